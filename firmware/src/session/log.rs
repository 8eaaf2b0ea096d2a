//! Events that wait to be fetched.

use protocol::service::{Event, LogRecord};

const LEN: usize = 16;

/// The oldest events that nobody has fetched. When there is no room new ones are counted, for the first cause matters more
/// than the last effect.
#[derive(Debug, Clone)]
pub struct Log {
    records: [LogRecord; LEN],
    first: usize,
    len: usize,
    dropped: u32,
}

impl Default for Log {
    fn default() -> Self {
        Self { records: [LogRecord { t_us: 0, event: Event::Started }; LEN], first: 0, len: 0, dropped: 0 }
    }
}

impl Log {
    /// Adds an event.
    pub fn push(&mut self, t_us: u32, event: Event) {
        if self.len < LEN {
            self.records[(self.first + self.len) % LEN] = LogRecord { t_us, event };
            self.len += 1;
        } else {
            self.dropped = self.dropped.saturating_add(1);
        }
    }

    /// Takes the oldest event. After the last one before a gap comes how many were lost in it.
    pub fn pop(&mut self) -> Option<LogRecord> {
        if self.len == 0 {
            return None;
        }
        let record = self.records[self.first % LEN];
        self.first = (self.first + 1) % LEN;
        self.len -= 1;
        if self.len == 0 && self.dropped > 0 {
            let events = core::mem::take(&mut self.dropped);
            self.push(record.t_us, Event::Dropped { events });
        }
        Some(record)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    #[test]
    fn events_come_out_in_order_and_lost_ones_are_counted() {
        let mut log = Log::default();
        assert_eq!(log.pop(), None);
        for t_us in 0..20 {
            log.push(t_us, Event::Bus { tier: 1 });
        }
        let records: Vec<_> = core::iter::from_fn(|| log.pop()).collect();
        assert!(records[..16].iter().map(|record| record.t_us).eq(0..16));
        assert_eq!(records[16..], [LogRecord { t_us: 15, event: Event::Dropped { events: 4 } }]);
    }
}
