//! Calls that cannot be obeyed: one line that says why, status 2, and nothing touched. Then the honest noes, status 1.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use serde_json::{Value, json};

use crate::{Ran, prehend};

/// A call and the words that its one line of error must hold. In the call, @ stands for the output's name.
type WrongCall = (&'static str, &'static str);

const USAGE: &[WrongCall] = &[
    ("grasp-it", "'grasp-it'"),
    ("--frobnicate", "'--frobnicate'"),
    ("demo --frobnicate --out @", "'--frobnicate'"),
    ("demo cube --out @", "'cube'"),
    ("scan", "--virtual"),
    ("scan --virtual cube", "--output"),
    ("scan -o @.ply", "--virtual"),
    ("reconstruct -o @.stl", "<CLOUD>"),
    ("reconstruct cloud.ply", "--output"),
    ("reconstruct cloud.ply cloud.ply -o @.stl", "'cloud.ply'"),
    ("plan -o @.json", "<INPUT>"),
    ("plan box.off", "--output"),
    ("quality", "<CONTACTS.json>"),
    ("execute -o @.json", "<PLAN.json>"),
    ("scan --virtual cube -o - --json", "--json and -o -"),
    ("reconstruct cloud.ply -o - --json", "--json and -o -"),
    ("plan box.off -o - --json", "--json and -o -"),
    ("execute good.json -o - --json", "--json and -o -"),
];

const DEMO: &[WrongCall] = &[
    ("demo --object nocube --out @", "'nocube'"),
    ("demo --object none.stl --out @", "none.stl: no such file"),
    ("demo --object folder --out @", "folder: is a directory"),
    ("demo --object empty.ply --out @", "empty.ply: the file is empty"),
    ("demo --object garbage.stl --out @", "garbage.stl"),
    ("demo --object cloud.ply --out @", "cloud.ply"),
    ("demo --object cube --out cloud.ply", "cloud.ply"),
    ("demo --object cube --out cloud.ply/below", "cloud.ply/below"),
    ("demo --link qemu-tcp --out @", "'qemu-tcp'"),
    ("demo --strategy worst --out @", "'worst' for '--strategy <STRATEGY>' [possible values: paper, best]"),
    ("demo --sweeps none --out @", "'none'"),
    ("demo --friction -0.4 --out @", "'-0.4' for '--friction"),
    ("demo --friction NaN --out @", "'NaN'"),
    ("demo --mass 0 --out @", "'0'"),
    ("demo --seed -1 --out @", "'-1' for '--seed"),
    ("demo --object box.off --unit inch --out @", "'inch'"),
];

const SCAN: &[WrongCall] = &[
    ("scan --virtual nocube -o @.ply", "'nocube'"),
    ("scan --virtual none.stl -o @.ply", "none.stl: no such file"),
    ("scan --virtual folder -o @.ply", "folder: is a directory"),
    ("scan --virtual empty.ply -o @.ply", "empty.ply: the file is empty"),
    ("scan --virtual garbage.stl -o @.ply", "garbage.stl"),
    ("scan --virtual garbage.bin -o @.ply", "garbage.bin"),
    ("scan --virtual cloud.ply -o @.ply", "cloud.ply: PLY file holds points"),
    ("scan --virtual points-only.off -o @.ply", "points-only.off"),
    ("scan --virtual index.off -o @.ply", "index.off: OFF, line 6: index 7 is out of range"),
    ("scan --virtual nan.off -o @.ply", "nan.off: OFF, line 4"),
    ("scan --virtual house.off -o @.ply", "scanning house.off: there is no reachable sweep"),
    ("scan --virtual astronomic.off -o @.ply", "scanning astronomic.off"),
    ("scan --virtual cube -o @.stl", ".stl: unknown extension"),
    ("scan --virtual cube -o @", "unknown extension"),
    ("scan --virtual cube -o nowhere/@.ply", "there is no directory nowhere"),
    ("scan --virtual cube -o folder.ply", "folder.ply: is a directory"),
    ("scan --virtual cube -o cloud.ply/@.ply", "cloud.ply/"),
    ("scan --virtual cube --seed 1.5 -o @.ply", "'1.5'"),
    ("scan --virtual cube --sweeps some -o @.ply", "'some'"),
    ("scan --virtual cube --unit km -o @.ply", "'km'"),
];

