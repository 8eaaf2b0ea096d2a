//! Accuracy of reconstructed scans of the built-in objects: distances, and the normals that fingertips find.
//!
//! `cargo run --release -p host --example surface_accuracy [SEEDS] [NOISE_PX]` scans each object as `prehend demo` does
//! (SEEDS 1 to 3 and 0.15 px by default) and prints means over the seeds:
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
use host::plan::arm::{Arm, Inverse};
use host::plan::attempt::{AttemptScratch, attempt};
use host::plan::candidates::typical;
use host::plan::paper;
use host::plan::scene::Scene;
use host::plan::search::SearchSettings;
use host::plan::surface_query::SurfaceQuery;
use host::scan::{
    Instrument, Scan, SweepSettings, palm_from_scanner, plan_sweeps, scan, target_sphere,
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
    let truth = std::env::var("OBJ").unwrap_or("teacup-cover".into()).parse::<BuiltIn>()?.object(1.0)?.mesh.transformed(&Isometry3::translation(SPOT_M[0], SPOT_M[1], SPOT_M[2]));
    let true_scene = Scene::new(truth.clone(), Isometry3::identity(), Some(0.0), Some(Arm::rx60()))?;
    let settings = SearchSettings { threshold: f64::INFINITY, ..SearchSettings::default() };
    let true_grasps = paper::search(&true_scene, &settings, &|_| ()).grasps;
    for seed in 1..=1 {
        let noise: f64 = std::env::args().nth(1).map_or(0.15, |t| t.parse().unwrap());
        let scan = scanned(&truth, noise, seed)?;
        let found = reconstruct(&scan.cloud, &Settings { table: Table::Plane(Plane::horizontal(0.0)), close: true, outliers: std::env::var("NOOUT").is_err(), seed, ..Settings::default() })?;
        println!("seed {seed} {:?} {:?}", found.report.seconds, found.report.used);
        let rim: Vec<_> = scan.cloud.points.iter().filter(|p| { let r = ((p.x-0.4).powi(2)+p.y*p.y).sqrt(); r > 0.0445 && p.z > 0.009 && p.z < 0.0135 }).collect();
        println!("rim points {} per mm2 {:.2}", rim.len(), rim.len() as f64 / (3.2*std::f64::consts::TAU*45.0));
        let rr: Vec<f64> = rim.iter().map(|p| ((p.x-0.4).powi(2)+p.y*p.y).sqrt()*1e3).collect();
        let m = rr.iter().sum::<f64>()/rr.len() as f64;
        println!("rim radius mean {:.3} sd {:.3}", m, (rr.iter().map(|r| (r-m).powi(2)).sum::<f64>()/rr.len() as f64).sqrt());
        if std::env::var("DUMP").is_ok() {
            let tq = &true_scene.surface;
            let mut bad: Vec<_> = samples(&found, 1).into_iter().map(|v| (tq.nearest(&v).signed_distance_m * 1e3, v)).filter(|(d, _)| d.abs() > 0.12).collect();
            bad.sort_by(|a, b| b.0.abs().total_cmp(&a.0.abs()));
            println!("bad {} of 20000", bad.len());
            let mut bins = std::collections::BTreeMap::new();
            for (d, v) in &bad { let r = ((v.x-0.4).powi(2)+v.y*v.y).sqrt()*1e3; let e = bins.entry(((r / 2.0) as i32 * 2, (v.z * 500.0) as i32 * 2, *d > 0.0)).or_insert((0, 0.0)); e.0 += 1; e.1 += d.abs(); }
            let mut bins: Vec<_> = bins.into_iter().collect();
            bins.sort_by_key(|b| -b.1.0);
            for (k, (n, s)) in bins.iter().take(12) { println!("  bad r {} z {} out {} n {} mean {:.3}", k.0, k.1, k.2, n, s / *n as f64); }
            for (d, v) in bad.iter().take(6) { println!("  bad {:.3} r {:.3} az {:.4} z {:.3}", d, ((v.x-0.4).powi(2)+v.y*v.y).sqrt()*1e3, v.y.atan2(v.x-0.4), v.z*1e3); }
        }
        // profile of the reconstruction near the rim: max radius by height
        let back = SurfaceQuery::new(&found.mesh)?;
        let hs: Vec<f64> = if std::env::var("OBJ").is_ok() { (0..30).map(|i| 0.012 + 0.0003*i as f64).collect() } else { vec![]}; for h in hs.into_iter().chain([0.0085, 0.009,0.0095,0.010,0.0105,0.011,0.0115,0.012,0.0125,0.013,0.0132,0.0135,0.014,0.0145]) {
            let mut radii = vec![];
            let mut tr = vec![];
            let tq = &true_scene.surface;
            for k in 0..360 {
                let a = (k as f64).to_radians();
                for (q, out) in [(&back, &mut radii), (tq, &mut tr)] {
                    // march inwards from outside horizontally
                    let mut r = 0.06;
                    let mut ok = false;
                    while r > 0.030 {
                        let d = q.nearest(&Point3::new(0.4 + r*a.cos(), r*a.sin(), h)).signed_distance_m;
                        if d < 1e-6 { ok = true; break; }
                        r -= d.max(2e-6);
                    }
                    if ok { out.push(r*1e3); }
                }
            }
            let st = |v: &Vec<f64>| { let m = v.iter().sum::<f64>()/v.len() as f64; (m, (v.iter().map(|r| (r-m).powi(2)).sum::<f64>()/v.len() as f64).sqrt()) };
            if std::env::var("H").is_ok() { println!("h {:.4} scan r {:.3?} truth {:.3?}", h, st(&radii), st(&tr)); }
        }
        let scene = Scene::new(found.mesh.clone(), Isometry3::identity(), Some(0.0), Some(Arm::rx60()))?;
        let mut scratch = AttemptScratch::default();
        for grasp in true_grasps.iter().take(8) {
            let again = attempt(&scene, grasp.candidate, &typical()[grasp.candidate], &grasp.site, &mut scratch);
            print!("cand {} eps {:.3} -> ", grasp.candidate, grasp.quality.epsilon_low);
            match again {
                Err(e) => println!("{}", e.name()),
                Ok(g) => {
                    print!("{:.3} ", g.quality.epsilon_low);
                    for (a, b) in grasp.contacts.iter().zip(&g.contacts) {
                        let (p, n, m) = (a.contact.point_in_object(), a.contact.inward_normal_in_object(), b.contact.inward_normal_in_object());
                        let r = ((p.x-0.4).powi(2)+p.y*p.y).sqrt()*1e3;
                        let az = |v: &Vector3<f64>| v.y.atan2(v.x).to_degrees();
                        let el = |v: &Vector3<f64>| v.z.asin().to_degrees();
                        print!(" [r{:.1} z{:.1} el {:.1} daz {:.1} del {:.1} dp {:.2}]", r, p.z*1e3, el(&n), az(&m)-az(&n), el(&m)-el(&n), (b.contact.point_in_object()-p).norm()*1e3);
                    }
                    println!();
                }
            }
        }
    }
    Ok(())
}

/// The scan that `prehend demo` makes.
fn scanned(truth: &Mesh, stripe_noise_px: f64, seed: u64) -> anyhow::Result<Scan> {
    let instrument = Instrument { stripe_noise_px, ..Instrument::default() };
    let arm = Arm::rx60();
    let scanner_from_palm = palm_from_scanner().inverse();
    let reachable = |pose: &Isometry3<f64>| {
        matches!(arm.palm_solutions_near(&(pose * scanner_from_palm), &[0.0; 6]), Inverse::Solutions(_))
    };
    let (center, radius_m) = target_sphere(truth);
    let plan = plan_sweeps(&center, radius_m, &instrument, &SweepSettings::default(), &reachable);
    Ok(scan(truth, Some(Plane::horizontal(0.0)), &plan.sweeps, &instrument, seed)?)
}

/// Points spread evenly over the faces that measured points support.
fn samples(found: &Reconstruction, seed: u64) -> Vec<Point3<f64>> {
    let faces: Vec<usize> = (0..found.mesh.faces().len()).filter(|&face| found.measured[face]).collect();
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
