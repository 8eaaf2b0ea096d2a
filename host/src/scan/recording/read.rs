//! Reading a recording.

use std::path::Path;

use rayon::prelude::*;

use super::error::{RecordingError, RowProblem};
use super::images::read_png;
use super::manifest::{CameraEntry, Content, Manifest};
use super::tables::{FrameRow, read_frames, read_joints, read_stripes};
use super::{FRAMES, JOINTS, MANIFEST, STRIPES, image_name};
use crate::io::read_text;
use crate::plan::arm::Arm;
use crate::scan::Camera;
use crate::scan::calibrate::Calibration;
use crate::scan::capture::{Capture, Frame};
use crate::scan::joints::JointTrack;
use crate::scan::profile::{StripePixel, stripe_pixels};
use crate::scan::render::Window;
use crate::scan::rig::{Rig, StripeCamera};
use crate::scan::stripe::{Across, StripeExtractor};

/// A recording, and what is amiss with it without making it useless.
#[derive(Debug, Clone, PartialEq)]
pub struct ReadRecording {
    /// What it holds, the known offset of the clocks applied.
    pub capture: Capture,
    /// One line each.
    pub warnings: Vec<String>,
}

/// Largest description and table that are read; a table of stripes may be some hundreds of megabytes.
const MAX_TEXT_BYTES: u64 = 1 << 22;
const MAX_TABLE_BYTES: u64 = 1 << 30;
/// Frames of three hours at 100 a second.
const MAX_FRAMES: usize = 1 << 20;

/// Reads the recording in `folder`, and finds the stripes in its images.
///
/// Missing images are a warning, as long as there are any.
///
/// # Errors
/// When a file is missing, damaged, or says what cannot be; see [`RecordingError`].
pub fn read_recording(folder: &Path) -> Result<ReadRecording, RecordingError> {
    let path = folder.join(MANIFEST);
    let (manifest, palm_from_scanner) = Manifest::parse(&path, &text(&path, MAX_TEXT_BYTES)?)?;
    let arm = if manifest.arm == "rx60" {
        Arm::rx60()
    } else {
        let path = folder.join(&manifest.arm);
        let text = text(&path, MAX_TEXT_BYTES)?;
        Arm::from_toml(&text).map_err(|source| RecordingError::Arm { path, source })?
    };
    let cameras = [camera(folder, &manifest.left)?, camera(folder, &manifest.right)?];
    let rig = Rig { cameras, palm_from_scanner };
    let path = folder.join(JOINTS);
    let joints = read_joints(&path, &text(&path, MAX_TABLE_BYTES)?)?;
    let rows = frames(folder, &joints, manifest.clock.offset_s)?;
    let (stripes, warnings) = match manifest.content {
        Content::Frames => from_images(folder, &rows, &rig)?,
        Content::Stripes => (from_table(folder, &rows, &rig)?, Vec::new()),
    };
    let frames = rows
        .iter()
        .zip(stripes)
        .map(|(row, stripes)| Frame { sweep: row.sweep, time_s: row.time_s, stripes })
        .collect();
    Ok(ReadRecording { capture: Capture { arm, rig, frames, joints }, warnings })
}

fn camera(folder: &Path, entry: &CameraEntry) -> Result<StripeCamera, RecordingError> {
    let path = folder.join(&entry.calibration);
    let text = text(&path, MAX_TEXT_BYTES)?;
    let calibration = Calibration::from_toml(&text);
    let calibration = calibration.map_err(|source| RecordingError::Calibration { path, source })?;
    let window = Window { first_row_px: entry.first_row_px, rows_px: entry.rows_px };
    Ok(StripeCamera { calibration, columns_px: entry.columns_px, window })
}

/// The frames' rows on the arm's clock, as far as it is known.
fn frames(folder: &Path, joints: &JointTrack, offset_s: f64) -> Result<Vec<FrameRow>, RecordingError> {
    let path = folder.join(FRAMES);
    let mut rows = read_frames(&path, &text(&path, MAX_TABLE_BYTES)?)?;
    if rows.len() > MAX_FRAMES {
        return Err(RecordingError::TooManyFrames { path, most: MAX_FRAMES });
    }
    let ends = [joints.samples().first(), joints.samples().last()];
    let [first_s, last_s] = ends.map(|sample| sample.map_or(f64::NAN, |sample| sample.time_s));
    for row in &mut rows {
        row.time_s += offset_s;
        if joints.at(row.time_s).is_none() {
            let FrameRow { line, frame, time_s, .. } = *row;
            let problem = RowProblem::Uncovered { frame, time_s, first_s, last_s };
            return Err(RecordingError::Row { path, line, problem });
        }
    }
    Ok(rows)
}

type FrameStripes = [Option<Vec<StripePixel>>; 2];

fn from_images(
    folder: &Path,
    rows: &[FrameRow],
    rig: &Rig,
) -> Result<(Vec<FrameStripes>, Vec<String>), RecordingError> {
    let extractor = StripeExtractor::default();
    let read = |row: &FrameRow, camera: Camera| {
        let StripeCamera { columns_px, window, .. } = rig.cameras[camera as usize];
        let path = folder.join(image_name(row.frame, camera));
        let image = read_png(&path, [columns_px, window.rows_px])?;
        Ok(image.map(|image| stripe_pixels(&extractor.image(&image, Across::Columns))))
    };
    let read = |row: &FrameRow| Ok([read(row, Camera::Left)?, read(row, Camera::Right)?]);
    // Collected twice, so that of several damaged images always the first is named.
    let stripes: Vec<Result<FrameStripes, RecordingError>> = rows.par_iter().map(read).collect();
    let stripes = stripes.into_iter().collect::<Result<Vec<FrameStripes>, RecordingError>>()?;
    let all = || {
        let frames = rows.iter().zip(&stripes);
        frames.flat_map(|(row, stripes)| Camera::ALL.map(|camera| (row, camera, &stripes[camera as usize])))
    };
    let missing = all().filter(|(.., stripes)| stripes.is_none()).count();
    let mut warnings = Vec::new();
    if missing == 2 * rows.len() {
        return Err(RecordingError::Nothing { path: folder.join(super::IMAGES), what: "images" });
    }
    if let Some((row, camera, _)) = all().find(|(.., stripes)| stripes.is_none()) {
        let (count, first) = (2 * rows.len(), image_name(row.frame, camera));
        warnings.push(format!("{missing} of {count} images are missing, the first is {first}"));
    }
    Ok((stripes, warnings))
}

fn from_table(folder: &Path, rows: &[FrameRow], rig: &Rig) -> Result<Vec<FrameStripes>, RecordingError> {
    let path = folder.join(STRIPES);
    let mut stripes: Vec<FrameStripes> = rows.iter().map(|_| [Some(Vec::new()), Some(Vec::new())]).collect();
    for row in read_stripes(&path, &text(&path, MAX_TABLE_BYTES)?, &rig.cameras)? {
        let Ok(place) = rows.binary_search_by_key(&row.frame, |frame| frame.frame) else {
            let problem = RowProblem::UnknownFrame { frame: row.frame };
            return Err(RecordingError::Row { path, line: row.line, problem });
        };
        stripes[place][row.camera as usize].get_or_insert_default().push(row.pixel);
    }
    Ok(stripes)
}

fn text(path: &Path, limit_bytes: u64) -> Result<String, RecordingError> {
    read_text(path, limit_bytes).map_err(|source| RecordingError::Text { path: path.to_owned(), source })
}
