//! `cargo run --release -p hil-tests --bin figures [-- --json]` prints what the firmware image costs, how large the images of
//! the other boards are, and how frames stand damage.

use std::process::ExitCode;

use hil_tests::corruption::{self, Outcome};
use hil_tests::figures::{self, Figures};
use host::link::emulator::image;
use serde::Serialize;

/// Damaged frames.
const FRAMES: u64 = 10_000_000;

/// Everything, as it is printed.
#[derive(Serialize)]
struct Report {
    #[serde(flatten)]
    figures: Figures,
    stm32g474_flash_bytes: u64,
    stm32g474_ram_bytes: u64,
    stm32h563_flash_bytes: u64,
    stm32h563_ram_bytes: u64,
    corrupted_tried: u64,
    corrupted_accepted: u64,
    resynchronised: u64,
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let json = match arguments.as_slice() {
        [] => false,
        [only] if only == "--json" => true,
        _ => {
            eprintln!("error: usage: figures [--json]");
            return ExitCode::from(2);
        }
    };
    match report() {
        Ok(report) => print(&report, json),
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}

fn report() -> Result<Report, Box<dyn std::error::Error>> {
    let figures = figures::measure(&image::build("mps2-an386")?)?;
    let [stm32g474_flash_bytes, stm32g474_ram_bytes] = figures::elf_bytes(&image::build("stm32g474")?)?;
    let [stm32h563_flash_bytes, stm32h563_ram_bytes] = figures::elf_bytes(&image::build("stm32h563")?)?;
    let Outcome { tried, accepted, resynchronised } = corruption::campaign(1, FRAMES);
    Ok(Report {
        figures,
        stm32g474_flash_bytes,
        stm32g474_ram_bytes,
        stm32h563_flash_bytes,
        stm32h563_ram_bytes,
        corrupted_tried: tried,
        corrupted_accepted: accepted,
        resynchronised,
    })
}

fn print(report: &Report, json: bool) -> ExitCode {
    let Ok(serde_json::Value::Object(fields)) = serde_json::to_value(report) else {
        return ExitCode::from(2);
    };
    if json {
        println!("{}", serde_json::Value::Object(fields));
    } else {
        for (name, number) in &fields {
            println!("{name:<30} {number:>10}");
        }
    }
    ExitCode::SUCCESS
}
