//! One trial, from an object that nobody has told the robot about to a verdict.

use std::time::Instant;

use nalgebra::Point3;
use rand::RngExt;

use super::draw::{self, Cell};
use crate::cli::execute::on_link;
use crate::cli::pipeline::{self, Search};
use crate::cli::plan::Strategy;
use crate::cli::scan;
use crate::cli::simulated::SimulatedHand;
use crate::exec::Verdict;
use crate::object::{BuiltIn, DESIGN_FRICTION};
use crate::plan::search::attempt_rng;
use crate::plan::seen::SeenSurface;
use crate::scan::SweepSettings;

/// Mass that every object is gripped for, kg: the robot does not know the true one, so it counts on the heaviest of the
/// experiment.
const PLANNED_MASS_KG: f64 = 0.2;

/// What all trials have in common.
pub(super) struct Protocol {
    pub(super) strategy: Strategy,
    pub(super) sweeps: SweepSettings,
    pub(super) seed: u64,
    pub(super) hand: SimulatedHand,
}

/// Why a trial did not end with a held object.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Cause {
    /// The scan gave no surface.
    NoSurface,
    /// No attempt of the search had force closure.
    NoClosure,
    /// The arm can make none of the grasps found.
    NoArmMotion,
    /// Of those that the arm can make, none has a balanced grip.
    NoBalancedGrip,
    /// See [`Verdict::Disturbed`].
    Disturbed,
    /// See [`Verdict::Slipped`].
    Slipped,
    /// See [`Verdict::Dropped`].
    Dropped,
    /// See [`Verdict::NotLifted`].
    NotLifted,
    /// See [`Verdict::Faulted`].
    Faulted,
    /// See [`Verdict::LinkLost`].
    LinkLost,
}

impl Cause {
    /// The key in reports.
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::NoSurface => "no-surface",
            Self::NoClosure => "no-closure",
            Self::NoArmMotion => "no-arm-motion",
            Self::NoBalancedGrip => "no-balanced-grip",
            Self::Disturbed => Verdict::Disturbed.name(),
            Self::Slipped => Verdict::Slipped.name(),
            Self::Dropped => Verdict::Dropped.name(),
            Self::NotLifted => Verdict::NotLifted.name(),
            Self::Faulted => Verdict::Faulted.name(),
            Self::LinkLost => Verdict::LinkLost.name(),
        }
    }
}

/// A grasp that was executed.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Tried {
    pub(super) candidate: String,
    pub(super) epsilon: f64,
}

/// A trial and what came of it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Trial {
    pub(super) object: BuiltIn,
    /// Size over that of the built-in object.
    pub(super) scale: f64,
    pub(super) mass_kg: f64,
    pub(super) friction: f64,
    pub(super) position: Point3<f64>,
    pub(super) yaw_rad: f64,
    /// Time of the arm's sweeps.
    pub(super) scan_s: f64,
    /// Reconstruction and search on one core, wall clock.
    pub(super) plan_s: f64,
    /// The grasp, if one was found.
    pub(super) grasp: Option<Tried>,
    /// Its execution, in the hand's time, and by the wall clock.
    pub(super) executed_s: f64,
    pub(super) execute_s: f64,
    /// Why it failed; `None` when the object was held.
    pub(super) failure: Option<Cause>,
}

/// Runs trial number `index`: its random numbers depend on nothing but the seed and the index.
pub(super) fn run(protocol: &Protocol, index: usize) -> anyhow::Result<Trial> {
    let mut rng = attempt_rng(protocol.seed, index);
    let cell = draw::cell(BuiltIn::ALL[index % BuiltIn::ALL.len()], &mut rng)?;
    let [scan_seed, search_seed, sensor_seed] = [(); 3].map(|()| rng.random::<u64>());
    let Cell { object, scale, yaw_rad, truth, instrument } = cell;
    let mesh = truth.object.mesh.transformed(&truth.base_from_object);
    let (_, scan) = scan::sweep(&mesh, &protocol.sweeps, &instrument, scan_seed)?;

    let mut trial = Trial {
        object,
        scale,
        mass_kg: truth.object.mass_kg,
        friction: truth.object.friction,
        position: truth.base_from_object.translation.vector.into(),
        yaw_rad,
        scan_s: scan.duration_s,
        plan_s: 0.0,
        grasp: None,
        executed_s: 0.0,
        execute_s: 0.0,
        failure: None,
    };
    let clock = Instant::now();
    let Ok(surface) = pipeline::surface(&scan.cloud, search_seed) else {
        trial.failure = Some(Cause::NoSurface);
        return Ok(trial);
    };
    let search = Search {
        strategy: protocol.strategy,
        friction: DESIGN_FRICTION,
        mass_kg: PLANNED_MASS_KG,
        seed: search_seed,
    };
    let seen = SeenSurface::of_mesh(&surface.mesh);
    let (_, planned) = search.run(surface.mesh, seen, "scan", 1, &|_| {})?;
    trial.plan_s = clock.elapsed().as_secs_f64();

    let document = planned.document;
    let Some(best) = document.grasps.first() else {
        trial.failure = Some(match document.force_closure {
            0 => Cause::NoClosure,
            found if document.rejected.get("no-arm-motion") == Some(&found) => Cause::NoArmMotion,
            _ => Cause::NoBalancedGrip,
        });
        return Ok(trial);
    };
    trial.grasp = Some(Tried { candidate: best.candidate.clone(), epsilon: best.quality.epsilon });
    let clock = Instant::now();
    let execution = on_link(&protocol.hand, &document, best, &truth, sensor_seed)?;
    (trial.executed_s, trial.execute_s) = (execution.duration_s, clock.elapsed().as_secs_f64());
    trial.failure = match execution.verdict {
        Verdict::Held => None,
        Verdict::Slipped => Some(Cause::Slipped),
        Verdict::Dropped => Some(Cause::Dropped),
        Verdict::NotLifted => Some(Cause::NotLifted),
        Verdict::Disturbed => Some(Cause::Disturbed),
        Verdict::Faulted => Some(Cause::Faulted),
        Verdict::LinkLost => Some(Cause::LinkLost),
    };
    Ok(trial)
}
