//! What stands in the cell in one trial: object, size, place, mass, friction, and the scanner's errors.

use std::f64::consts::TAU;
use std::ops::RangeInclusive;
use std::path::Path;

use anyhow::Context;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

use crate::cli::execute::{TABLE_FRICTION, Truth};
use crate::cli::input::{TABLE_HEIGHT_M, standing_at_spot};
use crate::object::{BuiltIn, Object, ObjectError};
use crate::scan::Instrument;
use crate::twin::{ObjectBody, RestError, resting_pose};

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

impl FrictionDraw {
    fn draw(&self, rng: &mut impl Rng) -> f64 {
        let normal: f64 = rng.sample(StandardNormal);
        (self.mean + self.deviation * normal).clamp(self.clip[0], self.clip[1])
    }
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

/// Mass that a built-in object is gripped for, kg: the robot does not know the true one, so it counts on the heaviest.
const PLANNED_MASS_KG: f64 = 0.2;

/// Orientations in which an object of a file is dropped until it comes to rest in one.
const DROPS: usize = 8;

/// What takes its turn in the trials.
pub(super) enum Specimen {
    /// A built-in object, of drawn size and mass.
    BuiltIn(BuiltIn),
    /// An object of a file as it is, in a pose in which it comes to rest; the robot is told its mass.
    File(Object),
}

impl Specimen {
    /// Name for reports: of a file without its folder and extension.
    pub(super) fn name(&self) -> String {
        match self {
            Self::BuiltIn(built_in) => built_in.name().to_owned(),
            Self::File(object) => Path::new(&object.name)
                .file_stem()
                .map_or_else(|| object.name.clone(), |stem| stem.to_string_lossy().into_owned()),
        }
    }
}

/// What is drawn for one trial.
pub(super) struct Cell {
    pub(super) scale: f64,
    pub(super) yaw_rad: f64,
    pub(super) truth: Truth,
    pub(super) instrument: Instrument,
    /// Mass that is planned with, kg.
    pub(super) planned_kg: f64,
}

/// Draws a trial's cell.
pub(super) fn cell(specimen: &Specimen, rng: &mut impl Rng) -> anyhow::Result<Cell> {
    match specimen {
        Specimen::BuiltIn(built_in) => Ok(built_in_cell(*built_in, rng)?),
        Specimen::File(object) => file_cell(object, rng),
    }
}

fn built_in_cell(built_in: BuiltIn, rng: &mut impl Rng) -> Result<Cell, ObjectError> {
    let (scales, masses_kg) = specimens(built_in);
    let scale = rng.random_range(scales);
    let mass_kg = rng.random_range(masses_kg);
    let material = if built_in == BuiltIn::TeacupCover { PORCELAIN } else { PLASTIC };
    let friction = material.draw(rng);
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
    Ok(Cell { scale, yaw_rad, truth, instrument, planned_kg: PLANNED_MASS_KG })
}

fn file_cell(object: &Object, rng: &mut impl Rng) -> anyhow::Result<Cell> {
    let friction = PLASTIC.draw(rng);
    let yaw_rad = rng.random_range(0.0..TAU);
    let [x, y] = [(); 2].map(|()| rng.random_range(-OFFSET_M..=OFFSET_M));
    let instrument = Instrument {
        stripe_noise_px: rng.random_range(STRIPE_NOISE_PX),
        registration_m: REGISTRATION_M,
        ..Instrument::default()
    };
    let body = ObjectBody::new(&object.mesh, object.convex_pieces(), Isometry3::identity(), object.mass_kg);
    let mut rest = Err(RestError::Rolls);
    for _ in 0..DROPS {
        // A direction and an angle about it: uniform over all orientations as a normalised 4-vector of normals.
        let q: [f64; 4] = [(); 4].map(|()| rng.sample(StandardNormal));
        let turn = UnitQuaternion::from_quaternion(Quaternion::from(q));
        rest = resting_pose(&body, turn, TABLE_FRICTION);
        if rest.is_ok() {
            break;
        }
    }
    let rest = rest.with_context(|| format!("standing {} on the table", object.name))?;
    let turn = Isometry3::rotation(Vector3::z() * yaw_rad) * rest;
    let base_from_object = Translation3::new(x, y, 0.0)
        * standing_at_spot(&object.mesh.transformed(&turn), TABLE_HEIGHT_M)
        * turn;
    let mut object = object.clone();
    object.friction = friction;
    let planned_kg = object.mass_kg;
    let truth = Truth { object, base_from_object, table_height_m: Some(TABLE_HEIGHT_M) };
    Ok(Cell { scale: 1.0, yaw_rad, truth, instrument, planned_kg })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::input::SPOT_M;
    use crate::plan::search::attempt_rng;

    #[test]
    fn every_dimension_is_within_the_papers_and_every_object_on_the_table() {
        for (index, object) in BuiltIn::ALL.into_iter().cycle().take(200).enumerate() {
            let cell = cell(&Specimen::BuiltIn(object), &mut attempt_rng(3, index)).unwrap();
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
