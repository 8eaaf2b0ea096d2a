//! The command line: arguments as typed, what they mean, and what is printed.
//!
//! Human text on stdout, progress on stderr and only on a terminal, `--json` for machines. Exit status 0 done, 1 an
//! honest no, 2 an error told in one line.

use std::ffi::OsString;
use std::io::{self, Write};
use std::path::Path;

use clap::error::ErrorKind;
use clap::{CommandFactory, Parser, Subcommand};

use crate::io::write_atomically;
use crate::link::address::OpenError;
use crate::link::port::PortError;

pub mod calibrate;
pub mod calibrate_mount;
mod calibrate_mount_virtual;
mod colour;
pub mod completions;
pub mod demo;
pub mod doctor;
pub mod execute;
pub mod experiment;
pub mod export;
pub mod hand;
pub mod hand_bus;
pub mod hand_file;
mod input;
pub mod man;
mod pipeline;
pub mod plan;
mod planning;
mod progress;
pub mod quality;
pub mod reconstruct;
mod remote;
pub mod scan;
mod scan_images;
pub mod serve;
mod simulated;
pub mod view;

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
    /// Scans of a ball -> where the scanner sits on the palm, with how well that is known
    CalibrateMount(calibrate_mount::CalibrateMountArgs),
    /// Laser-stripe scan of an object in the virtual cell -> cloud in the robot's base frame
    Scan(scan::ScanArgs),
    /// Point cloud -> triangle mesh, by Hoppe's method
    Reconstruct(reconstruct::ReconstructArgs),
    /// Mesh or cloud -> ranked force-closure grasps
    Plan(plan::PlanArgs),
    /// The planner as a service: HTTP, progress as events
    Serve(serve::ServeArgs),
    /// The grasp metric alone, for anybody's contacts
    Quality(quality::QualityArgs),
    /// Run a plan: approach, close, lift, watch for slip
    Execute(execute::ExecuteArgs),
    /// The paper's experiment on the virtual cell: many trials from scan to put-down, as a table
    Experiment(experiment::ExperimentArgs),
    /// A plan as one page for a browser: scene, grasps, quality, execution
    View(view::ViewArgs),
    /// A plan's grasps, scene or robot for another program: Isaac, MoveIt, URDF, MuJoCo, Inventor
    Export(export::ExportArgs),
    /// A hand: what a robot description says of it, or bring-up of one at the end of a line
    Hand(hand::HandCommandArgs),
    /// What this machine has of what prehend needs, and what to do about the rest
    Doctor(doctor::DoctorArgs),
    /// Completion of commands and options, for a shell
    Completions(completions::CompletionsArgs),
    /// Manual pages, one a command
    Man(man::ManArgs),
}

/// The whole command line, as completions and manual pages describe it.
fn definition() -> clap::Command {
    // Without `help COMMAND`: it would be described once more for every command.
    let mut definition = Cli::command().disable_help_subcommand(true);
    definition.build();
    definition
}

/// Parses, runs, reports. Returns the exit status.
pub fn main(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    let arguments: Vec<OsString> = arguments.into_iter().collect();
    let cli = match Cli::try_parse_from(&arguments) {
        Ok(cli) => cli,
        Err(error) => return usage(&error, &arguments),
    };
    let mut out = StandardOutput(io::stdout().lock());
    let result = run(cli.command, &mut out).and_then(|outcome| Ok(out.flush().map(|()| outcome)?));
    match result {
        Ok(Outcome::Done) => 0,
        Ok(Outcome::No) => 1,
        // Whoever reads from us has seen enough.
        Err(error) if is_broken_pipe(&error) => 0,
        Err(error) => {
            let next = next_step(&error).map_or_else(String::new, |next| format!(" ({next})"));
            report(&(chain(&error) + &next));
            2
        }
    }
}

fn run(command: Command, out: &mut dyn Write) -> anyhow::Result<Outcome> {
    match command {
        Command::Demo(args) => demo::run(&args, out),
        Command::Calibrate(args) => calibrate::run(&args, out),
        Command::CalibrateMount(args) => calibrate_mount::run(&args, out),
        Command::Scan(args) => scan::run(&args, out),
        Command::Reconstruct(args) => reconstruct::run(&args, out),
        Command::Plan(args) => plan::run(&args, out),
        Command::Serve(args) => serve::run(&args, out),
        Command::Quality(args) => quality::run(&args, out),
        Command::Execute(args) => execute::run(&args, out),
        Command::Experiment(args) => experiment::run(&args, out),
        Command::View(args) => view::run(&args, out),
        Command::Export(args) => export::run(&args, out),
        Command::Hand(args) => hand::run(&args, out),
        Command::Doctor(args) => doctor::run(&args, out),
        Command::Completions(args) => completions::run(&args, out),
        Command::Man(args) => man::run(&args, out),
    }
}

