//! What must not touch: table, object, other fingers, at the grasp and on the straight way to it.

use nalgebra::{Isometry3, Point3, Translation3, Vector3};

use super::attempt::Rejection;
use super::closing::matrix;
use super::hand_shape::lowest_m;
use super::scene::{Scene, TABLE_CLEARANCE_M, table_clearance_m};
use super::settle::Site;
use crate::hand::finger::MAX_BEADS;
use crate::hand::{Hand, MAX_FINGERS, PalmBox, Posture};

/// Least step of a bead along the approach, metres: it may so dive by less than this under a grazed surface.
const TRACE_STEP_MIN_M: f64 = 2.0e-4;

/// Overlap of beads of two fingers that is still no collision, metres: the chains are rounder than the links.
const SELF_OVERLAP_M: f64 = 0.002;

/// How near the palm may pass along its way before the check refuses it, metres; also what bounds the check's cost.
const STATION_M: f64 = 0.008;

/// Whether the palm alone is clear of table and object with the hand at the grasp.
pub(super) fn palm_clear(scene: &Scene, object_from_palm: &Isometry3<f64>) -> Result<(), Rejection> {
    let base_from_palm = scene.base_from_object * object_from_palm;
    if !palm_clear_of_table(scene, &base_from_palm) || palm_cuts_object(scene, object_from_palm) {
        return Err(Rejection::PalmBlocked);
    }
    Ok(())
}

/// Checks palm and open fingers at the grasp site and along the straight line from the approach site.
pub(super) fn free_approach(scene: &Scene, site: &Site, open: &Posture) -> Result<(), Rejection> {
    let back = -site.direction_in_object.into_inner();
    // The table is below the grasp site or below nothing: both ends of the way stand for all of it.
    for back_m in [0.0, scene.approach_m] {
        let object_from_palm = Translation3::from(back * back_m) * site.object_from_palm;
        if !hand_clear_of_table(scene, &object_from_palm, open) {
            return Err(Rejection::HitsTable);
        }
    }
    let far = Translation3::from(back * scene.approach_m) * site.object_from_palm;
    let way = -back * scene.approach_m;
    let cuts = |part: &PalmBox| {
        scene.surface.cuts_moving_box(&(far * part.palm_from_box), &part.half_extents_m, &way, STATION_M)
    };
    if scene.hand.palm.iter().any(cuts) {
        return Err(Rejection::PalmHitsObject);
    }
    let object_from_palm = matrix(&site.object_from_palm);
    for chain in &scene.hand.fingers {
        let frames = chain.frames(open);
        for bead in chain.beads() {
            let center = object_from_palm * (frames.palm_from_segment(bead.segment) * bead.center_in_segment);
            if hits_on_way(scene, &center, bead.radius_m, &back) {
                return Err(Rejection::FingerHitsObject);
            }
        }
    }
    Ok(())
}

/// Whether a ball hits the object between the grasp site and the approach site: steps as long as the way is free.
fn hits_on_way(scene: &Scene, center: &Point3<f64>, radius_m: f64, back: &Vector3<f64>) -> bool {
    let mut back_m = 0.0;
    while back_m < scene.approach_m {
        let at = center + back * back_m;
        let bound_m = scene.surface.distance_bound_m(&at) - radius_m;
        let free_m = if bound_m > TRACE_STEP_MIN_M {
            bound_m
        } else {
            scene.surface.nearest(&at).signed_distance_m - radius_m
        };
        if free_m <= 0.0 {
            return true;
        }
        back_m += free_m.max(TRACE_STEP_MIN_M);
    }
    false
}

pub(super) fn palm_cuts_object(scene: &Scene, object_from_palm: &Isometry3<f64>) -> bool {
    scene.hand.palm.iter().any(|part| {
        let object_from_box = object_from_palm * part.palm_from_box;
        let middle = Point3::from(object_from_box.translation.vector);
        scene.surface.cuts_box(&object_from_box, &part.half_extents_m)
            || !scene.surface.clear_of_ball(&middle, 0.0)
    })
}

