//! Frames: how a message gets over a wire that loses, adds and changes bytes.
//!
//! ```text
//! byte 0      delimiter, 0x00
//!      1      first code of the byte stuffing
//!      2      version of the protocol     -+
//!      3      seq, u16                     |
//!      5      message, 1 to 246 bytes      | stuffed: no byte of it is 0x00 on the wire
//!      n      CRC-32C of the above, u32   -+
//!      n + 4  delimiter, 0x00
//! ```
//!
//! A delimiter on both sides costs a byte and saves a frame: what came before the first one, garbage or half a frame, ends
//! there, so the frame that follows any garbage is itself received.
//!
//! `seq` counts the frames of one sender. It tells what the line lost from what was never sent; that a *set-point* is new
//! says the set-point's own `seq`, for a thread that sends may live on when the one that thinks has stopped.
//!
//! # Why CRC-32C
//!
//! Byte stuffing takes the Hamming distance from a CRC: one wrong code byte moves zeros about, which is a long burst to
//! the CRC behind it. A 16-bit CRC lets two wrong bits in 200,000 through, the 32 bits of Castagnoli's polynomial none.
//!
//! # Why not the `cobs` crate
//!
//! The stuffing is COBS, so any implementation reads it. Ours is short of 254 bytes, for which COBS is a chain of
//! distances from zero to zero. So it is done in place: stuffing is one pass without a second buffer, and unstuffing follows
//! the chain and touches only the zeros, where the crate copies byte by byte.

mod stuffing;

use crc::{CRC_32_ISCSI, Crc, Table};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Version of the protocol. A frame of another version is counted and refused; what a frame is never changes, so every
/// end can read the version of every other.
pub const VERSION: u8 = 1;

/// Most bytes of a message.
pub const MESSAGE_MAX: usize = 246;

/// Bytes on the wire beside those of the message: two delimiters, one code, version, seq and CRC.
pub const OVERHEAD: usize = 10;

/// Most bytes of a frame on the wire.
pub const FRAME_MAX: usize = MESSAGE_MAX + OVERHEAD;

/// Ends every frame and begins the next; occurs nowhere within.
const DELIMITER: u8 = 0;
/// Version and seq.
const HEADER: usize = 3;
const CRC_LEN: usize = 4;
/// Most bytes between two delimiters: a code, then what is stuffed. A chain of distances holds for up to 254.
const STUFFED_MAX: usize = 1 + HEADER + MESSAGE_MAX + CRC_LEN;
const _: () = assert!(STUFFED_MAX <= 254 && FRAME_MAX == STUFFED_MAX + 2);

/// A table of 1 kB: on a Cortex-M4, 16 kB are no faster and none is eight times slower.
const CRC_32C: Crc<u32, Table<1>> = Crc::<u32, Table<1>>::new(&CRC_32_ISCSI);

/// CRC-32C (Castagnoli, as in iSCSI) of these bytes, as frames have it; other buses of the hand use the same.
#[must_use]
pub fn crc_32c(bytes: &[u8]) -> u32 {
    CRC_32C.checksum(bytes)
}

/// Why a message cannot be framed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("a message of {len} bytes; a frame holds 1 to {MESSAGE_MAX}")]
pub struct MessageLength {
    /// Bytes of the message.
    pub len: usize,
}

/// Makes frames and numbers them.
#[derive(Debug, Clone, Default)]
pub struct Framer {
    seq: u16,
}

impl Framer {
    /// Number of the next frame.
    #[must_use]
    pub const fn seq(&self) -> u16 {
        self.seq
    }

    /// Frames a message into `buffer` and returns the bytes for the wire, `message.len() + OVERHEAD` of them.
    ///
    /// # Errors
    ///
    /// [`MessageLength`] for an empty message or one that is too long. No number is used up.
    pub fn frame<'b>(
        &mut self,
        message: &[u8],
        buffer: &'b mut [u8; FRAME_MAX],
    ) -> Result<&'b [u8], MessageLength> {
        let len = message.len();
        let framed = self.frame_in_place(len, buffer, |place| place.copy_from_slice(message));
        framed.ok_or(MessageLength { len })
    }

    /// Frames a message of `len` bytes that `write` puts into its place in `buffer`, and returns the bytes for the wire,
    /// `len + OVERHEAD` of them. `None`, and no number used up, if a message cannot be so long or the buffer is too short.
    pub fn frame_in_place<'b>(
        &mut self,
        len: usize,
        buffer: &'b mut [u8],
        write: impl FnOnce(&mut [u8]),
    ) -> Option<&'b [u8]> {
        if !(1..=MESSAGE_MAX).contains(&len) {
            return None;
        }
        let wire = buffer.get_mut(..len + OVERHEAD)?;
        let ([first, code, version, seq @ ..], rest) = wire.split_first_chunk_mut::<{ 2 + HEADER }>()?;
        (*first, *code, *version) = (DELIMITER, 0, VERSION);
        seq.copy_from_slice(&self.seq.to_le_bytes());
        write(rest.get_mut(..len)?);
        let (last, stuffed) = wire.get_mut(1..)?.split_last_mut()?;
        *last = DELIMITER;
        let (body, crc) = stuffed.split_last_chunk_mut::<CRC_LEN>()?;
        *crc = CRC_32C.checksum(body.get(1..)?).to_le_bytes();
        stuffing::stuff(stuffed);
        self.seq = self.seq.wrapping_add(1);
        Some(wire)
    }
}

