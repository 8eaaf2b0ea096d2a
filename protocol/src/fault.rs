//! Numbers for everything that can go wrong. Numbers are never reused and never change their meaning.
//!
//! | numbers | what | effect |
//! |---|---|---|
//! | 0 | nothing | |
//! | 1 to 31 | [`Refusal`]: a message is not obeyed | none |
//! | 32 to 95 | [`Fault`]: the hand no longer trusts itself | torque stops or goes |
//! | 96 to 127 | [`Limit`]: less is done than was asked | torque is held back |
//!
//! A number that an end does not know comes from a newer one and is shown as a number.

use serde::{Deserialize, Serialize};

macro_rules! numbered {
    (
        $(#[$doc:meta])*
        $name:ident, $low:literal to $high:literal,
        $($(#[$variant_doc:meta])* $variant:ident = $number:literal, $text:literal;)*
    ) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        #[repr(u8)]
        #[non_exhaustive]
        pub enum $name {
            $($(#[$variant_doc])* $variant = $number,)*
        }

        impl $name {
            /// All that exist, by number.
            pub const ALL: &'static [Self] = &[$(Self::$variant,)*];

            /// The number on the wire.
            #[must_use]
            pub const fn number(self) -> u8 {
                self as u8
            }

            /// What a number stands for; `None` if nothing here.
            #[must_use]
            pub const fn from_number(number: u8) -> Option<Self> {
                match number {
                    $($number => Some(Self::$variant),)*
                    _ => None,
                }
            }

            /// What it is, in words.
            #[must_use]
            pub const fn text(self) -> &'static str {
                match self {
                    $(Self::$variant => $text,)*
                }
            }
        }

        $(const _: () = assert!($low <= $number && $number <= $high);)*
    };
}

numbered! {
    /// Why a message was not obeyed. The state of the hand is as before.
    Refusal, 1 to 31,
    /// The bytes are not a message of their kind.
    Malformed = 1, "the bytes are not a message";
    /// Bytes follow the message.
    TrailingBytes = 2, "bytes follow the message";
    /// No such kind of message, or it goes the other way.
    UnknownKind = 3, "the kind of message is not known";
    /// A cyclic message of the wrong length.
    WrongLength = 4, "the message has the wrong length";
    /// No parameter has this index.
    UnknownParameter = 5, "there is no such parameter";
    /// The value is of another type than the parameter.
    WrongType = 6, "the value has the wrong type";
    /// The value is outside the parameter's range, or no number.
    OutOfRange = 7, "the value is out of range";
    /// Not while a drive has torque.
    TorqueOn = 8, "not while torque is on";
    /// The sensor's reading is too far from zero to be an offset.
    NotAtZero = 9, "the reading is too far from zero to be an offset";
    /// A set names a joint that does not exist.
    UnknownJoint = 10, "there is no such joint";
    /// Nothing is recorded under this index.
    NoRecord = 11, "there is no such record";
    /// The last request has not been answered yet.
    Busy = 12, "the last request has not been answered yet";
    /// The answer does not fit into a frame.
    AnswerTooLong = 13, "the answer does not fit into a frame";
    /// The board has no flash for parameters.
    NoStorage = 14, "the board stores no parameters";
    /// The flash failed.
    StorageFailed = 15, "the flash did not take the parameters";
    /// Segments are followed only with torque, while the control word asks for them and the hand neither holds nor stops.
    NoSegmentsNow = 16, "segments are not followed now";
    /// No room for a segment.
    SegmentsFull = 17, "no more segments can wait";
    /// A segment that does not follow the one before; the first, and the first after a hold or a stop, replaces.
    SegmentMissing = 18, "a segment before this one is missing";
    /// A segment's time is less than a blend, more than a minute, or too little for its way.
    SegmentTime = 19, "the segment is too short, too long or too fast";
}

numbered! {
    /// Why torque stops or goes.
    Fault, 32 to 95,
    /// No frame has arrived for longer than the stop time.
    BusSilent = 32, "no set-point arrives";
    /// Frames arrive, but their set-point stays the same.
    SenderStuck = 33, "set-points arrive but do not advance";
    /// Control periods were missed one after the other.
    Overrun = 34, "control periods were missed";
    /// Control, bus or sensors did not check in.
    TaskSilent = 35, "a task did not check in";
    /// A sensor gave no number.
    SensorNotANumber = 36, "a sensor gave no number";
    /// A joint angle beyond what the mechanism can reach.
    PositionRange = 37, "a joint angle is beyond the mechanism's range";
    /// A joint angle jumped.
    PositionRate = 38, "a joint angle jumped";
    /// A joint angle stays although the joint must have moved.
    PositionStuck = 39, "a joint angle does not follow its joint";
    /// A joint torque beyond what the sensor's joint can bear.
    TorqueRange = 40, "a joint torque is beyond what the joint bears";
    /// A strain gauge stays although its drive changes.
    TorqueStuck = 41, "a strain gauge does not follow its drive";
    /// A fingertip wrench beyond what the fingertip can bear.
    WrenchRange = 42, "a fingertip wrench is beyond what the fingertip bears";
    /// The control law gave no number.
    OutputNotANumber = 43, "the control law gave no number";
}

numbered! {
    /// Why less is done than was asked.
    Limit, 96 to 127,
    /// The drive cannot give more torque.
    Torque = 96, "the drive gives no more torque";
    /// The fingertip may bear no more force.
    TipForce = 97, "the fingertip bears no more force";
    /// The target lies beyond the mechanism's range.
    Position = 98, "the target is beyond the joint's range";
    /// The target is no number.
    BadTarget = 99, "the target is no number";
    /// A sensor or the time step is no number.
    BadInput = 100, "a sensor gives no number";
    /// The joint is held by its brake.
    Braked = 101, "the joint is braked";
    /// The target moves faster than the joint may.
    Speed = 102, "the target moves faster than the joint may";
    /// Set-points are late: the last target holds.
    Held = 103, "set-points are late and the last target holds";
    /// A latched stop: the last target holds, damped.
    Stopped = 104, "stopped: the last target holds, damped";
}

/// A set of [`Limit`]s, one bit for each number from 96 on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct LimitSet(pub u32);

impl LimitSet {
    /// With this limit added.
    #[must_use]
    pub const fn with(self, limit: Limit) -> Self {
        Self(self.0 | 1 << (limit.number() - 96))
    }

    /// Whether the limit is in the set.
    #[must_use]
    pub const fn contains(self, limit: Limit) -> bool {
        self.0 >> (limit.number() - 96) & 1 == 1
    }
}

/// A number of this module as it comes over the wire, known or not.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Code(pub u8);

impl Code {
    /// Nothing is wrong.
    pub const NONE: Self = Self(0);

    /// What it is, in words; `None` for 0 and for numbers of newer versions.
    #[must_use]
    pub fn text(self) -> Option<&'static str> {
        let (refusal, fault) = (Refusal::from_number(self.0), Fault::from_number(self.0));
        refusal.map(Refusal::text).or(fault.map(Fault::text)).or(Limit::from_number(self.0).map(Limit::text))
    }
}

impl From<Refusal> for Code {
    fn from(refusal: Refusal) -> Self {
        Self(refusal.number())
    }
}

impl From<Fault> for Code {
    fn from(fault: Fault) -> Self {
        Self(fault.number())
    }
}

impl From<Limit> for Code {
    fn from(limit: Limit) -> Self {
        Self(limit.number())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::assert_golden_text;
    use std::format;
    use std::string::String;

    #[test]
    fn numbers_keep_their_meaning() {
        let table: String =
            (0..=u8::MAX).filter_map(|number| Some(format!("{number} {}\n", Code(number).text()?))).collect();
        assert_golden_text("codes.txt", &table);
        assert_eq!(table.lines().count(), Refusal::ALL.len() + Fault::ALL.len() + Limit::ALL.len());
    }

    #[test]
    fn sets_hold_what_is_put_into_them() {
        for &limit in Limit::ALL {
            let set = LimitSet::default().with(limit);
            assert!(Limit::ALL.iter().all(|&other| set.contains(other) == (other == limit)));
        }
    }
}
