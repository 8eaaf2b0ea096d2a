//! Ways on scenes of boxes, looked at again by a check of its own: points on capsules, balls and corners, one by one.

use nalgebra::{Translation3, Unit, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::*;
use crate::hand::Hand;
use crate::object::solids::cuboid;
use crate::plan::arm::ArmParams;
use crate::plan::obstacles::Body;
use crate::plan::preshape::Preshape;
use crate::surface::Mesh;

/// A scene with a box (or any mesh about the origin, standing on z = 0) at a place on the table.
fn scene_with(mesh: Mesh, x: f64, y: f64) -> Scene {
    Scene::new(mesh, Isometry3::translation(x, y, 0.0), Some(0.0), Some(Arm::rx60())).unwrap()
}

fn box_scene(sides_m: [f64; 3], x: f64, y: f64) -> Scene {
    let mesh = cuboid(sides_m).unwrap().transformed(&Isometry3::translation(0.0, 0.0, 0.5 * sides_m[2]));
    scene_with(mesh, x, y)
}

/// The palm hanging over a point of the base frame, turned about the vertical and tilted.
fn hanging(at: [f64; 3], yaw_rad: f64, tilt_rad: f64) -> Isometry3<f64> {
    let down = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    let turned = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw_rad)
        * UnitQuaternion::from_axis_angle(&Vector3::y_axis(), tilt_rad)
        * down;
    Isometry3::from_parts(Translation3::new(at[0], at[1], at[2]), turned)
}

/// The site with the palm at a pose of the base frame, reached along palm z.
fn site(scene: &Scene, base_from_palm: &Isometry3<f64>) -> Site {
    let object_from_palm = scene.base_from_object.inverse() * base_from_palm;
    Site {
        object_from_palm,
        direction_in_object: Unit::new_normalize(object_from_palm * Vector3::z()),
        preshape: Preshape::at_fraction(&scene.hand, &scene.hand.candidates[0], 0.0),
    }
}

fn open(hand: &Hand) -> Posture {
    hand.candidates[0].posture_at(&hand.joints, 0.0)
}

/// What went wrong; nothing when there is a way.
fn failure(scene: &Scene, site: &Site, object_kg: f64, start_rad: Joints) -> Option<MotionError> {
    plan(scene, site, object_kg, start_rad).err()
}

fn plan(scene: &Scene, site: &Site, object_kg: f64, start_rad: Joints) -> Result<ArmMotion, MotionError> {
    plan_with(&Arm::rx60(), scene, site, object_kg, start_rad)
}

fn plan_with(
    arm: &Arm,
    scene: &Scene,
    site: &Site,
    object_kg: f64,
    start_rad: Joints,
) -> Result<ArmMotion, MotionError> {
    let open = open(&scene.hand);
    let request = MotionRequest { site, open: &open, closed: &open, object_kg, start_rad, seed: 1 };
    arm_motion(scene, arm, &request)
}

fn rest() -> Joints {
    ArmParams::rx60().rest_rad
}

/// Depth to which bodies reach into each other, metres, looked at point by point; `hand_counts` for the transfer.
fn overlap_m(scene: &Scene, hand: &HandShape, q: &Joints, hand_counts: bool) -> f64 {
    let arm = Arm::rx60();
    let frames = arm.link_frames(q);
    let base_from_palm = arm.base_from_palm(q);
    let object_from_base = scene.base_from_object.inverse();
    let into_object = |p: &Point3<f64>| -scene.surface.nearest(&(object_from_base * p)).signed_distance_m;
    // Balls along the capsules: (link, centre, radius).
    let mut balls = Vec::new();
    for capsule in arm.link_capsules() {
        let [from, to] = capsule.ends_in_base(&frames);
        balls.extend(
            (0..=10).map(|i| (capsule.link, from + (to - from) * (0.1 * f64::from(i)), capsule.radius_m)),
        );
    }
    let hand_balls: Vec<(Point3<f64>, f64)> = (hand.balls().iter().map(|b| (b.center_in_palm, b.radius_m)))
        .chain(hand.boxes().iter().flat_map(|part| {
            (0..27).map(move |i| {
                let side = Vector3::new(i % 3, i / 3 % 3, i / 9).map(|s| f64::from(s) - 1.0);
                let at = Point3::from(part.half_extents_m.component_mul(&side));
                (part.palm_from_box * at, 0.0)
            })
        }))
        .map(|(center, radius_m)| (base_from_palm * center, radius_m))
        .collect();
    let mut deepest: f64 = f64::NEG_INFINITY;
    for (link, center, radius_m) in &balls {
        if *link > 0 {
            deepest = deepest.max(radius_m - center.z);
        }
        deepest = deepest.max(radius_m + into_object(center));
        for (center2, radius2_m) in hand_balls.iter().filter(|_| *link <= 4) {
            deepest = deepest.max(radius_m + radius2_m - (center2 - center).norm());
        }
        for (link2, center2, radius2_m) in &balls {
            // Pairs that the RX60's capsules always overlap in: neighbours, plate and base, forearm and wrist.
            if *link2 > link + 1 && ![(0, 2), (3, 5)].contains(&(*link, *link2)) {
                deepest = deepest.max(radius_m + radius2_m - (center2 - center).norm());
            }
        }
    }
    for (center, radius_m) in hand_balls.iter().filter(|_| hand_counts) {
        deepest = deepest.max(radius_m - center.z).max(radius_m + into_object(center));
    }
    deepest
}

