//! The ellipsoid of disturbances, against epsilon, the conic solver behind resistance, and closed forms.

use nalgebra::{Matrix6, Rotation3, Vector6};

use super::*;

fn random_wrench(rng: &mut ChaCha8Rng) -> Vector6<f64> {
    Vector6::from_fn(|_, _| rng.random_range(-1.0..1.0_f64))
}

/// A matrix with semi-axes between 0.3 and 3, in any directions.
fn random_matrix(rng: &mut ChaCha8Rng) -> Matrix6<f64> {
    let axes = Matrix6::from_fn(|_, _| rng.random_range(-1.0..1.0_f64)).qr().q();
    let squares = Vector6::from_fn(|_, _| rng.random_range(0.3..3.0_f64).powi(2));
    axes * Matrix6::from_diagonal(&squares) * axes.transpose()
}

fn withstood(contacts: &[Contact], scale_m: f64, settings: &Settings, task: &Task) -> TaskQuality {
    let found = evaluate_task(
        contacts,
        &reference(scale_m),
        settings,
        task,
        &Limits::default(),
        &mut Workspace::new(),
    );
    let TaskClosure::Withstood(quality) = found else { panic!("{found:?}") };
    quality
}

/// Force-closed grasps.
fn closed(seed: u64, wanted: usize, settings: &Settings) -> Vec<Vec<Contact>> {
    let mut rng = rng(seed);
    let mut grasps = Vec::new();
    while grasps.len() < wanted {
        let contacts = random_grasp(&mut rng, 3 + grasps.len() % 3, 0.6);
        if matches!(measure(&contacts, 1.0, settings), Closure::Force(q) if q.epsilon_low > 0.01) {
            grasps.push(contacts);
        }
    }
    grasps
}

#[test]
fn the_ball_gives_epsilon_and_a_ball_of_half_the_size_twice_as_much() {
    for settings in [edges(8), Settings { norm: Norm::LInf, ..Settings::default() }] {
        for contacts in closed(81, 10, &settings) {
            for scale_m in [1.0, 0.05] {
                let Closure::Force(epsilon) = measure(&contacts, scale_m, &settings) else { continue };
                for size in [1.0, 0.5] {
                    let ball = [size, size, size, size * scale_m, size * scale_m, size * scale_m];
                    let found =
                        withstood(&contacts, scale_m, &settings, &Task::from_semi_axes(ball).unwrap());
                    let (low, high) = (found.scale_low * size, found.scale_high * size);
                    let slack = 1e-9 * high;
                    assert!(low <= epsilon.epsilon_high + slack && epsilon.epsilon_low <= high + slack);
                    assert!(high - low <= 1e-6 * high + 1e-10);
                }
            }
        }
    }
}

#[test]
fn it_turns_with_the_object_and_does_not_see_the_torque_scale() {
    let mut rng = rng(82);
    let settings = Settings { tolerance: 1e-8, ..Settings::default() };
    for contacts in closed(82, 10, &settings) {
        let matrix = random_matrix(&mut rng);
        let task = Task::from_matrix(&matrix).unwrap();
        let found = withstood(&contacts, 1.0, &settings, &task);
        for scale_m in [0.05, 7.0] {
            let other = withstood(&contacts, scale_m, &settings, &task);
            assert!((other.scale_low - found.scale_low).abs() < 3e-8 * found.scale_low, "{other:?}");
        }
        let turn = Rotation3::new(Vector3::from_fn(|_, _| rng.random_range(-3.0..3.0)));
        let mut twice = Matrix6::zeros();
        twice.fixed_view_mut::<3, 3>(0, 0).copy_from(turn.matrix());
        twice.fixed_view_mut::<3, 3>(3, 3).copy_from(turn.matrix());
        let turned: Vec<Contact> = contacts
            .iter()
            .map(|c| {
                let normal = turn * c.inward_normal_in_object().into_inner();
                Contact::new(turn * c.point_in_object(), normal, c.friction()).unwrap()
            })
            .collect();
        let task = Task::from_matrix(&(twice * matrix * twice.transpose())).unwrap();
        let other = withstood(&turned, 1.0, &settings, &task);
        assert!((other.scale_low - found.scale_low).abs() < 3e-8 * found.scale_low, "{other:?}");
    }
}

