//! Arm's MPS2 board with the AN386 image, a Cortex-M4F, as QEMU emulates it: the board of the tests.
//!
//! It speaks to its host by semihosting: text goes to QEMU's standard output and [`exit`] ends QEMU with a status.
#![allow(unsafe_code, reason = "semihosting is a breakpoint that the debugger answers")]

use core::fmt::{self, Write};
use core::panic::PanicInfo;

use cortex_m_semihosting::{nr, syscall};

/// `SYS_EXIT_EXTENDED` of Arm's semihosting specification 2.0: unlike `SYS_EXIT` it takes a status on 32-bit targets.
const SYS_EXIT_EXTENDED: usize = 0x20;
/// The reason of an orderly end, `ADP_Stopped_ApplicationExit`.
const APPLICATION_EXIT: usize = 0x2_0026;
/// Status after a panic, as that of a Rust process.
const PANIC_STATUS: u32 = 101;

/// QEMU's standard output.
#[derive(Debug)]
pub struct Console(usize);

impl Console {
    /// Opens the console. Writing fails if the host refuses it.
    #[must_use]
    pub fn open() -> Self {
        const NAME: &[u8] = b":tt\0";
        let block = [NAME.as_ptr() as usize, nr::open::W_TRUNC, NAME.len() - 1];
        // SAFETY: SYS_OPEN reads a name of the given length, which is static, and answers a handle.
        Self(unsafe { syscall(nr::OPEN, &block) })
    }
}

impl Write for Console {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        let block = [self.0, text.as_ptr() as usize, text.len()];
        // SAFETY: SYS_WRITE reads the bytes of `text`, which outlives the call, and answers how many it left.
        match unsafe { syscall(nr::WRITE, &block) } {
            0 => Ok(()),
            _ => Err(fmt::Error),
        }
    }
}

/// Ends QEMU with this status.
pub fn exit(status: u32) -> ! {
    let block = [APPLICATION_EXIT, status as usize];
    loop {
        // SAFETY: SYS_EXIT_EXTENDED reads the two words of the block. It does not return under QEMU.
        unsafe { syscall(SYS_EXIT_EXTENDED, &block) };
    }
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    // The status tells of the panic even when the console does not take the text.
    let _ = writeln!(Console::open(), "{info}");
    exit(PANIC_STATUS)
}
