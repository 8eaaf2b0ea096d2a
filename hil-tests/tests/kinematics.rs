//! The Cortex-M4F computes the same numbers as the host.

use std::time::Duration;

use firmware::selfcheck::kinematics_digest;
use host::link::emulator::image;
use host::link::emulator::qemu::{Qemu, QemuError};

/// A run takes a fifth of a second; this is for a machine that is busy with other things.
const TIMEOUT: Duration = Duration::from_secs(120);

#[test]
fn the_board_agrees_with_the_host_to_the_last_bit_and_with_itself() {
    let elf = image::build("mps2-an386").unwrap_or_else(|error| panic!("{error}"));
    let qemu = Qemu::new("mps2-an386", &elf);
    let run = qemu.run(TIMEOUT).unwrap_or_else(|error| panic!("{error}"));
    assert!(run.status.success(), "{run:?}");
    assert_eq!(run.stdout, format!("kinematics_digest seed=1 fnv1a64={:016x}\n", kinematics_digest(1)));

    let again = qemu.run(TIMEOUT).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(again, run);
}

#[test]
fn an_image_that_does_not_end_is_killed() {
    let elf = image::build("mps2-an386").unwrap_or_else(|error| panic!("{error}"));
    // Started with its processor stopped.
    let stopped = Qemu::new("mps2-an386", &elf).argument("-S");
    match stopped.run(Duration::from_millis(500)) {
        Err(QemuError::TimedOut { stdout, .. }) => assert_eq!(stdout, ""),
        other => panic!("{other:?}"),
    }
}
