//! Hand-eye calibration: where the scanner sits on the palm, from stripes on spheres and planes that the arm carried the
//! scanner past.
//!
//! A line sensor sees no pose of a target, only a curve in its own plane, so the classical `A X = X B` has nothing to
//! work on. Each profile of a sphere gives a circle instead, whose centre is the sphere's up to the unknown side of the
//! laser plane. From many poses of the palm a closed form follows for the mount and the spheres' centres ([`seed`]); all
//! points then refine mount, spheres and planes together, robustly ([`calibrate_mount`]). Where the mount stays unknown
//! because the arm moved too little, the error says which motion is missing. Every result comes with its covariance,
//! with what each sweep says about it when it is left out, and can be verified on an independent sphere ([`verify`]).
//!
//! The scanner frame is that of [`super::instrument`]: profiles lie in its plane x = 0.
mod arc;
mod capture;
mod cell;
mod error;
mod file;
mod leave_out;
mod loss;
mod problem;
mod seed;
mod solve;
#[cfg(test)]
mod tests;
mod uncertainty;
mod verify;

pub use arc::{Arc, ArcFit, fit_arc};
pub use capture::{FoundProfiles, sphere_profiles};
pub use cell::{ball, ball_sweeps, displaced_mount};
pub use error::HandEyeError;
pub use file::{MountFile, MountFileError};
pub use leave_out::{LeaveOneOut, LeftOut};
pub use problem::Located;
pub use seed::seed;
pub use solve::{HandEye, calibrate_mount};
pub use uncertainty::{Uncertainty, WeakDirection};
pub use verify::{Verification, verify};

use nalgebra::Isometry3;

/// What the scanner looked at. It stood still; where, is not known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Target {
    /// A ball.
    Sphere {
        /// Its radius, if it was measured otherwise.
        radius_m: Option<f64>,
    },
    /// A flat surface.
    Plane,
}

/// One stripe on a target, and where the palm was.
#[derive(Debug, Clone, PartialEq)]
pub struct Profile {
    /// Place of the target in the list.
    pub target: usize,
    /// Profiles of one motion of the arm. The arm's errors within a sweep resemble each other, so that sweeps, not
    /// profiles, are left out one at a time. A pose that was taken by itself is a sweep of its own.
    pub sweep: u32,
    /// What the arm says.
    pub base_from_palm: Isometry3<f64>,
    /// Points of the target in the laser plane, scanner frame: y along the stripe, z away from the laser.
    pub points_m: Vec<[f64; 2]>,
}
