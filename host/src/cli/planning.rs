//! From a scene to a plan document: search, arm's way, grip. Shared by `plan` and `demo`.

use std::collections::BTreeMap;
use std::io::Write;
use std::time::Instant;

use nalgebra::Vector3;
use protocol::ids::FINGER_COUNT;
use rayon::prelude::*;

use super::plan::Strategy;
use crate::exec::{
    GripContact, GripStiffness, LEAST_TIP_SHARE, LinkPush, balanced_forces, joint_squeeze_targets,
    squeeze_targets, torque_share,
};
use crate::grasp::Convention;
use crate::hand::{Hand, Posture, hit_dlr};
use crate::object::Object;
use crate::plan::arm::{GRAVITY_M_PER_S2, Joints};
use crate::plan::attempt::{Grasp, GraspContact, Rejection, palm_sites};
use crate::plan::document::{
    ContactInfo, FORMAT, FingerKnotInfo, FingerMotionInfo, GraspInfo, HandInfo, ObjectInfo, PlanDocument,
    QualityInfo, SettingsInfo, VERSION, array, frames, mesh_hash, posture,
};
use crate::plan::finger_motion::touch_together;
use crate::plan::motion::{MotionError, MotionRequest, arm_motion};
use crate::plan::scene::Scene;
use crate::plan::search::{SearchResult, SearchSettings};
use crate::plan::{best, paper};

/// Share of the friction coefficient that the squeeze itself may use; the rest is left for weight and disturbances.
const SQUEEZE_CONE_SHARE: f64 = 0.5;

/// Safety on the grip that holds the weight by friction alone.
const GRIP_SAFETY: f64 = 3.0;

/// Least and greatest mean normal force of a finger in the squeeze, newtons: below one the sensors' noise counts, and
/// the tips give 10 continuously.
const FINGER_FORCE_N: [f64; 2] = [1.5, 6.0];

/// Reasons against the arm's way that are told, the most frequent ones.
const REASONS_TOLD: usize = 3;

/// A search to be made.
pub(super) struct Planner<'a> {
    pub(super) scene: &'a Scene,
    pub(super) object: &'a Object,
    pub(super) strategy: Strategy,
    pub(super) settings: &'a SearchSettings,
    /// Where the arm starts; `None` is its rest posture.
    pub(super) start_rad: Option<Joints>,
}

/// A plan and what it took.
pub(super) struct Planned {
    pub(super) document: PlanDocument,
    /// The grasps of the document, in its order.
    pub(super) grasps: Vec<Grasp>,
    pub(super) search_s: f64,
    attempts_to_threshold: Option<usize>,
    threshold: f64,
    /// Why the arm could not make grasps, with how many, in words.
    no_arm_motion: BTreeMap<String, usize>,
}

/// Why a grasp is not written.
enum Unwritten {
    NoArmMotion(MotionError),
    NoBalancedGrip,
}

impl Unwritten {
    /// Key in the plan document.
    fn name(&self) -> &'static str {
        match self {
            Self::NoArmMotion(_) => "no-arm-motion",
            Self::NoBalancedGrip => "no-balanced-grip",
        }
    }
}

