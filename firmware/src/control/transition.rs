//! Paul's quartic transition between two straight segments of a joint's motion.
//!
//! The corner between the segments is replaced, from half a transition before to half after it, by the one quartic that
//! joins position, velocity and a vanishing acceleration at both ends (R. P. Paul, *Robot Manipulators*, 1981). With
//! equal half times and segment times for all joints, all fingers of a hand arrive together.

/// Motion of a joint at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// Angle.
    pub position_rad: f32,
    /// Speed.
    pub velocity_rad_per_s: f32,
    /// Acceleration.
    pub acceleration_rad_per_s2: f32,
}

/// A corner at time 0: from `from_rad` half a transition earlier, over `corner_rad`, to `to_rad` after `segment_s`.
///
/// `from_rad == corner_rad` is a start from rest, `to_rad == corner_rad` a stop. The quartic assumes that the joint comes
/// without acceleration, so a new corner must not begin before the last one has ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transition {
    /// Angle at `-half_s`.
    pub from_rad: f32,
    /// Angle at which the straight segments meet.
    pub corner_rad: f32,
    /// Angle at `segment_s`.
    pub to_rad: f32,
    /// Half the time of the transition; more than 0, and at most `segment_s`.
    pub half_s: f32,
    /// Time of the segment after the corner.
    pub segment_s: f32,
}

impl Transition {
    /// Change of velocity over the transition, times half its time: the scale of everything that the corner costs.
    fn turn_rad(&self) -> f32 {
        (self.to_rad - self.corner_rad) * self.half_s / self.segment_s + (self.from_rad - self.corner_rad)
    }

    /// Motion at `time_s` after the corner; before the transition along the first segment, after it along the second.
    #[must_use]
    pub fn at(&self, time_s: f32) -> Motion {
        let back = self.from_rad - self.corner_rad;
        if time_s <= -self.half_s {
            let velocity = -back / self.half_s;
            return straight(self.corner_rad, velocity, time_s);
        }
        if time_s >= self.half_s {
            return straight(self.corner_rad, (self.to_rad - self.corner_rad) / self.segment_s, time_s);
        }
        let h = (time_s + self.half_s) / (2.0 * self.half_s);
        let turn = self.turn_rad();
        Motion {
            position_rad: self.corner_rad + back + h * (turn * h * h * (2.0 - h) - 2.0 * back),
            velocity_rad_per_s: (turn * h * h * (3.0 - 2.0 * h) - back) / self.half_s,
            acceleration_rad_per_s2: 3.0 * turn * h * (1.0 - h) / (self.half_s * self.half_s),
        }
    }

    /// Largest acceleration of the transition, at the corner.
    #[must_use]
    pub fn peak_acceleration_rad_per_s2(&self) -> f32 {
        0.75 * self.turn_rad().abs() / (self.half_s * self.half_s)
    }

    /// How far the corner is cut.
    #[must_use]
    pub fn cut_rad(&self) -> f32 {
        0.1875 * self.turn_rad().abs()
    }
}

fn straight(corner_rad: f32, velocity_rad_per_s: f32, time_s: f32) -> Motion {
    Motion {
        position_rad: corner_rad + velocity_rad_per_s * time_s,
        velocity_rad_per_s,
        acceleration_rad_per_s2: 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNER: Transition =
        Transition { from_rad: 0.2, corner_rad: 0.5, to_rad: -0.4, half_s: 0.25, segment_s: 1.5 };

    #[test]
    fn ends_match_the_straight_segments() {
        let start = CORNER.at(-0.25 + 1e-7);
        assert!((start.position_rad - 0.2).abs() < 1e-6);
        assert!((start.velocity_rad_per_s - 0.3 / 0.25).abs() < 1e-5);
        assert!(start.acceleration_rad_per_s2.abs() < 1e-4);
        let end = CORNER.at(0.25 - 1e-7);
        assert!((end.position_rad - (0.5 - 0.9 * 0.25 / 1.5)).abs() < 1e-6);
        assert!((end.velocity_rad_per_s + 0.9 / 1.5).abs() < 1e-5);
        assert!(end.acceleration_rad_per_s2.abs() < 1e-4);
        assert!((CORNER.at(1.5).position_rad + 0.4).abs() < 1e-6);
    }

    #[test]
    fn derivatives_are_those_of_the_position() {
        let step = 2e-3;
        for i in -120..=120 {
            let t = i as f32 * 2e-3;
            let (low, here, high) = (CORNER.at(t - step), CORNER.at(t), CORNER.at(t + step));
            let velocity = (high.position_rad - low.position_rad) / (2.0 * step);
            let acceleration = (high.velocity_rad_per_s - low.velocity_rad_per_s) / (2.0 * step);
            assert!((here.velocity_rad_per_s - velocity).abs() < 1e-3, "{t}");
            assert!((here.acceleration_rad_per_s2 - acceleration).abs() < 0.05, "{t}");
        }
    }

    #[test]
    fn peak_and_cut_are_those_of_the_curve() {
        assert!(
            (CORNER.at(0.0).acceleration_rad_per_s2.abs() - CORNER.peak_acceleration_rad_per_s2()).abs()
                < 1e-4
        );
        assert!(((CORNER.at(0.0).position_rad - 0.5).abs() - CORNER.cut_rad()).abs() < 1e-6);
        let most =
            (-250..250).map(|i| CORNER.at(i as f32 * 1e-3).acceleration_rad_per_s2.abs()).fold(0.0, f32::max);
        assert!(most <= CORNER.peak_acceleration_rad_per_s2() * (1.0 + 1e-6));
    }

    #[test]
    fn starts_and_stops_at_rest() {
        let start = Transition { from_rad: 0.5, ..CORNER };
        assert_eq!(start.at(-0.25).velocity_rad_per_s.abs(), 0.0);
        let stop = Transition { to_rad: 0.5, ..CORNER };
        assert_eq!(
            stop.at(0.3),
            Motion { position_rad: 0.5, velocity_rad_per_s: 0.0, acceleration_rad_per_s2: 0.0 }
        );
    }
}
