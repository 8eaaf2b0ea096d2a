//! The expanding polytope on bodies whose distance to the origin is known.

use nalgebra::Vector6;

use super::expand::{Bracket, Goal, Hulls, Stop, bracket};
use super::*;
use crate::grasp::polar::Polar;

fn search(
    tolerance: f64,
    inside: Vector6<f64>,
    farthest: impl FnMut(&Vector6<f64>) -> Vector6<f64>,
) -> (Stop, Bracket) {
    let goal = Goal { tolerance, reject_below: None, accept_above: None, max_queries: 300 };
    let mut hulls = Hulls { polar: Some(Polar::default()), ..Hulls::default() };
    bracket(&mut hulls, &inside, 10.0, &goal, farthest)
}

/// Support function of a cube with half side 1.
fn cube(u: &Vector6<f64>) -> Vector6<f64> {
    u.map(|x| if x < 0.0 { -1.0 } else { 1.0 })
}

#[test]
fn cube_and_cross_polytope_about_a_moved_center() {
    let mut rng = rng(51);
    for _ in 0..50 {
        let center = Vector6::from_fn(|_, _| rng.random_range(-0.9..0.9_f64));
        let (stop, found) = search(0.0, center, |u| center + cube(u));
        assert_eq!(stop, Stop::Inside);
        let expected = 1.0 - center.amax();
        assert!((found.low - expected).abs() < 1e-11 && (found.high - expected).abs() < 1e-11, "{found:?}");

        let center = center / 6.0;
        let cross = |u: &Vector6<f64>| center + Vector6::ith(u.iamax(), u[u.iamax()].signum());
        let (stop, found) = search(0.0, center, cross);
        assert_eq!(stop, Stop::Inside);
        let expected = (1.0 - center.lp_norm(1)) / 6.0_f64.sqrt();
        assert!((found.low - expected).abs() < 1e-11 && (found.high - expected).abs() < 1e-11, "{found:?}");
    }
}

#[test]
fn a_ball_about_a_moved_center() {
    let mut rng = rng(52);
    for _ in 0..20 {
        let center = Vector6::from_fn(|_, _| rng.random_range(-1.0..1.0_f64)).normalize() * 0.5;
        let (stop, found) = search(1e-2, center, |u| center + u);
        assert_eq!(stop, Stop::Inside);
        let expected = 1.0 - center.norm();
        assert!(found.low <= expected && expected <= found.high + 1e-15, "{expected}: {found:?}");
    }
    // Every direction is the nearest one: the worst case, given up with a bracket that holds.
    let (stop, found) = search(1e-3, Vector6::zeros(), |u| *u);
    assert_eq!(stop, Stop::Unfinished);
    assert!(0.0 < found.low && found.low < 1.0 && (found.high - 1.0).abs() < 1e-14, "{found:?}");
}

#[test]
fn bodies_beside_the_origin_are_separated_from_any_start() {
    let mut rng = rng(53);
    for _ in 0..200 {
        let away = Vector6::from_fn(|_, _| rng.random_range(-1.0..1.0_f64)).normalize();
        let center = away * rng.random_range(1.0 + 1e-3..3.0);
        let guess = Vector6::from_fn(|_, _| rng.random_range(-1.0..1.0_f64));
        let (stop, found) = search(1e-6, guess, |u| center + u);
        assert_eq!(stop, Stop::Outside);
        let reach = (center + found.direction).dot(&found.direction);
        assert!(reach <= 0.0 && (reach - found.high).abs() < 1e-14, "{found:?}");
    }
}

#[test]
fn a_corner_at_the_origin_is_not_inside() {
    let corner = Vector6::repeat(1.0);
    let (stop, found) = search(1e-6, corner, |u| corner + cube(u));
    assert_eq!(stop, Stop::Outside);
    assert!(found.high.abs() < 1e-10 && found.direction.iter().all(|&x| x < 1e-9), "{found:?}");
}
