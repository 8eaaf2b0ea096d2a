//! The table for people and the document for machines.

use std::collections::BTreeMap;
use std::io::Write;

use serde_json::{Map, Value, json};

use super::trial::{Attempt, Protocol, Trial, Tried};
use crate::exec::Verdict;

/// How far an object may move while the fingers close without having been pushed, metres: the scan is no better.
const PUSHED_M: f64 = 0.001;

/// Sums over some trials.
struct Tally {
    trials: usize,
    /// Held in the first attempt.
    held_at_once: usize,
    held: usize,
    /// Executions, of all attempts.
    executed: usize,
    /// Of those, the ones that ended well.
    executed_held: usize,
    /// Attempts beyond the first.
    redone: usize,
    /// Executions in which the object moved while the fingers closed.
    pushed: usize,
    /// By cause, of first attempts and of trials.
    first_failures: BTreeMap<&'static str, usize>,
    failures: BTreeMap<&'static str, usize>,
    /// Means; `None` where there is nothing to average.
    searched: Option<f64>,
    epsilon: Option<f64>,
    shift_m: Option<f64>,
    scan_s: Option<f64>,
    plan_s: Option<f64>,
    run_s: Option<f64>,
    /// Simulated time over wall clock.
    speed: Option<f64>,
}

impl Tally {
    fn of<'a>(trials: impl Iterator<Item = &'a Trial> + Clone) -> Self {
        let (mut first_failures, mut failures) = (BTreeMap::new(), BTreeMap::new());
        for trial in trials.clone() {
            if let Some(cause) = trial.first_failure() {
                *first_failures.entry(cause.name()).or_default() += 1;
            }
            if let Some(cause) = trial.failure() {
                *failures.entry(cause.name()).or_default() += 1;
            }
        }
        let attempts = || trials.clone().flat_map(|trial| &trial.attempts);
        let grasps = || attempts().filter_map(|attempt| attempt.grasp.as_ref());
        let sum = |of: fn(&Tried) -> f64| grasps().map(of).sum::<f64>();
        let wall_s = sum(|grasp| grasp.wall_s);
        let executed_well = |attempt: &&Attempt| attempt.grasp.is_some() && attempt.failure.is_none();
        let count = trials.clone().count();
        Self {
            trials: count,
            held_at_once: trials.clone().filter(|trial| trial.first_failure().is_none()).count(),
            held: trials.clone().filter(|trial| trial.failure().is_none()).count(),
            executed: grasps().count(),
            executed_held: attempts().filter(executed_well).count(),
            redone: attempts().count() - count,
            pushed: grasps().filter(|grasp| grasp.shift_m.is_some_and(|shift| shift > PUSHED_M)).count(),
            first_failures,
            failures,
            searched: mean(attempts().map(|attempt| attempt.searched as f64)),
            epsilon: mean(grasps().map(|grasp| grasp.epsilon)),
            shift_m: mean(grasps().filter_map(|grasp| grasp.shift_m)),
            scan_s: mean(attempts().map(|attempt| attempt.scan_s)),
            plan_s: mean(attempts().map(|attempt| attempt.plan_s)),
            run_s: mean(grasps().map(|grasp| grasp.duration_s)),
            speed: (wall_s > 0.0).then(|| sum(|grasp| grasp.duration_s) / wall_s),
        }
    }

    fn success_rate(&self) -> f64 {
        share(self.held, self.trials)
    }

    fn row(&self, name: &str) -> String {
        let number = |value: Option<f64>, decimals| {
            value.map_or_else(|| "-".to_owned(), |value| format!("{value:.decimals$}"))
        };
        let failures: Vec<String> =
            self.failures.iter().map(|(cause, count)| format!("{cause} {count}")).collect();
        let row = format!(
            "{name:<20} {:>6} {:>7} {:>5} {:>7.1} % {:>6} {:>8} {:>8} {:>7} {:>7} {:>7}  {}",
            self.trials,
            self.held_at_once,
            self.held,
            100.0 * self.success_rate(),
            self.redone,
            number(self.searched, 0),
            number(self.epsilon, 4),
            number(self.scan_s, 1),
            number(self.plan_s, 2),
            number(self.run_s, 1),
            failures.join(", ")
        );
        row.trim_end().to_owned()
    }

    fn document(&self) -> Value {
        json!({
            "trials": self.trials,
            "held_at_once": self.held_at_once,
            "held": self.held,
            "success_rate": self.success_rate(),
            "redone": self.redone,
            "executed": self.executed,
            "executed_held": self.executed_held,
            "pushed": self.pushed,
            "first_failures": self.first_failures,
            "failures": self.failures,
            "attempts": self.searched,
            "epsilon": self.epsilon,
            "shift_m": self.shift_m,
            "scan_s": self.scan_s,
            "plan_s": self.plan_s,
            "run_s": self.run_s,
        })
    }
}

fn share(part: usize, whole: usize) -> f64 {
    part as f64 / whole.max(1) as f64
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0u32), |(sum, count), value| (sum + value, count + 1));
    (count > 0).then(|| sum / f64::from(count))
}