impl Planner<'_> {
    /// Searches and writes at most `top` grasps that the arm can also make.
    pub(super) fn plan(&self, top: usize, progress: &dyn Fn(usize)) -> Planned {
        let start = Instant::now();
        let result = match self.strategy {
            Strategy::Paper => paper::search(self.scene, self.settings, progress),
            Strategy::Best => best::search(self.scene, self.settings, progress),
        };
        let search_s = start.elapsed().as_secs_f64();
        let mut rejected: BTreeMap<String, usize> = Rejection::ALL
            .iter()
            .zip(result.rejected)
            .filter(|&(_, count)| count > 0)
            .map(|(reason, count)| (reason.name().to_owned(), count))
            .collect();
        let (mut infos, mut grasps) = (Vec::new(), Vec::new());
        let mut no_arm_motion: BTreeMap<String, usize> = BTreeMap::new();
        let mut left = result.grasps.as_slice();
        // As many at a time as may still be written: the outcome is that of one after the other.
        while infos.len() < top && !left.is_empty() && !self.settings.stop.is_asked() {
            let (now, later) = left.split_at(left.len().min(top - infos.len()));
            left = later;
            let outcomes: Vec<_> = now.par_iter().map(|grasp| self.grasp_info(grasp)).collect();
            for (grasp, outcome) in now.iter().zip(outcomes) {
                match outcome {
                    Ok(info) => {
                        infos.push(info);
                        grasps.push(grasp.clone());
                    }
                    Err(reason) => {
                        *rejected.entry(reason.name().to_owned()).or_default() += 1;
                        if let Unwritten::NoArmMotion(error) = reason {
                            *no_arm_motion.entry(error.to_string()).or_default() += 1;
                        }
                    }
                }
            }
        }
        Planned {
            document: self.document(&result, rejected, infos),
            grasps,
            search_s,
            attempts_to_threshold: result.attempts_to_threshold,
            threshold: self.settings.threshold,
            no_arm_motion,
        }
    }

    fn document(
        &self,
        result: &SearchResult,
        rejected: BTreeMap<String, usize>,
        grasps: Vec<GraspInfo>,
    ) -> PlanDocument {
        let scene = self.scene;
        PlanDocument {
            format: FORMAT.to_owned(),
            version: VERSION,
            frames: frames(),
            hand: HandInfo { name: scene.hand.name.clone(), sha256: scene.hand.sha256.clone() },
            arm: scene.arm.as_ref().map(|arm| arm.params().name.clone()),
            object: ObjectInfo {
                source: self.object.name.clone(),
                mesh_sha256: mesh_hash(&scene.mesh),
                triangles: scene.mesh.faces().len(),
                watertight: scene.mesh.is_watertight(),
                base_from_object: (&scene.base_from_object).into(),
                center_of_mass: array(&scene.center_of_mass),
                torque_scale_m: scene.wrench_reference.torque_scale_m(),
                mass_kg: self.object.mass_kg,
                friction: scene.friction,
            },
            table_height_m: scene.table_height_m,
            settings: SettingsInfo {
                strategy: self.strategy.name().to_owned(),
                attempts: self.settings.attempts,
                threshold: self.settings.threshold,
                seed: self.settings.seed,
            },
            convention: Convention::of(&scene.quality, &scene.wrench_reference).to_string(),
            attempts: result.attempts,
            force_closure: result.grasps.len(),
            rejected,
            grasps,
        }
    }

    /// Adds the ways of arm and fingers and the squeeze.
    fn grasp_info(&self, grasp: &Grasp) -> Result<GraspInfo, Unwritten> {
        let scene = self.scene;
        let arm_motion = match &scene.arm {
            Some(arm) => {
                let request = MotionRequest {
                    site: &grasp.site,
                    open: &grasp.pregrasp,
                    closed: &grasp.grasp,
                    object_kg: self.object.mass_kg,
                    start_rad: self.start_rad.unwrap_or(arm.params().rest_rad),
                    seed: self.settings.seed,
                };
                Some(arm_motion(scene, arm, &request).map_err(Unwritten::NoArmMotion)?)
            }
            None => None,
        };
        let (squeeze, forces) = self.squeeze(grasp).ok_or(Unwritten::NoBalancedGrip)?;
        let [approach, site, lift] = palm_sites(scene, &grasp.site);
        let quality = &grasp.quality;
        let contacts = grasp.contacts.iter().zip(&forces).map(|(touch, force)| ContactInfo {
            finger: touch.finger_name(&scene.hand).to_owned(),
            link: touch.link_name(&scene.hand).to_owned(),
            point: array(&touch.contact.point_in_object()),
            normal: touch.contact.inward_normal_in_object().into_inner().into(),
            friction: touch.contact.friction(),
            torsional_m: touch.contact.torsional_m(),
            squeeze_force_n: (*force).into(),
        });
        Ok(GraspInfo {
            candidate: scene.hand.candidates[grasp.candidate].name.clone(),
            quality: QualityInfo {
                epsilon: quality.epsilon(),
                epsilon_low: quality.epsilon_low,
                epsilon_high: quality.epsilon_high,
                expected_epsilon: grasp.robustness.map(|r| r.expected_epsilon),
                closure_chance: grasp.robustness.map(|r| r.closure_chance),
                limit_margin: grasp.robustness.map(|r| r.limit_margin),
                seen_share: grasp.robustness.map(|r| r.seen_share),
            },
            object_from_palm: (&grasp.site.object_from_palm).into(),
            approach_site: (&approach).into(),
            grasp_site: (&site).into(),
            lift_site: (&lift).into(),
            pregrasp: posture(&scene.hand, &grasp.pregrasp),
            grasp: posture(&scene.hand, &grasp.grasp),
            squeeze: posture(&scene.hand, &squeeze),
            finger_motion: finger_motion(&scene.hand, &grasp.pregrasp, &grasp.grasp),
            contacts: contacts.collect(),
            arm_motion,
        })
    }

    /// Joint targets that press, and the forces on the object in its frame.
    fn squeeze(&self, grasp: &Grasp) -> Option<(Posture, Vec<Vector3<f64>>)> {
        let scene = self.scene;
        let contacts: Vec<GripContact> = grasp
            .contacts
            .iter()
            .map(|touch| GripContact {
                point: touch.contact.point_in_object(),
                inward_normal: touch.contact.inward_normal_in_object(),
                friction: touch.contact.friction(),
            })
            .collect();
        // The weight hangs on friction: the sum of normal forces times the least coefficient carries it.
        let least_friction = contacts.iter().map(|c| c.friction).fold(f64::INFINITY, f64::min);
        let carrying_n = self.object.mass_kg * GRAVITY_M_PER_S2 / least_friction.max(0.05);
        let [least_n, most_n] = FINGER_FORCE_N.map(|n| n * contacts.len() as f64);
        let grip_n = (GRIP_SAFETY * carrying_n).clamp(least_n, most_n);
        let is_precise = !scene.hand.candidates[grasp.candidate].wraps;
        let least_share = if is_precise { LEAST_TIP_SHARE } else { 0.0 };
        let mut forces = [SQUEEZE_CONE_SHARE, 1.0]
            .into_iter()
            .find_map(|cone_share| balanced_forces(&contacts, cone_share, grip_n, least_share).ok())?;
        let palm_from_object = grasp.site.object_from_palm.inverse();
        let push = |(touch, force): (&GraspContact, &Vector3<f64>)| {
            let finger = touch.finger?;
            Some(LinkPush {
                finger,
                segment: scene.hand.fingers[finger].beads()[touch.bead].segment,
                point_in_palm: palm_from_object * touch.contact.point_in_object(),
                force_in_palm: palm_from_object.rotation * force,
            })
        };
        let mut pushes: Vec<LinkPush> = grasp.contacts.iter().zip(&forces).filter_map(push).collect();
        // Forces that balance do so at any size: what is too much for a drive or a fingertip is less for all.
        let tips = scene.hand.model.as_ref().filter(|_| is_precise);
        let tip_max_n = tips.map_or(f64::INFINITY, |model| model.drive.tip_force_max_n);
        let strongest_n = pushes.iter().map(|push| push.force_in_palm.norm()).fold(0.0, f64::max);
        let share = torque_share(&scene.hand, &grasp.grasp, &pushes).max(strongest_n / tip_max_n);
        if share > 1.0 {
            if grip_n / share < grip_n.min(carrying_n) {
                return None;
            }
            forces.iter_mut().for_each(|force| *force /= share);
            pushes.iter_mut().for_each(|push| push.force_in_palm /= share);
        }
        let squeeze = match &scene.hand.model {
            // The firmware's thumb presses by Cartesian impedance.
            Some(model) if is_precise => {
                let mut in_palm = [None; FINGER_COUNT];
                for push in &pushes {
                    if let Some(slot) = in_palm.get_mut(push.finger) {
                        *slot = Some(push.force_in_palm);
                    }
                }
                let angles = hit_dlr::angles(&grasp.grasp);
                hit_dlr::posture(&squeeze_targets(model, &angles, &in_palm, &GripStiffness::default()))
            }
            _ => joint_squeeze_targets(&scene.hand, &grasp.grasp, &pushes),
        };
        Some((squeeze, forces))
    }
}

