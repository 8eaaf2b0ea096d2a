//! The plane that objects stand on.

use nalgebra::{Isometry3, Matrix3, Point3, SymmetricEigen, Translation3, Unit, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::cloud::PointCloud;

/// A plane `normal . p = offset_m`; of a table, the normal points to the side that objects stand on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    /// Unit normal.
    pub normal: Unit<Vector3<f64>>,
    /// Distance of the plane from the frame's origin along the normal, metres.
    pub offset_m: f64,
}

impl Plane {
    /// The horizontal plane at height `z_m`.
    #[must_use]
    pub fn horizontal(z_m: f64) -> Self {
        Self { normal: Vector3::z_axis(), offset_m: z_m }
    }

    /// Height of a point over the plane, metres.
    #[must_use]
    pub fn height(&self, point: &Point3<f64>) -> f64 {
        self.normal.dot(&point.coords) - self.offset_m
    }

    /// Coordinates in a frame whose plane z = 0 is this one and whose z axis is the normal.
    #[must_use]
    pub fn plane_from_cloud(&self) -> Isometry3<f64> {
        let turn = UnitQuaternion::rotation_between_axis(&self.normal, &Vector3::z_axis())
            .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
        Isometry3::from_parts(Translation3::new(0.0, 0.0, -self.offset_m), turn)
    }
}

const ATTEMPTS: usize = 400;
/// Points that score an attempt.
const SCORED: usize = 2000;
/// Least share of the cloud on the table.
const LEAST_SHARE: f64 = 0.15;
/// Largest share of the cloud below the table.
const LARGEST_BELOW: f64 = 0.02;

/// Looks for the table: the plane with the most points within `tolerance_m` (RANSAC, then least squares), if it is a
/// table at all.
///
/// A side of a box is also a plane with many points. What makes a plane a table is that the rest stands on its front,
/// the side that the sensor saw, and that it is wider than what stands on it.
#[must_use]
pub fn find_table(cloud: &PointCloud, tolerance_m: f64, seed: u64) -> Option<Plane> {
    let points = &cloud.points;
    if points.len() < 3 {
        return None;
    }
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut pick = || points[rng.random_range(0..points.len())];
    let sample: Vec<Point3<f64>> =
        if points.len() <= SCORED { points.clone() } else { (0..SCORED).map(|_| pick()).collect() };
    let mut best: Option<(usize, Plane)> = None;
    for _ in 0..ATTEMPTS {
        let (a, b, c) = (pick(), pick(), pick());
        let Some(normal) = Unit::try_new((b - a).cross(&(c - a)), f64::MIN_POSITIVE) else {
            continue;
        };
        let plane = Plane { normal, offset_m: normal.dot(&a.coords) };
        let score = sample.iter().filter(|p| plane.height(p).abs() < tolerance_m).count();
        if best.as_ref().is_none_or(|(most, _)| score > *most) {
            best = Some((score, plane));
        }
    }
    let mut plane = best?.1;
    for _ in 0..2 {
        plane = refit(points.iter().filter(|p| plane.height(p).abs() < tolerance_m))?;
    }
    let plane = facing_sensor(plane, cloud, tolerance_m);
    is_table(&plane, points, tolerance_m).then_some(plane)
}

fn refit<'a>(points: impl Iterator<Item = &'a Point3<f64>> + Clone) -> Option<Plane> {
    let count = points.clone().count() as f64;
    let mean = points.clone().map(|p| p.coords).sum::<Vector3<f64>>() / count;
    let covariance: Matrix3<f64> = points.map(|p| (p.coords - mean) * (p.coords - mean).transpose()).sum();
    let eigen = SymmetricEigen::new(covariance);
    let normal = Unit::try_new(eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned(), 1e-12)?;
    Some(Plane { normal, offset_m: normal.dot(&mean) })
}

/// Turns the plane so that lines of sight leave it on its front; without them, so that more points are in front.
fn facing_sensor(plane: Plane, cloud: &PointCloud, tolerance_m: f64) -> Plane {
    let balance: f64 = match &cloud.views {
        Some(views) => views.iter().map(|view| view.dot(&plane.normal)).sum(),
        None => {
            let heights = cloud.points.iter().map(|p| plane.height(p));
            heights.filter(|h| h.abs() > tolerance_m).map(f64::signum).sum()
        }
    };
    if balance < 0.0 { Plane { normal: -plane.normal, offset_m: -plane.offset_m } } else { plane }
}

fn is_table(plane: &Plane, points: &[Point3<f64>], tolerance_m: f64) -> bool {
    let turn = plane.plane_from_cloud();
    let (mut on, mut below, mut above) = (Vec::new(), 0_usize, Vec::new());
    for point in points.iter().map(|p| turn * p) {
        if point.z > tolerance_m {
            above.push(point);
        } else if point.z < -2.0 * tolerance_m {
            below += 1;
        } else {
            on.push(point);
        }
    }
    let all = points.len() as f64;
    if (on.len() as f64) < LEAST_SHARE * all || below as f64 > LARGEST_BELOW * all || above.is_empty() {
        return false;
    }
    let size = |points: &[Point3<f64>]| {
        super::cloud::bounding_box(points).map_or_else(Vector3::zeros, |(low, high)| high - low)
    };
    let (table, rest) = (size(&on), size(&above));
    table.x > rest.x && table.y > rest.y
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene(turn: &Isometry3<f64>) -> PointCloud {
        let mut points = Vec::new();
        for i in 0..40 {
            for j in 0..40 {
                let (x, y) = (f64::from(i) * 0.005, f64::from(j) * 0.005);
                let on_box = (12..24).contains(&i) && (12..24).contains(&j);
                points.push(
                    turn * Point3::new(x, y, if on_box { 0.05 } else { 0.0002 * f64::from((i + j) % 2) }),
                );
            }
        }
        PointCloud::from_points(points).unwrap()
    }

    #[test]
    fn finds_a_tilted_table_and_its_upper_side() {
        let turn = Isometry3::new(Vector3::new(0.3, -0.2, 0.9), Vector3::new(2.0, 0.4, -0.3));
        let plane = find_table(&scene(&turn), 0.001, 1).unwrap();
        assert!(plane.normal.dot(&(turn.rotation * Vector3::z())) > 0.9999);
        assert!(plane.height(&(turn * Point3::new(0.1, 0.1, 0.05))) > 0.049);
        let mapped = plane.plane_from_cloud() * (turn * Point3::new(0.1, 0.1, 0.05));
        assert!((mapped.z - 0.05).abs() < 3e-4);
    }

    #[test]
    fn the_top_of_a_box_is_no_table() {
        let seen = scene(&Isometry3::identity()).filtered(|_, p| p.z > 0.01);
        let mut points = seen.points.clone();
        // One side of the same box.
        points.extend(seen.points.iter().map(|p| Point3::new(p.x, 0.06, p.y - 0.065)));
        assert_eq!(find_table(&PointCloud::from_points(points).unwrap(), 0.001, 1), None);
    }
}
