//! The bytes of one exchange with one finger board.

use protocol::frame::crc_32c;
use protocol::ids::JOINTS_PER_FINGER;
use protocol::units::{AngleQ, ForceQ, TipTorqueQ, TorqueQ};
use thiserror::Error;

/// Bytes of an exchange, in each direction.
pub const LEN: usize = 32;

/// Version of the frames, in the upper half of the second byte. A line that stands at 0 or 1 has another.
const VERSION: u8 = 0x10;
const VERSION_MASK: u8 = 0xf0;

/// Command: the drives of this finger give torque.
const ENABLE: u8 = 0x01;
/// Command: the rotation is an angle to go to. Thumb only.
const ROTATE: u8 = 0x02;

/// Reply: the drives give torque.
const ENABLED: u8 = 0x01;
/// Reply: the board does not trust itself: a drive or a sensor has failed.
const FAILED: u8 = 0x02;

/// Bytes that a command's CRC is over, and a reply's.
const COMMAND_BODY: usize = 10;
const REPLY_BODY: usize = LEN - CRC_LEN;
const CRC_LEN: usize = 4;

/// What a finger board is told.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Command {
    /// Counts exchanges, modulo 256.
    pub count: u8,
    /// Whether the drives are to give torque.
    pub enable: bool,
    /// Torques at the joints.
    pub torque: [TorqueQ; JOINTS_PER_FINGER],
    /// Where the thumb's rotation is to go; `None`: it is braked.
    pub rotation: Option<AngleQ>,
}

/// What a finger board tells.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Reply {
    /// Count of the last command that the board took before it made this reply.
    pub echo: u8,
    /// Whether the drives give torque.
    pub enabled: bool,
    /// Whether a drive or a sensor of the finger has failed; then its readings are not to be believed.
    pub failed: bool,
    /// Joint angles.
    pub angle: [AngleQ; JOINTS_PER_FINGER],
    /// Angle of the thumb's rotation; 0 on other fingers.
    pub rotation: AngleQ,
    /// Strain gauges.
    pub torque: [TorqueQ; JOINTS_PER_FINGER],
    /// Force on the fingertip.
    pub force: [ForceQ; 3],
    /// Moment on the fingertip.
    pub moment: [TipTorqueQ; 3],
}

/// Why bytes are no frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum ReplyError {
    /// The CRC does not fit.
    #[error("the finger's CRC is wrong")]
    Crc,
    /// Another version, or bits that have no meaning.
    #[error("the finger speaks another version")]
    Version,
}

impl Command {
    /// The bytes.
    pub fn encode(&self, out: &mut [u8; LEN]) {
        let rotate = if self.rotation.is_some() { ROTATE } else { 0 };
        let enable = if self.enable { ENABLE } else { 0 };
        let [a, b, c] = self.torque.map(|torque| torque.0);
        let angle = self.rotation.unwrap_or_default().0;
        out.fill(0);
        (out[0], out[1]) = (self.count, VERSION | enable | rotate);
        put(out, 2, [a, b, c, angle]);
        let crc = crc_32c(&out[..COMMAND_BODY]).to_le_bytes();
        out[COMMAND_BODY..COMMAND_BODY + CRC_LEN].copy_from_slice(&crc);
    }

    /// A command from its bytes: the finger board's part.
    ///
    /// # Errors
    ///
    /// Then the board goes on with its last command, and counts.
    pub fn decode(bytes: &[u8; LEN]) -> Result<Self, ReplyError> {
        check(&bytes[..COMMAND_BODY + CRC_LEN])?;
        let mode = bytes[1];
        if mode & VERSION_MASK != VERSION || mode & !(VERSION_MASK | ENABLE | ROTATE) != 0 {
            return Err(ReplyError::Version);
        }
        let [a, b, c, angle] = get(bytes, 2);
        Ok(Self {
            count: bytes[0],
            enable: mode & ENABLE != 0,
            torque: [a, b, c].map(TorqueQ),
            rotation: (mode & ROTATE != 0).then_some(AngleQ(angle)),
        })
    }
}

