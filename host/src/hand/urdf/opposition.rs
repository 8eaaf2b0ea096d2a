//! Which finger the others close against, in which order they stand, and how the palm lies.

use nalgebra::{Point3, Rotation3, Unit, Vector3};

use super::flexion;
use crate::hand::{Finger, Joint, Posture};

/// Places of each joint that turns or spreads a finger, and of its closing, while an opposing finger is looked for.
const TURN_PLACES: usize = 3;
const CLOSING_PLACES: usize = 7;

/// Tips farther apart than this do not oppose, metres.
const APART_MAX_M: f64 = 0.2;

/// A finger whose pads face those of the others better by this opposes them; otherwise the first in the file.
const BETTER: f64 = 0.02;

/// A tip and its pad in one posture.
#[derive(Debug, Clone)]
pub(super) struct State {
    pub(super) posture: Posture,
    pub(super) tip: Point3<f64>,
    pub(super) pad: Vector3<f64>,
}

impl State {
    pub(super) fn new(finger: &Finger, posture: &Posture) -> Self {
        let frames = finger.frames(posture);
        let pad = finger.pad_in_palm(&frames).into_inner();
        Self { posture: *posture, tip: finger.tip_in_palm(&frames), pad }
    }
}

/// Joints that several fingers share and that do not close them: set once for all.
pub(super) fn shared(joints: &[Joint], fingers: &[Finger]) -> Vec<usize> {
    (0..joints.len())
        .filter(|&joint| joints[joint].flexes.is_none() && flexion::users(fingers, joint) > 1)
        .collect()
}

/// Joints that turn or spread one finger alone.
pub(super) fn turning(joints: &[Joint], finger: &Finger, shared: &[usize]) -> Vec<usize> {
    let own = finger.joints().iter().copied();
    own.filter(|joint| joints[*joint].flexes.is_none() && !shared.contains(joint)).collect()
}

/// `n` values over a joint's range, its ends a tenth inside unless it is held there.
pub(super) fn places(joint: &Joint, n: usize) -> Vec<f64> {
    let inset = if joint.is_held { 0.0 } else { 0.1 };
    (0..n)
        .map(|k| {
            let share = if n < 2 { 0.5 } else { k as f64 / (n - 1) as f64 };
            joint.lower_rad + (joint.upper_rad - joint.lower_rad) * (inset + share * (1.0 - 2.0 * inset))
        })
        .collect()
}

/// Every combination of values for some joints, over a posture.
pub(super) fn combined(from: &[Posture], joint: usize, values: &[f64]) -> Vec<Posture> {
    let set = |posture: &Posture, value: f64| {
        let mut posture = *posture;
        posture[joint] = value;
        posture
    };
    from.iter().flat_map(|posture| values.iter().map(move |value| set(posture, *value))).collect()
}

/// Settings of the shared joints, over the posture with every joint in the middle.
pub(super) fn settings(joints: &[Joint], shared: &[usize]) -> Vec<Posture> {
    let mut settings = vec![flexion::middle(joints)];
    // Beyond three shared joints the rest stay in the middle.
    for &joint in shared.iter().take(3) {
        let n = if shared.len() == 1 { 5 } else { 3 };
        settings = combined(&settings, joint, &places(&joints[joint], n));
    }
    settings
}

/// The finger whose pad can face those of all others best, by the mean over them.
pub(super) fn opposing(joints: &[Joint], fingers: &[Finger]) -> usize {
    let shared = shared(joints, fingers);
    let mut best = (0, f64::NEG_INFINITY);
    let mut scores = vec![f64::NEG_INFINITY; fingers.len()];
    for setting in settings(joints, &shared) {
        let states: Vec<Vec<State>> =
            fingers.iter().map(|finger| coarse_states(joints, finger, &shared, &setting)).collect();
        for (own, score) in scores.iter_mut().enumerate() {
            for state in &states[own] {
                let others = (0..fingers.len()).filter(|other| *other != own);
                let sum: f64 = others.map(|other| faced(state, &states[other])).sum();
                *score = score.max(sum / (fingers.len() - 1).max(1) as f64);
            }
        }
    }
    for (finger, score) in scores.into_iter().enumerate() {
        if score > best.1 + BETTER {
            best = (finger, score);
        }
    }
    best.0
}

fn coarse_states(joints: &[Joint], finger: &Finger, shared: &[usize], setting: &Posture) -> Vec<State> {
    let mut postures = vec![*setting];
    for joint in turning(joints, finger, shared).into_iter().take(3) {
        postures = combined(&postures, joint, &places(&joints[joint], TURN_PLACES));
    }
    let mut states = Vec::new();
    for posture in &postures {
        let open = flexion::open(joints, finger, posture);
        let closed = flexion::closed(joints, finger, posture);
        for k in 0..CLOSING_PLACES {
            let share = 0.8 * k as f64 / (CLOSING_PLACES - 1) as f64;
            states.push(State::new(finger, &(open + (closed - open) * share)));
        }
    }
    states
}

