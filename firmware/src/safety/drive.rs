//! The state machine of a drive after CiA 402, one for the hand and one for every finger.
//!
//! ```text
//!  NotReadyToSwitchOn -> SwitchOnDisabled <--------- reset ------- Fault <- FaultReactionActive <- any state
//!                        |  ^     ^    ^                                           (Alarm::Off)
//!               shutdown |  |     |    |
//!                        v  |     |    '--- disable voltage, release ---.
//!                 ReadyToSwitchOn |                                     |
//!                        |  ^     |                                     |
//!              switch on |  | shutdown                                  |
//!                        v  |     |                                     |
//!                  SwitchedOn ----'  disable voltage, quick stop        |
//!                        |  ^                                           |
//!       enable operation |  | switch on                                 |
//!                        v  |         quick stop, Alarm::Stop           |
//!               OperationEnabled --------------------------------> QuickStopActive
//!                        ^                                              |
//!                        '------ reset, switch on, enable operation ----'
//! ```
//!
//! Stricter than the standard in three ways. `ReadyToSwitchOn` does not pass through `SwitchedOn` on a word that already
//! enables operation: without torque, two different words must come before there is any, so a sender that repeats one
//! word gets none. A stop that an alarm caused is left to torque only by a reset and those two words. And it *can* be
//! left so: a hand that holds an object must not be made to drop it to be commanded again.

use protocol::command::ControlWord;
use protocol::telemetry::DriveState;

/// What the supervision asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub enum Alarm {
    /// Nothing.
    #[default]
    None,
    /// Come to a stop with torque and stay there; without torque, stay without.
    Stop,
    /// Torque off.
    Off,
}

/// What a control word asks for, by its low four bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Command {
    DisableVoltage,
    QuickStop,
    Shutdown,
    SwitchOn,
    EnableOperation,
}

impl Command {
    const fn of(word: ControlWord) -> Self {
        let bits = word.bits();
        if bits & 0b0010 == 0 {
            Self::DisableVoltage
        } else if bits & 0b0100 == 0 {
            Self::QuickStop
        } else if bits & 0b0001 == 0 {
            Self::Shutdown
        } else if bits & 0b1000 == 0 {
            Self::SwitchOn
        } else {
            Self::EnableOperation
        }
    }
}

/// Input of one step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Input {
    /// The latest control word.
    pub word: ControlWord,
    /// What the supervision asks for now.
    pub alarm: Alarm,
    /// Whether the hand has found itself fit.
    pub ready: bool,
    /// Whether a stop is to end without torque, as the configuration may ask.
    pub release: bool,
}

/// State of a drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Drive {
    state: DriveState,
    /// The word of the step before.
    word: ControlWord,
    /// Whether a stop has been reset and may be left.
    acknowledged: bool,
}

impl Drive {
    /// The state.
    #[must_use]
    pub const fn state(&self) -> DriveState {
        self.state
    }

    /// Whether the drive may be given torque.
    #[must_use]
    pub const fn has_torque(&self) -> bool {
        matches!(self.state, DriveState::OperationEnabled | DriveState::QuickStopActive)
    }

    /// One step; returns the new state.
    pub fn step(&mut self, input: &Input) -> DriveState {
        let before = core::mem::replace(&mut self.word, input.word);
        let reset = ControlWord::FAULT_RESET.bits();
        let reset = input.word.bits() & !before.bits() & reset != 0 && input.alarm == Alarm::None;
        let command = Command::of(input.word);
        let quiet = input.alarm == Alarm::None;
        use DriveState as S;
        let next = match self.state {
            S::FaultReactionActive => S::Fault,
            S::Fault if reset => S::SwitchOnDisabled,
            S::Fault => S::Fault,
            _ if input.alarm == Alarm::Off => S::FaultReactionActive,
            S::NotReadyToSwitchOn if input.ready => S::SwitchOnDisabled,
            S::NotReadyToSwitchOn => S::NotReadyToSwitchOn,
            S::SwitchOnDisabled if quiet && command == Command::Shutdown => S::ReadyToSwitchOn,
            S::SwitchOnDisabled => S::SwitchOnDisabled,
            S::ReadyToSwitchOn | S::SwitchedOn if !quiet => S::SwitchOnDisabled,
            S::ReadyToSwitchOn => match command {
                Command::DisableVoltage | Command::QuickStop => S::SwitchOnDisabled,
                Command::SwitchOn => S::SwitchedOn,
                Command::Shutdown | Command::EnableOperation => S::ReadyToSwitchOn,
            },
            S::SwitchedOn => match command {
                Command::DisableVoltage | Command::QuickStop => S::SwitchOnDisabled,
                Command::Shutdown => S::ReadyToSwitchOn,
                Command::SwitchOn => S::SwitchedOn,
                Command::EnableOperation => S::OperationEnabled,
            },
            S::OperationEnabled => match command {
                Command::DisableVoltage => S::SwitchOnDisabled,
                _ if !quiet => S::QuickStopActive,
                Command::QuickStop => S::QuickStopActive,
                Command::Shutdown => S::ReadyToSwitchOn,
                Command::SwitchOn => S::SwitchedOn,
                Command::EnableOperation => S::OperationEnabled,
            },
            S::QuickStopActive => {
                let enables = command == Command::EnableOperation && Command::of(before) == Command::SwitchOn;
                if command == Command::DisableVoltage || input.release {
                    S::SwitchOnDisabled
                } else if self.acknowledged && quiet && enables {
                    S::OperationEnabled
                } else {
                    S::QuickStopActive
                }
            }
        };
        let stopped = self.state == S::QuickStopActive && next == S::QuickStopActive;
        self.acknowledged = stopped && quiet && (self.acknowledged || reset);
        self.state = next;
        next
    }
}

#[cfg(test)]
mod tests;
