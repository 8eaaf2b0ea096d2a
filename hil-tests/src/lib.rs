//! Builds the firmware image and runs it in QEMU; damages frames by the million.
//!
//! The image is the one that a board would get, not a test build: what passes here is what ships. A machine without
//! QEMU or without the target's standard library fails these tests and says what to install; nothing is skipped.
#![forbid(unsafe_code)]

pub mod corruption;
pub mod figures;
