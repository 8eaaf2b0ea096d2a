//! What the seen side of an object tells about the side that nobody saw.
//!
//! Most things that are put on tables are symmetric: about an upright axis, about upright planes, or, balls and lying
//! cylinders, about a level plane. Each such symmetry is a guess, and the scan holds evidence for and against it: the
//! image of a seen spot is confirmed where the scan saw such a spot, contradicted where it saw empty space, and
//! neither where it saw nothing (Thrun and Wegbreit 2005; Bohg et al. 2011). A symmetry that the scan does not
//! contradict, and confirms in good part, is carried over to what was not seen, lines of sight included.
//!
//! All in a frame in which the table is z = 0.

use std::f64::consts::{PI, TAU};

use nalgebra::{Matrix2, Point2, Point3, Rotation3, Unit, Vector2, Vector3};
use rayon::prelude::*;

use super::{
    carve::{Carved, Sight},
    cloud::bounding_box,
    grid::Grid,
    outlier::quantile,
    tangent::Tangent,
};

/// Samples that bear evidence.
const WITNESSES: usize = 500;
/// Widest gap between the directions of side faces of an object that was seen from all round: a box has 90 degrees.
const WIDEST_GAP_RAD: f64 = 1.9;
/// A face is a side when its normal leans from the vertical by more than this cosine.
const SIDE: f64 = 0.8;
/// Share of samples that face down, from which on a level plane of symmetry is looked for.
const OVERHANG_SHARE: f64 = 0.01;
const OVERHANGING: f64 = -0.1;
/// Least cosine between the image of a spot's normal and the normal found there.
const SAME_NORMAL: f64 = 0.7;
/// How near, in spacings, a seen spot must be to the image that it confirms.
const NEAR: f64 = 1.6;
/// How far under an image, in spacings, the lines of sight that contradict it go on.
const DEEP: f64 = 0.8;
/// The same of the table.
const BELOW_TABLE: f64 = 1.6;
/// Most images contradicted, and fewest confirmed and gained, as shares.
const MOST_CONTRADICTED: f64 = 0.04;
const FEWEST_CONFIRMED: f64 = 0.15;
const FEWEST_GAINED: f64 = 0.03;
/// Weight of a contradiction against a gain.
const CONTRADICTION: f64 = 8.0;
/// Share of a spot's images about an axis that may be contradicted before it is taken for a handle.
const HANDLE: f64 = 0.25;
/// Fewest spots that are no handle.
const FEWEST_ROUND: f64 = 0.85;
/// Directions of upright planes, and their places across the object, that are tried first.
const DIRECTIONS: usize = 36;
const PLACES: usize = 24;
/// Rounds in which the best of them is refined, with half the step each.
const REFINEMENTS: usize = 9;
/// Directions that are refined.
const REFINED: usize = 12;
/// How much deeper they go on at first, so that planes nearby are told from others.
const COARSE: f64 = 5.0;
/// Rounds in which a plane of symmetry is fitted to what confirms it, and what its old place weighs against that.
const FITS: usize = 6;
const FIT_PRIOR: f64 = 0.02;
/// Copies of the lines of sight about an axis of revolution.
const TURNS: usize = 36;
/// Most lines of sight that are copied about an axis.
const TURNED_SIGHTS: usize = 6000;
/// Cell of the box in which empty space is remembered, in spacings.
const FINE: f64 = 0.7;

/// What symmetry adds to a scan.
#[derive(Debug, Clone, Default)]
pub(super) struct Guess {
    /// Tangent planes of what was not seen.
    pub(super) planes: Vec<Tangent>,
    /// Lines of sight that another side would have had.
    pub(super) sights: Vec<Sight>,
}

/// A symmetry of the object.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Symmetry {
    /// About the upright axis through this point.
    Revolution(Point2<f64>),
    /// The plane `normal . p = offset`.
    Mirror { normal: Vector3<f64>, offset_m: f64 },
}

/// How the scan receives the images of its witnesses, as shares of them.
#[derive(Debug, Clone, Copy, Default)]
struct Evidence {
    confirmed: f64,
    contradicted: f64,
    gained: f64,
}

