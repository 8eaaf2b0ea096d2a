//! `prehend experiment`: the paper's experiment on the virtual cell, trial after trial from the scan to an object that was
//! lifted, shaken and put down.

use std::io::Write;
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use anyhow::{Context, ensure};
use clap::Args;
use rayon::ThreadPoolBuilder;

use super::execute::RunSettings;
use super::input;
use super::plan::Strategy;
use super::progress::bar;
use super::scan::Sweeps;
use super::simulated::{self, LinkChoice};
use super::{Outcome, write_json};
use crate::exec::Closing;
use crate::io::Unit;
use crate::object::BuiltIn;
use draw::Specimen;
use trial::{Protocol, Trial};

mod draw;
mod report;
mod trial;

/// Speed of each joint with `--no-arrive-together`, rad/s: a fingertip meets the object with some 0.1 m/s, four times what
/// it may.
const APART_RAD_PER_S: f64 = 1.0;

/// Repeat scan, reconstruction, plan and execution on objects of drawn size, place, mass and friction
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Examples:\n  prehend experiment --trials 2\n  prehend experiment --trials 2 --seed 2 --strategy best --json\n  prehend experiment --trials 5 --link qemu\n  prehend experiment --trials 20 --object can.obj=0.349 --object banana.obj=0.066"
)]
pub struct ExperimentArgs {
    /// Trials to make; the objects take turns
    #[arg(long, value_name = "N", default_value_t = 110, value_parser = clap::value_parser!(u32).range(1..=1_000_000), allow_negative_numbers = true)]
    pub trials: u32,
    /// What takes turns, instead of the five built-in objects: built-in ones, or mesh files with their mass in kg. What a
    /// file holds keeps its size, is dropped on the table in any orientation, and the robot is told its mass
    #[arg(long, value_name = "NAME|FILE[=KG]")]
    pub object: Vec<String>,
    /// Unit of the objects' mesh files: m or mm
    #[arg(long, default_value = "m", value_parser = input::unit)]
    pub unit: Unit,
    /// How often a trial is begun again from the scan, at most, when the robot finds no grasp or feels that it failed
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u32).range(0..=100), allow_negative_numbers = true)]
    pub redo: u32,
    /// Stiffness of the thumb across its pad in N/m, while the grip is planned for 300: the paper's first failure
    #[arg(long, value_name = "N/M", value_parser = input::positive, allow_negative_numbers = true)]
    pub thumb_stiffness: Option<f64>,
    /// Close each joint at its own constant speed, not all on one quartic: the paper's second failure
    #[arg(long)]
    pub no_arrive_together: bool,
    /// Folder for a recording of each execution (MCAP)
    #[arg(long, value_name = "DIR")]
    pub record: Option<PathBuf>,
    /// Physics steps in each millisecond: more of them show whether the usual 2 are enough
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u32).range(1..=64), allow_negative_numbers = true, hide = true)]
    pub plant_steps: u32,
    /// Greatest acceleration of the shake in m/s^2
    #[arg(long, value_name = "M/S2", default_value_t = 5.0, value_parser = input::not_negative, allow_negative_numbers = true, hide = true)]
    pub shake: f64,
    /// Search: the paper's of 2005, or the wider one
    #[arg(long, value_enum, default_value = "paper")]
    pub strategy: Strategy,
    /// Sweeps of the scanner
    #[arg(long, value_enum, default_value_t)]
    pub sweeps: Sweeps,
    /// Seed of every random choice
    #[arg(long, default_value_t = 1, allow_negative_numbers = true)]
    pub seed: u64,
    /// The hand to run them on: twin, the simulated hand that runs the firmware's control laws; controller, the whole
    /// firmware on its bus in this process; qemu or qemu:ELF, its image in QEMU
    #[arg(long, default_value = "twin", value_parser = simulated::link)]
    pub link: LinkChoice,
    /// Trials that run at a time, each on one core; by default as many as there are cores
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1024), allow_negative_numbers = true)]
    pub threads: Option<u32>,
    /// Print one JSON document on standard output
    #[arg(long)]
    pub json: bool,
}

