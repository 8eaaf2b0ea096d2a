//! Colours of what is printed: as clap's, on terminals that have them, unless `NO_COLOR` or `TERM=dumb` says no;
//! `CLICOLOR_FORCE` has them everywhere.

use std::env;
use std::fmt::Display;
use std::io::{self, IsTerminal};

use anstream::{AutoStream, ColorChoice};
use anstyle::{AnsiColor, Style};

/// What is in order.
pub(super) const GOOD: Style = AnsiColor::Green.on_default().bold();
/// What may be looked at.
pub(super) const DOUBTFUL: Style = AnsiColor::Yellow.on_default().bold();
/// What stops the work.
pub(super) const BAD: Style = AnsiColor::Red.on_default().bold();

/// A text in a style, for a writer that takes styles out where they are not wanted.
pub(super) fn styled(text: impl Display, style: Style) -> String {
    format!("{style}{text}{style:#}")
}

/// A text for standard output, in a style where that is wanted. Standard output itself takes nothing out: clouds and
/// meshes are written to it too.
pub(super) fn on_stdout(text: impl Display, style: Style) -> String {
    if is_wanted_on_stdout() { styled(text, style) } else { text.to_string() }
}

/// Whether standard output has colours.
pub(super) fn is_wanted_on_stdout() -> bool {
    matches!(AutoStream::auto(io::stdout()).current_choice(), ColorChoice::AlwaysAnsi | ColorChoice::Always)
}

/// Whether standard output has colours, and why not, in words.
pub(super) fn on_stdout_in_words() -> &'static str {
    let is_set = |name: &str| env::var_os(name).is_some_and(|value| !value.is_empty());
    match is_wanted_on_stdout() {
        true if !io::stdout().is_terminal() => "yes: CLICOLOR_FORCE is set",
        true => "yes",
        false if is_set("NO_COLOR") => "no: NO_COLOR is set",
        false if !io::stdout().is_terminal() => "no: standard output is no terminal",
        false => "no: TERM or CLICOLOR says that the terminal has none",
    }
}
