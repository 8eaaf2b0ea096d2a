//! The real client against the real session: in memory, and as the image in QEMU. Both must give the same bytes.
#![allow(clippy::expect_used, clippy::panic, reason = "helpers of tests end them as tests do")]

use firmware::app::{Controller, Identity};
use host::link::emulator::image;
use host::link::emulator::lockstep::Lockstep;
use host::link::host_end::{Heard, HostEnd};
use protocol::bench::{BusBytes, FromBoard, ToBoard};
use protocol::blackbox::Record;
use protocol::command::{ControlWord, Setpoint};
use protocol::fault::{Code, Fault, Limit, Refusal};
use protocol::ids::{FINGER_COUNT, FingerId, JOINT_COUNT};
use protocol::service::{Answer, Call, Event, Reply, Value};
use protocol::telemetry::{BusTier, DriveState, FingerSet, HandState};
use protocol::units::{AngleQ, TorqueQ};

const PERIOD_US: u32 = 1000;

/// A board, in memory or in QEMU.
trait Board {
    fn tick(&mut self, frame: &ToBoard) -> FromBoard;
}

impl Board for Controller {
    fn tick(&mut self, frame: &ToBoard) -> FromBoard {
        // Nothing is kept in memory, and the stories that save are of images.
        self.bench_period(frame, |_| false)
    }
}

impl Board for Lockstep {
    fn tick(&mut self, frame: &ToBoard) -> FromBoard {
        Lockstep::tick(self, frame).unwrap_or_else(|error| panic!("{error}"))
    }
}

/// A host, a board, and everything that passed between them.
struct Bench<B> {
    board: B,
    client: HostEnd,
    sensors: ToBoard,
    setpoint: Setpoint,
    passed: Vec<FromBoard>,
    heard: Vec<Heard>,
}

impl<B: Board> Bench<B> {
    fn new(board: B) -> Self {
        let sensors = ToBoard { position_rad: rest(), ..ToBoard::default() };
        let setpoint = Setpoint {
            position: rest().map(|q| AngleQ::from_rad(q).expect("a number")),
            ..Setpoint::default()
        };
        Self { board, client: HostEnd::default(), sensors, setpoint, passed: Vec::new(), heard: Vec::new() }
    }

    fn pass(&mut self, bytes: &[u8]) -> FromBoard {
        self.sensors.now_us += PERIOD_US;
        self.sensors.bus = BusBytes::new(bytes).expect("it fits into a period");
        let from = self.board.tick(&self.sensors);
        self.heard.extend(self.client.receive(from.bus.as_slice()));
        self.passed.push(from);
        from
    }

    fn silence(&mut self, periods: usize) {
        for _ in 0..periods {
            self.pass(&[]);
        }
    }

    /// Sends a set-point with this word for all fingers and returns the state in answer.
    fn command(&mut self, word: ControlWord) -> HandState {
        self.setpoint.control = word.with_fingers(FingerSet::ALL);
        let bytes = self.client.setpoint(&self.setpoint);
        let heard = self.heard.len();
        self.pass(&bytes);
        let state = self.heard[heard..].iter().find_map(|heard| match heard {
            Heard::State(state) => Some(**state),
            _ => None,
        });
        state.expect("every set-point is answered by a state")
    }

    fn enable(&mut self) {
        for word in [ControlWord::DISABLE_VOLTAGE, ControlWord::SHUTDOWN, ControlWord::SWITCH_ON] {
            self.command(word);
        }
        assert_eq!(self.command(ControlWord::ENABLE_OPERATION).status.drive, DriveState::OperationEnabled);
    }

    /// Asks and returns the bytes of the reply.
    fn ask(&mut self, call: Call) -> Vec<u8> {
        let (id, bytes) = self.client.request(call);
        let heard = self.heard.len();
        self.pass(&bytes);
        let reply = self.heard[heard..].iter().find_map(|heard| match heard {
            Heard::Reply(bytes) => Some(bytes.clone()),
            _ => None,
        });
        let reply = reply.expect("every request is answered");
        assert_eq!(Reply::decode(&reply).expect("a reply").id, id);
        reply
    }

    fn refused(&mut self, call: Call) -> Refusal {
        match Reply::decode(&self.ask(call)).expect("a reply").answer {
            Answer::Refused(code) => Refusal::from_number(code.0).expect("a refusal"),
            other => panic!("{other:?}"),
        }
    }

