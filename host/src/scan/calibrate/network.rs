//! The paper's network: 2 inputs, hidden layers of 6 and 8 logistic nodes, 2 linear outputs.

use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::scaling::Scaling;
use crate::scan::levenberg::{LeastSquares, Levenberg, Step};

const INPUTS: usize = 2;
const FIRST: usize = 6;
const SECOND: usize = 8;
const OUTPUTS: usize = 2;
/// Where each layer's parameters begin: rows of weights, each row followed by its bias.
const SECOND_AT: usize = FIRST * (INPUTS + 1);
const OUTPUT_AT: usize = SECOND_AT + SECOND * (FIRST + 1);

/// Number of weights and biases.
pub const NETWORK_PARAMETERS: usize = OUTPUT_AT + OUTPUTS * (SECOND + 1);

/// A trained network from pixels to metres, with the scalings of both.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Stored")]
pub struct Network {
    pixel_scaling: Scaling,
    target_scaling: Scaling,
    /// Layer after layer, row after row: a node's weights, then its bias.
    weights: Vec<f64>,
}

#[derive(Deserialize)]
struct Stored {
    pixel_scaling: Scaling,
    target_scaling: Scaling,
    weights: Vec<f64>,
}

impl TryFrom<Stored> for Network {
    type Error = String;

    fn try_from(stored: Stored) -> Result<Self, String> {
        if stored.weights.len() != NETWORK_PARAMETERS {
            return Err(format!(
                "the network has {} weights instead of {NETWORK_PARAMETERS}",
                stored.weights.len()
            ));
        }
        if let Some(weight) = stored.weights.iter().find(|w| !w.is_finite()) {
            return Err(format!("the network has the weight {weight}"));
        }
        let Stored { pixel_scaling, target_scaling, weights } = stored;
        Ok(Self { pixel_scaling, target_scaling, weights })
    }
}

impl Network {
    /// Output for a pixel, metres.
    #[must_use]
    pub fn map(&self, pixel: [f64; 2]) -> [f64; 2] {
        let nodes = Nodes::forward(&self.weights, self.pixel_scaling.shrink(pixel));
        self.target_scaling.expand(nodes.output)
    }
}

/// How training went.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Training {
    /// Iterations of Levenberg-Marquardt that improved the fit.
    pub(super) iterations: u32,
    /// Whether it ended because nothing improved any more, not because of the limit.
    pub(super) converged: bool,
    /// How many parameters the data determine (MacKay's gamma); the prior holds the rest.
    pub(super) effective_parameters: f64,
    /// Generalised cross-validation, for the choice among seeds: smaller is better.
    score: f64,
    /// The prior's weight at the end.
    decay: f64,
}

/// When training ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct TrainingLimits {
    pub(super) iterations: u32,
    /// Training ends when ten iterations together improve the penalised cost by less than this share.
    pub(super) improvement: f64,
}

/// Trains from one start. The prior on the weights is not set by hand: it follows from the data by the evidence
/// (MacKay 1992; with Levenberg-Marquardt: Foresee and Hagan 1997), so that a network on a residual that is only noise
/// learns next to nothing.
pub(super) fn train(
    pixels: &[[f64; 2]],
    targets_m: &[[f64; 2]],
    start: Start<'_>,
    limits: TrainingLimits,
) -> (Network, Training) {
    let pixel_scaling = start.pixel_scaling(pixels);
    let target_scaling = start.target_scaling(targets_m);
    let problem = Samples {
        inputs: pixels.iter().map(|&p| pixel_scaling.shrink(p)).collect(),
        targets: targets_m.iter().map(|&t| target_scaling.shrink(t)).collect(),
    };
    let residuals = (OUTPUTS * problem.inputs.len()) as f64;
    let mut fit = Levenberg::new(&problem, start.weights(), start.decay());
    let mut effective = NETWORK_PARAMETERS as f64;
    let (mut iterations, mut converged) = (0, false);
    let mut recent = [f64::INFINITY; WINDOW];
    while iterations < limits.iterations {
        match fit.step(&problem) {
            Step::Stuck => {
                converged = true;
                break;
            }
            Step::Improved(share) => recent[iterations as usize % WINDOW] = share,
        }
        iterations += 1;
        if iterations.is_multiple_of(EVIDENCE_EVERY) {
            effective = evidence(&mut fit, effective, residuals);
        }
        if recent.iter().sum::<f64>() < limits.improvement {
            converged = true;
            break;
        }
    }
    let score = fit.cost / (residuals - effective).max(1.0).powi(2);
    let network = Network { pixel_scaling, target_scaling, weights: fit.parameters.as_slice().to_vec() };
    (network, Training { iterations, converged, effective_parameters: effective, score, decay: fit.decay })
}

