//! First derivatives of Gaussians, sampled, for a range of widths.

/// Filters in steps of 15 % of width; a mismatch of half a step costs nothing that can be measured.
#[derive(Debug, Clone)]
pub(super) struct Kernels {
    kernels: Vec<Kernel>,
}

/// One filter: taps from -radius to radius.
#[derive(Debug, Clone)]
pub(super) struct Kernel {
    pub(super) taps: Vec<f32>,
}

/// Below a pixel the samples are too few, and wider stripes than the last are no stripes.
const NARROWEST_PX: f64 = 1.0;
const WIDEST_PX: f64 = 12.0;
const STEP: f64 = 1.15;
/// Where the filter is cut off, in sigma.
const REACH: f64 = 3.0;

impl Kernels {
    pub(super) fn new() -> Self {
        let count = ((WIDEST_PX / NARROWEST_PX).ln() / STEP.ln()).ceil() as i32;
        Self { kernels: (0..=count).map(|i| Kernel::new(NARROWEST_PX * STEP.powi(i))).collect() }
    }

    /// The filter for a stripe of this sigma.
    pub(super) fn matched(&self, sigma_px: f64) -> &Kernel {
        let step = ((sigma_px / NARROWEST_PX).max(1.0).ln() / STEP.ln()).round() as usize;
        &self.kernels[step.min(self.kernels.len() - 1)]
    }
}

impl Kernel {
    fn new(sigma_px: f64) -> Self {
        let radius = (REACH * sigma_px).ceil() as i32;
        let tap = |i: i32| {
            let x = f64::from(i) / sigma_px;
            (x * (-0.5 * x * x).exp()) as f32
        };
        Self { taps: (-radius..=radius).map(tap).collect() }
    }

    pub(super) fn radius(&self) -> usize {
        self.taps.len() / 2
    }
}
