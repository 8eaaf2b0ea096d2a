//! The hand controller.
#![no_std]

#[cfg(test)]
extern crate std;

pub mod app;
#[cfg(all(feature = "mps2-an386", target_os = "none"))]
pub mod board;
pub mod control;
pub mod parameters;
pub mod safety;
pub mod selfcheck;
pub mod session;
pub mod trig;
