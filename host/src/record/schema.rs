//! JSON Schemas of the messages. Names and fields of `foxglove.*` are those that Foxglove publishes
//! (<https://docs.foxglove.dev/docs/sdk/schemas>), as far as they are used here; `prehend.*` are this project's.

use serde_json::{Map, Value, json};

/// An object with these fields.
fn object<const N: usize>(title: &str, fields: [(&str, Value); N]) -> Value {
    let properties: Map<String, Value> =
        fields.into_iter().map(|(name, field)| (name.to_owned(), field)).collect();
    json!({ "title": title, "type": "object", "properties": properties })
}

fn list(items: Value) -> Value {
    json!({ "type": "array", "items": items })
}

fn number() -> Value {
    json!({ "type": "number" })
}

fn text() -> Value {
    json!({ "type": "string" })
}

fn time() -> Value {
    object("time", [("sec", json!({ "type": "integer", "minimum": 0 })), ("nsec", nanoseconds())])
}

fn duration() -> Value {
    object("duration", [("sec", json!({ "type": "integer" })), ("nsec", nanoseconds())])
}

fn nanoseconds() -> Value {
    json!({ "type": "integer", "minimum": 0, "maximum": 999_999_999 })
}

fn vector() -> Value {
    object("foxglove.Vector3", ["x", "y", "z"].map(|name| (name, number())))
}

fn point() -> Value {
    object("foxglove.Point3", ["x", "y", "z"].map(|name| (name, number())))
}

fn quaternion() -> Value {
    object("foxglove.Quaternion", ["x", "y", "z", "w"].map(|name| (name, number())))
}

fn pose() -> Value {
    object("foxglove.Pose", [("position", vector()), ("orientation", quaternion())])
}

fn color() -> Value {
    object("foxglove.Color", ["r", "g", "b", "a"].map(|name| (name, number())))
}

/// `foxglove.FrameTransforms`.
pub(super) fn frame_transforms() -> Value {
    let transform = object(
        "foxglove.FrameTransform",
        [
            ("timestamp", time()),
            ("parent_frame_id", text()),
            ("child_frame_id", text()),
            ("translation", vector()),
            ("rotation", quaternion()),
        ],
    );
    object("foxglove.FrameTransforms", [("transforms", list(transform))])
}

/// `foxglove.SceneUpdate`, with the primitives that are used here.
pub(super) fn scene_update() -> Value {
    let solid = |title| object(title, [("pose", pose()), ("size", vector()), ("color", color())]);
    let arrow = object(
        "foxglove.ArrowPrimitive",
        [
            ("pose", pose()),
            ("shaft_length", number()),
            ("shaft_diameter", number()),
            ("head_length", number()),
            ("head_diameter", number()),
            ("color", color()),
        ],
    );
    let triangles = object(
        "foxglove.TriangleListPrimitive",
        [
            ("pose", pose()),
            ("points", list(point())),
            ("color", color()),
            ("colors", list(color())),
            ("indices", list(json!({ "type": "integer", "minimum": 0 }))),
        ],
    );
    let pair = object("foxglove.KeyValuePair", [("key", text()), ("value", text())]);
    let entity = object(
        "foxglove.SceneEntity",
        [
            ("timestamp", time()),
            ("frame_id", text()),
            ("id", text()),
            ("lifetime", duration()),
            ("frame_locked", json!({ "type": "boolean" })),
            ("metadata", list(pair)),
            ("arrows", list(arrow)),
            ("cubes", list(solid("foxglove.CubePrimitive"))),
            ("spheres", list(solid("foxglove.SpherePrimitive"))),
            ("triangles", list(triangles)),
        ],
    );
    let deletion = object(
        "foxglove.SceneEntityDeletion",
        [("timestamp", time()), ("type", json!({ "type": "integer" })), ("id", text())],
    );
    object("foxglove.SceneUpdate", [("deletions", list(deletion)), ("entities", list(entity))])
}

/// `foxglove.Log`.
pub(super) fn log() -> Value {
    object(
        "foxglove.Log",
        [
            ("timestamp", time()),
            ("level", json!({ "type": "integer", "minimum": 0, "maximum": 5 })),
            ("message", text()),
            ("name", text()),
            ("file", text()),
            ("line", json!({ "type": "integer", "minimum": 0 })),
        ],
    )
}

/// `prehend.JointStates`.
pub(super) fn joint_states() -> Value {
    let joint = object(
        "prehend.JointState",
        [("name", text()), ("position_rad", number()), ("commanded_rad", number()), ("torque_nm", number())],
    );
    object("prehend.JointStates", [("timestamp", time()), ("phase", text()), ("joints", list(joint))])
}

/// `prehend.TipWrenches`.
pub(super) fn tip_wrenches() -> Value {
    let tip = object(
        "prehend.TipWrench",
        [
            ("finger", text()),
            ("frame_id", text()),
            ("force_n", vector()),
            ("moment_nm", vector()),
            ("filtered_n", number()),
        ],
    );
    object("prehend.TipWrenches", [("timestamp", time()), ("tips", list(tip))])
}
