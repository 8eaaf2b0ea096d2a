//! Statistical removal of stray points.

use nalgebra::Point3;
use rayon::prelude::*;

use super::grid::Grid;

/// Neighbours whose mean distance tells whether a point belongs to a surface.
const NEIGHBOURS: usize = 8;

/// For each point whether it belongs to a surface: not when the mean distance to its neighbours exceeds the cloud's
/// median of that distance by more than `factor` times its median absolute deviation (scaled to a standard
/// deviation), and at least by as much again.
///
/// Medians, unlike the usual mean and deviation, are not moved by the strays themselves. Borders and uneven density
/// are honest, hence the floor.
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
    spread.into_iter().map(|s| s <= limit).collect()
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
