//! The palm as boxes that stay clear of the fingers' roots.

use nalgebra::{Isometry3, IsometryMatrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};

use super::balls::{Form, Placed};
use super::description::Description;
use crate::hand::PalmBox;

/// Slabs into which a palm's mesh is cut along its longest edge: boxes around them lie closer than one around all.
const SLABS: usize = 4;

/// Boxes thinner than this after they made room for a finger are left out, metres.
const THIN_M: f64 = 0.002;

/// Boxes of the palm's shapes in the frame that those are placed in; `fingers` are the centres of the fingers' balls while
/// the hand is open and half closed.
///
/// Boxes around meshes are shrunk until they hold none of these; boxes, cylinders, balls of the description are
/// believed.
pub(super) fn boxes(
    description: &Description,
    shapes: &[Placed],
    fingers: &[Point3<f64>],
    warnings: &mut Vec<String>,
) -> Vec<PalmBox> {
    let mut boxes = Vec::new();
    for shape in shapes {
        let mut add = |center: Vector3<f64>, half: Vector3<f64>| {
            let at = shape.body_from_shape * Translation3::from(center);
            boxes.push(PalmBox { palm_from_box: quaternion(&at), half_extents_m: half });
        };
        match &shape.body {
            Form::Cuboid { half } => add(Vector3::zeros(), *half),
            Form::Sphere { radius_m } => add(Vector3::zeros(), Vector3::repeat(*radius_m)),
            Form::Cylinder { radius_m, length_m } => {
                add(Vector3::zeros(), Vector3::new(*radius_m, *radius_m, 0.5 * length_m));
            }
            Form::Capsule { radius_m, length_m } => {
                add(Vector3::zeros(), Vector3::new(*radius_m, *radius_m, 0.5 * length_m + radius_m));
            }
            Form::Mesh { mesh, .. } => {
                let name = &description.links[shape.link].name;
                let mut cut_m = 0.0_f64;
                for (low, high) in slabs(mesh) {
                    let shape_from_palm = shape.body_from_shape.inverse();
                    let (low, high, shrunk_m) = clear_of(low, high, fingers, &shape_from_palm);
                    cut_m = cut_m.max(shrunk_m);
                    if (high - low).min() > THIN_M {
                        add(0.5 * (low + high), 0.5 * (high - low));
                    }
                }
                if cut_m > 0.0 {
                    warnings.push(format!(
                        "link '{name}': boxes around its mesh are cut by up to {:.0} mm to clear the fingers' roots",
                        1e3 * cut_m
                    ));
                }
            }
        }
    }
    boxes
}

/// Boxes around the parts of a mesh, cut across its longest edge.
fn slabs(mesh: &crate::surface::Mesh) -> Vec<(Vector3<f64>, Vector3<f64>)> {
    let (low, high) = mesh.bounding_box();
    let edges = high - low;
    let axis = edges.imax();
    let mut slabs = Vec::new();
    for k in 0..SLABS {
        let at = |k: usize| low[axis] + edges[axis] * k as f64 / SLABS as f64;
        let (from, to) = (at(k), at(k + 1));
        let mut least = Vector3::repeat(f64::INFINITY);
        let mut most = Vector3::repeat(f64::NEG_INFINITY);
        let mut take = |p: Vector3<f64>| {
            least = least.inf(&p);
            most = most.sup(&p);
        };
        for face in 0..mesh.faces().len() {
            let corners = mesh.corners(face).map(|p| p.coords);
            for (i, j) in [(0, 1), (1, 2), (2, 0)] {
                let (a, b) = (corners[i], corners[j]);
                if (from..=to).contains(&a[axis]) {
                    take(a);
                }
                for plane in [from, to] {
                    if (a[axis] < plane) != (b[axis] < plane) {
                        take(a.lerp(&b, (plane - a[axis]) / (b[axis] - a[axis])));
                    }
                }
            }
        }
        if least.iter().all(|c| c.is_finite()) {
            slabs.push((least, most));
        }
    }
    slabs
}

/// The box with sides moved inwards, each time the one that costs the least volume, until no ball's centre is inside.
/// Also the longest move, metres.
fn clear_of(
    mut low: Vector3<f64>,
    mut high: Vector3<f64>,
    fingers: &[Point3<f64>],
    shape_from_palm: &IsometryMatrix3<f64>,
) -> (Vector3<f64>, Vector3<f64>, f64) {
    let mut most_m = 0.0_f64;
    for center in fingers {
        let at = (shape_from_palm * center).coords;
        if (0..3).any(|i| at[i] <= low[i] || at[i] >= high[i]) {
            continue;
        }
        let mut best: Option<(f64, usize, bool)> = None;
        for i in 0..3 {
            for is_low in [true, false] {
                let cut_m = if is_low { at[i] - low[i] } else { high[i] - at[i] };
                let share = cut_m / (high[i] - low[i]);
                if best.is_none_or(|(least, ..)| share < least) {
                    best = Some((share, i, is_low));
                }
            }
        }
        if let Some((share, i, is_low)) = best {
            most_m = most_m.max(share * (high[i] - low[i]));
            if is_low {
                low[i] = at[i];
            } else {
                high[i] = at[i];
            }
        }
    }
    (low, high, most_m)
}

/// A matrix isometry as a quaternion one.
pub(super) fn quaternion(matrix: &IsometryMatrix3<f64>) -> Isometry3<f64> {
    let rotation = Rotation3::from_matrix_unchecked(matrix.rotation.into_inner());
    Isometry3::from_parts(matrix.translation, UnitQuaternion::from_rotation_matrix(&rotation))
}
