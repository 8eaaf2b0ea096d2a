//! The plane that objects stand on.

use nalgebra::{Isometry3, Matrix3, Point3, SymmetricEigen, Translation3, Unit, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{
    cloud::{PointCloud, bounding_box},
    outlier::quantile,
    scene::clusters,
};

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

/// Least size of a scene in which the largest plane may be a wall's or a floor's.
const LEAST_ROOM_M: f64 = 0.5;
/// Planes that are tried, and attempts at each.
const PLANES: usize = 4;
const ATTEMPTS: usize = 400;
/// Points that score an attempt.
const SCORED: usize = 2000;
/// Least share of the cloud on the table.
const LEAST_SHARE: f64 = 0.15;
/// Most points below the table within its outline, as a share of the points on it.
const MOST_BELOW: f64 = 0.02;
/// Fewest points that make something standing on the table.
const FEWEST_ABOVE: usize = 10;
/// Share of the outline's sides by which it shrinks before the rest is judged: the walls of a box stand on its rim.
const RIM: f64 = 0.1;

/// Cells across the longer side of the rectangle about the table, by which its surface is told from what else lies in
/// its plane.
const CELLS: f64 = 100.0;
/// Least size of a patch of the plane that counts as table, as a share of the largest one's.
const LEAST_PATCH: f64 = 0.1;
/// By how much the table's outline is widened about its middle: an object at the rim hides the table behind it.
const WIDENED: f64 = 1.1;
/// Points that lie farther under the plane than this many tolerances are not the table's.
const DEEPEST: f64 = 8.0;
/// Share of the points under the plane that [`TableTop::scatter_m`] covers.
const COVERED: f64 = 0.98;

/// A table and its extent.
#[derive(Debug, Clone, PartialEq)]
pub struct TableTop {
    /// The table's plane, normal to the objects' side.
    pub plane: Plane,
    /// Corners of the convex polygon about the table, x and y of [`Plane::plane_from_cloud`], metres,
    /// counter-clockwise; `None` for a table without edges.
    pub outline: Option<Vec<[f64; 2]>>,
    /// How far its points scatter to below the plane, metres: nothing else is there, so this is noise, and what is bent.
    pub scatter_m: f64,
}

impl TableTop {
    /// A table without edges.
    #[must_use]
    pub const fn endless(plane: Plane) -> Self {
        Self { plane, outline: None, scatter_m: 0.0 }
    }

    /// Whether a point lies above the table by more than `margin_m`, and not beside it as a far wall does.
    #[must_use]
    pub fn carries(&self, point: &Point3<f64>, margin_m: f64) -> bool {
        let point = self.plane.plane_from_cloud() * point;
        point.z > margin_m && self.is_over(&point)
    }

    /// Whether a point (frame of [`Plane::plane_from_cloud`]) lies over or under the table.
    fn is_over(&self, point: &Point3<f64>) -> bool {
        self.outline.as_ref().is_none_or(|corners| {
            (0..corners.len()).all(|i| {
                let (a, b) = (corners[i], corners[(i + 1) % corners.len()]);
                (b[0] - a[0]) * (point.y - a[1]) >= (b[1] - a[1]) * (point.x - a[0])
            })
        })
    }

    /// Whether nine tenths of what the table carries spread less along both its sides than nine tenths of it do.
    fn is_wider_than_rest(&self, points: &[Point3<f64>], tolerance_m: f64) -> bool {
        let turn = self.plane.plane_from_cloud();
        let (rest, on): (Vec<Point3<f64>>, Vec<Point3<f64>>) = points
            .iter()
            .map(|p| turn * p)
            .filter(|p| p.z > -2.0 * tolerance_m && self.is_over(p))
            .partition(|p| p.z > 2.0 * tolerance_m);
        let spread = |points: &[Point3<f64>], axis: usize| {
            let value = |share: f64| quantile(points.iter().map(|p| p[axis]).collect(), share);
            value(0.95) - value(0.05)
        };
        (0..2).all(|axis| spread(&rest, axis) < spread(&on, axis))
    }
}

fn within([low, high]: &[[f64; 2]; 2], point: &Point3<f64>) -> bool {
    (0..2).all(|axis| (low[axis]..=high[axis]).contains(&point[axis]))
}

/// Looks for the table: the plane with the most points within `tolerance_m` (RANSAC, then least squares), of the largest
/// few, that is a table at all.
///
/// A side of a box, too, is a plane with many points. On a table something stands, on the side that the sensor saw,
/// and nothing is seen below it. Only what lies within the plane's outline counts: a room goes on beside the table.
#[must_use]
pub fn find_table(cloud: &PointCloud, tolerance_m: f64, seed: u64) -> Option<TableTop> {
    let points = &cloud.points;
    if points.len() < 3 {
        return None;
    }
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    // A wall or a floor may have more points than the table: what lies in a plane that is none is left out.
    let mut rest = points.clone();
    let extent_m = bounding_box(points).map_or(0.0, |(low, high)| (high - low).amax());
    for round in 0..PLANES {
        let plane = largest_plane(&rest, tolerance_m, &mut rng)?;
        let table = as_table(&plane, cloud, tolerance_m);
        // A scan of one thing has smaller planes, too, but no table that is wider than what is on it.
        if let Some(table) = table
            && (round == 0 || table.is_wider_than_rest(points, tolerance_m))
        {
            return Some(table);
        }
        if extent_m < LEAST_ROOM_M {
            return None;
        }
        rest.retain(|p| plane.height(p).abs() > 2.0 * tolerance_m);
        if (rest.len() as f64) < LEAST_SHARE * points.len() as f64 {
            return None;
        }
    }
    None
}

/// The plane with the most points.
fn largest_plane(points: &[Point3<f64>], tolerance_m: f64, rng: &mut ChaCha8Rng) -> Option<Plane> {
    if points.len() < 3 {
        return None;
    }
    let mut pick = || points[rng.random_range(0..points.len())];
    let sample: Vec<Point3<f64>> =
        if points.len() <= SCORED { points.to_vec() } else { (0..SCORED).map(|_| pick()).collect() };
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
    Some(plane)
}

/// The plane as a table, if it is one from either side.
fn as_table(plane: &Plane, cloud: &PointCloud, tolerance_m: f64) -> Option<TableTop> {
    let points = &cloud.points;
    let flipped = Plane { normal: -plane.normal, offset_m: -plane.offset_m };
    match &cloud.views {
        Some(views) => {
            let seen_from_front = views.iter().map(|view| view.dot(&plane.normal)).sum::<f64>() > 0.0;
            table_top(if seen_from_front { plane } else { &flipped }, points, tolerance_m)
        }
        // Either side may be the front. A box seen from within is then told from a table by what stands there:
        // it reaches from rim to rim.
        None => [*plane, flipped].iter().find_map(|side| {
            table_top(side, points, tolerance_m).filter(|top| top.is_wider_than_rest(points, tolerance_m))
        }),
    }
}

fn refit<'a>(points: impl Iterator<Item = &'a Point3<f64>> + Clone) -> Option<Plane> {
    let count = points.clone().count() as f64;
    let mean = points.clone().map(|p| p.coords).sum::<Vector3<f64>>() / count;
    let covariance: Matrix3<f64> = points.map(|p| (p.coords - mean) * (p.coords - mean).transpose()).sum();
    let eigen = SymmetricEigen::new(covariance);
    let normal = Unit::try_new(eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned(), 1e-12)?;
    Some(Plane { normal, offset_m: normal.dot(&mean) })
}

