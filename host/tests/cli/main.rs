//! The `prehend` command as its users meet it: the real binary, files in a folder of their own, exit status.
#![allow(clippy::unwrap_used, clippy::panic, reason = "the helpers of these tests are tests themselves")]

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
mod solids;
mod streams;
mod tables;
mod wrong_calls;

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
fn command(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_prehend"));
    command.current_dir(folder).args(arguments).stdin(Stdio::null()).env("RUST_BACKTRACE", "1");
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

/// A number of a JSON document by the path to it; it must be there and be a number.
#[track_caller]
fn number(document: &Value, pointer: &str) -> f64 {
    let value = document.pointer(pointer).unwrap_or_else(|| panic!("no {pointer} in {document}"));
    value.as_f64().unwrap_or_else(|| panic!("{pointer} is {value}"))
}
