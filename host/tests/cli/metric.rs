//! `prehend quality` against closed forms.

use std::fs;
use std::io::Write;
use std::process::Stdio;

use serde_json::{Value, json};

use crate::{command, number, prehend};

/// The corners of a tetrahedron on the unit sphere, friction `mu`, lengths multiplied by `scale`.
fn tetrahedron(mu: f64, scale: f64) -> Value {
    let corner = scale / f64::sqrt(3.0);
    let contacts: Vec<Value> = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]]
        .iter()
        .map(|p| json!({"point": p.map(|c| corner * c), "normal": p.map(|c| -c), "friction": mu}))
        .collect();
    json!({"contacts": contacts, "center_of_mass": [0, 0, 0], "torque_scale_m": scale})
}

/// Two contacts that face each other, hard or with torsional friction.
fn pinch(torsional_m: f64) -> Value {
    let contact = |x: f64| json!({"point": [x, 0, 0], "normal": [-x, 0, 0], "friction": 0.4, "torsional_m": torsional_m});
    json!({"contacts": [contact(0.03), contact(-0.03)], "center_of_mass": [0, 0, 0], "torque_scale_m": 0.03})
}

fn measured(contacts: &Value, options: &str) -> (i32, Value) {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("contacts.json"), contacts.to_string()).unwrap();
    let ran = prehend(folder.path(), &format!("quality contacts.json --json {options}"));
    (ran.status, ran.json())
}

#[test]
fn tetrahedron_has_the_epsilon_of_its_closed_form() {
    for mu in [0.2, 0.4, 0.8] {
        for scale in [1.0, 0.03] {
            let exact = mu / f64::sqrt(2.0);
            let (status, found) = measured(&tetrahedron(mu, scale), "--tolerance 1e-6");
            assert_eq!((status, &found["closure"]), (0, &true.into()));
            let [low, high] = ["/epsilon_low", "/epsilon_high"].map(|key| number(&found, key));
            assert!(
                low <= exact * (1.0 + 1e-12) && exact * (1.0 - 1e-12) <= high,
                "{exact} in [{low}, {high}]"
            );
            assert!(high - low <= 1e-6 * high, "[{low}, {high}]");
            assert_eq!(number(&found, "/epsilon"), low);
            assert_eq!(number(&found, "/convention/torque_scale_m"), scale);
        }
    }
}

#[test]
fn four_edges_give_what_qhull_gives() {
    let (status, found) = measured(&tetrahedron(0.4, 1.0), "--edges 4");
    assert_eq!(status, 0);
    assert!((number(&found, "/epsilon") - 0.250488927).abs() < 1e-8, "{found}");
    assert_eq!(found["convention"]["edges"], 4);
}

#[test]
fn other_programs_conventions_are_named_in_the_result() {
    let mut grasp = tetrahedron(0.4, 1.0);
    grasp["object"] = json!({"bounding_box": {"min": [-1, -1, -1], "max": [1, 1, 1]},
        "vertices": [[1, 0, 0]], "surface": grasp["contacts"]});
    let edge = f64::hypot(0.4, 1.0);
    for (name, epsilon, score) in [
        ("graspit", 0.275945702, 0.275945702),
        ("frogger", 0.250488927 / edge, 0.250488927 / edge),
        ("simox", 0.275945702 / edge, 1.0),
        ("dexnet", 0.275945702, 0.275945702),
    ] {
        let (status, found) = measured(&grasp, &format!("--convention {name}"));
        assert_eq!((status, &found["convention"]["name"]), (0, &name.into()), "{found}");
        assert!((number(&found, "/epsilon") - epsilon).abs() < 1e-6, "{found}");
        for key in ["/score_low", "/score_high"] {
            assert!((number(&found, key) - score).abs() < 1e-5, "{found}");
        }
    }
    let (_, custom) = measured(&grasp, "--edges 8");
    assert_eq!(custom["convention"]["name"], "custom");
    assert!(custom.get("score_low").is_none(), "{custom}");
    let mut open = pinch(0.0);
    open["object"] = grasp["object"].clone();
    for (name, score) in [("graspit", json!(-1.0)), ("dexgraspbench", json!(2.0)), ("frogger", Value::Null)] {
        let (status, found) = measured(&open, &format!("--convention {name}"));
        assert_eq!((status, &found["score"]), (1, &score), "{found}");
    }
}