impl Evidence {
    /// Gains without what confirms them count for little: anything may stand where nobody has looked.
    fn score(&self) -> f64 {
        self.gained * (self.confirmed / FEWEST_CONFIRMED).min(1.0) + 0.5 * self.confirmed
            - CONTRADICTION * self.contradicted
    }

    fn convinces(&self) -> bool {
        self.contradicted <= MOST_CONTRADICTED
            && self.confirmed >= FEWEST_CONFIRMED
            && self.gained >= FEWEST_GAINED
    }
}

/// What an image meets.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Meets {
    Surface,
    Empty,
    Unseen,
}

/// Looks for symmetries in what was seen of an object, and says what follows for what was not.
///
/// An object that was seen from all round and hides nothing below an overhang has nothing to gain.
pub(super) fn guess(planes: &[Tangent], sights: &[Sight], spacing_m: f64) -> Guess {
    let is_one_sided = widest_gap_rad(planes) > WIDEST_GAP_RAD;
    let overhang = planes.iter().filter(|plane| plane.normal.z < OVERHANGING).count() as f64;
    let hangs_over = overhang > OVERHANG_SHARE * planes.len() as f64;
    if sights.is_empty() {
        return Guess::default();
    }
    let Some(mut scan) = Scan::new(planes.to_vec(), sights.to_vec(), spacing_m) else {
        return Guess::default();
    };
    if let Some(axis) = scan.revolution() {
        scan.complete(axis);
    } else if is_one_sided {
        for _ in 0..2 {
            let Some(mirror) = scan.upright_mirror() else { break };
            scan.complete(mirror);
        }
    }
    if hangs_over && let Some(level) = scan.level_mirror() {
        scan.complete(level);
    }
    Guess { planes: scan.planes.split_off(planes.len()), sights: scan.sights.split_off(sights.len()) }
}

/// The widest gap between the directions that the sides face, seen from above.
fn widest_gap_rad(planes: &[Tangent]) -> f64 {
    const SECTORS: usize = 72;
    let mut counts = [0_usize; SECTORS];
    for plane in planes.iter().filter(|plane| plane.normal.z.abs() < SIDE) {
        let share = (plane.normal.y.atan2(plane.normal.x) + PI) / TAU;
        counts[((share * SECTORS as f64) as usize).min(SECTORS - 1)] += 1;
    }
    let fewest = counts.iter().sum::<usize>() / (20 * SECTORS);
    let faced: Vec<usize> = (0..SECTORS).filter(|&s| counts[s] > fewest).collect();
    let gaps = (0..faced.len()).map(|i| match faced.get(i + 1) {
        Some(next) => next - faced[i],
        None => faced[0] + SECTORS - faced[i],
    });
    gaps.max().unwrap_or(SECTORS) as f64 / SECTORS as f64 * TAU
}

/// What was seen, and guessed so far.
struct Scan {
    planes: Vec<Tangent>,
    sights: Vec<Sight>,
    grid: Grid,
    carved: Carved,
    spacing_m: f64,
}

impl Scan {
    fn new(planes: Vec<Tangent>, sights: Vec<Sight>, spacing_m: f64) -> Option<Self> {
        let origins: Vec<Point3<f64>> = planes.iter().map(|plane| plane.origin).collect();
        let (low, high) = bounding_box(&origins)?;
        // What is guessed may reach as far again as what was seen.
        let reach = Vector3::new(0.6, 0.6, 0.0) * (high - low).xy().amax() + Vector3::repeat(4.0 * spacing_m);
        let (low, high) = (low - reach, high + reach);
        let low = Point3::new(low.x, low.y, low.z.min(-2.0 * spacing_m));
        let carved = Carved::about(&low, &high, FINE * spacing_m, &sights)?;
        let grid = Grid::new(&origins, 1.5 * spacing_m);
        Some(Self { planes, sights, grid, carved, spacing_m })
    }

