//! Against an independent matrix product, and over random and singular poses.

use std::f64::consts::{PI, TAU};

use nalgebra::{Isometry3, Matrix4, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;

/// The RX60 as modified (Craig) DH rows `(alpha, a, d, theta offset)`, angles in degrees; the same arm from another
/// description.
const RX60_DH: [(f64, f64, f64, f64); 6] = [
    (0.0, 0.0, 0.341, 0.0),
    (-90.0, 0.0, 0.0, -90.0),
    (0.0, 0.290, 0.049, 90.0),
    (90.0, 0.0, 0.310, 0.0),
    (-90.0, 0.0, 0.0, 0.0),
    (90.0, 0.0, 0.065, 0.0),
];

fn dh_forward(q: &Joints) -> Matrix4<f64> {
    RX60_DH.iter().zip(q).fold(Matrix4::identity(), |m, (&(alpha, a, d, offset), q)| {
        let (sa, ca) = alpha.to_radians().sin_cos();
        let (st, ct) = (q + offset.to_radians()).sin_cos();
        m * Matrix4::new(
            ct,
            -st,
            0.0,
            a, //
            st * ca,
            ct * ca,
            -sa,
            -sa * d, //
            st * sa,
            ct * sa,
            ca,
            ca * d, //
            0.0,
            0.0,
            0.0,
            1.0,
        )
    })
}

fn random_joints(rng: &mut ChaCha8Rng, limits: &JointLimits) -> Joints {
    std::array::from_fn(|i| rng.random_range(limits.lower_rad[i]..limits.upper_rad[i]))
}

fn pose_error(a: &Isometry3<f64>, b: &Isometry3<f64>) -> (f64, f64) {
    let position_m = (a.translation.vector - b.translation.vector).norm();
    // The angle from the vector part: `acos` of a cosine near one would hide errors below 1e-8.
    let rotation_rad = 2.0 * (a.rotation.inverse() * b.rotation).imag().norm();
    (position_m, rotation_rad)
}

fn solutions(outcome: Inverse) -> Solutions {
    match outcome {
        Inverse::Solutions(solutions) => solutions,
        other => panic!("{other:?}"),
    }
}

fn assert_reaches(arm: &Arm, solution: &Solution, pose: &Isometry3<f64>) {
    let (position_m, rotation_rad) = pose_error(&arm.base_from_flange(&solution.q_rad), pose);
    assert!(position_m <= 2e-9 && rotation_rad <= 1e-9, "{solution:?}: {position_m} m, {rotation_rad} rad");
}

#[test]
fn zero_pose_stands_straight_up() {
    let pose = Arm::rx60().base_from_flange(&[0.0; 6]);
    assert!((pose.translation.vector - Vector3::new(0.0, 0.049, 1.006)).norm() < 1e-15);
    assert_eq!(pose.rotation, UnitQuaternion::identity());
    let palm = Arm::rx60().base_from_palm(&[0.0; 6]);
    assert!((palm.translation.vector - Vector3::new(0.0, 0.049, 1.026)).norm() < 1e-15);
}

#[test]
fn forward_agrees_with_the_dh_product() {
    let arm = Arm::rx60();
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    for _ in 0..2_000 {
        let q = random_joints(&mut rng, arm.limits());
        let error = (arm.base_from_flange(&q).to_homogeneous() - dh_forward(&q)).abs().max();
        assert!(error < 5e-15, "{q:?}: {error}");
    }
}

#[test]
fn link_origins_keep_their_distances() {
    let arm = Arm::rx60();
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    for _ in 0..100 {
        let frames = arm.link_frames(&random_joints(&mut rng, arm.limits()));
        let origin = |i: usize| frames[i].translation.vector;
        assert!((origin(0) - Vector3::new(0.0, 0.0, 0.341)).norm() < 1e-15);
        assert!(((origin(2) - origin(1)).norm() - 0.049_f64.hypot(0.290)).abs() < 1e-15);
        assert!(((origin(3) - origin(2)).norm() - 0.310).abs() < 1e-15);
        assert!((origin(4) - origin(3)).norm() < 1e-15);
        assert!(((origin(5) - origin(4)).norm() - 0.065).abs() < 1e-15);
    }
}

#[test]
fn every_solution_of_random_poses_maps_back_and_one_is_where_the_pose_came_from() {
    let arm = Arm::rx60();
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let (mut regular, mut worst) = (0, [0.0_f64; 3]);
    for _ in 0..20_000 {
        let q = random_joints(&mut rng, arm.limits());
        let pose = arm.base_from_flange(&q);
        // Seeded elsewhere, so that whole turns are not given away.
        let all = solutions(arm.inverse(&pose, &[0.0; 6]));
        for solution in all.iter() {
            let (position_m, rotation_rad) = pose_error(&arm.base_from_flange(&solution.q_rad), &pose);
            worst = [worst[0].max(position_m), worst[1].max(rotation_rad), worst[2]];
        }
        if q[2].sin().abs() > 1e-3 && q[4].sin().abs() > 1e-3 {
            regular += 1;
            assert_eq!(all.len(), 8, "{q:?}");
            let nearest = all.iter().map(|s| {
                let turned =
                    s.q_rad.iter().zip(&q).map(|(a, b)| (a - b - TAU * ((a - b) / TAU).round()).abs());
                turned.fold(0.0, f64::max)
            });
            worst[2] = worst[2].max(nearest.fold(f64::INFINITY, f64::min));
        }
        // Seeded with itself, the configuration comes first, in its own turns.
        let near = solutions(arm.solutions_near(&pose, &q));
        assert!(near[0].distance_rad(&q) < 1e-6, "{q:?}");
    }
    assert!(regular > 19_000);
    assert!(worst.iter().all(|&error| error <= 1e-9), "m, rad, joint rad: {worst:?}");
}

#[test]
fn solutions_inside_the_limits_come_sorted_and_inside() {
    let arm = Arm::rx60();
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    for _ in 0..500 {
        let pose = arm.base_from_flange(&random_joints(&mut rng, arm.limits()));
        let seed = random_joints(&mut rng, arm.limits());
        let near = solutions(arm.solutions_near(&pose, &seed));
        assert!(near.iter().all(|s| arm.limits().check(&s.q_rad).is_inside()));
        assert!(near.is_sorted_by_key(|s| s.distance_rad(&seed)));
    }
}

/// An arm with every length and convention different from zero: the formulas must not lean on the RX60's zeros.
fn crooked_arm() -> Arm {
    let geometry = OpwGeometry {
        a1_m: 0.16,
        a2_m: -0.11,
        b_m: -0.03,
        c1_m: 0.45,
        c2_m: 0.60,
        c3_m: 0.64,
        c4_m: 0.10,
        offset_rad: [0.1, -0.2, 0.3, 0.0, -0.1, PI],
        sign: [1.0, -1.0, 1.0, -1.0, 1.0, -1.0],
    };
    Arm::new(ArmParams { geometry, ..ArmParams::rx60() }).unwrap()
}

#[test]
fn a_general_arm_recovers_its_poses() {
    let arm = crooked_arm();
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    for _ in 0..5_000 {
        let q = random_joints(&mut rng, arm.limits());
        let pose = arm.base_from_flange(&q);
        let all = solutions(arm.inverse(&pose, &q));
        assert!(all.len() == 8 || all.len() == 4, "{}", all.len());
        all.iter().for_each(|solution| assert_reaches(&arm, solution, &pose));
        assert!(all.iter().any(|s| s.distance_rad(&q) < 1e-7), "{q:?}");
    }
}

/// The flange pointing along +x with its wrist centre at a point.
fn wrist_center_at(x: f64, y: f64, z: f64) -> Isometry3<f64> {
    let rotation = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), PI / 2.0);
    Isometry3::from_parts(Translation3::new(x + 0.065, y, z), rotation)
}

