//! When to be where on a path through joint space: as fast as the limits of speed and acceleration allow.
//!
//! A path is a list of joint angles. Its corners are rounded by parabolas that stay within a given distance, which
//! makes it a chain of pieces `q(s) = q0 + d s + c s^2 / 2` with a continuous tangent. With `x = (ds/dt)^2` linear in
//! `s` between grid points, the joint accelerations `q' x'/2 + q'' x` are linear too, so that limits which hold at
//! both ends of an interval hold in it. One pass forwards and one backwards find the greatest such `x`.

mod path;
#[cfg(test)]
mod tests;

use nalgebra::Point3;
use thiserror::Error;

use super::{
    arm::{Arm, Joints, LoadMode},
    trajectory::{JointTrajectory, Knot, TrajectoryError},
};
use path::{Interval, intervals};

/// Sixteen turns. The number of grid points grows with the angle, so nonsense must not get that far.
const GREATEST_ANGLE_RAD: f64 = 100.0;

/// Accelerations that differ by less, relatively, differ by rounding.
const SAME_ACCELERATION: f64 = 1e-9;

/// Greatest absolute joint speeds and accelerations of a motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionLimits {
    /// Speeds, > 0.
    pub speed_rad_per_s: Joints,
    /// Accelerations, > 0.
    pub acceleration_rad_per_s2: Joints,
}

impl MotionLimits {
    /// What the arm may do with a load judged by [`Arm::check_load`]; `None` where it may not move at all.
    #[must_use]
    pub fn for_load(arm: &Arm, mode: &LoadMode) -> Option<Self> {
        let params = arm.params();
        let (speed, acceleration) = match mode {
            LoadMode::Nominal => (1.0, 1.0),
            LoadMode::Reduced { .. } => (params.load.reduced_speed, params.load.reduced_acceleration),
            LoadMode::Exceeded { .. } | LoadMode::Invalid => return None,
        };
        Some(Self {
            speed_rad_per_s: params.speed_rad_per_s.map(|v| v * speed),
            acceleration_rad_per_s2: params.acceleration_rad_per_s2.map(|a| a * acceleration),
        })
    }
}

/// A limit of the speed in space of one point, such as the grasp centre during the approach.
#[derive(Clone, Copy)]
pub struct PointSpeed<'a> {
    /// Position of the point for given joint angles, metres.
    pub point: &'a dyn Fn(&Joints) -> Point3<f64>,
    /// Its greatest speed, m/s, > 0.
    pub limit_m_per_s: f64,
}

