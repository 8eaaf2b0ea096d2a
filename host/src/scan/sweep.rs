//! How the arm carries the scanner: straight passes with the laser plane across the motion.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use nalgebra::{Isometry3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};

use super::instrument::Instrument;
use crate::surface::Mesh;

/// One exposure of the stripe.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StripePose {
    /// Time since the start of the sweep.
    pub time_s: f64,
    /// The scanner in the robot base frame.
    pub base_from_scanner: Isometry3<f64>,
}

/// One straight pass.
#[derive(Debug, Clone, PartialEq)]
pub struct Sweep {
    /// For reports: "straight down", "from 90 deg, tilted 45 deg".
    pub name: String,
    /// Exposures in the order of time.
    pub stripes: Vec<StripePose>,
}

impl Sweep {
    /// Time from the first to the last exposure.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.stripes.last().map_or(0.0, |stripe| stripe.time_s)
    }
}

/// How to sweep.
#[derive(Debug, Clone, PartialEq)]
pub struct SweepSettings {
    /// Exposures a second: 50 fields of the paper's video cameras.
    pub rate_hz: f64,
    /// Distance between stripes; with the rate it sets the speed, 50 mm/s by default.
    pub pitch_m: f64,
    /// Length of a pass beyond the target on each side.
    pub margin_m: f64,
    /// Number of inclined views, evenly around the target. The paper sweeps once, straight down: 0.
    pub inclined: u32,
    /// After the views above, at most so many more, each chosen for what is still unseen ([`super::next_sweep::chain`]).
    pub next_best: u32,
    /// Width along the stripe that a pass covers; by default that of the cameras' field at the stand-off.
    pub field_width_m: Option<f64>,
    /// Angles between an inclined view and the vertical, in the order in which they are tried.
    pub tilts_rad: Vec<f64>,
}

impl SweepSettings {
    /// The paper's scan: one sweep, straight down.
    #[must_use]
    pub fn paper() -> Self {
        Self { inclined: 0, ..Self::default() }
    }
}

impl SweepSettings {
    /// One sweep straight down, and up to eight that look at what is still unseen.
    #[must_use]
    pub fn next_best() -> Self {
        Self { next_best: 8, ..Self::paper() }
    }
}

impl Default for SweepSettings {
    fn default() -> Self {
        Self {
            rate_hz: 50.0,
            pitch_m: 0.001,
            margin_m: 0.005,
            inclined: 4,
            next_best: 0,
            field_width_m: None,
            tilts_rad: [45.0, 35.0, 25.0].map(f64::to_radians).to_vec(),
        }
    }
}

/// The passes that the arm can make, and the views that it cannot.
#[derive(Debug, Clone, PartialEq)]
pub struct SweepPlan {
    /// Passes to make.
    pub sweeps: Vec<Sweep>,
    /// Names of the views that were dropped because the arm reaches no variant of them.
    pub dropped: Vec<String>,
}

/// Plans passes over the sphere of `radius_m` about `center` (base frame): one view straight down, then the inclined ones.
///
/// `reachable` says whether the arm can carry the scanner along a pass. The instrument may be rolled
/// about its axis in quarter turns, and an inclined view may take a smaller tilt; a view of which every variant has
/// an unreachable pass is dropped. A target wider than the scanner's field takes several parallel passes.
#[must_use]
pub fn plan_sweeps(
    center: &Point3<f64>,
    radius_m: f64,
    instrument: &Instrument,
    settings: &SweepSettings,
    reachable: &dyn Fn(&[StripePose]) -> bool,
) -> SweepPlan {
    let mut plan = SweepPlan { sweeps: Vec::new(), dropped: Vec::new() };
    let mut add = |name: &str, azimuth_rad: f64, tilts_rad: &[f64]| {
        for &tilt in tilts_rad {
            for roll in [0.0, PI, FRAC_PI_2, -FRAC_PI_2] {
                let view = View { center, azimuth_rad, tilt_rad: tilt, roll_rad: roll };
                let passes = view.passes(radius_m, instrument, settings);
                if passes.iter().all(|pass| reachable(pass)) {
                    let name = if tilt == 0.0 {
                        name.to_owned()
                    } else {
                        format!("{name}, tilted {:.0} deg", tilt.to_degrees())
                    };
                    let named = |stripes| Sweep { name: name.clone(), stripes };
                    plan.sweeps.extend(passes.into_iter().map(named));
                    return;
                }
            }
        }
        plan.dropped.push(name.to_owned());
    };
    add("straight down", 0.0, &[0.0]);
    for i in 0..settings.inclined {
        let azimuth = TAU * f64::from(i) / f64::from(settings.inclined);
        add(&format!("from {:.0} deg", azimuth.to_degrees()), azimuth, &settings.tilts_rad);
    }
    plan
}

