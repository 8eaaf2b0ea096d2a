//! Sharp edges and corners in the contour, where marching cubes would cut them off.
//!
//! Kobbelt et al. 2001 (feature sensitive surface extraction): where the tangent planes at a polygon's corners show that
//! an edge passes through its cell, the polygon is fanned from the point that lies best on all of these planes, and edges
//! between two such polygons are flipped, so that the mesh runs along the object's edge instead of across it. A cell as
//! wide as a third of a rim would else take a fifth of a cell off it, and a fingertip there meets the cut.

use std::collections::{HashMap, HashSet};

use nalgebra::{Matrix3, Point3, SymmetricEigen, Vector3};
use rayon::prelude::*;

use super::{
    contour::{Polygons, Triangles, on_edge, polygons},
    distance::{Distance, Field, Planes},
};

/// Cosine of the angle between two normals of a polygon from which on its cell holds an edge: 32 degrees.
const SHARP: f64 = 0.85;
/// Least eigenvalue of the planes' quadratic form, as a share of the largest: below, the point is not moved along that
/// direction. An edge of 32 degrees has 0.08, noise of a few degrees 0.005.
const LEAST_EIGENVALUE: f64 = 0.02;
/// Farthest that the point may lie from the polygon's middle, in cells.
const FARTHEST: f64 = 1.0;
/// Largest distance between a vertex and the planes that still explain it, in cells: elsewhere completion drew it.
const EXPLAINED: f64 = 0.25;
/// Least double area of a triangle, in squared cells.
const LEAST_AREA: f64 = 1e-5;

/// The zero set of `field` with the edges of `planes`, see [`contour`](super::contour::contour) for the rest.
pub(super) fn sharp_contour(field: &Field, planes: &Planes<'_>) -> Triangles {
    let mut polygons = polygons(field);
    let cell_m = field.lattice.cell_m;
    let at_vertices: Vec<Option<Distance>> = polygons
        .vertices
        .par_iter()
        .map_init(Vec::new, |found, vertex| {
            planes.distance(vertex, found).filter(|d| d.signed_m.abs() < EXPLAINED * cell_m)
        })
        .collect();
    let moved: Vec<Point3<f64>> = (0..polygons.vertices.len())
        .into_par_iter()
        .map(|i| corrected(field, &polygons, i, &at_vertices))
        .collect();
    let tips: Vec<Option<Point3<f64>>> = (0..polygons.polygons.len())
        .into_par_iter()
        .map(|i| tip(&polygons, polygons.ring(i), &moved, &at_vertices, cell_m))
        .collect();
    polygons.vertices = moved;
    fan(polygons, &tips, cell_m)
}

/// Where an edge of the object lies between two nodes the distance is not linear: one step of the false position.
fn corrected(
    field: &Field,
    polygons: &Polygons,
    vertex: usize,
    distances: &[Option<Distance>],
) -> Point3<f64> {
    let at = polygons.vertices[vertex];
    let Some(distance) = distances[vertex] else { return at };
    let nodes = polygons.edges[vertex];
    let [a, b] = nodes.map(|node| field.values[node]);
    let share = a / (a - b);
    let value = distance.signed_m;
    on_edge(
        field,
        nodes,
        if (value < 0.0) == (a < 0.0) {
            share + (1.0 - share) * value / (value - b)
        } else {
            share * a / (a - value)
        },
    )
}

/// The point from which a polygon with an edge in it is to be fanned.
fn tip(
    polygons: &Polygons,
    ring: &[u32],
    moved: &[Point3<f64>],
    distances: &[Option<Distance>],
    cell_m: f64,
) -> Option<Point3<f64>> {
    let planes: Option<Vec<Distance>> = ring.iter().map(|&v| distances[v as usize]).collect();
    let planes = planes?;
    if planes.iter().all(|a| planes.iter().all(|b| a.normal.dot(&b.normal) > SHARP)) {
        return None;
    }
    let middle = Point3::from(
        ring.iter().map(|&v| moved[v as usize].coords).sum::<Vector3<f64>>() / ring.len() as f64,
    );
    let (mut form, mut pull) = (Matrix3::zeros(), Vector3::zeros());
    for (&v, plane) in ring.iter().zip(&planes) {
        let normal = plane.normal.into_inner();
        // Height of the plane over the middle: the distance at the vertex was taken before it moved.
        let height = normal.dot(&(polygons.vertices[v as usize] - middle)) - plane.signed_m;
        form += normal * normal.transpose();
        pull += normal * height;
    }
    let eigen = SymmetricEigen::new(form);
    let largest = eigen.eigenvalues.max();
    let way: Vector3<f64> = (0..3)
        .filter(|&i| eigen.eigenvalues[i] > LEAST_EIGENVALUE * largest)
        .map(|i| {
            eigen.eigenvectors.column(i) * (eigen.eigenvectors.column(i).dot(&pull) / eigen.eigenvalues[i])
        })
        .sum();
    let tip = middle + way;
    // Every triangle of the fan must face as the surface does at its base.
    let faces_out = (0..ring.len()).all(|i| {
        let next = (i + 1) % ring.len();
        let area = double_area(&tip, &moved[ring[i] as usize], &moved[ring[next] as usize]);
        let outward = planes[i].normal.into_inner() + planes[next].normal.into_inner();
        area.norm() > LEAST_AREA * cell_m * cell_m && area.dot(&outward) > 0.0
    });
    (way.norm() < FARTHEST * cell_m && faces_out).then_some(tip)
}

/// Splits all polygons, those with a tip into a fan about it, and flips what lies between two tips.
fn fan(mut polygons: Polygons, tips: &[Option<Point3<f64>>], cell_m: f64) -> Triangles {
    let mut faces = Vec::new();
    // Face that has this directed edge as its base and a tip as its first corner.
    let mut base_of: HashMap<(u32, u32), usize> = HashMap::new();
    let mut flips = Vec::new();
    for (i, tip) in tips.iter().enumerate() {
        let Some(tip) = tip else {
            polygons.split(i, &mut faces);
            continue;
        };
        let apex = polygons.vertices.len() as u32;
        polygons.vertices.push(*tip);
        let ring = polygons.ring(i);
        for k in 0..ring.len() {
            let (a, b) = (ring[k], ring[(k + 1) % ring.len()]);
            if let Some(&other) = base_of.get(&(b, a)) {
                flips.push((other, faces.len()));
            }
            base_of.insert((a, b), faces.len());
            faces.push([apex, a, b]);
        }
    }
    let mut joined = HashSet::new();
    for (first, second) in flips {
        let ([from, a, b], [to, ..]) = (faces[first], faces[second]);
        let flipped = [[from, a, to], [to, b, from]];
        let area = |face: [u32; 3]| {
            let [p, q, r] = face.map(|v| polygons.vertices[v as usize]);
            double_area(&p, &q, &r)
        };
        let outward = area(faces[first]) + area(faces[second]);
        let sound = flipped.iter().all(|&face| {
            let area = area(face);
            area.norm() > LEAST_AREA * cell_m * cell_m && area.dot(&outward) > 0.0
        });
        // Two polygons can meet twice; only one edge can join their tips.
        if sound && joined.insert((from.min(to), from.max(to))) {
            [faces[first], faces[second]] = flipped;
        }
    }
    (polygons.vertices, faces)
}

/// Twice the area of a triangle times its normal.
fn double_area(a: &Point3<f64>, b: &Point3<f64>, c: &Point3<f64>) -> Vector3<f64> {
    (b - a).cross(&(c - a))
}
