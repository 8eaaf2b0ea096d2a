//! `prehend completions`: what a shell needs to complete commands and options.

use std::io::Write;

use clap::Args;
use clap_complete::Shell;

use super::{Outcome, definition};

/// Print the completion of commands and options for a shell
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Put the text where the shell looks for it, and open a new shell.\n\nExamples:\n  prehend completions bash > ~/.local/share/bash-completion/completions/prehend\n  prehend completions zsh > ~/.zfunc/_prehend\n  prehend completions fish > ~/.config/fish/completions/prehend.fish"
)]
pub struct CompletionsArgs {
    /// The shell
    #[arg(value_name = "SHELL")]
    pub shell: Shell,
}

/// Runs the command.
pub fn run(args: &CompletionsArgs, out: &mut dyn Write) -> anyhow::Result<Outcome> {
    let mut definition = definition();
    let name = definition.get_name().to_owned();
    // By way of memory: the generator panics when its writer fails, as a closed pipe does.
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut definition, name, &mut script);
    out.write_all(&script)?;
    Ok(Outcome::Done)
}
