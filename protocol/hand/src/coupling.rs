//! What the mechanism ties together: the distal joint to the middle one, and two motors to the base joint.
//!
//! Torques follow from power: if `q_joint = A q_motor`, then `torque_motor = A^T torque_joint`.

use nalgebra::RealField;

/// The distal joint's angle, radians: a rigid linkage makes it repeat the middle joint's, one to one.
#[must_use]
pub fn distal_rad<T: RealField + Copy>(middle_rad: T) -> T {
    middle_rad
}

/// The torque on the middle actuator, newton metres, that balances torques on the middle and on the distal joint: both
/// turn by the same angle, so they add. The actuator's torque limit is a limit on this sum.
#[must_use]
pub fn coupled_torque_nm<T: RealField + Copy>(middle_nm: T, distal_nm: T) -> T {
    middle_nm + distal_nm
}

/// The two motors behind the differential bevel gear of a finger's base, after their gears: angles, speeds or torques.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct BaseMotors<T> {
    /// The motor that abducts to the positive side when it runs alone.
    pub first: T,
    /// The motor that abducts to the negative side when it runs alone.
    pub second: T,
}

/// Angles or speeds of the base, `(abduction, flexion)`, from those of its motors: flexion is their mean, abduction half
/// their difference.
#[must_use]
pub fn base_from_motors<T: RealField + Copy>(motors: &BaseMotors<T>) -> (T, T) {
    let half: T = nalgebra::convert(0.5);
    ((motors.first - motors.second) * half, (motors.first + motors.second) * half)
}

/// Inverse of [`base_from_motors`].
#[must_use]
pub fn motors_from_base<T: RealField + Copy>(abduction: T, flexion: T) -> BaseMotors<T> {
    BaseMotors { first: flexion + abduction, second: flexion - abduction }
}

/// Torques of the base, `(abduction, flexion)`, newton metres, from those of its motors: both motors pull together in
/// flexion.
///
/// ```
/// use hand_model::{BaseMotors, base_torques_from_motors};
/// assert_eq!(base_torques_from_motors(&BaseMotors { first: 0.5, second: 0.5 }), (0.0, 1.0));
/// ```
#[must_use]
pub fn base_torques_from_motors<T: RealField + Copy>(motors: &BaseMotors<T>) -> (T, T) {
    (motors.first - motors.second, motors.first + motors.second)
}

/// Inverse of [`base_torques_from_motors`].
#[must_use]
pub fn motor_torques_from_base<T: RealField + Copy>(abduction_nm: T, flexion_nm: T) -> BaseMotors<T> {
    let half: T = nalgebra::convert(0.5);
    BaseMotors { first: (flexion_nm + abduction_nm) * half, second: (flexion_nm - abduction_nm) * half }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Poses;

    #[test]
    fn the_differential_is_inverted_and_keeps_power() {
        let mut poses = Poses::new(11);
        for _ in 0..1000 {
            let [speed_1, speed_2, torque_1, torque_2] = core::array::from_fn(|_| poses.uniform(-2.0, 2.0));
            let speeds = BaseMotors { first: speed_1, second: speed_2 };
            let torques = BaseMotors { first: torque_1, second: torque_2 };
            let (abduction, flexion) = base_from_motors(&speeds);
            let (abduction_nm, flexion_nm) = base_torques_from_motors(&torques);
            let motor_power = speed_1 * torque_1 + speed_2 * torque_2;
            assert!((abduction * abduction_nm + flexion * flexion_nm - motor_power).abs() < 1e-12);

            let again = motors_from_base(abduction, flexion);
            assert!((again.first - speed_1).abs() + (again.second - speed_2).abs() < 1e-12);
            let again = motor_torques_from_base(abduction_nm, flexion_nm);
            assert!((again.first - torque_1).abs() + (again.second - torque_2).abs() < 1e-12);
        }
    }

    #[test]
    fn the_coupled_torque_keeps_power() {
        let (speed, middle_nm, distal_nm) = (0.7_f64, 0.2, -0.5);
        let power = middle_nm * speed + distal_nm * distal_rad(speed);
        assert!((coupled_torque_nm(middle_nm, distal_nm) * speed - power).abs() < 1e-15);
    }
}