/// Runs the command.
pub fn run(args: &ExperimentArgs, out: &mut dyn Write) -> anyhow::Result<Outcome> {
    let clock = Instant::now();
    let protocol = protocol(args)?;
    let threads = args
        .threads
        .map_or_else(|| std::thread::available_parallelism().map_or(1, NonZeroUsize::get), |n| n as usize);
    let trials = run_all(&protocol, args.trials as usize, threads)?;
    let seconds = clock.elapsed().as_secs_f64();
    if args.json {
        write_json(out, &report::document(&protocol, &trials, seconds))?;
    } else {
        report::describe(&protocol, &trials, seconds, out)?;
    }
    Ok(Outcome::Done)
}

fn protocol(args: &ExperimentArgs) -> anyhow::Result<Protocol> {
    let specimens = if args.object.is_empty() {
        BuiltIn::ALL.map(Specimen::BuiltIn).into()
    } else {
        args.object.iter().map(|text| specimen(text, args.unit)).collect::<Result<Vec<_>, _>>()?
    };
    ensure!(
        args.link == LinkChoice::Twin || args.thumb_stiffness.is_none() && args.plant_steps == 2,
        "--thumb-stiffness and --plant-steps change the twin; give --link twin"
    );
    let mut run = RunSettings::default();
    run.twin.steps_per_tick = args.plant_steps;
    run.twin.thumb_stiffness_n_per_m = args.thumb_stiffness;
    run.execution.shake_m_per_s2 = args.shake;
    if args.no_arrive_together {
        run.execution.closing = Closing::EachAtSpeed(APART_RAD_PER_S);
    }
    let hand = args.link.make_ready()?;
    if let Some(folder) = &args.record {
        input::make_folder(folder)?;
    }
    Ok(Protocol {
        strategy: args.strategy,
        sweeps: args.sweeps.settings(),
        seed: args.seed,
        specimens,
        redo: args.redo,
        run,
        link: args.link.clone(),
        hand,
        record: args.record.clone(),
    })
}

/// What `--object` names.
fn specimen(text: &str, unit: Unit) -> anyhow::Result<Specimen> {
    if let Some(built_in) = BuiltIn::ALL.into_iter().find(|b| b.name() == text) {
        return Ok(Specimen::BuiltIn(built_in));
    }
    let (name, mass_kg) = match text.rsplit_once('=') {
        Some((name, mass)) => {
            let mass_kg = input::positive(mass)
                .map_err(|what| anyhow::anyhow!("--object {text}: {what} behind the =, the mass in kg"))?;
            (name, Some(mass_kg))
        }
        None => (text, None),
    };
    ensure!(!name.is_empty(), "--object {text}: name a file before the =");
    let object = input::object(name, unit, mass_kg, crate::object::DESIGN_FRICTION)?;
    // Once for all trials: it takes a moment.
    Ok(Specimen::File(object.decomposed()))
}

/// All trials in their order, whatever the number of threads.
///
/// Each worker takes the next trial and runs it in a pool of one thread of its own. In a common pool a search that waits
/// for its last attempt would take up another trial meanwhile, and be charged for the time.
fn run_all(protocol: &Protocol, count: usize, threads: usize) -> anyhow::Result<Vec<Trial>> {
    let progress = bar(count, "trials");
    let next = AtomicUsize::new(0);
    let done = Mutex::new(Vec::with_capacity(count));
    let pools = (0..threads.min(count))
        .map(|_| ThreadPoolBuilder::new().num_threads(1).build())
        .collect::<Result<Vec<_>, _>>()
        .context("starting the threads for the trials")?;
    std::thread::scope(|scope| {
        for pool in &pools {
            scope.spawn(|| {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    if index >= count {
                        break;
                    }
                    let trial = pool.install(|| trial::run(protocol, index));
                    // After the first error nobody wants the rest.
                    if trial.is_err() {
                        next.store(count, Ordering::Relaxed);
                    }
                    if let Ok(mut done) = done.lock() {
                        done.push((index, trial));
                    }
                    progress.inc(1);
                }
            });
        }
    });
    progress.finish_and_clear();
    let mut done = done.into_inner().map_err(|_| anyhow::anyhow!("a trial broke off"))?;
    done.sort_by_key(|&(index, _)| index);
    done.into_iter().map(|(index, trial)| trial.with_context(|| format!("trial {index}"))).collect()
}
