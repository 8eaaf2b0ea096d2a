//! The paper's calibration bench, simulated: twenty markers on a pattern that a measuring machine moves through the
//! laser plane, seen by a camera.

use nalgebra::{Point3, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::MarkerPair;
use crate::scan::instrument::{Camera, Instrument};

/// A camera that looks at the laser plane.
///
/// Laser plane: x along the stripe, y away from the laser's aperture, origin at the aperture; metres. Pixels: u along
/// the stripe, v across it, from the centre of the first pixel.
#[derive(Debug, Clone, PartialEq)]
pub struct BenchCamera {
    /// Focal length over pixel pitch.
    pub focal_px: f64,
    /// Where the optical axis meets the sensor.
    pub principal_px: [f64; 2],
    /// Distance from the centre of projection to the middle of the markers' field.
    pub distance_m: f64,
    /// Depth of that middle below the aperture.
    pub stand_off_m: f64,
    /// Angle between the optical axis and the laser plane.
    pub triangulation_rad: f64,
    /// Brown's k1, k2, p1, p2, on image coordinates over focal length.
    pub distortion: [f64; 4],
    /// Amplitude of a waviness of the image that no lens model describes.
    pub ripple_px: f64,
    /// Length of its waves.
    pub ripple_length_px: f64,
    /// Whether v grows with depth instead of falling: the instrument's cameras on the two sides differ in this.
    pub flipped: bool,
    /// How far the middle of the laser sheet stands out of its plane; it returns to it at the ends of the field.
    pub bow_m: f64,
}

impl Default for BenchCamera {
    /// A PAL camera (752 x 582 pixels, as the paper's) at 45 degrees: 0.21 mm per pixel along the stripe, 0.30 in depth.
    fn default() -> Self {
        Self {
            focal_px: 950.0,
            principal_px: [375.5, 290.5],
            distance_m: 0.200,
            stand_off_m: 0.200,
            triangulation_rad: 45_f64.to_radians(),
            distortion: [-0.2, 0.05, 5e-4, -3e-4],
            ripple_px: 0.0,
            flipped: false,
            ripple_length_px: 300.0,
            bow_m: 0.0,
        }
    }
}

impl BenchCamera {
    /// A camera whose optics no physical model fits: 0.25 px of ripple, and a laser sheet bowed by 0.1 mm.
    #[must_use]
    pub fn rippled() -> Self {
        Self { ripple_px: 0.25, bow_m: 1e-4, ..Self::default() }
    }

    /// One of the instrument's cameras, behind the same lens as [`BenchCamera::default`], which is also that of the
    /// rendered images ([`crate::scan::optics::Optics::default`]).
    #[must_use]
    pub fn of(instrument: &Instrument, camera: Camera) -> Self {
        let center = instrument.camera_center(camera);
        Self {
            focal_px: instrument.focal_m / instrument.pixel_m,
            principal_px: instrument.pixels.map(|n| 0.5 * (f64::from(n) - 1.0)),
            distance_m: instrument.stand_off_m.hypot(center.x),
            stand_off_m: instrument.stand_off_m,
            triangulation_rad: (center.x.abs() / instrument.stand_off_m).atan(),
            flipped: camera == Camera::Right,
            ..Self::default()
        }
    }

    /// Pixel at which a point of the laser sheet appears, without noise. `x` and `y` as measured in the laser's plane.
    #[must_use]
    pub fn project(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let (sine, cosine) = self.triangulation_rad.sin_cos();
        // From the middle of the field; z out of the plane, to the camera's side.
        let off_plane = self.bow_m * (1.0 - (x / HALF_WIDTH_M).powi(2));
        let point = Point3::new(x, y - self.stand_off_m, off_plane);
        let camera = Point3::new(0.0, -self.distance_m * cosine, self.distance_m * sine);
        let optical = Vector3::new(0.0, cosine, -sine);
        let ray = point - camera;
        let depth = ray.dot(&optical);
        let [a, b] = [ray.x, ray.dot(&optical.cross(&Vector3::x()))].map(|side| side / depth);
        let b = if self.flipped { -b } else { b };
        let [k1, k2, p1, p2] = self.distortion;
        let r2 = a * a + b * b;
        let radial = 1.0 + r2 * (k1 + r2 * k2);
        let distorted = [
            a * radial + 2.0 * p1 * a * b + p2 * (r2 + 2.0 * a * a),
            b * radial + p1 * (r2 + 2.0 * b * b) + 2.0 * p2 * a * b,
        ];
        let [u, v] = [0, 1].map(|axis| self.principal_px[axis] + self.focal_px * distorted[axis]);
        let wave = |at: f64| self.ripple_px * (std::f64::consts::TAU * at / self.ripple_length_px).sin();
        [u + wave(v), v + wave(u)]
    }
}

/// Half the length of the markers' row.
const HALF_WIDTH_M: f64 = 0.0475;

/// The pattern and its path: by default the paper's, 20 markers 5 mm apart, 50 positions 1 mm apart.
#[derive(Debug, Clone, PartialEq)]
pub struct Bench {
    /// Markers in the row.
    pub markers: u32,
    /// Distance between them.
    pub marker_pitch_m: f64,
    /// Positions of the pattern.
    pub steps: u32,
    /// Distance between them.
    pub step_m: f64,
    /// Standard deviation of a marker's pixel coordinate.
    pub noise_px: f64,
}

impl Default for Bench {
    fn default() -> Self {
        Self { markers: 20, marker_pitch_m: 0.005, steps: 50, step_m: 0.001, noise_px: 0.1 }
    }
}

impl Bench {
    /// Width and depth of the field that the markers span.
    #[must_use]
    pub fn field_m(&self) -> [f64; 2] {
        let span = |count: u32, pitch: f64| f64::from(count.saturating_sub(1)) * pitch;
        [span(self.markers, self.marker_pitch_m), span(self.steps, self.step_m)]
    }

    /// Marker pairs as the machine would note them, row after row.
    #[must_use]
    pub fn measure(&self, camera: &BenchCamera, seed: u64) -> Vec<MarkerPair> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let [width, depth] = self.field_m();
        let mut pairs = Vec::new();
        for row in 0..self.steps {
            for marker in 0..self.markers {
                let target_m = [
                    f64::from(marker) * self.marker_pitch_m - 0.5 * width,
                    camera.stand_off_m + f64::from(row) * self.step_m - 0.5 * depth,
                ];
                let pixel = camera.project(target_m).map(|coordinate| {
                    let noise: f64 = StandardNormal.sample(&mut rng);
                    coordinate + self.noise_px * noise
                });
                pairs.push(MarkerPair { pixel, target_m, row });
            }
        }
        pairs
    }

    /// Points at which to compare a calibration with the truth: a grid 1.7 mm apart, so between the markers, over the
    /// field and `beyond_m` around it; and whether each is inside the field.
    #[must_use]
    pub fn verification(&self, camera: &BenchCamera, beyond_m: f64) -> Vec<Verification> {
        let half = self.field_m().map(|length| 0.5 * length);
        let counts = half.map(|length| ((length + beyond_m) / VERIFICATION_PITCH_M).floor().min(1e3) as i32);
        let mut points = Vec::new();
        for row in -counts[1]..=counts[1] {
            for column in -counts[0]..=counts[0] {
                let offset = [column, row].map(|i| f64::from(i) * VERIFICATION_PITCH_M);
                let target_m = [offset[0], camera.stand_off_m + offset[1]];
                let inside = (0..2).all(|axis| offset[axis].abs() <= half[axis]);
                points.push(Verification { pixel: camera.project(target_m), target_m, inside });
            }
        }
        points
    }
}

const VERIFICATION_PITCH_M: f64 = 0.0017;

/// A point of known place that no training saw.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Verification {
    /// Its image, without noise.
    pub pixel: [f64; 2],
    /// Where it is in the laser plane.
    pub target_m: [f64; 2],
    /// Within the markers' field.
    pub inside: bool,
}
