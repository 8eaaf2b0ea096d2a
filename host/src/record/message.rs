//! The messages themselves.

use nalgebra::{Isometry3, Point3, Unit, UnitQuaternion, Vector3, convert};
use protocol::ids::{FingerId, JointId};
use serde_json::{Value, json};

use super::RecordedScene;
use crate::exec::{Event, EventKind, Execution, TraceSample, Verdict};
use crate::hand::{Hand, Posture};

/// Frame of the arm's base, in which everything stands.
const BASE: &str = "base";
/// Frame of the palm.
const PALM: &str = "palm";
/// Frame of the object.
const OBJECT: &str = "object";

/// Length of an arrow for a newton, metres.
const ARROW_M_PER_N: f64 = 0.01;
/// Forces below this have no arrow: the sensors' noise.
const ARROW_LEAST_N: f64 = 0.2;
/// Edge of the table that is drawn, metres.
const TABLE_M: f64 = 0.6;

/// Levels of `foxglove.Log`.
const INFO: u32 = 2;
const WARNING: u32 = 3;

type Rgb = [f64; 3];
const TABLE_COLOR: Rgb = [0.88, 0.89, 0.88];
const PALM_COLOR: Rgb = [0.38, 0.43, 0.51];
const FINGER_COLOR: Rgb = [0.55, 0.61, 0.71];
const OBJECT_COLOR: Rgb = [0.87, 0.77, 0.59];
const FORCE_COLOR: Rgb = [0.84, 0.28, 0.24];

/// Time since the start in whole nanoseconds.
pub(super) fn nanoseconds(time_s: f64) -> u64 {
    (time_s.max(0.0) * 1e9).round() as u64
}

fn time(time_s: f64) -> Value {
    let ns = nanoseconds(time_s);
    json!({ "sec": ns / 1_000_000_000, "nsec": ns % 1_000_000_000 })
}

fn vector(v: &Vector3<f64>) -> Value {
    json!({ "x": v.x, "y": v.y, "z": v.z })
}

fn quaternion(q: &UnitQuaternion<f64>) -> Value {
    json!({ "x": q.i, "y": q.j, "z": q.k, "w": q.w })
}

fn pose(pose: &Isometry3<f64>) -> Value {
    json!({ "position": vector(&pose.translation.vector), "orientation": quaternion(&pose.rotation) })
}

fn color([r, g, b]: Rgb) -> Value {
    json!({ "r": r, "g": g, "b": b, "a": 1.0 })
}

fn transform(time_s: f64, [parent, child]: [&str; 2], parent_from_child: &Isometry3<f64>) -> Value {
    json!({
        "timestamp": time(time_s),
        "parent_frame_id": parent,
        "child_frame_id": child,
        "translation": vector(&parent_from_child.translation.vector),
        "rotation": quaternion(&parent_from_child.rotation),
    })
}

/// Measured angles as a posture.
fn measured(sample: &TraceSample) -> Posture {
    let mut posture = Posture::ZERO;
    posture.0[..sample.measured_rad.len()].copy_from_slice(&sample.measured_rad);
    posture
}

/// `foxglove.FrameTransforms`: where everything is.
pub(super) fn transforms(hand: &Hand, sample: &TraceSample) -> Value {
    let mut transforms = vec![transform(sample.time_s, [BASE, PALM], &sample.base_from_palm)];
    if let Some(base_from_object) = &sample.base_from_object {
        transforms.push(transform(sample.time_s, [BASE, OBJECT], base_from_object));
    }
    let posture = measured(sample);
    for finger in &hand.fingers {
        let frames = finger.frames(&posture);
        let (mut parent, mut palm_from_parent) = (PALM, Isometry3::identity());
        for (index, segment) in finger.segments().iter().enumerate() {
            let palm_from_segment: Isometry3<f64> = convert(*frames.palm_from_segment(index));
            let parent_from_segment = palm_from_parent.inverse() * palm_from_segment;
            transforms.push(transform(sample.time_s, [parent, &segment.link], &parent_from_segment));
            (parent, palm_from_parent) = (&segment.link, palm_from_segment);
        }
    }
    json!({ "transforms": transforms })
}

/// An entity of a scene; it stays until another of the same id replaces it.
fn entity(time_s: f64, [frame, id]: [&str; 2], primitives: (&str, Vec<Value>)) -> Value {
    let mut entity = json!({
        "timestamp": time(time_s),
        "frame_id": frame,
        "id": id,
        "lifetime": { "sec": 0, "nsec": 0 },
        "frame_locked": true,
        "metadata": [],
        "arrows": [],
        "cubes": [],
        "spheres": [],
        "triangles": [],
    });
    entity[primitives.0] = primitives.1.into();
    entity
}

fn solid(center: &Isometry3<f64>, size_m: &Vector3<f64>, rgb: Rgb) -> Value {
    json!({ "pose": pose(center), "size": vector(size_m), "color": color(rgb) })
}

