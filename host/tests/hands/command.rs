//! The command line with hands of one's own.

use std::path::Path;
use std::process::Command;

use serde_json::Value;

use crate::refused::GRIPPER;
use crate::{FOUR, model};

fn prehend(folder: &Path, arguments: &[&str]) -> (i32, String, String) {
    let output =
        Command::new(env!("CARGO_BIN_EXE_prehend")).current_dir(folder).args(arguments).output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code().unwrap(), text(&output.stdout), text(&output.stderr))
}

#[test]
fn a_plan_names_its_hand_and_only_the_built_in_one_is_executed() {
    let folder = tempfile::tempdir().unwrap();
    let hand = folder.path().join("mine.urdf");
    std::fs::copy(model(FOUR), &hand).unwrap();
    std::fs::write(folder.path().join("mine.toml"), "name = \"of-mine\"\n").unwrap();
    let plan = [
        "plan",
        "cylinder",
        "--hand",
        "mine.urdf",
        "--strategy",
        "paper",
        "--attempts",
        "300",
        "-o",
        "p.json",
    ];
    let (status, out, error) = prehend(folder.path(), &plan);
    assert_eq!(status, 0, "{out}{error}");
    assert!(
        out.contains("hand: of-mine, 4 fingers (thumb, index, middle, ring), 16 independent joint(s)"),
        "{out}"
    );
    assert!(out.contains("hand: with mine.toml") && out.contains("palm frame 97.0 mm in front"), "{out}");
    let text = std::fs::read_to_string(folder.path().join("p.json")).unwrap();
    let document: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(document["hand"]["name"], "of-mine");
    let grasp = &document["grasps"][0];
    assert!(grasp["quality"]["epsilon_low"].as_f64().unwrap() > 0.0);
    assert!(grasp["squeeze"]["thumb_j2"].is_number() && grasp["arm_motion"].is_object());

    for call in [&["execute", "p.json"][..], &["export", "p.json", "--format", "isaac-grasp", "-o", "x"]] {
        let (status, out, error) = prehend(folder.path(), call);
        assert_eq!((status, out.as_str()), (2, ""), "{error}");
        assert!(
            error.lines().count() == 1 && error.contains("for another hand, of-mine: only hit-dlr"),
            "{error}"
        );
    }
    assert!(!folder.path().join("x").exists());
}

#[test]
fn a_hand_is_shown_in_words_and_as_json() {
    let path = model(FOUR).display().to_string();
    let here = tempfile::tempdir().unwrap();
    let (status, out, _) = prehend(here.path(), &["hand", "show", &path]);
    assert_eq!(status, 0);
    for words in
        ["palm: link hand_base", "thumb_j0", "spreads or turns: thumb", "closes upwards: ring", "power"]
    {
        assert!(out.contains(words), "{words} not in\n{out}");
    }
    let (_, json, _) = prehend(here.path(), &["hand", "show", &path, "--json"]);
    let document: Value = serde_json::from_str(&json).unwrap();
    assert_eq!(document["fingers"].as_array().unwrap().len(), 4);
    assert_eq!(document["joints"][0]["closes"], "none");
    assert!(document["config"].is_null() && document["link_from_palm"]["position"].is_array());
    // A joint that could close and is held, by a file beside the description.
    std::fs::copy(model(FOUR), here.path().join("mine.urdf")).unwrap();
    std::fs::write(here.path().join("mine.toml"), "held = [\"ring_j2\"]\n").unwrap();
    let (_, out, _) = prehend(here.path(), &["hand", "show", "mine.urdf"]);
    assert!(out.contains("hand: with mine.toml") && out.contains("is held: ring"), "{out}");
    let (_, json, _) = prehend(here.path(), &["hand", "show", "mine.urdf", "--json"]);
    assert_eq!(serde_json::from_str::<Value>(&json).unwrap()["config"], "mine.toml");
}

#[test]
fn a_hand_that_cannot_grasp_is_shown_but_not_planned_with() {
    let folder = tempfile::tempdir().unwrap();
    // Both jaws move the same way.
    let text = GRIPPER.replace("<axis xyz=\"-1 0 0\"/>", "<axis xyz=\"1 0 0\"/>");
    std::fs::write(folder.path().join("odd.urdf"), text).unwrap();
    let (status, out, error) = prehend(folder.path(), &["hand", "show", "odd.urdf"]);
    assert!(status == 0 && out.contains("0 typical grasp(s)"), "{out}{error}");
    assert!(error.contains("warning: odd.urdf: no posture found in which pads face each other"), "{error}");
    let (status, _, error) = prehend(folder.path(), &["plan", "cube", "--hand", "odd.urdf", "-o", "x"]);
    assert_eq!(status, 2);
    assert!(error.starts_with("error: odd.urdf: no posture found in which pads face each other"), "{error}");
    assert_eq!(error.lines().count(), 1, "{error}");
}

#[test]
fn wrong_calls_are_told_in_one_line() {
    let here = tempfile::tempdir().unwrap();
    for (call, words) in [
        ("plan cube -o x --hand none.urdf", "none.urdf: No such file"),
        ("plan cube -o x --hand shadow", "give hit-dlr or a file FILE.urdf"),
        ("plan cube -o x --hand-config a.toml", "--hand-config: the built-in hand takes none"),
        ("hand show", "required"),
        ("hand show none.urdf", "none.urdf: No such file"),
    ] {
        let arguments: Vec<&str> = call.split_whitespace().collect();
        let (status, out, error) = prehend(here.path(), &arguments);
        assert_eq!((status, out.as_str()), (2, ""), "{call}: {error}");
        assert!(error.contains(words) && error.lines().count() == 1, "{call}: {error}");
    }
}
