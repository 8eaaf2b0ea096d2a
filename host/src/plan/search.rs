//! What both strategies share: proposals tried on all cores in an order that does not depend on the threads.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use nalgebra::{Isometry3, Point3, Translation3, Unit, UnitQuaternion, Vector3};
use rand::{Rng, RngExt};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::StandardNormal;
use rayon::prelude::*;

use super::attempt::{AttemptScratch, Grasp, Rejection, attempt};
use super::preshape::PreshapeTable;
use super::propose::propose;
use super::scene::Scene;
use super::settle::{Approach, Site, settle};

/// Settings of a search, for both strategies.
#[derive(Debug, Clone, PartialEq)]
pub struct SearchSettings {
    /// Most attempts; the paper's default is 300.
    pub attempts: usize,
    /// The paper's strategy stops at the first grasp of at least this epsilon (its default: 0.2).
    pub threshold: f64,
    /// Seed of every random choice.
    pub seed: u64,
    /// How many grasps are wanted in the order of their robustness, at least.
    pub ranked: usize,
    /// Ends the search before its time; what it has found until then is no result to rely on.
    pub stop: Stop,
}

/// A wish to end a search, which another thread may utter. Clones utter and hear the same one.
#[derive(Debug, Clone, Default)]
pub struct Stop(Arc<AtomicBool>);

