//! Arm's MPS2 board with the AN386 image, a Cortex-M4F, as QEMU emulates it: the board of the tests.
//!
//! It speaks to its host by semihosting: text goes to QEMU's standard output, [`exit`] ends QEMU with a status, and
//! [`Bench`] exchanges sensors, torques and bus with a simulated hand. While it waits for that, time stands still.
#![allow(unsafe_code, reason = "semihosting is a breakpoint that the debugger answers")]

use core::ffi::CStr;
use core::fmt::{self, Write};
use core::panic::PanicInfo;

use cortex_m_semihosting::{nr, syscall, syscall1};
use embedded_storage_async::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};
use protocol::bench::{FromBoard, ToBoard};

use crate::figures::Counter;

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

/// A flash as that of an STM32G474 in a file of the host's, in the folder in which QEMU was started: it outlasts the image.
#[derive(Debug)]
pub struct FileFlash(usize);

/// The file did not do what it was asked.
#[derive(Debug)]
pub struct FileError;

impl FileFlash {
    const PAGES: usize = 4;

    /// Opens the file, or makes one, erased.
    #[must_use]
    pub fn open() -> Option<Self> {
        const NONE: usize = usize::MAX;
        const NAME: &CStr = c"flash";
        let there = open(NAME, nr::open::RW_BINARY);
        if there != NONE {
            return Some(Self(there));
        }
        let made = open(NAME, nr::open::RW_TRUNC_BINARY);
        if made == NONE {
            return None;
        }
        let mut flash = Self(made);
        flash.fill(0, Self::PAGES * Self::ERASE_SIZE).ok()?;
        Some(flash)
    }

    fn seek(&mut self, offset: usize) -> Result<(), FileError> {
        let block = [self.0, offset];
        // SAFETY: SYS_SEEK reads the block.
        match unsafe { syscall(nr::SEEK, &block) } {
            0 => Ok(()),
            _ => Err(FileError),
        }
    }

    fn fill(&mut self, offset: usize, len: usize) -> Result<(), FileError> {
        self.seek(offset)?;
        for _ in 0..len / Self::WRITE_SIZE {
            write(self.0, &[0xff; Self::WRITE_SIZE]).map_err(|_| FileError)?;
        }
        Ok(())
    }
}

impl NorFlashError for FileError {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl ErrorType for FileFlash {
    type Error = FileError;
}

impl ReadNorFlash for FileFlash {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FileError> {
        self.seek(offset as usize)?;
        let block = [self.0, bytes.as_mut_ptr() as usize, bytes.len()];
        // SAFETY: SYS_READ writes at most so many bytes there, which outlive the call.
        match unsafe { syscall(nr::READ, &block) } {
            0 => Ok(()),
            _ => Err(FileError),
        }
    }

    fn capacity(&self) -> usize {
        Self::PAGES * Self::ERASE_SIZE
    }
}

impl NorFlash for FileFlash {
    const WRITE_SIZE: usize = 8;
    const ERASE_SIZE: usize = 2048;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), FileError> {
        self.fill(from as usize, to.saturating_sub(from) as usize)
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FileError> {
        self.seek(offset as usize)?;
        write(self.0, bytes).map_err(|_| FileError)
    }
}

/// Counts instructions with the first of the CMSDK timers, which runs down at 25 MHz. QEMU started with `-icount shift=6`
/// takes 64 ns for every instruction, which are 1.6 of the timer's steps.
#[derive(Debug)]
pub struct InstructionCounter(());

impl InstructionCounter {
    const CONTROL: *mut u32 = 0x4000_0000 as *mut u32;
    const VALUE: *mut u32 = 0x4000_0004 as *mut u32;
    const RELOAD: *mut u32 = 0x4000_000c as *mut u32;
    const ENABLE: u32 = 1;

    /// Starts the timer.
    #[must_use]
    pub fn start() -> Self {
        // SAFETY: registers of TIMER0, which nothing else uses.
        unsafe {
            Self::RELOAD.write_volatile(u32::MAX);
            Self::VALUE.write_volatile(u32::MAX);
            Self::CONTROL.write_volatile(Self::ENABLE);
        }
        Self(())
    }

    fn steps(&self) -> u32 {
        // SAFETY: as above.
        unsafe { Self::VALUE.read_volatile() }
    }
}

impl Counter for InstructionCounter {
    fn count<T>(&self, work: impl FnOnce() -> T) -> (u32, T) {
        let before = self.steps();
        let result = work();
        let steps = before.wrapping_sub(self.steps());
        ((steps * 5).div_ceil(8), result)
    }
}

/// How deep the stack has been.
#[derive(Debug)]
pub struct StackPaint {
    low: *mut u32,
    words: usize,
}

impl StackPaint {
    /// What unused stack is filled with.
    const PAINT: u32 = 0x5afe_57ac;
    /// Bytes below the stack pointer that are left alone: the frame of [`Self::apply`] itself.
    const MARGIN: usize = 256;

    /// Fills the stack that is not in use.
    #[must_use]
    pub fn apply() -> Self {
        unsafe extern "C" {
            /// Behind the last static; from the linker script of cortex-m-rt.
            static mut __euninit: u32;
        }
        let low = &raw mut __euninit;
        let top = cortex_m::register::msp::read() as usize - Self::MARGIN;
        let words = top.saturating_sub(low as usize) / size_of::<u32>();
        for i in 0..words {
            // SAFETY: between the statics and the stack pointer nothing lives.
            unsafe { low.add(i).write_volatile(Self::PAINT) };
        }
        Self { low, words }
    }

    /// Bytes of stack below [`Self::apply`]'s caller that have been used since.
    #[must_use]
    pub fn used_bytes(&self) -> usize {
        // SAFETY: words that were filled, read as what they are.
        let untouched =
            (0..self.words).take_while(|&i| unsafe { self.low.add(i).read_volatile() } == Self::PAINT);
        (self.words - untouched.count()) * size_of::<u32>() + Self::MARGIN
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
