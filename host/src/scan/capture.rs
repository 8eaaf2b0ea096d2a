//! From stripes and joints to a cloud in the robot's base frame.

use nalgebra::{Isometry3, Point3, Unit};
use rayon::prelude::*;
use serde::Serialize;
use thiserror::Error;

use super::clock_offset::{ClockOffset, clock_offset};
use super::joints::{JointTrack, JointTrackError};
use super::profile::{ProfileCounts, ProfilePoint, ProfileSettings, StripePixel, profile};
use super::rig::Rig;
use crate::plan::arm::Arm;
use crate::surface::PointCloud;

/// One moment at which the cameras looked.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Sweep that it belongs to.
    pub sweep: u32,
    /// On the cameras' clock.
    pub time_s: f64,
    /// What each camera saw of the stripe, in the order of [`super::Camera::ALL`]; `None` when its image is missing.
    pub stripes: [Option<Vec<StripePixel>>; 2],
}

/// All that a scan by images delivers.
#[derive(Debug, Clone, PartialEq)]
pub struct Capture {
    /// The arm that carried the scanner.
    pub arm: Arm,
    /// The scanner.
    pub rig: Rig,
    /// In the order of time.
    pub frames: Vec<Frame>,
    /// The arm's joints.
    pub joints: JointTrack,
}

/// Where a capture that goes on from another begins.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Start {
    /// Number of its first frame.
    pub frame: u32,
    /// Number of its first sweep.
    pub sweep: u32,
    /// Time of the first joints.
    pub time_s: f64,
}

/// Time from one sweep to the next. What the arm does meanwhile is no matter: nobody looks.
pub(super) const PAUSE_S: f64 = 1.0;

/// How to measure a capture.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasureSettings {
    /// How the cameras are joined.
    pub profile: ProfileSettings,
    /// Whether to estimate the offset between the clocks and to apply it when it is beyond doubt.
    pub correct_clock: bool,
}

impl Default for MeasureSettings {
    fn default() -> Self {
        Self { profile: ProfileSettings::default(), correct_clock: true }
    }
}

/// A cloud, and how it came about.
#[derive(Debug, Clone, PartialEq)]
pub struct Measured {
    /// Points with lines of sight towards the laser, robot base frame.
    pub cloud: PointCloud,
    /// Frame that each point comes from.
    pub frame_of_point: Vec<u32>,
    /// The rest.
    pub report: MeasureReport,
}

/// Figures of a measurement.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MeasureReport {
    /// Frames of the capture.
    pub frames: usize,
    /// Images that were missing.
    pub missing_images: usize,
    /// What became of the stripes' pixels.
    pub pixels: ProfileCounts,
    /// The clocks of cameras and arm.
    pub clock: ClockOffset,
    /// Frames that the joints do not cover once the clocks are put right: left out.
    pub frames_lost_to_clock: usize,
}

/// Why a capture gives no cloud.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum MeasureError {
    /// A frame whose time the arm's joints do not cover.
    #[error("frame {frame} at {time_s} s: the arm's joints do not cover that time")]
    Uncovered {
        /// Place in the list, from 0.
        frame: usize,
        /// Its time.
        time_s: f64,
    },
    /// No stripe was seen.
    #[error("no frame shows a stripe that can be measured")]
    Nothing,
}

/// A profile, and where the scanner was.
pub(super) struct Placed {
    pub(super) sweep: u32,
    pub(super) time_s: f64,
    pub(super) points: Vec<ProfilePoint>,
}

impl Capture {
    /// Pose of the scanner in the base frame at a time of the arm's clock.
    pub(super) fn base_from_scanner(&self, time_s: f64) -> Option<Isometry3<f64>> {
        let q_rad = self.joints.at(time_s)?;
        Some(self.arm.base_from_palm(&q_rad) * self.rig.palm_from_scanner)
    }

    /// Where the next sweeps would begin.
    #[must_use]
    pub fn end(&self) -> Start {
        Start {
            frame: self.frames.len() as u32,
            sweep: self.frames.last().map_or(0, |frame| frame.sweep + 1),
            time_s: self.joints.samples().last().map_or(0.0, |sample| sample.time_s + PAUSE_S),
        }
    }

    /// This capture and one that begins at its end.
    ///
    /// # Errors
    /// When the other begins before this one ends.
    pub fn followed_by(mut self, other: Self) -> Result<Self, JointTrackError> {
        self.frames.extend(other.frames);
        Ok(Self { joints: self.joints.followed_by(other.joints)?, ..self })
    }

    /// Measures: points of the laser plane from pixels, joined from both cameras, placed by the arm's joints. The result
    /// does not depend on the number of threads.
    ///
    /// # Errors
    /// See [`MeasureError`].
    pub fn measure(&self, settings: &MeasureSettings) -> Result<Measured, MeasureError> {
        for (frame, Frame { time_s, .. }) in self.frames.iter().enumerate() {
            if self.joints.at(*time_s).is_none() {
                return Err(MeasureError::Uncovered { frame, time_s: *time_s });
            }
        }
        let (placed, counts): (Vec<Placed>, Vec<ProfileCounts>) = self
            .frames
            .par_iter()
            .map(|frame| {
                let stripes = [0, 1].map(|camera: usize| frame.stripes[camera].as_deref());
                let (points, counts) = profile(&self.rig, stripes, &settings.profile);
                (Placed { sweep: frame.sweep, time_s: frame.time_s, points }, counts)
            })
            .unzip();
        let mut pixels = ProfileCounts::default();
        counts.into_iter().for_each(|counts| pixels += counts);
        let clock = if settings.correct_clock { clock_offset(self, &placed) } else { ClockOffset::NotAsked };
        let mut measured = Measured {
            cloud: PointCloud::default(),
            frame_of_point: Vec::new(),
            report: MeasureReport {
                frames: self.frames.len(),
                missing_images: self.frames.iter().flat_map(|f| &f.stripes).filter(|s| s.is_none()).count(),
                pixels,
                clock,
                frames_lost_to_clock: 0,
            },
        };
        let (mut views, mut sweeps) = (Vec::new(), Vec::new());
        for (index, placed) in (0..).zip(&placed) {
            let Some(base_from_scanner) = self.base_from_scanner(placed.time_s + clock.applied_s()) else {
                measured.report.frames_lost_to_clock += 1;
                continue;
            };
            for point in &placed.points {
                let in_scanner = Point3::new(0.0, point.y_m, point.z_m);
                measured.cloud.points.push(base_from_scanner * in_scanner);
                views.push(base_from_scanner.rotation * Unit::new_normalize(-in_scanner.coords));
                measured.frame_of_point.push(index);
            }
            sweeps.extend(placed.points.iter().map(|_| u16::try_from(placed.sweep)));
        }
        measured.cloud.views = Some(views);
        // A recording may number its sweeps as it likes; beyond what a cloud can hold they are not told apart.
        measured.cloud.sweeps = sweeps.into_iter().collect::<Result<_, _>>().ok();
        if measured.cloud.is_empty() { Err(MeasureError::Nothing) } else { Ok(measured) }
    }
}
