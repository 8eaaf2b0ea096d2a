use super::*;
use hand_model::HandModel;
use proptest::prelude::*;
use protocol::telemetry::FingerSet;

const PERIOD_US: u32 = 1000;

fn config() -> Config {
    Config {
        period_us: PERIOD_US,
        bus: bus::Config::default(),
        sensors: sensors::Config::new(&HandModel::hit_dlr()),
        release_us: None,
    }
}

fn sensors() -> Sensors {
    Sensors {
        position_rad: [0.0; JOINT_COUNT],
        joint_torque_nm: [0.0; JOINT_COUNT],
        tip_wrench: [[0.0; 6]; FINGER_COUNT],
    }
}

/// A hand with a clock and a host that numbers its set-points.
struct Bench {
    config: Config,
    supervisor: Supervisor,
    sensors: Sensors,
    now_us: u32,
    seq: u16,
}

impl Bench {
    fn new() -> Self {
        Self { config: config(), supervisor: Supervisor::default(), sensors: sensors(), now_us: 0, seq: 0 }
    }

    fn cycle(&mut self, word: Option<ControlWord>, elapsed_us: u32, all_alive: bool) -> Found {
        self.now_us += elapsed_us;
        self.seq += u16::from(word.is_some());
        if all_alive {
            for part in [Part::Control, Part::Bus, Part::Sensors] {
                self.supervisor.check_in(part);
            }
        }
        self.supervisor.may_feed(elapsed_us);
        let cycle = Cycle {
            now_us: self.now_us,
            elapsed_us,
            heard: Heard { setpoint: word.map(|_| self.seq), frame: word.is_some() },
            word,
            excitation: &Excitation {
                target_rad: [0.0; JOINT_COUNT],
                output_nm: [0.0; JOINT_COUNT],
                active: self.supervisor.modes().map(|mode| mode != Mode::Off),
            },
        };
        self.supervisor.step(&self.config, &cycle, &mut self.sensors.clone())
    }

    fn command(&mut self, word: ControlWord) -> Found {
        self.cycle(Some(word.with_fingers(FingerSet::ALL)), PERIOD_US, true)
    }

    fn silence(&mut self, periods: u32) -> Found {
        let mut found = self.cycle(None, PERIOD_US, true);
        for _ in 1..periods {
            found = self.cycle(None, PERIOD_US, true);
        }
        found
    }

    fn enabled() -> Self {
        let mut bench = Self::new();
        for word in [ControlWord::DISABLE_VOLTAGE, ControlWord::SHUTDOWN, ControlWord::SWITCH_ON] {
            assert_eq!(bench.command(word).modes, [Mode::Off; FINGER_COUNT]);
        }
        assert_eq!(bench.command(ControlWord::ENABLE_OPERATION).modes, [Mode::Follow; FINGER_COUNT]);
        bench
    }

    fn code(&self) -> Option<(Code, Option<u8>)> {
        self.supervisor.first_fault().map(|first| (first.code, first.finger))
    }
}

#[test]
fn a_lost_bus_holds_then_stops_and_never_lets_go() {
    let mut bench = Bench::enabled();
    for (periods, mode, tier) in [
        (4, Mode::Follow, BusTier::Fresh),
        (5, Mode::Follow, BusTier::Late),
        (10, Mode::Hold, BusTier::Hold),
        (20, Mode::Stop, BusTier::Stop),
        (5000, Mode::Stop, BusTier::Stop),
    ] {
        let mut bench = Bench::enabled();
        let found = bench.silence(periods);
        assert_eq!((found.modes, bench.supervisor.tier()), ([mode; FINGER_COUNT], tier), "{periods}");
    }
    bench.silence(20);
    assert_eq!(bench.code(), Some((Code::from(Fault::BusSilent), None)));
    // The bus is back, but the stop is latched.
    for _ in 0..100 {
        assert_eq!(bench.command(ControlWord::ENABLE_OPERATION).modes, [Mode::Stop; FINGER_COUNT]);
    }
    assert!(bench.command(reset()).reset);
    assert_eq!(bench.code(), None);
    assert_eq!(bench.command(ControlWord::SWITCH_ON).modes, [Mode::Stop; FINGER_COUNT]);
    assert_eq!(bench.command(ControlWord::ENABLE_OPERATION).modes, [Mode::Follow; FINGER_COUNT]);
}

fn reset() -> ControlWord {
    ControlWord::from_bits(ControlWord::ENABLE_OPERATION.bits() | ControlWord::FAULT_RESET.bits())
        .expect("defined bits")
}

#[test]
fn a_short_silence_is_only_held() {
    let mut bench = Bench::enabled();
    assert_eq!(bench.silence(19).modes, [Mode::Hold; FINGER_COUNT]);
    assert_eq!(bench.command(ControlWord::ENABLE_OPERATION).modes, [Mode::Follow; FINGER_COUNT]);
    assert_eq!(bench.code(), None);
}

#[test]
fn a_stop_lets_go_when_so_configured() {
    let mut bench = Bench::enabled();
    bench.config.release_us = Some(500_000);
    assert_eq!(bench.silence(500).modes, [Mode::Stop; FINGER_COUNT]);
    assert_eq!(bench.silence(30).modes, [Mode::Off; FINGER_COUNT]);
    assert_eq!(bench.supervisor.hand(), DriveState::SwitchOnDisabled);
}

