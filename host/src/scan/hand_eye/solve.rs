//! From profiles to the mount: seed, robust refinement of everything together, checks.

use std::f64::consts::FRAC_PI_2;

use nalgebra::{DVector, Isometry3, UnitQuaternion, Vector3};
use rayon::prelude::*;

use super::arc::LARGEST_RADIUS_M;
use super::error::HandEyeError;
use super::leave_out::{LeaveOneOut, groups, leave_one_out};
use super::loss::{Loss, robust_scale_m};
use super::problem::{Free, LENGTH_M, Located, Problem, State, residuals_of};
use super::seed::{check_poses, cuts, from_cuts, half_turned, located, placed};
use super::uncertainty::{Uncertainty, WeakDirection, covariance};
use super::{Profile, Target};
use crate::scan::levenberg::{Levenberg, Step};

/// A mount, and how good it is.
#[derive(Debug, Clone, PartialEq)]
pub struct HandEye {
    /// The mount.
    pub palm_from_scanner: Isometry3<f64>,
    /// The targets, in their order; radii that were given are as given.
    pub targets: Vec<Located>,
    /// Radii as the profiles alone say, and their standard deviations; in the order of the targets.
    pub measured_radii_m: Vec<Option<[f64; 2]>>,
    /// Points that were used.
    pub points: usize,
    /// Of them, those so far off that they count nothing.
    pub outliers: usize,
    /// Standard deviation of the other points' distances from the targets.
    pub noise_m: f64,
    /// From the noise of the points, taken as independent: what more points would improve.
    pub by_points: Uncertainty,
    /// Worst over best determined direction of the mount, lengths counted in 0.2 m.
    pub condition: f64,
    /// The direction that is known worst.
    pub weakest: WeakDirection,
    /// Each sweep left out once. Its uncertainty knows of errors that the points of a sweep have in common.
    pub leave_one_out: LeaveOneOut,
}

impl HandEye {
    /// The larger of the two uncertainties, measured at the distance where the scanner looks.
    #[must_use]
    pub fn uncertainty(&self) -> Uncertainty {
        let arm = self.palm_from_scanner.rotation * Vector3::z() * LENGTH_M;
        let (points, sweeps) = (self.by_points, self.leave_one_out.uncertainty);
        if sweeps.point_std_m(&arm) >= points.point_std_m(&arm) { sweeps } else { points }
    }
}

/// Sweeps that a lone target has to be seen in; each of several may be seen in fewer.
const LEAST_SWEEPS: usize = 5;
const LEAST_SWEEPS_OF_SEVERAL: usize = 3;
/// Beyond it, a direction of the mount hangs on noise.
const LARGEST_CONDITION: f64 = 1000.0;
/// Points that lie farther off, in the middle, are not those of the targets.
const LARGEST_NOISE_M: f64 = 0.001;
/// Nor are they when more of them are outliers.
const LARGEST_OUTLIER_SHARE: f64 = 0.3;
const FAR_M: f64 = 0.005;
/// How much the radius of a sphere may differ from what was said, beyond four standard deviations.
const RADIUS_TOLERANCE_M: f64 = 0.0002;
/// Rounds of loss and scale; they end when the scale stays the same within this share.
const CAUCHY_ROUNDS: u32 = 20;
const TUKEY_ROUNDS: u32 = 6;
const SAME_SCALE: f64 = 0.01;
const MAX_ITERATIONS: u32 = 60;
/// An iteration that gains a smaller share is the last.
const LEAST_IMPROVEMENT: f64 = 1e-10;

