//! The joint problem: distances of all points from their targets, over the mount, spheres and planes.

use nalgebra::{DMatrix, DVector, Isometry3, Matrix3, Point3, SMatrix, SVector, UnitQuaternion, Vector3};

use super::loss::{Loss, robust_scale_m};
use super::{Profile, Target};
use crate::scan::levenberg::LeastSquares;

/// Where a target is, base frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Located {
    /// A ball.
    Sphere {
        /// Its centre.
        center_m: Point3<f64>,
        /// Its radius.
        radius_m: f64,
    },
    /// The points p with `normal . p = offset_m`, normal of unit length.
    Plane {
        /// Either of the two.
        normal: Vector3<f64>,
        /// From the base's origin along the normal.
        offset_m: f64,
    },
}

/// All unknowns.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct State {
    pub(super) palm_from_scanner: Isometry3<f64>,
    pub(super) targets: Vec<Located>,
}

/// Lengths are counted in this unit among the parameters, so that they compare with angles: about the stand-off.
pub(super) const LENGTH_M: f64 = 0.2;
/// Turn and shift of the mount.
pub(super) const MOUNT: usize = 6;
/// And up to four of a target.
pub(super) const COLUMNS: usize = MOUNT + 4;

/// A row of the Jacobian: the mount's six columns, then the target's.
pub(super) type Row = SVector<f64, COLUMNS>;

/// Which parameters a target has, and where they stand among all.
#[derive(Debug, Clone, Copy)]
struct Place {
    /// Of its first parameter.
    first: usize,
    /// Sphere: centre, and radius if free. Plane: two of the normal, and the offset.
    count: usize,
}

/// The problem around a state: parameters are steps away from it, all zero at the state itself.
///
/// The mount turns by `exp(w)`, w in the palm's axes about the origin of the scanner, and shifts along the palm's axes.
pub(super) struct Problem<'a> {
    pub(super) profiles: &'a [Profile],
    pub(super) around: State,
    pub(super) loss: Loss,
    free_mount: bool,
    places: Vec<Place>,
    parameters: usize,
}

/// What may be adjusted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Free {
    pub(super) mount: bool,
    /// Also the radii that are known.
    pub(super) radii: bool,
}

impl<'a> Problem<'a> {
    pub(super) fn new(
        targets: &[Target],
        profiles: &'a [Profile],
        around: State,
        loss: Loss,
        free: Free,
    ) -> Self {
        let mut parameters = if free.mount { MOUNT } else { 0 };
        let mut seen = vec![false; targets.len()];
        profiles.iter().for_each(|profile| seen[profile.target] = true);
        let place = |(target, seen): (&Target, bool)| {
            let count = match target {
                // Nothing is known of it: left as it is.
                _ if !seen => 0,
                Target::Sphere { radius_m: Some(_) } if !free.radii => 3,
                Target::Sphere { .. } => 4,
                Target::Plane => 3,
            };
            parameters += count;
            Place { first: parameters - count, count }
        };
        let places = targets.iter().zip(seen).map(place).collect();
        Self { profiles, around, loss, free_mount: free.mount, places, parameters }
    }

    /// Number of parameters.
    pub(super) const fn parameters(&self) -> usize {
        self.parameters
    }

    /// Place of a target's parameter among all.
    pub(super) fn parameter(&self, target: usize, which: usize) -> usize {
        self.places[target].first + which
    }

    /// The state that is the given steps away.
    pub(super) fn moved(&self, steps: &DVector<f64>) -> State {
        let mut state = self.around.clone();
        if self.free_mount {
            let turn = UnitQuaternion::from_scaled_axis(Vector3::new(steps[0], steps[1], steps[2]));
            state.palm_from_scanner.rotation = turn * state.palm_from_scanner.rotation;
            state.palm_from_scanner.translation.vector +=
                LENGTH_M * Vector3::new(steps[3], steps[4], steps[5]);
        }
        for (target, place) in state.targets.iter_mut().zip(&self.places) {
            let step = |i: usize| steps[place.first + i];
            if place.count == 0 {
                continue;
            }
            match target {
                Located::Sphere { center_m, radius_m } => {
                    *center_m += LENGTH_M * Vector3::new(step(0), step(1), step(2));
                    if place.count == 4 {
                        *radius_m += LENGTH_M * step(3);
                    }
                }
                Located::Plane { normal, offset_m } => {
                    let [a, b] = across(normal);
                    *normal = (*normal + a * step(0) + b * step(1)).normalize();
                    *offset_m += LENGTH_M * step(2);
                }
            }
        }
        state
    }

