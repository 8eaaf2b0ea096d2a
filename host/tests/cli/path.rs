//! From scan to lift, over files.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::{command, number, prehend, ran};

#[test]
fn files_lead_from_scan_to_lift() {
    let folder = tempfile::tempdir().unwrap();
    let run = |call: &str| prehend(folder.path(), call);

    let scan = run("scan --virtual cube -o cloud.ply --json").ends_with(0).json();
    assert!(number(&scan, "/points") > number(&scan, "/object_points"));

    let surface = run("reconstruct cloud.ply --table 0 --close -o mesh.stl --json").ends_with(0).json();
    assert_eq!(number(&surface, "/points"), number(&scan, "/points"));
    assert!(number(&surface, "/triangles") > 1000.0, "{surface}");
    assert!((0.0..60.0).contains(&number(&surface, "/seconds")), "{surface}");
    assert_eq!((&surface["watertight"], &surface["components"]), (&true.into(), &1.into()));

    let plan = run("plan mesh.stl --strategy paper -o plan.json --json").ends_with(0).json();
    let written: Value = serde_json::from_slice(&fs::read(folder.path().join("plan.json")).unwrap()).unwrap();
    let grasps = written["grasps"].as_array().unwrap();
    let attempts = number(&plan, "/attempts");
    assert!((1.0..=300.0).contains(&attempts), "{plan}");
    assert_eq!(number(&plan, "/grasps"), grasps.len() as f64);
    assert!((1.0..=attempts).contains(&number(&plan, "/force_closure")), "{plan}");
    assert!(number(&plan, "/seconds/total") >= number(&plan, "/seconds/search"));
    assert_eq!(plan["best"]["strategy"], "paper");
    assert_eq!(plan["best"]["epsilon"], grasps[0]["quality"]["epsilon"]);
    assert!((0.01..1.0).contains(&number(&plan, "/best/epsilon")), "{plan}");
    let rejected =
        plan["rejected"].as_object().unwrap().values().map(|count| count.as_u64().unwrap()).sum::<u64>();
    assert!(rejected as f64 <= attempts, "{plan}");

    let execution = run("execute plan.json --link twin --json").ends_with(0).json();
    assert_eq!(execution["verdict"], "held");
    assert!((0.08..0.12).contains(&number(&execution, "/lift_height_m")), "{execution}");

    // The negative control: nobody lifts a cube with soaped fingers.
    let slippery = run("execute plan.json --link twin --friction 0.02 --json").ends_with(1).json();
    assert_ne!(slippery["verdict"], "held");
    assert!(number(&slippery, "/lift_height_m") < 0.05, "{slippery}");
}

#[test]
fn an_arm_from_a_file_starts_where_it_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let run = |call: &str| prehend(folder.path(), call);
    let rx60 = fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/arms/rx60.toml")).unwrap();
    fs::write(folder.path().join("mine.toml"), rx60.replace("name = \"Stäubli RX60\"", "name = \"mine\""))
        .unwrap();
    run("plan cube --strategy paper --top 1 --arm mine.toml --start 10,-7,75,0,92,-20 -o mine.json")
        .ends_with(0);
    run("plan cube --strategy paper --top 1 -o rx60.json").ends_with(0);
    let read = |name: &str| -> Value {
        serde_json::from_slice(&fs::read(folder.path().join(name)).unwrap()).unwrap()
    };
    let (mine, rx60) = (read("mine.json"), read("rx60.json"));
    assert_eq!(mine["arm"], "mine");
    let motion = |plan: &Value, path: &str| number(plan, &format!("/grasps/0/arm_motion/{path}"));
    for (axis, degrees) in [10.0, -7.0, 75.0, 0.0, 92.0, -20.0_f64].into_iter().enumerate() {
        assert_eq!(motion(&mine, &format!("transfer/0/q_rad/{axis}")), degrees.to_radians());
    }
    // The same arm, so the same grasp, and the same last way to it.
    for axis in 0..6 {
        let [a, b] = [&mine, &rx60].map(|plan| motion(plan, &format!("lift/0/q_rad/{axis}")));
        assert!((a - b).abs() < 1e-9, "axis {}: {a} {b}", axis + 1);
    }
    // The fingers arrive together: the last knot is the grasp, at rest.
    let grasp = &mine["grasps"][0];
    let knots = grasp["finger_motion"]["knots"].as_array().unwrap();
    let last = knots.last().unwrap();
    assert_eq!((&last["q_rad"], &last["t_s"]), (&grasp["grasp"], &grasp["finger_motion"]["contact_s"]));
    assert_eq!(knots[0]["q_rad"], grasp["pregrasp"]);
    assert!(last["qd_rad_per_s"].as_object().unwrap().values().all(|speed| speed.as_f64() == Some(0.0)));

    let refused = run("export mine.json --format moveit -o grasps.yaml");
    assert!(refused.status == 2 && refused.stderr.contains("give its file by --arm"), "{}", refused.stderr);
    run("export mine.json --format moveit --arm mine.toml -o grasps.yaml").ends_with(0);
}

