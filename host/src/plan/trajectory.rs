//! Joint angles over time, as cubic pieces.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::arm::Joints;

/// Where the arm is, and how fast, at one time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "Knot of an arm trajectory")]
pub struct Knot {
    /// Time since the start of the motion, seconds.
    #[schemars(title = "Time", range(min = 0.0))]
    pub t_s: f64,
    /// Joint angles in the manufacturer's counting, rad.
    #[schemars(title = "Angles")]
    pub q_rad: Joints,
    /// Joint speeds, rad/s.
    #[schemars(title = "Speeds")]
    pub qd_rad_per_s: Joints,
}

/// The state of a motion between two knots.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Joint angles.
    pub q_rad: Joints,
    /// Joint speeds.
    pub qd_rad_per_s: Joints,
    /// Joint accelerations.
    pub qdd_rad_per_s2: Joints,
}

/// The greatest absolute values that each joint reaches during a motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Peaks {
    /// Speeds.
    pub speed_rad_per_s: Joints,
    /// Accelerations.
    pub acceleration_rad_per_s2: Joints,
    /// Jerks, inside the pieces.
    pub jerk_rad_per_s3: Joints,
}

/// Why knots are not a trajectory.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum TrajectoryError {
    /// There is no knot.
    #[error("a trajectory needs at least one knot")]
    Empty,
    /// A knot contains NaN or infinity.
    #[error("knot {knot} contains a value that is not a finite number")]
    NotFinite {
        /// Index of the knot.
        knot: usize,
    },
    /// Times do not begin at zero or do not increase.
    #[error(
        "knot {knot} is at {t_s} s, which is not after the knot before it (the first one has to be at 0 s)"
    )]
    Time {
        /// Index of the knot.
        knot: usize,
        /// Its time.
        t_s: f64,
    },
    /// A motion can only be slowed by a factor greater than zero.
    #[error("a motion cannot be slowed by the factor {0}")]
    Factor(f64),
}

/// A motion of six joints: cubic Hermite pieces between knots, so that angle and speed are continuous and the
/// acceleration is linear in each piece.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "Vec<Knot>", into = "Vec<Knot>")]
#[schemars(title = "Arm trajectory", extend("minItems" = 1))]
pub struct JointTrajectory {
    knots: Vec<Knot>,
}

impl TryFrom<Vec<Knot>> for JointTrajectory {
    type Error = TrajectoryError;

    fn try_from(knots: Vec<Knot>) -> Result<Self, TrajectoryError> {
        Self::new(knots)
    }
}

impl From<JointTrajectory> for Vec<Knot> {
    fn from(trajectory: JointTrajectory) -> Self {
        trajectory.knots
    }
}

impl JointTrajectory {
    /// Checks that there are knots, that they are finite, and that their times begin at zero and increase.
    pub fn new(knots: Vec<Knot>) -> Result<Self, TrajectoryError> {
        if knots.is_empty() {
            return Err(TrajectoryError::Empty);
        }
        let mut before_s = None;
        for (i, knot) in knots.iter().enumerate() {
            if !knot.q_rad.iter().chain(&knot.qd_rad_per_s).chain([&knot.t_s]).all(|v| v.is_finite()) {
                return Err(TrajectoryError::NotFinite { knot: i });
            }
            if before_s.map_or(knot.t_s != 0.0, |before_s| knot.t_s <= before_s) {
                return Err(TrajectoryError::Time { knot: i, t_s: knot.t_s });
            }
            before_s = Some(knot.t_s);
        }
        Ok(Self { knots })
    }

    /// The knots, in the order of time; at least one.
    #[must_use]
    pub fn knots(&self) -> &[Knot] {
        &self.knots
    }

