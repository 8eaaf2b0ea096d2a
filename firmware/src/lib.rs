//! The hand controller.
#![no_std]

#[cfg(test)]
extern crate std;

#[cfg(all(feature = "mps2-an386", target_os = "none"))]
pub mod board;
pub mod control;
pub mod safety;
pub mod selfcheck;
pub mod trig;
