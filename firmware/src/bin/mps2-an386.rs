//! The image for QEMU: checks its arithmetic, reports and ends.
#![no_std]
#![no_main]

use core::fmt::Write;

use cortex_m as _; // its critical section
use cortex_m_rt::entry;
use firmware::board::mps2_an386::{Console, exit};
use firmware::selfcheck::kinematics_digest;

/// Seed of the poses; the host computes the digest with the same.
const SEED: u32 = 1;

#[entry]
fn main() -> ! {
    let digest = kinematics_digest(SEED);
    let reported = writeln!(Console::open(), "kinematics_digest seed={SEED} fnv1a64={digest:016x}");
    exit(u32::from(reported.is_err()))
}
