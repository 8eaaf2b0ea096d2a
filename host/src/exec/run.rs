//! One grasp from the approach site to a verdict: the state machine.

use hand_model::HandModel;
use nalgebra::Isometry3;
use protocol::ids::{FINGER_COUNT, FingerId, JOINT_COUNT, JOINTS_PER_FINGER, JointId};
use thiserror::Error;

use super::judge::{Course as Judged, Sight};
use super::monitor::{Monitor, MonitorConfig, Touch};
use super::motion::{Course, Start};
use super::outcome::{Event, EventKind, Execution, TraceSample, Trouble, Verdict};
use super::phase::Phase;
use super::plan::{Closing, ExecutionPlan, ExecutionSettings};
use crate::link::{Command, Link, LinkError, Report, TrueObject};

/// Change of a joint's torque from which its finger counts as loaded where its tip feels nothing: a link touches, as in a
/// power grasp. Twice what the weight of a stretched finger changes.
const LOADED_NM: f64 = 0.1;

/// How long arm and hand stay where a fault met them before the execution ends.
const STAY_S: f64 = 0.5;

/// Why a plan was not executed to its end.
#[derive(Debug, Error)]
pub enum ExecutionError {
    /// The link failed.
    #[error("the execution broke off after {time_s} s")]
    Link {
        /// Time since the start.
        time_s: f64,
        /// What failed.
        source: LinkError,
        /// What had happened by then.
        so_far: Box<Execution>,
    },
    /// A setting is not a positive number.
    #[error("setting {name} must be a positive number, not {value}")]
    Setting {
        /// Which one.
        name: &'static str,
        /// Its value.
        value: f64,
    },
}

/// Drives `link` through `plan`.
///
/// # Errors
/// [`ExecutionError`]; a grasp that fails is not an error but a [`Verdict`].
pub fn execute<L: Link + ?Sized>(
    model: &HandModel<f64>,
    plan: &ExecutionPlan,
    settings: &ExecutionSettings,
    link: &mut L,
) -> Result<Execution, ExecutionError> {
    check(settings)?;
    let mut run = Run::new(Course { plan, settings, model });
    let mut next = Some(Phase::Prepare);
    while let Some(phase) = next {
        run.begin(phase, link.object());
        let ticks = (run.course.duration_s(phase, &run.start, run.trouble()) / settings.period_s).ceil();
        for tick in 1..=ticks as u64 {
            let times = [tick as f64, ticks].map(|ticks| ticks * settings.period_s);
            let command = run.course.command(phase, &run.start, run.trouble(), times, run.grip);
            let report = link.step(&command, settings.period_s).map_err(|source| run.broken_off(source))?;
            run.take_in(phase, &command, &report, link.object());
            if let Some(fault) = link.fault() {
                run.event(EventKind::Fault(fault));
                run.stay(phase, &command, link)?;
                return Ok(run.ended(Verdict::Faulted, link.object()));
            }
            if phase == Phase::Prepare && is_prepared(plan, &report) {
                break;
            }
            if run.trouble_in(phase) {
                break;
            }
        }
        next = run.after(phase);
    }
    Ok(run.end(link.object()))
}

/// Whether the hand has its pregrasp, within what friction and weight leave.
fn is_prepared(plan: &ExecutionPlan, report: &Report) -> bool {
    let rotation = JointId::THUMB_ROTATION.index();
    let pairs = report.position_rad.into_iter().zip(plan.pregrasp.to_array()).enumerate();
    pairs
        .into_iter()
        .all(|(joint, (is, should))| (is - should).abs() < if joint == rotation { 0.02 } else { 0.05 })
}

