//! What stands in the cell in one trial: object, size, place, mass, friction, and the scanner's errors.

use std::f64::consts::TAU;
use std::ops::RangeInclusive;

use nalgebra::{Isometry3, Translation3, Vector3};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

use crate::cli::execute::Truth;
use crate::cli::input::{TABLE_HEIGHT_M, standing_at_spot};
use crate::object::{BuiltIn, ObjectError};
use crate::scan::Instrument;

/// How far an object stands from the cell's spot along each axis, metres.
const OFFSET_M: f64 = 0.02;

/// Misplacement of each sweep along each axis (one standard deviation), metres: arm 0.3 mm, hand-eye calibration 0.3 mm
/// and 0.1 degrees at 0.3 m, together 0.66 mm in space.
const REGISTRATION_M: f64 = 0.0004;

/// Stripe centre on diffuse plastic to glossy or dark surfaces (one standard deviation), pixels.
const STRIPE_NOISE_PX: RangeInclusive<f64> = 0.1..=0.3;

/// Share of wrong points on a glaze, which reflects the stripe twice.
const GLAZE_OUTLIERS: f64 = 0.015;

/// Coulomb friction of rubber on a material: normally distributed and clipped.
struct FrictionDraw {
    mean: f64,
    deviation: f64,
    clip: [f64; 2],
}

const PLASTIC: FrictionDraw = FrictionDraw { mean: 0.6, deviation: 0.15, clip: [0.3, 1.0] };
const PORCELAIN: FrictionDraw = FrictionDraw { mean: 0.6, deviation: 0.2, clip: [0.25, 1.0] };

/// Scale and mass (kg) of the specimens of an object. Every dimension stays within the paper's 10 to 140 mm: cubes of 25 to
/// 80 mm, cylinders D 30 x 54 to D 75 x 135 mm, mice 86 to 138 mm long, disks D 70 x 14 to D 140 x 28 mm, covers of 80
/// to 95 mm. The masses are those of such things, and drawn apart from the size: there are hollow and solid ones.
const fn specimens(object: BuiltIn) -> (RangeInclusive<f64>, RangeInclusive<f64>) {
    match object {
        BuiltIn::TeacupCover => (0.89..=1.05, 0.060..=0.120),
        BuiltIn::Cube => (0.5..=1.6, 0.060..=0.140),
        BuiltIn::Cylinder => (0.6..=1.5, 0.050..=0.150),
        BuiltIn::Mouse => (0.75..=1.2, 0.085..=0.113),
        BuiltIn::Disk => (0.7..=1.4, 0.060..=0.200),
    }
}

/// What is drawn for one trial.
pub(super) struct Cell {
    pub(super) object: BuiltIn,
    pub(super) scale: f64,
    pub(super) yaw_rad: f64,
    pub(super) truth: Truth,
    pub(super) instrument: Instrument,
}

/// Draws a trial's cell.
pub(super) fn cell(built_in: BuiltIn, rng: &mut impl Rng) -> Result<Cell, ObjectError> {
    let (scales, masses_kg) = specimens(built_in);
    let scale = rng.random_range(scales);
    let mass_kg = rng.random_range(masses_kg);
    let material = if built_in == BuiltIn::TeacupCover { PORCELAIN } else { PLASTIC };
    let normal: f64 = rng.sample(StandardNormal);
    let friction = (material.mean + material.deviation * normal).clamp(material.clip[0], material.clip[1]);
    let yaw_rad = rng.random_range(0.0..TAU);
    let [x, y] = [(); 2].map(|()| rng.random_range(-OFFSET_M..=OFFSET_M));
    let instrument = Instrument {
        stripe_noise_px: rng.random_range(STRIPE_NOISE_PX),
        outlier_share: if built_in == BuiltIn::TeacupCover { GLAZE_OUTLIERS } else { 0.0 },
        registration_m: REGISTRATION_M,
        ..Instrument::default()
    };
    let mut object = built_in.object(scale)?;
    object.mass_kg = mass_kg;
    object.friction = friction;
    let turn = Isometry3::rotation(Vector3::z() * yaw_rad);
    let base_from_object = Translation3::new(x, y, 0.0)
        * standing_at_spot(&object.mesh.transformed(&turn), TABLE_HEIGHT_M)
        * turn;
    let truth = Truth { object, base_from_object, table_height_m: Some(TABLE_HEIGHT_M) };
    Ok(Cell { object: built_in, scale, yaw_rad, truth, instrument })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::input::SPOT_M;
    use crate::plan::search::attempt_rng;

    #[test]
    fn every_dimension_is_within_the_papers_and_every_object_on_the_table() {
        for (index, object) in BuiltIn::ALL.into_iter().cycle().take(200).enumerate() {
            let cell = cell(object, &mut attempt_rng(3, index)).unwrap();
            let Truth { object, base_from_object, .. } = &cell.truth;
            let (low, high) = object.mesh.bounding_box();
            assert!(
                (high - low).iter().all(|side| (0.010..=0.1401).contains(side)),
                "{} {}",
                object.name,
                high - low
            );
            let (low, high) = object.mesh.transformed(base_from_object).bounding_box();
            let middle = nalgebra::center(&low, &high);
            assert!(low.z.abs() < 1e-9 && middle.z > 0.0);
            assert!(
                (middle.x - SPOT_M[0]).abs() <= OFFSET_M + 1e-9
                    && (middle.y - SPOT_M[1]).abs() <= OFFSET_M + 1e-9
            );
            assert!((0.25..=1.0).contains(&object.friction) && (0.05..=0.2).contains(&object.mass_kg));
        }
    }
}
