//! What the image costs: instructions counted in QEMU, bytes read off the ELF.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use object::{Object, ObjectSection, ObjectSegment, SectionKind};
use serde::Serialize;
use thiserror::Error;

use host::link::emulator::qemu::{Qemu, QemuError};

/// A run takes a fifth of a second; this is for a machine that is busy with other things.
const TIMEOUT: Duration = Duration::from_secs(120);

/// Where the RAM of every board begins; flash lies below.
const RAM: u64 = 0x2000_0000;

/// Why there are no figures.
#[derive(Debug, Error)]
pub enum FiguresError {
    /// The emulator did not run.
    #[error(transparent)]
    Qemu(#[from] QemuError),
    /// The image ended otherwise than it should, or what it printed is no list of figures.
    #[error("the image ended with {status} and printed: {stdout}")]
    Image {
        /// How it ended.
        status: String,
        /// The beginning of what it printed.
        stdout: String,
    },
    /// The ELF could not be read.
    #[error("{}: {source}", .path.display())]
    Read {
        /// The ELF.
        path: PathBuf,
        /// What went wrong.
        source: io::Error,
    },
    /// The file is no ELF.
    #[error("{}: {source}", .path.display())]
    Elf {
        /// The ELF.
        path: PathBuf,
        /// What is wrong with it.
        source: object::Error,
    },
}

/// Instructions and bytes. The names are those of the figures' JSON.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Figures {
    /// A control period of the whole hand, median.
    pub tick_instructions: u32,
    /// The longest control period of a thousand.
    pub tick_most_instructions: u32,
    /// The longest of a thousand in which segments are followed instead of set-points.
    pub segment_tick_most_instructions: u32,
    /// The thumb's impedance alone.
    pub thumb_instructions: u32,
    /// A state's message from its fields, CRC and stuffing.
    pub state_frame_instructions: u32,
    /// Receiving a set-point, median.
    pub receive_instructions: u32,
    /// Updating, framing and handing out a state, median.
    pub transmit_instructions: u32,
    /// Commands and replies of the four finger boards.
    pub fingers_instructions: u32,
    /// A state, or the longest reply: the most that control may have to wait for.
    pub wait_most_instructions: u32,
    /// Code and constants.
    pub flash_bytes: u64,
    /// Statics, among them the black box.
    pub ram_bytes: u64,
    /// Deepest stack of the run.
    pub stack_bytes: u32,
}

/// Counts an image on QEMU's mps2-an386.
///
/// # Errors
///
/// QEMU or the image does not run as it should, or the ELF is none.
pub fn measure(elf: &Path) -> Result<Figures, FiguresError> {
    // At 64 ns an instruction each is 1.6 steps of the board's 25 MHz timer, so that none is lost.
    let run = Qemu::new("mps2-an386", elf).instruction_shift(6).word("figures").run(TIMEOUT)?;
    let counts = Counts::parse(&run.stdout).filter(|_| run.status.success());
    let figures = counts.and_then(|counts| counts.figures(elf_bytes(elf)));
    let broken = || FiguresError::Image {
        status: run.status.to_string(),
        stdout: run.stdout.chars().take(500).collect(),
    };
    figures.ok_or_else(broken)?
}

/// Numbers by their name, in the order of printing.
struct Counts<'a>(BTreeMap<&'a str, Vec<u32>>);

impl<'a> Counts<'a> {
    fn parse(text: &'a str) -> Option<Self> {
        let mut counts = BTreeMap::<_, Vec<u32>>::new();
        for line in text.lines() {
            let (name, number) = line.split_once(' ')?;
            counts.entry(name).or_default().push(number.parse().ok()?);
        }
        Some(Self(counts))
    }

    /// The share `at` of these numbers that are not more, less what counting itself takes.
    fn quantile(&self, name: &str, at: f64) -> Option<u32> {
        let pick = |name: &str, at: f64| {
            let mut numbers = self.0.get(name)?.clone();
            numbers.sort_unstable();
            numbers.get(((numbers.len() - 1) as f64 * at).round() as usize).copied()
        };
        Some(pick(name, at)?.saturating_sub(pick("nothing", 0.5)?))
    }

    fn figures(&self, bytes: Result<[u64; 2], FiguresError>) -> Option<Result<Figures, FiguresError>> {
        // Half of the periods have a set-point: among the others nothing is received or sent.
        let with_setpoint = 0.75;
        // Were a finger without torque, less would be counted.
        let periods = self.0.get("tick")?.len();
        if self.0.get("enabled")? != &[periods as u32] || self.0.get("segments")?.len() != periods {
            return None;
        }
        let figures = Figures {
            tick_instructions: self.quantile("tick", 0.5)?,
            tick_most_instructions: self.quantile("tick", 1.0)?,
            segment_tick_most_instructions: self.quantile("segments", 1.0)?,
            thumb_instructions: self.quantile("thumb", 0.5)?,
            state_frame_instructions: self.quantile("state_frame", 0.5)?,
            receive_instructions: self.quantile("receive", with_setpoint)?,
            transmit_instructions: self.quantile("transmit", with_setpoint)?,
            fingers_instructions: self.quantile("fingers", 0.5)?,
            wait_most_instructions: self.quantile("serve", 1.0)?.max(self.quantile("report", 1.0)?),
            stack_bytes: *self.0.get("stack")?.first()?,
            flash_bytes: 0,
            ram_bytes: 0,
        };
        Some(bytes.map(|[flash_bytes, ram_bytes]| Figures { flash_bytes, ram_bytes, ..figures }))
    }
}

/// Bytes of flash and of RAM that an image takes; the stack is not among them.
///
/// # Errors
///
/// The file cannot be read, or is no ELF.
pub fn elf_bytes(path: &Path) -> Result<[u64; 2], FiguresError> {
    let bytes = fs::read(path).map_err(|source| FiguresError::Read { path: path.to_owned(), source })?;
    let elf =
        object::File::parse(&*bytes).map_err(|source| FiguresError::Elf { path: path.to_owned(), source })?;
    // What is in the file is flashed, the first values of statics too; what lies in RAM takes it, in the file or not.
    let flash = elf.segments().map(|segment| segment.file_range().1).sum();
    let in_ram = |kind| matches!(kind, SectionKind::Data | SectionKind::UninitializedData);
    let ram = elf.sections().filter(|section| section.address() >= RAM && in_ram(section.kind()));
    Ok([flash, ram.map(|section| section.size()).sum()])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_are_less_what_counting_takes() {
        let counts = Counts::parse("nothing 2\ntick 10\ntick 30\ntick 12\n").expect("a list");
        assert_eq!((counts.quantile("tick", 0.5), counts.quantile("tick", 1.0)), (Some(10), Some(28)));
        assert_eq!(counts.quantile("thumb", 0.5), None);
        assert!(Counts::parse("hello").is_none());
    }
}
