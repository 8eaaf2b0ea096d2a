//! The metric against values that it did not make itself.
mod brute_force;
mod conventions;
mod degenerate;
mod expansion;
mod golden;
mod gradient;
mod properties;
mod resistance;
mod task;
mod two_algorithms;

use std::f64::consts::PI;

use nalgebra::{Point3, Vector3};
use rand::RngExt;
use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};

use super::*;

fn rng(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

/// Torques about the object's origin.
fn reference(torque_scale_m: f64) -> WrenchReference {
    WrenchReference::new(Point3::origin(), torque_scale_m).unwrap()
}

fn with_cone(cone: ConeModel) -> Settings {
    Settings { cone, ..Settings::default() }
}

fn edges(m: u32) -> Settings {
    with_cone(ConeModel::edges(m).unwrap())
}

fn measure(contacts: &[Contact], torque_scale_m: f64, settings: &Settings) -> Closure {
    evaluate(contacts, &reference(torque_scale_m), settings, &mut Workspace::new())
}

/// Lower bound on epsilon; 0 without closure. Fails the test when the search gave up.
fn epsilon(contacts: &[Contact], torque_scale_m: f64, settings: &Settings) -> f64 {
    match measure(contacts, torque_scale_m, settings) {
        Closure::Force(quality) => quality.epsilon_low,
        Closure::None(_) => 0.0,
        other => panic!("not finished: {other:?}"),
    }
}

/// Contacts on the unit sphere, each pushing towards its centre.
fn on_sphere(points: &[[f64; 3]], friction: f64) -> Vec<Contact> {
    let contact = |&[x, y, z]: &[f64; 3]| {
        let p = Vector3::new(x, y, z).normalize();
        Contact::new(Point3::from(p), -p, friction).unwrap()
    };
    points.iter().map(contact).collect()
}

fn tetrahedron(friction: f64) -> Vec<Contact> {
    on_sphere(&[[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]], friction)
}

/// Contacts spread evenly on the equator of the unit sphere.
fn equator(count: u32, friction: f64) -> Vec<Contact> {
    let at = |k: u32| {
        let angle = 2.0 * PI * f64::from(k) / f64::from(count);
        [angle.cos(), angle.sin(), 0.0]
    };
    on_sphere(&(0..count).map(at).collect::<Vec<_>>(), friction)
}

/// A random contact on a box, a ball or a cylinder of about unit size.
fn random_contact(rng: &mut ChaCha8Rng, shape: u32, friction: f64) -> Contact {
    let direction = loop {
        let v = Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0_f64));
        if (0.01..1.0).contains(&v.norm()) {
            break v.normalize();
        }
    };
    let (point, outward) = match shape % 3 {
        0 => (direction, direction),
        1 => {
            let side = direction.iamax();
            let mut p = Vector3::from_fn(|_, _| rng.random_range(-0.6..0.6));
            p[side] = 0.6 * direction[side].signum();
            (p, Vector3::ith(side, direction[side].signum()))
        }
        _ => {
            let around = Vector3::new(direction.x, direction.y, 0.0).normalize();
            (around * 0.4 + Vector3::z() * rng.random_range(-0.9..0.9), around)
        }
    };
    Contact::new(Point3::from(point), -outward, friction).unwrap()
}

fn random_grasp(rng: &mut ChaCha8Rng, count: usize, friction: f64) -> Vec<Contact> {
    let shape = rng.random_range(0..3);
    (0..count).map(|_| random_contact(rng, shape, friction)).collect()
}
