use hand_model::{HandAngles, HandModel};
use nalgebra::{Isometry3, Vector3};
use protocol::fault::Fault;

use super::*;
use crate::twin::{Friction, InProcess, TICK_S};

/// A hand in empty space.
fn scene() -> Scene {
    let mut angles = HandAngles::from_array(&[0.3; JOINT_COUNT]);
    for finger in &mut angles.fingers {
        finger.abduction_rad = 0.0;
    }
    Scene {
        hand: HandModel::hit_dlr(),
        base_from_palm: Isometry3::identity(),
        angles,
        object: None,
        table_height_m: None,
        friction: Friction { tip: 0.6, link: 0.3, table: 0.4 },
        gravity: Vector3::zeros(),
    }
}

fn command() -> Command {
    Command {
        position_rad: scene().angles.to_array(),
        velocity_rad_per_s: [0.0; JOINT_COUNT],
        feed_forward_nm: [0.0; JOINT_COUNT],
        thumb: ThumbLaw::Position,
        base_from_palm: Isometry3::identity(),
    }
}

fn start() -> OnBus<InProcess> {
    OnBus::start(&scene(), SensorParameters::hit_dlr(), 1, InProcess::default()).unwrap()
}

#[test]
fn torque_comes_with_the_first_command_and_the_hands_own_reflex_is_off() {
    let mut hand = start();
    assert_eq!(hand.state().status.drive, DriveState::SwitchedOn);
    assert_eq!(hand.plant().state().time_s, 0.0, "the mechanism rests until then");
    let rate = hand.board.controller().unwrap().control_config().slip.rate_n_per_s;
    assert_eq!(rate, 0.0);
    assert_eq!(hand.fault(), None, "that it has no torque yet is no fault");
    let report = hand.step(&command(), TICK_S).unwrap();
    assert_eq!(hand.state().status.fingers, [DriveState::OperationEnabled; 4]);
    assert_eq!(hand.fault(), None);
    assert!((hand.plant().state().time_s - TICK_S).abs() < 1e-12);
    // What is reported are the sensors, to the digits of the wire.
    for (is, should) in report.position_rad.iter().zip(command().position_rad) {
        assert!((is - should).abs() < 0.005, "{report:?}");
    }
}

#[test]
fn joints_go_where_they_are_sent() {
    let mut hand = start();
    let mut goal = command();
    goal.position_rad[5] = 0.4;
    goal.position_rad[0] = 0.35;
    for _ in 0..1000 {
        hand.step(&goal, TICK_S).unwrap();
    }
    let is = hand.plant().state().angle_rad;
    // Friction that is not compensated, 0.05 N m at most, bends the 6 N m/rad of a joint by 8 mrad.
    assert!((is[5] - 0.4).abs() < 0.02, "{is:?}");
    assert!((is[0] - 0.35).abs() < 0.01, "the thumb's rotation: {is:?}");
    assert!((is[6] - 0.3).abs() < 0.02, "{is:?}");
}

#[test]
fn a_finger_whose_sensor_breaks_lets_go_alone() {
    let mut hand = start().failing_at(0.01, Failure::StrainGauge(FingerId::Ring));
    for _ in 0..10 {
        hand.step(&command(), TICK_S).unwrap();
        assert_eq!(hand.fault(), None);
    }
    hand.step(&command(), TICK_S).unwrap();
    let ring = FingerSet::default().with(FingerId::Ring);
    let fault = HandFault { code: Fault::SensorNotANumber.into(), fingers: ring };
    assert_eq!(hand.fault(), Some(fault));
    for _ in 0..100 {
        hand.step(&command(), TICK_S).unwrap();
    }
    assert_eq!(hand.fault(), Some(fault), "it stays until it is reset");
    assert_eq!(hand.state().status.fingers[..3], [DriveState::OperationEnabled; 3]);
    assert_eq!(hand.state().status.fingers[3], DriveState::Fault);
}

#[test]
fn what_cannot_be_sent_is_refused_and_a_dead_board_is_a_lost_link() {
    let mut hand = start().failing_at(0.002, Failure::Power);
    let mut wrong = command();
    wrong.position_rad[3] = f64::NAN;
    assert!(matches!(hand.step(&wrong, TICK_S), Err(LinkError::NotANumber)));
    assert!(matches!(hand.step(&command(), 0.4 * TICK_S), Err(LinkError::Step { .. })));
    hand.step(&command(), 2.0 * TICK_S).unwrap();
    assert!(matches!(hand.step(&command(), TICK_S), Err(LinkError::Lost(_))));
}

/// A board that gives no torque and says nothing.
struct Mute;

impl Board for Mute {
    fn tick(&mut self, _: &ToBoard) -> Result<FromBoard, LinkError> {
        Ok(FromBoard::default())
    }

    fn kill(&mut self) {}
}

#[test]
fn a_board_that_says_nothing_is_told() {
    let silent = OnBus::start(&scene(), SensorParameters::hit_dlr(), 1, Mute).err().unwrap();
    assert!(matches!(silent, StartError::Link(LinkError::Lost(_))), "{silent}");
}
