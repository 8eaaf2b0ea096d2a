//! Limits by dense sampling, and times against closed forms.

use nalgebra::Isometry3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::plan::arm::{LineOutcome, LoadQuantity};

fn reduced() -> MotionLimits {
    let mode = LoadMode::Reduced { because: LoadQuantity::Axis5Inertia };
    MotionLimits::for_load(&Arm::rx60(), &mode).unwrap()
}

const CORNERS: Shape = Shape::Rounded { corner_rad: 0.02 };

/// Samples a motion at 20 kHz: limits of speed, acceleration and jerk, the latter two also by differences that know
/// nothing of the trajectory's own derivatives; that speed is the derivative of the angle, and that the acceleration is
/// continuous and vanishes at both ends.
fn assert_keeps_limits(trajectory: &JointTrajectory, limits: &MotionLimits) {
    let h = trajectory.duration_s() / (trajectory.duration_s() * 20_000.0).ceil();
    let count = (trajectory.duration_s() / h).round() as usize;
    for k in 1..count {
        let t = h * k as f64;
        let [before, here, after] = [t - h, t, t + h].map(|t| trajectory.sample(t));
        for i in 0..6 {
            let (speed, acceleration) = (limits.speed_rad_per_s[i], limits.acceleration_rad_per_s2[i]);
            let jerk = limits.jerk_rad_per_s3[i];
            assert!(here.qd_rad_per_s[i].abs() <= speed * (1.0 + 1e-9));
            assert!(here.qdd_rad_per_s2[i].abs() <= acceleration * (1.0 + 1e-8));
            let slope = (after.q_rad[i] - before.q_rad[i]) / (2.0 * h);
            assert!((slope - here.qd_rad_per_s[i]).abs() <= jerk * h * h, "{t} s, axis {}", i + 1);
            let second = (after.q_rad[i] - 2.0 * here.q_rad[i] + before.q_rad[i]) / (h * h);
            assert!(second.abs() <= acceleration * (1.0 + 1e-4) + 1e-6, "{t} s, axis {}: {second}", i + 1);
            let change = (after.qdd_rad_per_s2[i] - here.qdd_rad_per_s2[i]) / h;
            assert!(change.abs() <= jerk * (1.0 + 1e-6) + 1e-5, "{t} s, axis {}: {change}", i + 1);
        }
    }
    for end in [0.0, trajectory.duration_s()] {
        assert_eq!(trajectory.sample(end).qd_rad_per_s, [0.0; 6]);
        let inside = trajectory.sample((end - 1e-9).abs());
        (0..6).for_each(|i| {
            assert!(inside.qdd_rad_per_s2[i].abs() <= 1e-5 * limits.acceleration_rad_per_s2[i])
        });
    }
}

#[test]
fn reduced_mode_scales_the_nominal_limits_and_no_motion_is_allowed_beyond() {
    let arm = Arm::rx60();
    let nominal = MotionLimits::for_load(&arm, &LoadMode::Nominal).unwrap();
    assert_eq!(nominal.speed_rad_per_s, arm.params().speed_rad_per_s);
    assert!((reduced().speed_rad_per_s[0] - 0.6 * 287.0_f64.to_radians()).abs() < 1e-12);
    assert!((reduced().acceleration_rad_per_s2[0] - 0.3 * 287.0_f64.to_radians() / 0.3).abs() < 1e-12);
    assert_eq!(MotionLimits::for_load(&arm, &LoadMode::Exceeded { because: LoadQuantity::Mass }), None);
    assert_eq!(MotionLimits::for_load(&arm, &LoadMode::Invalid), None);
}

