//! From set-points, which come once a bus cycle, to a target for every control period, without a step in it.
//!
//! Between two set-points the target moves evenly, over the time that lay between them, and never faster than a joint
//! may. So it needs no speed on the wire; it comes one bus cycle late; and whatever is commanded, even at the moment when
//! torque comes on, starts from where the joints are.

use protocol::command::Setpoint;
use protocol::ids::{FINGER_COUNT, FingerId, JOINT_COUNT, JointId};
use protocol::telemetry::JointSet;

use crate::control::segments::{Pace, Segment, SegmentError, Segments};
use crate::control::{Target, ThumbMode};

/// How fast a target may change.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Config {
    /// Largest joint speed.
    pub speed_max_rad_per_s: f32,
    /// Largest change of a feed-forward torque.
    pub torque_rate_max_nm_per_s: f32,
    /// Half the time of a blend between segments.
    pub blend_half_us: u32,
}

impl Config {
    const fn pace(&self) -> Pace {
        Pace { half_us: self.blend_half_us, speed_max_rad_per_s: self.speed_max_rad_per_s }
    }
}

/// A target on its way to the last set-point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Follower {
    target: Target,
    limited: JointSet,
    goal_rad: [f32; JOINT_COUNT],
    goal_nm: [f32; JOINT_COUNT],
    /// Time left to get there.
    left_s: f32,
    segments: Segments,
    /// Whether positions are those of the segments.
    by_segments: bool,
}

/// The end of `+-most` that `x` lies beyond; `None` if it lies within. Unlike `clamp` it cannot panic, whatever `most` is; and
/// `min` and `max`, which think of NaN, are calls of twenty instructions each.
fn end_beyond(x: f32, most: f32) -> Option<f32> {
    if x.abs() <= most { None } else { Some(if x > most { most } else { -most }) }
}

impl Follower {
    /// At rest at these angles.
    #[must_use]
    pub fn new(position_rad: [f32; JOINT_COUNT]) -> Self {
        Self {
            target: Target::hold(position_rad, ThumbMode::Position),
            limited: JointSet::default(),
            goal_rad: position_rad,
            goal_nm: [0.0; JOINT_COUNT],
            left_s: 0.0,
            segments: Segments::at_rest(&position_rad),
            by_segments: false,
        }
    }

    /// Whether positions are those of segments from now on. Beginning with them, the hand is at rest; ending with them, it goes
    /// to the last set-point.
    pub fn follow_segments(&mut self, by_segments: bool) {
        if by_segments && !self.by_segments {
            self.segments.rest(&self.target.position_rad);
        }
        self.by_segments = by_segments;
    }

    /// Forgets the segments, here.
    pub fn drop_segments(&mut self) {
        self.segments.rest(&self.target.position_rad);
    }

    /// Adds a segment, which may begin at once.
    ///
    /// # Errors
    ///
    /// [`SegmentError`]; then all is as before.
    pub fn add_segment(
        &mut self,
        config: &Config,
        segment: &Segment,
        replaces: bool,
    ) -> Result<(), SegmentError> {
        self.segments.add(segment, replaces, &config.pace())
    }

    /// One period by segments, instead of [`Self::step`].
    #[inline(never)]
    pub fn step_segments(&mut self, config: &Config, active: [bool; FINGER_COUNT], elapsed_us: u32) {
        let weights = self.segments.advance(elapsed_us, &config.pace());
        self.limited = JointSet::default();
        let torque_step_nm = config.torque_rate_max_nm_per_s * (elapsed_us as f32 * 1e-6);
        let target = &mut self.target;
        for finger in FingerId::ALL {
            if !active[finger.index()] {
                target.velocity_rad_per_s[finger.joints()].fill(0.0);
                continue;
            }
            for i in finger.joints() {
                self.segments.write(i, &weights, target);
                let left_nm = self.goal_nm[i] - target.feed_forward_nm[i];
                target.feed_forward_nm[i] += end_beyond(left_nm, torque_step_nm).unwrap_or(left_nm);
            }
        }
    }

    /// Begins anew where the joints of a finger are, without torque.
    pub fn restart(&mut self, finger: FingerId, measured_rad: &[f32; JOINT_COUNT]) {
        for i in finger.joints() {
            self.target.position_rad[i] = measured_rad[i];
            self.target.feed_forward_nm[i] = 0.0;
        }
    }

    /// A new set-point, to be reached in `within_s`.
    pub fn head_for(&mut self, setpoint: &Setpoint, within_s: f32) {
        for i in 0..JOINT_COUNT {
            self.goal_nm[i] = setpoint.feed_forward[i].to_nm();
        }
        // It is a set-point that ends segments, and then it counts.
        if !setpoint.control.segments() {
            for i in 0..JOINT_COUNT {
                self.goal_rad[i] = setpoint.position[i].to_rad();
            }
        }
        self.left_s = within_s;
        let is_spring = setpoint.control.thumb_impedance();
        self.target.thumb_mode = if is_spring { ThumbMode::Impedance } else { ThumbMode::Position };
    }

    /// Stay here: no set-point is to be reached any more. Torques stay, for they may carry what is held.
    pub fn stay(&mut self) {
        (self.goal_rad, self.goal_nm) = (self.target.position_rad, self.target.feed_forward_nm);
    }

