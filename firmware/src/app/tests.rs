//! Whatever comes over the bus and from the sensors.

use std::vec;
use std::vec::Vec;

use proptest::prelude::*;
use protocol::command::{ControlWord, Setpoint};
use protocol::frame::{Deframer, FRAME_MAX, Framer, MESSAGE_MAX};
use protocol::ids::FingerJoint;
use protocol::service::{Call, Request};
use protocol::units::AngleQ;

use super::*;

const PERIOD_US: u32 = 125;

fn controller() -> Controller {
    Controller::new(Identity { board: "test", period_us: PERIOD_US, has_storage: true })
}

fn sensors(position_rad: f32) -> Sensors {
    Sensors {
        position_rad: [position_rad; JOINT_COUNT],
        joint_torque_nm: [0.0; JOINT_COUNT],
        tip_wrench: [[0.0; 6]; FINGER_COUNT],
    }
}

fn framed(framer: &mut Framer, message: &[u8]) -> Vec<u8> {
    framer.frame(message, &mut [0; FRAME_MAX]).expect("a message of legal length").to_vec()
}

fn setpoint(seq: u16, word: ControlWord) -> Vec<u8> {
    let mut bytes = vec![0; Setpoint::LEN];
    let whole: &mut [u8; Setpoint::LEN] = bytes.as_mut_slice().try_into().expect("its length");
    Setpoint { seq, control: word.with_fingers(protocol::telemetry::FingerSet::ALL), ..Setpoint::default() }
        .encode(whole);
    bytes
}

fn assert_sane(output: &Output) {
    for joint in JointId::ALL {
        let torque_nm = output.torque_nm[joint.index()];
        let finger = joint.finger_joint().map_or(FingerId::Thumb, |(finger, _)| finger);
        assert!(torque_nm.is_finite() && torque_nm.abs() <= 2.0, "{output:?}");
        assert!(output.enabled[finger.index()] || torque_nm == 0.0, "{output:?}");
    }
}

#[test]
fn the_watchdog_is_fed_while_the_bus_is_looked_at_and_then_no_more() {
    let mut hand = controller();
    for period in 1..100 {
        hand.receive(&[]);
        assert!(hand.tick(period * PERIOD_US, &sensors(0.1)).feed_watchdog);
    }
    for period in 100..200 {
        assert!(!hand.tick(period * PERIOD_US, &sensors(0.1)).feed_watchdog);
    }
}

