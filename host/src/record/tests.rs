use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Isometry3, Point3, Vector3};
use protocol::ids::{FINGER_COUNT, FingerId, JOINT_COUNT};

use super::*;
use crate::exec::{Event, EventKind, Phase, TraceSample, Trouble, Verdict};
use crate::hand::Posture;
use crate::link::TipWrench;
use crate::object::BuiltIn;

fn execution() -> Execution {
    let sample = |k: u32| TraceSample {
        time_s: 0.02 * f64::from(k),
        phase: Phase::Lift,
        base_from_palm: Isometry3::translation(0.4, 0.0, 0.3 + 0.01 * f64::from(k)),
        commanded_rad: [0.3; JOINT_COUNT],
        measured_rad: [0.29; JOINT_COUNT],
        joint_torque_nm: [0.1; JOINT_COUNT],
        tip_wrench: [TipWrench { force: Vector3::new(-2.0, 0.0, 0.0), moment: Vector3::zeros() };
            FINGER_COUNT],
        tip_force_n: [2.0; FINGER_COUNT],
        slip_ratio: [None, Some(0.5), None, None],
        base_from_object: Some(Isometry3::translation(0.4, 0.0, 0.01 * f64::from(k))),
    };
    Execution {
        verdict: Verdict::Dropped,
        felt: Verdict::Dropped,
        trouble: Some(Trouble::Lost),
        shift_m: None,
        lift_height_m: Some(0.02),
        slip_m: None,
        misplaced_m: None,
        grip_max: 1.0,
        base_from_object: None,
        duration_s: 0.06,
        events: vec![
            Event { time_s: 0.0, kind: EventKind::Phase(Phase::Lift) },
            Event { time_s: 0.03, kind: EventKind::Slip(FingerId::Thumb) },
            Event { time_s: 0.05, kind: EventKind::Trouble(Trouble::Lost) },
        ],
        trace: (1..=3).map(sample).collect(),
    }
}

/// Messages by topic: schema, and content with its time.
type Recorded = BTreeMap<String, (Value, Vec<(u64, Value)>)>;

fn read(bytes: &[u8]) -> Recorded {
    let mut topics = Recorded::new();
    for message in mcap::MessageStream::new(bytes).unwrap() {
        let message = message.unwrap();
        let schema = message.channel.schema.as_ref().unwrap();
        assert_eq!(
            (schema.encoding.as_str(), message.channel.message_encoding.as_str()),
            ("jsonschema", "json")
        );
        let schema_json: Value = serde_json::from_slice(&schema.data).unwrap();
        assert_eq!(schema_json["title"], schema.name.as_str());
        let topic = topics.entry(message.channel.topic.clone()).or_insert((schema_json, Vec::new()));
        topic.1.push((message.log_time, serde_json::from_slice(&message.data).unwrap()));
    }
    topics
}

#[test]
fn a_recording_is_read_back_and_fits_its_schemas() {
    let hand = Hand::hit_dlr().unwrap();
    let cube = BuiltIn::Cube.object(1.0).unwrap();
    let scene =
        RecordedScene { hand: &hand, object: &cube.mesh, object_name: "cube", table_height_m: Some(0.0) };
    let mut bytes = Vec::new();
    write_recording(&scene, &execution(), &mut bytes).unwrap();
    let topics = read(&bytes);
    let counts: Vec<(&str, usize)> = topics.iter().map(|(name, (_, m))| (name.as_str(), m.len())).collect();
    let expected =
        [("/events", 4), ("/forces", 3), ("/joints", 3), ("/scene", 1), ("/tf", 3), ("/wrenches", 3)];
    assert_eq!(counts, expected);
    for (topic, (schema, messages)) in &topics {
        let mut compiler = boon::Compiler::new();
        compiler.add_resource("schema.json", schema.clone()).unwrap();
        let mut schemas = boon::Schemas::new();
        let index = compiler.compile("schema.json", &mut schemas).unwrap();
        assert!(messages.is_sorted_by_key(|(time, _)| *time), "{topic}");
        for (_, message) in messages {
            schemas.validate(message, index).unwrap_or_else(|error| panic!("{topic}: {error}"));
            has_only_fields_of(topic, message, schema);
        }
    }
    let (_, events) = &topics["/events"];
    assert_eq!(events[1].0, 30_000_000);
    assert_eq!(events[1].1["timestamp"], serde_json::json!({ "sec": 0, "nsec": 30_000_000 }));
    assert!(events[2].1["message"].as_str().unwrap().starts_with("lost: "));
    assert_eq!(events[3].1["message"], "verdict: dropped");
    // The mesh is the object's.
    let entities = topics["/scene"].1[0].1["entities"].as_array().unwrap();
    let mesh = entities.iter().find(|entity| entity["id"] == "object").unwrap();
    assert_eq!(mesh["triangles"][0]["indices"].as_array().unwrap().len(), 3 * cube.mesh.faces().len());
}

