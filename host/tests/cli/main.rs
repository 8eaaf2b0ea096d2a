//! The `prehend` command as its users meet it: the real binary, files in a folder of their own, exit status.
#![allow(clippy::unwrap_used, clippy::panic, reason = "the helpers of these tests are tests themselves")]

mod colours;
mod doctor;
mod experiment;
mod export;
mod fixture;
mod hand_bus;
mod lifts;
mod meshes;
mod metric;
mod mount;
mod path;
mod recording;
mod schema;
mod shell;
mod solids;
mod streams;
mod tables;
mod view;
mod wrong_calls;
mod wrong_kinds;

use std::ffi::OsStr;
use std::path::Path;
use std::process::{Command, Stdio};

use serde_json::Value;

/// What a call of the binary left.
struct Ran {
    call: String,
    status: i32,
    stdout: Vec<u8>,
    stderr: String,
}

impl Ran {
    /// The one JSON document on standard output.
    fn json(&self) -> Value {
        serde_json::from_slice(&self.stdout).unwrap_or_else(|error| panic!("{}: {error}", self.call))
    }

    /// Checks the exit status; on another one, everything that was said is shown.
    #[track_caller]
    fn ends_with(self, status: i32) -> Self {
        let said = String::from_utf8_lossy(&self.stdout);
        assert_eq!(self.status, status, "{}\n{said}{}", self.call, self.stderr);
        self
    }
}

/// The binary in `folder`, with nothing on standard input and a backtrace for whatever panics.
fn command(folder: &Path, arguments: &[impl AsRef<OsStr>]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_prehend"));
    command.current_dir(folder).args(arguments).stdin(Stdio::null()).env("RUST_BACKTRACE", "1");
    // What whoever runs the tests likes in their own terminal.
    for name in ["NO_COLOR", "CLICOLOR", "CLICOLOR_FORCE", "CI"] {
        command.env_remove(name);
    }
    command
}

fn ran(mut command: Command) -> Ran {
    let output = command.output().unwrap();
    let call = format!("{command:?}");
    // No status means a signal: an abort, a stack overflow, out of memory.
    let status = output.status.code().unwrap_or_else(|| panic!("{call}: {}", output.status));
    Ran { call, status, stdout: output.stdout, stderr: String::from_utf8_lossy(&output.stderr).into_owned() }
}

/// Runs a call that is written as on a command line, without quoting.
fn prehend(folder: &Path, call: &str) -> Ran {
    ran(command(folder, &call.split_whitespace().collect::<Vec<_>>()))
}

/// The commands that the program says it has, each as it is typed: `plan`, `hand show`.
fn commands() -> Vec<String> {
    below("").into_iter().flat_map(|name| with_below(&name)).collect()
}

fn with_below(name: &str) -> Vec<String> {
    let below = below(name);
    if below.is_empty() { vec![name.to_owned()] } else { below }
}

/// What `--help` of a command lists under it.
fn below(name: &str) -> Vec<String> {
    let help = prehend(&std::env::temp_dir(), &format!("{name} --help")).ends_with(0);
    let text = String::from_utf8(help.stdout).unwrap();
    let listed =
        text.lines().skip_while(|line| *line != "Commands:").skip(1).take_while(|line| !line.is_empty());
    // A description that is wrapped is indented further than a name.
    let lines = listed.filter(|line| line.starts_with("  ") && !line.starts_with("   "));
    lines
        .map(|line| line.split_whitespace().next().unwrap())
        .filter(|word| *word != "help")
        .map(|word| format!("{name} {word}").trim().to_owned())
        .collect()
}

/// A number of a JSON document by the path to it; it must be there and be a number.
#[track_caller]
fn number(document: &Value, pointer: &str) -> f64 {
    let value = document.pointer(pointer).unwrap_or_else(|| panic!("no {pointer} in {document}"));
    value.as_f64().unwrap_or_else(|| panic!("{pointer} is {value}"))
}
