//! Consistent signs for tangent planes.

use std::{cmp::Reverse, collections::BinaryHeap};

use nalgebra::{Point3, Unit, Vector3};

use super::{grid::Neighbour, tangent::Tangent};

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
/// join neighbouring tangent planes (Hoppe et al. 1992, section 3.3); `near` are the neighbours of each.
///
/// Hoppe's cost of an edge, `1 - |n_i . n_j|`, takes the two sides of a thin wall for the best of neighbours, and cannot
/// pass an edge of a right angle. So the one normal is first reflected in the plane half way between the two samples, as
/// if both lay on one circle (Xie et al. 2003): across a convex or concave edge and around a wall the signs come out right.
///
/// The graph's components are oriented each by itself. Hoppe roots the tree at the highest sample, whose normal may be
/// the worst; here all samples of a component vote: outward from the centroid of the cloud, or towards `up` where that
/// vote is balanced, as on a plane sheet.
pub fn orient_by_propagation(tangents: &mut [Tangent], near: &[Vec<Neighbour>], up: &Vector3<f64>) {
    let graph = Riemannian::new(near);
    let sum: Vector3<f64> = tangents.iter().map(|tangent| tangent.origin.coords).sum();
    let centroid = Point3::from(sum / tangents.len().max(1) as f64);
    // Least cost found so far in parts per million, 0 for what is reached.
    let mut costs = vec![u32::MAX; tangents.len()];
    for root in 0..tangents.len() {
        if costs[root] > 0 {
            let members = propagate(tangents, &graph, root, &mut costs);
            vote(tangents, &members, &centroid, up);
        }
    }
}

/// Neighbours of every tangent plane in both directions, in one array; some twice.
struct Riemannian {
    starts: Vec<u32>,
    neighbours: Vec<u32>,
}

impl Riemannian {
    fn new(near: &[Vec<Neighbour>]) -> Self {
        let edges = || {
            let all = (0..).zip(near).flat_map(|(i, near)| near.iter().map(move |n| (i, n.1)));
            all.filter(|(i, j): &(u32, u32)| i != j)
        };
        let mut starts = vec![0_u32; near.len() + 1];
        for (i, j) in edges() {
            starts[i as usize + 1] += 1;
            starts[j as usize + 1] += 1;
        }
        for i in 1..starts.len() {
            starts[i] += starts[i - 1];
        }
        let mut next = starts.clone();
        let mut neighbours = vec![0; starts[near.len()] as usize];
        for (i, j) in edges() {
            for (from, to) in [(i, j), (j, i)] {
                neighbours[next[from as usize] as usize] = to;
                next[from as usize] += 1;
            }
        }
        Self { starts, neighbours }
    }

    fn of(&self, i: u32) -> &[u32] {
        &self.neighbours[self.starts[i as usize] as usize..self.starts[i as usize + 1] as usize]
    }
}

/// The normal that a plane has at the origin of another one if both lie on one circle.
fn carried(from: &Tangent, to: &Tangent) -> Vector3<f64> {
    let (normal, way) = (from.normal.into_inner(), to.origin - from.origin);
    let square = way.norm_squared();
    if square > 0.0 { normal - way * (2.0 * way.dot(&normal) / square) } else { normal }
}

/// Prim's algorithm from `root`; every plane takes the sign of the one that it is reached from. Returns the component.
fn propagate(tangents: &mut [Tangent], graph: &Riemannian, root: usize, costs: &mut [u32]) -> Vec<u32> {
    // Costs in parts per million order the heap without floats; indices break ties the same way every time.
    let mut frontier = BinaryHeap::from([Reverse((1_u32, root as u32, root as u32))]);
    let mut members = Vec::new();
    while let Some(Reverse((_, to, from))) = frontier.pop() {
        if std::mem::replace(&mut costs[to as usize], 0) == 0 {
            continue;
        }
        members.push(to);
        let reference = carried(&tangents[from as usize], &tangents[to as usize]);
        let tangent = &mut tangents[to as usize];
        if tangent.normal.dot(&reference) < 0.0 {
            tangent.normal = -tangent.normal;
        }
        let tangent = *tangent;
        for &next in graph.of(to) {
            if costs[next as usize] == 0 {
                continue;
            }
            let other = &tangents[next as usize];
            let cost = 1.0 - carried(&tangent, other).dot(&other.normal).abs();
            let cost = 1 + (cost.max(0.0) * 1e6) as u32;
            if cost < costs[next as usize] {
                costs[next as usize] = cost;
                frontier.push(Reverse((cost, next, to)));
            }
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
    use crate::surface::{grid::Grid, tangent::neighbourhoods};

    fn propagated(tangents: &mut [Tangent]) {
        let origins: Vec<Point3<f64>> = tangents.iter().map(|t| t.origin).collect();
        let near = neighbourhoods(&origins, &Grid::for_surface(&origins), 9);
        orient_by_propagation(tangents, &near, &Vector3::z());
    }

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
        propagated(&mut tangents);
        assert!(tangents.iter().all(|t| t.normal.dot(&t.origin.coords) > 0.9));
    }

    #[test]
    fn signs_pass_the_edges_of_a_box_and_the_sides_of_a_thin_plate() {
        // Faces 1.2 samples deep: neighbours lie beyond the edges and on the other side.
        for half in [[10.0, 8.0, 6.0], [15.0, 15.0, 0.6_f64]] {
            let half: Vector3<f64> = Vector3::from(half);
            let mut tangents = Vec::new();
            for axis in 0..3 {
                let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                let count = |a: usize| (2.0 * half[a]).ceil() as i32;
                for (side, i, k) in (0..2)
                    .flat_map(|side| (0..count(u)).map(move |i| (side, i)))
                    .flat_map(|(side, i)| (0..count(v)).map(move |k| (side, i, k)))
                {
                    let mut origin = Point3::origin();
                    origin[axis] = if side == 0 { -half[axis] } else { half[axis] };
                    for (a, n) in [(u, i), (v, k)] {
                        origin[a] = half[a] * (2.0 * (f64::from(n) + 0.5) / f64::from(count(a)) - 1.0);
                    }
                    let sign = if (7 * i + 3 * k) % 2 == 0 { 1.0 } else { -1.0 };
                    let normal = Unit::new_unchecked(Vector3::ith(axis, sign));
                    tangents.push(Tangent { origin, normal });
                }
            }
            propagated(&mut tangents);
            for Tangent { origin, normal } in &tangents {
                assert!(normal.component_mul(&half.map(f64::recip)).dot(&origin.coords) > 0.9, "{origin}");
            }
        }
    }

    #[test]
    fn a_plane_sheet_faces_up_and_views_win_over_shape() {
        let flat = |i: usize| Point3::new((i % 20) as f64, (i / 20) as f64, 0.0);
        let down = Tangent { origin: Point3::origin(), normal: -Vector3::z_axis() };
        let mut tangents: Vec<_> = (0..400).map(|i| Tangent { origin: flat(i), ..down }).collect();
        propagated(&mut tangents);
        assert!(tangents.iter().all(|t| t.normal.z > 0.0));
        orient_towards(&mut tangents, &vec![Unit::new_normalize(Vector3::new(1.0, 0.0, -0.1)); 400]);
        assert!(tangents.iter().all(|t| t.normal.z < 0.0));
    }
}
