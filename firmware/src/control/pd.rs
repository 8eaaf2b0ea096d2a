//! Proportional-derivative control of one joint.

/// Gains of a joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PdGains {
    /// Stiffness.
    pub stiffness_nm_per_rad: f32,
    /// Damping of the speed error.
    pub damping_nm_s_per_rad: f32,
}

/// Torque for an error of `position_error_rad` and `velocity_error_rad_per_s`, both target less measurement.
#[must_use]
pub fn torque_nm(gains: &PdGains, position_error_rad: f32, velocity_error_rad_per_s: f32) -> f32 {
    gains.stiffness_nm_per_rad * position_error_rad + gains.damping_nm_s_per_rad * velocity_error_rad_per_s
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pulls_back_and_brakes() {
        let gains = PdGains { stiffness_nm_per_rad: 4.0, damping_nm_s_per_rad: 0.5 };
        assert_eq!(torque_nm(&gains, 0.25, 0.0), 1.0);
        assert_eq!(torque_nm(&gains, 0.0, -2.0), -1.0);
    }
}
