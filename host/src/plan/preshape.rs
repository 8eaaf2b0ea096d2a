//! The hand before it closes: where its tips oppose each other, and the ways on which they come together.
//!
//! At every closing fraction s of a candidate the tips define a *grasp frame*: origin midway between the opposing
//! finger's tip and the mean of the others, x along the line from those to it, y across the fingers, z away from the
//! palm. As the fingers flex they draw back towards the palm, each by another amount, so the frame leans by some 30
//! degrees between wide open and closed, and the tips do not lie in one plane. A precision grasp wants them in one:
//! every tip is moved into the plane z = 0 of the frame by inverse kinematics, and closes along a straight way in it.

use std::sync::OnceLock;

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};

use crate::hand::{Candidate, Hand, MAX_FINGERS, Posture};

/// Way of a tip from the beginning of its path to the place in the preshape, metres.
pub const PATH_M: f64 = 0.025;

/// Greatest closing fraction that an opening is looked for at.
const FRACTION_MAX: f64 = 2.0;

/// Widths of a [`PreshapeTable`] are this far apart, metres: a twelfth of the way that the paths leave for closing.
const WIDTH_STEP_M: f64 = 0.002;

/// Widths of a [`PreshapeTable`]: up to 0.2 m, more than hands open.
const WIDTHS: usize = 101;

/// A hand shaped for an object of some width, and the straight ways in joint space on which its used fingers close:
/// u = 0 stands off by [`PATH_M`], u = 1 is the preshape, and it goes on to the joints' limits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Preshape {
    /// Pose of the grasp frame in the palm frame.
    pub palm_from_grasp: Isometry3<f64>,
    /// Distance between the centres of the opposing finger's tip and the mean of the others, metres.
    pub opening_m: f64,
    /// The hand at u = 0 of every finger, held joints and fingers that are not used included.
    pub start: Posture,
    /// Change per unit of u; 0 for joints that do not move.
    pub rate: Posture,
    /// The u at which each finger's path begins: above 0 where the joints do not let it stand off so far.
    pub u_begin: [f64; MAX_FINGERS],
    /// The u at which a finger's first joint meets its limit.
    pub u_end: [f64; MAX_FINGERS],
}

impl Preshape {
    /// The candidate with `width_m` (metres) between its tip balls, or as open as it goes.
    #[must_use]
    pub fn for_width(hand: &Hand, candidate: &Candidate, width_m: f64) -> Self {
        let wanted_m = width_m + 2.0 * hand.fingers[candidate.opposing].tip_radius_m();
        // The opening falls with s: bisection to 60 mm / 2^10, a twentieth of a millimetre.
        let (mut low, mut high) = (0.0, FRACTION_MAX);
        for _ in 0..10 {
            let middle = 0.5 * (low + high);
            if grasp_frame(hand, candidate, middle).1 > wanted_m { low = middle } else { high = middle }
        }
        Self::at_fraction(hand, candidate, low)
    }

    /// The candidate at closing fraction `s`, its tips moved into one plane where the joints allow.
    #[must_use]
    pub fn at_fraction(hand: &Hand, candidate: &Candidate, s: f64) -> Self {
        let (palm_from_grasp, opening_m) = grasp_frame(hand, candidate, s);
        let mut preshape = Self {
            palm_from_grasp,
            opening_m,
            start: candidate.posture_at(&hand.joints, s),
            rate: Posture::ZERO,
            u_begin: [0.0; MAX_FINGERS],
            u_end: [0.0; MAX_FINGERS],
        };
        for finger in candidate.fingers() {
            preshape.add_path(hand, candidate, finger, s);
        }
        preshape
    }

    /// The hand with one finger at u of its path and everything else where the paths begin.
    #[must_use]
    pub fn with_finger_at(&self, u: f64) -> Posture {
        self.start + self.rate * u
    }

