//! One grasp from the approach site to a verdict.

use core::f64::consts::FRAC_PI_2;

use hand_model::HandModel;
use nalgebra::{Isometry3, Point3, Translation3};
use protocol::ids::{FINGER_COUNT, FingerId, JOINT_COUNT, JointId};
use thiserror::Error;

use super::monitor::{Monitor, MonitorConfig, Touch};
use super::outcome::{Event, EventKind, Execution, Phase, TraceSample, Verdict};
use super::plan::{ExecutionPlan, ExecutionSettings};
use crate::link::{Command, Link, LinkError, Report, ThumbLaw, TrueObject};
use crate::plan::profile::rest_to_rest;

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
    let mut run = Run {
        plan,
        settings,
        monitor: Monitor::new(MonitorConfig::new(&model.finger, plan.friction)),
        tick: 0,
        grip: 1.0,
        touched: [false; FINGER_COUNT],
        slipping: [false; FINGER_COUNT],
        events: Vec::new(),
        trace: Vec::new(),
    };
    let at_start = link.object();
    let mut highest_m = f64::NEG_INFINITY;
    let (mut before_close, mut gripped) = (at_start, None);
    let mut gripped_by = 0;
    for phase in Phase::ALL {
        run.event(EventKind::Phase(phase));
        match phase {
            Phase::Close => before_close = link.object(),
            Phase::Lift => {
                gripped = link.object();
                gripped_by = run.fingers_touching();
            }
            _ => {}
        }
        let ticks = (run.duration_s(model, phase) / settings.period_s).ceil().max(1.0);
        for tick in 1..=ticks as u64 {
            let command = run.command(phase, tick as f64 * settings.period_s, ticks * settings.period_s);
            let report = link.step(&command, settings.period_s).map_err(|source| run.broken_off(source))?;
            run.tick += 1;
            run.take_in(phase, &command, &report, link.object());
            if let Some(fault) = link.fault() {
                run.event(EventKind::Fault(fault));
                run.stay(phase, &command, link)?;
                return Ok(run.ended(Verdict::Faulted, rise_m(at_start, link.object())));
            }
            highest_m = highest_m.max(rise_m(at_start, link.object()).unwrap_or(f64::NEG_INFINITY));
            if phase == Phase::Prepare && is_prepared(plan, &report) {
                break;
            }
        }
    }
    let at_end = link.object();
    let lift_height_m = rise_m(at_start, at_end);
    let slip_m = slip_m(plan, settings, gripped, at_end);
    let pushed = at_start
        .zip(before_close)
        .is_some_and(|(a, b)| (a.center_in_base - b.center_in_base).norm() > settings.displacement_max_m);
    let slipped = slip_m.is_some_and(|slip| slip > settings.displacement_max_m);
    let verdict = match lift_height_m {
        _ if pushed => Verdict::Disturbed,
        Some(rise) if rise > 0.5 * settings.lift_m => {
            if slipped {
                Verdict::Slipped
            } else {
                Verdict::Held
            }
        }
        Some(_) if highest_m > 0.1 * settings.lift_m => Verdict::Dropped,
        Some(_) => Verdict::NotLifted,
        // Where nobody sees the object the fingertips must tell: it takes two to hold.
        None if run.fingers_touching() >= 2 => Verdict::Held,
        None if gripped_by >= 2 => Verdict::Dropped,
        None => Verdict::NotLifted,
    };
    Ok(Execution {
        verdict,
        lift_height_m,
        slip_m,
        duration_s: run.time_s(),
        events: run.events,
        trace: run.trace,
    })
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
    let positive = [
        ("period_s", settings.period_s),
        ("advance_speed_m_per_s", settings.advance_speed_m_per_s),
        ("close_s", settings.close_s),
        ("squeeze_s", settings.squeeze_s),
        ("lift_m", settings.lift_m),
        ("lift_s", settings.lift_s),
        ("hold_s", settings.hold_s),
        ("reflex_max", settings.reflex_max),
        ("trace_period_s", settings.trace_period_s),
    ];
    match positive.into_iter().find(|(_, value)| !(value.is_finite() && *value > 0.0)) {
        Some((name, value)) => Err(ExecutionError::Setting { name, value }),
        None => Ok(()),
    }
}

/// How far the centre rose from `start`.
fn rise_m(start: Option<TrueObject>, now: Option<TrueObject>) -> Option<f64> {
    start.zip(now).map(|(a, b)| b.center_in_base.z - a.center_in_base.z)
}

/// How far the centre moved in the palm frame from the end of the squeeze to the end of the hold.
fn slip_m(
    plan: &ExecutionPlan,
    settings: &ExecutionSettings,
    gripped: Option<TrueObject>,
    at_end: Option<TrueObject>,
) -> Option<f64> {
    let in_palm = |site: Isometry3<f64>, object: TrueObject| -> Point3<f64> {
        site.inverse_transform_point(&object.center_in_base)
    };
    gripped.zip(at_end).map(|(a, b)| {
        (in_palm(lifted(&plan.grasp_site, settings.lift_m), b) - in_palm(plan.grasp_site, a)).norm()
    })
}

fn lifted(site: &Isometry3<f64>, by_m: f64) -> Isometry3<f64> {
    Translation3::new(0.0, 0.0, by_m) * site
}