impl Reply {
    /// The bytes: the finger board's part.
    pub fn encode(&self, out: &mut [u8; LEN]) {
        let enabled = if self.enabled { ENABLED } else { 0 };
        let failed = if self.failed { FAILED } else { 0 };
        (out[0], out[1]) = (self.echo, VERSION | enabled | failed);
        put(out, 2, self.angle.map(|angle| angle.0));
        put(out, 8, [self.rotation.0]);
        put(out, 10, self.torque.map(|torque| torque.0));
        put(out, 16, self.force.map(|force| force.0));
        put(out, 22, self.moment.map(|moment| moment.0));
        let crc = crc_32c(&out[..REPLY_BODY]).to_le_bytes();
        out[REPLY_BODY..].copy_from_slice(&crc);
    }

    /// A reply from its bytes.
    ///
    /// # Errors
    ///
    /// The bytes are not what a board of this version sends.
    pub fn decode(bytes: &[u8; LEN]) -> Result<Self, ReplyError> {
        check(bytes)?;
        let state = bytes[1];
        if state & VERSION_MASK != VERSION || state & !(VERSION_MASK | ENABLED | FAILED) != 0 {
            return Err(ReplyError::Version);
        }
        let [rotation] = get(bytes, 8);
        Ok(Self {
            echo: bytes[0],
            enabled: state & ENABLED != 0,
            failed: state & FAILED != 0,
            angle: get(bytes, 2).map(AngleQ),
            rotation: AngleQ(rotation),
            torque: get(bytes, 10).map(TorqueQ),
            force: get(bytes, 16).map(ForceQ),
            moment: get(bytes, 22).map(TipTorqueQ),
        })
    }
}

/// Whether the last four bytes are the CRC of those before.
fn check(bytes: &[u8]) -> Result<(), ReplyError> {
    match bytes.split_last_chunk::<CRC_LEN>() {
        Some((body, crc)) if crc_32c(body) == u32::from_le_bytes(*crc) => Ok(()),
        _ => Err(ReplyError::Crc),
    }
}

fn put<const N: usize>(out: &mut [u8; LEN], at: usize, numbers: [i16; N]) {
    for (place, number) in out[at..].chunks_exact_mut(2).zip(numbers) {
        place.copy_from_slice(&number.to_le_bytes());
    }
}

