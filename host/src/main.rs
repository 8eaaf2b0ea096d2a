//! The `prehend` command: parse, run, exit status.

use std::process::ExitCode;

fn main() -> ExitCode {
    ExitCode::from(host::cli::main(std::env::args_os()))
}
