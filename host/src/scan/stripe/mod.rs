//! Where a laser stripe crosses a line of pixels, to a few hundredths of a pixel.
//!
//! The centre is the zero crossing of the line's convolution with the first derivative of a Gaussian as wide as the
//! stripe: Steger's detector (1998) in one dimension. In white noise that is the best linear estimate, and unlike a fit
//! to the peak it survives saturation, because the flanks carry it. An edge of colour within the stripe biases it like
//! every estimator that sees one image only, by about half the stripe's sigma. The asymmetry tells, once the stripe is wider than the pixels that blur the edge:
//! from a sigma of some 3 pixels on.
mod kernel;
mod line;
mod synthetic;
#[cfg(test)]
mod tests;

pub use line::{LineOutcome, StripeCenter};
pub use synthetic::{AlbedoStep, SyntheticLine};

use image::GrayImage;

use kernel::Kernels;

/// What counts as a stripe.
#[derive(Debug, Clone, PartialEq)]
pub struct StripeSettings {
    /// Least height above the ambient light, grey levels. Six times the line's own noise, over three pixels, is asked for in any case.
    pub min_peak: f64,
    /// Grey level from which a pixel counts as saturated.
    pub saturation: u8,
    /// A second stripe this high, relative to the first, makes the line ambiguous.
    pub ambiguous: f64,
    /// Widest stripe that is trusted, full width at half height.
    pub max_width_px: f64,
    /// Largest asymmetry that is trusted, -1 to 1.
    pub max_asymmetry: f64,
}

impl Default for StripeSettings {
    fn default() -> Self {
        Self { min_peak: 10.0, saturation: 250, ambiguous: 0.5, max_width_px: 24.0, max_asymmetry: 0.25 }
    }
}

/// How the lines that cross the stripe lie in the image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Across {
    /// The stripe runs along the rows: one centre for each column.
    Columns,
    /// The stripe runs along the columns: one centre for each row.
    Rows,
}

/// Finds stripes. Holds the filters, so make one and keep it.
#[derive(Debug, Clone)]
pub struct StripeExtractor {
    settings: StripeSettings,
    kernels: Kernels,
}

/// Columns that are copied at a time: a line of the cache holds as many pixels of a row.
const BLOCK: usize = 64;

impl StripeExtractor {
    /// An extractor with these settings.
    #[must_use]
    pub fn new(settings: StripeSettings) -> Self {
        Self { settings, kernels: Kernels::new() }
    }

    /// The stripe in one line of pixels; positions count from the centre of the first.
    #[must_use]
    pub fn line(&self, pixels: &[u8]) -> LineOutcome {
        line::extract(pixels, &self.settings, &self.kernels, &mut Vec::new())
    }

    /// The stripe in every column, or every row, of an image.
    #[must_use]
    pub fn image(&self, image: &GrayImage, across: Across) -> Vec<LineOutcome> {
        let [width, height] = [image.width() as usize, image.height() as usize];
        if width == 0 || height == 0 {
            return Vec::new();
        }
        let pixels = image.as_raw();
        let mut sums = Vec::new();
        let mut extract = |line: &[u8]| line::extract(line, &self.settings, &self.kernels, &mut sums);
        match across {
            Across::Rows => pixels.chunks_exact(width).map(extract).collect(),
            Across::Columns => {
                let mut outcomes = Vec::with_capacity(width);
                let mut columns = vec![0; BLOCK * height];
                for first in (0..width).step_by(BLOCK) {
                    let count = BLOCK.min(width - first);
                    for (v, row) in pixels.chunks_exact(width).enumerate() {
                        for (column, &pixel) in row[first..first + count].iter().enumerate() {
                            columns[column * height + v] = pixel;
                        }
                    }
                    outcomes.extend(columns.chunks_exact(height).take(count).map(&mut extract));
                }
                outcomes
            }
        }
    }
}

impl Default for StripeExtractor {
    fn default() -> Self {
        Self::new(StripeSettings::default())
    }
}
