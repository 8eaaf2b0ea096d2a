//! How fast the arm may move what it carries.

use nalgebra::{Matrix3, Point3, Vector3};

use super::super::arm::{Arm, Payload};
use super::super::scene::Scene;
use super::super::timing::MotionLimits;
use super::MotionError;

/// Mass of the scanner on the palm's support, kg (assumed: two small cameras, a line laser, a bracket).
const SCANNER_KG: f64 = 0.35;

/// Height of the hand's and scanner's common centre of mass over the wrist plane, metres, along palm z (palm 1.05 kg
/// around 60 mm, fingers around 200 mm).
const LOAD_CENTER_IN_PALM_M: f64 = 0.10;

/// Limits of a motion with hand, scanner and an object of `object_kg` at the grasp centre.
pub(super) fn limits(scene: &Scene, arm: &Arm, object_kg: f64) -> Result<MotionLimits, MotionError> {
    let hand_kg = scene.hand.mass_kg + SCANNER_KG;
    let mass_kg = hand_kg + object_kg;
    let object_z_m = scene.hand.grasp_center_in_palm.z;
    let center_z_m = (LOAD_CENTER_IN_PALM_M * hand_kg + object_z_m * object_kg) / mass_kg;
    // Point masses about their common centre; the parts' own inertias are a tenth of that.
    let reduced = hand_kg * object_kg / mass_kg * (object_z_m - LOAD_CENTER_IN_PALM_M).powi(2);
    let flange_from_palm = arm.flange_from_palm();
    let rotation = flange_from_palm.rotation.to_rotation_matrix().into_inner();
    let payload = Payload {
        mass_kg,
        center_in_flange: flange_from_palm * Point3::new(0.0, 0.0, center_z_m),
        inertia_kg_m2: rotation
            * Matrix3::from_diagonal(&Vector3::new(reduced, reduced, 0.0))
            * rotation.transpose(),
    };
    MotionLimits::for_load(arm, &arm.check_load(&payload).mode).ok_or(MotionError::TooHeavy { object_kg })
}
