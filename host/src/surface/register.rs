//! Registration of the sweeps of one scan to each other.
//!
//! The arm and the hand-eye calibration misplace each sweep by some tenths of a millimetre, as a rigid body. What two
//! sweeps both saw tells by how much: all sweeps are moved at once until their overlaps meet (multi-view registration,
//! Pulli 1999, with the symmetric point-to-plane distance of Rusinkiewicz 2019 and Geman-McClure weights), and the
//! table, where it is seen, lies in its plane.
//!
//! Overlaps do not determine everything: a disk may turn about its axis, and all sweeps may move together. The motions
//! therefore have a prior, a normal distribution about none, and along combinations of motions that the overlaps hardly
//! speak about nothing moves at all.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector, Isometry3, Point3, SymmetricEigen, Translation3, UnitQuaternion, Vector3};
use rayon::prelude::*;

use super::{
    cloud::PointCloud,
    grid::Grid,
    orient::orient_towards,
    outlier::median,
    table::Plane,
    tangent::{Tangent, neighbourhoods, tangents},
    thin::{Thinned, thin},
};

/// Standard deviation of a sweep's misplacement that is counted on.
const PRIOR_M: f64 = 1e-3;
/// The same of its rotation about its own middle.
const PRIOR_RAD: f64 = 5e-3;
/// Farthest that a sweep is moved.
const MOST_M: f64 = 4e-3;
/// Most that a sweep is turned.
const MOST_RAD: f64 = 2e-2;
/// Distance within which points of two sweeps may be the same spot, at first.
const REACH_M: f64 = 4e-3;
/// Rounds of matching and moving.
const ROUNDS: usize = 10;
/// Least scatter that gaps are judged by, as a share of the reach: what many pairs agree on must not hide, before it was
/// brought near, what few say.
const SCATTER_PER_REACH: f64 = 0.15;
/// Most tangent planes of a sweep, and most of its points on the table.
const MOST_PLANES: usize = 5000;
const MOST_ON_TABLE: usize = 500;
/// Directions of normals that are told apart: so many along each side of each face of a cube.
const DIRECTIONS: f64 = 4.0;
/// Most that a pair counts for being one of few of its direction.
const RAREST: f64 = 20.0;
/// Most sweeps: all pairs of them are matched.
const MOST_SWEEPS: usize = 64;
/// Neighbours of a tangent plane.
const NEIGHBOURS: usize = 12;
/// Least cosine between the normals of one spot in two sweeps.
const SAME_NORMAL: f64 = 0.9;
/// Fewest pairs that say anything.
const FEWEST_PAIRS: usize = 30;
/// Pairs that count as one: neighbouring pairs share points, and their errors with them.
const PAIRS_IN_ONE: f64 = 10.0;
/// Least scatter that is counted on.
const LEAST_SCATTER_M: f64 = 1e-5;
/// Least information about a motion, as a multiple of the prior's, that moves anything.
const LEAST_INFORMATION: f64 = 4.0;
/// The same as a share of what is known best.
const LEAST_SHARE: f64 = 1e-3;
/// How near the table's plane a point counts as the table's.
const TABLE_REACH_M: f64 = 2e-3;

/// What registration did.
#[derive(Debug, Clone, PartialEq)]
pub enum Registration {
    /// The cloud does not say which sweep its points belong to, or has only one.
    OneSweep,
    /// The sweeps have too little in common, would not fit better, or are more than 64.
    Unmoved,
    /// The sweeps were moved.
    Moved(Moved),
}

/// By how much sweeps were moved.
#[derive(Debug, Clone, PartialEq)]
pub struct Moved {
    /// For each number of a sweep, from 0 to the largest, its motion in the cloud's frame.
    pub corrections: Vec<Isometry3<f64>>,
    /// Median distance between overlapping sweeps along their normals, before, metres.
    pub before_m: f64,
    /// The same afterwards.
    pub after_m: f64,
}

impl Registration {
    /// The cloud with its sweeps moved.
    #[must_use]
    pub fn applied(&self, cloud: &PointCloud) -> PointCloud {
        let (Self::Moved(moved), Some(sweeps)) = (self, &cloud.sweeps) else { return cloud.clone() };
        let correction = |i: usize| {
            moved.corrections.get(usize::from(sweeps[i])).copied().unwrap_or_else(Isometry3::identity)
        };
        let turn = |array: &Option<Vec<nalgebra::Unit<Vector3<f64>>>>| {
            array
                .as_ref()
                .map(|array| array.iter().enumerate().map(|(i, v)| correction(i).rotation * v).collect())
        };
        PointCloud {
            points: cloud.points.iter().enumerate().map(|(i, p)| correction(i) * p).collect(),
            normals: turn(&cloud.normals),
            views: turn(&cloud.views),
            sweeps: cloud.sweeps.clone(),
        }
    }
}

