//! A line to the image in QEMU: the bus's bytes go in the frames of the lock-step, and a hand at rest is simulated.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use protocol::bench::{BUS_MAX, BusBytes, ToBoard};
use protocol::ids::{FingerJoint, JointId};
use thiserror::Error;

use super::image::{self, ImageError};
use super::lockstep::{Lockstep, LockstepError};
use crate::link::port::{Port, PortError};

/// The image and its control period.
const BOARD: &str = "mps2-an386";
const PERIOD_US: u32 = 1000;

/// Why there is no emulated hand.
#[derive(Debug, Error)]
pub enum EmulatorError {
    /// There is no such image.
    #[error("{}: {source}", .path.display())]
    Elf {
        /// What was named.
        path: PathBuf,
        /// Why it cannot be read.
        source: io::Error,
    },
    /// The image could not be built.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// The emulator did not start.
    #[error(transparent)]
    Lockstep(#[from] LockstepError),
}

/// The ELF that is named, or the project's own, built.
///
/// # Errors
/// There is no such file, or cargo does not build.
pub fn find_image(elf: Option<&Path>) -> Result<PathBuf, EmulatorError> {
    match elf {
        Some(elf) => {
            fs::metadata(elf).map_err(|source| EmulatorError::Elf { path: elf.to_owned(), source })?;
            Ok(elf.to_owned())
        }
        None => Ok(image::build(BOARD)?),
    }
}

/// The image in QEMU, its joints at rest. Time there passes only while one waits for its bytes.
#[derive(Debug)]
pub struct EmulatorPort {
    board: Lockstep,
    sensors: ToBoard,
    /// Bytes that the image has not been given yet.
    waiting: Vec<u8>,
}

impl EmulatorPort {
    /// Starts an image, or builds and starts the project's own.
    ///
    /// # Errors
    /// Cargo or QEMU does not do its part.
    pub fn start(elf: Option<&Path>) -> Result<Self, EmulatorError> {
        let elf = find_image(elf)?;
        let position_rad = JointId::ALL.map(|joint| match joint.finger_joint() {
            None | Some((_, FingerJoint::Abduction)) => 0.0,
            Some((_, FingerJoint::Flexion | FingerJoint::Middle)) => 0.2,
        });
        Ok(Self {
            board: Lockstep::start(&elf)?,
            sensors: ToBoard { position_rad, ..ToBoard::default() },
            waiting: Vec::new(),
        })
    }
}

impl Port for EmulatorPort {
    fn send(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.waiting.extend_from_slice(bytes);
        Ok(())
    }

    /// `wait` is the image's own time.
    fn receive(&mut self, wait: Duration) -> Result<Vec<u8>, PortError> {
        let periods = (wait.as_micros() / u128::from(PERIOD_US)).max(1);
        for _ in 0..periods {
            let now = self.waiting.len().min(BUS_MAX);
            self.sensors.bus = BusBytes::new(&self.waiting[..now]).unwrap_or_default();
            self.waiting.drain(..now);
            self.sensors.now_us = self.sensors.now_us.wrapping_add(PERIOD_US);
            let answer = self.board.tick(&self.sensors).map_err(io::Error::other).map_err(PortError::Lost)?;
            if !answer.bus.as_slice().is_empty() {
                return Ok(answer.bus.as_slice().to_vec());
            }
        }
        Ok(Vec::new())
    }
}
