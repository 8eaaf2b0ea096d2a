//! Time of the grasp metric, with the plain expanding polytope beside it: `cargo bench -p host --bench quality`.
//!
//! Each measurement goes round 200 random force-closure grasps, so that no branch is learnt by heart. The comparison with
//! Qhull is a package of its own, `qhull/` beside this file.
#![allow(clippy::expect_used, reason = "a benchmark of contacts that are none has nothing to measure")]

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use host::grasp::{
    Closure, ConeModel, Contact, Settings, Workspace, WrenchReference, evaluate, evaluate_above,
};
use nalgebra::{Point3, Vector3};
use rand::RngExt;
use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};

const GRASPS: usize = 200;

/// A contact anywhere on an ellipsoid with half axes 1, 0.7 and 0.5.
fn random_contact(rng: &mut ChaCha8Rng, friction: f64) -> Contact {
    let half = Vector3::new(1.0, 0.7, 0.5);
    loop {
        let v = Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0_f64));
        if (0.01..1.0).contains(&v.norm()) {
            let towards = v.normalize();
            let point = Point3::from(towards.component_mul(&half));
            return Contact::new(point, -towards.component_div(&half), friction).expect("a contact");
        }
    }
}

fn reference() -> WrenchReference {
    WrenchReference::new(Point3::origin(), 1.0).expect("a reference")
}

/// Random grasps that are closed, or those that are not.
fn grasps(count: usize, friction: f64, closed: bool, settings: &Settings) -> Vec<Vec<Contact>> {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut workspace = Workspace::new();
    let mut found = Vec::new();
    while found.len() < GRASPS {
        let grasp: Vec<_> = (0..count).map(|_| random_contact(&mut rng, friction)).collect();
        let is_closed = matches!(evaluate(&grasp, &reference(), settings, &mut workspace), Closure::Force(_));
        if is_closed == closed {
            found.push(grasp);
        }
    }
    found
}

fn pyramid(edges: u32) -> Settings {
    let cone = ConeModel::edges(edges).expect("a pyramid");
    Settings { cone, tolerance: 0.0, ..Settings::default() }
}

fn quality(criterion: &mut Criterion) {
    let cases =
        [("8 edges", pyramid(8)), ("16 edges", pyramid(16)), ("exact cone 1e-6", Settings::default())];
    for (name, settings) in cases {
        let mut group = criterion.benchmark_group(name);
        for count in [3, 4, 5] {
            for (outcome, closed) in [("closed", true), ("open", false)] {
                let grasps = grasps(count, 0.4, closed, &settings);
                for (way, mut workspace) in
                    [("metric", Workspace::new()), ("whole polytope", Workspace::whole_polytope())]
                {
                    let mut round = grasps.iter().cycle();
                    let id = BenchmarkId::new(way, format!("{count} contacts, {outcome}"));
                    group.bench_function(id, |bencher| {
                        bencher.iter(|| {
                            round.next().map(|grasp| {
                                evaluate(black_box(grasp), &reference(), &settings, &mut workspace)
                            })
                        });
                    });
                }
            }
        }
        group.finish();
    }
}

/// Whether a grasp beats the best so far, which nine in ten do not.
fn ranking(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("best so far, 8 edges");
    let settings = pyramid(8);
    for (count, best) in [(3, 0.2), (4, 0.28), (5, 0.34)] {
        let grasps = grasps(count, 0.8, true, &settings);
        let (mut workspace, mut round) = (Workspace::new(), grasps.iter().cycle());
        group.bench_function(format!("{count} contacts, floor {best}"), |bencher| {
            bencher.iter(|| {
                round.next().map(|grasp| {
                    evaluate_above(black_box(grasp), &reference(), &settings, best, &mut workspace)
                })
            });
        });
    }
    group.finish();
}

criterion_group!(benches, quality, ranking);
criterion_main!(benches);