/// The course of an execution.
struct Run<'a> {
    plan: &'a ExecutionPlan,
    settings: &'a ExecutionSettings,
    monitor: Monitor,
    tick: u64,
    /// Multiple of the planned grip; the slip reflex raises it.
    grip: f64,
    touched: [bool; FINGER_COUNT],
    slipping: [bool; FINGER_COUNT],
    events: Vec<Event>,
    trace: Vec<TraceSample>,
}

impl Run<'_> {
    fn time_s(&self) -> f64 {
        self.tick as f64 * self.settings.period_s
    }

    fn fingers_touching(&self) -> usize {
        self.touched.iter().filter(|&&touches| touches).count()
    }

    fn event(&mut self, kind: EventKind) {
        self.events.push(Event { time_s: self.time_s(), kind });
    }

    fn duration_s(&self, model: &HandModel<f64>, phase: Phase) -> f64 {
        let settings = self.settings;
        match phase {
            // At most: the thumb's base has a quarter turn to go at its own speed.
            Phase::Prepare => FRAC_PI_2 / model.thumb_rotation.speed_max_rad_per_s + 0.5,
            Phase::Advance => {
                let way =
                    self.plan.grasp_site.translation.vector - self.plan.approach_site.translation.vector;
                let turn = self.plan.grasp_site.rotation.angle_to(&self.plan.approach_site.rotation);
                // A radian of turning counts as a decimetre.
                (way.norm() + 0.1 * turn) / settings.advance_speed_m_per_s
            }
            Phase::Close => settings.close_s,
            Phase::Squeeze => settings.squeeze_s,
            Phase::Lift => settings.lift_s,
            Phase::Hold => settings.hold_s,
        }
    }

    /// The command at `time_s` of a phase that takes `duration_s`.
    fn command(&self, phase: Phase, time_s: f64, duration_s: f64) -> Command {
        let plan = self.plan;
        let way = rest_to_rest(time_s, duration_s);
        let base_from_palm = match phase {
            Phase::Prepare => plan.approach_site,
            Phase::Advance => plan.approach_site.lerp_slerp(&plan.grasp_site, way.share),
            Phase::Close | Phase::Squeeze => plan.grasp_site,
            Phase::Lift => lifted(&plan.grasp_site, self.settings.lift_m * way.share),
            Phase::Hold => lifted(&plan.grasp_site, self.settings.lift_m),
        };
        let (open, grasp, squeeze) =
            (plan.pregrasp.to_array(), plan.grasp.to_array(), plan.squeeze.to_array());
        let (from, to, share, rate) = match phase {
            Phase::Prepare | Phase::Advance => (open, open, 0.0, 0.0),
            Phase::Close => (open, grasp, way.share, way.rate_per_s),
            Phase::Squeeze => (grasp, squeeze, way.share, 0.0),
            Phase::Lift | Phase::Hold => (grasp, squeeze, self.grip, 0.0),
        };
        Command {
            position_rad: core::array::from_fn(|j| from[j] + (to[j] - from[j]) * share),
            // A grip is a push against something: its targets have no speed of their own.
            velocity_rad_per_s: core::array::from_fn(|j| (to[j] - from[j]) * rate),
            feed_forward_nm: [0.0; JOINT_COUNT],
            thumb: match phase {
                Phase::Prepare | Phase::Advance | Phase::Close => ThumbLaw::Position,
                Phase::Squeeze | Phase::Lift | Phase::Hold => plan.thumb,
            },
            base_from_palm,
        }
    }

    /// What a hand with a fault is commanded: to stay, and the arm too. Fingers whose drives are sound so go on to hold.
    fn stay<L: Link + ?Sized>(
        &mut self,
        phase: Phase,
        last: &Command,
        link: &mut L,
    ) -> Result<(), ExecutionError> {
        let command = Command { velocity_rad_per_s: [0.0; JOINT_COUNT], ..*last };
        for _ in 0..(STAY_S / self.settings.period_s).ceil() as u64 {
            let report = link.step(&command, self.settings.period_s).map_err(|e| self.broken_off(e))?;
            self.tick += 1;
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
    fn ended(&mut self, verdict: Verdict, lift_height_m: Option<f64>) -> Execution {
        Execution {
            verdict,
            lift_height_m,
            slip_m: None,
            duration_s: self.time_s(),
            events: core::mem::take(&mut self.events),
            trace: core::mem::take(&mut self.trace),
        }
    }

    /// Judges the sensors, tells of changes, tightens a slipping grip.
    fn take_in(&mut self, phase: Phase, command: &Command, report: &Report, object: Option<TrueObject>) {
        let touch = self.monitor.update(report, self.settings.period_s);
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
            let slips = touch[f] == Touch::Slipping && matches!(phase, Phase::Lift | Phase::Hold);
            if slips && !self.slipping[f] {
                self.event(EventKind::Slip(finger));
            }
            self.slipping[f] = slips;
        }
        if self.slipping.contains(&true) {
            let more = self.settings.reflex_rate_per_s * self.settings.period_s;
            self.grip = (self.grip + more).min(self.settings.reflex_max.max(1.0));
        }
        let every = (self.settings.trace_period_s / self.settings.period_s).round().max(1.0) as u64;
        if self.tick.is_multiple_of(every) {
            self.trace.push(TraceSample {
                time_s: self.time_s(),
                phase,
                base_from_palm: command.base_from_palm,
                commanded_rad: command.position_rad,
                measured_rad: report.position_rad,
                tip_force_n: FingerId::ALL.map(|finger| self.monitor.force_n(finger)),
                base_from_object: object.map(|o| o.base_from_object),
            });
        }
    }
}
