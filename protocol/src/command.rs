//! Host to hand: the cyclic set-point.
//!
//! ```text
//! byte   0  kind, 0x01
//!        1  seq             u16
//!        3  t_us            u32
//!        7  position        13 x AngleQ
//!       33  feed_forward    13 x TorqueQ
//!       59  thumb.stiffness  3 x StiffnessQ
//!       65  thumb.damping    3 x DampingQ
//!       71
//! ```
//!
//! All integers are little-endian, without padding. Arrays of joints are in the order of
//! [`JointId::ALL`](crate::ids::JointId::ALL).

use crate::bytes::{Field, Reader, Writer};
use crate::ids::JOINT_COUNT;
use crate::message::{DecodeError, MessageKind};
use crate::units::{AngleQ, DampingQ, StiffnessQ, TorqueQ};

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
        self.position.put(&mut out);
        self.feed_forward.put(&mut out);
        self.thumb.stiffness.put(&mut out);
        self.thumb.damping.put(&mut out);
        debug_assert!(out.0.is_empty());
    }

    /// Reads the message. The only wrong bytes are those of another kind; angles and torques are not judged here.
    ///
    /// # Errors
    ///
    /// [`DecodeError::Kind`].
    pub fn decode(bytes: &[u8; Self::LEN]) -> Result<Self, DecodeError> {
        let mut input = Reader(bytes);
        MessageKind::Setpoint.expect(Field::get(&mut input))?;
        let setpoint = Self {
            seq: Field::get(&mut input),
            t_us: Field::get(&mut input),
            position: Field::get(&mut input),
            feed_forward: Field::get(&mut input),
            thumb: ThumbImpedance { stiffness: Field::get(&mut input), damping: Field::get(&mut input) },
        };
        debug_assert!(input.0.is_empty());
        Ok(setpoint)
    }
}

const _: () = assert!(Setpoint::LEN == 71);
