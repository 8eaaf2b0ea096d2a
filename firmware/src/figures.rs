//! What the hand's work costs, in instructions: the work that is counted, without the counter, which is a board's.
//!
//! All fingers follow set-points and move, the thumb as a spring at its tip; a set-point comes with every second period, as
//! with 8 kHz of control and 4 kHz of bus. Sensors are noisy, so that no branch always goes one way.

use core::fmt::{self, Write};
use core::hint::black_box;

use protocol::command::{ControlWord, Setpoint, ThumbImpedance};
use protocol::frame::{FRAME_MAX, Framer, MESSAGE_MAX};
use protocol::ids::{FINGER_COUNT, FingerJoint, JOINT_COUNT, JointId};
use protocol::service::{Call, Request};
use protocol::telemetry::{FingerSet, HandState, TipWrench};
use protocol::units::{AngleQ, DampingQ, ForceQ, StiffnessQ, TipTorqueQ, TorqueQ, VelocityQ};

use crate::app::{Controller, Output};
use crate::control::impedance::{FingerMotion, tip_torque};
use crate::control::{Config, Sensors};
use crate::finger_bus::{FingerBus, LEN, Reply};

/// Counts the instructions of a piece of work.
pub trait Counter {
    /// Does the work and returns how many instructions it took, its own included, and what it gave.
    fn count<T>(&self, work: impl FnOnce() -> T) -> (u32, T);
}

/// Periods that are counted.
const PERIODS: u16 = 1000;
/// Periods before that, in which the drives are switched on.
const WARM_UP: u16 = 40;
/// Times that a piece without a state is counted.
const REPETITIONS: u16 = 5;

/// Counts and writes lines of a name and a number: `nothing`, what counting itself costs; `thumb`, the thumb's impedance
/// alone; `state_frame`, a state's message, CRC and stuffing; `fingers`, commands and replies of the finger boards; and for
/// every period `receive`, `tick` and `transmit`, which is [`Controller::serve`] and [`Controller::transmit`]. Then `enabled`,
/// the periods in which all fingers had torque, and `segments`, the periods in which they followed segments instead, blends
/// among them. Last `report`, a state, and `serve`, the longest reply.
///
/// `hand` is a new one with a period of `period_us`.
///
/// # Errors
///
/// Those of writing.
pub fn report(
    counter: &impl Counter,
    hand: &mut Controller,
    period_us: u32,
    out: &mut impl Write,
) -> fmt::Result {
    for _ in 0..REPETITIONS {
        writeln!(out, "nothing {}", counter.count(|| ()).0)?;
    }
    thumb(counter, hand.control_config(), out)?;
    state_frame(counter, out)?;
    fingers(counter, out)?;
    periods(counter, hand, period_us, out)?;
    segments(counter, hand, period_us, out)?;
    replies(counter, hand, out)
}

#[inline(never)]
fn thumb(counter: &impl Counter, config: &Config, out: &mut impl Write) -> fmt::Result {
    let mut noise = Noise(1);
    for _ in 0..REPETITIONS {
        // Some millimetres apart, so that the spring's force is not cut.
        let mut motion = || FingerMotion {
            angle_rad: [0.0; 3].map(|_: f32| 0.5 + noise.next(0.05)),
            speed_rad_per_s: [0.0; 3].map(|_: f32| noise.next(0.5)),
        };
        let (is, should) = black_box((motion(), motion()));
        let (instructions, _) =
            counter.count(|| black_box(tip_torque(&config.finger, &config.thumb, &is, &should)));
        writeln!(out, "thumb {instructions}")?;
    }
    Ok(())
}

/// Of a hand that moves, and of one whose state is nothing but zeros, which is the worst for the stuffing.
#[inline(never)]
fn state_frame(counter: &impl Counter, out: &mut impl Write) -> fmt::Result {
    let mut framer = Framer::default();
    let mut noise = Noise(3);
    for seq in 0..REPETITIONS {
        let zeros = HandState { seq, ..HandState::default() };
        let mut digits = || noise.next(2000.0) as i16;
        let moving = HandState {
            position: zeros.position.map(|_| AngleQ(digits())),
            velocity: zeros.velocity.map(|_| VelocityQ(digits())),
            torque: zeros.torque.map(|_| TorqueQ(digits())),
            tip_wrench: zeros.tip_wrench.map(|_| TipWrench {
                force: [0; 3].map(|_| ForceQ(digits())),
                torque: [0; 3].map(|_| TipTorqueQ(digits())),
            }),
            ..zeros
        };
        for (name, state) in [("state_frame", moving), ("state_frame_of_zeros", zeros)] {
            let mut wire = [0; FRAME_MAX];
            let state = black_box(state);
            let (instructions, _) = counter.count(|| {
                let frame = framer.frame_in_place(HandState::LEN, black_box(&mut wire), |place| {
                    if let Ok(place) = place.try_into() {
                        state.encode(place);
                    }
                });
                black_box(frame.map(<[u8]>::len))
            });
            writeln!(out, "{name} {instructions}")?;
        }
    }
    Ok(())
}

