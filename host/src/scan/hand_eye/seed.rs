//! A mount from scratch: the closed form for spheres.
//!
//! Every circle that a profile cuts out of a sphere has the sphere's centre straight above or below its own, at the
//! height `h = +-sqrt(r^2 - rho^2)` out of the laser plane. With the palm's pose (R, t), the centre c, and the mount's
//! axes a (along the stripe), b (away from the laser) and e = a x b, and its origin p,
//!
//! ```text
//! R (a y + b z + e h + p) + t = c
//! ```
//!
//! which is linear in a, b, p and c once `e h` is known. First h is taken for zero, which is right in the mean over a
//! sweep across the sphere; the two axes found are brought to right angles (Procrustes), and the mount tells on which
//! side of the plane each centre lies. That is repeated until the sides stay the same.
//!
//! Where the ball was nearly always at the same depth, b and p are hardly told apart before the axes are made orthogonal,
//! and the result may be far off: [`placed`] then begins from any orientation, and [`half_turned`] from the other side.

use std::f64::consts::PI;

use nalgebra::{
    DMatrix, DVector, Isometry3, Matrix2, Matrix3, Matrix3x2, Point3, Rotation3, SymmetricEigen,
    Translation3, UnitQuaternion, Vector2, Vector3,
};

use super::arc::{Arc, fit_arc};
use super::error::HandEyeError;
use super::problem::{LENGTH_M, Located, State};
use super::{Profile, Target};

/// A profile's circle, and where the palm was.
pub(super) struct Cut {
    pub(super) target: usize,
    base_from_palm: Isometry3<f64>,
    arc: Arc,
    /// Distance of the sphere's centre from the laser plane, either way.
    height_m: f64,
}

/// Noise of a circle's centre, to begin with.
const CENTER_NOISE_M: f64 = 0.0005;
/// Turns of the palm about other axes than one, below which the mount cannot be told.
const LEAST_SPREAD_RAD: f64 = 0.05;
/// Spread of the ball's places in the field about a line, below which a turn about it is not told.
const LEAST_FIELD_M: f64 = 0.001;
/// Spread about a line above which half a turn about it is plainly wrong.
const NEAR_LINE_M: f64 = 0.006;
const MAX_ROUNDS: u32 = 20;
/// The largest cut of so many is taken for the equator's; noise makes some larger.
const EQUATOR_SHARE: f64 = 0.95;

/// The mount that fits profiles of spheres, without knowing anything of it before.
///
/// # Errors
/// [`HandEyeError::NoSphere`], [`HandEyeError::NoRotation`], [`HandEyeError::OnALine`], and [`HandEyeError::NoStart`]
/// without spheres.
pub fn seed(targets: &[Target], profiles: &[Profile]) -> Result<Isometry3<f64>, HandEyeError> {
    let cuts = cuts(targets, profiles)?;
    check_poses(targets.len(), &cuts)?;
    Ok(from_cuts(targets, &cuts))
}

/// All circles; every sphere has some.
pub(super) fn cuts(targets: &[Target], profiles: &[Profile]) -> Result<Vec<Cut>, HandEyeError> {
    let mut cuts = Vec::new();
    for (index, target) in targets.iter().enumerate() {
        let Target::Sphere { radius_m } = *target else { continue };
        let first = cuts.len();
        for profile in profiles.iter().filter(|profile| profile.target == index) {
            // A radius that is wrong must not hide the sphere.
            if let Some(fit) = fit_arc(&profile.points_m, None) {
                let (base_from_palm, arc) = (profile.base_from_palm, fit.arc);
                cuts.push(Cut { target: index, base_from_palm, arc, height_m: 0.0 });
            }
        }
        let own = &mut cuts[first..];
        let mut radii: Vec<f64> = own.iter().map(|cut| cut.arc.radius_m).collect();
        radii.sort_by(f64::total_cmp);
        let Some(largest_m) = radii.get((EQUATOR_SHARE * radii.len() as f64) as usize) else {
            return Err(HandEyeError::NoSphere { target: index });
        };
        let radius_m = radius_m.unwrap_or(*largest_m);
        for cut in own {
            cut.height_m = (radius_m.powi(2) - cut.arc.radius_m.powi(2)).max(0.0).sqrt();
        }
    }
    if cuts.is_empty() { Err(HandEyeError::NoStart) } else { Ok(cuts) }
}

