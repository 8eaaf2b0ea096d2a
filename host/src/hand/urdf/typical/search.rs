//! Postures in which a set of fingers stands against an opposing one: on a grid, the best refined downhill.

use nalgebra::{Point3, Unit, Vector3};

use super::patterns::Pattern;
use crate::hand::urdf::flexion;
use crate::hand::urdf::opposition::{State, combined, places, root, shared, turning};
use crate::hand::{Finger, Joint, Posture};

/// Distances of the tips in a preshape that are looked at, as shares of a finger's length, beside the tips' radii.
const OPENINGS: [f64; 2] = [0.25, 0.45];

/// Deviations that cost as much as pads 60 degrees off: of the distance, and of the height over the common plane, metres.
const DISTANCE_M: f64 = 0.03;
pub(super) const HEIGHT_M: f64 = 0.02;

/// Most places of a finger's first turning joint; the best start is kept for each.
const BUCKETS: usize = 5;

/// What does not change while candidates with one opposing finger are looked for.
pub(super) struct Search<'a> {
    pub(super) joints: &'a [Joint],
    pub(super) fingers: &'a [Finger],
    /// The finger that the others close against.
    pub(super) opposing: usize,
    /// Direction across the closing fingers, palm frame.
    pub(super) lateral: Unit<Vector3<f64>>,
    /// Mean of the fingers' roots, palm frame.
    pub(super) roots: Vector3<f64>,
    length_m: f64,
    /// Joints that several fingers share and that do not close them.
    shared: Vec<usize>,
}

/// Axes at an opposing finger: from the others to it, lateral, and away from the palm.
pub(super) struct Axes {
    x: Vector3<f64>,
    pub(super) lateral: Vector3<f64>,
    pub(super) z: Vector3<f64>,
}

impl<'a> Search<'a> {
    pub(super) fn new(
        joints: &'a [Joint],
        fingers: &'a [Finger],
        opposing: usize,
        lateral: Unit<Vector3<f64>>,
    ) -> Self {
        let middle = flexion::middle(joints);
        let count = fingers.len() as f64;
        let length_m = |finger: &Finger| {
            let open = State::new(finger, &flexion::open(joints, finger, &middle));
            (open.tip.coords - root(finger)).norm()
        };
        Self {
            joints,
            fingers,
            opposing,
            lateral,
            roots: fingers.iter().map(root).sum::<Vector3<f64>>() / count,
            length_m: fingers.iter().map(length_m).sum::<f64>() / count,
            shared: shared(joints, fingers),
        }
    }

    pub(super) fn axes(&self, x: &Vector3<f64>, center: &Point3<f64>) -> Axes {
        let lateral = self.lateral.into_inner();
        let lateral = (lateral - x * x.dot(&lateral)).try_normalize(1e-6).unwrap_or(lateral);
        let z = x.cross(&lateral);
        let is_away = z.dot(&(center.coords - self.roots)) >= 0.0;
        Axes { x: *x, lateral, z: if is_away { z } else { -z } }
    }

    /// States of a finger over a setting: its turning joints and its closing joints on a grid.
    fn states(&self, finger: usize, setting: &Posture) -> Vec<(usize, State)> {
        let chain = &self.fingers[finger];
        let turning = turning(self.joints, chain, &self.shared);
        let n = if turning.len() < 3 { BUCKETS } else { 3 };
        let mut turned: Vec<(usize, Posture)> = vec![(0, *setting)];
        for (k, &joint) in turning.iter().take(3).enumerate() {
            let values = places(&self.joints[joint], n);
            turned = turned
                .iter()
                .flat_map(|(bucket, posture)| {
                    combined(&[*posture], joint, &values)
                        .into_iter()
                        .enumerate()
                        .map(move |(place, posture)| (if k == 0 { place } else { *bucket }, posture))
                })
                .collect();
        }
        let flexing = flexion::flexing_joints(self.joints, chain);
        let mut states = Vec::new();
        for (bucket, posture) in &turned {
            let open = flexion::open(self.joints, chain, posture);
            let closed = flexion::closed(self.joints, chain, posture);
            let mut postures = vec![open];
            for (k, &joint) in flexing.iter().take(3).enumerate() {
                let n = match (flexing.len(), k) {
                    (1, _) => 14,
                    (2, 0) => 8,
                    (2, _) => 5,
                    (_, 0) => 6,
                    _ => 4,
                };
                let value = |k: usize| {
                    let share = 0.03 + 0.82 * k as f64 / f64::from(n - 1);
                    open[joint] + (closed[joint] - open[joint]) * share
                };
                let values: Vec<f64> = (0..n as usize).map(value).collect();
                postures = combined(&postures, joint, &values);
            }
            states.extend(postures.iter().map(|posture| (*bucket, State::new(chain, posture))));
        }
        states
    }

