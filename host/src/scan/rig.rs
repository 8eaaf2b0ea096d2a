//! The scanner as it is calibrated: two cameras that measure in the laser plane, and their place on the palm.

use nalgebra::{Isometry3, Point3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::calibrate::{
    Bench, CalibrateError, CalibrateSettings, Calibration, Evaluation, MarkerPair, calibrate,
};
use super::instrument::{Camera, Instrument};
use super::mount::palm_from_scanner;
use super::optics::Optics;
use super::render::Window;

/// A camera whose pixels mean points of the laser plane.
#[derive(Debug, Clone, PartialEq)]
pub struct StripeCamera {
    /// Of the whole sensor.
    pub calibration: Calibration,
    /// Columns of the sensor; a frame has them all.
    pub columns_px: u32,
    /// Rows of the sensor that a frame has.
    pub window: Window,
}

/// Rows that are read beyond those that are calibrated: a stripe that ends outside is then seen to do so.
const WINDOW_MARGIN_PX: f64 = 12.0;

impl StripeCamera {
    /// A camera of which the rows are read that its calibration knows.
    #[must_use]
    pub fn new(calibration: Calibration, sensor_px: [u32; 2]) -> Self {
        let rows = calibration.hull().corners_px().iter().map(|corner| corner[1]);
        let (low, high) = rows.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        let within = |v: f64| v.clamp(0.0, f64::from(sensor_px[1])) as u32;
        let first_row_px = within((low - WINDOW_MARGIN_PX).floor());
        let end = within((high + WINDOW_MARGIN_PX).ceil() + 1.0).max(first_row_px);
        let window = Window { first_row_px, rows_px: end - first_row_px };
        Self { calibration, columns_px: sensor_px[0], window }
    }

    /// The point of the laser plane at a place of a frame: y along the stripe and z away from the laser, metres, scanner
    /// frame. `None` where the camera is not calibrated.
    #[must_use]
    pub fn measure(&self, [u_px, v_px]: [f64; 2]) -> Option<[f64; 2]> {
        match self.calibration.evaluate([u_px, v_px + f64::from(self.window.first_row_px)]) {
            Evaluation::Point(point) => Some(point),
            Evaluation::OutsideHull { .. } | Evaluation::Singular => None,
        }
    }
}

/// The whole scanner.
#[derive(Debug, Clone, PartialEq)]
pub struct Rig {
    /// In the order of [`Camera::ALL`].
    pub cameras: [StripeCamera; 2],
    /// Where the scanner sits on the palm.
    pub palm_from_scanner: Isometry3<f64>,
}

impl Rig {
    /// The virtual scanner, calibrated on the virtual measuring machine ([`scanner_markers`]).
    ///
    /// # Errors
    /// When the optics are beyond calibration.
    pub fn calibrated(instrument: &Instrument, optics: &Optics, seed: u64) -> Result<Self, CalibrateError> {
        // Where a lens model fits, as here, more training of the networks would change nothing.
        let settings = CalibrateSettings { starts: 1, max_iterations: 20, seed };
        let camera = |camera: Camera| {
            let pairs = scanner_markers(instrument, optics, camera, MARKER_NOISE_PX, seed);
            let calibration = calibrate(&pairs, &settings)?.calibration;
            Ok::<_, CalibrateError>(StripeCamera::new(calibration, instrument.pixels))
        };
        let (left, right) = rayon::join(|| camera(Camera::Left), || camera(Camera::Right));
        Ok(Self { cameras: [left?, right?], palm_from_scanner: palm_from_scanner() })
    }
}

/// Width along the stripe that the virtual scanner measures at every depth from 155 to 245 mm.
pub const MEASURED_WIDTH_M: f64 = 0.104;

/// Noise of a marker's pixel coordinate.
pub const MARKER_NOISE_PX: f64 = 0.1;

/// What the virtual measuring machine notes for one camera of the scanner: markers 5 mm apart, moved through the laser
/// sheet in steps of 2 mm over 120 x 98 mm about the stand-off, those that the camera sees.
#[must_use]
pub fn scanner_markers(
    instrument: &Instrument,
    optics: &Optics,
    camera: Camera,
    noise_px: f64,
    seed: u64,
) -> Vec<MarkerPair> {
    let bench = Bench { markers: 25, marker_pitch_m: 0.005, steps: 50, step_m: 0.002, noise_px };
    let [width, depth] = bench.field_m();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(camera as u64);
    let mut pairs = Vec::new();
    for row in 0..bench.steps {
        for marker in 0..bench.markers {
            let y = f64::from(marker) * bench.marker_pitch_m - 0.5 * width;
            let z = instrument.stand_off_m + f64::from(row) * bench.step_m - 0.5 * depth;
            // The machine centres each marker in the light, wherever the sheet is.
            let point = Point3::new(optics.bow_at_m(y / z, instrument), y, z);
            if let Some(pixel) = optics.pixel(instrument, camera, &point) {
                let pixel = pixel.map(|coordinate| {
                    let noise: f64 = StandardNormal.sample(&mut rng);
                    coordinate + noise_px * noise
                });
                pairs.push(MarkerPair { pixel, target_m: [y, z], row });
            }
        }
    }
    pairs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_cameras_measure_points_of_the_laser_plane() {
        let (instrument, optics) = (Instrument::default(), Optics::default());
        let rig = Rig::calibrated(&instrument, &optics, 1).unwrap();
        for (camera, stripe_camera) in Camera::ALL.into_iter().zip(&rig.cameras) {
            let half_m = 0.5 * MEASURED_WIDTH_M;
            let ends = [0.1555, 0.2, 0.245].map(|z| [(-half_m, z), (half_m, z)]);
            let within = [(0.0, 0.2), (0.04, 0.16), (-0.05, 0.24), (0.03, 0.21)];
            for (y, z) in within.into_iter().chain(ends.into_iter().flatten()) {
                let [u, v] = optics.pixel(&instrument, camera, &Point3::new(0.0, y, z)).unwrap();
                let row = v - f64::from(stripe_camera.window.first_row_px);
                let [found_y, found_z] = stripe_camera.measure([u, row]).unwrap();
                assert!((found_y - y).abs() < 2e-5 && (found_z - z).abs() < 5e-5, "{camera:?} {y} {z}");
            }
            // The window holds what is calibrated, and no more than it needs.
            let window = stripe_camera.window;
            assert!((120..300).contains(&window.rows_px), "{window:?}");
            assert_eq!(stripe_camera.measure([384.0, 0.0]), None);
            assert_eq!(stripe_camera.measure([384.0, f64::from(window.rows_px - 1)]), None);
        }
    }
}
