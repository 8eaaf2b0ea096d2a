//! Sweeps one after the other, each chosen from what the ones before have not seen.
//!
//! Nothing is known of the object but a sphere that holds it. After the first view every candidate (a direction from which
//! the scanner looks, in which it can be carried over all that is there, at the distance at which it measures) is rated
//! by the frontier of the unseen that its laser would light; the best is swept, until no candidate shows enough.

use std::collections::BTreeSet;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use super::instrument::Instrument;
use super::sweep::{StripePose, Sweep, SweepPlan, SweepSettings, looking};
use super::unseen::{Frontier, Unseen};
use crate::surface::PointCloud;

/// What the sweeps are made with and over.
#[derive(Clone, Copy)]
pub struct Chain<'a> {
    /// Centre of a sphere that holds the target, base frame.
    pub center: Point3<f64>,
    /// Its radius.
    pub radius_m: f64,
    /// Height of the table.
    pub table_height_m: f64,
    /// The scanner.
    pub instrument: &'a Instrument,
    /// Rate, pitch, margin and field, and how many views more.
    pub settings: &'a SweepSettings,
    /// Whether the arm can carry the scanner along a pass.
    pub reachable: &'a dyn Fn(&[StripePose]) -> bool,
}

/// Directions around the vertical, and from it.
const AZIMUTHS: u32 = 12;
const TILTS_DEG: [f64; 4] = [0.0, 25.0, 35.0, 45.0];
/// Depth that a pass covers about its stand-off.
const FIELD_DEPTH_M: f64 = 0.09;
/// A view that would show fewer voxels of the frontier is not worth its time, nor one that adds a smaller share to what is
/// known of the surface.
const LEAST_GAIN: usize = 12;
const LEAST_SHARE: f64 = 0.02;
/// Time of the way to another view, against which the gain is weighed.
const CHANGE_S: f64 = 1.0;

/// Makes the sweeps of `first`, then at most as many more views as the settings' `next_best` says, each the best for what
/// is still unseen. `scan` makes sweeps and gives their cloud, base frame. All sweeps that were made are returned, in their order.
///
/// # Errors
/// Those of `scan`.
pub fn chain<E>(
    first: SweepPlan,
    given: &Chain<'_>,
    scan: &mut dyn FnMut(&[Sweep]) -> Result<PointCloud, E>,
) -> Result<SweepPlan, E> {
    let mut made = first;
    let mut unseen = Unseen::new(&given.center, given.radius_m, given.table_height_m);
    unseen.add(&scan(&made.sweeps)?);
    let mut tried: Vec<[u32; 2]> = Vec::new();
    // What a view promised to show and did not.
    let mut given_up: BTreeSet<[usize; 3]> = BTreeSet::new();
    let mut frontier = unseen.frontier();
    for _ in 0..given.settings.next_best {
        let Some(next) = next_view(&unseen, &frontier, &tried, given) else { break };
        unseen.add(&scan(&next.sweeps)?);
        frontier = unseen.frontier();
        given_up.extend(frontier.iter().map(|f| f.place).filter(|place| next.promised.contains(place)));
        frontier.retain(|f| !given_up.contains(&f.place));
        tried.push(next.direction);
        made.sweeps.extend(next.sweeps);
    }
    Ok(made)
}

/// A view to make next.
struct NextView {
    /// Numbers of azimuth and tilt.
    direction: [u32; 2],
    sweeps: Vec<Sweep>,
    /// Voxels that it should show.
    promised: BTreeSet<[usize; 3]>,
}

fn next_view(
    unseen: &Unseen,
    frontier: &[Frontier],
    tried: &[[u32; 2]],
    given: &Chain<'_>,
) -> Option<NextView> {
    let surface = unseen.surface();
    let target: Vec<Point3<f64>> = surface.iter().copied().chain(frontier.iter().map(|f| f.center)).collect();
    let least = LEAST_GAIN.max((LEAST_SHARE * surface.len() as f64) as usize);
    // By promise, before the arm is asked: that takes the most time.
    let mut promising: Vec<(f64, [u32; 2], View)> = Vec::new();
    for (t, tilt_deg) in (0..).zip(TILTS_DEG) {
        for a in 0..if tilt_deg == 0.0 { 1 } else { AZIMUTHS } {
            if tried.contains(&[a, t]) {
                continue;
            }
            let azimuth_rad = TAU * f64::from(a) / f64::from(AZIMUTHS);
            let view = View::over(&target, azimuth_rad, tilt_deg.to_radians(), given)?;
            let gain = view.lit(frontier, unseen, given).count();
            if gain >= least {
                promising.push((gain as f64 / (view.duration_s(given) + CHANGE_S), [a, t], view));
            }
        }
    }
    promising.sort_by(|a, b| b.0.total_cmp(&a.0));
    promising.into_iter().find_map(|(_, direction, view)| {
        // As it is, or with the scanner turned about its axis by half a turn: the motion then runs the other way.
        [0.0, PI, FRAC_PI_2, -FRAC_PI_2].into_iter().find_map(|roll_rad| {
            let view = View::rolled(&target, view.azimuth_rad, view.tilt_rad, roll_rad, given)?;
            let passes = view.passes(given);
            let name = match view.tilt_rad {
                0.0 => "straight down again".to_owned(),
                tilt => format!(
                    "from {:.0} deg, tilted {:.0} deg, for the unseen",
                    view.azimuth_rad.to_degrees(),
                    tilt.to_degrees()
                ),
            };
            passes.iter().all(|pass| (given.reachable)(pass)).then(|| NextView {
                direction,
                promised: view.lit(frontier, unseen, given).map(|f| f.place).collect(),
                sweeps: passes.into_iter().map(|stripes| Sweep { name: name.clone(), stripes }).collect(),
            })
        })
    })
}