pub(super) fn from_cuts(targets: &[Target], cuts: &[Cut]) -> Isometry3<f64> {
    let mut sides = vec![0.0; cuts.len()];
    let mut weights: Vec<f64> = cuts.iter().map(equator_weight).collect();
    let mut rotation = Matrix3::identity();
    let mut mount = Isometry3::identity();
    for round in 0..MAX_ROUNDS {
        let System { axes, .. } = solve(targets.len(), cuts, &sides, &weights, &rotation, true);
        rotation = procrustes(&axes);
        let placed = solve(targets.len(), cuts, &sides, &weights, &rotation, false);
        let (origin, centers) = (placed.origin, &placed.centers);
        mount = Isometry3::from_parts(
            Translation3::from(origin),
            UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation)),
        );
        let mut changed = false;
        let off: Vec<Vector3<f64>> = cuts
            .iter()
            .zip(&mut sides)
            .map(|(cut, side)| {
                let center = Point3::from(centers[cut.target]);
                let in_scanner = mount.inverse() * (cut.base_from_palm.inverse() * center);
                let new_side = in_scanner.x.signum();
                changed |= *side != new_side;
                *side = new_side;
                let [y, z] = cut.arc.center_m;
                in_scanner - Point3::new(new_side * cut.height_m, y, z)
            })
            .collect();
        if round > 0 && !changed {
            break;
        }
        // Cauchy's weights: a circle that was none, or one on the wrong side, counts little.
        let mut lengths: Vec<f64> = off.iter().map(Vector3::norm).collect();
        lengths.sort_by(f64::total_cmp);
        let typical_m = lengths[lengths.len() / 2].max(CENTER_NOISE_M);
        for (weight, off) in weights.iter_mut().zip(&off) {
            *weight = 1.0 / (typical_m * typical_m + off.norm_squared());
        }
    }
    mount
}

/// The mount of a given orientation whose origin fits the cuts, each taken for a cut through the middle.
pub(super) fn placed(targets: &[Target], cuts: &[Cut], rotation: &UnitQuaternion<f64>) -> Isometry3<f64> {
    let sides = vec![0.0; cuts.len()];
    let weights: Vec<f64> = cuts.iter().map(equator_weight).collect();
    let axes = rotation.to_rotation_matrix().into_inner();
    let origin = solve(targets.len(), cuts, &sides, &weights, &axes, false).origin;
    Isometry3::from_parts(Translation3::from(origin), *rotation)
}

/// How much a cut's own centre tells of the sphere's.
fn equator_weight(cut: &Cut) -> f64 {
    1.0 / (CENTER_NOISE_M.powi(2) + cut.height_m.powi(2))
}

/// Which motions are missing.
pub(super) fn check_poses(targets: usize, cuts: &[Cut]) -> Result<(), HandEyeError> {
    check_rotation(targets, cuts)?;
    let spread_m = FieldLine::of(cuts).spread_m;
    if spread_m < LEAST_FIELD_M { Err(HandEyeError::OnALine { spread_m }) } else { Ok(()) }
}

/// The line in the scanner's field that the circles' centres are nearest to.
///
/// If they are on it, half a turn about it maps each circle onto itself, and each sphere to the same height on the other
/// side of the laser plane, which nothing tells from the first. If they are all in one place, any turn about the
/// direction of the sweeps does.
struct FieldLine {
    middle_m: Vector2<f64>,
    along: Vector2<f64>,
    /// Root mean square distance of the centres from it.
    spread_m: f64,
}