const RECONSTRUCT: &[WrongCall] = &[
    ("reconstruct none.ply -o @.stl", "none.ply: no such file"),
    ("reconstruct folder -o @.stl", "folder: is a directory"),
    ("reconstruct empty.ply -o @.stl", "empty.ply: the file is empty"),
    ("reconstruct garbage.ply -o @.stl", "garbage.ply: PLY, line 1"),
    ("reconstruct box.off -o @.stl", "box.off: OFF file holds a mesh"),
    ("reconstruct good.json -o @.stl", "good.json"),
    ("reconstruct three.xyz -o @.stl", "reconstructing three.xyz: 3 of 3 points"),
    ("reconstruct line.xyz -o @.stl", "reconstructing line.xyz: all points lie on a line"),
    ("reconstruct nan.xyz -o @.stl", "reconstructing nan.xyz"),
    ("reconstruct astronomic.xyz -o @.stl", "reconstructing astronomic.xyz"),
    ("reconstruct words.xyz -o @.stl", "words.xyz: point columns, line 2: 'east' is not a number"),
    ("reconstruct cloud.ply -o @.xyz", ".xyz: unknown extension"),
    ("reconstruct cloud.ply -o nowhere/@.stl", "there is no directory nowhere"),
    ("reconstruct cloud.ply -o folder.stl", "folder.stl: is a directory"),
    ("reconstruct cloud.ply -o @.stl --crop 0,0,0,1,1", "'0,0,0,1,1' for '--crop"),
    ("reconstruct cloud.ply -o @.stl --crop 0,0,0,1,1,NaN", "'0,0,0,1,1,NaN'"),
    ("reconstruct cloud.ply -o @.stl --crop -5,-5,-5,-6,-6,-6", "0 of"),
    ("reconstruct cloud.ply -o @.stl --cell 0", "'0' for '--cell"),
    ("reconstruct cloud.ply -o @.stl --cell -0.001", "'-0.001' for '--cell"),
    ("reconstruct cloud.ply -o @.stl --cell NaN", "'NaN'"),
    ("reconstruct cloud.ply -o @.stl --cell 1e-12", "cells of 0.000000000001 m"),
    ("reconstruct cloud.ply -o @.stl --cell 1e300", "reconstructing cloud.ply"),
    ("reconstruct cloud.ply -o @.stl --table floor", "'floor'"),
    ("reconstruct cloud.ply -o @.stl --table inf", "'inf'"),
    ("reconstruct cloud.ply -o @.stl --table 1e300", "0 of"),
    ("reconstruct cloud.ply -o @.stl --unit inch", "'inch'"),
    ("reconstruct cloud.ply -o @.stl --seed one", "'one'"),
];

