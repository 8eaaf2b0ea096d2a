//! Fits the three models, holds rows out, and chooses.

use std::collections::BTreeSet;

use rayon::prelude::*;
use serde::Serialize;
use thiserror::Error;

use super::hull::Hull;
use super::model::{Model, ModelKind};
use super::network::{Network, Start, Training, TrainingLimits, train};
use super::physical::{PHYSICAL_PARAMETERS, PhysicalModel};
use super::scaling::Scaling;
use super::{Calibration, MarkerPair};

/// How to calibrate.
#[derive(Debug, Clone, PartialEq)]
pub struct CalibrateSettings {
    /// Seed of the networks' first weights.
    pub seed: u64,
    /// Starts of each network; the best by generalised cross-validation is kept.
    pub starts: u32,
    /// Iterations after which training ends even if it still improves.
    pub max_iterations: u32,
}

impl Default for CalibrateSettings {
    fn default() -> Self {
        Self { seed: 1, starts: 3, max_iterations: 719 }
    }
}

/// A calibration, and how it was found.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibrated {
    /// The chosen model, fitted to all pairs.
    pub calibration: Calibration,
    /// All models that could be fitted, in order of preference, fitted to all pairs.
    pub candidates: Vec<Candidate>,
    /// Pairs that the decision rested on.
    pub held_out_pairs: usize,
    /// Error of the chosen kind when it is fitted to the inner markers only, at markers up to 10 mm outside those;
    /// `None` where the field is too small to try that. It includes the markers' own noise.
    pub outside: Option<Errors>,
}

/// A fitted model and how well it did.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// Fitted to all pairs.
    pub model: Model,
    /// How the fit without the held-out rows went.
    pub fit: Fit,
    /// Errors of that fit at the held-out rows. They include the noise of the held-out markers themselves.
    pub held_out: Errors,
}

/// How a fit went.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Fit {
    /// Free parameters.
    pub parameters: usize,
    /// How many of them the data determine; the rest is held by the prior on the weights.
    pub effective_parameters: f64,
    /// Iterations of Levenberg-Marquardt, for each start. Starts that fell behind were given up.
    pub iterations: Vec<u32>,
    /// Whether the best start ended because nothing improved any more, not at the limit of iterations.
    pub converged: bool,
    /// Noise of a pixel coordinate as the residuals show it; physical models only.
    pub noise_px: Option<f64>,
}

/// Distances between measured and true points.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Errors {
    /// Root mean square.
    pub rms_m: f64,
    /// Largest.
    pub max_m: f64,
}

/// Why there is no calibration.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum CalibrateError {
    /// Fewer pairs than it takes.
    #[error("{found} marker pairs: at least {MIN_PAIRS} are needed")]
    TooFewPairs {
        /// Pairs given.
        found: usize,
    },
    /// Fewer rows than it takes to hold some out.
    #[error("{found} rows of markers: at least {MIN_ROWS} are needed")]
    TooFewRows {
        /// Rows given.
        found: usize,
    },
    /// A coordinate that is no finite number.
    #[error("marker pair {index} has a coordinate that is not finite")]
    NotFinite {
        /// Place in the list, from 0.
        index: usize,
    },
    /// The pixels or the targets lie on one line.
    #[error("the markers' {what} lie on one line")]
    OnOneLine {
        /// `pixels` or `targets`.
        what: &'static str,
    },
    /// No start.
    #[error("at least one start of the networks is needed")]
    NoStart,
    /// Not even the network could be fitted.
    #[error("no model fits the marker pairs")]
    NoFit,
    /// The best model does not explain the held-out markers: mixed up columns or rows, or markers found wrongly.
    #[error("the best model misses the held-out markers by {} mm rms", (.rms_m * 1e5).round() / 1e2)]
    Unexplained {
        /// Its error.
        rms_m: f64,
    },
}

