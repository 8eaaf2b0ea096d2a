use std::f64::consts::{PI, TAU};

use nalgebra::{DMatrix, DVector, Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::loss::Loss;
use super::problem::{Free, Problem, State};
use super::*;
use crate::scan::levenberg::LeastSquares;
use crate::scan::sweep::looking;
use crate::scan::{Camera, Instrument, palm_from_scanner};

/// How a virtual arm looks at targets, without its kinematics.
#[derive(Clone, Copy)]
struct Views {
    sweeps: u32,
    /// Of the table's normal and the laser, at most.
    tilt_rad: f64,
    /// How far from the middle of the field the target is put, along the stripe and in depth.
    aside_m: [f64; 2],
    noise_m: f64,
    /// Standard deviation of what the arm says of each pose, for each axis.
    arm_noise_m: f64,
    /// And of what it says of a whole sweep.
    sweep_noise_m: f64,
    outlier_share: f64,
}

const VIEWS: Views = Views {
    sweeps: 16,
    tilt_rad: 0.75,
    aside_m: [0.025, 0.025],
    noise_m: 5e-5,
    arm_noise_m: 0.0,
    sweep_noise_m: 0.0,
    outlier_share: 0.0,
};

const RADIUS_M: f64 = 0.020;
const CENTER: Point3<f64> = Point3::new(0.40, 0.0, 0.025);
const BALL: Located = Located::Sphere { center_m: CENTER, radius_m: RADIUS_M };

fn rng(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

fn direction(rng: &mut ChaCha8Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| normal(rng)).normalize()
}

/// The nominal mount, turned and shifted by so much in some direction.
fn moved_mount(rng: &mut ChaCha8Rng, shift_m: f64, turn_rad: f64) -> Isometry3<f64> {
    let nominal = palm_from_scanner();
    let turn = UnitQuaternion::from_scaled_axis(direction(rng) * turn_rad);
    let shift = Translation3::from(nominal.translation.vector + direction(rng) * shift_m);
    Isometry3::from_parts(shift, turn * nominal.rotation)
}

/// Where a ray from the laser meets a target that both cameras see there, scanner frame.
fn lit(
    target: &Located,
    base_from_scanner: &Isometry3<f64>,
    instrument: &Instrument,
    ray: &Vector3<f64>,
) -> Option<Point3<f64>> {
    let scanner_from_base = base_from_scanner.inverse();
    let (reach, normal): (f64, Box<dyn Fn(&Point3<f64>) -> Vector3<f64>>) = match *target {
        Located::Sphere { center_m, radius_m } => {
            let center = (scanner_from_base * center_m).coords;
            let along = ray.dot(&center);
            let inside = along * along - center.norm_squared() + radius_m * radius_m;
            (along - inside.sqrt(), Box::new(move |p| (p.coords - center) / radius_m))
        }
        Located::Plane { normal, offset_m } => {
            let in_scanner = scanner_from_base.rotation * normal;
            let offset = offset_m - normal.dot(&base_from_scanner.translation.vector);
            let facing = in_scanner * -offset.signum();
            (offset / in_scanner.dot(ray), Box::new(move |_| facing))
        }
    };
    let point = Point3::from(ray * reach);
    if !(reach > 0.0 && (0.151..0.249).contains(&point.z) && point.y.abs() < 0.052) {
        return None;
    }
    let normal = normal(&point);
    let [left, right] = Camera::ALL.map(|camera| instrument.camera_center(camera));
    let seen = |eye: Point3<f64>| (eye - point).normalize().dot(&normal) > instrument.max_incidence_rad.cos();
    (seen(Point3::origin()) && seen(left) && seen(right)).then_some(point)
}

/// Profiles of a target by sweeps across `at`, 1 mm from frame to frame, 1 mm from point to point.
fn sweeps(
    index: usize,
    target: &Located,
    at: &Point3<f64>,
    mount: &Isometry3<f64>,
    views: &Views,
    rng: &mut ChaCha8Rng,
) -> Vec<Profile> {
    let instrument = Instrument::default();
    let mut profiles = Vec::new();
    for sweep in 0..views.sweeps {
        let azimuth = rng.random_range(0.0..TAU);
        let tilt = views.tilt_rad * rng.random_range(0.0..1.0_f64).sqrt();
        let rotation = looking(azimuth, tilt, rng.random_range(-PI..PI));
        let [y, z] = views.aside_m.map(|aside| rng.random_range(-1.0..=1.0) * aside);
        let off = Vector3::from_fn(|_, _| views.sweep_noise_m * normal(rng));
        for frame in -20..=20 {
            let in_scanner = Vector3::new(-0.001 * f64::from(frame), y, instrument.stand_off_m + z);
            let origin = at - rotation * in_scanner;
            let base_from_scanner = Isometry3::from_parts(Translation3::from(origin), rotation);
            let mut points_m = Vec::new();
            for column in -52..=52 {
                let ray = Vector3::new(0.0, 0.001 * f64::from(column), instrument.stand_off_m).normalize();
                if let Some(point) = lit(target, &base_from_scanner, &instrument, &ray) {
                    let [dy, dz] = [0, 1].map(|_| views.noise_m * normal(rng));
                    let wrong = if rng.random_bool(views.outlier_share) {
                        rng.random_range(-0.003..0.003)
                    } else {
                        0.0
                    };
                    points_m.push([point.y + dy, point.z + dz + wrong]);
                }
            }
            let noise = off + Vector3::from_fn(|_, _| views.arm_noise_m * normal(rng));
            let base_from_palm = Translation3::from(noise) * base_from_scanner * mount.inverse();
            if points_m.len() >= 5 {
                profiles.push(Profile { target: index, sweep, base_from_palm, points_m });
            }
        }
    }
    profiles
}

fn ball(mount: &Isometry3<f64>, views: &Views, rng: &mut ChaCha8Rng) -> Vec<Profile> {
    sweeps(0, &BALL, &CENTER, mount, views, rng)
}

/// Shift in metres and turn in radians between two mounts.
fn off(a: &Isometry3<f64>, b: &Isometry3<f64>) -> [f64; 2] {
    [(a.translation.vector - b.translation.vector).norm(), a.rotation.angle_to(&b.rotation)]
}

/// The turn and shift from the true mount, as [`Uncertainty`] counts them.
fn error(found: &Isometry3<f64>, truth: &Isometry3<f64>) -> nalgebra::Vector6<f64> {
    let turn = (found.rotation * truth.rotation.inverse()).scaled_axis();
    let shift = found.translation.vector - truth.translation.vector;
    nalgebra::Vector6::new(turn.x, turn.y, turn.z, shift.x, shift.y, shift.z)
}

const KNOWN: [Target; 1] = [Target::Sphere { radius_m: Some(RADIUS_M) }];
const UNKNOWN: [Target; 1] = [Target::Sphere { radius_m: None }];

#[test]
fn one_sphere_gives_the_mount_from_nothing() {
    for seed in 0..24 {
        let mut rng = rng(seed);
        // Any mount at all.
        let mut mount = moved_mount(&mut rng, 0.1, 0.0);
        mount.rotation = UnitQuaternion::from_scaled_axis(direction(&mut rng) * rng.random_range(0.0..PI));
        let outlier_share = if seed % 2 == 0 { 0.0 } else { 0.05 };
        let views = Views { outlier_share, ..VIEWS };
        let profiles = ball(&mount, &views, &mut rng);
        for targets in [KNOWN, UNKNOWN] {
            let clock = std::time::Instant::now();
            let seeded = super::seed(&targets, &profiles).unwrap();
            let [seed_m, seed_rad] = off(&seeded, &mount);
            let found = calibrate_mount(&targets, &profiles, None).unwrap();
            let [shift_m, turn_rad] = off(&found.palm_from_scanner, &mount);
            println!(
                "{seed}: seed {:.3} mm {:.3} deg, found {:.4} mm {:.4} deg, noise {:.4} mm, condition {:.0}, {} of {} out, loo {:.4}, {:.2} s",
                seed_m * 1e3,
                seed_rad.to_degrees(),
                shift_m * 1e3,
                turn_rad.to_degrees(),
                found.noise_m * 1e3,
                found.condition,
                found.outliers,
                found.points,
                found.leave_one_out.rms_m * 1e3,
                clock.elapsed().as_secs_f64()
            );
            assert!(shift_m < 1e-4 && turn_rad < 0.03_f64.to_radians(), "{seed}");
        }
    }
}

#[test]
fn the_jacobian_is_the_derivative() {
    let mut rng = rng(7);
    let mount = moved_mount(&mut rng, 0.01, 0.1);
    let floor = Located::Plane { normal: Vector3::new(0.1, 0.2, 0.9).normalize(), offset_m: 0.02 };
    let few = Views { sweeps: 2, ..VIEWS };
    let mut profiles = ball(&mount, &few, &mut rng);
    profiles.extend(sweeps(1, &floor, &Point3::new(0.4, 0.0, -0.04), &mount, &few, &mut rng));
    profiles.retain(|profile| profile.points_m.len() > 3);
    assert!(profiles.iter().any(|profile| profile.target == 1));
    let targets = [Target::Sphere { radius_m: None }, Target::Plane];
    let around = State { palm_from_scanner: mount, targets: vec![BALL, floor] };
    let free = Free { mount: true, radii: true };
    let problem = Problem::new(&targets, &profiles, around, Loss::cauchy(1e-3), free);
    let n = problem.parameters();
    assert_eq!(n, 13);
    // Away from zero, where the turn's own derivative shows.
    let steps = DVector::from_fn(n, |_, _| 0.05 * normal(&mut rng));
    let (mut square, mut gradient) = (DMatrix::zeros(n, n), DVector::zeros(n));
    let cost = problem.linearise(&steps, &mut square, &mut gradient);
    assert!((cost - problem.cost(&steps)).abs() < 1e-12 * cost);
    for i in 0..n {
        let mut unit = DVector::zeros(n);
        unit[i] = 1e-6;
        let slope = (problem.cost(&(&steps + &unit)) - problem.cost(&(&steps - &unit))) / 2e-6;
        assert!(
            (gradient[i] - 0.5 * slope).abs() < 1e-6 * gradient.norm(),
            "{i}: {} {}",
            gradient[i],
            0.5 * slope
        );
    }
}
