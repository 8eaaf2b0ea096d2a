//! `prehend man`: manual pages, one a command.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use clap::Args;
use clap::builder::Resettable;
use roff::{Roff, roman};
use sha2::{Digest, Sha256};

use super::{Outcome, definition, input};
use crate::io::write_atomically;

/// Begins the last line of a page. The hash of all lines above it follows, so that a page that somebody has changed is
/// told from one that is as it was written.
const SEAL: &str = ".\\\" written by prehend man, SHA-256 ";

/// Write manual pages, one a command
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Pages that an earlier version wrote are replaced. What else is there under their names is left alone, and then no page is written.\n\nExamples:\n  prehend man pages\n  prehend man ~/.local/share/man/man1"
)]
pub struct ManArgs {
    /// Folder to write into, made if it is not there; `man` looks into those called man1
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
}

/// Runs the command.
pub fn run(args: &ManArgs, out: &mut dyn Write) -> anyhow::Result<Outcome> {
    let mut pages = Vec::new();
    collect(&definition(), &mut pages)?;
    input::make_folder(&args.folder)?;
    // All of them are looked at before any is written.
    let mut missing = Vec::new();
    for (name, page) in &pages {
        let path = args.folder.join(name);
        if !holds(&path, page)? {
            missing.push((path, page));
        }
    }
    for (path, page) in &missing {
        write_atomically(path, |writer| writer.write_all(page.as_bytes()))?;
    }
    let folder = &args.folder;
    writeln!(out, "wrote {} of {} pages into {}", missing.len(), pages.len(), folder.display())?;
    writeln!(out, "to read one: man -l {}", folder.join("prehend.1").display())?;
    Ok(Outcome::Done)
}

/// Whether a file holds the page already. Errs when it holds what `prehend man` did not write.
fn holds(path: &Path, page: &str) -> anyhow::Result<bool> {
    let name = || path.display().to_string();
    let found = match fs::symlink_metadata(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(false),
        found => found.with_context(name)?,
    };
    let held = if found.is_file() { fs::read(path).with_context(name)? } else { Vec::new() };
    ensure!(
        held == page.as_bytes() || is_sealed(&held),
        "{}: is there already and not as prehend man wrote it: move it away, or name another folder",
        path.display()
    );
    Ok(held == page.as_bytes())
}

/// Whether somebody's bytes are a page as some version of this program wrote it.
fn is_sealed(bytes: &[u8]) -> bool {
    let text = String::from_utf8_lossy(bytes);
    text.rfind(SEAL).is_some_and(|at| sealed(text[..at].to_owned()) == text)
}

fn sealed(mut page: String) -> String {
    let hash: String = Sha256::digest(page.as_bytes()).iter().map(|byte| format!("{byte:02x}")).collect();
    page.push_str(SEAL);
    page.push_str(&hash);
    page.push('\n');
    page
}

/// The pages of a command and all below it, by their files' names.
fn collect(command: &clap::Command, pages: &mut Vec<(String, String)>) -> io::Result<()> {
    let name = command.get_display_name().unwrap_or_else(|| command.get_name());
    let notes = command.get_after_help().map(ToString::to_string).unwrap_or_default();
    let page = clap_mangen::Man::new(command.clone().after_help(Resettable::Reset))
        .title(name)
        .source(concat!("prehend ", env!("CARGO_PKG_VERSION")))
        .manual("Prehend");
    let mut bytes = Vec::new();
    page.render(&mut bytes)?;
    bytes.extend(extra(&notes).to_roff().into_bytes());
    pages.push((format!("{name}.1"), sealed(String::from_utf8_lossy(&bytes).into_owned())));
    command.get_subcommands().try_for_each(|below| collect(below, pages))
}

/// What stands under the options in `--help`: notes, then examples, whose lines stay lines.
fn extra(notes: &str) -> Roff {
    let (notes, examples) = notes.split_once("Examples:\n").unwrap_or((notes, ""));
    let mut roff = Roff::new();
    if !notes.trim().is_empty() {
        roff.control("SH", ["NOTES"]);
        for paragraph in notes.split("\n\n").filter(|paragraph| !paragraph.trim().is_empty()) {
            roff.control("PP", []).text([roman(paragraph.trim())]);
        }
    }
    if !examples.is_empty() {
        roff.control("SH", ["EXAMPLES"]).control("nf", []);
        for line in examples.lines() {
            roff.text([roman(line.trim())]);
        }
        roff.control("fi", []);
    }
    roff
}
