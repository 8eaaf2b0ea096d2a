//! Shapes as balls, for fingers.

use nalgebra::{IsometryMatrix3, Point3, Vector3};

use super::description::{Description, Shape, Solid};
use super::error::Problem;
use super::files::Files;
use super::fit;

/// Most balls of one box or disc.
const MAX_GRID: usize = 24;

/// Meshes that stick out of their balls by more than this are named, metres.
const UNCOVERED_M: f64 = 0.002;

/// A ball in a body's frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ball {
    pub(super) center: Point3<f64>,
    pub(super) radius_m: f64,
}

/// A shape with its mesh read, in the body's frame.
#[derive(Debug, Clone)]
pub(super) struct Placed {
    pub(super) link: usize,
    pub(super) body_from_shape: IsometryMatrix3<f64>,
    pub(super) body: Form,
}

/// What a shape is.
#[derive(Debug, Clone)]
pub(super) enum Form {
    Cuboid { half: Vector3<f64> },
    Sphere { radius_m: f64 },
    Cylinder { radius_m: f64, length_m: f64 },
    Capsule { radius_m: f64, length_m: f64 },
    Mesh { uri: String, mesh: crate::surface::Mesh },
}

/// The shapes of a body's links: the collision shapes of each, or its visual ones with a line in `warnings`.
pub(super) fn shapes(
    description: &Description,
    links: &[(usize, IsometryMatrix3<f64>)],
    files: &Files,
    warnings: &mut Vec<String>,
) -> Result<Vec<Placed>, Problem> {
    let mut placed = Vec::new();
    for (link, body_from_link) in links {
        let element = &description.links[*link];
        let from = if element.collision.is_empty() { &element.visual } else { &element.collision };
        if element.collision.is_empty() && !from.is_empty() {
            warnings
                .push(format!("link '{}' has no collision shape: its visual ones are used", element.name));
        }
        for Shape { link_from_shape, solid } in from {
            let body = match solid {
                Solid::Cuboid { half } => Form::Cuboid { half: *half },
                Solid::Sphere { radius_m } => Form::Sphere { radius_m: *radius_m },
                Solid::Cylinder { radius_m, length_m } => {
                    Form::Cylinder { radius_m: *radius_m, length_m: *length_m }
                }
                Solid::Capsule { radius_m, length_m } => {
                    Form::Capsule { radius_m: *radius_m, length_m: *length_m }
                }
                Solid::Mesh { uri, scale } => {
                    let mesh = files.mesh(&element.name, uri, scale, warnings)?;
                    Form::Mesh { uri: uri.clone(), mesh }
                }
            };
            placed.push(Placed { link: *link, body_from_shape: body_from_link * link_from_shape, body });
        }
    }
    Ok(placed)
}

/// Balls of a body's shapes, centres at most `spacing` radii apart as far as [`MAX_GRID`] lets them.
pub(super) fn balls(
    description: &Description,
    shapes: &[Placed],
    spacing: f64,
    warnings: &mut Vec<String>,
) -> Vec<Ball> {
    let mut balls: Vec<Ball> = Vec::new();
    for shape in shapes {
        let place = |center: Vector3<f64>, radius_m: f64| Ball {
            center: shape.body_from_shape * Point3::from(center),
            radius_m,
        };
        match &shape.body {
            Form::Sphere { radius_m } => balls.push(place(Vector3::zeros(), *radius_m)),
            Form::Capsule { radius_m, length_m } => {
                let ends = [-0.5 * length_m, 0.5 * length_m];
                balls.extend(row(ends, *radius_m, spacing).map(|z| place(Vector3::z() * z, *radius_m)));
            }
            Form::Cylinder { radius_m, length_m } if *length_m >= 2.0 * radius_m => {
                let ends = [-1.0, 1.0].map(|side| {
                    // A ball at its end makes it a capsule there.
                    let end = Vector3::z() * (0.5 * side * length_m);
                    let is_round = has_ball_at(shapes, &place(end, *radius_m));
                    end.z - if is_round { 0.0 } else { side * radius_m }
                });
                balls.extend(row(ends, *radius_m, spacing).map(|z| place(Vector3::z() * z, *radius_m)));
            }
            Form::Cylinder { radius_m, length_m } => {
                let half = Vector3::new(*radius_m, *radius_m, 0.5 * length_m);
                let inner_m = (radius_m - half.z).max(0.0);
                let is_in = |c: &Vector3<f64>| c.x.hypot(c.y) <= inner_m + 1e-9;
                balls.extend(grid(&half, spacing).into_iter().filter(is_in).map(|c| place(c, half.min())));
            }
            Form::Cuboid { half } => {
                balls.extend(grid(half, spacing).into_iter().map(|c| place(c, half.min())));
            }
            Form::Mesh { uri, mesh } => {
                let fit = fit::balls_in(mesh, spacing);
                if fit.uncovered_m > UNCOVERED_M {
                    warnings.push(format!(
                        "link '{}': {} ball(s) stand for '{uri}', which sticks out of them by up to {:.1} mm",
                        description.links[shape.link].name,
                        fit.balls.len(),
                        1e3 * fit.uncovered_m
                    ));
                }
                balls.extend(fit.balls.iter().map(|ball| place(ball.center.coords, ball.radius_m)));
            }
        }
    }
    // Balls inside others touch nothing.
    let mut kept: Vec<Ball> = Vec::new();
    for (i, ball) in balls.iter().enumerate() {
        let inside = |(j, other): (usize, &Ball)| {
            let slack_m = other.radius_m - ball.radius_m - (other.center - ball.center).norm();
            j != i && (slack_m > 1e-9 || (slack_m > -1e-9 && j < i))
        };
        if !balls.iter().enumerate().any(inside) {
            kept.push(*ball);
        }
    }
    kept
}