#[test]
fn one_joint_takes_the_time_of_the_s_curve() {
    let limits = reduced();
    let (v, a, j) = (limits.speed_rad_per_s[0], limits.acceleration_rad_per_s2[0], limits.jerk_rad_per_s3[0]);
    // Rest-to-rest times of a jerk-limited motion (e.g. Biagiotti and Melchiorri 2008, section 3.4). The first reaches
    // full speed, the second full acceleration only, the third not even that.
    let full = 2.8;
    let accelerating = 0.9;
    let short = 0.01;
    assert!(full > v * (v / a + a / j) && v * (v / a + a / j) > accelerating);
    assert!(accelerating > 2.0 * a.powi(3) / (j * j) && 2.0 * a.powi(3) / (j * j) > short);
    for (angle, time_s, slower) in [
        (full, full / v + v / a + a / j, 0.02),
        (accelerating, a / j + ((a / j).powi(2) + 4.0 * accelerating / a).sqrt(), 0.04),
        (short, 4.0 * (short / (2.0 * j)).cbrt(), 0.10),
    ] {
        let path = [[0.0; 6], [angle, 0.0, 0.0, 0.0, 0.0, 0.0]];
        let trajectory = time_path(&path, &limits, CORNERS, None).unwrap();
        assert_keeps_limits(&trajectory, &limits);
        let ratio = trajectory.duration_s() / time_s;
        println!("{ratio}");
        assert!(ratio >= 1.0 - 1e-9 && ratio < 1.0 + slower, "{angle} rad: {ratio}");
    }
}

#[test]
fn a_jerk_without_limit_gives_the_trapezoid() {
    let limits = MotionLimits { jerk_rad_per_s3: [1e7; 6], ..reduced() };
    let (v, a) = (limits.speed_rad_per_s[0], limits.acceleration_rad_per_s2[0]);
    for (angle, time_s) in [(0.1, 2.0 * (0.1_f64 / a).sqrt()), (2.5, 2.5 / v + v / a)] {
        let path = [[0.0; 6], [angle, 0.0, 0.0, 0.0, 0.0, 0.0]];
        let trajectory = time_path(&path, &limits, CORNERS, None).unwrap();
        assert_keeps_limits(&trajectory, &limits);
        let ratio = trajectory.duration_s() / time_s;
        assert!((1.0 - 1e-9..1.02).contains(&ratio), "{ratio}");
    }
}

#[test]
fn a_motion_of_constant_jerks_has_few_knots() {
    let limits = reduced();
    let trajectory = time_path(&[[0.0; 6], [2.8, 1.0, 0.0, 0.0, 0.0, 0.0]], &limits, CORNERS, None).unwrap();
    assert!(trajectory.knots().len() < 100, "{}", trajectory.knots().len());
}

#[test]
fn random_paths_keep_every_limit_and_reach_their_ends() {
    let limits = reduced();
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    for points in [2, 3, 3, 4, 6, 9, 20] {
        let path: Vec<Joints> =
            (0..points).map(|_| std::array::from_fn(|_| rng.random_range(-1.5..1.5))).collect();
        let trajectory = time_path(&path, &limits, CORNERS, None).unwrap();
        assert_keeps_limits(&trajectory, &limits);
        assert_eq!(trajectory.knots()[0].q_rad, path[0]);
        let end = trajectory.knots().last().unwrap().q_rad;
        assert!((0..6).all(|i| (end[i] - path[points - 1][i]).abs() < 1e-12));
    }
}

#[test]
fn there_and_back_turns_round_before_the_corner() {
    let limits = reduced();
    let far = [0.8, -0.4, 0.0, 0.0, 0.0, 0.3];
    let trajectory =
        time_path(&[[0.0; 6], far, [0.0; 6]], &limits, Shape::Rounded { corner_rad: 0.01 }, None).unwrap();
    assert_keeps_limits(&trajectory, &limits);
    let farthest = trajectory.knots().iter().map(|knot| knot.q_rad[0]).fold(0.0, f64::max);
    assert!(farthest > 0.79 && farthest < 0.8);
}

