//! A simulated mechanism whose hand is a board with the whole controller, spoken to over its bus as a real one would be.
//!
//! In every control period the board gets the mechanism's sensors and the bytes of one set-point, and gives torques for
//! the mechanism and the bytes of its state. So the session, the drives' steps to torque, the tiers of a silent bus, the
//! plausibility of sensors, the limits of targets and the integers of the wire all have their part in a grasp.
//!
//! The board of the image for QEMU has a control period of 1 ms, which is two steps of the physics and one cycle of the
//! bus; the STM32 boards have 125 us. The physics is not stepped as finely as those: what it would show
//! there is its own solver. Nor are its sensors held over eight of their periods: the speed estimate would see seven
//! standstills and a jump. All filters and limits of the controller are in seconds, so that the
//! laws are the same.

use firmware::control::Config;
use protocol::bench::{BUS_MAX, BusBytes, FromBoard, ToBoard};
use protocol::command::{ControlWord, Setpoint, ThumbImpedance};
use protocol::fault::Code;
use protocol::ids::{FingerId, JOINT_COUNT};
use protocol::service::{Answer, Call, Reply, Value};
use protocol::telemetry::{DriveState, FingerSet, HandState};
use protocol::units::{AngleQ, DampingQ, StiffnessQ, TorqueQ};
use thiserror::Error;

use super::board::{Board, PERIOD_US};
use super::cell::{Cell, whole_ticks};
use super::plant::{Plant, PlantError, Scene};
use super::sensors::SensorParameters;
use crate::link::host_end::{Heard, HostEnd};
use crate::link::{Command, HandFault, Link, LinkError, Report, ThumbLaw, TipWrench, TrueObject};

/// How many periods an answer may take.
const WAIT_PERIODS: usize = 10;
/// The parameter that is the rate of the hand's own slip reflex.
const REFLEX_RATE: &str = "slip.rate";

/// Why a hand on the bus was not made ready.
#[derive(Debug, Error)]
pub enum StartError {
    /// The scene cannot be simulated.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// The line broke, or the hand says nothing.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The hand said no.
    #[error("the hand refuses: {} (number {})", .0.text().unwrap_or("a reason of a newer version"), .0.0)]
    Refused(Code),
    /// The hand has no such parameter.
    #[error("the hand has no parameter {name}")]
    NoParameter {
        /// Its name.
        name: &'static str,
    },
    /// The drives do not come on.
    #[error("the hand's drives do not come on: {drive:?}, fault number {}", .fault.0)]
    NotReady {
        /// State of the hand.
        drive: DriveState,
        /// Its fault, if it has one.
        fault: Code,
    },
}

/// Something to go wrong, to see what becomes of a grasp then.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Failure {
    /// The board loses its power.
    Power,
    /// A finger's strain gauges give no number any more.
    StrainGauge(FingerId),
}

/// A simulated hand run by the board `B`.
pub struct OnBus<B> {
    cell: Cell,
    board: B,
    end: HostEnd,
    thumb: ThumbImpedance,
    now_us: u32,
    thumb_rotation_rad: f64,
    state: HandState,
    /// What is to fail, and when, in the hand's time since torque came on.
    failure: Option<(f64, Failure)>,
    executed_periods: u64,
}

impl<B: Board> OnBus<B> {
    /// Sets up a scene, and makes the hand ready as a host does: hello, its own slip reflex off, old faults reset, two
    /// steps to torque; the third comes with the first command. Until then the mechanism is at rest, as if braked. `seed`
    /// is that of the sensors' noise.
    ///
    /// # Errors
    /// [`StartError`].
    pub fn start(
        scene: &Scene,
        parameters: SensorParameters,
        seed: u64,
        board: B,
    ) -> Result<Self, StartError> {
        // The tip's spring that plans count on is that of the control laws; over the bus it is the host's to say.
        let spring = Config::new(&scene.hand.cast()).thumb;
        let thumb = ThumbImpedance {
            stiffness: spring.stiffness_n_per_m.map(|k| StiffnessQ::from_n_per_m(k).unwrap_or_default()),
            damping: spring.damping_n_s_per_m.map(|d| DampingQ::from_n_s_per_m(d).unwrap_or_default()),
        };
        let mut hand = Self {
            cell: Cell::new(scene, parameters, seed)?,
            board,
            end: HostEnd::default(),
            thumb,
            now_us: 0,
            thumb_rotation_rad: scene.angles.thumb_rotation_rad,
            state: HandState::default(),
            failure: None,
            executed_periods: 0,
        };
        hand.make_ready()?;
        Ok(hand)
    }

