//! `scan.toml`: what the recording holds, and the scanner and arm that made it.

use std::path::Path;

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use serde::{Deserialize, Serialize};

use super::error::RecordingError;
use crate::scan::rig::StripeCamera;

/// What a recording holds of the cameras' images.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Content {
    /// The images, as PNG.
    Frames,
    /// The stripes found in them.
    Stripes,
}

pub(super) const VERSION: u32 = 1;
/// Metres, radians, seconds; and pixels.
const UNITS: &str = "m rad s px";
/// What the poses of the arm are relative to, and the cloud will be.
const FRAME: &str = "base";
/// Larger sensors are a mistake in the file.
const MAX_SIDE_PX: u32 = 16_384;

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Manifest {
    pub(super) version: u32,
    pub(super) units: String,
    pub(super) frame: String,
    pub(super) content: Content,
    pub(super) arm: String,
    #[serde(default)]
    pub(super) clock: Clock,
    palm_from_scanner: Pose,
    pub(super) left: CameraEntry,
    pub(super) right: CameraEntry,
}

#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Clock {
    /// What is known of the clocks before: to be added to the frames' times to get the arm's.
    pub(super) offset_s: f64,
}

/// A pose as files have it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::scan) struct Pose {
    position_m: [f64; 3],
    orientation_wxyz: [f64; 4],
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CameraEntry {
    pub(super) calibration: String,
    pub(super) columns_px: u32,
    pub(super) rows_px: u32,
    pub(super) first_row_px: u32,
}

/// How far from length 1 a quaternion may be that means a rotation.
const UNIT_TOLERANCE: f64 = 1e-6;
/// Within this it is left alone, so that a recording gives back the pose that it was made with to the last bit.
const ROUNDING: f64 = 1e-12;

impl Pose {
    pub(in crate::scan) fn of(pose: &Isometry3<f64>) -> Self {
        let q = pose.rotation.quaternion();
        Self { position_m: pose.translation.vector.into(), orientation_wxyz: [q.w, q.i, q.j, q.k] }
    }

    /// `None` when the numbers are no pose.
    pub(in crate::scan) fn isometry(&self) -> Option<Isometry3<f64>> {
        let [w, i, j, k] = self.orientation_wxyz;
        let quaternion = Quaternion::new(w, i, j, k);
        let off = (quaternion.norm() - 1.0).abs();
        let finite = self.position_m.iter().chain(&self.orientation_wxyz).all(|x| x.is_finite());
        if !finite || off > UNIT_TOLERANCE {
            return None;
        }
        let rotation = if off <= ROUNDING {
            UnitQuaternion::new_unchecked(quaternion)
        } else {
            UnitQuaternion::new_normalize(quaternion)
        };
        Some(Isometry3::from_parts(Translation3::from(self.position_m), rotation))
    }
}

impl CameraEntry {
    pub(super) fn of(camera: &StripeCamera, calibration: &str) -> Self {
        Self {
            calibration: calibration.to_owned(),
            columns_px: camera.columns_px,
            rows_px: camera.window.rows_px,
            first_row_px: camera.window.first_row_px,
        }
    }
}

impl Manifest {
    pub(super) fn new(
        content: Content,
        arm: &str,
        palm_from_scanner: &Isometry3<f64>,
        [left, right]: [CameraEntry; 2],
    ) -> Self {
        Self {
            version: VERSION,
            units: UNITS.to_owned(),
            frame: FRAME.to_owned(),
            content,
            arm: arm.to_owned(),
            clock: Clock::default(),
            palm_from_scanner: Pose::of(palm_from_scanner),
            left,
            right,
        }
    }

    /// Reads and checks the text of `path`; with it comes `palm_from_scanner`, which is a pose.
    pub(super) fn parse(path: &Path, text: &str) -> Result<(Self, Isometry3<f64>), RecordingError> {
        let wrong = |message: String| RecordingError::Manifest { path: path.to_owned(), message };
        let manifest: Self = toml::from_str(text).map_err(|error| {
            let start = error.span().map_or(0, |span| span.start);
            let line = text.get(..start).map_or(0, |before| before.matches('\n').count()) + 1;
            wrong(format!("line {line}: {}", error.message().replace('\n', " ")))
        })?;
        if manifest.version != VERSION {
            return Err(wrong(format!("version {}, this program reads {VERSION}", manifest.version)));
        }
        for (key, found, wanted) in [("units", &manifest.units, UNITS), ("frame", &manifest.frame, FRAME)] {
            if found != wanted {
                return Err(wrong(format!("{key} is {found:?}, only {wanted:?} is known")));
            }
        }
        if !manifest.clock.offset_s.is_finite() {
            return Err(wrong("clock.offset_s is not a finite number".to_owned()));
        }
        let palm_from_scanner = manifest.palm_from_scanner.isometry().ok_or_else(|| {
            wrong("palm_from_scanner is no pose: finite numbers and a quaternion of length 1".to_owned())
        })?;
        for (key, camera) in [("left", &manifest.left), ("right", &manifest.right)] {
            let sides = [camera.columns_px, camera.rows_px];
            if sides.contains(&0) || sides.iter().chain([&camera.first_row_px]).any(|&n| n > MAX_SIDE_PX) {
                return Err(wrong(format!("{key}: a frame of {} x {} pixels", sides[0], sides[1])));
            }
        }
        for name in [&manifest.left.calibration, &manifest.right.calibration, &manifest.arm] {
            // Files beside this one, so that a recording can be carried elsewhere, and reads nothing else.
            if Path::new(name).file_name().is_none_or(|file| file.to_str() != Some(name)) {
                return Err(wrong(format!("{name:?} is not the name of a file in the folder")));
            }
        }
        Ok((manifest, palm_from_scanner))
    }
}
