//! Whether control keeps its time, and whether all parts are alive.

/// Periods in a row that may be overrun before the hand stops.
const OVERRUNS_IN_A_ROW: u8 = 4;

/// Counts control periods that did not come in time. A missed period is left out, never made up for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Overruns {
    /// Periods missed since the start.
    pub missed: u32,
    /// Longest time between two periods.
    pub worst_us: u32,
    in_a_row: u8,
}

impl Overruns {
    /// A period that began `elapsed_us` after the one before. True when so many in a row came late that the hand must
    /// stop. Late is half a period.
    pub fn step(&mut self, period_us: u32, elapsed_us: u32) -> bool {
        self.worst_us = self.worst_us.max(elapsed_us);
        let half_us = period_us / 2;
        if elapsed_us <= period_us.saturating_add(half_us) {
            self.in_a_row = 0;
        } else {
            let periods = elapsed_us.saturating_add(half_us) / period_us.max(1);
            self.missed = self.missed.saturating_add(periods.saturating_sub(1));
            self.in_a_row = self.in_a_row.saturating_add(1);
        }
        self.in_a_row >= OVERRUNS_IN_A_ROW
    }
}

/// Parts that must be alive for the watchdog to be fed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Part {
    /// A control period was completed.
    Control = 1,
    /// The task of the bus looked for bytes, whether there were any or not.
    Bus = 2,
    /// Sensors were read.
    Sensors = 4,
}

/// Who has checked in since the watchdog was fed. A watchdog fed by one part only proves that this part is alive.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct CheckIns {
    seen: u8,
    waiting_us: u32,
}

impl CheckIns {
    /// A part is alive.
    pub fn check_in(&mut self, part: Part) {
        self.seen |= part as u8;
    }

    /// After `elapsed_us`, whether the watchdog may be fed: when all parts have checked in since the last time.
    pub fn may_feed(&mut self, elapsed_us: u32) -> bool {
        let all = Part::Control as u8 | Part::Bus as u8 | Part::Sensors as u8;
        let fed = self.seen == all;
        if fed {
            *self = Self::default();
        } else {
            self.waiting_us = self.waiting_us.saturating_add(elapsed_us);
        }
        fed
    }

    /// Time for which some part has been missing.
    #[must_use]
    pub const fn waiting_us(&self) -> u32 {
        self.waiting_us
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missed_periods_are_counted_and_four_late_ones_in_a_row_stop() {
        let mut overruns = Overruns::default();
        assert!(!overruns.step(125, 187));
        assert_eq!(overruns.missed, 0);
        assert!(!overruns.step(125, 1000));
        assert_eq!((overruns.missed, overruns.worst_us), (7, 1000));
        assert!(!overruns.step(125, 125), "one in time ends the row");
        assert_eq!([250, 250, 250, 250].map(|us| overruns.step(125, us)), [false, false, false, true]);
        assert_eq!(overruns.missed, 11);
    }

    #[test]
    fn the_watchdog_is_fed_only_when_all_have_checked_in() {
        for missing in [Part::Control, Part::Bus, Part::Sensors] {
            let mut check_ins = CheckIns::default();
            for part in [Part::Control, Part::Bus, Part::Sensors].into_iter().filter(|&part| part != missing)
            {
                check_ins.check_in(part);
            }
            assert!(!check_ins.may_feed(125), "{missing:?}");
            assert_eq!(check_ins.waiting_us(), 125);
            check_ins.check_in(missing);
            assert!(check_ins.may_feed(125));
            assert!(!check_ins.may_feed(125), "once for each round");
        }
    }
}
