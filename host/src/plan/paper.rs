//! The search of the 2005 system.
//!
//! Eight typical candidates first, the palm over the geometric centre and moved until the fingers touch together; then
//! small rotations and shifts about the sites found, at most 300 attempts, an end at the first epsilon above 0.2 (Wang
//! et al. 2005, section V.A). Where the paper says "approach to the object from different position and pose" this
//! takes: straight down with the opposition along the object's principal axes, thinnest first, then leaning.

use nalgebra::{Matrix3, Point3, Unit, UnitQuaternion, Vector3};
use rand::RngExt;

use super::preshape::{PreshapeTable, tables};
use super::scene::Scene;
use super::search::{Proposal, SearchResult, SearchSettings, Tried, attempt_rng, perturbed, record, try_all};
use super::settle::Approach;

/// Proposals tried at a time: enough for the cores, few enough not to waste work behind the threshold.
const BATCH: usize = 16;

/// Small range of the second stage: shift in metres, rotation in radians (one standard deviation).
const SHIFT_M: f64 = 0.008;
const TURN_RAD: f64 = 0.2;

/// Sites that the second stage works on.
const SITES_KEPT: usize = 8;

/// Runs the search. `progress` is told the number of attempts so far.
#[must_use]
pub fn search(scene: &Scene, settings: &SearchSettings, progress: &dyn Fn(usize)) -> SearchResult {
    let candidates = tables(&scene.hand);
    let mut result = SearchResult::empty();
    let mut sites: Vec<Tried> = Vec::new();

    for proposals in initial_proposals(scene) {
        for batch in proposals.chunks(BATCH) {
            let tried = try_all(scene, &candidates, batch);
            let stop = record(&mut result, &tried, settings, true, progress);
            if stop {
                result.rank();
                return result;
            }
            sites.extend(tried);
        }
        if sites.iter().filter(|site| site.outcome.is_ok()).count() >= SITES_KEPT {
            break;
        }
    }
    refine(scene, &candidates, settings, sites, &mut result, progress);
    result.rank();
    result
}

/// The first stage: all candidates but the power grasps, which are the paper's future work, in one approach before the next
/// approach, so that the eight come first as in the paper.
pub(super) fn initial_proposals(scene: &Scene) -> Vec<Vec<Proposal>> {
    let precise =
        || scene.hand.candidates.iter().enumerate().filter(|(_, c)| !c.wraps).map(|(index, _)| index);
    let stage = |approaches: Vec<(Approach, Point3<f64>)>| {
        let all = approaches.into_iter().flat_map(|at| precise().map(move |candidate| (candidate, at)));
        let settle = |(candidate, (approach, target_in_object))| Proposal::Settle {
            candidate,
            approach,
            target_in_object,
            width_m: None,
        };
        all.map(settle).collect()
    };
    initial_approaches(scene).into_iter().map(stage).collect()
}

/// Second stage: small random motions about the best sites.
fn refine(
    scene: &Scene,
    candidates: &[PreshapeTable],
    settings: &SearchSettings,
    mut sites: Vec<Tried>,
    result: &mut SearchResult,
    progress: &dyn Fn(usize),
) {
    // Grasps by quality, then the refusals that came furthest through the checks.
    sites.sort_by(|a, b| match (&a.outcome, &b.outcome) {
        (Ok(a), Ok(b)) => b.quality.epsilon_low.total_cmp(&a.quality.epsilon_low),
        (Ok(_), Err(_)) => std::cmp::Ordering::Less,
        (Err(_), Ok(_)) => std::cmp::Ordering::Greater,
        (Err(a), Err(b)) => b.cmp(a),
    });
    sites.truncate(SITES_KEPT);
    while result.attempts < settings.attempts && !sites.is_empty() {
        let first = result.attempts;
        let proposals: Vec<Proposal> = (first..(first + BATCH).min(settings.attempts))
            .map(|index| {
                let mut rng = attempt_rng(settings.seed, index);
                let from = &sites[rng.random_range(0..sites.len())];
                let site = perturbed(&from.site, &scene.center_of_mass, SHIFT_M, TURN_RAD, &mut rng);
                Proposal::At { candidate: from.candidate, site: Box::new(site) }
            })
            .collect();
        let tried = try_all(scene, candidates, &proposals);
        if record(result, &tried, settings, true, progress) {
            return;
        }
    }
}

