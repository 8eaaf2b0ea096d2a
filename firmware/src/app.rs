//! The whole hand without its hardware: what a board calls, and what runs in the host's twin.
//!
//! ```text
//! every control period   tick(now, sensors) -> torques, enables, may the watchdog be fed
//! when bytes have come   receive(bytes)
//! when time is left      report(), a state;  serve(), one request;  transmit(room) -> bytes for the line
//! ```
//!
//! `tick` has one length whatever the bus brings; all that may take longer is in `report`, `serve` and `transmit`. Where
//! those come late, several set-points are answered by one state, the last.

mod bench;
mod report;
mod service;

use hand_model::HandModel;
use protocol::fault::Refusal;
use protocol::ids::{FINGER_COUNT, FingerId, JOINT_COUNT, JointId};
use protocol::service::{Answer, Event, Reply};
use protocol::telemetry::{BusTier, DriveState, FingerSet, HandState};

use crate::control::{self, Sensors};
use crate::parameters::{Parameters, Settings};
use crate::safety::recorder::Recorder;
use crate::safety::sensors::Excitation;
use crate::safety::target::Follower;
use crate::safety::watch::Part;
use crate::safety::{Cycle, Found, Mode, Supervisor, bus::Heard};
use crate::session::Session;

/// What makes one hand different from another.
#[derive(Debug, Clone, Copy)]
pub struct Identity {
    /// Name of the board.
    pub board: &'static str,
    /// Nominal control period.
    pub period_us: u32,
    /// Whether the board keeps parameters, and so asks for [`Controller::take_save`].
    pub has_storage: bool,
}

/// What the drives are to do until the next period.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Output {
    /// Joint torques, in the order of `JointId`; finite, and 0 where a drive is off.
    pub torque_nm: [f32; JOINT_COUNT],
    /// Fingers whose drives are on.
    pub enabled: [bool; FINGER_COUNT],
    /// Where the thumb's rotation is to go, while the thumb is on.
    pub thumb_rotation_rad: Option<f32>,
    /// Whether all parts have checked in and the watchdog may be fed.
    pub feed_watchdog: bool,
}

/// The hand.
#[derive(Debug, Clone)]
pub struct Controller {
    identity: Identity,
    model: HandModel<f32>,
    parameters: Parameters,
    settings: Settings,
    session: Session,
    supervisor: Supervisor,
    recorder: Recorder,
    control: control::State,
    follower: Follower,
    /// Stiffness of the thumb's tip as it is now, along x, y, z.
    thumb_stiffness_n_per_m: [f32; 3],
    zero_nm: [f32; JOINT_COUNT],
    last: Last,
    state: HandState,
    /// A set-point has not been answered by its state yet.
    report_is_due: bool,
    /// Request whose parameters are to be kept, and whether the board has been told.
    save: Option<(u16, bool)>,
    /// Number of the last segment that was taken; `None` when the next one must replace.
    segment: Option<u16>,
}

/// What the period before leaves.
#[derive(Debug, Clone, Copy)]
struct Last {
    now_us: Option<u32>,
    thumb_stiffness_n_per_m: [f32; 3],
    setpoint_us: u32,
    modes: [Mode; FINGER_COUNT],
    excitation: Excitation,
    /// Strain gauges before their zero is taken off.
    raw_torque_nm: [f32; JOINT_COUNT],
    /// Sensors with their zeros, as they were believed.
    sensors: Sensors,
    limits: [control::Limit; JOINT_COUNT],
    drives: (DriveState, [DriveState; FINGER_COUNT]),
    tier: BusTier,
    slipping: FingerSet,
}

impl Controller {
    /// A hand with default parameters that has not seen its sensors yet.
    #[must_use]
    pub fn new(identity: Identity) -> Self {
        let model = HandModel::hit_dlr();
        let parameters = Parameters::default();
        let mut session = Session::default();
        session.log().push(0, Event::Started);
        let zero = [0.0; JOINT_COUNT];
        Self {
            identity,
            settings: parameters.settings(&model, identity.period_us),
            model,
            parameters,
            session,
            supervisor: Supervisor::default(),
            recorder: Recorder::default(),
            control: control::State::default(),
            follower: Follower::new(zero),
            thumb_stiffness_n_per_m: [0.0; 3],
            zero_nm: zero,
            last: Last {
                now_us: None,
                thumb_stiffness_n_per_m: [0.0; 3],
                setpoint_us: 0,
                modes: [Mode::Off; FINGER_COUNT],
                excitation: Excitation { target_rad: zero, output_nm: zero, active: [false; FINGER_COUNT] },
                raw_torque_nm: zero,
                sensors: Sensors {
                    position_rad: zero,
                    joint_torque_nm: zero,
                    tip_wrench: [[0.0; 6]; FINGER_COUNT],
                },
                limits: [control::Limit::None; JOINT_COUNT],
                drives: Default::default(),
                tier: BusTier::default(),
                slipping: FingerSet::default(),
            },
            state: HandState::default(),
            report_is_due: false,
            save: None,
            segment: None,
        }
    }

