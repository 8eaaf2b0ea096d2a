//! When to be where on a path through joint space: fast within limits of speed, acceleration and jerk.
//!
//! A path is a chain of cubic pieces in its parameter `s` with continuous curvature ([`Shape`]). With `x = (ds/dt)^2`
//! linear in `s` between grid points, the joint accelerations `q' x'/2 + q'' x` stay below the limits in an interval
//! when they do so in the worst case of its ends. One pass forwards and one backwards find the greatest such `x`: the
//! fastest motion without a limit of jerk (Bobrow, Dubowsky, Gibson 1985). The moving average of its speed `ds/dt` over
//! a window of `acceleration / jerk` bounds the jerk and keeps the path; a straight line so gets exactly the S-curve,
//! which is a trapezoid of speed averaged over that window; for this, peaks of the speed are first cut so wide that the
//! acceleration falls to zero before the braking begins. Where the path bends, the average mixes speeds of places
//! with different limits: speed is taken back there and the passes are made again. What is left is given back by slowing
//! the whole motion, so that the limits hold in the result, whatever the path.

mod path;
mod profile;
mod spline;
#[cfg(test)]
mod tests;

use nalgebra::Point3;
use thiserror::Error;

use super::{
    arm::{Arm, Joints, LoadMode},
    trajectory::{JointTrajectory, Knot, TrajectoryError},
};
use path::{Interval, rounded, through};
use profile::Profile;
use spline::TimeSpline;

/// Sixteen turns. The number of grid points grows with the angle, so nonsense must not get that far.
const GREATEST_ANGLE_RAD: f64 = 100.0;

/// Control points in one window of the moving average: finer, and the limits are used better by less than 1 %.
const POINTS_IN_WINDOW: f64 = 8.0;

/// Least and greatest number of control points of a motion.
const POINTS: [f64; 2] = [24.0, 4000.0];

/// Speed is taken back locally at most this often, and no more once the whole motion need not be slowed by more than
/// [`GOOD_ENOUGH`].
const ROUNDS: usize = 4;
const GOOD_ENOUGH: f64 = 1.02;

/// Shares of the acceleration to try are powers of this, from 1 on, until one makes the motion slower than the one before
/// it: over a short way there is no time for the jerk to build up all of it.
const SHARE_STEP: f64 = 0.7;
const MOST_SHARES: i32 = 40;

/// How a path goes from point to point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shape {
    /// In straight lines of joint space with rounded corners.
    Rounded {
        /// Distance in joint space that the motion may keep from the corners, rad, > 0.
        corner_rad: f64,
    },
    /// Along the cubic spline through all of them: for densely sampled curves.
    Through,
}

/// Greatest absolute joint speeds, accelerations and jerks of a motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionLimits {
    /// Speeds, > 0.
    pub speed_rad_per_s: Joints,
    /// Accelerations, > 0.
    pub acceleration_rad_per_s2: Joints,
    /// Jerks, > 0.
    pub jerk_rad_per_s3: Joints,
}

impl MotionLimits {
    /// What the arm may do with a load judged by [`Arm::check_load`]; `None` where it may not move at all. The jerk is
    /// reduced like the acceleration, so that full acceleration is reached in the same time.
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
            jerk_rad_per_s3: params.jerk_rad_per_s3.map(|j| j * acceleration),
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
/// The motion passes through the first and last point exactly, and through or near the others as `shape` says. A path of
/// one point, or of equal points, takes no time. Limits of joint speed, acceleration and jerk are kept to rounding, that
/// of the point's speed between neighbouring knots on the average. The acceleration is continuous and 0 at both ends.
pub fn time_path(
    path: &[Joints],
    limits: &MotionLimits,
    shape: Shape,
    point_speed: Option<PointSpeed<'_>>,
) -> Result<JointTrajectory, TimingError> {
    check(path, limits, shape, point_speed)?;
    let intervals = match shape {
        Shape::Rounded { corner_rad } => rounded(path, corner_rad),
        Shape::Through => through(path),
    };
    if intervals.is_empty() {
        let rest = Knot { t_s: 0.0, q_rad: path[0], qd_rad_per_s: [0.0; 6] };
        return Ok(JointTrajectory::new(vec![rest])?);
    }
    let most = greatest_squared_speeds(&intervals, limits, point_speed)?;
    let mut best: Option<TimeSpline> = None;
    for share in (0..MOST_SHARES).map(|n| SHARE_STEP.powi(n)) {
        let window_s = share * window_s(limits);
        let trial = Trial { intervals: &intervals, limits, point_speed, window_s, share };
        let Some(spline) = trial.run(most.clone()) else { continue };
        if best.as_ref().is_some_and(|best| best.duration_s() <= spline.duration_s()) {
            break;
        }
        best = Some(spline);
    }
    let best = best.ok_or(TimingError::Trajectory(TrajectoryError::Empty))?;
    let trajectory = best.trajectory(limits)?;
    // Joining pieces may have added a little.
    let excess = excess(&trajectory, limits);
    Ok(if excess > 1.0 { trajectory.slowed(excess)? } else { trajectory })
}

/// By which factor a motion has to be slowed to keep its limits; at most 1 when it keeps them.
fn excess(trajectory: &JointTrajectory, limits: &MotionLimits) -> f64 {
    let peaks = trajectory.peaks();
    (0..6).fold(0.0, |most: f64, i| {
        let speed = peaks.speed_rad_per_s[i] / limits.speed_rad_per_s[i];
        let acceleration = peaks.acceleration_rad_per_s2[i] / limits.acceleration_rad_per_s2[i];
        let jerk = peaks.jerk_rad_per_s3[i] / limits.jerk_rad_per_s3[i];
        most.max(speed).max(acceleration.sqrt()).max(jerk.cbrt())
    })
}

/// Time in which every joint can reach its full acceleration.
fn window_s(limits: &MotionLimits) -> f64 {
    let rises = limits.acceleration_rad_per_s2.iter().zip(&limits.jerk_rad_per_s3);
    rises.map(|(acceleration, jerk)| acceleration / jerk).fold(0.0, f64::max)
}

/// One way to use the limits.
struct Trial<'a> {
    intervals: &'a [Interval],
    limits: &'a MotionLimits,
    point_speed: Option<PointSpeed<'a>>,
    /// Of the moving average.
    window_s: f64,
    /// Of the acceleration.
    share: f64,
}