impl FieldLine {
    fn of(cuts: &[Cut]) -> Self {
        let places = || cuts.iter().map(|cut| Vector2::from(cut.arc.center_m));
        let count = cuts.len().max(1) as f64;
        let middle_m = places().sum::<Vector2<f64>>() / count;
        let spread: Matrix2<f64> =
            places().map(|place| (place - middle_m) * (place - middle_m).transpose()).sum();
        let eigen = SymmetricEigen::new(spread / count);
        let along = eigen.eigenvectors.column(eigen.eigenvalues.imax()).into_owned();
        Self { middle_m, along, spread_m: eigen.eigenvalues.min().max(0.0).sqrt() }
    }
}

/// The mount that fits nearly as well where the spheres' places in the field are near a line: turned by half a turn
/// about it. `None` where they are not.
pub(super) fn half_turned(mount: &Isometry3<f64>, cuts: &[Cut]) -> Option<Isometry3<f64>> {
    let FieldLine { middle_m, along, spread_m } = FieldLine::of(cuts);
    if spread_m > NEAR_LINE_M {
        return None;
    }
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.0, along.x, along.y) * PI);
    let middle = Point3::new(0.0, middle_m.x, middle_m.y);
    let about = Translation3::from(middle) * turn * Translation3::from(middle).inverse();
    Some(mount * about)
}

/// Which turns of the palm are missing. With one orientation R alone, a shift of the mount by d and of the centre by R d
/// change nothing that is measured; with several, only a d that all of them carry to the same place.
fn check_rotation(targets: usize, cuts: &[Cut]) -> Result<(), HandEyeError> {
    let mut spread = Matrix3::zeros();
    for target in 0..targets {
        let turns = || {
            let own = cuts.iter().filter(|cut| cut.target == target);
            own.map(|cut| cut.base_from_palm.rotation.to_rotation_matrix().into_inner())
        };
        let count = turns().count().max(1) as f64;
        let mean: Matrix3<f64> = turns().sum::<Matrix3<f64>>() / count;
        spread += turns().map(|turn| (turn - mean).tr_mul(&(turn - mean))).sum::<Matrix3<f64>>();
    }
    let eigen = SymmetricEigen::new(spread / cuts.len() as f64);
    let least = eigen.eigenvalues.imin();
    let spread_rad = eigen.eigenvalues[least].max(0.0).sqrt();
    if spread_rad >= LEAST_SPREAD_RAD {
        return Ok(());
    }
    let axis = eigen.eigenvectors.column(least).into_owned();
    // Of the two directions the one with a positive largest part.
    let axis = axis * axis[axis.iamax()].signum();
    Err(HandEyeError::NoRotation { axis: axis.into(), spread_deg: spread_rad.to_degrees() })
}

struct System {
    /// a and b, not yet at right angles; of the given rotation when that was held.
    axes: Matrix3x2<f64>,
    origin: Vector3<f64>,
    centers: Vec<Vector3<f64>>,
}

