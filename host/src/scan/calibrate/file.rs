//! Calibrations on disk: TOML, with a version.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::Calibration;

/// Why a text is no calibration.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum CalibrationFileError {
    /// No TOML, or not these keys; the message names the line.
    #[error("{}", .0.to_string().trim_end().replace('\n', " "))]
    Syntax(#[from] toml::de::Error),
    /// Written by another version of this program.
    #[error("calibration version {found}, this program reads {VERSION}")]
    Version {
        /// The file's.
        found: u32,
    },
    /// A calibration that cannot be stored: it holds a number that is not finite.
    #[error("{0}")]
    Write(#[from] toml::ser::Error),
}

const VERSION: u32 = 1;

#[derive(Serialize, Deserialize)]
struct File<T> {
    version: u32,
    #[serde(flatten)]
    content: T,
}

#[derive(Deserialize)]
struct Any {}

impl Calibration {
    /// As TOML, so that [`Calibration::from_toml`] gives the very same numbers.
    ///
    /// # Errors
    /// [`CalibrationFileError::Write`].
    pub fn to_toml(&self) -> Result<String, CalibrationFileError> {
        Ok(toml::to_string(&File { version: VERSION, content: self })?)
    }

    /// Reads what [`Calibration::to_toml`] wrote.
    ///
    /// # Errors
    /// When the text is no calibration of this version.
    pub fn from_toml(text: &str) -> Result<Self, CalibrationFileError> {
        let found = toml::from_str::<File<Any>>(text)?.version;
        if found != VERSION {
            return Err(CalibrationFileError::Version { found });
        }
        Ok(toml::from_str::<File<Self>>(text)?.content)
    }
}