/// Finds the motions that make the sweeps of a cloud meet. `table` is a plane that all of them see part of.
///
/// Sweeps without overlap with any other, and without a view of the table, stay where they are. The result does not
/// depend on the number of threads.
#[must_use]
pub fn register(cloud: &PointCloud, table: Option<&Plane>) -> Registration {
    let Some(numbers) = &cloud.sweeps else { return Registration::OneSweep };
    let mut present = numbers.clone();
    present.sort_unstable();
    present.dedup();
    if present.len() < 2 {
        return Registration::OneSweep;
    }
    if present.len() > MOST_SWEEPS {
        return Registration::Unmoved;
    }
    let mut sweeps: Vec<Sweep> = present
        .par_iter()
        .map(|&number| Sweep::new(&cloud.filtered(|i, _| numbers[i] == number), table))
        .collect();
    let mut before_m = None;
    let mut reach_m = REACH_M;
    for _ in 0..ROUNDS {
        let pairs = matched(&sweeps, reach_m);
        let heights = table.map_or_else(Vec::new, |table| on_table(&sweeps, table));
        if pairs.len() < FEWEST_PAIRS {
            return Registration::Unmoved;
        }
        let scatter_m = typical(&pairs);
        before_m.get_or_insert(scatter_m);
        move_together(&mut sweeps, &pairs, &heights, scatter_m.max(SCATTER_PER_REACH * reach_m));
        reach_m = (0.6 * reach_m).max(6.0 * scatter_m);
    }
    let (Some(before_m), after_m) = (before_m, typical(&matched(&sweeps, REACH_M))) else {
        return Registration::Unmoved;
    };
    if after_m >= before_m {
        return Registration::Unmoved;
    }
    let mut corrections =
        vec![Isometry3::identity(); present.last().map_or(0, |&last| usize::from(last) + 1)];
    for (&number, sweep) in present.iter().zip(&sweeps) {
        corrections[usize::from(number)] = sweep.motion();
    }
    Registration::Moved(Moved { corrections, before_m, after_m })
}

/// One sweep as it is matched.
struct Sweep {
    planes: Vec<Tangent>,
    grid: Grid,
    /// Points on the table.
    table: Vec<Point3<f64>>,
    /// Side of the voxels that it was thinned with.
    voxel_m: f64,
    /// What it turns about.
    middle: Point3<f64>,
    /// Rotation vector, then translation.
    moved: [Vector3<f64>; 2],
}

impl Sweep {
    fn new(cloud: &PointCloud, table: Option<&Plane>) -> Self {
        let is_table = |p: &Point3<f64>| table.is_some_and(|table| table.height(p).abs() < TABLE_REACH_M);
        let (Thinned { cloud: body, counts, .. }, voxel_m) =
            thinned(&cloud.filtered(|_, p| !is_table(p)), MOST_PLANES);
        let (Thinned { cloud: table, .. }, _) = thinned(&cloud.filtered(|_, p| is_table(p)), MOST_ON_TABLE);
        let grid = Grid::for_surface(&body.points);
        let near = neighbourhoods(&body.points, &grid, NEIGHBOURS);
        let found = tangents(&body.points, &counts, &grid, &near, 1.5 * voxel_m).planes;
        let outside = body.views.as_ref().or(body.normals.as_ref());
        let fitted: Vec<usize> = (0..found.len()).filter(|&i| found[i].is_some()).collect();
        let mut planes: Vec<Tangent> = found.into_iter().flatten().collect();
        if let Some(outside) = outside {
            let outside: Vec<_> = fitted.iter().map(|&i| outside[i]).collect();
            orient_towards(&mut planes, &outside);
        }
        let count = (planes.len() + table.len()).max(1) as f64;
        let sum: Vector3<f64> =
            planes.iter().map(|p| &p.origin).chain(&table.points).map(|p| p.coords / count).sum();
        let origins: Vec<Point3<f64>> = planes.iter().map(|plane| plane.origin).collect();
        Self {
            grid: Grid::for_surface(&origins),
            planes,
            table: table.points,
            voxel_m,
            middle: sum.into(),
            moved: [Vector3::zeros(); 2],
        }
    }

