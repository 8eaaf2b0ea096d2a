//! What both ends of the bus agree on: the bytes.
//!
//! [`ids`] names fingers and joints and fixes their order; [`units`] holds the integers that stand for angles,
//! torques and forces on the wire; [`command`] and [`telemetry`] are the two cyclic messages, each of one length.
//! No allocation, no floating point beyond the conversions in [`units`].
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

mod bytes;
pub mod command;
pub mod frame;
pub mod ids;
pub mod message;
pub mod telemetry;
#[cfg(test)]
mod tests;
pub mod units;
