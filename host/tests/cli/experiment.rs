//! `prehend experiment`: the same trials on any number of threads, and sums that agree with them.

use serde_json::Value;

use crate::{number, prehend};

/// A document without the times of the wall clock.
fn timeless(mut document: Value) -> Value {
    fn strip(value: &mut Value) {
        match value {
            Value::Object(fields) => {
                fields.retain(|name, _| !["seconds", "plan_s", "execute_s"].contains(&name.as_str()));
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
}
