//! Calls that cannot be obeyed: one line that says why, status 2, and nothing touched. Then the honest noes: status 1.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use serde_json::{Value, json};

use crate::fixture::fill;
use crate::tables::{
    CALIBRATE, DEMO, EXECUTE, EXPERIMENT, EXPORT, HAND, NOES, PLAN, QUALITY, RECONSTRUCT, SCAN, SHELL, USAGE,
};
use crate::{Ran, prehend};

#[test]
fn wrong_calls_are_told_in_one_line_and_touch_nothing() {
    let folder = tempfile::tempdir().unwrap();
    fill(folder.path());
    let before = snapshot(folder.path());
    let tables =
        [USAGE, DEMO, CALIBRATE, SCAN, RECONSTRUCT, PLAN, QUALITY, EXECUTE, EXPERIMENT, EXPORT, HAND, SHELL];
    let mut wrong = Vec::new();
    for (call, words) in tables.concat() {
        // An output that is not there must not appear, one that is there must stay as it is.
        let outputs: &[&str] = if call.contains('@') { &["new", "kept"] } else { &[""] };
        for output in outputs {
            let ran = prehend(folder.path(), &call.replace('@', output));
            let mut faults = faults(&ran, words);
            let after = snapshot(folder.path());
            if after != before {
                faults.push(format!("files changed: {:?}", changed(&before, &after)));
                fs::remove_dir_all(folder.path()).unwrap();
                fs::create_dir(folder.path()).unwrap();
                fill(folder.path());
            }
            if !faults.is_empty() {
                wrong.push(format!("{}: {}", ran.call, faults.join("; ")));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// What is amiss with a refusal.
pub(crate) fn faults(ran: &Ran, words: &str) -> Vec<String> {
    let mut faults = Vec::new();
    let (errors, rest): (Vec<&str>, Vec<&str>) =
        ran.stderr.lines().partition(|line| line.starts_with("error: "));
    if ran.status != 2 {
        faults.push(format!("status {}", ran.status));
    }
    if errors.len() != 1 || !rest.iter().all(|line| line.starts_with("warning: ")) {
        faults.push(format!("not one line of error: {}", ran.stderr));
    }
    if !errors.iter().all(|line| line.contains(words)) {
        faults.push(format!("{words} is not in {}", ran.stderr));
    }
    if said_twice(&errors.concat()) {
        faults.push(format!("the cause is told twice: {}", ran.stderr));
    }
    if ["panicked", "RUST_BACKTRACE", "stack backtrace"].iter().any(|word| ran.stderr.contains(word)) {
        faults.push(ran.stderr.clone());
    }
    if !ran.stdout.is_empty() {
        faults.push(format!("on standard output: {}", String::from_utf8_lossy(&ran.stdout)));
    }
    faults
}

/// Whether a line ends in "x: x".
fn said_twice(line: &str) -> bool {
    line.match_indices(": ").any(|(at, _)| {
        let (before, after) = (&line[..at], &line[at + 2..]);
        before.ends_with(after)
    })
}

#[test]
fn an_honest_no_is_status_1_without_an_error() {
    let folder = tempfile::tempdir().unwrap();
    fill(folder.path());
    for (call, words) in NOES {
        let ran = prehend(folder.path(), &call.replace('@', "new")).ends_with(1);
        assert!(String::from_utf8_lossy(&ran.stdout).contains(words), "{call}");
        assert!(ran.stderr.lines().all(|line| line.starts_with("warning: ")), "{call}: {}", ran.stderr);
    }
    // What was tried is on record, and is no plan to execute.
    prehend(folder.path(), "plan square.off --strategy paper -o tried.json").ends_with(1);
    let tried: Value = serde_json::from_slice(&fs::read(folder.path().join("tried.json")).unwrap()).unwrap();
    assert_eq!((&tried["grasps"], &tried["force_closure"]), (&json!([]), &0.into()));
    assert!(!tried["rejected"].as_object().unwrap().is_empty());
    let refused = prehend(folder.path(), "execute tried.json").ends_with(2);
    assert!(refused.stderr.contains("tried.json has no grasp to execute"), "{}", refused.stderr);
}

#[test]
fn a_demo_that_breaks_off_keeps_what_it_had_found() {
    let folder = tempfile::tempdir().unwrap();
    fill(folder.path());
    // A sheet on the table: the scanner sees it, but nothing of it stands out.
    let ran = prehend(folder.path(), "demo --object square.off --out new").ends_with(2);
    assert!(ran.stderr.starts_with("error: reconstructing the scan of square.off: "), "{}", ran.stderr);
    assert_eq!(snapshot(&folder.path().join("new")).into_keys().collect::<Vec<_>>(), ["cloud.ply"]);
}

/// Every file below a folder with its bytes; folders have none.
pub(crate) fn snapshot(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap().map(Result::unwrap) {
        let name = entry.file_name().into_string().unwrap();
        if entry.path().is_dir() {
            for (below, bytes) in snapshot(&entry.path()) {
                found.insert(format!("{name}/{below}"), bytes);
            }
            found.insert(name + "/", Vec::new());
        } else {
            found.insert(name, fs::read(entry.path()).unwrap());
        }
    }
    found
}

pub(crate) fn changed(before: &BTreeMap<String, Vec<u8>>, after: &BTreeMap<String, Vec<u8>>) -> Vec<String> {
    before.keys().chain(after.keys()).filter(|&name| before.get(name) != after.get(name)).cloned().collect()
}
