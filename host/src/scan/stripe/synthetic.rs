//! A line of pixels across a stripe as a camera delivers it: for tests, benchmarks and the virtual scanner.

use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

/// A Gaussian stripe on ambient light, seen by a camera with shot and read noise that saturates at 255.
#[derive(Debug, Clone, PartialEq)]
pub struct SyntheticLine {
    /// From the centre of the first pixel.
    pub center_px: f64,
    /// Standard deviation of the stripe's profile.
    pub sigma_px: f64,
    /// Height above the ambient light, grey levels; above 255 the stripe saturates.
    pub peak: f64,
    /// Ambient light, grey levels.
    pub ambient: f64,
    /// Noise of the read-out, grey levels.
    pub read_noise: f64,
    /// Electrons of a grey level, whose number is Poisson distributed; 0 for no shot noise.
    pub electrons_per_level: f64,
    /// A change of colour.
    pub albedo_step: Option<AlbedoStep>,
}

/// From `at_px` on the surface reflects `ratio` times as much as before.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AlbedoStep {
    /// From the centre of the first pixel.
    pub at_px: f64,
    /// 1 is no step.
    pub ratio: f64,
}

impl Default for SyntheticLine {
    /// A well exposed stripe in a noisy camera: 10 electrons a grey level, 2.5 grey levels of read noise.
    fn default() -> Self {
        Self {
            center_px: 0.0,
            sigma_px: 1.5,
            peak: 200.0,
            ambient: 5.0,
            read_noise: 2.5,
            electrons_per_level: 10.0,
            albedo_step: None,
        }
    }
}

/// Samples of the profile within a pixel, which integrates over its width.
const SAMPLES: u32 = 5;

impl SyntheticLine {
    /// Mean grey level of a pixel before noise and saturation.
    #[must_use]
    pub fn level(&self, pixel: f64) -> f64 {
        let sample = |i: u32| {
            let at = pixel + (f64::from(i) + 0.5) / f64::from(SAMPLES) - 0.5;
            let x = (at - self.center_px) / self.sigma_px;
            let albedo = self.albedo_step.filter(|step| at >= step.at_px).map_or(1.0, |step| step.ratio);
            albedo * (self.ambient + self.peak * (-0.5 * x * x).exp())
        };
        (0..SAMPLES).map(sample).sum::<f64>() / f64::from(SAMPLES)
    }

    /// Pixels of a line; shot noise is taken as Gaussian.
    pub fn render(&self, pixels: usize, rng: &mut impl Rng) -> Vec<u8> {
        (0..pixels)
            .map(|pixel| {
                let level = self.level(pixel as f64);
                let shot =
                    if self.electrons_per_level > 0.0 { level / self.electrons_per_level } else { 0.0 };
                let noise: f64 = StandardNormal.sample(rng);
                let value = level + noise * (self.read_noise.powi(2) + shot).sqrt();
                value.round().clamp(0.0, 255.0) as u8
            })
            .collect()
    }
}