const PLAN: &[WrongCall] = &[
    ("plan none.stl -o @.json", "none.stl: no such file"),
    ("plan nocube -o @.json", "nocube"),
    ("plan folder -o @.json", "folder: is a directory"),
    ("plan empty.ply -o @.json", "empty.ply: the file is empty"),
    ("plan garbage.stl -o @.json", "garbage.stl"),
    ("plan good.json -o @.json", "good.json: neither content nor extension"),
    ("plan three.xyz -o @.json", "reconstructing three.xyz: 3 of 3 points"),
    ("plan astronomic.off -o @.json", "planning on astronomic.off"),
    ("plan speck.off -o @.json", "planning on speck.off"),
    ("plan box.off -o nowhere/@.json --strategy paper", "there is no directory nowhere"),
    ("plan box.off -o folder --strategy paper", "folder: is a directory"),
    ("plan box.off -o @.json --strategy worst", "'worst'"),
    ("plan box.off -o @.json --hand gripper", "'gripper'"),
    ("plan box.off -o @.json --arm ur5", "'ur5'"),
    ("plan box.off -o @.json --place moon", "'moon'"),
    ("plan box.off -o @.json --friction -1", "'-1' for '--friction"),
    ("plan box.off -o @.json --friction NaN", "'NaN'"),
    ("plan box.off -o @.json --friction some", "'some'"),
    ("plan box.off -o @.json --threshold -1", "'-1' for '--threshold"),
    ("plan box.off -o @.json --threshold inf", "'inf'"),
    ("plan box.off -o @.json --mass 0", "'0' for '--mass"),
    ("plan box.off -o @.json --mass -1", "'-1' for '--mass"),
    ("plan box.off -o @.json --attempts 0", "'0' for '--attempts"),
    ("plan box.off -o @.json --attempts -3", "'-3' for '--attempts"),
    ("plan box.off -o @.json --attempts 99999999999999999999", "'99999999999999999999'"),
    ("plan box.off -o @.json --table NaN", "'NaN'"),
    ("plan box.off -o @.json --top 0", "'0' for '--top"),
    ("plan box.off -o @.json --up 0,0,0", "--up"),
    ("plan box.off -o @.json --up 0,1", "'0,1' for '--up"),
    ("plan box.off -o @.json --up 0,inf,1", "'0,inf,1'"),
    ("plan box.off -o @.json --unit inch", "'inch'"),
];

const QUALITY: &[WrongCall] = &[
    ("quality none.json", "none.json: No such file"),
    ("quality folder", "folder: Is a directory"),
    ("quality empty.json", "empty.json: EOF"),
    ("quality garbage.bin", "garbage.bin"),
    ("quality box.off", "box.off: expected value at line 1"),
    ("quality good.json", "unknown field `format`"),
    ("quality null.json", "null.json: invalid type: null"),
    ("quality contacts-are-text.json", "expected a sequence at line 1 column 17"),
    ("quality contact-is-number.json", "contact-is-number.json: invalid type: integer `1`"),
    ("quality zero-normal.json", "contact 0: normal (0, 0, 0) has no direction"),
    ("quality nan-normal.json", "nan-normal.json: expected value at line 1"),
    ("quality astronomic.json", "astronomic.json: contact 0: point"),
    ("quality overflow.json", "overflow.json: number out of range"),
    ("quality negative-friction.json", "contact 0: friction -0.4"),
    ("quality no-scale.json", "torque_scale_m 0"),
    ("quality two-coordinates.json", "invalid length 2"),
    ("quality pinch.json --edges 2", "'2' for '--edges"),
    ("quality pinch.json --edges -8", "'-8' for '--edges"),
    ("quality pinch.json --edges round", "'round'"),
    ("quality pinch.json --norm l2", "'l2' for '--norm <NORM>' [possible values: l1, linf]"),
    ("quality pinch.json --force-norm both", "'both'"),
    ("quality pinch.json --tolerance -1", "'-1' for '--tolerance"),
    ("quality pinch.json --tolerance NaN", "'NaN'"),
    ("quality pinch.json pinch.json", "'pinch.json'"),
];

