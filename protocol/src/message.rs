//! What all messages share: the kind in the first byte, and why bytes are not a message.

use thiserror::Error;

/// First byte of a message. Numbers are never reused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum MessageKind {
    /// [`Setpoint`](crate::command::Setpoint), host to hand.
    Setpoint = 0x01,
    /// [`Request`](crate::service::Request), host to hand.
    Request = 0x02,
    /// [`HandState`](crate::telemetry::HandState), hand to host.
    HandState = 0x81,
    /// [`Reply`](crate::service::Reply), hand to host.
    Reply = 0x82,
    /// [`LogRecord`](crate::service::LogRecord), hand to host.
    Log = 0x83,
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
    /// A control word with bits that have no meaning.
    #[error("control word {found:#06x} has bits that are not defined")]
    ControlWord {
        /// The two bytes.
        found: u16,
    },
    /// A tier of bus loss that has no meaning.
    #[error("bus tier {found} is not defined")]
    BusTier {
        /// The byte.
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
    /// The kind that a message begins with; `None` for a byte that stands for none.
    #[must_use]
    pub const fn from_byte(byte: u8) -> Option<Self> {
        match byte {
            0x01 => Some(Self::Setpoint),
            0x02 => Some(Self::Request),
            0x81 => Some(Self::HandState),
            0x82 => Some(Self::Reply),
            0x83 => Some(Self::Log),
            _ => None,
        }
    }

    /// Checks a first byte.
    pub(crate) fn expect(self, found: u8) -> Result<(), DecodeError> {
        if found == self as u8 { Ok(()) } else { Err(DecodeError::Kind { expected: self, found }) }
    }
}
