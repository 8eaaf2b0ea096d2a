use nalgebra::Unit;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;

/// Points of a box 60 x 40 x 30 mm about (0.4, 0, 0.015), on the faces that a sensor in `view`'s direction sees, with
/// noise of 50 um along the line of sight.
fn seen_box(view: Vector3<f64>, rng: &mut ChaCha8Rng) -> Seen {
    let half = Vector3::new(0.030, 0.020, 0.015);
    let view = Unit::new_normalize(view);
    let mut seen = Vec::new();
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            if view[axis] * side < 0.2 {
                continue;
            }
            for _ in 0..3000 {
                let mut p = Vector3::from([0, 1, 2].map(|a: usize| half[a] * rng.random_range(-1.0..1.0)));
                p[axis] = side * half[axis];
                let noise = 1e-4 * (rng.random::<f64>() - 0.5) * 1.7;
                seen.push((Point3::new(0.4, 0.0, 0.015) + p + view.into_inner() * noise, view));
            }
        }
    }
    seen
}

/// Points with their lines of sight.
type Seen = Vec<(Point3<f64>, Unit<Vector3<f64>>)>;

fn cloud_of(sweeps: &[(Isometry3<f64>, Seen)]) -> PointCloud {
    let mut cloud = PointCloud { views: Some(vec![]), sweeps: Some(vec![]), ..PointCloud::default() };
    for (number, (motion, seen)) in sweeps.iter().enumerate() {
        for (point, view) in seen {
            cloud.points.push(motion * point);
            cloud.views.as_mut().unwrap().push(motion.rotation * view);
            cloud.sweeps.as_mut().unwrap().push(number as u16);
        }
    }
    cloud
}

fn about_the_box(turn: Vector3<f64>, shift: Vector3<f64>) -> Isometry3<f64> {
    let about = Translation3::new(0.4, 0.0, 0.015);
    Translation3::from(shift) * about * UnitQuaternion::from_scaled_axis(turn) * about.inverse()
}

#[test]
fn known_motions_of_overlapping_sweeps_are_found_again() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    // All see the same three faces: nothing ties views of opposite faces together, as nobody knows the box's width.
    let views = [[0.4, 0.4, 1.0], [1.0, 0.6, 1.0], [0.6, 1.0, 1.0], [1.0, 1.0, 0.5], [0.6, 0.5, 1.0]];
    let motions: Vec<Isometry3<f64>> = views
        .iter()
        .map(|_| {
            let mut three = |size: f64| Vector3::from([0, 1, 2].map(|_| rng.random_range(-size..size)));
            about_the_box(three(3e-3), three(7e-4))
        })
        .collect();
    let sweeps: Vec<_> =
        motions.iter().zip(views).map(|(&m, view)| (m, seen_box(view.into(), &mut rng))).collect();
    let Registration::Moved(moved) = register(&cloud_of(&sweeps), None) else { panic!("not moved") };
    assert!(moved.before_m > 3e-4 && moved.after_m < 1e-4, "{moved:?}");
    // All together may have moved: compare with the first sweep.
    let first = moved.corrections[0] * motions[0];
    for (correction, motion) in moved.corrections.iter().zip(&motions) {
        let rest = first.inverse() * correction * motion;
        let corner = Point3::new(0.43, 0.02, 0.03);
        assert!((rest * corner - corner).norm() < 6e-5, "{}", (rest * corner - corner).norm());
    }
}

#[test]
fn what_overlaps_do_not_show_stays() {
    // Two views of a plane, and each far off its place within it: only the height may change.
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let mut sheet = || -> Seen {
        (0..6000)
            .map(|_| {
                let [x, y] = [0, 1].map(|_| rng.random_range(-0.05..0.05));
                (Point3::new(x, y, rng.random_range(-5e-5..5e-5)), Vector3::z_axis())
            })
            .collect()
    };
    let motion = Isometry3::translation(6e-4, -5e-4, 4e-4);
    let cloud = cloud_of(&[(Isometry3::identity(), sheet()), (motion, sheet())]);
    let Registration::Moved(moved) = register(&cloud, None) else { panic!("not moved") };
    let [first, second] = [0, 1].map(|i| moved.corrections[i].translation.vector);
    assert!((first.z - second.z - 4e-4).abs() < 2e-5, "{first} {second}");
    for shift in [first, second] {
        assert!(shift.xy().norm() < 2e-5, "{shift}");
    }
    for correction in &moved.corrections {
        assert!(correction.rotation.scaled_axis().z.abs() < 1e-4);
    }
}

#[test]
fn a_known_table_says_how_high_all_sweeps_are() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let motions = [[1e-4, 0.0, 5e-4], [0.0, 0.0, 9e-4]].map(|[x, y, z]| Isometry3::translation(x, y, z));
    let sweeps = motions.map(|motion| {
        let mut seen = seen_box(Vector3::new(0.7, 0.7, 1.0), &mut rng);
        for _ in 0..3000 {
            let [x, y] = [0, 1].map(|_| rng.random_range(0.035..0.06));
            seen.push((Point3::new(0.4 + x, y, rng.random_range(-5e-5..5e-5)), Vector3::z_axis()));
        }
        (motion, seen)
    });
    let Registration::Moved(moved) = register(&cloud_of(&sweeps), Some(&Plane::horizontal(0.0))) else {
        panic!("not moved")
    };
    for (correction, motion) in moved.corrections.iter().zip(&motions) {
        let on_table = Point3::new(0.45, 0.05, 0.0);
        let height = (correction * (motion * on_table)).z;
        assert!(height.abs() < 6e-5, "{height}");
    }
}

#[test]
fn one_sweep_and_sweeps_apart_are_left_alone() {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let seen = seen_box(Vector3::z(), &mut rng);
    assert_eq!(register(&cloud_of(&[(Isometry3::identity(), seen.clone())]), None), Registration::OneSweep);
    let away = Isometry3::translation(0.3, 0.0, 0.0);
    let cloud = cloud_of(&[(Isometry3::identity(), seen.clone()), (away, seen)]);
    assert_eq!(register(&cloud, None), Registration::Unmoved);
    assert_eq!(Registration::Unmoved.applied(&cloud), cloud);
}
