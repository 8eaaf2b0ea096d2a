//! What a camera of the scanner sees of the laser's stripe: an image, for the extractor to read.
//!
//! The laser sheet has a thickness, and is cast as several thin sheets of Gaussian weight: a spot that lies half beyond
//! an edge, half in a shadow, or on a slope looks as it should without being told.

use image::{GrayImage, Luma};
use nalgebra::{Isometry3, Point3, Unit, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::cast::Scene;
use super::instrument::{Camera, Instrument};
use super::virtual_scan::ScanError;
use crate::surface::{Mesh, Plane};

/// Light, lens and sensor, beyond the geometry of the [`Instrument`].
#[derive(Debug, Clone, PartialEq)]
pub struct Optics {
    /// Standard deviation of the laser sheet's thickness.
    pub spot_sigma_m: f64,
    /// How far the middle of the sheet stands out of its plane, towards +x; it returns to it at the ends of the fan.
    pub bow_m: f64,
    /// Standard deviation of the lens's blur.
    pub blur_px: f64,
    /// Brown's k1, k2, p1, p2, on image coordinates over focal length.
    pub distortion: [f64; 4],
    /// Grey level at the middle of the stripe on a white surface that faces the laser at the stand-off. Above 255 it
    /// saturates.
    pub exposure: f64,
    /// Grey level without the laser.
    pub ambient: f64,
    /// Standard deviation of the speckle over its mean; independent from one spot of the stripe to the next.
    pub speckle: f64,
    /// Electrons of a grey level; 0 for no shot noise.
    pub electrons_per_level: f64,
    /// Noise of the read-out, grey levels.
    pub read_noise: f64,
}

impl Default for Optics {
    /// A line 1 mm wide (four sigma), an ordinary lens, and a noisy camera. Assumed.
    fn default() -> Self {
        Self {
            spot_sigma_m: 0.00025,
            bow_m: 0.0,
            blur_px: 0.7,
            distortion: [-0.2, 0.05, 5e-4, -3e-4],
            exposure: 200.0,
            ambient: 5.0,
            speckle: 0.15,
            electrons_per_level: 10.0,
            read_noise: 2.5,
        }
    }
}

impl Optics {
    fn is_sound(&self) -> bool {
        let Self {
            spot_sigma_m, blur_px, exposure, ambient, speckle, electrons_per_level, read_noise, ..
        } = *self;
        let amounts = [spot_sigma_m, blur_px, exposure, ambient, speckle, electrons_per_level, read_noise];
        amounts.iter().all(|x| x.is_finite() && *x >= 0.0)
            && self.distortion.iter().chain([&self.bow_m]).all(|x| x.is_finite())
    }
}

/// Thin sheets on each side of the middle one, out to so many sigma.
const HALF_SHEETS: i32 = 4;
const SHEETS_REACH: f64 = 2.0;
/// Rays of a sheet per pixel along the stripe.
const RAYS_PER_PIXEL: f64 = 1.0;
/// More are not a camera's.
const MAX_RAYS: f64 = 1e5;
const MAX_PIXELS: u64 = 100_000_000;
/// Neighbouring rays whose images are farther apart lie on different surfaces.
const MAX_GAP_PX: f64 = 4.0;
/// Where a thin sheet's profile is cut off, in sigma.
const REACH: f64 = 4.0;

/// Renders exposures of one scene.
pub struct Renderer {
    scene: Scene,
    instrument: Instrument,
    optics: Optics,
    /// Offset, share of the light, and direction of each ray, for each thin sheet.
    sheets: Vec<Sheet>,
    /// Profile of a thin sheet in the image.
    sigma_px: f64,
}

/// One of the thin sheets that make up the laser's.
struct Sheet {
    level: f64,
    /// Origin and direction of neighbouring rays, scanner frame.
    rays: Vec<(Point3<f64>, Vector3<f64>)>,
}

/// A place that a thin sheet lights, as the camera sees it.
struct Lit {
    pixel: [f64; 2],
    level: f64,
}

impl Renderer {
    /// Prepares to render `object` (base frame) on `table`, if any.
    ///
    /// # Errors
    /// [`ScanError::NoObject`], and [`ScanError::Instrument`] when a value of the instrument or the optics is not finite
    /// or makes no sense.
    pub fn new(
        object: &Mesh,
        table: Option<Plane>,
        instrument: &Instrument,
        optics: &Optics,
    ) -> Result<Self, ScanError> {
        let scene = Scene::new(object, table).ok_or(ScanError::NoObject)?;
        let scale_px = instrument.focal_m
            / (instrument.pixel_m * instrument.stand_off_m.hypot(instrument.camera_offset_m));
        let pitch_m = 2.0 * SHEETS_REACH * optics.spot_sigma_m / f64::from(2 * HALF_SHEETS);
        // Profiles half as wide as their distance at least, so that they add up to a smooth one.
        let sigma_px = optics.blur_px.hypot(0.5 * pitch_m * scale_px).max(0.3);
        let half_width_m = instrument.stand_off_m * (0.5 * instrument.fan_rad).tan();
        let rays = (2.0 * half_width_m * scale_px * RAYS_PER_PIXEL).ceil();
        let [width, height] = instrument.pixels.map(u64::from);
        if !(rays > 0.0 && rays < MAX_RAYS && width * height <= MAX_PIXELS && optics.is_sound()) {
            return Err(ScanError::Instrument);
        }
        let offsets = || (-HALF_SHEETS..=HALF_SHEETS).map(f64::from);
        let weight = |sheet: f64| (-0.5 * (SHEETS_REACH * sheet / f64::from(HALF_SHEETS)).powi(2)).exp();
        // So that the middle of the sum of all profiles is the exposure.
        let middle: f64 =
            offsets().map(|s| weight(s) * (-0.5 * (s * pitch_m * scale_px / sigma_px).powi(2)).exp()).sum();
        let sheet = |sheet: f64| {
            let ray = |i: u32| {
                let across = 2.0 * f64::from(i) / rays - 1.0;
                let x = sheet * pitch_m + optics.bow_m * (1.0 - across * across);
                let direction = Vector3::new(0.0, across * half_width_m, instrument.stand_off_m);
                (Point3::new(x, 0.0, 0.0), direction.normalize())
            };
            Sheet {
                level: optics.exposure * weight(sheet) / middle,
                rays: (0..=rays as u32).map(ray).collect(),
            }
        };
        let sheets = offsets().map(sheet).collect();
        Ok(Self { scene, instrument: instrument.clone(), optics: optics.clone(), sheets, sigma_px })
    }

    /// One exposure of one camera, the scanner at `base_from_scanner`. Pixels count from the centre of the first; the
    /// stripe runs along the rows. The same seed gives the same image.
    #[must_use]
    pub fn exposure(&self, base_from_scanner: &Isometry3<f64>, camera: Camera, seed: u64) -> GrayImage {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let [width, height] = self.instrument.pixels;
        let mut light = Light { width, height, levels: vec![0.0; width as usize * height as usize] };
        for sheet in &self.sheets {
            let mut before = None;
            for ray in &sheet.rays {
                let lit = self.cast(base_from_scanner, ray, camera).map(|Lit { pixel, level }| {
                    let speckle: f64 = StandardNormal.sample(&mut rng);
                    let level = level * sheet.level * (1.0 + self.optics.speckle * speckle).max(0.0);
                    Lit { pixel, level }
                });
                if let (Some(a), Some(b)) = (&before, &lit) {
                    light.add(a, b, self.sigma_px);
                }
                before = lit;
            }
        }
        light.expose(&self.optics, &mut rng)
    }

    /// What a ray lights, when the camera sees it; its level is relative to a white surface that faces the laser.
    fn cast(
        &self,
        base_from_scanner: &Isometry3<f64>,
        (origin, direction): &(Point3<f64>, Vector3<f64>),
        camera: Camera,
    ) -> Option<Lit> {
        let (origin_in_base, direction_in_base) = (base_from_scanner * origin, base_from_scanner * direction);
        let hit = self.scene.hit(&origin_in_base, &direction_in_base)?;
        let lit = origin_in_base + direction_in_base * hit.distance_m;
        let center = base_from_scanner * self.instrument.camera_center(camera);
        let to_camera = Unit::new_normalize(center - lit);
        let facing = -hit.normal.dot(&direction_in_base);
        if facing <= 0.0 || hit.normal.dot(&to_camera) <= 0.0 || !self.scene.is_clear(&center, &lit) {
            return None;
        }
        let image = self.instrument.project(camera, &(origin + direction * hit.distance_m))?;
        let focal_px = self.instrument.focal_m / self.instrument.pixel_m;
        let distorted = distort(image.map(|x| x / focal_px), &self.optics.distortion);
        let pixel = [0, 1]
            .map(|axis| focal_px * distorted[axis] + 0.5 * (f64::from(self.instrument.pixels[axis]) - 1.0));
        // A diffuse surface spreads the laser's power over a larger spot when it leans.
        let level = facing * (self.instrument.stand_off_m / hit.distance_m);
        Some(Lit { pixel, level })
    }
}

/// Brown's distortion.
fn distort([a, b]: [f64; 2], &[k1, k2, p1, p2]: &[f64; 4]) -> [f64; 2] {
    let r2 = a * a + b * b;
    let radial = 1.0 + r2 * (k1 + r2 * k2);
    [
        a * radial + 2.0 * p1 * a * b + p2 * (r2 + 2.0 * a * a),
        b * radial + p1 * (r2 + 2.0 * b * b) + 2.0 * p2 * a * b,
    ]
}

/// Light that falls on the sensor, in grey levels, row by row.
struct Light {
    width: u32,
    height: u32,
    levels: Vec<f64>,
}

impl Light {
    /// Adds the piece of a thin sheet between two neighbouring places.
    fn add(&mut self, a: &Lit, b: &Lit, sigma_px: f64) {
        let gap = (b.pixel[0] - a.pixel[0]).hypot(b.pixel[1] - a.pixel[1]);
        if gap > MAX_GAP_PX {
            return;
        }
        let (left, right) = if a.pixel[0] <= b.pixel[0] { (a, b) } else { (b, a) };
        let first = left.pixel[0].ceil().max(0.0) as u32;
        for u in first..self.width {
            let along = f64::from(u) - left.pixel[0];
            let length = right.pixel[0] - left.pixel[0];
            // A column at the seam belongs to the next piece.
            if along >= length {
                break;
            }
            let share = along / length;
            let v = left.pixel[1] + share * (right.pixel[1] - left.pixel[1]);
            let level = left.level + share * (right.level - left.level);
            let reach = REACH * sigma_px;
            let from = (v - reach).ceil().max(0.0) as u32;
            for row in from..self.height {
                let x = (f64::from(row) - v) / sigma_px;
                if x > REACH {
                    break;
                }
                self.levels[row as usize * self.width as usize + u as usize] += level * (-0.5 * x * x).exp();
            }
        }
    }

    /// Reads the sensor.
    fn expose(&self, optics: &Optics, rng: &mut ChaCha8Rng) -> GrayImage {
        let mut pixels = self.levels.iter().map(|&level| {
            let level = level + optics.ambient;
            let shot =
                if optics.electrons_per_level > 0.0 { level / optics.electrons_per_level } else { 0.0 };
            let noise: f64 = StandardNormal.sample(rng);
            (level + noise * (optics.read_noise.powi(2) + shot).sqrt()).round().clamp(0.0, 255.0) as u8
        });
        GrayImage::from_fn(self.width, self.height, |_, _| Luma([pixels.next().unwrap_or_default()]))
    }
}

#[cfg(test)]
mod tests;
