//! What can be read off the boards' images without running them.
#![allow(clippy::panic, reason = "helpers of tests end them as tests do")]

use std::path::Path;

use hil_tests::figures;
use host::link::emulator::image;
use object::{Object, ObjectSection, ObjectSymbol};

/// Interrupt handlers of each STM32 image, with their places in the vector table: the processor's 16 exceptions come first.
const BOARDS: [(&str, [(&str, usize); 3]); 2] = [
    ("stm32g474", [("TIM6_DAC", 54), ("DMA1_CHANNEL3", 13), ("LPTIM1", 49)]),
    ("stm32h563", [("TIM6", 49), ("GPDMA1_CHANNEL2", 29), ("LPTIM1", 64)]),
];
const EXCEPTIONS: usize = 16;

/// Most flash that an image may take: a fifth of the STM32G474's, and little of the STM32H563's 2 MB.
const FLASH_MAX: [u64; 2] = [96 * 1024, 128 * 1024];

/// Where flash begins.
const FLASH: u64 = 0x0800_0000;

fn built(board: &str) -> (std::path::PathBuf, Vec<u8>) {
    let elf = image::build(board).unwrap_or_else(|error| panic!("{error}"));
    let bytes = std::fs::read(&elf).unwrap_or_else(|error| panic!("{}: {error}", elf.display()));
    (elf, bytes)
}

/// A Cortex-M4F and an M33 have no unit for it: one sine would take two thousand instructions.
fn computes_nothing_in_double_precision(path: &Path, elf: &object::File<'_>) {
    let names: Vec<_> = elf.symbols().filter_map(|symbol| symbol.name().ok()).collect();
    assert!(names.iter().any(|name| name.contains("firmware")), "{}: it has its names", path.display());
    for helper in
        ["__aeabi_d", "__aeabi_f2d", "__aeabi_i2d", "__aeabi_ui2d", "__adddf3", "__muldf3", "__divdf3"]
    {
        assert!(!names.iter().any(|name| name.starts_with(helper)), "{}: {helper}", path.display());
    }
}

#[test]
fn no_image_computes_in_double_precision() {
    for board in ["mps2-an386", "stm32g474", "stm32h563"] {
        let (path, bytes) = built(board);
        let elf = object::File::parse(&*bytes).unwrap_or_else(|error| panic!("{board}: {error}"));
        computes_nothing_in_double_precision(&path, &elf);
    }
}

#[test]
fn images_fit_and_leave_the_parameters_their_pages() {
    for ((board, _), flash_max) in BOARDS.into_iter().zip(FLASH_MAX) {
        let (path, bytes) = built(board);
        let [flash, ram] = figures::elf_bytes(&path).unwrap_or_else(|error| panic!("{error}"));
        assert!(flash < flash_max && ram < 48 * 1024, "{board}: {flash} bytes of flash, {ram} of RAM");
        let elf = object::File::parse(&*bytes).unwrap_or_else(|error| panic!("{board}: {error}"));
        let at = |name| elf.symbol_by_name(name).unwrap_or_else(|| panic!("{board}: {name}")).address();
        let (start, end) = (at("_parameters_start"), at("_parameters_end"));
        assert!(start > FLASH + flash && end - start >= 2 * 2048, "{board}: {start:x} to {end:x}");
    }
}

#[test]
fn every_interrupt_has_its_handler() {
    // A handler that was not linked would be the default one, without a word of the linker's.
    for (board, handlers) in BOARDS {
        let (_, bytes) = built(board);
        let elf = object::File::parse(&*bytes).unwrap_or_else(|error| panic!("{board}: {error}"));
        let table = elf.section_by_name(".vector_table").unwrap_or_else(|| panic!("{board}: no vectors"));
        assert_eq!(table.address(), FLASH, "{board}");
        let words = table.data().unwrap_or_else(|error| panic!("{board}: {error}"));
        let vector = |at: usize| {
            let word = words[4 * at..4 * at + 4].try_into().map(u32::from_le_bytes);
            u64::from(word.unwrap_or_else(|error| panic!("{error}")))
        };
        let at = |name| elf.symbol_by_name(name).unwrap_or_else(|| panic!("{board}: {name}")).address();
        for (name, number) in handlers {
            assert_eq!(vector(EXCEPTIONS + number), at(name), "{board}: {name}");
            assert_ne!(at(name), at("DefaultHandler"), "{board}: {name}");
        }
        // The one that a word of flash raises that a failing supply has left half written.
        assert_ne!(vector(2), at("DefaultHandler"), "{board}: NonMaskableInt");
    }
}
