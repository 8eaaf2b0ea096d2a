use super::*;
use protocol::ids::FingerJoint;

const PERIOD_US: u32 = 1000;
/// Flexion of the index finger.
const J: usize = 5;
const INDEX: usize = 1;

fn config() -> Config {
    Config::new(&HandModel::hit_dlr())
}

fn sensors() -> Sensors {
    let mut sensors = Sensors {
        position_rad: [0.5; JOINT_COUNT],
        joint_torque_nm: [0.0; JOINT_COUNT],
        tip_wrench: [[0.0; 6]; FINGER_COUNT],
    };
    sensors.position_rad[0] = HandModel::<f32>::hit_dlr().hard_limits.thumb_rotation.upper_rad;
    for finger in FingerId::ALL {
        sensors.position_rad[JointId::of(finger, FingerJoint::Abduction).index()] = 0.0;
    }
    sensors
}

fn excitation() -> Excitation {
    Excitation { target_rad: [0.5; JOINT_COUNT], output_nm: [0.0; JOINT_COUNT], active: [true; FINGER_COUNT] }
}

/// Periods of the index finger until its fault, and the fault.
fn fault_after(
    mut change: impl FnMut(u32, &mut Sensors, &mut Excitation),
    periods: u32,
) -> Option<(u32, Fault)> {
    let mut memory = Plausibility::default();
    for period in 0..periods {
        let (mut sensors, mut excitation) = (sensors(), excitation());
        change(period, &mut sensors, &mut excitation);
        let faults = memory.step(&config(), &mut sensors, &excitation, PERIOD_US);
        assert!(faults.iter().enumerate().all(|(finger, fault)| finger == INDEX || fault.is_none()));
        if let Some(fault) = faults[INDEX] {
            return Some((period, fault));
        }
    }
    None
}

#[test]
fn a_hand_at_rest_is_plausible_for_ever() {
    assert_eq!(fault_after(|_, _, _| {}, 10_000), None);
}

#[test]
fn what_is_no_number_is_a_fault_at_once() {
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let expected = Some((0, Fault::SensorNotANumber));
        assert_eq!(fault_after(|_, sensors, _| sensors.position_rad[J] = bad, 1), expected);
        assert_eq!(fault_after(|_, sensors, _| sensors.joint_torque_nm[J] = bad, 1), expected);
        for part in 0..6 {
            assert_eq!(fault_after(|_, sensors, _| sensors.tip_wrench[INDEX][part] = bad, 1), expected);
        }
    }
}

#[test]
fn what_is_out_of_range_is_a_fault_at_the_third_time() {
    let torque = |_, sensors: &mut Sensors, _: &mut Excitation| sensors.joint_torque_nm[J] = -10.0;
    assert_eq!(fault_after(torque, 10), Some((2, Fault::TorqueRange)));
    let position = |_, sensors: &mut Sensors, _: &mut Excitation| sensors.position_rad[J] = 2.5;
    assert_eq!(fault_after(position, 10), Some((2, Fault::PositionRange)));
    let force = |_, sensors: &mut Sensors, _: &mut Excitation| sensors.tip_wrench[INDEX][2] = 31.0;
    assert_eq!(fault_after(force, 10), Some((2, Fault::WrenchRange)));
    let moment = |_, sensors: &mut Sensors, _: &mut Excitation| sensors.tip_wrench[INDEX][5] = -0.6;
    assert_eq!(fault_after(moment, 10), Some((2, Fault::WrenchRange)));
    let twice = |period, sensors: &mut Sensors, _: &mut Excitation| {
        sensors.joint_torque_nm[J] = if period % 3 == 0 { 0.0 } else { 10.0 };
    };
    assert_eq!(fault_after(twice, 100), None, "never three times in a row");
}

#[test]
fn an_angle_that_jumps_is_not_believed_and_a_fault_if_it_stays() {
    let glitch = |period, sensors: &mut Sensors, _: &mut Excitation| {
        sensors.position_rad[J] = if period % 7 == 6 { 0.8 } else { 0.5 };
    };
    assert_eq!(fault_after(glitch, 100), None);
    let jump = |period, sensors: &mut Sensors, _: &mut Excitation| {
        sensors.position_rad[J] = if period < 10 { 0.5 } else { 0.8 };
    };
    assert_eq!(fault_after(jump, 100), Some((12, Fault::PositionRate)));

    let mut memory = Plausibility::default();
    let mut now = sensors();
    let _ = memory.step(&config(), &mut now, &excitation(), PERIOD_US);
    now.position_rad[J] = 0.8;
    let _ = memory.step(&config(), &mut now, &excitation(), PERIOD_US);
    assert_eq!(now.position_rad[J], 0.5);
    let fast = |period, sensors: &mut Sensors, _: &mut Excitation| {
        sensors.position_rad[J] = 0.1 + 3.0 * period as f32 * 1e-3;
    };
    assert_eq!(fault_after(fast, 400), None, "as fast as a joint can");
}

#[test]
fn an_angle_that_does_not_follow_is_a_fault_unless_something_is_in_the_way() {
    let sweep = |period: u32| 0.5 + 0.3 * (period as f32 / 300.0).min(1.0);
    let stuck =
        |period, _: &mut Sensors, excitation: &mut Excitation| excitation.target_rad[J] = sweep(period);
    assert_eq!(fault_after(stuck, 1000), Some((200, Fault::PositionStuck)));
    let blocked = |period, sensors: &mut Sensors, excitation: &mut Excitation| {
        excitation.target_rad[J] = sweep(period);
        sensors.joint_torque_nm[J] = 0.001 * period as f32;
    };
    assert_eq!(fault_after(blocked, 1000), None);
    let idle = |period, _: &mut Sensors, excitation: &mut Excitation| {
        excitation.target_rad[J] = sweep(period);
        excitation.active[INDEX] = false;
    };
    assert_eq!(fault_after(idle, 1000), None);
}

#[test]
fn a_strain_gauge_that_does_not_follow_its_drive_is_a_fault() {
    let stuck = |period, _: &mut Sensors, excitation: &mut Excitation| {
        excitation.output_nm[J] = if period > 100 { 0.4 } else { 0.0 };
    };
    assert_eq!(fault_after(stuck, 1000), Some((200, Fault::TorqueStuck)));
    let alive = |period, sensors: &mut Sensors, excitation: &mut Excitation| {
        stuck(period, sensors, excitation);
        sensors.joint_torque_nm[J] = 1e-4 * (period % 2) as f32;
    };
    assert_eq!(fault_after(alive, 1000), None);
}
