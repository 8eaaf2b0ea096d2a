//! Tangent planes: the local linear approximation of Hoppe et al. 1992, section 3.1.

use std::{borrow::Cow, f64::consts::TAU};

use nalgebra::{Isometry3, Matrix3, Point3, Unit, Vector3};
use rayon::prelude::*;

use super::{
    grid::{Grid, Neighbour},
    outlier::median,
};

/// A plane that approximates the surface near one sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tangent {
    /// The sample's foot on the plane or, of a plain fit, the weighted centroid of the neighbourhood, metres.
    pub origin: Point3<f64>,
    /// Unit normal: direction of least variance; of either sign until oriented.
    pub normal: Unit<Vector3<f64>>,
}

impl Tangent {
    /// The same plane in frame `a`, where `self` is in frame `b`.
    #[must_use]
    pub fn transformed(&self, a_from_b: &Isometry3<f64>) -> Self {
        Self { origin: a_from_b * self.origin, normal: a_from_b.rotation * self.normal }
    }
}

/// Least scatter of the samples about their planes that is counted on, as a share of the neighbourhood's radius: cleaner
/// clouds than this still scatter by their curvature.
const LEAST_SCATTER: f64 = 0.02;

/// Distance from the plane, in scatters, at which a neighbour loses most of its say.
const TOLERANCE: f64 = 2.5;

/// How far an edge of 30 degrees, the least that counts as one, lifts its neighbourhood's border over the mean plane, as a
/// share of the radius: half of the tangent of 15 degrees.
const EDGE_HEIGHT: f64 = 0.134;

/// Rounds of reweighting. The last two hardly move anything.
const ROUNDS: usize = 4;

/// The `k` nearest points of each point, itself among them, nearest first.
#[must_use]
pub fn neighbourhoods(points: &[Point3<f64>], grid: &Grid, k: usize) -> Vec<Vec<Neighbour>> {
    let nearest = |found: &mut Vec<Neighbour>, point| {
        grid.nearest(point, k, found);
        found.clone()
    };
    points.par_iter().map_init(Vec::new, nearest).collect()
}

/// Fits a plane to the neighbourhood of each point, or to all within `radius_m` when they are more: a number of neighbours
/// alone would describe noise wherever the samples lie closer than their noise. `None` for a sample whose neighbourhood
/// is a line or a point.
///
/// Hoppe's plain fit rounds every edge by the size of its neighbourhood: beside an edge it takes both faces for one. So
/// the fit is robust, in two steps. Each sample begins with the plane, of those fitted plainly around its neighbours and
/// itself, that describes it and its own neighbours best: beside an edge that is one from further inside its face (the
/// idea of Kuwahara's filter). Then it is fitted again, with weights that fall off with a neighbour's distance from the
/// plane, as with its distance from the sample. The origin is the sample's foot on its plane, and not the neighbours'
/// centroid, which draws away from borders and edges.
///
/// A point counts as often as `counts` says: as the mean of so many samples.
///
/// Where the samples scatter so much that an edge would not show above it, as where sweeps of a scanner do not quite fit
/// onto each other, two layers of one face would be taken for two faces. The planes are then Hoppe's plain ones.
#[must_use]
pub fn tangents(
    points: &[Point3<f64>],
    counts: &[f64],
    grid: &Grid,
    near: &[Vec<Neighbour>],
    radius_m: f64,
) -> Tangents {
    let weighted = Weighted { points, counts };
    let near: Vec<Cow<'_, [Neighbour]>> = points
        .par_iter()
        .zip(near)
        .map(|(point, near)| {
            if near.last().is_none_or(|last| last.0 >= radius_m * radius_m) {
                return Cow::Borrowed(near.as_slice());
            }
            let mut found = Vec::with_capacity(2 * near.len());
            grid.within(point, radius_m, &mut found);
            Cow::Owned(found)
        })
        .collect();
    let each = points.par_iter().zip(&near);
    let plain: Vec<Option<Fit>> = each
        .clone()
        .map_init(Vec::new, |pulls, (point, near)| {
            // The core of the neighbourhood: the smaller, the nearer to an edge it is still on one face.
            let core = (near.len() * 2 / 3).max(FEWEST).min(near.len());
            weighted.pulls(point, &near[..core], pulls);
            fit(point, pulls, |_| 1.0)
        })
        .collect();
    let scatter_m = median(plain.iter().flatten().map(|fit| fit.scatter_m).collect());
    let reach_m = median(near.iter().filter_map(|near| near.last()).map(|last| last.0.sqrt()).collect());
    let shows_edges = TOLERANCE * scatter_m < EDGE_HEIGHT * reach_m;
    let planes = each
        .map_init(Vec::new, |pulls, (point, near)| {
            weighted.pulls(point, near, pulls);
            if shows_edges {
                return robust(point, near, pulls, &plain, scatter_m);
            }
            let Fit { centroid, normal, .. } = fit(point, pulls, |_| 1.0)?;
            Some(Tangent { origin: centroid, normal })
        })
        .collect();
    Tangents { planes, shows_edges }
}

