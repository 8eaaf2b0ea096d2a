//! Answers to requests.

use protocol::blackbox::Record;
use protocol::fault::{Code, Refusal};
use protocol::ids::{JOINT_COUNT, JointId};
use protocol::service::{Answer, BlackBox, Call, Hello, Reply, Request};
use protocol::telemetry::JointSet;
use protocol::units::AngleQ;

use super::Controller;
use crate::control::segments::{Segment, SegmentError};
use crate::parameters::{self, Parameters};
use crate::safety::Mode;

/// A strain gauge's reading beyond this is a load, not an offset.
const ZERO_MAX_NM: f32 = 0.2;

impl Controller {
    /// Answers the request that waits, if one does.
    pub fn serve(&mut self) {
        // The state comes before the reply, as they were asked for.
        self.report();
        let Some(request) = self.session.take_request() else { return };
        let mut record = [0; Record::LEN];
        let answer = match self.answer(&request, &mut record) {
            Ok(Some(answer)) => answer,
            Ok(None) => return,
            Err(refusal) => Answer::Refused(Code::from(refusal)),
        };
        self.session.reply(&Reply { id: request.id, answer });
    }

    /// The answer; `None` when it comes later.
    fn answer<'a>(
        &mut self,
        request: &Request,
        record: &'a mut [u8; Record::LEN],
    ) -> Result<Option<Answer<'a>>, Refusal> {
        let torque_off = || if self.supervisor.has_torque() { Err(Refusal::TorqueOn) } else { Ok(()) };
        Ok(Some(match request.call {
            Call::Hello => Answer::Hello(Hello {
                firmware: env!("CARGO_PKG_VERSION"),
                protocol: protocol::frame::VERSION,
                board: self.identity.board,
                schema: protocol::schema::FINGERPRINT,
                parameters: parameters::COUNT,
            }),
            Call::ParameterInfo { index } => Answer::ParameterInfo(*Parameters::info(index)?),
            Call::ParameterGet { index } => Answer::Parameter(self.parameters.get(index)?),
            Call::ParameterSet { index, value } => {
                torque_off()?;
                let mut parameters = self.parameters;
                parameters.set(index, value)?;
                self.set_parameters(&parameters);
                Answer::Parameter(value)
            }
            Call::SensorZero { joints } => {
                torque_off()?;
                self.zero(joints)?;
                Answer::Done
            }
            Call::BlackBox => {
                let (full_rate, decimated) = self.recorder.len();
                Answer::BlackBox(BlackBox {
                    full_rate: full_rate as u16,
                    decimated: decimated as u16,
                    frozen: self.recorder.is_frozen(),
                    first_fault: self.supervisor.first_fault(),
                })
            }
            Call::BlackBoxRead { index } => {
                self.recorder.get(usize::from(index)).ok_or(Refusal::NoRecord)?.encode(record);
                Answer::Record(record)
            }
            Call::Link => Answer::Link(*self.session.counters()),
            Call::ParameterSave => {
                torque_off()?;
                if !self.identity.has_storage {
                    return Err(Refusal::NoStorage);
                } else if self.save.is_some() {
                    return Err(Refusal::Busy);
                }
                // Answered when the board has done it.
                self.save = Some((request.id, false));
                return Ok(None);
            }
            Call::ParameterDefaults => {
                torque_off()?;
                self.set_parameters(&Parameters::default());
                Answer::Done
            }
            Call::Segment { number, replaces, time_us, position } => {
                self.segment(number, replaces, time_us, position)?;
                Answer::Done
            }
        }))
    }

    /// Whether the mechanism lets a joint have this angle.
    #[inline(never)]
    fn reaches(&self, joint: JointId, angle_rad: f32) -> bool {
        self.settings.control.limits.range(joint).contains(angle_rad)
    }

    /// Takes a segment, or one that it has taken already.
    fn segment(
        &mut self,
        number: u16,
        replaces: bool,
        time_us: u32,
        position: [i16; JOINT_COUNT],
    ) -> Result<(), Refusal> {
        let modes = &self.last.modes;
        let follows =
            modes.contains(&Mode::Follow) && !modes.contains(&Mode::Hold) && !modes.contains(&Mode::Stop);
        if !follows || !self.supervisor.word().segments() {
            return Err(Refusal::NoSegmentsNow);
        } else if self.segment == Some(number) {
            return Ok(());
        } else if !replaces && self.segment.map(|last| last.wrapping_add(1)) != Some(number) {
            return Err(Refusal::SegmentMissing);
        }
        let segment = Segment { goal_rad: position.map(|digits| AngleQ(digits).to_rad()), time_us };
        for (joint, goal_rad) in JointId::ALL.into_iter().zip(segment.goal_rad) {
            if !self.reaches(joint, goal_rad) {
                return Err(Refusal::OutOfRange);
            }
        }
        match self.follower.add_segment(&self.settings.target, &segment, replaces) {
            Ok(()) => self.segment = Some(number),
            Err(SegmentError::Full) => return Err(Refusal::SegmentsFull),
            Err(SegmentError::Time) => return Err(Refusal::SegmentTime),
        }
        Ok(())
    }

    /// Takes the present readings of these strain gauges as zero; all of them or none.
    fn zero(&mut self, joints: u16) -> Result<(), Refusal> {
        let joints = JointSet::from_bits(joints).map_err(|_| Refusal::UnknownJoint)?;
        let mut zero_nm = self.zero_nm;
        let readings = zero_nm.iter_mut().zip(self.last.raw_torque_nm);
        for (joint, (zero_nm, reading_nm)) in JointId::ALL.into_iter().zip(readings) {
            if !joints.contains(joint) {
                continue;
            }
            if reading_nm.is_nan() || reading_nm.abs() > ZERO_MAX_NM {
                return Err(Refusal::NotAtZero);
            }
            *zero_nm = reading_nm;
        }
        self.zero_nm = zero_nm;
        Ok(())
    }
}
