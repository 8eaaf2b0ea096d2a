//! The hand before it closes: where its tips oppose each other, and the ways on which they come together.
//!
//! At every closing fraction s of a candidate the tips define a *grasp frame*: origin midway between the thumb's tip and
//! the mean of the others, x along the line from those to the thumb, y to the index's side, z away from the palm. As
//! the fingers flex they draw back towards the palm, each by another amount, so the frame leans by some 30 degrees
//! between wide open and closed, and the tips do not lie in one plane. A precision grasp wants them in one: every tip
//! is moved into the plane z = 0 of the frame by the closed-form inverse, and closes along a straight way in it.

use hand_model::{FingerAngles, FingerInverse, FingerTrig, inverse_angles, tip};
use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use protocol::ids::FingerId;

use super::candidates::Candidate;
use super::hand_body::HandBody;

/// Way of a tip from the beginning of its path to the place in the preshape, metres.
pub const PATH_M: f64 = 0.025;

/// A straight line in a finger's joint space: u = 0 stands off by [`PATH_M`], u = 1 is the preshape, and it goes on to
/// the joints' limits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FingerPath {
    /// Angles at u = 0.
    pub start: FingerAngles<f64>,
    /// Change of abduction, flexion and middle angle per unit of u, rad.
    pub rate_rad: [f64; 3],
    /// The u at which the path begins: above 0 where the joints do not let the finger stand off so far.
    pub u_begin: f64,
    /// The u at which the first joint meets its limit.
    pub u_end: f64,
}

impl FingerPath {
    fn through(hand: &HandBody, start: FingerAngles<f64>, preshape: &FingerAngles<f64>) -> Self {
        let limits = &hand.model.soft_limits;
        let [from, to] = [start.to_array(), preshape.to_array()];
        let rate_rad = [to[0] - from[0], to[1] - from[1], to[2] - from[2]];
        let u_end = [limits.abduction, limits.flexion, limits.middle]
            .iter()
            .zip(from.iter().zip(&rate_rad))
            .filter(|(_, (_, rate))| rate.abs() > 1e-9)
            .map(|(range, (from, rate))| {
                let limit = if *rate > 0.0 { range.upper_rad } else { range.lower_rad };
                (limit - from) / rate
            })
            .fold(f64::INFINITY, f64::min);
        // A path without motion ends where it begins.
        Self { start, rate_rad, u_begin: 0.0, u_end: if u_end.is_finite() { u_end.max(0.0) } else { 0.0 } }
    }

    /// Angles at u, which is not beyond [`Self::u_end`].
    #[must_use]
    pub fn at(&self, u: f64) -> FingerAngles<f64> {
        let from = self.start.to_array();
        FingerAngles::from_array(&[0, 1, 2].map(|i| from[i] + u * self.rate_rad[i]))
    }
}

/// A hand shaped for an object of some width.
#[derive(Debug, Clone, PartialEq)]
pub struct Preshape {
    /// Pose of the grasp frame in the palm frame.
    pub palm_from_grasp: Isometry3<f64>,
    /// Distance between the centres of the thumb's tip and the mean of the others, metres.
    pub opening_m: f64,
    /// Thumb rotation, rad.
    pub thumb_rotation_rad: f64,
    /// Ways of the used fingers, by [`FingerId::index`].
    pub paths: [Option<FingerPath>; 4],
}

impl Preshape {
    /// The candidate at closing fraction `s`, its tips moved into one plane where the joints allow.
    #[must_use]
    pub fn at_fraction(hand: &HandBody, candidate: &Candidate, s: f64) -> Self {
        let (palm_from_grasp, opening_m) = grasp_frame(hand, candidate, s);
        let paths = FingerId::ALL.map(|finger| {
            candidate.uses[finger.index()]
                .then(|| path(hand, candidate, finger, s, &palm_from_grasp, opening_m))
        });
        Self { palm_from_grasp, opening_m, thumb_rotation_rad: candidate.thumb_rotation_rad, paths }
    }

    /// The candidate with `width_m` (metres) between its tip spheres, or as open as it goes.
    #[must_use]
    pub fn for_width(hand: &HandBody, candidate: &Candidate, width_m: f64) -> Self {
        let wanted_m = width_m + 2.0 * hand.model.finger.tip_radius_m;
        // The opening falls with s: bisection to 60 mm / 2^16, a micrometre.
        let (mut low, mut high) = (0.0, 2.0);
        for _ in 0..16 {
            let middle = 0.5 * (low + high);
            if grasp_frame(hand, candidate, middle).1 > wanted_m { low = middle } else { high = middle }
        }
        Self::at_fraction(hand, candidate, low)
    }
}