/// Help and version are printed whole; of a wrong call, the one line that says what is wrong.
fn usage(error: &clap::Error, arguments: &[OsString]) -> u8 {
    if matches!(error.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion) {
        // Printing help to a closed pipe is no failure either.
        let _ = error.print();
        return 0;
    }
    if error.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand {
        let _ = error.print();
        return 2;
    }
    report(&format!("{} (see {} --help)", told(error), command_of(arguments)));
    2
}

/// What is wrong with a call, in one line.
fn told(error: &clap::Error) -> String {
    let text = error.to_string();
    let lines: Vec<&str> = text.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    // The first line, and what belongs to it: the words that would do, or the arguments that are missing.
    let mut message = lines.first().copied().unwrap_or("wrong call").trim_start_matches("error: ").to_owned();
    if message.ends_with(':') {
        for line in lines.iter().skip(1).take_while(|line| !line.starts_with("Usage")) {
            message = format!("{message} {line}");
        }
    } else if let Some(words) = lines.get(1).filter(|line| line.starts_with("[possible values")) {
        message = format!("{message} {words}");
    }
    message
}

/// The command that was called, as far as its words are known: `prehend hand show`.
fn command_of(arguments: &[OsString]) -> String {
    let definition = definition();
    let mut command = &definition;
    let mut name = command.get_name().to_owned();
    for word in arguments.iter().skip(1) {
        let Some(below) = command.find_subcommand(word) else { break };
        command = below;
        name = format!("{name} {}", below.get_name());
    }
    name
}

/// What to do about an error that does not say so itself: those of lines, where the system says only what it met.
fn next_step(error: &anyhow::Error) -> Option<&'static str> {
    let open = error.downcast_ref::<OpenError>()?;
    let OpenError::Port(PortError::Open { source, .. }) = open else { return None };
    Some(match source.kind() {
        io::ErrorKind::NotFound | io::ErrorKind::PermissionDenied => {
            "see prehend doctor --for hand: which devices there are, and which you may open"
        }
        io::ErrorKind::ConnectionRefused | io::ErrorKind::TimedOut => {
            "is the hand's bridge switched on, and is this its port?"
        }
        _ => "see prehend hand --help for what --link takes",
    })
}

fn report(message: &str) {
    // One line, whatever the parts say. Nobody is left to tell when stderr is gone too.
    let line = message.split('\n').map(str::trim).collect::<Vec<_>>().join(" ");
    let _ = writeln!(anstream::stderr(), "{} {line}", colour::styled("error:", colour::BAD));
}

/// Standard output whose errors say that it is the one that failed, as those of files do.
struct StandardOutput(io::StdoutLock<'static>);

impl StandardOutput {
    fn named<T>(result: io::Result<T>) -> io::Result<T> {
        result.map_err(|error| io::Error::new(error.kind(), format!("standard output: {error}")))
    }
}

impl Write for StandardOutput {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        Self::named(self.0.write(bytes))
    }

    fn flush(&mut self) -> io::Result<()> {
        Self::named(self.0.flush())
    }
}

/// An error and its causes. Some errors tell their cause in their own words: it is not told again.
fn chain(error: &anyhow::Error) -> String {
    let mut text = error.to_string();
    for cause in error.chain().skip(1).map(ToString::to_string) {
        if !text.ends_with(&cause) {
            text = format!("{text}: {cause}");
        }
    }
    text
}

fn is_broken_pipe(error: &anyhow::Error) -> bool {
    error.chain().any(|cause| {
        let of_system = cause.downcast_ref::<io::Error>().map(io::Error::kind);
        // serde_json does not show the system's error as the cause of its own.
        let of_json = cause.downcast_ref::<serde_json::Error>().and_then(serde_json::Error::io_error_kind);
        of_system.or(of_json) == Some(io::ErrorKind::BrokenPipe)
    })
}

/// Writes one JSON document and a line end into a file.
fn write_json_file(path: &Path, value: &impl serde::Serialize) -> anyhow::Result<()> {
    Ok(write_atomically(path, |writer| {
        serde_json::to_writer_pretty(&mut *writer, value)?;
        writeln!(writer)
    })?)
}

/// Writes one JSON document and a line end.
fn write_json(out: &mut dyn Write, value: &impl serde::Serialize) -> anyhow::Result<()> {
    // By way of a string: an error of the writer inside serde_json's hides a broken pipe.
    writeln!(out, "{}", serde_json::to_string_pretty(value)?)?;
    Ok(())
}