#[test]
fn a_pinch_resists_its_weight_by_friction_and_shows_the_forces() {
    let (status, found) = measured(&pinch(0.0), "--resist 0,0,-2,0,0,0 --tolerance 1e-7");
    // No force closure, and still the answer to the question is yes: 0.4 N of friction per newton against 2 N.
    assert_eq!((status, &found["closure"]), (0, &false.into()));
    assert_eq!(found["resistance"]["balanced"], true);
    for key in ["/resistance/factor_low", "/resistance/factor_high"] {
        assert!((number(&found, key) - 0.2).abs() < 1e-6, "{found}");
    }
    let forces = found["resistance"]["contact_forces"].as_array().unwrap();
    let up: f64 = forces.iter().map(|f| number(f, "/force_n/2")).sum();
    assert!((up - 0.4).abs() < 1e-6 && forces.len() == 2, "{found}");

    let (status, found) = measured(&pinch(0.0), "--resist 0,0,-2,0.1,0,0");
    assert_eq!((status, &found["resistance"]["balanced"]), (1, &false.into()));
    assert_eq!(found["resistance"]["limiting_wrench"].as_array().unwrap().len(), 6);
    let (_, found) = measured(&pinch(0.0), "--resist -1,0,0,0,0,0 --norm linf");
    assert!((number(&found, "/resistance/factor_low") - 1.0).abs() < 1e-6, "{found}");
}

#[test]
fn a_task_is_measured_from_the_document_or_the_command_line() {
    let mut grasp = tetrahedron(0.4, 1.0);
    let exact = 0.4 / f64::sqrt(2.0);
    // A ball of 2 N and 2 N m at a scale of 1 m is epsilon over 2.
    let (status, found) = measured(&grasp, "--ellipsoid 2,2,2,2,2,2 --tolerance 1e-6");
    assert_eq!((status, &found["task"]["withstood"]), (0, &true.into()));
    assert!((number(&found, "/task/scale_low") - exact / 2.0).abs() < 1e-6, "{found}");
    grasp["task"] = json!({"semi_axes": [1, 1, 1, 1, 1, 1]});
    let (_, found) = measured(&grasp, "--tolerance 1e-6");
    assert!((number(&found, "/task/scale_high") - exact).abs() < 1e-6, "{found}");
    // More of a load than a newton of summed normal force can bear.
    grasp["task"]["load"] = json!([0, 0, -2, 0, 0, 0]);
    let (status, found) = measured(&grasp, "--tolerance 1e-3");
    assert_eq!((status, &found["task"]["withstood"], &found["closure"]), (1, &false.into(), &true.into()));
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("contacts.json"), grasp.to_string()).unwrap();
    let text = prehend(folder.path(), "quality contacts.json").ends_with(1);
    assert!(String::from_utf8_lossy(&text.stdout).starts_with("withstands nothing of the ellipsoid"));
    let refused = prehend(folder.path(), "quality contacts.json --convention frogger").ends_with(2);
    assert!(refused.stderr.contains("a task has no --convention"), "{}", refused.stderr);
}

#[test]
fn two_hard_contacts_never_close_and_two_soft_ones_do() {
    let (status, hard) = measured(&pinch(0.0), "");
    assert_eq!((status, &hard["closure"]), (1, &false.into()));
    assert!(hard.get("epsilon").is_none(), "{hard}");
    // Nothing turns the object about the line through the contacts.
    let direction = hard["separating_direction"].as_array().unwrap();
    assert!((direction[3].as_f64().unwrap().abs() - 1.0).abs() < 1e-6, "{hard}");
    let (status, soft) = measured(&pinch(0.01), "");
    assert_eq!((status, &soft["closure"]), (0, &true.into()));
    assert!(number(&soft, "/epsilon") > 0.01, "{soft}");
}

#[test]
fn standard_input_is_as_good_as_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let contacts = tetrahedron(0.4, 1.0).to_string();
    fs::write(folder.path().join("contacts.json"), &contacts).unwrap();
    let from_file = prehend(folder.path(), "quality contacts.json").ends_with(0);
    assert!(String::from_utf8_lossy(&from_file.stdout).contains("force closure, epsilon 0.2828"));

    let mut child = command(folder.path(), &["quality", "-"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    child.stdin.take().unwrap().write_all(contacts.as_bytes()).unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!((output.status.code(), output.stdout), (Some(0), from_file.stdout));
}