    fn add_path(&mut self, hand: &Hand, candidate: &Candidate, finger: usize, s: f64) {
        let chain = &hand.fingers[finger];
        let natural_posture = candidate.posture_at(&hand.joints, s);
        if !hand.is_placeable(finger) {
            self.add_natural_path(hand, candidate, finger, &natural_posture);
            return;
        }
        let grasp_from_palm = self.palm_from_grasp.inverse();
        let natural = grasp_from_palm * chain.tip_in_palm(&chain.frames(&natural_posture));
        let radius_m = 0.5 * self.opening_m;
        let reach = |tip_in_grasp: Point3<f64>, seed: &Posture| {
            hand.finger_inverse(finger, &(self.palm_from_grasp * tip_in_grasp), seed)
        };
        // From the wanted place towards the natural one until the joints let the finger stand there.
        for blend in [1.0, 0.75, 0.5, 0.25, 0.0] {
            let (place, towards) = match candidate.around_rad {
                Some(around_rad) => {
                    let natural_rad = natural.y.atan2(natural.x);
                    let turn_rad = blend * wrapped(around_rad[finger] - natural_rad);
                    let (sin, cos) = (natural_rad + turn_rad).sin_cos();
                    let outward = Vector3::new(cos, sin, 0.0);
                    (Point3::from(outward * radius_m), -outward)
                }
                None => {
                    let side = if finger == candidate.opposing { 1.0 } else { -1.0 };
                    (Point3::new(side * radius_m, natural.y, 0.0), -Vector3::x() * side)
                }
            };
            let Some(preshape) = reach(place, &natural_posture) else { continue };
            for share in [1.0, 0.5, 0.25] {
                let Some(start) = reach(place - towards * (PATH_M * share), &preshape) else { continue };
                // With u = 1 at the preshape still: a shorter path begins later and is as steep per metre.
                let rate = (preshape - start) * (1.0 / share);
                self.set_path(hand, finger, &(preshape - rate), &rate, 1.0 - share);
                return;
            }
        }
        let start = candidate.posture_at(&hand.joints, (s - 0.4).max(0.0));
        self.set_path(hand, finger, &start, &(natural_posture - start), 0.0);
    }

    /// The path of a finger whose tip its joints cannot place: it closes as the candidate does, on a path as long as the
    /// others'.
    fn add_natural_path(&mut self, hand: &Hand, candidate: &Candidate, finger: usize, preshape: &Posture) {
        let chain = &hand.fingers[finger];
        let frames = chain.frames(preshape);
        let tip = chain.tip_in_palm(&frames);
        let jacobian = chain.point_jacobian(&frames, chain.segments().len() - 1, &tip);
        let mut rate = Posture::ZERO;
        let mut way_m = Vector3::zeros();
        for (column, &joint) in chain.joints().iter().enumerate().filter(|(_, j)| !hand.joints[**j].is_held) {
            rate[joint] = candidate.closing[joint];
            way_m += jacobian.column(column) * rate[joint];
        }
        // A tip that closing hardly moves has no path of that length: its joints would leave their limits.
        let rate = rate * (PATH_M / way_m.norm().max(0.2 * PATH_M));
        let mut u_begin = 0.0_f64;
        for &joint in chain.joints().iter().filter(|joint| rate[**joint].abs() > 1e-9) {
            let limits = &hand.joints[joint];
            let limit = if rate[joint] > 0.0 { limits.lower_rad } else { limits.upper_rad };
            u_begin = u_begin.max(1.0 - (preshape[joint] - limit) / rate[joint]);
        }
        self.set_path(hand, finger, &(*preshape - rate), &rate, u_begin);
    }

    /// Takes a finger's own joints over from `start` and `rate`.
    fn set_path(&mut self, hand: &Hand, finger: usize, start: &Posture, rate: &Posture, u_begin: f64) {
        let mut u_end = f64::INFINITY;
        for &joint in hand.fingers[finger].joints() {
            let limits = &hand.joints[joint];
            if limits.is_held {
                continue;
            }
            self.start[joint] = start[joint];
            self.rate[joint] = rate[joint];
            if rate[joint].abs() > 1e-9 {
                let limit = if rate[joint] > 0.0 { limits.upper_rad } else { limits.lower_rad };
                u_end = u_end.min((limit - start[joint]) / rate[joint]);
            }
        }
        self.u_begin[finger] = u_begin;
        // A path without motion ends where it begins.
        self.u_end[finger] = if u_end.is_finite() { u_end.max(u_begin) } else { u_begin };
    }
}

/// The preshapes of one candidate for widths two millimetres apart, each made when it is first asked for.
#[derive(Debug)]
pub struct PreshapeTable {
    typical: usize,
    candidate: Candidate,
    entries: Vec<OnceLock<Preshape>>,
}

impl PreshapeTable {
    /// An empty table for a candidate that is number `typical` of its hand's, or a variant of it.
    #[must_use]
    pub fn new(typical: usize, candidate: Candidate) -> Self {
        Self { typical, candidate, entries: (0..WIDTHS).map(|_| OnceLock::new()).collect() }
    }