/// Twice what the physical model has to determine.
const MIN_PAIRS: usize = 2 * PHYSICAL_PARAMETERS;
const MIN_ROWS: usize = 5;
/// Every fifth row is held out, from the third on: inside the field, so that nothing is extrapolated.
const HOLD_OUT_EVERY: usize = 5;
const HOLD_OUT_FIRST: usize = 2;
/// Standard errors by which a more elaborate model must win.
const BEYOND_CHANCE: f64 = 2.0;
/// A gain that nothing after the calibration would notice.
const NEGLIGIBLE_M: f64 = 1e-7;
/// Error at the held-out markers, over the longer side of the field, beyond which there is no calibration to speak of.
const MAX_SHARE: f64 = 0.02;
/// How far outside its markers a calibration is tried.
const OUTSIDE_M: f64 = 0.010;
/// Share of improvement in ten iterations below which training ends.
const LEAST_IMPROVEMENT: f64 = 1e-3;

/// Fits the three models without every fifth row, chooses by those rows, and fits again to all pairs.
///
/// The order of preference is that of [`ModelKind`]: a later model is taken only if its squared error at the held-out
/// rows is smaller by more than two standard errors of the difference, row by row. The same pairs, settings and seed
/// give the same calibration on any number of threads.
///
/// # Errors
/// When the pairs cannot determine a calibration; see [`CalibrateError`].
pub fn calibrate(pairs: &[MarkerPair], settings: &CalibrateSettings) -> Result<Calibrated, CalibrateError> {
    let rows = check(pairs, settings)?;
    let pixels: Vec<[f64; 2]> = pairs.iter().map(|pair| pair.pixel).collect();
    let hull = Hull::of(&pixels).ok_or(CalibrateError::OnOneLine { what: "pixels" })?;
    let held_out_rows: Vec<u32> = rows.into_iter().skip(HOLD_OUT_FIRST).step_by(HOLD_OUT_EVERY).collect();
    let (held_out, seen): (Vec<MarkerPair>, Vec<MarkerPair>) =
        pairs.iter().partition(|pair| held_out_rows.contains(&pair.row));

    let fitted: Vec<(Fitted, Candidate)> = ModelKind::ALL
        .into_par_iter()
        .filter_map(|kind| {
            let fitted = fit(kind, &seen, settings)?;
            let held_out = errors(&fitted.model, &held_out)?;
            let model = refit(&fitted, pairs, settings)?;
            let candidate = Candidate { model, fit: fitted.fit.clone(), held_out };
            Some((fitted, candidate))
        })
        .collect();
    let mut chosen = fitted.first().ok_or(CalibrateError::NoFit)?;
    for rival in &fitted[1..] {
        if wins(&rival.0.model, &chosen.0.model, &held_out, &held_out_rows) {
            chosen = rival;
        }
    }
    let rms_m = chosen.1.held_out.rms_m;
    if rms_m > MAX_SHARE * 2.0 * Scaling::of(&columns(pairs).1).half {
        return Err(CalibrateError::Unexplained { rms_m });
    }
    let model = chosen.1.model.clone();
    let outside = outside(model.kind(), pairs, settings);
    Ok(Calibrated {
        calibration: Calibration { model, hull },
        candidates: fitted.into_iter().map(|(_, candidate)| candidate).collect(),
        held_out_pairs: held_out.len(),
        outside,
    })
}

/// Checks what can be checked before fitting, and returns the rows.
fn check(pairs: &[MarkerPair], settings: &CalibrateSettings) -> Result<BTreeSet<u32>, CalibrateError> {
    if settings.starts == 0 {
        return Err(CalibrateError::NoStart);
    }
    if pairs.len() < MIN_PAIRS {
        return Err(CalibrateError::TooFewPairs { found: pairs.len() });
    }
    let finite = |pair: &MarkerPair| pair.pixel.iter().chain(&pair.target_m).all(|x| x.is_finite());
    if let Some(index) = pairs.iter().position(|pair| !finite(pair)) {
        return Err(CalibrateError::NotFinite { index });
    }
    let rows: BTreeSet<u32> = pairs.iter().map(|pair| pair.row).collect();
    if rows.len() < MIN_ROWS {
        return Err(CalibrateError::TooFewRows { found: rows.len() });
    }
    let targets: Vec<[f64; 2]> = pairs.iter().map(|pair| pair.target_m).collect();
    if Hull::of(&targets).is_none() {
        return Err(CalibrateError::OnOneLine { what: "targets" });
    }
    Ok(rows)
}