#[test]
fn unreachable_poses_are_named() {
    let arm = Arm::rx60();
    let outcome = |x, y, z| arm.solutions_near(&wrist_center_at(x, y, z), &[0.0; 6]);
    for (x, y) in [(0.0, 0.0), (0.0, 0.0489), (-0.03, 0.03), (0.049, 0.0)] {
        assert!(matches!(outcome(x, y, 0.6), Inverse::ShoulderSingular { least_m: 0.049, .. }), "{x} {y}");
    }
    assert!(matches!(outcome(0.0, 0.0491, 0.7), Inverse::Solutions(_)));
    let in_plane = |forward: f64| (forward * forward + 0.049 * 0.049_f64).sqrt();
    match outcome(in_plane(0.601), 0.0, 0.341) {
        Inverse::OutOfReach { distance_m, greatest_m, .. } => {
            assert!((distance_m - 0.601).abs() < 1e-12 && greatest_m == 0.600);
        }
        other => panic!("{other:?}"),
    }
    assert!(matches!(outcome(in_plane(0.019), 0.0, 0.341), Inverse::OutOfReach { .. }));
    // Between 20 and 233 mm the lengths would allow it, but axis 3 does not bend so far.
    match outcome(in_plane(0.230), 0.0, 0.341) {
        Inverse::OutsideLimits { axis: 3, excess_rad } => assert!(excess_rad > 0.0 && excess_rad < 0.05),
        other => panic!("{other:?}"),
    }
    assert!(matches!(outcome(in_plane(0.234), 0.0, 0.341), Inverse::Solutions(_)));
}

