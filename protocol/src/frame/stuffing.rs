//! Consistent overhead byte stuffing (Cheshire and Baker, 1999) of less than 255 bytes, in place.
//!
//! Every zero is replaced by the distance to the next one, and the byte before the data holds the distance to the first;
//! the last distance leads just behind the data. With less than 255 bytes no distance needs the code 0xff.

/// Stuffs `bytes[1..]` and puts the first distance into `bytes[0]`. Afterwards no byte is zero.
pub(super) fn stuff(bytes: &mut [u8]) {
    debug_assert!(bytes.len() < 255);
    let Some((first, data)) = bytes.split_first_mut() else { return };
    let mut distance = 1_u8;
    // Four bytes at a time, for most of them hold no zero.
    let (rest, words) = data.as_rchunks_mut();
    for word in words.iter_mut().rev() {
        if has_zero(u32::from_ne_bytes(*word)) {
            word.iter_mut().rev().for_each(|byte| pass(byte, &mut distance));
        } else {
            distance = distance.wrapping_add(4);
        }
    }
    rest.iter_mut().rev().for_each(|byte| pass(byte, &mut distance));
    *first = distance;
}

fn pass(byte: &mut u8, distance: &mut u8) {
    if *byte == 0 {
        *byte = core::mem::take(distance);
    }
    *distance = distance.wrapping_add(1);
}

/// Whether one of the four bytes is zero (Warren, Hacker's Delight, section 6-1).
const fn has_zero(word: u32) -> bool {
    word.wrapping_sub(0x0101_0101) & !word & 0x8080_8080 != 0
}

/// Undoes [`stuff`]: restores the zeros of `bytes[1..]` and clears `bytes[0]`. False when the distances do not lead
/// exactly to the end; then some are gone.
pub(super) fn unstuff(bytes: &mut [u8]) -> bool {
    let len = bytes.len();
    let mut at = 0;
    while let Some(byte) = bytes.get_mut(at) {
        match core::mem::take(byte) {
            0 => return false,
            distance => at += usize::from(distance),
        }
    }
    at == len
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec;
    use std::vec::Vec;

    fn stuffed(data: &[u8]) -> Vec<u8> {
        let mut bytes = vec![0xaa];
        bytes.extend_from_slice(data);
        stuff(&mut bytes);
        bytes
    }

    #[test]
    fn examples_of_the_authors() {
        // Section III of the paper, and the usual vectors since.
        for (data, expected) in [
            (&[0x00][..], &[0x01, 0x01][..]),
            (&[0x00, 0x00], &[0x01, 0x01, 0x01]),
            (&[0x11, 0x22, 0x00, 0x33], &[0x03, 0x11, 0x22, 0x02, 0x33]),
            (&[0x11, 0x22, 0x33, 0x44], &[0x05, 0x11, 0x22, 0x33, 0x44]),
            (&[0x11, 0x00, 0x00, 0x00], &[0x02, 0x11, 0x01, 0x01, 0x01]),
            (&[], &[0x01]),
        ] {
            assert_eq!(stuffed(data), expected);
        }
    }

    #[test]
    fn the_longest_data_come_back() {
        for zeros_every in [1, 2, 7, 100, 1000] {
            let data: Vec<u8> = (0..253_usize).map(|i| u8::from(i % zeros_every != 0) * 0xff).collect();
            let mut bytes = stuffed(&data);
            assert!(!bytes.contains(&0));
            assert!(unstuff(&mut bytes));
            assert_eq!(bytes[1..], data);
        }
    }

    #[test]
    fn distances_that_miss_the_end_are_refused() {
        for bytes in [&mut [0x02][..], &mut [0x03, 0x11], &mut [0x01, 0xff, 0x01], &mut [0x01, 0x00, 0x01]] {
            assert!(!unstuff(bytes), "{bytes:?}");
        }
    }
}