/// What a deframer has seen since it was made; every count wraps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Counters {
    /// Frames delivered.
    pub good: u32,
    /// Frames that the sender numbered and that did not arrive.
    pub lost: u32,
    /// Frames with the number of the one before; not delivered.
    pub repeated: u32,
    /// Bytes between delimiters too few for a frame.
    pub too_short: u32,
    /// Bytes between delimiters too many for a frame.
    pub too_long: u32,
    /// Stuffing that does not end where the frame does.
    pub stuffing: u32,
    /// Wrong CRC.
    pub checksum: u32,
    /// Right CRC, another version of the protocol.
    pub version: u32,
}

impl Counters {
    /// Everything that came over the wire and was thrown away.
    #[must_use]
    pub const fn refused(&self) -> u32 {
        self.repeated
            .wrapping_add(self.too_short)
            .wrapping_add(self.too_long)
            .wrapping_add(self.stuffing)
            .wrapping_add(self.checksum)
            .wrapping_add(self.version)
    }
}

/// A frame as it arrived.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Frame<'a> {
    /// Number that the sender gave it.
    pub seq: u16,
    /// 1 to [`MESSAGE_MAX`] bytes; the first is the kind.
    pub message: &'a [u8],
}

/// Finds the frames in a stream of bytes, however it is cut up and whatever lies between them.
///
/// ```
/// use protocol::frame::{Deframer, FRAME_MAX, Framer};
/// let (mut framer, mut deframer) = (Framer::default(), Deframer::default());
/// let mut buffer = [0; FRAME_MAX];
/// let frame = framer.frame(b"message", &mut buffer)?;
/// let mut noise: &[u8] = b"noise";
/// assert_eq!(deframer.receive(&mut noise), None);
/// let mut bytes = frame;
/// assert_eq!(deframer.receive(&mut bytes).map(|frame| frame.message), Some(&b"message"[..]));
/// # Ok::<(), protocol::frame::MessageLength>(())
/// ```
#[derive(Debug, Clone)]
pub struct Deframer {
    buffer: [u8; STUFFED_MAX],
    /// Bytes since the last delimiter; more than the buffer holds when there were too many.
    len: usize,
    last_seq: Option<u16>,
    counters: Counters,
    foreign_version: Option<u8>,
}

impl Default for Deframer {
    fn default() -> Self {
        Self {
            buffer: [0; STUFFED_MAX],
            len: 0,
            last_seq: None,
            counters: Counters::default(),
            foreign_version: None,
        }
    }
}

impl Deframer {
    /// Takes bytes off the front of `bytes` up to the end of the next good frame and returns that, or takes them all and
    /// returns `None`. Call it until it does.
    pub fn receive(&mut self, bytes: &mut &[u8]) -> Option<Frame<'_>> {
        loop {
            let mut pieces = bytes.splitn(2, |&byte| byte == DELIMITER);
            self.append(pieces.next().unwrap_or(&[]));
            let rest = pieces.next();
            *bytes = rest.unwrap_or(&[]);
            rest?;
            let len = core::mem::take(&mut self.len);
            if let Some(seq) = self.close(len) {
                let end = len.saturating_sub(CRC_LEN);
                return Some(Frame { seq, message: self.buffer.get(1 + HEADER..end).unwrap_or(&[]) });
            }
        }
    }

    /// What has been received and refused so far.
    #[must_use]
    pub const fn counters(&self) -> &Counters {
        &self.counters
    }

    /// Version of the last frame that was whole but of another version; `None` if there was none.
    #[must_use]
    pub const fn foreign_version(&self) -> Option<u8> {
        self.foreign_version
    }

    fn append(&mut self, bytes: &[u8]) {
        let room = self.buffer.get_mut(self.len..).unwrap_or(&mut []);
        if let Some(room) = room.get_mut(..bytes.len()) {
            room.copy_from_slice(bytes);
        }
        self.len = self.len.saturating_add(bytes.len()).min(STUFFED_MAX + 1);
    }

    /// Judges the `len` bytes before a delimiter: the frame's number if they are one, else the cause is counted.
    fn close(&mut self, len: usize) -> Option<u16> {
        if len == 0 {
            return None;
        }
        let count = |counter: &mut u32| {
            *counter = counter.wrapping_add(1);
            None
        };
        let Some(stuffed) = self.buffer.get_mut(..len) else { return count(&mut self.counters.too_long) };
        if len < 1 + HEADER + 1 + CRC_LEN {
            return count(&mut self.counters.too_short);
        }
        if !stuffing::unstuff(stuffed) {
            return count(&mut self.counters.stuffing);
        }
        let Some((body, crc)) = stuffed[1..].split_last_chunk::<CRC_LEN>() else {
            return count(&mut self.counters.too_short);
        };
        if CRC_32C.checksum(body) != u32::from_le_bytes(*crc) {
            return count(&mut self.counters.checksum);
        }
        let &[version, low, high, ..] = body else { return count(&mut self.counters.too_short) };
        if version != VERSION {
            self.foreign_version = Some(version);
            return count(&mut self.counters.version);
        }
        let seq = u16::from_le_bytes([low, high]);
        if let Some(last) = self.last_seq.replace(seq) {
            match seq.wrapping_sub(last) {
                0 => return count(&mut self.counters.repeated),
                // Half the circle back is a sender that started anew, not one that lost so many.
                step @ 1..0x8000 => {
                    self.counters.lost = self.counters.lost.wrapping_add(u32::from(step) - 1);
                }
                _ => {}
            }
        }
        self.counters.good = self.counters.good.wrapping_add(1);
        Some(seq)
    }
}

#[cfg(test)]
mod tests;