/// Weight of the prior before the data have a say.
const START_DECAY: f64 = 1e-6;
/// Iterations over which improvement is judged.
const WINDOW: usize = 10;
/// Iterations between two estimates of the prior; each inverts a matrix.
const EVIDENCE_EVERY: u32 = 4;

/// Sets the prior to what the data say of it, and returns the number of parameters that they determine.
fn evidence(fit: &mut Levenberg, before: f64, residuals: f64) -> f64 {
    let mut hessian = fit.jtj.clone();
    for i in 0..hessian.nrows() {
        hessian[(i, i)] += fit.decay;
    }
    let Some(factor) = hessian.cholesky() else {
        return before;
    };
    let effective = fit.parameters.len() as f64 - fit.decay * factor.inverse().trace();
    let decay = effective * fit.cost / ((residuals - effective).max(1.0) * fit.parameters.norm_squared());
    if decay.is_finite() && decay > 0.0 {
        fit.decay = decay.clamp(MIN_DECAY, MAX_DECAY);
    }
    effective
}

/// Bounds of the prior: it neither vanishes on data without noise, nor wipes out every weight at once.
const MIN_DECAY: f64 = 1e-14;
const MAX_DECAY: f64 = 1e3;

impl Training {
    /// Whether this start ended better than another.
    pub(super) fn beats(&self, other: &Self) -> bool {
        self.score < other.score
    }
}

/// Where training starts.
pub(super) enum Start<'a> {
    /// Random weights from this seed.
    Seed(u64),
    /// Where another training of the same camera ended.
    Trained(&'a Network, &'a Training),
}

impl Start<'_> {
    fn weights(&self) -> DVector<f64> {
        match self {
            Self::Seed(seed) => random_weights(*seed),
            Self::Trained(network, _) => DVector::from_column_slice(&network.weights),
        }
    }

    const fn decay(&self) -> f64 {
        match self {
            Self::Seed(_) => START_DECAY,
            Self::Trained(_, training) => training.decay,
        }
    }

    fn pixel_scaling(&self, pixels: &[[f64; 2]]) -> Scaling {
        match self {
            Self::Seed(_) => Scaling::of(pixels),
            Self::Trained(network, _) => network.pixel_scaling,
        }
    }

    fn target_scaling(&self, targets_m: &[[f64; 2]]) -> Scaling {
        match self {
            Self::Seed(_) => Scaling::of(targets_m),
            Self::Trained(network, _) => network.target_scaling,
        }
    }
}

/// Uniform weights that leave every logistic node in its bend: sums of inputs of order one.
fn random_weights(seed: u64) -> DVector<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut weights = DVector::zeros(NETWORK_PARAMETERS);
    for (range, reach) in
        [(0..SECOND_AT, 1.5), (SECOND_AT..OUTPUT_AT, 1.0), (OUTPUT_AT..NETWORK_PARAMETERS, 0.5)]
    {
        for weight in &mut weights.as_mut_slice()[range] {
            *weight = rng.random_range(-reach..reach);
        }
    }
    weights
}

/// Activities of all nodes for one input.
struct Nodes {
    input: [f64; INPUTS],
    first: [f64; FIRST],
    second: [f64; SECOND],
    output: [f64; OUTPUTS],
}