pub(super) fn palm_clear_of_table(scene: &Scene, base_from_palm: &Isometry3<f64>) -> bool {
    let Some(table_height_m) = scene.table_height_m else { return true };
    let lowest_allowed_m = table_height_m + TABLE_CLEARANCE_M;
    scene.hand.palm.iter().all(|part| {
        lowest_m(&(base_from_palm * part.palm_from_box), &part.half_extents_m) >= lowest_allowed_m
    })
}

/// Whether palm and fingers stay above the table; true without a table.
pub(super) fn hand_clear_of_table(
    scene: &Scene,
    object_from_palm: &Isometry3<f64>,
    posture: &Posture,
) -> bool {
    let Some(table_height_m) = scene.table_height_m else { return true };
    let base_from_palm = scene.base_from_object * object_from_palm;
    if !palm_clear_of_table(scene, &base_from_palm) {
        return false;
    }
    let base_from_palm = matrix(&base_from_palm);
    scene.hand.fingers.iter().all(|chain| {
        let frames = chain.frames(posture);
        chain.beads().iter().all(|bead| {
            let center = base_from_palm * (frames.palm_from_segment(bead.segment) * bead.center_in_segment);
            center.z - bead.radius_m >= table_height_m + table_clearance_m(bead.part)
        })
    })
}

/// Two beads of different fingers that must not overlap.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BeadPair {
    first: [usize; 2],
    second: [usize; 2],
    least_m2: f64,
}

/// The pairs of beads that a hand's posture is checked for. Pairs that overlap in most of the joint ranges, as
/// neighbouring roots do in hands with wide links, are left out: they are no collision but how the hand is built.
#[must_use]
pub fn bead_pairs(hand: &Hand) -> Vec<BeadPair> {
    let samples: Vec<Vec<[Point3<f64>; MAX_BEADS]>> = (0..POSTURES)
        .map(|k| {
            let mut posture = Posture::ZERO;
            for (i, joint) in hand.joints.iter().enumerate() {
                // Additive recurrence: well spread, and the same for every hand with as many joints.
                let share = (0.5 + (k + 1) as f64 * RECURRENCE.powi(i as i32 + 1)).fract();
                posture[i] = joint.lower_rad + share * (joint.upper_rad - joint.lower_rad);
            }
            bead_places(hand, &posture)[..hand.fingers.len()].to_vec()
        })
        .collect();
    let mut pairs = Vec::new();
    for (i, first) in hand.fingers.iter().enumerate() {
        for (k, second) in hand.fingers.iter().enumerate().skip(i + 1) {
            for (a, bead) in first.beads().iter().enumerate() {
                for (b, other) in second.beads().iter().enumerate() {
                    let least_m = (bead.radius_m + other.radius_m - SELF_OVERLAP_M).max(0.0);
                    let overlap = |s: &&Vec<[Point3<f64>; MAX_BEADS]>| (s[i][a] - s[k][b]).norm() < least_m;
                    if 2 * samples.iter().filter(overlap).count() < POSTURES {
                        pairs.push(BeadPair { first: [i, a], second: [k, b], least_m2: least_m * least_m });
                    }
                }
            }
        }
    }
    pairs
}

/// Sampled postures of [`bead_pairs`].
const POSTURES: usize = 64;
/// Inverse of the golden ratio.
const RECURRENCE: f64 = 0.618_033_988_749_894_8;

fn bead_places(hand: &Hand, posture: &Posture) -> [[Point3<f64>; MAX_BEADS]; MAX_FINGERS] {
    let mut places = [[Point3::origin(); MAX_BEADS]; MAX_FINGERS];
    for (chain, places) in hand.fingers.iter().zip(&mut places) {
        let frames = chain.frames(posture);
        for (bead, place) in chain.beads().iter().zip(places) {
            *place = frames.palm_from_segment(bead.segment) * bead.center_in_segment;
        }
    }
    places
}

/// Whether beads of two different fingers overlap by more than the tolerance.
pub(super) fn fingers_collide(scene: &Scene, posture: &Posture) -> bool {
    let places = bead_places(&scene.hand, posture);
    scene.bead_pairs.iter().any(|pair| {
        let ([f, a], [g, b]) = (pair.first, pair.second);
        (places[f][a] - places[g][b]).norm_squared() < pair.least_m2
    })
}
