//! Links only if no panic is reachable from the bus or from the control period: its panic handler calls a function that nobody defines, and the linker
//! takes the handler in as soon as any code may come to it. Never run.
#![no_std]
#![no_main]
#![allow(unsafe_code, reason = "an undefined function is a foreign one")]

use core::hint::black_box;
use core::panic::PanicInfo;

use cortex_m as _; // its critical section
use cortex_m_rt::entry;
use firmware::app::{Controller, Identity};
use firmware::clock::PeriodClock;
use firmware::control::Sensors;
use firmware::finger_bus::{FingerBus, LEN};
use firmware::line::RingReader;
use protocol::bench::{FromBoard, ToBoard};
use protocol::blackbox::Record;
use protocol::command::Setpoint;
use protocol::frame::{Deframer, FRAME_MAX, Framer, MESSAGE_MAX};
use protocol::ids::FINGER_COUNT;
use protocol::service::{LogRecord, Reply, Request};
use protocol::telemetry::HandState;

unsafe extern "C" {
    /// Not defined anywhere.
    fn a_panic_is_reachable() -> !;
}

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    // SAFETY: an image with this call in it does not link.
    unsafe { a_panic_is_reachable() }
}

/// All that a board with fingers calls once a control period around the controller.
fn exchange(hand: &mut Controller, fingers: &mut FingerBus, clock: &mut PeriodClock, ring: &mut RingReader) {
    let (mut commands, replies) = ([[0; LEN]; FINGER_COUNT], black_box([[0; LEN]; FINGER_COUNT]));
    fingers.take(&replies);
    let output = hand.tick(clock.step(black_box(0)), fingers.sensors());
    fingers.command(Some(&output), &mut commands);
    black_box((commands, fingers.present(), *fingers.counters(), ring.take(black_box(7))));
}

/// All that a board calls once a control period.
fn control_period(hand: &mut Controller) {
    let frame = ToBoard::decode(black_box(&[0; ToBoard::LEN]));
    hand.receive(frame.bus.as_slice());
    let sensors = Sensors {
        position_rad: frame.position_rad,
        joint_torque_nm: frame.joint_torque_nm,
        tip_wrench: frame.tip_wrench,
    };
    black_box(hand.tick(frame.now_us, &sensors));
    hand.serve();
    if let Some(parameters) = black_box(hand.take_save()) {
        black_box(parameters);
        hand.saved(black_box(true));
    }
    hand.transmit(black_box(&mut [0; 64]));
}

/// Everything that reads or writes bytes of the bus, and the whole controller, on bytes of which the compiler knows nothing.
#[entry]
fn main() -> ! {
    let (mut framer, mut deframer) = (Framer::default(), Deframer::default());
    let (mut buffer, mut wire) = ([0; MESSAGE_MAX], [0; FRAME_MAX]);
    let mut hand = Controller::new(Identity { board: "none", period_us: 125, has_storage: true });
    let (mut fingers, mut clock) = (FingerBus::default(), PeriodClock::new(125, 0));
    let mut ring = RingReader::new(1024);
    loop {
        let mut bytes: &[u8] = black_box(&[0; 64][..]);
        while let Some(frame) = deframer.receive(&mut bytes) {
            let message = black_box(frame.message);
            if let Ok(setpoint) = message.try_into().map(Setpoint::decode) {
                let _ = black_box(setpoint);
            }
            if let Ok(state) = message.try_into().map(HandState::decode) {
                let _ = black_box(state);
            }
            if let Ok(record) = message.try_into().map(Record::decode) {
                let _ = black_box(record);
            }
            if let Ok(request) = Request::decode(message) {
                let _ = black_box(request.encode(&mut buffer));
            }
            if let Ok(reply) = Reply::decode(message) {
                let _ = black_box(reply.encode(&mut buffer));
            }
            if let Ok(record) = LogRecord::decode(message) {
                let _ = black_box(record.encode(&mut buffer));
            }
            let _ = black_box(framer.frame(message, &mut wire));
        }
        let mut state = [0; HandState::LEN];
        black_box(HandState::default()).encode(&mut state);
        let mut setpoint = [0; Setpoint::LEN];
        black_box(Setpoint::default()).encode(&mut setpoint);
        let mut record = [0; Record::LEN];
        black_box(Record::default()).encode(&mut record);
        black_box((state, setpoint, record, deframer.counters()));
        let mut from = [0; FromBoard::LEN];
        black_box(FromBoard::default()).encode(&mut from);
        black_box(from);
        control_period(black_box(&mut hand));
        exchange(black_box(&mut hand), black_box(&mut fingers), black_box(&mut clock), black_box(&mut ring));
    }
}