/// An exchange with four boards in good order.
#[inline(never)]
fn fingers(counter: &impl Counter, out: &mut impl Write) -> fmt::Result {
    let mut bus = FingerBus::default();
    let mut frames = [[0; LEN]; FINGER_COUNT];
    let mut noise = Noise(4);
    let output = Output {
        torque_nm: [0.0; JOINT_COUNT].map(|_: f32| noise.next(1.0)),
        enabled: [true; FINGER_COUNT],
        thumb_rotation_rad: Some(1.0),
        feed_watchdog: true,
    };
    for echo in 0..REPETITIONS as u8 {
        let mut answers = [[0; LEN]; FINGER_COUNT];
        for reply in &mut answers {
            let mut digits = || noise.next(2000.0) as i16;
            Reply {
                echo,
                angle: [0; 3].map(|_| AngleQ(digits())),
                torque: [0; 3].map(|_| TorqueQ(digits())),
                force: [0; 3].map(|_| ForceQ(digits())),
                moment: [0; 3].map(|_| TipTorqueQ(digits())),
                ..Reply::default()
            }
            .encode(reply);
        }
        let (instructions, ()) = counter.count(|| {
            bus.command(Some(black_box(&output)), black_box(&mut frames));
            bus.take(black_box(&answers));
        });
        black_box(bus.sensors());
        writeln!(out, "fingers {instructions}")?;
    }
    Ok(())
}

/// To and fro by segments that are hardly longer than their blends; a set-point comes with every second period.
#[inline(never)]
fn segments(
    counter: &impl Counter,
    hand: &mut Controller,
    period_us: u32,
    out: &mut impl Write,
) -> fmt::Result {
    let mut framer = Framer::default();
    let mut noise = Noise(5);
    let (mut wire, mut buffer) = ([0; FRAME_MAX], [0; MESSAGE_MAX]);
    let word = ControlWord::ENABLE_OPERATION.with_thumb_impedance().with_segments();
    for index in 0..PERIODS {
        let seq = WARM_UP + PERIODS + index;
        let angles_rad = swing_rad(seq);
        if index % 2 == 0 {
            let mut message = [0; Setpoint::LEN];
            setpoint(seq, word, &angles_rad).encode(&mut message);
            receive(hand, framer.frame(&message, &mut wire).unwrap_or(&[]));
        }
        // The first one is asked for when the set-point before has said that there are segments.
        if index % 480 == 1 {
            let number = index / 480;
            let position = swing_rad(if number % 2 == 0 { 400 } else { 0 })
                .map(|q| AngleQ::from_rad(q).unwrap_or_default().0);
            let call = Call::Segment { number, replaces: number == 0, time_us: 60_000, position };
            let request = Request { id: number, call };
            receive(hand, framer.frame(request.encode(&mut buffer).unwrap_or(&[]), &mut wire).unwrap_or(&[]));
            serve(hand);
        }
        let sensors = Sensors {
            position_rad: angles_rad.map(|angle_rad| angle_rad + noise.next(1e-4)),
            joint_torque_nm: [0.0; JOINT_COUNT].map(|_: f32| noise.next(0.02)),
            tip_wrench: [[0.0; 6]; FINGER_COUNT].map(|wrench| wrench.map(|_: f32| noise.next(0.05))),
        };
        let now_us = u32::from(seq) * period_us;
        let (tick, output) = counter.count(|| hand.tick(black_box(now_us), black_box(&sensors)));
        serve(hand);
        let _ = transmit(hand, &mut [0; 2 * FRAME_MAX]);
        if output.enabled == [true; FINGER_COUNT] {
            writeln!(out, "segments {tick}")?;
        }
    }
    Ok(())
}

/// A set-point is answered by a state, and with it the black box is asked for a record.
#[inline(never)]
fn replies(counter: &impl Counter, hand: &mut Controller, out: &mut impl Write) -> fmt::Result {
    let mut framer = Framer::default();
    let (mut wire, mut buffer) = ([0; FRAME_MAX], [0; MESSAGE_MAX]);
    let angles_rad = swing_rad(0);
    let sensors = Sensors {
        position_rad: angles_rad,
        joint_torque_nm: [0.0; JOINT_COUNT],
        tip_wrench: [[0.0; 6]; FINGER_COUNT],
    };
    for index in 0..REPETITIONS {
        let mut message = [0; Setpoint::LEN];
        // Numbers behind those of the periods are new.
        let seq = WARM_UP + 2 * PERIODS + index;
        setpoint(seq, ControlWord::ENABLE_OPERATION, &angles_rad).encode(&mut message);
        receive(hand, framer.frame(&message, &mut wire).unwrap_or(&[]));
        let request = Request { id: index, call: Call::BlackBoxRead { index } };
        receive(hand, framer.frame(request.encode(&mut buffer).unwrap_or(&[]), &mut wire).unwrap_or(&[]));
        let _ = hand.tick(u32::from(seq) * 125, &sensors);
        let (report, ()) = counter.count(|| hand.report());
        let (served, ()) = counter.count(|| serve(hand));
        let mut room = [0; 2 * FRAME_MAX];
        let _ = transmit(hand, &mut room);
        writeln!(out, "report {report}\nserve {served}")?;
    }
    Ok(())
}

