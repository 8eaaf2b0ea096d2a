//! Contouring: the zero set of a field as triangles, by marching cubes over the cells that it has values on.

use std::{ops::Range, sync::LazyLock};

use nalgebra::Point3;

use super::distance::{Field, STRIDE};

/// Vertices stay this share of a cell's edge away from its ends, so that no triangle loses its area.
const CLEARANCE: f64 = 0.02;

/// Vertices and counter-clockwise triangles, not yet checked as a mesh.
pub(super) type Triangles = (Vec<Point3<f64>>, Vec<[u32; 3]>);

/// The polygons in which cells cut the zero set, before they are split into triangles.
pub(super) struct Polygons {
    pub(super) vertices: Vec<Point3<f64>>,
    /// For each vertex the two nodes (indices into the field) whose edge it lies on.
    pub(super) edges: Vec<[usize; 2]>,
    /// Corners of all polygons, one polygon after the other, counter-clockwise.
    pub(super) corners: Vec<u32>,
    pub(super) polygons: Vec<Polygon>,
}

/// One polygon within one cell.
#[derive(Debug, Clone)]
pub(super) struct Polygon {
    /// Its corners' places in [`Polygons::corners`].
    pub(super) corners: Range<usize>,
    /// The corner to fan it from, if a fan will do.
    apex: Option<usize>,
}

/// Surface between negative and positive nodes, normals towards positive.
///
/// A cell with an undefined corner emits nothing. The surface is manifold, and it is open only along such cells: each
/// grid edge holds at most one vertex, faces of two cells are cut alike, and polygons are split along no diagonal that
/// lies in a cell's face.
#[must_use]
pub(super) fn contour(field: &Field) -> Triangles {
    let mut polygons = polygons(field);
    let mut faces = Vec::new();
    for i in 0..polygons.polygons.len() {
        polygons.split(i, &mut faces);
    }
    (polygons.vertices, faces)
}

/// The polygons of all cells.
pub(super) fn polygons(field: &Field) -> Polygons {
    let mut cutter = Cutter {
        field,
        vertex_of: vec![[u32::MAX; 3]; field.keys.len()],
        out: Polygons { vertices: Vec::new(), edges: Vec::new(), corners: Vec::new(), polygons: Vec::new() },
    };
    for index in 0..field.keys.len() {
        if let Some(corners) = cell_corners(field, index) {
            cutter.cut(corners);
        }
    }
    cutter.out
}

/// Indices of the eight corners of the cell above node `index`, if all have a value. Bit 0 of the corner is x, bit 1
/// y, bit 2 z.
fn cell_corners(field: &Field, index: usize) -> Option<[usize; 8]> {
    let key = field.keys[index];
    let mut corners = [0; 8];
    for row in 0..4 {
        let row_key = key + (row & 1) * STRIDE[1] + (row >> 1) * STRIDE[2];
        let start = if row == 0 { index } else { field.keys.binary_search(&row_key).ok()? };
        // Keys ascend along x first.
        if field.keys.get(start + 1) != Some(&(row_key + 1)) {
            return None;
        }
        corners[2 * row as usize] = start;
        corners[2 * row as usize + 1] = start + 1;
    }
    Some(corners)
}

struct Cutter<'a> {
    field: &'a Field,
    /// Vertex on the edge from each node along x, y and z, or `u32::MAX`.
    vertex_of: Vec<[u32; 3]>,
    out: Polygons,
}

impl Polygons {
    /// Corners of a polygon.
    pub(super) fn ring(&self, polygon: usize) -> &[u32] {
        &self.corners[self.polygons[polygon].corners.clone()]
    }

    /// Splits a polygon into triangles along no diagonal that lies in a cell's face.
    pub(super) fn split(&mut self, polygon: usize, faces: &mut Vec<[u32; 3]>) {
        let Polygon { corners, apex } = self.polygons[polygon].clone();
        let ring = &self.corners[corners];
        if let Some(apex) = apex {
            for i in 1..ring.len() - 1 {
                let at = |offset: usize| ring[(apex + offset) % ring.len()];
                faces.push([at(0), at(i), at(i + 1)]);
            }
        } else {
            let sum: nalgebra::Vector3<f64> = ring.iter().map(|&v| self.vertices[v as usize].coords).sum();
            let center = self.vertices.len() as u32;
            self.vertices.push(Point3::from(sum / ring.len() as f64));
            for i in 0..ring.len() {
                faces.push([center, ring[i], ring[(i + 1) % ring.len()]]);
            }
        }
    }
}

impl Cutter<'_> {
    fn cut(&mut self, corners: [usize; 8]) {
        let inside =
            (0..8).filter(|&c| self.field.values[corners[c]] < 0.0).fold(0_u8, |mask, c| mask | 1 << c);
        for polygon in &CASES[inside as usize] {
            let start = self.out.corners.len();
            for &edge in polygon {
                let vertex = self.vertex(&corners, edge);
                self.out.corners.push(vertex);
            }
            self.out
                .polygons
                .push(Polygon { corners: start..self.out.corners.len(), apex: flat_apex(polygon) });
        }
    }

    fn vertex(&mut self, corners: &[usize; 8], edge: Edge) -> u32 {
        let (from, to) = (corners[edge.from as usize], corners[edge.to() as usize]);
        let slot = &mut self.vertex_of[from][edge.axis as usize];
        if *slot == u32::MAX {
            *slot = self.out.vertices.len() as u32;
            let (a, b) = (self.field.values[from], self.field.values[to]);
            self.out.vertices.push(on_edge(self.field, [from, to], a / (a - b)));
            self.out.edges.push([from, to]);
        }
        *slot
    }
}

