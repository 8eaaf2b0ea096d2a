//! Instruction counts repeat exactly under QEMU, so they may gate: control has 21,250 cycles at 8 kHz and 170 MHz.

use hil_tests::figures;
use host::link::emulator::image;

#[test]
fn control_keeps_its_budget_and_counts_repeat() {
    let elf = image::build("mps2-an386").unwrap_or_else(|error| panic!("{error}"));
    let measured = figures::measure(&elf).unwrap_or_else(|error| panic!("{error}"));
    assert!(measured.tick_most_instructions < 6_000, "{measured:?}");
    assert!(measured.segment_tick_most_instructions < 6_000, "{measured:?}");
    // With a period's tick, and its exchange, a wait must fit into 125 us: docs/hardware.md.
    assert!(measured.fingers_instructions < 1_700 && measured.wait_most_instructions < 3_600, "{measured:?}");
    assert!(measured.thumb_instructions < 400, "{measured:?}");
    assert!(measured.state_frame_instructions < 1_800, "{measured:?}");
    // With all that counts; tests/boards.rs has the limits of what a board gets.
    assert!(measured.flash_bytes < 112 * 1024 && measured.ram_bytes < 48 * 1024, "{measured:?}");
    assert!(measured.stack_bytes < 4096, "{measured:?}");
    assert_eq!(figures::measure(&elf).unwrap_or_else(|error| panic!("{error}")), measured);
}
