//! What both ends of the bus agree on: the body.
#![no_std]
