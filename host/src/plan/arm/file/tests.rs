//! The built-in arm as a file, published arms, and files that are wrong.

use std::f64::consts::{FRAC_PI_2, TAU};

use nalgebra::{Isometry3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::plan::arm::{Inverse, Joints};

const RX60: &str = include_str!("../../../../../docs/arms/rx60.toml");

#[test]
fn the_rx60_as_a_file_is_the_built_in_one() {
    let (read, built_in) = (Arm::from_toml(RX60).unwrap(), Arm::rx60());
    let [a, b] = [&read, &built_in].map(|arm| arm.params().clone());
    assert_eq!((a.name, a.geometry, a.limits, a.load), (b.name, b.geometry, b.limits, b.load));
    assert_eq!((a.speed_rad_per_s, a.rest_rad), (b.speed_rad_per_s, b.rest_rad));
    for (a, b) in
        [(a.acceleration_rad_per_s2, b.acceleration_rad_per_s2), (a.jerk_rad_per_s3, b.jerk_rad_per_s3)]
    {
        assert!(a.iter().zip(&b).all(|(a, b)| (a / b - 1.0).abs() < 1e-15));
    }
    for (a, b) in a.capsules.iter().zip(&b.capsules) {
        assert!((a.from - b.from).norm() + (a.to - b.to).norm() < 1e-15 && a.radius_m == b.radius_m);
    }
    assert_eq!(read.flange_from_palm(), built_in.flange_from_palm());
}

/// A file with the least that an arm needs.
fn least(lengths: [f64; 7], offset_rad: Joints, sign: [f64; 6]) -> String {
    let [a1, a2, b, c1, c2, c3, c4] = lengths;
    format!(
        "name = \"x\"\n[geometry]\na1_m = {a1:?}\na2_m = {a2:?}\nb_m = {b:?}\nc1_m = {c1:?}\nc2_m = {c2:?}\n\
         c3_m = {c3:?}\nc4_m = {c4:?}\noffset_rad = {offset_rad:?}\nsign = {sign:?}\n\
         [axes]\nlower_deg = [-170, -170, -170, -270, -120, -350]\nupper_deg = [170, 170, 170, 270, 120, 350]\n\
         speed_deg_per_s = [200, 200, 200, 300, 300, 400]\n[load]\nmass_kg = [5, 5]\n"
    )
}

/// Parameter sets as published in the documentation of the crate rs-opw-kinematics 3.0.0, and the flange at joint
/// angles 0 by hand. For the IRB 2400 this is also the maker's drawing: 940 mm forward, 1455 mm up, pointing forward.
fn published() -> [(&'static str, String, Option<[f64; 3]>); 5] {
    let back3 = [0.0, 0.0, -FRAC_PI_2, 0.0, 0.0, 0.0];
    let back2 = [0.0, -FRAC_PI_2, 0.0, 0.0, 0.0, 0.0];
    let ones = [1.0; 6];
    [
        (
            "ABB IRB 2400/10",
            least([0.100, -0.135, 0.0, 0.615, 0.705, 0.755, 0.085], back3, ones),
            Some([0.940, 0.0, 1.455]),
        ),
        (
            "KUKA KR 6 R700 sixx",
            least([0.025, -0.035, 0.0, 0.400, 0.315, 0.365, 0.080], back2, [-1.0, 1.0, 1.0, -1.0, 1.0, -1.0]),
            Some([0.025 + 0.315 + 0.365 + 0.080, 0.0, 0.400 + 0.035]),
        ),
        ("ABB IRB 120", least([0.0, -0.070, 0.0, 0.290, 0.270, 0.302, 0.072], back3, ones), None),
        ("Fanuc R-2000iB/200R", least([0.720, -0.225, 0.0, 0.600, 1.075, 1.280, 0.235], back3, ones), None),
        ("Stäubli TX40", least([0.0, 0.0, 0.035, 0.320, 0.225, 0.225, 0.065], back3, ones), None),
    ]
}

#[test]
fn published_arms_come_back_from_forward_to_inverse() {
    for (name, text, at_zero) in published() {
        let arm = Arm::from_toml(&text).unwrap();
        if let Some([x, y, z]) = at_zero {
            let flange = arm.base_from_flange(&[0.0; 6]);
            assert!((flange.translation.vector - Vector3::new(x, y, z)).norm() < 1e-12, "{name}: {flange}");
            assert!(
                ((flange.rotation * Vector3::z()) - Vector3::x()).norm() < 1e-12,
                "{name} points forward"
            );
        }
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut regular = 0;
        for _ in 0..2_000 {
            let limits = arm.limits();
            let q: Joints =
                std::array::from_fn(|i| rng.random_range(limits.lower_rad[i]..limits.upper_rad[i]));
            let pose = arm.base_from_palm(&q);
            assert!(arm.reaches_palm(&pose), "{name}: {q:?}");
            let Inverse::Solutions(near) = arm.palm_solutions_near(&pose, &q) else {
                panic!("{name}: {q:?}")
            };
            for solution in near.iter() {
                let back: Isometry3<f64> = arm.base_from_palm(&solution.q_rad);
                assert!((back.translation.vector - pose.translation.vector).norm() < 5e-9);
                assert!(back.rotation.angle_to(&pose.rotation) < 1e-6);
            }
            let turned = |a: &Joints| {
                (0..6).map(|i| (a[i] - q[i] - TAU * ((a[i] - q[i]) / TAU).round()).abs()).fold(0.0, f64::max)
            };
            let margin = arm.margin(&q);
            if margin.wrist.min(margin.elbow).min(margin.shoulder) > 1e-3 {
                regular += 1;
                assert!(turned(&near[0].q_rad) < 1e-6, "{name}: {q:?}");
            }
        }
        assert!(regular > 1_900);
    }
}

#[test]
fn what_a_file_leaves_out_is_assumed() {
    let (_, text, _) = published().into_iter().next().unwrap();
    let arm = Arm::from_toml(&text).unwrap();
    let params = arm.params();
    assert!((params.acceleration_rad_per_s2[0] - 200f64.to_radians() / 0.3).abs() < 1e-12);
    assert!((params.jerk_rad_per_s3[0] - 200f64.to_radians() / 0.03).abs() < 1e-9);
    assert_eq!(arm.flange_from_palm(), Arm::rx60().flange_from_palm());
    assert!(arm.limits().check(&params.rest_rad).is_inside());
    // Radii of the RX60 times the ratio of the lengths.
    let scale = (0.705 + 0.135_f64.hypot(0.755)) / 0.6;
    assert!((arm.link_capsules()[2].radius_m - 0.094 * scale).abs() < 1e-12);
    assert!(!arm.self_pairs().is_empty());
    assert!(arm.self_pairs().iter().all(|&(i, k)| {
        let capsules = arm.link_capsules();
        capsules[k].link > capsules[i].link + 1
    }));
}

#[test]
fn every_mistake_is_named_by_key_and_value() {
    let without = |key: &str| {
        let kept: Vec<&str> = RX60.lines().filter(|line| !line.starts_with(key)).collect();
        kept.join("\n")
    };
    let with = |from: &str, to: &str| {
        assert!(RX60.contains(from), "{from}");
        RX60.replacen(from, to, 1)
    };
    let cases = [
        (String::new(), "name is missing"),
        (without("c2_m"), "geometry.c2_m is missing"),
        (without("lower_deg"), "axes.lower_deg (or lower_rad) is missing"),
        (without("speed_deg"), "axes.speed_deg_per_s (or speed_rad_per_s) is missing"),
        (without("mass_kg"), "load.mass_kg is missing"),
        (with("[load]", "[lode]"), "load is missing"),
        (with("c2_m", "c2"), "geometry.c2_m is missing"),
        (with("b_m = 0.049", "b_m = 0.049\nb = 1"), "geometry.b is not a key that an arm has"),
        (with("name =", "nick = 1\nname ="), "nick is not a key that an arm has"),
        (with("reduced_speed = 0.6", "reduced_speed = 0.6\nmode = 1"), "load.mode is not a key"),
        (with("b_m = 0.049", "b_m = \"wide\""), "geometry.b_m is \"wide\", not a number"),
        (with("b_m = 0.049", "b_m = nan"), "geometry.b_m holds NaN, not a finite number"),
        (with("c4_m = 0.065", "c4_m = inf"), "geometry.c4_m holds inf"),
        (with("c2_m = 0.290", "c2_m = -0.290"), "c2_m is -0.29, but has to be greater than zero"),
        (with("700]", "700, 1]"), "axes.speed_deg_per_s has 7 value(s), not 6"),
        (with("287, 287", "0, 287"), "speed_rad_per_s is 0, but has to be greater than zero"),
        (with("[-160,", "[161,"), "axis 1 has its lower limit 2.8"),
        (with("rest_rad = [0.0,", "rest_rad = [3.0,"), "the rest posture has axis 1 at 3 rad"),
        (with("rest_rad", "lower_rad"), "axes.lower_deg and axes.lower_rad are both there"),
        (with("c1_m = 0.341", "c1_m = 0.341\nsign = [1, 1, 1, 1, 2, 1]"), "the sign of axis 5 is 2"),
        (with("mass_kg = [2.5, 4.5]", "mass_kg = [2.5, 1.5]"), "load.mass_kg is 1.5, but has to be at least"),
        (with("mass_kg = [2.5, 4.5]", "mass_kg = 2.5"), "load.mass_kg is 2.5, not a list of numbers"),
        (with("mass_kg = [2.5, 4.5]", "mass_kg = [-1, 4.5]"), "load.mass_kg is -1"),
        (with("reduced_speed = 0.6", "reduced_speed = 1.6"), "load.reduced_speed is 1.6"),
        (with("axis6_torque_nm = 3.5", "axis6_torque_nm = 0"), "load.axis6_torque_nm is 0"),
        (with("[0.0, 0.0, 0.020]", "[0.0, 0.020]"), "flange_from_palm.position_m has 2 value(s), not 3"),
        (
            with("position_m", "orientation_wxyz = [1, 1, 0, 0]\nposition_m"),
            "flange_from_palm.orientation_wxyz is 1.414",
        ),
        (with("link = 3", "link = 7"), "capsule 4: link is 7, but has to be 0 (the base) to 6"),
        (with("link = 3", "link = 2.5"), "capsule 4: link is 2.5"),
        (with("radius_m = 0.115", "radius_m = -1"), "capsule 1: radius_m is -1"),
        (with("radius_m = 0.115", ""), "capsule 1: radius_m is missing"),
        (with("[axes]", "[axes"), "line 14: "),
        (with("name = \"Stäubli RX60\"", "name = 7"), "name is 7, not a text"),
        (with("[geometry]", "[geometry]\na1_m = 1"), "line 7: duplicate key"),
        ("geometry = 3\nname = \"x\"".to_owned(), "geometry is 3, not a table"),
    ];
    for (text, message) in cases {
        let error = Arm::from_toml(&text).unwrap_err().to_string();
        assert!(error.starts_with(message), "{error:?} for {message:?}");
        assert!(!error.contains('\n'));
    }
}
