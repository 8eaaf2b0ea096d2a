//! Polygons to triangles.
//!
//! Ears are cut here and not by the `earcut` crate because that one leaves out corners that lie on a straight edge. The
//! neighbour on that edge keeps them, and a closed surface would come out open.

use nalgebra::{Point3, Vector3};

use super::error::Problem;

/// Ear cutting is cubic in the worst case; convex faces are fanned whatever their size.
const MAX_CONCAVE_CORNERS: usize = 1024;

/// Cuts a polygon into triangles of the same turning sense that use every corner. A polygon that crosses itself is
/// fanned from where no ear is left. All indices must be in range.
pub(super) fn triangulate(
    polygon: &[u32],
    vertices: &[Point3<f64>],
    triangles: &mut Vec<[u32; 3]>,
) -> Result<(), Problem> {
    match *polygon {
        [] | [_] | [_, _] => return Err(Problem::TooFewCorners(polygon.len())),
        [a, b, c] => {
            triangles.push([a, b, c]);
            return Ok(());
        }
        _ => {}
    }
    let flat = flattened(polygon, vertices);
    if is_convex(&flat) {
        fan(polygon, &(0..polygon.len()).collect::<Vec<_>>(), triangles);
        return Ok(());
    }
    if polygon.len() > MAX_CONCAVE_CORNERS {
        return Err(Problem::TooManyCorners { corners: polygon.len(), limit: MAX_CONCAVE_CORNERS });
    }
    let mut ring: Vec<usize> = (0..polygon.len()).collect();
    let mut from = 0;
    while ring.len() > 3 {
        let Some(ear) = (0..ring.len()).map(|k| (from + k) % ring.len()).find(|&k| is_ear(&ring, k, &flat))
        else {
            break;
        };
        let n = ring.len();
        triangles.push([ring[(ear + n - 1) % n], ring[ear], ring[(ear + 1) % n]].map(|k| polygon[k]));
        ring.remove(ear);
        // Going on behind the neighbour spreads the cuts instead of fanning slivers from one corner.
        from = ear + 1;
    }
    fan(polygon, &ring, triangles);
    Ok(())
}

fn fan(polygon: &[u32], ring: &[usize], triangles: &mut Vec<[u32; 3]>) {
    for pair in ring[1..].windows(2) {
        triangles.push([ring[0], pair[0], pair[1]].map(|k| polygon[k]));
    }
}

/// The corners along the axis that the polygon faces most, counter-clockwise; the coordinates stay the file's own.
fn flattened(polygon: &[u32], vertices: &[Point3<f64>]) -> Vec<[f64; 2]> {
    let corner = |k: usize| vertices[polygon[k % polygon.len()] as usize];
    let normal: Vector3<f64> =
        (1..polygon.len()).map(|k| (corner(k) - corner(0)).cross(&(corner(k + 1) - corner(0)))).sum();
    let axis = normal.iamax();
    let (mut u, mut v) = ((axis + 1) % 3, (axis + 2) % 3);
    if normal[axis] < 0.0 {
        std::mem::swap(&mut u, &mut v);
    }
    (0..polygon.len()).map(|k| [corner(k)[u], corner(k)[v]]).collect()
}

/// Twice the signed area of a triangle.
fn turn(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Every corner turns left, and so does every fan triangle: the second half excludes stars that wind round twice.
fn is_convex(flat: &[[f64; 2]]) -> bool {
    let n = flat.len();
    (0..n).all(|k| turn(flat[k], flat[(k + 1) % n], flat[(k + 2) % n]) > 0.0)
        && (1..n - 1).all(|k| turn(flat[0], flat[k], flat[k + 1]) > 0.0)
}

/// Whether corner `k` of the ring can be cut off: it turns left and no other corner is in the triangle or on its rim.
fn is_ear(ring: &[usize], k: usize, flat: &[[f64; 2]]) -> bool {
    let n = ring.len();
    let [a, b, c] = [ring[(k + n - 1) % n], ring[k], ring[(k + 1) % n]].map(|i| flat[i]);
    turn(a, b, c) > 0.0
        && !ring.iter().map(|&i| flat[i]).any(|p| {
            p != a && p != b && p != c && turn(a, b, p) >= 0.0 && turn(b, c, p) >= 0.0 && turn(c, a, p) >= 0.0
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(outline: &[[f64; 2]]) -> (f64, usize) {
        let vertices: Vec<_> = outline.iter().map(|p| Point3::new(p[0], p[1], 3.0)).collect();
        let polygon: Vec<u32> = (0..outline.len() as u32).collect();
        let mut triangles = Vec::new();
        triangulate(&polygon, &vertices, &mut triangles).unwrap();
        let corners = triangles.iter().map(|triangle| triangle.map(|i| outline[i as usize]));
        let parts: Vec<f64> = corners.map(|[a, b, c]| 0.5 * turn(a, b, c)).collect();
        assert!(parts.iter().all(|&part| part > 0.0), "{parts:?}");
        (parts.iter().sum(), triangles.len())
    }

    #[test]
    fn concave_outline_keeps_its_area() {
        let arrow = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [2.0, 1.0]];
        assert_eq!(area(&arrow), (6.0, 2));
        let comb: Vec<[f64; 2]> = [[0.0, 0.0], [5.0, 0.0]]
            .into_iter()
            .chain((0..5).rev().flat_map(|k| [[k as f64 + 1.0, 2.0], [k as f64 + 0.5, 0.5]]))
            .chain([[0.0, 2.0]])
            .collect();
        let shoelace: f64 =
            (0..comb.len()).map(|k| turn([0.0, 0.0], comb[k], comb[(k + 1) % comb.len()])).sum::<f64>() / 2.0;
        let (found, triangles) = area(&comb);
        assert!((found - shoelace).abs() < 1e-12);
        assert_eq!(triangles, comb.len() - 2);
    }

    #[test]
    fn corners_on_a_straight_edge_stay() {
        let square =
            [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 1.0], [2.0, 2.0], [1.0, 2.0], [0.0, 2.0], [0.0, 1.0]];
        assert_eq!(area(&square), (4.0, 6));
    }

    #[test]
    fn large_concave_faces_are_refused_and_large_convex_ones_are_not() {
        let disc = |n: usize, dent: f64| -> Vec<Point3<f64>> {
            (0..n)
                .map(|k| {
                    let (sin, cos) = (k as f64 / n as f64 * std::f64::consts::TAU).sin_cos();
                    Point3::new(cos, sin, 0.0) * if k == 5 { dent } else { 1.0 }
                })
                .collect()
        };
        let polygon: Vec<u32> = (0..2000).collect();
        let mut triangles = Vec::new();
        triangulate(&polygon, &disc(2000, 1.0), &mut triangles).unwrap();
        assert_eq!(triangles.len(), 1998);
        let error = triangulate(&polygon, &disc(2000, 0.5), &mut triangles).unwrap_err();
        assert_eq!(error, Problem::TooManyCorners { corners: 2000, limit: 1024 });
    }
}
