//! The default search: approaches from everywhere, all attempts spent, ranked by what survives an error of the pose.

use nalgebra::{Point3, Unit, UnitQuaternion, Vector3};
use rand::{Rng, RngExt};
use rand_distr::{Distribution, UnitSphere};

use super::attempt::Grasp;
use super::candidates::{Candidate, typical};
use super::scene::Scene;
use super::search::{Proposal, SearchResult, SearchSettings, Tried, attempt_rng, perturbed, record, try_all};
use super::settle::Approach;

/// Share of the attempts that sample the whole object; the rest refines the best of them.
const SAMPLING_SHARE: f64 = 0.7;

/// Grasps that the refinement works on.
const REFINED: usize = 16;

/// Shift in metres and rotation in radians of a refinement (one standard deviation), small against a fingertip.
const REFINE_SHIFT_M: f64 = 0.005;
const REFINE_TURN_RAD: f64 = 0.12;

/// Grasps whose robustness is measured, and samples each.
const ROBUST_GRASPS: usize = 32;
const ROBUST_SAMPLES: usize = 16;

/// Error of the object's pose against the hand that the ranking assumes (one standard deviation): arm, hand-eye
/// calibration and scan together leave about a millimetre, and the closing fingers push.
const POSE_ERROR_M: f64 = 0.002;
const POSE_ERROR_RAD: f64 = 0.03;

/// Proposals tried between two reports of progress.
const BATCH: usize = 64;

/// Runs the search. `progress` is told the number of attempts so far.
#[must_use]
pub fn search(scene: &Scene, settings: &SearchSettings, progress: &dyn Fn(usize)) -> SearchResult {
    let candidates = typical();
    let mut result = SearchResult::empty();
    let sampled = (settings.attempts as f64 * SAMPLING_SHARE).ceil() as usize;
    let mut kept: Vec<Tried> = Vec::new();
    // Without a grasp there is nothing to refine: the sampling then goes on to the end.
    while result.attempts < sampled || kept.is_empty() {
        let first = result.attempts;
        let end = if kept.is_empty() { settings.attempts } else { sampled };
        let proposals: Vec<Proposal> = (first..(first + BATCH).min(end))
            .map(|index| sample(scene, index % candidates.len(), &mut attempt_rng(settings.seed, index)))
            .collect();
        let tried = try_all(scene, &candidates, &proposals);
        let stop = record(&mut result, &tried, settings, false, progress);
        kept.extend(tried.into_iter().filter(|t| t.outcome.is_ok()));
        if stop {
            break;
        }
    }
    refine(scene, &candidates, settings, kept, &mut result, progress);
    result.rank();
    rank_by_robustness(scene, &candidates, settings.seed, &mut result);
    result
}

/// A random approach of one candidate. Seldom from below: with a table, directions rise at most ten degrees above the
/// horizontal; without one they come from all sides.
fn sample(scene: &Scene, candidate: usize, rng: &mut impl Rng) -> Proposal {
    let direction_in_base = loop {
        let direction = Vector3::from(UnitSphere.sample(rng));
        if scene.table_height_m.is_none() || direction.z < 0.17 {
            break direction;
        }
    };
    let direction = Unit::new_normalize(scene.base_from_object.inverse_transform_vector(&direction_in_base));
    let across = if direction.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
    let turn = UnitQuaternion::from_axis_angle(&direction, rng.random_range(0.0..std::f64::consts::TAU));
    Proposal::Settle {
        candidate,
        approach: Approach {
            direction_in_object: direction,
            opposition_in_object: turn * direction.cross(&across),
        },
        target_in_object: target(scene, rng),
    }
}

/// A point to grasp about: half way, on average, between the centre of mass and a random point of the surface, since
/// handles, necks and corners are graspable where the middle is too thick.
fn target(scene: &Scene, rng: &mut impl Rng) -> Point3<f64> {
    let vertices = scene.mesh.vertices();
    let somewhere = vertices[rng.random_range(0..vertices.len())];
    scene.center_of_mass + (somewhere - scene.center_of_mass) * rng.random_range(0.0..1.0)
}

fn refine(
    scene: &Scene,
    candidates: &[Candidate],
    settings: &SearchSettings,
    mut kept: Vec<Tried>,
    result: &mut SearchResult,
    progress: &dyn Fn(usize),
) {
    let epsilon = |t: &Tried| t.outcome.as_ref().map_or(0.0, |g| g.quality.epsilon_low);
    while result.attempts < settings.attempts && !kept.is_empty() {
        kept.sort_by(|a, b| epsilon(b).total_cmp(&epsilon(a)));
        kept.truncate(REFINED);
        let first = result.attempts;
        let proposals: Vec<Proposal> = (first..(first + BATCH).min(settings.attempts))
            .map(|index| {
                let mut rng = attempt_rng(settings.seed, index);
                let from = &kept[index % kept.len()];
                let about = from.outcome.as_ref().map_or(scene.center_of_mass, contact_middle);
                let site = perturbed(&from.site, &about, REFINE_SHIFT_M, REFINE_TURN_RAD, &mut rng);
                Proposal::At { candidate: from.candidate, site: Box::new(site) }
            })
            .collect();
        let tried = try_all(scene, candidates, &proposals);
        if record(result, &tried, settings, false, progress) {
            return;
        }
        kept.extend(tried.into_iter().filter(|t| t.outcome.is_ok()));
    }
}

/// Mean of the contact points, object frame.
fn contact_middle(grasp: &Grasp) -> Point3<f64> {
    let sum: Vector3<f64> = grasp.contacts.iter().map(|c| c.contact.point_in_object().coords).sum();
    Point3::from(sum / grasp.contacts.len().max(1) as f64)
}

/// Re-orders the best grasps by their mean epsilon over sampled pose errors, a lost closure counting as 0. The others
/// stay behind them in the order of their epsilon.
fn rank_by_robustness(scene: &Scene, candidates: &[Candidate], seed: u64, result: &mut SearchResult) {
    let count = result.grasps.len().min(ROBUST_GRASPS);
    let proposals: Vec<Proposal> = (0..count)
        .flat_map(|g| (0..ROBUST_SAMPLES).map(move |k| (g, k)))
        .map(|(g, k)| {
            let grasp = &result.grasps[g];
            // The same errors for every grasp, so that none is luckier than another.
            let mut rng = attempt_rng(seed ^ 0x524f_4255_5354, k);
            let about = contact_middle(grasp);
            let site = perturbed(&grasp.site, &about, POSE_ERROR_M, POSE_ERROR_RAD, &mut rng);
            Proposal::At { candidate: grasp.candidate, site: Box::new(site) }
        })
        .collect();
    let tried = try_all(scene, candidates, &proposals);
    for (grasp, samples) in result.grasps.iter_mut().zip(tried.chunks(ROBUST_SAMPLES)) {
        let sum: f64 = samples.iter().flat_map(|t| &t.outcome).map(|g| g.quality.epsilon_low).sum();
        grasp.expected_epsilon = Some(sum / ROBUST_SAMPLES as f64);
    }
    result.grasps[..count]
        .sort_by(|a, b| b.expected_epsilon.unwrap_or(0.0).total_cmp(&a.expected_epsilon.unwrap_or(0.0)));
}
