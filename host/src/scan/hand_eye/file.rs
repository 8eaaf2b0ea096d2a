//! A mount as a file: what `scan.toml` says of it, with how well it is known.

use nalgebra::Isometry3;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::HandEye;
use crate::scan::recording::Pose;

/// The only version.
const VERSION: u32 = 1;
const UNITS: &str = "m rad";

/// A mount that was calibrated.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MountFile {
    version: u32,
    units: String,
    palm_from_scanner: Pose,
    #[serde(skip_serializing_if = "Option::is_none")]
    uncertainty: Option<Spread>,
}

/// Standard deviations.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Spread {
    /// Of the scanner's origin along the palm's axes.
    position_m: [f64; 3],
    /// Of turns about them.
    rotation_rad: [f64; 3],
}

/// Why a text is no mount.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum MountFileError {
    /// No TOML, or a key that means nothing, or a lack of one.
    #[error("line {line}: {message}")]
    Toml {
        /// Counted from 1.
        line: usize,
        /// What is wrong there.
        message: String,
    },
    /// Another version than the one that is known.
    #[error("version {found}, this program reads {VERSION}")]
    Version {
        /// The file's.
        found: u32,
    },
    /// Other units.
    #[error("units is {found:?}, only {UNITS:?} is known")]
    Units {
        /// The file's.
        found: String,
    },
    /// Numbers that are no pose.
    #[error("palm_from_scanner is no pose: finite numbers and a quaternion of length 1")]
    NoPose,
}

impl MountFile {
    /// What is kept of a calibration.
    #[must_use]
    pub fn of(found: &HandEye) -> Self {
        let uncertainty = found.uncertainty();
        Self {
            version: VERSION,
            units: UNITS.to_owned(),
            palm_from_scanner: Pose::of(&found.palm_from_scanner),
            uncertainty: Some(Spread {
                position_m: uncertainty.position_std_m(),
                rotation_rad: uncertainty.rotation_std_rad(),
            }),
        }
    }

    /// The file's text.
    ///
    /// # Errors
    /// Not in practice: the serialiser's type says that it might.
    pub fn to_toml(&self) -> Result<String, toml::ser::Error> {
        toml::to_string(self)
    }

    /// The mount that a file's text holds.
    ///
    /// # Errors
    /// See [`MountFileError`].
    pub fn palm_from_scanner(text: &str) -> Result<Isometry3<f64>, MountFileError> {
        let file: Self = toml::from_str(text).map_err(|error| {
            let start = error.span().map_or(0, |span| span.start);
            let line = text.get(..start).map_or(0, |before| before.matches('\n').count()) + 1;
            MountFileError::Toml { line, message: error.message().replace('\n', " ") }
        })?;
        if file.version != VERSION {
            return Err(MountFileError::Version { found: file.version });
        }
        if file.units != UNITS {
            return Err(MountFileError::Units { found: file.units });
        }
        file.palm_from_scanner.isometry().ok_or(MountFileError::NoPose)
    }
}