/// Finds the mount of the scanner on the palm, and where the targets are.
///
/// Without a `start` there has to be a sphere, and the mount follows from nothing; planes alone need one, within some
/// 20 mm and 10 degrees.
///
/// # Errors
/// See [`HandEyeError`].
pub fn calibrate_mount(
    targets: &[Target],
    profiles: &[Profile],
    start: Option<&Isometry3<f64>>,
) -> Result<HandEye, HandEyeError> {
    check(targets, profiles)?;
    let cuts = match cuts(targets, profiles) {
        Err(HandEyeError::NoStart) if start.is_some() => Vec::new(),
        cuts => cuts?,
    };
    // The radii first say for themselves what they are; but the way there is safer with those that are known.
    let known = targets.iter().any(|target| matches!(target, Target::Sphere { radius_m: Some(_) }));
    let from = |start: &Isometry3<f64>| {
        let state = located(targets, profiles, &cuts, *start);
        let by_way_of = |held: bool| {
            let state = if held {
                refined(targets, profiles, state.clone(), Free { mount: true, radii: false }).0
            } else {
                state.clone()
            };
            let (state, loss) = refined(targets, profiles, state, Free { mount: true, radii: true });
            Refined { fit: Goodness::of(profiles, &state, loss), state, loss }
        };
        let first = by_way_of(known);
        // A radius that was given wrong may have led astray.
        if known && !first.fit.is_plausible() { first.better(by_way_of(false)) } else { first }
    };
    let mut best = match start {
        Some(start) => from(start),
        None => {
            check_poses(targets.len(), &cuts)?;
            from(&from_cuts(targets, &cuts))
        }
    };
    if start.is_none() {
        if !best.fit.is_plausible() {
            let starts: Vec<_> = cube_rotations().iter().map(|turn| placed(targets, &cuts, turn)).collect();
            let found: Vec<Refined> = starts.par_iter().map(from).collect();
            best = found.into_iter().fold(best, Refined::better);
        }
        if let Some(start) = half_turned(&best.state.palm_from_scanner, &cuts) {
            best = from(&start).better(best);
        }
    }
    let Refined { fit, mut state, loss } = best;
    if !fit.is_plausible() {
        return Err(HandEyeError::Inconsistent { noise_m: fit.noise_m, outlier_share: fit.outlier_share });
    }
    let measured_radii_m = measured_radii(targets, profiles, &state, loss)?;
    for (target, located) in targets.iter().zip(&mut state.targets) {
        if let (Target::Sphere { radius_m: Some(given) }, Located::Sphere { radius_m, .. }) =
            (target, located)
        {
            *radius_m = *given;
        }
    }
    let free = Free { mount: true, radii: false };
    let (state, loss) = refined(targets, profiles, state, free);
    let covariance = covariance(&Problem::new(targets, profiles, state.clone(), loss, free));
    let (condition, weakest) = (covariance.condition, covariance.weakest);
    if condition > LARGEST_CONDITION {
        return Err(HandEyeError::Undetermined { condition, direction: weakest });
    }
    let residuals = Problem::residuals_m(profiles, &state);
    Ok(HandEye {
        palm_from_scanner: state.palm_from_scanner,
        measured_radii_m,
        points: residuals.len(),
        outliers: residuals.iter().filter(|&&residual| loss.weight(residual) == 0.0).count(),
        noise_m: Problem::scale_m(profiles, &state),
        by_points: Uncertainty::of_parameters(&covariance.parameters),
        condition,
        weakest,
        leave_one_out: leave_one_out(targets, profiles, &state, loss),
        targets: state.targets,
    })
}

/// Where one start led to.
struct Refined {
    state: State,
    loss: Loss,
    fit: Goodness,
}

impl Refined {
    fn better(self, other: Self) -> Self {
        let rank = |fit: &Goodness| if fit.is_round { fit.misfit_m } else { f64::INFINITY };
        if rank(&other.fit) < rank(&self.fit) { other } else { self }
    }
}

/// How well a state fits.
struct Goodness {
    noise_m: f64,
    outlier_share: f64,
    /// Root mean square of residuals, none counted for more than [`FAR_M`]. Noise alone would not do to compare fits: it
    /// speaks of the better half of the points, and a wrong mount may fit those of some sweeps perfectly.
    misfit_m: f64,
    /// Whether all spheres are as small as spheres are looked for: one that has grown without bound is a plane, in which
    /// a wrong mount may lay the caps that the sweeps see.
    is_round: bool,
}

impl Goodness {
    fn of(profiles: &[Profile], state: &State, loss: Loss) -> Self {
        let residuals = Problem::residuals_m(profiles, state);
        let count = residuals.len().max(1) as f64;
        let squares: f64 = residuals.iter().map(|residual| residual.abs().min(FAR_M).powi(2)).sum();
        let outliers = residuals.iter().filter(|&&residual| loss.weight(residual) == 0.0).count();
        let round = |target: &Located| match target {
            Located::Sphere { radius_m, .. } => (0.0..2.0 * LARGEST_RADIUS_M).contains(radius_m),
            Located::Plane { .. } => true,
        };
        Self {
            is_round: state.targets.iter().all(round),
            noise_m: robust_scale_m(residuals),
            outlier_share: outliers as f64 / count,
            misfit_m: (squares / count).sqrt(),
        }
    }

    fn is_plausible(&self) -> bool {
        self.is_round && self.noise_m <= LARGEST_NOISE_M && self.outlier_share <= LARGEST_OUTLIER_SHARE
    }
}

/// The 24 rotations that bring a cube's edges onto its edges: none is farther than 63 degrees from one of them.
fn cube_rotations() -> Vec<UnitQuaternion<f64>> {
    let quarter = |axis: Vector3<f64>, times: u32| {
        UnitQuaternion::from_scaled_axis(axis * (f64::from(times) * FRAC_PI_2))
    };
    let faces = (0..4).map(|times| quarter(Vector3::x(), times));
    let faces = faces.chain([1, 3].map(|times| quarter(Vector3::y(), times)));
    faces.flat_map(|face| (0..4).map(move |times| face * quarter(Vector3::z(), times))).collect()
}

