//! What `prehend plan` makes of meshes that are damaged, flat, huge or tiny.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::solids::Solid;
use crate::{Ran, number, prehend};

/// Plans on `mesh.off`: what was said, and the plan.
fn planned(folder: &Path, solid: &Solid, options: &str) -> (Ran, Value) {
    solid.write(&folder.join("mesh.off"));
    let ran = prehend(folder, &format!("plan mesh.off --attempts 150 --top 2 -o plan.json {options}"));
    assert!(ran.status <= 1, "{}: {}", ran.call, ran.stderr);
    let plan = serde_json::from_slice(&fs::read(folder.join("plan.json")).unwrap()).unwrap();
    (ran, plan)
}

fn cube() -> Solid {
    Solid::block([0.05; 3], 4)
}

#[test]
fn faces_turned_or_there_twice_change_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let (ran, sound) = planned(folder.path(), &cube(), "");
    assert_eq!((ran.status, ran.stderr.as_str(), &sound["object"]["watertight"]), (0, "", &true.into()));
    let both = |other: Solid| {
        let mut solid = cube();
        solid.faces.extend(other.faces);
        solid
    };
    for (solid, words) in [
        (cube().with_turned(|_| true), "the closed surface was inside out: its faces were turned"),
        (cube().with_turned(|index| index % 3 == 0), "64 faces were turned to agree with their neighbours"),
        (both(cube()), "192 faces that are there twice were dropped"),
        (both(cube().with_turned(|_| true)), "every face is there from both sides: 192 were dropped"),
    ] {
        let (ran, plan) = planned(folder.path(), &solid, "");
        assert_eq!(ran.stderr, format!("warning: mesh.off: {words}\n"));
        assert!(plan == sound, "{words}: another plan");
    }
}

#[test]
fn meshes_with_holes_and_fins_are_planned_on_as_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let mut holes = cube();
    let mut index = 0;
    holes.faces.retain(|_| {
        index += 1;
        index % 7 != 0
    });
    let mut fin = cube();
    fin.vertices.push([0.0, 0.0, 0.07]);
    let top = fin.vertices.len() - 1;
    let [a, b, _] = fin.faces[fin.faces.len() - 1];
    fin.faces.push([a, b, top]);
    // Two cubes that share the corner points of one edge.
    let mut pair = cube();
    let second = cube();
    let mut index_of = Vec::new();
    for vertex in &second.vertices {
        let moved = [vertex[0] + 0.05, vertex[1] + 0.05, vertex[2]];
        let same = pair.vertices.iter().position(|v| (0..3).all(|k| (v[k] - moved[k]).abs() < 1e-9));
        index_of.push(same.unwrap_or_else(|| {
            pair.vertices.push(moved);
            pair.vertices.len() - 1
        }));
    }
    pair.faces.extend(second.faces.iter().map(|face| face.map(|index| index_of[index])));
    for solid in [holes, fin, pair] {
        let (ran, plan) = planned(folder.path(), &solid, "--strategy best");
        assert_eq!((ran.status, &plan["object"]["watertight"]), (0, &false.into()), "{}", ran.stderr);
        assert_eq!(number(&plan, "/object/triangles"), solid.faces.len() as f64);
    }
}

#[test]
fn what_no_hand_can_hold_is_an_honest_no_with_counts() {
    let folder = tempfile::tempdir().unwrap();
    let sheet = |faces: Vec<[usize; 3]>| Solid {
        vertices: vec![[0.0; 3], [0.05, 0.0, 0.0], [0.05, 0.05, 0.0], [0.0, 0.05, 0.0]],
        faces,
    };
    for (solid, options, words) in [
        (Solid::block([0.5; 3], 1), "", ""),
        (Solid::block([0.004; 3], 1), "", ""),
        (sheet(vec![[0, 1, 2], [0, 2, 3]]), "", ""),
        (sheet(vec![[0, 1, 2], [0, 2, 3], [0, 2, 1], [0, 3, 2]]), "", "from both sides"),
        (cube().scaled(1e3), "", "mesh.off: is 50.0 m across: is it in millimetres? try --unit mm"),
        (cube().scaled(1e6), "", "is 50000.0 m across: is it in millimetres?"),
        (cube(), "--unit mm", "mesh.off: is 0.050 mm across: is it in metres? try --unit m"),
        (cube().scaled(1e-3), "", "is 0.050 mm across: that is too small for a hand"),
    ] {
        for strategy in ["paper", "best"] {
            let (ran, plan) = planned(folder.path(), &solid, &format!("--strategy {strategy} {options}"));
            let said = String::from_utf8_lossy(&ran.stdout);
            assert!(ran.status == 1 && said.contains("0 with force closure"), "{}: {said}", ran.call);
            assert!(
                ran.stderr.contains(words) && ran.stderr.is_empty() == words.is_empty(),
                "{}",
                ran.stderr
            );
            let counts = plan["rejected"].as_object().unwrap().values().map(|count| count.as_f64().unwrap());
            assert_eq!(counts.sum::<f64>(), number(&plan, "/attempts"));
        }
    }
}

#[test]
fn two_hundred_thousand_triangles_are_planned_on() {
    let folder = tempfile::tempdir().unwrap();
    let (ran, plan) = planned(folder.path(), &Solid::block([0.05; 3], 130), "--strategy paper");
    assert_eq!((ran.status, number(&plan, "/object/triangles")), (0, 202_800.0));
}
