//! The firmware's own image in QEMU, as a hand at the end of a line.
//!
//! The image is the one that a board would get, not a test build: what passes here is what ships.

pub mod image;
pub mod lockstep;
mod port;
pub mod qemu;

pub use port::{EmulatorError, EmulatorPort, find_image};
