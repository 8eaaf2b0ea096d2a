//! Compensation of the drives' own friction.

/// Friction of a drive as its controller knows it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrictionModel {
    /// Dry friction.
    pub coulomb_nm: f32,
    /// Viscous friction.
    pub viscous_nm_s_per_rad: f32,
    /// Speed at which half of the dry friction is compensated.
    pub knee_rad_per_s: f32,
    /// Share of the model that is compensated, 0 to 1. Less than the whole: what is given too much drives a limit cycle.
    pub share: f32,
}

/// Torque to add for a *desired* speed. The measured one would feed its noise back, with the wrong sign around rest.
///
/// Dry friction comes in as `v / (|v| + knee)`: smooth through rest like the usual hyperbolic tangent, for a division.
#[must_use]
pub fn compensation_nm(model: &FrictionModel, desired_rad_per_s: f32) -> f32 {
    let dry = model.coulomb_nm * desired_rad_per_s / (desired_rad_per_s.abs() + model.knee_rad_per_s);
    model.share * (dry + model.viscous_nm_s_per_rad * desired_rad_per_s)
}

#[cfg(test)]
mod tests {
    use super::*;

    const MODEL: FrictionModel =
        FrictionModel { coulomb_nm: 0.02, viscous_nm_s_per_rad: 0.01, knee_rad_per_s: 0.02, share: 0.5 };

    #[test]
    fn helps_the_motion_and_never_gives_all() {
        assert_eq!(compensation_nm(&MODEL, 0.0), 0.0);
        for speed in [0.001, 0.02, 0.3, 3.0] {
            let help = compensation_nm(&MODEL, speed);
            assert_eq!(compensation_nm(&MODEL, -speed), -help);
            assert!(help > 0.0 && help < 0.5 * (0.02 + 0.01 * speed), "{speed}: {help}");
        }
        assert!((compensation_nm(&MODEL, 0.02) - 0.5 * (0.01 + 0.0002)).abs() < 1e-8, "half at the knee");
    }
}
