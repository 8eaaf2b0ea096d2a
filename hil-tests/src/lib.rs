//! Builds the firmware image and runs it in QEMU.