/// From open to touching, all fingers arriving together; `None` for a hand without speeds.
fn finger_motion(hand: &Hand, open: &Posture, closed: &Posture) -> Option<FingerMotionInfo> {
    let count = hand.joints.len();
    let speeds: Vec<f64> = hand.joints.iter().map(|joint| joint.speed_max_rad_per_s).collect();
    let motion = touch_together(&open.0[..count], &closed.0[..count], &speeds).ok()?;
    let named = |values: &[f64]| {
        hand.joints.iter().zip(values).map(|(joint, &value)| (joint.name.clone(), value)).collect()
    };
    let knots = motion.knots.iter().map(|knot| FingerKnotInfo {
        t_s: knot.t_s,
        q_rad: named(&knot.q_rad),
        qd_rad_per_s: named(&knot.qd_rad_per_s),
    });
    Some(FingerMotionInfo { contact_s: motion.contact_s, knots: knots.collect() })
}

impl Planned {
    /// What was found, in lines for people.
    pub(super) fn describe(&self, out: &mut dyn Write) -> std::io::Result<()> {
        let document = &self.document;
        writeln!(
            out,
            "planned in {:.2} s ({}): {} attempt(s), {} with force closure",
            self.search_s, document.settings.strategy, document.attempts, document.force_closure
        )?;
        if let Some(attempt) = self.attempts_to_threshold {
            writeln!(out, "epsilon passed {} at attempt {attempt}", self.threshold)?;
        }
        if !document.rejected.is_empty() {
            let reasons: Vec<String> =
                document.rejected.iter().map(|(reason, count)| format!("{reason} {count}")).collect();
            writeln!(out, "rejected: {}", reasons.join(", "))?;
        }
        if !self.no_arm_motion.is_empty() {
            let mut reasons: Vec<(&String, &usize)> = self.no_arm_motion.iter().collect();
            reasons.sort_by_key(|(_, count)| std::cmp::Reverse(**count));
            let told: Vec<String> = reasons
                .iter()
                .take(REASONS_TOLD)
                .map(|(reason, count)| format!("{reason} ({count})"))
                .collect();
            let more = if reasons.len() > REASONS_TOLD { "; ..." } else { "" };
            writeln!(out, "no arm motion: {}{more}", told.join("; "))?;
        }
        match document.grasps.first() {
            Some(best) => {
                write!(out, "best: {}, epsilon {:.4}", best.candidate, best.quality.epsilon)?;
                if let Some(expected) = best.quality.expected_epsilon {
                    write!(out, ", {expected:.4} expected under errors")?;
                }
                writeln!(
                    out,
                    " (exact cones of unit normal force, L1, torque / {:.1} mm: GraspIt!'s convention)",
                    document.object.torque_scale_m * 1e3
                )
            }
            None => writeln!(out, "no grasp to execute"),
        }
    }
}