#[inline(never)]
fn periods(
    counter: &impl Counter,
    hand: &mut Controller,
    period_us: u32,
    out: &mut impl Write,
) -> fmt::Result {
    let mut framer = Framer::default();
    let mut noise = Noise(2);
    let words = [
        ControlWord::DISABLE_VOLTAGE,
        ControlWord::SHUTDOWN,
        ControlWord::SWITCH_ON,
        ControlWord::ENABLE_OPERATION.with_thumb_impedance(),
    ];
    let mut wire = [0; FRAME_MAX];
    let mut enabled = 0;
    for period in 0..WARM_UP + PERIODS {
        let angles_rad = swing_rad(period);
        let mut message = [0; Setpoint::LEN];
        setpoint(period, words[usize::from(period / 2).min(words.len() - 1)], &angles_rad)
            .encode(&mut message);
        let frame = if period % 2 == 0 { framer.frame(&message, &mut wire).unwrap_or(&[]) } else { &[] };
        let sensors = Sensors {
            position_rad: angles_rad.map(|angle_rad| angle_rad + noise.next(1e-4)),
            joint_torque_nm: [0.0; JOINT_COUNT].map(|_: f32| noise.next(0.02)),
            tip_wrench: [[0.0; 6]; FINGER_COUNT].map(|wrench| wrench.map(|_: f32| noise.next(0.05))),
        };
        let (received, ()) = counter.count(|| receive(hand, black_box(frame)));
        let now_us = u32::from(period) * period_us;
        let (tick, output) = counter.count(|| hand.tick(black_box(now_us), black_box(&sensors)));
        enabled += u16::from(period >= WARM_UP && output.enabled == [true; FINGER_COUNT]);
        let mut room = [0; FRAME_MAX];
        let (transmitted, _) = counter.count(|| {
            serve(hand);
            transmit(hand, black_box(&mut room))
        });
        if period >= WARM_UP {
            writeln!(out, "receive {received}\ntick {tick}\ntransmit {transmitted}")?;
        }
    }
    writeln!(out, "enabled {enabled}")
}

// Once in the image, and not at every place that calls them.
#[inline(never)]
fn receive(hand: &mut Controller, bytes: &[u8]) {
    hand.receive(bytes);
}

#[inline(never)]
fn serve(hand: &mut Controller) {
    hand.serve();
}

#[inline(never)]
fn transmit(hand: &mut Controller, room: &mut [u8]) -> usize {
    hand.transmit(room)
}

/// To and fro at 1 rad/s of a controller at 8 kHz; abductions stand in the middle.
fn swing_rad(period: u16) -> [f32; JOINT_COUNT] {
    let phase = period % 800;
    let bend_rad = 0.5 + f32::from(phase.min(800 - phase)) * 125e-6;
    JointId::ALL.map(|joint| match joint.finger_joint() {
        None | Some((_, FingerJoint::Abduction)) => 0.05,
        Some((_, FingerJoint::Flexion | FingerJoint::Middle)) => bend_rad,
    })
}

fn setpoint(seq: u16, word: ControlWord, angles_rad: &[f32; JOINT_COUNT]) -> Setpoint {
    let stiffness = StiffnessQ::from_n_per_m(500.0).unwrap_or_default();
    let damping = DampingQ::from_n_s_per_m(10.0).unwrap_or_default();
    Setpoint {
        seq,
        control: word.with_fingers(FingerSet::ALL),
        position: angles_rad.map(|angle_rad| AngleQ::from_rad(angle_rad).unwrap_or_default()),
        thumb: ThumbImpedance { stiffness: [stiffness; 3], damping: [damping; 3] },
        ..Setpoint::default()
    }
}

/// Numbers that look random, from a linear congruence (Numerical Recipes, 3rd edition, section 7.1).
struct Noise(u32);

impl Noise {
    /// Within `+-most`.
    fn next(&mut self, most: f32) -> f32 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        ((self.0 >> 16) as f32 / 32_768.0 - 1.0) * most
    }
}
