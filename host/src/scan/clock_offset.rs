//! The offset between the cameras' clock and the arm's, from the scan itself.
//!
//! A late time stamp shifts every point of a sweep against the motion, so sweeps that pass the same surface in different
//! directions disagree by the offset times the difference of their speeds. Small planes are fitted to one sweep, the
//! points of the others near by are compared with them along the normal, and one number, the offset, is fitted to all of
//! them by robust least squares. Surface that no two sweeps pass differently along its normal, as the table, says
//! nothing.
//!
//! The uncertainty is that of the sum of the residuals of one pair of sweeps, which share the errors of both
//! (cluster-robust: Liang and Zeger 1986), so that whatever misplaces a sweep as a whole shows in it.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Point3, Vector3};
use rayon::prelude::*;
use serde::Serialize;

use super::capture::{Capture, Placed};
use crate::surface::grid::Grid;

/// What the scan says of the clocks.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(tag = "outcome", rename_all = "kebab-case")]
pub enum ClockOffset {
    /// Nobody asked.
    NotAsked,
    /// No two sweeps pass the same surface differently: one sweep only, or nothing but a table.
    Undetermined,
    /// The clocks agree as far as the scan can tell.
    Negligible {
        /// What to add to the frames' times to get the arm's.
        offset_s: f64,
        /// Its standard deviation.
        sigma_s: f64,
    },
    /// The clocks differ; the cloud was made with the frames' times put right.
    Applied {
        /// What was added to the frames' times.
        offset_s: f64,
        /// Its standard deviation.
        sigma_s: f64,
    },
}

impl ClockOffset {
    /// What is added to the frames' times.
    #[must_use]
    pub const fn applied_s(self) -> f64 {
        match self {
            Self::Applied { offset_s, .. } => offset_s,
            Self::NotAsked | Self::Undetermined | Self::Negligible { .. } => 0.0,
        }
    }
}

/// Offsets that are looked for.
const MOST_S: f64 = 0.06;
const COARSE_STEP_S: f64 = 0.006;
/// Beyond this many standard deviations an offset is no chance.
const BEYOND_CHANCE: f64 = 4.0;
/// An offset that moves nothing by more than a scan's noise.
const NEGLIGIBLE_S: f64 = 0.0005;
/// Less certain is not known.
const LEAST_KNOWN_S: f64 = 0.002;
/// Planes that are tried in each sweep, and those of all sweeps that vote on the coarse offset.
const PLANES_OF_SWEEP: usize = 12_000;
const COARSE_PLANES: usize = 3000;
const PLANE_POINTS: usize = 16;
const PLANE_RADIUS_M: f64 = 0.0025;
/// Standard deviation of a plane's points up to which it is one.
const FLAT_M: f64 = 0.0002;
/// Points of another sweep that are compared with a plane, and how far they may be along it.
const MET_POINTS: usize = 8;
const MET_RADIUS_M: f64 = 0.002;
/// Share of the sweeps' speed against each other that must be along the normal.
const TELLING: f64 = 0.2;
/// Fewer planes that meet another sweep say nothing.
const LEAST_MEETINGS: usize = 60;
/// Residuals of more standard deviations count for nothing (Tukey's biweight, efficiency 95 %).
const TUKEY: f64 = 4.685;
const LEAST_SCALE_M: f64 = 0.00003;
const ITERATIONS: usize = 8;

/// The points of one sweep at offset 0, base frame, and how fast each moves with the offset.
struct SweepPoints {
    points: Vec<Point3<f64>>,
    speeds: Vec<Vector3<f64>>,
    mean_speed: Vector3<f64>,
    grid: Grid,
}

/// A small plane of a sweep.
struct Patch {
    sweep: usize,
    center: Point3<f64>,
    normal: Vector3<f64>,
    speed: Vector3<f64>,
}

/// A plane met by another sweep: the residual is `distance_m + slope_m_per_s * offset`.
struct Meeting {
    /// The two sweeps, the lower number first: which of them had the plane makes no other pair.
    pair: [usize; 2],
    distance_m: f64,
    slope_m_per_s: f64,
}

