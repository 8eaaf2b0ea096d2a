//! Joint limits, and which whole turn of a joint to take.

use std::f64::consts::TAU;

use super::Joints;

/// Rounding of the inverse kinematics must not turn a joint that stands on its limit into one outside.
const TOLERANCE_RAD: f64 = 1e-9;

/// Range of each joint, radians.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointLimits {
    /// Smallest angles.
    pub lower_rad: Joints,
    /// Greatest angles.
    pub upper_rad: Joints,
}

/// Whether a configuration is inside the limits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LimitCheck {
    /// Every joint is.
    Inside,
    /// At least one is not (an angle that is not a number never is).
    Outside {
        /// The worst one, 1 to 6.
        axis: usize,
        /// How far it is beyond its limit.
        excess_rad: f64,
    },
}

impl LimitCheck {
    /// Whether every joint is inside.
    #[must_use]
    pub fn is_inside(&self) -> bool {
        matches!(self, Self::Inside)
    }
}

impl JointLimits {
    /// Compares a configuration with the limits and names the joint that is farthest outside.
    #[must_use]
    pub fn check(&self, q_rad: &Joints) -> LimitCheck {
        let mut worst = LimitCheck::Inside;
        let mut worst_rad = TOLERANCE_RAD;
        for (i, &q) in q_rad.iter().enumerate() {
            let excess_rad =
                if q.is_nan() { f64::INFINITY } else { (self.lower_rad[i] - q).max(q - self.upper_rad[i]) };
            if excess_rad > worst_rad {
                worst_rad = excess_rad;
                worst = LimitCheck::Outside { axis: i + 1, excess_rad };
            }
        }
        worst
    }

    /// `angle_rad` plus whole turns: of the angles inside the limits of joint `i` (0 to 5) the one nearest to
    /// `seed_rad`; if none is inside, the one that is least outside.
    pub(super) fn nearest_turn(&self, i: usize, angle_rad: f64, seed_rad: f64) -> f64 {
        let lower = self.lower_rad[i] - TOLERANCE_RAD;
        let upper = self.upper_rad[i] + TOLERANCE_RAD;
        let first = ((lower - angle_rad) / TAU).ceil();
        let last = ((upper - angle_rad) / TAU).floor();
        if first <= last {
            return angle_rad + TAU * ((seed_rad - angle_rad) / TAU).round().clamp(first, last);
        }
        // None inside: `last` is then the turn just below the range and `first` the one just above.
        let [below, above] = [last, first].map(|turns| angle_rad + TAU * turns);
        if lower - below <= above - upper { below } else { above }
    }
}
