//! A reference that shares nothing with the expanding polytope: try every six points for a facet.

use nalgebra::{Matrix6, Vector6};

use super::*;

/// Distance from the origin to the boundary of the hull of `points`, 0 when the origin is not inside. Tries all planes
/// through six points; `None` when no plane supports the hull, that is, when it is flat.
fn by_all_planes(points: &[Vector6<f64>]) -> Option<f64> {
    let mut least: Option<f64> = None;
    let mut pick = [0, 1, 2, 3, 4, 5];
    loop {
        let rows = pick.map(|i| points[i].transpose());
        // n . p = 1 on all six: planes through the origin have no solution, and then epsilon is 0 to be found by others.
        if let Some(inverse) = Matrix6::from_rows(&rows).try_inverse() {
            let n = inverse * Vector6::repeat(1.0);
            let offset = 1.0 / n.norm();
            let heights = || points.iter().map(|p| (n.dot(p) - 1.0) * offset);
            if heights().all(|h| h < 1e-10) {
                least = Some(least.map_or(offset, |d: f64| d.min(offset)));
            } else if heights().all(|h| h > -1e-10) {
                return Some(0.0);
            }
        }
        let Some(at) = (0..6).rev().find(|&k| pick[k] < points.len() - 6 + k) else { return least };
        pick[at] += 1;
        for k in at + 1..6 {
            pick[k] = pick[k - 1] + 1;
        }
    }
}

/// The edges of all pyramids, from the definition.
fn edge_wrenches(contacts: &[Contact], m: u32) -> Vec<Vector6<f64>> {
    let mut wrenches = Vec::new();
    for contact in contacts {
        let n = contact.inward_normal_in_object();
        let axis = if n.x.abs() >= 0.9 { Vector3::y() } else { Vector3::x() };
        let t = n.cross(&axis).normalize();
        let b = n.cross(&t);
        for k in 0..m {
            let angle = 2.0 * PI * f64::from(k) / f64::from(m);
            let force = n.into_inner() + (t * angle.cos() + b * angle.sin()) * contact.friction();
            let torque = contact.point_in_object().coords.cross(&force);
            wrenches.push(Vector6::from_iterator(force.iter().chain(torque.iter()).copied()));
        }
    }
    wrenches
}

#[test]
fn the_polytope_finds_what_all_planes_find() {
    let mut rng = rng(11);
    let mut closures = 0;
    for trial in 0..200 {
        let friction = [0.4, 0.8, 1.2][trial % 3];
        let contacts = random_grasp(&mut rng, 3, friction);
        let expected = by_all_planes(&edge_wrenches(&contacts, 4)).unwrap_or(0.0);
        let settings = Settings { tolerance: 0.0, ..edges(4) };
        let found = match measure(&contacts, 1.0, &settings) {
            Closure::Force(quality) => quality.epsilon_low,
            Closure::None(_) => 0.0,
            other => panic!("trial {trial}: {other:?}"),
        };
        closures += usize::from(expected > 1e-6);
        assert!((found - expected).abs() < 1e-9, "trial {trial}: {found} for {expected}");
    }
    assert!(closures >= 20, "only {closures} grasps had anything to compare");
}
