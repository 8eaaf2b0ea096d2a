//! `prehend doctor` with a search path of tools that are made up.

use std::fs;
use std::os::fd::AsRawFd;
use std::path::Path;
use std::process::Command;

use serde_json::Value;
use serial2::SerialPort;
use tempfile::TempDir;

use crate::{Ran, command, prehend, ran};

/// Writes a tool. By a process of its own: were the file open for writing here, a process that another test starts at
/// this moment would keep it open, and it could not be run.
fn tool(folder: &Path, name: &str, script: &str) {
    let script = format!("#!/bin/sh\n{script}\n");
    let write = r#"printf '%s' "$2" > "$1" && chmod +x "$1""#;
    let status =
        Command::new("/bin/sh").args(["-c", write, "sh"]).arg(folder.join(name)).arg(script).status();
    assert!(status.unwrap().success());
}

/// Tools as they should be, without rustup and probe-rs.
fn tools() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let libraries = path.join("libraries");
    fs::create_dir(&libraries).unwrap();
    tool(
        path,
        "rustc",
        &format!(
            r#"case $1 in --version) echo 'rustc 9.9.9 (x)';; *) echo '{}';; esac"#,
            libraries.display()
        ),
    );
    tool(path, "cargo", "echo cargo 9.9.9");
    qemu(path, "7.2.0 (Debian)", "mps2-an386");
    for name in ["chromium", "chromedriver", "python3"] {
        tool(path, name, &format!("echo {name} 9.9"));
    }
    folder
}

fn qemu(folder: &Path, version: &str, machine: &str) {
    let answer = format!(
        "case $1 in --version) echo 'QEMU emulator version {version}';; *) echo '{machine}  Arm board';; esac"
    );
    tool(folder, "qemu-system-arm", &answer);
}

fn doctor(path: &Path, words: &str) -> Ran {
    let words = format!("doctor {words} --json");
    let mut command = command(path, &words.split_whitespace().collect::<Vec<_>>());
    command.env("PATH", path);
    ran(command)
}

fn check(document: &Value, name: &str) -> Value {
    let checks = document["checks"].as_array().unwrap();
    checks.iter().find(|check| check["name"] == name).unwrap_or_else(|| panic!("{name}: {document}")).clone()
}

#[test]
fn a_fit_machine_is_fit_without_what_is_only_handy() {
    let tools = tools();
    let said = doctor(tools.path(), "--for test --for firmware").ends_with(0).json();
    for name in ["rustc", "cargo", "rustfmt", "clippy", "thumbv7em-none-eabihf", "qemu-system-arm"] {
        assert_eq!(
            (&check(&said, name)["status"], &check(&said, name)["next"]),
            (&"ok".into(), &Value::Null)
        );
    }
    for name in ["rustup", "probe-rs"] {
        assert_eq!(check(&said, name)["status"], "warning");
        assert!(check(&said, name)["next"].as_str().unwrap().contains("install"));
    }
    assert_eq!((&said["missing"], &said["for"]), (&0.into(), &serde_json::json!(["test", "firmware"])));
}

#[test]
fn nothing_on_the_search_path_is_no_matter_for_planning() {
    let empty = tempfile::tempdir().unwrap();
    let plan = doctor(empty.path(), "").ends_with(0).json();
    assert_eq!(check(&plan, "rustc")["status"], "warning");
    // For the tests also rustfmt, clippy, browser, driver and Python.
    assert_eq!(doctor(empty.path(), "--for test").ends_with(1).json()["missing"], 11);
    let firmware = doctor(empty.path(), "--for firmware").ends_with(1).json();
    // rustc, cargo, the two targets, QEMU and its machine.
    assert_eq!(firmware["missing"], 6);
    assert_eq!(check(&firmware, "rustc")["found"], "not found");
    assert_eq!(check(&firmware, "clippy")["status"], "warning");
    let next = check(&firmware, "qemu-system-arm")["next"].clone();
    assert!(next.as_str().unwrap().contains("apt-get install qemu-system-arm"), "{next}");
}

#[test]
fn what_is_old_or_broken_is_told_from_what_is_absent() {
    let tools = tools();
    let path = tools.path();
    qemu(path, "6.2.0 (Debian)", "virt");
    tool(path, "rustc", r#"case $1 in --version) echo 'rustc 1.70.0 (x)';; *) echo /none/there;; esac"#);
    tool(path, "rustup", "echo rustup 1.28.2");
    tool(
        path,
        "cargo",
        r#"case $1 in fmt) echo 'no such command: fmt' >&2; exit 101;; *) echo cargo 1;; esac"#,
    );
    let said = doctor(path, "--for test").ends_with(1).json();
    for (name, found, next) in [
        (
            "qemu-system-arm",
            "QEMU emulator version 6.2.0 (Debian), 7.2 or later is needed",
            "apt-get install",
        ),
        ("machine mps2-an386", "not known to QEMU", "apt-get install"),
        ("rustc", "rustc 1.70.0 (x), 1.89 or later is needed", "rustup update stable"),
        ("thumbv7em-none-eabihf", "not installed", "rustup target add thumbv7em-none-eabihf"),
        ("thumbv8m.main-none-eabihf", "not installed", "rustup target add thumbv8m.main-none-eabihf"),
        ("rustfmt", "ends with exit status: 101 no such command: fmt", "rustup component add rustfmt"),
    ] {
        let check = check(&said, name);
        assert_eq!((&check["status"], &check["found"]), (&"missing".into(), &found.into()), "{name}");
        assert!(check["next"].as_str().unwrap().starts_with(next), "{check}");
    }
    assert_eq!(said["missing"], 6);
    // A file that is no program.
    fs::write(path.join("probe-rs"), "text").unwrap();
    assert_eq!(check(&doctor(path, "").ends_with(0).json(), "probe-rs")["status"], "warning");
}

#[test]
fn a_serial_device_that_is_named_is_looked_at_and_not_opened() {
    let (_near, far) = SerialPort::pair().unwrap();
    let terminal = fs::read_link(format!("/proc/self/fd/{}", far.as_raw_fd())).unwrap();
    let tools = tools();
    let said =
        doctor(tools.path(), &format!("--for hand --device {}", terminal.display())).ends_with(0).json();
    assert_eq!(check(&said, "serial devices")["found"], format!("{} may be opened", terminal.display()));
    for (device, words) in [("/dev/none", "is not there"), (".", "is no serial device")] {
        let call = format!("--for hand --device {} --device {device}", terminal.display());
        let check = check(&doctor(tools.path(), &call).ends_with(1).json(), "serial devices");
        assert!(check["found"].as_str().unwrap().ends_with(words), "{check}");
    }
}

#[test]
fn the_table_has_a_line_a_check_and_says_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let mut command = command(folder.path(), &["doctor", "--for", "firmware"]);
    command.env("PATH", folder.path());
    let text = String::from_utf8(ran(command).ends_with(1).stdout).unwrap();
    let checks = doctor(folder.path(), "").json()["checks"].as_array().unwrap().len();
    assert_eq!(text.lines().count(), checks + 1, "{text}");
    assert!(text.contains("missing  rustc "), "{text}");
    assert!(text.contains("not found: install Rust by rustup (https://rustup.rs)\n"), "{text}");
    assert!(text.ends_with("6 missing for: firmware\n"), "{text}");
    // On the machine that runs the tests, whatever it has.
    prehend(folder.path(), "doctor").ends_with(0);
}