    /// Which of the hand's candidates it is, or is a variant of.
    #[must_use]
    pub fn typical(&self) -> usize {
        self.typical
    }

    /// Whose preshapes these are.
    #[must_use]
    pub fn candidate(&self) -> &Candidate {
        &self.candidate
    }

    /// The preshape for the width nearest to `width_m` (metres) that the table has.
    #[must_use]
    pub fn nearest(&self, hand: &Hand, width_m: f64) -> &Preshape {
        let entry = (width_m.max(0.0) / WIDTH_STEP_M).round() as usize;
        let entry = entry.min(WIDTHS - 1);
        self.entries[entry]
            .get_or_init(|| Preshape::for_width(hand, &self.candidate, entry as f64 * WIDTH_STEP_M))
    }
}

/// The tables of a hand's candidates, in their order.
#[must_use]
pub fn tables(hand: &Hand) -> Vec<PreshapeTable> {
    hand.candidates.iter().cloned().enumerate().map(|(i, c)| PreshapeTable::new(i, c)).collect()
}

/// An angle in -pi..=pi.
fn wrapped(angle_rad: f64) -> f64 {
    let turns = (angle_rad / std::f64::consts::TAU).round();
    angle_rad - turns * std::f64::consts::TAU
}

/// Pose of the grasp frame in the palm frame, and the opening, at closing fraction `s`.
fn grasp_frame(hand: &Hand, candidate: &Candidate, s: f64) -> (Isometry3<f64>, f64) {
    let (opposing, mean) = opposed_tips(hand, candidate, s);
    // Closed beyond touching each other the tips pass, and the line between them turns round: keep to the line of the
    // open hand.
    let (open_opposing, open_mean) = opposed_tips(hand, candidate, 0.0);
    let open_across = (open_opposing - open_mean).try_normalize(1e-9).unwrap_or_else(Vector3::x);
    let across = opposing - mean;
    let apart_m = across.dot(&open_across);
    let x = if apart_m > 1e-3 { across.normalize() } else { open_across };
    let lateral = candidate.lateral_in_palm.into_inner();
    let y = (lateral - x * x.dot(&lateral)).try_normalize(1e-9).unwrap_or_else(|| any_across(&x));
    let rotation = rotation_from_axes(&x, &y, &x.cross(&y));
    (Isometry3::from_parts(Translation3::from(0.5 * (mean + opposing)), rotation), apart_m.max(0.0))
}

/// The opposing finger's tip and the mean of the others', palm frame.
fn opposed_tips(hand: &Hand, candidate: &Candidate, s: f64) -> (Vector3<f64>, Vector3<f64>) {
    let posture = candidate.posture_at(&hand.joints, s);
    let tip = |finger: usize| {
        let chain = &hand.fingers[finger];
        chain.tip_in_palm(&chain.frames(&posture)).coords
    };
    let (mut sum, mut count) = (Vector3::zeros(), 0);
    for finger in candidate.fingers().filter(|&f| f != candidate.opposing) {
        sum += tip(finger);
        count += 1;
    }
    (tip(candidate.opposing), sum / f64::from(count.max(1)))
}

/// A unit vector across another.
#[must_use]
pub fn any_across(axis: &Vector3<f64>) -> Vector3<f64> {
    let helper = if axis.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
    axis.cross(&helper).normalize()
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

    #[test]
    fn tips_lie_in_one_plane_and_the_opening_is_the_width() {
        let hand = Hand::hit_dlr().unwrap();
        // For balls of 50 mm and more: on smaller ones the ring finger does not get round to its place.
        let quadpod = PreshapeTable::new(0, hand.candidates[0].clone());
        for width_m in [0.06, 0.076, 0.09] {
            let preshape = quadpod.nearest(&hand, width_m);
            let gap_m = preshape.opening_m - 2.0 * hand.fingers[0].tip_radius_m();
            assert!((gap_m - width_m).abs() < 2e-4, "{gap_m} for {width_m}");
            for (i, finger) in hand.fingers.iter().enumerate() {
                for u in [preshape.u_begin[i].max(0.75), 1.0] {
                    let posture = preshape.with_finger_at(u);
                    let in_palm = finger.tip_in_palm(&finger.frames(&posture));
                    let in_grasp = preshape.palm_from_grasp.inverse() * in_palm;
                    assert!(in_grasp.z.abs() < 1.5e-3, "{} at u {u}: {in_grasp}", finger.name);
                }
            }
        }
    }
}
