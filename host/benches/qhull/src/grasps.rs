//! Random grasps: contacts on an ellipsoid, a box or a cylinder of random proportions, torques divided by its radius.

use std::f64::consts::{PI, TAU};

use host::grasp::{Contact, WrenchReference};
use nalgebra::{Point3, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Contacts, and what their torques are divided by.
#[derive(Clone)]
pub struct Grasp {
    pub contacts: Vec<Contact>,
    pub reference: WrenchReference,
}

impl Grasp {
    fn new(contacts: Vec<Contact>, radius_m: f64) -> Self {
        let reference = WrenchReference::new(Point3::origin(), radius_m).expect("a radius");
        Self { contacts, reference }
    }
}

enum Shape {
    Ellipsoid,
    Box,
    Cylinder,
}

/// A body about the origin with the given half sizes.
struct Body {
    shape: Shape,
    half_m: Vector3<f64>,
}

impl Body {
    fn random(rng: &mut ChaCha8Rng) -> Self {
        let shape = match rng.random_range(0..3) {
            0 => Shape::Ellipsoid,
            1 => Shape::Box,
            _ => Shape::Cylinder,
        };
        Self { shape, half_m: Vector3::from_fn(|_, _| rng.random_range(0.02..0.06)) }
    }

    fn radius_m(&self) -> f64 {
        let half = &self.half_m;
        match self.shape {
            Shape::Ellipsoid => half.amax(),
            Shape::Box => half.norm(),
            Shape::Cylinder => half.x.hypot(half.z),
        }
    }

    /// The contact that is roughly in a direction from the centre.
    fn contact(&self, towards: &Vector3<f64>, friction: f64, rng: &mut ChaCha8Rng) -> Contact {
        let half = &self.half_m;
        let (point, outward) = match self.shape {
            Shape::Ellipsoid => (towards.component_mul(half), towards.component_div(half)),
            Shape::Box => {
                let axis = towards.component_div(half).iamax();
                let side = towards[axis].signum();
                let mut point = half.map(|h| rng.random_range(-h..h));
                point[axis] = half[axis] * side;
                (point, Vector3::ith(axis, side))
            }
            Shape::Cylinder => {
                let around = Vector3::new(towards.x, towards.y, 0.0).normalize();
                (around * half.x + Vector3::z() * rng.random_range(-half.z..half.z), around)
            }
        };
        Contact::new(Point3::from(point), -outward, friction).expect("a contact")
    }
}

fn direction(rng: &mut ChaCha8Rng) -> Vector3<f64> {
    loop {
        let v = Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0_f64));
        if (0.01..1.0).contains(&v.norm()) {
            return v.normalize();
        }
    }
}

/// Directions of `count` contacts: anywhere, in opposing pairs, or a thumb opposite to the other fingers.
fn directions(rng: &mut ChaCha8Rng, count: usize) -> Vec<Vector3<f64>> {
    let thumb = direction(rng);
    let arrangement = rng.random_range(0..3);
    let mut all = vec![thumb];
    while all.len() < count {
        let near = |centre: Vector3<f64>, spread: f64, rng: &mut ChaCha8Rng| {
            (centre + direction(rng) * spread).normalize()
        };
        all.push(match arrangement {
            0 => direction(rng),
            1 if all.len() % 2 == 1 => near(-all[all.len() - 1], 0.2, rng),
            1 => direction(rng),
            _ => near(-thumb, 0.8, rng),
        });
    }
    all
}

/// A random grasp, closed or not.
pub fn random(rng: &mut ChaCha8Rng, count: usize, friction: f64) -> Grasp {
    let body = Body::random(rng);
    let directions = directions(rng, count);
    let contacts = directions.iter().map(|towards| body.contact(towards, friction, rng)).collect();
    Grasp::new(contacts, body.radius_m())
}

/// Contacts around the equator of the unit sphere, turned at random, each moved by up to `noise`: as round as wrenches
/// get.
pub fn equator(rng: &mut ChaCha8Rng, count: usize, friction: f64, noise: f64) -> Grasp {
    let phase = rng.random_range(-PI..PI);
    let contact = |k: usize| {
        let (sin, cos) = (phase + TAU * k as f64 / count as f64).sin_cos();
        let moved = Vector3::new(cos, sin, 0.0) + direction(rng) * noise;
        let p = moved.normalize();
        Contact::new(Point3::from(p), -p, friction).expect("a contact")
    };
    Grasp::new((0..count).map(contact).collect(), 1.0)
}

/// Contacts within `width` of a line: wrenches nearly as flat as a board.
pub fn near_a_line(rng: &mut ChaCha8Rng, count: usize, friction: f64, width: f64) -> Grasp {
    let contact = |_| {
        let off_line = direction(rng) * width;
        let point = Vector3::x() * rng.random_range(-1.0..1.0) + off_line;
        Contact::new(Point3::from(point), direction(rng), friction).expect("a contact")
    };
    Grasp::new((0..count).map(contact).collect(), 1.0)
}