    /// What the image of a seen spot meets. It meets empty space when lines of sight pass through it, down to `deep`
    /// spacings under it: they would have ended at a surface. Past a wall that was seen from its other side none goes.
    fn meets(&self, image: &Tangent, deep: f64, found: &mut Vec<(f64, u32)>) -> Meets {
        self.grid.within(&image.origin, NEAR * self.spacing_m, found);
        let nearest = found.first().map(|n| self.planes[n.1 as usize]);
        let is_same = |other: &Tangent| other.normal.dot(&image.normal) > SAME_NORMAL;
        if nearest.as_ref().is_some_and(is_same) {
            return Meets::Surface;
        }
        let beside = |spacings: f64| image.origin + image.normal.into_inner() * (spacings * self.spacing_m);
        let is_passed = self.carved.is_empty(&beside(0.0)) && self.carved.is_empty(&beside(-deep));
        if is_passed || image.origin.z < -BELOW_TABLE * self.spacing_m {
            return Meets::Empty;
        }
        Meets::Unseen
    }

    fn witnesses(&self) -> impl Iterator<Item = &Tangent> {
        self.planes.iter().step_by((self.planes.len() / WITNESSES).max(1))
    }

    fn evidence(&self, mirror: &Symmetry, deep: f64) -> Evidence {
        let Symmetry::Mirror { normal, offset_m } = *mirror else { return Evidence::default() };
        let (mut evidence, mut count, mut found) = (Evidence::default(), 0.0, Vec::new());
        for plane in self.witnesses() {
            count += 1.0;
            match self.meets(&mirrored(plane, &normal, offset_m), deep, &mut found) {
                Meets::Surface => evidence.confirmed += 1.0,
                Meets::Empty => evidence.contradicted += 1.0,
                Meets::Unseen => evidence.gained += 1.0,
            }
        }
        let Evidence { confirmed, contradicted, gained } = evidence;
        Evidence { confirmed: confirmed / count, contradicted: contradicted / count, gained: gained / count }
    }

    /// The upright axis that all normals point at, if the object is round about it.
    fn revolution(&self) -> Option<Symmetry> {
        let center = self.common_axis()?;
        let (mut evidence, mut round, mut count, mut found) = (Evidence::default(), 0.0, 0.0, Vec::new());
        for plane in self.witnesses() {
            count += 1.0;
            let (mut empty, mut surface) = (0.0, 0.0);
            let turns = 11;
            for turn in 1..=turns {
                match self.meets(
                    &turned(plane, &center, TAU * f64::from(turn) / f64::from(turns + 1)),
                    DEEP,
                    &mut found,
                ) {
                    Meets::Empty => empty += 1.0 / f64::from(turns),
                    Meets::Surface => surface += 1.0 / f64::from(turns),
                    Meets::Unseen => {}
                }
            }
            if empty <= HANDLE {
                round += 1.0;
                evidence.contradicted += empty;
                evidence.confirmed += surface;
                evidence.gained += 1.0 - empty - surface;
            }
        }
        let Evidence { confirmed, contradicted, gained } = evidence;
        let evidence = Evidence {
            confirmed: confirmed / round,
            contradicted: contradicted / round,
            gained: gained / round,
        };
        (round >= FEWEST_ROUND * count && evidence.convinces()).then_some(Symmetry::Revolution(center))
    }

    /// Where the horizontal parts of the sides' normals cross, by reweighted least squares.
    fn common_axis(&self) -> Option<Point2<f64>> {
        let sides: Vec<(Point2<f64>, Vector2<f64>)> = self
            .planes
            .iter()
            .filter(|plane| plane.normal.z.abs() < 0.95)
            .map(|plane| (plane.origin.xy(), plane.normal.xy()))
            .collect();
        let mut center: Option<Point2<f64>> = None;
        for _ in 0..10 {
            let (mut form, mut pull) = (Matrix2::zeros(), Vector2::zeros());
            for (point, normal) in &sides {
                let across = Vector2::new(-normal.y, normal.x);
                let offset = across.dot(&point.coords);
                let miss = center.map_or(0.0, |c: Point2<f64>| across.dot(&c.coords) - offset);
                let weight = 1.0 / (1.0 + (miss / self.spacing_m).powi(2));
                form += across * across.transpose() * weight;
                pull += across * (weight * offset);
            }
            // Sides that all face one way, as those of one box, have no crossing.
            let eigen = form.symmetric_eigenvalues();
            if eigen.min() < 0.02 * eigen.max() {
                return None;
            }
            center = form.try_inverse().map(|inverse| Point2::from(inverse * pull));
        }
        center
    }