    /// Where the sweep belongs, from where it is.
    fn motion(&self) -> Isometry3<f64> {
        let [turn, shift] = self.moved;
        let about = Translation3::from(self.middle.coords);
        Translation3::from(shift) * about * UnitQuaternion::from_scaled_axis(turn) * about.inverse()
    }
}

/// At most so many averaged points, and the side of their voxels.
fn thinned(cloud: &PointCloud, most: usize) -> (Thinned, f64) {
    let extent_m = cloud.bounding_box().map_or(0.0, |(low, high)| (high - low).amax());
    let mut voxel_m = (extent_m / 120.0).max(1e-9);
    loop {
        let found = thin(cloud, voxel_m);
        if found.cloud.len() <= most {
            return (found, voxel_m);
        }
        voxel_m *= (found.cloud.len() as f64 / most as f64).sqrt().max(1.1);
    }
}

/// The same spot in two sweeps.
struct Pair {
    sweeps: [usize; 2],
    points: [Point3<f64>; 2],
    normal: Vector3<f64>,
    /// How far the first lies before the second.
    gap_m: f64,
}

/// Number of the direction that a normal, of either sign, has.
fn direction(normal: &Vector3<f64>) -> [i8; 3] {
    let axis = normal.iamax();
    let on_face = normal / normal[axis];
    let mut key = [0; 3];
    for other in (0..3).filter(|&other| other != axis) {
        key[other] = ((on_face[other] + 1.0) * 0.5 * DIRECTIONS).min(DIRECTIONS - 1.0) as i8;
    }
    key[axis] = -1;
    key
}

/// How much each pair counts. The side of a disk is a tenth of it, but only the side tells where the disk is: each
/// direction of normals counts alike (the idea of Rusinkiewicz and Levoy 2001), up to a limit.
fn weights(pairs: &[Pair]) -> Vec<f64> {
    let mut counts: BTreeMap<[i8; 3], f64> = BTreeMap::new();
    for pair in pairs {
        *counts.entry(direction(&pair.normal)).or_default() += 1.0;
    }
    let fair = pairs.len() as f64 / counts.len().max(1) as f64;
    let of = |pair: &Pair| {
        let count = counts.get(&direction(&pair.normal)).copied().unwrap_or(1.0);
        // A handful of pairs is more likely edges and noise.
        if count < FEWEST_PAIRS as f64 { 1.0 } else { (fair / count).min(RAREST) }
    };
    pairs.iter().map(of).collect()
}

/// A point that should lie on the table.
struct Height {
    sweep: usize,
    point: Point3<f64>,
    normal: Vector3<f64>,
    gap_m: f64,
}

fn matched(sweeps: &[Sweep], reach_m: f64) -> Vec<Pair> {
    let motions: Vec<Isometry3<f64>> = sweeps.iter().map(Sweep::motion).collect();
    let twos: Vec<[usize; 2]> =
        (0..sweeps.len()).flat_map(|a| (a + 1..sweeps.len()).map(move |b| [a, b])).collect();
    let of_two = |&[a, b]: &[usize; 2]| {
        // The sparser of the two sweeps finds its points among the denser one's.
        let [a, b] = if sweeps[a].planes.len() <= sweeps[b].planes.len() { [a, b] } else { [b, a] };
        let b_from_a = motions[b].inverse() * motions[a];
        let aside_m = 0.75 * sweeps[b].voxel_m;
        let mut found = Vec::new();
        let pair = |plane: &Tangent| {
            let here = plane.transformed(&b_from_a);
            sweeps[b].grid.nearest(&here.origin, 1, &mut found);
            let other = sweeps[b].planes[found.first()?.1 as usize];
            if here.normal.dot(&other.normal) < SAME_NORMAL {
                return None;
            }
            let normal = (here.normal.into_inner() + other.normal.into_inner()).normalize();
            let way = here.origin - other.origin;
            let gap_m = way.dot(&normal);
            // A point beside what the other sweep saw has no partner in it.
            if gap_m.abs() > reach_m || (way - normal * gap_m).norm() > aside_m {
                return None;
            }
            let points = [here.origin, other.origin].map(|p| motions[b] * p);
            Some(Pair { sweeps: [a, b], points, normal: motions[b].rotation * normal, gap_m })
        };
        sweeps[a].planes.iter().filter_map(pair).collect::<Vec<_>>()
    };
    twos.par_iter().flat_map_iter(of_two).collect()
}

