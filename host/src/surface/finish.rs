//! What is done to a mesh once it is drawn: flaps, slivers, fewer triangles, and where each face comes from.

use nalgebra::{Isometry3, Point3, Unit, Vector3};
use rayon::prelude::*;

use super::{
    carve::{Carved, Sight},
    decimate::{Limits, decimate},
    fragments::without_fragments,
    grid::{Grid, Neighbour},
    mesh::Mesh,
    provenance::Provenance,
    reconstruct::Settings,
    slivers::without_slivers,
};

/// Least cosine between a face and the line of sight to the sensor that saw it. A little below none, for noise.
const LEAST_FACING: f64 = -0.1;
/// Edges shorter than this share of a cell are slivers' and collapse, where the surface moves less than the other share.
const SLIVER_EDGE: f64 = 0.15;
const SLIVER_TOLERANCE: f64 = 0.05;

/// A sheet without the faces that no sensor can have seen: those that look away from the one that saw the nearest sample,
/// and those that lines of sight pass through. Both hang over where the surface folds back under itself. `None` when
/// nothing is left, or nothing tells.
pub(super) fn without_flaps(
    mesh: &Mesh,
    grid: &Grid,
    views: Option<&[Unit<Vector3<f64>>]>,
    plane_from_cloud: &Isometry3<f64>,
    sights: &[Sight],
    spacing_m: f64,
) -> Option<Mesh> {
    let views = views?;
    let (low, high) = mesh.bounding_box();
    let reach = Vector3::repeat(4.0 * spacing_m);
    let carved = Carved::about(&(low - reach), &(high + reach), spacing_m, sights)?;
    let is_sound = |found: &mut Vec<Neighbour>, face: usize| {
        let [a, b, c] = mesh.corners(face).map(|p| p.coords);
        let (middle, normal) = (Point3::from((a + b + c) / 3.0), mesh.face_normal(face).into_inner());
        grid.nearest(&middle, 1, found);
        let view = found.first().map(|n| plane_from_cloud.rotation * views[n.1 as usize]);
        let beside = |cells: f64| middle + normal * (cells * spacing_m);
        let is_passed = carved.is_empty(&beside(1.5)) && carved.is_empty(&beside(-1.5));
        view.is_none_or(|view| view.dot(&normal) > LEAST_FACING) && !is_passed
    };
    let sound: Vec<bool> = (0..mesh.faces().len()).into_par_iter().map_init(Vec::new, is_sound).collect();
    let faces = mesh.faces().iter().zip(&sound).filter(|(_, sound)| **sound).map(|(face, _)| *face);
    // Vertices that nothing uses any more go with the fragments.
    let kept = without_fragments((mesh.vertices().to_vec(), faces.collect()), 0.0, false);
    Mesh::new(kept.triangles.0, kept.triangles.1).ok()
}

/// Without slivers, and with no more triangles than asked for, as far as the bound on the error allows.
pub(super) fn fewer_triangles(mesh: Mesh, settings: &Settings, cell_m: f64) -> Mesh {
    let mesh = without_slivers(mesh, SLIVER_EDGE * cell_m, SLIVER_TOLERANCE * cell_m);
    if settings.triangles.is_none() && settings.tolerance_m.is_none() {
        return mesh;
    }
    decimate(
        &mesh,
        &Limits {
            triangles: settings.triangles.unwrap_or(0),
            tolerance_m: settings.tolerance_m.unwrap_or(cell_m),
        },
    )
}

/// Where each face comes from. Of the points of `grid` the first `seen` were measured; with a base, faces below that
/// height that look down are the table's.
pub(super) fn provenances(
    mesh: &Mesh,
    grid: &Grid,
    seen: usize,
    radius_m: f64,
    base_m: Option<f64>,
) -> Vec<Provenance> {
    (0..mesh.faces().len())
        .into_par_iter()
        .map_init(Vec::new, |found, face| {
            let [a, b, c] = mesh.corners(face).map(|p| p.coords);
            let middle = Point3::from((a + b + c) / 3.0);
            if base_m.is_some_and(|base_m| middle.z < base_m) && mesh.face_normal(face).z < -0.7 {
                return Provenance::Table;
            }
            grid.nearest(&middle, 1, found);
            match found.first().filter(|n| n.0 < radius_m * radius_m) {
                Some(n) if (n.1 as usize) < seen => Provenance::Measured,
                Some(_) => Provenance::Mirrored,
                None => Provenance::Extruded,
            }
        })
        .collect()
}
