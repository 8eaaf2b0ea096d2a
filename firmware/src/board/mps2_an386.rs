//! Arm's MPS2 board with the AN386 image, a Cortex-M4F, as QEMU emulates it: the board of the tests.
//!
//! It speaks to its host by semihosting: text goes to QEMU's standard output, [`exit`] ends QEMU with a status, and
//! [`Bench`] exchanges sensors, torques and bus with a simulated hand. While it waits for that, time stands still.
#![allow(unsafe_code, reason = "semihosting is a breakpoint that the debugger answers")]

use core::ffi::CStr;
use core::fmt::{self, Write};
use core::panic::PanicInfo;

use cortex_m_semihosting::{nr, syscall, syscall1};
use protocol::bench::{FromBoard, ToBoard};

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
        Self(open(c":tt", nr::open::W_TRUNC))
    }
}

/// Handle of a file of the host's.
fn open(name: &'static CStr, mode: usize) -> usize {
    let block = [name.as_ptr() as usize, mode, name.to_bytes().len()];
    // SAFETY: SYS_OPEN reads a name of the given length, which is static, and answers a handle.
    unsafe { syscall(nr::OPEN, &block) }
}

/// Whether the image was started with this word on its command line, after its name.
#[must_use]
pub fn started_with(word: &str) -> bool {
    let mut line = [0_u8; 256];
    let mut block = [line.as_mut_ptr() as usize, line.len()];
    // SAFETY: SYS_GET_CMDLINE writes the line, at most as long as the block says, and its length into the block; both
    // outlive the call.
    if unsafe { syscall1(nr::GET_CMDLINE, block.as_mut_ptr() as usize) } != 0 {
        return false;
    }
    let words = line.get(..block[1]).unwrap_or(&[]).split(|&byte| byte == b' ' || byte == 0);
    words.skip(1).any(|other| other == word.as_bytes())
}

/// The simulated hand at the other end of two pipes.
#[derive(Debug)]
pub struct Bench {
    from: usize,
    to: usize,
}

impl Bench {
    /// Opens the pipes in the folder in which QEMU was started.
    #[must_use]
    pub fn open() -> Self {
        Self {
            to: open(c"from_board", nr::open::W_TRUNC_BINARY),
            from: open(c"to_board", nr::open::R_BINARY),
        }
    }

    /// Waits for the next control period; `None` when the other end is gone.
    pub fn read(&mut self) -> Option<ToBoard> {
        let mut bytes = [0_u8; ToBoard::LEN];
        let mut rest = &mut bytes[..];
        while !rest.is_empty() {
            let block = [self.from, rest.as_mut_ptr() as usize, rest.len()];
            // SAFETY: SYS_READ writes at most so many bytes there, which outlive the call, and answers how many it did
            // not write. A pipe gives what it has.
            let left = unsafe { syscall(nr::READ, &block) };
            let read = rest.len().checked_sub(left).filter(|&read| read > 0)?;
            rest = rest.get_mut(read..)?;
        }
        Some(ToBoard::decode(&bytes))
    }

    /// Ends the control period.
    ///
    /// # Errors
    ///
    /// The other end is gone.
    pub fn write(&mut self, frame: &FromBoard) -> fmt::Result {
        let mut bytes = [0_u8; FromBoard::LEN];
        frame.encode(&mut bytes);
        write(self.to, &bytes)
    }
}

/// Writes all of it.
fn write(handle: usize, bytes: &[u8]) -> fmt::Result {
    let block = [handle, bytes.as_ptr() as usize, bytes.len()];
    // SAFETY: SYS_WRITE reads the bytes, which outlive the call, and answers how many it left.
    match unsafe { syscall(nr::WRITE, &block) } {
        0 => Ok(()),
        _ => Err(fmt::Error),
    }
}

impl Write for Console {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        write(self.0, text.as_bytes())
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