/// A direction from which to look, and how far the target reaches in it.
struct View {
    azimuth_rad: f64,
    tilt_rad: f64,
    rotation: UnitQuaternion<f64>,
    /// Ends of the target along the axes of the scanner.
    low: Vector3<f64>,
    high: Vector3<f64>,
}

impl View {
    fn over(target: &[Point3<f64>], azimuth_rad: f64, tilt_rad: f64, given: &Chain<'_>) -> Option<Self> {
        Self::rolled(target, azimuth_rad, tilt_rad, 0.0, given)
    }

    /// `None` when there is no target.
    fn rolled(
        target: &[Point3<f64>],
        azimuth_rad: f64,
        tilt_rad: f64,
        roll_rad: f64,
        given: &Chain<'_>,
    ) -> Option<Self> {
        let rotation = looking(azimuth_rad, tilt_rad, roll_rad);
        let within = |p: &Point3<f64>| rotation.inverse() * p.coords;
        let first = within(target.first()?);
        let (low, high) = target.iter().map(within).fold((first, first), |(l, h), p| (l.inf(&p), h.sup(&p)));
        let margin = Vector3::new(given.settings.margin_m, 0.0, 0.0);
        Some(Self { azimuth_rad, tilt_rad, rotation, low: low - margin, high: high + margin })
    }

    /// Numbers of exposures along a pass, of passes side by side, and of passes at different distances.
    fn counts(&self, given: &Chain<'_>) -> [u32; 3] {
        let width = given.settings.field_width_m.unwrap_or(given.instrument.field_width_m());
        let whole = self.high - self.low;
        let count =
            |length_m: f64, part_m: f64, most: f64| (length_m / part_m).ceil().clamp(1.0, most) as u32;
        [
            count(whole.x, given.settings.pitch_m, 1e5),
            count(whole.y, width, 16.0),
            count(whole.z, FIELD_DEPTH_M, 16.0),
        ]
    }

    fn duration_s(&self, given: &Chain<'_>) -> f64 {
        let [along, side, deep] = self.counts(given);
        f64::from(side * deep) * (f64::from(along) / given.settings.rate_hz + CHANGE_S)
    }

    /// Middle of a part along an axis.
    fn middle(&self, axis: usize, part: u32, parts: u32) -> f64 {
        let whole = self.high[axis] - self.low[axis];
        self.low[axis] + whole * (f64::from(part) + 0.5) / f64::from(parts)
    }

    /// The aperture of the laser when it lights a point, in the axes of the scanner.
    fn aperture(&self, point: &Vector3<f64>, given: &Chain<'_>) -> Vector3<f64> {
        let [_, side, deep] = self.counts(given);
        let part = |axis: usize, parts: u32| {
            let whole = (self.high[axis] - self.low[axis]).max(f64::MIN_POSITIVE);
            let share = (point[axis] - self.low[axis]) / whole;
            ((share * f64::from(parts)) as u32).min(parts - 1)
        };
        let (y, z) = (self.middle(1, part(1, side), side), self.middle(2, part(2, deep), deep));
        Vector3::new(point.x, y, z - given.instrument.stand_off_m)
    }