fn get<const N: usize>(bytes: &[u8; LEN], at: usize) -> [i16; N] {
    core::array::from_fn(|i| i16::from_le_bytes([bytes[at + 2 * i], bytes[at + 2 * i + 1]]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const REPLY: Reply = Reply {
        echo: 7,
        enabled: true,
        failed: false,
        angle: [AngleQ(0x0102), AngleQ(-2), AngleQ(3)],
        rotation: AngleQ(0x0405),
        torque: [TorqueQ(1), TorqueQ(2), TorqueQ(-3)],
        force: [ForceQ(4), ForceQ(5), ForceQ(6)],
        moment: [TipTorqueQ(7), TipTorqueQ(8), TipTorqueQ(-9)],
    };

    #[test]
    fn bytes_are_where_they_are_drawn() {
        let mut bytes = [0xaa; LEN];
        let torque = [TorqueQ(0x0102), TorqueQ(-1), TorqueQ(3)];
        Command { count: 9, enable: true, torque, rotation: Some(AngleQ(0x0708)) }.encode(&mut bytes);
        assert_eq!(bytes[..10], [9, 0x13, 2, 1, 0xff, 0xff, 3, 0, 8, 7]);
        // CRC-32C of these ten bytes by another implementation (bit by bit, polynomial 0x82f63b78 reflected).
        assert_eq!(bytes[10..14], bitwise_crc_32c(&bytes[..10]).to_le_bytes());
        assert_eq!(bytes[14..], [0; 18]);
        REPLY.encode(&mut bytes);
        assert_eq!(bytes[..16], [7, 0x11, 2, 1, 0xfe, 0xff, 3, 0, 5, 4, 1, 0, 2, 0, 0xfd, 0xff]);
        assert_eq!(bytes[16..28], [4, 0, 5, 0, 6, 0, 7, 0, 8, 0, 0xf7, 0xff]);
        assert_eq!(bytes[28..], bitwise_crc_32c(&bytes[..28]).to_le_bytes());
    }

    /// The definition, as a finger board without a table computes it.
    fn bitwise_crc_32c(bytes: &[u8]) -> u32 {
        let step = |crc: u32| (crc >> 1) ^ (0x82f6_3b78 & (crc & 1).wrapping_neg());
        !bytes.iter().fold(!0, |crc, &byte| (0..8).fold(crc ^ u32::from(byte), |crc, _| step(crc)))
    }

    #[test]
    fn a_dead_line_is_no_reply() {
        for level in [0x00, 0xff, 0x55, 0xaa] {
            assert_eq!(Reply::decode(&[level; LEN]), Err(ReplyError::Crc), "{level:x}");
            assert_eq!(Command::decode(&[level; LEN]), Err(ReplyError::Crc), "{level:x}");
        }
    }

    #[test]
    fn no_one_or_two_wrong_bits_pass() {
        let mut good = [0; LEN];
        REPLY.encode(&mut good);
        let flip = |bytes: &mut [u8; LEN], bit: usize| bytes[bit / 8] ^= 1 << (bit % 8);
        for first in 0..LEN * 8 {
            for second in first..LEN * 8 {
                let mut bytes = good;
                flip(&mut bytes, first);
                if second != first {
                    flip(&mut bytes, second);
                }
                assert_eq!(Reply::decode(&bytes), Err(ReplyError::Crc), "{first} {second}");
            }
        }
    }

    proptest! {
        #[test]
        fn what_is_sent_is_received(
            numbers in any::<[i16; 13]>(), count in any::<u8>(), bits in any::<[bool; 3]>(),
        ) {
            let mut bytes = [0; LEN];
            let three = |at: usize| [numbers[at], numbers[at + 1], numbers[at + 2]];
            let command = Command {
                count,
                enable: bits[0],
                torque: three(0).map(TorqueQ),
                rotation: bits[1].then_some(AngleQ(numbers[3])),
            };
            command.encode(&mut bytes);
            prop_assert_eq!(Command::decode(&bytes), Ok(command));
            let reply = Reply {
                echo: count,
                enabled: bits[0],
                failed: bits[1],
                angle: three(0).map(AngleQ),
                rotation: AngleQ(numbers[3]),
                torque: three(4).map(TorqueQ),
                force: three(7).map(ForceQ),
                moment: three(10).map(TipTorqueQ),
            };
            reply.encode(&mut bytes);
            prop_assert_eq!(Reply::decode(&bytes), Ok(reply));
        }

        #[test]
        fn any_bytes_are_refused_or_are_the_frame_that_they_are(bytes in any::<[u8; LEN]>(), state in any::<u8>()) {
            prop_assert_eq!(Reply::decode(&bytes), Err(ReplyError::Crc));
            // With a CRC that fits, only the version and undefined bits are left to refuse by.
            let mut whole = bytes;
            whole[1] = state;
            let crc = crc_32c(&whole[..REPLY_BODY]).to_le_bytes();
            whole[REPLY_BODY..].copy_from_slice(&crc);
            match Reply::decode(&whole) {
                Ok(reply) => {
                    let mut again = [0; LEN];
                    reply.encode(&mut again);
                    prop_assert_eq!(again, whole);
                }
                Err(error) => {
                    prop_assert_eq!(error, ReplyError::Version);
                    prop_assert!(state & VERSION_MASK != VERSION || state & 0x0c != 0);
                }
            }
        }
    }
}
