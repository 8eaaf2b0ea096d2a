//! The default search: proposals where the body can be held, attempts spent where they pay, the best refined, ranked by
//! what survives errors of pose, friction and shape.
pub(super) mod rank;

use nalgebra::{Point3, Vector3};
use rand::{Rng, RngExt};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::attempt::Grasp;
use super::paper::initial_proposals;
use super::preshape::{PreshapeTable, tables};
use super::propose::variants;
use super::scene::Scene;
use super::search::{Proposal, SearchResult, SearchSettings, Tried, attempt_rng, perturbed, record, try_all};
use super::settle::Site;

/// Share of the attempts that sample the whole object; the rest refines the best of them.
const SAMPLING_SHARE: f64 = 0.3;

/// Variants of each candidate, drawn anew for each search: preshape and spread as continuous variables.
const VARIANTS: usize = 3;

/// Grasps of each candidate that the refinement works on at its beginning, so that none is given up for a bad start, and
/// of all candidates together in its last third.
const REFINED_EACH: usize = 6;
const REFINED_LAST: usize = 12;

/// Shift in metres and rotation in radians of a refinement (one standard deviation) at its beginning, small against a
/// fingertip, and what they have shrunk to at its end.
const REFINE_SHIFT_M: [f64; 2] = [0.006, 0.0015];
const REFINE_TURN_RAD: [f64; 2] = [0.15, 0.03];

/// The same for joints that spread or turn a finger, as a share of their range.
const REFINE_SPREAD: [f64; 2] = [0.08, 0.02];

/// Grasps whose robustness is measured, at least.
const RANKED: usize = 128;

/// Proposals tried between two reports of progress.
const BATCH: usize = 64;

/// Runs the search. `progress` is told the number of attempts so far.
#[must_use]
pub fn search(scene: &Scene, settings: &SearchSettings, progress: &dyn Fn(usize)) -> SearchResult {
    let mut tables = tables(&scene.hand);
    tables.extend(variants(scene, VARIANTS, &mut attempt_rng(settings.seed, usize::MAX - 1)));
    let mut result = SearchResult::empty();
    if tables.is_empty() {
        return result;
    }
    let sampled = (settings.attempts as f64 * SAMPLING_SHARE).ceil() as usize;
    let mut allotment = Allotment::new(tables.len());
    let mut kept: Vec<Tried> = Vec::new();
    // What a person would try first costs little, and on plain bodies nothing is better.
    let first: Vec<Proposal> =
        initial_proposals(scene).into_iter().flatten().take(settings.attempts).collect();
    for batch in first.chunks(BATCH) {
        let tried = try_all(scene, &tables, batch);
        tried.iter().for_each(|t| allotment.learn(t));
        record(&mut result, &tried, settings, false, progress);
        kept.extend(tried.into_iter().filter(|t| t.outcome.is_ok()));
    }
    // Without a grasp there is nothing to refine: the sampling then goes on to the end.
    while result.attempts < settings.attempts && (result.attempts < sampled || kept.is_empty()) {
        let first = result.attempts;
        let end = if kept.is_empty() { settings.attempts } else { sampled };
        let proposals: Vec<Proposal> = (first..(first + BATCH).min(end))
            .map(|index| {
                let mut rng = attempt_rng(settings.seed, index);
                let table = allotment.draw(&mut rng);
                Proposal::Sampled { candidate: table, rng: Box::new(rng) }
            })
            .collect();
        let tried = try_all(scene, &tables, &proposals);
        tried.iter().for_each(|t| allotment.learn(t));
        let stop = record(&mut result, &tried, settings, false, progress);
        kept.extend(tried.into_iter().filter(|t| t.outcome.is_ok()));
        if stop {
            break;
        }
    }
    refine(scene, &tables, settings, &mut kept, &mut result, progress);
    result.rank();
    rank::rank(scene, RANKED.max(settings.ranked), settings.seed, &mut result);
    result
}

/// How many attempts each candidate is given: in proportion to the epsilon that its attempts have brought so far, and never
/// none.
struct Allotment {
    /// Attempts, and the sum of their epsilons.
    of_table: Vec<(f64, f64)>,
}

impl Allotment {
    /// Attempts as if made before, and what each brought: a new table is worth an average one.
    const BEFORE: (f64, f64) = (4.0, 0.2);