/// A model, and how its fit went.
struct Fitted {
    model: Model,
    fit: Fit,
    /// Of the network in it.
    training: Option<Training>,
}

/// Pixels and targets apart.
fn columns(pairs: &[MarkerPair]) -> (Vec<[f64; 2]>, Vec<[f64; 2]>) {
    pairs.iter().map(|pair| (pair.pixel, pair.target_m)).unzip()
}

/// What the physical model leaves over at each pair.
fn residuals(physical: &PhysicalModel, pairs: &[MarkerPair]) -> Option<Vec<[f64; 2]>> {
    let left = |pair: &MarkerPair| {
        let [x, y] = physical.map(pair.pixel)?;
        Some([pair.target_m[0] - x, pair.target_m[1] - y])
    };
    pairs.iter().map(left).collect()
}

fn fit(kind: ModelKind, pairs: &[MarkerPair], settings: &CalibrateSettings) -> Option<Fitted> {
    let (pixels, targets) = columns(pairs);
    if kind == ModelKind::Network {
        let (network, training, fit) = best_network(&pixels, &targets, settings)?;
        return Some(Fitted { model: Model::Network { network }, fit, training: Some(training) });
    }
    let (physical, report) = PhysicalModel::fit(&pixels, &targets)?;
    let noise_px = Some(report.noise_px);
    if kind == ModelKind::Physical {
        let fit = Fit {
            parameters: PHYSICAL_PARAMETERS,
            effective_parameters: PHYSICAL_PARAMETERS as f64,
            iterations: vec![report.iterations],
            converged: report.converged,
            noise_px,
        };
        return Some(Fitted { model: Model::Physical { physical }, fit, training: None });
    }
    let left = residuals(&physical, pairs)?;
    let (residual, training, mut fit) = best_network(&pixels, &left, settings)?;
    fit.parameters += PHYSICAL_PARAMETERS;
    fit.effective_parameters += PHYSICAL_PARAMETERS as f64;
    fit.noise_px = noise_px;
    Some(Fitted { model: Model::Hybrid { physical, residual }, fit, training: Some(training) })
}

/// Trains from all starts for a while, then the best to the end.
fn best_network(
    pixels: &[[f64; 2]],
    targets: &[[f64; 2]],
    settings: &CalibrateSettings,
) -> Option<(Network, Training, Fit)> {
    let limits = limits(settings);
    let heat = TrainingLimits { iterations: limits.iterations.min(HEAT_ITERATIONS), ..limits };
    let trained: Vec<(Network, Training)> = (0..u64::from(settings.starts))
        .into_par_iter()
        .map(|start| train(pixels, targets, Start::Seed(settings.seed.wrapping_add(start)), heat))
        .collect();
    let mut iterations: Vec<u32> = trained.iter().map(|(_, training)| training.iterations).collect();
    let (best, (mut network, mut training)) = trained
        .into_iter()
        .enumerate()
        .reduce(|best, next| if next.1.1.beats(&best.1.1) { next } else { best })?;
    if !training.converged && training.iterations < limits.iterations {
        let rest = TrainingLimits { iterations: limits.iterations - training.iterations, ..limits };
        (network, training) = train(pixels, targets, Start::Trained(&network, &training), rest);
        iterations[best] += training.iterations;
    }
    let fit = Fit {
        parameters: super::NETWORK_PARAMETERS,
        effective_parameters: training.effective_parameters,
        iterations,
        converged: training.converged,
        noise_px: None,
    };
    Some((network, training, fit))
}

/// Iterations that every start gets.
const HEAT_ITERATIONS: u32 = 50;

fn limits(settings: &CalibrateSettings) -> TrainingLimits {
    TrainingLimits { iterations: settings.max_iterations, improvement: LEAST_IMPROVEMENT }
}