#[test]
fn time_may_wrap() {
    let mut hand = controller();
    let mut now_us = u32::MAX - 10 * PERIOD_US;
    let mut framer = Framer::default();
    let words = [ControlWord::DISABLE_VOLTAGE, ControlWord::SHUTDOWN, ControlWord::SWITCH_ON];
    let words = words.into_iter().chain(core::iter::repeat_n(ControlWord::ENABLE_OPERATION, 50));
    for (seq, word) in (0..).zip(words) {
        hand.receive(&framed(&mut framer, &setpoint(seq, word)));
        let output = hand.tick(now_us, &sensors(0.1));
        now_us = now_us.wrapping_add(PERIOD_US);
        assert_eq!(output.enabled, [word == ControlWord::ENABLE_OPERATION; FINGER_COUNT], "{seq}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Bytes that are no frames, frames that are no messages, and messages with any content.
    #[test]
    fn no_bytes_and_no_readings_make_a_torque_that_may_not_be(
        periods in proptest::collection::vec(
            (0_u8..6, proptest::collection::vec(any::<u8>(), 1..246), any::<u32>(), -1.0_f32..1.0, 0_u8..40),
            1..200,
        ),
        enabled in any::<bool>(),
    ) {
        let mut hand = controller();
        let mut framer = Framer::default();
        let mut now_us = 0_u32;
        let mut room = [0; 1024];
        if enabled {
            let words = [0x00, 0x06, 0x07, 0x0f].map(|bits| ControlWord::from_bits(bits).expect("defined bits"));
            for (seq, word) in (0xff00..).zip(words) {
                hand.receive(&framed(&mut framer, &setpoint(seq, word)));
                now_us += PERIOD_US;
                assert_sane(&hand.tick(now_us, &sensors(0.1)));
            }
        }
        for (kind, mut message, odd_us, angle_rad, odd) in periods {
            match kind {
                0 => hand.receive(&message),
                1 => {
                    message.resize(Setpoint::LEN, 0x5a);
                    message[0] = 0x01;
                    // No bits that would have it refused.
                    (message[7], message[8]) = (message[7] & 0x9f, message[8] & 0x1f);
                    hand.receive(&framed(&mut framer, &message));
                }
                2 => {
                    message.splice(..1, [0x02, 1, odd % 11]);
                    message.truncate(200);
                    hand.receive(&framed(&mut framer, &message));
                }
                3 => hand.receive(&framed(&mut framer, &message)),
                _ => hand.receive(&[]),
            }
            now_us = now_us.wrapping_add(if odd == 0 { odd_us } else { PERIOD_US });
            let mut sensors = sensors(angle_rad);
            match odd {
                1 => sensors.position_rad[5] = f32::NAN,
                2 => sensors.joint_torque_nm[8] = f32::INFINITY,
                3 => sensors.tip_wrench[2][4] = f32::NAN,
                4 => sensors.position_rad = [f32::MAX; JOINT_COUNT],
                _ => {}
            }
            assert_sane(&hand.tick(now_us, &sensors));
            hand.serve();
            let len = hand.transmit(&mut room[..usize::from(odd) * 20]);
            prop_assert!(len <= usize::from(odd) * 20);
        }
    }
}

#[test]
fn a_tip_that_slips_is_told_and_the_thumb_presses_harder_until_it_lets_go() {
    let mut hand = controller();
    let mut framer = Framer::default();
    let mut now_us = 0;
    let mut pass = |hand: &mut Controller, word: ControlWord, sensors: &Sensors, seq: u16| {
        let mut bytes = [0; Setpoint::LEN];
        let stiffness = protocol::units::StiffnessQ::from_n_per_m(300.0).expect("a number");
        let thumb = protocol::command::ThumbImpedance { stiffness: [stiffness; 3], ..Default::default() };
        let position = sensors.position_rad.map(|q| AngleQ::from_rad(q).expect("a number"));
        let control = word.with_thumb_impedance().with_fingers(FingerSet::ALL);
        Setpoint { seq, control, position, thumb, ..Setpoint::default() }.encode(&mut bytes);
        hand.receive(&framed(&mut framer, &bytes));
        now_us += PERIOD_US;
        let output = hand.tick(now_us, sensors);
        hand.serve();
        hand.transmit(&mut [0; 1024]);
        output.torque_nm
    };
    let mut bent = sensors(0.5);
    for finger in FingerId::ALL {
        bent.position_rad[JointId::of(finger, FingerJoint::Abduction).index()] = 0.0;
    }
    let words = [0x00, 0x06, 0x07].map(|bits| ControlWord::from_bits(bits).expect("defined bits"));
    let words = words.into_iter().chain(core::iter::repeat(ControlWord::ENABLE_OPERATION));
    let mut seq = 0..;
    let mut last = [0.0; JOINT_COUNT];
    for (word, seq) in words.clone().zip(seq.by_ref()).take(100) {
        last = pass(&mut hand, word, &bent, seq);
    }
    let flexion = JointId::of(FingerId::Thumb, FingerJoint::Flexion).index();
    assert!(last[flexion].abs() < 0.01, "{last:?}");
    // 2 N on the ring finger's pad and 1.6 N across it.
    let mut slipping = bent;
    slipping.tip_wrench[FingerId::Ring.index()] = [1.6, 0.0, -2.0, 0.0, 1.6 * 0.0125, 0.0];
    for seq in seq.by_ref().take(400) {
        last = pass(&mut hand, ControlWord::ENABLE_OPERATION, &slipping, seq);
    }
    assert!(hand.state.status.slipping.contains(FingerId::Ring));
    assert_eq!(hand.state.status.slipping.bits(), 1 << FingerId::Ring.index());
    // Some 2 N at the tip, through the gain of the torque loop.
    assert!((0.1..0.5).contains(&last[flexion]), "{last:?}");
    for seq in seq.by_ref().take(400) {
        last = pass(&mut hand, ControlWord::ENABLE_OPERATION, &bent, seq);
    }
    assert_eq!(hand.state.status.slipping, FingerSet::default());
    assert!(last[flexion] > 0.1, "the grip stays");
    for (word, seq) in words.zip(seq).take(400) {
        last = pass(&mut hand, word, &bent, seq);
    }
    assert!(last[flexion].abs() < 0.01, "{last:?}");
}

/// A hand whose set-points come, and that is asked.
struct Asked {
    hand: Controller,
    framer: Framer,
    heard: Deframer,
    now_us: u32,
    seq: u16,
    targets: Vec<[f32; JOINT_COUNT]>,
}

impl Asked {
    fn new() -> Self {
        let (framer, heard) = (Framer::default(), Deframer::default());
        Self { hand: controller(), framer, heard, now_us: 0, seq: 0, targets: vec![] }
    }

    /// A period with a set-point.
    fn pass(&mut self, word: ControlWord) {
        self.hand.receive(&framed(&mut self.framer, &setpoint(self.seq, word)));
        self.seq = self.seq.wrapping_add(1);
        self.period();
    }

    fn period(&mut self) {
        self.now_us += PERIOD_US;
        // A hand that follows, with noise, as of any sensor.
        let noise = 1e-5 * (self.now_us / PERIOD_US % 7) as f32;
        let mut sensors = sensors(0.1);
        if let Some(target) = self.targets.last() {
            sensors.position_rad = target.map(|target_rad| target_rad + noise);
        }
        sensors.joint_torque_nm = [noise; JOINT_COUNT];
        assert_sane(&self.hand.tick(self.now_us, &sensors));
        self.hand.transmit(&mut [0; 1024]);
        self.targets.push(self.hand.last.excitation.target_rad);
    }

    fn switch_on(&mut self) {
        for word in [ControlWord::DISABLE_VOLTAGE, ControlWord::SHUTDOWN, ControlWord::SWITCH_ON, SEGMENTS] {
            self.pass(word);
        }
    }

    /// The refusal, if it is one.
    fn ask(&mut self, number: u16, replaces: bool, time_us: u32, angle_rad: f32) -> Option<Refusal> {
        let position = [AngleQ::from_rad(angle_rad).expect("a number").0; JOINT_COUNT];
        let request = Request { id: 1, call: Call::Segment { number, replaces, time_us, position } };
        let mut buffer = [0; MESSAGE_MAX];
        let message = request.encode(&mut buffer).expect("it fits");
        self.hand.receive(&framed(&mut self.framer, message));
        self.hand.serve();
        let mut room = [0; 1024];
        let len = self.hand.transmit(&mut room);
        let mut bytes = &room[..len];
        let mut answer = None;
        while let Some(frame) = self.heard.receive(&mut bytes) {
            if let Ok(reply) = Reply::decode(frame.message) {
                answer = match reply.answer {
                    Answer::Done => Some(None),
                    Answer::Refused(code) => Some(Refusal::from_number(code.0)),
                    other => panic!("{other:?}"),
                };
            }
        }
        answer.expect("an answer")
    }
}

const SEGMENTS: ControlWord = ControlWord::ENABLE_OPERATION.with_segments();

#[test]
fn segments_are_followed_without_a_step_whenever_they_come() {
    let mut asked = Asked::new();
    assert_eq!(asked.ask(1, true, 200_000, 0.2), Some(Refusal::NoSegmentsNow), "no torque");
    asked.switch_on();
    assert_eq!(asked.ask(1, false, 200_000, 0.2), Some(Refusal::SegmentMissing), "nothing to follow");
    assert_eq!(asked.ask(1, true, 200_000, 0.2), None);
    for _ in 0..800 {
        asked.pass(SEGMENTS);
    }
    assert_eq!(asked.ask(1, true, 200_000, 0.2), None, "the same once more");
    assert_eq!(asked.ask(2, false, 100_000, 0.15), None);
    assert_eq!(asked.ask(4, false, 100_000, 0.15), Some(Refusal::SegmentMissing));
    assert_eq!(asked.ask(3, false, 10_000, 0.15), Some(Refusal::SegmentTime), "shorter than a blend");
    assert_eq!(asked.ask(3, false, 50_000, 0.32), Some(Refusal::SegmentTime), "3.4 rad/s");
    assert_eq!(asked.ask(3, false, 900_000, -1.5), Some(Refusal::OutOfRange));
    // While the last blend comes to rest.
    for _ in 0..1650 {
        asked.pass(SEGMENTS);
    }
    assert_eq!(asked.ask(3, false, 100_000, 0.05), None);
    for _ in 0..300 {
        asked.pass(SEGMENTS);
    }
    assert_eq!(asked.ask(9, true, 200_000, 0.1), None, "in the midst of a blend");
    for _ in 0..2200 {
        asked.pass(SEGMENTS);
    }
    let first = asked.targets.iter().position(|target| target[5] != asked.targets[0][5]).expect("it moves");
    let moving = &asked.targets[first.saturating_sub(1)..];
    let at = |i: usize, joint: usize| f64::from(moving[i][joint]);
    for joint in 0..JOINT_COUNT {
        for i in 1..moving.len() - 1 {
            let speed = (at(i, joint) - at(i - 1, joint)) / 125e-6;
            // 0.1 rad in 0.1 s, and what an acceleration carries beyond; noise of the angle where torque came on.
            assert!(speed.abs() < 1.5, "{i} {joint}: {speed}");
        }
    }
    let goal_rad = AngleQ::from_rad(0.1).expect("a number").to_rad();
    assert_eq!(moving.last(), Some(&[goal_rad; JOINT_COUNT]));
    let farthest = moving.iter().map(|target| target[5]).fold(0.0, f32::max);
    assert!((0.19..=0.2001).contains(&farthest), "the first one is reached: {farthest}");
}

#[test]
fn segments_end_with_a_hold_and_a_new_one_must_replace() {
    let mut asked = Asked::new();
    asked.switch_on();
    assert_eq!(asked.ask(1, true, 500_000, 0.3), None);
    for number in 2..10 {
        assert_eq!(asked.ask(number, false, 100_000, 0.3), None);
    }
    assert_eq!(asked.ask(10, false, 100_000, 0.3), Some(Refusal::SegmentsFull));
    for _ in 0..1000 {
        asked.pass(SEGMENTS);
    }
    for _ in 0..100 {
        asked.period();
    }
    assert_eq!(asked.hand.supervisor.tier(), BusTier::Hold);
    assert_eq!(asked.ask(10, false, 100_000, 0.3), Some(Refusal::NoSegmentsNow));
    asked.pass(SEGMENTS);
    let held = asked.targets[asked.targets.len() - 1];
    for _ in 0..100 {
        asked.pass(SEGMENTS);
    }
    assert_eq!(asked.targets.last(), Some(&held), "nothing is left of the old ones");
    assert_eq!(asked.ask(10, false, 100_000, 0.3), Some(Refusal::SegmentMissing));
    assert_eq!(asked.ask(10, true, 500_000, 0.3), None);
    // Without the bit the set-point's angles count, evenly and no faster than a joint may.
    for _ in 0..1000 {
        asked.pass(SEGMENTS);
    }
    let before = asked.targets[asked.targets.len() - 1];
    for _ in 0..8000 {
        asked.pass(ControlWord::ENABLE_OPERATION);
    }
    assert!(before[5] > 0.12, "{before:?}");
    assert_eq!(asked.targets.last(), Some(&[0.0; JOINT_COUNT]));
    asked.pass(SEGMENTS);
    assert_eq!(asked.ask(11, false, 500_000, 0.3), Some(Refusal::SegmentMissing), "they begin anew");
}
