//! The service channel: everything that is not cyclic. Postcard behind the first byte, the kind.
//!
//! The host asks, the hand answers every [`Request`] with one [`Reply`] of the same `id`, one at a time and between
//! cyclic messages. A request does the same when it comes twice, so a host that hears nothing asks again.
//!
//! Postcard writes a variant by its place in the enum: variants are added at the end and never taken away, fields are
//! never added to one. Postcard would overlook bytes behind a message, by which an old end would misread a newer one; here
//! they are refused.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::blackbox::Record;
use crate::fault::{Code, Refusal};
use crate::frame::{Counters, MESSAGE_MAX};
use crate::ids::{FINGER_COUNT, JOINT_COUNT};
use crate::message::MessageKind;

/// A value of a parameter; the variant is its type.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Value {
    /// A number in the parameter's unit.
    F32(f32),
    /// A count.
    U32(u32),
    /// Yes or no.
    Bool(bool),
}

/// What is asked of the hand.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Call {
    /// Who are you? Answered by [`Answer::Hello`]. Neither the call nor the answer ever changes.
    Hello,
    /// Describe a parameter: [`Answer::ParameterInfo`].
    ParameterInfo {
        /// 0 to one less than [`Hello::parameters`].
        index: u16,
    },
    /// Read a parameter: [`Answer::Parameter`].
    ParameterGet {
        /// As of [`Self::ParameterInfo`].
        index: u16,
    },
    /// Change a parameter, while no drive has torque: [`Answer::Parameter`].
    ParameterSet {
        /// As of [`Self::ParameterInfo`].
        index: u16,
        /// Of the parameter's type and within its range.
        value: Value,
    },
    /// Take the present readings of joint torque sensors as zero, while no drive has torque: [`Answer::Done`].
    SensorZero {
        /// Bits of a [`JointSet`](crate::telemetry::JointSet).
        joints: u16,
    },
    /// What is in the black box: [`Answer::BlackBox`].
    BlackBox,
    /// A moment from the black box: [`Answer::Record`].
    BlackBoxRead {
        /// 0 to one less than [`BlackBox::full_rate`] + [`BlackBox::decimated`]: full rate first, oldest first.
        index: u16,
    },
    /// What the hand's end of the line has seen: [`Answer::Link`].
    Link,
    /// Keep the parameters as they are now beyond the power supply, while no drive has torque: [`Answer::Done`].
    ParameterSave,
    /// Put all parameters to their defaults, while no drive has torque; what is kept stays: [`Answer::Done`].
    ParameterDefaults,
    /// Go on straight to these angles, in the time from the end of the segment before; corners are blended. Followed while the
    /// control word [asks for it](crate::command::ControlWord::segments): [`Answer::Done`] when it waits.
    Segment {
        /// One more than that of the segment before; any if it replaces. The same number twice is the same segment.
        number: u16,
        /// Forget the segments before, also the one under way, and begin now.
        replaces: bool,
        /// Microseconds.
        time_us: u32,
        /// [`AngleQ`](crate::units::AngleQ)s.
        position: [i16; JOINT_COUNT],
    },
}

/// A call with the number by which its answer is known.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Request {
    /// Chosen by the host.
    pub id: u16,
    /// What is asked.
    pub call: Call,
}

/// Who the hand is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Hello<'a> {
    /// Version of the firmware.
    pub firmware: &'a str,
    /// [`VERSION`](crate::frame::VERSION) of the hand's end.
    pub protocol: u8,
    /// Name of the board.
    pub board: &'a str,
    /// [`FINGERPRINT`](crate::schema::FINGERPRINT) of the hand's end.
    pub schema: u64,
    /// How many parameters there are.
    pub parameters: u16,
}

/// What there is to know about a parameter besides its value. The type is that of `default`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ParameterInfo<'a> {
    /// Lower case with dots, for example `thumb.stiffness_x`.
    pub name: &'a str,
    /// As in `N/m`; empty for counts and for yes or no.
    pub unit: &'a str,
    /// Value after flashing.
    pub default: Value,
    /// Smallest value.
    pub min: Value,
    /// Largest value.
    pub max: Value,
}

/// What is in the black box.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct BlackBox {
    /// Records of consecutive control periods.
    pub full_rate: u16,
    /// Records of every so many control periods, reaching further back.
    pub decimated: u16,
    /// Whether recording has ended after a fault, until that is reset.
    pub frozen: bool,
    /// The first fault since the last reset.
    pub first_fault: Option<FirstFault>,
}

/// The first fault since the last reset. What follows from it is in the records.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct FirstFault {
    /// What it is.
    pub code: Code,
    /// Its finger, as [`FingerId::index`](crate::ids::FingerId::index); `None` for the whole hand.
    pub finger: Option<u8>,
    /// When, in the hand's time, microseconds, wrapping after 71 minutes.
    pub t_us: u32,
}