    /// The upright plane of symmetry that gains most.
    fn upright_mirror(&self) -> Option<Symmetry> {
        let origins: Vec<Point3<f64>> = self.planes.iter().map(|plane| plane.origin).collect();
        let across = |azimuth: f64| Vector3::new(azimuth.cos(), azimuth.sin(), 0.0);
        let try_at = |azimuth: f64, offset_m: f64, deep: f64| {
            let mirror = Symmetry::Mirror { normal: across(azimuth), offset_m };
            (self.evidence(&mirror, deep).score(), azimuth, offset_m)
        };
        let better = |a: (f64, f64, f64), b: (f64, f64, f64)| if b.0 > a.0 { b } else { a };
        let coarse: Vec<(f64, f64, f64)> = (0..DIRECTIONS)
            .into_par_iter()
            .map(|i| {
                let azimuth = PI * i as f64 / DIRECTIONS as f64;
                let normal = across(azimuth);
                let places = origins.iter().map(|p| normal.dot(&p.coords));
                let (low, high) =
                    places.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
                (1..PLACES)
                    .map(|k| try_at(azimuth, low + (high - low) * k as f64 / PLACES as f64, COARSE * DEEP))
                    .fold((f64::NEG_INFINITY, 0.0, 0.0), better)
            })
            .collect();
        let mut ranked = coarse;
        ranked.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.total_cmp(&b.1)));
        let (low, high) = bounding_box(&origins)?;
        let step_m = (high - low).xy().norm() / PLACES as f64;
        ranked.truncate(REFINED);
        let refined: Vec<(f64, f64, f64)> = ranked
            .into_par_iter()
            .map(|start| {
                let (mut best, mut turn, mut shift_m) = (start, 0.5 * PI / DIRECTIONS as f64, 0.5 * step_m);
                for round in 0..REFINEMENTS {
                    let deep = DEEP * COARSE.powf(1.0 - (round as f64 + 1.0) / REFINEMENTS as f64);
                    let (_, azimuth, offset_m) = best;
                    best = (f64::NEG_INFINITY, 0.0, 0.0);
                    for (i, k) in (0..9).map(|n| (f64::from(n % 3 - 1), f64::from(n / 3 - 1))) {
                        best = better(best, try_at(azimuth + i * turn, offset_m + k * shift_m, deep));
                    }
                    (turn, shift_m) = (0.6 * turn, 0.6 * shift_m);
                }
                best
            })
            .collect();
        let mirrors = refined.into_iter().filter_map(|(_, azimuth, offset_m)| {
            let (azimuth, offset_m) = self.fitted(azimuth, offset_m);
            let mirror = Symmetry::Mirror { normal: across(azimuth), offset_m };
            let evidence = self.evidence(&mirror, DEEP);
            evidence.convinces().then_some((evidence.score(), mirror))
        });
        mirrors.reduce(|a, b| if b.0 > a.0 { b } else { a }).map(|(_, mirror)| mirror)
    }

    /// The upright plane moved so that images and the seen spots that confirm them fall together (least squares, from image
    /// to the spot's plane). Where they say nothing, as those of a flat top do, it stays.
    fn fitted(&self, mut azimuth: f64, mut offset_m: f64) -> (f64, f64) {
        let middle = self.planes.iter().map(|plane| plane.origin.xy().coords).sum::<Vector2<f64>>()
            / self.planes.len() as f64;
        let reaches = self.witnesses().map(|plane| (plane.origin.xy().coords - middle).norm());
        let reach_m = reaches.fold(self.spacing_m, f64::max);
        let mut found = Vec::new();
        for _ in 0..FITS {
            let normal = Vector3::new(azimuth.cos(), azimuth.sin(), 0.0);
            let along = Vector3::new(-normal.y, normal.x, 0.0);
            // Of two unknowns: the turn about the middle, times the object's radius, and the shift.
            let (mut form, mut pull) = (Matrix2::zeros(), Vector2::zeros());
            let mut count = 0.0;
            for plane in self.witnesses() {
                let image = mirrored(plane, &normal, offset_m);
                self.grid.nearest(&image.origin, 1, &mut found);
                let Some(spot) = found.first().filter(|n| n.0 < (NEAR * self.spacing_m).powi(2)) else {
                    continue;
                };
                let spot = self.planes[spot.1 as usize];
                if spot.normal.dot(&image.normal) < SAME_NORMAL {
                    continue;
                }
                let arm = Vector3::new(plane.origin.x - middle.x, plane.origin.y - middle.y, 0.0);
                let lever = middle.x * normal.x + middle.y * normal.y - offset_m;
                let turn = (along * (normal.dot(&arm) + lever) + normal * along.dot(&arm)) * -2.0;
                let row = Vector2::new(spot.normal.dot(&turn) / reach_m, 2.0 * spot.normal.dot(&normal));
                let miss_m = spot.normal.dot(&(image.origin - spot.origin));
                form += row * row.transpose();
                pull -= row * miss_m;
                count += 1.0;
            }
            // As if some of the spots had been found where they are expected.
            form += Matrix2::identity() * (FIT_PRIOR * f64::max(count, 1.0));
            let Some(step) = form.try_inverse().map(|inverse| inverse * pull) else { break };
            let step = step.map(|s| s.clamp(-self.spacing_m, self.spacing_m));
            let turn = step.x / reach_m;
            // The plane turns about its place abreast of the middle.
            let place = Vector2::new(normal.x, normal.y).dot(&middle) - offset_m;
            azimuth += turn;
            offset_m = azimuth.cos() * middle.x + azimuth.sin() * middle.y - place + step.y;
        }
        (azimuth, offset_m)
    }

    /// The level plane half way up: what lies on the table has its lowest point on it.
    fn level_mirror(&self) -> Option<Symmetry> {
        let top_m = quantile(self.planes.iter().map(|plane| plane.origin.z).collect(), 0.998);
        let mirror = Symmetry::Mirror { normal: Vector3::z(), offset_m: 0.5 * top_m };
        self.evidence(&mirror, DEEP).convinces().then_some(mirror)
    }

    /// Adds the images that meet nothing, and the images of the lines of sight.
    fn complete(&mut self, symmetry: Symmetry) {
        let images: Vec<Tangent> = match symmetry {
            Symmetry::Mirror { normal, offset_m } => {
                self.planes.iter().map(|plane| mirrored(plane, &normal, offset_m)).collect()
            }
            Symmetry::Revolution(center) => self.revolved(&center),
        };
        let new: Vec<Tangent> = images
            .into_par_iter()
            .map_init(Vec::new, |found, image| {
                self.grid.within(&image.origin, 1.2 * self.spacing_m, found);
                (found.is_empty() && image.origin.z > 0.0 && self.meets(&image, DEEP, found) == Meets::Unseen)
                    .then_some(image)
            })
            .flatten_iter()
            .collect();
        let copies: Vec<Sight> = match symmetry {
            Symmetry::Mirror { normal, offset_m } => {
                self.sights.iter().map(|sight| mirrored_sight(sight, &normal, offset_m)).collect()
            }
            Symmetry::Revolution(center) => {
                let step = (self.sights.len() / TURNED_SIGHTS).max(1);
                let some: Vec<&Sight> = self.sights.iter().step_by(step).collect();
                (1..TURNS)
                    .flat_map(|turn| {
                        let angle = TAU * turn as f64 / TURNS as f64;
                        some.iter().map(move |sight| turned_sight(sight, &center, angle)).collect::<Vec<_>>()
                    })
                    .collect()
            }
        };
        // Images of the table's lines of sight end on the table; those of the object's would have ended on it as well.
        self.sights.extend(copies);
        self.planes.extend(new);
        let origins: Vec<Point3<f64>> = self.planes.iter().map(|plane| plane.origin).collect();
        self.grid = Grid::new(&origins, 1.5 * self.spacing_m);
    }

    /// The mean profile of what is round about the axis, turned about it.
    fn revolved(&self, center: &Point2<f64>) -> Vec<Tangent> {
        let cell_m = self.spacing_m;
        // Radius, height and the same of the normal; inner and outer walls apart.
        let mut spots: Vec<([i64; 3], [f64; 4])> = self
            .planes
            .iter()
            .filter_map(|plane| {
                let arm = plane.origin.xy() - center;
                let radius = arm.norm();
                let out = plane.normal.xy().dot(&arm) / radius.max(1e-9);
                // Handles do not face away from the axis.
                let aside = plane.normal.xy().norm_squared() - out * out;
                let key = [(radius / cell_m) as i64, (plane.origin.z / cell_m) as i64, i64::from(out > 0.0)];
                (aside < 0.1).then_some((key, [radius, plane.origin.z, out, plane.normal.z]))
            })
            .collect();
        spots.sort_by_key(|spot| spot.0);
        let mut images = Vec::new();
        for group in spots.chunk_by(|a, b| a.0 == b.0) {
            let mean = |i: usize| group.iter().map(|spot| spot.1[i]).sum::<f64>() / group.len() as f64;
            let [radius, height, out, up] = [0, 1, 2, 3].map(mean);
            let Some(normal) = Unit::try_new(Vector3::new(out, 0.0, up), 1e-6) else { continue };
            let origin = Point3::new(center.x + radius, center.y, height);
            let profile = Tangent { origin, normal };
            let mut found = Vec::new();
            let tries: Vec<Meets> = (0..12)
                .map(|turn| {
                    self.meets(&turned(&profile, center, TAU * f64::from(turn) / 12.0), DEEP, &mut found)
                })
                .collect();
            if tries.iter().filter(|&&met| met == Meets::Empty).count() > 3 {
                continue;
            }
            let turns = (TAU * radius / self.spacing_m).ceil().clamp(1.0, 2000.0) as u32;
            images
                .extend((0..turns).map(|i| turned(&profile, center, TAU * f64::from(i) / f64::from(turns))));
        }
        images
    }
}

