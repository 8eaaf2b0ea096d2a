//! From the units of the data to about -1..1, where networks and solvers are at ease.

use serde::{Deserialize, Serialize};

/// An affine map of the plane: shift, then one scale for both axes, so that distances keep their proportions.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct Scaling {
    pub(super) center: [f64; 2],
    pub(super) half: f64,
}

impl Scaling {
    /// Takes the longer side of the points' box to -1..1. Of no points, or of one: no scale.
    pub(super) fn of(points: &[[f64; 2]]) -> Self {
        let bounds = |axis: usize| {
            let values = points.iter().map(|p| p[axis]);
            (values.clone().fold(f64::INFINITY, f64::min), values.fold(f64::NEG_INFINITY, f64::max))
        };
        let [(low_x, high_x), (low_y, high_y)] = [bounds(0), bounds(1)];
        let half = 0.5 * (high_x - low_x).max(high_y - low_y);
        if half > 0.0 && half.is_finite() {
            Self { center: [0.5 * (low_x + high_x), 0.5 * (low_y + high_y)], half }
        } else {
            Self { center: points.first().copied().unwrap_or_default(), half: 1.0 }
        }
    }

    /// To scaled units.
    pub(super) fn shrink(self, point: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|axis| (point[axis] - self.center[axis]) / self.half)
    }

    /// Back to the units of the data.
    pub(super) fn expand(self, point: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|axis| self.center[axis] + point[axis] * self.half)
    }
}
