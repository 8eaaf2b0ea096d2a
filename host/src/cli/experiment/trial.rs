//! One trial, from an object that nobody has told the robot about to a verdict, begun again from the scan when the robot
//! notices that it failed.

use std::path::PathBuf;
use std::time::Instant;

use nalgebra::Point3;
use rand::RngExt;

use super::draw::{self, Cell, Specimen};
use crate::cli::execute::{RunSettings, Truth, on_link, record_run};
use crate::cli::pipeline::{self, Search};
use crate::cli::plan::Strategy;
use crate::cli::scan;
use crate::cli::simulated::{LinkChoice, SimulatedHand};
use crate::exec::{Execution, Verdict};
use crate::object::DESIGN_FRICTION;
use crate::plan::search::attempt_rng;
use crate::plan::seen::SeenSurface;
use crate::scan::{Instrument, SweepSettings};

/// What all trials have in common.
pub(super) struct Protocol {
    pub(super) strategy: Strategy,
    pub(super) sweeps: SweepSettings,
    pub(super) seed: u64,
    pub(super) specimens: Vec<Specimen>,
    /// How often the process is begun again from the scan, at most.
    pub(super) redo: u32,
    pub(super) run: RunSettings,
    pub(super) link: LinkChoice,
    pub(super) hand: SimulatedHand,
    /// Folder for a recording of each execution.
    pub(super) record: Option<PathBuf>,
}

/// Why an attempt did not end with an object held and put down.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Cause {
    /// The arm can sweep the scanner over no side of it.
    NoSweep,
    /// The scan gave no surface.
    NoSurface,
    /// No attempt of the search had force closure.
    NoClosure,
    /// The arm can make none of the grasps found.
    NoArmMotion,
    /// Of those that the arm can make, none has a balanced grip.
    NoBalancedGrip,
    /// The execution's verdict.
    Verdict(Verdict),
}

impl Cause {
    /// The key in reports.
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::NoSweep => "no-sweep",
            Self::NoSurface => "no-surface",
            Self::NoClosure => "no-closure",
            Self::NoArmMotion => "no-arm-motion",
            Self::NoBalancedGrip => "no-balanced-grip",
            Self::Verdict(verdict) => verdict.name(),
        }
    }
}

/// A grasp that was executed, and how it went.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Tried {
    pub(super) candidate: String,
    pub(super) epsilon: f64,
    pub(super) felt: Verdict,
    pub(super) shift_m: Option<f64>,
    pub(super) slip_m: Option<f64>,
    pub(super) misplaced_m: Option<f64>,
    pub(super) grip_max: f64,
    /// Simulated time.
    pub(super) duration_s: f64,
    /// Wall clock.
    pub(super) wall_s: f64,
}

/// Once from the scan to a verdict.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Attempt {
    /// Time of the arm's sweeps.
    pub(super) scan_s: f64,
    /// Reconstruction and search on one core, wall clock.
    pub(super) plan_s: f64,
    /// Attempts of the search.
    pub(super) searched: usize,
    /// The grasp, if one was found.
    pub(super) grasp: Option<Tried>,
    /// Why it failed; `None` when all went well.
    pub(super) failure: Option<Cause>,
}

/// A trial and what came of it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Trial {
    /// Index of the specimen.
    pub(super) specimen: usize,
    /// Size over that of the built-in object, or of the file.
    pub(super) scale: f64,
    pub(super) mass_kg: f64,
    pub(super) friction: f64,
    pub(super) position: Point3<f64>,
    pub(super) yaw_rad: f64,
    /// At least one.
    pub(super) attempts: Vec<Attempt>,
}

impl Trial {
    /// Why the first attempt failed.
    pub(super) fn first_failure(&self) -> Option<Cause> {
        self.attempts.first().and_then(|attempt| attempt.failure)
    }

    /// Why the last attempt failed.
    pub(super) fn failure(&self) -> Option<Cause> {
        self.attempts.last().and_then(|attempt| attempt.failure)
    }
}