fn path(
    hand: &HandBody,
    candidate: &Candidate,
    finger: FingerId,
    s: f64,
    palm_from_grasp: &Isometry3<f64>,
    opening_m: f64,
) -> FingerPath {
    let limit = hand.flexion_limit_rad();
    let own = candidate.finger_at(finger, s, limit);
    let palm_from_base = hand.palm_from_finger_base(finger, candidate.thumb_rotation_rad);
    let base_from_grasp = palm_from_base.inverse() * palm_from_grasp;
    let natural = base_from_grasp.inverse() * tip(&hand.model.finger, &FingerTrig::new(&own, f64::sin_cos));
    let radius_m = 0.5 * opening_m;
    let reach = |tip_in_grasp: Point3<f64>| {
        let model = &hand.model;
        let tip_in_base = base_from_grasp * tip_in_grasp;
        match inverse_angles(&model.finger, &model.soft_limits, finger, &tip_in_base, f64::atan2) {
            FingerInverse::Reached(angles) => Some(angles),
            _ => None,
        }
    };
    // From the wanted place towards the natural one until the joints let the finger stand there.
    for blend in [1.0, 0.75, 0.5, 0.25, 0.0] {
        let (place, towards) = match candidate.around_rad {
            Some(around_rad) => {
                let natural_rad = natural.y.atan2(natural.x);
                let turn_rad = blend * wrapped(around_rad[finger.index()] - natural_rad);
                let (sin, cos) = (natural_rad + turn_rad).sin_cos();
                let outward = Vector3::new(cos, sin, 0.0);
                (Point3::from(outward * radius_m), -outward)
            }
            None => {
                let side = natural.x.signum();
                (Point3::new(side * radius_m, natural.y, 0.0), -Vector3::x() * side)
            }
        };
        let Some(preshape) = reach(place) else { continue };
        for share in [1.0, 0.5, 0.25] {
            let Some(start) = reach(place - towards * (PATH_M * share)) else { continue };
            // With u = 1 at the preshape still: a shorter path begins later and is as steep per metre.
            let short = FingerPath::through(hand, start, &preshape);
            let full_start = short.at(1.0 - 1.0 / share);
            return FingerPath { u_begin: 1.0 - share, ..FingerPath::through(hand, full_start, &preshape) };
        }
    }
    FingerPath::through(hand, candidate.finger_at(finger, (s - 0.4).max(0.0), limit), &own)
}

/// An angle in -pi..=pi.
fn wrapped(angle_rad: f64) -> f64 {
    let turns = (angle_rad / std::f64::consts::TAU).round();
    angle_rad - turns * std::f64::consts::TAU
}

/// Pose of the grasp frame in the palm frame, and the opening, at closing fraction `s`.
fn grasp_frame(hand: &HandBody, candidate: &Candidate, s: f64) -> (Isometry3<f64>, f64) {
    let limit = hand.flexion_limit_rad();
    let tip_in_palm = |finger: FingerId| {
        let angles = candidate.finger_at(finger, s, limit);
        let in_base = tip(&hand.model.finger, &FingerTrig::new(&angles, f64::sin_cos));
        (hand.palm_from_finger_base(finger, candidate.thumb_rotation_rad) * in_base).coords
    };
    let others: Vec<Vector3<f64>> = FingerId::ALL
        .into_iter()
        .filter(|&f| f != FingerId::Thumb && candidate.uses[f.index()])
        .map(tip_in_palm)
        .collect();
    let mean = others.iter().sum::<Vector3<f64>>() / others.len().max(1) as f64;
    let thumb = tip_in_palm(FingerId::Thumb);
    // Closed beyond touching each other the tips pass, and the line between them turns round: keep to the palm's x.
    let across = thumb - mean;
    let x = if across.x > 1e-3 { across.normalize() } else { Vector3::x() };
    let y = (Vector3::y() - x * x.y).normalize();
    let rotation = rotation_from_axes(&x, &y, &x.cross(&y));
    (Isometry3::from_parts(Translation3::from(0.5 * (mean + thumb)), rotation), across.x.max(0.0))
}

/// The rotation whose columns are three orthonormal right-handed axes.
#[must_use]
pub fn rotation_from_axes(x: &Vector3<f64>, y: &Vector3<f64>, z: &Vector3<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[
        *x, *y, *z,
    ])))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::candidates::typical;

    #[test]
    fn tips_lie_in_one_plane_and_the_opening_is_the_width() {
        let hand = HandBody::hit_dlr();
        // For balls of 50 mm and more: on smaller ones the ring finger does not get round to its place.
        let quadpod = &typical()[0];
        for width_m in [0.06, 0.075, 0.09] {
            let preshape = Preshape::for_width(&hand, quadpod, width_m);
            let gap_m = preshape.opening_m - 2.0 * hand.model.finger.tip_radius_m;
            assert!((gap_m - width_m).abs() < 1e-4, "{gap_m} for {width_m}");
            for finger in FingerId::ALL {
                let path = preshape.paths[finger.index()].unwrap();
                for u in [path.u_begin.max(0.75), 1.0] {
                    let in_base = tip(&hand.model.finger, &FingerTrig::new(&path.at(u), f64::sin_cos));
                    let in_palm = hand.palm_from_finger_base(finger, preshape.thumb_rotation_rad) * in_base;
                    let in_grasp = preshape.palm_from_grasp.inverse() * in_palm;
                    assert!(in_grasp.z.abs() < 1.5e-3, "{} at u {u}: {in_grasp}", finger.name());
                }
            }
        }
    }
}
