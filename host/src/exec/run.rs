//! One grasp from the approach site to a verdict.

use hand_model::{HandAngles, HandModel};
use nalgebra::{Isometry3, Point3, Translation3};
use protocol::ids::{FINGER_COUNT, FingerId, JOINT_COUNT};
use thiserror::Error;

use super::monitor::{Monitor, MonitorConfig, Touch};
use super::profile::rest_to_rest;
use crate::link::{Command, Link, LinkError, Report, ThumbLaw, TrueObject};

/// Where the palm goes and what the hand does. Poses are `base_from_palm`.
#[derive(Debug, Clone, PartialEq)]
pub struct ExecutionPlan {
    /// Clear of the object; the execution starts here.
    pub approach_site: Isometry3<f64>,
    /// Where the fingers close; reached from the approach site in a straight line.
    pub grasp_site: Isometry3<f64>,
    /// Open hand on the way in.
    pub pregrasp: HandAngles<f64>,
    /// Fingertips on the surface.
    pub grasp: HandAngles<f64>,
    /// Targets beyond the surface that make the grip; see [`squeeze_targets`](super::squeeze_targets).
    pub squeeze: HandAngles<f64>,
    /// Friction that the plan counts on.
    pub friction: f64,
    /// The thumb's law from the grasp on.
    pub thumb: ThumbLaw,
}

/// Times, speeds and thresholds of an execution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExecutionSettings {
    /// Period of commands.
    pub period_s: f64,
    /// Mean speed of the palm from the approach site to the grasp site.
    pub advance_speed_m_per_s: f64,
    /// Time in which all fingers close; the fingertips arrive at rest.
    pub close_s: f64,
    /// Time in which the grip grows.
    pub squeeze_s: f64,
    /// How far to lift.
    pub lift_m: f64,
    /// Time to lift.
    pub lift_s: f64,
    /// Time to hold before the verdict.
    pub hold_s: f64,
    /// Largest multiple of the planned grip that the slip reflex may ask for.
    pub reflex_max: f64,
    /// Share of the planned grip that the slip reflex adds in a second of slipping.
    pub reflex_rate_per_s: f64,
    /// How far an object may move before the fingers have closed, or within the grip until the end.
    pub displacement_max_m: f64,
    /// Time between samples of the trace.
    pub trace_period_s: f64,
}

impl Default for ExecutionSettings {
    fn default() -> Self {
        Self {
            period_s: 1e-3,
            advance_speed_m_per_s: 0.08,
            close_s: 1.0,
            squeeze_s: 0.5,
            lift_m: 0.1,
            lift_s: 1.5,
            hold_s: 1.0,
            reflex_max: 2.0,
            reflex_rate_per_s: 5.0,
            displacement_max_m: 0.015,
            trace_period_s: 0.02,
        }
    }
}

/// How an execution ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// Lifted and held where it was grasped.
    Held,
    /// Still in the hand, but it moved in it by more than allowed.
    Slipped,
    /// Lifted, then lost.
    Dropped,
    /// It stayed on the table.
    NotLifted,
    /// It was pushed away before the fingers had closed.
    Disturbed,
}

impl Verdict {
    /// Lower-case name, as in reports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Held => "held",
            Self::Slipped => "slipped",
            Self::Dropped => "dropped",
            Self::NotLifted => "not_lifted",
            Self::Disturbed => "disturbed",
        }
    }
}

/// Parts of an execution, in their order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// At the approach site: the hand takes its pregrasp and the thumb its rotation.
    Prepare,
    /// Straight to the grasp site.
    Advance,
    /// All fingers to the surface.
    Close,
    /// The grip grows.
    Squeeze,
    /// Straight up.
    Lift,
    /// Still.
    Hold,
}

impl Phase {
    const ALL: [Self; 6] = [Self::Prepare, Self::Advance, Self::Close, Self::Squeeze, Self::Lift, Self::Hold];
}

