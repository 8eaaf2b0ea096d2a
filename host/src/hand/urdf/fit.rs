//! Balls inside a mesh: along its longest principal axis, each as large as the surface around it lets it be.
//!
//! Inscribed, not circumscribed: a fingertip that is thought larger than it is would stop before it touches.

use nalgebra::{Matrix3, Point3, SymmetricEigen, Vector3};
use parry3d_f64::math::Vector as ParryVector;
use parry3d_f64::query::PointQuery;
use parry3d_f64::shape::TriMesh;

use super::balls::Ball;
use crate::surface::Mesh;

/// Cross-sections that are looked at along the axis.
const STATIONS: usize = 32;

/// Steps in which a ball's centre moves away from the surface that it touches.
const CENTRING_STEPS: usize = 24;

/// What fits into a mesh.
pub(super) struct Fit {
    /// Along the axis.
    pub(super) balls: Vec<Ball>,
    /// How far the mesh sticks out of its balls, metres.
    pub(super) uncovered_m: f64,
}

/// Balls inside a mesh, centres at most `spacing` radii apart where it is thick enough for that.
pub(super) fn balls_in(mesh: &Mesh, spacing: f64) -> Fit {
    let axes = principal_axes(mesh);
    let (low, high) = extent(mesh, &axes[0]);
    let across_m = [1, 2].map(|i| extent(mesh, &axes[i])).map(|(low, high)| high - low);
    let half_thin_m = 0.5 * across_m[0].min(across_m[1]).min(high - low);
    let vertices = mesh.vertices().iter().map(|p| ParryVector::new(p.x, p.y, p.z)).collect();
    let surface = TriMesh::new(vertices, mesh.faces().to_vec()).ok();
    let mut stations: Vec<(f64, Ball)> = Vec::new();
    if let Some(surface) = &surface {
        for k in 0..STATIONS {
            let along_m = low + (high - low) * (k as f64 + 0.5) / STATIONS as f64;
            if let Some(ball) = inscribed(mesh, surface, &axes, along_m, half_thin_m) {
                stations.push((along_m, ball));
            }
        }
    }
    if stations.is_empty() {
        stations = as_box(mesh, &axes, half_thin_m);
    }
    let balls = thinned(&stations, spacing);
    let outside_m = |p: &Point3<f64>| {
        let gaps = balls.iter().map(|ball| (p - ball.center).norm() - ball.radius_m);
        gaps.fold(f64::INFINITY, f64::min)
    };
    let uncovered_m = mesh.vertices().iter().map(outside_m).fold(0.0, f64::max);
    Fit { balls, uncovered_m }
}

/// Axes of the surface's second moments, longest first.
fn principal_axes(mesh: &Mesh) -> [Vector3<f64>; 3] {
    let (mut area, mut first, mut second) = (0.0, Vector3::zeros(), Matrix3::zeros());
    for face in 0..mesh.faces().len() {
        let [a, b, c] = mesh.corners(face).map(|p| p.coords);
        let weight = 0.5 * (b - a).cross(&(c - a)).norm();
        // Exact for a triangle: the midpoints of its edges, a third each.
        for middle in [(a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0] {
            first += middle * (weight / 3.0);
            second += middle * middle.transpose() * (weight / 3.0);
        }
        area += weight;
    }
    if area <= 0.0 {
        return [Vector3::x(), Vector3::y(), Vector3::z()];
    }
    let mean = first / area;
    let eigen = SymmetricEigen::new(second / area - mean * mean.transpose());
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    order.map(|i| eigen.eigenvectors.column(i).into_owned())
}

fn extent(mesh: &Mesh, axis: &Vector3<f64>) -> (f64, f64) {
    mesh.vertices()
        .iter()
        .map(|p| p.coords.dot(axis))
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), t| (l.min(t), h.max(t)))
}

