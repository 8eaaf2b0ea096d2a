//! Joint angles of one finger for a place of its tip.

use nalgebra::{Matrix3, Point3, Vector3};

use super::Hand;
use super::finger::MAX_SEGMENTS;
use super::posture::Posture;

/// Steps of the iteration; a reachable place takes 3 to 8.
const MAX_STEPS: usize = 24;

/// Rest that counts as reached, metres.
const REACHED_M: f64 = 1e-7;

/// Damping of the normal equations, metres squared: a lever of 0.1 mm counts as none.
const DAMPING_M2: f64 = 1e-8;

impl Hand {
    /// A posture near `seed` in which the tip of `finger` (the centre of its ball) is at `tip_in_palm`, with joints
    /// that are held where `seed` has them; `None` when the limits do not let it.
    ///
    /// Damped least squares with joints at their limits taken out (Y. Nakamura and H. Hanafusa, "Inverse kinematic
    /// solutions with singularity robustness", 1986), at most 24 steps.
    #[must_use]
    pub fn finger_inverse(
        &self,
        finger: usize,
        tip_in_palm: &Point3<f64>,
        seed: &Posture,
    ) -> Option<Posture> {
        let chain = &self.fingers[finger];
        let mut posture = *seed;
        let mut before_m = f64::INFINITY;
        let mut damping_m2 = DAMPING_M2;
        for _ in 0..MAX_STEPS {
            let frames = chain.frames(&posture);
            let tip = chain.tip_in_palm(&frames);
            let rest = tip_in_palm - tip;
            let rest_m = rest.norm();
            if rest_m < REACHED_M {
                return Some(posture);
            }
            // Far from the place, or stuck at a limit or a stretched finger.
            damping_m2 = if rest_m < 0.7 * before_m { DAMPING_M2 } else { damping_m2 * 10.0 };
            before_m = rest_m;
            let jacobian = chain.point_jacobian(&frames, chain.segments().len() - 1, &tip);
            let mut free = [false; MAX_SEGMENTS];
            for (slot, &joint) in free.iter_mut().zip(chain.joints()) {
                *slot = !self.joints[joint].is_held;
            }
            // A joint at its limit that would go beyond it is taken out, and the rest solved again.
            for _ in 0..chain.joints().len() {
                let step = damped_step(&jacobian, &free, &rest, damping_m2);
                let mut taken_out = false;
                let mut next = posture;
                for (column, &joint) in chain.joints().iter().enumerate() {
                    if !free[column] {
                        continue;
                    }
                    let limits = &self.joints[joint];
                    let wanted = posture[joint] + step[column];
                    let kept = wanted.clamp(limits.lower_rad, limits.upper_rad);
                    if kept != wanted && kept == posture[joint] {
                        free[column] = false;
                        taken_out = true;
                    }
                    next[joint] = kept;
                }
                if !taken_out {
                    posture = next;
                    break;
                }
            }
            if !free.iter().any(|&f| f) {
                return None;
            }
        }
        None
    }
}

fn damped_step(
    jacobian: &nalgebra::SMatrix<f64, 3, MAX_SEGMENTS>,
    free: &[bool; MAX_SEGMENTS],
    rest: &Vector3<f64>,
    damping_m2: f64,
) -> [f64; MAX_SEGMENTS] {
    let mut normal = Matrix3::identity() * damping_m2;
    for (column, _) in free.iter().enumerate().filter(|(_, free)| **free) {
        let lever = jacobian.column(column);
        normal += lever * lever.transpose();
    }
    let Some(solved) = normal.cholesky().map(|c| c.solve(rest)) else { return [0.0; MAX_SEGMENTS] };
    // No joint turns by more than half a radian at once: beyond, the lever is another.
    let mut step: [f64; MAX_SEGMENTS] =
        std::array::from_fn(|c| if free[c] { jacobian.column(c).dot(&solved) } else { 0.0 });
    let largest = step.iter().fold(0.0_f64, |most, s| most.max(s.abs()));
    if largest > 0.5 {
        step.iter_mut().for_each(|s| *s *= 0.5 / largest);
    }
    step
}
