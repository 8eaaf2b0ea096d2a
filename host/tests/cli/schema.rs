//! The published schemas: what the types give, what real documents keep to, what refuses what the readers refuse.

use std::fs;

use boon::{Compiler, SchemaIndex, Schemas};
use host::grasp::document::GraspDocument;
use host::plan::document::PlanDocument;
use serde_json::{Value, json};

use crate::prehend;

/// A published schema, ready to judge.
struct Judge {
    schemas: Schemas,
    index: SchemaIndex,
}

impl Judge {
    fn of(file: &str) -> Self {
        let (mut schemas, mut compiler) = (Schemas::new(), Compiler::new());
        compiler.add_resource("prehend.json", published(file)).unwrap();
        let index = compiler.compile("prehend.json", &mut schemas).unwrap();
        Self { schemas, index }
    }

    fn accepts(&self, document: &Value) -> bool {
        self.schemas.validate(document, self.index).is_ok()
    }

    #[track_caller]
    fn agrees(&self, document: &Value) {
        if let Err(error) = self.schemas.validate(document, self.index) {
            panic!("{error:#}");
        }
    }
}

fn published(file: &str) -> Value {
    let path = format!("{}/../docs/{file}", env!("CARGO_MANIFEST_DIR"));
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

#[test]
fn published_schemas_are_what_the_types_give() {
    for (file, command, types) in [
        ("plan.schema.json", "plan", PlanDocument::schema()),
        ("contacts.schema.json", "quality", GraspDocument::schema()),
    ] {
        let call = format!("prehend {command} --schema > docs/{file}");
        assert!(types.as_value() == &published(file), "docs/{file} is out of date: {call}");
        let folder = tempfile::tempdir().unwrap();
        let printed = prehend(folder.path(), &format!("{command} --schema")).ends_with(0).json();
        assert!(published(file) == printed, "docs/{file} is not what is printed: {call}");
    }
}

#[test]
fn every_field_has_a_title_a_description_and_a_unit() {
    let units = [
        "metres", "rad", "newtons", "seconds", "kg", " N", "no unit", "umber of", "0 to 1", "share", "Seed",
        "Version",
    ];
    let mut fields = 0;
    for file in ["plan.schema.json", "contacts.schema.json"] {
        let schema = published(file);
        let definitions = schema["$defs"].as_object().unwrap();
        for (of, definition) in
            definitions.iter().map(|(name, d)| (name.as_str(), d)).chain([(file, &schema)])
        {
            assert!(definition["title"].is_string() && definition["description"].is_string(), "{of}");
            let Some(properties) = definition["properties"].as_object() else { continue };
            assert_eq!(definition["additionalProperties"], false, "{of}");
            for (name, field) in properties {
                fields += 1;
                assert!(field["title"].is_string(), "{of}.{name} has no title");
                let description = field["description"].as_str().unwrap_or_default();
                let is_number = |schema: &Value| {
                    let types = schema["type"].to_string();
                    types.contains("number") || types.contains("integer")
                };
                let is_numeric =
                    [field, &field["items"], &field["additionalProperties"]].into_iter().any(is_number);
                assert!(!description.is_empty(), "{of}.{name} has no description");
                let has_unit = units.iter().any(|unit| description.contains(unit));
                assert!(!is_numeric || has_unit, "{of}.{name} has no unit: {description}");
            }
        }
    }
    assert!(fields > 60, "only {fields}");
}

#[test]
fn real_plans_keep_to_the_schema() {
    let judge = Judge::of("plan.schema.json");
    let folder = tempfile::tempdir().unwrap();
    for (call, status) in [
        ("plan cube --strategy paper -o -", 0),
        ("plan cube --strategy best --attempts 400 --top 3 -o -", 0),
        ("plan cylinder --strategy paper --arm none --table none -o -", 0),
        ("plan mouse --strategy best --attempts 400 --arm none --top 3 -o -", 0),
        ("plan cube --strategy paper --friction 0 --attempts 20 -o -", 1),
    ] {
        let plan = prehend(folder.path(), call).ends_with(status).json();
        judge.agrees(&plan);
        assert_eq!(plan["grasps"].as_array().unwrap().is_empty(), status == 1, "{call}");
        let read: PlanDocument = serde_json::from_value(plan).unwrap();
        read.check().unwrap();
    }
}

#[test]
fn damaged_plans_are_refused_by_schema_and_reader() {
    let judge = Judge::of("plan.schema.json");
    let folder = tempfile::tempdir().unwrap();
    let good = prehend(folder.path(), "plan cube --strategy paper --top 1 -o -").ends_with(0).json();
    judge.agrees(&good);
    let refused = |plan: &Value, what: &str| {
        assert!(!judge.accepts(plan), "the schema accepts {what}");
        let read = serde_json::from_value::<PlanDocument>(plan.clone());
        assert!(!read.is_ok_and(|read| read.check().is_ok()), "the reader accepts {what}");
    };
    for (pointer, value) in [
        ("/format", json!("plan")),
        ("/version", json!(1)),
        ("/version", json!("2")),
        ("/attempts", json!(-1)),
        ("/force_closure", json!(1.5)),
        ("/rejected/not-on-pad", json!("many")),
        ("/grasps", json!({})),
        ("/table_height_m", json!("low")),
        ("/object/mass_kg", json!(0)),
        ("/object/friction", json!(-0.4)),
        ("/object/torque_scale_m", json!(-1)),
        ("/object/watertight", json!("yes")),
        ("/object/base_from_object/position", json!([0, 0])),
        ("/object/center_of_mass", json!([0, 0, null])),
        ("/object/colour", json!("red")),
        ("/grasps/0/approach_site/orientation_wxyz", json!([1, 0, 0])),
        ("/grasps/0/pregrasp/thumb_flexion", json!("bent")),
        ("/grasps/0/contacts/0/friction", json!(-1)),
        ("/grasps/0/contacts/0/torsional_m", json!(-1)),
        ("/grasps/0/contacts/0/squeeze_force_n", json!([1, 2, 3, 4])),
        ("/grasps/0/arm_motion/lift", json!([])),
        ("/grasps/0/arm_motion/lift/0/q_rad", json!([0, 0, 0, 0, 0])),
        ("/grasps/0/arm_motion/lift/0/tau_nm", json!([0, 0, 0, 0, 0, 0])),
        ("/grasps/0/finger_motion/knots/0/t_s", json!(null)),
        ("/grasps/0/finger_motion/contact_s", json!(-1)),
        ("/grasps/0/finger_motion/knots/1/t_s", json!(-1)),
        ("/object/mesh_sha256", json!("x")),
        ("/hand/sha256", json!("A".repeat(64))),
        ("/grasps/0/quality/epsilon", json!(null)),
    ] {
        let mut plan = good.clone();
        let (parent, key) = pointer.rsplit_once('/').unwrap();
        match plan.pointer_mut(pointer) {
            Some(place) => *place = value.clone(),
            None => plan.pointer_mut(parent).unwrap()[key] = value.clone(),
        }
        refused(&plan, &format!("{pointer} {value}"));
    }
    // Every field that may not be null is missed.
    let mut missed = 0;
    for at in [
        "",
        "/hand",
        "/object",
        "/settings",
        "/grasps/0",
        "/grasps/0/quality",
        "/grasps/0/contacts/0",
        "/grasps/0/grasp_site",
    ] {
        for (field, value) in good.pointer(at).unwrap().as_object().unwrap() {
            let mut plan = good.clone();
            plan.pointer_mut(at).unwrap().as_object_mut().unwrap().remove(field);
            let is_optional = judge.accepts(&plan);
            assert_eq!(
                is_optional,
                serde_json::from_value::<PlanDocument>(plan).is_ok(),
                "{at}/{field} {value}"
            );
            missed += usize::from(!is_optional);
        }
    }
    assert!(missed > 40, "only {missed} fields are needed");
}

#[test]
fn contacts_are_judged_by_schema_as_by_the_reader() {
    let judge = Judge::of("contacts.schema.json");
    let contact = json!({"point": [0.03, 0, 0], "normal": [-2, 0, 0], "friction": 0.4});
    let with = |more: Value| {
        let mut document =
            json!({"contacts": [contact, contact], "center_of_mass": [0, 0, 0], "torque_scale_m": 0.06});
        document.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        document
    };
    let six = json!([1, 1, 2, 0.02, 0.02, 0.01]);
    for (document, is_good) in [
        (json!({"contacts": []}), true),
        (with(json!({})), true),
        (with(json!({"torque_scale_m": null, "task": null})), true),
        (
            with(
                json!({"object": {"vertices": [[0, 0, 1]], "bounding_box": {"min": [0, 0, 0], "max": [1, 1, 1]}, "surface": [contact]}}),
            ),
            true,
        ),
        (with(json!({"task": {"semi_axes": six, "load": [0, 0, -2, 0, 0, 0]}})), true),
        (with(json!({"task": {"semi_axes": six, "matrix": null}})), true),
        (json!({}), false),
        (json!([]), false),
        (with(json!({"mass": 1})), false),
        (with(json!({"torque_scale_m": 0})), false),
        (with(json!({"center_of_mass": [0, 0]})), false),
        (with(json!({"contacts": vec![contact.clone(); 1001]})), false),
        (with(json!({"contacts": [{"point": [0, 0, 0], "normal": [0, 0, 1]}]})), false),
        (with(json!({"contacts": [{"point": [0, 0, 0], "normal": [0, 0, 1], "friction": -1}]})), false),
        (
            with(
                json!({"contacts": [{"point": [0, 0, 0], "normal": [0, 0, 1], "friction": 1, "torsional_m": -1}]}),
            ),
            false,
        ),
        (
            with(
                json!({"contacts": [{"point": [0, 0, 0], "normal": [0, 0, 1], "friction": 1, "max_force_n": 0}]}),
            ),
            false,
        ),
        (with(json!({"object": {"bounding_box": {"min": [0, 0, 0]}}})), false),
        (with(json!({"task": {"load": [0, 0, -2, 0, 0, 0]}})), false),
        (with(json!({"task": {"semi_axes": six, "matrix": vec![six.clone(); 6]}})), false),
    ] {
        assert_eq!(judge.accepts(&document), is_good, "schema: {document}");
        assert_eq!(GraspDocument::from_json(&document.to_string()).is_ok(), is_good, "reader: {document}");
    }
}
