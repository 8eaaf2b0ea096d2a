//! Which sets of six points have been met: the bases of the vertices in [`polar`](super::polar).

use super::polytope::Stuck;

/// Sets that can be known, and slots of the table that knows them.
const MAX_KNOWN: usize = 2048;
const SLOTS: usize = 2 * MAX_KNOWN;

/// Sets of six points that have been seen: a table with open addresses, emptied by counting up.
#[derive(Debug, Clone, Default)]
pub(super) struct Seen {
    slots: Vec<u64>,
    count: usize,
    round: u16,
}

impl Seen {
    /// Forgets all.
    pub(super) fn clear(&mut self) {
        self.count = 0;
        self.round = self.round.wrapping_add(1);
        if self.round == 0 || self.slots.is_empty() {
            self.slots.clear();
            self.slots.resize(SLOTS, 0);
            self.round = 1;
        }
    }

    /// Whether the set is new.
    pub(super) fn insert(&mut self, name: u64) -> Result<bool, Stuck> {
        let entry = name | u64::from(self.round) << 48;
        // Fibonacci hashing: the high bits of the product depend on all bits of the name.
        let mut at = (name.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 32) as usize % SLOTS;
        while self.slots[at] >> 48 == u64::from(self.round) {
            if self.slots[at] == entry {
                return Ok(false);
            }
            at = (at + 1) % SLOTS;
        }
        if self.count == MAX_KNOWN {
            return Err(Stuck);
        }
        self.count += 1;
        self.slots[at] = entry;
        Ok(true)
    }
}

/// The name of a set of six points in ascending order: their bytes, 48 bits.
pub(super) fn name(points: &[u8; 6]) -> u64 {
    points.iter().fold(0, |name, &point| name << 8 | u64::from(point))
}

/// The name of a set when one point gives way to a newer one than all.
pub(super) fn renamed(name: u64, without: u8, with: u8) -> u64 {
    let is_it = |shift: &u32| name >> shift & 0xff == u64::from(without);
    let shift = (0..6).map(|place| 8 * place).find(is_it).unwrap_or(0);
    let (above, below) = (name >> (shift + 8), name & ((1 << shift) - 1));
    (above << shift | below) << 8 | u64::from(with)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_set_is_new_once_between_clearings() {
        let mut seen = Seen::default();
        let other = renamed(name(&[0, 1, 2, 3, 4, 5]), 2, 6);
        assert_eq!(other, name(&[0, 1, 3, 4, 5, 6]));
        // More rounds than the table can count, so that the count starts over.
        for _ in 0..=u16::MAX {
            seen.clear();
            assert_eq!(seen.insert(other), Ok(true));
            assert_eq!(seen.insert(other), Ok(false));
        }
    }

    #[test]
    fn there_is_room_for_so_many_and_no_more() {
        let mut seen = Seen::default();
        seen.clear();
        let sets = (0..MAX_KNOWN as u64).map(|k| (k % 45) << 8 | (k / 45) << 16 | 0xff);
        for set in sets.clone() {
            assert_eq!(seen.insert(set), Ok(true));
        }
        for set in sets {
            assert_eq!(seen.insert(set), Ok(false));
        }
        assert_eq!(seen.insert(0), Err(Stuck));
    }
}