    fn fault(&self) -> Option<(Fault, Option<u8>)> {
        self.heard.iter().find_map(|heard| match heard {
            Heard::Log(record) => match record.event {
                Event::Fault(first) => Some((Fault::from_number(first.code.0)?, first.finger)),
                _ => None,
            },
            _ => None,
        })
    }
}

/// Angles well inside every range.
fn rest() -> [f32; JOINT_COUNT] {
    let mut angles = [0.5; JOINT_COUNT];
    for finger in FingerId::ALL {
        angles[1 + 3 * finger.index()] = 0.0;
    }
    angles
}

fn in_memory() -> Bench<Controller> {
    Bench::new(Controller::new(Identity { board: "mps2-an386", period_us: PERIOD_US, has_storage: true }))
}

/// Word of the service, of the cyclic channel, of faults, all in one run.
fn story<B: Board>(bench: &mut Bench<B>) {
    let reply = bench.ask(Call::Hello);
    let Answer::Hello(hello) = Reply::decode(&reply).expect("a reply").answer else { panic!("{reply:?}") };
    assert_eq!((hello.board, hello.protocol), ("mps2-an386", protocol::frame::VERSION));
    assert_eq!((hello.firmware, hello.schema), (env!("CARGO_PKG_VERSION"), protocol::schema::FINGERPRINT));
    for index in 0..hello.parameters {
        let reply = bench.ask(Call::ParameterInfo { index });
        let Answer::ParameterInfo(info) = Reply::decode(&reply).expect("a reply").answer else {
            panic!("{reply:?}")
        };
        let reply = bench.ask(Call::ParameterGet { index });
        assert_eq!(Reply::decode(&reply).expect("a reply").answer, Answer::Parameter(info.default));
    }
    assert_eq!(bench.refused(Call::ParameterGet { index: hello.parameters }), Refusal::UnknownParameter);
    assert_eq!(
        bench.refused(Call::ParameterSet { index: 0, value: Value::F32(f32::NAN) }),
        Refusal::OutOfRange
    );

    bench.enable();
    assert_eq!(bench.refused(Call::ParameterSet { index: 0, value: Value::F32(5.0) }), Refusal::TorqueOn);
    assert_eq!(bench.refused(Call::SensorZero { joints: 2 }), Refusal::TorqueOn);
    // The index finger is to bend; the joints do not move, so its torque grows.
    bench.setpoint.position[5] = AngleQ::from_rad(0.55).expect("a number");
    let state = (0..50).map(|_| bench.command(ControlWord::ENABLE_OPERATION)).last().expect("fifty states");
    let last = bench.passed.last().expect("it passed");
    assert_eq!((last.enabled, last.torque_nm[5] > 0.2, last.torque_nm[8].abs() < 1e-3), (0xf, true, true));
    assert!(state.position.iter().zip(rest()).all(|(q, rest)| (q.to_rad() - rest).abs() < 1e-4));

    // The line goes dead, is held, stops; the grip stays.
    let gripping_nm = last.torque_nm[5];
    bench.silence(100);
    let last = bench.passed.last().expect("it passed");
    assert_eq!((last.enabled, last.torque_nm[5]), (0xf, gripping_nm));
    let state = bench.command(ControlWord::ENABLE_OPERATION);
    assert_eq!((state.status.drive, state.status.bus), (DriveState::QuickStopActive, BusTier::Fresh));
    assert_eq!(state.status.fault, Code::from(Fault::BusSilent));
    assert!(state.status.limits.contains(Limit::Stopped));
    // Reset, two words, and it goes on.
    let reset = ControlWord::from_bits(0x8f).expect("defined bits");
    for word in [reset, ControlWord::SWITCH_ON] {
        assert_eq!(bench.command(word).status.drive, DriveState::QuickStopActive);
    }
    assert_eq!(bench.command(ControlWord::ENABLE_OPERATION).status.drive, DriveState::OperationEnabled);

    // A strain gauge breaks: its finger alone lets go.
    bench.sensors.joint_torque_nm[11] = f32::NAN;
    let state = bench.command(ControlWord::ENABLE_OPERATION);
    assert_eq!(state.status.fault, Code::from(Fault::SensorNotANumber));
    assert_eq!(bench.passed.last().map(|last| last.enabled), Some(0b0111));
    bench.silence(30);
    let reply = bench.ask(Call::BlackBox);
    let Answer::BlackBox(summary) = Reply::decode(&reply).expect("a reply").answer else {
        panic!("{reply:?}")
    };
    assert!(summary.frozen);
    let first = summary.first_fault.expect("there was one");
    assert_eq!(first.finger, Some(3));
    let mut before = 0;
    let mut at_fault = None;
    for index in 0..summary.full_rate {
        let reply = bench.ask(Call::BlackBoxRead { index });
        let Answer::Record(bytes) = Reply::decode(&reply).expect("a reply").answer else {
            panic!("{reply:?}")
        };
        let record = Record::decode(bytes.try_into().expect("its length")).expect("a record");
        assert!(record.t_us > before);
        before = record.t_us;
        if record.t_us == first.t_us {
            at_fault = Some(record);
        }
    }
    let at_fault = at_fault.expect("the moment of the fault is on record");
    assert_eq!((at_fault.fault, at_fault.output[11]), (first.code, TorqueQ(0)));
    let end = summary.full_rate + summary.decimated;
    assert_eq!(bench.refused(Call::BlackBoxRead { index: end }), Refusal::NoRecord);
    assert_eq!(bench.client.counters().refused(), 0);
    assert!(!bench.heard.iter().any(|heard| matches!(heard, Heard::Unknown(_))));
}

