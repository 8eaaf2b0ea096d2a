//! Accuracy of reconstructed scans of the built-in objects: distances, and the normals that fingertips find.
//!
//! `cargo run --release -p host --example surface_accuracy [SEEDS] [NOISE_PX] [OUTLIERS] [SWEEPS_MM]` scans each
//! object as `prehend demo` does (SEEDS 1 to 3, 0.15 px, a share of 0 strays, sweeps misplaced by 0 mm by default) and prints means over the seeds:
//!
//! - mesh -> truth: from points spread evenly over the faces that measured points support, mm, mean and 95 %;
//! - truth -> mesh: from the points that the same scan sees without noise, mm, mean and 95 %;
//! - normal: angle between the true and the reconstructed contact normal of a fingertip that touches the truth, degrees,
//!   median and 95 %: over the whole surface that a tip can reach above the table, and over the sides alone, where the
//!   true normal is within 30 degrees of horizontal;
//! - grasps: epsilon of the grasps that the paper's search finds on the true mesh, and of the same hand poses closed on
//!   the reconstruction (0 where they do not close), mean of the best ten; and the best epsilon of a search on the
//!   reconstruction, with the attempts it took.

use std::time::Instant;

use anyhow::Context;
use host::object::BuiltIn;
use host::plan::arm::Arm;
use host::plan::attempt::{AttemptScratch, attempt};
use host::plan::paper;
use host::plan::scene::Scene;
use host::plan::search::SearchSettings;
use host::plan::surface_query::SurfaceQuery;
use host::scan::{
    Instrument, Scan, StripePose, SweepSettings, palm_from_scanner, plan_sweeps, scan, target_sphere,
};
use host::surface::{Mesh, Plane, Reconstruction, Settings, Table, reconstruct};
use nalgebra::{Isometry3, Point3, Unit, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Points and contacts that each figure is taken over.
const SAMPLES: usize = 20_000;
const TIP_RADIUS_M: f64 = 0.013;
/// Where `prehend demo` puts its object, base frame.
const SPOT_M: [f64; 3] = [0.40, 0.0, 0.0];
const TABLE_CLEARANCE_M: f64 = 0.001;

fn main() -> anyhow::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let seeds: u64 = arguments.next().map_or(Ok(3), |text| text.parse()).context("SEEDS")?;
    let stripe_noise_px = arguments.next().map_or(Ok(0.15), |text| text.parse()).context("NOISE_PX")?;
    let outlier_share = arguments.next().map_or(Ok(0.0), |text| text.parse()).context("OUTLIERS")?;
    let sweeps_mm: f64 = arguments.next().map_or(Ok(0.0), |text| text.parse()).context("SWEEPS_MM")?;
    let registration_m = 1e-3 * sweeps_mm;
    let instrument = Instrument { stripe_noise_px, outlier_share, registration_m, ..Instrument::default() };
    println!(
        "{:12} {:>6} {:>6} {:>9} {:>13} {:>13} {:>11} {:>11} {:>15} {:>11}",
        "object",
        "used",
        "s",
        "triangles",
        "mesh->truth",
        "truth->mesh",
        "normal",
        "sides",
        "true/scan best10",
        "search"
    );
    for built_in in BuiltIn::ALL {
        let truth =
            built_in.object(1.0)?.mesh.transformed(&Isometry3::translation(SPOT_M[0], SPOT_M[1], SPOT_M[2]));
        let query = SurfaceQuery::new(&truth)?;
        let exact = scanned(&truth, &Instrument { stripe_noise_px: 0.0, ..Instrument::default() }, 1)?;
        let seen: Vec<Point3<f64>> = exact
            .cloud
            .points
            .iter()
            .copied()
            .filter(|p| p.z > 1e-3 && query.nearest(p).signed_distance_m.abs() < 1e-6)
            .collect();
        let true_scene = Scene::new(truth.clone(), Isometry3::identity(), Some(0.0), Some(Arm::rx60()))?;
        let settings = SearchSettings { threshold: f64::INFINITY, ..SearchSettings::default() };
        let true_grasps = paper::search(&true_scene, &settings, &|_| ()).grasps;
        let runs = (1..=seeds)
            .map(|seed| {
                let scan = scanned(&truth, &instrument, seed)?;
                let clock = Instant::now();
                let found = reconstruct(
                    &scan.cloud,
                    &Settings {
                        table: Table::Plane(Plane::horizontal(0.0)),
                        close: true,
                        seed,
                        ..Settings::default()
                    },
                )?;
                let seconds = clock.elapsed().as_secs_f64();
                let back = SurfaceQuery::new(&found.mesh)?;
                let distance = |from: &SurfaceQuery, points: &[Point3<f64>]| -> [f64; 2] {
                    let mut mm: Vec<f64> =
                        points.iter().map(|p| from.nearest(p).signed_distance_m.abs() * 1e3).collect();
                    [mm.iter().sum::<f64>() / mm.len() as f64, quantile(&mut mm, 0.95)]
                };
                let mesh_to_truth = distance(&query, &samples(&found, seed));
                let truth_to_mesh = distance(&back, &seen);
                let [mut all, mut sides] = normal_errors(&truth, &query, &back, seed);
                let scene =
                    Scene::new(found.mesh.clone(), Isometry3::identity(), Some(0.0), Some(Arm::rx60()))?;
                let mut scratch = AttemptScratch::default();
                let (mut on_truth, mut on_scan) = (0.0, 0.0);
                let best: Vec<_> = true_grasps.iter().take(10).collect();
                for grasp in &best {
                    on_truth += grasp.quality.epsilon_low / best.len() as f64;
                    let again = attempt(
                        &scene,
                        grasp.candidate,
                        &scene.hand.candidates[grasp.candidate],
                        &grasp.site,
                        &mut scratch,
                    );
                    on_scan += again.map_or(0.0, |again| again.quality.epsilon_low) / best.len() as f64;
                }
                let search =
                    paper::search(&scene, &SearchSettings { seed, ..SearchSettings::default() }, &|_| ());
                let best = search.grasps.first().map_or(0.0, |grasp| grasp.quality.epsilon_low);
                Ok(vec![
                    found.report.used as f64,
                    seconds,
                    found.report.triangles as f64,
                    mesh_to_truth[0],
                    mesh_to_truth[1],
                    truth_to_mesh[0],
                    truth_to_mesh[1],
                    quantile(&mut all, 0.5),
                    quantile(&mut all, 0.95),
                    quantile(&mut sides, 0.5),
                    quantile(&mut sides, 0.95),
                    on_truth,
                    on_scan,
                    best,
                    search.attempts as f64,
                ])
            })
            .collect::<anyhow::Result<Vec<_>>>()?;
        let mean = |i: usize| runs.iter().map(|run| run[i]).sum::<f64>() / runs.len() as f64;
        println!(
            "{:12} {:6.0} {:6.3} {:9.0} {:6.3} {:6.3} {:6.3} {:6.3} {:5.2} {:5.1} {:5.2} {:5.1} {:7.3} {:7.3} {:6.3} {:4.0}",
            built_in.name(),
            mean(0),
            mean(1),
            mean(2),
            mean(3),
            mean(4),
            mean(5),
            mean(6),
            mean(7),
            mean(8),
            mean(9),
            mean(10),
            mean(11),
            mean(12),
            mean(13),
            mean(14)
        );
    }
    Ok(())
}

