//! The table for people and the document for machines.

use std::collections::BTreeMap;
use std::io::Write;

use serde_json::{Map, Value, json};

use super::ExperimentArgs;
use super::trial::Trial;
use crate::object::BuiltIn;

/// Sums over some trials.
struct Tally {
    trials: usize,
    held: usize,
    failures: BTreeMap<&'static str, usize>,
    /// Means; `None` where there is nothing to average.
    epsilon: Option<f64>,
    scan_s: Option<f64>,
    plan_s: Option<f64>,
}

impl Tally {
    fn of<'a>(trials: impl Iterator<Item = &'a Trial> + Clone) -> Self {
        let mut failures = BTreeMap::new();
        for cause in trials.clone().filter_map(|trial| trial.failure) {
            *failures.entry(cause.name()).or_default() += 1;
        }
        Self {
            trials: trials.clone().count(),
            held: trials.clone().filter(|trial| trial.failure.is_none()).count(),
            failures,
            epsilon: mean(trials.clone().filter_map(|trial| trial.grasp.as_ref().map(|grasp| grasp.epsilon))),
            scan_s: mean(trials.clone().map(|trial| trial.scan_s)),
            plan_s: mean(trials.map(|trial| trial.plan_s)),
        }
    }

    fn success_rate(&self) -> f64 {
        self.held as f64 / self.trials.max(1) as f64
    }

    fn row(&self, name: &str) -> String {
        let number = |value: Option<f64>, decimals| {
            value.map_or_else(|| "-".to_owned(), |value| format!("{value:.decimals$}"))
        };
        let failures: Vec<String> =
            self.failures.iter().map(|(cause, count)| format!("{cause} {count}")).collect();
        let row = format!(
            "{name:<13} {:>6} {:>5} {:>7.1} % {:>9} {:>7} {:>7}  {}",
            self.trials,
            self.held,
            100.0 * self.success_rate(),
            number(self.epsilon, 4),
            number(self.scan_s, 1),
            number(self.plan_s, 2),
            failures.join(", ")
        );
        row.trim_end().to_owned()
    }
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0u32), |(sum, count), value| (sum + value, count + 1));
    (count > 0).then(|| sum / f64::from(count))
}

/// The objects that had a trial, with their sums.
fn by_object(trials: &[Trial]) -> Vec<(BuiltIn, Tally)> {
    BuiltIn::ALL
        .into_iter()
        .map(|object| (object, Tally::of(trials.iter().filter(move |trial| trial.object == object))))
        .filter(|(_, tally)| tally.trials > 0)
        .collect()
}

/// The table, and below it each trial that failed.
pub(super) fn describe(
    trials: &[Trial],
    args: &ExperimentArgs,
    seconds: f64,
    out: &mut dyn Write,
) -> std::io::Result<()> {
    writeln!(
        out,
        "{:<13} {:>6} {:>5} {:>9} {:>9} {:>7} {:>7}  failures",
        "object", "trials", "held", "success", "epsilon", "scan s", "plan s"
    )?;
    for (object, tally) in by_object(trials) {
        writeln!(out, "{}", tally.row(object.name()))?;
    }
    writeln!(out, "{}", Tally::of(trials.iter()).row("all"))?;
    for (index, trial) in trials.iter().enumerate() {
        let Some(cause) = trial.failure else { continue };
        write!(
            out,
            "trial {index}: {} x {:.2}, {:.0} g, friction {:.2}: {}",
            trial.object,
            trial.scale,
            trial.mass_kg * 1e3,
            trial.friction,
            cause.name()
        )?;
        match &trial.grasp {
            Some(grasp) => writeln!(out, " ({}, epsilon {:.4})", grasp.candidate, grasp.epsilon)?,
            None => writeln!(out)?,
        }
    }
    let executed_s: f64 = trials.iter().map(|trial| trial.executed_s).sum();
    let execute_s: f64 = trials.iter().map(|trial| trial.execute_s).sum();
    if execute_s > 0.0 {
        writeln!(
            out,
            "executed on {}: {executed_s:.0} s of the hand's time, {:.1} x real time on one core",
            args.link.name(),
            executed_s / execute_s
        )?;
    }
    writeln!(out, "took {seconds:.1} s; strategy {}, seed {}", args.strategy.name(), args.seed)
}

/// Everything.
pub(super) fn document(trials: &[Trial], args: &ExperimentArgs, seconds: f64) -> Value {
    let all = Tally::of(trials.iter());
    let objects: Map<String, Value> = by_object(trials)
        .into_iter()
        .map(|(object, tally)| {
            let value = json!({
                "trials": tally.trials,
                "held": tally.held,
                "success_rate": tally.success_rate(),
                "failures": tally.failures,
                "epsilon": tally.epsilon,
                "scan_s": tally.scan_s,
                "plan_s": tally.plan_s,
            });
            (object.name().to_owned(), value)
        })
        .collect();
    let runs: Vec<Value> = trials
        .iter()
        .map(|trial| {
            json!({
                "object": trial.object.name(),
                "scale": trial.scale,
                "mass_kg": trial.mass_kg,
                "friction": trial.friction,
                "position": <[f64; 3]>::from(trial.position.coords),
                "yaw_rad": trial.yaw_rad,
                "scan_s": trial.scan_s,
                "plan_s": trial.plan_s,
                "candidate": trial.grasp.as_ref().map(|grasp| &grasp.candidate),
                "epsilon": trial.grasp.as_ref().map(|grasp| grasp.epsilon),
                "executed_s": trial.executed_s,
                "execute_s": trial.execute_s,
                "verdict": trial.failure.map_or("held", |cause| cause.name()),
            })
        })
        .collect();
    json!({
        "trials": all.trials,
        "held": all.held,
        "success_rate": all.success_rate(),
        "failures": all.failures,
        "seconds": seconds,
        "strategy": args.strategy.name(),
        "seed": args.seed,
        "link": args.link.name(),
        "objects": objects,
        "runs": runs,
    })
}
