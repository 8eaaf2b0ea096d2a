//! Both messages against golden bytes, and against every change of one byte.
//!
//! `BLESS=1 cargo test -p protocol golden` writes the files in `golden/` anew. A change there is a change of the wire.

use std::format;
use std::path::Path;
use std::string::String;
use std::vec::Vec;

use crate::command::{ControlWord, Setpoint, ThumbImpedance};
use crate::fault::{Code, Fault, LimitSet};
use crate::ids::{FINGER_COUNT, FingerId, JOINT_COUNT, JointId};
use crate::telemetry::{BusTier, DriveState, FingerSet, HandState, JointSet, Status, TipWrench};
use crate::units::{AngleQ, DampingQ, ForceQ, StiffnessQ, TipTorqueQ, TorqueQ, VelocityQ};

/// Sixteen bytes to a line.
fn hex(bytes: &[u8]) -> String {
    let line = |line: &[u8]| line.iter().map(|b| format!("{b:02x}")).collect::<Vec<_>>().join(" ") + "\n";
    bytes.chunks(16).map(line).collect()
}

pub(crate) fn assert_golden(name: &str, bytes: &[u8]) {
    assert_golden_text(name, &hex(bytes));
}

pub(crate) fn assert_golden_text(name: &str, text: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/golden").join(name);
    if std::env::var_os("BLESS").is_some() {
        std::fs::write(&path, text).expect("the golden file can be written");
    }
    let golden = std::fs::read_to_string(&path).expect("the golden file is there");
    assert_eq!(text, golden, "{name}");
}

/// Every field has a value of its own, so that no two can change places.
pub(crate) fn setpoint() -> Setpoint {
    Setpoint {
        seq: 0x0201,
        t_us: 0x0605_0403,
        control: ControlWord::ENABLE_OPERATION.with_fingers(FingerSet::default().with(FingerId::Index)),
        position: core::array::from_fn(|i| AngleQ(0x1000 + i as i16)),
        feed_forward: core::array::from_fn(|i| TorqueQ(-0x2000 - i as i16)),
        thumb: ThumbImpedance {
            stiffness: core::array::from_fn(|i| StiffnessQ(0xa000 + i as u16)),
            damping: core::array::from_fn(|i| DampingQ(0xb000 + i as u16)),
        },
    }
}

fn hand_state() -> HandState {
    HandState {
        seq: 0x0201,
        t_us: 0x0605_0403,
        echoed_seq: 0x0807,
        command_age_us: 0x0e0d,
        status: Status {
            drive: DriveState::OperationEnabled,
            fingers: [1, 2, 3, 4].map(|i| DriveState::ALL[i]),
            bus: BusTier::Hold,
            fault: Code::from(Fault::SenderStuck),
            slipping: FingerSet::default().with(FingerId::Thumb).with(FingerId::Ring),
            limited: JointSet::default().with(JointId::THUMB_ROTATION).with(JointId::ALL[JOINT_COUNT - 1]),
            limits: LimitSet(0x0c0b_0a09),
        },
        refused: 0x100f,
        position: core::array::from_fn(|i| AngleQ(0x1000 + i as i16)),
        velocity: core::array::from_fn(|i| VelocityQ(-0x2000 - i as i16)),
        torque: core::array::from_fn(|i| TorqueQ(0x3000 + i as i16)),
        tip_wrench: core::array::from_fn(|f| TipWrench {
            force: core::array::from_fn(|i| ForceQ(-0x4000 - 0x100 * f as i16 - i as i16)),
            torque: core::array::from_fn(|i| TipTorqueQ(0x5000 + 0x100 * f as i16 + i as i16)),
        }),
    }
}

pub(crate) fn encoded_setpoint(setpoint: &Setpoint) -> [u8; Setpoint::LEN] {
    let mut bytes = [0xee; Setpoint::LEN];
    setpoint.encode(&mut bytes);
    bytes
}

fn encoded_state(state: &HandState) -> [u8; HandState::LEN] {
    let mut bytes = [0xee; HandState::LEN];
    state.encode(&mut bytes);
    bytes
}