#[test]
fn singular_configurations_have_fewer_solutions_that_all_reach() {
    let arm = Arm::rx60();
    // (configuration, solutions, elbow, wrist): arm stretched, wrist straight, both, and nearly so.
    let cases: [(Joints, usize, bool, bool); 6] = [
        ([0.3, 0.9, 0.0, 0.4, 0.7, -0.5], 4, true, false),
        ([0.3, 0.4, 1.1, 0.4, 0.0, -0.5], 7, false, true),
        ([0.3, 0.9, 0.0, 0.4, 0.0, -0.5], 3, true, true),
        ([0.3, 0.9, 1e-9, 0.4, 0.7, -0.5], 4, true, false),
        ([0.3, 0.4, 1.1, 0.4, 1e-11, -0.5], 7, false, true),
        ([0.3, 0.4, 1.1, 0.4, 1e-7, -0.5], 8, false, false),
    ];
    for (q, count, straight, free) in cases {
        let pose = arm.base_from_flange(&q);
        let seed = [0.0, 0.0, 0.0, -0.8, 0.0, 0.0];
        let all = solutions(arm.inverse(&pose, &seed));
        assert_eq!(all.len(), count, "{q:?}");
        all.iter().for_each(|solution| assert_reaches(&arm, solution, &pose));
        assert_eq!(all.iter().any(|s| s.branch.elbow == Elbow::Straight), straight, "{q:?}");
        let frees = all.iter().filter(|s| s.branch.wrist == Wrist::Free);
        assert_eq!(frees.clone().count() > 0, free, "{q:?}");
        frees.for_each(|s| assert!((s.q_rad[3] + 0.8).abs() < 1e-12));
    }
}

