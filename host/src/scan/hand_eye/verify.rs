//! A mount put to the test on a sphere that it was not calibrated with.

use nalgebra::{Isometry3, Point3};

use super::error::HandEyeError;
use super::leave_out::groups;
use super::problem::{Free, LENGTH_M, Located, Problem};
use super::seed::{cuts, located};
use super::solve::{minimised, refined, rms_m};
use super::uncertainty::covariance;
use super::{Profile, Target};

/// What an independent sphere says of a mount.
#[derive(Debug, Clone, PartialEq)]
pub struct Verification {
    /// Centre of the sphere that fits the cloud of all sweeps, base frame.
    pub center_m: Point3<f64>,
    /// Its radius.
    pub radius_m: f64,
    /// Standard deviation of the radius, from the noise of the points.
    pub radius_std_m: f64,
    /// Root mean square of the cloud's distances from that sphere, outliers aside. A mount that is off moves the sweeps
    /// against each other, which widens it.
    pub rms_m: f64,
    /// Points of the cloud.
    pub points: usize,
    /// How far the centre by each sweep alone lies from the centre by all, in the order of the sweeps.
    pub center_offsets_m: Vec<f64>,
}

impl Verification {
    /// Root mean square of the centres' offsets: how far apart a mount, and the arm, put the same thing in two sweeps.
    #[must_use]
    pub fn center_rms_m(&self) -> f64 {
        let squares: f64 = self.center_offsets_m.iter().map(|offset| offset * offset).sum();
        (squares / self.center_offsets_m.len().max(1) as f64).sqrt()
    }
}

/// Fits a sphere to profiles as the mount places them. All are of the one sphere, whatever their target says; `radius_m`
/// is its radius if known, to find the centre of a single sweep with.
///
/// # Errors
/// [`HandEyeError::NoSphere`], [`HandEyeError::TooFewPoses`] and [`HandEyeError::NotFinite`].
pub fn verify(
    profiles: &[Profile],
    radius_m: Option<f64>,
    palm_from_scanner: &Isometry3<f64>,
) -> Result<Verification, HandEyeError> {
    let profiles: Vec<Profile> = profiles.iter().map(|p| Profile { target: 0, ..p.clone() }).collect();
    let finite = |p: &Profile| p.points_m.iter().flatten().all(|x| x.is_finite());
    if let Some(profile) = profiles.iter().position(|p| !finite(p)) {
        return Err(HandEyeError::NotFinite { profile });
    }
    let sweeps = groups(&profiles);
    if sweeps.len() < 2 {
        return Err(HandEyeError::TooFewPoses { target: 0, found: sweeps.len(), needed: 2 });
    }
    let targets = [Target::Sphere { radius_m }];
    let start = located(&targets, &profiles, &cuts(&targets, &profiles)?, *palm_from_scanner);
    let free = Free { mount: false, radii: true };
    let (state, loss) = refined(&targets, &profiles, start, free);
    let Located::Sphere { center_m, radius_m: found_m } = state.targets[0] else {
        return Err(HandEyeError::NoSphere { target: 0 });
    };
    let problem = Problem::new(&targets, &profiles, state.clone(), loss, free);
    let radius_variance = covariance(&problem).parameters[(3, 3)];
    // One sweep sees a cap, from which centre and radius do not follow together.
    let known = [Target::Sphere { radius_m: Some(radius_m.unwrap_or(found_m)) }];
    let mut held = state.clone();
    held.targets[0] = Located::Sphere { center_m, radius_m: radius_m.unwrap_or(found_m) };
    let offset_m = |&(_, sweep): &(usize, u32)| {
        let own: Vec<Profile> = profiles.iter().filter(|p| p.sweep == sweep).cloned().collect();
        let free = Free { mount: false, radii: false };
        let alone = minimised(&Problem::new(&known, &own, held.clone(), loss, free));
        match alone.targets[0] {
            Located::Sphere { center_m: center, .. } => (center - center_m).norm(),
            Located::Plane { .. } => f64::INFINITY,
        }
    };
    Ok(Verification {
        center_m,
        radius_m: found_m,
        radius_std_m: LENGTH_M * radius_variance.max(0.0).sqrt(),
        rms_m: rms_m(&profiles, &state, loss),
        points: profiles.iter().map(|profile| profile.points_m.len()).sum(),
        center_offsets_m: sweeps.iter().map(offset_m).collect(),
    })
}
