//! From set-points, which come once a bus cycle, to a target for every control period, without a step in it.
//!
//! Between two set-points the target moves evenly, over the time that lay between them, and never faster than a joint
//! may. So it needs no speed on the wire; it comes one bus cycle late; and whatever is commanded, even at the moment when
//! torque comes on, starts from where the joints are.

use protocol::ids::{FINGER_COUNT, FingerId, JOINT_COUNT, JointId};
use protocol::telemetry::JointSet;

use crate::control::{Target, ThumbMode};

/// How fast a target may change.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Config {
    /// Largest joint speed.
    pub speed_max_rad_per_s: f32,
    /// Largest change of a feed-forward torque.
    pub torque_rate_max_nm_per_s: f32,
}

/// A target on its way to the last set-point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Follower {
    position_rad: [f32; JOINT_COUNT],
    feed_forward_nm: [f32; JOINT_COUNT],
    goal_rad: [f32; JOINT_COUNT],
    goal_nm: [f32; JOINT_COUNT],
    /// Time left to get there.
    left_s: f32,
}

/// The target of one period.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Followed {
    /// Angles, speeds and torques for the control laws.
    pub target: Target,
    /// Joints whose target is held back.
    pub limited: JointSet,
}

/// `x` within `+-most`. Unlike `clamp` it cannot panic, whatever `most` is; and `min` and `max`, which think of NaN, are
/// calls of twenty instructions each.
fn within(x: f32, most: f32) -> f32 {
    if x > most {
        most
    } else if x < -most {
        -most
    } else {
        x
    }
}

impl Follower {
    /// At rest at these angles.
    #[must_use]
    pub fn new(position_rad: [f32; JOINT_COUNT]) -> Self {
        let zero = [0.0; JOINT_COUNT];
        Self { position_rad, feed_forward_nm: zero, goal_rad: position_rad, goal_nm: zero, left_s: 0.0 }
    }

    /// Begins anew where the joints of a finger are, without torque.
    pub fn restart(&mut self, finger: FingerId, measured_rad: &[f32; JOINT_COUNT]) {
        for joint in JointId::ALL {
            if joint.moves() == finger {
                let i = joint.index();
                self.position_rad[i] = measured_rad[i];
                self.feed_forward_nm[i] = 0.0;
            }
        }
    }

    /// A new set-point, to be reached in `within_s`.
    pub fn head_for(&mut self, goal_rad: [f32; JOINT_COUNT], goal_nm: [f32; JOINT_COUNT], within_s: f32) {
        (self.goal_rad, self.goal_nm, self.left_s) = (goal_rad, goal_nm, within_s);
    }

    /// Stay here: no set-point is to be reached any more. Torques stay, for they may carry what is held.
    pub fn stay(&mut self) {
        (self.goal_rad, self.goal_nm) = (self.position_rad, self.feed_forward_nm);
    }

    /// The target `dt_s` later; `dt_s` is more than 0. Fingers not `active` do not move.
    pub fn step(
        &mut self,
        config: &Config,
        active: [bool; FINGER_COUNT],
        thumb_mode: ThumbMode,
        dt_s: f32,
    ) -> Followed {
        let mut limited = JointSet::default();
        let mut velocity_rad_per_s = [0.0; JOINT_COUNT];
        let time_s = self.left_s.max(dt_s);
        let torque_step_nm = config.torque_rate_max_nm_per_s * dt_s;
        for joint in JointId::ALL {
            if !active[joint.moves().index()] {
                continue;
            }
            let i = joint.index();
            let asked = (self.goal_rad[i] - self.position_rad[i]) / time_s;
            let speed = within(asked, config.speed_max_rad_per_s);
            if speed != asked {
                limited = limited.with(joint);
            }
            velocity_rad_per_s[i] = speed;
            // Exactly there at the end, whatever rounding did on the way.
            let arrives = time_s <= dt_s && speed == asked;
            self.position_rad[i] =
                if arrives { self.goal_rad[i] } else { self.position_rad[i] + speed * dt_s };
            self.feed_forward_nm[i] += within(self.goal_nm[i] - self.feed_forward_nm[i], torque_step_nm);
        }
        self.left_s = (self.left_s - dt_s).max(0.0);
        let target = Target {
            position_rad: self.position_rad,
            velocity_rad_per_s,
            feed_forward_nm: self.feed_forward_nm,
            thumb_mode,
        };
        Followed { target, limited }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CONFIG: Config = Config { speed_max_rad_per_s: 3.0, torque_rate_max_nm_per_s: 50.0 };
    const ALL: [bool; FINGER_COUNT] = [true; FINGER_COUNT];
    const DT_S: f32 = 125e-6;

    #[test]
    fn a_set_point_is_reached_evenly_in_its_time() {
        let mut follower = Follower::new([0.5; JOINT_COUNT]);
        follower.head_for([0.502; JOINT_COUNT], [0.0; JOINT_COUNT], 1e-3);
        for period in 1..=8 {
            let target = follower.step(&CONFIG, ALL, ThumbMode::Position, DT_S);
            assert!((target.target.velocity_rad_per_s[3] - 2.0).abs() < 1e-2, "{target:?}");
            assert!((target.target.position_rad[3] - (0.5 + 0.00025 * period as f32)).abs() < 1e-6);
            assert_eq!(target.limited, JointSet::default());
        }
        let there = follower.step(&CONFIG, ALL, ThumbMode::Position, DT_S);
        assert_eq!((there.target.position_rad[3], there.target.velocity_rad_per_s[3]), (0.502, 0.0));
    }

    #[test]
    fn no_command_makes_a_step() {
        let mut follower = Follower::new([0.5; JOINT_COUNT]);
        follower.head_for([2.0; JOINT_COUNT], [-4.0; JOINT_COUNT], DT_S);
        let mut before = follower.step(&CONFIG, ALL, ThumbMode::Position, DT_S);
        assert!(before.limited.contains(JointId::ALL[4]));
        for _ in 0..8000 {
            let now = follower.step(&CONFIG, ALL, ThumbMode::Position, DT_S);
            for i in 0..JOINT_COUNT {
                assert!((now.target.position_rad[i] - before.target.position_rad[i]).abs() <= 3.0 * DT_S * 1.001);
                assert!((now.target.feed_forward_nm[i] - before.target.feed_forward_nm[i]).abs() <= 50.0 * DT_S * 1.001);
            }
            before = now;
        }
        assert_eq!((before.target.position_rad[4], before.target.feed_forward_nm[4]), (2.0, -4.0));
    }

    #[test]
    fn a_finger_begins_where_it_is_and_waits_until_it_is_active() {
        let mut follower = Follower::new([0.5; JOINT_COUNT]);
        follower.head_for([0.6; JOINT_COUNT], [0.1; JOINT_COUNT], 0.0);
        let active = [true, false, true, true];
        for _ in 0..1000 {
            let _ = follower.step(&CONFIG, active, ThumbMode::Position, DT_S);
        }
        follower.restart(FingerId::Index, &[0.55; JOINT_COUNT]);
        let target = follower.step(&CONFIG, active, ThumbMode::Position, DT_S);
        assert_eq!((target.target.position_rad[5], target.target.feed_forward_nm[5]), (0.55, 0.0));
        assert_eq!((target.target.position_rad[8], target.target.feed_forward_nm[8]), (0.6, 0.1));
        follower.stay();
        let target = follower.step(&CONFIG, ALL, ThumbMode::Position, DT_S);
        assert_eq!((target.target.position_rad[5], target.target.velocity_rad_per_s[5]), (0.55, 0.0));
        assert_eq!(target.target.feed_forward_nm[8], 0.1);
    }
}