/// The scan that `prehend demo` makes.
fn scanned(truth: &Mesh, instrument: &Instrument, seed: u64) -> anyhow::Result<Scan> {
    let arm = Arm::rx60();
    let scanner_from_palm = palm_from_scanner().inverse();
    let holds = |stripe: &StripePose| arm.reaches_palm(&(stripe.base_from_scanner * scanner_from_palm));
    let reachable = |pass: &[StripePose]| pass.iter().all(holds);
    let (center, radius_m) = target_sphere(truth);
    let plan = plan_sweeps(&center, radius_m, instrument, &SweepSettings::default(), &reachable);
    Ok(scan(truth, Some(Plane::horizontal(0.0)), &plan.sweeps, instrument, seed)?)
}

/// Points spread evenly over the faces that measured points support.
fn samples(found: &Reconstruction, seed: u64) -> Vec<Point3<f64>> {
    let faces: Vec<usize> =
        (0..found.mesh.faces().len()).filter(|&face| found.mesh.is_measured(face)).collect();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    spread(&found.mesh, &faces, &mut rng).into_iter().map(|(point, _)| point).collect()
}

/// Points spread evenly over some faces of a mesh, each with its face.
fn spread(mesh: &Mesh, faces: &[usize], rng: &mut ChaCha8Rng) -> Vec<(Point3<f64>, usize)> {
    let mut total = 0.0;
    let sums: Vec<f64> = faces
        .iter()
        .map(|&face| {
            let [a, b, c] = mesh.corners(face);
            total += (b - a).cross(&(c - a)).norm();
            total
        })
        .collect();
    (0..SAMPLES)
        .map(|_| {
            let at = rng.random_range(0.0..total);
            let face = faces[sums.partition_point(|&sum| sum < at).min(faces.len() - 1)];
            let [a, b, c] = mesh.corners(face);
            let (mut u, mut v): (f64, f64) = (rng.random(), rng.random());
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            (a + (b - a) * u + (c - a) * v, face)
        })
        .collect()
}

/// Angles in degrees between the normals of fingertips that touch the truth: all, and those on the sides.
fn normal_errors(truth: &Mesh, query: &SurfaceQuery, back: &SurfaceQuery, seed: u64) -> [Vec<f64>; 2] {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let faces: Vec<usize> = (0..truth.faces().len()).collect();
    let [mut all, mut sides] = [Vec::new(), Vec::new()];
    for (point, face) in spread(truth, &faces, &mut rng) {
        // Off the face's normal by up to 45 degrees, so that tips come to touch edges as well.
        let jitter = Vector3::from([0, 1, 2].map(|_| rng.random_range(-0.5..0.5)));
        let outward = Unit::new_normalize(truth.face_normal(face).into_inner() + jitter);
        // The tip comes along that way until it touches.
        let mut center = point + outward.into_inner() * 0.05;
        let mut touch = None;
        for _ in 0..100 {
            let nearest = query.nearest(&center);
            let gap = nearest.signed_distance_m - TIP_RADIUS_M;
            if gap < 1e-6 {
                touch = (gap > -1e-6).then(|| Unit::new_normalize(center - nearest.point_in_object));
                break;
            }
            center -= outward.into_inner() * gap;
        }
        let Some(normal) = touch else { continue };
        if center.z < TIP_RADIUS_M + TABLE_CLEARANCE_M {
            continue;
        }
        let nearest = back.nearest(&center);
        let found = (center - nearest.point_in_object).normalize() * nearest.signed_distance_m.signum();
        let degrees = normal.angle(&found).to_degrees();
        all.push(degrees);
        if normal.z.abs() < 0.5 {
            sides.push(degrees);
        }
    }
    [all, sides]
}

fn quantile(values: &mut [f64], share: f64) -> f64 {
    if values.is_empty() {
        return f64::NAN;
    }
    values.sort_by(f64::total_cmp);
    values[((values.len() - 1) as f64 * share) as usize]
}
