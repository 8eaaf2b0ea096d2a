//! Profiles of a sphere from a recording or a virtual capture.

use rayon::prelude::*;

use super::Profile;
use super::arc::fit_arc;
use crate::scan::capture::Capture;
use crate::scan::profile::{ProfileSettings, profile};

/// Profiles that show the sphere.
#[derive(Debug, Clone, PartialEq)]
pub struct FoundProfiles {
    /// In the order of the frames; numbers of sweeps are the capture's.
    pub profiles: Vec<Profile>,
    /// Frames of the capture.
    pub frames: usize,
    /// Sweeps of the capture.
    pub sweeps: usize,
}

/// Finds the sphere in each frame of a capture; the rest of the stripe, and frames that do not show it, are left out.
///
/// The mount and the clocks of the capture are as it says: the clocks' offset is not estimated, because that needs a mount.
#[must_use]
pub fn sphere_profiles(capture: &Capture, target: usize, radius_m: Option<f64>) -> FoundProfiles {
    let settings = ProfileSettings::default();
    let profiles = capture
        .frames
        .par_iter()
        .filter_map(|frame| {
            let q_rad = capture.joints.at(frame.time_s)?;
            let stripes = [0, 1].map(|camera: usize| frame.stripes[camera].as_deref());
            let points: Vec<[f64; 2]> =
                profile(&capture.rig, stripes, &settings).0.iter().map(|p| [p.y_m, p.z_m]).collect();
            let fit = fit_arc(&points, radius_m)?;
            Some(Profile {
                target,
                sweep: frame.sweep,
                base_from_palm: capture.arm.base_from_palm(&q_rad),
                points_m: fit.points_m,
            })
        })
        .collect();
    let sweeps = capture.frames.chunk_by(|a, b| a.sweep == b.sweep).count();
    FoundProfiles { profiles, frames: capture.frames.len(), sweeps }
}
