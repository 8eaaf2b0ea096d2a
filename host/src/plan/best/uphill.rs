//! Which way epsilon rises when palm and fingers move.
//!
//! The metric says how epsilon changes with each contact's point and normal ([`evaluate_with_gradient`]). A contact moves
//! with its ball: the palm carries the ball along, the finger then closes until it touches again, so that the ball's
//! centre keeps its distance and slides along the surface. How point and normal turn as it does is measured on the
//! surface itself, by nearest-point queries from a centre moved a little; a facet's noise is averaged by the ball's
//! radius as it is in every contact.
//!
//! Epsilon is a minimum over directions and has edges: on one, what the metric gives is one of several gradients. A step
//! this way is therefore a proposal like any other, that an attempt judges.

use nalgebra::{Point3, Unit, Vector3};

use super::super::attempt::Grasp;
use super::super::closing::matrix;
use super::super::preshape::any_across;
use super::super::scene::Scene;
use crate::grasp::{Contact, ContactGradient, Slope, Workspace, evaluate_with_gradient};
use crate::hand::Posture;

/// How far a ball's centre is moved to see how its contact follows, metres: some facets, small against a fingertip.
const PROBE_M: f64 = 0.001;

/// Change of the joints for differences, rad.
const JOINT_STEP_RAD: f64 = 1e-4;

/// Least speed towards the surface of a closing fingertip, as a share of its speed: what only grazes is left where it is.
const LEAST_APPROACH: f64 = 0.1;

/// A motion of palm and spreading joints: shift of the object's frame in metres, turn in radians about the middle of the
/// contacts, joints in radians.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Motion {
    pub(super) shift_m: Vector3<f64>,
    pub(super) turn_rad: Vector3<f64>,
    pub(super) spread_rad: Posture,
}

/// How much of each motion is one step: what epsilon's slope in metres, radians and joint angles is weighed by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Scale {
    pub(super) shift_m: f64,
    pub(super) turn_rad: f64,
    /// As a share of each joint's range.
    pub(super) spread: f64,
}

/// Room that one thread keeps between gradients.
#[derive(Default)]
pub(super) struct UphillScratch {
    contacts: Vec<Contact>,
    gradient: Vec<ContactGradient>,
    quality: Workspace,
}

/// The motion of one step's length on which epsilon of a precision grasp rises fastest, turning about `about`; `None`
/// where the metric has no slope or nothing that can be moved changes it. Power grasps, whose joints stop one by one, have
/// none.
pub(super) fn uphill(
    scene: &Scene,
    grasp: &Grasp,
    about_in_object: &Point3<f64>,
    scale: &Scale,
    scratch: &mut UphillScratch,
) -> Option<Motion> {
    if scene.hand.candidates[grasp.candidate].wraps {
        return None;
    }
    scratch.contacts.clear();
    scratch.contacts.extend(grasp.contacts.iter().map(|touch| touch.contact));
    let (_, slope) = evaluate_with_gradient(
        &scratch.contacts,
        &scene.wrench_reference,
        &scene.quality,
        &mut scratch.quality,
        &mut scratch.gradient,
    );
    if slope == Slope::None {
        return None;
    }
    let mut rise =
        Motion { shift_m: Vector3::zeros(), turn_rad: Vector3::zeros(), spread_rad: Posture::ZERO };
    for (touch, gradient) in grasp.contacts.iter().zip(&scratch.gradient) {
        let Some(finger) = touch.finger else { continue };
        let chain = &scene.hand.fingers[finger];
        let bead = &chain.beads()[touch.bead];
        let object_from_palm = matrix(&grasp.site.object_from_palm);
        let center_at = |posture: &Posture| {
            object_from_palm
                * (chain.frames(posture).palm_from_segment(bead.segment) * bead.center_in_segment)
        };
        let center = center_at(&grasp.grasp);
        let closing =
            (center_at(&(grasp.grasp + grasp.site.preshape.rate * JOINT_STEP_RAD)) - center) / JOINT_STEP_RAD;
        let Some(per_m) = slope_per_m(scene, &center, &closing, gradient) else { continue };
        rise.shift_m += per_m;
        rise.turn_rad += (center - about_in_object).cross(&per_m);
        for (joint, limits) in scene.hand.joints.iter().enumerate() {
            if limits.flexes.is_none() && chain.joints().contains(&joint) {
                let mut moved = grasp.grasp;
                moved[joint] += JOINT_STEP_RAD;
                rise.spread_rad[joint] += (center_at(&moved) - center).dot(&per_m) / JOINT_STEP_RAD;
            }
        }
    }
    // In units of the scale the steepest way is along the slope; back in metres and radians the scale counts twice.
    let ranges = |joint: usize| {
        let limits = &scene.hand.joints[joint];
        scale.spread * (limits.upper_rad - limits.lower_rad)
    };
    let joints = 0..scene.hand.joints.len();
    let (shift, turn) = (rise.shift_m * scale.shift_m, rise.turn_rad * scale.turn_rad);
    let spread: f64 = joints.clone().map(|i| (rise.spread_rad[i] * ranges(i)).powi(2)).sum();
    let steepness = (shift.norm_squared() + turn.norm_squared() + spread).sqrt();
    if !(steepness > 0.0 && steepness.is_finite()) {
        return None;
    }
    rise.shift_m = shift * (scale.shift_m / steepness);
    rise.turn_rad = turn * (scale.turn_rad / steepness);
    joints.for_each(|i| rise.spread_rad[i] *= ranges(i).powi(2) / steepness);
    Some(rise)
}

/// The slope of epsilon, per metre, in a motion that carries a ball's centre while the finger closes along `closing` to
/// touch again; `None` when it hardly closes at all, or centre and surface coincide.
fn slope_per_m(
    scene: &Scene,
    center: &Point3<f64>,
    closing: &Vector3<f64>,
    gradient: &ContactGradient,
) -> Option<Vector3<f64>> {
    let contact = |center: &Point3<f64>| {
        let point = scene.surface.nearest(center).point_in_object;
        Some((point, Unit::try_new(point - center, 1e-9)?.into_inner()))
    };
    let (_, normal) = contact(center)?;
    let towards = normal.dot(closing);
    if towards.abs() < LEAST_APPROACH * closing.norm() || towards == 0.0 {
        return None;
    }
    let first = any_across(&normal);
    let mut per_m = Vector3::zeros();
    for tangent in [first, normal.cross(&first)] {
        let ahead = contact(&(center + tangent * PROBE_M))?;
        let behind = contact(&(center - tangent * PROBE_M))?;
        let [slides, turns] = [ahead.0 - behind.0, ahead.1 - behind.1].map(|way| way / (2.0 * PROBE_M));
        let rises = gradient.point_per_m.dot(&slides) + gradient.normal_per_rad.dot(&turns);
        // What of a carried way is slid along the tangent: its own part, less the part of the closing that undoes the
        // way's part along the normal.
        per_m += (tangent - normal * (tangent.dot(closing) / towards)) * rises;
    }
    Some(per_m)
}