fn check(settings: &ExecutionSettings) -> Result<(), ExecutionError> {
    let closing = match settings.closing {
        Closing::Together => 1.0,
        Closing::EachAtSpeed(rad_per_s) => rad_per_s,
    };
    let positive = [
        ("period_s", settings.period_s),
        ("advance_speed_m_per_s", settings.advance_speed_m_per_s),
        ("close_s", settings.close_s),
        ("closing", closing),
        ("squeeze_s", settings.squeeze_s),
        ("lift_m", settings.lift_m),
        ("lift_s", settings.lift_s),
        ("hold_s", settings.hold_s),
        // No shake is a shake, too.
        ("shake_m_per_s2", settings.shake_m_per_s2 + f64::MIN_POSITIVE),
        ("shake_s", settings.shake_s),
        ("stop_m_per_s2", settings.stop_m_per_s2),
        ("reflex_max", settings.reflex_max),
        ("trace_period_s", settings.trace_period_s),
    ];
    match positive.into_iter().find(|(_, value)| !(value.is_finite() && *value > 0.0)) {
        Some((name, value)) => Err(ExecutionError::Setting { name, value }),
        None => Ok(()),
    }
}

/// The course of an execution.
struct Run<'a> {
    course: Course<'a>,
    judged: Judged,
    monitor: Monitor,
    tick: u64,
    start: Start,
    /// The last two commanded poses of the palm, the later one first.
    palm: [Isometry3<f64>; 2],
    /// Multiple of the planned grip; the slip reflex raises it.
    grip: f64,
    /// The most that the slip reflex may ask for: where a fingertip is at its limit, more from the others pushes the
    /// object towards it instead of holding it.
    grip_most: f64,
    /// Fingers that press in the grip.
    presses: [bool; FINGER_COUNT],
    touched: [bool; FINGER_COUNT],
    slipping: [bool; FINGER_COUNT],
    /// Joint torques before the fingers closed.
    unloaded_nm: Option<[f64; JOINT_COUNT]>,
    loaded: [bool; FINGER_COUNT],
    /// How long fewer than two fingers have felt the object.
    lost_s: f64,
    /// How long fewer than two fingers have been firm at the tightest grip.
    slip_s: f64,
    events: Vec<Event>,
    trace: Vec<TraceSample>,
}

impl<'a> Run<'a> {
    fn new(course: Course<'a>) -> Self {
        let plan = course.plan;
        let palm = plan.approach_site;
        let presses = FingerId::ALL
            .map(|finger| plan.grasp.fingers[finger.index()] != plan.squeeze.fingers[finger.index()]);
        Self {
            monitor: Monitor::new(MonitorConfig::new(&course.model.finger, plan.friction)),
            judged: Judged::default(),
            tick: 0,
            start: Start { base_from_palm: palm, before: palm, grips: false, grip: 1.0 },
            palm: [palm; 2],
            grip: 1.0,
            grip_most: course.settings.reflex_max.max(1.0),
            presses,
            touched: [false; FINGER_COUNT],
            slipping: [false; FINGER_COUNT],
            unloaded_nm: None,
            loaded: [false; FINGER_COUNT],
            lost_s: 0.0,
            slip_s: 0.0,
            course,
            events: Vec::new(),
            trace: Vec::new(),
        }
    }