/// The point at a share of the way between two nodes, kept clear of both.
pub(super) fn on_edge(field: &Field, [from, to]: [usize; 2], share: f64) -> Point3<f64> {
    let share = share.clamp(CLEARANCE, 1.0 - CLEARANCE);
    let [low, high] = [from, to].map(|node| field.lattice.position(field.keys[node]));
    low + (high - low) * share
}

/// An edge of the unit cube: from its lower corner along an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Edge {
    from: u8,
    axis: u8,
}

impl Edge {
    const fn to(self) -> u8 {
        self.from | 1 << self.axis
    }

    fn between(a: u8, b: u8) -> Self {
        Self { from: a & b, axis: (a ^ b).trailing_zeros() as u8 }
    }

    /// Whether some face of the cube holds both edges.
    fn shares_face(self, other: Self) -> bool {
        let ends = [self.from, self.to(), other.from, other.to()];
        ends.iter().fold(7, |all, &c| all & c) != 0 || ends.iter().fold(0, |any, &c| any | c) != 7
    }
}

/// Corners of each face of the cube, counter-clockwise seen from outside.
const FACES: [[u8; 4]; 6] =
    [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];

/// Polygons for each of the 256 sets of inside corners (bit per corner). Computed, as the rule is shorter than a table.
static CASES: LazyLock<Vec<Vec<Vec<Edge>>>> = LazyLock::new(|| (0..=u8::MAX).map(rings).collect());

/// On every face a segment runs from where its rim enters the inside to where it next leaves it, so each inside corner
/// of an ambiguous face is cut off by itself: the same on both cells that share the face. Every crossed edge lies on
/// two faces, entering on one and leaving on the other, so the segments chain into closed polygons.
fn rings(inside: u8) -> Vec<Vec<Edge>> {
    let is_inside = |corner: u8| inside >> corner & 1 == 1;
    let mut segments: Vec<(Edge, Edge)> = Vec::new();
    for face in FACES {
        for start in 0..4 {
            if is_inside(face[start]) || !is_inside(face[(start + 1) % 4]) {
                continue;
            }
            let leaves = (1..4).find(|i| !is_inside(face[(start + i + 1) % 4])).unwrap_or(3);
            let enter = Edge::between(face[start], face[(start + 1) % 4]);
            segments.push((enter, Edge::between(face[(start + leaves) % 4], face[(start + leaves + 1) % 4])));
        }
    }
    let mut rings = Vec::new();
    while let Some((first, mut end)) = segments.pop() {
        let mut ring = vec![first];
        while let Some(next) = segments.iter().position(|segment| segment.0 == end) {
            ring.push(end);
            end = segments.swap_remove(next).1;
        }
        rings.push(ring);
    }
    rings
}

/// A corner from which the polygon can be fanned without a diagonal in a face of the cube, where a neighbour might
/// draw the same one.
fn flat_apex(polygon: &[Edge]) -> Option<usize> {
    let n = polygon.len();
    (0..n).find(|&apex| (2..n - 1).all(|i| !polygon[apex].shares_face(polygon[(apex + i) % n])))
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::surface::{Mesh, distance::Lattice, distance::pack};

    fn dense(n: u64, value: impl FnMut(Point3<f64>) -> f64) -> Field {
        let lattice = Lattice { low: Point3::origin(), cell_m: 1.0 };
        let node = |i: u64| pack([i % n, i / n % n, i / (n * n)]);
        let keys: Vec<_> = (0..n * n * n).map(node).collect();
        let values = keys.iter().map(|&k| lattice.position(k)).map(value).collect();
        Field { lattice, keys, values }
    }

    #[test]
    fn every_case_closes_its_polygons() {
        for inside in 0..=u8::MAX {
            let crossed = (0..8_u8)
                .flat_map(|from| (0..3).map(move |axis| Edge { from, axis }))
                .filter(|e| e.from >> e.axis & 1 == 0)
                .filter(|e| (inside >> e.from ^ inside >> e.to()) & 1 == 1)
                .count();
            let rings = &CASES[inside as usize];
            assert_eq!(rings.iter().map(Vec::len).sum::<usize>(), crossed);
            assert!(rings.iter().all(|ring| ring.len() >= 3));
        }
    }

    #[test]
    fn a_sphere_is_closed_outward_and_of_the_right_size() {
        let field = dense(24, |p| (p - Point3::new(11.3, 11.6, 11.1)).norm() - 8.0);
        let (vertices, faces) = contour(&field);
        let mesh = Mesh::new(vertices, faces).unwrap();
        assert!(mesh.is_watertight());
        let volume = 4.0 / 3.0 * std::f64::consts::PI * 512.0;
        assert!((mesh.signed_volume_m3() / volume - 1.0).abs() < 0.01);
    }

    #[test]
    fn noise_of_every_case_still_makes_a_watertight_surface() {
        for seed in 0..20 {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let inner = 1.0..11.0;
            let field = dense(13, |p| {
                let border = !p.iter().all(|c| inner.contains(c));
                if border { 1.0 } else { rng.random_range(-1.0..1.0) }
            });
            let (vertices, faces) = contour(&field);
            let count = faces.len();
            let mesh = Mesh::new(vertices, faces).unwrap();
            assert_eq!(mesh.faces().len(), count, "no triangle without area");
            assert_eq!(mesh.open_edges(), 0, "seed {seed}");
        }
    }
}
