//! What all messages share: the kind in the first byte, and why bytes are not a message.

use thiserror::Error;

/// First byte of a message. Numbers are never reused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum MessageKind {
    /// [`Setpoint`](crate::command::Setpoint), host to hand.
    Setpoint = 0x01,
    /// [`HandState`](crate::telemetry::HandState), hand to host.
    HandState = 0x81,
}

/// Why bytes of the right length are not a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum DecodeError {
    /// The first byte names another message.
    #[error("message kind {found:#04x} where {:#04x} was expected", *expected as u8)]
    Kind {
        /// The message that was asked for.
        expected: MessageKind,
        /// The first byte.
        found: u8,
    },
    /// A drive state that has no meaning.
    #[error("drive state {found} is not defined")]
    DriveState {
        /// The byte.
        found: u8,
    },
    /// A set names a finger that the hand does not have.
    #[error("finger set {found:#04x} names a finger that does not exist")]
    FingerSet {
        /// The byte.
        found: u8,
    },
    /// A set names a joint that the hand does not have.
    #[error("joint set {found:#06x} names a joint that does not exist")]
    JointSet {
        /// The two bytes.
        found: u16,
    },
}

impl MessageKind {
    /// Checks a first byte.
    pub(crate) fn expect(self, found: u8) -> Result<(), DecodeError> {
        if found == self as u8 { Ok(()) } else { Err(DecodeError::Kind { expected: self, found }) }
    }
}
