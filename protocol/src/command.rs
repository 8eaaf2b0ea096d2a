//! Host to hand: the cyclic set-point.
//!
//! ```text
//! byte   0  kind, 0x01
//!        1  seq             u16
//!        3  t_us            u32
//!        7  control         u16
//!        9  position        13 x AngleQ
//!       35  feed_forward    13 x TorqueQ
//!       61  thumb.stiffness  3 x StiffnessQ
//!       67  thumb.damping    3 x DampingQ
//!       73
//! ```
//!
//! All integers are little-endian, without padding. Arrays of joints are in the order of
//! [`JointId::ALL`](crate::ids::JointId::ALL).

use crate::bytes::{Field, Reader, Writer};
use crate::ids::JOINT_COUNT;
use crate::message::{DecodeError, MessageKind};
use crate::telemetry::FingerSet;
use crate::units::{AngleQ, DampingQ, StiffnessQ, TorqueQ};

/// What the drives are to do, after CiA 402.
///
/// ```text
/// bit  0  switch on              bit  4  thumb as a spring at its tip (0: joint by joint)
///      1  enable voltage              7  reset a fault, on its rising edge
///      2  0 is a quick stop        8-11  fingers that take part, bit 8 + FingerId
///      3  enable operation         12  positions are those of segments, not of the set-point
/// ```
///
/// The other bits must be 0: a hand that does not know one refuses the set-point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ControlWord(u16);

impl ControlWord {
    /// Torque and power off.
    pub const DISABLE_VOLTAGE: Self = Self(0x00);
    /// Come to a stop and stay there.
    pub const QUICK_STOP: Self = Self(0x02);
    /// The first step to torque: be ready to switch on.
    pub const SHUTDOWN: Self = Self(0x06);
    /// The second step: power on, no torque yet.
    pub const SWITCH_ON: Self = Self(0x07);
    /// The third step: follow set-points.
    pub const ENABLE_OPERATION: Self = Self(0x0f);
    /// Reset a fault.
    pub const FAULT_RESET: Self = Self(0x80);

    const THUMB_IMPEDANCE: u16 = 0x10;
    const FINGER_SHIFT: u32 = 8;
    const SEGMENTS: u16 = 0x1000;
    /// Bits that have a meaning.
    const DEFINED: u16 = 0x1f9f;

    /// The word with these bits.
    ///
    /// # Errors
    ///
    /// [`DecodeError::ControlWord`] if one has no meaning.
    pub const fn from_bits(bits: u16) -> Result<Self, DecodeError> {
        if bits & !Self::DEFINED == 0 {
            Ok(Self(bits))
        } else {
            Err(DecodeError::ControlWord { found: bits })
        }
    }

    /// The bits.
    #[must_use]
    pub const fn bits(self) -> u16 {
        self.0
    }

    /// With these fingers taking part.
    #[must_use]
    pub const fn with_fingers(self, fingers: FingerSet) -> Self {
        Self(self.0 & !(0xf << Self::FINGER_SHIFT) | (fingers.bits() as u16) << Self::FINGER_SHIFT)
    }

    /// Fingers that take part.
    #[must_use]
    pub const fn fingers(self) -> FingerSet {
        FingerSet::truncated((self.0 >> Self::FINGER_SHIFT) as u8)
    }

    /// With the thumb as a spring at its tip.
    #[must_use]
    pub const fn with_thumb_impedance(self) -> Self {
        Self(self.0 | Self::THUMB_IMPEDANCE)
    }

    /// Whether the thumb is a spring at its tip.
    #[must_use]
    pub const fn thumb_impedance(self) -> bool {
        self.0 & Self::THUMB_IMPEDANCE != 0
    }

    /// With positions from [`Call::Segment`](crate::service::Call::Segment)s.
    #[must_use]
    pub const fn with_segments(self) -> Self {
        Self(self.0 | Self::SEGMENTS)
    }

    /// Whether positions come from segments.
    #[must_use]
    pub const fn segments(self) -> bool {
        self.0 & Self::SEGMENTS != 0
    }
}

/// Cartesian impedance of the thumb's tip, along the axes of the thumb's finger base frame.
///
/// The tip is drawn to where the commanded angles of the thumb put it. Zero stiffness and damping leave the
/// feed-forward torques alone in effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ThumbImpedance {
    /// Force per displacement of the tip, by x, y, z.
    pub stiffness: [StiffnessQ; 3],
    /// Force per speed of the tip, by x, y, z.
    pub damping: [DampingQ; 3],
}

/// What the hand is to do until the next set-point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Setpoint {
    /// Counts set-points up, wrapping; the hand echoes it.
    pub seq: u16,
    /// When the set-point is to hold, in the hand's time, microseconds, wrapping after 71 minutes.
    pub t_us: u32,
    /// What the drives are to do.
    pub control: ControlWord,
    /// Commanded joint angles.
    pub position: [AngleQ; JOINT_COUNT],
    /// Torques added to those of the control law. The thumb's rotation, which is braked in a grasp, ignores its own.
    pub feed_forward: [TorqueQ; JOINT_COUNT],
    /// How the thumb yields.
    pub thumb: ThumbImpedance,
}

impl Setpoint {
    /// Bytes of the message.
    pub const LEN: usize = u8::LEN
        + u16::LEN
        + u32::LEN
        + u16::LEN
        + <[AngleQ; JOINT_COUNT]>::LEN
        + <[TorqueQ; JOINT_COUNT]>::LEN
        + <[StiffnessQ; 3]>::LEN
        + <[DampingQ; 3]>::LEN;

    /// Writes the message.
    ///
    /// ```
    /// use protocol::command::Setpoint;
    /// let setpoint = Setpoint { seq: 7, ..Setpoint::default() };
    /// let mut bytes = [0; Setpoint::LEN];
    /// setpoint.encode(&mut bytes);
    /// assert_eq!(Setpoint::decode(&bytes), Ok(setpoint));
    /// ```
    pub fn encode(&self, bytes: &mut [u8; Self::LEN]) {
        let mut out = Writer(bytes);
        (MessageKind::Setpoint as u8).put(&mut out);
        self.seq.put(&mut out);
        self.t_us.put(&mut out);
        self.control.0.put(&mut out);
        self.position.put(&mut out);
        self.feed_forward.put(&mut out);
        self.thumb.stiffness.put(&mut out);
        self.thumb.damping.put(&mut out);
        debug_assert!(out.0.is_empty());
    }

    /// Reads the message. Angles and torques are not judged here.
    ///
    /// # Errors
    ///
    /// Another kind, a bit of the control word that has no meaning.
    pub fn decode(bytes: &[u8; Self::LEN]) -> Result<Self, DecodeError> {
        let mut input = Reader(bytes);
        MessageKind::Setpoint.expect(Field::get(&mut input))?;
        let setpoint = Self {
            seq: Field::get(&mut input),
            t_us: Field::get(&mut input),
            control: ControlWord::from_bits(Field::get(&mut input))?,
            position: Field::get(&mut input),
            feed_forward: Field::get(&mut input),
            thumb: ThumbImpedance { stiffness: Field::get(&mut input), damping: Field::get(&mut input) },
        };
        debug_assert!(input.0.is_empty());
        Ok(setpoint)
    }
}

const _: () = assert!(Setpoint::LEN == 73);