const EXECUTE: &[WrongCall] = &[
    ("execute none.json -o @.json", "none.json: No such file"),
    ("execute folder -o @.json", "reading folder: not a file"),
    ("execute empty.json -o @.json", "reading empty.json"),
    ("execute garbage.bin -o @.json", "reading garbage.bin"),
    ("execute box.off -o @.json", "reading box.off: expected value at line 1"),
    ("execute pinch.json -o @.json", "unknown field `contacts`"),
    ("execute other-format.json -o @.json", "other-format.json: format is \"plan\""),
    ("execute other-version.json -o @.json", "other-version.json: version 2"),
    ("execute no-grasp.json -o @.json", "no-grasp.json has no grasp"),
    ("execute grasps-are-text.json -o @.json", "grasps-are-text.json: invalid type: string \"none\""),
    ("execute more-fields.json -o @.json", "unknown field `colour`"),
    ("execute no-joint.json -o @.json", "no-joint.json: squeeze has no angle for joint ring_middle"),
    ("execute wild-joint.json -o @.json", "pregrasp: thumb_flexion cannot turn to 1e300 rad"),
    ("execute no-rotation.json -o @.json", "no-rotation.json: approach_site"),
    ("execute wild-rotation.json -o @.json", "wild-rotation.json: grasp_site has no orientation"),
    ("execute far-object.json -o @.json", "far-object.json: base_from_object is 1e300 m"),
    ("execute far-hand.json -o @.json", "far-hand.json: approach_site is 1e2 m"),
    ("execute long-way.json -o @.json", "long-way.json: approach_site is 4."),
    ("execute far-table.json -o @.json", "far-table.json: table_height_m 1e300"),
    ("execute weightless.json -o @.json", "an object of -1 kg"),
    ("execute negative-friction-plan.json -o @.json", "negative-friction-plan.json: friction -1"),
    ("execute other-hand.json -o @.json", "other-hand.json: the plan is for another hand"),
    ("execute other-mesh.json -o @.json", "other.off is not the mesh that was planned on"),
    ("execute lost-mesh.json -o @.json", "gone.off: no such file"),
    ("execute good.json --grasp 99 -o @.json", "--grasp 99"),
    ("execute good.json --grasp 0 -o @.json", "'0' for '--grasp"),
    ("execute good.json --grasp -1 -o @.json", "'-1' for '--grasp"),
    ("execute good.json --grasp best -o @.json", "'best'"),
    ("execute good.json --link serial-port -o @.json", "'serial-port'"),
    ("execute good.json --object nocube -o @.json", "'nocube'"),
    ("execute good.json --object none.stl -o @.json", "none.stl: no such file"),
    ("execute good.json --object cloud.ply -o @.json", "cloud.ply: PLY file holds points"),
    ("execute good.json --object square.off -o @.json", "square.off"),
    ("execute good.json --object astronomic.off -o @.json", "astronomic.off"),
    ("execute good.json --friction -1 -o @.json", "'-1' for '--friction"),
    ("execute good.json --friction NaN -o @.json", "'NaN'"),
    ("execute good.json --mass 0 -o @.json", "'0' for '--mass"),
    ("execute good.json --unit mm -o @.json", "box.off is not the mesh that was planned on"),
    ("execute good.json -o nowhere/@.json", "there is no directory nowhere"),
    ("execute good.json -o folder", "folder: is a directory"),
];

/// Calls that are in order and end in a no: the words are on standard output.
const NOES: &[WrongCall] = &[
    ("plan square.off --strategy paper -o @.json", "no grasp to execute"),
    ("plan flat.off --strategy paper -o @.json", "no grasp to execute"),
    ("plan house.off --attempts 100 -o @.json", "no grasp to execute"),
    ("plan box.off --friction 0 --attempts 100 -o @.json", "no grasp to execute"),
    ("plan box.off --strategy paper --table 3 -o @.json", "no grasp to execute"),
    ("quality pinch.json", "no force closure"),
    ("quality no-contacts.json", "no force closure: there is no contact"),
    ("demo --object cube --friction 0 --out @", "no grasp to execute"),
    ("execute good.json --friction 0.02 -o @.json", "verdict: "),
];