    /// Takes over parameters, as those that were kept, while no drive has torque.
    pub fn set_parameters(&mut self, parameters: &Parameters) {
        self.parameters = *parameters;
        self.settings = self.parameters.settings(&self.model, self.identity.period_us);
    }

    /// Parameters that the board is to keep now, which may take long: no drive has torque. It says [`Self::saved`] then.
    pub fn take_save(&mut self) -> Option<Parameters> {
        let (id, is_taken) = self.save.as_mut()?;
        if core::mem::replace(is_taken, true) {
            return None;
        }
        if self.supervisor.has_torque() {
            // It came on since the request.
            let (id, answer) = (*id, Answer::Refused(Refusal::TorqueOn.into()));
            self.save = None;
            self.session.reply(&Reply { id, answer });
            return None;
        }
        Some(self.parameters)
    }

    /// What came of [`Self::take_save`].
    pub fn saved(&mut self, done: bool) {
        if let Some((id, _)) = self.save.take() {
            let answer = if done { Answer::Done } else { Answer::Refused(Refusal::StorageFailed.into()) };
            self.session.reply(&Reply { id, answer });
        }
    }

    /// The control laws in operation.
    #[must_use]
    pub const fn control_config(&self) -> &control::Config {
        &self.settings.control
    }

    /// Takes what the line has brought, which may be nothing.
    pub fn receive(&mut self, bytes: &[u8]) {
        self.supervisor.check_in(Part::Bus);
        self.session.receive(bytes, self.last.now_us.unwrap_or(0));
    }

    /// Bytes for the line, as many as there are or as fit; returns how many.
    pub fn transmit(&mut self, out: &mut [u8]) -> usize {
        self.report();
        self.session.transmit(out)
    }

    /// Frames the state that answers a set-point, if one is due; [`Self::serve`] and [`Self::transmit`] do it too. Not in
    /// `tick`, of which it would be half, and which must not wait for it.
    pub fn report(&mut self) {
        if core::mem::take(&mut self.report_is_due) {
            self.update_state();
            self.session.report(&self.state);
        }
    }

    /// One control period, which begins at `now_us` of a clock that wraps.
    pub fn tick(&mut self, now_us: u32, sensors: &Sensors) -> Output {
        let period_us = self.identity.period_us;
        let elapsed_us = self.last.now_us.map_or(period_us, |last| now_us.wrapping_sub(last)).max(1);
        self.last.now_us = Some(now_us);
        let dt_s = elapsed_us as f32 * 1e-6;
        self.last.raw_torque_nm = sensors.joint_torque_nm;
        // Array by array: what is longer becomes a call, at four instructions a word.
        self.last.sensors.position_rad = sensors.position_rad;
        for i in 0..JOINT_COUNT {
            self.last.sensors.joint_torque_nm[i] = sensors.joint_torque_nm[i] - self.zero_nm[i];
        }
        for (wrench, read) in self.last.sensors.tip_wrench.iter_mut().zip(&sensors.tip_wrench) {
            *wrench = *read;
        }

        let setpoint = self.session.take_setpoint().map(|setpoint| (setpoint.seq, setpoint.control));
        self.supervisor.check_in(Part::Sensors);
        let found = self.supervisor.step(
            &self.settings.safety,
            &Cycle {
                now_us,
                elapsed_us,
                heard: Heard { setpoint: setpoint.map(|(seq, _)| seq), frame: self.session.take_frames() },
                word: setpoint.map(|(_, word)| word),
                excitation: &self.last.excitation,
            },
            &mut self.last.sensors,
        );
        if found.fresh {
            self.state.seq = self.state.seq.wrapping_add(1);
            self.report_is_due = true;
        }
        self.follow(&found, now_us, elapsed_us, dt_s);
        let output_nm = self.control(&found, dt_s);
        let enabled = found.modes.map(|mode| mode != Mode::Off);
        let target_rad = self.follower.target().position_rad;
        self.last.excitation = Excitation { target_rad, output_nm, active: enabled };
        self.last.modes = found.modes;
        self.record(now_us, &found);
        self.supervisor.check_in(Part::Control);
        Output {
            torque_nm: output_nm,
            enabled,
            thumb_rotation_rad: enabled[FingerId::Thumb.index()]
                .then_some(target_rad[JointId::THUMB_ROTATION.index()]),
            feed_watchdog: self.supervisor.may_feed(elapsed_us),
        }
    }

