//! What both ends of the bus agree on: the bytes.
#![no_std]
