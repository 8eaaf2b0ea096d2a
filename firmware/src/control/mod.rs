//! The control laws: from joint angles, torques and a target to drive torques, one call for each control period.
//!
//! [`step`] is a function of its configuration, its state and its input: no I/O, no clock, no allocation, no `f64` and no
//! trigonometry of libm. What it could not do as asked it says for each joint in [`Limit`].
pub mod friction;
pub mod impedance;
pub mod limits;
pub mod pd;
pub mod quintic;
pub mod segments;
pub mod slip;
mod tick;
pub mod transition;

pub use limits::Limit;
pub use tick::{Config, Sensors, State, Target, ThumbMode, Torques, step};