/// The tangent planes of a cloud.
#[derive(Debug, Clone, PartialEq)]
pub struct Tangents {
    /// One for each point, in their order.
    pub planes: Vec<Option<Tangent>>,
    /// Whether the points scatter so little about their planes that an edge of 30 degrees shows.
    pub shows_edges: bool,
}

/// Fewest neighbours of a plain fit.
const FEWEST: usize = 6;

/// A plane and how the points scatter about it.
#[derive(Debug, Clone, Copy)]
struct Fit {
    centroid: Point3<f64>,
    normal: Unit<Vector3<f64>>,
    /// Weighted standard deviation of the heights over the plane.
    scatter_m: f64,
}

impl Fit {
    fn height(&self, point: &Point3<f64>) -> f64 {
        self.normal.dot(&(point - self.centroid))
    }
}

/// Points with their weights.
struct Weighted<'a> {
    points: &'a [Point3<f64>],
    counts: &'a [f64],
}

/// How much a neighbour counts for a plane, and where it lies from the point that the plane is fitted for.
type Pull = (f64, Vector3<f64>);

impl Weighted<'_> {
    /// Those of the neighbours, in their order, by distance and count. `pulls` is overwritten.
    fn pulls(&self, center: &Point3<f64>, neighbours: &[Neighbour], pulls: &mut Vec<Pull>) {
        let reach2 = neighbours.last().map_or(0.0, |last| last.0);
        pulls.clear();
        pulls.extend(neighbours.iter().map(|&(d2, i)| {
            (falloff(d2, reach2) * self.counts[i as usize], self.points[i as usize] - center)
        }));
    }
}

/// The plane of a point by the robust way of [`tangents`].
fn robust(
    point: &Point3<f64>,
    neighbours: &[Neighbour],
    pulls: &[Pull],
    plain: &[Option<Fit>],
    scatter_m: f64,
) -> Option<Tangent> {
    let reach2 = neighbours.last()?.0;
    let tolerance_m = TOLERANCE * scatter_m.max(LEAST_SCATTER * reach2.sqrt());
    let agreement = |height: f64| (-0.5 * (height / tolerance_m).powi(2)).exp();
    let whole: f64 = pulls.iter().map(|(weight, _)| weight).sum();
    // Neighbours are ordered by distance: of equals the nearest wins, on any number of threads.
    let mut best: Option<(f64, Fit)> = None;
    for &(_, i) in neighbours {
        let Some(candidate) = plain[i as usize] else { continue };
        let height_m = candidate.height(point);
        let share = agreement(height_m) / (1.0 + (candidate.scatter_m / tolerance_m).powi(2));
        // All neighbours could at most agree whole: most candidates cannot win.
        if best.as_ref().is_some_and(|(most, _)| share * whole <= *most) {
            continue;
        }
        let agrees = |offset: &Vector3<f64>| agreement(height_m + candidate.normal.dot(offset));
        let support: f64 = pulls.iter().map(|(weight, offset)| weight * agrees(offset)).sum();
        let score = share * support;
        if best.as_ref().is_none_or(|(most, _)| score > *most) {
            best = Some((score, candidate));
        }
    }
    let mut plane = best?.1;
    for _ in 0..ROUNDS {
        let height_m = plane.height(point);
        let agrees = |offset: &Vector3<f64>| agreement(height_m + plane.normal.dot(offset));
        let Some(next) = fit(point, pulls, agrees) else { break };
        plane = next;
    }
    Some(Tangent { origin: point - plane.normal.into_inner() * plane.height(point), normal: plane.normal })
}

