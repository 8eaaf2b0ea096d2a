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
use crate::hand::{Joint, Posture};

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

impl Scale {
    /// One step of a joint, rad.
    pub(super) fn of_joint(&self, joint: &Joint) -> f64 {
        self.spread * (joint.upper_rad - joint.lower_rad)
    }
}

/// Room that one thread keeps between gradients.
#[derive(Default)]
pub(super) struct UphillScratch {
    contacts: Vec<Contact>,
    gradient: Vec<ContactGradient>,
    quality: Workspace,
}

/// The motion of one step's length on which epsilon of a precision grasp rises fastest, turning about `about`; `None`
/// where there is no slope or nothing that can be moved changes epsilon.
pub(super) fn uphill(
    scene: &Scene,
    grasp: &Grasp,
    about_in_object: &Point3<f64>,
    scale: &Scale,
    scratch: &mut UphillScratch,
) -> Option<Motion> {
    let slope = slope(scene, grasp, about_in_object, scratch)?;
    // In units of the scale the steepest way is along the slope; back in metres and radians the scale counts twice.
    let (shift, turn) = (slope.shift_m * scale.shift_m, slope.turn_rad * scale.turn_rad);
    let mut spread = Posture::ZERO;
    for (i, joint) in scene.hand.joints.iter().enumerate() {
        spread[i] = slope.spread_rad[i] * scale.of_joint(joint);
    }
    let spread_squared: f64 = spread.0.iter().map(|s| s * s).sum();
    let steepness = (shift.norm_squared() + turn.norm_squared() + spread_squared).sqrt();
    if !(steepness > 0.0 && steepness.is_finite()) {
        return None;
    }
    for (i, joint) in scene.hand.joints.iter().enumerate() {
        spread[i] *= scale.of_joint(joint) / steepness;
    }
    Some(Motion {
        shift_m: shift * (scale.shift_m / steepness),
        turn_rad: turn * (scale.turn_rad / steepness),
        spread_rad: spread,
    })
}