    /// The cheapest start of each pattern for each place of the opposing finger's first turning joint.
    pub(super) fn starts(
        &self,
        setting: &Posture,
        patterns: &[Pattern],
        starts: &mut Vec<(f64, usize, Posture, f64)>,
    ) {
        let is_used = |finger| patterns.iter().any(|pattern| pattern.others.contains(&finger));
        let of_finger = |finger| {
            if finger == self.opposing || is_used(finger) { self.states(finger, setting) } else { Vec::new() }
        };
        let states: Vec<Vec<(usize, State)>> = (0..self.fingers.len()).map(of_finger).collect();
        let one_drive = self.one_drive();
        let mut best: Vec<Vec<Option<(f64, Posture, f64)>>> = vec![vec![None; BUCKETS]; patterns.len()];
        for (bucket, own) in &states[self.opposing] {
            let slant = own.pad.dot(&self.lateral).powi(2);
            // Turned away from the others: nothing stands against it.
            if slant > 0.5 {
                continue;
            }
            for share in OPENINGS {
                let opening_m = share * self.length_m + 2.0 * self.fingers[self.opposing].tip_radius_m();
                let center = own.tip + own.pad * (0.5 * opening_m);
                let axes = self.axes(&-own.pad, &center);
                let mut known: Vec<(usize, f64, (f64, usize))> = Vec::new();
                for (index, pattern) in patterns.iter().enumerate() {
                    let mut cost = 1.5 * slant;
                    let mut posture = own.posture;
                    let mut aside_m = 0.0;
                    for (k, &finger) in pattern.others.iter().enumerate() {
                        let angle = pattern.around_rad.as_ref().map_or(f64::NAN, |around| around[k]);
                        let same = |entry: &&(usize, f64, (f64, usize))| {
                            entry.0 == finger && entry.1.to_bits() == angle.to_bits()
                        };
                        let found = known.iter().find(same).map(|entry| entry.2);
                        let (least, state) = found.unwrap_or_else(|| {
                            let around = pattern.around_rad.as_ref().map(|around| around[k]);
                            let costs = states[finger].iter().enumerate().map(|(i, (_, state))| {
                                let conflict = one_drive.iter().any(|&j| state.posture[j] != own.posture[j]);
                                let cost = self.cost(own, state, &axes, opening_m, around);
                                (if conflict { f64::INFINITY } else { cost }, i)
                            });
                            let least =
                                costs.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::INFINITY, 0));
                            known.push((finger, angle, least));
                            least
                        });
                        cost += least / pattern.others.len() as f64;
                        let Some((_, state)) = states[finger].get(state) else { continue };
                        aside_m += (state.tip - own.tip).dot(&axes.lateral) / pattern.others.len() as f64;
                        for &joint in self.fingers[finger].joints() {
                            posture[joint] = state.posture[joint];
                        }
                    }
                    cost += 0.3 * (aside_m / DISTANCE_M).powi(2).min(4.0);
                    let slot = &mut best[index][*bucket];
                    if cost.is_finite() && slot.as_ref().is_none_or(|(least, ..)| cost < *least) {
                        *slot = Some((cost, posture, opening_m));
                    }
                }
            }
        }
        for (index, slots) in best.into_iter().enumerate() {
            starts.extend(slots.into_iter().flatten().map(|(cost, posture, m)| (cost, index, posture, m)));
        }
    }

    /// Joints that close more than one finger.
    fn one_drive(&self) -> Vec<usize> {
        (0..self.joints.len())
            .filter(|&joint| self.joints[joint].flexes.is_some() && flexion::users(self.fingers, joint) > 1)
            .collect()
    }

    /// What is wrong with a finger's state against an opposing one: 0 nothing.
    fn cost(&self, own: &State, state: &State, axes: &Axes, opening_m: f64, around_rad: Option<f64>) -> f64 {
        let to = state.tip - own.tip;
        let height = (to.dot(&axes.z) / HEIGHT_M).powi(2);
        match around_rad {
            None => {
                let off = ((-to.dot(&axes.x) - opening_m) / DISTANCE_M).powi(2);
                1.0 - state.pad.dot(&axes.x) + (0.5 * (off + height)).min(4.0)
            }
            Some(angle) => {
                let (sin, cos) = angle.sin_cos();
                let outward = axes.x * cos + axes.lateral * sin;
                let wanted = (outward - axes.x) * (0.5 * opening_m);
                let off = (to - wanted) - axes.z * (to - wanted).dot(&axes.z);
                1.0 + state.pad.dot(&outward)
                    + (0.5 * (off.norm_squared() / HEIGHT_M.powi(2) + height)).min(4.0)
            }
        }
    }

    /// The whole cost of a posture, with the axes from its own tips.
    fn total(&self, pattern: &Pattern, posture: &Posture, opening_m: f64) -> f64 {
        let own = State::new(&self.fingers[self.opposing], posture);
        let others: Vec<State> =
            pattern.others.iter().map(|&finger| State::new(&self.fingers[finger], posture)).collect();
        let mean = mean(&others);
        let Some(x) = (own.tip.coords - mean).try_normalize(1e-6) else { return f64::INFINITY };
        let center = Point3::from(0.5 * (own.tip.coords + mean));
        let axes = self.axes(&x, &center);
        let mut cost = 2.0 * (1.0 + own.pad.dot(&x)) + 1.5 * x.dot(&self.lateral).powi(2);
        for (k, state) in others.iter().enumerate() {
            let around = pattern.around_rad.as_ref().map(|around| around[k]);
            cost += self.cost(&own, state, &axes, opening_m, around) / others.len() as f64;
        }
        // Little, so that joints that change nothing stay in the middle.
        for &finger in std::iter::once(&self.opposing).chain(&pattern.others) {
            for &joint in self.fingers[finger].joints() {
                let limits = &self.joints[joint];
                let half = 0.5 * (limits.upper_rad - limits.lower_rad);
                let off = (posture[joint] - 0.5 * (limits.lower_rad + limits.upper_rad)) / half.max(1e-9);
                cost += 0.02 * off.powi(2);
            }
        }
        cost
    }

    /// Joint by joint downhill, with steps from a tenth of the range to a two-hundredth.
    pub(super) fn refined(&self, pattern: &Pattern, from: &Posture, opening_m: f64) -> Posture {
        let mut joints: Vec<usize> = Vec::new();
        for &finger in std::iter::once(&self.opposing).chain(&pattern.others) {
            for &joint in self.fingers[finger].joints() {
                if !joints.contains(&joint) {
                    joints.push(joint);
                }
            }
        }
        let mut best = *from;
        let mut least = self.total(pattern, &best, opening_m);
        for share in [0.1, 0.05, 0.02, 0.01, 0.005] {
            for _ in 0..3 {
                for &joint in &joints {
                    let limits = &self.joints[joint];
                    let step = share * (limits.upper_rad - limits.lower_rad);
                    for sign in [-1.0, 1.0] {
                        let mut tried = best;
                        tried[joint] = (tried[joint] + sign * step).clamp(limits.lower_rad, limits.upper_rad);
                        let cost = self.total(pattern, &tried, opening_m);
                        if cost < least - 1e-9 {
                            (best, least) = (tried, cost);
                        }
                    }
                }
            }
        }
        best
    }
}

/// Mean place of some tips, palm frame.
pub(super) fn mean(states: &[State]) -> Vector3<f64> {
    states.iter().map(|state| state.tip.coords).sum::<Vector3<f64>>() / states.len().max(1) as f64
}
