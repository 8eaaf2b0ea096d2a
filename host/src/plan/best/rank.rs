//! The order of the grasps: by what is left of them when pose, friction and shape are not quite as planned.

use nalgebra::{Point3, Unit, UnitQuaternion, Vector3};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;
use rayon::prelude::*;

use super::super::attempt::{AttemptScratch, Grasp, Robustness, quality_with_errors};
use super::super::scene::Scene;
use super::super::search::{SearchResult, attempt_rng, perturbed};
use super::contact_middle;

/// Samples of the errors for each grasp.
const SAMPLES: usize = 16;

/// Error of the object's pose against the hand that the ranking assumes (one standard deviation): arm, hand-eye
/// calibration and scan together leave about a millimetre, and the closing fingers push.
const POSE_ERROR_M: f64 = 0.002;
const POSE_ERROR_RAD: f64 = 0.03;

/// Relative error of the friction coefficient (one standard deviation), and how far it may go.
const FRICTION_ERROR: f64 = 0.15;
const FRICTION_CLIP: f64 = 0.4;

/// Error of the surface under a fingertip (one standard deviation): where it is, metres, and how it is turned, rad. The
/// second pair is for surface that nobody has seen.
const MEASURED_ERROR: [f64; 2] = [0.0005, 0.08];
const INVENTED_ERROR: [f64; 2] = [0.004, 0.30];

/// Joints nearer to a limit than this share of their range make a grasp worse: the squeeze has no way to go.
const MARGIN_WANTED: f64 = 0.05;

/// Two grasps of one candidate whose palms are nearer than this are one grasp for a reader who looks for choices.
const ALIKE_M: f64 = 0.015;
const ALIKE_RAD: f64 = 0.25;

/// An error of everything that a grasp depends on.
#[derive(Debug, Clone, Copy)]
pub(in super::super) struct Errors {
    /// Multiplies the friction coefficient.
    pub(in super::super) friction: f64,
    /// Unit numbers that the error of each contact's surface is made from: along the normal, and turned about two axes.
    pub(in super::super) surface: [[f64; 3]; 16],
}

/// Re-orders the best `count` grasps by their score; the others stay behind them in the order of their epsilon. Grasps
/// like a better one go behind those that are not.
pub(super) fn rank(scene: &Scene, count: usize, seed: u64, result: &mut SearchResult) {
    let mut ranked = std::mem::take(&mut result.grasps);
    let others = ranked.split_off(ranked.len().min(count));
    ranked.par_iter_mut().for_each_init(AttemptScratch::default, |scratch, grasp| {
        grasp.robustness = Some(robustness(scene, grasp, seed, scratch));
    });
    ranked.sort_by(|a, b| score(b).total_cmp(&score(a)));
    let (distinct, alike) = told_apart(ranked);
    result.grasps = distinct.into_iter().chain(alike).chain(others).collect();
}

pub(super) fn score(grasp: &Grasp) -> f64 {
    grasp.robustness.map_or(0.0, |robustness| robustness.score)
}

fn robustness(scene: &Scene, grasp: &Grasp, seed: u64, scratch: &mut AttemptScratch) -> Robustness {
    let candidate = &scene.hand.candidates[grasp.candidate];
    let about = contact_middle(grasp);
    let (mut closures, mut sum) = (0, 0.0);
    for sample in 0..SAMPLES {
        // The same errors for every grasp, so that none is luckier than another.
        let mut rng = attempt_rng(seed ^ 0x524f_4255_5354, sample);
        let site = perturbed(&grasp.site, &about, POSE_ERROR_M, POSE_ERROR_RAD, &mut rng);
        let errors = Errors::draw(&mut rng);
        if let Some(epsilon) = quality_with_errors(scene, candidate, &site, &errors, scratch) {
            closures += 1;
            sum += epsilon;
        }
    }
    let seen_share = scene.seen.as_ref().map_or(1.0, |seen| {
        let measured = grasp.contacts.iter().filter(|c| seen.is_seen(&c.contact.point_in_object())).count();
        measured as f64 / grasp.contacts.len().max(1) as f64
    });
    let limit_margin = scene.hand.limit_margin(&grasp.grasp, candidate.fingers());
    let closure_chance = f64::from(closures) / SAMPLES as f64;
    let expected_epsilon = sum / SAMPLES as f64;
    let cramped = 0.5 + 0.5 * (limit_margin / MARGIN_WANTED).clamp(0.0, 1.0);
    Robustness {
        closure_chance,
        expected_epsilon,
        limit_margin,
        seen_share,
        score: expected_epsilon * closure_chance * cramped,
    }
}

impl Errors {
    fn draw(rng: &mut impl Rng) -> Self {
        let mut normal = || rng.sample::<f64, _>(StandardNormal);
        let friction = 1.0 + (normal() * FRICTION_ERROR).clamp(-FRICTION_CLIP, FRICTION_CLIP);
        Self { friction, surface: std::array::from_fn(|_| std::array::from_fn(|_| normal())) }
    }

    /// A contact's point and inward normal as they may be in truth; contact number `index`, which the scene has `seen` or
    /// not.
    pub(in super::super) fn moved(
        &self,
        index: usize,
        point: &Point3<f64>,
        normal: &Unit<Vector3<f64>>,
        is_seen: bool,
    ) -> (Point3<f64>, Unit<Vector3<f64>>) {
        let [along_m, turn_rad] = if is_seen { MEASURED_ERROR } else { INVENTED_ERROR };
        let [a, b, c] = self.surface[index % self.surface.len()];
        let across = super::super::preshape::any_across(normal);
        let axis = across * b + normal.cross(&across) * c;
        let turn = UnitQuaternion::from_scaled_axis(axis * turn_rad);
        (point + normal.into_inner() * (a * along_m), Unit::new_normalize(turn * normal.into_inner()))
    }
}

/// The grasps that are like none before them, and the others, in their order.
fn told_apart(grasps: Vec<Grasp>) -> (Vec<Grasp>, Vec<Grasp>) {
    let (mut distinct, mut alike) = (Vec::<Grasp>::new(), Vec::new());
    for grasp in grasps {
        let pose = &grasp.site.object_from_palm;
        let is_alike = distinct.iter().any(|other| {
            let other_pose = &other.site.object_from_palm;
            other.candidate == grasp.candidate
                && (other_pose.translation.vector - pose.translation.vector).norm() < ALIKE_M
                && other_pose.rotation.angle_to(&pose.rotation) < ALIKE_RAD
        });
        if is_alike { alike.push(grasp) } else { distinct.push(grasp) }
    }
    (distinct, alike)
}
