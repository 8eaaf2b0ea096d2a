//! Leaving one sweep out at a time: what the others predict for it, and how much the mount hangs on it.

use nalgebra::{Matrix6, Vector3, Vector6};
use rayon::prelude::*;

use super::loss::Loss;
use super::problem::{Free, Problem, State, residuals_of};
use super::solve::{minimised, weighted_rms_m};
use super::uncertainty::Uncertainty;
use super::{Profile, Target};

/// A sweep that was left out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeftOut {
    /// Place of its target.
    pub target: usize,
    /// Its number.
    pub sweep: u32,
    /// Root mean square of its points' distances from the target, mount and target as all other sweeps have them; outliers
    /// aside.
    pub rms_m: f64,
    /// How far the mount turns without it, in the palm's axes.
    pub turn_rad: Vector3<f64>,
    /// How far the scanner's origin shifts without it.
    pub shift_m: Vector3<f64>,
}

/// All sweeps, each left out once.
#[derive(Debug, Clone, PartialEq)]
pub struct LeaveOneOut {
    /// In the order of targets and sweeps.
    pub sweeps: Vec<LeftOut>,
    /// Root mean square over the sweeps.
    pub rms_m: f64,
    /// The worst sweep's.
    pub max_rms_m: f64,
    /// Covariance of the mount by the jackknife (Efron 1982): it makes no assumption about what the errors within
    /// a sweep have in common, as those of the arm do.
    pub uncertainty: Uncertainty,
}

/// Targets and sweeps of profiles, in order, each once.
pub(super) fn groups(profiles: &[Profile]) -> Vec<(usize, u32)> {
    let mut groups: Vec<(usize, u32)> = profiles.iter().map(|p| (p.target, p.sweep)).collect();
    groups.sort_unstable();
    groups.dedup();
    groups
}

/// Refits without each sweep, from the state that all of them give.
pub(super) fn leave_one_out(
    targets: &[Target],
    profiles: &[Profile],
    all: &State,
    loss: Loss,
) -> LeaveOneOut {
    let sweeps: Vec<LeftOut> = groups(profiles)
        .into_par_iter()
        .map(|group| {
            let is_in = |profile: &&Profile| (profile.target, profile.sweep) == group;
            let others: Vec<Profile> = profiles.iter().filter(|p| !is_in(p)).cloned().collect();
            let free = Free { mount: true, radii: false };
            let state = minimised(&Problem::new(targets, &others, all.clone(), loss, free));
            let residuals = profiles.iter().filter(is_in).flat_map(|profile| residuals_of(profile, &state));
            let (before, without) = (&all.palm_from_scanner, &state.palm_from_scanner);
            LeftOut {
                target: group.0,
                sweep: group.1,
                rms_m: weighted_rms_m(residuals, loss),
                turn_rad: (without.rotation * before.rotation.inverse()).scaled_axis(),
                shift_m: without.translation.vector - before.translation.vector,
            }
        })
        .collect();
    let count = sweeps.len().max(1) as f64;
    let moves = || {
        sweeps.iter().map(|s| {
            let [turn, shift] = [s.turn_rad, s.shift_m];
            Vector6::new(turn.x, turn.y, turn.z, shift.x, shift.y, shift.z)
        })
    };
    let mean = moves().sum::<Vector6<f64>>() / count;
    let spread: Matrix6<f64> = moves().map(|m| (m - mean) * (m - mean).transpose()).sum();
    let rms_m = (sweeps.iter().map(|s| s.rms_m.powi(2)).sum::<f64>() / count).sqrt();
    let max_rms_m = sweeps.iter().map(|s| s.rms_m).fold(0.0, f64::max);
    LeaveOneOut {
        sweeps,
        rms_m,
        max_rms_m,
        uncertainty: Uncertainty { covariance: spread * ((count - 1.0) / count) },
    }
}
