//! Cube, sphere, cylinder and cone, as polygons with their corners on the true surface.

use std::f64::consts::{PI, TAU};

use nalgebra::{Point3, Vector3};

use super::super::error::{Fault, Problem};
use super::Dialect;
use super::parser::Node;
use super::scene::{Scene, State};

/// Sides of a circle. The polygon lies within 0.06 % of the radius: 0.03 mm on a cup.
const AROUND: usize = 96;
/// Bands of a sphere from pole to pole.
const BANDS: usize = AROUND / 2;

/// Points and outward polygons in the node's own frame; the axis of round bodies is y.
#[derive(Default)]
struct Body {
    points: Vec<Point3<f64>>,
    polygons: Vec<Vec<usize>>,
}

/// Adds the surface of a node. `false` when the node is no primitive.
pub(super) fn add(scene: &mut Scene<'_, '_>, node: &Node<'_>, state: &State) -> Result<bool, Fault> {
    let body = match node.kind {
        "Cube" | "Box" => cuboid(node)?,
        "Sphere" => sphere(node.positive("radius", 1.0)?),
        "Cylinder" => {
            let (sides, top, bottom) =
                (shows(scene, node, "SIDES"), shows(scene, node, "TOP"), shows(scene, node, "BOTTOM"));
            cylinder(node.positive("radius", 1.0)?, node.positive("height", 2.0)?, sides, top, bottom)
        }
        "Cone" => {
            let (sides, bottom) = (shows(scene, node, "SIDES"), shows(scene, node, "BOTTOM"));
            cone(node.positive("bottomRadius", 1.0)?, node.positive("height", 2.0)?, sides, bottom)
        }
        _ => return Ok(false),
    };
    scene.spend(body.points.len())?;
    let first = scene.mesh.vertices.len() as i64;
    scene.mesh.vertices.extend(body.points.iter().map(|point| state.placed(point)));
    let is_mirrored = state.is_mirrored();
    for mut polygon in body.polygons {
        if is_mirrored {
            polygon.reverse();
        }
        scene
            .mesh
            .push(polygon.into_iter().map(|corner| Ok(first + corner as i64)), node.line)
            .map_err(|problem| node.fault(problem))?;
    }
    Ok(true)
}

/// Whether a part is shown: `parts (SIDES | TOP)` in Inventor and VRML 1, `side TRUE top FALSE` in VRML 2.
fn shows(scene: &Scene<'_, '_>, node: &Node<'_>, part: &str) -> bool {
    match scene.dialect {
        Dialect::Inventor => {
            let parts = node.words("parts");
            parts.is_empty() || parts.contains(&part) || parts.contains(&"ALL")
        }
        Dialect::Vrml2 => {
            let field = if part == "SIDES" { "side" } else { &part.to_ascii_lowercase() };
            node.words(field) != ["FALSE"]
        }
    }
}

fn cuboid(node: &Node<'_>) -> Result<Body, Fault> {
    let size = match node.vector("size")? {
        Some(size) => size,
        None => {
            Vector3::new(node.scalar("width", 2.0)?, node.scalar("height", 2.0)?, node.scalar("depth", 2.0)?)
        }
    };
    if let Some(&value) = size.iter().find(|&&length| length <= 0.0) {
        return Err(node.fault(Problem::NotPositive { what: "the size of a box", value }));
    }
    // Corner k is at the upper end along x, y, z where bit 0, 1, 2 of k is set.
    let corner = |k: usize| {
        let sign = |bit: usize| if k >> bit & 1 == 1 { 0.5 } else { -0.5 };
        Point3::new(sign(0) * size.x, sign(1) * size.y, sign(2) * size.z)
    };
    let sides = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    Ok(Body { points: (0..8).map(corner).collect(), polygons: sides.map(Vec::from).to_vec() })
}

fn sphere(radius: f64) -> Body {
    let mut body = Body::default();
    let rings: Vec<_> = (1..BANDS)
        .map(|band| {
            let (sin, cos) = (PI * band as f64 / BANDS as f64).sin_cos();
            body.ring(radius * sin, radius * cos)
        })
        .collect();
    for pair in rings.windows(2) {
        body.band(pair[0], pair[1]);
    }
    let (top, bottom) = (body.point(0.0, radius), body.point(0.0, -radius));
    body.tip(top, rings[0], true);
    body.tip(bottom, rings[BANDS - 2], false);
    body
}

fn cylinder(radius: f64, height: f64, sides: bool, top: bool, bottom: bool) -> Body {
    let mut body = Body::default();
    let (upper, lower) = (body.ring(radius, height / 2.0), body.ring(radius, -height / 2.0));
    if sides {
        body.band(upper, lower);
    }
    if top {
        body.polygons.push((upper..upper + AROUND).collect());
    }
    if bottom {
        body.polygons.push((lower..lower + AROUND).rev().collect());
    }
    body
}

fn cone(radius: f64, height: f64, sides: bool, bottom: bool) -> Body {
    let mut body = Body::default();
    let ring = body.ring(radius, -height / 2.0);
    if sides {
        let apex = body.point(0.0, height / 2.0);
        body.tip(apex, ring, true);
    }
    if bottom {
        body.polygons.push((ring..ring + AROUND).rev().collect());
    }
    body
}

impl Body {
    fn point(&mut self, x: f64, y: f64) -> usize {
        self.points.push(Point3::new(x, y, 0.0));
        self.points.len() - 1
    }

    /// A circle about the y axis, counter-clockwise seen from +y; returns its first point.
    fn ring(&mut self, radius: f64, y: f64) -> usize {
        let first = self.points.len();
        self.points.extend((0..AROUND).map(|k| {
            let (sin, cos) = (TAU * k as f64 / AROUND as f64).sin_cos();
            Point3::new(radius * cos, y, -radius * sin)
        }));
        first
    }

    /// Quadrilaterals between two rings, the first being the upper one.
    fn band(&mut self, upper: usize, lower: usize) {
        for k in 0..AROUND {
            let next = (k + 1) % AROUND;
            self.polygons.push(vec![upper + k, lower + k, lower + next, upper + next]);
        }
    }

    /// Triangles between a ring and a point on the axis above or below it.
    fn tip(&mut self, point: usize, ring: usize, is_above: bool) {
        for k in 0..AROUND {
            let (a, b) = (ring + k, ring + (k + 1) % AROUND);
            self.polygons.push(if is_above { vec![a, b, point] } else { vec![b, a, point] });
        }
    }
}
