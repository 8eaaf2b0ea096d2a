//! What is received by a DMA channel that runs round a buffer for ever: nothing has to be restarted after an error on
//! the line, and no byte waits for an interrupt.

use core::ops::Range;

/// Reads behind a DMA channel.
///
/// The reader must look more often than the channel goes round. If it does not, old bytes are lost and what is left is
/// out of order; frames that this damages are refused by their CRC and counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RingReader {
    len: usize,
    at: usize,
}

impl RingReader {
    /// At the beginning of a buffer of `len` bytes.
    #[must_use]
    pub const fn new(len: usize) -> Self {
        Self { len, at: 0 }
    }

    /// Where the new bytes are when the channel still has `left` bytes to go to the end: two pieces in their order, the
    /// second empty unless the channel has gone round.
    pub fn take(&mut self, left: usize) -> [Range<usize>; 2] {
        // A channel that has just ended a round may show 0 before it shows the whole length.
        let end = self.len.saturating_sub(left) % self.len.max(1);
        let from = core::mem::replace(&mut self.at, end);
        if end >= from { [from..end, 0..0] } else { [from..self.len, 0..end] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    #[test]
    fn a_round_that_has_ended_is_one_that_begins() {
        let mut reader = RingReader::new(8);
        assert_eq!(reader.take(8), [0..0, 0..0]);
        assert_eq!(reader.take(1), [0..7, 0..0]);
        assert_eq!(reader.take(0), [7..8, 0..0]);
        assert_eq!(reader.take(8), [0..0, 0..0]);
    }

    proptest! {
        #[test]
        fn every_byte_is_read_once_and_in_order(steps in proptest::collection::vec(0_usize..64, 0..200)) {
            let (mut buffer, mut reader) = ([0_u8; 64], RingReader::new(64));
            let (mut sent, mut read) = (Vec::new(), Vec::new());
            for step in steps {
                for _ in 0..step {
                    let byte = sent.len() as u8;
                    buffer[sent.len() % 64] = byte;
                    sent.push(byte);
                }
                for piece in reader.take(64 - sent.len() % 64) {
                    read.extend_from_slice(&buffer[piece]);
                }
            }
            prop_assert_eq!(read, sent);
        }
    }
}
