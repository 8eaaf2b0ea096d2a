//! Closing one finger until it touches: conservative advancement along the coupled kinematics.

use hand_model::FingerAngles;
use nalgebra::{Isometry3, Point3, Unit, Vector3};
use protocol::ids::FingerId;

use super::candidates::Candidate;
use super::hand_body::{HandBody, Link};
use super::surface_query::SurfaceQuery;

/// Distance at which a bead counts as touching, metres: a tenth of the scanner's noise.
const TOUCH_M: f64 = 2.0e-5;

/// Cap on advancement steps. Each step keeps at least the share of the gap that the finger's lever leaves, so a touch
/// is found in a few tens; a finger that creeps along the surface for longer does not close on it.
const MAX_STEPS: usize = 400;

/// Where a closing finger ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Closing {
    /// It touches.
    Touches(Touch),
    /// It reached its limits in the air.
    Misses,
    /// It stood inside the object or on it before it moved.
    StartsInside,
}

/// First touch of a finger.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Touch {
    /// Closing fraction of [`Candidate::finger_at`].
    pub s: f64,
    /// The finger's angles there.
    pub angles: FingerAngles<f64>,
    /// The link that touches.
    pub link: Link,
    /// The touched point, object frame, metres.
    pub point_in_object: Point3<f64>,
    /// Direction in which the finger pushes: from the bead's centre to the point.
    pub inward_normal_in_object: Unit<Vector3<f64>>,
    /// Cosine of the angle between that direction and the pad's normal: 1 is the middle of the pad, below 0 the back
    /// of the finger.
    pub pad_cosine: f64,
}

/// Room for the bead positions, kept between calls.
#[derive(Debug, Default, Clone)]
pub struct ClosingScratch {
    centers: Vec<Point3<f64>>,
    /// Lower bound of each bead's distance, metres: the last measured one less the way that it can have moved since.
    bounds: Vec<f64>,
}

/// Closes `finger` from its open posture along the candidate's line until a bead touches the surface.
pub fn close_finger(
    surface: &SurfaceQuery,
    hand: &HandBody,
    object_from_base: &Isometry3<f64>,
    candidate: &Candidate,
    finger: FingerId,
    scratch: &mut ClosingScratch,
) -> Closing {
    let limit = hand.flexion_limit_rad();
    let rate = candidate.closing_rate_rad(finger);
    let open = candidate.finger_at(finger, 0.0, limit);
    // Closing fraction at which both joints have reached their limits.
    let s_end = [(open.flexion_rad, rate[0], limit[0]), (open.middle_rad, rate[1], limit[1])]
        .into_iter()
        .filter(|&(_, rate, _)| rate > 0.0)
        .map(|(from, rate, to)| (to - from) / rate)
        .fold(0.0, f64::max);
    // No bead moves faster than this per unit of s: flexion carries it by its distance from the base, the coupled
    // middle and distal joints by at most twice the length beyond the middle joint.
    let beyond_middle_m = hand.model.finger.l2_m + 2.0 * hand.model.finger.l3_m;
    let speed_m = rate[0].abs() * hand.reach_m() + rate[1].abs() * beyond_middle_m;

    let ClosingScratch { centers, bounds } = scratch;
    bounds.clear();
    bounds.resize(hand.beads().len(), 0.0);
    let mut s = 0.0;
    for step in 0..MAX_STEPS {
        let angles = candidate.finger_at(finger, s, limit);
        hand.bead_centers(&angles, centers);
        let mut gap = f64::INFINITY;
        for ((bead, center), bound) in hand.beads().iter().zip(centers.iter()).zip(bounds.iter_mut()) {
            // A bead whose bound is beyond the smallest gap so far cannot shorten this step.
            if *bound < gap {
                let center_in_object = object_from_base * center;
                let nearest = surface.nearest(&center_in_object);
                *bound = nearest.signed_distance_m - bead.radius_m;
                if *bound <= TOUCH_M {
                    if step == 0 || nearest.signed_distance_m <= 0.0 {
                        return Closing::StartsInside;
                    }
                    let push = nearest.point_in_object - center_in_object;
                    let pad_in_object = object_from_base
                        * hand_model::pad_normal(&hand_model::FingerTrig::new(&angles, f64::sin_cos));
                    let inward_normal_in_object = Unit::new_normalize(push);
                    return Closing::Touches(Touch {
                        s,
                        angles,
                        link: bead.link,
                        point_in_object: nearest.point_in_object,
                        inward_normal_in_object,
                        pad_cosine: inward_normal_in_object.dot(&pad_in_object),
                    });
                }
            }
            gap = gap.min(*bound);
        }
        if s >= s_end {
            return Closing::Misses;
        }
        // Half the touch distance more than is proven free, so that the last step lands inside the touch band.
        let advance = (gap / speed_m).max(0.5 * TOUCH_M / speed_m);
        s = (s + advance).min(s_end);
        bounds.iter_mut().for_each(|bound| *bound -= advance * speed_m);
    }
    Closing::Misses
}