/// Estimates the offset.
pub(super) fn clock_offset(capture: &Capture, placed: &[Placed]) -> ClockOffset {
    let sweeps = sweeps(capture, placed);
    if sweeps.len() < 2 {
        return ClockOffset::Undetermined;
    }
    let patches: Vec<Patch> = (0..sweeps.len()).flat_map(|sweep| patches(&sweeps, sweep)).collect();
    let steps = (MOST_S / COARSE_STEP_S).round() as i32;
    let coarse: Vec<f64> = (-steps..=steps).map(|i| f64::from(i) * COARSE_STEP_S).collect();
    // Every plane's vote: how well the sweeps meet, with one number that bounds the blame.
    let stride = patches.len().div_ceil(COARSE_PLANES).max(1);
    let few: Vec<&Patch> = patches.iter().step_by(stride).collect();
    let cost = |offset_s: f64| {
        let met = meetings(&sweeps, few.iter().copied(), offset_s);
        let off = |m: &Meeting| (m.distance_m + m.slope_m_per_s * offset_s).abs().min(BLAME_M);
        let sum: f64 = met.iter().map(off).sum();
        // A plane that nothing meets blames the offset as well.
        sum / met.len().max(1) as f64 + BLAME_M * (1.0 - met.len() as f64 / few.len().max(1) as f64)
    };
    let costs: Vec<f64> = coarse.iter().map(|&offset_s| cost(offset_s)).collect();
    let best = (0..coarse.len()).min_by(|&a, &b| costs[a].total_cmp(&costs[b]));
    let mut offset_s = best.map_or(0.0, |i| coarse[i]);
    let mut fitted = None;
    for _ in 0..ITERATIONS {
        let met = meetings(&sweeps, patches.iter(), offset_s);
        let Some(fit) = fit(&met, offset_s) else { return ClockOffset::Undetermined };
        let moved_s = fit.offset_s - offset_s;
        offset_s = fit.offset_s;
        fitted = Some(fit);
        if moved_s.abs() < 1e-6 {
            break;
        }
    }
    match fitted {
        // One at the very end of those that are looked for may come out a little beyond it.
        Some(Fit { offset_s, sigma_s })
            if sigma_s <= LEAST_KNOWN_S && offset_s.abs() <= MOST_S + COARSE_STEP_S =>
        {
            if offset_s.abs() > BEYOND_CHANCE * sigma_s && offset_s.abs() > NEGLIGIBLE_S {
                ClockOffset::Applied { offset_s, sigma_s }
            } else {
                ClockOffset::Negligible { offset_s, sigma_s }
            }
        }
        _ => ClockOffset::Undetermined,
    }
}

/// Residual beyond which a plane's blame does not grow.
const BLAME_M: f64 = 0.001;
/// Half of the time over which a speed is taken.
const HALF_STEP_S: f64 = 0.005;

fn sweeps(capture: &Capture, placed: &[Placed]) -> Vec<SweepPoints> {
    placed
        .chunk_by(|a, b| a.sweep == b.sweep)
        .filter_map(|frames| {
            let (mut points, mut speeds) = (Vec::new(), Vec::new());
            for frame in frames {
                let pose = capture.base_from_scanner(frame.time_s)?;
                // At the ends of the joints one side has to do.
                let around = [-HALF_STEP_S, HALF_STEP_S].map(|step_s| {
                    let moved = capture.base_from_scanner(frame.time_s + step_s);
                    moved.map_or((0.0, pose), |moved| (step_s, moved))
                });
                let [(before_s, before), (after_s, after)] = around;
                if after_s <= before_s {
                    continue;
                }
                for point in &frame.points {
                    let in_scanner = Point3::new(0.0, point.y_m, point.z_m);
                    points.push(pose * in_scanner);
                    speeds.push((after * in_scanner - before * in_scanner) / (after_s - before_s));
                }
            }
            if points.is_empty() {
                return None;
            }
            let mean_speed = speeds.iter().sum::<Vector3<f64>>() / speeds.len() as f64;
            let grid = Grid::new(&points, MET_RADIUS_M);
            Some(SweepPoints { points, speeds, mean_speed, grid })
        })
        .collect()
}

/// Planes of a sweep along whose normals another sweep moves differently.
fn patches(sweeps: &[SweepPoints], sweep: usize) -> Vec<Patch> {
    let own = &sweeps[sweep];
    let stride = own.points.len().div_ceil(PLANES_OF_SWEEP).max(1);
    let candidates: Vec<usize> = (0..own.points.len()).step_by(stride).collect();
    candidates
        .par_iter()
        .filter_map(|&index| {
            let mut found = Vec::new();
            own.grid.nearest(&own.points[index], PLANE_POINTS, &mut found);
            found.retain(|(distance2, _)| *distance2 <= PLANE_RADIUS_M.powi(2));
            if found.len() < PLANE_POINTS / 2 {
                return None;
            }
            let share = 1.0 / found.len() as f64;
            let near = || found.iter().map(|&(_, i)| own.points[i as usize].coords);
            let center = near().sum::<Vector3<f64>>() * share;
            let spread: Matrix3<f64> =
                near().map(|p| (p - center) * (p - center).transpose()).sum::<Matrix3<f64>>() * share;
            let eigen = spread.symmetric_eigen();
            let least = eigen.eigenvalues.imin();
            if eigen.eigenvalues[least].max(0.0).sqrt() > FLAT_M {
                return None;
            }
            let normal: Vector3<f64> = eigen.eigenvectors.column(least).into();
            let tells = sweeps.iter().enumerate().any(|(other, points)| {
                let against = points.mean_speed - own.mean_speed;
                other != sweep && against.dot(&normal).abs() > TELLING * own.mean_speed.norm()
            });
            let speed = own.speeds[index];
            tells.then_some(Patch { sweep, center: center.into(), normal, speed })
        })
        .collect()
}

