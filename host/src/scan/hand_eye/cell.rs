//! The virtual cell's ball, and sweeps over it that tell a mount.

use std::f64::consts::{PI, TAU};

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::scan::sweep::looking;
use crate::scan::{Instrument, StripePose, Sweep, palm_from_scanner};
use crate::surface::{Mesh, MeshError};

/// Facets around a ball's equator: at 20 mm of radius their middles lie 1.5 micrometres deep.
const FACETS: u32 = 256;
/// Largest angle between a view and the vertical.
const LARGEST_TILT_RAD: f64 = 0.785;
/// How far the ball is put from the middle of the field, along the stripe and in depth, at most. The middle of a ball is
/// so much farther than the stand-off that its face is in the field.
const ASIDE_M: [f64; 2] = [0.030, 0.035];
const FARTHER_M: f64 = 0.010;
/// Length of a sweep beyond the ball on each side.
const MARGIN_M: f64 = 0.002;
/// Distance and time between frames: 50 mm/s.
const PITCH_M: f64 = 0.001;
const PERIOD_S: f64 = 0.02;
/// Views that are tried for each that is wanted.
const TRIALS: u32 = 200;

/// A ball's surface.
///
/// # Errors
/// When the radius or the centre makes no mesh.
pub fn ball(center_m: &Point3<f64>, radius_m: f64) -> Result<Mesh, MeshError> {
    let rings = FACETS / 2;
    let mut vertices = vec![center_m + Vector3::z() * radius_m];
    for ring in 1..rings {
        let (sin, cos) = (PI * f64::from(ring) / f64::from(rings)).sin_cos();
        vertices.extend((0..FACETS).map(|i| {
            let (y, x) = (TAU * f64::from(i) / f64::from(FACETS)).sin_cos();
            center_m + Vector3::new(x * sin, y * sin, cos) * radius_m
        }));
    }
    vertices.push(center_m - Vector3::z() * radius_m);
    let last = vertices.len() as u32 - 1;
    let at = |ring: u32, i: u32| 1 + (ring - 1) * FACETS + i % FACETS;
    let mut faces = Vec::new();
    for i in 0..FACETS {
        faces.push([0, at(1, i), at(1, i + 1)]);
        for ring in 1..rings - 1 {
            faces.push([at(ring, i), at(ring + 1, i), at(ring + 1, i + 1)]);
            faces.push([at(ring, i), at(ring + 1, i + 1), at(ring, i + 1)]);
        }
        faces.push([last, at(rings - 1, i + 1), at(rings - 1, i)]);
    }
    Mesh::new(vertices, faces)
}

/// Up to `count` straight sweeps across a ball, drawn by the seed from those that the arm can make: leaning to all sides,
/// rolled about the line of sight, the ball in another place of the field each time. Fewer when the arm reaches
/// too little.
#[must_use]
pub fn ball_sweeps(
    center_m: &Point3<f64>,
    radius_m: f64,
    instrument: &Instrument,
    count: u32,
    seed: u64,
    reachable: &dyn Fn(&[StripePose]) -> bool,
) -> Vec<Sweep> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut sweeps = Vec::new();
    let half = ((radius_m + MARGIN_M) / PITCH_M).ceil().clamp(1.0, 1e4) as i32;
    for _ in 0..count.saturating_mul(TRIALS) {
        if sweeps.len() as u32 >= count {
            break;
        }
        let azimuth = rng.random_range(0.0..TAU);
        // Even over the cap of directions, near enough.
        let tilt = LARGEST_TILT_RAD * rng.random_range(0.0..1.0_f64).sqrt();
        let rotation = looking(azimuth, tilt, rng.random_range(-PI..PI));
        let [y, z] = ASIDE_M.map(|aside| rng.random_range(-aside..aside));
        let stripes: Vec<StripePose> = (-half..=half)
            .map(|i| {
                let in_scanner =
                    Vector3::new(-PITCH_M * f64::from(i), y, instrument.stand_off_m + FARTHER_M + z);
                let origin = Translation3::from(center_m - rotation * in_scanner);
                StripePose {
                    time_s: PERIOD_S * f64::from(i + half),
                    base_from_scanner: Isometry3::from_parts(origin, rotation),
                }
            })
            .collect();
        if reachable(&stripes) {
            let name = format!("from {:.0} deg, tilted {:.0} deg", azimuth.to_degrees(), tilt.to_degrees());
            sweeps.push(Sweep { name, stripes });
        }
    }
    sweeps
}

/// The nominal mount, shifted and turned by so much, whereto the seed decides: a scanner as it was screwed on.
#[must_use]
pub fn displaced_mount(shift_m: f64, turn_rad: f64, seed: u64) -> Isometry3<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut direction = || {
        let vector = Vector3::from_fn(|_, _| StandardNormal.sample(&mut rng));
        vector.try_normalize(1e-9).unwrap_or_else(Vector3::x)
    };
    let nominal = palm_from_scanner();
    let turn = UnitQuaternion::from_scaled_axis(direction() * turn_rad);
    let shift = Translation3::from(nominal.translation.vector + direction() * shift_m);
    Isometry3::from_parts(shift, turn * nominal.rotation)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ball_is_closed_and_round() {
        let center = Point3::new(0.4, 0.1, 0.03);
        let mesh = ball(&center, 0.02).unwrap();
        assert!(mesh.is_watertight());
        let volume = 4.0 / 3.0 * PI * 0.02_f64.powi(3);
        assert!((mesh.signed_volume_m3() / volume - 1.0).abs() < 1e-3, "outwards, and as large");
    }

    #[test]
    fn sweeps_lean_to_all_sides_and_pass_over_the_ball() {
        let (center, instrument) = (Point3::new(0.4, 0.0, 0.03), Instrument::default());
        let all = ball_sweeps(&center, 0.02, &instrument, 16, 1, &|_| true);
        assert_eq!(all.len(), 16);
        for sweep in &all {
            let middle = sweep.stripes[sweep.stripes.len() / 2].base_from_scanner.inverse() * center;
            assert!(middle.x.abs() < 1e-9 && middle.y.abs() < 0.03 && (middle.z - 0.21).abs() < 0.035);
        }
        let down = all.iter().map(|s| (s.stripes[0].base_from_scanner.rotation * Vector3::z()).z);
        assert!(down.clone().fold(-1.0, f64::max) > -0.75 && down.fold(0.0, f64::min) < -0.95);
        assert!(ball_sweeps(&center, 0.02, &instrument, 16, 1, &|_| false).is_empty());
        assert_ne!(ball_sweeps(&center, 0.02, &instrument, 16, 2, &|_| true), all);
    }

    #[test]
    fn a_mount_is_displaced_by_as_much_as_asked() {
        let (mount, nominal) = (displaced_mount(0.005, 0.03, 1), palm_from_scanner());
        assert!(((mount.translation.vector - nominal.translation.vector).norm() - 0.005).abs() < 1e-12);
        assert!((mount.rotation.angle_to(&nominal.rotation) - 0.03).abs() < 1e-9);
        assert_ne!(mount, displaced_mount(0.005, 0.03, 2));
    }
}
