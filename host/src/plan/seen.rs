//! Which part of the surface was measured, and which was completed from what is around it.

use std::collections::HashSet;

use nalgebra::Point3;

/// The measured points behind a reconstructed surface, as the cells of a grid that hold at least one.
#[derive(Debug, Clone)]
pub struct SeenSurface {
    cell_m: f64,
    cells: HashSet<[i32; 3]>,
}

impl SeenSurface {
    /// Points in the object's frame; surface farther than about `reach_m` (metres, > 0) from all of them counts as
    /// invented. Take three spacings of the points. Points that are no numbers are left out.
    #[must_use]
    pub fn new<'p>(points: impl IntoIterator<Item = &'p Point3<f64>>, reach_m: f64) -> Self {
        let cell_m = reach_m.max(1e-6);
        let cells = points
            .into_iter()
            .filter(|p| p.coords.iter().all(|c| c.is_finite()))
            .map(|p| Self::cell(p, cell_m))
            .collect();
        Self { cell_m, cells }
    }

    /// Of a cloud whose points are `spacing_m` apart: surface within three spacings of a point was measured.
    #[must_use]
    pub fn of_cloud(points: &[Point3<f64>], spacing_m: f64) -> Self {
        Self::new(points, 3.0 * spacing_m)
    }

    fn cell(point: &Point3<f64>, cell_m: f64) -> [i32; 3] {
        // A cast saturates, so that points far away share a cell instead of wrapping round.
        [point.x, point.y, point.z].map(|c| (c / cell_m).floor() as i32)
    }

    /// Whether a measured point is near: in the point's cell or in the half of the next ones on its side, between 0.5
    /// and 1.5 times the reach.
    #[must_use]
    pub fn is_seen(&self, point: &Point3<f64>) -> bool {
        let own = Self::cell(point, self.cell_m);
        let side = [point.x, point.y, point.z]
            .map(|c| if (c / self.cell_m).fract().rem_euclid(1.0) < 0.5 { -1 } else { 1 });
        (0..8).any(|corner| {
            let cell = std::array::from_fn(|k| {
                own[k].saturating_add(if corner >> k & 1 == 1 { side[k] } else { 0 })
            });
            self.cells.contains(&cell)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_points_are_seen_and_far_ones_are_not() {
        let cloud: Vec<Point3<f64>> = (-20..=20)
            .flat_map(|i| (-20..=20).map(move |k| Point3::new(i as f64, k as f64, 0.0) * 1e-3))
            .collect();
        let seen = SeenSurface::new(&cloud, 3e-3);
        for i in -15..=15 {
            let at = f64::from(i) * 1.3e-3;
            assert!(seen.is_seen(&Point3::new(at, -at, 0.0)));
            assert!(
                seen.is_seen(&Point3::new(at, -at, 1.4e-3)) && seen.is_seen(&Point3::new(at, at, -1.4e-3))
            );
            assert!(
                !seen.is_seen(&Point3::new(at, at, 6.1e-3)) && !seen.is_seen(&Point3::new(at, at, -6.1e-3))
            );
        }
        assert!(!seen.is_seen(&Point3::new(1e300, f64::NAN, 0.0)));
    }
}