/// The table on this side of the plane, if it is one.
fn table_top(plane: &Plane, points: &[Point3<f64>], tolerance_m: f64) -> Option<TableTop> {
    let turn = plane.plane_from_cloud();
    let points: Vec<Point3<f64>> = points.iter().map(|p| turn * p).collect();
    let on: Vec<&Point3<f64>> = points.iter().filter(|p| p.z.abs() <= 2.0 * tolerance_m).collect();
    if (on.len() as f64) < LEAST_SHARE * points.len() as f64 {
        return None;
    }
    let side = |axis: usize, share: f64| quantile(on.iter().map(|p| p[axis]).collect(), share);
    let [low, high] = [0.02, 0.98].map(|share| [0, 1].map(|axis| side(axis, share)));
    let rim = [0, 1].map(|axis| RIM * (high[axis] - low[axis]));
    let core = [[low[0] + rim[0], low[1] + rim[1]], [high[0] - rim[0], high[1] - rim[1]]];
    let inside = || points.iter().filter(|p| within(&core, p));
    let above = inside().filter(|p| p.z > 2.0 * tolerance_m).count();
    let below = inside().filter(|p| p.z < -2.0 * tolerance_m).count();
    let is_table = above >= FEWEST_ABOVE && below as f64 <= MOST_BELOW * on.len() as f64;
    if !is_table {
        return None;
    }
    let top = TableTop { plane: *plane, outline: Some(outline(&on)), scatter_m: 0.0 };
    let deepest = -DEEPEST * tolerance_m;
    let under = points.iter().filter(|p| (deepest..0.0).contains(&p.z) && top.is_over(p)).map(|p| -p.z);
    let scatter_m = quantile(under.collect(), COVERED);
    Some(TableTop { scatter_m, ..top })
}

