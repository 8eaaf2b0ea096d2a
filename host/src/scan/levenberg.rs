//! Levenberg-Marquardt on the normal equations, with an optional prior that pulls the parameters to zero.
//!
//! Damping after Nielsen (1999): the ratio of the real to the promised decrease rules it, so that it needs no tuning.

use nalgebra::{DMatrix, DVector};

/// A sum of squares of residuals over some parameters.
pub(super) trait LeastSquares {
    /// The sum of squares alone. Not finite where the parameters make no sense.
    fn cost(&self, parameters: &DVector<f64>) -> f64;

    /// Fills the lower triangle of J^T J, and J^T r, J the Jacobian of the residuals r, and returns the sum of squares.
    fn linearise(&self, parameters: &DVector<f64>, jtj: &mut DMatrix<f64>, jtr: &mut DVector<f64>) -> f64;
}

/// What one iteration did.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Step {
    /// The penalised cost fell by this share of itself.
    Improved(f64),
    /// No step of any length improves: a minimum, as far as the arithmetic can tell.
    Stuck,
}

/// An iterate: parameters, and the linearised problem around them.
pub(super) struct Levenberg {
    pub(super) parameters: DVector<f64>,
    /// Sum of squares of the residuals, without the prior.
    pub(super) cost: f64,
    /// J^T J at `parameters`, lower triangle.
    pub(super) jtj: DMatrix<f64>,
    /// Weight of the prior: `decay` times the sum of squares of the parameters is added to the cost.
    pub(super) decay: f64,
    jtr: DVector<f64>,
    damping: f64,
    growth: f64,
}

/// Damping at the start, of the largest diagonal element.
const START_DAMPING: f64 = 1e-3;
/// Trials within one iteration; the damping grows beyond any scale long before.
const MAX_TRIALS: u32 = 40;

impl Levenberg {
    pub(super) fn new(problem: &impl LeastSquares, parameters: DVector<f64>, decay: f64) -> Self {
        let n = parameters.len();
        let (mut jtj, mut jtr) = (DMatrix::zeros(n, n), DVector::zeros(n));
        let cost = problem.linearise(&parameters, &mut jtj, &mut jtr);
        let damping = START_DAMPING * (jtj.diagonal().max() + decay);
        Self { parameters, cost, jtj, decay, jtr, damping, growth: 2.0 }
    }

    /// Sum of squares with the prior's share.
    pub(super) fn penalised(&self) -> f64 {
        self.cost + self.decay * self.parameters.norm_squared()
    }

    /// One iteration: solves, tries, damps more until the cost falls, and linearises anew.
    pub(super) fn step(&mut self, problem: &impl LeastSquares) -> Step {
        let before = self.penalised();
        let gradient = &self.jtr + &self.parameters * self.decay;
        for _ in 0..MAX_TRIALS {
            if !self.damping.is_finite() {
                return Step::Stuck;
            }
            let mut damped = self.jtj.clone();
            for i in 0..damped.nrows() {
                damped[(i, i)] += self.decay + self.damping;
            }
            if let Some(factor) = damped.cholesky() {
                let step = -factor.solve(&gradient);
                let trial = &self.parameters + &step;
                let after = problem.cost(&trial) + self.decay * trial.norm_squared();
                let promised = step.dot(&(&step * self.damping - &gradient));
                if after < before {
                    let ratio = (before - after) / promised;
                    self.damping *= (1.0 - (2.0 * ratio - 1.0).powi(3)).max(1.0 / 3.0);
                    self.growth = 2.0;
                    self.parameters = trial;
                    self.cost = problem.linearise(&self.parameters, &mut self.jtj, &mut self.jtr);
                    return Step::Improved((before - after) / before);
                }
                // Nothing left to gain but rounding.
                if promised <= f64::EPSILON * before {
                    return Step::Stuck;
                }
            }
            self.damping *= self.growth;
            self.growth *= 2.0;
        }
        Step::Stuck
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rosenbrock's valley: residuals 10 (y - x^2) and 1 - x.
    struct Valley;

    impl LeastSquares for Valley {
        fn cost(&self, p: &DVector<f64>) -> f64 {
            (10.0 * (p[1] - p[0] * p[0])).powi(2) + (1.0 - p[0]).powi(2)
        }

        fn linearise(&self, p: &DVector<f64>, jtj: &mut DMatrix<f64>, jtr: &mut DVector<f64>) -> f64 {
            let jacobian = DMatrix::from_row_slice(2, 2, &[-20.0 * p[0], 10.0, -1.0, 0.0]);
            let residual = DVector::from_vec(vec![10.0 * (p[1] - p[0] * p[0]), 1.0 - p[0]]);
            jtj.copy_from(&(jacobian.transpose() * &jacobian));
            jtr.copy_from(&(jacobian.transpose() * residual));
            self.cost(p)
        }
    }

    fn minimise(decay: f64) -> (Levenberg, u32) {
        let mut fit = Levenberg::new(&Valley, DVector::from_vec(vec![-1.2, 1.0]), decay);
        let mut iterations = 0;
        while fit.step(&Valley) != Step::Stuck {
            iterations += 1;
        }
        (fit, iterations)
    }

    #[test]
    fn finds_the_end_of_the_valley() {
        let (fit, iterations) = minimise(0.0);
        assert!((&fit.parameters - DVector::from_vec(vec![1.0, 1.0])).norm() < 1e-7, "{}", fit.parameters);
        assert!((5..60).contains(&iterations), "{iterations}");
    }

    #[test]
    fn the_prior_pulls_to_zero_and_is_stationary() {
        let (fit, _) = minimise(0.1);
        assert!(fit.parameters.norm() < 1.3);
        // No neighbour is better: a real minimum of the penalised cost.
        for delta in [[1e-4, 0.0], [-1e-4, 0.0], [0.0, 1e-4], [0.0, -1e-4]] {
            let p = &fit.parameters + DVector::from_row_slice(&delta);
            assert!(Valley.cost(&p) + 0.1 * p.norm_squared() > fit.penalised());
        }
    }

    #[test]
    fn parameters_without_sense_stop_at_once() {
        let mut fit = Levenberg::new(&Valley, DVector::from_vec(vec![f64::NAN, 1.0]), 0.0);
        assert_eq!(fit.step(&Valley), Step::Stuck);
    }
}
