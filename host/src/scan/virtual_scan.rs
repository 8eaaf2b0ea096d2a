//! A whole virtual scan: sweeps over an object on a table.

use nalgebra::{Translation3, Unit, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;
use thiserror::Error;

use super::{
    cast::{Body, Scene, Seen, stripe},
    instrument::Instrument,
    sweep::{StripePose, Sweep},
};
use crate::surface::{Mesh, Plane, PointCloud};

/// What a scan delivers.
#[derive(Debug, Clone, PartialEq)]
pub struct Scan {
    /// Points with lines of sight towards the laser, robot base frame; the table's are among them.
    pub cloud: PointCloud,
    /// How many of the points are truly on the object. A real scanner cannot know: for reports and tests.
    pub object_points: usize,
    /// Exposures made.
    pub stripes: usize,
    /// Time of the sweeps, without the arm's way from one to the next.
    pub duration_s: f64,
}

/// Why there is no scan.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ScanError {
    /// No sweep to make.
    #[error("there is no reachable sweep to scan with")]
    NoSweep,
    /// Rays cannot be cast at the object.
    #[error("the object's mesh has no triangles to scan")]
    NoObject,
    /// A standard deviation or an angle of the instrument is not a finite number.
    #[error("the instrument's parameters are not all finite")]
    Instrument,
}

/// Scans `object` (base frame) standing on `table`, if any.
///
/// Each stripe draws its noise from its own stream of the generator, so that the same seed gives the same cloud on any
/// number of threads.
pub fn scan(
    object: &Mesh,
    table: Option<Plane>,
    sweeps: &[Sweep],
    instrument: &Instrument,
    seed: u64,
) -> Result<Scan, ScanError> {
    if sweeps.iter().all(|sweep| sweep.stripes.is_empty()) {
        return Err(ScanError::NoSweep);
    }
    let laser_rays = instrument.laser_rays();
    let noise = [instrument.stripe_noise_px, instrument.outlier_depth_m, instrument.registration_m];
    if noise.iter().any(|n| !n.is_finite())
        || laser_rays.iter().any(|ray| !ray.x.is_finite() || ray.z.is_nan())
    {
        return Err(ScanError::Instrument);
    }
    let scene = Scene::new(object, table).ok_or(ScanError::NoObject)?;
    let misplaced: Vec<Translation3<f64>> = (0..sweeps.len())
        .map(|sweep| {
            // Streams of sweeps start above any number of stripes.
            let mut rng = stream(seed, (1 << 32) + sweep as u64);
            let mut axis = || -> f64 { StandardNormal.sample(&mut rng) };
            Translation3::from(Vector3::new(axis(), axis(), axis()) * instrument.registration_m)
        })
        .collect();
    let exposures: Vec<(usize, &StripePose)> =
        sweeps.iter().enumerate().flat_map(|(i, sweep)| sweep.stripes.iter().map(move |s| (i, s))).collect();
    let stripes: Vec<Vec<Seen>> = exposures
        .par_iter()
        .enumerate()
        .map(|(index, (_, pose))| {
            let mut rng = stream(seed, index as u64);
            stripe(&scene, &pose.base_from_scanner, &laser_rays, instrument, &mut rng)
        })
        .collect();
    let count = stripes.iter().map(Vec::len).sum();
    let (mut points, mut views) = (Vec::with_capacity(count), Vec::with_capacity(count));
    let mut sweep_of = Vec::with_capacity(count);
    let mut object_points = 0;
    for (&(sweep, pose), seen) in exposures.iter().zip(&stripes) {
        let base_from_scanner = misplaced[sweep] * pose.base_from_scanner;
        for Seen { point, body } in seen {
            points.push(base_from_scanner * point);
            views.push(base_from_scanner.rotation * Unit::new_normalize(-point.coords));
            // An arm makes no sixty thousand sweeps; if it did, the last would count as one.
            sweep_of.push(u16::try_from(sweep).unwrap_or(u16::MAX));
            object_points += usize::from(*body == Body::Object);
        }
    }
    Ok(Scan {
        cloud: PointCloud { points, normals: None, views: Some(views), sweeps: Some(sweep_of) },
        object_points,
        stripes: exposures.len(),
        duration_s: sweeps.iter().map(Sweep::duration_s).sum(),
    })
}

fn stream(seed: u64, index: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(index);
    rng
}

#[cfg(test)]
mod tests;