/// Centre and radius of a sphere about a mesh, for [`plan_sweeps`]: the centre of its box, and the farthest vertex.
#[must_use]
pub fn target_sphere(mesh: &Mesh) -> (Point3<f64>, f64) {
    let (low, high) = mesh.bounding_box();
    let center = nalgebra::center(&low, &high);
    (center, mesh.vertices().iter().map(|p| (p - center).norm()).fold(0.0, f64::max))
}

/// The scanner's axes when it looks at the target from an azimuth (about z from x) and a tilt (from the vertical), rolled
/// about its own z.
pub(super) fn looking(azimuth_rad: f64, tilt_rad: f64, roll_rad: f64) -> UnitQuaternion<f64> {
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), azimuth_rad)
        * Rotation3::from_axis_angle(&Vector3::y_axis(), tilt_rad);
    // z looks down, x (the motion) runs across the azimuth, so that an inclined stripe runs up the object.
    let looking_down = Rotation3::from_basis_unchecked(&[Vector3::y(), Vector3::x(), -Vector3::z()]);
    let roll = Rotation3::from_axis_angle(&Vector3::z_axis(), roll_rad);
    UnitQuaternion::from_rotation_matrix(&(turn * looking_down * roll))
}

struct View<'a> {
    center: &'a Point3<f64>,
    /// Where the scanner stands, seen from the target, about z from x.
    azimuth_rad: f64,
    tilt_rad: f64,
    roll_rad: f64,
}

impl View<'_> {
    fn passes(
        &self,
        radius_m: f64,
        instrument: &Instrument,
        settings: &SweepSettings,
    ) -> Vec<Vec<StripePose>> {
        let rotation = looking(self.azimuth_rad, self.tilt_rad, self.roll_rad);
        let half_length = radius_m + settings.margin_m;
        let count = (2.0 * half_length / settings.pitch_m).ceil().clamp(1.0, 1e5) as u32;
        let passes = (2.0 * radius_m / settings.field_width_m.unwrap_or(instrument.field_width_m()))
            .ceil()
            .clamp(1.0, 16.0) as u32;
        let pass_width = 2.0 * radius_m / f64::from(passes);
        let pass = |pass: u32| {
            let y = (f64::from(pass) - 0.5 * f64::from(passes - 1)) * pass_width;
            (0..=count)
                .map(|i| {
                    let x = settings.pitch_m * (f64::from(i) - 0.5 * f64::from(count));
                    let offset = rotation * Vector3::new(x, y, -instrument.stand_off_m);
                    let base_from_scanner =
                        Isometry3::from_parts(Translation3::from(self.center + offset), rotation);
                    StripePose { time_s: f64::from(i) / settings.rate_hz, base_from_scanner }
                })
                .collect()
        };
        (0..passes).map(pass).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CENTER: Point3<f64> = Point3::new(0.42, 0.0, 0.03);

    fn plan(radius_m: f64, reachable: &dyn Fn(&[StripePose]) -> bool) -> SweepPlan {
        plan_sweeps(&CENTER, radius_m, &Instrument::default(), &SweepSettings::default(), reachable)
    }

    #[test]
    fn every_view_looks_at_the_target_from_above() {
        let plan = plan(0.05, &|_| true);
        assert_eq!(plan.sweeps.len(), 5);
        assert!(plan.dropped.is_empty());
        for sweep in &plan.sweeps {
            let middle = sweep.stripes[sweep.stripes.len() / 2].base_from_scanner;
            assert!((middle * Point3::new(0.0, 0.0, 0.2) - CENTER).norm() < 1e-3, "{}", sweep.name);
            assert!((middle.rotation * Vector3::z()).z < -0.7);
            let first = sweep.stripes[0].base_from_scanner;
            let motion = middle.translation.vector - first.translation.vector;
            assert!((motion.normalize() - first.rotation * Vector3::x()).norm() < 1e-9, "{}", sweep.name);
            assert!((sweep.duration_s() - 2.2).abs() < 0.05);
        }
        assert_eq!(plan.sweeps[2].name, "from 90 deg, tilted 45 deg");
        let east = plan.sweeps[1].stripes[50].base_from_scanner.translation.vector - CENTER.coords;
        assert!(east.x > 0.1 && east.y.abs() < 0.02 && east.z > 0.1);
    }

    #[test]
    fn unreachable_views_are_lowered_or_named() {
        let lowered = plan(0.05, &|pass| {
            let x = |stripe: &StripePose| stripe.base_from_scanner.translation.vector.x;
            pass.iter().all(|stripe| x(stripe) < 0.42 + 0.2 * 30_f64.to_radians().sin())
        });
        assert_eq!(lowered.sweeps[1].name, "from 0 deg, tilted 25 deg");
        assert_eq!(lowered.sweeps[3].name, "from 180 deg, tilted 45 deg");
        let none = plan(0.05, &|_| false);
        assert!(none.sweeps.is_empty());
        assert_eq!(none.dropped.len(), 5);
        assert_eq!(none.dropped[0], "straight down");
    }

    #[test]
    fn wide_targets_take_parallel_passes() {
        assert_eq!(plan(0.10, &|_| true).sweeps.len(), 10);
    }
}
