//! The hand controller.
#![no_std]