/// No message may have a field that its schema does not name: a viewer would not find it.
fn has_only_fields_of(at: &str, message: &Value, schema: &Value) {
    match message {
        Value::Object(fields) => {
            for (name, value) in fields {
                let field = &schema["properties"][name];
                assert!(field.is_object(), "{at}.{name}");
                has_only_fields_of(&format!("{at}.{name}"), value, field);
            }
        }
        Value::Array(items) => items.iter().for_each(|item| has_only_fields_of(at, item, &schema["items"])),
        _ => {}
    }
}

/// Fields of the schemas as Foxglove documents them, all that a viewer may expect.
const PUBLISHED: [(&str, &[&str]); 16] = [
    ("foxglove.FrameTransforms", &["transforms"]),
    (
        "foxglove.FrameTransform",
        &["timestamp", "parent_frame_id", "child_frame_id", "translation", "rotation"],
    ),
    ("foxglove.SceneUpdate", &["deletions", "entities"]),
    ("foxglove.SceneEntityDeletion", &["timestamp", "type", "id"]),
    (
        "foxglove.SceneEntity",
        &[
            "timestamp",
            "frame_id",
            "id",
            "lifetime",
            "frame_locked",
            "metadata",
            "arrows",
            "cubes",
            "spheres",
            "cylinders",
            "lines",
            "triangles",
            "texts",
            "models",
        ],
    ),
    ("foxglove.KeyValuePair", &["key", "value"]),
    (
        "foxglove.ArrowPrimitive",
        &["pose", "shaft_length", "shaft_diameter", "head_length", "head_diameter", "color"],
    ),
    ("foxglove.CubePrimitive", &["pose", "size", "color"]),
    ("foxglove.SpherePrimitive", &["pose", "size", "color"]),
    ("foxglove.TriangleListPrimitive", &["pose", "points", "color", "colors", "indices"]),
    ("foxglove.Pose", &["position", "orientation"]),
    ("foxglove.Vector3", &["x", "y", "z"]),
    ("foxglove.Point3", &["x", "y", "z"]),
    ("foxglove.Quaternion", &["x", "y", "z", "w"]),
    ("foxglove.Color", &["r", "g", "b", "a"]),
    ("foxglove.Log", &["timestamp", "level", "message", "name", "file", "line"]),
];

#[test]
fn schemas_have_the_names_and_fields_that_foxglove_publishes() {
    let mut seen = BTreeSet::new();
    for schema in [schema::frame_transforms(), schema::scene_update(), schema::log()] {
        visit(&schema, &mut seen);
    }
    assert_eq!(seen.len(), PUBLISHED.len());
}

fn visit(schema: &Value, seen: &mut BTreeSet<String>) {
    if let (Some(title), Some(fields)) = (schema["title"].as_str(), schema["properties"].as_object()) {
        match title {
            "time" | "duration" => assert!(fields.keys().eq(["nsec", "sec"]), "{fields:?}"),
            _ => {
                let (_, published) = PUBLISHED.iter().find(|(name, _)| *name == title).unwrap();
                assert!(fields.keys().all(|name| published.contains(&name.as_str())), "{title}: {fields:?}");
                seen.insert(title.to_owned());
            }
        }
        fields.values().for_each(|field| visit(field, seen));
    }
    if schema["items"].is_object() {
        visit(&schema["items"], seen);
    }
}

#[test]
fn frames_lead_from_the_base_to_the_fingertips() {
    let hand = Hand::hit_dlr().unwrap();
    let sample = execution().trace.remove(0);
    let message = message::transforms(&hand, &sample);
    let mut base_from: BTreeMap<String, Isometry3<f64>> = BTreeMap::new();
    base_from.insert("base".to_owned(), Isometry3::identity());
    for transform in message["transforms"].as_array().unwrap() {
        let number = |part: &str, axis: &str| transform[part][axis].as_f64().unwrap();
        let [x, y, z] = ["x", "y", "z"].map(|axis| number("translation", axis));
        let [i, j, k, w] = ["x", "y", "z", "w"].map(|axis| number("rotation", axis));
        let turn = nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, i, j, k));
        let parent = base_from[transform["parent_frame_id"].as_str().unwrap()];
        let child = transform["child_frame_id"].as_str().unwrap();
        base_from.insert(child.to_owned(), parent * Isometry3::from_parts([x, y, z].into(), turn));
    }
    let posture = Posture(core::array::from_fn(|j| if j < JOINT_COUNT { 0.29 } else { 0.0 }));
    for (finger, id) in hand.fingers.iter().zip(FingerId::ALL) {
        assert_eq!(finger.name, id.name());
        let expected: Point3<f64> = sample.base_from_palm * finger.tip_in_palm(&finger.frames(&posture));
        let last = &finger.segments().last().unwrap().link;
        assert!((base_from[last] * finger.tip_in_last() - expected).norm() < 1e-9, "{last}");
    }
}
