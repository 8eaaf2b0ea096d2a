//! The tables of a recording: CSV with a header; blank lines and lines that begin with `#` are passed over.

use std::io::{self, Write};
use std::path::Path;

use super::error::{RecordingError, RowProblem};
use crate::scan::Camera;
use crate::scan::capture::Frame;
use crate::scan::joints::{JointSample, JointTrack};
use crate::scan::profile::StripePixel;
use crate::scan::rig::StripeCamera;
use crate::scan::stripe::StripeCenter;

const FRAME_COLUMNS: [&str; 3] = ["frame", "sweep", "t_s"];
const JOINT_COLUMNS: [&str; 7] = ["t_s", "q1", "q2", "q3", "q4", "q5", "q6"];
const STRIPE_COLUMNS: [&str; 9] =
    ["frame", "camera", "u_px", "v_px", "width_px", "peak", "asymmetry", "saturated_px", "trusted"];

/// A row of `frames.csv`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct FrameRow {
    pub(super) line: usize,
    pub(super) frame: u32,
    pub(super) sweep: u32,
    pub(super) time_s: f64,
}

/// A row of `stripes.csv`.
pub(super) struct StripeRow {
    pub(super) line: usize,
    pub(super) frame: u32,
    pub(super) camera: Camera,
    pub(super) pixel: StripePixel,
}

/// One line of a table.
struct Row<'a> {
    path: &'a Path,
    line: usize,
    columns: &'static [&'static str],
    cells: Vec<&'a str>,
}

impl Row<'_> {
    fn wrong(&self, problem: RowProblem) -> RecordingError {
        RecordingError::Row { path: self.path.to_owned(), line: self.line, problem }
    }

    fn value_is_wrong(&self, column: usize) -> RecordingError {
        self.wrong(RowProblem::Value {
            column: self.columns[column].to_owned(),
            found: shorten(self.cells[column]),
        })
    }

    fn number(&self, column: usize) -> Result<f64, RecordingError> {
        let value = self.cells[column].parse::<f64>().ok().filter(|x| x.is_finite());
        value.ok_or_else(|| self.value_is_wrong(column))
    }

    fn whole(&self, column: usize) -> Result<u32, RecordingError> {
        self.cells[column].parse().map_err(|_| self.value_is_wrong(column))
    }
}

/// Enough of a text to recognise it.
fn shorten(text: &str) -> String {
    text.chars().take(40).collect()
}

/// Goes through the rows of a table.
fn rows<T>(
    path: &Path,
    text: &str,
    columns: &'static [&'static str],
    mut read: impl FnMut(Row<'_>) -> Result<T, RecordingError>,
) -> Result<Vec<T>, RecordingError> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let lines = text.lines().enumerate().map(|(i, line)| (i + 1, line.trim()));
    let mut content = lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
    let wrong = |line, problem| RecordingError::Row { path: path.to_owned(), line, problem };
    let (line, header) = content.next().unwrap_or((1, ""));
    if !header.split(',').map(str::trim).eq(columns.iter().copied()) {
        return Err(wrong(line, RowProblem::Header { wanted: columns.join(","), found: shorten(header) }));
    }
    content
        .map(|(line, row)| {
            let cells: Vec<&str> = row.split(',').map(str::trim).collect();
            if cells.len() != columns.len() {
                return Err(wrong(line, RowProblem::Columns { found: cells.len(), wanted: columns.len() }));
            }
            read(Row { path, line, columns, cells })
        })
        .collect()
}

pub(super) fn read_frames(path: &Path, text: &str) -> Result<Vec<FrameRow>, RecordingError> {
    let mut before: Option<FrameRow> = None;
    let frames = rows(path, text, &FRAME_COLUMNS, |row| {
        let frame =
            FrameRow { line: row.line, frame: row.whole(0)?, sweep: row.whole(1)?, time_s: row.number(2)? };
        if let Some(before) = before {
            if frame.frame <= before.frame {
                return Err(row.wrong(RowProblem::FrameOrder { frame: frame.frame, before: before.frame }));
            }
            if frame.time_s <= before.time_s {
                return Err(row.wrong(RowProblem::Time { time_s: frame.time_s, before_s: before.time_s }));
            }
        }
        before = Some(frame);
        Ok(frame)
    })?;
    if frames.is_empty() {
        return Err(RecordingError::Nothing { path: path.to_owned(), what: "frames" });
    }
    Ok(frames)
}

