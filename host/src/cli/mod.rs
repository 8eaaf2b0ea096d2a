//! The command line: arguments as typed, what they mean, and what is printed.
//!
//! Human text on stdout, progress on stderr and only on a terminal, `--json` for machines. Exit status 0 done, 1 an
//! honest no, 2 an error told in one line.

use std::ffi::OsString;
use std::io::{self, Write};

use clap::error::ErrorKind;
use clap::{Parser, Subcommand};

pub mod calibrate;
pub mod demo;
pub mod execute;
mod input;
pub mod plan;
mod planning;
mod progress;
pub mod quality;
pub mod reconstruct;
pub mod scan;

/// How a command that ran ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// It did what was asked: exit status 0.
    Done,
    /// An honest no (no force closure, unreachable, slipped): exit status 1.
    No,
}

/// Grasps for objects that nobody has modelled: scan, reconstruct, plan, execute.
#[derive(Debug, Parser)]
#[command(name = "prehend", version, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// The whole story on the virtual cell: scan, reconstruct, plan, execute, report
    Demo(demo::DemoArgs),
    /// Marker pairs -> calibration of a scanner's camera, with its errors
    Calibrate(calibrate::CalibrateArgs),
    /// Laser-stripe scan of an object in the virtual cell -> cloud in the robot's base frame
    Scan(scan::ScanArgs),
    /// Point cloud -> triangle mesh, by Hoppe's method
    Reconstruct(reconstruct::ReconstructArgs),
    /// Mesh or cloud -> ranked force-closure grasps
    Plan(plan::PlanArgs),
    /// The grasp metric alone, for anybody's contacts
    Quality(quality::QualityArgs),
    /// Run a plan: approach, close, lift, watch for slip
    Execute(execute::ExecuteArgs),
}

/// Parses, runs, reports. Returns the exit status.
pub fn main(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    let cli = match Cli::try_parse_from(arguments) {
        Ok(cli) => cli,
        Err(error) => return usage(&error),
    };
    let mut out = io::stdout().lock();
    let result = run(cli.command, &mut out).and_then(|outcome| Ok(out.flush().map(|()| outcome)?));
    match result {
        Ok(Outcome::Done) => 0,
        Ok(Outcome::No) => 1,
        // Whoever reads from us has seen enough.
        Err(error) if is_broken_pipe(&error) => 0,
        Err(error) => {
            report(&format!("{error:#}"));
            2
        }
    }
}

fn run(command: Command, out: &mut dyn Write) -> anyhow::Result<Outcome> {
    match command {
        Command::Demo(args) => demo::run(&args, out),
        Command::Calibrate(args) => calibrate::run(&args, out),
        Command::Scan(args) => scan::run(&args, out),
        Command::Reconstruct(args) => reconstruct::run(&args, out),
        Command::Plan(args) => plan::run(&args, out),
        Command::Quality(args) => quality::run(&args, out),
        Command::Execute(args) => execute::run(&args, out),
    }
}

/// Help and version are printed whole; of a wrong call, the one line that says what is wrong.
fn usage(error: &clap::Error) -> u8 {
    if matches!(error.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion) {
        // Printing help to a closed pipe is no failure either.
        let _ = error.print();
        return 0;
    }
    if error.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand {
        let _ = error.print();
        return 2;
    }
    let text = error.to_string();
    let lines: Vec<&str> = text.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    // The first line, and what belongs to it when that ends in a colon (the missing arguments).
    let mut message = lines.first().copied().unwrap_or("wrong call").trim_start_matches("error: ").to_owned();
    if message.ends_with(':') {
        for line in lines.iter().skip(1).take_while(|line| !line.starts_with("Usage")) {
            message = format!("{message} {line}");
        }
    }
    report(&format!("{message} (see prehend --help)"));
    2
}

fn report(message: &str) {
    // One line, whatever the parts say. Nobody is left to tell when stderr is gone too.
    let line = message.split('\n').map(str::trim).collect::<Vec<_>>().join(" ");
    let _ = writeln!(io::stderr(), "error: {line}");
}

fn is_broken_pipe(error: &anyhow::Error) -> bool {
    error
        .chain()
        .filter_map(|cause| cause.downcast_ref::<io::Error>())
        .any(|cause| cause.kind() == io::ErrorKind::BrokenPipe)
}

/// Writes one JSON document and a line end.
fn write_json(out: &mut dyn Write, value: &impl serde::Serialize) -> anyhow::Result<()> {
    serde_json::to_writer_pretty(&mut *out, value)?;
    writeln!(out)?;
    Ok(())
}