#[test]
fn every_wrench_within_is_balanced_and_the_weakest_just_so() {
    let mut rng = rng(83);
    let mut workspace = Workspace::new();
    let (mut found_some, mut overloaded) = (0, 0);
    for trial in 0..80 {
        let norm = if trial % 2 == 0 { Norm::L1 } else { Norm::LInf };
        let settings = Settings { norm, tolerance: 1e-5, ..Settings::default() };
        let contacts = random_grasp(&mut rng, 3 + trial % 3, 0.6);
        let matrix = random_matrix(&mut rng);
        // Without a load, with one, and with one that is too much.
        let load = random_wrench(&mut rng) * [0.0, 0.05, 3.0][trial / 2 % 3];
        let task = Task::from_matrix(&matrix).and_then(|task| task.with_load(load)).unwrap();
        let scale_m = 0.7;
        let reference = reference(scale_m);
        let limits = Limits::default();
        let root = matrix.cholesky().unwrap().l();
        let mut factor = |wrench: &Vector6<f64>| {
            let (force, torque) = (wrench.fixed_rows::<3>(0).into(), wrench.fixed_rows::<3>(3).into());
            let disturbance = Disturbance::new(force, torque).unwrap();
            match resist(&contacts, &reference, &settings, &disturbance, &mut workspace) {
                Resistance::Balanced(balance) => (balance.factor_low, balance.factor_high),
                Resistance::None(_) => (0.0, 1e-5),
                Resistance::Unfinished(found) => panic!("{found:?}"),
            }
        };
        let found = evaluate_task(&contacts, &reference, &settings, &task, &limits, &mut Workspace::new());
        let physical = |u: &Vector6<f64>| {
            // Along a direction of force, torque / scale, a wrench in N and N m goes by force, torque x scale.
            Vector6::from_fn(|k, _| if k < 3 { u[k] } else { u[k] / scale_m })
        };
        match found {
            TaskClosure::Withstood(quality) => {
                found_some += 1;
                for _ in 0..20 {
                    let within = root * random_wrench(&mut rng).normalize() * (quality.scale_low * 0.999);
                    assert!(factor(&(load + within)).1 >= 1.0 - 1e-5, "trial {trial}: {quality:?}");
                }
                // The point of the ellipsoid that needs most along the weakest wrench.
                let u = physical(&quality.weakest_wrench);
                let worst = -root * (root.transpose() * u).normalize();
                let (low, _) = factor(&(load + worst * quality.scale_high * 1.001));
                assert!(low < 1.0, "trial {trial}: {low} {quality:?}");
            }
            TaskClosure::None { direction, .. } => {
                overloaded += usize::from(trial / 2 % 3 == 2);
                let u = physical(&direction);
                let map = GraspMap::new(&contacts, &reference, settings.cone, settings.force_norm);
                let reach = map.reach(&direction, norm).unwrap().max(0.0);
                assert!(reach + u.dot(&load) < 1e-8, "trial {trial}: {reach}");
            }
            other => panic!("trial {trial}: {other:?}"),
        }
    }
    assert!(found_some > 15 && overloaded > 5, "{found_some} {overloaded}");
}

#[test]
fn a_weight_on_three_fingers_is_a_task_without_closure() {
    // Fingers below, each with up to 1 N: they bear 3 N, and in the middle of that, with a weight of 1.5 N, forces up and
    // down by as much. Torques and sideways forces are asked for so little that they do not matter.
    let below = [[1.0, 0.0, 0.0], [-0.5, 0.75_f64.sqrt(), 0.0], [-0.5, -(0.75_f64.sqrt()), 0.0]]
        .map(|p| Contact::new(Point3::from(p), Vector3::z(), 0.5).unwrap());
    let settings = Settings { norm: Norm::LInf, tolerance: 1e-6, ..Settings::default() };
    let task = Task::from_semi_axes([1e-4, 1e-4, 1.0, 1e-4, 1e-4, 1e-4]).unwrap();
    for (weight, expected) in [(1.5, 1.5), (0.5, 0.5), (2.0, 1.0)] {
        let loaded = task.with_load(Vector6::new(0.0, 0.0, -weight, 0.0, 0.0, 0.0)).unwrap();
        let found = withstood(&below, 1.0, &settings, &loaded);
        assert!((found.scale_low - expected).abs() < 1e-3 * expected, "{weight}: {found:?}");
    }
    let overload = task.with_load(Vector6::new(0.0, 0.0, -3.5, 0.0, 0.0, 0.0)).unwrap();
    for task in [task, overload] {
        let found = evaluate_task(
            &below,
            &reference(1.0),
            &settings,
            &task,
            &Limits::default(),
            &mut Workspace::new(),
        );
        assert!(matches!(found, TaskClosure::None { .. }), "{found:?}");
    }
    let limits = Limits::at(1.0);
    let loaded = task.with_load(Vector6::new(0.0, 0.0, -1.5, 0.0, 0.0, 0.0)).unwrap();
    let found = evaluate_task(&below, &reference(1.0), &settings, &loaded, &limits, &mut Workspace::new());
    assert!(found.quality().is_some_and(|q| q.scale_low >= 1.0), "{found:?}");
    let found =
        evaluate_task(&below, &reference(1.0), &settings, &loaded, &Limits::at(2.0), &mut Workspace::new());
    assert!(matches!(found, TaskClosure::Below(q) if q.scale_high < 2.0), "{found:?}");
}

#[test]
fn what_is_no_task_is_refused() {
    assert!(matches!(Task::from_semi_axes([1.0, 1.0, 0.0, 1.0, 1.0, 1.0]), Err(TaskError::SemiAxis(_))));
    assert!(matches!(Task::from_semi_axes([1.0, f64::NAN, 1.0, 1.0, 1.0, 1.0]), Err(TaskError::SemiAxis(_))));
    let ball = Task::from_semi_axes([1.0; 6]).unwrap();
    assert!(matches!(ball.with_load(Vector6::repeat(f64::NAN)), Err(TaskError::Load(_))));
    let mut matrix = Matrix6::identity();
    matrix[(0, 1)] = 0.5;
    assert_eq!(Task::from_matrix(&matrix), Err(TaskError::Matrix));
    assert_eq!(Task::from_matrix(&-Matrix6::identity()), Err(TaskError::Matrix));
    assert_eq!(Task::from_matrix(&(Matrix6::identity() * f64::NAN)), Err(TaskError::Matrix));
    assert_eq!(Task::from_matrix(&Matrix6::identity()), Ok(ball));
    assert!(matches!(
        evaluate_task(&[], &reference(1.0), &edges(8), &ball, &Limits::default(), &mut Workspace::new()),
        TaskClosure::None { .. }
    ));
}