pub(super) fn write_frames(writer: &mut dyn Write, frames: &[Frame]) -> io::Result<()> {
    writeln!(writer, "{}", FRAME_COLUMNS.join(","))?;
    for (index, frame) in frames.iter().enumerate() {
        writeln!(writer, "{index},{},{}", frame.sweep, frame.time_s)?;
    }
    Ok(())
}

pub(super) fn read_joints(path: &Path, text: &str) -> Result<JointTrack, RecordingError> {
    let mut track = JointTrack::default();
    rows(path, text, &JOINT_COLUMNS, |row| {
        let time_s = row.number(0)?;
        let mut q_rad = [0.0; 6];
        for (axis, q) in q_rad.iter_mut().enumerate() {
            *q = row.number(axis + 1)?;
        }
        track.push(JointSample { time_s, q_rad }).map_err(|error| row.wrong(error.into()))
    })?;
    if track.samples().is_empty() {
        return Err(RecordingError::Nothing { path: path.to_owned(), what: "joints" });
    }
    Ok(track)
}

pub(super) fn write_joints(writer: &mut dyn Write, samples: &[JointSample]) -> io::Result<()> {
    writeln!(writer, "{}", JOINT_COLUMNS.join(","))?;
    for JointSample { time_s, q_rad: [a, b, c, d, e, f] } in samples {
        writeln!(writer, "{time_s},{a},{b},{c},{d},{e},{f}")?;
    }
    Ok(())
}

pub(super) fn read_stripes(
    path: &Path,
    text: &str,
    cameras: &[StripeCamera; 2],
) -> Result<Vec<StripeRow>, RecordingError> {
    rows(path, text, &STRIPE_COLUMNS, |row| {
        let camera = Camera::ALL.into_iter().find(|camera| camera.name() == row.cells[1]);
        let camera = camera.ok_or_else(|| row.value_is_wrong(1))?;
        let trusted = match row.cells[8] {
            "0" => false,
            "1" => true,
            _ => return Err(row.value_is_wrong(8)),
        };
        let center = StripeCenter {
            position_px: row.number(3)?,
            width_px: row.number(4)?,
            peak: row.number(5)?,
            asymmetry: row.number(6)?,
            saturated_px: row.whole(7)?,
        };
        let column = row.whole(2)?;
        let StripeCamera { columns_px, window, .. } = cameras[camera as usize];
        if column >= columns_px || !(-0.5..=f64::from(window.rows_px) - 0.5).contains(&center.position_px) {
            return Err(row.wrong(RowProblem::OutsideFrame { columns_px, rows_px: window.rows_px }));
        }
        Ok(StripeRow {
            line: row.line,
            frame: row.whole(0)?,
            camera,
            pixel: StripePixel { column, center, trusted },
        })
    })
}

pub(super) fn write_stripes(writer: &mut dyn Write, frames: &[Frame]) -> io::Result<()> {
    writeln!(writer, "{}", STRIPE_COLUMNS.join(","))?;
    for (index, frame) in frames.iter().enumerate() {
        for (camera, pixels) in Camera::ALL.into_iter().zip(&frame.stripes) {
            for StripePixel { column, center, trusted } in pixels.iter().flatten() {
                let StripeCenter { position_px, width_px, peak, asymmetry, saturated_px } = center;
                writeln!(
                    writer,
                    "{index},{},{column},{position_px},{width_px},{peak},{asymmetry},{saturated_px},{}",
                    camera.name(),
                    u8::from(*trusted)
                )?;
            }
        }
    }
    Ok(())
}