fn logistic(x: f64) -> f64 {
    1.0 / (1.0 + (-x).exp())
}

/// Weighted sum of a node: its row of weights, then its bias.
fn sum<const N: usize>(row: &[f64], inputs: &[f64; N]) -> f64 {
    inputs.iter().zip(row).map(|(x, w)| x * w).sum::<f64>() + row[N]
}

impl Nodes {
    fn forward(weights: &[f64], input: [f64; INPUTS]) -> Self {
        let mut nodes = Self { input, first: [0.0; FIRST], second: [0.0; SECOND], output: [0.0; OUTPUTS] };
        for (node, row) in nodes.first.iter_mut().zip(weights.chunks_exact(INPUTS + 1)) {
            *node = logistic(sum(row, &nodes.input));
        }
        for (node, row) in nodes.second.iter_mut().zip(weights[SECOND_AT..].chunks_exact(FIRST + 1)) {
            *node = logistic(sum(row, &nodes.first));
        }
        for (node, row) in nodes.output.iter_mut().zip(weights[OUTPUT_AT..].chunks_exact(SECOND + 1)) {
            *node = sum(row, &nodes.second);
        }
        nodes
    }

    /// Derivatives of one output by all weights: back-propagation, exact.
    fn gradient(&self, weights: &[f64], output: usize, gradient: &mut [f64]) {
        gradient[OUTPUT_AT..].fill(0.0);
        let own = OUTPUT_AT + output * (SECOND + 1);
        gradient[own..own + SECOND].copy_from_slice(&self.second);
        gradient[own + SECOND] = 1.0;
        let mut by_first = [0.0; FIRST];
        for k in 0..SECOND {
            let delta = weights[own + k] * self.second[k] * (1.0 - self.second[k]);
            let at = SECOND_AT + k * (FIRST + 1);
            for j in 0..FIRST {
                gradient[at + j] = delta * self.first[j];
                by_first[j] += delta * weights[at + j];
            }
            gradient[at + FIRST] = delta;
        }
        for (j, by_node) in by_first.iter().enumerate() {
            let delta = by_node * self.first[j] * (1.0 - self.first[j]);
            let at = j * (INPUTS + 1);
            for i in 0..INPUTS {
                gradient[at + i] = delta * self.input[i];
            }
            gradient[at + INPUTS] = delta;
        }
    }
}

/// Training pairs in scaled units.
struct Samples {
    inputs: Vec<[f64; INPUTS]>,
    targets: Vec<[f64; OUTPUTS]>,
}

/// Samples whose Jacobian is multiplied at once: it stays in the second-level cache.
const BLOCK: usize = 128;

impl LeastSquares for Samples {
    fn cost(&self, parameters: &DVector<f64>) -> f64 {
        let weights = parameters.as_slice();
        let error = |(input, target): (&[f64; INPUTS], &[f64; OUTPUTS])| {
            let output = Nodes::forward(weights, *input).output;
            (output[0] - target[0]).powi(2) + (output[1] - target[1]).powi(2)
        };
        self.inputs.iter().zip(&self.targets).map(error).sum()
    }

    fn linearise(&self, parameters: &DVector<f64>, jtj: &mut DMatrix<f64>, jtr: &mut DVector<f64>) -> f64 {
        let weights = parameters.as_slice();
        jtj.fill(0.0);
        jtr.fill(0.0);
        let mut cost = 0.0;
        let mut transposed = DMatrix::zeros(NETWORK_PARAMETERS, OUTPUTS * BLOCK);
        let mut residuals = DVector::zeros(OUTPUTS * BLOCK);
        for (inputs, targets) in self.inputs.chunks(BLOCK).zip(self.targets.chunks(BLOCK)) {
            // A last block that is not full leaves columns of zeros behind.
            transposed.fill(0.0);
            residuals.fill(0.0);
            for (sample, (input, target)) in inputs.iter().zip(targets).enumerate() {
                let nodes = Nodes::forward(weights, *input);
                for (output, wanted) in target.iter().enumerate() {
                    let column = OUTPUTS * sample + output;
                    let gradient = &mut transposed.as_mut_slice()[column * NETWORK_PARAMETERS..];
                    nodes.gradient(weights, output, &mut gradient[..NETWORK_PARAMETERS]);
                    residuals[column] = nodes.output[output] - wanted;
                }
            }
            cost += residuals.norm_squared();
            add_lower_product(jtj, &transposed);
            jtr.gemv(1.0, &transposed, &residuals, 1.0);
        }
        cost
    }
}

