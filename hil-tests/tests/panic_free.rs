//! What can be read off an image without running it.

use host::link::emulator::image;

#[test]
fn no_panic_is_reachable_from_the_bus_or_the_control_period() {
    // Its panic handler calls a function that does not exist.
    image::build("panic-free").unwrap_or_else(|error| panic!("{error}"));
}