    fn settings(&self) -> &'a ExecutionSettings {
        self.course.settings
    }

    fn time_s(&self) -> f64 {
        self.tick as f64 * self.settings().period_s
    }

    fn trouble(&self) -> Option<Trouble> {
        self.judged.trouble.map(|(trouble, _)| trouble)
    }

    fn event(&mut self, kind: EventKind) {
        self.events.push(Event { time_s: self.time_s(), kind });
    }

    fn sight(&self, object: Option<TrueObject>) -> Option<Sight> {
        object.map(|object| Sight { base_from_palm: self.palm[0], object })
    }

    fn begin(&mut self, phase: Phase, object: Option<TrueObject>) {
        self.event(EventKind::Phase(phase));
        self.judged.begins(phase, self.sight(object));
        if phase == Phase::Lift {
            let strongest_n =
                FingerId::ALL.map(|finger| self.monitor.force_n(finger)).into_iter().fold(0.0, f64::max);
            let room = self.course.model.drive.tip_force_max_n / strongest_n.max(f64::MIN_POSITIVE);
            self.grip_most = self.grip_most.min(room).max(1.0);
        }
        let [base_from_palm, before] = self.palm;
        let grips = phase != Phase::Stop || self.trouble() != Some(Trouble::Obstructed);
        self.start = Start { base_from_palm, before, grips, grip: self.grip };
    }

    /// Whether a finger presses and feels something, with its tip or in its joints.
    fn holds(&self, f: usize) -> bool {
        self.presses[f] && (self.touched[f] || self.loaded[f])
    }

    /// Whether it holds without slipping.
    fn is_firm(&self, f: usize) -> bool {
        self.holds(f) && !self.slipping[f]
    }

    fn fingers(&self, are: fn(&Self, usize) -> bool) -> usize {
        (0..FINGER_COUNT).filter(|&f| are(self, f)).count()
    }

    /// What a hand with a fault is commanded: to stay, and the arm too. Fingers whose drives are sound so go on to hold.
    fn stay<L: Link + ?Sized>(
        &mut self,
        phase: Phase,
        last: &Command,
        link: &mut L,
    ) -> Result<(), ExecutionError> {
        let command = Command { velocity_rad_per_s: [0.0; JOINT_COUNT], ..*last };
        for _ in 0..(STAY_S / self.settings().period_s).ceil() as u64 {
            let report = link.step(&command, self.settings().period_s).map_err(|e| self.broken_off(e))?;
            self.take_in(phase, &command, &report, link.object());
        }
        Ok(())
    }

    /// The end without a link: nothing more can be commanded. A hand that hears nothing holds, then stops and keeps its
    /// grip, by itself.
    fn broken_off(&mut self, source: LinkError) -> ExecutionError {
        self.event(EventKind::LinkLost);
        let so_far = Box::new(self.ended(Verdict::LinkLost, None));
        ExecutionError::Link { time_s: self.time_s(), source, so_far }
    }

    /// An end before the last phase, with what happened until now.
    fn ended(&mut self, verdict: Verdict, object: Option<TrueObject>) -> Execution {
        Execution { verdict, felt: verdict, ..self.end(object) }
    }

    /// Judges the sensors, tells of changes, tightens a slipping grip.
    fn take_in(&mut self, phase: Phase, command: &Command, report: &Report, object: Option<TrueObject>) {
        self.tick += 1;
        self.palm = [command.base_from_palm, self.palm[0]];
        if let Some((start, now)) = self.judged.at_start.zip(object) {
            let rise_m = now.center_in_base.z - start.object.center_in_base.z;
            self.judged.highest_m = self.judged.highest_m.max(rise_m);
        }
        self.feel(phase, report);
        let settings = self.settings();
        let timed = |holds: bool, timer_s: f64| if holds { timer_s + settings.period_s } else { 0.0 };
        let most = self.grip_most;
        let slips = self.slipping.contains(&true);
        // A finger may stay at the edge of its cone while the others hold: two that are firm are enough.
        self.slip_s = timed(self.grip >= most && slips && self.fingers(Self::is_firm) < 2, self.slip_s);
        let carries = phase.carries() || phase == Phase::Lower;
        self.lost_s = timed(carries && self.fingers(Self::holds) < 2, self.lost_s);
        if slips {
            self.grip = (self.grip + settings.reflex_rate_per_s * settings.period_s).min(most);
        }
        let every = (settings.trace_period_s / settings.period_s).round().max(1.0) as u64;
        if self.tick.is_multiple_of(every) {
            self.trace.push(TraceSample {
                time_s: self.time_s(),
                phase,
                base_from_palm: command.base_from_palm,
                commanded_rad: command.position_rad,
                measured_rad: report.position_rad,
                joint_torque_nm: report.joint_torque_nm,
                tip_wrench: report.tip_wrench,
                tip_force_n: FingerId::ALL.map(|finger| self.monitor.force_n(finger)),
                slip_ratio: FingerId::ALL.map(|finger| self.monitor.slip_ratio(finger)),
                base_from_object: object.map(|o| o.base_from_object),
            });
        }
    }

    /// What each finger feels.
    fn feel(&mut self, phase: Phase, report: &Report) {
        if phase == Phase::Close && self.unloaded_nm.is_none() {
            self.unloaded_nm = Some(report.joint_torque_nm);
        }
        let touch = self.monitor.update(report, self.settings().period_s);
        for finger in FingerId::ALL {
            let f = finger.index();
            let touches = touch[f] != Touch::Free;
            if touches != self.touched[f] {
                self.touched[f] = touches;
                self.event(match (touches, phase) {
                    (true, Phase::Prepare | Phase::Advance) => EventKind::UnexpectedContact(finger),
                    (true, _) => EventKind::Contact(finger),
                    (false, _) => EventKind::ContactLost(finger),
                });
            }
            let slips = touch[f] == Touch::Slipping && phase.carries();
            if slips && !self.slipping[f] {
                self.event(EventKind::Slip(finger));
            }
            self.slipping[f] = slips;
            let first = 1 + JOINTS_PER_FINGER * f;
            self.loaded[f] = self.unloaded_nm.is_some_and(|before| {
                (first..first + JOINTS_PER_FINGER)
                    .any(|joint| (report.joint_torque_nm[joint] - before[joint]).abs() > LOADED_NM)
            });
        }
    }

    /// Whether the course is to be left in this phase, now.
    fn trouble_in(&mut self, phase: Phase) -> bool {
        let settings = self.settings();
        let carries = phase.carries();
        let trouble = if self.judged.trouble.is_some() {
            None
        } else if matches!(phase, Phase::Prepare | Phase::Advance) && self.touched.contains(&true) {
            Some(Trouble::Obstructed)
        } else if (carries || phase == Phase::Lower) && self.lost_s > settings.lost_s {
            Some(Trouble::Lost)
        } else if carries && self.slip_s > settings.slip_max_s {
            Some(Trouble::SlipNotStopped)
        } else {
            None
        };
        self.leave_for(trouble, phase)
    }

    fn leave_for(&mut self, trouble: Option<Trouble>, phase: Phase) -> bool {
        if let Some(trouble) = trouble {
            self.judged.trouble = Some((trouble, phase));
            self.event(EventKind::Trouble(trouble));
        }
        trouble.is_some()
    }

    /// What comes after a phase that is over or was broken off.
    fn after(&mut self, phase: Phase) -> Option<Phase> {
        let stopped = match self.judged.trouble {
            Some((Trouble::Missed, _)) => false,
            Some((_, in_phase)) => in_phase == phase,
            None => false,
        };
        if stopped {
            return Some(Phase::Stop);
        }
        if phase == Phase::Squeeze && self.fingers(Self::holds) < 2 {
            self.leave_for(Some(Trouble::Missed), phase);
        }
        phase.next(self.trouble())
    }

    fn end(&mut self, object: Option<TrueObject>) -> Execution {
        self.judged.at_end = self.sight(object);
        self.judged.touching_at_end = self.touched.iter().filter(|&&touches| touches).count();
        let judged = self.judged;
        Execution {
            verdict: judged.verdict(self.course.settings),
            felt: judged.felt(),
            trouble: self.trouble(),
            shift_m: judged.shift_m(),
            lift_height_m: judged.rise_m(),
            slip_m: judged.slip_m(),
            misplaced_m: judged.misplaced_m(),
            grip_max: self.grip,
            base_from_object: object.map(|object| object.base_from_object),
            duration_s: self.time_s(),
            events: core::mem::take(&mut self.events),
            trace: core::mem::take(&mut self.trace),
        }
    }
}
