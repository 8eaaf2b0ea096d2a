//! Which part of the surface was measured, and which was completed from what is around it.

use std::collections::HashSet;

use nalgebra::Point3;

use crate::surface::Mesh;

/// How far from measured surface a contact still is on it: less than a fingertip is wide.
const REACH_M: f64 = 0.0025;

/// The measured part of a reconstructed surface, as the cells of a grid that hold at least one.
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

    /// Of a surface that knows where its faces come from; `None` for another, all of which counts as measured.
    #[must_use]
    pub fn of_mesh(mesh: &Mesh) -> Option<Self> {
        mesh.provenance()?;
        let step_m = 0.5 * REACH_M;
        let mut points = Vec::new();
        for face in (0..mesh.faces().len()).filter(|&face| mesh.is_measured(face)) {
            let [a, b, c] = mesh.corners(face);
            let longest = (b - a).norm().max((c - a).norm()).max((c - b).norm());
            let steps = (longest / step_m).ceil().clamp(1.0, 200.0) as u32;
            for i in 0..=steps {
                for k in 0..=steps - i {
                    let [u, v] = [i, k].map(|n| f64::from(n) / f64::from(steps));
                    points.push(a + (b - a) * u + (c - a) * v);
                }
            }
        }
        Some(Self::new(&points, REACH_M))
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
    use crate::surface::Provenance;

    #[test]
    fn only_measured_faces_of_a_mesh_are_seen() {
        let corners = [[0.0, 0.0], [0.1, 0.0], [0.1, 0.1], [0.0, 0.1]].map(|[x, y]| Point3::new(x, y, 0.0));
        let mesh = Mesh::new(corners.to_vec(), vec![[0, 1, 2], [0, 2, 3]]).unwrap();
        assert!(SeenSurface::of_mesh(&mesh).is_none());
        let mesh = mesh.with_provenance(vec![Provenance::Measured, Provenance::Extruded]).unwrap();
        let seen = SeenSurface::of_mesh(&mesh).unwrap();
        for i in 1..50 {
            let at = f64::from(i) * 2e-3;
            assert!(seen.is_seen(&Point3::new(at, 0.5 * at, 0.0)));
            assert!(!seen.is_seen(&Point3::new(0.9 * (0.1 - at), 0.1, 0.0)) || at < 0.02);
        }
    }

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