fn check(targets: &[Target], profiles: &[Profile]) -> Result<(), HandEyeError> {
    for target in targets {
        if let Target::Sphere { radius_m: Some(radius_m) } = *target
            && !(radius_m.is_finite() && radius_m > 0.0)
        {
            return Err(HandEyeError::NoRadius { radius_m });
        }
    }
    for (index, profile) in profiles.iter().enumerate() {
        if profile.target >= targets.len() {
            return Err(HandEyeError::UnknownTarget { profile: index, target: profile.target });
        }
        let pose = &profile.base_from_palm;
        let numbers = pose.translation.vector.iter().chain(pose.rotation.coords.iter());
        if !numbers.chain(profile.points_m.iter().flatten()).all(|x| x.is_finite()) {
            return Err(HandEyeError::NotFinite { profile: index });
        }
    }
    let groups = groups(profiles);
    let needed = if targets.len() == 1 { LEAST_SWEEPS } else { LEAST_SWEEPS_OF_SEVERAL };
    for target in 0..targets.len() {
        let found = groups.iter().filter(|group| group.0 == target).count();
        if found < needed {
            return Err(HandEyeError::TooFewPoses { target, found, needed });
        }
    }
    if targets.is_empty() { Err(HandEyeError::NoStart) } else { Ok(()) }
}

/// Radii of all spheres, free as they are in `state`.
fn measured_radii(
    targets: &[Target],
    profiles: &[Profile],
    state: &State,
    loss: Loss,
) -> Result<Vec<Option<[f64; 2]>>, HandEyeError> {
    let free = Free { mount: true, radii: true };
    let problem = Problem::new(targets, profiles, state.clone(), loss, free);
    let covariance = covariance(&problem);
    let radius = |(index, target): (usize, &Target)| {
        let Target::Sphere { radius_m: given } = target else { return Ok(None) };
        let Located::Sphere { radius_m: found_m, .. } = state.targets[index] else { return Ok(None) };
        let place = problem.parameter(index, 3);
        let std_m = LENGTH_M * covariance.parameters[(place, place)].max(0.0).sqrt();
        match given {
            Some(given_m) if (found_m - given_m).abs() > RADIUS_TOLERANCE_M + 4.0 * std_m => {
                Err(HandEyeError::WrongRadius { target: index, given_m: *given_m, found_m, std_m })
            }
            _ => Ok(Some([found_m, std_m])),
        }
    };
    targets.iter().enumerate().map(radius).collect()
}

/// The state of least robust cost near the given one, and the loss at whose scale it is.
pub(super) fn refined(
    targets: &[Target],
    profiles: &[Profile],
    mut state: State,
    free: Free,
) -> (State, Loss) {
    let mut scale_m = Problem::scale_m(profiles, &state);
    for (rounds, loss) in [(CAUCHY_ROUNDS, Loss::cauchy as fn(f64) -> Loss), (TUKEY_ROUNDS, Loss::tukey)] {
        for _ in 0..rounds {
            state = minimised(&Problem::new(targets, profiles, state, loss(scale_m), free));
            let before_m = scale_m;
            scale_m = Problem::scale_m(profiles, &state);
            if (scale_m - before_m).abs() < SAME_SCALE * before_m {
                break;
            }
        }
    }
    let loss = Loss::tukey(scale_m);
    (minimised(&Problem::new(targets, profiles, state, loss, free)), loss)
}

/// The minimum of a problem, from where it stands.
pub(super) fn minimised(problem: &Problem<'_>) -> State {
    let mut fit = Levenberg::new(problem, DVector::zeros(problem.parameters()), 0.0);
    for _ in 0..MAX_ITERATIONS {
        match fit.step(problem) {
            Step::Improved(share) if share >= LEAST_IMPROVEMENT => {}
            Step::Improved(_) | Step::Stuck => break,
        }
    }
    problem.moved(&fit.parameters)
}

/// Root mean square of residuals that count by their weights.
pub(super) fn weighted_rms_m(residuals_m: impl Iterator<Item = f64>, loss: Loss) -> f64 {
    let (mut squares, mut weights) = (0.0, 0.0);
    for residual in residuals_m {
        let weight = loss.weight(residual);
        squares += weight * residual * residual;
        weights += weight;
    }
    if weights > 0.0 { (squares / weights).sqrt() } else { f64::INFINITY }
}

/// Robust root mean square of profiles about a state.
pub(super) fn rms_m(profiles: &[Profile], state: &State, loss: Loss) -> f64 {
    weighted_rms_m(profiles.iter().flat_map(|profile| residuals_of(profile, state)), loss)
}
