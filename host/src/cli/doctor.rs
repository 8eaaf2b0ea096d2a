//! `prehend doctor`: what this machine has of what Prehend needs, and what to do about the rest.

use std::io::Write;
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use serde::Serialize;
use serde_json::json;

use super::{Outcome, colour, write_json};

mod machine;
mod serial;
mod tools;

/// Check toolchain, emulator, serial devices and machine, and say what is missing
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Exit status 1 when something is missing that is needed for what was asked; what else is absent is a warning. Nothing is installed, and no device is opened.\n\nExamples:\n  prehend doctor\n  prehend doctor --for hand --device /dev/ttyUSB0\n  prehend doctor --for firmware --for test --json"
)]
pub struct DoctorArgs {
    /// What the machine shall be fit for; may be given several times
    #[arg(long = "for", value_enum, value_name = "PURPOSE", default_value = "plan")]
    pub purposes: Vec<Purpose>,
    /// Serial device to look at, instead of those that are found; may be given several times
    #[arg(long, value_name = "PATH")]
    pub device: Vec<PathBuf>,
    /// Print one JSON document on standard output
    #[arg(long)]
    pub json: bool,
}

/// What a machine may be used for, `--for`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Purpose {
    /// Scan, reconstruct, plan and execute on the virtual cell: prehend alone
    Plan,
    /// Talk to a hand at the end of a serial line
    Hand,
    /// Build the firmware and run it in QEMU, as `--link qemu` does
    Firmware,
    /// Run every check of the source tree
    Test,
}

/// What was looked at.
#[derive(Debug, Clone, PartialEq)]
struct Finding {
    name: String,
    needed_for: &'static [Purpose],
    /// What there is.
    found: Result<String, Lack>,
}

/// What there is instead of what is needed.
#[derive(Debug, Clone, PartialEq)]
struct Lack {
    found: String,
    /// What to do, in one line.
    next: String,
}

/// How a finding is judged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
enum Status {
    Ok,
    /// Lacking, and needed for what was asked.
    Missing,
    /// Lacking, but not needed for what was asked.
    Warning,
}

impl Finding {
    fn new(name: impl Into<String>, needed_for: &'static [Purpose], found: Result<String, Lack>) -> Self {
        Self { name: name.into(), needed_for, found }
    }

    fn status(&self, purposes: &[Purpose]) -> Status {
        match &self.found {
            Ok(_) => Status::Ok,
            Err(_) if self.needed_for.iter().any(|need| purposes.contains(need)) => Status::Missing,
            Err(_) => Status::Warning,
        }
    }
}

impl Lack {
    fn new(found: impl Into<String>, next: impl Into<String>) -> Self {
        Self { found: found.into(), next: next.into() }
    }
}

/// Runs the command.
pub fn run(args: &DoctorArgs, out: &mut dyn Write) -> anyhow::Result<Outcome> {
    let mut findings = machine::findings();
    findings.extend(tools::findings());
    findings.push(serial::finding(&args.device));
    let judged: Vec<(Status, &Finding)> =
        findings.iter().map(|finding| (finding.status(&args.purposes), finding)).collect();
    let missing = judged.iter().filter(|(status, _)| *status == Status::Missing).count();
    if args.json {
        let checks = judged.iter().map(|(status, finding)| {
            let (found, next) = match &finding.found {
                Ok(found) => (found, None),
                Err(lack) => (&lack.found, Some(&lack.next)),
            };
            json!({
                "name": finding.name,
                "status": status,
                "needed_for": finding.needed_for,
                "found": found,
                "next": next,
            })
        });
        let checks: Vec<_> = checks.collect();
        write_json(out, &json!({ "for": args.purposes, "missing": missing, "checks": checks }))?;
    } else {
        table(&judged, out)?;
        let purposes: Vec<String> = args.purposes.iter().map(|purpose| name(*purpose)).collect();
        let purposes = purposes.join(", ");
        match missing {
            0 => writeln!(out, "nothing is missing for: {purposes}")?,
            n => writeln!(out, "{n} missing for: {purposes}")?,
        }
    }
    Ok(if missing == 0 { Outcome::Done } else { Outcome::No })
}

fn table(judged: &[(Status, &Finding)], out: &mut dyn Write) -> std::io::Result<()> {
    let width = judged.iter().map(|(_, finding)| finding.name.len()).max().unwrap_or(0);
    for (status, Finding { name, found, .. }) in judged {
        // Padded before it is styled: styles have a width of their own to the formatter.
        let word = match status {
            Status::Ok => colour::on_stdout(format_args!("{:<8}", "ok"), colour::GOOD),
            Status::Missing => colour::on_stdout(format_args!("{:<8}", "missing"), colour::BAD),
            Status::Warning => colour::on_stdout(format_args!("{:<8}", "warning"), colour::DOUBTFUL),
        };
        match found {
            Ok(found) => writeln!(out, "{word} {name:<width$}  {found}")?,
            Err(Lack { found, next }) => writeln!(out, "{word} {name:<width$}  {found}: {next}")?,
        }
    }
    Ok(())
}

/// The purpose's word, as typed.
fn name(purpose: Purpose) -> String {
    purpose.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
}
