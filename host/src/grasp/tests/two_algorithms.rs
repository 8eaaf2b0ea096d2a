//! The search among the facets near the origin against the whole polytope: they share the support function and nothing
//! of the geometry.

use super::*;

/// Differences that rounding explains.
fn agree(fast: f64, whole: f64) -> bool {
    (fast - whole).abs() <= 1e-9 * whole + 1e-12
}

/// Counts of outcomes of the first algorithm.
#[derive(Debug, Default)]
struct Outcomes {
    closed: usize,
    open: usize,
    unfinished: usize,
}

/// Measures grasps both ways, to all digits for pyramids; a finished answer has to be the other's answer.
fn compare(grasps: impl Iterator<Item = Vec<Contact>>, settings: &Settings) -> Outcomes {
    let (mut fast, mut whole) = (Workspace::new(), Workspace::whole_polytope());
    let mut outcomes = Outcomes::default();
    for contacts in grasps {
        let found = evaluate(&contacts, &reference(1.0), settings, &mut fast);
        let expected = evaluate(&contacts, &reference(1.0), settings, &mut whole);
        match (found, expected) {
            (Closure::Force(found), Closure::Force(expected)) => {
                outcomes.closed += 1;
                let (low, high) = (found.epsilon_low, found.epsilon_high);
                if settings.tolerance == 0.0 {
                    assert!(agree(low, expected.epsilon_low), "{contacts:?}: {found:?}, {expected:?}");
                } else {
                    // Two brackets of one number overlap.
                    let slack = 1e-9 * high + 1e-12;
                    assert!(low <= expected.epsilon_high + slack, "{found:?}, {expected:?}");
                    assert!(expected.epsilon_low <= high + slack, "{found:?}, {expected:?}");
                }
            }
            (Closure::None(_), Closure::None(_)) => outcomes.open += 1,
            (Closure::Force(tiny), Closure::None(_)) | (Closure::None(_), Closure::Force(tiny)) => {
                assert!(tiny.epsilon_low < 1e-10, "{contacts:?}: {found:?}, {expected:?}");
            }
            (Closure::Unfinished(_), _) => outcomes.unfinished += 1,
            (_, Closure::Unfinished(_)) => {}
            other => panic!("{contacts:?}: {other:?}"),
        }
    }
    outcomes
}

fn sharp(edge_count: u32) -> Settings {
    Settings { tolerance: 0.0, ..edges(edge_count) }
}

#[test]
fn random_grasps() {
    for (seed, friction) in [(61, 0.2), (62, 0.4), (63, 0.8)] {
        for (edge_count, trials) in [(8, 2000), (16, 500), (5, 500)] {
            let mut rng = rng(seed);
            let grasps = (0..trials).map(|trial| random_grasp(&mut rng, 3 + trial % 3, friction));
            let outcomes = compare(grasps, &sharp(edge_count));
            assert_eq!(outcomes.unfinished, 0, "{outcomes:?}");
            assert!(outcomes.closed > trials / 20, "{outcomes:?}");
        }
    }
}

#[test]
fn random_grasps_of_other_kinds() {
    let mut rng = rng(64);
    let mut soft = |_| {
        let hard = random_grasp(&mut rng, 3, 0.5);
        hard.iter().map(|c| c.with_torsion(0.2).and_then(|c| c.with_max_force(3.0)).unwrap()).collect()
    };
    for norm in [Norm::L1, Norm::LInf] {
        let outcomes = compare((0..300).map(&mut soft), &Settings { norm, ..sharp(8) });
        assert!(outcomes.closed > 50 && outcomes.unfinished == 0, "{outcomes:?}");
        let exact = Settings { norm, tolerance: 1e-5, ..Settings::default() };
        let outcomes = compare((0..300).map(&mut soft), &exact);
        assert!(outcomes.closed > 50 && outcomes.unfinished == 0, "{outcomes:?}");
    }
}

#[test]
fn round_wrenches() {
    let mut rng = rng(65);
    for noise in [0.0, 1e-9, 1e-4, 0.3] {
        let around = (0..30).map(|trial| {
            let moved = |c: &Contact| {
                let noise = Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0)) * noise;
                let p = (c.point_in_object().coords + noise).normalize();
                Contact::new(Point3::from(p), -p, 0.8).unwrap()
            };
            let round = if trial % 4 == 3 { tetrahedron(0.8) } else { equator(3 + trial % 4, 0.8) };
            round.iter().map(moved).collect()
        });
        let outcomes = compare(around, &sharp(8));
        assert!(outcomes.unfinished == 0 && outcomes.closed > 10, "{outcomes:?}");
    }
}

#[test]
fn nearly_flat_wrenches() {
    let mut rng = rng(66);
    for width in [1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6] {
        let near_a_line = (0..400).map(|_| {
            (0..4)
                .map(|_| {
                    let off = Vector3::from_fn(|_, _| rng.random_range(-width..width));
                    let normal = Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0));
                    let point = Vector3::x() * rng.random_range(-1.0..1.0) + off;
                    Contact::new(Point3::from(point), normal, 0.8).unwrap()
                })
                .collect()
        });
        let outcomes = compare(near_a_line, &sharp(8));
        assert!(outcomes.closed > 100, "{width:e}: {outcomes:?}");
        assert!(outcomes.unfinished < 4, "{width:e}: {outcomes:?}");
    }
}
