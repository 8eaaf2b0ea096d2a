//! The quintic that begins a corner in the midst of another: Paul's quartic and what an acceleration adds that is there already.
//!
//! A quintic joins position, velocity and acceleration of any two motions (J. J. Craig, *Introduction to Robotics*, 3rd edition,
//! section 7.3). Between a motion with the velocity v0 and the acceleration a0 and a straight line with the velocity v1
//! that meets v0's line at the corner, after half the time T of the blend, it is, with the share s of that time,
//!
//! ```text
//! position = corner + T (v0 (s - 1/2 - g) + v1 g) + T^2 a0 h,    g = s^3 - s^4 / 2,    h = s^2 (1 - s)^3 / 2
//! ```
//!
//! Without a0 this is [`Transition`](super::transition::Transition). What depends on s is the same for all joints.

use super::transition::Motion;

/// A joint's blend about a corner.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Corner {
    /// Where the straight lines meet.
    pub position_rad: f32,
    /// Velocity at the beginning.
    pub before_rad_per_s: f32,
    /// Velocity at the end.
    pub after_rad_per_s: f32,
    /// Acceleration at the beginning; there is none at the end.
    pub acceleration_rad_per_s2: f32,
}

/// What [`Corner`]'s values count for at one time, in positions and in velocities.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Weights {
    before_s: f32,
    after_s: f32,
    acceleration_s2: f32,
    before: f32,
    after: f32,
    acceleration_s: f32,
}

impl Weights {
    /// On the straight line behind the corner, so long after it.
    #[must_use]
    pub const fn straight(after_corner_s: f32) -> Self {
        Self {
            before_s: 0.0,
            after_s: after_corner_s,
            acceleration_s2: 0.0,
            before: 0.0,
            after: 1.0,
            acceleration_s: 0.0,
        }
    }

    /// In a blend of `time_s`, after the share `s` of it, 0 to 1.
    #[must_use]
    pub fn blend(s: f32, time_s: f32) -> Self {
        let (rest, square) = (1.0 - s, s * s);
        let after_s = time_s * square * s * (1.0 - 0.5 * s);
        let after = square * (3.0 - 2.0 * s);
        Self {
            before_s: time_s * (s - 0.5) - after_s,
            after_s,
            acceleration_s2: 0.5 * time_s * time_s * square * rest * rest * rest,
            before: 1.0 - after,
            after,
            acceleration_s: 0.5 * time_s * s * rest * rest * (2.0 - 5.0 * s),
        }
    }
}

impl Corner {
    /// Position in radians and velocity in radians per second.
    #[must_use]
    pub fn at(&self, weights: &Weights) -> (f32, f32) {
        let (before, after) = (self.before_rad_per_s, self.after_rad_per_s);
        let acceleration = self.acceleration_rad_per_s2;
        (
            self.position_rad
                + weights.before_s * before
                + weights.after_s * after
                + weights.acceleration_s2 * acceleration,
            weights.before * before + weights.after * after + weights.acceleration_s * acceleration,
        )
    }

    /// The whole motion in a blend of `time_s`, after the share `s` of it.
    #[must_use]
    pub fn blend(&self, s: f32, time_s: f32) -> Motion {
        let (position_rad, velocity_rad_per_s) = self.at(&Weights::blend(s, time_s));
        let turn = (self.after_rad_per_s - self.before_rad_per_s) / time_s;
        let left = 1.0 + s * (-9.0 + s * (18.0 - 10.0 * s));
        let acceleration_rad_per_s2 = 6.0 * s * (1.0 - s) * turn + left * self.acceleration_rad_per_s2;
        Motion { position_rad, velocity_rad_per_s, acceleration_rad_per_s2 }
    }

