//! One line of pixels: find the stripe, measure its width, and take the zero crossing of the matched derivative.

use super::StripeSettings;
use super::kernel::{Kernel, Kernels};

/// A stripe's centre and what tells how far to trust it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StripeCenter {
    /// From the centre of the line's first pixel.
    pub position_px: f64,
    /// Full width at half height.
    pub width_px: f64,
    /// Height above the ambient light, mean of three pixels, grey levels.
    pub peak: f64,
    /// How much steeper the flank after the centre is than the one before: their difference over their sum, -1 to 1.
    /// Away from 0 on edges, steps of colour, and reflections that touch the stripe.
    pub asymmetry: f64,
    /// Saturated pixels within the width.
    pub saturated_px: u32,
}

/// What a line of pixels shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LineOutcome {
    /// One stripe of trusted shape.
    Stripe(StripeCenter),
    /// One stripe, wider or more lopsided than the settings trust.
    Misshapen(StripeCenter),
    /// Two stripes of comparable height, the higher first: a reflection, which may be either.
    Ambiguous([StripeCenter; 2]),
    /// A stripe that runs off the end of the line.
    CutOff,
    /// Nothing that stands out of the noise.
    Dark,
}

impl LineOutcome {
    /// The centre, when it is single and trusted.
    #[must_use]
    pub const fn center(&self) -> Option<&StripeCenter> {
        match self {
            Self::Stripe(center) => Some(center),
            Self::Misshapen(_) | Self::Ambiguous(_) | Self::CutOff | Self::Dark => None,
        }
    }
}

/// Noise that a stripe must stand out of, in standard deviations. A line has some 500 chances to be wrong.
const STAND_OUT: f64 = 6.0;
/// Full width at half height of a Gaussian, in sigma.
const FULL_WIDTH: f64 = 2.354_820_045;
/// The filter's width over the stripe's. Where the stripe is bright, so is its noise: the feet deserve more weight than a
/// matched filter gives them.
const FILTER_WIDTH: f64 = 1.15;
/// The same for the flanks' slopes: a matched filter would round off what it should compare.
const FLANK_FILTER_WIDTH: f64 = 0.6;
/// Variance that the mean of three pixels adds to a stripe's width.
const THREE_PIXEL_VARIANCE: f64 = 2.0 / 3.0;
/// Every fourth pixel is enough to know the ambient light.
const AMBIENT_STRIDE: usize = 4;
/// Shortest line in which ambient light and stripe can be told apart.
const MIN_PIXELS: usize = 16;

/// `sums` is scratch.
pub(super) fn extract(
    pixels: &[u8],
    settings: &StripeSettings,
    kernels: &Kernels,
    sums: &mut Vec<i16>,
) -> LineOutcome {
    if pixels.len() < MIN_PIXELS {
        return LineOutcome::Dark;
    }
    let ambient = Ambient::of(pixels);
    sums.clear();
    // sums[i] is centred on pixel i + 1.
    sums.extend(pixels.windows(3).map(|w| i16::from(w[0]) + i16::from(w[1]) + i16::from(w[2])));
    let least = settings.min_peak.max(STAND_OUT * ambient.noise / 3_f64.sqrt());
    let finder = Finder { pixels, sums, ambient: ambient.level, settings, kernels };
    let Some(first) = finder.highest(0..sums.len(), least) else {
        return LineOutcome::Dark;
    };
    let Some(flanks) = finder.flanks(&first) else {
        return LineOutcome::CutOff;
    };
    let center = finder.center(&first, &flanks);
    // Look for a second stripe a width away from the first.
    let width = flanks.width().ceil() as usize;
    let before = 0..(flanks.low as usize).saturating_sub(width + 1);
    let after = (flanks.high as usize + width).min(sums.len())..sums.len();
    let least = least.max(settings.ambiguous * first.height);
    let rivals = [before, after].into_iter().filter_map(|range| finder.highest(range, least));
    let rival = rivals.reduce(|best, next| if next.height > best.height { next } else { best });
    match rival.map(|rival| finder.flanks(&rival).map(|flanks| finder.center(&rival, &flanks))) {
        Some(Some(rival)) => LineOutcome::Ambiguous([center, rival]),
        Some(None) => LineOutcome::CutOff,
        None if center.width_px > settings.max_width_px
            || center.asymmetry.abs() > settings.max_asymmetry =>
        {
            LineOutcome::Misshapen(center)
        }
        None => LineOutcome::Stripe(center),
    }
}