    fn new(tables: usize) -> Self {
        Self { of_table: vec![Self::BEFORE; tables] }
    }

    fn draw(&self, rng: &mut impl Rng) -> usize {
        let worth = |(attempts, sum): &(f64, f64)| sum / attempts + 0.005;
        let total: f64 = self.of_table.iter().map(worth).sum();
        let mut place = rng.random_range(0.0..total);
        self.of_table
            .iter()
            .position(|table| {
                place -= worth(table);
                place < 0.0
            })
            .unwrap_or(0)
    }

    fn learn(&mut self, tried: &Tried) {
        let (attempts, sum) = &mut self.of_table[tried.candidate];
        *attempts += 1.0;
        *sum += epsilon(tried);
    }
}

fn epsilon(tried: &Tried) -> f64 {
    tried.outcome.as_ref().map_or(0.0, |grasp| grasp.quality.epsilon_low)
}

/// Small random motions of palm and spread about the best grasps, smaller and smaller.
fn refine(
    scene: &Scene,
    tables: &[PreshapeTable],
    settings: &SearchSettings,
    kept: &mut Vec<Tried>,
    result: &mut SearchResult,
    progress: &dyn Fn(usize),
) {
    let begin = result.attempts;
    while result.attempts < settings.attempts && !kept.is_empty() {
        kept.sort_by(|a, b| epsilon(b).total_cmp(&epsilon(a)));
        if 3 * (result.attempts - begin) < 2 * (settings.attempts - begin) {
            let mut of_candidate = vec![0; scene.hand.candidates.len()];
            kept.retain(|t| {
                let count = &mut of_candidate[tables[t.candidate].typical()];
                *count += 1;
                *count <= REFINED_EACH
            });
        } else {
            kept.truncate(REFINED_LAST);
        }
        let first = result.attempts;
        let proposals: Vec<Proposal> = (first..(first + BATCH).min(settings.attempts))
            .map(|index| {
                let mut rng = attempt_rng(settings.seed, index);
                let done = (index - begin) as f64 / (settings.attempts - begin) as f64;
                // The best more often than the last: the square of an even number.
                let place = rng.random_range(0.0..1.0_f64).powi(2) * kept.len() as f64;
                let from = &kept[(place as usize).min(kept.len() - 1)];
                let about = from.outcome.as_ref().map_or(scene.center_of_mass, contact_middle);
                let site = varied(scene, &from.site, &about, done, &mut rng);
                Proposal::At { candidate: from.candidate, site: Box::new(site) }
            })
            .collect();
        let tried = try_all(scene, tables, &proposals);
        if record(result, &tried, settings, false, progress) {
            return;
        }
        kept.extend(tried.into_iter().filter(|t| t.outcome.is_ok()));
    }
}

/// A site moved a little, its fingers spread a little otherwise; `done` is the share of the refinement behind it.
fn varied(scene: &Scene, site: &Site, about: &Point3<f64>, done: f64, rng: &mut ChaCha8Rng) -> Site {
    let now = |[from, to]: [f64; 2]| from * (to / from).powf(done);
    let mut varied = perturbed(site, about, now(REFINE_SHIFT_M), now(REFINE_TURN_RAD), rng);
    for (i, joint) in scene.hand.joints.iter().enumerate() {
        if joint.flexes.is_none() {
            let preshape = &mut varied.preshape;
            // A finger's path has to stay inside the limits from end to end.
            let finger = scene.hand.fingers.iter().position(|f| f.joints().contains(&i)).unwrap_or(0);
            let ends = [preshape.u_begin[finger], preshape.u_end[finger]].map(|u| u * preshape.rate[i]);
            let lowest = joint.lower_rad - ends[0].min(ends[1]);
            let highest = joint.upper_rad - ends[0].max(ends[1]);
            let by = rng.sample::<f64, _>(StandardNormal)
                * now(REFINE_SPREAD)
                * (joint.upper_rad - joint.lower_rad);
            preshape.start[i] = (preshape.start[i] + by).min(highest).max(lowest);
        }
    }
    varied
}

/// Mean of the contact points, object frame.
fn contact_middle(grasp: &Grasp) -> Point3<f64> {
    let sum: Vector3<f64> = grasp.contacts.iter().map(|c| c.contact.point_in_object().coords).sum();
    Point3::from(sum / grasp.contacts.len().max(1) as f64)
}