    /// Hands out each profile's index, and its points' residuals with their rows if asked for.
    pub(super) fn each_profile(&self, steps: &DVector<f64>, mut visit: impl FnMut(usize, &[(f64, Row)])) {
        let state = self.moved(steps);
        let mount = state.palm_from_scanner;
        // The turn's own derivative, away from zero (Sola et al. 2018, equation 145).
        let jacobian = if self.free_mount {
            left_jacobian(&Vector3::new(steps[0], steps[1], steps[2]))
        } else {
            Matrix3::identity()
        };
        let mut rows = Vec::new();
        for (index, profile) in self.profiles.iter().enumerate() {
            rows.clear();
            let palm_axes = profile.base_from_palm.rotation.to_rotation_matrix();
            let target = &state.targets[profile.target];
            let place = &self.places[profile.target];
            for &[y, z] in &profile.points_m {
                let turned = mount.rotation * Vector3::new(0.0, y, z);
                let in_palm = Point3::from(turned + mount.translation.vector);
                let in_base = profile.base_from_palm * in_palm;
                let (residual, outward) = distance_m(target, &in_base);
                let mut row = Row::zeros();
                let in_palm_axes = palm_axes.inverse() * outward;
                let by_turn = jacobian.tr_mul(&turned.cross(&in_palm_axes));
                row.fixed_rows_mut::<3>(0).copy_from(&by_turn);
                row.fixed_rows_mut::<3>(3).copy_from(&(LENGTH_M * in_palm_axes));
                match target {
                    Located::Sphere { .. } => {
                        row.fixed_rows_mut::<3>(MOUNT).copy_from(&(-LENGTH_M * outward));
                        row[MOUNT + 3] = -LENGTH_M;
                    }
                    Located::Plane { normal, .. } => {
                        let Located::Plane { normal: before, .. } = self.around.targets[profile.target]
                        else {
                            continue;
                        };
                        let [a, b] = across(&before);
                        let step = |i: usize| steps[place.first + i];
                        let length = (before + a * step(0) + b * step(1)).norm();
                        let along = in_base.coords - normal * normal.dot(&in_base.coords);
                        row[MOUNT] = along.dot(&a) / length;
                        row[MOUNT + 1] = along.dot(&b) / length;
                        row[MOUNT + 2] = -LENGTH_M;
                    }
                }
                rows.push((residual, row));
            }
            visit(index, &rows);
        }
    }

    /// Residuals at a state, of all points.
    pub(super) fn residuals_m(profiles: &[Profile], state: &State) -> Vec<f64> {
        profiles.iter().flat_map(|profile| residuals_of(profile, state)).collect()
    }

    /// Standard deviation of ordinary points about the state.
    pub(super) fn scale_m(profiles: &[Profile], state: &State) -> f64 {
        robust_scale_m(Self::residuals_m(profiles, state))
    }

    /// Adds a profile's columns to where its parameters stand.
    pub(super) fn scatter(
        &self,
        profile: usize,
        of: &SMatrix<f64, COLUMNS, COLUMNS>,
        into: &mut DMatrix<f64>,
    ) {
        let columns = self.columns(profile);
        for (i, row) in columns.iter().enumerate() {
            for (j, column) in columns.iter().enumerate() {
                if let (Some(row), Some(column)) = (row, column) {
                    into[(*row, *column)] += of[(i, j)];
                }
            }
        }
    }

    /// Where a profile's columns stand among the parameters; `None` is held fast.
    pub(super) fn columns(&self, profile: usize) -> [Option<usize>; COLUMNS] {
        let place = self.places[self.profiles[profile].target];
        std::array::from_fn(|column| match column.checked_sub(MOUNT) {
            None => self.free_mount.then_some(column),
            Some(own) => (own < place.count).then_some(place.first + own),
        })
    }
}

impl LeastSquares for Problem<'_> {
    fn cost(&self, steps: &DVector<f64>) -> f64 {
        let state = self.moved(steps);
        let residuals = self.profiles.iter().flat_map(|profile| residuals_of(profile, &state));
        residuals.map(|residual| self.loss.cost(residual)).sum()
    }

    fn linearise(&self, steps: &DVector<f64>, jtj: &mut DMatrix<f64>, jtr: &mut DVector<f64>) -> f64 {
        jtj.fill(0.0);
        jtr.fill(0.0);
        let mut cost = 0.0;
        self.each_profile(steps, |profile, rows| {
            let (mut square, mut right) = (SMatrix::<f64, COLUMNS, COLUMNS>::zeros(), Row::zeros());
            for (residual, row) in rows {
                let weight = self.loss.weight(*residual);
                cost += self.loss.cost(*residual);
                square.ger(weight, row, row, 1.0);
                right.axpy(weight * residual, row, 1.0);
            }
            self.scatter(profile, &square, jtj);
            for (value, column) in right.iter().zip(self.columns(profile)) {
                if let Some(column) = column {
                    jtr[column] += value;
                }
            }
        });
        cost
    }
}

/// Residuals of a profile's points.
pub(super) fn residuals_of<'a>(profile: &'a Profile, state: &'a State) -> impl Iterator<Item = f64> + 'a {
    let base_from_scanner = profile.base_from_palm * state.palm_from_scanner;
    let target = &state.targets[profile.target];
    let in_base = move |&[y, z]: &[f64; 2]| base_from_scanner * Point3::new(0.0, y, z);
    profile.points_m.iter().map(move |point| distance_m(target, &in_base(point)).0)
}

/// Distance of a point from a target's surface, outwards, and the direction in which it grows.
fn distance_m(target: &Located, point: &Point3<f64>) -> (f64, Vector3<f64>) {
    match target {
        Located::Sphere { center_m, radius_m } => {
            let ray = point - center_m;
            let length = ray.norm();
            (length - radius_m, ray / length.max(f64::MIN_POSITIVE))
        }
        Located::Plane { normal, offset_m } => (normal.dot(&point.coords) - offset_m, *normal),
    }
}

/// Two unit vectors at right angles to a unit vector and to each other.
fn across(normal: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let helper = if normal.x.abs() < 0.6 { Vector3::x() } else { Vector3::y() };
    let first = normal.cross(&helper).normalize();
    [first, normal.cross(&first)]
}

/// d exp(w) q = (J dw) x (exp(w) q).
fn left_jacobian(w: &Vector3<f64>) -> Matrix3<f64> {
    let angle = w.norm();
    let skew = w.cross_matrix();
    if angle < 1e-6 {
        return Matrix3::identity() + skew * 0.5;
    }
    let square = angle * angle;
    Matrix3::identity()
        + skew * ((1.0 - angle.cos()) / square)
        + skew * skew * ((angle - angle.sin()) / (square * angle))
}