/// Solves the linear relation for the axes (unless the rotation is held), the origin and the centres.
fn solve(
    targets: usize,
    cuts: &[Cut],
    sides: &[f64],
    weights: &[f64],
    rotation: &Matrix3<f64>,
    free_axes: bool,
) -> System {
    // Unknowns: a, b (each times the length), p, and all c.
    let own = if free_axes { 9 } else { 3 };
    let n = own + 3 * targets;
    let (mut normal, mut right) = (DMatrix::<f64>::zeros(n, n), DVector::<f64>::zeros(n));
    for ((cut, side), weight) in cuts.iter().zip(sides).zip(weights) {
        let [y, z] = cut.arc.center_m;
        let turn = cut.base_from_palm.rotation.to_rotation_matrix().into_inner();
        let mut known =
            -turn.tr_mul(&cut.base_from_palm.translation.vector) - rotation.column(0) * (side * cut.height_m);
        // Blocks of the three equations, in the palm's axes.
        let mut blocks: Vec<(usize, Matrix3<f64>)> = Vec::with_capacity(4);
        if free_axes {
            blocks.push((0, Matrix3::identity() * (y / LENGTH_M)));
            blocks.push((3, Matrix3::identity() * (z / LENGTH_M)));
        } else {
            known -= rotation.column(1) * y + rotation.column(2) * z;
        }
        blocks.push((own - 3, Matrix3::identity()));
        blocks.push((own + 3 * cut.target, -turn.transpose()));
        for (i, a) in &blocks {
            let mut part = right.fixed_rows_mut::<3>(*i);
            part += *weight * a.tr_mul(&known);
            for (j, b) in &blocks {
                let mut part = normal.fixed_view_mut::<3, 3>(*i, *j);
                part += *weight * a.tr_mul(b);
            }
        }
    }
    // Where the poses say nothing, the least of all answers: what is missing is told later, of all points.
    let svd = normal.svd(true, true);
    let tolerance = svd.singular_values.max() * 1e-12;
    let unknowns = svd.solve(&right, tolerance).unwrap_or_else(|_| DVector::zeros(n));
    let part = |first: usize| unknowns.fixed_rows::<3>(first).into_owned();
    let axes = if free_axes {
        Matrix3x2::from_columns(&[part(0) / LENGTH_M, part(3) / LENGTH_M])
    } else {
        rotation.fixed_columns::<2>(1).into_owned()
    };
    System { axes, origin: part(own - 3), centers: (0..targets).map(|k| part(own + 3 * k)).collect() }
}

/// The rotation whose second and third axes are nearest to the given ones.
fn procrustes(axes: &Matrix3x2<f64>) -> Matrix3<f64> {
    let svd = axes.svd(true, true);
    let right = match (svd.u, svd.v_t) {
        (Some(u), Some(v_t)) => u * v_t,
        _ => Matrix3x2::identity(),
    };
    let [a, b] = [0, 1].map(|i| Vector3::from(right.column(i)));
    Matrix3::from_columns(&[a.cross(&b), a, b])
}

/// Targets as a mount places them.
pub(super) fn located(
    targets: &[Target],
    profiles: &[Profile],
    cuts: &[Cut],
    palm_from_scanner: Isometry3<f64>,
) -> State {
    let place = |(index, target): (usize, &Target)| match target {
        Target::Sphere { radius_m } => {
            // Cuts near the equator, whose centres are the sphere's.
            let own = || cuts.iter().filter(|cut| cut.target == index);
            let center = |cut: &Cut| {
                let [y, z] = cut.arc.center_m;
                (cut.base_from_palm * (palm_from_scanner * Point3::new(0.0, y, z))).coords
            };
            let total: f64 = own().map(equator_weight).sum();
            let sum: Vector3<f64> = own().map(|cut| center(cut) * equator_weight(cut)).sum();
            let equator_m = own().map(|cut| cut.arc.radius_m.hypot(cut.height_m)).fold(0.0, f64::max);
            Located::Sphere { center_m: Point3::from(sum / total), radius_m: radius_m.unwrap_or(equator_m) }
        }
        Target::Plane => plane(profiles.iter().filter(|profile| profile.target == index), &palm_from_scanner),
    };
    State { palm_from_scanner, targets: targets.iter().enumerate().map(place).collect() }
}

/// The plane with the least squares of distances.
fn plane<'a>(
    profiles: impl Iterator<Item = &'a Profile> + Clone,
    palm_from_scanner: &Isometry3<f64>,
) -> Located {
    let points = || {
        profiles.clone().flat_map(|profile| {
            let base_from_scanner = profile.base_from_palm * palm_from_scanner;
            profile.points_m.iter().map(move |&[y, z]| (base_from_scanner * Point3::new(0.0, y, z)).coords)
        })
    };
    let count = points().count().max(1) as f64;
    let middle = points().sum::<Vector3<f64>>() / count;
    let spread: Matrix3<f64> = points().map(|p| (p - middle) * (p - middle).transpose()).sum();
    let eigen = SymmetricEigen::new(spread);
    let normal = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
    Located::Plane { normal, offset_m: normal.dot(&middle) }
}
