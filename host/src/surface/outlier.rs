//! Statistical removal of stray points.

use nalgebra::{Matrix3, Point3, SymmetricEigen, Vector3};
use rayon::prelude::*;

use super::grid::{Grid, Neighbour};

/// Neighbours whose mean distance tells whether a point belongs to a surface.
const NEIGHBOURS: usize = 8;

/// Most scatter of a sparse point's neighbours about their plane, as a share of their mean distance.
const FLAT: f64 = 0.10;
/// Most height of the point itself over that plane.
const ON_PLANE: f64 = 0.2;
/// How sparse a surface may be, as a multiple of the limit for any point.
const SPARSEST: f64 = 1.5;

/// For each point whether it belongs to a surface. It does not when the mean distance to its neighbours exceeds the
/// cloud's median of that distance by more than `factor` times its median absolute deviation (scaled to a standard
/// deviation), and at least by as much again; unless, up to half as much again, the neighbours still lie in a plane, and
/// the point in it.
///
/// Medians, unlike the usual mean and deviation, are not moved by the strays themselves. Flat neighbourhoods are kept
/// because density is uneven: a narrow face that few rays meet, such as a rim seen from above, is as sparse as some
/// strays are, but these lie in no plane.
#[must_use]
pub fn inliers(points: &[Point3<f64>], factor: f64) -> Vec<bool> {
    if points.len() <= NEIGHBOURS {
        return vec![true; points.len()];
    }
    let grid = Grid::for_surface(points);
    let spread: Vec<f64> = points
        .par_iter()
        .map_init(Vec::new, |found, point| {
            grid.nearest(point, NEIGHBOURS + 1, found);
            found.iter().map(|n| n.0.sqrt()).sum::<f64>() / NEIGHBOURS as f64
        })
        .collect();
    let center = median(spread.clone());
    let deviation = 1.4826 * median(spread.iter().map(|s| (s - center).abs()).collect());
    let limit = center + (factor * deviation).max(center);
    points
        .par_iter()
        .enumerate()
        .map_init(Vec::new, |found, (i, point)| {
            if spread[i] <= limit {
                return true;
            }
            grid.nearest(point, NEIGHBOURS + 1, found);
            found.retain(|n| n.1 as usize != i);
            spread[i] <= SPARSEST * limit && is_flat(points, point, found, spread[i])
        })
        .collect()
}

/// Whether `neighbours`, which lie about `distance_m` from `point`, are in one plane with it.
fn is_flat(points: &[Point3<f64>], point: &Point3<f64>, neighbours: &[Neighbour], distance_m: f64) -> bool {
    let count = neighbours.len() as f64;
    let offsets = || neighbours.iter().map(|n| (points[n.1 as usize] - point) / distance_m);
    let mean = offsets().sum::<Vector3<f64>>() / count;
    let covariance: Matrix3<f64> = offsets().map(|o| (o - mean) * (o - mean).transpose() / count).sum();
    let eigen = SymmetricEigen::new(covariance);
    let least = eigen.eigenvalues.imin();
    let height = mean.dot(&eigen.eigenvectors.column(least));
    eigen.eigenvalues[least] <= FLAT * FLAT && height.abs() <= ON_PLANE
}

/// The middle value, or 0 of nothing.
pub(super) fn median(values: Vec<f64>) -> f64 {
    quantile(values, 0.5)
}

/// The value below which the `share` (0 to 1) of the values lies, or 0 of nothing.
pub(super) fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let index = ((values.len() - 1) as f64 * share) as usize;
    *values.select_nth_unstable_by(index, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drops_the_stray_and_keeps_the_sheet() {
        let mut points: Vec<_> =
            (0..400).map(|i| Point3::new(f64::from(i % 20), f64::from(i / 20), 0.0)).collect();
        points.push(Point3::new(10.0, 10.0, 6.0));
        let kept = inliers(&points, 6.0);
        assert!(!kept[400] && kept[..400].iter().all(|&kept| kept));
    }
}