/// Weighted least squares; `trust`, by the way from the centre, goes on top of the weights.
fn fit(center: &Point3<f64>, pulls: &[Pull], trust: impl Fn(&Vector3<f64>) -> f64) -> Option<Fit> {
    let reach2 = pulls.last()?.1.norm_squared();
    if reach2 <= 0.0 {
        return None;
    }
    let (mut total, mut mean, mut moment) = (0.0, Vector3::zeros(), Matrix3::zeros());
    for (weight, offset) in pulls {
        let weight = weight * trust(offset);
        let pull = offset * weight;
        total += weight;
        mean += pull;
        moment += pull * offset.transpose();
    }
    if total <= f64::MIN_POSITIVE {
        return None;
    }
    mean /= total;
    let covariance = (moment / total - mean * mean.transpose()) / reach2;
    let (normal, variance) = least_variance(&covariance)?;
    let scatter_m = (variance.max(0.0) * reach2).sqrt();
    Some(Fit { centroid: center + mean, normal, scatter_m })
}

/// Direction of least variance, and that variance; `None` when two variances vanish. In closed form (Smith 1961): a third of
/// the time that the general decomposition takes, of which a cloud needs five for each point.
fn least_variance(covariance: &Matrix3<f64>) -> Option<(Unit<Vector3<f64>>, f64)> {
    let mean = covariance.trace() / 3.0;
    let off = covariance - Matrix3::from_diagonal_element(mean);
    let spread = (off.norm_squared() / 6.0).sqrt();
    if !(spread.is_finite() && mean > 0.0) {
        return None;
    }
    let shape = (0.5 * off.determinant() / spread.powi(3)).clamp(-1.0, 1.0);
    let angle = if spread > 0.0 { shape.acos() / 3.0 } else { 0.0 };
    let [most, least] = [0.0, TAU / 3.0].map(|turn| mean + 2.0 * spread * (angle + turn).cos());
    // The sum of the other two variances from the minors: from the roots it would have lost half of its digits.
    let minors = 0.5 * ((3.0 * mean).powi(2) - covariance.norm_squared());
    if minors < 1e-9 * most * most {
        return None;
    }
    // The rows of what is left span the plane; two of them that stand well across each other give its normal.
    let rows = covariance - Matrix3::from_diagonal_element(least);
    let [a, b, c] = [0, 1, 2].map(|i| rows.row(i).transpose());
    let crossed = [a.cross(&b), b.cross(&c), c.cross(&a)];
    let best = crossed.into_iter().max_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared()))?;
    let normal = Unit::try_new(best, 1e-12 * most * most).unwrap_or_else(Vector3::z_axis);
    Some((normal, normal.dot(&(covariance * normal.into_inner()))))
}

/// Weight of a neighbour by its squared distance, of the neighbourhood's squared radius.
fn falloff(d2: f64, reach2: f64) -> f64 {
    (-2.0 * d2 / reach2).exp()
}