/// Runs trial number `index`: its random numbers depend on nothing but the seed and the index.
pub(super) fn run(protocol: &Protocol, index: usize) -> anyhow::Result<Trial> {
    let mut rng = attempt_rng(protocol.seed, index);
    let specimen = index % protocol.specimens.len();
    let cell = draw::cell(&protocol.specimens[specimen], &mut rng)?;
    let Cell { scale, yaw_rad, mut truth, instrument, planned_kg } = cell;
    let mut trial = Trial {
        specimen,
        scale,
        mass_kg: truth.object.mass_kg,
        friction: truth.object.friction,
        position: truth.base_from_object.translation.vector.into(),
        yaw_rad,
        attempts: Vec::new(),
    };
    for number in 0..=protocol.redo {
        let seeds = [(); 3].map(|()| rng.random::<u64>());
        let (attempt, execution) = once(protocol, &truth, &instrument, planned_kg, seeds)?;
        // What the robot does not notice it does not do again.
        let noticed = attempt.grasp.as_ref().is_none_or(|grasp| grasp.felt != Verdict::Held);
        trial.attempts.push(attempt);
        if let Some(execution) = execution {
            if let Some(folder) = &protocol.record {
                let name = format!("trial-{index:04}-{}.mcap", number + 1);
                record_run(&folder.join(name), &truth, &execution)?;
            }
            let Some(now) = execution.base_from_object else { break };
            truth.base_from_object = now;
        }
        if !noticed || !pipeline::is_in_cell(&truth) {
            break;
        }
    }
    Ok(trial)
}

/// Scan, surface, plan and execution. The execution is there when a grasp was found.
fn once(
    protocol: &Protocol,
    truth: &Truth,
    instrument: &Instrument,
    planned_kg: f64,
    [scan_seed, search_seed, sensor_seed]: [u64; 3],
) -> anyhow::Result<(Attempt, Option<Execution>)> {
    let mesh = truth.object.mesh.transformed(&truth.base_from_object);
    let mut attempt = Attempt { scan_s: 0.0, plan_s: 0.0, searched: 0, grasp: None, failure: None };
    let Ok((_, scan)) = scan::sweep(&mesh, &protocol.sweeps, instrument, scan_seed) else {
        attempt.failure = Some(Cause::NoSweep);
        return Ok((attempt, None));
    };
    attempt.scan_s = scan.duration_s;
    let clock = Instant::now();
    let Ok(surface) = pipeline::surface(&scan.cloud, search_seed) else {
        attempt.failure = Some(Cause::NoSurface);
        return Ok((attempt, None));
    };
    let search = Search {
        strategy: protocol.strategy,
        friction: DESIGN_FRICTION,
        mass_kg: planned_kg,
        seed: search_seed,
    };
    let seen = SeenSurface::of_mesh(&surface.mesh);
    let (_, planned) = search.run(surface.mesh, seen, "scan", 1, &|_| {})?;
    attempt.plan_s = clock.elapsed().as_secs_f64();

    let document = planned.document;
    attempt.searched = document.attempts;
    let Some(best) = document.grasps.first() else {
        attempt.failure = Some(match document.force_closure {
            0 => Cause::NoClosure,
            found if document.rejected.get("no-arm-motion") == Some(&found) => Cause::NoArmMotion,
            _ => Cause::NoBalancedGrip,
        });
        return Ok((attempt, None));
    };
    let clock = Instant::now();
    let execution = on_link(&protocol.hand, &document, best, truth, sensor_seed, &protocol.run)?;
    attempt.grasp = Some(Tried {
        candidate: best.candidate.clone(),
        epsilon: best.quality.epsilon,
        felt: execution.felt,
        shift_m: execution.shift_m,
        slip_m: execution.slip_m,
        misplaced_m: execution.misplaced_m,
        grip_max: execution.grip_max,
        duration_s: execution.duration_s,
        wall_s: clock.elapsed().as_secs_f64(),
    });
    attempt.failure = match execution.verdict {
        Verdict::Held => None,
        other => Some(Cause::Verdict(other)),
    };
    Ok((attempt, Some(execution)))
}
