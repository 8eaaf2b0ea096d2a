//! Calibration of a camera against the laser plane: from the pixel of a stripe to metres in that plane.
//!
//! The paper trains a network on marker pairs and says nothing of its error. Here the same network competes with a
//! physical model, and with the physical model corrected by a network on its residual. Rows of markers that none of
//! them has seen decide; a more elaborate model must win beyond chance, because where the optics are ordinary a
//! network only learns noise. A calibration refuses pixels outside the hull of its markers: there a network, and
//! to a lesser degree any model, invents.
mod cmm;
mod file;
mod hull;
mod markers;
mod model;
mod network;
mod physical;
mod scaling;
mod select;
#[cfg(test)]
mod tests;

pub use cmm::{Bench, BenchCamera, Verification};
pub use file::CalibrationFileError;
pub use hull::Hull;
pub use markers::{MarkersError, parse_markers};
pub use model::{Model, ModelKind};
pub use network::{NETWORK_PARAMETERS, Network};
pub use physical::{PHYSICAL_PARAMETERS, PhysicalModel};
pub use select::{CalibrateError, CalibrateSettings, Calibrated, Candidate, Errors, Fit, calibrate};

use serde::{Deserialize, Serialize};

/// A marker whose place is known, and where a camera saw it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MarkerPair {
    /// u along the stripe and v across it.
    pub pixel: [f64; 2],
    /// In the laser plane: x along the stripe, y away from the laser.
    pub target_m: [f64; 2],
    /// Position of the pattern; rows are held out as a whole.
    pub row: u32,
}

/// What a camera's pixels mean in the laser plane.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    model: Model,
    /// Of the markers' pixels.
    hull: Hull,
}

/// What a calibration says of a pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Evaluation {
    /// Point of the laser plane, metres: x along the stripe, y away from the laser.
    Point([f64; 2]),
    /// The pixel is outside the hull of the markers' pixels. There is no margin: a marker's own pixel is just inside.
    OutsideHull {
        /// How far.
        distance_px: f64,
    },
    /// The model has no answer; the calibration does not come from [`calibrate`], which checks this.
    Singular,
}

impl Calibration {
    /// Measures a pixel.
    #[must_use]
    pub fn evaluate(&self, pixel: [f64; 2]) -> Evaluation {
        let distance_px = self.hull.distance_px(pixel);
        if distance_px > 0.0 {
            return Evaluation::OutsideHull { distance_px };
        }
        self.model.map(pixel).map_or(Evaluation::Singular, Evaluation::Point)
    }

    /// The model, which answers outside the hull too: for comparisons, not for measuring.
    #[must_use]
    pub const fn model(&self) -> &Model {
        &self.model
    }

    /// Where the calibration holds.
    #[must_use]
    pub const fn hull(&self) -> &Hull {
        &self.hull
    }
}
