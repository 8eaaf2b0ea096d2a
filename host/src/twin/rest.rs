//! Poses in which an object rests on the table: it is dropped, and the pose taken in which it comes to rest.

use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use rapier3d_f64::math::Vector;
use rapier3d_f64::prelude::ColliderBuilder;
use thiserror::Error;

use super::convert::project_pose;
use super::object::ObjectBody;
use super::plant::{GRAVITY, PlantError, STEP_S, engine_world};
use super::surface::{Part, surface};

/// Height from which it falls, metres.
const DROP_M: f64 = 0.002;
/// How long it may take to come to rest.
const MOST_S: f64 = 8.0;
/// Times between looks at it.
const LOOK_S: f64 = 0.25;
/// Motion between two looks that counts as rest, metres and radians.
const STILL_M: f64 = 2e-5;
const STILL_RAD: f64 = 1e-3;

/// Why an object has no resting pose.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum RestError {
    /// It cannot be simulated.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// It rolled or rocked until nobody waited any longer.
    #[error("it had not come to rest after {MOST_S} s")]
    Rolls,
}

/// The pose (of the object in a frame whose z = 0 is the table) in which `object` comes to rest when it is let go in
/// orientation `turn`, just above the table, whose friction coefficient is `friction`. Its own pose does not matter.
///
/// # Errors
/// [`RestError`]; round things roll, and another orientation may do better.
pub fn resting_pose(
    object: &ObjectBody,
    turn: UnitQuaternion<f64>,
    friction: f64,
) -> Result<Isometry3<f64>, RestError> {
    let lowest_m =
        object.pieces.iter().flatten().map(|corner| (turn * corner).z).fold(f64::INFINITY, f64::min);
    let from = Isometry3::from_parts(Translation3::new(0.0, 0.0, DROP_M - lowest_m), turn);
    let mut world = engine_world(&GRAVITY, STEP_S);
    let top = ColliderBuilder::halfspace(nalgebra::Unit::new_unchecked(Vector::Z));
    world.insert_collider(surface(top, Part::Table, friction), None);
    let body = ObjectBody { base_from_object: from, ..object.clone() }.insert(&mut world)?;
    let mut before = from;
    for _ in 0..(MOST_S / LOOK_S) as usize {
        for _ in 0..(LOOK_S / STEP_S) as usize {
            world.step();
        }
        let now = project_pose(world.bodies[body].position());
        let center = object.center_of_mass;
        let moved_m = (now * center - before * center).norm();
        if moved_m < STILL_M && now.rotation.angle_to(&before.rotation) < STILL_RAD {
            return Ok(now);
        }
        before = now;
    }
    Err(RestError::Rolls)
}
