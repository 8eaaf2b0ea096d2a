//! The second part of the search: motions about the best grasps, smaller and smaller, at random and the way epsilon rises.

use nalgebra::{Point3, UnitQuaternion};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;
use rayon::prelude::*;

use super::super::preshape::PreshapeTable;
use super::super::scene::Scene;
use super::super::search::{
    Proposal, SearchResult, SearchSettings, Tried, attempt_rng, moved, perturbed, record, try_all,
};
use super::super::settle::Site;
use super::uphill::{Motion, Scale, UphillScratch, uphill};
use super::{BATCH, contact_middle, epsilon};
use crate::hand::Posture;

/// Grasps of each candidate that the refinement works on at its beginning, so that none is given up for a bad start, and
/// of all candidates together in its last third.
const REFINED_EACH: usize = 6;
const REFINED_LAST: usize = 12;

/// One standard deviation of a random motion at the beginning, small against a fingertip, and how much smaller it has
/// become at the end.
pub(super) const MOTION: Scale = Scale { shift_m: 0.006, turn_rad: 0.15, spread: 0.08 };
const SHRINKS_TO: f64 = 0.22;

/// Share of the motions that follow the slope of epsilon where there is one.
const UPHILL_SHARE: f64 = 0.5;

/// What such a motion has of a random one besides: on an edge of epsilon the slope alone leads nowhere.
const UPHILL_NOISE: f64 = 0.3;

/// A grasp that the refinement works on.
struct Kept {
    tried: Tried,
    /// Mean of its contacts, object frame.
    middle: Point3<f64>,
    /// The motion on which its epsilon rises; `None` inside when there is none, outside before it was asked for.
    uphill: Option<Option<Motion>>,
}

impl Kept {
    fn new(scene: &Scene, tried: Tried) -> Self {
        let middle = tried.outcome.as_ref().map_or(scene.center_of_mass, contact_middle);
        Self { tried, middle, uphill: None }
    }

    fn find_uphill(&mut self, scene: &Scene, scratch: &mut UphillScratch) {
        if self.uphill.is_none() {
            let grasp = self.tried.outcome.as_ref().ok();
            self.uphill = Some(grasp.and_then(|grasp| uphill(scene, grasp, &self.middle, &MOTION, scratch)));
        }
    }
}

/// Spends what is left of the attempts on motions about the best of `kept`.
pub(super) fn refine(
    scene: &Scene,
    tables: &[PreshapeTable],
    settings: &SearchSettings,
    kept: Vec<Tried>,
    result: &mut SearchResult,
    progress: &dyn Fn(usize),
) {
    let begin = result.attempts;
    let mut kept: Vec<Kept> = kept.into_iter().map(|tried| Kept::new(scene, tried)).collect();
    while result.attempts < settings.attempts && !kept.is_empty() && !settings.stop.is_asked() {
        kept.sort_by(|a, b| epsilon(&b.tried).total_cmp(&epsilon(&a.tried)));
        if 3 * (result.attempts - begin) < 2 * (settings.attempts - begin) {
            let mut of_candidate = vec![0; scene.hand.candidates.len()];
            kept.retain(|one| {
                let count = &mut of_candidate[tables[one.tried.candidate].typical()];
                *count += 1;
                *count <= REFINED_EACH
            });
        } else {
            kept.truncate(REFINED_LAST);
        }
        kept.par_iter_mut()
            .for_each_init(UphillScratch::default, |scratch, one| one.find_uphill(scene, scratch));
        let first = result.attempts;
        let proposals: Vec<Proposal> = (first..(first + BATCH).min(settings.attempts))
            .map(|index| {
                let mut rng = attempt_rng(settings.seed, index);
                let done = (index - begin) as f64 / (settings.attempts - begin) as f64;
                // The best more often than the last: the square of an even number.
                let place = rng.random_range(0.0..1.0_f64).powi(2) * kept.len() as f64;
                let from = &kept[(place as usize).min(kept.len() - 1)];
                let site = from.varied(scene, SHRINKS_TO.powf(done), &mut rng);
                Proposal::At { candidate: from.tried.candidate, site: Box::new(site) }
            })
            .collect();
        let tried = try_all(scene, tables, &proposals);
        record(result, &tried, settings, false, progress);
        kept.extend(tried.into_iter().filter(|t| t.outcome.is_ok()).map(|tried| Kept::new(scene, tried)));
    }
}

impl Kept {
    /// The site moved a little, its fingers spread a little otherwise; `size` of [`MOTION`].
    fn varied(&self, scene: &Scene, size: f64, rng: &mut impl Rng) -> Site {
        let mut site = self.tried.site;
        let (mut noise, mut spread_rad) = (size, Posture::ZERO);
        if rng.random_range(0.0..1.0) < UPHILL_SHARE
            && let Some(motion) = self.uphill.as_ref().and_then(Option::as_ref)
        {
            // As long as a random motion is along one of its axes.
            let steps = size * rng.sample::<f64, _>(StandardNormal).abs();
            let turn = UnitQuaternion::from_scaled_axis(motion.turn_rad * steps);
            site = moved(&site, &self.middle, &(motion.shift_m * steps), turn);
            spread_rad = motion.spread_rad * steps;
            noise *= UPHILL_NOISE;
        }
        let mut site = perturbed(&site, &self.middle, noise * MOTION.shift_m, noise * MOTION.turn_rad, rng);
        for (i, joint) in scene.hand.joints.iter().enumerate() {
            if joint.flexes.is_none() {
                let preshape = &mut site.preshape;
                // A finger's path has to stay inside the limits from end to end.
                let finger = scene.hand.fingers.iter().position(|f| f.joints().contains(&i)).unwrap_or(0);
                let ends = [preshape.u_begin[finger], preshape.u_end[finger]].map(|u| u * preshape.rate[i]);
                let lowest = joint.lower_rad - ends[0].min(ends[1]);
                let highest = joint.upper_rad - ends[0].max(ends[1]);
                let deviation_rad = noise * MOTION.of_joint(joint);
                let by_rad = spread_rad[i] + rng.sample::<f64, _>(StandardNormal) * deviation_rad;
                preshape.start[i] = (preshape.start[i] + by_rad).min(highest).max(lowest);
            }
        }
        site
    }
}