    /// Has something fail after so many seconds of commands.
    #[must_use]
    pub fn failing_at(mut self, time_s: f64, failure: Failure) -> Self {
        self.failure = Some((time_s, failure));
        self
    }

    /// The simulated hand, object and table.
    #[must_use]
    pub fn plant(&self) -> &Plant {
        self.cell.plant()
    }

    /// What the hand said last.
    #[must_use]
    pub fn state(&self) -> &HandState {
        &self.state
    }

    fn make_ready(&mut self) -> Result<(), StartError> {
        let parameters = self.ask(Call::Hello, |answer| match answer {
            Answer::Hello(hello) => Some(hello.parameters),
            _ => None,
        })?;
        self.switch_own_reflex_off(parameters.unwrap_or_default())?;
        let position = self.cell.read().position_rad;
        for word in [ControlWord::FAULT_RESET, ControlWord::SHUTDOWN, ControlWord::SWITCH_ON] {
            let setpoint = self.setpoint(word, &position, &[0.0; JOINT_COUNT], ThumbLaw::Position)?;
            self.cycle(&setpoint)?;
        }
        let status = self.state.status;
        let (drive, fault) = (status.drive, status.fault);
        if drive != DriveState::SwitchedOn || status.fingers.iter().any(|f| *f != DriveState::SwitchedOn) {
            return Err(StartError::NotReady { drive, fault });
        }
        Ok(())
    }

    /// The executor has its reflex, which knows the plan's forces; two at once would add up.
    fn switch_own_reflex_off(&mut self, parameters: u16) -> Result<(), StartError> {
        for index in 0..parameters {
            let is_it = self.ask(Call::ParameterInfo { index }, |answer| match answer {
                Answer::ParameterInfo(info) => Some(info.name == REFLEX_RATE),
                _ => None,
            })?;
            if is_it == Some(true) {
                self.ask(Call::ParameterSet { index, value: Value::F32(0.0) }, |_| Some(()))?;
                return Ok(());
            }
        }
        Err(StartError::NoParameter { name: REFLEX_RATE })
    }

