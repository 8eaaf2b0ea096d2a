//! All parts of the supervision in one period.

use protocol::command::ControlWord;
use protocol::fault::{Code, Fault};
use protocol::ids::{FINGER_COUNT, FingerId, JOINT_COUNT};
use protocol::service::FirstFault;
use protocol::telemetry::{BusTier, DriveState};

use super::bus::{self, Bus, Heard};
use super::drive::{Alarm, Drive, Input};
use super::sensors::{self, Excitation, Plausibility};
use super::watch::{CheckIns, Overruns, Part};
use crate::control::Sensors;
use crate::control::limits::all_finite;

/// A part that has not checked in for so long is dead.
const SILENT_US: u32 = 50_000;

/// Everything that stays the same.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Config {
    /// Nominal control period.
    pub period_us: u32,
    /// Tiers of bus loss.
    pub bus: bus::Config,
    /// What sensors may say.
    pub sensors: sensors::Config,
    /// After so long a stop ends without torque, and what is held falls; `None`: never.
    pub release_us: Option<u32>,
}

/// What a period brought.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cycle<'a> {
    /// The hand's time, wrapping.
    pub now_us: u32,
    /// Since the period before.
    pub elapsed_us: u32,
    /// What the bus brought.
    pub heard: Heard,
    /// Control word of its set-point, if one came.
    pub word: Option<ControlWord>,
    /// What the hand did the period before.
    pub excitation: &'a Excitation,
}

/// What a finger is to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Mode {
    /// No torque.
    #[default]
    Off,
    /// Follow set-points.
    Follow,
    /// Stay at the last target until set-points come again.
    Hold,
    /// Stay at the last target, damped, until told otherwise.
    Stop,
}

/// What the supervision found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Found {
    /// What every finger is to do.
    pub modes: [Mode; FINGER_COUNT],
    /// Whether the set-point of this period is new and to be followed.
    pub fresh: bool,
    /// A fault that was not there before.
    pub new_fault: Option<FirstFault>,
    /// Whether a reset has cleared the first fault.
    pub reset: bool,
}

/// State of the supervision.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Supervisor {
    hand: Drive,
    fingers: [Drive; FINGER_COUNT],
    bus: Bus,
    tier: BusTier,
    plausibility: Plausibility,
    overruns: Overruns,
    check_ins: CheckIns,
    word: ControlWord,
    first_fault: Option<FirstFault>,
    stopped_us: u32,
    bad_output: bool,
}

impl Supervisor {
    /// One period. Of `sensors` it leaves those to control by.
    // A function of its own, as every large step of a period: all of them in one run out of registers.
    #[inline(never)]
    pub fn step(&mut self, config: &Config, cycle: &Cycle<'_>, sensors: &mut Sensors) -> Found {
        let verdict = self.bus.step(&config.bus, &cycle.heard, cycle.elapsed_us);
        self.tier = verdict.tier;
        let before = self.word;
        if let (true, Some(word)) = (verdict.fresh, cycle.word) {
            self.word = word;
        }
        let faults = self.plausibility.step(&config.sensors, sensors, cycle.excitation, cycle.elapsed_us);
        let hand_fault = self.hand_fault(config, cycle.elapsed_us);
        let hand_alarm = hand_fault.map_or(Alarm::None, alarm);

        let reset_bit = ControlWord::FAULT_RESET.bits();
        let reset = self.word.bits() & !before.bits() & reset_bit != 0
            && hand_alarm == Alarm::None
            && self.first_fault.is_some();
        if reset {
            self.first_fault = None;
        }
        let new_fault = self.latch(cycle.now_us, hand_fault, &faults);

        let ready = faults.iter().all(Option::is_none);
        let release = config.release_us.is_some_and(|release_us| self.stopped_us >= release_us);
        let input = Input { word: self.word, alarm: hand_alarm, ready, release };
        let state = self.hand.step(&input);
        for (finger, drive) in FingerId::ALL.into_iter().zip(&mut self.fingers) {
            let fault = faults[finger.index()].map_or(Alarm::None, alarm);
            drive.step(&Input { word: word_for(self.word, finger), alarm: hand_alarm.max(fault), ..input });
        }
        let stopped = state == DriveState::QuickStopActive;
        self.stopped_us = if stopped { self.stopped_us.saturating_add(cycle.elapsed_us) } else { 0 };
        Found { modes: self.modes(), fresh: verdict.fresh, new_fault, reset }
    }

