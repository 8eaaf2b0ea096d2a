//! Boards with the whole controller, one control period at a time: the image in QEMU, and the same library here.

use firmware::app::{Controller, Identity};
use protocol::bench::{FromBoard, ToBoard};
use thiserror::Error;

use crate::link::LinkError;
use crate::link::emulator::lockstep::Lockstep;

/// The control period of the image for QEMU, microseconds.
pub(super) const PERIOD_US: u32 = 1000;

/// A board on a simulated mechanism.
pub trait Board {
    /// One control period.
    ///
    /// # Errors
    /// [`LinkError::Lost`]: the board is gone.
    fn tick(&mut self, frame: &ToBoard) -> Result<FromBoard, LinkError>;

    /// Takes its power away; no period follows.
    fn kill(&mut self);
}

impl Board for Lockstep {
    fn tick(&mut self, frame: &ToBoard) -> Result<FromBoard, LinkError> {
        Self::tick(self, frame).map_err(|error| LinkError::Lost(Box::new(error)))
    }

    fn kill(&mut self) {
        Self::kill(self);
    }
}

/// The board has no power any more.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("the board has no power any more")]
struct Dead;

/// What the image for QEMU is made of, in this process: the same library, fed the same frames.
#[derive(Debug, Clone)]
pub struct InProcess(Option<Box<Controller>>);

impl Default for InProcess {
    fn default() -> Self {
        let identity = Identity { board: "mps2-an386", period_us: PERIOD_US, has_storage: true };
        Self(Some(Box::new(Controller::new(identity))))
    }
}

#[cfg(test)]
impl InProcess {
    /// The controller, while it has power.
    pub(super) fn controller(&self) -> Option<&Controller> {
        self.0.as_deref()
    }
}

impl Board for InProcess {
    fn tick(&mut self, frame: &ToBoard) -> Result<FromBoard, LinkError> {
        let controller = self.0.as_mut().ok_or_else(|| LinkError::Lost(Box::new(Dead)))?;
        // There is no flash here.
        Ok(controller.bench_period(frame, |_| false))
    }

    fn kill(&mut self) {
        self.0 = None;
    }
}
