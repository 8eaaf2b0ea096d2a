//! One moment of the black box.
//!
//! ```text
//! byte   0  t_us      u32
//!        4  drive     u8
//!        5  fingers    4 x u8
//!        9  bus       u8
//!       10  fault     u8
//!       11  position  13 x AngleQ
//!       37  target    13 x AngleQ
//!       63  torque    13 x TorqueQ
//!       89  output    13 x TorqueQ
//!      115
//! ```

use crate::bytes::{Field, Reader, Writer};
use crate::fault::Code;
use crate::ids::{FINGER_COUNT, JOINT_COUNT};
use crate::message::DecodeError;
use crate::telemetry::{BusTier, DriveState};
use crate::units::{AngleQ, TorqueQ};

/// What the hand saw and did in one control period.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Record {
    /// When, in the hand's time, microseconds, wrapping after 71 minutes.
    pub t_us: u32,
    /// State of the hand.
    pub drive: DriveState,
    /// State of every finger.
    pub fingers: [DriveState; FINGER_COUNT],
    /// How long set-points had been missing.
    pub bus: BusTier,
    /// The first fault until then.
    pub fault: Code,
    /// Measured joint angles.
    pub position: [AngleQ; JOINT_COUNT],
    /// Angles that the control law was given.
    pub target: [AngleQ; JOINT_COUNT],
    /// Measured joint torques.
    pub torque: [TorqueQ; JOINT_COUNT],
    /// Torques that the drives were given.
    pub output: [TorqueQ; JOINT_COUNT],
}

impl Record {
    /// Bytes of a record.
    pub const LEN: usize = u32::LEN
        + u8::LEN
        + <[u8; FINGER_COUNT]>::LEN
        + u8::LEN
        + u8::LEN
        + 2 * <[AngleQ; JOINT_COUNT]>::LEN
        + 2 * <[TorqueQ; JOINT_COUNT]>::LEN;

    /// Writes the record.
    pub fn encode(&self, bytes: &mut [u8; Self::LEN]) {
        let mut out = Writer(bytes);
        self.t_us.put(&mut out);
        (self.drive as u8).put(&mut out);
        self.fingers.map(|state| state as u8).put(&mut out);
        (self.bus as u8).put(&mut out);
        self.fault.0.put(&mut out);
        self.position.put(&mut out);
        self.target.put(&mut out);
        self.torque.put(&mut out);
        self.output.put(&mut out);
        debug_assert!(out.0.is_empty());
    }

    /// Reads the record.
    ///
    /// # Errors
    ///
    /// A drive state or a bus tier that has no meaning.
    pub fn decode(bytes: &[u8; Self::LEN]) -> Result<Self, DecodeError> {
        let mut input = Reader(bytes);
        let t_us = Field::get(&mut input);
        let drive = DriveState::from_byte(Field::get(&mut input))?;
        let mut fingers = [DriveState::default(); FINGER_COUNT];
        for finger in &mut fingers {
            *finger = DriveState::from_byte(Field::get(&mut input))?;
        }
        let record = Self {
            t_us,
            drive,
            fingers,
            bus: BusTier::from_byte(Field::get(&mut input))?,
            fault: Code(Field::get(&mut input)),
            position: Field::get(&mut input),
            target: Field::get(&mut input),
            torque: Field::get(&mut input),
            output: Field::get(&mut input),
        };
        debug_assert!(input.0.is_empty());
        Ok(record)
    }
}

const _: () = assert!(Record::LEN == 115);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::assert_golden;

    #[test]
    fn golden_record() {
        let record = Record {
            t_us: 0x0403_0201,
            drive: DriveState::QuickStopActive,
            fingers: [1, 2, 3, 4].map(|i| DriveState::ALL[i]),
            bus: BusTier::Stop,
            fault: Code(0x20),
            position: core::array::from_fn(|i| AngleQ(0x1000 + i as i16)),
            target: core::array::from_fn(|i| AngleQ(-0x2000 - i as i16)),
            torque: core::array::from_fn(|i| TorqueQ(0x3000 + i as i16)),
            output: core::array::from_fn(|i| TorqueQ(-0x4000 - i as i16)),
        };
        let mut bytes = [0xee; Record::LEN];
        record.encode(&mut bytes);
        assert_golden("record.hex", &bytes);
        assert_eq!(Record::decode(&bytes), Ok(record));
        bytes[9] = 4;
        assert_eq!(Record::decode(&bytes), Err(DecodeError::BusTier { found: 4 }));
    }
}