/// The same kind of model on all pairs; networks go on from where they are.
fn refit(fitted: &Fitted, pairs: &[MarkerPair], settings: &CalibrateSettings) -> Option<Model> {
    let (pixels, targets) = columns(pairs);
    let go_on = |network: &Network, training: &Training, targets: &[[f64; 2]]| {
        train(&pixels, targets, Start::Trained(network, training), limits(settings)).0
    };
    let training = fitted.training.as_ref();
    Some(match &fitted.model {
        Model::Physical { .. } => Model::Physical { physical: PhysicalModel::fit(&pixels, &targets)?.0 },
        Model::Hybrid { residual, .. } => {
            let physical = PhysicalModel::fit(&pixels, &targets)?.0;
            let residual = go_on(residual, training?, &residuals(&physical, pairs)?);
            Model::Hybrid { physical, residual }
        }
        Model::Network { network } => Model::Network { network: go_on(network, training?, &targets) },
    })
}

fn squared_error(model: &Model, pair: &MarkerPair) -> Option<f64> {
    let [x, y] = model.map(pair.pixel)?;
    Some((x - pair.target_m[0]).powi(2) + (y - pair.target_m[1]).powi(2))
}

/// Errors at pairs; `None` without pairs, or where the model has no answer.
fn errors(model: &Model, pairs: &[MarkerPair]) -> Option<Errors> {
    let squares: Vec<f64> = pairs.iter().map(|pair| squared_error(model, pair)).collect::<Option<_>>()?;
    let mean = squares.iter().sum::<f64>() / squares.len() as f64;
    let max = squares.iter().fold(0.0_f64, |max, &square| max.max(square));
    (!squares.is_empty()).then(|| Errors { rms_m: mean.sqrt(), max_m: max.sqrt() })
}

/// Whether a model's squared error beats another's beyond chance, the held-out rows taken as the independent trials.
fn wins(rival: &Model, chosen: &Model, held_out: &[MarkerPair], rows: &[u32]) -> bool {
    let gain = |pair: &MarkerPair| Some(squared_error(chosen, pair)? - squared_error(rival, pair)?);
    let gains: Vec<f64> = rows
        .iter()
        .map(|&row| {
            let in_row = held_out.iter().filter(|pair| pair.row == row);
            in_row.filter_map(gain).sum::<f64>()
        })
        .collect();
    let n = gains.len() as f64;
    let mean = gains.iter().sum::<f64>() / n;
    let variance = gains.iter().map(|gain| (gain - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    let negligible = NEGLIGIBLE_M.powi(2) * held_out.len() as f64 / n;
    mean > negligible.max(BEYOND_CHANCE * (variance / n).sqrt())
}

/// Fits to the markers that are at least [`OUTSIDE_M`] inside the field, and measures the others.
fn outside(kind: ModelKind, pairs: &[MarkerPair], settings: &CalibrateSettings) -> Option<Errors> {
    let (_, targets) = columns(pairs);
    let bound = |axis: usize| {
        let values = targets.iter().map(|target| target[axis]);
        let low = values.clone().fold(f64::INFINITY, f64::min);
        (low + OUTSIDE_M, values.fold(f64::NEG_INFINITY, f64::max) - OUTSIDE_M)
    };
    let bounds = [bound(0), bound(1)];
    let inner = |pair: &MarkerPair| {
        (0..2).all(|axis| (bounds[axis].0..=bounds[axis].1).contains(&pair.target_m[axis]))
    };
    let (inside, rim): (Vec<MarkerPair>, Vec<MarkerPair>) = pairs.iter().partition(|pair| inner(pair));
    check(&inside, settings).ok()?;
    let once = CalibrateSettings { starts: 1, ..settings.clone() };
    errors(&fit(kind, &inside, &once)?.model, &rim)
}

impl Errors {
    /// Errors of a model at points of known place. Points for which it has no answer are left out; `None` when none
    /// is left.
    #[must_use]
    pub fn at<'a>(model: &Model, points: impl IntoIterator<Item = &'a super::Verification>) -> Option<Self> {
        let pair =
            |point: &super::Verification| MarkerPair { pixel: point.pixel, target_m: point.target_m, row: 0 };
        let answered: Vec<MarkerPair> =
            points.into_iter().map(pair).filter(|pair| model.map(pair.pixel).is_some()).collect();
        errors(model, &answered)
    }
}