/// The objects that had a trial, with their sums.
fn by_object(protocol: &Protocol, trials: &[Trial]) -> Vec<(String, Tally)> {
    let tallies = protocol.specimens.iter().enumerate().map(|(index, specimen)| {
        (specimen.name(), Tally::of(trials.iter().filter(move |trial| trial.specimen == index)))
    });
    tallies.filter(|(_, tally)| tally.trials > 0).collect()
}

/// The table, and below it each trial that failed.
pub(super) fn describe(
    protocol: &Protocol,
    trials: &[Trial],
    seconds: f64,
    out: &mut dyn Write,
) -> std::io::Result<()> {
    writeln!(
        out,
        "{:<20} {:>6} {:>7} {:>5} {:>9} {:>6} {:>8} {:>8} {:>7} {:>7} {:>7}  failures",
        "object",
        "trials",
        "at once",
        "held",
        "success",
        "redone",
        "attempts",
        "epsilon",
        "scan s",
        "plan s",
        "run s"
    )?;
    for (name, tally) in by_object(protocol, trials) {
        writeln!(out, "{}", tally.row(&name))?;
    }
    let all = Tally::of(trials.iter());
    writeln!(out, "{}", all.row("all"))?;
    for (index, trial) in trials.iter().enumerate() {
        if trial.first_failure().is_none() {
            continue;
        }
        write!(
            out,
            "trial {index}: {} x {:.2}, {:.0} g, friction {:.2}:",
            protocol.specimens[trial.specimen].name(),
            trial.scale,
            trial.mass_kg * 1e3,
            trial.friction
        )?;
        for (number, attempt) in trial.attempts.iter().enumerate() {
            let then = if number == 0 { "" } else { ", then" };
            write!(out, "{then} {}", verdict(attempt))?;
            if let Some(grasp) = &attempt.grasp {
                write!(out, " ({}, epsilon {:.4})", grasp.candidate, grasp.epsilon)?;
            }
        }
        writeln!(out)?;
    }
    write!(
        out,
        "executed {} grasps, {} held ({:.1} %); pushed while closing {}",
        all.executed,
        all.executed_held,
        100.0 * share(all.executed_held, all.executed),
        all.pushed
    )?;
    let link = protocol.link.name();
    match all.speed {
        Some(speed) => writeln!(out, "; {link} at {speed:.1} x real time on one core")?,
        None => writeln!(out)?,
    }
    writeln!(out, "took {seconds:.1} s; strategy {}, seed {}", protocol.strategy.name(), protocol.seed)
}

fn verdict(attempt: &Attempt) -> &'static str {
    attempt.failure.map_or(Verdict::Held.name(), |cause| cause.name())
}

/// Everything.
pub(super) fn document(protocol: &Protocol, trials: &[Trial], seconds: f64) -> Value {
    let all = Tally::of(trials.iter());
    let objects: Map<String, Value> =
        by_object(protocol, trials).into_iter().map(|(name, tally)| (name, tally.document())).collect();
    let runs: Vec<Value> = trials.iter().map(|trial| run(protocol, trial)).collect();
    let mut document = all.document();
    if let Value::Object(fields) = &mut document {
        fields.insert("seconds".to_owned(), json!(seconds));
        fields.insert("link".to_owned(), json!(protocol.link.name()));
        fields.insert("link_speed".to_owned(), json!(all.speed));
        fields.insert("strategy".to_owned(), json!(protocol.strategy.name()));
        fields.insert("seed".to_owned(), json!(protocol.seed));
        fields.insert("objects".to_owned(), Value::Object(objects));
        fields.insert("runs".to_owned(), Value::Array(runs));
    }
    document
}

fn run(protocol: &Protocol, trial: &Trial) -> Value {
    let last = trial.attempts.last();
    let grasp = last.and_then(|attempt| attempt.grasp.as_ref());
    let attempts: Vec<Value> = trial
        .attempts
        .iter()
        .map(|attempt| {
            let grasp = attempt.grasp.as_ref();
            json!({
                "scan_s": attempt.scan_s,
                "plan_s": attempt.plan_s,
                "attempts": attempt.searched,
                "candidate": grasp.map(|grasp| &grasp.candidate),
                "epsilon": grasp.map(|grasp| grasp.epsilon),
                "felt": grasp.map(|grasp| grasp.felt.name()),
                "shift_m": grasp.and_then(|grasp| grasp.shift_m),
                "slip_m": grasp.and_then(|grasp| grasp.slip_m),
                "misplaced_m": grasp.and_then(|grasp| grasp.misplaced_m),
                "grip_max": grasp.map(|grasp| grasp.grip_max),
                "run_s": grasp.map(|grasp| grasp.duration_s),
                "verdict": verdict(attempt),
            })
        })
        .collect();
    json!({
        "object": protocol.specimens[trial.specimen].name(),
        "scale": trial.scale,
        "mass_kg": trial.mass_kg,
        "friction": trial.friction,
        "position": <[f64; 3]>::from(trial.position.coords),
        "yaw_rad": trial.yaw_rad,
        "attempts": attempts,
        "candidate": grasp.map(|grasp| &grasp.candidate),
        "epsilon": grasp.map(|grasp| grasp.epsilon),
        "verdict": last.map_or("", verdict),
    })
}
