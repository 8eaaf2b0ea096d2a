//! What the hand tells of itself: the state for the bus, the black box, the log.

use protocol::blackbox::Record;
use protocol::fault::{Code, Limit, LimitSet};
use protocol::ids::{FINGER_COUNT, JOINT_COUNT, JointId};
use protocol::service::Event;
use protocol::telemetry::{FingerSet, JointSet, Status, TipWrench};
use protocol::units::{AngleQ, ForceQ, TipTorqueQ, TorqueQ, VelocityQ};

use super::Controller;
use crate::control::{self, Sensors};
use crate::safety::{Found, Mode};

impl Controller {
    /// What the host will be told. A reading that is no number leaves the last one: no wire value stands for it, and
    /// the fault tells.
    pub(super) fn update_state(
        &mut self,
        now_us: u32,
        sensors: &Sensors,
        modes: &[Mode; FINGER_COUNT],
        slowed: JointSet,
        limits: &[control::Limit; JOINT_COUNT],
    ) {
        let state = &mut self.state;
        state.t_us = now_us;
        state.echoed_seq = self.supervisor.bus().last_seq();
        state.command_age_us = u16::try_from(self.supervisor.bus().age_us()).unwrap_or(u16::MAX);
        state.refused = self.session.counters().refused() as u16;
        for (i, velocity) in self.control.velocity_rad_per_s().iter().enumerate() {
            update(&mut state.position[i], AngleQ::from_rad(sensors.position_rad[i]));
            update(&mut state.velocity[i], VelocityQ::from_rad_per_s(*velocity));
            update(&mut state.torque[i], TorqueQ::from_nm(sensors.joint_torque_nm[i]));
        }
        for (TipWrench { force, torque }, read) in state.tip_wrench.iter_mut().zip(&sensors.tip_wrench)
        {
            for i in 0..3 {
                update(&mut force[i], ForceQ::from_n(read[i]));
                update(&mut torque[i], TipTorqueQ::from_nm(read[3 + i]));
            }
        }
        let (mut limited, mut reasons) = (JointSet::default(), LimitSet::default());
        for joint in JointId::ALL {
            let held = match modes[joint.moves().index()] {
                Mode::Off => continue,
                Mode::Follow => None,
                Mode::Hold => Some(Limit::Held),
                Mode::Stop => Some(Limit::Stopped),
            };
            let slowed = slowed.contains(joint).then_some(Limit::Speed);
            for limit in [held, slowed, limit_on_wire(limits[joint.index()])].into_iter().flatten() {
                limited = limited.with(joint);
                reasons = reasons.with(limit);
            }
        }
        state.status = Status {
            drive: self.supervisor.hand(),
            fingers: self.supervisor.fingers(),
            bus: self.supervisor.tier(),
            fault: self.supervisor.first_fault().map_or(Code::NONE, |first| first.code),
            slipping: FingerSet::default(),
            limited,
            limits: reasons,
        };
    }

    /// Into the black box, and what has changed into the log.
    pub(super) fn record(&mut self, found: &Found) {
        let (state, last) = (&self.state, &mut self.last);
        let status = &state.status;
        let log = self.session.log();
        let drives = (status.drive, status.fingers);
        if core::mem::replace(&mut last.drives, drives) != drives {
            let fingers = status.fingers.map(|state| state as u8);
            log.push(state.t_us, Event::Drives { hand: status.drive as u8, fingers });
        }
        if core::mem::replace(&mut last.tier, status.bus) != status.bus {
            log.push(state.t_us, Event::Bus { tier: status.bus as u8 });
        }
        if found.reset {
            self.recorder.resume();
        }
        if let Some(fault) = found.new_fault {
            log.push(state.t_us, Event::Fault(fault));
            self.recorder.freeze();
        }
        let mut record = Record {
            t_us: state.t_us,
            drive: status.drive,
            fingers: status.fingers,
            bus: status.bus,
            fault: status.fault,
            position: state.position,
            torque: state.torque,
            ..Record::default()
        };
        for i in 0..JOINT_COUNT {
            update(&mut record.target[i], AngleQ::from_rad(last.excitation.target_rad[i]));
            update(&mut record.output[i], TorqueQ::from_nm(last.excitation.output_nm[i]));
        }
        self.recorder.record(&record);
    }
}

fn update<T>(place: &mut T, value: Option<T>) {
    if let Some(value) = value {
        *place = value;
    }
}

/// The control laws' limit by its number on the wire. That the thumb's rotation is braked is no news.
const fn limit_on_wire(limit: control::Limit) -> Option<Limit> {
    match limit {
        control::Limit::None | control::Limit::Braked => None,
        control::Limit::Torque => Some(Limit::Torque),
        control::Limit::TipForce => Some(Limit::TipForce),
        control::Limit::Position => Some(Limit::Position),
        control::Limit::BadTarget => Some(Limit::BadTarget),
        control::Limit::BadInput => Some(Limit::BadInput),
    }
}
