//! What the cameras of the scanner see of the laser's stripe: images, for the extractor to read.
//!
//! The laser sheet has a thickness, and is cast as several thin sheets of Gaussian weight: a spot that lies half beyond
//! an edge, half in a shadow, or on a slope looks as it should without being told. A surface with gloss mirrors the middle
//! of the sheet once onto whatever is there, which makes the false stripes of glaze; evenly scattered light that lights
//! its surroundings is left out.

use image::{GrayImage, Luma};
use nalgebra::{Isometry3, Point3, Unit, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::cast::{Body, Hit, Scene};
use super::instrument::{Camera, Instrument};
use super::optics::{Finish, Optics};
use super::virtual_scan::ScanError;
use crate::surface::{Mesh, Plane};

/// Thin sheets on each side of the middle one, out to so many sigma.
const HALF_SHEETS: i32 = 4;
const SHEETS_REACH: f64 = 2.0;
/// Rays of a sheet per pixel along the stripe.
const RAYS_PER_PIXEL: f64 = 1.0;
/// More are not a camera's.
const MAX_RAYS: f64 = 1e5;
const MAX_PIXELS: u64 = 100_000_000;
/// How much wider than at the stand-off, seen from the aperture, the cameras' field is near by and through the lens.
const FIELD_MARGIN: f64 = 1.15;
/// Neighbouring rays whose images are farther apart lie on different surfaces.
const MAX_GAP_PX: f64 = 4.0;
/// Where a thin sheet's profile is cut off, in sigma.
const REACH: f64 = 4.0;
/// Phong's exponent of a highlight: some 7 degrees wide at half height. Normalised, a mirror's light is then
/// (exponent + 2) / 2 times as bright in its middle as if it were scattered evenly.
const HIGHLIGHT_EXPONENT: i32 = 200;
/// A mirrored ray starts this far off the surface.
const CLEARANCE_M: f64 = 1e-6;

/// Rows of a sensor that are read out; all columns are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Window {
    /// First row.
    pub first_row_px: u32,
    /// Number of rows.
    pub rows_px: u32,
}

/// Renders exposures of one scene.
pub struct Renderer {
    scene: Scene,
    instrument: Instrument,
    optics: Optics,
    sheets: Vec<Sheet>,
    /// Which of them is the middle one.
    middle: usize,
    /// Profile of a thin sheet in the image, and of the whole one.
    sigma_px: f64,
    whole_sigma_px: f64,
}

/// One of the thin sheets that make up the laser's.
struct Sheet {
    /// Grey level in the middle of its image.
    level: f64,
    /// Origin and direction of neighbouring rays, scanner frame.
    rays: Vec<(Point3<f64>, Vector3<f64>)>,
}

/// A place that a ray lights.
struct Spot {
    in_base: Point3<f64>,
    in_scanner: Point3<f64>,
    normal: Vector3<f64>,
    /// Light that is scattered evenly, relative to a white surface that faces the laser at the stand-off.
    scattered: f64,
    /// Light that is mirrored, on the same scale, and where to.
    mirrored: f64,
    mirror: Vector3<f64>,
}