fn mirrored(plane: &Tangent, normal: &Vector3<f64>, offset_m: f64) -> Tangent {
    let flip = |v: Vector3<f64>| v - normal * (2.0 * normal.dot(&v));
    let origin = plane.origin - normal * (2.0 * (normal.dot(&plane.origin.coords) - offset_m));
    Tangent { origin, normal: Unit::new_normalize(flip(plane.normal.into_inner())) }
}

fn mirrored_sight(sight: &Sight, normal: &Vector3<f64>, offset_m: f64) -> Sight {
    let image = mirrored(&Tangent { origin: sight.point, normal: sight.towards_sensor }, normal, offset_m);
    Sight { point: image.origin, towards_sensor: image.normal }
}

fn turned(plane: &Tangent, center: &Point2<f64>, angle_rad: f64) -> Tangent {
    let rotation = Rotation3::from_axis_angle(&Vector3::z_axis(), angle_rad);
    let about = Vector3::new(center.x, center.y, 0.0);
    Tangent { origin: rotation * (plane.origin - about) + about, normal: rotation * plane.normal }
}

fn turned_sight(sight: &Sight, center: &Point2<f64>, angle_rad: f64) -> Sight {
    let image = turned(&Tangent { origin: sight.point, normal: sight.towards_sensor }, center, angle_rad);
    Sight { point: image.origin, towards_sensor: image.normal }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::{
        PointCloud, Provenance, Reconstruction, Settings, Table,
        camera::{Thing, seen},
        reconstruct,
        table::Plane,
    };

    /// One view, 35 degrees from the vertical.
    fn one_view(thing: Thing) -> PointCloud {
        seen(&[thing], [[0.29, -0.32, 0.6], [0.0, 0.0, 0.03]], 0.25, 300, 2e-4).filtered(|_, p| p.y < 0.3)
    }

    fn completed(cloud: &PointCloud, symmetry: bool) -> Reconstruction {
        let table = Table::Plane(Plane::horizontal(0.0));
        reconstruct(cloud, &Settings { table, close: true, symmetry, ..Settings::default() }).unwrap()
    }

    fn volume_ratio(model: &Reconstruction, truth: f64) -> f64 {
        assert!(model.report.watertight && model.report.components == 1, "{:?}", model.report);
        model.mesh.signed_volume_m3() / truth
    }

    #[test]
    fn the_back_of_a_cylinder_is_turned_and_that_of_a_box_mirrored() {
        use std::f64::consts::PI;
        for (thing, volume) in [
            (Thing::Cylinder([0.0, 0.0], 0.035, 0.08), PI * 0.035 * 0.035 * 0.08),
            (Thing::Box([-0.03, -0.045, 0.0], [0.03, 0.045, 0.06]), 0.06 * 0.09 * 0.06),
            (Thing::Ball([0.0, 0.0, 0.035], 0.035), 4.0 / 3.0 * PI * 0.035_f64.powi(3)),
        ] {
            let cloud = one_view(thing);
            let model = completed(&cloud, true);
            let ratio = volume_ratio(&model, volume);
            assert!((ratio - 1.0).abs() < 0.1, "{thing:?}: {ratio}");
            let area = model.mesh.area_m2();
            let share = |each| model.mesh.area_of_m2(each) / area;
            assert!(share(Provenance::Mirrored) > 0.15, "{thing:?}: {}", share(Provenance::Mirrored));
            assert!(share(Provenance::Extruded) < 0.25, "{thing:?}: {}", share(Provenance::Extruded));
            let plain = completed(&cloud, false);
            assert_eq!(plain.mesh.area_of_m2(Provenance::Mirrored), 0.0);
        }
    }

    #[test]
    fn the_plane_of_symmetry_is_fitted_to_what_confirms_it() {
        // Half an ellipsoid of unequal axes, turned by 20 degrees and moved aside, seen from one side.
        let axes = Vector3::new(0.055, 0.032, 0.038);
        let place = nalgebra::Isometry3::translation(0.013, -0.021, 0.0)
            * nalgebra::UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 20_f64.to_radians());
        let towards_sensor = Unit::new_normalize(Vector3::new(0.5, 0.25, 0.83));
        let spacing_m = 1.2e-3;
        let mut planes = Vec::new();
        for i in 0..=40 {
            let elevation = 0.5 * PI * f64::from(i) / 40.0;
            let around = (TAU * 0.04 * elevation.cos() / spacing_m).ceil().max(1.0) as u32;
            for k in 0..around {
                let azimuth = TAU * f64::from(k) / f64::from(around);
                let unit = Vector3::new(
                    elevation.cos() * azimuth.cos(),
                    elevation.cos() * azimuth.sin(),
                    elevation.sin(),
                );
                let normal = place * Unit::new_normalize(unit.component_div(&axes));
                if normal.dot(&towards_sensor) > 0.25 {
                    planes.push(Tangent { origin: place * Point3::from(unit.component_mul(&axes)), normal });
                }
            }
        }
        let mut sights: Vec<Sight> =
            planes.iter().map(|plane| Sight { point: plane.origin, towards_sensor }).collect();
        // The table around it, but for the shadow: lines of sight that miss the ellipsoid.
        for (i, k) in (-80..=80).flat_map(|i| (-80..=80).map(move |k| (i, k))) {
            let point = Point3::new(f64::from(i), f64::from(k), 0.0) * 1.5e-3;
            let from = place.inverse_transform_point(&point).coords.component_div(&axes);
            let way = place.inverse_transform_vector(&towards_sensor).component_div(&axes);
            let nearest = from - way * (from.dot(&way) / way.norm_squared());
            if nearest.norm() > 1.0 || from.norm() > 1.0 && from.dot(&way) > 0.0 {
                sights.push(Sight { point, towards_sensor });
            }
        }
        let scan = Scan::new(planes, sights, spacing_m).unwrap();
        let Some(Symmetry::Mirror { normal, offset_m }) = scan.upright_mirror() else { panic!("no plane") };
        let across = [Vector3::x(), Vector3::y()].map(|axis| (place * axis).dot(&normal).abs());
        assert!(across[0].max(across[1]) > 1_f64.to_radians().cos(), "{normal:?}");
        let miss_m = normal.dot(&place.translation.vector) - offset_m;
        assert!(miss_m.abs() < 0.2 * spacing_m, "{miss_m}");
    }

    #[test]
    fn without_a_symmetry_nothing_is_mirrored() {
        // An L, which has no upright plane of symmetry that a view from this side would not contradict.
        let arms = [
            Thing::Box([-0.05, -0.05, 0.0], [0.05, -0.02, 0.06]),
            Thing::Box([-0.05, -0.02, 0.0], [-0.02, 0.06, 0.03]),
        ];
        let cloud =
            seen(&arms, [[0.29, -0.32, 0.6], [0.0, 0.0, 0.03]], 0.25, 300, 2e-4).filtered(|_, p| p.y < 0.3);
        let model = completed(&cloud, true);
        let share = model.mesh.area_of_m2(Provenance::Mirrored) / model.mesh.area_m2();
        assert!(model.report.watertight && share < 0.12, "{share}");
    }
}