    /// One period of `dt_s`, which is more than 0. Fingers not `active` do not move.
    // A function of its own, as every large step of a period: all of them in one run out of registers.
    #[inline(never)]
    pub fn step(&mut self, config: &Config, active: [bool; FINGER_COUNT], dt_s: f32) {
        let time_s = if self.left_s > dt_s { self.left_s } else { dt_s };
        // One division for all joints.
        let (per_s, arrives) = (1.0 / time_s, time_s <= dt_s);
        let torque_step_nm = config.torque_rate_max_nm_per_s * dt_s;
        let target = &mut self.target;
        self.limited = JointSet::default();
        for finger in FingerId::ALL {
            if !active[finger.index()] {
                target.velocity_rad_per_s[finger.joints()].fill(0.0);
                continue;
            }
            for i in finger.joints() {
                let (goal_rad, position_rad) = (self.goal_rad[i], target.position_rad[i]);
                let asked = (goal_rad - position_rad) * per_s;
                let speed = end_beyond(asked, config.speed_max_rad_per_s);
                target.velocity_rad_per_s[i] = speed.unwrap_or(asked);
                target.position_rad[i] = match speed {
                    Some(speed) => position_rad + speed * dt_s,
                    // Exactly there at the end, whatever rounding did on the way.
                    None if arrives => goal_rad,
                    None => position_rad + asked * dt_s,
                };
                if speed.is_some() {
                    self.limited = self.limited.with(JointId::ALL[i]);
                }
                let left_nm = self.goal_nm[i] - target.feed_forward_nm[i];
                target.feed_forward_nm[i] += end_beyond(left_nm, torque_step_nm).unwrap_or(left_nm);
            }
        }
        self.left_s = if self.left_s > dt_s { self.left_s - dt_s } else { 0.0 };
    }

    /// The target of this period.
    #[must_use]
    pub const fn target(&self) -> &Target {
        &self.target
    }

    /// Joints whose target is held back in this period.
    #[must_use]
    pub const fn limited(&self) -> JointSet {
        self.limited
    }
}

#[cfg(test)]
mod tests {
    use protocol::units::{AngleQ, TorqueQ};

    use super::*;

    const CONFIG: Config =
        Config { speed_max_rad_per_s: 3.0, torque_rate_max_nm_per_s: 50.0, blend_half_us: 25_000 };
    const ALL: [bool; FINGER_COUNT] = [true; FINGER_COUNT];
    const DT_S: f32 = 125e-6;

    /// As it comes over the bus.
    fn angle_rad(angle_rad: f32) -> f32 {
        AngleQ::from_rad(angle_rad).expect("a number").to_rad()
    }

    fn setpoint(angle_rad: f32, torque_nm: f32) -> Setpoint {
        Setpoint {
            position: [AngleQ::from_rad(angle_rad).expect("a number"); JOINT_COUNT],
            feed_forward: [TorqueQ::from_nm(torque_nm).expect("a number"); JOINT_COUNT],
            ..Setpoint::default()
        }
    }

    fn step(follower: &mut Follower, active: [bool; FINGER_COUNT]) -> Target {
        follower.step(&CONFIG, active, DT_S);
        *follower.target()
    }

    #[test]
    fn a_set_point_is_reached_evenly_in_its_time() {
        let mut follower = Follower::new([0.5; JOINT_COUNT]);
        let goal_rad = angle_rad(0.502);
        follower.head_for(&setpoint(0.502, 0.0), 1e-3);
        for period in 1..=8 {
            let target = step(&mut follower, ALL);
            let way_rad = goal_rad - 0.5;
            assert!((target.velocity_rad_per_s[3] - way_rad / 1e-3).abs() < 1e-2, "{target:?}");
            assert!((target.position_rad[3] - (0.5 + way_rad * period as f32 / 8.0)).abs() < 1e-6);
            assert_eq!(follower.limited(), JointSet::default());
        }
        let there = step(&mut follower, ALL);
        assert_eq!((there.position_rad[3], there.velocity_rad_per_s[3]), (goal_rad, 0.0));
    }

    #[test]
    fn no_command_makes_a_step() {
        let mut follower = Follower::new([0.5; JOINT_COUNT]);
        follower.head_for(&setpoint(2.0, -4.0), DT_S);
        let mut before = step(&mut follower, ALL);
        assert!(follower.limited().contains(JointId::ALL[4]));
        for _ in 0..8000 {
            let now = step(&mut follower, ALL);
            for i in 0..JOINT_COUNT {
                assert!((now.position_rad[i] - before.position_rad[i]).abs() <= 3.0 * DT_S * 1.001);
                assert!((now.feed_forward_nm[i] - before.feed_forward_nm[i]).abs() <= 50.0 * DT_S * 1.001);
            }
            before = now;
        }
        assert_eq!((before.position_rad[4], before.feed_forward_nm[4]), (angle_rad(2.0), -4.0));
    }

    #[test]
    fn a_finger_begins_where_it_is_and_waits_until_it_is_active() {
        let mut follower = Follower::new([0.5; JOINT_COUNT]);
        follower.head_for(&setpoint(0.6, 0.125), 0.0);
        let active = [true, false, true, true];
        for _ in 0..1000 {
            let _ = step(&mut follower, active);
        }
        follower.restart(FingerId::Index, &[0.55; JOINT_COUNT]);
        let target = step(&mut follower, active);
        assert_eq!((target.position_rad[5], target.feed_forward_nm[5]), (0.55, 0.0));
        assert_eq!((target.position_rad[8], target.feed_forward_nm[8]), (angle_rad(0.6), 0.125));
        follower.stay();
        let target = step(&mut follower, ALL);
        assert_eq!((target.position_rad[5], target.velocity_rad_per_s[5]), (0.55, 0.0));
        assert_eq!(target.feed_forward_nm[8], 0.125);
    }
}