    /// Time of the last knot.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.knots.last().map_or(0.0, |knot| knot.t_s)
    }

    /// The state at a time. Before the start and after the end the arm rests where it starts or ends.
    #[must_use]
    pub fn sample(&self, t_s: f64) -> Sample {
        let after = self.knots.partition_point(|knot| knot.t_s <= t_s);
        if after == 0 || after == self.knots.len() {
            // The last knot itself still has its speed.
            let knot = &self.knots[after.saturating_sub(1)];
            let moving = t_s == knot.t_s;
            let qd_rad_per_s = if moving { knot.qd_rad_per_s } else { [0.0; 6] };
            return Sample { q_rad: knot.q_rad, qd_rad_per_s, qdd_rad_per_s2: [0.0; 6] };
        }
        let (a, b) = (&self.knots[after - 1], &self.knots[after]);
        let piece: [[f64; 3]; 6] = std::array::from_fn(|i| Piece::between(a, b, i).at(t_s - a.t_s));
        Sample {
            q_rad: piece.map(|[q, _, _]| q),
            qd_rad_per_s: piece.map(|[_, qd, _]| qd),
            qdd_rad_per_s2: piece.map(|[_, _, qdd]| qdd),
        }
    }

    /// The greatest speeds, accelerations and jerks, exactly: a quadratic, a linear function and a constant in each
    /// piece.
    #[must_use]
    pub fn peaks(&self) -> Peaks {
        let mut peaks =
            Peaks { speed_rad_per_s: [0.0; 6], acceleration_rad_per_s2: [0.0; 6], jerk_rad_per_s3: [0.0; 6] };
        for i in 0..6 {
            let speed = &mut peaks.speed_rad_per_s[i];
            *speed = self.knots.iter().fold(0.0, |most, knot| most.max(knot.qd_rad_per_s[i].abs()));
            for pair in self.knots.windows(2) {
                let piece = Piece::between(&pair[0], &pair[1], i);
                let end = piece.at(piece.duration_s);
                let acceleration = &mut peaks.acceleration_rad_per_s2[i];
                *acceleration = acceleration.max(piece.acceleration.abs()).max(end[2].abs());
                let jerk = &mut peaks.jerk_rad_per_s3[i];
                *jerk = jerk.max(piece.jerk.abs());
                let turning_s = -piece.acceleration / piece.jerk;
                if turning_s > 0.0 && turning_s < piece.duration_s {
                    *speed = speed.max(piece.at(turning_s)[1].abs());
                }
            }
        }
        peaks
    }

    /// The same path, `factor` times as slow: speeds fall by the factor, accelerations by its square, jerks by its cube.
    /// An error when the
    /// factor is not greater than zero, or when the times or speeds leave the range of numbers.
    pub fn slowed(&self, factor: f64) -> Result<Self, TrajectoryError> {
        let slow = |knot: &Knot| Knot {
            t_s: knot.t_s * factor,
            q_rad: knot.q_rad,
            qd_rad_per_s: knot.qd_rad_per_s.map(|speed| speed / factor),
        };
        if factor.is_nan() || factor <= 0.0 {
            return Err(TrajectoryError::Factor(factor));
        }
        Self::new(self.knots.iter().map(slow).collect())
    }
}

/// One joint between two knots: a cubic in the time since the first one.
struct Piece {
    duration_s: f64,
    angle: f64,
    speed: f64,
    /// At the start.
    acceleration: f64,
    jerk: f64,
}

impl Piece {
    fn between(a: &Knot, b: &Knot, joint: usize) -> Self {
        let duration_s = b.t_s - a.t_s;
        let (v0, v1) = (a.qd_rad_per_s[joint], b.qd_rad_per_s[joint]);
        let mean = (b.q_rad[joint] - a.q_rad[joint]) / duration_s;
        Self {
            duration_s,
            angle: a.q_rad[joint],
            speed: v0,
            acceleration: (6.0 * mean - 4.0 * v0 - 2.0 * v1) / duration_s,
            jerk: 6.0 * (v0 + v1 - 2.0 * mean) / (duration_s * duration_s),
        }
    }