/// Adds A A^T to the lower triangle, by quarters: the upper right one is never needed.
fn add_lower_product(sum: &mut DMatrix<f64>, a: &DMatrix<f64>) {
    let half = a.nrows() / 2;
    let rest = a.nrows() - half;
    let (top, bottom) = (a.rows(0, half), a.rows(half, rest));
    let (top_transposed, bottom_transposed) = (top.transpose(), bottom.transpose());
    sum.view_mut((0, 0), (half, half)).gemm(1.0, &top, &top_transposed, 1.0);
    sum.view_mut((half, 0), (rest, half)).gemm(1.0, &bottom, &top_transposed, 1.0);
    sum.view_mut((half, half), (rest, rest)).gemm(1.0, &bottom, &bottom_transposed, 1.0);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_normal_equations_are_those_of_the_numerical_slope() {
        let samples = 150;
        let input = |i: u32| [f64::from(i % 13) / 6.5 - 1.0, f64::from(i % 7) / 3.5 - 1.0];
        let problem = Samples {
            inputs: (0..samples).map(input).collect(),
            targets: (0..samples).map(|i| [f64::from(i % 5) * 0.2, f64::from(i % 3) * 0.3]).collect(),
        };
        let weights = random_weights(3);
        let n = NETWORK_PARAMETERS;
        let (mut jtj, mut jtr) = (DMatrix::zeros(n, n), DVector::zeros(n));
        let cost = problem.linearise(&weights, &mut jtj, &mut jtr);
        assert!((cost - problem.cost(&weights)).abs() < 1e-9 * cost);
        // The same by differences.
        let residuals = |w: &DVector<f64>| {
            let outputs = problem.inputs.iter().zip(&problem.targets).flat_map(|(input, target)| {
                let output = Nodes::forward(w.as_slice(), *input).output;
                [output[0] - target[0], output[1] - target[1]]
            });
            DVector::from_vec(outputs.collect())
        };
        let columns: Vec<DVector<f64>> = (0..n)
            .map(|i| {
                let moved = |by: f64| {
                    let mut w = weights.clone();
                    w[i] += by;
                    residuals(&w)
                };
                (moved(1e-5) - moved(-1e-5)) / 2e-5
            })
            .collect();
        let jacobian = DMatrix::from_columns(&columns);
        let lower = (jacobian.transpose() * &jacobian).lower_triangle();
        assert!((jtj.lower_triangle() - lower).abs().max() < 1e-6);
        assert!((jtr - jacobian.transpose() * residuals(&weights)).abs().max() < 1e-7);
    }

    #[test]
    fn a_network_of_noise_stays_almost_silent() {
        use rand_distr::{Distribution, StandardNormal};
        let mut rng = ChaCha8Rng::seed_from_u64(9);
        let pixels: Vec<[f64; 2]> = (0..800).map(|i| [f64::from(i % 20), f64::from(i / 20)]).collect();
        let noise: Vec<[f64; 2]> =
            pixels.iter().map(|_| [(); 2].map(|()| StandardNormal.sample(&mut rng))).collect();
        let limits = TrainingLimits { iterations: 200, improvement: 1e-3 };
        let (network, training) = train(&pixels, &noise, Start::Seed(1), limits);
        assert!(training.effective_parameters < 10.0, "{training:?}");
        let loudest = pixels.iter().map(|&p| network.map(p)).map(|[x, y]| x.hypot(y)).fold(0.0, f64::max);
        assert!(loudest < 0.3, "{loudest}");
    }
}