/// `foxglove.SceneUpdate`: what there is to see, each thing in its own frame.
pub(super) fn things(scene: &RecordedScene<'_>) -> Value {
    let mut entities = Vec::new();
    if let Some(height_m) = scene.table_height_m {
        const THICK_M: f64 = 0.01;
        let size_m = Vector3::new(TABLE_M, TABLE_M, THICK_M);
        let center = Isometry3::translation(0.5 * TABLE_M + 0.1, 0.0, height_m - 0.5 * THICK_M);
        entities.push(entity(0.0, [BASE, "table"], ("cubes", vec![solid(&center, &size_m, TABLE_COLOR)])));
    }
    let hand = scene.hand;
    let boxes =
        hand.palm.iter().map(|part| solid(&part.palm_from_box, &(2.0 * part.half_extents_m), PALM_COLOR));
    entities.push(entity(0.0, [PALM, PALM], ("cubes", boxes.collect())));
    for finger in &hand.fingers {
        for (index, segment) in finger.segments().iter().enumerate() {
            let beads = finger.beads().iter().filter(|bead| bead.segment == index).map(|bead| {
                let center = Isometry3::from(bead.center_in_segment.coords);
                solid(&center, &Vector3::repeat(2.0 * bead.radius_m), FINGER_COLOR)
            });
            let beads: Vec<Value> = beads.collect();
            if !beads.is_empty() {
                entities.push(entity(0.0, [&segment.link, &segment.link], ("spheres", beads)));
            }
        }
    }
    let points: Vec<Value> = scene.object.vertices().iter().map(|p| vector(&p.coords)).collect();
    let indices: Vec<u32> = scene.object.faces().iter().flatten().copied().collect();
    let triangles = json!({
        "pose": pose(&Isometry3::identity()),
        "points": points,
        "color": color(OBJECT_COLOR),
        "colors": [],
        "indices": indices,
    });
    let mut object = entity(0.0, [OBJECT, OBJECT], ("triangles", vec![triangles]));
    object["metadata"] = json!([{ "key": "name", "value": scene.object_name }]);
    entities.push(object);
    json!({ "deletions": [], "entities": entities })
}

/// `foxglove.SceneUpdate`: the forces on the fingertips.
pub(super) fn forces(hand: &Hand, sample: &TraceSample) -> Value {
    let arrows = hand.fingers.iter().zip(&sample.tip_wrench).filter_map(|(finger, wrench)| {
        let frame = &finger.segments().last()?.link;
        let newtons = wrench.force.norm();
        let id = format!("force {}", finger.name);
        let arrow = Unit::try_new(wrench.force, ARROW_LEAST_N).map(|along| {
            let tip: Point3<f64> = finger.tip_in_last();
            // Opposite to x any turn about y will do.
            let turn = UnitQuaternion::rotation_between(&Vector3::x(), &along).unwrap_or_else(|| {
                UnitQuaternion::from_axis_angle(&Vector3::y_axis(), core::f64::consts::PI)
            });
            json!({
                "pose": pose(&Isometry3::from_parts(tip.into(), turn)),
                "shaft_length": ARROW_M_PER_N * newtons,
                "shaft_diameter": 0.003,
                "head_length": 0.006,
                "head_diameter": 0.006,
                "color": color(FORCE_COLOR),
            })
        });
        Some(entity(sample.time_s, [frame, &id], ("arrows", arrow.into_iter().collect())))
    });
    json!({ "deletions": [], "entities": arrows.collect::<Vec<Value>>() })
}

/// `prehend.JointStates`.
pub(super) fn joints(sample: &TraceSample) -> Value {
    let joints = JointId::ALL.iter().enumerate().map(|(j, joint)| {
        json!({
            "name": joint.name(),
            "position_rad": sample.measured_rad[j],
            "commanded_rad": sample.commanded_rad[j],
            "torque_nm": sample.joint_torque_nm[j],
        })
    });
    json!({
        "timestamp": time(sample.time_s),
        "phase": sample.phase.name(),
        "joints": joints.collect::<Vec<Value>>(),
    })
}

/// `prehend.TipWrenches`.
pub(super) fn wrenches(hand: &Hand, sample: &TraceSample) -> Value {
    let tips = FingerId::ALL.iter().zip(&hand.fingers).map(|(finger, body)| {
        let wrench = &sample.tip_wrench[finger.index()];
        json!({
            "finger": finger.name(),
            "frame_id": body.segments().last().map_or("", |segment| segment.link.as_str()),
            "force_n": vector(&wrench.force),
            "moment_nm": vector(&wrench.moment),
            "filtered_n": sample.tip_force_n[finger.index()],
        })
    });
    json!({ "timestamp": time(sample.time_s), "tips": tips.collect::<Vec<Value>>() })
}

fn log(time_s: f64, level: u32, message: &str) -> Value {
    json!({
        "timestamp": time(time_s),
        "level": level,
        "message": message,
        "name": "prehend",
        "file": "",
        "line": 0,
    })
}

/// `foxglove.Log`: something happened.
pub(super) fn event(event: &Event) -> Value {
    let text = match event.kind {
        EventKind::Trouble(trouble) => format!("{}: {}", trouble.name(), trouble.explanation()),
        kind => kind.to_string(),
    };
    let level = match event.kind {
        EventKind::Phase(_) | EventKind::Contact(_) => INFO,
        _ => WARNING,
    };
    log(event.time_s, level, &text)
}

/// `foxglove.Log`: how it ended.
pub(super) fn verdict(execution: &Execution) -> Value {
    let level = if execution.verdict == Verdict::Held { INFO } else { WARNING };
    log(execution.duration_s, level, &format!("verdict: {}", execution.verdict.name()))
}