    /// Voxels of the frontier that the laser would light.
    fn lit<'a>(
        &'a self,
        frontier: &'a [Frontier],
        unseen: &'a Unseen,
        given: &'a Chain<'_>,
    ) -> impl Iterator<Item = &'a Frontier> {
        let least_cosine = given.instrument.max_incidence_rad.cos();
        frontier.iter().filter(move |f| {
            let in_scanner = self.rotation.inverse() * f.center.coords;
            let to_laser = self.rotation * (self.aperture(&in_scanner, given) - in_scanner).normalize();
            f.outward.dot(&to_laser) > least_cosine && unseen.is_clear(&f.center, &to_laser)
        })
    }

    fn passes(&self, given: &Chain<'_>) -> Vec<Vec<StripePose>> {
        let [along, side, deep] = self.counts(given);
        let mut passes = Vec::new();
        for layer in 0..deep {
            for lane in 0..side {
                let stripe = |i: u32| {
                    let x = 0.5 * (self.low.x + self.high.x)
                        + given.settings.pitch_m * (f64::from(i) - 0.5 * f64::from(along));
                    let z = self.middle(2, layer, deep) - given.instrument.stand_off_m;
                    let place = self.rotation * Vector3::new(x, self.middle(1, lane, side), z);
                    StripePose {
                        time_s: f64::from(i) / given.settings.rate_hz,
                        base_from_scanner: Isometry3::from_parts(Translation3::from(place), self.rotation),
                    }
                };
                passes.push((0..=along).map(stripe).collect());
            }
        }
        passes
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::object::BuiltIn;
    use crate::scan::{ScanError, plan_sweeps, scan, target_sphere};
    use crate::surface::{Mesh, Plane};

    fn placed(built_in: BuiltIn) -> Mesh {
        built_in.object(1.0).unwrap().mesh.transformed(&Isometry3::translation(0.40, 0.0, 0.0))
    }

    /// Chained sweeps over an object, and what they saw of it.
    fn chained(mesh: &Mesh, most: u32, reachable: &dyn Fn(&[StripePose]) -> bool) -> (SweepPlan, PointCloud) {
        let (center, radius_m) = target_sphere(mesh);
        let instrument = Instrument::default();
        let settings = SweepSettings { next_best: most, ..SweepSettings::paper() };
        let given = Chain {
            center,
            radius_m,
            table_height_m: 0.0,
            instrument: &instrument,
            settings: &settings,
            reachable,
        };
        let first = plan_sweeps(&center, radius_m, &instrument, &settings, reachable);
        let mut all = PointCloud { views: Some(Vec::new()), ..PointCloud::default() };
        let plan = chain(first, &given, &mut |sweeps| {
            let seen = scan(mesh, Some(Plane::horizontal(0.0)), sweeps, &instrument, 1)?.cloud;
            all.points.extend(&seen.points);
            all.views.iter_mut().for_each(|views| views.extend(seen.views.iter().flatten()));
            Ok::<_, ScanError>(seen)
        });
        (plan.unwrap(), all)
    }

    #[test]
    fn the_walls_of_a_cube_are_what_is_looked_at_next() {
        let mesh = placed(BuiltIn::Cube);
        let (plan, cloud) = chained(&mesh, 8, &|_| true);
        let names: Vec<&str> = plan.sweeps.iter().map(|sweep| sweep.name.as_str()).collect();
        println!("{names:?}");
        // Two walls at a time from over a corner would do it; no more than one view a wall.
        assert!((3..=6).contains(&plan.sweeps.len()), "{names:?}");
        let (low, high) = mesh.bounding_box();
        let height = high.z;
        for (axis, side) in [(0, low.x), (0, high.x), (1, low.y), (1, high.y)] {
            // Every part of each wall, 8 mm wide.
            for i in 0..(height / 0.008) as i32 {
                let band = (0.008 * f64::from(i) + 0.002)..(0.008 * f64::from(i) + 0.008);
                let on = |p: &&Point3<f64>| (p[axis] - side).abs() < 0.0005 && band.contains(&p.z);
                assert!(cloud.points.iter().filter(on).count() > 20, "axis {axis} at {side}, {band:?}");
            }
        }
    }

    #[test]
    fn nothing_unseen_or_nothing_in_reach_ends_the_chain() {
        // A disk 20 mm high shows its side too; the end comes by itself.
        let (plan, _) = chained(&placed(BuiltIn::Disk), 50, &|_| true);
        assert!(plan.sweeps.len() < 12, "{}", plan.sweeps.len());
        let down = |pass: &[StripePose]| {
            pass.iter().all(|s| (s.base_from_scanner.rotation * Vector3::z()).z < -0.99)
        };
        let (plan, _) = chained(&placed(BuiltIn::Cube), 8, &down);
        assert!(plan.sweeps.iter().all(|sweep| !sweep.name.contains("tilted")));
    }

    #[test]
    fn deep_targets_are_swept_at_several_distances() {
        let settings = SweepSettings { field_width_m: Some(0.104), ..SweepSettings::default() };
        let instrument = Instrument::default();
        let given = Chain {
            center: Point3::origin(),
            radius_m: 0.1,
            table_height_m: 0.0,
            instrument: &instrument,
            settings: &settings,
            reachable: &|_| true,
        };
        let target = [Point3::new(0.3, -0.1, 0.0), Point3::new(0.5, 0.1, 0.16)];
        let view = View::over(&target, 0.0, 0.0, &given).unwrap();
        // 200 mm wide and 160 mm deep.
        assert_eq!(view.counts(&given)[1..], [2, 2]);
        let passes = view.passes(&given);
        assert_eq!(passes.len(), 4);
        let heights: Vec<f64> = passes.iter().map(|pass| pass[0].base_from_scanner.translation.z).collect();
        assert!((heights[0] - 0.32).abs() < 1e-9 && (heights[2] - 0.24).abs() < 1e-9, "{heights:?}");
    }
}
