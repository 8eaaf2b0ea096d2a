//! What the hand tells of itself: the state for the bus, the black box, the log.

use protocol::fault::{Code, Limit, LimitSet};
use protocol::ids::{JOINT_COUNT, JointId};
use protocol::service::Event;
use protocol::telemetry::{FingerSet, JointSet, Status, TipWrench};
use protocol::units::{AngleQ, ForceQ, TipTorqueQ, TorqueQ, VelocityQ};

use super::Controller;
use crate::control;
use crate::safety::{Found, Mode, Supervisor};

impl Controller {
    /// What the host will be told, beside what [`Self::record`] has noted in every period. A reading that is no number
    /// leaves the last one: no wire value stands for it, and the fault tells.
    pub(super) fn update_state(&mut self) {
        let (state, last) = (&mut self.state, &self.last);
        state.t_us = last.now_us.unwrap_or(0);
        state.echoed_seq = self.supervisor.bus().last_seq();
        state.command_age_us = u16::try_from(self.supervisor.bus().age_us()).unwrap_or(u16::MAX);
        state.refused = self.session.counters().refused() as u16;
        for (i, velocity) in self.control.velocity_rad_per_s().iter().enumerate() {
            update(&mut state.velocity[i], VelocityQ::from_rad_per_s(*velocity));
        }
        for (TipWrench { force, torque }, read) in state.tip_wrench.iter_mut().zip(&last.sensors.tip_wrench) {
            for i in 0..3 {
                update(&mut force[i], ForceQ::from_n(read[i]));
                update(&mut torque[i], TipTorqueQ::from_nm(read[3 + i]));
            }
        }
        let (mut limited, mut reasons) = (JointSet::default(), LimitSet::default());
        for joint in JointId::ALL {
            let held = match last.modes[joint.moves().index()] {
                Mode::Off => continue,
                Mode::Follow => None,
                Mode::Hold => Some(Limit::Held),
                Mode::Stop => Some(Limit::Stopped),
            };
            let slowed = self.follower.limited().contains(joint).then_some(Limit::Speed);
            for limit in [held, slowed, limit_on_wire(last.limits[joint.index()])].into_iter().flatten() {
                limited = limited.with(joint);
                reasons = reasons.with(limit);
            }
        }
        state.status = Status {
            drive: self.supervisor.hand(),
            fingers: self.supervisor.fingers(),
            bus: self.supervisor.tier(),
            fault: first_fault(&self.supervisor),
            slipping: last.slipping,
            limited,
            limits: reasons,
        };
    }

    /// Into the black box, and what has changed into the log.
    // A function of its own, as every large step of a period: all of them in one run out of registers.
    #[inline(never)]
    pub(super) fn record(&mut self, t_us: u32, found: &Found) {
        let fault = first_fault(&self.supervisor);
        let (drive, fingers, bus) =
            (self.supervisor.hand(), self.supervisor.fingers(), self.supervisor.tier());
        let (state, last, log) = (&mut self.state, &mut self.last, self.session.log());
        if core::mem::replace(&mut last.drives, (drive, fingers)) != (drive, fingers) {
            log.push(t_us, Event::Drives { hand: drive as u8, fingers: fingers.map(|state| state as u8) });
        }
        if core::mem::replace(&mut last.tier, bus) != bus {
            log.push(t_us, Event::Bus { tier: bus as u8 });
        }
        let slipping = FingerSet::of(self.control.slipping());
        if core::mem::replace(&mut last.slipping, slipping) != slipping {
            log.push(t_us, Event::Slip { fingers: slipping.bits() });
        }
        if found.reset {
            self.recorder.resume();
        }
        if let Some(fault) = found.new_fault {
            log.push(t_us, Event::Fault(fault));
            self.recorder.freeze();
        }
        for i in 0..JOINT_COUNT {
            update(&mut state.position[i], AngleQ::from_rad(last.sensors.position_rad[i]));
            update(&mut state.torque[i], TorqueQ::from_nm(last.sensors.joint_torque_nm[i]));
        }
        self.recorder.record(|record| {
            (record.t_us, record.drive, record.fingers, record.bus, record.fault) =
                (t_us, drive, fingers, bus, fault);
            for i in 0..JOINT_COUNT {
                // Targets and outputs are numbers.
                record.target[i] = AngleQ::from_rad(last.excitation.target_rad[i]).unwrap_or_default();
                record.output[i] = TorqueQ::from_nm(last.excitation.output_nm[i]).unwrap_or_default();
            }
            (record.position, record.torque) = (state.position, state.torque);
        });
    }
}

fn first_fault(supervisor: &Supervisor) -> Code {
    supervisor.first_fault().map_or(Code::NONE, |first| first.code)
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