/// The ball about the middle of a cross-section that the surface leaves room for, moved within the section to where it
/// is largest; `None` when the middle is outside the mesh.
fn inscribed(
    mesh: &Mesh,
    surface: &TriMesh,
    axes: &[Vector3<f64>; 3],
    along_m: f64,
    half_thin_m: f64,
) -> Option<Ball> {
    let axis = &axes[0];
    let mut center = section_middle(mesh, axis, along_m)?;
    if winding_number(mesh, &center).abs() < 0.5 {
        return None;
    }
    let nearest = |at: &Point3<f64>| {
        let point = surface.project_local_point(ParryVector::new(at.x, at.y, at.z), false).point;
        Point3::new(point.x, point.y, point.z)
    };
    let radius = |at: &Point3<f64>| (at - nearest(at)).norm();
    let mut radius_m = radius(&center);
    let mut step_m = 0.25 * half_thin_m;
    for _ in 0..CENTRING_STEPS {
        let away = center - nearest(&center);
        let away = away - axis * axis.dot(&away);
        let Some(direction) = away.try_normalize(1e-12) else { break };
        let moved = center + direction * step_m;
        let moved_radius_m = radius(&moved);
        // A longer way than the ball is thick may lead through the wall.
        if moved_radius_m > radius_m && step_m < radius_m {
            (center, radius_m) = (moved, moved_radius_m);
        } else {
            step_m *= 0.5;
        }
    }
    (radius_m > 1e-5).then_some(Ball { center, radius_m })
}

/// Middle of the outline in which a plane cuts the mesh, by length.
fn section_middle(mesh: &Mesh, axis: &Vector3<f64>, along_m: f64) -> Option<Point3<f64>> {
    let (mut length, mut sum) = (0.0, Vector3::zeros());
    for face in 0..mesh.faces().len() {
        let corners = mesh.corners(face);
        let heights = corners.map(|p| p.coords.dot(axis) - along_m);
        let mut ends = Vec::with_capacity(2);
        for (i, j) in [(0, 1), (1, 2), (2, 0)] {
            if (heights[i] < 0.0) != (heights[j] < 0.0) {
                let share = heights[i] / (heights[i] - heights[j]);
                ends.push(corners[i].coords.lerp(&corners[j].coords, share));
            }
        }
        if let [a, b] = ends.as_slice() {
            let part = (b - a).norm();
            length += part;
            sum += (a + b) * (0.5 * part);
        }
    }
    (length > 0.0).then(|| Point3::from(sum / length))
}

/// How often the mesh goes round a point: 1 or -1 inside, 0 outside, between them near the holes of an open one (van
/// Oosterom and Strackee 1983, "The solid angle of a plane triangle").
fn winding_number(mesh: &Mesh, at: &Point3<f64>) -> f64 {
    let mut turns = 0.0;
    for face in 0..mesh.faces().len() {
        let [a, b, c] = mesh.corners(face).map(|p| p - at);
        let (la, lb, lc) = (a.norm(), b.norm(), c.norm());
        let below = la * lb * lc + a.dot(&b) * lc + b.dot(&c) * la + c.dot(&a) * lb;
        turns += a.dot(&b.cross(&c)).atan2(below);
    }
    turns / std::f64::consts::TAU
}

/// For a mesh that encloses nothing: a row in the middle of its box.
fn as_box(mesh: &Mesh, axes: &[Vector3<f64>; 3], half_thin_m: f64) -> Vec<(f64, Ball)> {
    let middle = |axis: &Vector3<f64>| {
        let (low, high) = extent(mesh, axis);
        0.5 * (low + high)
    };
    let across = axes[1] * middle(&axes[1]) + axes[2] * middle(&axes[2]);
    let radius_m = half_thin_m.max(1e-4);
    let (low, high) = extent(mesh, &axes[0]);
    let (first, last) = (low + radius_m, (high - radius_m).max(low + radius_m));
    (0..STATIONS)
        .map(|k| {
            let along_m = first + (last - first) * k as f64 / (STATIONS - 1) as f64;
            (along_m, Ball { center: Point3::from(across + axes[0] * along_m), radius_m })
        })
        .collect()
}

