//! Commands for the four finger boards from what the controller wants, and its sensors from their replies.

use protocol::ids::{FINGER_COUNT, FingerId, JOINT_COUNT, JOINTS_PER_FINGER, JointId};
use protocol::units::{AngleQ, TorqueQ};

use super::frame::{Command, LEN, Reply};
use crate::app::Output;
use crate::control::Sensors;

/// Exchanges in a row that a finger may miss before its readings are given up: half a millisecond at 8 kHz.
pub const MISSED_MAX: u8 = 4;

/// How a finger board answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counters {
    /// Replies that were damaged or of another version, or did not come.
    pub broken: u32,
    /// Replies of a board that has not taken the last [`MISSED_MAX`] commands.
    pub deaf: u32,
    /// Replies of a board that says that it has failed.
    pub failed: u32,
}

/// The hand's end of the bus to the fingers.
///
/// A reply is believed if its CRC fits, its board has taken a command lately and has not failed. For a few exchanges the
/// last believed readings stand in for one that is not; then the finger's readings are no numbers, which the supervision
/// takes for what it is: a fault of that finger, whose drives are switched off.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FingerBus {
    /// Count of the last command.
    count: u8,
    /// Exchanges in a row that each finger missed; [`MISSED_MAX`] before its first reply.
    missed: [u8; FINGER_COUNT],
    counters: [Counters; FINGER_COUNT],
    sensors: Sensors,
}

impl Default for FingerBus {
    fn default() -> Self {
        Self {
            count: 0,
            missed: [MISSED_MAX; FINGER_COUNT],
            counters: [Counters::default(); FINGER_COUNT],
            sensors: Sensors {
                position_rad: [f32::NAN; JOINT_COUNT],
                joint_torque_nm: [f32::NAN; JOINT_COUNT],
                tip_wrench: [[f32::NAN; 6]; FINGER_COUNT],
            },
        }
    }
}

impl FingerBus {
    /// Commands of the next exchange. Without an output, that is before the first period, no drive gives torque.
    pub fn command(&mut self, output: Option<&Output>, frames: &mut [[u8; LEN]; FINGER_COUNT]) {
        self.count = self.count.wrapping_add(1);
        for (finger, frame) in FingerId::ALL.into_iter().zip(frames) {
            let mut command = Command { count: self.count, ..Command::default() };
            if let Some(output) = output.filter(|output| output.enabled[finger.index()]) {
                command.enable = true;
                let first = first_joint(finger);
                // The controller lets only numbers through.
                command.torque = core::array::from_fn(|k| {
                    TorqueQ::from_nm(output.torque_nm[first + k]).unwrap_or_default()
                });
                if finger == FingerId::Thumb {
                    command.rotation = output.thumb_rotation_rad.and_then(AngleQ::from_rad);
                }
            }
            command.encode(frame);
        }
    }

    /// What the fingers replied in the exchange of the last [`Self::command`].
    pub fn take(&mut self, replies: &[[u8; LEN]; FINGER_COUNT]) {
        for (finger, bytes) in FingerId::ALL.into_iter().zip(replies) {
            let i = finger.index();
            match self.judge(i, bytes) {
                Some(reply) => {
                    self.missed[i] = 0;
                    self.believe(finger, &reply);
                }
                None => {
                    self.missed[i] = self.missed[i].saturating_add(1);
                    if self.missed[i] >= MISSED_MAX {
                        self.give_up(finger);
                    }
                }
            }
        }
    }

    /// The sensors to control by.
    #[must_use]
    pub const fn sensors(&self) -> &Sensors {
        &self.sensors
    }

    /// The reply, if it is to be believed.
    fn judge(&mut self, finger: usize, bytes: &[u8; LEN]) -> Option<Reply> {
        let counters = &mut self.counters[finger];
        let Ok(reply) = Reply::decode(bytes) else {
            counters.broken = counters.broken.saturating_add(1);
            return None;
        };
        // It was made before this exchange's command came. A board whose reply stands still falls behind.
        let behind = self.count.wrapping_sub(1).wrapping_sub(reply.echo);
        if behind >= MISSED_MAX {
            counters.deaf = counters.deaf.saturating_add(1);
            return None;
        }
        if reply.failed {
            counters.failed = counters.failed.saturating_add(1);
            return None;
        }
        Some(reply)
    }

