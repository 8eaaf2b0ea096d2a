//! Standard output: `-o -`, closed pipes, help.

use std::fs;
use std::path::Path;
use std::process::Stdio;

use crate::{command, commands, prehend};

#[test]
fn dash_writes_the_file_to_standard_output_and_nowhere_else() {
    let folder = tempfile::tempdir().unwrap();
    for (call, name) in [
        ("scan --virtual cube", "cloud.ply"),
        ("reconstruct cloud.ply --table 0 --close", "mesh.ply"),
        ("plan mesh.ply --strategy paper", "plan.json"),
        ("execute plan.json", "run.json"),
    ] {
        prehend(folder.path(), &format!("{call} -o {name}")).ends_with(0);
        let before = names(folder.path());
        let dash = prehend(folder.path(), &format!("{call} -o -")).ends_with(0);
        assert!(
            dash.stdout == fs::read(folder.path().join(name)).unwrap(),
            "{call}: other bytes than {name}"
        );
        assert_eq!((dash.stderr.as_str(), names(folder.path())), ("", before), "{call}");
    }
}

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn a_closed_pipe_is_success() {
    let folder = tempfile::tempdir().unwrap();
    prehend(folder.path(), "scan --virtual cube -o cloud.ply").ends_with(0);
    prehend(folder.path(), "plan cube --strategy paper -o plan.json").ends_with(0);
    for call in [
        "scan --virtual cube -o -",
        "scan --virtual cube -o other.ply --json",
        "reconstruct cloud.ply -o -",
        "reconstruct cloud.ply -o mesh.stl",
        "plan cube --strategy paper -o -",
        "plan cube --strategy paper -o other.json --json",
        "execute plan.json -o -",
        "execute plan.json --json",
        "--help",
        "plan --help",
        "completions bash",
    ] {
        let mut child = command(folder.path(), &call.split_whitespace().collect::<Vec<_>>())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!((output.status.code(), said.as_ref()), (Some(0), ""), "{call}");
    }
}

/// `/dev/full` takes nothing, as a full disk.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let full = || fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    for call in
        ["scan --virtual cube -o -", "plan cube --strategy paper -o -", "scan --virtual cube -o a.ply --json"]
    {
        let mut command = command(folder.path(), &call.split_whitespace().collect::<Vec<_>>());
        let output = command.stdout(full()).output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{call}");
        assert!(said.starts_with("error: standard output: ") && said.lines().count() == 1, "{call}: {said}");
    }
    let refused = prehend(folder.path(), "plan cube --strategy paper -o /dev/full").ends_with(2);
    assert!(refused.stderr.starts_with("error: /dev/full: "), "{}", refused.stderr);
}

#[test]
fn every_command_has_help_with_examples_that_parse() {
    let commands = commands();
    for name in
        ["demo", "scan", "reconstruct", "plan", "quality", "execute", "experiment", "export", "hand show"]
    {
        assert!(commands.iter().any(|command| command == name), "{name} is not in {commands:?}");
    }
    for name in commands {
        let folder = tempfile::tempdir().unwrap();
        let help = prehend(folder.path(), &format!("{name} --help")).ends_with(0);
        assert_eq!(help.stderr, "");
        let text = String::from_utf8(help.stdout).unwrap();
        let (_, examples) = text.split_once("Examples:\n").unwrap_or_else(|| panic!("{name}: {text}"));
        let examples: Vec<&str> = examples.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
        assert!(!examples.is_empty(), "{name}");
        for example in examples {
            let call = example.strip_prefix("prehend ").unwrap_or_else(|| panic!("{name}: {example}"));
            assert!(call.starts_with(&name), "{example}");
            let call = call.split(['<', '>']).next().unwrap();
            // A service would not end by itself. What comes before its help is parsed.
            let call = if name == "serve" { format!("{call} --help") } else { call.to_owned() };
            // Their files are not here, but what clap refuses would be told with a hint at the help.
            let ran = prehend(folder.path(), &call);
            assert!(!ran.stderr.contains("--help)"), "{example}: {}", ran.stderr);
        }
    }
}

#[test]
fn without_a_command_the_help_is_shown() {
    let bare = prehend(&std::env::temp_dir(), "").ends_with(2);
    assert!(bare.stdout.is_empty() && bare.stderr.contains("Usage: prehend <COMMAND>"), "{}", bare.stderr);
    let version = prehend(&std::env::temp_dir(), "--version").ends_with(0);
    assert_eq!(version.stdout, concat!("prehend ", env!("CARGO_PKG_VERSION"), "\n").as_bytes());
}
