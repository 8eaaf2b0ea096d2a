//! The black box: the last control periods, every one, and every so many of those further back.
//!
//! A fault freezes it a little later, so that it holds what led there and what was done about it, until that is reset.

use protocol::blackbox::Record;

/// Consecutive periods.
pub const FULL_RATE: usize = 100;
/// Thinned periods.
pub const DECIMATED: usize = 64;
/// Periods for each thinned one: at 8 kHz the 64 reach back two seconds.
pub const DECIMATION: u16 = 256;
/// Periods recorded after a fault.
const AFTER_FAULT: u16 = 20;

/// The last `N` records.
#[derive(Debug, Clone)]
struct Ring<const N: usize> {
    records: [Record; N],
    next: usize,
    len: usize,
}

impl<const N: usize> Ring<N> {
    fn new() -> Self {
        Self { records: [Record::default(); N], next: 0, len: 0 }
    }

    /// The place of the next record, over the oldest one if there is no other.
    fn next(&mut self) -> Option<&mut Record> {
        let next = self.next;
        self.next = if next + 1 < N { next + 1 } else { 0 };
        self.len = (self.len + 1).min(N);
        self.records.get_mut(next)
    }

    /// Oldest first.
    fn get(&self, index: usize) -> Option<&Record> {
        if index < self.len { self.records.get((self.next + N - self.len + index) % N) } else { None }
    }
}

/// The black box.
#[derive(Debug, Clone)]
pub struct Recorder {
    full: Ring<FULL_RATE>,
    decimated: Ring<DECIMATED>,
    until_decimated: u16,
    /// Periods still to be recorded after a fault.
    left: Option<u16>,
}

impl Default for Recorder {
    fn default() -> Self {
        Self { full: Ring::new(), decimated: Ring::new(), until_decimated: 0, left: None }
    }
}

impl Recorder {
    /// Records a period, unless frozen; `write` fills every field of a record in its place, which holds an old one.
    pub fn record(&mut self, write: impl FnOnce(&mut Record)) {
        match &mut self.left {
            Some(0) => return,
            Some(left) => *left -= 1,
            None => {}
        }
        let Some(record) = self.full.next() else { return };
        write(record);
        match self.until_decimated.checked_sub(1) {
            Some(left) => self.until_decimated = left,
            None => {
                if let Some(place) = self.decimated.next() {
                    *place = *record;
                }
                self.until_decimated = DECIMATION - 1;
            }
        }
    }

    /// A fault: record a little more, then keep what there is. The first one counts.
    pub fn freeze(&mut self) {
        self.left.get_or_insert(AFTER_FAULT);
    }

    /// Record again.
    pub fn resume(&mut self) {
        self.left = None;
    }

    /// Whether recording has ended.
    #[must_use]
    pub fn is_frozen(&self) -> bool {
        self.left == Some(0)
    }

    /// How many records there are at full rate and thinned.
    #[must_use]
    pub const fn len(&self) -> (usize, usize) {
        (self.full.len, self.decimated.len)
    }

    /// A record by its index: those at full rate first, oldest first.
    #[must_use]
    pub fn get(&self, index: usize) -> Option<&Record> {
        match index.checked_sub(self.full.len) {
            None => self.full.get(index),
            Some(index) => self.decimated.get(index),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    fn at(t_us: u32) -> Record {
        Record { t_us, ..Record::default() }
    }

    #[test]
    fn the_last_hundred_and_every_256th_are_kept_oldest_first() {
        let mut recorder = Recorder::default();
        assert_eq!((recorder.len(), recorder.get(0)), ((0, 0), None));
        for t_us in 0..20_000 {
            recorder.record(|record| *record = at(t_us));
        }
        let times: Vec<u32> = (0..).map_while(|i| recorder.get(i)).map(|record| record.t_us).collect();
        let full = 19_900..20_000;
        let decimated = (0..20_000).step_by(256).skip(79 - 64);
        assert_eq!(times, full.chain(decimated).collect::<Vec<_>>());
        assert_eq!(recorder.len(), (100, 64));
    }

    #[test]
    fn a_fault_keeps_what_led_to_it() {
        let mut recorder = Recorder::default();
        for t_us in 0..1000 {
            if t_us == 500 || t_us == 510 {
                recorder.freeze();
            }
            recorder.record(|record| *record = at(t_us));
        }
        assert!(recorder.is_frozen());
        assert_eq!(recorder.get(99).map(|record| record.t_us), Some(519));
        recorder.resume();
        recorder.record(|record| *record = at(2000));
        assert_eq!(recorder.get(99).map(|record| record.t_us), Some(2000));
    }
}
