//! What can be read off an image without running it.

use host::link::emulator::image;

#[test]
fn no_panic_is_reachable_from_the_bus_or_the_control_period() {
    // Its panic handler calls a function that does not exist.
    image::build("panic-free").unwrap_or_else(|error| panic!("{error}"));
}

#[test]
fn the_image_computes_nothing_in_double_precision() {
    // A Cortex-M4F has no unit for it: one sine would take two thousand instructions.
    let elf = image::build("mps2-an386").unwrap_or_else(|error| panic!("{error}"));
    let bytes = std::fs::read(&elf).unwrap_or_else(|error| panic!("{}: {error}", elf.display()));
    let names = |wanted: &[u8]| bytes.windows(wanted.len()).any(|window| window == wanted);
    assert!(names(b"kinematics_digest"), "the image has its names");
    for helper in ["__aeabi_dadd", "__aeabi_dmul", "__aeabi_ddiv", "__aeabi_f2d", "__aeabi_d2f"] {
        assert!(!names(helper.as_bytes()), "{helper}");
    }
}
