//! `prehend experiment`: the same trials on any number of threads, and sums that agree with them.

use serde_json::Value;

use crate::solids::Solid;
use crate::{number, prehend};

/// A document without the times of the wall clock.
fn timeless(mut document: Value) -> Value {
    fn strip(value: &mut Value) {
        match value {
            Value::Object(fields) => {
                let timed = ["seconds", "plan_s", "link_speed"];
                fields.retain(|name, _| !timed.contains(&name.as_str()));
                fields.values_mut().for_each(strip);
            }
            Value::Array(items) => items.iter_mut().for_each(strip),
            _ => {}
        }
    }
    strip(&mut document);
    document
}

#[test]
fn trials_repeat_on_any_number_of_threads_and_add_up() {
    let folder = tempfile::tempdir().unwrap();
    let [alone, together] = ["--threads 1", "--threads 3"].map(|threads| {
        prehend(folder.path(), &format!("experiment --trials 3 --seed 5 --json {threads}")).ends_with(0)
    });
    assert_eq!(timeless(alone.json()), timeless(together.json()));
    let other = prehend(folder.path(), "experiment --trials 1 --seed 6 --json").ends_with(0).json();
    assert_ne!(other["runs"][0]["scale"], alone.json()["runs"][0]["scale"]);

    let document = alone.json();
    let held = number(&document, "/held");
    assert_eq!(number(&document, "/trials"), 3.0);
    assert!((number(&document, "/success_rate") - held / 3.0).abs() < 1e-12);
    assert!(number(&document, "/seconds") > 0.0);
    let objects: Vec<&Value> = document["objects"].as_object().unwrap().values().collect();
    let sum = |key: &str| objects.iter().map(|object| number(object, key)).sum::<f64>();
    assert_eq!((sum("/trials"), sum("/held")), (3.0, held));
    for object in objects {
        let failures: f64 =
            object["failures"].as_object().unwrap().values().map(|n| n.as_f64().unwrap()).sum();
        assert_eq!(number(object, "/held") + failures, number(object, "/trials"), "{object}");
    }
    let runs = document["runs"].as_array().unwrap();
    assert_eq!(runs.iter().filter(|run| run["verdict"] == "held").count() as f64, held);
    let attempts: usize = runs.iter().map(|run| run["attempts"].as_array().unwrap().len()).sum();
    assert_eq!(number(&document, "/redone"), (attempts - runs.len()) as f64);
}

#[test]
fn a_file_takes_its_turn_lying_as_it_fell_and_its_runs_are_recorded() {
    let folder = tempfile::tempdir().unwrap();
    Solid::block([0.03, 0.05, 0.08], 1).write(&folder.path().join("block.off"));
    let call = "experiment --object block.off=0.05 --trials 2 --seed 1 --redo 0 --record rec --json";
    let document = prehend(folder.path(), call).ends_with(0).json();
    assert_eq!((&document["trials"], &document["objects"]["block"]["trials"]), (&2.into(), &2.into()));
    let runs = document["runs"].as_array().unwrap();
    assert!(runs.iter().all(|run| run["mass_kg"] == 0.05 && run["scale"] == 1.0), "{document}");
    let executed = number(&document, "/executed") as usize;
    let names: Vec<String> = std::fs::read_dir(folder.path().join("rec"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    assert_eq!(names.len(), executed, "{names:?}");
    assert!(names.iter().all(|name| name.starts_with("trial-") && name.ends_with("-1.mcap")), "{names:?}");
}

#[test]
fn what_no_hand_can_span_is_begun_again_and_told() {
    let folder = tempfile::tempdir().unwrap();
    Solid::block([0.3, 0.3, 0.3], 1).write(&folder.path().join("crate.off"));
    let call = "experiment --object crate.off=0.2 --trials 1 --redo 1 --sweeps paper --json";
    let document = prehend(folder.path(), call).ends_with(0).json();
    assert_eq!((&document["held"], &document["executed"]), (&0.into(), &0.into()), "{document}");
    assert_eq!(document["runs"][0]["attempts"].as_array().unwrap().len(), 2);
}
