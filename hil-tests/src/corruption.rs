//! Damages frames in every way a line does, and counts which the receiver takes for good.

use protocol::frame::{Deframer, FRAME_MAX, Framer, MESSAGE_MAX};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Ways to damage a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Damage {
    /// One to three bits anywhere.
    Bits,
    /// Up to 64 consecutive bits replaced by random ones.
    Burst,
    /// A piece cut off the front, off the end or out of the middle.
    Cut,
    /// Head of one frame, tail of another.
    Splice,
    /// Bytes put in between, zeros among them.
    Insertion,
    /// A byte sent twice, or two bytes that changed places.
    Order,
}

impl Damage {
    /// All of them.
    pub const ALL: [Self; 6] =
        [Self::Bits, Self::Burst, Self::Cut, Self::Splice, Self::Insertion, Self::Order];
}

/// What came of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Outcome {
    /// Frames that were damaged, each differing from what was sent.
    pub tried: u64,
    /// Frames received that nobody had sent: number or message differ.
    pub accepted: u64,
    /// Times that the very next good frame was received.
    pub resynchronised: u64,
}

/// Damages `count` frames, each way in turn, and sends a good frame after each.
///
/// Messages are random in length and content; zeros, which the stuffing moves about, are few in some and most of others.
#[must_use]
pub fn campaign(seed: u64, count: u64) -> Outcome {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut framer = Framer::default();
    let mut deframer = Deframer::default();
    let mut outcome = Outcome::default();
    while outcome.tried < count {
        let sent: [Sent; 3] = core::array::from_fn(|_| Sent::random(&mut random, &mut framer));
        let way = Damage::ALL[outcome.tried as usize % Damage::ALL.len()];
        let damaged = damage(way, &sent[0].wire, &sent[1].wire, &mut random);
        if damaged == sent[0].wire || damaged == sent[1].wire {
            continue;
        }
        outcome.tried += 1;
        let stream = [&damaged[..], &sent[2].wire].concat();
        let mut bytes = &stream[..];
        let mut next_received = false;
        while let Some(frame) = deframer.receive(&mut bytes) {
            match sent.iter().position(|sent| sent.seq == frame.seq && sent.message == frame.message) {
                Some(which) => next_received |= which == 2,
                None => outcome.accepted += 1,
            }
        }
        outcome.resynchronised += u64::from(next_received);
    }
    outcome
}

/// A frame and what is in it.
struct Sent {
    seq: u16,
    message: Vec<u8>,
    wire: Vec<u8>,
}

impl Sent {
    fn random(random: &mut ChaCha8Rng, framer: &mut Framer) -> Self {
        let zeros_of_ten = random.random_range(0..10);
        let len = random.random_range(1..=MESSAGE_MAX);
        let byte = |random: &mut ChaCha8Rng| {
            if random.random_range(0..10) < zeros_of_ten { 0 } else { random.random() }
        };
        let message: Vec<u8> = (0..len).map(|_| byte(random)).collect();
        let seq = framer.seq();
        let mut buffer = [0; FRAME_MAX];
        // The length is legal; were it not, the frame would be empty and never received.
        let wire = framer.frame(&message, &mut buffer).map(<[u8]>::to_vec).unwrap_or_default();
        Self { seq, message, wire }
    }
}

fn damage(way: Damage, frame: &[u8], other: &[u8], random: &mut ChaCha8Rng) -> Vec<u8> {
    let mut bytes = frame.to_vec();
    match way {
        Damage::Bits => {
            for _ in 0..random.random_range(1..=3) {
                let bit = random.random_range(0..bytes.len() * 8);
                bytes[bit / 8] ^= 1 << (bit % 8);
            }
        }
        Damage::Burst => {
            let start = random.random_range(0..bytes.len() * 8);
            for bit in start..(start + random.random_range(2..=64)).min(bytes.len() * 8) {
                bytes[bit / 8] ^= u8::from(random.random::<bool>()) << (bit % 8);
            }
        }
        Damage::Cut => {
            let (a, b) = (random.random_range(0..=bytes.len()), random.random_range(0..=bytes.len()));
            match random.random_range(0..3) {
                0 => drop(bytes.drain(..a)),
                1 => bytes.truncate(a),
                _ => drop(bytes.drain(a.min(b)..a.max(b))),
            }
        }
        Damage::Splice => {
            bytes.truncate(random.random_range(0..=bytes.len()));
            bytes.extend_from_slice(&other[random.random_range(0..=other.len())..]);
        }
        Damage::Insertion => {
            let mut inserted = vec![0; random.random_range(1..=300)];
            if random.random() {
                random.fill_bytes(&mut inserted);
            }
            let at = random.random_range(0..=bytes.len());
            bytes.splice(at..at, inserted);
        }
        Damage::Order => {
            let (a, b) = (random.random_range(0..bytes.len()), random.random_range(0..bytes.len()));
            if random.random() {
                bytes.swap(a, b);
            } else {
                bytes.insert(a, bytes[a]);
            }
        }
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_damaged_frame_is_accepted_and_the_next_one_always_is() {
        let outcome = campaign(1, 200_000);
        assert_eq!(outcome, Outcome { tried: 200_000, accepted: 0, resynchronised: 200_000 });
    }

    #[test]
    fn every_way_does_damage() {
        let mut random = ChaCha8Rng::seed_from_u64(2);
        let mut framer = Framer::default();
        for way in Damage::ALL {
            let sent: [Sent; 2] = core::array::from_fn(|_| Sent::random(&mut random, &mut framer));
            let differ =
                (0..100).filter(|_| damage(way, &sent[0].wire, &sent[1].wire, &mut random) != sent[0].wire);
            assert!(differ.count() > 90, "{way:?}");
        }
    }
}
