//! The quintic between any two motions of a joint: what Paul's quartic cannot begin, a new corner in the midst of one.
//!
//! It joins position, velocity and acceleration at both ends, six conditions for six coefficients (J. J. Craig,
//! *Introduction to Robotics*, 3rd edition, section 7.3). Between two straight lines that meet at half its time, with no
//! acceleration at either end, its last coefficient vanishes, and it is [`Transition`](super::transition::Transition).

use super::transition::Motion;

/// A joint's motion over a piece of time, as a polynomial of the share of that time that has passed. Coefficients from the
/// constant one on, in radians.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Quintic([f32; 6]);

impl Quintic {
    /// From one motion to another in `time_s`, which is more than 0.
    #[must_use]
    pub fn between(from: &Motion, to: &Motion, time_s: f32) -> Self {
        // Derivatives by the share instead of by time.
        let (v0, v1) = (from.velocity_rad_per_s * time_s, to.velocity_rad_per_s * time_s);
        let (a0, a1) =
            (from.acceleration_rad_per_s2 * time_s * time_s, to.acceleration_rad_per_s2 * time_s * time_s);
        let way = to.position_rad - from.position_rad;
        Self([
            from.position_rad,
            v0,
            0.5 * a0,
            10.0 * way - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1,
            -15.0 * way + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1,
            6.0 * way - 3.0 * (v0 + v1) - 0.5 * a0 + 0.5 * a1,
        ])
    }

    /// Evenly from `position_rad` on.
    #[must_use]
    pub fn straight(position_rad: f32, velocity_rad_per_s: f32, time_s: f32) -> Self {
        Self([position_rad, velocity_rad_per_s * time_s, 0.0, 0.0, 0.0, 0.0])
    }

    /// Position in radians and velocity in radians per piece, after a share of the piece, 0 to 1.
    #[must_use]
    pub fn at(&self, share: f32) -> (f32, f32) {
        let [c0, c1, c2, c3, c4, c5] = self.0;
        // Horner's scheme, twice: its intermediate values are the coefficients of the quotient, whose value is the derivative.
        let b4 = c5 * share + c4;
        let b3 = b4 * share + c3;
        let b2 = b3 * share + c2;
        let b1 = b2 * share + c1;
        let position = b1 * share + c0;
        let velocity = (((c5 * share + b4) * share + b3) * share + b2) * share + b1;
        (position, velocity)
    }

    /// The whole motion after a share of the piece, which takes `time_s`.
    #[must_use]
    pub fn motion(&self, share: f32, time_s: f32) -> Motion {
        let (position_rad, velocity) = self.at(share);
        let [_, _, c2, c3, c4, c5] = self.0;
        let acceleration = ((20.0 * c5 * share + 12.0 * c4) * share + 6.0 * c3) * share + 2.0 * c2;
        Motion {
            position_rad,
            velocity_rad_per_s: velocity / time_s,
            acceleration_rad_per_s2: acceleration / (time_s * time_s),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::transition::Transition;
    use super::*;
    use proptest::prelude::*;

    fn motion(position_rad: f32, velocity_rad_per_s: f32, acceleration_rad_per_s2: f32) -> Motion {
        Motion { position_rad, velocity_rad_per_s, acceleration_rad_per_s2 }
    }

    fn assert_near(a: &Motion, b: &Motion, tolerance: [f32; 3]) {
        let off = [
            a.position_rad - b.position_rad,
            a.velocity_rad_per_s - b.velocity_rad_per_s,
            a.acceleration_rad_per_s2 - b.acceleration_rad_per_s2,
        ];
        assert!(off.iter().zip(tolerance).all(|(off, most)| off.abs() <= most), "{a:?} {b:?}");
    }

    #[test]
    fn from_rest_to_rest_it_is_the_minimum_jerk_motion() {
        // Flash and Hogan 1985: 10 s^3 - 15 s^4 + 6 s^5, peak speed 15/8 of the mean.
        let piece = Quintic::between(&motion(1.0, 0.0, 0.0), &motion(3.0, 0.0, 0.0), 0.5);
        for i in 0..=20 {
            let s = i as f32 / 20.0;
            let way = 10.0 * s.powi(3) - 15.0 * s.powi(4) + 6.0 * s.powi(5);
            assert!((piece.at(s).0 - (1.0 + 2.0 * way)).abs() < 5e-6, "{s}");
        }
        assert!((piece.motion(0.5, 0.5).velocity_rad_per_s - 4.0 * 1.875).abs() < 1e-5);
    }

    #[test]
    fn at_a_corner_it_is_pauls_quartic() {
        let corner =
            Transition { from_rad: 0.2, corner_rad: 0.5, to_rad: -0.4, half_s: 0.25, segment_s: 1.5 };
        let piece = Quintic::between(&corner.at(-0.25), &corner.at(0.25), 0.5);
        for i in 0..=100 {
            let share = i as f32 / 100.0;
            let paul = corner.at(-0.25 + 0.5 * share);
            // Paul's own end has no acceleration; at the very ends he is on the straight lines.
            assert_near(&piece.motion(share, 0.5), &paul, [1e-6, 2e-5, 1e-3]);
        }
    }

    proptest! {
        #[test]
        fn both_ends_are_met(
            from in [-1.5_f32..1.5, -3.0_f32..3.0, -50.0_f32..50.0],
            to in [-1.5_f32..1.5, -3.0_f32..3.0, -50.0_f32..50.0],
            time_s in 0.02_f32..2.0,
        ) {
            let [from, to] = [from, to].map(|[p, v, a]| motion(p, v, a));
            let piece = Quintic::between(&from, &to, time_s);
            // Of the coefficients' size, and what becomes of it in a derivative by a short time.
            let most = 1e-6 * (3.0 + 6.0 * time_s + 50.0 * time_s * time_s) * 16.0;
            let tolerance = [most, 8.0 * most / time_s, 64.0 * most / (time_s * time_s)];
            assert_near(&piece.motion(0.0, time_s), &from, tolerance);
            assert_near(&piece.motion(1.0, time_s), &to, tolerance);
        }

        #[test]
        fn derivatives_are_those_of_the_position(
            from in [-1.0_f32..1.0, -2.0_f32..2.0, -9.0_f32..9.0], to in -1.0_f32..1.0, share in 0.05_f32..0.95,
        ) {
            let [p, v, a] = from;
            let piece = Quintic::between(&motion(p, v, a), &motion(to, 0.0, 0.0), 1.0);
            let step = 0.01;
            let (low, here, high) =
                (piece.motion(share - step, 1.0), piece.motion(share, 1.0), piece.motion(share + step, 1.0));
            let velocity = (high.position_rad - low.position_rad) / (2.0 * step);
            let acceleration = (high.velocity_rad_per_s - low.velocity_rad_per_s) / (2.0 * step);
            prop_assert!((here.velocity_rad_per_s - velocity).abs() < 0.05);
            prop_assert!((here.acceleration_rad_per_s2 - acceleration).abs() < 0.3);
        }
    }
}
