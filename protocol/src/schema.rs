//! A fingerprint of the wire, to be compared when two ends meet.
//!
//! It is the hash of the golden bytes, to which tests hold every message, every number of [`fault`](crate::fault) and the
//! frame, and of the sizes of the last digits, which bytes do not show. Renaming a field changes nothing on the wire and
//! nothing here; a hash over type names, as of `postcard-schema`, would call that another protocol and would not see
//! the fixed layouts at all.

use crate::units::{AngleQ, DampingQ, ForceQ, StiffnessQ, TipTorqueQ, TorqueQ, VelocityQ};

/// The fingerprint of what this crate speaks.
pub const FINGERPRINT: u64 = {
    let files: [&[u8]; 6] = [
        include_bytes!("golden/setpoint.hex"),
        include_bytes!("golden/hand_state.hex"),
        include_bytes!("golden/frame.hex"),
        include_bytes!("golden/record.hex"),
        include_bytes!("golden/service.txt"),
        include_bytes!("golden/codes.txt"),
    ];
    let digits = [
        AngleQ::RAD_PER_LSB,
        VelocityQ::RAD_PER_S_PER_LSB,
        TorqueQ::NM_PER_LSB,
        ForceQ::N_PER_LSB,
        TipTorqueQ::NM_PER_LSB,
        StiffnessQ::N_PER_M_PER_LSB,
        DampingQ::N_S_PER_M_PER_LSB,
    ];
    let mut hash = EMPTY;
    let mut i = 0;
    while i < files.len() {
        hash = fnv1a(hash, files[i]);
        i += 1;
    }
    i = 0;
    while i < digits.len() {
        hash = fnv1a(hash, &digits[i].to_bits().to_le_bytes());
        i += 1;
    }
    hash
};

/// Fowler, Noll and Vo's hash of nothing.
const EMPTY: u64 = 0xcbf2_9ce4_8422_2325;

/// Goes on with their hash 1a. Carriage returns are left out, so that a checkout with other line ends is the same.
const fn fnv1a(mut hash: u64, bytes: &[u8]) -> u64 {
    let mut i = 0;
    while i < bytes.len() {
        if bytes[i] != b'\r' {
            hash = (hash ^ bytes[i] as u64).wrapping_mul(0x0000_0100_0000_01b3);
        }
        i += 1;
    }
    hash
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hash_is_fnv_1a() {
        assert_eq!(fnv1a(EMPTY, b"foobar"), 0x8594_4171_f739_67e8);
        assert_eq!(fnv1a(EMPTY, b"foo\rbar"), fnv1a(EMPTY, b"foobar"));
    }
}