impl Trial<'_> {
    /// The motion within all limits, from the greatest squared speeds at the grid points; `None` when it is too short for
    /// the acceleration to come and go.
    fn run(&self, mut most: Vec<f64>) -> Option<TimeSpline> {
        let mut best: Option<TimeSpline> = None;
        for _ in 0..ROUNDS {
            let fastest = Profile::new(self.intervals, &self.passes(&most));
            // Without this much, no peak of the speed can be cut to the width of the window.
            if fastest.duration_s().is_nan() || fastest.duration_s() <= 2.0 * self.window_s {
                break;
            }
            let x = fastest.flattened(self.window_s);
            let (mut spline, places) = self.averaged(&Profile::new(self.intervals, &x));
            let excess = spline.excess(self.limits, self.point_speed);
            let worst = excess.iter().copied().fold(0.0, f64::max);
            if worst > 1.0 {
                spline.h_s *= worst;
            }
            if best.as_ref().is_none_or(|best| spline.duration_s() < best.duration_s()) {
                best = Some(spline);
            }
            if worst.is_nan() || worst <= GOOD_ENOUGH {
                break;
            }
            self.take_back(&mut most, &x, &excess, &places);
        }
        best
    }

    /// Squared speeds that the limits of acceleration allow from rest to rest below `most`.
    fn passes(&self, most: &[f64]) -> Vec<f64> {
        let mut limits = *self.limits;
        limits.acceleration_rad_per_s2 = limits.acceleration_rad_per_s2.map(|a| a * self.share);
        let mut x = most.to_vec();
        x[0] = 0.0;
        x[self.intervals.len()] = 0.0;
        for (k, interval) in self.intervals.iter().enumerate() {
            x[k + 1] = x[k + 1].min(interval.reachable(x[k], &limits));
        }
        for (k, interval) in self.intervals.iter().enumerate().rev() {
            x[k] = x[k].min(interval.reachable(x[k + 1], &limits));
        }
        x
    }

    /// The motion with averaged speed as control points, and the place on the path of each.
    fn averaged(&self, profile: &Profile) -> (TimeSpline, Vec<f64>) {
        // A window far below the duration has no effect, and would be lost in rounding.
        let window_s = self.window_s.max(1e-4 * profile.duration_s());
        let total_s = profile.duration_s() + window_s;
        let count = (POINTS_IN_WINDOW * total_s / window_s).ceil().clamp(POINTS[0], POINTS[1]);
        let h_s = total_s / count;
        let length: f64 = self.intervals.iter().map(|interval| interval.length).sum();
        let (mut points, mut places) = (Vec::new(), Vec::new());
        let (mut k, mut before) = (0, 0.0);
        // Three equal points at each end: rest, without acceleration.
        for i in -2..=(count as i64 + 2) {
            let place = profile.averaged(h_s * i as f64, window_s).clamp(0.0, length);
            while k + 1 < self.intervals.len() && place > before + self.intervals[k].length {
                before += self.intervals[k].length;
                k += 1;
            }
            points.push(self.intervals[k].at(place - before));
            places.push(place);
        }
        let end = self.intervals[self.intervals.len() - 1].end();
        let count = points.len();
        points[..3].fill(self.intervals[0].q);
        points[count - 3..].fill(end);
        (TimeSpline { points, h_s }, places)
    }

    /// Lowers the greatest squared speeds about the places where the motion exceeds its limits, as far as it does.
    fn take_back(&self, most: &mut [f64], x: &[f64], excess: &[f64], places: &[f64]) {
        let mut s = 0.0;
        let mut first = 0;
        for k in 0..most.len() {
            // Stretches of the motion that this grid point has to do with: control points act over four spacings.
            while first + 1 < places.len() && places[first + 1] < s {
                first += 1;
            }
            let range = first.saturating_sub(4)..(first + 2).min(excess.len());
            let worst = excess[range].iter().copied().fold(1.0, f64::max);
            if worst > 1.0 {
                most[k] = most[k].min(x[k] / (worst * worst));
            }
            s += self.intervals.get(k).map_or(0.0, |interval| interval.length);
        }
    }
}

fn check(
    path: &[Joints],
    limits: &MotionLimits,
    shape: Shape,
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
    let corner_rad = match shape {
        Shape::Rounded { corner_rad } => Some(corner_rad),
        Shape::Through => None,
    };
    let positive = (limits.speed_rad_per_s.iter().map(|&v| ("speed", v)))
        .chain(limits.acceleration_rad_per_s2.iter().map(|&v| ("acceleration", v)))
        .chain(limits.jerk_rad_per_s3.iter().map(|&v| ("jerk", v)))
        .chain(corner_rad.map(|c| ("corner", c)))
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
