//! A capture of the virtual cell: frames rendered along the sweeps, and the stripes found in them.

use image::GrayImage;
use rayon::prelude::*;

use super::Camera;
use super::capture::{Capture, Frame, PAUSE_S, Start};
use super::joints::{JointSample, JointTrack, JointTrackError};
use super::profile::stripe_pixels;
use super::render::Renderer;
use super::rig::Rig;
use super::stripe::{Across, StripeExtractor};
use super::sweep::Sweep;
use crate::plan::arm::Arm;

/// A sweep that the arm can make.
#[derive(Debug, Clone, PartialEq)]
pub struct CarriedSweep {
    /// The stripes.
    pub sweep: Sweep,
    /// What the joints do, on the sweep's own time; from [`super::joints::carry`].
    pub joints: Vec<JointSample>,
}

/// Frames and joints on the clocks of the cell, before anything is seen.
struct Timing {
    /// Sweep, true time, and place in its sweep of each frame.
    frames: Vec<(usize, f64, usize)>,
    joints: Vec<JointSample>,
}

fn timing(sweeps: &[CarriedSweep], mut start_s: f64) -> Timing {
    let mut timing = Timing { frames: Vec::new(), joints: Vec::new() };
    for (index, carried) in sweeps.iter().enumerate() {
        let first_s = carried.joints.first().map_or(0.0, |sample| sample.time_s);
        let at = |time_s: f64| stamp(start_s + time_s - first_s);
        let stripes = carried.sweep.stripes.iter().enumerate();
        timing.frames.extend(stripes.map(|(place, stripe)| (index, at(stripe.time_s), place)));
        timing.joints.extend(carried.joints.iter().map(|s| JointSample { time_s: at(s.time_s), ..*s }));
        start_s = timing.joints.last().map_or(start_s, |sample| sample.time_s) + PAUSE_S;
    }
    timing
}

/// Clocks count microseconds.
fn stamp(time_s: f64) -> f64 {
    (time_s * 1e6).round() / 1e6
}

/// What is done with each image as soon as it is there: its frame, its camera, and the image.
pub type Sink<'a, E> = &'a (dyn Fn(u32, Camera, &GrayImage) -> Result<(), E> + Sync);

/// The clocks and the noise of the virtual cell.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CellSettings {
    /// How early the frames' time stamps are: so much has to be added to get the arm's time.
    pub offset_s: f64,
    /// Seed of all noise.
    pub seed: u64,
}

/// Why a capture failed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CaptureError<E> {
    /// The joints of the sweeps make no track.
    #[error("the arm's joints: {0}")]
    Joints(JointTrackError),
    /// The sink's error.
    #[error("{0}")]
    Sink(E),
}

/// Renders what both cameras see along the sweeps, hands each image to `sink`, and finds the stripes. `start` is the end of
/// the capture that this one follows, if any.
///
/// The same seed gives the same capture on any number of threads.
///
/// # Errors
/// See [`CaptureError`].
pub fn virtual_capture<E: Send>(
    renderer: &Renderer,
    arm: &Arm,
    rig: &Rig,
    sweeps: &[CarriedSweep],
    start: Start,
    settings: CellSettings,
    sink: Sink<'_, E>,
) -> Result<Capture, CaptureError<E>> {
    let Timing { frames, joints } = timing(sweeps, start.time_s);
    let CellSettings { offset_s, seed } = settings;
    let joints = JointTrack::new(joints).map_err(CaptureError::Joints)?;
    let windows = [0, 1].map(|camera: usize| rig.cameras[camera].window);
    let extractor = StripeExtractor::default();
    let frames = frames
        .par_iter()
        .enumerate()
        .map(|(index, &(sweep, time_s, place))| {
            let pose = &sweeps[sweep].sweep.stripes[place].base_from_scanner;
            let number = start.frame + index as u32;
            let images = renderer.exposures(pose, windows, seed, number);
            for (camera, image) in Camera::ALL.into_iter().zip(&images) {
                sink(number, camera, image).map_err(CaptureError::Sink)?;
            }
            let found = |image: &GrayImage| stripe_pixels(&extractor.image(image, Across::Columns));
            let stripes = [Some(found(&images[0])), Some(found(&images[1]))];
            Ok(Frame { sweep: start.sweep + sweep as u32, time_s: stamp(time_s - offset_s), stripes })
        })
        .collect::<Result<Vec<Frame>, CaptureError<E>>>()?;
    Ok(Capture { arm: arm.clone(), rig: rig.clone(), frames, joints })
}

#[cfg(test)]
mod tests;