/// Everything that holds of every motion.
fn check(scene: &Scene, site: &Site, motion: &ArmMotion, start_rad: Joints, object_kg: f64) {
    let arm = Arm::rx60();
    let hand = HandShape::of(&scene.hand, &open(&scene.hand));
    let end = |trajectory: &JointTrajectory| trajectory.sample(trajectory.duration_s()).q_rad;
    let apart = |a: &Joints, b: &Joints| (0..6).map(|i| (a[i] - b[i]).abs()).fold(0.0, f64::max);
    assert_eq!(motion.transfer.sample(0.0).q_rad, start_rad);
    assert!(apart(&end(&motion.transfer), &motion.approach.sample(0.0).q_rad) < 1e-9);
    assert!(apart(&end(&motion.approach), &motion.lift.sample(0.0).q_rad) < 1e-9);
    let sites = palm_sites(scene, site);
    for (q, site) in
        [motion.approach.sample(0.0).q_rad, end(&motion.approach), end(&motion.lift)].iter().zip(&sites)
    {
        let palm = arm.base_from_palm(q);
        assert!((palm.translation.vector - site.translation.vector).norm() < 1e-6);
        assert!(palm.rotation.angle_to(&site.rotation) < 1e-6);
    }
    let [free, loaded] = [0.0, object_kg].map(|kg| limits(scene, &arm, kg).unwrap());
    for (leg, trajectory, limits) in [
        (Leg::Transfer, &motion.transfer, free),
        (Leg::Approach, &motion.approach, free),
        (Leg::Lift, &motion.lift, loaded),
    ] {
        let peaks = trajectory.peaks();
        for i in 0..6 {
            assert!(peaks.speed_rad_per_s[i] <= limits.speed_rad_per_s[i] * (1.0 + 1e-6));
            assert!(peaks.acceleration_rad_per_s2[i] <= limits.acceleration_rad_per_s2[i] * (1.0 + 1e-6));
            assert!(peaks.jerk_rad_per_s3[i] <= limits.jerk_rad_per_s3[i] * (1.0 + 1e-6));
        }
        let steps = (trajectory.duration_s() / 0.004).ceil();
        for k in 0..=steps as usize {
            let q = trajectory.sample(trajectory.duration_s() * k as f64 / steps).q_rad;
            assert!(arm.limits().check(&q).is_inside());
            // In the lift the object moves along: only what stays where it is is looked at here.
            if leg != Leg::Lift {
                let depth_m = overlap_m(scene, &hand, &q, leg == Leg::Transfer);
                assert!(depth_m < 0.0003, "{leg}: {depth_m} m at {q:?}");
            }
        }
    }
}

#[test]
fn random_sites_get_ways_that_touch_nothing() {
    let scenes = [box_scene([0.06, 0.06, 0.12], 0.40, 0.0), box_scene([0.05, 0.20, 0.05], 0.35, 0.15)];
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut made = 0;
    for i in 0..60 {
        let scene = &scenes[i % 2];
        let at = scene.base_from_object.translation.vector;
        let mut offset = |range: f64| rng.random_range(-range..range);
        let place = [at.x + offset(0.08), at.y + offset(0.08), 0.38 + offset(0.10)];
        let site = site(scene, &hanging(place, offset(3.0), offset(0.9)));
        // The open hand may stand in the object here: a grasp's own checks are not made.
        let Ok(motion) = plan(scene, &site, 0.1, rest()) else { continue };
        made += 1;
        if made % 4 == 0 {
            check(scene, &site, &motion, rest(), 0.1);
        }
    }
    assert!(made > 30, "{made}");
}

/// A plate that stands upright between two sides of the working space.
fn wall(height_m: f64) -> Scene {
    box_scene([0.30, 0.02, height_m], 0.53, 0.0)
}

/// The RX60 with less room to turn, so that it cannot go round behind itself.
fn confined() -> Arm {
    let mut params = ArmParams::rx60();
    for (axis, most) in [(0, 1.2), (3, 3.0)] {
        params.limits.lower_rad[axis] = -most;
        params.limits.upper_rad[axis] = most;
    }
    Arm::new(params).unwrap()
}

