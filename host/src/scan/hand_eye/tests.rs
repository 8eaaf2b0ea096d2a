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
    /// Azimuth, tilt and roll of all views; otherwise each has its own.
    fixed_rad: Option<[f64; 3]>,
}

const VIEWS: Views = Views {
    sweeps: 16,
    tilt_rad: 0.75,
    aside_m: [0.025, 0.025],
    noise_m: 5e-5,
    arm_noise_m: 0.0,
    sweep_noise_m: 0.0,
    outlier_share: 0.0,
    fixed_rad: None,
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
    let (reach, point, normal) = match *target {
        Located::Sphere { center_m, radius_m } => {
            let center = (scanner_from_base * center_m).coords;
            let along = ray.dot(&center);
            let reach = along - (along * along - center.norm_squared() + radius_m * radius_m).sqrt();
            (reach, ray * reach, (ray * reach - center) / radius_m)
        }
        Located::Plane { normal, offset_m } => {
            let in_scanner = scanner_from_base.rotation * normal;
            let offset = offset_m - normal.dot(&base_from_scanner.translation.vector);
            let reach = offset / in_scanner.dot(ray);
            (reach, ray * reach, in_scanner * -offset.signum())
        }
    };
    let point = Point3::from(point);
    // Not where a ray misses, whose reach is not a number.
    if !(reach > 0.0 && (0.151..0.249).contains(&point.z) && point.y.abs() < 0.052) {
        return None;
    }
    let [left, right] = Camera::ALL.map(|camera| instrument.camera_center(camera));
    let seen = |eye: Point3<f64>| (eye - point).normalize().dot(&normal) > instrument.max_incidence_rad.cos();
    (seen(Point3::origin()) && seen(left) && seen(right)).then_some(point)
}

