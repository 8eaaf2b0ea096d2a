//! The hand controller: control laws, supervision and the hand's side of the bus, as a library that knows no board.
//!
//! [`app::Controller`] is the whole hand: bytes and sensors in, torques and bytes out, once a control period. It runs in
//! the images under `src/bin`, in `hil-tests` and, its [`control`] part, inside the host's twin.
#![no_std]

#[cfg(test)]
extern crate std;

pub mod app;
#[cfg(all(any(feature = "mps2-an386", feature = "_stm32"), target_os = "none"))]
pub mod board;
pub mod clock;
pub mod control;
pub mod figures;
pub mod finger_bus;
pub mod line;
pub mod parameters;
pub mod safety;
pub mod selfcheck;
pub mod session;
pub mod storage;
pub mod trig;