/// A place as the camera sees it.
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
        let half_fan_m = instrument.stand_off_m * (0.5 * instrument.fan_rad).tan();
        let half_width_m = half_fan_m.min(0.5 * FIELD_MARGIN * instrument.field_width_m());
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
                let y = (2.0 * f64::from(i) / rays - 1.0) * half_width_m;
                let x = sheet * pitch_m + optics.bow_at_m(y / instrument.stand_off_m, instrument);
                let direction = Vector3::new(0.0, y, instrument.stand_off_m);
                (Point3::new(x, 0.0, 0.0), direction.normalize())
            };
            Sheet {
                level: optics.exposure * weight(sheet) / middle,
                rays: (0..=rays as u32).map(ray).collect(),
            }
        };
        Ok(Self {
            sheets: offsets().map(sheet).collect(),
            middle: HALF_SHEETS as usize,
            sigma_px,
            whole_sigma_px: optics.blur_px.hypot(optics.spot_sigma_m * scale_px).max(0.3),
            scene,
            instrument: instrument.clone(),
            optics: optics.clone(),
        })
    }

    /// Exposure number `frame` of both cameras, the scanner at `base_from_scanner`; the given rows are read out. Pixels
    /// count from the centre of the first; the stripe runs along the rows. The same seed gives the same images, and each
    /// exposure has noise of its own from it.
    #[must_use]
    pub fn exposures(
        &self,
        base_from_scanner: &Isometry3<f64>,
        windows: [Window; 2],
        seed: u64,
        frame: u32,
    ) -> [GrayImage; 2] {
        let sheets: Vec<Vec<Option<Spot>>> = self
            .sheets
            .iter()
            .map(|sheet| sheet.rays.iter().map(|ray| self.cast(base_from_scanner, ray)).collect())
            .collect();
        let scanner_from_base = base_from_scanner.inverse();
        let bounce = |spot: &Option<Spot>| self.bounce(&scanner_from_base, spot.as_ref()?);
        let again: Vec<Option<Spot>> = sheets[self.middle].iter().map(bounce).collect();
        Camera::ALL.map(|camera| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            rng.set_stream(2 * u64::from(frame) + camera as u64);
            let center = base_from_scanner * self.instrument.camera_center(camera);
            let mut light = Light::new(self.instrument.pixels[0], windows[camera as usize]);
            let whole = (&again, self.optics.exposure, self.whole_sigma_px);
            let thin = self.sheets.iter().zip(&sheets).map(|(sheet, s)| (s, sheet.level, self.sigma_px));
            for (spots, level, sigma_px) in thin.chain([whole]) {
                let mut before = None;
                for spot in spots {
                    let lit = spot.as_ref().and_then(|spot| self.see(spot, camera, &center)).map(|lit| {
                        let speckle: f64 = StandardNormal.sample(&mut rng);
                        let graininess = (1.0 + self.optics.speckle * speckle).max(0.0);
                        Lit { level: lit.level * level * graininess, ..lit }
                    });
                    if let (Some(a), Some(b)) = (&before, &lit) {
                        light.add(a, b, sigma_px);
                    }
                    before = lit;
                }
            }
            light.expose(&self.optics, &mut rng)
        })
    }

    /// What a ray of the laser lights.
    fn cast(
        &self,
        base_from_scanner: &Isometry3<f64>,
        (origin, direction): &(Point3<f64>, Vector3<f64>),
    ) -> Option<Spot> {
        let (origin_in_base, direction_in_base) = (base_from_scanner * origin, base_from_scanner * direction);
        let hit = self.scene.hit(&origin_in_base, &direction_in_base)?;
        let in_base = origin_in_base + direction_in_base * hit.distance_m;
        let in_scanner = origin + direction * hit.distance_m;
        // A fan's light thins out with the distance.
        let light = self.instrument.stand_off_m / hit.distance_m;
        self.spot(in_base, in_scanner, &direction_in_base, &hit, light)
    }

    /// What the mirrored light of a spot lights.
    fn bounce(&self, scanner_from_base: &Isometry3<f64>, spot: &Spot) -> Option<Spot> {
        if spot.mirrored <= 0.0 {
            return None;
        }
        let origin = spot.in_base + spot.normal * CLEARANCE_M;
        let hit = self.scene.hit(&origin, &spot.mirror)?;
        let in_base = origin + spot.mirror * hit.distance_m;
        let way_m = spot.in_scanner.coords.norm();
        let light = spot.mirrored * way_m / (way_m + hit.distance_m);
        self.spot(in_base, scanner_from_base * in_base, &spot.mirror, &hit, light)
    }

    /// A surface under light from `direction`, as strong as `light` on a surface that faces it.
    fn spot(
        &self,
        in_base: Point3<f64>,
        in_scanner: Point3<f64>,
        direction: &Vector3<f64>,
        hit: &Hit,
        light: f64,
    ) -> Option<Spot> {
        let facing = -hit.normal.dot(direction);
        if facing <= 0.0 {
            return None;
        }
        let finish: &Finish = match hit.body {
            Body::Object => &self.optics.object,
            Body::Table => &self.optics.table,
        };
        Some(Spot {
            in_base,
            in_scanner,
            normal: hit.normal,
            // A diffuse surface spreads the laser's power over a larger spot when it leans.
            scattered: light * facing * finish.albedo_at(&in_base),
            mirrored: light * finish.gloss,
            mirror: direction + hit.normal * (2.0 * facing),
        })
    }

    /// A spot in a camera's image, unless something stands between.
    fn see(&self, spot: &Spot, camera: Camera, center: &Point3<f64>) -> Option<Lit> {
        let to_camera = Unit::new_normalize(center - spot.in_base);
        if spot.normal.dot(&to_camera) <= 0.0 {
            return None;
        }
        let pixel = self.optics.pixel(&self.instrument, camera, &spot.in_scanner)?;
        if !self.scene.is_clear(center, &spot.in_base) {
            return None;
        }
        let toward = if spot.mirrored > 0.0 { spot.mirror.dot(&to_camera).max(0.0) } else { 0.0 };
        let highlight =
            spot.mirrored * 0.5 * f64::from(HIGHLIGHT_EXPONENT + 2) * toward.powi(HIGHLIGHT_EXPONENT);
        Some(Lit { pixel, level: spot.scattered + highlight })
    }
}

/// Light that falls on the rows of a sensor that are read, in grey levels, row by row.
struct Light {
    width: u32,
    window: Window,
    levels: Vec<f64>,
}

impl Light {
    fn new(width: u32, window: Window) -> Self {
        Self { width, window, levels: vec![0.0; width as usize * window.rows_px as usize] }
    }

    /// Adds the piece of a thin sheet between two neighbouring places.
    fn add(&mut self, a: &Lit, b: &Lit, sigma_px: f64) {
        let gap = (b.pixel[0] - a.pixel[0]).hypot(b.pixel[1] - a.pixel[1]);
        if gap > MAX_GAP_PX {
            return;
        }
        let (left, right) = if a.pixel[0] <= b.pixel[0] { (a, b) } else { (b, a) };
        let length = right.pixel[0] - left.pixel[0];
        let first = left.pixel[0].ceil().max(0.0) as u32;
        for u in first..self.width {
            let along = f64::from(u) - left.pixel[0];
            // A column at the seam belongs to the next piece.
            if along >= length {
                break;
            }
            let share = along / length;
            let v = left.pixel[1] + share * (right.pixel[1] - left.pixel[1])
                - f64::from(self.window.first_row_px);
            let level = left.level + share * (right.level - left.level);
            let reach = REACH * sigma_px;
            let from = (v - reach).ceil().max(0.0) as u32;
            for row in from..self.window.rows_px {
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
        GrayImage::from_fn(self.width, self.window.rows_px, |_, _| Luma([pixels.next().unwrap_or_default()]))
    }
}

#[cfg(test)]
mod tests;
