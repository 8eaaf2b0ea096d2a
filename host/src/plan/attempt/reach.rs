//! The arm: whether it brings the palm to the three sites of a grasp, and past what stands there.

use nalgebra::{Isometry3, Translation3};

use super::super::arm::{Inverse, Joints};
use super::super::hand_shape::HandShape;
use super::super::obstacles::{ObjectPlace, Obstacles};
use super::super::scene::Scene;
use super::super::settle::Site;
use crate::hand::Posture;

/// Between two sites some ten centimetres apart a joint turns by less than this while the arm keeps its configuration, rad.
const SAME_CONFIGURATION_RAD: f64 = 1.2;

/// Poses of the palm in the base frame at the approach site (behind the grasp site along the straight last way), the
/// grasp site, and after the lift straight up.
#[must_use]
pub fn palm_sites(scene: &Scene, site: &Site) -> [Isometry3<f64>; 3] {
    let grasp = scene.base_from_object * site.object_from_palm;
    let way = scene.base_from_object * site.direction_in_object.into_inner();
    [
        Translation3::from(-way * scene.approach_m) * grasp,
        grasp,
        Translation3::new(0.0, 0.0, scene.lift_m) * grasp,
    ]
}

/// Whether the arm has a posture for approach, grasp and lifted site; true without an arm.
pub(super) fn reachable(scene: &Scene, site: &Site) -> bool {
    let Some(arm) = &scene.arm else { return true };
    palm_sites(scene, site).iter().all(|base_from_palm| arm.reaches_palm(base_from_palm))
}

/// Whether the arm can hold the palm at approach, grasp and lifted site in one configuration whose links clear table and
/// object there; true without an arm. The ways between are looked at when a grasp is written.
pub(super) fn arm_stays_clear(scene: &Scene, site: &Site, open: &Posture, closed: &Posture) -> bool {
    let Some(arm) = &scene.arm else { return true };
    let [approach, grasp, lift] = palm_sites(scene, site);
    let rest_rad = &arm.params().rest_rad;
    let Inverse::Solutions(starts) = arm.palm_solutions_near(&approach, rest_rad) else { return false };
    let base_from_object = scene.base_from_object;
    let [open, closed] = [open, closed].map(|posture| HandShape::of(&scene.hand, posture));
    let obstacles = |hand, place| Obstacles::new(arm, hand, scene.table_height_m, &scene.surface, place);
    let coming = obstacles(&open, ObjectPlace::Target { base_from_object });
    let palm_from_object = site.object_from_palm.inverse();
    let going = obstacles(&closed, ObjectPlace::Held { palm_from_object });
    starts.iter().any(|start| {
        let next = |pose: &Isometry3<f64>, from: &Joints| match arm.palm_solutions_near(pose, from) {
            Inverse::Solutions(found) => found.first().map(|solution| solution.q_rad),
            _ => None,
        };
        let is_near =
            |a: &Joints, b: &Joints| a.iter().zip(b).all(|(a, b)| (a - b).abs() < SAME_CONFIGURATION_RAD);
        let Some(at_grasp) = next(&grasp, &start.q_rad).filter(|q| is_near(q, &start.q_rad)) else {
            return false;
        };
        let Some(at_lift) = next(&lift, &at_grasp).filter(|q| is_near(q, &at_grasp)) else { return false };
        let is_clear = |obstacles: &Obstacles<'_>, q: &Joints| obstacles.clash_at(q).is_none();
        is_clear(&coming, &start.q_rad) && is_clear(&coming, &at_grasp) && is_clear(&going, &at_lift)
    })
}