#[test]
fn text_for_people_names_what_was_written() {
    let folder = tempfile::tempdir().unwrap();
    for (call, words) in [
        ("scan --virtual disk -o cloud.pcd", "wrote cloud.pcd"),
        ("reconstruct cloud.pcd --table 0 --close -o mesh.obj", "wrote mesh.obj"),
        ("plan mesh.obj --strategy paper -o plan.json", "wrote plan.json"),
    ] {
        let ran = prehend(folder.path(), call);
        let text = String::from_utf8(ran.stdout).unwrap();
        assert!(ran.status <= 1 && text.contains(words), "{call}: {text}{}", ran.stderr);
        assert_eq!(ran.stderr, "", "{call}");
    }
}

/// A table of 0.4 m with two boxes on it, 80 x 60 x 50 and 40 x 40 x 60 mm, as a camera above sees them.
fn table_scene() -> String {
    let mut text = String::new();
    let mut add = |x: f64, y: f64, z: f64| text.push_str(&format!("{x:.4} {y:.4} {z:.4}\n"));
    let top = |x: f64, y: f64| {
        let on = |x0: f64, y0: f64, a: f64, b: f64| (x - x0).abs() < a && (y - y0).abs() < b;
        if on(-0.07, 0.0, 0.04, 0.03) {
            0.05
        } else if on(0.08, 0.03, 0.02, 0.02) {
            0.06
        } else {
            0.0
        }
    };
    for i in -100..100 {
        for k in -100..100 {
            let (x, y) = (f64::from(i) * 0.002 + 0.001, f64::from(k) * 0.002 + 0.001);
            let z = top(x, y);
            add(x, y, z);
            // Walls, where a neighbour is lower.
            let lowest =
                top(x + 0.002, y).min(top(x - 0.002, y)).min(top(x, y + 0.002)).min(top(x, y - 0.002));
            let steps = ((z - lowest) / 0.002).round().max(0.0) as u32;
            (1..steps).for_each(|step| add(x, y, lowest + f64::from(step) * 0.002));
        }
    }
    text
}

