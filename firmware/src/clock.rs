//! The hand's time, from a free-running counter that is read at the beginning of every control period.

/// Time in whole control periods.
///
/// The counter and the timer that begins periods have one clock, so an interrupt that comes a little later shows in the
/// counter but is no longer period: the sensors were read when the timer said so. What was missed shows as whole periods.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PeriodClock {
    period_us: u32,
    now_us: u32,
}

impl PeriodClock {
    /// Begins at a reading of the counter.
    #[must_use]
    pub const fn new(period_us: u32, counter_us: u32) -> Self {
        Self { period_us, now_us: counter_us }
    }

    /// The time of the period in which the counter is read; both wrap after 71 minutes.
    pub fn step(&mut self, counter_us: u32) -> u32 {
        let since = counter_us.wrapping_sub(self.now_us);
        // A counter that is behind, by less than half a period, stands before the first period's end.
        let since = if since > u32::MAX / 2 { 0 } else { since };
        let periods = since.saturating_add(self.period_us / 2) / self.period_us.max(1);
        self.now_us = self.now_us.wrapping_add(periods.wrapping_mul(self.period_us));
        self.now_us
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn lateness_is_no_time_and_missed_periods_are() {
        let mut clock = PeriodClock::new(125, 1000);
        assert_eq!([1125, 1290, 1376, 1499].map(|read| clock.step(read)), [1125, 1250, 1375, 1500]);
        assert_eq!(clock.step(1500 + 22_000 + 30), 1500 + 22_000);
    }

    proptest! {
        #[test]
        fn it_never_drifts_whatever_the_jitter(
            start in any::<u32>(), jitter in proptest::collection::vec(0_u32..62, 1..500),
        ) {
            let mut clock = PeriodClock::new(125, start);
            for (n, late) in (1_u32..).zip(jitter) {
                let due = start.wrapping_add(n * 125);
                prop_assert_eq!(clock.step(due.wrapping_add(late)), due);
            }
        }
    }
}