/// How well a pad is faced by the best of some others: the lesser cosine of either to the line between them.
fn faced(own: &State, others: &[State]) -> f64 {
    let mut best = 0.0_f64;
    for other in others {
        let line = other.tip - own.tip;
        let apart_m = line.norm();
        if !(1e-3..=APART_MAX_M).contains(&apart_m) {
            continue;
        }
        best = best.max((own.pad.dot(&line)).min(-other.pad.dot(&line)) / apart_m);
    }
    best
}

/// Where a finger begins: its first joint, palm frame.
pub(super) fn root(finger: &Finger) -> Vector3<f64> {
    finger.segments()[0].parent_from_segment().translation.vector
}

/// Direction across the fingers other than the opposing one: along their roots, or for a single one its last axis.
pub(super) fn lateral(joints: &[Joint], fingers: &[Finger], opposing: usize) -> Unit<Vector3<f64>> {
    let others: Vec<usize> = (0..fingers.len()).filter(|finger| *finger != opposing).collect();
    let mut longest = Vector3::zeros();
    for (i, a) in others.iter().enumerate() {
        for b in &others[i + 1..] {
            let apart = root(&fingers[*a]) - root(&fingers[*b]);
            if apart.norm() > longest.norm() + 1e-9 {
                longest = apart;
            }
        }
    }
    Unit::try_new(longest, 1e-3).unwrap_or_else(|| {
        let Some(finger) = others.first().map(|&other| &fingers[other]) else { return Vector3::y_axis() };
        let last = finger.segments().len() - 1;
        let frame = *finger.frames(&flexion::middle(joints)).palm_from_segment(last);
        match finger.segments()[last].motion() {
            crate::hand::finger::Motion::Turning => frame.rotation * finger.segments()[last].axis(),
            // Across the way of a sliding finger and its length.
            crate::hand::finger::Motion::Sliding => {
                let way = frame.rotation * finger.segments()[last].axis().into_inner();
                let along = finger.tip_in_palm(&finger.frames(&flexion::middle(joints))).coords;
                Unit::try_new(way.cross(&along), 1e-9).unwrap_or_else(Vector3::y_axis)
            }
        }
    })
}

/// The opposing finger first, then the others in the order of their roots, from the side on which that one stands.
pub(super) fn order(joints: &[Joint], fingers: &[Finger], opposing: usize) -> Vec<usize> {
    let lateral = lateral(joints, fingers, opposing);
    let along = |finger: usize| root(&fingers[finger]).dot(&lateral);
    let mut others: Vec<usize> = (0..fingers.len()).filter(|finger| *finger != opposing).collect();
    let first_in_file = others.first().copied();
    others.sort_by(|&a, &b| along(a).total_cmp(&along(b)));
    let mean = others.iter().map(|&finger| along(finger)).sum::<f64>() / others.len().max(1) as f64;
    let aside_m = along(opposing) - mean;
    let is_reversed =
        if aside_m.abs() > 1e-4 { aside_m > 0.0 } else { first_in_file == others.last().copied() };
    if is_reversed {
        others.reverse();
    }
    std::iter::once(opposing).chain(others).collect()
}

/// The rotation of the palm frame in the palm's link: quarter turns, so that z points along the stretched fingers and x
/// out of the grasping side as nearly as the link's axes do.
pub(super) fn link_from_palm(joints: &[Joint], fingers: &[Finger], opposing: usize) -> Rotation3<f64> {
    let middle = flexion::middle(joints);
    let (mut along, mut pads) = (Vector3::zeros(), Vector3::zeros());
    let mut roots = Vector3::zeros();
    for (i, finger) in fingers.iter().enumerate() {
        let open = State::new(finger, &flexion::open(joints, finger, &middle));
        along += (open.tip.coords - root(finger)).try_normalize(1e-6).unwrap_or_default();
        if i != opposing {
            pads += open.pad;
            roots += root(finger);
        }
    }
    let others = (fingers.len() - 1).max(1) as f64;
    // Prismatic fingers may stand still at their roots' height: then whatever axis reaches farthest.
    let z = nearest_axis(&along, None);
    let across = |v: Vector3<f64>| v - z * z.dot(&v);
    let pads = across(pads / others);
    let to_opposing = across(root(&fingers[opposing]) - roots / others);
    let x = if pads.norm() > 0.3 { pads } else { to_opposing };
    let x = if x.norm() > 1e-6 { nearest_axis(&x, Some(&z)) } else { nearest_axis(&z.yzx(), Some(&z)) };
    Rotation3::from_matrix_unchecked(nalgebra::Matrix3::from_columns(&[x, z.cross(&x), z]))
}

/// The signed coordinate axis nearest to a direction, not along `other_than`.
pub(super) fn nearest_axis(direction: &Vector3<f64>, other_than: Option<&Vector3<f64>>) -> Vector3<f64> {
    let axes = [Vector3::z(), Vector3::x(), Vector3::y(), -Vector3::z(), -Vector3::x(), -Vector3::y()];
    let mut best = (f64::NEG_INFINITY, Vector3::z());
    for axis in axes {
        let cosine = axis.dot(direction);
        if other_than.is_none_or(|other| other.dot(&axis).abs() < 0.5) && cosine > best.0 + 1e-9 {
            best = (cosine, axis);
        }
    }
    best.1
}