#[test]
fn one_of_several_objects_is_picked() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("scene.xyz"), table_scene()).unwrap();
    let run = |call: &str| prehend(folder.path(), call);
    let all = run("reconstruct scene.xyz -o model.ply --close --pick all --json").ends_with(0).json();
    assert_eq!((number(&all, "/objects/0/number"), all["objects"].as_array().unwrap().len()), (1.0, 2));
    assert!((number(&all, "/objects/0/size_m/0") - 0.08).abs() < 0.005, "{all}");
    assert!((number(&all, "/objects/1/size_m/2") - 0.06).abs() < 0.003, "{all}");
    for model in ["/models/0", "/models/1"] {
        assert_eq!(all.pointer(&format!("{model}/watertight")), Some(&true.into()), "{all}");
        let name = all.pointer(&format!("{model}/file")).and_then(Value::as_str).unwrap();
        assert!(folder.path().join(name).exists(), "{name}");
    }
    let one = run("reconstruct scene.xyz -o one.ply --close --pick 2 --tolerance 0.0005 --json")
        .ends_with(0)
        .json();
    assert_eq!(number(&one, "/picked"), 2.0);
    assert!(number(&one, "/triangles") < number(&all, "/models/1/triangles") / 3.0, "{one}");
    let shares = one["provenance"].as_object().unwrap().values().map(|share| share.as_f64().unwrap());
    assert!((shares.sum::<f64>() - 1.0).abs() < 1e-9);
    run("plan scene.xyz --pick 0.08,0.03,0.03 --strategy paper -o plan.json").ends_with(0);
    let refused = run("reconstruct scene.xyz -o no.ply --pick 7");
    assert!(refused.status == 2 && refused.stderr.contains("no object 7 among the 2"), "{}", refused.stderr);
}

/// The files of a folder with their bytes.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap())
        .map(|entry| (entry.file_name().into_string().unwrap(), fs::read(entry.path()).unwrap()))
        .collect()
}

#[test]
fn demo_lifts_the_teacup_cover_and_repeats_itself() {
    let folder = tempfile::tempdir().unwrap();
    let demo = |call: &str, threads: &str| {
        let mut command = command(folder.path(), &call.split_whitespace().collect::<Vec<_>>());
        command.env("RAYON_NUM_THREADS", threads);
        ran(command).ends_with(0).json()
    };
    let first = demo("demo --object teacup-cover --out a --json", "2");
    let again = demo("demo --object teacup-cover --out b/c --seed 1 --json", "1");
    demo("demo --object teacup-cover --out d --seed 2 --json", "2");

    assert_eq!(first["verdict"], "held");
    assert!((number(&first, "/lift_height_m") - 0.1).abs() < 0.01, "{first}");
    assert!((0.01..1.0).contains(&number(&first, "/epsilon")), "{first}");
    assert!(number(&first, "/points") > 10_000.0 && number(&first, "/triangles") > 1000.0, "{first}");
    assert!((1.0..=number(&first, "/attempts")).contains(&number(&first, "/force_closure")), "{first}");
    for stage in ["scan_s", "reconstruct_s", "plan_s", "execute_s", "view_s"] {
        assert!((0.0..120.0).contains(&number(&first, &format!("/stages/{stage}"))), "{first}");
    }
    let but_times = |mut summary: Value| {
        summary["stages"].take();
        summary
    };
    assert_eq!(but_times(first), but_times(again));

    let [a, b, d] = ["a", "b/c", "d"].map(|name| files(&folder.path().join(name)));
    let names: Vec<&str> = a.keys().map(String::as_str).collect();
    assert_eq!(
        names,
        ["cloud.ply", "grasp.png", "mesh.iv", "mesh.stl", "plan.json", "report.html", "run.json"]
    );
    assert!(a.keys().eq(b.keys()) && a.keys().eq(d.keys()));
    for (name, bytes) in &a {
        // Not assert_eq!, which would print megabytes.
        assert!(b[name] == *bytes, "{name} differs between two runs with one seed");
        assert!(d[name] != *bytes, "{name} does not depend on the seed");
    }
    assert!(a["grasp.png"].starts_with(b"\x89PNG\r\n\x1a\n"));

    // The files that a demo leaves lead on: the mesh to the same plan, and the plan, found with its mesh from elsewhere,
    // to the lift.
    let there = folder.path().join("a");
    prehend(&there, "plan mesh.stl --strategy paper --mass 0.07 -o again.json").ends_with(0);
    assert!(fs::read(there.join("again.json")).unwrap() == a["plan.json"], "another plan from the same mesh");
    let execution = prehend(folder.path(), "execute a/plan.json --json").ends_with(0).json();
    assert_eq!(execution["verdict"], "held");
}
