//! The opened hand: how used fingers stand off and where the others are put, so that the way to the grasp is free.

use super::super::approach::{fingers_collide, free_approach, hand_clear_of_table};
use super::super::preshape::PATH_M;
use super::super::scene::Scene;
use super::super::settle::Site;
use super::closed::Closed;
use super::grasp::Rejection;
use crate::hand::{Candidate, Hand, Posture};

/// How far the tips stand off their contacts before they close, metres, widest first: room for errors of scan, arm and
/// calibration, as much as object, table and joint limits leave.
const STAND_OFF_M: [f64; 3] = [0.025, 0.015, 0.008];

/// Of its way back along its path, a tip leaves the surface by at least this share.
const OFF_COSINE_MIN: f64 = 0.3;

/// Finds the posture for the way to the object: used fingers opened by `opened` as far as there is room (it is given one
/// of [`STAND_OFF_M`] and the joints of the fingers that are not used are put onto what it returns), fingers that are not
/// used stretched or, where that is in the way, folded (in `grasp` too). Errors with the last obstacle.
pub(super) fn around(
    scene: &Scene,
    candidate: &Candidate,
    site: &Site,
    closed: &Posture,
    grasp: &mut Posture,
    opened: &dyn Fn(f64) -> Option<Posture>,
) -> Result<Posture, Rejection> {
    let mut obstacle = Rejection::FingerHitsObject;
    let idle = || (0..scene.hand.fingers.len()).filter(|&f| !candidate.uses[f]);
    for is_folded in [false, true] {
        for finger in idle() {
            take_finger(&scene.hand, finger, &candidate.open, grasp);
            if is_folded {
                fold(&scene.hand, finger, grasp);
            }
        }
        if !hand_clear_of_table(scene, &site.object_from_palm, grasp) {
            obstacle = Rejection::HitsTable;
        } else if fingers_collide(scene, grasp) {
            obstacle = Rejection::FingersCollide;
        } else {
            for stand_off_m in STAND_OFF_M {
                let Some(mut pregrasp) = opened(stand_off_m) else { continue };
                for finger in idle() {
                    take_finger(&scene.hand, finger, grasp, &mut pregrasp);
                }
                match free_approach(scene, site, &pregrasp) {
                    Ok(()) => return Ok(pregrasp),
                    Err(reason) => obstacle = reason,
                }
                if pregrasp == *closed {
                    break;
                }
            }
        }
        if idle().next().is_none() {
            break;
        }
    }
    Err(obstacle)
}

/// Folds a finger out of the way: its closing joints to where they end.
fn fold(hand: &Hand, finger: usize, onto: &mut Posture) {
    for &joint in hand.fingers[finger].joints() {
        let limits = &hand.joints[joint];
        match limits.flexes {
            Some(true) if !limits.is_held => onto[joint] = limits.upper_rad,
            Some(false) if !limits.is_held => onto[joint] = limits.lower_rad,
            _ => {}
        }
    }
}

/// The grasp with every touching tip drawn back from its contact along the normal, or along its path where it has too few
/// joints for that; `None` when a finger's limits do not let it.
pub(super) fn stand_off(
    scene: &Scene,
    site: &Site,
    closed: &Closed,
    grasp: &Posture,
    stand_off_m: f64,
) -> Option<Posture> {
    let mut opened = *grasp;
    for (finger, touch) in closed.touches() {
        let chain = &scene.hand.fingers[finger];
        let back = site
            .object_from_palm
            .inverse_transform_vector(&(-stand_off_m * touch.inward_normal_in_object.into_inner()));
        let from = chain.tip_in_palm(&chain.frames(grasp));
        let found = if scene.hand.is_placeable(finger) {
            scene.hand.finger_inverse(finger, &(from + back), grasp)?
        } else {
            let opened = scene.hand.clamped(site.preshape.with_finger_at(touch.u - stand_off_m / PATH_M));
            // Somewhere off the contact, if not straight off it.
            let off = chain.tip_in_palm(&chain.frames(&opened)) - from;
            if off.dot(&back) < OFF_COSINE_MIN * back.norm() * back.norm() {
                return None;
            }
            opened
        };
        take_finger(&scene.hand, finger, &found, &mut opened);
    }
    Some(opened)
}

/// Takes over the joints of one finger, held ones left out.
pub(in super::super) fn take_finger(hand: &Hand, finger: usize, from: &Posture, onto: &mut Posture) {
    for &joint in hand.fingers[finger].joints() {
        if !hand.joints[joint].is_held {
            onto[joint] = from[joint];
        }
    }
}
