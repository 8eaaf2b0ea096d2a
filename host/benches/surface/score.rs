//! How far a mesh is from the surface that it stands for.

use host::plan::surface_query::SurfaceQuery;
use host::surface::Mesh;
use nalgebra::Point3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::lid::Lid;

/// Points that each figure is taken over.
const SAMPLES: usize = 50_000;
/// Surface farther than this from the truth is invented, millimetres.
const FALSE_MM: f64 = 1.0;

/// Distances in mm as mean, 95 % and greatest; shares in per cent.
#[derive(Debug, Clone, Copy)]
pub(super) struct Score {
    pub(super) mesh_to_truth: [f64; 3],
    pub(super) truth_to_mesh: [f64; 3],
    /// Share of the mesh's area more than a millimetre away from the truth.
    pub(super) invented: f64,
    /// Share of the truth more than a millimetre away from the mesh.
    pub(super) missed: f64,
    /// Angle between a facet's normal and the truth's, degrees: median and 95 %.
    pub(super) normal_deg: [f64; 2],
    /// Share of the area that faces inwards.
    pub(super) inverted: f64,
    pub(super) open_edges: usize,
    pub(super) triangles: usize,
}

/// Measures a mesh in metres against `truth`; of the truth the given points, mm, are what could be known.
pub(super) fn score(mesh: &Mesh, truth: &Lid, known: &[Point3<f64>]) -> anyhow::Result<Score> {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let drawn: Vec<(Point3<f64>, usize)> = spread(mesh, &mut rng);
    let found: Vec<(f64, f64)> = drawn
        .par_iter()
        .map(|(point, face)| {
            let nearest = truth.nearest(&Point3::from(point.coords * 1e3));
            (nearest.distance_mm, nearest.outward.angle(&mesh.face_normal(*face)).to_degrees())
        })
        .collect();
    let query = SurfaceQuery::new(mesh)?;
    let step = (known.len() / SAMPLES).max(1);
    let back: Vec<f64> = known
        .par_iter()
        .step_by(step)
        .map(|point| query.nearest(&Point3::from(point.coords * 1e-3)).signed_distance_m.abs() * 1e3)
        .collect();
    let share = |count: usize, of: usize| 100.0 * count as f64 / of as f64;
    let inverted = found.iter().filter(|f| f.1 > 90.0).count();
    // A mesh that is turned as a whole still has normals.
    let turned = 2 * inverted > found.len();
    let angles = found.iter().map(|f| if turned { 180.0 - f.1 } else { f.1 }).collect();
    Ok(Score {
        invented: share(found.iter().filter(|f| f.0 > FALSE_MM).count(), found.len()),
        missed: share(back.iter().filter(|d| **d > FALSE_MM).count(), back.len()),
        mesh_to_truth: summary(found.iter().map(|f| f.0).collect()),
        truth_to_mesh: summary(back),
        normal_deg: quantiles(angles, [0.5, 0.95]),
        inverted: share(inverted, found.len()),
        open_edges: mesh.open_edges(),
        triangles: mesh.faces().len(),
    })
}

/// Points spread evenly over a mesh, each with its face.
fn spread(mesh: &Mesh, rng: &mut ChaCha8Rng) -> Vec<(Point3<f64>, usize)> {
    let mut total = 0.0;
    let sums: Vec<f64> = (0..mesh.faces().len())
        .map(|face| {
            let [a, b, c] = mesh.corners(face);
            total += (b - a).cross(&(c - a)).norm();
            total
        })
        .collect();
    (0..SAMPLES)
        .map(|_| {
            let at = rng.random_range(0.0..total);
            let face = sums.partition_point(|&sum| sum < at).min(sums.len() - 1);
            let [a, b, c] = mesh.corners(face);
            let (mut u, mut v): (f64, f64) = (rng.random(), rng.random());
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            (a + (b - a) * u + (c - a) * v, face)
        })
        .collect()
}

fn summary(values: Vec<f64>) -> [f64; 3] {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let [p95, most] = quantiles(values, [0.95, 1.0]);
    [mean, p95, most]
}

fn quantiles(mut values: Vec<f64>, shares: [f64; 2]) -> [f64; 2] {
    values.sort_unstable_by(f64::total_cmp);
    shares.map(|share| values[((values.len() - 1) as f64 * share) as usize])
}