impl Stop {
    /// Asks for the end.
    pub fn ask(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether somebody asked.
    #[must_use]
    pub fn is_asked(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

impl PartialEq for Stop {
    /// Whether both are asked or neither is.
    fn eq(&self, other: &Self) -> bool {
        self.is_asked() == other.is_asked()
    }
}

impl Default for SearchSettings {
    fn default() -> Self {
        Self { attempts: 300, threshold: 0.2, seed: 1, ranked: 10, stop: Stop::default() }
    }
}

/// What a search found. Grasps are in the scene's object frame.
#[derive(Debug, Clone)]
pub struct SearchResult {
    /// Attempts made.
    pub attempts: usize,
    /// Force-closure grasps, best first.
    pub grasps: Vec<Grasp>,
    /// Attempts by reason of rejection, in the order of [`Rejection::ALL`].
    pub rejected: [usize; Rejection::ALL.len()],
    /// Attempts until the first grasp at or above the threshold, if there was one.
    pub attempts_to_threshold: Option<usize>,
}

impl SearchResult {
    /// Nothing tried yet.
    #[must_use]
    pub fn empty() -> Self {
        Self {
            attempts: 0,
            grasps: Vec::new(),
            rejected: [0; Rejection::ALL.len()],
            attempts_to_threshold: None,
        }
    }

    fn record(&mut self, outcome: Result<Grasp, Rejection>, threshold: f64) {
        self.attempts += 1;
        match outcome {
            Ok(grasp) => {
                if grasp.quality.epsilon_low >= threshold && self.attempts_to_threshold.is_none() {
                    self.attempts_to_threshold = Some(self.attempts);
                }
                self.grasps.push(grasp);
            }
            Err(reason) => {
                if let Some(slot) = Rejection::ALL.iter().position(|r| *r == reason) {
                    self.rejected[slot] += 1;
                }
            }
        }
    }

    /// Best first; equal ones stay in the order in which they were found.
    pub fn rank(&mut self) {
        self.grasps.sort_by(|a, b| b.quality.epsilon_low.total_cmp(&a.quality.epsilon_low));
    }
}

/// A placed hand to be tried, or an approach whose place is still to be settled.
#[derive(Debug, Clone)]
pub enum Proposal {
    /// Settle first, over this point of the object.
    Settle {
        /// Index of the candidate's preshapes.
        candidate: usize,
        /// From where.
        approach: Approach,
        /// The point that the contacts are to lie around, object frame.
        target_in_object: Point3<f64>,
        /// Thickness between the fingers, metres, where it is known.
        width_m: Option<f64>,
    },
    /// Draw a site where the body can be held.
    Sampled {
        /// Index of the candidate's preshapes.
        candidate: usize,
        /// Makes the choice. Boxed: it is as large as an approach three times.
        rng: Box<ChaCha8Rng>,
    },
    /// Try just here.
    At {
        /// Index of the candidate's preshapes.
        candidate: usize,
        /// Where. Boxed: it is ten times the size of an approach.
        site: Box<Site>,
    },
}

/// What became of a proposal: the site as tried, object frame, after settling if that was asked for.
#[derive(Debug, Clone)]
pub struct Tried {
    /// Index of the candidate's preshapes.
    pub candidate: usize,
    /// Where the hand stood.
    pub site: Site,
    /// Grasp or reason.
    pub outcome: Result<Grasp, Rejection>,
}

/// Tries proposals on all cores. The results are in the order of the proposals whatever the number of threads.
#[must_use]
pub fn try_all(scene: &Scene, tables: &[PreshapeTable], proposals: &[Proposal]) -> Vec<Tried> {
    proposals
        .par_iter()
        .map_init(AttemptScratch::default, |scratch, proposal| {
            let (index, site) = match proposal {
                Proposal::Settle { candidate, approach, target_in_object, width_m } => {
                    let table = &tables[*candidate];
                    (*candidate, settle(scene, table, approach, target_in_object, *width_m))
                }
                Proposal::Sampled { candidate, rng } => {
                    (*candidate, propose(scene, &tables[*candidate], &mut ChaCha8Rng::clone(rng)))
                }
                Proposal::At { candidate, site } => (*candidate, **site),
            };
            let outcome = attempt(scene, tables[index].typical(), tables[index].candidate(), &site, scratch);
            Tried { candidate: index, site, outcome }
        })
        .collect()
}

/// Adds the outcomes to `result` in order and calls `progress` with the number of attempts so far. With
/// `stop_at_threshold`, everything behind the first grasp above the threshold is as if it had not been tried, so that
/// the batch's size cannot be seen in the result. Returns whether to stop, which [`SearchSettings::stop`] also asks for.
pub fn record(
    result: &mut SearchResult,
    tried: &[Tried],
    settings: &SearchSettings,
    stop_at_threshold: bool,
    progress: &dyn Fn(usize),
) -> bool {
    for one in tried {
        result.record(one.outcome.clone(), settings.threshold);
        if result.attempts >= settings.attempts || stop_at_threshold && result.attempts_to_threshold.is_some()
        {
            progress(result.attempts);
            return true;
        }
    }
    progress(result.attempts);
    settings.stop.is_asked()
}

/// The generator of attempt number `index`: its numbers depend on nothing but the seed and the index.
#[must_use]
pub fn attempt_rng(seed: u64, index: usize) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(index as u64 + 1);
    rng
}

/// A site turned and shifted a little about the contacts' middle: normally distributed with the given deviations.
#[must_use]
pub fn perturbed(
    site: &Site,
    about_in_object: &Point3<f64>,
    shift_m: f64,
    turn_rad: f64,
    rng: &mut impl Rng,
) -> Site {
    let mut normal = || rng.sample::<f64, _>(StandardNormal);
    let shift = Vector3::new(normal(), normal(), normal()) * shift_m;
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(normal(), normal(), normal()) * turn_rad);
    moved(site, about_in_object, &shift, turn)
}

/// A site turned by a rotation about a point, and shifted.
#[must_use]
pub fn moved(
    site: &Site,
    about_in_object: &Point3<f64>,
    shift_m: &Vector3<f64>,
    turn: UnitQuaternion<f64>,
) -> Site {
    let about = Translation3::from(about_in_object.coords);
    let motion = Translation3::from(*shift_m)
        * about
        * Isometry3::from_parts(Translation3::identity(), turn)
        * about.inverse();
    Site {
        object_from_palm: motion * site.object_from_palm,
        direction_in_object: Unit::new_normalize(turn * site.direction_in_object.into_inner()),
        preshape: site.preshape,
    }
}