    fn believe(&mut self, finger: FingerId, reply: &Reply) {
        let first = first_joint(finger);
        for k in 0..JOINTS_PER_FINGER {
            self.sensors.position_rad[first + k] = reply.angle[k].to_rad();
            self.sensors.joint_torque_nm[first + k] = reply.torque[k].to_nm();
        }
        if finger == FingerId::Thumb {
            self.sensors.position_rad[JointId::THUMB_ROTATION.index()] = reply.rotation.to_rad();
            // Its brake has no strain gauge.
            self.sensors.joint_torque_nm[JointId::THUMB_ROTATION.index()] = 0.0;
        }
        let wrench = &mut self.sensors.tip_wrench[finger.index()];
        for k in 0..3 {
            (wrench[k], wrench[3 + k]) = (reply.force[k].to_n(), reply.moment[k].to_nm());
        }
    }

    fn give_up(&mut self, finger: FingerId) {
        for i in finger.joints() {
            (self.sensors.position_rad[i], self.sensors.joint_torque_nm[i]) = (f32::NAN, f32::NAN);
        }
        self.sensors.tip_wrench[finger.index()] = [f32::NAN; 6];
    }

    /// Fingers whose readings are believed now, or stand in for a few missed ones.
    #[must_use]
    pub fn present(&self) -> [bool; FINGER_COUNT] {
        self.missed.map(|missed| missed < MISSED_MAX)
    }

    /// How the boards have answered.
    #[must_use]
    pub const fn counters(&self) -> &[Counters; FINGER_COUNT] {
        &self.counters
    }
}

