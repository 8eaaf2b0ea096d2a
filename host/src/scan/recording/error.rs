//! What can be wrong with a recording, and where.

use std::path::PathBuf;

use thiserror::Error;

use super::JOINTS;
use crate::io::TextError;
use crate::plan::arm::ArmFileError;
use crate::scan::calibrate::CalibrationFileError;
use crate::scan::joints::JointTrackError;

/// Why a recording cannot be read or written. Every message is one line that names the file.
#[derive(Debug, Error)]
pub enum RecordingError {
    /// The operating system refused.
    #[error("{}: {source}", .path.display())]
    System {
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// Nothing is written over.
    #[error("{}: is already there; a recording overwrites nothing", .path.display())]
    Exists {
        /// The folder.
        path: PathBuf,
    },
    /// A file that gives no text, or one larger than any recording's.
    #[error("{}: {source}", .path.display())]
    Text {
        /// The file.
        path: PathBuf,
        /// Why.
        source: TextError,
    },
    /// More frames than any recording has.
    #[error("{}: more than {most} frames", .path.display())]
    TooManyFrames {
        /// The table.
        path: PathBuf,
        /// The most that are read.
        most: usize,
    },
    /// `scan.toml` is no TOML, or has a key that means nothing, or lacks one.
    #[error("{}: {message}", .path.display())]
    Manifest {
        /// The file.
        path: PathBuf,
        /// What is wrong; it names the line or the key.
        message: String,
    },
    /// A line of a table.
    #[error("{}: line {line}: {problem}", .path.display())]
    Row {
        /// The file.
        path: PathBuf,
        /// Counted from 1.
        line: usize,
        /// What is wrong there.
        problem: RowProblem,
    },
    /// A table without a row.
    #[error("{}: no {what}", .path.display())]
    Nothing {
        /// The file or folder.
        path: PathBuf,
        /// What there should be.
        what: &'static str,
    },
    /// An image that is damaged, or of another kind or size than said.
    #[error("{}: {message}", .path.display())]
    Image {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        message: String,
    },
    /// A calibration that cannot be read.
    #[error("{}: {source}", .path.display())]
    Calibration {
        /// The file.
        path: PathBuf,
        /// Why.
        source: CalibrationFileError,
    },
    /// An arm that cannot be read.
    #[error("{}: {source}", .path.display())]
    Arm {
        /// The file.
        path: PathBuf,
        /// Why.
        source: ArmFileError,
    },
    /// Only the built-in arm has a name to be recorded by.
    #[error("only scans by the rx60 can be recorded")]
    UnknownArm,
}

impl From<JointTrackError> for RowProblem {
    fn from(error: JointTrackError) -> Self {
        match error {
            JointTrackError::Order { time_s, before_s, .. } => Self::Time { time_s, before_s },
            // Cells that hold no finite numbers are told by their columns before.
            JointTrackError::NotFinite { .. } => {
                Self::Value { column: JOINTS.to_owned(), found: error.to_string() }
            }
        }
    }
}

/// What is wrong in a line of a table.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum RowProblem {
    /// The first line does not name the columns.
    #[error("the header must be {wanted}, found {found:?}")]
    Header {
        /// The names.
        wanted: String,
        /// The line, shortened.
        found: String,
    },
    /// A line with too few or too many columns.
    #[error("{found} columns instead of {wanted}")]
    Columns {
        /// Its columns.
        found: usize,
        /// How many there should be.
        wanted: usize,
    },
    /// A value that is no finite number, no whole one, or none of the words.
    #[error("{column} is {found:?}")]
    Value {
        /// Name of the column.
        column: String,
        /// The text, shortened.
        found: String,
    },
    /// A time that does not come after the one before.
    #[error("out of order: {time_s} s comes after {before_s} s")]
    Time {
        /// Its time.
        time_s: f64,
        /// That of the line before.
        before_s: f64,
    },
    /// A frame number that does not come after the one before.
    #[error("out of order: frame {frame} comes after {before}")]
    FrameOrder {
        /// Its number.
        frame: u32,
        /// That of the line before.
        before: u32,
    },
    /// A frame while the arm's joints are unknown.
    #[error("frame {frame} at {time_s} s is not covered by joints.csv ({first_s} to {last_s} s)")]
    Uncovered {
        /// Its number.
        frame: u32,
        /// Its time, with the known offset of the clocks.
        time_s: f64,
        /// First time of the joints.
        first_s: f64,
        /// Last time of the joints.
        last_s: f64,
    },
    /// A stripe in a frame that frames.csv does not have.
    #[error("there is no frame {frame} in frames.csv")]
    UnknownFrame {
        /// Its number.
        frame: u32,
    },
    /// A stripe outside the frame.
    #[error("the stripe is outside the frame of {columns_px} x {rows_px} pixels")]
    OutsideFrame {
        /// Width of the frame.
        columns_px: u32,
        /// Height of the frame.
        rows_px: u32,
    },
}