#[test]
fn numbers_that_are_none_are_an_outcome() {
    let arm = Arm::rx60();
    for bad in [f64::NAN, f64::INFINITY] {
        let pose = Isometry3::translation(bad, 0.0, 0.5);
        assert_eq!(arm.inverse(&pose, &[0.0; 6]), Inverse::NotFinite);
        assert_eq!(arm.solutions_near(&wrist_center_at(0.4, 0.0, 0.4), &[bad; 6]), Inverse::NotFinite);
        assert!(matches!(arm.limits().check(&[bad; 6]), LimitCheck::Outside { axis: 1, .. }));
    }
    let nan_rotation = Isometry3::rotation(Vector3::new(0.0, f64::NAN, 0.0));
    assert_eq!(arm.inverse(&nan_rotation, &[0.0; 6]), Inverse::NotFinite);
    assert!(!arm.base_from_flange(&[f64::NAN; 6]).translation.vector.x.is_finite());
}

#[test]
fn a_joint_with_more_than_a_turn_stays_near_the_seed() {
    let arm = Arm::rx60();
    let q = [0.2, 0.5, 1.0, 250.0_f64.to_radians(), 0.6, -260.0_f64.to_radians()];
    let pose = arm.base_from_flange(&q);
    let near = solutions(arm.solutions_near(&pose, &q));
    assert!(near[0].distance_rad(&q) < 1e-9);
    let from_zero = solutions(arm.solutions_near(&pose, &[0.0; 6]));
    assert!(from_zero.iter().all(|s| s.q_rad[3].abs() <= PI + 1e-9 && s.q_rad[5].abs() <= PI + 1e-9));
}

#[test]
fn limits_name_the_worst_joint() {
    let arm = Arm::rx60();
    let mut q = [0.0; 6];
    assert!(arm.limits().check(&q).is_inside());
    q[4] = -115.0_f64.to_radians();
    q[1] = 128.0_f64.to_radians();
    match arm.limits().check(&q) {
        LimitCheck::Outside { axis: 5, excess_rad } => {
            assert!((excess_rad - 5.5_f64.to_radians()).abs() < 1e-12)
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn rx60_passes_its_own_check_and_bad_parameters_do_not() {
    assert_eq!(Arm::new(ArmParams::rx60()), Ok(Arm::rx60()));
    let broken = |change: fn(&mut ArmParams)| {
        let mut params = ArmParams::rx60();
        change(&mut params);
        Arm::new(params).unwrap_err()
    };
    assert_eq!(broken(|p| p.geometry.c2_m = 0.0), ArmError::NotPositive { name: "c2_m", value: 0.0 });
    assert!(matches!(broken(|p| p.geometry.b_m = f64::NAN), ArmError::NotFinite { name: "b_m", .. }));
    assert_eq!(broken(|p| p.geometry.sign[2] = 0.5), ArmError::Sign { axis: 3, value: 0.5 });
    assert!(matches!(broken(|p| p.limits.lower_rad[5] = 9.0), ArmError::Limits { axis: 6, .. }));
}

#[test]
fn bodies_lie_along_their_links() {
    let arm = Arm::rx60();
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    let frames = arm.link_frames(&random_joints(&mut rng, arm.limits()));
    let placed = |link: usize| {
        let capsule = arm.link_capsules().iter().find(|c| c.link == link).unwrap();
        [capsule.from, capsule.to].map(|p| (frames[link - 1] * p).coords)
    };
    let [axis2, elbow, wrist, flange] = [1, 2, 3, 5].map(|i| frames[i].translation.vector);
    let [from, to] = placed(2);
    assert!(((to - from) - (frames[1].rotation * Vector3::z() * 0.290)).norm() < 1e-12);
    assert!(((from - axis2).norm() - 0.15225).abs() < 1e-12);
    let [from, to] = placed(3);
    assert!((from - elbow).norm() < 1e-12 && (to - from).cross(&(wrist - elbow)).norm() < 1e-12);
    // The last one ends flush with the flange.
    let [from, to] = placed(5);
    assert!((from - wrist).norm() < 1e-12 && ((flange - to).norm() - 0.035).abs() < 1e-12);
    assert!(
        arm.link_capsules().is_sorted_by_key(|c| c.link) && arm.link_capsules().iter().all(|c| c.link <= 6)
    );
}