    /// Angle, speed and acceleration.
    fn at(&self, t: f64) -> [f64; 3] {
        let acceleration = self.acceleration + self.jerk * t;
        let speed = self.speed + t * (self.acceleration + 0.5 * self.jerk * t);
        let angle = self.angle + t * (self.speed + t * (0.5 * self.acceleration + self.jerk * t / 6.0));
        [angle, speed, acceleration]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Joint 1 runs through `t^3 - 2 t`, which one Hermite piece has to give back exactly; joint 2 turns at a
    /// constant speed.
    fn cubic() -> JointTrajectory {
        let knot = |t: f64| Knot {
            t_s: t,
            q_rad: [t * t * t - 2.0 * t, 0.5 * t, 0.0, 0.0, 0.0, 0.0],
            qd_rad_per_s: [3.0 * t * t - 2.0, 0.5, 0.0, 0.0, 0.0, 0.0],
        };
        JointTrajectory::new(vec![knot(0.0), knot(1.5), knot(2.0)]).unwrap()
    }

    #[test]
    fn a_cubic_comes_back_exactly() {
        let trajectory = cubic();
        for i in 0..200 {
            let t = 0.01 * f64::from(i);
            let sample = trajectory.sample(t);
            assert!((sample.q_rad[0] - (t * t * t - 2.0 * t)).abs() < 1e-13);
            assert!((sample.qd_rad_per_s[0] - (3.0 * t * t - 2.0)).abs() < 1e-13);
            assert!((sample.qdd_rad_per_s2[0] - 6.0 * t).abs() < 1e-12);
            assert!((sample.qd_rad_per_s[1] - 0.5).abs() < 1e-13);
        }
        let peaks = trajectory.peaks();
        assert!((peaks.speed_rad_per_s[0] - 10.0).abs() < 1e-12);
        assert!((peaks.acceleration_rad_per_s2[0] - 12.0).abs() < 1e-12);
    }

    #[test]
    fn a_peak_speed_between_knots_is_seen() {
        let knot = |t_s: f64, q: f64| Knot { t_s, q_rad: [q; 6], qd_rad_per_s: [0.0; 6] };
        let peaks = JointTrajectory::new(vec![knot(0.0, 0.0), knot(2.0, 1.0)]).unwrap().peaks();
        assert!((peaks.speed_rad_per_s[3] - 0.75).abs() < 1e-15);
        assert!((peaks.acceleration_rad_per_s2[3] - 1.5).abs() < 1e-15);
    }

    #[test]
    fn outside_its_time_the_arm_rests() {
        let trajectory = cubic();
        assert_eq!(trajectory.sample(-1.0).qd_rad_per_s, [0.0; 6]);
        assert_eq!(trajectory.sample(-1.0).q_rad, trajectory.knots()[0].q_rad);
        assert_eq!(trajectory.sample(9.0).q_rad, trajectory.knots()[2].q_rad);
        assert_eq!(trajectory.sample(9.0).qd_rad_per_s, [0.0; 6]);
        assert_eq!(trajectory.sample(2.0).qd_rad_per_s, trajectory.knots()[2].qd_rad_per_s);
        assert_eq!(trajectory.sample(f64::NAN).q_rad, trajectory.knots()[0].q_rad);
    }

    #[test]
    fn slowed_motion_has_scaled_peaks() {
        let (fast, slow) = (cubic().peaks(), cubic().slowed(2.0).unwrap().peaks());
        assert!((slow.speed_rad_per_s[0] - fast.speed_rad_per_s[0] / 2.0).abs() < 1e-12);
        assert!((slow.acceleration_rad_per_s2[0] - fast.acceleration_rad_per_s2[0] / 4.0).abs() < 1e-12);
        assert_eq!(cubic().slowed(-1.0), Err(TrajectoryError::Factor(-1.0)));
        assert!(cubic().slowed(f64::NAN).is_err() && cubic().slowed(f64::INFINITY).is_err());
    }

    #[test]
    fn bad_knots_are_named_also_when_read_from_a_file() {
        let knot = |t_s: f64| Knot { t_s, q_rad: [0.0; 6], qd_rad_per_s: [0.0; 6] };
        assert_eq!(JointTrajectory::new(vec![]), Err(TrajectoryError::Empty));
        let late = TrajectoryError::Time { knot: 0, t_s: 1.0 };
        assert_eq!(JointTrajectory::new(vec![knot(1.0)]), Err(late));
        let repeated = TrajectoryError::Time { knot: 2, t_s: 1.0 };
        assert_eq!(JointTrajectory::new(vec![knot(0.0), knot(1.0), knot(1.0)]), Err(repeated));
        let nan = JointTrajectory::new(vec![knot(0.0), knot(f64::NAN)]);
        assert_eq!(nan, Err(TrajectoryError::NotFinite { knot: 1 }));

        let text = serde_json::to_string(&cubic()).unwrap();
        assert_eq!(serde_json::from_str::<JointTrajectory>(&text).unwrap(), cubic());
        let error = serde_json::from_str::<JointTrajectory>(&text.replace("1.5", "5.5")).unwrap_err();
        assert!(error.to_string().contains("knot 2 is at 2 s"), "{error}");
    }
}
