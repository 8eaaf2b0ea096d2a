//! A plan in the formats of other programs.

use std::fs;

use serde_json::Value;

use crate::prehend;

#[test]
fn a_plan_is_exported_in_every_format() {
    let folder = tempfile::tempdir().unwrap();
    prehend(folder.path(), "plan cube --strategy paper --all -o plan.json").ends_with(0);
    let plan: Value = serde_json::from_slice(&fs::read(folder.path().join("plan.json")).unwrap()).unwrap();
    let count = plan["grasps"].as_array().unwrap().len();
    let export = |call: &str| {
        let written = prehend(folder.path(), &format!("export plan.json {call} -o out")).ends_with(0);
        assert_eq!(written.stdout, b"wrote out\n");
        let piped = prehend(folder.path(), &format!("export plan.json {call} -o -")).ends_with(0);
        let text = fs::read_to_string(folder.path().join("out")).unwrap();
        assert!(piped.stdout == text.as_bytes(), "{call}: standard output differs from the file");
        text
    };
    let best: Value = serde_saphyr::from_str(&export("--format isaac-grasp")).unwrap();
    let pose = &plan["grasps"][0]["object_from_palm"];
    assert_eq!(best["grasps"]["grasp_1"]["position"], pose["position"]);
    let all: Value = serde_saphyr::from_str(&export("--format isaac-grasp --all")).unwrap();
    assert_eq!(all["grasps"].as_object().unwrap().len(), count);
    let list: Value = serde_saphyr::from_str(&export("--format moveit --all")).unwrap();
    assert_eq!(list.as_array().unwrap().len(), count);
    assert_eq!(list[0]["grasp_quality"], plan["grasps"][0]["quality"]["epsilon"]);
    assert!(urdf_rs::read_from_string(&export("--format urdf")).is_ok());
    assert!(urdf_rs::read_from_string(&export("--format urdf-arm")).is_ok());
    assert!(export("--format mjcf").starts_with("<mujoco "));
    assert!(export("--format inventor").starts_with("#Inventor "));
}

#[test]
fn arrays_are_an_archive_of_the_same_bytes_each_time() {
    let folder = tempfile::tempdir().unwrap();
    crate::fixture::fill(folder.path());
    let archive = || {
        let ran = prehend(folder.path(), "export good.json --format npz --all -o -").ends_with(0);
        ran.stdout
    };
    let first = archive();
    // NumPy reads it in `.ci/readback.sh`; here its members by name.
    assert!(first.starts_with(b"PK") && first == archive());
    for key in ["obj_pose", "joint_names", "pregrasp_qpos", "grasp_qpos", "squeeze_qpos"] {
        let name = format!("{key}.npy");
        assert!(first.windows(name.len()).any(|bytes| bytes == name.as_bytes()), "{key}");
    }
}

#[test]
fn a_plan_without_an_arm_gives_moveit_the_palm() {
    let folder = tempfile::tempdir().unwrap();
    prehend(folder.path(), "plan cube --strategy paper --arm none --top 1 -o plan.json").ends_with(0);
    let plan: Value = serde_json::from_slice(&fs::read(folder.path().join("plan.json")).unwrap()).unwrap();
    let ran = prehend(folder.path(), "export plan.json --format moveit -o -").ends_with(0);
    let list: Value = serde_saphyr::from_str(std::str::from_utf8(&ran.stdout).unwrap()).unwrap();
    let [x, y, z] = ["x", "y", "z"].map(|k| list[0]["grasp_pose"]["pose"]["position"][k].clone());
    assert_eq!(Value::from(vec![x, y, z]), plan["grasps"][0]["grasp_site"]["position"]);
}

#[test]
fn a_scene_finds_the_mesh_beside_a_plan_that_was_moved() {
    let folder = tempfile::tempdir().unwrap();
    let (old, new) = (folder.path().join("old"), folder.path().join("new"));
    fs::create_dir(&old).unwrap();
    crate::fixture::fill(&old);
    prehend(&old, "export good.json --format inventor -o scene.iv").ends_with(0);
    fs::rename(&old, &new).unwrap();
    prehend(folder.path(), "export new/good.json --format inventor -o moved.iv").ends_with(0);
    let read = |path: std::path::PathBuf| fs::read(path).unwrap();
    assert!(read(new.join("scene.iv")) == read(folder.path().join("moved.iv")));
}
