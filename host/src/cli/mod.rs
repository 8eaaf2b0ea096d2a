//! The commands of `prehend`, one file each.
pub mod quality;

/// How a command ended that did not fail.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// It did what was asked: exit status 0.
    Done,
    /// An honest no: exit status 1.
    No,
}