#[test]
fn the_image_tells_the_same_story_as_the_library_to_the_last_bit() {
    let mut memory = in_memory();
    story(&mut memory);
    let elf = image::build("mps2-an386").unwrap_or_else(|error| panic!("{error}"));
    let mut emulated = Bench::new(Lockstep::start(&elf).unwrap_or_else(|error| panic!("{error}")));
    story(&mut emulated);
    assert_eq!(emulated.passed.len(), memory.passed.len());
    for (i, (emulated, memory)) in emulated.passed.iter().zip(&memory.passed).enumerate() {
        assert_eq!(emulated, memory, "period {i}");
    }
    let status = emulated.board.finish().unwrap_or_else(|error| panic!("{error}"));
    assert!(status.success(), "{status}");
}

#[test]
fn parameters_outlast_the_power_supply() {
    let elf = image::build("mps2-an386").unwrap_or_else(|error| panic!("{error}"));
    let folder = tempfile::tempdir().expect("a folder");
    let flash = folder.path().join("flash.bin");
    let start = || {
        let board = Lockstep::start_with_flash(&elf, Some(&flash)).unwrap_or_else(|error| panic!("{error}"));
        Bench::new(board)
    };
    let gain = |bench: &mut Bench<Lockstep>| {
        let reply = bench.ask(Call::ParameterGet { index: 7 });
        let Answer::Parameter(Value::F32(gain)) = Reply::decode(&reply).expect("a reply").answer else {
            panic!("{reply:?}")
        };
        gain
    };
    let done = |bench: &mut Bench<Lockstep>, call| {
        let reply = bench.ask(call);
        Reply::decode(&reply).expect("a reply").answer == Answer::Done
    };
    let mut bench = start();
    assert_eq!(gain(&mut bench), 0.5);
    bench.ask(Call::ParameterSet { index: 7, value: Value::F32(0.75) });
    assert!(done(&mut bench, Call::ParameterSave));
    bench.ask(Call::ParameterSet { index: 7, value: Value::F32(1.5) });
    bench.enable();
    for call in [Call::ParameterSave, Call::ParameterDefaults] {
        assert_eq!(bench.refused(call), Refusal::TorqueOn);
    }
    bench.board.finish().unwrap_or_else(|error| panic!("{error}"));

    let mut bench = start();
    assert_eq!(gain(&mut bench), 0.75, "what was saved, not what was set");
    assert!(done(&mut bench, Call::ParameterDefaults));
    assert_eq!(gain(&mut bench), 0.5);
    bench.board.finish().unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(gain(&mut start()), 0.75, "defaults were not saved");
}

#[test]
fn a_stuck_sender_is_told_from_a_dead_line() {
    for (stuck, fault) in [(true, Fault::SenderStuck), (false, Fault::BusSilent)] {
        let mut bench = in_memory();
        bench.enable();
        for _ in 0..25 {
            let bytes =
                if stuck { bench.client.setpoint_again(&bench.setpoint) } else { b"\0noise\0".to_vec() };
            bench.pass(&bytes);
        }
        bench.command(ControlWord::ENABLE_OPERATION);
        for _ in 0..30 {
            bench.command(ControlWord::ENABLE_OPERATION);
        }
        assert_eq!(bench.fault(), Some((fault, None)));
    }
}

