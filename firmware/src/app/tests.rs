//! Whatever comes over the bus and from the sensors.

use std::vec;
use std::vec::Vec;

use proptest::prelude::*;
use protocol::command::{ControlWord, Setpoint};
use protocol::frame::{FRAME_MAX, Framer};
use protocol::ids::FingerJoint;

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
                    (message[7], message[8]) = (message[7] & 0x9f, message[8] & 0x0f);
                    hand.receive(&framed(&mut framer, &message));
                }
                2 => {
                    message.splice(..1, [0x02, 1, odd % 9]);
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