/// Of balls in a row, both that reach farthest, and between them as few as leave no gap above the spacing.
fn thinned(stations: &[(f64, Ball)], spacing: f64) -> Vec<Ball> {
    let reach = |sign: f64| {
        let end_m = |(along_m, ball): &(f64, Ball)| sign * along_m + ball.radius_m;
        let most_m = stations.iter().map(end_m).fold(f64::NEG_INFINITY, f64::max);
        // Of those that reach the end, to a tenth of their radius, the largest: it has the rounding of the end.
        (0..stations.len())
            .filter(|&i| end_m(&stations[i]) > most_m - 0.1 * stations[i].1.radius_m)
            .max_by(|&a, &b| stations[a].1.radius_m.total_cmp(&stations[b].1.radius_m))
    };
    let (Some(first), Some(last)) = (reach(-1.0), reach(1.0)) else { return Vec::new() };
    let (first, last) = (first.min(last), first.max(last));
    let mut balls = vec![stations[first].1];
    let mut at = first;
    while at < last {
        let far_enough = |next: &usize| {
            let gap_m = stations[*next].0 - stations[at].0;
            gap_m <= spacing * stations[at].1.radius_m.min(stations[*next].1.radius_m)
        };
        // The farthest that still touches enough, or the next one.
        at = (at + 1..=last).take_while(far_enough).last().unwrap_or(at + 1);
        balls.push(stations[at].1);
    }
    balls
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A closed tube with round ends about x, radius 0.01, centres of its ends at 0 and 0.04.
    fn capsule() -> Mesh {
        let (rings, around) = (24, 48);
        let mut vertices = Vec::new();
        let mut faces = Vec::new();
        // Half circles at either end, joined by one long band.
        let profile: Vec<(f64, f64)> = (0..=rings)
            .map(|k| {
                let angle = std::f64::consts::PI * k as f64 / rings as f64;
                let shift = if 2 * k < rings { 0.0 } else { 0.04 };
                (shift - 0.01 * angle.cos(), 0.01 * angle.sin())
            })
            .collect();
        for (x, r) in &profile {
            for j in 0..around {
                let (sin, cos) = (std::f64::consts::TAU * f64::from(j) / f64::from(around)).sin_cos();
                vertices.push(Point3::new(*x, r * cos, r * sin));
            }
        }
        for i in 0..rings {
            for j in 0..around as u32 {
                let at = |i: u32, j: u32| i * around as u32 + j % around as u32;
                let i = i as u32;
                faces.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
                faces.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
            }
        }
        Mesh::new(vertices, faces).unwrap()
    }

    #[test]
    fn balls_of_a_capsule_have_its_radius_and_reach_its_ends() {
        let fit = balls_in(&capsule(), 0.75);
        // The mesh lies inside the capsule by the sagitta of its facets, 0.02 mm; stations are 1.9 mm apart.
        for ball in &fit.balls {
            assert!(ball.radius_m < 0.01 + 1e-9 && ball.center.y.hypot(ball.center.z) < 3e-4, "{ball:?}");
        }
        let ends = [fit.balls[0], fit.balls[fit.balls.len() - 1]];
        let mut reach: Vec<f64> = ends.iter().map(|b| (b.center.x - 0.02).abs() + b.radius_m).collect();
        reach.sort_by(f64::total_cmp);
        assert!(reach[0] > 0.0285 && reach[1] < 0.03 + 1e-9, "{reach:?}");
        assert!(ends.iter().all(|b| b.radius_m > 0.009));
        assert!(fit.uncovered_m < 0.0015, "{}", fit.uncovered_m);
    }

    #[test]
    fn the_winding_number_tells_inside_from_outside() {
        let mesh = capsule();
        assert!((winding_number(&mesh, &Point3::new(0.02, 0.003, 0.0)).abs() - 1.0).abs() < 1e-9);
        assert!(winding_number(&mesh, &Point3::new(0.02, 0.013, 0.0)).abs() < 1e-9);
    }
}