/// The hand low on one side of the wall.
fn beside_the_wall(arm: &Arm, y: f64) -> Joints {
    match arm.palm_solutions_near(&hanging([0.42, y, 0.36], 0.0, 0.0), &rest()) {
        Inverse::Solutions(found) => found[0].q_rad,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_wall_is_gone_over() {
    let arm = confined();
    let start = beside_the_wall(&arm, -0.25);
    for (i, height_m) in [0.25, 0.30, 0.35, 0.40, 0.45, 0.50].into_iter().enumerate() {
        let scene = wall(height_m);
        let site = site(&scene, &hanging([0.42, 0.25, 0.33], 0.3 * i as f64, 0.0));
        // Straight on, something would go through it.
        let [approach_site, ..] = palm_sites(&scene, &site);
        let hand = HandShape::of(&scene.hand, &open(&scene.hand));
        let place = ObjectPlace::Standing { base_from_object: scene.base_from_object };
        let obstacles = Obstacles::new(&arm, &hand, scene.table_height_m, &scene.surface, place);
        assert_eq!(obstacles.clash_at(&start), None);
        let Inverse::Solutions(found) = arm.palm_solutions_near(&approach_site, &start) else { panic!() };
        for solution in found.iter() {
            let clash = obstacles.clash_between(&start, &solution.q_rad).expect("a wall");
            assert_eq!(clash.other, Body::Object);
        }
        let motion = plan_with(&arm, &scene, &site, 0.1, start).unwrap();
        check(&scene, &site, &motion, start, 0.1);
    }
}

#[test]
fn the_way_does_not_depend_on_the_number_of_threads() {
    let (arm, scene) = (confined(), wall(0.40));
    let start = beside_the_wall(&arm, -0.25);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let plan = |i: usize| {
            let site = site(&scene, &hanging([0.42, 0.25, 0.33], 0.2 * i as f64, 0.0));
            plan_with(&arm, &scene, &site, 0.1, start).ok()
        };
        pool.install(|| (0..4).into_par_iter().map(plan).collect::<Vec<_>>())
    };
    let one = run(1);
    assert!(one.iter().all(Option::is_some) && one == run(3));
}

#[test]
fn what_cannot_be_done_says_why() {
    let scene = box_scene([0.06, 0.06, 0.06], 0.40, 0.0);
    let over = |z| site(&scene, &hanging([0.40, 0.0, z], 0.0, 0.0));
    let far = site(&scene, &hanging([0.90, 0.0, 0.40], 0.0, 0.0));
    assert_eq!(failure(&scene, &far, 0.1, rest()), Some(MotionError::Unreachable));
    // The hand and scanner alone weigh 1.95 kg; the wrist bears 0.125 kg m^2.
    assert_eq!(failure(&scene, &over(0.36), 3.0, rest()), Some(MotionError::TooHeavy { object_kg: 3.0 }));
    let mut outside = rest();
    outside[1] = 2.3;
    let error = failure(&scene, &over(0.36), 0.1, outside);
    assert_eq!(error, Some(MotionError::StartOutsideLimits { axis: 2, angle_rad: 2.3 }));
    let nan = failure(&scene, &over(0.36), 0.1, [f64::NAN; 6]);
    assert!(matches!(nan, Some(MotionError::StartOutsideLimits { axis: 1, .. })));
    // Stretched forward and down, the hand is in the table.
    let low = failure(&scene, &over(0.36), 0.1, [0.0, 1.6, 0.7, 0.0, 0.2, 0.0]);
    let Some(MotionError::StartCollides(Clash { other: Body::Table, .. })) = low else { panic!("{low:?}") };
    assert!(low.unwrap().to_string().ends_with("touches the table"));
    // Reached at the approach site, but 80 mm farther the arm is too short.
    let end = site(&scene, &hanging([0.70, 0.0, 0.42], 0.0, -1.2));
    let reach = failure(&scene, &end, 0.1, rest());
    assert!(matches!(reach, Some(MotionError::NoLine { leg: Leg::Approach, .. })), "{reach:?}");
}

#[test]
fn a_site_behind_walls_is_not_reached_through_them() {
    // A closed box about the whole approach, walls 10 mm thick: inside is free, and there is no way in.
    let outer = cuboid([0.60, 0.60, 0.70]).unwrap();
    let inner = cuboid([0.58, 0.58, 0.68]).unwrap();
    let mut vertices = outer.vertices().to_vec();
    let mut faces = outer.faces().to_vec();
    let first = vertices.len() as u32;
    vertices.extend(inner.vertices());
    faces.extend(inner.faces().iter().map(|f| [f[0] + first, f[2] + first, f[1] + first]));
    let mesh = Mesh::new(vertices, faces).unwrap().transformed(&Isometry3::translation(0.0, 0.0, 0.36));
    let scene = scene_with(mesh, 0.40, 0.0);
    let site = site(&scene, &hanging([0.40, 0.0, 0.36], 0.0, 0.0));
    // The arm itself would have to be in the wall.
    let error = failure(&scene, &site, 0.1, rest()).expect("walls");
    assert!(
        matches!(
            error,
            MotionError::Collides { clash: Clash { other: Body::Object, .. }, .. }
                | MotionError::StartCollides(Clash { other: Body::Object, .. })
        ),
        "{error:?}"
    );
}
