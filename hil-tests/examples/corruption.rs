//! `cargo run --release -p hil-tests --example corruption [FRAMES]` damages ten million frames, or as many as asked.

use std::process::ExitCode;

use hil_tests::corruption::campaign;

fn main() -> ExitCode {
    let count = match std::env::args().nth(1).map(|text| text.parse()) {
        None => 10_000_000,
        Some(Ok(count)) => count,
        Some(Err(error)) => {
            eprintln!("the number of frames: {error}");
            return ExitCode::from(2);
        }
    };
    let outcome = campaign(1, count);
    println!(
        "tried {}, accepted {}, resynchronised {}",
        outcome.tried, outcome.accepted, outcome.resynchronised
    );
    ExitCode::from(u8::from(outcome.accepted > 0 || outcome.resynchronised < outcome.tried))
}