#[test]
fn the_approach_line_keeps_the_speed_of_the_point() {
    let arm = Arm::rx60();
    let ready = [0.1, 0.4, 1.6, 0.2, 1.1, -0.3];
    let from = arm.base_from_palm(&ready);
    let to = Isometry3::translation(0.0, 0.0, -0.12) * from;
    let LineOutcome::Path(path) = arm.straight_line(&from, &to, &ready, 0.002, 0.02) else {
        panic!("the line is within reach");
    };
    let limits = reduced();
    let palm = |q: &Joints| Point3::from(arm.base_from_palm(q).translation.vector);
    let free = time_path(&path, &limits, Shape::Through, None).unwrap();
    let capped = PointSpeed { point: &palm, limit_m_per_s: 0.05 };
    let slow = time_path(&path, &limits, Shape::Through, Some(capped)).unwrap();
    for trajectory in [&free, &slow] {
        assert_keeps_limits(trajectory, &limits);
    }
    let mut fastest: f64 = 0.0;
    let count = (slow.duration_s() * 1_000.0) as usize;
    for k in 0..count {
        let [a, b] = [k, k + 1].map(|k| palm(&slow.sample(0.001 * k as f64).q_rad));
        fastest = fastest.max((b - a).norm() / 0.001);
        let off = (b.coords - from.translation.vector).xy().norm();
        assert!(off < 2e-5, "{off} m beside the line");
    }
    assert!(fastest < 0.05 * 1.001 && fastest > 0.05 * 0.98, "{fastest} m/s");
    assert!(slow.duration_s() > 0.12 / 0.05 && slow.duration_s() < 0.12 / 0.05 + 0.4);
    assert!(free.duration_s() < 0.5 * slow.duration_s());
}

#[test]
fn tiny_and_empty_motions_are_no_special_case() {
    let limits = reduced();
    for angle in [1e-3, 1e-5, 2e-6] {
        let trajectory = time_path(&[[0.0; 6], [angle; 6]], &limits, CORNERS, None).unwrap();
        assert!(trajectory.duration_s() > 0.0);
        assert_keeps_limits(&trajectory, &limits);
    }
    let rest = time_path(&[[0.3; 6], [0.3; 6]], &limits, CORNERS, None).unwrap();
    assert_eq!((rest.duration_s(), rest.sample(0.0).q_rad), (0.0, [0.3; 6]));
}

#[test]
fn extreme_limits_end_in_a_motion_or_an_error_but_never_in_a_panic() {
    let path = [[0.0; 6], [1.0; 6], [0.5; 6]];
    for limit in [1e-300, 1e-9, 1e9, 1e300] {
        let limits = MotionLimits {
            speed_rad_per_s: [limit; 6],
            acceleration_rad_per_s2: [limit; 6],
            jerk_rad_per_s3: [limit; 6],
        };
        for corner_rad in [1e-300, 1e-9, 1e9] {
            if let Ok(trajectory) = time_path(&path, &limits, Shape::Rounded { corner_rad }, None) {
                assert!(trajectory.duration_s() > 0.0 && trajectory.duration_s().is_finite());
            }
        }
    }
}

#[test]
fn bad_input_is_named() {
    let limits = reduced();
    let path = [[0.0; 6], [1.0; 6]];
    assert_eq!(time_path(&[], &limits, CORNERS, None), Err(TimingError::Empty));
    for bad in [f64::NAN, f64::INFINITY, -101.0] {
        let error =
            time_path(&[[0.0; 6], [0.0, 0.0, bad, 0.0, 0.0, 0.0]], &limits, CORNERS, None).unwrap_err();
        assert!(error.to_string().starts_with("point 1 of the path has a joint angle of "), "{error}");
    }
    let corner = Err(TimingError::Limit { name: "corner", value: 0.0 });
    assert_eq!(time_path(&path, &limits, Shape::Rounded { corner_rad: 0.0 }, None), corner);
    let stuck = MotionLimits { speed_rad_per_s: [0.0; 6], ..limits };
    assert_eq!(
        time_path(&path, &stuck, CORNERS, None),
        Err(TimingError::Limit { name: "speed", value: 0.0 })
    );
    let nowhere = |_: &Joints| Point3::new(f64::NAN, 0.0, 0.0);
    let cap = Some(PointSpeed { point: &nowhere, limit_m_per_s: 0.1 });
    assert_eq!(time_path(&path, &limits, CORNERS, cap), Err(TimingError::Position { point: 0 }));
}
