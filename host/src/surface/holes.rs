//! Small holes of a contoured surface.
//!
//! Where a lattice node finds no sample that supports it, as can happen beside an edge, the cells about it stay empty, in the
//! middle of samples that lie no farther apart than elsewhere. Such holes are the method's and not the object's.

use std::collections::BTreeMap;

use nalgebra::{Point3, Vector3};

use super::contour::Triangles;

/// Most edges of a hole that is filled.
const MOST_EDGES: usize = 24;

/// Fills holes that are no wider than `widest_m`, each by a fan about its middle. Borders that meet in a vertex stay open.
pub(super) fn without_small_holes((mut vertices, mut faces): Triangles, widest_m: f64) -> Triangles {
    for hole in holes(&faces) {
        let corners: Vec<Point3<f64>> = hole.iter().map(|&v| vertices[v as usize]).collect();
        let middle = corners.iter().map(|p| p.coords).sum::<Vector3<f64>>() / corners.len() as f64;
        if corners.iter().any(|p| 2.0 * (p.coords - middle).norm() > widest_m) {
            continue;
        }
        let apex = vertices.len() as u32;
        let next = |i: usize| hole[(i + 1) % hole.len()];
        let fan: Vec<[u32; 3]> = (0..hole.len()).map(|i| [hole[i], next(i), apex]).collect();
        let across = |face: &[u32; 3]| {
            let [a, b, c] = face.map(|v| vertices.get(v as usize).map_or(middle, |p| p.coords));
            (b - a).cross(&(c - a))
        };
        let outward: Vector3<f64> = fan.iter().map(across).sum();
        // A fan that folds over is no patch.
        if fan.iter().all(|face| across(face).dot(&outward) > 0.0) {
            vertices.push(middle.into());
            faces.extend(fan);
        }
    }
    (vertices, faces)
}

/// The borders that run once around, of few edges, each as its vertices in the order in which new faces go along them.
fn holes(faces: &[[u32; 3]]) -> Vec<Vec<u32>> {
    let ordered = |from: u32, to: u32| (from.min(to), from.max(to));
    let mut edges: Vec<((u32, u32), u32)> = Vec::with_capacity(3 * faces.len());
    for &[a, b, c] in faces {
        edges.extend([(a, b), (b, c), (c, a)].map(|(from, to)| (ordered(from, to), from)));
    }
    edges.sort_unstable();
    // From each vertex of a border to the next; `None` where borders meet.
    let mut next: BTreeMap<u32, Option<u32>> = BTreeMap::new();
    for uses in edges.chunk_by(|a, b| a.0 == b.0) {
        if let [((low, high), from)] = *uses {
            // A new face runs along the edge the other way.
            let (to, from) = (from, if from == low { high } else { low });
            next.entry(from).and_modify(|next| *next = None).or_insert(Some(to));
        }
    }
    let mut found = Vec::new();
    for &start in next.keys() {
        let mut hole = vec![start];
        while let Some(Some(to)) = next.get(&hole[hole.len() - 1]) {
            if *to == start {
                // Each border once: from its lowest vertex.
                if hole.len() >= 3 && hole.iter().all(|v| *v >= start) {
                    found.push(hole);
                }
                break;
            }
            if hole.len() == MOST_EDGES {
                break;
            }
            hole.push(*to);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::object::BuiltIn;
    use crate::surface::Mesh;

    fn triangles(mesh: &Mesh, kept: impl Fn(usize) -> bool) -> Triangles {
        let faces = mesh.faces().iter().enumerate().filter(|(f, _)| kept(*f)).map(|(_, face)| *face);
        (mesh.vertices().to_vec(), faces.collect())
    }

    fn open_edges((vertices, faces): Triangles) -> usize {
        Mesh::new(vertices, faces).unwrap().open_edges()
    }

    #[test]
    fn small_holes_are_filled_and_wide_ones_are_not() {
        let mesh = BuiltIn::Mouse.object(1.0).unwrap().mesh;
        assert!(mesh.is_watertight());
        let one = triangles(&mesh, |f| f != 100);
        assert_eq!(open_edges(one.clone()), 3);
        assert_eq!(open_edges(without_small_holes(one.clone(), 0.1)), 0);
        assert_eq!(open_edges(without_small_holes(one, 1e-6)), 3);

        // All faces about a vertex.
        let v = mesh.faces()[200][0];
        let without = triangles(&mesh, |f| !mesh.faces()[f].contains(&v));
        assert!(open_edges(without.clone()) > 3);
        let filled = without_small_holes(without, 0.1);
        assert_eq!(filled.1.len(), mesh.faces().len());
        assert_eq!(open_edges(filled), 0);

        // A border of the whole surface is wider.
        let half = triangles(&mesh, |f| mesh.corners(f).iter().all(|p| p.x > 0.0));
        let open = open_edges(half.clone());
        assert_eq!(open_edges(without_small_holes(half, 0.01)), open);
    }
}
