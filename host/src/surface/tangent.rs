//! Tangent planes: the local linear approximation of Hoppe et al. 1992, section 3.1.

use nalgebra::{Isometry3, Matrix3, Point3, SymmetricEigen, Unit, Vector3};
use rayon::prelude::*;

use super::grid::Grid;

/// A plane that approximates the surface near one sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tangent {
    /// Weighted centroid of the neighbourhood, metres.
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

/// Fits a plane to the `k` nearest neighbours of each point, or to those within `radius_m` when they are more: `k`
/// alone would describe noise wherever the samples lie closer than their noise.
///
/// Weights fall off as a Gaussian of the distance, which keeps the origin near its sample where a plain centroid would
/// cut edges and shrink small radii. `None` for a sample whose neighbourhood is a line or a point.
#[must_use]
pub fn tangents(points: &[Point3<f64>], grid: &Grid, k: usize, radius_m: f64) -> Vec<Option<Tangent>> {
    points
        .par_iter()
        .map_init(Vec::new, |found, point| {
            grid.nearest(point, k, found);
            if found.last().is_some_and(|last| last.0 < radius_m * radius_m) {
                grid.within(point, radius_m, found);
            }
            fit(points, point, found)
        })
        .collect()
}

fn fit(points: &[Point3<f64>], center: &Point3<f64>, neighbours: &[(f64, u32)]) -> Option<Tangent> {
    let reach2 = neighbours.last()?.0;
    if reach2 <= 0.0 {
        return None;
    }
    let weight = |d2: f64| (-2.0 * d2 / reach2).exp();
    let (mut total, mut mean) = (0.0, Vector3::zeros());
    for &(d2, i) in neighbours {
        total += weight(d2);
        mean += (points[i as usize] - center) * weight(d2);
    }
    mean /= total;
    let mut covariance = Matrix3::zeros();
    for &(d2, i) in neighbours {
        let offset = points[i as usize] - center - mean;
        covariance += offset * offset.transpose() * (weight(d2) / (total * reach2));
    }
    let eigen = SymmetricEigen::new(covariance);
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    // Two vanishing variances leave the normal undetermined.
    if eigen.eigenvalues[order[1]] < 1e-9 * eigen.eigenvalues[order[2]] {
        return None;
    }
    let normal = Unit::try_new(eigen.eigenvectors.column(order[0]).into_owned(), 1e-12)?;
    Some(Tangent { origin: center + mean, normal })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tilted_plane_is_found_exactly_and_a_line_is_not_a_plane() {
        let normal = Vector3::new(1.0, 2.0, 2.0) / 3.0;
        let (u, v) = (Vector3::new(2.0, -2.0, 1.0) / 3.0, Vector3::new(2.0, 1.0, -2.0) / 3.0);
        let sheet: Vec<_> =
            (0..100).map(|i| Point3::from(u * f64::from(i % 10) + v * f64::from(i / 10))).collect();
        for tangent in tangents(&sheet, &Grid::for_surface(&sheet), 9, 0.0) {
            let tangent = tangent.unwrap();
            assert!((tangent.normal.dot(&normal).abs() - 1.0).abs() < 1e-12);
            assert!(tangent.origin.coords.dot(&normal).abs() < 1e-12);
        }
        let line: Vec<_> = (0..50).map(|i| Point3::from(u * f64::from(i))).collect();
        assert!(tangents(&line, &Grid::for_surface(&line), 9, 0.0).iter().all(Option::is_none));
    }
}
