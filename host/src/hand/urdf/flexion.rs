//! How fingers close, read off their kinematics.
//!
//! A finger flexes about its last axis: joints parallel to that one flex it, the others spread or turn it. It closes to
//! the side to which it curls: from stretched, joints of a finger turn much farther to the side of the pad than to the
//! back. Where that does not decide (one flexing joint, or sliding ones), it closes to where its tip comes nearer to the
//! other tips. The pad is where the tip goes as the last joint closes.

use nalgebra::{Unit, Vector3};

use super::error::Problem;
use super::overrides::{Flexion, Overrides};
use crate::hand::finger::Motion;
use crate::hand::{Finger, Joint, Posture};

/// Axes within this of the last one flex with it: the cosine of 30 degrees.
const PARALLEL_COSINE: f64 = 0.866;

/// A finger curls to one side when it turns this much farther there.
const CURL_RATIO: f64 = 2.0;

/// Places at which a joint is looked at.
const PLACES: usize = 13;

/// Sets [`Joint::flexes`], [`Joint::is_held`] and the fingers' pads.
pub(super) fn find(
    joints: &mut [Joint],
    fingers: &mut Vec<Finger>,
    overrides: &Overrides,
    warnings: &mut Vec<String>,
) -> Result<(), Problem> {
    let middle = middle(joints);
    let mut votes: Vec<Vec<f64>> = vec![Vec::new(); joints.len()];
    for (i, finger) in fingers.iter().enumerate() {
        let flexing = flexing(finger, &middle);
        let sign = closing_sign(joints, fingers, i, &flexing, &middle);
        for &joint in finger.joints() {
            // The last segment that it moves decides, which the pad is on or nearest to.
            let of_joint =
                flexing.iter().rev().find(|(segment, _)| finger.segments()[*segment].joint == joint);
            if let Some((segment, sense)) = of_joint {
                votes[joint].push(sign * sense * finger.segments()[*segment].multiplier.signum());
            }
        }
    }
    for (i, joint) in joints.iter_mut().enumerate() {
        let sum: f64 = votes[i].iter().sum();
        if votes[i].len() > 1 && sum.abs() < votes[i].len() as f64 - 0.5 {
            warnings.push(format!("joint '{}' closes one finger as it opens another", joint.name));
        }
        joint.flexes = votes[i].first().map(|vote| if sum == 0.0 { *vote > 0.0 } else { sum > 0.0 });
    }
    // What a person says of closing counts when it is asked which joints only spread.
    override_flexion(joints, overrides)?;
    for (i, joint) in joints.iter_mut().enumerate() {
        joint.is_held = users(fingers, i) > 1 && joint.flexes.is_none();
    }
    override_held(joints, overrides)?;
    let signed: Vec<Finger> = fingers.drain(..).map(|finger| with_pad(finger, joints, &middle)).collect();
    fingers.extend(signed);
    Ok(())
}

/// How many fingers use a joint.
pub(super) fn users(fingers: &[Finger], joint: usize) -> usize {
    fingers.iter().filter(|finger| finger.joints().contains(&joint)).count()
}

/// The independent joint that a key of the overrides names.
fn named<'j>(joints: &'j mut [Joint], key: &str, name: &str) -> Result<&'j mut Joint, Problem> {
    joints.iter_mut().find(|joint| joint.name == name).ok_or_else(|| Problem::Unknown {
        key: key.to_owned(),
        what: "joint that moves a finger by itself named",
        name: name.to_owned(),
    })
}

fn override_flexion(joints: &mut [Joint], overrides: &Overrides) -> Result<(), Problem> {
    for (name, flexion) in &overrides.flexion {
        named(joints, "flexion", name)?.flexes = match flexion {
            Flexion::Upper => Some(true),
            Flexion::Lower => Some(false),
            Flexion::None => None,
        };
    }
    Ok(())
}

fn override_held(joints: &mut [Joint], overrides: &Overrides) -> Result<(), Problem> {
    for name in &overrides.held {
        named(joints, "held", name)?.is_held = true;
    }
    Ok(())
}

