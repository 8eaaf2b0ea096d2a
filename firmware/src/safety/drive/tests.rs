//! Every state with every input.

use super::*;
use std::vec::Vec;

const WORDS: [u16; 11] = [0x00, 0x02, 0x06, 0x07, 0x0f, 0x80, 0x82, 0x86, 0x87, 0x8f, 0x04];

fn word(bits: u16) -> ControlWord {
    ControlWord::from_bits(bits).expect("defined bits")
}

/// Every drive, also those that no history leads to.
fn all_drives() -> Vec<Drive> {
    let mut drives = Vec::new();
    for state in DriveState::ALL {
        for bits in WORDS {
            for acknowledged in [false, true] {
                drives.push(Drive { state, word: word(bits), acknowledged });
            }
        }
    }
    drives
}

fn all_inputs() -> Vec<Input> {
    let mut inputs = Vec::new();
    for bits in WORDS {
        for alarm in [Alarm::None, Alarm::Stop, Alarm::Off] {
            for flags in 0..4 {
                let (ready, release) = (flags & 1 == 1, flags & 2 == 2);
                inputs.push(Input { word: word(bits), alarm, ready, release });
            }
        }
    }
    inputs
}

fn after(mut drive: Drive, input: Input) -> Drive {
    drive.step(&input);
    drive
}

const READY: Input =
    Input { word: ControlWord::DISABLE_VOLTAGE, alarm: Alarm::None, ready: true, release: false };

fn commanded(bits: u16) -> Input {
    Input { word: word(bits), ..READY }
}

#[test]
fn an_alarm_of_off_leads_to_fault_from_every_state_and_leaves_no_torque() {
    for drive in all_drives() {
        for input in all_inputs().into_iter().filter(|input| input.alarm == Alarm::Off) {
            let first = after(drive, input);
            assert!(!first.has_torque(), "{drive:?} {input:?}");
            assert_eq!(after(first, input).state, DriveState::Fault, "{drive:?} {input:?}");
        }
    }
}

#[test]
fn an_alarm_of_stop_is_never_followed_by_operation() {
    for drive in all_drives() {
        for input in all_inputs().into_iter().filter(|input| input.alarm == Alarm::Stop) {
            let next = after(drive, input);
            assert_ne!(next.state, DriveState::OperationEnabled, "{drive:?} {input:?}");
            // It takes torque from nobody by itself, and gives none.
            let lets_go = Command::of(input.word) == Command::DisableVoltage || input.release;
            assert_eq!(next.has_torque(), drive.has_torque() && !(lets_go && may_let_go(&drive, &input)));
        }
    }
}

fn may_let_go(drive: &Drive, input: &Input) -> bool {
    drive.state == DriveState::QuickStopActive || Command::of(input.word) == Command::DisableVoltage
}

#[test]
fn torque_comes_only_from_switched_on() {
    for drive in all_drives().into_iter().filter(|drive| !drive.has_torque()) {
        for input in all_inputs() {
            if after(drive, input).has_torque() {
                assert_eq!(drive.state, DriveState::SwitchedOn, "{drive:?} {input:?}");
                assert_eq!(Command::of(input.word), Command::EnableOperation);
                assert_eq!(input.alarm, Alarm::None);
            }
        }
    }
}

#[test]
fn one_word_repeated_never_leads_to_torque() {
    for drive in all_drives().into_iter().filter(|d| !d.has_torque() && d.state != DriveState::SwitchedOn) {
        for input in all_inputs() {
            let mut drive = drive;
            for _ in 0..20 {
                drive.step(&input);
                assert!(!drive.has_torque(), "{input:?}");
            }
        }
    }
}

#[test]
fn operation_after_a_stop_takes_a_reset_and_two_words() {
    let stopped = Drive { state: DriveState::QuickStopActive, word: word(0x0f), acknowledged: false };
    // In two words only if the first resets and switches on at once; never in one.
    for first in all_inputs() {
        assert_ne!(after(stopped, first).state, DriveState::OperationEnabled);
        for second in all_inputs() {
            let drive = after(after(stopped, first), second);
            let way = (first.word.bits(), Command::of(second.word)) == (0x87, Command::EnableOperation);
            assert!(way || drive.state != DriveState::OperationEnabled, "{first:?} {second:?}");
        }
    }
    let mut drive = stopped;
    for bits in [0x07, 0x0f, 0x07, 0x0f] {
        assert_eq!(drive.step(&commanded(bits)), DriveState::QuickStopActive, "no reset yet");
    }
    for bits in [0x8f, 0x07] {
        assert_eq!(drive.step(&commanded(bits)), DriveState::QuickStopActive);
    }
    assert_eq!(drive.step(&commanded(0x0f)), DriveState::OperationEnabled);
    // An alarm in between takes the reset back.
    let mut drive = stopped;
    drive.step(&commanded(0x8f));
    drive.step(&Input { alarm: Alarm::Stop, ..commanded(0x0f) });
    for bits in [0x07, 0x0f] {
        assert_eq!(drive.step(&commanded(bits)), DriveState::QuickStopActive);
    }
}

#[test]
fn a_fault_is_left_only_by_the_rising_edge_of_a_reset() {
    for drive in all_drives().into_iter().filter(|drive| drive.state == DriveState::Fault) {
        for input in all_inputs() {
            let rising = input.word.bits() & !drive.word.bits() & 0x80 != 0 && input.alarm == Alarm::None;
            let expected = if rising { DriveState::SwitchOnDisabled } else { DriveState::Fault };
            assert_eq!(after(drive, input).state, expected, "{drive:?} {input:?}");
        }
    }
}

#[test]
fn disable_voltage_takes_torque_away_at_once() {
    for drive in all_drives() {
        for input in all_inputs().into_iter().filter(|i| Command::of(i.word) == Command::DisableVoltage) {
            assert!(!after(drive, input).has_torque(), "{drive:?} {input:?}");
        }
    }
}

#[test]
fn the_way_of_the_standard_up_and_down() {
    use DriveState as S;
    let mut drive = Drive::default();
    for (bits, state) in [
        (0x00, S::SwitchOnDisabled),
        (0x0f, S::SwitchOnDisabled),
        (0x06, S::ReadyToSwitchOn),
        (0x0f, S::ReadyToSwitchOn),
        (0x07, S::SwitchedOn),
        (0x0f, S::OperationEnabled),
        (0x07, S::SwitchedOn),
        (0x06, S::ReadyToSwitchOn),
        (0x07, S::SwitchedOn),
        (0x0f, S::OperationEnabled),
        (0x06, S::ReadyToSwitchOn),
        (0x07, S::SwitchedOn),
        (0x02, S::SwitchOnDisabled),
        (0x06, S::ReadyToSwitchOn),
        (0x07, S::SwitchedOn),
        (0x0f, S::OperationEnabled),
        (0x02, S::QuickStopActive),
        (0x00, S::SwitchOnDisabled),
    ] {
        assert_eq!(drive.step(&commanded(bits)), state, "{bits:#x}");
    }
    let unfit = Input { ready: false, ..READY };
    assert_eq!(Drive::default().step(&unfit), S::NotReadyToSwitchOn);
}

#[test]
fn a_stop_holds_its_torque_unless_told_to_let_go() {
    let mut drive = Drive { state: DriveState::OperationEnabled, word: word(0x0f), acknowledged: false };
    let silent = Input { alarm: Alarm::Stop, ..commanded(0x0f) };
    for _ in 0..1000 {
        assert_eq!(drive.step(&silent), DriveState::QuickStopActive);
    }
    assert_eq!(drive.step(&Input { release: true, ..silent }), DriveState::SwitchOnDisabled);
}