    /// Moves the target on.
    fn follow(&mut self, found: &Found, now_us: u32, elapsed_us: u32, dt_s: f32) {
        let measured = &self.last.sensors.position_rad;
        for finger in FingerId::ALL {
            let i = finger.index();
            if found.modes[i] == Mode::Off || self.last.modes[i] == Mode::Off {
                self.follower.restart(finger, measured);
            }
        }
        let by_segments = self.supervisor.word().segments();
        if by_segments {
            self.keep_segments(found);
        } else {
            self.segment = None;
        }
        self.follower.follow_segments(by_segments);
        if found.fresh {
            let setpoint = self.session.last_setpoint();
            let most = self.settings.thumb_damping_max_n_s_per_m;
            let damping = setpoint.thumb.damping.map(|asked| lesser(asked.to_n_s_per_m(), most));
            self.settings.control.thumb.damping_n_s_per_m = damping;
            self.settings.stop.thumb.damping_n_s_per_m = damping;
            let between_us = now_us.wrapping_sub(self.last.setpoint_us).min(self.settings.safety.bus.stop_us);
            let most = self.settings.thumb_stiffness_max_n_per_m;
            self.last.thumb_stiffness_n_per_m =
                setpoint.thumb.stiffness.map(|asked| lesser(asked.to_n_per_m(), most));
            self.last.setpoint_us = now_us;
            self.follower.head_for(setpoint, between_us as f32 * 1e-6);
        }
        if found.modes.iter().any(|mode| matches!(mode, Mode::Hold | Mode::Stop)) {
            self.follower.stay();
        }
        let active = found.modes.map(|mode| mode != Mode::Off);
        if by_segments {
            self.follower.step_segments(&self.settings.target, active, elapsed_us);
        } else {
            self.follower.step(&self.settings.target, active, dt_s);
        }
    }

    /// Segments end with a hold or a stop, and where a finger joins or leaves the others.
    fn keep_segments(&mut self, found: &Found) {
        let follows = |mode: Mode| matches!(mode, Mode::Off | Mode::Follow);
        let is_off = |mode: Mode| mode == Mode::Off;
        if !found.modes.into_iter().all(follows) || found.modes.map(is_off) != self.last.modes.map(is_off) {
            self.follower.drop_segments();
            self.segment = None;
        }
    }

    /// Torques of this period; why they are less than asked is left in `last`.
    fn control(&mut self, found: &Found, dt_s: f32) -> [f32; JOINT_COUNT] {
        let stops = found.modes.contains(&Mode::Stop);
        let config = if stops { &mut self.settings.stop } else { &mut self.settings.control };
        for (now, goal) in self.thumb_stiffness_n_per_m.iter_mut().zip(self.last.thumb_stiffness_n_per_m) {
            let tighter = *now + self.settings.thumb_stiffness_rate_n_per_m_s * dt_s;
            *now = if goal < tighter { goal } else { tighter };
        }
        config.thumb.stiffness_n_per_m = self.thumb_stiffness_n_per_m;
        let (sensors, target) = (&self.last.sensors, self.follower.target());
        let mut torques = control::step(config, &mut self.control, sensors, target, dt_s);
        for finger in FingerId::ALL {
            if found.modes[finger.index()] == Mode::Off {
                torques.nm[finger.joints()].fill(0.0);
            }
        }
        if found.modes[FingerId::Thumb.index()] == Mode::Off {
            self.control.end_boost();
        }
        self.last.limits = torques.limits;
        self.supervisor.gate(torques.nm)
    }
}

/// The lesser number. `min`, which thinks of NaN, is a call of twenty instructions.
fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[cfg(test)]
mod tests;