fn has_ball_at(shapes: &[Placed], ball: &Ball) -> bool {
    shapes.iter().any(|shape| match shape.body {
        Form::Sphere { radius_m } => {
            let center = Point3::from(shape.body_from_shape.translation.vector);
            radius_m >= 0.95 * ball.radius_m && (center - ball.center).norm() < 0.05 * ball.radius_m
        }
        _ => false,
    })
}

/// Places from one end to the other, at most `spacing` radii apart; one in the middle when the ends meet or have passed.
fn row([from, to]: [f64; 2], radius_m: f64, spacing: f64) -> impl Iterator<Item = f64> {
    let length_m = (to - from).max(0.0);
    let (from, to) = if to > from { (from, to) } else { (0.5 * (from + to), 0.5 * (from + to)) };
    // A hair more than a whole number of spacings is that number.
    let gaps = ((length_m / (spacing * radius_m)) - 1e-9).ceil().clamp(0.0, 200.0) as usize;
    (0..=gaps)
        .map(move |k| if gaps == 0 { 0.5 * (from + to) } else { from + (to - from) * k as f64 / gaps as f64 })
}

/// Centres of balls of half the smallest edge in a box, wider apart when they would be more than [`MAX_GRID`].
fn grid(half: &Vector3<f64>, spacing: f64) -> Vec<Vector3<f64>> {
    let radius_m = half.min();
    let free_m = half - Vector3::repeat(radius_m);
    let mut spacing = spacing;
    loop {
        let places: [Vec<f64>; 3] =
            [0, 1, 2].map(|i| row([-free_m[i], free_m[i]], radius_m, spacing).collect());
        if places.iter().map(Vec::len).product::<usize>() <= MAX_GRID {
            let mut centers = Vec::new();
            for x in &places[0] {
                for y in &places[1] {
                    centers.extend(places[2].iter().map(|z| Vector3::new(*x, *y, *z)));
                }
            }
            return centers;
        }
        spacing *= 1.25;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_end_at_the_ends_and_leave_no_wide_gap() {
        for (length_m, radius_m) in [(0.05, 0.01), (0.0075, 0.01), (0.0151, 0.01), (0.0, 0.02)] {
            let places: Vec<f64> = row([-0.5 * length_m, 0.5 * length_m], radius_m, 0.75).collect();
            assert!((places[0] + 0.5 * length_m).abs() < 1e-15);
            assert!((places[places.len() - 1] - 0.5 * length_m).abs() < 1e-15);
            assert!(places.windows(2).all(|pair| pair[1] - pair[0] <= 0.75 * radius_m + 1e-9));
        }
    }

    #[test]
    fn balls_of_a_box_stay_in_it_and_few() {
        for half in [Vector3::new(0.01, 0.02, 0.03), Vector3::new(0.0005, 0.1, 0.1), Vector3::repeat(0.01)] {
            let centers = grid(&half, 0.75);
            assert!(!centers.is_empty() && centers.len() <= MAX_GRID);
            for center in centers {
                assert!((half - center.abs()).min() >= half.min() - 1e-12);
            }
        }
    }
}
