//! Robust losses of a residual: how much it counts, given the scale of ordinary ones.

/// A loss, scaled so that small residuals cost their square.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Loss {
    /// Grows without bound, so that far ones still pull: for the way to the minimum.
    Cauchy { width_m: f64 },
    /// Tukey's biweight: beyond the width a residual counts nothing.
    Tukey { width_m: f64 },
}

/// Widths in standard deviations at which a loss loses 5 % against plain squares on Gaussian noise (Holland and Welsch
/// 1977).
const CAUCHY_WIDTH: f64 = 2.3849;
const TUKEY_WIDTH: f64 = 4.6851;

impl Loss {
    pub(super) fn cauchy(scale_m: f64) -> Self {
        Self::Cauchy { width_m: CAUCHY_WIDTH * scale_m }
    }

    pub(super) fn tukey(scale_m: f64) -> Self {
        Self::Tukey { width_m: TUKEY_WIDTH * scale_m }
    }

    pub(super) fn cost(self, residual_m: f64) -> f64 {
        match self {
            Self::Cauchy { width_m } => width_m * width_m * (residual_m / width_m).powi(2).ln_1p(),
            Self::Tukey { width_m } => {
                let inside = (1.0 - (residual_m / width_m).powi(2)).max(0.0);
                width_m * width_m / 3.0 * (1.0 - inside.powi(3))
            }
        }
    }

    /// Half the derivative of the cost, over the residual.
    pub(super) fn weight(self, residual_m: f64) -> f64 {
        match self {
            Self::Cauchy { width_m } => 1.0 / (1.0 + (residual_m / width_m).powi(2)),
            Self::Tukey { width_m } => (1.0 - (residual_m / width_m).powi(2)).max(0.0).powi(2),
        }
    }

    /// Half the second derivative of the cost.
    pub(super) fn curvature(self, residual_m: f64) -> f64 {
        match self {
            Self::Cauchy { width_m } => {
                let square = (residual_m / width_m).powi(2);
                (1.0 - square) / (1.0 + square).powi(2)
            }
            Self::Tukey { width_m } => {
                let square = (residual_m / width_m).powi(2);
                if square < 1.0 { (1.0 - square) * (1.0 - 5.0 * square) } else { 0.0 }
            }
        }
    }
}

/// Smallest scale of noise that is believed: below it, arithmetic shows.
const LEAST_SCALE_M: f64 = 1e-9;

/// Standard deviation of Gaussian noise with this median of its absolute values; up to half may be anything.
pub(super) fn robust_scale_m(mut residuals_m: Vec<f64>) -> f64 {
    if residuals_m.is_empty() {
        return LEAST_SCALE_M;
    }
    residuals_m.iter_mut().for_each(|residual| *residual = residual.abs());
    let middle = residuals_m.len() / 2;
    let (_, median, _) = residuals_m.select_nth_unstable_by(middle, f64::total_cmp);
    (1.4826 * *median).max(LEAST_SCALE_M)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weight_and_curvature_are_derivatives_of_the_cost() {
        let h = 1e-6;
        for loss in [Loss::cauchy(0.7), Loss::tukey(0.7)] {
            for r in [-4.0, -2.0, -0.3, 0.1, 1.0, 2.5, 3.2, 5.0] {
                let slope = (loss.cost(r + h) - loss.cost(r - h)) / (2.0 * h);
                assert!((loss.weight(r) * r - 0.5 * slope).abs() < 1e-7, "{loss:?} {r}");
                let pull = |r: f64| loss.weight(r) * r;
                let bend = (pull(r + h) - pull(r - h)) / (2.0 * h);
                assert!((loss.curvature(r) - bend).abs() < 1e-6, "{loss:?} {r}");
            }
            assert!((loss.cost(1e-4) - 1e-8).abs() < 1e-14);
        }
    }

    #[test]
    fn the_scale_is_gaussian_and_robust() {
        // Quantiles of the normal distribution at 0.05, 0.15, ... 0.95, and two that are anything.
        let mut normal = vec![-1.645, -1.036, -0.674, -0.385, -0.126, 0.126, 0.385, 0.674, 1.036, 1.645];
        assert!((robust_scale_m(normal.clone()) - 1.0).abs() < 0.01);
        normal[0] = 1e6;
        assert!((robust_scale_m(normal) - 1.0).abs() < 0.01);
        assert_eq!(robust_scale_m(Vec::new()), LEAST_SCALE_M);
    }
}
