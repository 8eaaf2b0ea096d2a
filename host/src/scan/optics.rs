//! What lens, sensor, laser sheet and surfaces do to the light, beyond the geometry of the [`Instrument`].

use nalgebra::Point3;

use super::instrument::{Camera, Instrument};
use crate::surface::Plane;

/// Light, lens and sensor.
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
    /// The object's surface.
    pub object: Finish,
    /// The table's.
    pub table: Finish,
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
            object: Finish::default(),
            table: Finish::default(),
        }
    }
}

/// How a surface reflects the laser.
#[derive(Debug, Clone, PartialEq)]
pub struct Finish {
    /// Share of the light that is scattered evenly; 1 is white.
    pub albedo: f64,
    /// Share of the light that is mirrored, as by glaze or polish; 0.04 is a glaze's at right angles (Fresnel, refractive
    /// index 1.5). It makes highlights, and lights other places, which is where false stripes come from.
    pub gloss: f64,
    /// Changes of colour.
    pub edges: Vec<AlbedoEdge>,
}

impl Default for Finish {
    /// White and matt.
    fn default() -> Self {
        Self { albedo: 1.0, gloss: 0.0, edges: Vec::new() }
    }
}

impl Finish {
    /// White with a glaze.
    #[must_use]
    pub fn glazed() -> Self {
        Self { gloss: 0.04, ..Self::default() }
    }

    /// Albedo at a point, base frame.
    #[must_use]
    pub fn albedo_at(&self, point: &Point3<f64>) -> f64 {
        let beyond = |edge: &&AlbedoEdge| edge.plane.height(point) > 0.0;
        self.edges.iter().filter(beyond).fold(self.albedo, |albedo, edge| albedo * edge.ratio)
    }

    fn is_sound(&self) -> bool {
        let edges = self.edges.iter().map(|edge| edge.ratio);
        edges.chain([self.albedo, self.gloss]).all(|x| x.is_finite() && x >= 0.0) && self.gloss <= 1.0
    }
}

/// On the side of the plane's normal (base frame) the surface scatters `ratio` times as much light.
#[derive(Debug, Clone, PartialEq)]
pub struct AlbedoEdge {
    /// Where the colour changes.
    pub plane: Plane,
    /// 1 is no change.
    pub ratio: f64,
}

impl Optics {
    /// Whether all values are finite, and those that are amounts not negative.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        let Self {
            spot_sigma_m, blur_px, exposure, ambient, speckle, electrons_per_level, read_noise, ..
        } = *self;
        let amounts = [spot_sigma_m, blur_px, exposure, ambient, speckle, electrons_per_level, read_noise];
        amounts.iter().all(|x| x.is_finite() && *x >= 0.0)
            && self.distortion.iter().chain([&self.bow_m]).all(|x| x.is_finite())
            && self.object.is_sound()
            && self.table.is_sound()
    }

    /// How far the sheet stands out of its plane in the direction of `slope`, y over z of the scanner frame.
    #[must_use]
    pub fn bow_at_m(&self, slope: f64, instrument: &Instrument) -> f64 {
        let across = slope / (0.5 * instrument.fan_rad).tan();
        self.bow_m * (1.0 - across * across)
    }

    /// Where a point (scanner frame) appears: u along the stripe, v across it, from the centre of the sensor's first
    /// pixel; `None` when the camera does not see there.
    #[must_use]
    pub fn pixel(&self, instrument: &Instrument, camera: Camera, point: &Point3<f64>) -> Option<[f64; 2]> {
        let image = instrument.project(camera, point)?;
        let focal_px = instrument.focal_m / instrument.pixel_m;
        let distorted = distort(image.map(|x| x / focal_px), &self.distortion);
        Some([0, 1].map(|axis| focal_px * distorted[axis] + 0.5 * (f64::from(instrument.pixels[axis]) - 1.0)))
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
