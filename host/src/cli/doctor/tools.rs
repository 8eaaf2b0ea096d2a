//! Toolchain, emulator, probe, and the browser and Python of the tests: asked for their versions, on the search path as the other commands use them.

use std::io;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use super::Purpose::{Firmware, Test};
use super::{Finding, Lack, Purpose};
use crate::link::emulator::qemu::{Running, drain};

/// Time in which a tool says its version.
const PATIENCE: Duration = Duration::from_secs(10);

/// The oldest compiler that the workspace builds with.
const MIN_RUST: &str = env!("CARGO_PKG_RUST_VERSION");

/// The oldest QEMU that the firmware is run with.
const MIN_QEMU: &str = "7.2";

/// The machine that QEMU must know.
const MACHINE: &str = "mps2-an386";

/// Target of the firmware for QEMU and the STM32G474.
const TARGET: &str = "thumbv7em-none-eabihf";

/// Target of the firmware for the STM32H563.
const TARGET_V8M: &str = "thumbv8m.main-none-eabihf";

const BUILD: &[Purpose] = &[Firmware, Test];

const INSTALL_RUST: &str = "install Rust by rustup (https://rustup.rs)";
const INSTALL_BROWSER: &str = "apt-get install chromium chromium-driver (Debian), or your system's packages";
const INSTALL_PYTHON: &str =
    "apt-get install python3 python3-venv (Debian, Ubuntu), or your system's packages";
const INSTALL_QEMU: &str = "apt-get install qemu-system-arm (Debian, Ubuntu), brew install qemu (macOS)";

/// What a tool answered.
enum Answer {
    /// What it printed on standard output.
    Said(String),
    /// It ended with another status than 0.
    Failed(String),
    NotFound,
    /// It was found and cannot be run, or does not end.
    Broken(String),
}

impl Answer {
    /// The text, or what is lacking, with what to do when the tool is not there, or not in order.
    fn or_lack(self, install: &str) -> Result<String, Lack> {
        match self {
            Self::Said(text) => Ok(text),
            Self::NotFound => Err(Lack::new("not found", install)),
            Self::Failed(why) | Self::Broken(why) => Err(Lack::new(why, install)),
        }
    }
}

pub(super) fn findings() -> Vec<Finding> {
    let rustup = ask("rustup", &["--version"]).or_lack(INSTALL_RUST).and_then(first_line);
    let add = |what: &str| match rustup {
        Ok(_) => format!("rustup {what}"),
        Err(_) => format!("{INSTALL_RUST}, then rustup {what}; or your system's package"),
    };
    let rustc = ask("rustc", &["--version"]).or_lack(INSTALL_RUST);
    let update = if rustup.is_ok() { "rustup update stable" } else { INSTALL_RUST };
    let cargo = ask("cargo", &["--version"]).or_lack(INSTALL_RUST).and_then(first_line);
    let [target, target_v8m] =
        [TARGET, TARGET_V8M].map(|name| target(name, &add(&format!("target add {name}"))));
    let component = |program: &str, name: &str| {
        let answer = ask("cargo", &[program, "--version"]);
        answer.or_lack(&add(&format!("component add {name}"))).and_then(first_line)
    };
    let [rustfmt, clippy] = [component("fmt", "rustfmt"), component("clippy", "clippy")];
    let qemu = ask("qemu-system-arm", &["--version"]).or_lack(INSTALL_QEMU);
    let machine = ask("qemu-system-arm", &["-machine", "help"]).or_lack(INSTALL_QEMU).and_then(knows_machine);
    let [browser, driver] = ["chromium", "chromedriver"]
        .map(|program| ask(program, &["--version"]).or_lack(INSTALL_BROWSER).and_then(first_line));
    // Without this module it cannot make an environment.
    let python = ask("python3", &["-c", "import ensurepip, sys; print('Python', sys.version.split()[0])"]);
    let python = python.or_lack(INSTALL_PYTHON).and_then(first_line);
    let probe_rs = ask("probe-rs", &["--version"]);
    let probe_rs = probe_rs.or_lack("cargo install probe-rs-tools, to flash a board").and_then(first_line);
    vec![
        Finding::new("rustc", BUILD, rustc.and_then(|text| at_least(&text, MIN_RUST, update))),
        Finding::new("cargo", BUILD, cargo),
        Finding::new("rustfmt", &[Test], rustfmt),
        Finding::new("clippy", &[Test], clippy),
        Finding::new(TARGET, BUILD, target),
        Finding::new(TARGET_V8M, BUILD, target_v8m),
        Finding::new("qemu-system-arm", BUILD, qemu.and_then(|text| at_least(&text, MIN_QEMU, INSTALL_QEMU))),
        Finding::new(format!("machine {MACHINE}"), BUILD, machine),
        Finding::new("chromium", &[Test], browser),
        Finding::new("chromedriver", &[Test], driver),
        Finding::new("python3", &[Test], python),
        Finding::new("rustup", &[], rustup),
        Finding::new("probe-rs", &[], probe_rs),
    ]
}