#[test]
fn golden_setpoint() {
    assert_golden("setpoint.hex", &encoded_setpoint(&setpoint()));
}

#[test]
fn golden_hand_state() {
    assert_golden("hand_state.hex", &encoded_state(&hand_state()));
}

#[test]
fn messages_survive_the_round_trip() {
    assert_eq!(Setpoint::decode(&encoded_setpoint(&setpoint())), Ok(setpoint()));
    assert_eq!(HandState::decode(&encoded_state(&hand_state())), Ok(hand_state()));
}

#[test]
fn every_byte_counts() {
    // Whatever one byte becomes, decoding either refuses it or gives a value that encodes to the very same bytes.
    let golden = encoded_setpoint(&setpoint());
    let mut refused = [0; Setpoint::LEN];
    for at in 0..Setpoint::LEN {
        for value in 0..=u8::MAX {
            let mut bytes = golden;
            bytes[at] = value;
            match Setpoint::decode(&bytes) {
                Ok(decoded) => assert_eq!(encoded_setpoint(&decoded), bytes, "byte {at}"),
                Err(_) => refused[at] += 1,
            }
        }
    }
    // Kind: one is right. Control word: 6 bits have a meaning in the low byte and 5 in the high one.
    let mut expected = [0; Setpoint::LEN];
    (expected[0], expected[7], expected[8]) = (255, 192, 224);
    assert_eq!(refused, expected);
    let golden = encoded_state(&hand_state());
    let mut refused = [0; HandState::LEN];
    for at in 0..HandState::LEN {
        for value in 0..=u8::MAX {
            let mut bytes = golden;
            bytes[at] = value;
            match HandState::decode(&bytes) {
                Ok(decoded) => assert_eq!(encoded_state(&decoded), bytes, "byte {at}"),
                Err(_) => refused[at] += 1,
            }
        }
    }
    // Kind: one is right. Drives: 8 states. Tiers: 4. Fingers: 4 bits. Joints: 8 bits in the low byte, 5 in the high one.
    let mut expected = [0; HandState::LEN];
    expected[0] = 255;
    expected[11..16].fill(248);
    (expected[16], expected[18], expected[20]) = (252, 240, 224);
    assert_eq!(refused, expected);
}

#[test]
fn errors_name_what_they_found() {
    let mut bytes = encoded_state(&hand_state());
    bytes[11] = 8;
    let error = HandState::decode(&bytes).expect_err("there are eight states");
    assert_eq!(format!("{error}"), "drive state 8 is not defined");
    bytes[0] = 0x01;
    let error = HandState::decode(&bytes).expect_err("a set-point is no state");
    assert_eq!(format!("{error}"), "message kind 0x01 where 0x81 was expected");
}

#[test]
fn sets_hold_what_is_put_into_them() {
    for i in 0..FINGER_COUNT {
        let set = FingerSet::default().with(FingerId::ALL[i]);
        assert!(FingerId::ALL.into_iter().all(|finger| set.contains(finger) == (finger.index() == i)));
    }
    for i in 0..JOINT_COUNT {
        let set = JointSet::default().with(JointId::ALL[i]);
        assert!(JointId::ALL.into_iter().all(|joint| set.contains(joint) == (joint.index() == i)));
    }
}

#[test]
fn a_control_word_is_its_parts() {
    let fingers = FingerSet::default().with(FingerId::Thumb).with(FingerId::Middle);
    let word = ControlWord::ENABLE_OPERATION.with_fingers(fingers).with_thumb_impedance();
    assert_eq!(word.bits(), 0x051f);
    assert_eq!((word.fingers(), word.thumb_impedance()), (fingers, true));
    assert_eq!(word.with_fingers(FingerSet::ALL).fingers(), FingerSet::ALL);
    assert!(!ControlWord::FAULT_RESET.thumb_impedance());
    assert_eq!(word.with_segments().bits(), 0x151f);
    assert!(word.with_segments().segments() && !word.segments());
}