/// Profiles of a target by sweeps across `at`, 1.5 mm from frame to frame, 1 mm from point to point.
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
        let tilt = views.tilt_rad * rng.random_range(0.0..1.0_f64).sqrt();
        let own = [rng.random_range(0.0..TAU), tilt, rng.random_range(-PI..PI)];
        let [azimuth, tilt, roll] = views.fixed_rad.unwrap_or(own);
        let rotation = looking(azimuth, tilt, roll);
        let [y, z] = views.aside_m.map(|aside| rng.random_range(-1.0..=1.0) * aside);
        let off = Vector3::from_fn(|_, _| views.sweep_noise_m * normal(rng));
        for frame in -14..=14 {
            let in_scanner = Vector3::new(-0.0015 * f64::from(frame), y, instrument.stand_off_m + z);
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

/// At most 0.1 mm and 0.03 degrees.
#[track_caller]
fn assert_near(found: &Isometry3<f64>, truth: &Isometry3<f64>, what: &dyn std::fmt::Debug) {
    let [shift_m, turn_rad] = off(found, truth);
    let turn_deg = turn_rad.to_degrees();
    assert!(shift_m < 1e-4 && turn_deg < 0.03, "{what:?}: {:.3} mm, {turn_deg:.3} deg", shift_m * 1e3);
}

/// Any mount at all.
fn any_mount(rng: &mut ChaCha8Rng) -> Isometry3<f64> {
    let shift = moved_mount(rng, 0.1, 0.0).translation;
    let turn = UnitQuaternion::from_scaled_axis(direction(rng) * rng.random_range(0.0..PI));
    Isometry3::from_parts(shift, turn)
}

#[test]
fn one_sphere_gives_the_mount_from_nothing() {
    let mut worst = [0.0_f64; 4];
    for seed in 0..24 {
        let mut rng = rng(seed);
        let mount = any_mount(&mut rng);
        let unknown = (0.05, if seed % 4 == 0 { UNKNOWN } else { KNOWN });
        for (outlier_share, targets) in [(0.0, KNOWN), unknown] {
            let profiles = ball(&mount, &Views { outlier_share, ..VIEWS }, &mut rng);
            let [seed_m, seed_rad] = off(&super::seed(&targets, &profiles).unwrap(), &mount);
            let found = calibrate_mount(&targets, &profiles, None).unwrap();
            let [shift_m, turn_rad] = off(&found.palm_from_scanner, &mount);
            for (worst, now) in worst.iter_mut().zip([seed_m, seed_rad, shift_m, turn_rad]) {
                *worst = worst.max(now);
            }
            // The closed form alone is near, whatever the mount.
            assert!(seed_m < 0.004 && seed_rad < 0.02, "{seed}: {seed_m} {seed_rad}");
            assert_near(&found.palm_from_scanner, &mount, &(seed, outlier_share));
            let share = found.outliers as f64 / found.points as f64;
            // Those outliers that are within the noise by chance, or the ball's flank, go unnoticed.
            assert!((0.8 * outlier_share..=outlier_share + 0.003).contains(&share), "{share}");
            assert!((found.noise_m - 4.7e-5).abs() < 4e-6);
            let Some([radius_m, std_m]) = found.measured_radii_m[0] else { panic!("no radius") };
            assert!((radius_m - RADIUS_M).abs() < 5.0 * std_m && std_m < 1e-5);
        }
    }
    println!("worst of closed form and refinement, m and rad: {worst:?}");
}

/// A wrong mount may lay the laser planes of two or three sweeps into one, which then fits them all too well.
#[test]
fn five_sweeps_do() {
    for seed in 0..24 {
        let mut rng = rng(500 + seed);
        let mount = any_mount(&mut rng);
        let profiles = ball(&mount, &Views { sweeps: 5, outlier_share: 0.02, ..VIEWS }, &mut rng);
        let found = calibrate_mount(&KNOWN, &profiles, None);
        // A few have the ball near a line of the field, or the palm turned too little: those say so.
        if let Err(HandEyeError::OnALine { .. } | HandEyeError::NoRotation { .. }) = found {
            continue;
        }
        let found = found.unwrap();
        let error = error(&found.palm_from_scanner, &mount);
        assert!(normalised(&error, &found.by_points)[0] < 35.0, "{seed}");
        assert!(off(&found.palm_from_scanner, &mount)[0] < 5e-4, "{seed}");
    }
}

#[test]
fn a_mount_is_found_from_20_mm_and_10_degrees_off() {
    for seed in 0..20 {
        let mut rng = rng(100 + seed);
        let mount = any_mount(&mut rng);
        let views = Views { outlier_share: 0.05, ..VIEWS };
        let turn = UnitQuaternion::from_scaled_axis(direction(&mut rng) * 10_f64.to_radians());
        let shift = Translation3::from(mount.translation.vector + direction(&mut rng) * 0.020);
        let start = Isometry3::from_parts(shift, turn * mount.rotation);
        let profiles = ball(&mount, &views, &mut rng);
        let found = calibrate_mount(&KNOWN, &profiles, Some(&start)).unwrap();
        assert_near(&found.palm_from_scanner, &mount, &("sphere", seed));
        let table = Located::Plane { normal: Vector3::z(), offset_m: 0.0 };
        let profiles = sweeps(0, &table, &Point3::new(0.4, 0.0, 0.0), &mount, &views, &mut rng);
        let found = calibrate_mount(&[Target::Plane], &profiles, Some(&start)).unwrap();
        let [a, b] = off(&found.palm_from_scanner, &mount);
        println!(
            "plane {seed}: {:.4} mm {:.4} deg condition {:.0}",
            a * 1e3,
            b.to_degrees(),
            found.condition
        );
        assert_near(&found.palm_from_scanner, &mount, &("plane", seed));
        assert_eq!(calibrate_mount(&[Target::Plane], &profiles, None), Err(HandEyeError::NoStart));
    }
}

#[test]
fn a_ball_near_a_line_of_the_field_is_not_taken_from_its_other_side() {
    for seed in 0..8 {
        let mut rng = rng(400 + seed);
        let mount = any_mount(&mut rng);
        // On a line, half a turn about it would fit as well. These are uniform: their spread is 0.6 times as much.
        for aside_m in [[0.025, 0.0035], [0.0035, 0.025], [0.004, 0.004]] {
            let profiles = ball(&mount, &Views { aside_m, ..VIEWS }, &mut rng);
            let [a, b] = off(&super::seed(&KNOWN, &profiles).unwrap(), &mount);
            let found = calibrate_mount(&KNOWN, &profiles, None).unwrap();
            let [c, d] = off(&found.palm_from_scanner, &mount);
            println!(
                "{seed} {aside_m:?}: seed {:.1} mm {:.1} deg, {:.4} mm {:.4} deg, {:.0}",
                a * 1e3,
                b.to_degrees(),
                c * 1e3,
                d.to_degrees(),
                found.condition
            );
            // Not the accuracy of a well spread set, but as honest: chi-square of six numbers.
            let error = error(&found.palm_from_scanner, &mount);
            assert!(normalised(&error, &found.by_points)[0] < 35.0, "{seed} {aside_m:?}");
            assert!(c < 4e-4 && d.to_degrees() < 0.15);
        }
    }
}

#[test]
fn single_poses_two_balls_and_a_plane_together_do() {
    for seed in 0..20 {
        let mut rng = rng(200 + seed);
        let mount = any_mount(&mut rng);
        // One frame of each of 40 views, anywhere on the ball: the laser plane passes the centre on either side.
        let views = Views { sweeps: 40, ..VIEWS };
        let all = ball(&mount, &views, &mut rng);
        let single: Vec<Profile> = all
            .chunk_by(|a, b| a.sweep == b.sweep)
            .map(|sweep| sweep[rng.random_range(sweep.len() / 5..sweep.len() - sweep.len() / 5)].clone())
            .collect();
        for targets in [KNOWN, UNKNOWN] {
            let found = calibrate_mount(&targets, &single, None).unwrap();
            let [a, b] = off(&found.palm_from_scanner, &mount);
            println!("single {seed}: {:.4} mm {:.4} deg {:.0}", a * 1e3, b.to_degrees(), found.condition);
            // Some thousand points, not some ten thousand.
            assert!(a < 3e-4 && b.to_degrees() < 0.1);
        }
        let few = Views { sweeps: 4, ..VIEWS };
        let other = Point3::new(0.36, 0.06, 0.03);
        let second = Located::Sphere { center_m: other, radius_m: 0.015 };
        let table = Located::Plane { normal: Vector3::z(), offset_m: 0.0 };
        let mut together = sweeps(0, &BALL, &CENTER, &mount, &few, &mut rng);
        together.extend(sweeps(1, &second, &other, &mount, &few, &mut rng));
        together.extend(sweeps(2, &table, &Point3::new(0.4, 0.1, 0.0), &mount, &few, &mut rng));
        let targets = [KNOWN[0], Target::Sphere { radius_m: None }, Target::Plane];
        let found = calibrate_mount(&targets, &together, None).unwrap();
        assert_near(&found.palm_from_scanner, &mount, &("together", seed));
        let Located::Sphere { center_m, radius_m } = found.targets[1] else { panic!("a sphere") };
        assert!((center_m - other).norm() < 1e-4 && (radius_m - 0.015).abs() < 3e-5);
    }
}

/// Squares of errors over their variances: all together (Mahalanobis), and of the six numbers alone, in the mean.
fn normalised(error: &nalgebra::Vector6<f64>, uncertainty: &Uncertainty) -> [f64; 2] {
    let covariance = uncertainty.covariance;
    let all = covariance.cholesky().map_or(f64::NAN, |factor| error.dot(&factor.solve(error)));
    [all, (0..6).map(|i| error[i] * error[i] / covariance[(i, i)]).sum::<f64>() / 6.0]
}

#[test]
fn the_covariance_is_honest() {
    let runs = 24;
    let (mut all, mut with_outliers) = (0.0, 0.0);
    let (mut by_sweeps, mut by_points) = (0.0, 0.0);
    for seed in 0..runs {
        let mut rng = rng(300 + seed);
        let mount = moved_mount(&mut rng, 0.02, 0.2);
        let mut errors = |views: Views| {
            let found = calibrate_mount(&KNOWN, &ball(&mount, &views, &mut rng), None).unwrap();
            let error = error(&found.palm_from_scanner, &mount);
            if views.arm_noise_m == 0.0 {
                assert_near(&found.palm_from_scanner, &mount, &views.outlier_share);
            }
            let [shift_m, turn_rad] = off(&found.palm_from_scanner, &mount);
            assert!(shift_m < 4e-4 && turn_rad < 0.12_f64.to_radians(), "{shift_m} {turn_rad}");
            (normalised(&error, &found.by_points), normalised(&error, &found.leave_one_out.uncertainty))
        };
        all += errors(VIEWS).0[0];
        with_outliers += errors(Views { outlier_share: 0.05, ..VIEWS }).0[0];
        // What the arm says is wrong by as much throughout a sweep, and by more in each pose.
        let arm = errors(Views { sweep_noise_m: 2e-5, arm_noise_m: 5e-5, ..VIEWS });
        by_points += arm.0[1] / runs as f64;
        by_sweeps += arm.1[1] / runs as f64;
    }
    println!("chi-square of {}: {all:.0}, with outliers {with_outliers:.0}", 6 * runs);
    println!(
        "mean square of normalised errors of an arm that errs: by points {by_points:.2}, by sweeps {by_sweeps:.2}"
    );
    // Chi-square of 144 degrees of freedom: three and a half standard deviations (17.0) on either side.
    assert!((85.0..204.0).contains(&all), "{all}");
    assert!((85.0..204.0).contains(&with_outliers), "{with_outliers}");
    // The points know nothing of the arm; sweeps that are left out do. 1 is right, up to the few sweeps.
    assert!(by_points > 3.0, "{by_points}");
    assert!((0.5..1.6).contains(&by_sweeps), "{by_sweeps}");
}

#[test]
fn leaving_a_sweep_out_is_a_fit_without_it_and_shows_the_one_that_is_wrong() {
    let mut rng = rng(1);
    let mount = moved_mount(&mut rng, 0.02, 0.2);
    let mut profiles = ball(&mount, &VIEWS, &mut rng);
    let sound = calibrate_mount(&KNOWN, &profiles, None).unwrap();
    assert_eq!(sound.leave_one_out.sweeps.len(), 16);
    assert!(sound.leave_one_out.max_rms_m < 5.5e-5);
    for left in sound.leave_one_out.sweeps.iter().step_by(5) {
        let others: Vec<Profile> = profiles.iter().filter(|p| p.sweep != left.sweep).cloned().collect();
        let without = calibrate_mount(&KNOWN, &others, None).unwrap().palm_from_scanner;
        let shift = without.translation.vector - sound.palm_from_scanner.translation.vector;
        // Only the scale of the loss differs.
        assert!((shift - left.shift_m).norm() < 1e-6, "{shift} {}", left.shift_m);
        assert!(left.shift_m.norm() > 1e-7);
    }
    // An arm that lost a step.
    for profile in profiles.iter_mut().filter(|p| p.sweep == 11) {
        profile.base_from_palm = Translation3::new(0.0, 0.0, 2e-4) * profile.base_from_palm;
    }
    let wrong = calibrate_mount(&KNOWN, &profiles, None).unwrap().leave_one_out;
    let worst = wrong.sweeps.iter().max_by(|a, b| a.rms_m.total_cmp(&b.rms_m)).unwrap();
    assert_eq!(worst.sweep, 11);
    assert!(worst.rms_m > 2.0 * sound.leave_one_out.max_rms_m, "{}", worst.rms_m);
}

#[test]
fn poses_that_cannot_tell_are_refused_with_the_motion_that_is_missing() {
    let mut rng = rng(2);
    let mount = palm_from_scanner();
    let mut refused = |views: Views| {
        calibrate_mount(&KNOWN, &ball(&mount, &views, &mut rng), None)
            .map(|found| found.condition)
            .unwrap_err()
    };
    let straight = refused(Views { fixed_rad: Some([0.3, 0.4, 0.5]), ..VIEWS });
    assert!(
        matches!(straight, HandEyeError::NoRotation { spread_deg, .. } if spread_deg < 1e-6),
        "{straight}"
    );
    // Straight down in every yaw: the laser looks along the palm's x.
    let yaw = refused(Views { tilt_rad: 0.0, ..VIEWS });
    let HandEyeError::NoRotation { axis, .. } = yaw else { panic!("{yaw}") };
    assert!((Vector3::from(axis) - Vector3::x()).norm() < 1e-6, "{axis:?}");
    assert!(yaw.to_string().contains("about other axes"), "{yaw}");
    for aside_m in [[0.0; 2], [0.025, 0.0], [0.0, 0.025]] {
        let same = refused(Views { aside_m, ..VIEWS });
        assert!(matches!(same, HandEyeError::OnALine { spread_m } if spread_m < 5e-4), "{same}");
    }
    // With a start, all points say it: a turn about the sweep's direction through the ball changes nothing.
    let profiles = ball(&mount, &Views { aside_m: [0.0; 2], noise_m: 0.0, ..VIEWS }, &mut rng);
    let same = calibrate_mount(&KNOWN, &profiles, Some(&mount)).map(|found| found.condition).unwrap_err();
    let HandEyeError::Undetermined { direction, .. } = same else { panic!("{same}") };
    assert!(!direction.is_shift() && same.to_string().contains("elsewhere in the scanner's field"), "{same}");
    assert!(direction.turn_rad.normalize().dot(&Vector3::y()).abs() > 0.99, "{direction:?}");
    // Planes that are always met alike.
    let table = Located::Plane { normal: Vector3::z(), offset_m: 0.0 };
    let flat = Views { tilt_rad: 0.0, ..VIEWS };
    let profiles = sweeps(0, &table, &Point3::new(0.4, 0.0, 0.0), &mount, &flat, &mut rng);
    let found = calibrate_mount(&[Target::Plane], &profiles, Some(&mount));
    assert!(matches!(found, Err(HandEyeError::Undetermined { .. })), "{found:?}");
}

#[test]
fn wrong_input_is_named() {
    let mut rng = rng(3);
    let mount = palm_from_scanner();
    let profiles = ball(&mount, &VIEWS, &mut rng);
    let failed = |targets: &[Target], profiles: &[Profile]| {
        calibrate_mount(targets, profiles, None).map(|found| found.condition).unwrap_err()
    };
    for radius_m in [0.015, 0.019, 0.0205, 0.030] {
        let wrong = failed(&[Target::Sphere { radius_m: Some(radius_m) }], &profiles);
        let HandEyeError::WrongRadius { found_m, .. } = wrong else { panic!("{radius_m}: {wrong}") };
        assert!((found_m - RADIUS_M).abs() < 3e-5, "{radius_m}: {found_m}");
    }
    for radius_m in [0.0, -0.02, f64::NAN] {
        let wrong = failed(&[Target::Sphere { radius_m: Some(radius_m) }], &profiles);
        assert!(matches!(wrong, HandEyeError::NoRadius { .. }), "{wrong}");
    }
    let few: Vec<Profile> = profiles.iter().filter(|p| p.sweep < 4).cloned().collect();
    assert_eq!(failed(&KNOWN, &few), HandEyeError::TooFewPoses { target: 0, found: 4, needed: 5 });
    assert_eq!(failed(&KNOWN, &[]), HandEyeError::TooFewPoses { target: 0, found: 0, needed: 5 });
    assert_eq!(failed(&[], &[]), HandEyeError::NoStart);
    assert_eq!(failed(&[], &few), HandEyeError::UnknownTarget { profile: 0, target: 0 });
    let mut broken = profiles.clone();
    broken[7].points_m[2][1] = f64::NAN;
    assert_eq!(failed(&KNOWN, &broken), HandEyeError::NotFinite { profile: 7 });
    let mut broken = profiles.clone();
    broken[9].base_from_palm.translation.vector.x = f64::INFINITY;
    assert_eq!(failed(&KNOWN, &broken), HandEyeError::NotFinite { profile: 9 });
    let mut flat = profiles.clone();
    flat.iter_mut().flat_map(|p| &mut p.points_m).for_each(|point| point[1] = 0.2);
    assert_eq!(failed(&KNOWN, &flat), HandEyeError::NoSphere { target: 0 });
    // A ball that rolled away between any two sweeps.
    let mut rolled = profiles;
    for profile in &mut rolled {
        let way = 0.01 * f64::from(profile.sweep % 5);
        profile.base_from_palm = Translation3::new(way, -0.5 * way, 0.0) * profile.base_from_palm;
    }
    let wrong = failed(&KNOWN, &rolled);
    assert!(matches!(wrong, HandEyeError::Inconsistent { .. }), "{wrong}");
}

#[test]
fn an_independent_ball_shows_whether_a_mount_is_right() {
    let mut rng = rng(4);
    let mount = moved_mount(&mut rng, 0.02, 0.2);
    let found = calibrate_mount(&KNOWN, &ball(&mount, &VIEWS, &mut rng), None).unwrap();
    let other = Located::Sphere { center_m: Point3::new(0.38, 0.05, 0.03), radius_m: 0.0127 };
    let views = Views { sweeps: 6, outlier_share: 0.02, ..VIEWS };
    let profiles = sweeps(3, &other, &Point3::new(0.38, 0.05, 0.03), &mount, &views, &mut rng);
    for known in [None, Some(0.0127)] {
        let good = verify(&profiles, known, &found.palm_from_scanner).unwrap();
        println!("{:?} centres {:.4} mm", good, good.center_rms_m() * 1e3);
        assert!(good.rms_m < 6e-5 && good.center_rms_m() < 5e-5);
        assert!((good.radius_m - 0.0127).abs() < 5.0 * good.radius_std_m + 5e-6);
        assert!((good.center_m - Point3::new(0.38, 0.05, 0.03)).norm() < 5e-5);
        assert_eq!(good.center_offsets_m.len(), 6);
    }
    let mut bad = found.palm_from_scanner;
    bad.translation.vector.y += 0.0005;
    let bad = verify(&profiles, Some(0.0127), &bad).unwrap();
    assert!(bad.center_rms_m() > 2e-4 && bad.rms_m > 1e-4, "{bad:?}");
    let one: Vec<Profile> = profiles.iter().filter(|p| p.sweep == 0).cloned().collect();
    assert!(matches!(verify(&one, None, &mount), Err(HandEyeError::TooFewPoses { needed: 2, .. })));
    assert!(matches!(verify(&[], None, &mount), Err(HandEyeError::TooFewPoses { found: 0, .. })));
}

#[test]
fn without_noise_the_mount_is_exact() {
    let mut rng = rng(5);
    let mount = any_mount(&mut rng);
    let profiles = ball(&mount, &Views { noise_m: 0.0, sweeps: 6, ..VIEWS }, &mut rng);
    let found = calibrate_mount(&KNOWN, &profiles, None).unwrap();
    let [shift_m, turn_rad] = off(&found.palm_from_scanner, &mount);
    assert!(shift_m < 1e-8 && turn_rad < 1e-7, "{shift_m} {turn_rad}");
}

#[test]
fn a_mount_goes_through_its_file() {
    let mut rng = rng(6);
    let mount = any_mount(&mut rng);
    let found =
        calibrate_mount(&KNOWN, &ball(&mount, &Views { sweeps: 6, ..VIEWS }, &mut rng), None).unwrap();
    let text = MountFile::of(&found).to_toml().unwrap();
    assert_eq!(MountFile::palm_from_scanner(&text), Ok(found.palm_from_scanner), "{text}");
    let wrong = |from: &str, to: &str| MountFile::palm_from_scanner(&text.replace(from, to)).unwrap_err();
    assert_eq!(wrong("version = 1", "version = 2"), MountFileError::Version { found: 2 });
    assert_eq!(wrong("m rad", "mm deg"), MountFileError::Units { found: "mm deg".to_owned() });
    assert!(matches!(wrong("position_m", "position_mm"), MountFileError::Toml { .. }));
    let start = text.find("orientation_wxyz = [").unwrap();
    let doubled = text[..start].to_owned() + "orientation_wxyz = [2.0, 0.0, 0.0, 0.0]\n";
    assert_eq!(MountFile::palm_from_scanner(&doubled), Err(MountFileError::NoPose));
    assert!(matches!(
        MountFile::palm_from_scanner("version = nan"),
        Err(MountFileError::Toml { line: 1, .. })
    ));
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
