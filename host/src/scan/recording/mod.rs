//! Recordings: a folder with what the cameras saw and what the arm did meanwhile.
//!
//! `scan.toml` describes the scanner, `frames.csv` says when each frame was taken, `joints.csv` where the arm was; the
//! images lie in `frames/` as PNG, or the stripes found in them in `stripes.csv`. Every key and column is explained in
//! `docs/scanning.md`.
mod error;
mod images;
mod manifest;
mod read;
mod tables;
#[cfg(test)]
mod tests;
mod write;

pub use error::{RecordingError, RowProblem};
pub use manifest::Content;
pub(in crate::scan) use manifest::Pose;
pub use read::{ReadRecording, read_recording};
pub use write::RecordingWriter;

use super::Camera;

const MANIFEST: &str = "scan.toml";
const FRAMES: &str = "frames.csv";
const JOINTS: &str = "joints.csv";
const STRIPES: &str = "stripes.csv";
const IMAGES: &str = "frames";

/// Name of an image in the folder.
fn image_name(frame: u32, camera: Camera) -> String {
    format!("{IMAGES}/{frame:06}-{}.png", camera.name())
}