    /// The motion on the straight line behind the corner, so long after it.
    #[must_use]
    pub fn straight(&self, after_corner_s: f32) -> Motion {
        let (position_rad, velocity_rad_per_s) = self.at(&Weights::straight(after_corner_s));
        Motion { position_rad, velocity_rad_per_s, acceleration_rad_per_s2: 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::super::transition::Transition;
    use super::*;
    use proptest::prelude::*;

    /// The quintic by its six conditions, in f64: its value and derivatives after a share of `time_s`.
    fn by_conditions(from: [f64; 3], to: [f64; 3], time_s: f64, s: f64) -> [f64; 3] {
        let (v0, v1) = (from[1] * time_s, to[1] * time_s);
        let (a0, a1) = (from[2] * time_s * time_s, to[2] * time_s * time_s);
        let way = to[0] - from[0];
        let c = [
            from[0],
            v0,
            0.5 * a0,
            10.0 * way - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1,
            -15.0 * way + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1,
            6.0 * way - 3.0 * (v0 + v1) - 0.5 * a0 + 0.5 * a1,
        ];
        let sum = |terms: [f64; 6]| terms.iter().zip(c).map(|(term, c)| term * c).sum::<f64>();
        [
            sum([1.0, s, s.powi(2), s.powi(3), s.powi(4), s.powi(5)]),
            sum([0.0, 1.0, 2.0 * s, 3.0 * s.powi(2), 4.0 * s.powi(3), 5.0 * s.powi(4)]) / time_s,
            sum([0.0, 0.0, 2.0, 6.0 * s, 12.0 * s.powi(2), 20.0 * s.powi(3)]) / (time_s * time_s),
        ]
    }

    fn assert_near(a: &Motion, b: [f64; 3], tolerance: [f64; 3]) {
        let a = [a.position_rad, a.velocity_rad_per_s, a.acceleration_rad_per_s2].map(f64::from);
        assert!((0..3).all(|k| (a[k] - b[k]).abs() <= tolerance[k]), "{a:?} {b:?}");
    }

    #[test]
    fn without_an_acceleration_it_is_pauls_quartic() {
        let paul = Transition { from_rad: 0.2, corner_rad: 0.5, to_rad: -0.4, half_s: 0.25, segment_s: 1.5 };
        let corner = Corner {
            position_rad: 0.5,
            before_rad_per_s: 0.3 / 0.25,
            after_rad_per_s: -0.9 / 1.5,
            acceleration_rad_per_s2: 0.0,
        };
        for i in 1..100 {
            let s = i as f32 / 100.0;
            let Motion { position_rad, velocity_rad_per_s, acceleration_rad_per_s2 } =
                paul.at(-0.25 + 0.5 * s);
            let paul = [position_rad, velocity_rad_per_s, acceleration_rad_per_s2].map(f64::from);
            assert_near(&corner.blend(s, 0.5), paul, [3e-7, 1e-6, 2e-5]);
        }
        assert_eq!(corner.straight(0.75).position_rad, paul.at(0.75).position_rad);
    }

    proptest! {
        #[test]
        fn it_is_the_quintic_of_its_six_conditions(
            corner in [-1.5_f32..1.5, -3.0_f32..3.0, -3.0_f32..3.0, -200.0_f32..200.0],
            time_s in 0.01_f32..0.5,
            s in 0.0_f32..=1.0,
        ) {
            let [position_rad, before_rad_per_s, after_rad_per_s, acceleration_rad_per_s2] = corner;
            let blend = Corner { position_rad, before_rad_per_s, after_rad_per_s, acceleration_rad_per_s2 };
            let [position, before, after, acceleration] = corner.map(f64::from);
            let half_s = 0.5 * f64::from(time_s);
            let from = [position - before * half_s, before, acceleration];
            let to = [position + after * half_s, after, 0.0];
            let should = by_conditions(from, to, f64::from(time_s), f64::from(s));
            // Six digits of the largest term of each.
            let largest = [3.0, 3.0 + 200.0 * half_s, 200.0 + 12.0 / half_s];
            assert_near(&blend.blend(s, time_s), should, largest.map(|term| 2e-6 * term));
        }
    }
}