fn on_table(sweeps: &[Sweep], table: &Plane) -> Vec<Height> {
    let of_sweep = |(number, sweep): (usize, &Sweep)| {
        let motion = sweep.motion();
        let height = move |p: &Point3<f64>| {
            let point = motion * p;
            let normal = table.normal.into_inner();
            Height { sweep: number, point, normal, gap_m: table.height(&point) }
        };
        sweep.table.iter().map(height).collect::<Vec<_>>()
    };
    sweeps.iter().enumerate().flat_map(of_sweep).collect()
}

/// Standard deviation of the gaps as their median tells it.
fn typical(pairs: &[Pair]) -> f64 {
    1.4826 * median(pairs.iter().map(|pair| pair.gap_m.abs()).collect())
}

/// One step of Gauss-Newton on all motions at once, each in units of its prior.
fn move_together(sweeps: &mut [Sweep], pairs: &[Pair], heights: &[Height], scatter_m: f64) {
    let count = 6 * sweeps.len();
    let (mut form, mut pull) = (DMatrix::<f64>::zeros(count, count), DVector::<f64>::zeros(count));
    let scatter_m = scatter_m.max(LEAST_SCATTER_M);
    let mut add = |rows: &[(usize, [f64; 6])], gap_m: f64, count: f64| {
        // Geman and McClure: what is far off is no measurement of the gap.
        let trust = (1.0 + (gap_m / (2.0 * scatter_m)).powi(2)).powi(-2);
        let weight = count * trust / (scatter_m * scatter_m * PAIRS_IN_ONE);
        for (a, row_a) in rows {
            for (i, x) in row_a.iter().enumerate() {
                pull[6 * a + i] -= weight * x * gap_m;
                for (b, row_b) in rows {
                    for (k, y) in row_b.iter().enumerate() {
                        form[(6 * a + i, 6 * b + k)] += weight * x * y;
                    }
                }
            }
        }
    };
    let row = |sweep: &Sweep, point: &Point3<f64>, normal: &Vector3<f64>| {
        let turn = (point - sweep.middle - sweep.moved[1]).cross(normal) * PRIOR_RAD;
        let shift = normal * PRIOR_M;
        [turn.x, turn.y, turn.z, shift.x, shift.y, shift.z]
    };
    for (Pair { sweeps: [a, b], points, normal, gap_m }, count) in pairs.iter().zip(weights(pairs)) {
        let rows = [
            (*a, row(&sweeps[*a], &points[0], normal)),
            (*b, row(&sweeps[*b], &points[1], normal).map(|x| -x)),
        ];
        add(&rows, *gap_m, count);
    }
    for Height { sweep, point, normal, gap_m } in heights {
        add(&[(*sweep, row(&sweeps[*sweep], point, normal))], *gap_m, 1.0);
    }
    // The prior pulls what was moved so far back.
    for (s, sweep) in sweeps.iter().enumerate() {
        let so_far = [sweep.moved[0] / PRIOR_RAD, sweep.moved[1] / PRIOR_M];
        for i in 0..6 {
            pull[6 * s + i] -= so_far[i / 3][i % 3];
        }
    }
    let eigen = SymmetricEigen::new(form);
    let least = LEAST_INFORMATION.max(LEAST_SHARE * eigen.eigenvalues.max());
    let mut step = DVector::<f64>::zeros(count);
    for (i, &information) in eigen.eigenvalues.iter().enumerate().filter(|(_, value)| **value >= least) {
        let direction = eigen.eigenvectors.column(i);
        step += direction * (direction.dot(&pull) / (information + 1.0));
    }
    if !step.iter().all(|x| x.is_finite()) {
        return;
    }
    for (s, sweep) in sweeps.iter_mut().enumerate() {
        let part = |at: usize, unit: f64| Vector3::new(step[at], step[at + 1], step[at + 2]) * unit;
        let [turn, shift] = [part(6 * s, PRIOR_RAD), part(6 * s + 3, PRIOR_M)];
        sweep.moved =
            [(sweep.moved[0] + turn).cap_magnitude(MOST_RAD), (sweep.moved[1] + shift).cap_magnitude(MOST_M)];
    }
}

#[cfg(test)]
mod tests;
