//! Frames against golden bytes and against every damage of one and two bits.

use std::vec;
use std::vec::Vec;

use proptest::prelude::*;

use super::*;
use crate::tests::{assert_golden, encoded_setpoint, setpoint};

fn framed(framer: &mut Framer, message: &[u8]) -> Vec<u8> {
    let mut buffer = [0xee; FRAME_MAX];
    framer.frame(message, &mut buffer).expect("a message of legal length").to_vec()
}

/// Numbers and messages of all frames in `bytes`.
fn received(deframer: &mut Deframer, mut bytes: &[u8]) -> Vec<(u16, Vec<u8>)> {
    let mut frames = Vec::new();
    while let Some(frame) = deframer.receive(&mut bytes) {
        frames.push((frame.seq, frame.message.to_vec()));
    }
    assert!(bytes.is_empty());
    frames
}

#[test]
fn golden_frame() {
    let mut framer = Framer { seq: 0x0100 };
    let bytes = framed(&mut framer, &encoded_setpoint(&setpoint()));
    assert_golden("frame.hex", &bytes);
    assert_eq!(
        received(&mut Deframer::default(), &bytes),
        [(0x0100, encoded_setpoint(&setpoint()).to_vec())]
    );
}

#[test]
fn the_checksum_is_that_of_the_standard() {
    // RFC 3720, appendix B.4, and the check value of the catalogue of parametrised CRC algorithms.
    assert_eq!(CRC_32C.checksum(&[0; 32]), 0x8a91_36aa);
    assert_eq!(CRC_32C.checksum(b"123456789"), 0xe306_9283);
}

#[test]
fn messages_of_every_legal_length_pass_in_pieces_of_every_size() {
    let mut framer = Framer::default();
    let mut stream = Vec::new();
    let messages: Vec<Vec<u8>> =
        (1..=MESSAGE_MAX).map(|len| (0..len).map(|i| (i % 5) as u8).collect()).collect();
    for message in &messages {
        stream.extend(framed(&mut framer, message));
    }
    for piece in [1, 2, 3, 64, 1000, stream.len()] {
        let mut deframer = Deframer::default();
        let frames: Vec<_> = stream.chunks(piece).flat_map(|bytes| received(&mut deframer, bytes)).collect();
        assert!(frames.iter().map(|(_, message)| message).eq(&messages));
        assert_eq!(*deframer.counters(), Counters { good: MESSAGE_MAX as u32, ..Counters::default() });
    }
}

#[test]
fn illegal_lengths_are_refused_and_use_no_number() {
    let mut framer = Framer::default();
    let mut buffer = [0; FRAME_MAX];
    for len in [0, MESSAGE_MAX + 1, 10_000] {
        assert_eq!(framer.frame(&vec![1; len], &mut buffer), Err(MessageLength { len }));
    }
    assert_eq!(received(&mut Deframer::default(), &framed(&mut framer, &[1])), [(0, vec![1])]);
}

#[test]
fn every_error_of_one_and_two_bits_is_refused_and_costs_one_frame() {
    let mut framer = Framer::default();
    let damaged = framed(&mut framer, &encoded_setpoint(&setpoint()));
    let next = framed(&mut framer, &[0x55, 0, 0, 7]);
    let bits = damaged.len() * 8;
    let flip = |bytes: &mut [u8], bit: usize| bytes[bit / 8] ^= 1 << (bit % 8);
    for first in 0..bits {
        for second in first..bits {
            let mut bytes = damaged.clone();
            flip(&mut bytes, first);
            if second != first {
                flip(&mut bytes, second);
            }
            bytes.extend_from_slice(&next);
            let frames = received(&mut Deframer::default(), &bytes);
            assert_eq!(frames, [(1, vec![0x55, 0, 0, 7])], "bits {first} and {second}");
        }
    }
}

#[test]
fn causes_are_counted_apart() {
    let mut deframer = Deframer::default();
    let mut framer = Framer::default();
    let good = framed(&mut framer, &[1, 2, 3]);
    let mut crc = good.clone();
    crc[5] ^= 0x80;
    let mut code = good.clone();
    code[4] += 1;
    // Version 2 with its own right CRC.
    let mut foreign = vec![0, 2, 0, 0, 9];
    let checksum = CRC_32C.checksum(&foreign[1..]);
    foreign.extend(checksum.to_le_bytes());
    stuffing::stuff(&mut foreign);
    foreign.push(DELIMITER);
    let frames: Vec<_> = [&good[..], &good, &crc, &code, &foreign, &[7; 300], &[0, 1, 2, 3, 0]]
        .into_iter()
        .flat_map(|bytes| received(&mut deframer, bytes))
        .collect();
    assert_eq!(frames, [(0, vec![1, 2, 3])]);
    let expected = Counters {
        good: 1,
        lost: 0,
        repeated: 1,
        too_short: 1,
        too_long: 1,
        stuffing: 1,
        checksum: 1,
        version: 1,
    };
    assert_eq!(*deframer.counters(), expected);
    assert_eq!(deframer.counters().refused(), 6);
    assert_eq!(deframer.foreign_version(), Some(2));
}

#[test]
fn gaps_in_the_numbers_are_lost_frames_and_a_restart_is_none() {
    let mut deframer = Deframer::default();
    for (seq, lost) in
        [(0xfffe, 0), (0xffff, 0), (0, 0), (3, 2), (0x8002, 2 + 0x7ffe), (0, 2 + 0x7ffe + 0x7ffd)]
    {
        assert_eq!(received(&mut deframer, &framed(&mut Framer { seq }, &[1])).len(), 1);
        assert_eq!(deframer.counters().lost, lost, "{seq}");
    }
    assert_eq!(received(&mut deframer, &framed(&mut Framer { seq: 0xf000 }, &[1])).len(), 1);
    assert_eq!(deframer.counters().lost, 2 + 0x7ffe + 0x7ffd);
}

proptest! {
    #[test]
    fn after_any_garbage_the_next_frame_is_received(
        garbage in proptest::collection::vec(prop_oneof![Just(0_u8), any::<u8>()], 0..1000),
        message in proptest::collection::vec(prop_oneof![Just(0_u8), any::<u8>()], 1..=MESSAGE_MAX),
        pieces in 1_usize..50,
    ) {
        let mut stream = garbage;
        stream.extend(framed(&mut Framer::default(), &message));
        let mut deframer = Deframer::default();
        let frames: Vec<_> = stream.chunks(pieces).flat_map(|bytes| received(&mut deframer, bytes)).collect();
        prop_assert_eq!(frames, [(0, message)]);
    }
}