/// Runs a tool.
fn ask(program: &str, arguments: &[&str]) -> Answer {
    let mut command = Command::new(program);
    // rustup's stand-ins would fetch a toolchain that is missing; a doctor only looks.
    command.args(arguments).env("RUSTUP_AUTO_INSTALL", "0");
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut running = match command.spawn() {
        Ok(child) => Running(child),
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Answer::NotFound,
        Err(error) => return Answer::Broken(format!("cannot be run ({error})")),
    };
    let [stdout, stderr] = [drain(running.0.stdout.take()), drain(running.0.stderr.take())];
    let (Ok(Ok(said)), Ok(Ok(complaint))) = (stdout.recv_timeout(PATIENCE), stderr.recv_timeout(PATIENCE))
    else {
        return Answer::Broken(format!("does not answer within {} s", PATIENCE.as_secs()));
    };
    match running.0.wait() {
        Ok(status) if status.success() => Answer::Said(said),
        Ok(status) => {
            let why = complaint.lines().map(str::trim).find(|line| !line.is_empty()).unwrap_or("");
            Answer::Failed(format!("ends with {status} {why}").trim().to_owned())
        }
        Err(error) => Answer::Broken(error.to_string()),
    }
}

fn first_line(text: String) -> Result<String, Lack> {
    Ok(text.lines().next().unwrap_or("").trim().to_owned())
}

/// The first version number in a text, as numbers.
fn version(text: &str) -> Option<Vec<u32>> {
    text.split_whitespace().find_map(|word| {
        // Versions of nightly compilers end in a word.
        let word = word.split('-').next().unwrap_or(word);
        let numbers: Option<Vec<u32>> = word.split('.').map(|part| part.parse().ok()).collect();
        numbers.filter(|numbers| numbers.len() >= 2)
    })
}

/// The line of the version if it is that or a later one.
fn at_least(text: &str, least: &str, update: &str) -> Result<String, Lack> {
    let line = text.lines().next().unwrap_or("").trim();
    match version(line) {
        None => Err(Lack::new(format!("tells no version ({line:?})"), update)),
        found if found >= version(least) => Ok(line.to_owned()),
        Some(_) => Err(Lack::new(format!("{line}, {least} or later is needed"), update)),
    }
}

/// Whether the libraries of a target are installed.
fn target(name: &str, add: &str) -> Result<String, Lack> {
    let folder = ask("rustc", &["--print", "target-libdir", "--target", name]).or_lack(add)?;
    let folder = folder.trim();
    if !folder.is_empty() && Path::new(folder).is_dir() {
        Ok("installed".to_owned())
    } else {
        Err(Lack::new("not installed", add))
    }
}

fn knows_machine(list: String) -> Result<String, Lack> {
    if list.lines().any(|line| line.split_whitespace().next() == Some(MACHINE)) {
        Ok("known to QEMU".to_owned())
    } else {
        Err(Lack::new("not known to QEMU", INSTALL_QEMU))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_are_compared_by_numbers() {
        let qemu = "QEMU emulator version 7.2.0 (Debian 1:7.2+dfsg-7)\nCopyright (c) 2003-2022";
        assert_eq!(version(qemu), Some(vec![7, 2, 0]));
        assert_eq!(version("rustc 1.93.0-nightly (0123abc 2026-01-01)"), Some(vec![1, 93, 0]));
        assert_eq!(version("no number here 2"), None);
        assert!(at_least("QEMU emulator version 10.0.2", "7.2", "").is_ok());
        assert!(at_least("QEMU emulator version 7.10", "7.2", "").is_ok());
        let old = at_least("QEMU emulator version 6.2.0", "7.2", "get a new one").unwrap_err();
        assert_eq!(old.found, "QEMU emulator version 6.2.0, 7.2 or later is needed");
        assert_eq!(old.next, "get a new one");
        assert!(at_least("", "7.2", "").is_err());
        assert!(version(MIN_RUST).is_some() && version(MIN_QEMU).is_some());
    }
}