/// Index of a finger's abduction in arrays of joints.
fn first_joint(finger: FingerId) -> usize {
    1 + finger.index() * JOINTS_PER_FINGER
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use protocol::units::{ForceQ, TipTorqueQ};

    /// Four boards that do what boards have to do.
    #[derive(Default)]
    struct Boards {
        taken: [Command; FINGER_COUNT],
        mute: [bool; FINGER_COUNT],
        deaf: [bool; FINGER_COUNT],
        failed: [bool; FINGER_COUNT],
        angle: i16,
    }

    impl Boards {
        fn exchange(&mut self, commands: &[[u8; LEN]; FINGER_COUNT]) -> [[u8; LEN]; FINGER_COUNT] {
            core::array::from_fn(|i| {
                let mut bytes = [0; LEN];
                let base = 100 * i as i16 + self.angle;
                Reply {
                    echo: self.taken[i].count,
                    enabled: self.taken[i].enable,
                    failed: self.failed[i],
                    angle: [base, base + 1, base + 2].map(AngleQ),
                    rotation: AngleQ(77),
                    torque: [base + 3, base + 4, base + 5].map(TorqueQ),
                    force: [base + 6, base + 7, base + 8].map(ForceQ),
                    moment: [base + 9, base + 10, base + 11].map(TipTorqueQ),
                }
                .encode(&mut bytes);
                if !self.deaf[i] {
                    self.taken[i] = Command::decode(&commands[i]).expect("a command");
                }
                if self.mute[i] { [0xff; LEN] } else { bytes }
            })
        }
    }

    fn exchange<'a>(bus: &'a mut FingerBus, boards: &mut Boards, output: Option<&Output>) -> &'a Sensors {
        let mut commands = [[0; LEN]; FINGER_COUNT];
        bus.command(output, &mut commands);
        let replies = boards.exchange(&commands);
        bus.take(&replies);
        bus.sensors()
    }

    fn connected() -> (FingerBus, Boards) {
        let (mut bus, mut boards) = (FingerBus::default(), Boards::default());
        for _ in 0..3 {
            let _ = exchange(&mut bus, &mut boards, None);
        }
        assert_eq!(bus.present(), [true; FINGER_COUNT]);
        (bus, boards)
    }

    const OUTPUT: Output = Output {
        torque_nm: [0.5; JOINT_COUNT],
        enabled: [true, false, true, true],
        thumb_rotation_rad: Some(0.25),
        feed_watchdog: true,
    };

    #[test]
    fn readings_come_to_their_joints() {
        let (mut bus, mut boards) = connected();
        let sensors = exchange(&mut bus, &mut boards, None);
        for finger in FingerId::ALL {
            let base = 100 * finger.index() as i16;
            for k in 0..3 {
                let (at, q) = (1 + 3 * finger.index() + k, k as i16);
                assert_eq!(sensors.position_rad[at], AngleQ(base + q).to_rad());
                assert_eq!(sensors.joint_torque_nm[at], TorqueQ(base + 3 + q).to_nm());
                assert_eq!(sensors.tip_wrench[finger.index()][k], ForceQ(base + 6 + q).to_n());
                assert_eq!(sensors.tip_wrench[finger.index()][3 + k], TipTorqueQ(base + 9 + q).to_nm());
            }
        }
        assert_eq!(sensors.position_rad[0], AngleQ(77).to_rad());
        assert_eq!(sensors.joint_torque_nm[0], 0.0);
    }

    #[test]
    fn before_an_output_and_on_a_finger_that_is_off_no_drive_gives_torque() {
        let (mut bus, mut boards) = connected();
        assert!(boards.taken.iter().all(|command| !command.enable && command.rotation.is_none()));
        let _ = exchange(&mut bus, &mut boards, Some(&OUTPUT));
        assert_eq!(boards.taken.map(|command| command.enable), OUTPUT.enabled);
        assert_eq!(boards.taken[1].torque, [TorqueQ(0); 3]);
        assert_eq!(boards.taken[2].torque, [TorqueQ(4096); 3]);
        assert_eq!(boards.taken[0].rotation, AngleQ::from_rad(0.25));
        assert!(boards.taken[1..].iter().all(|command| command.rotation.is_none()));
    }

    #[test]
    fn a_few_missed_replies_are_bridged_and_more_are_no_numbers() {
        let (mut bus, mut boards) = connected();
        boards.mute[2] = true;
        for missed in 1..=2 * MISSED_MAX {
            boards.angle += 1;
            let sensors = exchange(&mut bus, &mut boards, None);
            let there = missed < MISSED_MAX;
            assert_eq!(sensors.position_rad[7].is_nan(), !there, "{missed}");
            assert_eq!(sensors.tip_wrench[2][5].is_nan(), !there);
            assert_eq!(sensors.position_rad[10], AngleQ(300 + boards.angle).to_rad(), "others go on");
            assert_eq!(bus.present(), [true, true, there, true]);
        }
        boards.mute[2] = false;
        let sensors = exchange(&mut bus, &mut boards, None);
        assert_eq!(sensors.position_rad[7], AngleQ(200 + boards.angle).to_rad());
        assert_eq!(bus.counters()[2], Counters { broken: 8, deaf: 0, failed: 0 });
        assert_eq!(bus.counters()[1], Counters::default());
    }

    #[test]
    fn a_board_that_takes_no_commands_or_stands_still_is_given_up() {
        let (mut bus, mut boards) = connected();
        boards.deaf[3] = true;
        let lost = (0..20).position(|_| {
            let _ = exchange(&mut bus, &mut boards, None);
            bus.present() == [true, true, true, false]
        });
        // Its echo falls behind for as many exchanges as may be missed, then that many are missed.
        assert_eq!(lost, Some(usize::from(2 * MISSED_MAX) - 1));
        assert!(bus.counters()[3].deaf >= u32::from(MISSED_MAX));
    }

    #[test]
    fn a_board_that_has_failed_is_given_up() {
        let (mut bus, mut boards) = connected();
        boards.failed[0] = true;
        for _ in 0..MISSED_MAX {
            let _ = exchange(&mut bus, &mut boards, None);
        }
        let sensors = exchange(&mut bus, &mut boards, None);
        assert!(sensors.position_rad[..4].iter().all(|angle_rad| angle_rad.is_nan()));
        assert!(sensors.position_rad[4..].iter().all(|angle_rad| angle_rad.is_finite()));
        assert_eq!(bus.counters()[0].failed, u32::from(MISSED_MAX) + 1);
    }

    proptest! {
        #[test]
        fn whatever_comes_a_finger_is_all_numbers_or_none(replies in any::<[[u8; LEN]; FINGER_COUNT]>(), times in 1..9) {
            let (mut bus, _) = connected();
            for _ in 0..times {
                bus.take(&replies);
                let sensors = bus.sensors();
                for finger in FingerId::ALL {
                    let numbers = finger.joints().flat_map(|i| [sensors.position_rad[i], sensors.joint_torque_nm[i]]);
                    let numbers = numbers.chain(sensors.tip_wrench[finger.index()]);
                    let is = bus.present()[finger.index()];
                    prop_assert!(numbers.into_iter().all(|number| number.is_finite() == is));
                }
            }
        }
    }
}
