//! What a joint may be given, and why it got less than was asked.

/// Why a joint's torque is not what the control law asked for. On the wire stands `protocol::fault::Limit`, to which the
/// session maps these.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(u8)]
pub enum Limit {
    /// It is.
    #[default]
    None = 0,
    /// The drive cannot give more.
    Torque = 1,
    /// The spring at the fingertip would push harder than the fingertip may bear.
    TipForce = 2,
    /// The target lay beyond the mechanism's range and was moved to its end.
    Position = 3,
    /// The target was not a finite number; the last good one holds.
    BadTarget = 4,
    /// A sensor of this finger, or the time step, was not a finite number; the finger is given no torque.
    BadInput = 5,
    /// The joint is held by its brake and takes no torque.
    Braked = 6,
}

/// `torque_nm` within `+-max_nm`, and whether it had to be cut. What is no number becomes no torque.
#[must_use]
pub fn clamp_torque(torque_nm: f32, max_nm: f32) -> (f32, Limit) {
    if torque_nm.abs() <= max_nm {
        (torque_nm, Limit::None)
    } else if torque_nm.is_finite() {
        (if torque_nm > 0.0 { max_nm } else { -max_nm }, Limit::Torque)
    } else {
        (0.0, Limit::BadInput)
    }
}

/// Whether every number is finite.
#[must_use]
pub fn all_finite(numbers: &[f32]) -> bool {
    // Zero times what is not finite is no number, and no number stays none: one comparison for all of them.
    numbers.iter().fold(0.0, |sum: f32, x| sum + x * 0.0) == 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn torque_is_cut_to_its_limit_and_says_so() {
        assert_eq!(clamp_torque(0.5, 0.9), (0.5, Limit::None));
        assert_eq!(clamp_torque(2.0, 0.9), (0.9, Limit::Torque));
        assert_eq!(clamp_torque(-2.0, 0.9), (-0.9, Limit::Torque));
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            assert_eq!(clamp_torque(bad, 0.9), (0.0, Limit::BadInput));
        }
    }
}
