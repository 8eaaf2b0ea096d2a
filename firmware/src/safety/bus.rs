//! How long the hand has been without a new set-point, in tiers.
//!
//! New is a set-point whose `seq` has advanced: a sender that repeats one frame for ever is as good as silent. By how much
//! does not matter up to half the circle; more is a step back, an old frame. Once the hand has stopped, any other number
//! is new, so that a host that starts again need not know where the last one ended.

use protocol::fault::Fault;
use protocol::telemetry::BusTier;

/// When the tiers begin.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Config {
    /// Time between set-points.
    pub cycle_us: u32,
    /// Set-points that may be missed before it is said.
    pub late_cycles: u32,
    /// Without a new set-point for so long the last target is held still.
    pub hold_us: u32,
    /// Without a new set-point for so long the hand stops, and stays stopped.
    pub stop_us: u32,
}

impl Default for Config {
    fn default() -> Self {
        Self { cycle_us: 1000, late_cycles: 5, hold_us: 10_000, stop_us: 20_000 }
    }
}

/// What the bus brought in a control period.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Heard {
    /// `seq` of the last set-point, if one came.
    pub setpoint: Option<u16>,
    /// Whether any frame came, a repeated one too.
    pub frame: bool,
}

/// State of the bus as the hand sees it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Bus {
    last: Option<u16>,
    age_us: u32,
    /// Whether frames have come since the last new set-point.
    frames_since: bool,
    tier: BusTier,
}

/// What a period meant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Verdict {
    /// How long set-points have been missing.
    pub tier: BusTier,
    /// Whether the set-point of this period is new and to be followed.
    pub fresh: bool,
}

impl Bus {
    /// One period of `elapsed_us`.
    pub fn step(&mut self, config: &Config, heard: &Heard, elapsed_us: u32) -> Verdict {
        let fresh = heard.setpoint.is_some_and(|seq| {
            self.last.is_none_or(|last| match seq.wrapping_sub(last) {
                0 => false,
                1..0x8000 => true,
                _ => self.tier == BusTier::Stop,
            })
        });
        if fresh {
            self.last = heard.setpoint;
            self.age_us = 0;
            self.frames_since = false;
        } else {
            self.age_us = self.age_us.saturating_add(elapsed_us);
            self.frames_since |= heard.frame;
        }
        let late_us = config.cycle_us.saturating_mul(config.late_cycles);
        self.tier = match self.age_us {
            age if age >= config.stop_us => BusTier::Stop,
            age if age >= config.hold_us => BusTier::Hold,
            age if age >= late_us => BusTier::Late,
            _ => BusTier::Fresh,
        };
        Verdict { tier: self.tier, fresh }
    }

    /// Time since the last new set-point, or since the start.
    #[must_use]
    pub const fn age_us(&self) -> u32 {
        self.age_us
    }

    /// `seq` of the last new set-point; 0 before the first.
    #[must_use]
    pub fn last_seq(&self) -> u16 {
        self.last.unwrap_or(0)
    }

    /// The fault that a stop for want of set-points is.
    #[must_use]
    pub const fn cause(&self) -> Fault {
        if self.frames_since { Fault::SenderStuck } else { Fault::BusSilent }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CONFIG: Config = Config { cycle_us: 1000, late_cycles: 5, hold_us: 10_000, stop_us: 20_000 };
    const NOTHING: Heard = Heard { setpoint: None, frame: false };

    fn setpoint(seq: u16) -> Heard {
        Heard { setpoint: Some(seq), frame: true }
    }

    #[test]
    fn tiers_begin_at_their_times() {
        let mut bus = Bus::default();
        assert!(bus.step(&CONFIG, &setpoint(7), 125).fresh);
        for us in (125..30_000).step_by(125) {
            let expected = match us {
                0..5_000 => BusTier::Fresh,
                5_000..10_000 => BusTier::Late,
                10_000..20_000 => BusTier::Hold,
                _ => BusTier::Stop,
            };
            assert_eq!(bus.step(&CONFIG, &NOTHING, 125), Verdict { tier: expected, fresh: false }, "{us}");
        }
        assert_eq!(bus.cause(), Fault::BusSilent);
        assert_eq!(bus.step(&CONFIG, &setpoint(8), 125), Verdict { tier: BusTier::Fresh, fresh: true });
    }

    #[test]
    fn a_sender_that_repeats_itself_is_as_good_as_silent() {
        let mut bus = Bus::default();
        bus.step(&CONFIG, &setpoint(7), 1000);
        for _ in 0..20 {
            assert!(!bus.step(&CONFIG, &setpoint(7), 1000).fresh);
        }
        assert_eq!((bus.tier, bus.cause()), (BusTier::Stop, Fault::SenderStuck));
        assert!(!bus.step(&CONFIG, &setpoint(7), 1000).fresh, "still the same");
    }

    #[test]
    fn numbers_wrap_and_old_ones_are_not_new_before_a_stop() {
        let mut bus = Bus::default();
        for (seq, fresh) in
            [(0xfffe, true), (0xffff, true), (0, true), (0xffff, false), (900, true), (0, false)]
        {
            assert_eq!(bus.step(&CONFIG, &setpoint(seq), 1000).fresh, fresh, "{seq}");
        }
        for _ in 0..30 {
            bus.step(&CONFIG, &NOTHING, 1000);
        }
        assert!(bus.step(&CONFIG, &setpoint(0), 1000).fresh, "a host that started anew");
        assert_eq!(bus.last_seq(), 0);
    }
}
