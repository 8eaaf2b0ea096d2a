//! Joint angles over time as a uniform cubic B-spline.
//!
//! Its control points bound what it does: speed, acceleration and jerk never exceed the first, second and third
//! differences of neighbouring control points over the spacing (they are averages of them). The acceleration is
//! continuous and the jerk constant between knots. Control points on a motion `q(t)` make it the motion itself, smoothed
//! over two spacings: it keeps `h^2 |acceleration| / 6` from it.

use super::{MotionLimits, PointSpeed};
use crate::plan::arm::Joints;
use crate::plan::trajectory::{JointTrajectory, Knot, TrajectoryError};

/// Cubic pieces whose jerks differ by less than this share of the limit become one: it halves the knots of a straight line.
/// The acceleration then has steps of as small a share of what it can change by in one spacing.
const SAME_JERK: f64 = 1e-4;

/// Control points, the first three and the last three equal (rest at both ends), `h` seconds apart.
pub(super) struct TimeSpline {
    pub(super) points: Vec<Joints>,
    pub(super) h_s: f64,
}

impl TimeSpline {
    /// Seconds from the first knot to the last.
    pub(super) fn duration_s(&self) -> f64 {
        self.h_s * self.points.len().saturating_sub(3) as f64
    }

    /// By which factor each stretch between two neighbouring points has to be slowed for the motion to keep all limits;
    /// at most 1 where it keeps them.
    pub(super) fn excess(&self, limits: &MotionLimits, point_speed: Option<PointSpeed<'_>>) -> Vec<f64> {
        let h = self.h_s;
        let places = point_speed.map(|cap| self.points.iter().map(cap.point).collect::<Vec<_>>());
        (0..self.points.len() - 1)
            .map(|k| {
                let mut most: f64 = 0.0;
                for i in 0..6 {
                    let q = |k: usize| self.points[k.min(self.points.len() - 1)][i];
                    let (first, second) = (q(k + 1) - q(k), q(k + 2) - 2.0 * q(k + 1) + q(k));
                    let third = q(k + 3) - 3.0 * q(k + 2) + 3.0 * q(k + 1) - q(k);
                    most = most
                        .max(first.abs() / (h * limits.speed_rad_per_s[i]))
                        .max((second.abs() / (h * h * limits.acceleration_rad_per_s2[i])).sqrt())
                        .max((third.abs() / (h * h * h * limits.jerk_rad_per_s3[i])).cbrt());
                }
                if let (Some(cap), Some(places)) = (point_speed, &places) {
                    most = most.max((places[k + 1] - places[k]).norm() / (h * cap.limit_m_per_s));
                }
                most
            })
            .collect()
    }

    /// The motion as cubic pieces.
    pub(super) fn trajectory(&self, limits: &MotionLimits) -> Result<JointTrajectory, TrajectoryError> {
        let h = self.h_s;
        let same = limits.jerk_rad_per_s3.map(|jerk| SAME_JERK * jerk * h * h * h);
        let third = |k: usize, i: usize| {
            let q = |k: usize| self.points[k][i];
            q(k + 2) - 3.0 * q(k + 1) + 3.0 * q(k) - q(k - 1)
        };
        let Some(last) = self.points.len().checked_sub(2).filter(|&last| last > 1) else {
            return Err(TrajectoryError::Empty);
        };
        let mut knots = Vec::with_capacity(last);
        let mut since = 1;
        for k in 1..=last {
            // One cubic does for several spacings with one jerk.
            if k > 1 && k < last && (0..6).all(|i| (third(k, i) - third(since, i)).abs() <= same[i]) {
                continue;
            }
            since = k;
            let (before, here, after) = (&self.points[k - 1], &self.points[k], &self.points[k + 1]);
            knots.push(Knot {
                t_s: h * (k - 1) as f64,
                q_rad: std::array::from_fn(|i| (before[i] + 4.0 * here[i] + after[i]) / 6.0),
                qd_rad_per_s: std::array::from_fn(|i| (after[i] - before[i]) / (2.0 * h)),
            });
        }
        // Rest is exact: the mean of three equal points may differ from them by rounding.
        for (knot, at) in [(0, 0), (knots.len() - 1, self.points.len() - 1)] {
            knots[knot].q_rad = self.points[at];
            knots[knot].qd_rad_per_s = [0.0; 6];
        }
        JointTrajectory::new(knots)
    }
}
