//! `prehend experiment`: the paper's experiment on the virtual cell, trial after trial from scan to hold.

use std::io::Write;
use std::num::NonZeroUsize;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use anyhow::Context;
use clap::Args;
use rayon::ThreadPoolBuilder;

use super::plan::Strategy;
use super::progress::bar;
use super::scan::Sweeps;
use super::simulated::{self, LinkChoice};
use super::{Outcome, write_json};
use trial::{Protocol, Trial};

mod draw;
mod report;
mod trial;

/// Repeat scan, reconstruction, plan and execution on objects of drawn size, place, mass and friction
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Examples:\n  prehend experiment --trials 2\n  prehend experiment --trials 2 --seed 2 --strategy best --json\n  prehend experiment --trials 5 --link qemu"
)]
pub struct ExperimentArgs {
    /// Trials to make; the objects take turns
    #[arg(long, value_name = "N", default_value_t = 110, value_parser = clap::value_parser!(u32).range(1..=1_000_000), allow_negative_numbers = true)]
    pub trials: u32,
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
    let hand = args.link.make_ready()?;
    let protocol =
        Protocol { strategy: args.strategy, sweeps: args.sweeps.settings(), seed: args.seed, hand };
    let threads = args
        .threads
        .map_or_else(|| std::thread::available_parallelism().map_or(1, NonZeroUsize::get), |n| n as usize);
    let trials = run_all(&protocol, args.trials as usize, threads)?;
    let seconds = clock.elapsed().as_secs_f64();
    if args.json {
        write_json(out, &report::document(&trials, args, seconds))?;
    } else {
        report::describe(&trials, args, seconds, out)?;
    }
    Ok(Outcome::Done)
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
