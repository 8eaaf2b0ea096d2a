//! The hand that is not there: a simulated plant with sensors, and the firmware's control laws running on it.
//!
//! [`plant`] is the physics (hand, object and table in the rapier engine) and knows nothing of the firmware; [`Twin`] runs
//! the production control laws on the plant's sensors, in this process and on virtual time, and is the default
//! [`Link`](crate::link::Link). [`OnBus`] puts a whole controller on the plant instead, spoken to over its bus: the firmware's
//! image in QEMU, or the library that it is made of ([`InProcess`]). The plant shares no dynamics with the controller: the controller has none.
//!
//! What the plant leaves out: the elasticity of the drives, contacts of the hand with itself, rolling and torsional
//! friction of the rubber, and the arm's own dynamics (the palm goes exactly where it is sent).
mod board;
mod cell;
mod convert;
mod embedded;
mod finger;
mod hand;
mod object;
mod on_bus;
pub mod plant;
mod rest;
mod sensors;
mod surface;

pub use board::{Board, InProcess};
pub use cell::TICK_S;
pub use embedded::{Twin, TwinSettings};
pub use object::ObjectBody;
pub use on_bus::{Failure, OnBus, StartError};
pub use plant::{Friction, Plant, PlantError, Scene};
pub use rest::{RestError, resting_pose};
pub use sensors::SensorParameters;

#[cfg(test)]
mod tests;
