//! A depth camera over a table, for tests: boxes and upright cylinders, seen from one place.

use nalgebra::{Point3, Unit, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::PointCloud;

/// Something on the table z = 0.
#[derive(Debug, Clone, Copy)]
pub(super) enum Thing {
    /// From corner to corner.
    Box([f64; 3], [f64; 3]),
    /// Upright: centre, radius, height.
    Cylinder([f64; 2], f64, f64),
    /// Centre and radius.
    Ball([f64; 3], f64),
}

impl Thing {
    /// How far along the ray it begins.
    fn hit(&self, from: &Point3<f64>, way: &Vector3<f64>) -> Option<f64> {
        let slab = |low: f64, high: f64, at: f64, step: f64| {
            let (a, b) = ((low - at) / step, (high - at) / step);
            [a.min(b), a.max(b)]
        };
        let round = |center: Vector3<f64>, radius: f64, keep: Vector3<f64>| {
            let (o, d) = ((from.coords - center).component_mul(&keep), way.component_mul(&keep));
            let (a, b, c) = (d.norm_squared(), o.dot(&d), o.norm_squared() - radius * radius);
            let root = (b * b - a * c).sqrt();
            // Rays that miss have no root, and an interval of NaN that holds nothing.
            [(-b - root) / a, (-b + root) / a]
        };
        let intervals = match *self {
            Self::Box(low, high) => [0, 1, 2].map(|a| slab(low[a], high[a], from[a], way[a])).to_vec(),
            Self::Cylinder([x, y], radius, height) => vec![
                round(Vector3::new(x, y, 0.0), radius, Vector3::new(1.0, 1.0, 0.0)),
                slab(0.0, height, from.z, way.z),
            ],
            Self::Ball(center, radius) => vec![round(center.into(), radius, Vector3::repeat(1.0))],
        };
        if intervals.iter().flatten().any(|bound| bound.is_nan()) {
            return None;
        }
        let start = intervals.iter().map(|interval| interval[0]).fold(0.0, f64::max);
        let end = intervals.iter().map(|interval| interval[1]).fold(f64::INFINITY, f64::min);
        (start < end).then_some(start)
    }
}

/// What a camera at `eye` that looks at `target` sees of the things, of a table of half width `table_m` and of a wall 0.4 m
/// behind the table's middle; `columns` across 40 degrees, with noise along the ray.
pub(super) fn seen(
    things: &[Thing],
    [eye, target]: [[f64; 3]; 2],
    table_m: f64,
    columns: u32,
    noise_m: f64,
) -> PointCloud {
    let (eye, target) = (Point3::from(eye), Point3::from(target));
    let forward = (target - eye).normalize();
    let right = forward.cross(&Vector3::z()).normalize();
    let up = right.cross(&forward);
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let (mut points, mut views) = (Vec::new(), Vec::new());
    let angle = |i: u32| (f64::from(i) / f64::from(columns) - 0.5) * 0.73;
    for i in 0..columns {
        for k in 0..columns {
            let way = (forward + right * angle(i) + up * angle(k)).normalize();
            let to_table = -eye.z / way.z;
            let on_table = (eye + way * to_table).coords.xy().amax() < table_m;
            let table = (to_table > 0.0 && on_table).then_some(to_table);
            let wall = (way.y > 0.0).then(|| (0.4 - eye.y) / way.y);
            let hits = things.iter().filter_map(|thing| thing.hit(&eye, &way));
            let nearest = hits.chain(table).chain(wall).fold(f64::INFINITY, f64::min);
            if nearest.is_finite() {
                points.push(eye + way * (nearest + noise_m * (rng.random::<f64>() - 0.5) * 3.4));
                views.push(Unit::new_unchecked(-way));
            }
        }
    }
    PointCloud { points, views: Some(views), ..PointCloud::default() }
}