/// How epsilon of a precision grasp rises with each motion: per metre, per radian. `None` where the metric has no slope, and
/// for power grasps, whose joints stop one by one.
fn slope(
    scene: &Scene,
    grasp: &Grasp,
    about_in_object: &Point3<f64>,
    scratch: &mut UphillScratch,
) -> Option<Motion> {
    if scene.hand.candidates[grasp.candidate].wraps {
        return None;
    }
    scratch.contacts.clear();
    scratch.contacts.extend(grasp.contacts.iter().map(|touch| touch.contact));
    let (_, kind) = evaluate_with_gradient(
        &scratch.contacts,
        &scene.wrench_reference,
        &scene.quality,
        &mut scratch.quality,
        &mut scratch.gradient,
    );
    if kind == Slope::None {
        return None;
    }
    let object_from_palm = matrix(&grasp.site.object_from_palm);
    let mut rise =
        Motion { shift_m: Vector3::zeros(), turn_rad: Vector3::zeros(), spread_rad: Posture::ZERO };
    for (touch, gradient) in grasp.contacts.iter().zip(&scratch.gradient) {
        let Some(finger) = touch.finger else { continue };
        let chain = &scene.hand.fingers[finger];
        let bead = &chain.beads()[touch.bead];
        let center_at = |posture: &Posture| {
            object_from_palm
                * (chain.frames(posture).palm_from_segment(bead.segment) * bead.center_in_segment)
        };
        let center = center_at(&grasp.grasp);
        let speed =
            |rate: &Posture| (center_at(&(grasp.grasp + *rate * JOINT_STEP_RAD)) - center) / JOINT_STEP_RAD;
        let closing = speed(&grasp.site.preshape.rate);
        let Some(per_m) = slope_per_m(scene, &center, &closing, gradient) else { continue };
        rise.shift_m += per_m;
        rise.turn_rad += (center - about_in_object).cross(&per_m);
        for &joint in chain.joints() {
            if scene.hand.joints[joint].flexes.is_none() {
                let mut alone = Posture::ZERO;
                alone[joint] = 1.0;
                rise.spread_rad[joint] += speed(&alone).dot(&per_m);
            }
        }
    }
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

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, UnitQuaternion};

    use super::super::super::attempt::{AttemptScratch, attempt};
    use super::super::super::best::{contact_middle, search};
    use super::super::super::search::{SearchSettings, moved};
    use super::super::refine::MOTION;
    use super::*;
    use crate::object::BuiltIn;
    use crate::object::solids::cuboid;
    use crate::surface::Mesh;

    fn floating(mesh: Mesh) -> Scene {
        let mut scene = Scene::new(mesh, Isometry3::identity(), None, None).unwrap();
        scene.quality.tolerance = 1e-7;
        scene
    }

    /// The grasps of the search about which nothing is random but the seed.
    fn grasps(scene: &Scene) -> Vec<Grasp> {
        let settings = SearchSettings { attempts: 600, ..SearchSettings::default() };
        let mut grasps = search(scene, &settings, &|_| ()).grasps;
        grasps.retain(|grasp| !scene.hand.candidates[grasp.candidate].wraps);
        grasps
    }

    /// Epsilon with palm and spread moved by `steps` of a motion.
    fn epsilon_after(
        scene: &Scene,
        grasp: &Grasp,
        about: &Point3<f64>,
        motion: &Motion,
        steps: f64,
    ) -> Option<f64> {
        let turn = UnitQuaternion::from_scaled_axis(motion.turn_rad * steps);
        let mut site = moved(&grasp.site, about, &(motion.shift_m * steps), turn);
        site.preshape.start = site.preshape.start + motion.spread_rad * steps;
        let candidate = &scene.hand.candidates[grasp.candidate];
        let mut scratch = AttemptScratch::default();
        attempt(scene, grasp.candidate, candidate, &site, &mut scratch).ok().map(|g| g.quality.epsilon())
    }

    #[test]
    fn on_flat_faces_the_slope_is_that_of_closing_anew() {
        let scene = floating(cuboid([0.05, 0.06, 0.07]).unwrap());
        let mut scratch = UphillScratch::default();
        let (mut compared, mut off) = (0, 0);
        for grasp in grasps(&scene).iter().step_by(7) {
            let about = contact_middle(grasp);
            let contacts: Vec<Contact> = grasp.contacts.iter().map(|touch| touch.contact).collect();
            let (_, kind) = evaluate_with_gradient(
                &contacts,
                &scene.wrench_reference,
                &scene.quality,
                &mut Workspace::new(),
                &mut Vec::new(),
            );
            if kind != Slope::Gradient {
                continue;
            }
            let Some(slope) = slope(&scene, grasp, &about, &mut scratch) else { continue };
            for axis in 0..3 {
                let mut alone = Motion {
                    shift_m: Vector3::zeros(),
                    turn_rad: Vector3::zeros(),
                    spread_rad: Posture::ZERO,
                };
                alone.shift_m[axis] = 1.0;
                // The tips touch to within some hundredths of a millimetre.
                const STEP_M: f64 = 4e-4;
                let at = |steps: f64| epsilon_after(&scene, grasp, &about, &alone, steps);
                let (Some(ahead), Some(behind)) = (at(STEP_M), at(-STEP_M)) else { continue };
                let here = grasp.quality.epsilon();
                let (right, left) = ((ahead - here) / STEP_M, (here - behind) / STEP_M);
                let expected = 0.5 * (right + left);
                // Per metre, where whatever there is is of the order of 1 / the torque scale. Where the two sides differ,
                // an edge of epsilon or of the box lies within the step.
                if (right - left).abs() > 0.1 + 0.1 * expected.abs() {
                    continue;
                }
                compared += 1;
                off += usize::from((slope.shift_m[axis] - expected).abs() > 0.1 + 0.1 * expected.abs());
            }
        }
        assert!(compared >= 30, "{compared}");
        assert!(20 * off <= compared, "{off} of {compared}");
    }

    #[test]
    fn a_step_uphill_helps_more_often_than_one_downhill() {
        let scene = floating(BuiltIn::Mouse.object(1.0).unwrap().mesh);
        let mut scratch = UphillScratch::default();
        let (mut up, mut down) = (0, 0);
        for grasp in grasps(&scene).iter().step_by(5) {
            let about = contact_middle(grasp);
            let Some(motion) = uphill(&scene, grasp, &about, &MOTION, &mut scratch) else { continue };
            let helps = |steps| {
                epsilon_after(&scene, grasp, &about, &motion, steps)
                    .is_some_and(|e| e > grasp.quality.epsilon())
            };
            up += usize::from(helps(0.1));
            down += usize::from(helps(-0.1));
        }
        assert!(up >= 20 && up > 3 * down, "{up} up, {down} down");
    }
}
