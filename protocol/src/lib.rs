//! What both ends of the bus agree on: the bytes.
//!
//! [`ids`] names fingers and joints and fixes their order; [`units`] holds the integers that stand for angles,
//! torques and forces on the wire; [`command`] and [`telemetry`] are the two cyclic messages, each of one length;
//! [`service`] is the channel for everything else, which may take its time; [`frame`] gets messages over a wire;
//! [`fault`] numbers what goes wrong; [`schema`] is the fingerprint of all that. [`mod@bench`] is not of the bus: by it a
//! simulated hand drives an emulated board.
//! No allocation, no panic, no floating point beyond the conversions in [`units`].
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

pub mod bench;
pub mod blackbox;
mod bytes;
pub mod command;
pub mod fault;
pub mod frame;
pub mod ids;
pub mod message;
pub mod schema;
pub mod service;
pub mod telemetry;
#[cfg(test)]
mod tests;
pub mod units;
