//! A plan as a page.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::prehend;

/// What a page shows.
fn data(page: &Path) -> Value {
    let text = fs::read_to_string(page).unwrap();
    let (_, after) = text.split_once("id=\"data\">").unwrap();
    serde_json::from_str(after.split_once("</script>").unwrap().0).unwrap()
}

#[test]
fn a_page_shows_what_lies_beside_the_plan_and_belongs_to_it() {
    let folder = tempfile::tempdir().unwrap();
    let (path, run) = (|name: &str| folder.path().join(name), |call: &str| prehend(folder.path(), call));
    run("scan --virtual cube -o cloud.ply").ends_with(0);
    run("reconstruct cloud.ply --table 0 --close -o mesh.ply").ends_with(0);
    run("plan mesh.ply --strategy paper -o plan.json").ends_with(0);
    let alone = run("view plan.json -o page.html").ends_with(0);
    assert_eq!(alone.stdout, b"wrote page.html with mesh, cloud\n");
    let page = data(&path("page.html"));
    let plan: Value = serde_json::from_slice(&fs::read(path("plan.json")).unwrap()).unwrap();
    let length = |value: &Value| value.as_array().unwrap().len();
    assert_eq!(length(&page["grasps"]), length(&plan["grasps"]).min(20));
    assert_eq!(page["grasps"][0]["quality"], plan["grasps"][0]["quality"]);
    assert_eq!(length(&page["mesh"]["faces"]) as u64, 3 * plan["object"]["triangles"].as_u64().unwrap());
    // The mesh of `reconstruct` knows where it comes from, the scan is thinned, the arm is the plan's.
    assert_eq!(length(&page["mesh"]["provenance"]), length(&page["mesh"]["faces"]) / 3);
    assert!((100..=3 * 20_000).contains(&length(&page["cloud"])));
    assert!(page["arm"].is_array() && page["run"].is_null());
    // The bracket that the page finds on the plan's contacts is that of the plan: one more way to the same number.
    for grasp in page["grasps"].as_array().unwrap() {
        let [low, high] = ["epsilon_low", "epsilon_high"].map(|key| grasp["quality"][key].as_f64().unwrap());
        let reach = grasp["margins"]["weakest_reach"].as_f64().unwrap();
        assert!((low * (1.0 - 1e-9)..=high * 1.002).contains(&reach), "{reach} is not in {low}..{high}");
    }

    run("execute plan.json --object cube -o run.json").ends_with(0);
    run("view plan.json --top 1 -o page.html").ends_with(0);
    let page = data(&path("page.html"));
    assert_eq!((length(&page["grasps"]), &page["run"]["verdict"]), (1, &"held".into()));
    assert!(length(&page["run"]["trace"]) > 100);

    // Another object's scan and another plan's run are not shown, unless it is asked for.
    run("scan --virtual disk -o cloud.ply").ends_with(0);
    run("plan cylinder --strategy paper --top 1 --arm none -o other.json").ends_with(0);
    let other = run("view other.json --cloud cloud.ply -o other.html").ends_with(0);
    assert_eq!(other.stdout, b"wrote other.html with mesh, cloud\n");
    let other = run("view other.json -o other.html").ends_with(0);
    assert_eq!(other.stdout, b"wrote other.html with mesh\n");
    assert!(data(&path("other.html"))["arm"].is_null());
}

#[test]
fn a_page_of_another_mesh_or_hand_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    crate::fixture::fill(folder.path());
    for (plan, named) in [
        ("other-mesh.json", "not the mesh"),
        ("lost-mesh.json", "gone.off"),
        ("other-hand.json", "another hand"),
    ] {
        let refused = prehend(folder.path(), &format!("view {plan} -o page.html")).ends_with(2);
        assert!(refused.stderr.contains(named), "{}", refused.stderr);
    }
    assert!(!folder.path().join("page.html").exists());
}