/// Where other sweeps meet the planes when the clocks differ by `offset_s`.
fn meetings<'a>(
    sweeps: &[SweepPoints],
    patches: impl Iterator<Item = &'a Patch>,
    offset_s: f64,
) -> Vec<Meeting> {
    let patches: Vec<&Patch> = patches.collect();
    let met = |patch: &&Patch| {
        let mut met = Vec::new();
        let mut found = Vec::new();
        for (other, points) in sweeps.iter().enumerate() {
            let against = points.mean_speed - patch.speed;
            if other == patch.sweep || against.dot(&patch.normal).abs() < TELLING * patch.speed.norm() {
                continue;
            }
            points.grid.nearest(&(patch.center - against * offset_s), MET_POINTS, &mut found);
            let last = found.last().map_or(f64::INFINITY, |(distance2, _)| *distance2);
            if found.len() < MET_POINTS || last > MET_RADIUS_M.powi(2) {
                continue;
            }
            let share = 1.0 / found.len() as f64;
            let (mut point, mut speed) = (Vector3::zeros(), Vector3::zeros());
            for &(_, i) in &found {
                point += points.points[i as usize].coords * share;
                speed += points.speeds[i as usize] * share;
            }
            met.push(Meeting {
                pair: [patch.sweep.min(other), patch.sweep.max(other)],
                distance_m: patch.normal.dot(&(point - patch.center.coords)),
                slope_m_per_s: patch.normal.dot(&(speed - patch.speed)),
            });
        }
        met
    };
    patches.par_iter().map(met).collect::<Vec<_>>().into_iter().flatten().collect()
}

struct Fit {
    offset_s: f64,
    sigma_s: f64,
}

/// One step of reweighted least squares; `None` when too little meets.
fn fit(met: &[Meeting], offset_s: f64) -> Option<Fit> {
    if met.len() < LEAST_MEETINGS {
        return None;
    }
    let residual = |m: &Meeting| m.distance_m + m.slope_m_per_s * offset_s;
    let mut sizes: Vec<f64> = met.iter().map(|m| residual(m).abs()).collect();
    let middle = sizes.len() / 2;
    let (_, median, _) = sizes.select_nth_unstable_by(middle, f64::total_cmp);
    // Of a normal distribution the median of the size is 0.6745 standard deviations.
    let cut = TUKEY * (*median / 0.6745).max(LEAST_SCALE_M);
    let weight = |m: &Meeting| {
        let x = residual(m) / cut;
        if x.abs() < 1.0 { (1.0 - x * x).powi(2) } else { 0.0 }
    };
    let information: f64 = met.iter().map(|m| weight(m) * m.slope_m_per_s.powi(2)).sum();
    let pull: f64 = met.iter().map(|m| weight(m) * m.slope_m_per_s * m.distance_m).sum();
    if information <= 0.0 {
        return None;
    }
    let offset_s = -pull / information;
    let mut scores: BTreeMap<[usize; 2], f64> = BTreeMap::new();
    for m in met {
        let score = weight(m) * m.slope_m_per_s * (m.distance_m + m.slope_m_per_s * offset_s);
        *scores.entry(m.pair).or_default() += score;
    }
    let used = scores.values().filter(|score| **score != 0.0).count() as f64;
    let of_pairs = scores.values().map(|score| score * score).sum::<f64>() * used / (used - 1.0).max(1.0);
    // Two sweeps alone cannot disagree with each other: neighbours on the surface share errors, say ten at a time.
    let of_points: f64 = met
        .iter()
        .map(|m| (weight(m) * m.slope_m_per_s * (m.distance_m + m.slope_m_per_s * offset_s)).powi(2))
        .sum();
    let sigma_s = of_pairs.max(NEIGHBOURS * of_points).sqrt() / information;
    (offset_s.is_finite() && sigma_s.is_finite()).then_some(Fit { offset_s, sigma_s })
}

/// Planes that share their points.
const NEIGHBOURS: f64 = 10.0;
