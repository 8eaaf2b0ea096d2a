//! The parts of an execution, and which follows which.

use super::outcome::Trouble;

/// Parts of an execution.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// At the approach site: the hand takes its pregrasp and the thumb its rotation.
    Prepare,
    /// Straight to the grasp site.
    Advance,
    /// All fingers to the surface.
    Close,
    /// The grip grows.
    Squeeze,
    /// Straight up.
    Lift,
    /// Still.
    Hold,
    /// To and fro along each axis of the base.
    Shake,
    /// The palm comes to rest where it is. Only when the course is left.
    Stop,
    /// Straight down, to where it was lifted from.
    Lower,
    /// The grip ends.
    Release,
    /// All fingers from the surface.
    Open,
    /// Straight back to the approach site; where the object was lost, to the height of the lift.
    Retreat,
}

impl Phase {
    /// All phases, in the order of an execution that goes well.
    pub const ALL: [Self; 12] = [
        Self::Prepare,
        Self::Advance,
        Self::Close,
        Self::Squeeze,
        Self::Lift,
        Self::Hold,
        Self::Shake,
        Self::Stop,
        Self::Lower,
        Self::Release,
        Self::Open,
        Self::Retreat,
    ];

    /// Lower-case name, as in reports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Prepare => "prepare",
            Self::Advance => "advance",
            Self::Close => "close",
            Self::Squeeze => "squeeze",
            Self::Lift => "lift",
            Self::Hold => "hold",
            Self::Shake => "shake",
            Self::Stop => "stop",
            Self::Lower => "lower",
            Self::Release => "release",
            Self::Open => "open",
            Self::Retreat => "retreat",
        }
    }

    /// What follows; `None` after the last.
    pub(super) fn next(self, trouble: Option<Trouble>) -> Option<Self> {
        Some(match (self, trouble) {
            (Self::Prepare, _) => Self::Advance,
            (Self::Advance, _) => Self::Close,
            (Self::Close, _) => Self::Squeeze,
            (Self::Squeeze, Some(Trouble::Missed)) => Self::Release,
            (Self::Squeeze, _) => Self::Lift,
            (Self::Lift, _) => Self::Hold,
            (Self::Hold, _) => Self::Shake,
            (Self::Shake, _) => Self::Lower,
            (Self::Stop, Some(Trouble::Obstructed)) => Self::Retreat,
            (Self::Stop, Some(Trouble::Lost)) => Self::Release,
            (Self::Stop, _) => Self::Lower,
            (Self::Lower, _) => Self::Release,
            (Self::Release, _) => Self::Open,
            (Self::Open, _) => Self::Retreat,
            (Self::Retreat, _) => return None,
        })
    }

    /// Whether the object should be in the hand and off the table.
    pub(super) const fn carries(self) -> bool {
        matches!(self, Self::Lift | Self::Hold | Self::Shake)
    }
}