#[test]
fn wrong_calls_are_told_in_one_line_and_touch_nothing() {
    let folder = tempfile::tempdir().unwrap();
    fill(folder.path());
    let before = snapshot(folder.path());
    let tables = [USAGE, DEMO, SCAN, RECONSTRUCT, PLAN, QUALITY, EXECUTE];
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
fn faults(ran: &Ran, words: &str) -> Vec<String> {
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
        assert_eq!(ran.stderr, "", "{call}");
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
fn snapshot(folder: &Path) -> BTreeMap<String, Vec<u8>> {
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

fn changed(before: &BTreeMap<String, Vec<u8>>, after: &BTreeMap<String, Vec<u8>>) -> Vec<String> {
    before.keys().chain(after.keys()).filter(|&name| before.get(name) != after.get(name)).cloned().collect()
}

/// An OFF file of a tetrahedron at the origin with legs of `leg` metres.
fn corner_off(leg: &str) -> String {
    format!("OFF\n4 4 0\n0 0 0\n{leg} 0 0\n0 {leg} 0\n0 0 {leg}\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n")
}

/// A box of 50 mm.
const BOX_OFF: &str = "OFF\n8 6 0\n-0.025 -0.025 0\n0.025 -0.025 0\n0.025 0.025 0\n-0.025 0.025 0\n\
    -0.025 -0.025 0.05\n0.025 -0.025 0.05\n0.025 0.025 0.05\n-0.025 0.025 0.05\n\
    4 0 3 2 1\n4 4 5 6 7\n4 0 1 5 4\n4 1 2 6 5\n4 2 3 7 6\n4 3 0 4 7\n";

/// Lays out everything that the tables name.
fn fill(folder: &Path) {
    let write = |name: &str, content: &[u8]| fs::write(folder.join(name), content).unwrap();
    // Folders whose names could be those of outputs, and what is already there under the outputs' names.
    for name in ["folder", "folder.ply", "folder.stl", "kept"] {
        fs::create_dir(folder.join(name)).unwrap();
    }
    for name in ["kept.ply", "kept.stl", "kept.xyz", "kept.json"] {
        write(name, b"somebody's work\n");
    }
    for name in ["empty.ply", "empty.json"] {
        write(name, b"");
    }
    let garbage: Vec<u8> = (0..2000u32).map(|k| (k.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
    for name in ["garbage.ply", "garbage.stl", "garbage.bin"] {
        write(name, &garbage);
    }
    for (name, text) in [
        ("box.off", BOX_OFF),
        ("other.off", &BOX_OFF.replace("0.025 0.025", "0.025 0.0250001")),
        ("square.off", "OFF\n4 2 0\n0 0 0\n0.05 0 0\n0.05 0.05 0\n0 0.05 0\n3 0 1 2\n3 0 2 3\n"),
        ("flat.off", "OFF\n3 2 0\n0 0 0\n0.05 0 0\n0 0.05 0\n3 0 1 2\n3 0 2 1\n"),
        ("points-only.off", "OFF\n3 0 0\n0 0 0\n0.05 0 0\n0 0.05 0\n"),
        ("index.off", "OFF\n3 1 0\n0 0 0\n0.05 0 0\n0 0.05 0\n3 0 1 7\n"),
        ("nan.off", "OFF\n3 1 0\n0 0 0\nnan 0 0\n0 0.05 0\n3 0 1 2\n"),
        ("house.off", &corner_off("1.5")),
        ("astronomic.off", &corner_off("1e300")),
        ("speck.off", &corner_off("1e-9")),
        ("three.xyz", "0 0 0\n0.1 0 0\n0 0.1 0\n"),
        ("line.xyz", &(0..99).map(|k| format!("{k} 0 0\n")).collect::<String>()),
        ("nan.xyz", &"nan 0 0\n0 inf 0\n1 2 3\n".repeat(40)),
        ("astronomic.xyz", &"1e300 0 0\n-1e300 0 1\n0 1e300 0\n1 1 1e300\n".repeat(40)),
        ("words.xyz", "0 0 0\neast 0 0\n"),
    ] {
        write(name, text.as_bytes());
    }
    fill_contacts(&write);
    prehend(folder, "scan --virtual cube --no-table -o cloud.ply").ends_with(0);
    prehend(folder, "plan box.off --strategy paper --top 1 -o good.json").ends_with(0);
    let good: Value = serde_json::from_slice(&fs::read(folder.join("good.json")).unwrap()).unwrap();
    for (name, pointer, value) in plan_damages() {
        let mut plan = good.clone();
        match pointer.rsplit_once('/') {
            // A last step that is not there yet is a field to add.
            Some((parent, key)) if plan.pointer(pointer).is_none() => {
                plan.pointer_mut(parent).unwrap()[key] = value
            }
            _ => *plan.pointer_mut(pointer).unwrap() = value,
        }
        write(name, plan.to_string().as_bytes());
    }
    let mut plan = good;
    plan["grasps"][0]["squeeze"].as_object_mut().unwrap().remove("ring_middle");
    write("no-joint.json", plan.to_string().as_bytes());
}

fn fill_contacts(write: &dyn Fn(&str, &[u8])) {
    let one = |point: &str, normal: &str, friction: &str| {
        format!(r#"{{"contacts":[{{"point":{point},"normal":{normal},"friction":{friction}}}]}}"#)
    };
    let pinch = r#"{"contacts":[{"point":[0.03,0,0],"normal":[-1,0,0],"friction":0.4},
        {"point":[-0.03,0,0],"normal":[1,0,0],"friction":0.4}]}"#;
    for (name, text) in [
        ("pinch.json", pinch),
        ("null.json", "null"),
        ("no-contacts.json", r#"{"contacts":[]}"#),
        ("contacts-are-text.json", r#"{"contacts":"all"}"#),
        ("contact-is-number.json", r#"{"contacts":[1]}"#),
        ("zero-normal.json", &one("[0,0,1]", "[0,0,0]", "0.4")),
        ("nan-normal.json", &one("[0,0,1]", "[0,0,NaN]", "0.4")),
        ("astronomic.json", &one("[0,0,1e300]", "[0,0,1]", "0.4")),
        ("overflow.json", &one("[0,0,1e999]", "[0,0,1]", "0.4")),
        ("negative-friction.json", &one("[0,0,1]", "[0,0,1]", "-0.4")),
        ("two-coordinates.json", &one("[0,0]", "[0,0,1]", "0.4")),
        ("no-scale.json", r#"{"contacts":[],"torque_scale_m":0}"#),
    ] {
        write(name, text.as_bytes());
    }
}

/// Name of a plan, where it differs from a good one, and what stands there instead.
fn plan_damages() -> Vec<(&'static str, &'static str, Value)> {
    vec![
        ("other-format.json", "/format", json!("plan")),
        ("other-version.json", "/version", json!(2)),
        ("no-grasp.json", "/grasps", json!([])),
        ("grasps-are-text.json", "/grasps", json!("none")),
        ("more-fields.json", "/object/colour", json!("red")),
        ("wild-joint.json", "/grasps/0/pregrasp/thumb_flexion", json!(1e300)),
        ("no-rotation.json", "/grasps/0/approach_site/orientation_wxyz", json!([0, 0, 0, 0])),
        ("wild-rotation.json", "/grasps/0/grasp_site/orientation_wxyz", json!([1e300, 1e300, 0, 0])),
        ("far-object.json", "/object/base_from_object/position", json!([0, 0, 1e300])),
        ("far-hand.json", "/grasps/0/approach_site/position", json!([100, 0, 0])),
        ("long-way.json", "/grasps/0/approach_site/position", json!([4.9, 0, 0.3])),
        ("far-table.json", "/table_height_m", json!(1e300)),
        ("weightless.json", "/object/mass_kg", json!(-1)),
        ("negative-friction-plan.json", "/object/friction", json!(-1)),
        ("other-hand.json", "/hand/sha256", json!("0".repeat(64))),
        ("other-mesh.json", "/object/source", json!("other.off")),
        ("lost-mesh.json", "/object/source", json!("gone.off")),
    ]
}
