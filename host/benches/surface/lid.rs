//! The lid that clouds are sampled from: a solid of revolution whose surface is known exactly.

use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

use host::surface::PointCloud;
use nalgebra::{Point2, Point3, Unit, Vector2, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Radius of the lid, mm.
const RADIUS_MM: f64 = 40.0;
/// Steps of a curved part of the profile.
const STEPS: usize = 400;

/// A solid of revolution about z: 80 mm wide and 45 mm high, with a mushroom knob on an undercut neck.
pub(super) struct Lid {
    /// Profile (radius, height) in mm, from the top of the axis around to its bottom; the body is on the right.
    profile: Vec<Point2<f64>>,
    /// Area of the surface up to each point of the profile, mm^2.
    areas: Vec<f64>,
}

/// The nearest point of the true surface.
pub(super) struct Nearest {
    pub(super) distance_mm: f64,
    pub(super) outward: Vector3<f64>,
}

impl Lid {
    /// The lid filled up.
    pub(super) fn solid() -> Self {
        let mut profile = outside();
        profile.push(Point2::new(0.0, 4.0));
        Self::of(profile)
    }

    /// The lid itself: a wall of about 4 mm, and a flange below that fits into the cup.
    pub(super) fn thin() -> Self {
        let mut profile = outside();
        profile.extend([[36.0, 4.0], [36.0, 0.0], [33.0, 0.0], [33.0, 4.0]].map(Point2::from));
        profile.extend(bezier([33.0, 4.0], [24.0, 19.0], [0.0, 20.0]));
        Self::of(profile)
    }

    fn of(profile: Vec<Point2<f64>>) -> Self {
        let mut areas = vec![0.0];
        for pair in profile.windows(2) {
            let area = PI * (pair[0].x + pair[1].x) * (pair[1] - pair[0]).norm();
            areas.push(areas.last().copied().unwrap_or(0.0) + area);
        }
        Self { profile, areas }
    }

    /// Point and outward normal at a share of the area and a share of the turn, mm.
    fn at(&self, area: f64, turn: f64) -> (Point3<f64>, Vector3<f64>) {
        let total = self.areas[self.areas.len() - 1];
        let i = self.areas.partition_point(|&a| a <= area * total).clamp(1, self.areas.len() - 1);
        let [a, b] = [self.profile[i - 1], self.profile[i]];
        let share = (area * total - self.areas[i - 1]) / (self.areas[i] - self.areas[i - 1]);
        // The area of a cone up to a share of its slant is quadratic in that share.
        let (r, dr) = (a.x, b.x - a.x);
        let goal = share * (2.0 * r + dr);
        let t = if dr.abs() < 1e-9 { share } else { ((r * r + dr * goal).max(0.0).sqrt() - r) / dr };
        let (at, outward) = (a + (b - a) * t, normal(a, b));
        let (sin, cos) = (TAU * turn).sin_cos();
        let turned = |p: Vector2<f64>| Vector3::new(p.x * cos, p.x * sin, p.y);
        (Point3::from(turned(at.coords)), turned(outward))
    }

    /// Points all over the surface, spread evenly, without noise, mm.
    pub(super) fn samples(&self, n: usize) -> impl Iterator<Item = (Point3<f64>, Vector3<f64>)> {
        // The additive recurrence of the plastic number fills a square most evenly.
        const PLASTIC: f64 = 1.324_717_957_244_746;
        (0..n).map(|i| {
            let place = |step: f64| (0.5 + i as f64 * step).fract();
            self.at(place(1.0 / PLASTIC), place(1.0 / (PLASTIC * PLASTIC)))
        })
    }

    /// Where rays from above first meet the surface, mm; the rays lie in stripes half as far again apart as in a stripe.
    pub(super) fn from_above(n: usize) -> Vec<Point3<f64>> {
        let outside = Self::of(outside());
        let pitch = (PI * RADIUS_MM * RADIUS_MM / (1.5 * n as f64)).sqrt();
        let mut seen = Vec::with_capacity(n + n / 8);
        let half = |step: f64| (RADIUS_MM / step) as i64;
        for i in -half(1.5 * pitch)..=half(1.5 * pitch) {
            for k in -half(pitch)..=half(pitch) {
                let (x, y) = (1.5 * pitch * i as f64, pitch * k as f64);
                if let Some(z) = outside.height(x.hypot(y)) {
                    seen.push(Point3::new(x, y, z));
                }
            }
        }
        seen
    }

    /// Greatest height at a distance from the axis.
    fn height(&self, radius: f64) -> Option<f64> {
        let crossed = self.profile.windows(2).filter_map(|pair| {
            let [a, b] = [pair[0], pair[1]];
            let share = (radius - a.x) / (b.x - a.x);
            (share.is_finite() && (0.0..=1.0).contains(&share)).then(|| a.y + share * (b.y - a.y))
        });
        crossed.fold(None, |most, z| Some(most.map_or(z, |most: f64| most.max(z))))
    }

    /// The nearest point of the surface to one given in mm.
    pub(super) fn nearest(&self, point: &Point3<f64>) -> Nearest {
        let radius = point.x.hypot(point.y);
        let at = Point2::new(radius, point.z);
        let mut best = (f64::INFINITY, Vector2::x());
        for pair in self.profile.windows(2) {
            let [a, b] = [pair[0], pair[1]];
            let way = b - a;
            let foot = a + way * ((at - a).dot(&way) / way.norm_squared()).clamp(0.0, 1.0);
            let distance = (at - foot).norm_squared();
            if distance < best.0 {
                best = (distance, normal(a, b));
            }
        }
        let radial = if radius > 0.0 { Vector3::new(point.x, point.y, 0.0) / radius } else { Vector3::x() };
        Nearest { distance_mm: best.0.sqrt(), outward: radial * best.1.x + Vector3::z() * best.1.y }
    }
}

fn outside() -> Vec<Point2<f64>> {
    // A ball of 9 mm on a neck of 5 mm, which it overhangs.
    let (center, ball, neck) = (36.0, 9.0, 5.0_f64);
    let last = PI - (neck / ball).asin();
    let mut profile: Vec<Point2<f64>> = (0..=STEPS)
        .map(|i| last * i as f64 / STEPS as f64)
        .map(|angle| Point2::new(ball * angle.sin(), center + ball * angle.cos()))
        .collect();
    profile.push(Point2::new(neck, 24.0));
    profile.extend(bezier([neck, 24.0], [22.0, 24.0], [RADIUS_MM, 7.0]));
    profile.push(Point2::new(RADIUS_MM, 4.0));
    profile
}

/// A quadratic Bezier curve without its first point.
fn bezier(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> impl Iterator<Item = Point2<f64>> {
    let [a, b, c] = [a, b, c].map(Vector2::from);
    (1..=STEPS).map(move |i| {
        let t = i as f64 / STEPS as f64;
        Point2::from(a * (1.0 - t).powi(2) + b * (2.0 * t * (1.0 - t)) + c * (t * t))
    })
}

fn normal(a: Point2<f64>, b: Point2<f64>) -> Vector2<f64> {
    let way = (b - a).normalize();
    Vector2::new(-way.y, way.x)
}

/// A cloud in metres, with Gaussian noise in all three directions.
pub(super) fn noisy(points: &[Point3<f64>], sigma_mm: f64, seed: u64) -> PointCloud {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut noise = move || {
        let drawn: f64 = StandardNormal.sample(&mut rng);
        sigma_mm * drawn
    };
    let moved = |p: &Point3<f64>| (p + Vector3::from_fn(|_, _| noise())) * 1e-3;
    PointCloud { points: points.iter().map(moved).collect(), ..PointCloud::default() }
}

/// Elevations of the directions in which sensors stand about the axis, degrees, outside and across the axis.
const ELEVATIONS_DEG: [f64; 7] = [90.0, 60.0, 30.0, 0.0, -30.0, -60.0, -90.0];

impl Lid {
    /// Lines of sight of points of the surface: each to the sensor that it faces most, of those that see it. Sensors stand
    /// far away in the plane of the point and the axis; of what none sees, in its normal's direction.
    pub(super) fn lines_of_sight(&self, samples: &[(Point3<f64>, Vector3<f64>)]) -> Vec<Unit<Vector3<f64>>> {
        // What is seen depends on the place on the profile alone.
        let mut seen: HashMap<[i64; 4], Vector2<f64>> = HashMap::new();
        let looked = |(point, outward): &(Point3<f64>, Vector3<f64>)| {
            let radial = Vector3::new(point.x, point.y, 0.0).normalize();
            let (at, normal) = (
                Point2::new(point.xy().coords.norm(), point.z),
                Vector2::new(outward.dot(&radial), outward.z),
            );
            let key = [at.x * 5.0, at.y * 5.0, normal.x * 50.0, normal.y * 50.0].map(|c| c.round() as i64);
            let way = *seen.entry(key).or_insert_with(|| {
                let ways = ELEVATIONS_DEG.iter().flat_map(|deg| {
                    let (up, aside) = deg.to_radians().sin_cos();
                    [Vector2::new(aside, up), Vector2::new(-aside, up)]
                });
                ways.filter(|way| way.dot(&normal) > 0.1 && self.is_free(&(at + normal * 0.05), way))
                    .max_by(|a, b| a.dot(&normal).total_cmp(&b.dot(&normal)))
                    .unwrap_or(normal)
            });
            Unit::new_normalize(radial * way.x + Vector3::z() * way.y)
        };
        samples.iter().map(looked).collect()
    }

    /// Whether a ray in the plane of the axis meets the body nowhere.
    fn is_free(&self, from: &Point2<f64>, way: &Vector2<f64>) -> bool {
        self.profile.windows(2).all(|pair| {
            // The body on both sides of the axis.
            [1.0, -1.0].into_iter().all(|side| {
                let [a, b] = [pair[0], pair[1]].map(|p| Vector2::new(side * p.x, p.y) - from.coords);
                let along = b - a;
                let det = along.x * way.y - along.y * way.x;
                if det.abs() < 1e-12 {
                    return true;
                }
                let on_segment = (a.y * way.x - a.x * way.y) / det;
                let on_ray = (along.x * a.y - along.y * a.x) / det;
                !((0.0..=1.0).contains(&on_segment) && on_ray > 0.0)
            })
        })
    }
}
