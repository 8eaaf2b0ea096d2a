//! The default search: proposals where the body can be held, attempts spent where they pay, the best refined, ranked by
//! what survives errors of pose, friction and shape.
pub(super) mod rank;
mod refine;
mod uphill;

use nalgebra::{Point3, Vector3};
use rand::{Rng, RngExt};

use super::attempt::Grasp;
use super::paper::initial_proposals;
use super::preshape::tables;
use super::propose::variants;
use super::scene::Scene;
use super::search::{Proposal, SearchResult, SearchSettings, Tried, attempt_rng, record, try_all};

/// Share of the attempts that sample the whole object; the rest refines the best of them.
const SAMPLING_SHARE: f64 = 0.3;

/// Variants of each candidate, drawn anew for each search: preshape and spread as continuous variables.
const VARIANTS: usize = 3;

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
    let mut try_batch = |batch: &[Proposal], allotment: &mut Allotment, result: &mut SearchResult| {
        let tried = try_all(scene, &tables, batch);
        tried.iter().for_each(|t| allotment.learn(t));
        record(result, &tried, settings, false, progress);
        kept.extend(tried.into_iter().filter(|t| t.outcome.is_ok()));
        !kept.is_empty()
    };
    let mut is_found = false;
    for batch in first.chunks(BATCH) {
        is_found = try_batch(batch, &mut allotment, &mut result);
    }
    // Without a grasp there is nothing to refine: the sampling then goes on to the end.
    while result.attempts < settings.attempts
        && (result.attempts < sampled || !is_found)
        && !settings.stop.is_asked()
    {
        let first = result.attempts;
        let end = if is_found { sampled } else { settings.attempts };
        let proposals: Vec<Proposal> = (first..(first + BATCH).min(end))
            .map(|index| {
                let mut rng = attempt_rng(settings.seed, index);
                let table = allotment.draw(&mut rng);
                Proposal::Sampled { candidate: table, rng: Box::new(rng) }
            })
            .collect();
        is_found = try_batch(&proposals, &mut allotment, &mut result);
    }
    refine::refine(scene, &tables, settings, kept, &mut result, progress);
    result.rank();
    if settings.stop.is_asked() {
        return result;
    }
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

/// Mean of the contact points, object frame.
fn contact_middle(grasp: &Grasp) -> Point3<f64> {
    let sum: Vector3<f64> = grasp.contacts.iter().map(|c| c.contact.point_in_object().coords).sum();
    Point3::from(sum / grasp.contacts.len().max(1) as f64)
}
