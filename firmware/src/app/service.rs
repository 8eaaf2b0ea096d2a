//! Answers to requests.

use protocol::blackbox::Record;
use protocol::fault::{Code, Refusal};
use protocol::ids::JointId;
use protocol::service::{Answer, BlackBox, Call, Hello, Reply};
use protocol::telemetry::JointSet;

use super::Controller;
use crate::parameters::{self, Parameters};

/// A strain gauge's reading beyond this is a load, not an offset.
const ZERO_MAX_NM: f32 = 0.2;

impl Controller {
    /// Answers the request that waits, if one does.
    pub fn serve(&mut self) {
        // The state comes before the reply, as they were asked for.
        self.report_if_due();
        let Some(request) = self.session.take_request() else { return };
        if request.call == Call::ParameterSave
            && let Ok(()) = self.may_save()
        {
            // Answered when the board has done it.
            self.save = Some((request.id, false));
            return;
        }
        let mut record = [0; Record::LEN];
        let answer = self
            .answer(&request.call, &mut record)
            .unwrap_or_else(|refusal| Answer::Refused(Code::from(refusal)));
        self.session.reply(&Reply { id: request.id, answer });
    }

    fn answer<'a>(&mut self, call: &Call, record: &'a mut [u8; Record::LEN]) -> Result<Answer<'a>, Refusal> {
        let torque_off = || if self.supervisor.has_torque() { Err(Refusal::TorqueOn) } else { Ok(()) };
        Ok(match *call {
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
                self.parameters.set(index, value)?;
                self.settings = self.parameters.settings(&self.model, self.identity.period_us);
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
            Call::ParameterSave => self.may_save().map(|()| Answer::Done)?,
            Call::ParameterDefaults => {
                torque_off()?;
                self.parameters = Parameters::default();
                self.settings = self.parameters.settings(&self.model, self.identity.period_us);
                Answer::Done
            }
        })
    }

    fn may_save(&self) -> Result<(), Refusal> {
        if self.supervisor.has_torque() {
            Err(Refusal::TorqueOn)
        } else if !self.identity.has_storage {
            Err(Refusal::NoStorage)
        } else if self.save.is_some() {
            Err(Refusal::Busy)
        } else {
            Ok(())
        }
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