/// Light without the stripe.
struct Ambient {
    level: f64,
    noise: f64,
}

impl Ambient {
    /// Median, and the standard deviation that the darker half shows: the stripe is in the brighter one.
    fn of(pixels: &[u8]) -> Self {
        let mut histogram = [0_u32; 256];
        for &pixel in pixels.iter().step_by(AMBIENT_STRIDE) {
            histogram[usize::from(pixel)] += 1;
        }
        let count: u32 = histogram.iter().sum();
        let quantile = |share: f64| {
            let wanted = share * f64::from(count);
            let mut below = 0.0;
            for (level, &here) in (0_u32..).zip(&histogram) {
                let here = f64::from(here);
                if below + here >= wanted {
                    // Within a level, as if its pixels were spread over it.
                    return f64::from(level) - 0.5 + (wanted - below) / here.max(1.0);
                }
                below += here;
            }
            255.0
        };
        let median = quantile(0.5);
        Self { level: median.max(0.0), noise: median - quantile(0.159) }
    }
}

struct Finder<'a> {
    pixels: &'a [u8],
    /// Of three pixels each.
    sums: &'a [i16],
    ambient: f64,
    settings: &'a StripeSettings,
    kernels: &'a Kernels,
}

/// A highest place among the sums.
struct Peak {
    at: usize,
    height: f64,
}

/// Where a stripe falls below half its height, pixels.
struct Flanks {
    low: f64,
    high: f64,
}

impl Flanks {
    fn width(&self) -> f64 {
        self.high - self.low
    }
}