    /// Asks and waits for the answer; `None` if `read` does not know it.
    fn ask<T>(
        &mut self,
        call: Call,
        read: impl Fn(&Answer<'_>) -> Option<T>,
    ) -> Result<Option<T>, StartError> {
        let (id, bytes) = self.end.request(call);
        let mut bytes = &bytes[..];
        for _ in 0..WAIT_PERIODS {
            let (_, heard) = self.period(core::mem::take(&mut bytes))?;
            for heard in heard {
                let Heard::Reply(reply) = heard else { continue };
                match Reply::decode(&reply) {
                    Ok(Reply { id: of, answer }) if of == id => {
                        return match answer {
                            Answer::Refused(code) => Err(StartError::Refused(code)),
                            answer => Ok(read(&answer)),
                        };
                    }
                    _ => {}
                }
            }
        }
        Err(LinkError::Lost(Box::new(Silent)).into())
    }

    /// One control period: sensors and these bytes to the board, torques and what it says from it.
    fn period(&mut self, bytes: &[u8]) -> Result<(FromBoard, Vec<Heard>), LinkError> {
        self.now_us = self.now_us.wrapping_add(PERIOD_US);
        let read = self.cell.read();
        let mut frame = ToBoard {
            now_us: self.now_us,
            position_rad: read.position_rad.map(|x| x as f32),
            joint_torque_nm: read.joint_torque_nm.map(|x| x as f32),
            tip_wrench: read.tip_wrench.map(|wrench| wrench.to_array().map(|x| x as f32)),
            // No message is as long as the room for a period.
            bus: BusBytes::new(&bytes[..bytes.len().min(BUS_MAX)]).unwrap_or_default(),
        };
        self.fail(&mut frame);
        let answer = self.board.tick(&frame)?;
        let heard = self.end.receive(answer.bus.as_slice());
        Ok((answer, heard))
    }

    fn fail(&mut self, frame: &mut ToBoard) {
        let Some((time_s, failure)) = self.failure else { return };
        if self.executed_periods as f64 * f64::from(PERIOD_US) * 1e-6 < time_s {
            return;
        }
        match failure {
            Failure::Power => self.board.kill(),
            Failure::StrainGauge(finger) => {
                frame.joint_torque_nm[finger.joints()].iter_mut().for_each(|nm| *nm = f32::NAN);
            }
        }
    }

    /// A cycle of the bus: a set-point, and the state that answers it.
    fn cycle(&mut self, setpoint: &Setpoint) -> Result<FromBoard, LinkError> {
        let bytes = self.end.setpoint(setpoint);
        let (answer, heard) = self.period(&bytes)?;
        let state = heard.into_iter().find_map(|heard| match heard {
            Heard::State(state) => Some(*state),
            _ => None,
        });
        self.state = state.ok_or_else(|| LinkError::Lost(Box::new(Silent)))?;
        Ok(answer)
    }

    fn setpoint(
        &self,
        word: ControlWord,
        position_rad: &[f64; JOINT_COUNT],
        feed_forward_nm: &[f64; JOINT_COUNT],
        thumb: ThumbLaw,
    ) -> Result<Setpoint, LinkError> {
        let mut setpoint = Setpoint {
            t_us: self.now_us.wrapping_add(PERIOD_US),
            control: match thumb {
                ThumbLaw::Position => word,
                ThumbLaw::Impedance => word.with_thumb_impedance(),
            }
            .with_fingers(FingerSet::ALL),
            // Under either law, so that the spring is there when it is asked for: it tightens slowly.
            thumb: self.thumb,
            ..Setpoint::default()
        };
        for joint in 0..JOINT_COUNT {
            let (angle, torque) = (position_rad[joint] as f32, feed_forward_nm[joint] as f32);
            setpoint.position[joint] = AngleQ::from_rad(angle).ok_or(LinkError::NotANumber)?;
            setpoint.feed_forward[joint] = TorqueQ::from_nm(torque).ok_or(LinkError::NotANumber)?;
        }
        Ok(setpoint)
    }

    fn report(&self) -> Report {
        let state = &self.state;
        Report {
            time_s: f64::from(state.t_us) * 1e-6,
            position_rad: state.position.map(|q| f64::from(q.to_rad())),
            joint_torque_nm: state.torque.map(|q| f64::from(q.to_nm())),
            tip_wrench: state.tip_wrench.map(|wrench| TipWrench {
                force: wrench.force.map(|q| f64::from(q.to_n())).into(),
                moment: wrench.torque.map(|q| f64::from(q.to_nm())).into(),
            }),
        }
    }
}

impl<B: Board> Link for OnBus<B> {
    /// `dt_s` must be a whole number of [`TICK_S`](super::TICK_S); the palm moves evenly over it. What is reported is what
    /// the hand's state says: the sensors as they were when the last control period began.
    fn step(&mut self, command: &Command, dt_s: f64) -> Result<Report, LinkError> {
        for left in (1..=whole_ticks(dt_s)?).rev() {
            let word = ControlWord::ENABLE_OPERATION;
            let setpoint =
                self.setpoint(word, &command.position_rad, &command.feed_forward_nm, command.thumb)?;
            let answer = self.cycle(&setpoint)?;
            self.executed_periods += 1;
            if answer.enabled & 1 << FingerId::Thumb.index() != 0 {
                self.thumb_rotation_rad = f64::from(answer.thumb_rotation_rad);
            }
            self.cell.advance(
                answer.torque_nm.map(f64::from),
                self.thumb_rotation_rad,
                &command.base_from_palm,
                1.0 / left as f64,
            );
        }
        Ok(self.report())
    }

    fn object(&self) -> Option<TrueObject> {
        self.cell.object()
    }

    fn fault(&self) -> Option<HandFault> {
        let status = &self.state.status;
        let follows = |state: DriveState| state == DriveState::OperationEnabled;
        let is_well = follows(status.drive) && status.fingers.into_iter().all(follows);
        (self.executed_periods > 0 && (!is_well || status.fault != Code::NONE)).then(|| HandFault {
            code: status.fault,
            fingers: FingerSet::of(status.fingers.map(|finger| !follows(finger))),
        })
    }
}

/// Nothing came in time that answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("the hand does not answer")]
struct Silent;

#[cfg(test)]
mod tests;
