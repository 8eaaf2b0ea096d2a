//! A digest of the kinematics in single precision, to prove that every board computes what the host computes.
//!
//! Plans are checked on the host with the firmware's own library, so a board whose compiler, floating-point unit or
//! mathematics library rounds otherwise must show before it moves a finger.

use hand_model::{FingerAngles, FingerTrig, HandModel, TipInverse, inverse_trig, links, tip, tip_jacobian};
use nalgebra::IsometryMatrix3;
use protocol::ids::FingerId;

use crate::trig::sin_cos;

/// Poses in the digest.
const POSES: u32 = 2000;

/// Fowler, Noll and Vo's hash 1a over the bits of `f32` numbers, little-endian.
struct Fnv1a(u64);

impl Fnv1a {
    const fn new() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }

    fn bytes(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }

    fn numbers<'a>(&mut self, numbers: impl IntoIterator<Item = &'a f32>) {
        for number in numbers {
            self.bytes(&number.to_bits().to_le_bytes());
        }
    }

    fn isometry(&mut self, isometry: &IsometryMatrix3<f32>) {
        self.numbers(&isometry.translation.vector);
        self.numbers(isometry.rotation.matrix());
    }
}

/// Numerical Recipes' linear congruential generator, whose upper bits are random enough for scattered poses.
struct Lcg(u32);

impl Lcg {
    /// The next number from `low` to `high`, of 2^24 steps.
    fn between(&mut self, low: f32, high: f32) -> f32 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        low + (high - low) * ((self.0 >> 8) as f32 / 16_777_216.0)
    }
}

/// Digest of tips and their inverses, Jacobians, links and finger bases over 2000 poses within the hard limits, drawn with `seed`.
///
/// ```
/// use firmware::selfcheck::kinematics_digest;
/// assert_eq!(kinematics_digest(1), kinematics_digest(1));
/// assert_ne!(kinematics_digest(1), kinematics_digest(2));
/// ```
#[must_use]
pub fn kinematics_digest(seed: u32) -> u64 {
    let hand = HandModel::<f32>::hit_dlr();
    let limits = hand.hard_limits;
    let ranges = [limits.abduction, limits.flexion, limits.middle];
    let mut random = Lcg(seed);
    let mut digest = Fnv1a::new();
    for _ in 0..POSES {
        let angles = ranges.map(|range| random.between(range.lower_rad, range.upper_rad));
        let trig = FingerTrig::new(&FingerAngles::from_array(&angles), sin_cos);
        let tip_in_base = tip(&hand.finger, &trig);
        digest.numbers(&tip_in_base.coords);
        if let TipInverse::Reached(poses) = inverse_trig(&hand.finger, &tip_in_base) {
            for (sin, cos) in poses.iter().flat_map(|pose| [pose.abduction, pose.flexion, pose.middle]) {
                digest.numbers(&[sin, cos]);
            }
        }
        digest.numbers(&tip_jacobian(&hand.finger, &trig));
        let links = links(&hand.finger, &trig);
        for link in [&links.proximal, &links.middle, &links.distal] {
            digest.isometry(link);
        }
        let rotation = limits.thumb_rotation;
        let thumb_rotation = sin_cos(random.between(rotation.lower_rad, rotation.upper_rad));
        for finger in FingerId::ALL {
            digest.isometry(&hand.palm_from_finger_base(finger, thumb_rotation));
        }
    }
    digest.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hash_is_fnv_1a() {
        // From the authors' published vectors.
        for (text, expected) in
            [("", 0xcbf2_9ce4_8422_2325), ("a", 0xaf63_dc4c_8601_ec8c), ("foobar", 0x8594_4171_f739_67e8)]
        {
            let mut hash = Fnv1a::new();
            hash.bytes(text.as_bytes());
            assert_eq!(hash.0, expected, "{text}");
        }
    }

    #[test]
    fn the_last_bit_of_one_number_shows() {
        let digest = |x: f32| {
            let mut hash = Fnv1a::new();
            hash.numbers(&[0.0, x, 1.0]);
            hash.0
        };
        assert_ne!(digest(0.5), digest(0.5_f32.next_up()));
        assert_ne!(digest(0.0), digest(-0.0));
    }

    #[test]
    fn poses_fill_their_range() {
        let mut random = Lcg(3);
        let numbers: [f32; 1000] = core::array::from_fn(|_| random.between(-1.0, 3.0));
        assert!(numbers.iter().all(|x| (-1.0..=3.0).contains(x)));
        let mean = numbers.iter().sum::<f32>() / 1000.0;
        assert!((mean - 1.0).abs() < 0.15, "{mean}");
    }
}