#[test]
fn messages_that_are_none_are_refused_and_change_nothing() {
    let mut bench = in_memory();
    bench.enable();
    for (message, refusal) in [
        (&[0x01, 2, 3][..], Refusal::WrongLength),
        (&[0x02, 1, 99], Refusal::Malformed),
        (&[0x02, 1, 0, 0], Refusal::TrailingBytes),
        (&[0x81; HandState::LEN], Refusal::UnknownKind),
        (&[0x77], Refusal::UnknownKind),
    ] {
        let bytes = bench.client.framed(message);
        bench.pass(&bytes);
        let before = bench.heard.len();
        // The log comes behind states, one event at a time.
        for _ in 0..20 {
            let state = bench.command(ControlWord::ENABLE_OPERATION);
            assert_eq!(state.status.drive, DriveState::OperationEnabled);
        }
        let expected = Event::Refused(Code::from(refusal));
        let logged = |heard: &Heard| matches!(heard, Heard::Log(record) if record.event == expected);
        assert!(bench.heard[before..].iter().any(logged), "{message:02x?}");
    }
    let mut two = bench.client.request(Call::Hello).1;
    two.extend(bench.client.request(Call::Hello).1);
    bench.pass(&two);
    let answers: Vec<_> = bench
        .heard
        .iter()
        .filter_map(|heard| match heard {
            Heard::Reply(bytes) => Some(Reply::decode(bytes).expect("a reply").answer),
            _ => None,
        })
        .collect();
    assert_eq!(answers[0], Answer::Refused(Code::from(Refusal::Busy)));
    assert!(matches!(answers[1], Answer::Hello(_)));
}

#[test]
fn a_torn_line_loses_no_good_frame() {
    // Garbage before every frame, and every frame in pieces of one byte over many periods: nothing is refused but the
    // garbage, and what is asked is answered.
    let mut bench = in_memory();
    let (_, bytes) = bench.client.request(Call::Link);
    bench.pass(&[0x55; 300]);
    for byte in bytes {
        bench.pass(&[byte]);
    }
    let link = bench.heard.iter().find_map(|heard| match heard {
        Heard::Reply(bytes) => match Reply::decode(bytes).expect("a reply").answer {
            Answer::Link(counters) => Some(counters),
            _ => None,
        },
        _ => None,
    });
    let link = link.expect("an answer");
    assert_eq!((link.good, link.too_long, link.refused()), (1, 1, 1));
}

#[test]
fn torque_comes_without_a_step_wherever_the_set_point_is() {
    let mut bench = in_memory();
    bench.setpoint.position = [AngleQ::MAX; JOINT_COUNT];
    bench.setpoint.feed_forward = [TorqueQ::MAX; JOINT_COUNT];
    bench.enable();
    let mut before = [0.0; JOINT_COUNT];
    for from in &bench.passed {
        for (before, now) in before.iter_mut().zip(from.torque_nm) {
            // A period at full speed, stiffness and torque rate, through the gain of the torque loop.
            assert!((now - *before).abs() < 0.9, "{before} {now}");
            *before = now;
        }
    }
    assert_eq!(bench.passed[2].torque_nm, [0.0; JOINT_COUNT]);
}

#[test]
fn sensors_are_zeroed_only_by_what_can_be_an_offset() {
    let mut bench = in_memory();
    bench.sensors.joint_torque_nm = [0.1; JOINT_COUNT];
    bench.sensors.joint_torque_nm[4] = 0.3;
    bench.silence(1);
    assert_eq!(bench.refused(Call::SensorZero { joints: 0x1ffe }), Refusal::NotAtZero);
    assert_eq!(bench.refused(Call::SensorZero { joints: 0x2000 }), Refusal::UnknownJoint);
    assert!(bench.command(ControlWord::DISABLE_VOLTAGE).torque[5].to_nm() > 0.09);
    let reply = bench.ask(Call::SensorZero { joints: 1 << 5 });
    assert_eq!(Reply::decode(&reply).expect("a reply").answer, Answer::Done);
    let state = bench.command(ControlWord::DISABLE_VOLTAGE);
    assert_eq!(state.torque[5], TorqueQ(0));
    assert!(state.torque[6].to_nm() > 0.09, "only the one asked for");
    assert_eq!(state.status.fingers, [DriveState::SwitchOnDisabled; FINGER_COUNT]);
}
