//! The metric in a warmed workspace and grasp attempts that are refused allocate nothing, so that a planner's threads do not
//! wait for each other.
//! A binary of its own: the counting allocator serves all of it.
#![allow(clippy::unwrap_used, clippy::panic, reason = "the helpers of these tests are tests themselves")]

use host::grasp::{
    Closure, ConeModel, Contact, Disturbance, Limits, Norm, Resistance, Settings, Task, Workspace,
    WrenchReference, evaluate, evaluate_task, evaluate_with_gradient, evaluate_within, resist,
};
use host::object::BuiltIn;
use host::plan::arm::Arm;
use host::plan::attempt::{AttemptScratch, Rejection, attempt};
use host::plan::preshape::tables;
use host::plan::scene::Scene;
use host::plan::settle::{Approach, settle};
use nalgebra::{Isometry3, Point3, Unit, Vector3};
use rand::RngExt;
use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};

/// Contacts anywhere on an ellipsoid.
fn grasps(count: usize) -> Vec<Vec<Contact>> {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let half = Vector3::new(1.0, 0.7, 0.5);
    let mut contact = || {
        let towards = Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0_f64)).normalize();
        let point = Point3::from(towards.component_mul(&half));
        Contact::new(point, -towards.component_div(&half), 0.5).unwrap()
    };
    (0..count).map(|k| (0..2 + k % 4).map(|_| contact()).collect()).collect()
}

fn reference() -> WrenchReference {
    WrenchReference::new(Point3::origin(), 1.0).unwrap()
}

fn all_settings() -> Vec<Settings> {
    let pyramid = Settings { cone: ConeModel::edges(8).unwrap(), tolerance: 0.0, ..Settings::default() };
    let exact = Settings { tolerance: 1e-4, ..Settings::default() };
    vec![pyramid, exact, Settings { norm: Norm::LInf, ..exact }]
}

/// Runs the work twice in one workspace, and counts what the second time allocates.
#[track_caller]
fn allocates_nothing(work: impl Fn(&[Contact], &Settings, &mut Workspace)) {
    let grasps = grasps(400);
    for settings in all_settings() {
        let mut workspace = Workspace::new();
        let mut all = || grasps.iter().for_each(|contacts| work(contacts, &settings, &mut workspace));
        all();
        let counted = allocation_counter::measure(all);
        assert_eq!((counted.count_total, counted.bytes_total), (0, 0), "{settings:?}");
    }
}

#[test]
fn the_counter_counts() {
    let counted = allocation_counter::measure(|| drop(std::hint::black_box(vec![1_u8; 1000])));
    assert!(counted.count_total == 1 && counted.bytes_total == 1000, "{counted:?}");
}

#[test]
fn epsilon() {
    let (closed, limits) = (std::cell::Cell::new(0), Limits::at(0.05));
    allocates_nothing(|contacts, settings, workspace| {
        let found = evaluate(contacts, &reference(), settings, workspace);
        closed.set(closed.get() + usize::from(matches!(found, Closure::Force(_))));
        let _ = std::hint::black_box(evaluate_within(contacts, &reference(), settings, &limits, workspace));
    });
    assert!(closed.get() > 300, "{}", closed.get());
}

#[test]
fn resistance() {
    let pull = Disturbance::new(Vector3::new(0.3, -0.2, -1.0), Vector3::new(0.0, 0.1, 0.0)).unwrap();
    let balanced = std::cell::Cell::new(0);
    allocates_nothing(|contacts, settings, workspace| {
        let found = resist(contacts, &reference(), settings, &pull, workspace);
        balanced.set(balanced.get() + usize::from(matches!(found, Resistance::Balanced(_))));
    });
    assert!(balanced.get() > 300, "{}", balanced.get());
}

#[test]
fn task() {
    let task = Task::from_semi_axes([1.0, 1.0, 2.0, 0.5, 0.5, 0.2]).unwrap();
    let loaded = task.with_load(nalgebra::Vector6::new(0.0, 0.0, -0.05, 0.0, 0.0, 0.0)).unwrap();
    let limits = Limits::default();
    allocates_nothing(|contacts, settings, workspace| {
        for task in [&task, &loaded] {
            let _ = std::hint::black_box(evaluate_task(
                contacts,
                &reference(),
                settings,
                task,
                &limits,
                workspace,
            ));
        }
    });
}

#[test]
fn gradient() {
    let gradient = std::cell::RefCell::new(Vec::with_capacity(8));
    allocates_nothing(|contacts, settings, workspace| {
        let found =
            evaluate_with_gradient(contacts, &reference(), settings, workspace, &mut gradient.borrow_mut());
        let _ = std::hint::black_box(found);
    });
}

#[test]
fn refused_attempts() {
    let mesh = BuiltIn::Mouse.object(1.0).unwrap().mesh;
    let base_from_object = Isometry3::translation(0.4, 0.0, 0.0);
    let scene = Scene::new(mesh, base_from_object, Some(0.0), Some(Arm::rx60())).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let mut scratch = AttemptScratch::default();
    let mut sites = Vec::new();
    for _ in 0..60 {
        let mut random = || Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0_f64));
        let (lean, opposition) = (0.5 * random(), random());
        let approach = Approach {
            direction_in_object: Unit::new_normalize(lean - Vector3::z()),
            opposition_in_object: opposition,
        };
        for (index, table) in tables(&scene.hand).iter().enumerate() {
            sites.push((index, settle(&scene, table, &approach, &scene.center_of_mass, None)));
        }
    }
    let mut tried =
        |index: usize, site| attempt(&scene, index, &scene.hand.candidates[index], site, &mut scratch).err();
    let refusals: Vec<Option<Rejection>> = sites.iter().map(|(index, site)| tried(*index, site)).collect();
    let (mut counts, mut reasons) = (Vec::new(), std::collections::BTreeSet::new());
    for ((index, site), refusal) in sites.iter().zip(&refusals) {
        let Some(reason) = refusal.filter(|reason| *reason != Rejection::ArmBlocked) else { continue };
        counts
            .push(allocation_counter::measure(|| _ = std::hint::black_box(tried(*index, site))).count_total);
        reasons.insert(reason);
    }
    assert!(counts.len() > 100 && reasons.len() >= 5, "{} {reasons:?}", counts.len());
    assert_eq!(counts.iter().sum::<u64>(), 0);
}