#[cfg(test)]
mod tests {
    use nalgebra::{SymmetricEigen, UnitQuaternion};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    #[test]
    fn a_tilted_plane_is_found_exactly_and_a_line_is_not_a_plane() {
        let normal = Vector3::new(1.0, 2.0, 2.0) / 3.0;
        let (u, v) = (Vector3::new(2.0, -2.0, 1.0) / 3.0, Vector3::new(2.0, 1.0, -2.0) / 3.0);
        let sheet: Vec<_> =
            (0..100).map(|i| Point3::from(u * f64::from(i % 10) + v * f64::from(i / 10))).collect();
        let planes = |points: &[Point3<f64>]| {
            let grid = Grid::for_surface(points);
            tangents(points, &vec![1.0; points.len()], &grid, &neighbourhoods(points, &grid, 9), 0.0).planes
        };
        for tangent in planes(&sheet) {
            let tangent = tangent.unwrap();
            assert!((tangent.normal.dot(&normal).abs() - 1.0).abs() < 1e-12);
            assert!(tangent.origin.coords.dot(&normal).abs() < 1e-12);
        }
        let line: Vec<_> = (0..50).map(|i| Point3::from(u * f64::from(i))).collect();
        assert!(planes(&line).iter().all(Option::is_none));
    }

    #[test]
    fn the_closed_form_agrees_with_the_decomposition() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for _ in 0..2_000 {
            let turn = UnitQuaternion::from_scaled_axis(Vector3::from_fn(|_, _| rng.random_range(-3.0..3.0)));
            // From flat as a mirror to a ball, and long ones.
            let least = 10_f64.powf(rng.random_range(-12.0..-0.5));
            let variances = Vector3::new(least, rng.random_range(least.max(0.01)..1.0), 1.0);
            let turn = turn.to_rotation_matrix().into_inner();
            let covariance = turn * Matrix3::from_diagonal(&variances) * turn.transpose() * 0.3;
            let (normal, variance) = least_variance(&covariance).unwrap();
            let eigen = SymmetricEigen::new(covariance);
            let i = eigen.eigenvalues.imin();
            assert!((variance - eigen.eigenvalues[i]).abs() < 1e-15, "{variances:?}");
            let sine = normal.cross(&eigen.eigenvectors.column(i)).norm();
            // As well as two near variances let a direction be told.
            assert!(sine < 1e-14 / (variances.y - variances.x), "{sine:e} {variances:?}");
        }
        assert!(least_variance(&Matrix3::zeros()).is_none());
        let way = Vector3::new(0.6, 0.0, 0.8);
        assert!(least_variance(&(way * way.transpose())).is_none());
        assert!(least_variance(&Matrix3::identity()).is_some());
    }

    #[test]
    fn edges_show_on_clean_samples_and_not_under_layers() {
        // A roof of 90 degrees, sampled a millimetre apart, in five layers that are apart by `layer_m`.
        let roof = |layer_m: f64| -> Vec<Point3<f64>> {
            let at = |i: i32, k: i32| {
                let (x, y) = (f64::from(i) * 1e-3, f64::from(k) * 1e-3);
                Point3::new(x, y, -x.abs() + layer_m * f64::from((7 * i + 3 * k).rem_euclid(5) - 2))
            };
            (-20..=20).flat_map(|i| (-20..=20).map(move |k| at(i, k))).collect()
        };
        let fitted = |points: &[Point3<f64>]| {
            let grid = Grid::for_surface(points);
            tangents(points, &vec![1.0; points.len()], &grid, &neighbourhoods(points, &grid, 12), 1.5e-3)
        };
        let clean = roof(0.0);
        let found = fitted(&clean);
        assert!(found.shows_edges);
        // Beside the ridge every plane is still that of its own side.
        for (point, plane) in clean.iter().zip(&found.planes) {
            if (1.5e-3..15e-3).contains(&point.x) && point.y.abs() < 15e-3 {
                let normal = plane.unwrap().normal;
                assert!((normal.x - normal.z).abs() < 0.02, "{normal:?} at {point}");
            }
        }
        assert!(!fitted(&roof(0.4e-3)).shows_edges);
    }
}
