//! Which side of the surface a point is on: the pseudo-normals of edges and corners.
//!
//! At its nearest point of the surface a point is inside when it is behind that place's angle-weighted normal
//! (Baerentzen and Aanaes 2005, DOI 10.1109/TVCG.2005.49).

use parry3d_f64::math::Vector;
use parry3d_f64::shape::{Triangle, TrianglePointLocation};
use rayon::prelude::*;

use super::tree::Hit;

/// Normals where triangles meet. Corners at the same place count as one.
pub(super) struct Sides {
    /// Vertex at each corner of each triangle.
    corners: Vec<[u32; 3]>,
    /// Edge from each corner to the next.
    edges: Vec<[u32; 3]>,
    vertex_normals: Vec<Vector>,
    edge_normals: Vec<Vector>,
    closed: bool,
}

impl Sides {
    /// Of triangles whose corners are the given vertices.
    pub(super) fn new(triangles: &[Triangle], mut corners: Vec<[u32; 3]>, vertices: &[Vector]) -> Self {
        let same = first_at_same_place(vertices);
        corners.par_iter_mut().for_each(|face| *face = face.map(|i| same[i as usize]));

        // A triangle too thin for a normal adds to none, as if it were not there.
        let parts: Vec<(Vector, [Vector; 3])> = triangles
            .par_iter()
            .map(|t| {
                let normal = t.scaled_normal().try_normalize().unwrap_or(Vector::ZERO);
                let weighted = |at: Vector, one: Vector, other: Vector| {
                    let angle_rad = (one - at).angle_between(other - at);
                    if angle_rad.is_finite() { normal * angle_rad } else { Vector::ZERO }
                };
                (normal, [weighted(t.a, t.b, t.c), weighted(t.b, t.c, t.a), weighted(t.c, t.a, t.b)])
            })
            .collect();
        let mut vertex_normals = vec![Vector::ZERO; vertices.len()];
        for (face, (_, weighted)) in corners.iter().zip(&parts) {
            for (&vertex, &part) in face.iter().zip(weighted) {
                vertex_normals[vertex as usize] += part;
            }
        }

        // Edges as pairs of vertices, lower first, each with the places that run along it.
        let mut uses: Vec<(u64, u32)> = corners
            .par_iter()
            .enumerate()
            .flat_map_iter(|(face, &[a, b, c])| {
                [(a, b), (b, c), (c, a)].into_iter().enumerate().map(move |(side, (from, to))| {
                    (u64::from(from.min(to)) << 32 | u64::from(from.max(to)), (3 * face + side) as u32)
                })
            })
            .collect();
        uses.par_sort_unstable();
        let mut edges = vec![[0; 3]; corners.len()];
        let mut edge_normals = Vec::with_capacity(uses.len() / 2);
        let mut closed = true;
        for run in uses.chunk_by(|one, other| one.0 == other.0) {
            let mut normal = Vector::ZERO;
            let mut balance = 0;
            for &(_, place) in run {
                let (face, side) = (place as usize / 3, place as usize % 3);
                edges[face][side] = edge_normals.len() as u32;
                normal += parts[face].0;
                balance += if corners[face][side] < corners[face][(side + 1) % 3] { 1 } else { -1 };
            }
            closed &= run.len() == 2 && balance == 0;
            edge_normals.push(normal);
        }
        Self { corners, edges, vertex_normals, edge_normals, closed }
    }

    /// Whether every edge joins two triangles that are turned alike.
    pub(super) fn closed(&self) -> bool {
        self.closed
    }

    /// Whether a point is inside, or behind the nearest sheet of an open surface.
    pub(super) fn inside(&self, triangles: &[Triangle], point: Vector, hit: &Hit) -> bool {
        let face = hit.triangle as usize;
        let normal = match hit.location {
            TrianglePointLocation::OnFace(..) | TrianglePointLocation::OnSolid => {
                triangles[face].scaled_normal()
            }
            TrianglePointLocation::OnEdge(side, _) => {
                self.edge_normals[self.edges[face][side as usize] as usize]
            }
            TrianglePointLocation::OnVertex(corner) => {
                self.vertex_normals[self.corners[face][corner as usize] as usize]
            }
        };
        (point - hit.point).dot(normal) <= 0.0
    }

    /// Bytes on the heap.
    pub(super) fn bytes(&self) -> usize {
        (self.corners.capacity() + self.edges.capacity()) * size_of::<[u32; 3]>()
            + (self.vertex_normals.capacity() + self.edge_normals.capacity()) * size_of::<Vector>()
    }
}

/// For each vertex the lowest one that is just where it is.
fn first_at_same_place(vertices: &[Vector]) -> Vec<u32> {
    // Adding zero makes one zero of two.
    let key = |vertex: u32| vertices[vertex as usize].to_array().map(|x| (x + 0.0).to_bits());
    let mut order: Vec<u32> = (0..vertices.len() as u32).collect();
    order.par_sort_unstable_by_key(|&vertex| (key(vertex), vertex));
    let mut first = vec![0; vertices.len()];
    for run in order.chunk_by(|&one, &other| key(one) == key(other)) {
        run.iter().for_each(|&vertex| first[vertex as usize] = run[0]);
    }
    first
}