/// Why a path cannot be timed.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum TimingError {
    /// There is no point at all.
    #[error("a path needs at least one point")]
    Empty,
    /// A joint angle is NaN, infinite, or more turns away from zero than any joint can make.
    #[error("point {point} of the path has a joint angle of {angle_rad} rad")]
    Angle {
        /// Index of the path point.
        point: usize,
        /// The angle.
        angle_rad: f64,
    },
    /// The position of the watched point is NaN or infinite.
    #[error("the position of the watched point is not a finite number at point {point} of the path")]
    Position {
        /// Index of the path point at or just before the place.
        point: usize,
    },
    /// A limit is not greater than zero.
    #[error("the {name} limit is {value}, but has to be greater than zero")]
    Limit {
        /// Which limit.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// The result is not a trajectory; limits of extreme size can do this.
    #[error("the timed path is not a trajectory")]
    Trajectory(#[from] TrajectoryError),
}

/// Times a path, from rest to rest.
///
/// `corner_rad` is the distance in joint space that the motion may keep from the corners of the path (it passes through
/// the first and last point exactly). A path of one point, or of equal points, takes no time. The limits of joint speed
/// and acceleration are kept to rounding; that of the point's speed between grid points to first order.
pub fn time_path(
    path: &[Joints],
    limits: &MotionLimits,
    corner_rad: f64,
    point_speed: Option<PointSpeed<'_>>,
) -> Result<JointTrajectory, TimingError> {
    check(path, limits, corner_rad, point_speed)?;
    let intervals = intervals(path, corner_rad);
    let Some(last) = intervals.last() else {
        let rest = Knot { t_s: 0.0, q_rad: path[0], qd_rad_per_s: [0.0; 6] };
        return Ok(JointTrajectory::new(vec![rest])?);
    };

    let mut x = greatest_squared_speeds(&intervals, limits, point_speed)?;
    x[0] = 0.0;
    x[intervals.len()] = 0.0;
    for (k, interval) in intervals.iter().enumerate() {
        x[k + 1] = x[k + 1].min(interval.reachable(x[k], limits));
    }
    for (k, interval) in intervals.iter().enumerate().rev() {
        x[k] = x[k].min(interval.reachable(x[k + 1], limits));
    }

    let mut t_s = 0.0;
    let mut knots = Vec::with_capacity(x.len());
    let acceleration = |k: usize| (x[k + 1] - x[k]) / (2.0 * intervals[k].length);
    for (k, interval) in intervals.iter().enumerate() {
        let (here, next) = (x[k].sqrt(), x[k + 1].sqrt());
        // One cubic does for a straight part with one acceleration, however many intervals it has.
        let one_piece = k > 0 && interval.continues(&intervals[k - 1]) && {
            let (a, b) = (acceleration(k - 1), acceleration(k));
            (a - b).abs() <= SAME_ACCELERATION * (a.abs() + b.abs())
        };
        if !one_piece {
            knots.push(Knot { t_s, q_rad: interval.q, qd_rad_per_s: interval.tangent.map(|d| d * here) });
        }
        t_s += 2.0 * interval.length / (here + next);
    }
    knots.push(Knot { t_s, q_rad: last.end(), qd_rad_per_s: [0.0; 6] });

    // The cubic between two knots is not quite the exact motion where the path bends; what it exceeds is given back.
    let trajectory = JointTrajectory::new(knots)?;
    let excess = excess(&trajectory, limits);
    Ok(if excess > 1.0 { trajectory.slowed(excess)? } else { trajectory })
}

fn check(
    path: &[Joints],
    limits: &MotionLimits,
    corner_rad: f64,
    point_speed: Option<PointSpeed<'_>>,
) -> Result<(), TimingError> {
    if path.is_empty() {
        return Err(TimingError::Empty);
    }
    for (point, q_rad) in path.iter().enumerate() {
        if let Some(&angle_rad) = q_rad.iter().find(|q| q.is_nan() || q.abs() > GREATEST_ANGLE_RAD) {
            return Err(TimingError::Angle { point, angle_rad });
        }
    }
    let positive = (limits.speed_rad_per_s.iter().map(|&v| ("speed", v)))
        .chain(limits.acceleration_rad_per_s2.iter().map(|&v| ("acceleration", v)))
        .chain([("corner", corner_rad)])
        .chain(point_speed.map(|cap| ("point speed", cap.limit_m_per_s)));
    for (name, value) in positive {
        if !(value > 0.0 && value.is_finite()) {
            return Err(TimingError::Limit { name, value });
        }
    }
    Ok(())
}

/// Greatest `x` at each grid point, from the limits that do not depend on the neighbours.
fn greatest_squared_speeds(
    intervals: &[Interval],
    limits: &MotionLimits,
    point_speed: Option<PointSpeed<'_>>,
) -> Result<Vec<f64>, TimingError> {
    let mut x = vec![f64::INFINITY; intervals.len() + 1];
    for (k, interval) in intervals.iter().enumerate() {
        let mut most = interval.greatest_squared_speed(limits);
        if let Some(PointSpeed { point, limit_m_per_s }) = point_speed {
            let chord_m = (point(&interval.end()) - point(&interval.q)).norm();
            if !chord_m.is_finite() {
                return Err(TimingError::Position { point: interval.path_point });
            }
            most = most.min((limit_m_per_s * interval.length / chord_m).powi(2));
        }
        x[k] = x[k].min(most);
        x[k + 1] = x[k + 1].min(most);
    }
    Ok(x)
}

/// By which factor a motion has to be slowed to keep its limits; at most 1 when it keeps them.
fn excess(trajectory: &JointTrajectory, limits: &MotionLimits) -> f64 {
    let peaks = trajectory.peaks();
    (0..6).fold(0.0, |most: f64, i| {
        let speed = peaks.speed_rad_per_s[i] / limits.speed_rad_per_s[i];
        let acceleration = peaks.acceleration_rad_per_s2[i] / limits.acceleration_rad_per_s2[i];
        most.max(speed).max(acceleration.sqrt())
    })
}