/// Something worth telling.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum EventKind {
    /// A phase begins.
    Phase(Phase),
    /// A fingertip feels a contact.
    Contact(FingerId),
    /// A fingertip feels a contact while the palm still moves to the grasp site.
    UnexpectedContact(FingerId),
    /// A fingertip is at the edge of its friction cone, and the grip is tightened.
    Slip(FingerId),
    /// A fingertip that was in contact feels nothing any more.
    ContactLost(FingerId),
}

/// An event and its time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Event {
    /// Time since the start of the execution.
    pub time_s: f64,
    /// What happened.
    pub kind: EventKind,
}

/// The state of the execution at one time.
#[derive(Debug, Clone, PartialEq)]
pub struct TraceSample {
    /// Time since the start of the execution.
    pub time_s: f64,
    /// Part of the execution.
    pub phase: Phase,
    /// Commanded pose of the palm.
    pub base_from_palm: Isometry3<f64>,
    /// Commanded joint angles, order of `JointId`.
    pub commanded_rad: [f64; JOINT_COUNT],
    /// Measured joint angles.
    pub measured_rad: [f64; JOINT_COUNT],
    /// Filtered force on each fingertip.
    pub tip_force_n: [f64; FINGER_COUNT],
    /// True pose of the object, where it is known.
    pub base_from_object: Option<Isometry3<f64>>,
}

/// What came of a plan.
#[derive(Debug, Clone, PartialEq)]
pub struct Execution {
    /// How it ended.
    pub verdict: Verdict,
    /// How far the object's centre rose, where its true place is known.
    pub lift_height_m: Option<f64>,
    /// How far the object moved in the palm frame since the grip stood, where that is known.
    pub slip_m: Option<f64>,
    /// Simulated or real time that it took.
    pub duration_s: f64,
    /// What happened, in order.
    pub events: Vec<Event>,
    /// The course of it.
    pub trace: Vec<TraceSample>,
}

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
    for phase in Phase::ALL {
        run.event(EventKind::Phase(phase));
        match phase {
            Phase::Close => before_close = link.object(),
            Phase::Lift => gripped = link.object(),
            _ => {}
        }
        let ticks = (run.duration_s(model, phase) / settings.period_s).ceil().max(1.0) as u64;
        for tick in 1..=ticks {
            let command =
                run.command(phase, tick as f64 * settings.period_s, ticks as f64 * settings.period_s);
            let report = link
                .step(&command, settings.period_s)
                .map_err(|source| ExecutionError::Link { time_s: run.time_s(), source })?;
            run.tick += 1;
            run.take_in(phase, &command, &report, link.object());
            highest_m = highest_m.max(rise_m(at_start, link.object()).unwrap_or(f64::NEG_INFINITY));
        }
    }
    let at_end = link.object();
    let lift_height_m = rise_m(at_start, at_end);
    let slip_m = slip_m(plan, settings, gripped, at_end);
    let pushed = at_start
        .zip(before_close)
        .is_some_and(|(a, b)| (a.center_in_base - b.center_in_base).norm() > settings.displacement_max_m);
    let verdict = match lift_height_m {
        _ if pushed => Verdict::Disturbed,
        Some(rise) if rise > 0.5 * settings.lift_m => match slip_m {
            Some(slip) if slip > settings.displacement_max_m => Verdict::Slipped,
            _ => Verdict::Held,
        },
        Some(_) if highest_m > 0.1 * settings.lift_m => Verdict::Dropped,
        Some(_) => Verdict::NotLifted,
        // Without a true pose the fingertips must tell.
        None if run.touched.contains(&true) => Verdict::Held,
        None => Verdict::Dropped,
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

    fn event(&mut self, kind: EventKind) {
        self.events.push(Event { time_s: self.time_s(), kind });
    }

    fn duration_s(&self, model: &HandModel<f64>, phase: Phase) -> f64 {
        let settings = self.settings;
        match phase {
            // Half a turn of slack for the thumb's base, which moves at its own speed; the hand may already be there.
            Phase::Prepare => 0.2 / model.thumb_rotation.speed_max_rad_per_s,
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
            arm_joints_rad: None,
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
        if self.tick % every == 0 {
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