/// Every joint in the middle of its limits.
pub(super) fn middle(joints: &[Joint]) -> Posture {
    let mut posture = Posture::ZERO;
    for (i, joint) in joints.iter().enumerate() {
        posture[i] = 0.5 * (joint.lower_rad + joint.upper_rad);
    }
    posture
}

/// Segments that flex a finger, with 1 where they turn about the last axis and -1 where about its opposite.
fn flexing(finger: &Finger, middle: &Posture) -> Vec<(usize, f64)> {
    let frames = finger.frames(middle);
    let last = finger.segments().len() - 1;
    let axis = |segment: usize| {
        frames.palm_from_segment(segment).rotation * finger.segments()[segment].axis().into_inner()
    };
    let motion = finger.segments()[last].motion();
    (0..=last)
        .filter(|&segment| finger.segments()[segment].motion() == motion)
        .map(|segment| (segment, axis(segment).dot(&axis(last))))
        .filter(|(_, cosine)| cosine.abs() >= PARALLEL_COSINE)
        .map(|(segment, cosine)| (segment, cosine.signum()))
        .collect()
}

/// 1 when a finger closes by turning about its last axis as that points, -1 when the other way.
fn closing_sign(
    joints: &[Joint],
    fingers: &[Finger],
    index: usize,
    flexing: &[(usize, f64)],
    middle: &Posture,
) -> f64 {
    let finger = &fingers[index];
    if let Some(sign) = curl_sign(joints, finger, flexing, middle) {
        return sign;
    }
    // Where all its flexing joints go one way, and the other.
    let mut ends = [*middle; 2];
    for (segment, sense) in flexing {
        let segment = &finger.segments()[*segment];
        let joint = &joints[segment.joint];
        let is_up = sense * segment.multiplier > 0.0;
        ends[0][segment.joint] = if is_up { joint.lower_rad } else { joint.upper_rad };
        ends[1][segment.joint] = if is_up { joint.upper_rad } else { joint.lower_rad };
    }
    // A drive that moves several fingers moves the others too.
    let apart_m = |posture: &Posture| {
        let tip = |finger: &Finger| finger.tip_in_palm(&finger.frames(posture));
        let own = tip(finger);
        let others = fingers.iter().enumerate().filter(|(other, _)| *other != index);
        others.map(|(_, other)| (tip(other) - own).norm()).sum::<f64>()
    };
    if apart_m(&ends[1]) <= apart_m(&ends[0]) { 1.0 } else { -1.0 }
}

/// The side to which a finger curls: to which its joints turn farther from where it is longest.
fn curl_sign(joints: &[Joint], finger: &Finger, flexing: &[(usize, f64)], middle: &Posture) -> Option<f64> {
    let inner = flexing.get(1..)?;
    let last = finger.segments().len() - 1;
    if inner.is_empty() || finger.segments()[last].motion() == Motion::Sliding {
        return None;
    }
    let straight = stretched(joints, finger, flexing, middle);
    let mut room_rad = [0.0; 2];
    for (segment, sense) in inner {
        let segment = &finger.segments()[*segment];
        let joint = &joints[segment.joint];
        let at = straight[segment.joint];
        let turn = |to: f64| (to - at) * segment.multiplier * sense;
        for turned in [turn(joint.lower_rad), turn(joint.upper_rad)] {
            room_rad[usize::from(turned > 0.0)] += turned.abs();
        }
    }
    let [back, forth] = room_rad;
    if forth > CURL_RATIO * back {
        Some(1.0)
    } else if back > CURL_RATIO * forth {
        Some(-1.0)
    } else {
        None
    }
}

