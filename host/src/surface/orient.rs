//! Consistent signs for tangent planes.

use std::{cmp::Reverse, collections::BinaryHeap};

use nalgebra::{Point3, Unit, Vector3};
use rayon::prelude::*;

use super::{grid::Grid, tangent::Tangent};

/// Turns each normal towards the direction that is known to lie outside there: a line of sight, or a given normal.
///
/// This needs no neighbour and so cannot jump from one side of a thin wall to the other, as propagation does.
pub fn orient_towards(tangents: &mut [Tangent], outside: &[Unit<Vector3<f64>>]) {
    for (tangent, outside) in tangents.iter_mut().zip(outside) {
        if tangent.normal.dot(outside) < 0.0 {
            tangent.normal = -tangent.normal;
        }
    }
}

/// Orients without lines of sight: propagation along the minimum spanning tree of the Riemannian graph, whose edges
/// join `k` nearest tangent planes and cost `1 - |n_i . n_j|` (Hoppe et al. 1992, section 3.3).
///
/// The graph's components are oriented each by itself. Hoppe roots the tree at the highest sample, whose normal may be
/// the worst; here all samples of a component vote: outward from the centroid of the cloud, or towards `up` where that
/// vote is balanced, as on a plane sheet.
pub fn orient_by_propagation(tangents: &mut [Tangent], k: usize, up: &Vector3<f64>) {
    let origins: Vec<Point3<f64>> = tangents.iter().map(|t| t.origin).collect();
    let graph = Riemannian::new(tangents, &origins, k);
    let centroid =
        Point3::from(origins.iter().map(|o| o.coords).sum::<Vector3<f64>>() / origins.len().max(1) as f64);
    let mut reached = vec![false; tangents.len()];
    for root in 0..tangents.len() {
        if !reached[root] {
            let members = propagate(tangents, &graph, root, &mut reached);
            vote(tangents, &members, &centroid, up);
        }
    }
}

/// Neighbours of every tangent plane in both directions, in one array.
struct Riemannian {
    starts: Vec<u32>,
    neighbours: Vec<u32>,
}

impl Riemannian {
    fn new(tangents: &[Tangent], origins: &[Point3<f64>], k: usize) -> Self {
        let grid = Grid::for_surface(origins);
        let mut edges: Vec<(u32, u32)> = origins
            .par_iter()
            .enumerate()
            .map_init(Vec::new, |found, (i, origin)| {
                grid.nearest(origin, k + 1, found);
                let i = i as u32;
                found.iter().filter(|n| n.1 != i).flat_map(|n| [(i, n.1), (n.1, i)]).collect::<Vec<_>>()
            })
            .flatten_iter()
            .collect();
        edges.par_sort_unstable();
        edges.dedup();
        let mut starts = vec![0_u32; tangents.len() + 1];
        for edge in &edges {
            starts[edge.0 as usize + 1] += 1;
        }
        for i in 1..starts.len() {
            starts[i] += starts[i - 1];
        }
        Self { starts, neighbours: edges.into_iter().map(|edge| edge.1).collect() }
    }

    fn of(&self, i: u32) -> &[u32] {
        &self.neighbours[self.starts[i as usize] as usize..self.starts[i as usize + 1] as usize]
    }
}

/// Prim's algorithm from `root`; every plane takes the sign of the one that it is reached from. Returns the component.
fn propagate(tangents: &mut [Tangent], graph: &Riemannian, root: usize, reached: &mut [bool]) -> Vec<u32> {
    // Costs in parts per million order the heap without floats; indices break ties the same way every time.
    let mut frontier = BinaryHeap::from([Reverse((0_u32, root as u32, root as u32))]);
    let mut members = Vec::new();
    while let Some(Reverse((_, to, from))) = frontier.pop() {
        if std::mem::replace(&mut reached[to as usize], true) {
            continue;
        }
        members.push(to);
        let reference = tangents[from as usize].normal;
        let tangent = &mut tangents[to as usize];
        if tangent.normal.dot(&reference) < 0.0 {
            tangent.normal = -tangent.normal;
        }
        let normal = tangent.normal;
        for &next in graph.of(to).iter().filter(|&&next| !reached[next as usize]) {
            let cost = 1.0 - normal.dot(&tangents[next as usize].normal).abs();
            frontier.push(Reverse(((cost * 1e6) as u32, next, to)));
        }
    }
    members
}

fn vote(tangents: &mut [Tangent], members: &[u32], centroid: &Point3<f64>, up: &Vector3<f64>) {
    let (mut outward, mut total, mut upward) = (0.0, 0.0, 0.0);
    for &i in members {
        let tangent = &tangents[i as usize];
        let arm = tangent.origin - centroid;
        outward += tangent.normal.dot(&arm);
        total += arm.norm();
        upward += tangent.normal.dot(up);
    }
    let score = if outward.abs() > 0.05 * total { outward } else { upward };
    if score < 0.0 {
        for &i in members {
            tangents[i as usize].normal = -tangents[i as usize].normal;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A Fibonacci sphere with normals of mixed sign.
    fn sphere(count: usize) -> Vec<Tangent> {
        (0..count)
            .map(|i| {
                let z = 1.0 - (2.0 * i as f64 + 1.0) / count as f64;
                let (sin, cos) = (2.399_963 * i as f64).sin_cos();
                let r = (1.0 - z * z).sqrt();
                let normal = Unit::new_normalize(Vector3::new(r * cos, r * sin, z));
                let sign = if i % 3 == 0 { -normal } else { normal };
                Tangent { origin: Point3::from(normal.into_inner()), normal: sign }
            })
            .collect()
    }

    #[test]
    fn propagation_turns_a_sphere_outward() {
        let mut tangents = sphere(2000);
        orient_by_propagation(&mut tangents, 8, &Vector3::z());
        assert!(tangents.iter().all(|t| t.normal.dot(&t.origin.coords) > 0.9));
    }

    #[test]
    fn a_plane_sheet_faces_up_and_views_win_over_shape() {
        let flat = |i: usize| Point3::new((i % 20) as f64, (i / 20) as f64, 0.0);
        let down = Tangent { origin: Point3::origin(), normal: -Vector3::z_axis() };
        let mut tangents: Vec<_> = (0..400).map(|i| Tangent { origin: flat(i), ..down }).collect();
        orient_by_propagation(&mut tangents, 8, &Vector3::z());
        assert!(tangents.iter().all(|t| t.normal.z > 0.0));
        orient_towards(&mut tangents, &vec![Unit::new_normalize(Vector3::new(1.0, 0.0, -0.1)); 400]);
        assert!(tangents.iter().all(|t| t.normal.z < 0.0));
    }
}
