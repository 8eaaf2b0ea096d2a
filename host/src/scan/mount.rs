//! Where the scanner sits on the hand.

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};

/// Pose of the scanner in the palm frame: on a support in front of the palm, looking along the palm's +x, away from the
/// stretched fingers; the thumb turns aside to 0 degrees while scanning (Wang et al. 2005, figure 6 a). The stand-off
/// is the calibration's; the place on the palm is assumed.
#[must_use]
pub fn palm_from_scanner() -> Isometry3<f64> {
    // Scanner z = palm x, scanner x (the direction of motion) = palm y.
    let axes = Matrix3::from_columns(&[Vector3::y(), Vector3::z(), Vector3::x()]);
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    Isometry3::from_parts(Translation3::new(0.045, 0.0, 0.08), rotation)
}