#[test]
fn a_silent_bus_of_a_hand_at_rest_is_no_fault() {
    let mut bench = Bench::new();
    bench.silence(1000);
    assert_eq!((bench.supervisor.hand(), bench.code()), (DriveState::SwitchOnDisabled, None));
    assert_eq!(bench.supervisor.tier(), BusTier::Stop);
}

#[test]
fn a_bad_sensor_takes_torque_from_its_finger_alone() {
    let mut bench = Bench::enabled();
    bench.sensors.position_rad[8] = f32::NAN;
    let found = bench.command(ControlWord::ENABLE_OPERATION);
    assert_eq!(found.modes, [Mode::Follow, Mode::Follow, Mode::Off, Mode::Follow]);
    assert_eq!(bench.code(), Some((Code::from(Fault::SensorNotANumber), Some(2))));
    bench.command(ControlWord::ENABLE_OPERATION);
    assert_eq!(bench.supervisor.fingers()[2], DriveState::Fault);
    // While the cause lasts a reset resets nothing.
    bench.command(reset());
    assert_eq!(bench.supervisor.fingers()[2], DriveState::Fault);
    assert_eq!(bench.code(), Some((Code::from(Fault::SensorNotANumber), Some(2))));
    bench.sensors = sensors();
    for _ in 0..100 {
        bench.command(ControlWord::ENABLE_OPERATION);
    }
    assert_eq!(bench.supervisor.fingers()[2], DriveState::Fault, "no fault resets itself");
    bench.command(reset());
    assert_eq!(bench.supervisor.fingers()[2], DriveState::SwitchOnDisabled);
    assert_eq!(bench.code(), None);
}

#[test]
fn a_finger_joins_the_others_by_one_bit() {
    let mut bench = Bench::new();
    let some = FingerSet::default().with(FingerId::Thumb).with(FingerId::Index);
    for word in [
        ControlWord::DISABLE_VOLTAGE,
        ControlWord::SHUTDOWN,
        ControlWord::SWITCH_ON,
        ControlWord::ENABLE_OPERATION,
    ] {
        bench.cycle(Some(word.with_fingers(some)), PERIOD_US, true);
    }
    let modes = bench.cycle(Some(ControlWord::ENABLE_OPERATION.with_fingers(some)), PERIOD_US, true).modes;
    assert_eq!(modes, [Mode::Follow, Mode::Follow, Mode::Off, Mode::Off]);
    assert_eq!(bench.command(ControlWord::ENABLE_OPERATION).modes, [Mode::Follow; FINGER_COUNT]);
}

#[test]
fn overruns_and_dead_tasks_stop_the_hand() {
    let enable = ControlWord::ENABLE_OPERATION.with_fingers(FingerSet::ALL);
    let mut bench = Bench::enabled();
    for _ in 0..3 {
        assert_eq!(bench.cycle(Some(enable), 2 * PERIOD_US, true).modes, [Mode::Follow; FINGER_COUNT]);
    }
    assert_eq!(bench.cycle(Some(enable), 2 * PERIOD_US, true).modes, [Mode::Stop; FINGER_COUNT]);
    assert_eq!(bench.code(), Some((Code::from(Fault::Overrun), None)));
    assert_eq!(bench.supervisor.overruns().missed, 4);

    let mut bench = Bench::enabled();
    let periods = (1..100).find(|_| bench.cycle(Some(enable), PERIOD_US, false).modes[0] == Mode::Stop);
    assert_eq!(periods, Some(50));
    assert_eq!(bench.code(), Some((Code::from(Fault::TaskSilent), None)));
}

#[test]
fn torques_that_are_no_numbers_do_not_pass_and_end_operation() {
    let mut bench = Bench::enabled();
    let mut torques = [0.1; JOINT_COUNT];
    assert_eq!(bench.supervisor.gate(torques), torques);
    torques[3] = f32::NAN;
    assert_eq!(bench.supervisor.gate(torques), [0.0; JOINT_COUNT]);
    assert_eq!(bench.command(ControlWord::ENABLE_OPERATION).modes, [Mode::Off; FINGER_COUNT]);
    assert_eq!(bench.code(), Some((Code::from(Fault::OutputNotANumber), None)));
}

proptest! {
    #[test]
    fn no_finger_has_torque_that_was_not_asked_for(
        words in proptest::collection::vec((any::<u16>(), any::<bool>(), 0_u8..20), 1..200),
    ) {
        let mut bench = Bench::new();
        let mut before = [Mode::Off; FINGER_COUNT];
        for (bits, comes, bad) in words {
            let word = ControlWord::from_bits(bits & 0x0f9f).expect("defined bits");
            bench.sensors = sensors();
            if bad < 4 {
                bench.sensors.position_rad[1 + 3 * usize::from(bad)] = f32::NAN;
            }
            let found = bench.cycle(comes.then_some(word), PERIOD_US, true);
            for finger in FingerId::ALL {
                let (was, is) = (before[finger.index()], found.modes[finger.index()]);
                if was == Mode::Off && is != Mode::Off {
                    prop_assert!(comes && word.fingers().contains(finger) && word.bits() & 0xf == 0xf);
                }
                prop_assert!(is == Mode::Off || bad != finger.index() as u8);
            }
            before = found.modes;
        }
    }
}