/// Approaches with the points that the contacts are to lie around, in the order in which they are tried, in stages: each
/// stage is tried whole. Straight down about the centre and, since what stands on a table is often widest at its foot,
/// as deep as the table lets the fingers go; then leaning by 45 and by 80 degrees.
fn initial_approaches(scene: &Scene) -> Vec<Vec<(Approach, Point3<f64>)>> {
    let down = scene.base_from_object.inverse_transform_vector(&-Vector3::z());
    // The paper's centre of geometry. The middle of a bounding box would move with every bump of a scan.
    let center = scene.center_of_mass;
    let depth_m = scene.mesh.vertices().iter().map(|p| (p - center).dot(&down)).fold(0.0, f64::max);
    let at = |target: Point3<f64>| move |approach: Approach| (approach, target);
    let from_above = oppositions(scene, &down, 4);
    let shallow = from_above.iter().copied().map(at(center));
    let deep = from_above.iter().copied().map(at(center + down * depth_m));
    let leaning = |lean_rad: f64| {
        from_above
            .iter()
            .flat_map(|approach| {
                let axis = Unit::new_normalize(approach.opposition_in_object);
                let turn = UnitQuaternion::from_axis_angle(&axis, lean_rad);
                oppositions(scene, &(turn * down), 1)
            })
            .map(at(center))
            .collect()
    };
    vec![shallow.chain(deep).collect(), leaning(45f64.to_radians()), leaning(80f64.to_radians())]
}

/// `count` approaches in one direction, the opposition turned in equal steps from the object's thinnest extent across
/// the direction.
fn oppositions(scene: &Scene, direction_in_object: &Vector3<f64>, count: usize) -> Vec<Approach> {
    let direction = Unit::new_normalize(*direction_in_object);
    let thin = thinnest_across(scene, &direction);
    (0..count)
        .map(|i| {
            let turn =
                UnitQuaternion::from_axis_angle(&direction, std::f64::consts::TAU * i as f64 / count as f64);
            Approach { direction_in_object: direction, opposition_in_object: turn * thin }
        })
        .collect()
}

/// The direction across `direction` in which the vertices scatter least about the centre. Area-weighted scatter of the
/// faces, so that the density of a mesh's vertices does not count.
#[must_use]
fn thinnest_across(scene: &Scene, direction: &Unit<Vector3<f64>>) -> Vector3<f64> {
    let mut scatter = Matrix3::zeros();
    for face in 0..scene.mesh.faces().len() {
        let [a, b, c] = scene.mesh.corners(face);
        let area = 0.5 * (b - a).cross(&(c - a)).norm();
        for corner in [a, b, c] {
            let across = corner - scene.center_of_mass;
            let flat = across - direction.into_inner() * across.dot(direction);
            scatter += flat * flat.transpose() * (area / 3.0);
        }
    }
    let eigen = scatter.symmetric_eigen();
    // The direction itself has scatter 0; of the two eigenvectors across it, the one that scatters less.
    let across: Vec<usize> = {
        let along = (0..3)
            .max_by(|&i, &j| {
                let alignment = |k: usize| eigen.eigenvectors.column(k).dot(direction).abs();
                alignment(i).total_cmp(&alignment(j))
            })
            .unwrap_or(0);
        (0..3).filter(|&i| i != along).collect()
    };
    let thin =
        if eigen.eigenvalues[across[0]] <= eigen.eigenvalues[across[1]] { across[0] } else { across[1] };
    eigen.eigenvectors.column(thin).into_owned()
}
