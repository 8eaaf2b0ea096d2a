//! A folder with everything that the tables of calls name: good files, bad ones, and what stands in the way.

use std::fs;
use std::path::Path;

use serde_json::{Value, json};

use crate::prehend;

/// An OFF file of a tetrahedron at the origin with legs of `leg` metres.
fn corner_off(leg: &str) -> String {
    format!("OFF\n4 4 0\n0 0 0\n{leg} 0 0\n0 {leg} 0\n0 0 {leg}\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n")
}

/// A box of 50 mm.
const BOX_OFF: &str = "OFF\n8 6 0\n-0.025 -0.025 0\n0.025 -0.025 0\n0.025 0.025 0\n-0.025 0.025 0\n\
    -0.025 -0.025 0.05\n0.025 -0.025 0.05\n0.025 0.025 0.05\n-0.025 0.025 0.05\n\
    4 0 3 2 1\n4 4 5 6 7\n4 0 1 5 4\n4 1 2 6 5\n4 2 3 7 6\n4 3 0 4 7\n";

/// Lays out everything that the tables name.
pub(crate) fn fill(folder: &Path) {
    let write = |name: &str, content: &[u8]| fs::write(folder.join(name), content).unwrap();
    // Folders whose names could be those of outputs, and what is already there under the outputs' names.
    for name in ["folder", "folder.ply", "folder.stl", "folder.toml", "kept"] {
        fs::create_dir(folder.join(name)).unwrap();
    }
    for name in ["kept.ply", "kept.stl", "kept.xyz", "kept.json", "kept.toml", "kept.csv"] {
        write(name, b"somebody's work\n");
    }
    for name in ["empty.ply", "empty.json", "empty.csv", "empty.urdf"] {
        write(name, b"");
    }
    let garbage: Vec<u8> = (0..2000u32).map(|k| (k.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
    for name in ["garbage.ply", "garbage.stl", "garbage.bin", "garbage.csv", "garbage.urdf", "garbage.json"] {
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
        ("inf.off", "OFF\n3 1 0\n0 0 0\ninf 0 0\n0 0.05 0\n3 0 1 2\n"),
        ("one-place.off", "OFF\n4 2 0\n1 1 1\n1 1 1\n1 1 1\n1 1 1\n3 0 1 2\n3 0 2 3\n"),
        ("one-line.off", "OFF\n3 1 0\n0 0 0\n0.05 0 0\n0.1 0 0\n3 0 1 2\n"),
        ("house.off", &corner_off("1.5")),
        ("astronomic.off", &corner_off("1e300")),
        ("speck.off", &corner_off("1e-9")),
        ("three.xyz", "0 0 0\n0.1 0 0\n0 0.1 0\n"),
        ("line.xyz", &(0..99).map(|k| format!("{k} 0 0\n")).collect::<String>()),
        ("nan.xyz", &"nan 0 0\n0 inf 0\n1 2 3\n".repeat(40)),
        ("astronomic.xyz", &"1e300 0 0\n-1e300 0 1\n0 1e300 0\n1 1 1e300\n".repeat(40)),
        ("short.toml", "name = \"x\"\n[geometry]\na1_m = 0\na2_m = 0\nb_m = 0\nc1_m = 0.4\n"),
        ("run.json", r#"{"verdict":"held","duration_s":1,"events":[],"trace":[{"time_s":0}]}"#),
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
        ("other-version.json", "/version", json!(99)),
        ("other-arm.json", "/arm", json!("UR5")),
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