/// What the hand answers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Answer<'a> {
    /// To [`Call::Hello`].
    #[serde(borrow)]
    Hello(Hello<'a>),
    /// No: a [`Refusal`]'s number.
    Refused(Code),
    /// Done.
    Done,
    /// To [`Call::ParameterInfo`].
    ParameterInfo(ParameterInfo<'a>),
    /// To [`Call::ParameterGet`] and [`Call::ParameterSet`]: the value from now on.
    Parameter(Value),
    /// To [`Call::BlackBox`].
    BlackBox(BlackBox),
    /// To [`Call::BlackBoxRead`]: a [`Record`] of [`Record::LEN`] bytes.
    Record(&'a [u8]),
    /// To [`Call::Link`].
    Link(Counters),
}

/// An answer with the number of its request.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Reply<'a> {
    /// As in the request.
    pub id: u16,
    /// What the hand says.
    #[serde(borrow)]
    pub answer: Answer<'a>,
}

/// Something that happened. The numbers say what; no prose goes over the line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Event {
    /// The hand has started.
    Started,
    /// A drive changed its state: [`DriveState`](crate::telemetry::DriveState)s as their numbers.
    Drives {
        /// Of the hand.
        hand: u8,
        /// Of every finger.
        fingers: [u8; FINGER_COUNT],
    },
    /// A fault was found.
    Fault(FirstFault),
    /// The tier of bus loss changed: [`BusTier`](crate::telemetry::BusTier) as its number.
    Bus {
        /// The new tier.
        tier: u8,
    },
    /// A message was refused without an answer, for it had no id to answer to.
    Refused(Code),
    /// So many events were lost because nobody fetched them.
    Dropped {
        /// How many.
        events: u32,
    },
    /// Other fingertips slip than before: [`FingerSet`](crate::telemetry::FingerSet) as its bits.
    Slip {
        /// Those that slip now.
        fingers: u8,
    },
}

/// An event and its time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct LogRecord {
    /// When, in the hand's time, microseconds, wrapping after 71 minutes.
    pub t_us: u32,
    /// What.
    pub event: Event,
}

/// Why bytes are not the message that was expected, or a message is no bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum ServiceError {
    /// The first byte names another kind of message, or none.
    #[error("message kind {found:?} where {expected:?} was expected")]
    Kind {
        /// The kind asked for.
        expected: MessageKind,
        /// The first byte, if there is one.
        found: Option<u8>,
    },
    /// What follows the kind is not such a message.
    #[error("the bytes are no {kind:?}")]
    Malformed {
        /// The kind in the first byte.
        kind: MessageKind,
    },
    /// Bytes follow the message.
    #[error("{extra} bytes follow a {kind:?}")]
    TrailingBytes {
        /// The kind in the first byte.
        kind: MessageKind,
        /// How many.
        extra: usize,
    },
    /// The message does not fit.
    #[error("the message is longer than {MESSAGE_MAX} bytes")]
    TooLong,
}

impl ServiceError {
    /// The number under which a hand refuses it.
    #[must_use]
    pub const fn refusal(self) -> Refusal {
        match self {
            Self::Kind { .. } => Refusal::UnknownKind,
            Self::Malformed { .. } => Refusal::Malformed,
            Self::TrailingBytes { .. } => Refusal::TrailingBytes,
            Self::TooLong => Refusal::AnswerTooLong,
        }
    }
}

/// Puts the kind before the message.
fn encode<'b>(
    kind: MessageKind,
    message: &impl Serialize,
    buffer: &'b mut [u8; MESSAGE_MAX],
) -> Result<&'b [u8], ServiceError> {
    let [first, rest @ ..] = buffer;
    *first = kind as u8;
    let len = postcard::to_slice(message, rest).map_err(|_| ServiceError::TooLong)?.len();
    buffer.get(..=len).ok_or(ServiceError::TooLong)
}

/// Reads the whole message, or none of it.
fn decode<'a, M: Deserialize<'a>>(kind: MessageKind, bytes: &'a [u8]) -> Result<M, ServiceError> {
    let rest = match bytes.split_first() {
        Some((&first, rest)) if first == kind as u8 => rest,
        other => return Err(ServiceError::Kind { expected: kind, found: other.map(|(&first, _)| first) }),
    };
    match postcard::take_from_bytes(rest) {
        Ok((message, [])) => Ok(message),
        Ok((_, extra)) => Err(ServiceError::TrailingBytes { kind, extra: extra.len() }),
        Err(_) => Err(ServiceError::Malformed { kind }),
    }
}

macro_rules! message {
    ($name:ident $(<$life:lifetime>)?, $kind:ident) => {
        impl $(<$life>)? $name $(<$life>)? {
            /// Writes the message into `buffer` and returns its bytes, the kind first.
            ///
            /// # Errors
            ///
            /// [`ServiceError::TooLong`].
            pub fn encode<'b>(&self, buffer: &'b mut [u8; MESSAGE_MAX]) -> Result<&'b [u8], ServiceError> {
                encode(MessageKind::$kind, self, buffer)
            }

            /// Reads the message from all of `bytes`, the kind first.
            ///
            /// # Errors
            ///
            /// Another kind, bytes that are no such message, bytes behind it.
            pub fn decode(bytes: message!(@slice $($life)?)) -> Result<Self, ServiceError> {
                decode(MessageKind::$kind, bytes)
            }
        }
    };
    (@slice) => { &[u8] };
    (@slice $life:lifetime) => { &$life [u8] };
}

message!(Request, Request);
message!(Reply<'a>, Reply);
message!(LogRecord, Log);

const _: () = assert!(Record::LEN + 8 <= MESSAGE_MAX, "a record fits into a reply");

#[cfg(test)]
mod tests;