/// The posture with a finger's flexing joints where its tip is farthest from the first of them; joints that do not
/// change this stay.
fn stretched(joints: &[Joint], finger: &Finger, flexing: &[(usize, f64)], from: &Posture) -> Posture {
    let Some((first, _)) = flexing.first() else { return *from };
    let length_m = |posture: &Posture| {
        let frames = finger.frames(posture);
        let root = frames.palm_from_segment(*first).translation.vector;
        (finger.tip_in_palm(&frames).coords - root).norm()
    };
    let mut best = *from;
    // Coordinate by coordinate, twice around, then finer.
    for round in 0..6 {
        for (segment, _) in flexing {
            let index = finger.segments()[*segment].joint;
            let joint = &joints[index];
            let range = joint.upper_rad - joint.lower_rad;
            let half = 0.5 * range * 0.35f64.powi((round - 1).max(0));
            let center = if round < 2 { 0.5 * (joint.lower_rad + joint.upper_rad) } else { best[index] };
            for k in 0..PLACES {
                let share = 2.0 * k as f64 / (PLACES - 1) as f64 - 1.0;
                let mut tried = best;
                tried[index] = (center + share * half).clamp(joint.lower_rad, joint.upper_rad);
                if length_m(&tried) > length_m(&best) + 1e-9 {
                    best = tried;
                }
            }
        }
    }
    best
}

/// Joints that flex a finger, root first.
pub(super) fn flexing_joints(joints: &[Joint], finger: &Finger) -> Vec<usize> {
    finger.joints().iter().copied().filter(|&joint| joints[joint].flexes.is_some()).collect()
}

/// The open finger: its first flexing joint where closing begins, the others where the finger is longest, all a little
/// off; other joints as in `from`.
pub(super) fn open(joints: &[Joint], finger: &Finger, from: &Posture) -> Posture {
    /// Share of its range that a joint keeps from where the finger is straight or at a limit: there it is singular, and
    /// contacts are seldom good.
    const OFF: f64 = 0.06;
    let flexing: Vec<(usize, f64)> = (0..finger.segments().len())
        .filter(|&segment| joints[finger.segments()[segment].joint].flexes.is_some())
        .map(|segment| (segment, 1.0))
        .collect();
    let mut posture = stretched(joints, finger, &flexing, from);
    for (k, &index) in flexing_joints(joints, finger).iter().enumerate() {
        let joint = &joints[index];
        let closes_up = joint.flexes == Some(true);
        let off = OFF * (joint.upper_rad - joint.lower_rad) * if closes_up { 1.0 } else { -1.0 };
        let at = match (k, closes_up) {
            (0, true) => joint.lower_rad,
            (0, false) => joint.upper_rad,
            _ => posture[index],
        };
        posture[index] = (at + off).clamp(joint.lower_rad, joint.upper_rad);
    }
    posture
}

/// Where joints of a finger end when it closes.
pub(super) fn closed(joints: &[Joint], finger: &Finger, from: &Posture) -> Posture {
    let mut posture = *from;
    for index in flexing_joints(joints, finger) {
        let joint = &joints[index];
        posture[index] = if joint.flexes == Some(true) { joint.upper_rad } else { joint.lower_rad };
    }
    posture
}

/// The finger with its pad where the tip goes as its last closing joint closes.
fn with_pad(finger: Finger, joints: &[Joint], middle: &Posture) -> Finger {
    let frames = finger.frames(middle);
    let last = finger.segments().len() - 1;
    let tip = finger.tip_in_palm(&frames);
    // From the last joint towards the palm: one whose axis goes through the tip does not move it.
    let moved = (0..=last).rev().find_map(|k| {
        let segment = &finger.segments()[k];
        let sign = if joints[segment.joint].flexes? { 1.0 } else { -1.0 } * segment.multiplier.signum();
        let frame = frames.palm_from_segment(k);
        let axis = frame.rotation * segment.axis().into_inner();
        let velocity: Vector3<f64> = match segment.motion() {
            Motion::Turning => axis.cross(&(tip.coords - frame.translation.vector)),
            Motion::Sliding => axis,
        };
        Unit::try_new(velocity * sign, 1e-4)
    });
    match moved {
        Some(pad_in_palm) => {
            let pad = frames.palm_from_segment(last).rotation.inverse() * pad_in_palm;
            finger.with_pad(pad)
        }
        None => finger,
    }
}