/// The convex polygon about those of the points that lie in large patches, widened a little.
fn outline(points: &[&Point3<f64>]) -> Vec<[f64; 2]> {
    let flat = |p: &&&Point3<f64>| Point3::new(p.x, p.y, 0.0);
    let flat: Vec<Point3<f64>> = points.iter().map(|p| flat(&p)).collect();
    let size = bounding_box(&flat).map_or_else(Vector3::zeros, |(low, high)| high - low);
    let spacing_m = (size.x * size.y / flat.len().max(1) as f64).sqrt();
    let cell_m = (size.amax() / CELLS).max(3.0 * spacing_m).max(f64::MIN_POSITIVE);
    let patches = clusters(&flat, cell_m);
    let largest = patches.iter().map(Vec::len).max().unwrap_or(0) as f64;
    let table = patches.iter().filter(|patch| patch.len() as f64 >= LEAST_PATCH * largest).flatten();
    let corners = convex_hull(table.map(|&i| [flat[i as usize].x, flat[i as usize].y]).collect());
    let count = corners.len().max(1) as f64;
    let middle = [0, 1].map(|axis| corners.iter().map(|corner| corner[axis] / count).sum::<f64>());
    let widened =
        |corner: &[f64; 2]| [0, 1].map(|axis| middle[axis] + WIDENED * (corner[axis] - middle[axis]));
    corners.iter().map(widened).collect()
}

/// Corners of the convex hull, counter-clockwise (Andrew 1979).
fn convex_hull(mut points: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    points.dedup();
    let mut hull: Vec<[f64; 2]> = Vec::new();
    for pass in 0..2 {
        let start = hull.len();
        let mut add = |point: &[f64; 2]| {
            while hull.len() >= start + 2 {
                let (a, b) = (hull[hull.len() - 2], hull[hull.len() - 1]);
                if (b[0] - a[0]) * (point[1] - a[1]) > (b[1] - a[1]) * (point[0] - a[0]) {
                    break;
                }
                hull.pop();
            }
            hull.push(*point);
        };
        if pass == 0 {
            points.iter().for_each(&mut add)
        } else {
            points.iter().rev().for_each(&mut add)
        }
        hull.pop();
    }
    hull
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
        let top = find_table(&scene(&turn), 0.001, 1).unwrap();
        let plane = top.plane;
        assert!(top.carries(&(turn * Point3::new(0.1, 0.1, 0.05)), 0.01));
        assert!(!top.carries(&(turn * Point3::new(0.1, 0.3, 0.05)), 0.01));
        assert!(plane.normal.dot(&(turn.rotation * Vector3::z())) > 0.9999);
        assert!(plane.height(&(turn * Point3::new(0.1, 0.1, 0.05))) > 0.049);
        let mapped = plane.plane_from_cloud() * (turn * Point3::new(0.1, 0.1, 0.05));
        assert!((mapped.z - 0.05).abs() < 3e-4);
    }

    #[test]
    fn the_table_ends_where_it_ends_and_says_how_noisy_it_is() {
        let mut cloud = scene(&Isometry3::identity());
        // A wall behind a gap, which crosses the table's plane.
        for i in 0..20 {
            for k in 0..20 {
                let (x, z) = (f64::from(i) * 0.005, f64::from(k - 10) * 0.005);
                cloud.points.push(Point3::new(x, 0.30, z));
            }
        }
        for i in 8..32 {
            cloud.points.push(Point3::new(0.005 * f64::from(i), 0.05, -0.003));
        }
        let top = find_table(&cloud, 0.001, 1).unwrap();
        assert!(!top.carries(&Point3::new(0.05, 0.30, 0.04), 0.01));
        assert!(top.carries(&Point3::new(0.19, 0.01, 0.04), 0.01));
        assert!((top.scatter_m - 0.003).abs() < 5e-4, "{}", top.scatter_m);
    }

    #[test]
    fn hulls_are_convex_and_counter_clockwise() {
        let grid = (0..25).map(|i| [f64::from(i % 5), f64::from(i / 5)]).collect();
        assert_eq!(convex_hull(grid), [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]]);
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