    /// A fault of the whole hand, the worst first.
    fn hand_fault(&mut self, config: &Config, elapsed_us: u32) -> Option<Fault> {
        let overrun = self.overruns.step(config.period_us, elapsed_us);
        if core::mem::take(&mut self.bad_output) {
            Some(Fault::OutputNotANumber)
        } else if overrun {
            Some(Fault::Overrun)
        } else if self.check_ins.waiting_us() >= SILENT_US {
            Some(Fault::TaskSilent)
        } else if self.tier == BusTier::Stop {
            Some(self.bus.cause())
        } else {
            None
        }
    }

    /// Keeps the first fault. One that stops nothing, as a silent bus of a hand at rest, is none.
    fn latch(
        &mut self,
        t_us: u32,
        hand: Option<Fault>,
        fingers: &[Option<Fault>; FINGER_COUNT],
    ) -> Option<FirstFault> {
        if self.first_fault.is_some() {
            return None;
        }
        let of_hand = hand.filter(|&fault| alarm(fault) == Alarm::Off || self.hand.has_torque());
        let of_finger = || (0_u8..).zip(fingers).find_map(|(finger, fault)| Some((Some(finger), (*fault)?)));
        let (finger, fault) = of_hand.map(|fault| (None, fault)).or_else(of_finger)?;
        self.first_fault = Some(FirstFault { code: Code::from(fault), finger, t_us });
        self.first_fault
    }

    /// What every finger is to do now.
    fn modes(&self) -> [Mode; FINGER_COUNT] {
        self.fingers.map(|finger| {
            if !(finger.has_torque() && self.hand.has_torque()) {
                Mode::Off
            } else if [finger.state(), self.hand.state()].contains(&DriveState::QuickStopActive) {
                Mode::Stop
            } else if self.tier >= BusTier::Hold {
                Mode::Hold
            } else {
                Mode::Follow
            }
        })
    }

    /// Lets torques through if all are numbers, else none of them; that is a fault of the next period.
    #[must_use]
    pub fn gate(&mut self, torques_nm: [f32; JOINT_COUNT]) -> [f32; JOINT_COUNT] {
        if all_finite(&torques_nm) {
            torques_nm
        } else {
            self.bad_output = true;
            [0.0; JOINT_COUNT]
        }
    }

    /// A part is alive.
    pub fn check_in(&mut self, part: Part) {
        self.check_ins.check_in(part);
    }

    /// Whether the watchdog may be fed; call once a period.
    pub fn may_feed(&mut self, elapsed_us: u32) -> bool {
        self.check_ins.may_feed(elapsed_us)
    }

    /// State of the hand.
    #[must_use]
    pub const fn hand(&self) -> DriveState {
        self.hand.state()
    }

    /// States of the fingers.
    #[must_use]
    pub fn fingers(&self) -> [DriveState; FINGER_COUNT] {
        self.fingers.map(|finger| finger.state())
    }

    /// Whether any drive may have torque.
    #[must_use]
    pub const fn has_torque(&self) -> bool {
        self.hand.has_torque()
    }

    /// How long set-points have been missing.
    #[must_use]
    pub const fn tier(&self) -> BusTier {
        self.tier
    }

    /// The bus.
    #[must_use]
    pub const fn bus(&self) -> &Bus {
        &self.bus
    }

    /// The control word in effect.
    #[must_use]
    pub const fn word(&self) -> ControlWord {
        self.word
    }

    /// The first fault since the last reset.
    #[must_use]
    pub const fn first_fault(&self) -> Option<FirstFault> {
        self.first_fault
    }

    /// Control periods that did not come in time.
    #[must_use]
    pub const fn overruns(&self) -> &Overruns {
        &self.overruns
    }
}

/// What a fault asks for. Where sensors and drives are sound the hand stays where it is rather than let go.
const fn alarm(fault: Fault) -> Alarm {
    match fault {
        Fault::BusSilent | Fault::SenderStuck | Fault::Overrun | Fault::TaskSilent => Alarm::Stop,
        _ => Alarm::Off,
    }
}

/// The word as a finger sees it: one that takes no part is switched on at most. So it joins the others by one bit, without
/// their letting go.
fn word_for(word: ControlWord, finger: FingerId) -> ControlWord {
    let enable = ControlWord::ENABLE_OPERATION.bits() & !ControlWord::SWITCH_ON.bits();
    if word.fingers().contains(finger) {
        return word;
    }
    // Without a bit that was defined no undefined one comes up.
    ControlWord::from_bits(word.bits() & !enable).unwrap_or(ControlWord::DISABLE_VOLTAGE)
}

#[cfg(test)]
mod tests;