impl Finder<'_> {
    fn height(&self, at: usize) -> f64 {
        f64::from(self.sums[at]) / 3.0 - self.ambient
    }

    fn highest(&self, range: std::ops::Range<usize>, least: f64) -> Option<Peak> {
        let sums = self.sums.get(range.clone())?;
        let highest = sums.iter().fold(0, |highest, &sum| sum.max(highest));
        let at = range.start + sums.iter().position(|&sum| sum == highest)?;
        let height = self.height(at);
        (height >= least).then_some(Peak { at, height })
    }

    /// `None` when a flank lies beyond the line.
    fn flanks(&self, peak: &Peak) -> Option<Flanks> {
        let half = 0.5 * peak.height;
        let high = (peak.at..self.sums.len()).find(|&i| self.height(i) < half)?;
        let low = (0..peak.at).rev().find(|&i| self.height(i) < half)?;
        let crossing = |outside: usize, inside: usize| {
            let (a, b) = (self.height(outside), self.height(inside));
            let share = (half - a) / (b - a);
            // The first sum is centred on the second pixel.
            1.0 + outside as f64 + share * (inside as f64 - outside as f64)
        };
        Some(Flanks { low: crossing(low, low + 1), high: crossing(high, high - 1) })
    }

    fn center(&self, peak: &Peak, flanks: &Flanks) -> StripeCenter {
        let sigma = ((flanks.width() / FULL_WIDTH).powi(2) - THREE_PIXEL_VARIANCE).max(0.0).sqrt();
        let position_px = self.zero_crossing(FILTER_WIDTH * sigma, flanks);
        let within = &self.pixels[flanks.low.ceil() as usize..=flanks.high.floor() as usize];
        let saturated = within.iter().filter(|&&pixel| pixel >= self.settings.saturation).count();
        StripeCenter {
            position_px,
            width_px: flanks.width(),
            peak: peak.height,
            asymmetry: self.asymmetry(FLANK_FILTER_WIDTH * sigma, flanks),
            saturated_px: saturated as u32,
        }
    }

    /// Where the filtered line falls through zero most steeply between the flanks; their middle if it does nowhere.
    fn zero_crossing(&self, sigma_px: f64, flanks: &Flanks) -> f64 {
        let kernel = self.kernels.matched(sigma_px);
        // A response on each side of the flanks, and one more for the interpolation.
        let (first, responses) = self.responses(kernel, flanks, 2.0);
        let falls = responses.windows(4).enumerate().filter(|(_, w)| w[1] > 0.0 && w[2] <= 0.0);
        let steepest = falls.reduce(
            |best, next| {
                if next.1[1] - next.1[2] > best.1[1] - best.1[2] { next } else { best }
            },
        );
        match steepest {
            Some((i, window)) => (first + 1 + i as isize) as f64 + cubic_zero(window),
            None => 0.5 * (flanks.low + flanks.high),
        }
    }

    fn asymmetry(&self, sigma_px: f64, flanks: &Flanks) -> f64 {
        // The steepest places are no farther than half a width beyond the flanks.
        let (_, responses) = self.responses(self.kernels.matched(sigma_px), flanks, 0.5 * flanks.width());
        let rise = f64::from(responses.iter().fold(0.0_f32, |most, &r| most.max(r)));
        let fall = f64::from(responses.iter().fold(0.0_f32, |most, &r| most.max(-r)));
        // Without any slope there is no side to lean to.
        (fall - rise) / (fall + rise).max(f64::MIN_POSITIVE)
    }

    /// Responses from `beyond` before the flanks to as far after them, and the pixel of the first.
    fn responses(&self, kernel: &Kernel, flanks: &Flanks, beyond: f64) -> (isize, Vec<f32>) {
        let first = (flanks.low - beyond).floor() as isize;
        let last = (flanks.high + beyond).ceil() as isize;
        (first, (first..=last).map(|at| self.response(kernel, at)).collect())
    }

    /// Convolution at a pixel; beyond the line's ends there is ambient light.
    fn response(&self, kernel: &Kernel, at: isize) -> f32 {
        let start = at - kernel.radius() as isize;
        let whole = usize::try_from(start).ok().and_then(|s| self.pixels.get(s..s + kernel.taps.len()));
        if let Some(window) = whole {
            // The taps add up to zero: no need to subtract the ambient light.
            return window.iter().zip(&kernel.taps).map(|(&pixel, tap)| f32::from(pixel) * tap).sum();
        }
        let taps = (start..).zip(&kernel.taps);
        taps.map(|(i, tap)| {
            let pixel = usize::try_from(i).ok().and_then(|i| self.pixels.get(i));
            pixel.map_or(self.ambient as f32, |&pixel| f32::from(pixel)) * tap
        })
        .sum()
    }
}

/// Zero between the second and the third of four values one apart, counted from the second; the second is positive, the
/// third is not.
fn cubic_zero(values: &[f32]) -> f64 {
    let [a, b, c, d] = [0, 1, 2, 3].map(|i| f64::from(values[i]));
    // Lagrange's cubic through -1, 0, 1, 2 by powers.
    let third = (d - a) / 6.0 + (b - c) / 2.0;
    let second = (a + c) / 2.0 - b;
    let first = c - d / 6.0 - a / 3.0 - b / 2.0;
    let mut zero = b / (b - c);
    for _ in 0..3 {
        let slope = first + zero * (2.0 * second + zero * 3.0 * third);
        // A response that does not fall is no place for Newton's step.
        if slope < 0.0 {
            let value = b + zero * (first + zero * (second + zero * third));
            zero = (zero - value / slope).clamp(0.0, 1.0);
        }
    }
    zero
}
