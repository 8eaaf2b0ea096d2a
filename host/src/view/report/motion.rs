//! Where hand and arm are from the approach site to the squeeze.

use nalgebra::{Isometry3, Point3, Vector3};
use serde::Serialize;

use super::{ReportError, mm, read_posture};
use crate::hand::{Hand, PalmBox, Posture};
use crate::plan::arm::Arm;
use crate::plan::document::{GraspInfo, PlanDocument};

/// Steps from one stage to the next.
const BETWEEN: usize = 12;

/// The stages and their steps.
pub(super) const STAGES: [(&str, usize); 4] =
    [("approach", 0), ("pregrasp", BETWEEN), ("grasp", 2 * BETWEEN), ("squeeze", 3 * BETWEEN)];

/// Farthest that the arm's angles may put the palm from the grasp site, metres.
const SITE_M: f64 = 1e-3;

/// What stays the same while the hand moves.
#[derive(Serialize)]
pub(super) struct HandParts {
    /// Radii of the bodies along each finger, palm first, mm: each reaches from the point before to its own.
    radii: Vec<Vec<f64>>,
    /// Number of the palm's boxes.
    boxes: usize,
}

impl HandParts {
    pub(super) fn of(hand: &Hand) -> Self {
        let radii = hand.fingers.iter().map(|finger| {
            let beads = finger.beads();
            beads.first().into_iter().chain(beads).map(|bead| 1e3 * bead.radius_m).collect()
        });
        Self { radii: radii.collect(), boxes: hand.palm.len() }
    }
}

/// Radii of the arm's capsules, mm.
#[derive(Serialize)]
pub(super) struct ArmShape(Vec<f64>);

impl ArmShape {
    pub(super) fn of(arm: &Arm) -> Self {
        Self(arm.link_capsules().iter().map(|capsule| 1e3 * capsule.radius_m).collect())
    }
}

/// Hand and arm at one step, mm in the base frame.
#[derive(Serialize)]
pub(super) struct Step {
    /// For each finger the points of its chain, x, y, z each: one on the palm, the root, then the balls.
    fingers: Vec<Vec<f64>>,
    /// Eight corners of each box of the palm; bit 0 of a corner's number is its side along x, 1 along y, 2 along z.
    boxes: Vec<Vec<f64>>,
    /// Both ends of each of the arm's capsules.
    arm: Option<Vec<f64>>,
}

/// Whether the arm of the plan's trajectories is this one, on this mount: they end where the plan says.
pub(super) fn reaches(arm: &Arm, document: &PlanDocument) -> Result<bool, ReportError> {
    for grasp in &document.grasps {
        let Some(knot) = grasp.arm_motion.as_ref().and_then(|motion| motion.approach.knots().last()) else {
            return Ok(false);
        };
        let site = grasp.grasp_site.to_isometry("grasp_site")?;
        let reached = arm.base_from_palm(&knot.q_rad);
        if (reached.translation.vector - site.translation.vector).norm() > SITE_M {
            return Ok(false);
        }
    }
    Ok(true)
}

/// All steps of a grasp: the straight way, the closing, the pressing.
///
/// # Errors
/// [`ReportError`] when a pose is none or a posture does not fit the hand.
pub(super) fn steps(
    number: usize,
    hand: &Hand,
    arm: Option<&Arm>,
    info: &GraspInfo,
) -> Result<Vec<Step>, ReportError> {
    let posture = |named, name| read_posture(number, hand, named, name);
    let [open, closed, pressing] = [
        posture(&info.pregrasp, "pregrasp")?,
        posture(&info.grasp, "grasp")?,
        posture(&info.squeeze, "squeeze")?,
    ];
    let approach = info.approach_site.to_isometry("approach_site")?;
    let site = info.grasp_site.to_isometry("grasp_site")?;
    let steps = (0..=3 * BETWEEN).map(|step| {
        let share = |stage: usize| (step.saturating_sub(stage * BETWEEN) as f64 / BETWEEN as f64).min(1.0);
        let along = share(0);
        let angles = arm
            .zip(info.arm_motion.as_ref())
            .map(|(arm, motion)| (arm, motion.approach.sample(along * motion.approach.duration_s()).q_rad));
        let base_from_palm = match &angles {
            Some((arm, q_rad)) => arm.base_from_palm(q_rad),
            None => approach.lerp_slerp(&site, along),
        };
        let posture = open + (closed - open) * share(1) + (pressing - closed) * share(2);
        Step {
            fingers: fingers(hand, &posture, &base_from_palm),
            boxes: hand.palm.iter().map(|part| corners(part, &base_from_palm)).collect(),
            arm: angles.map(|(arm, q_rad)| {
                let frames = arm.link_frames(&q_rad);
                let ends = arm.link_capsules().iter().flat_map(|capsule| capsule.ends_in_base(&frames));
                ends.flat_map(|end| mm(&end)).collect()
            }),
        }
    });
    Ok(steps.collect())
}

fn fingers(hand: &Hand, posture: &Posture, base_from_palm: &Isometry3<f64>) -> Vec<Vec<f64>> {
    let mut centers = Vec::new();
    let chains = hand.fingers.iter().map(|finger| {
        let frames = finger.frames(posture);
        finger.bead_centers(posture, &mut centers);
        let first = finger.beads().first().map_or(0, |bead| bead.segment);
        let root = Point3::from(frames.palm_from_segment(first).translation.vector);
        let chain = [nearest_on_palm(&hand.palm, &root), root];
        chain.iter().chain(&centers).flat_map(|p| mm(&(base_from_palm * p))).collect()
    });
    chains.collect()
}

/// Where the carrier of a finger leaves the palm; the models give no shape for it.
fn nearest_on_palm(palm: &[PalmBox], root: &Point3<f64>) -> Point3<f64> {
    let on_boxes = palm.iter().map(|part| {
        let in_box = part.palm_from_box.inverse() * root;
        let nearest = in_box.coords.zip_map(&part.half_extents_m, |c, half| c.clamp(-half, half));
        part.palm_from_box * Point3::from(nearest)
    });
    on_boxes.min_by(|a, b| (a - root).norm().total_cmp(&(b - root).norm())).unwrap_or(*root)
}

fn corners(part: &PalmBox, base_from_palm: &Isometry3<f64>) -> Vec<f64> {
    let base_from_box = base_from_palm * part.palm_from_box;
    let side = |corner: usize, axis: usize| if corner >> axis & 1 == 0 { -1.0 } else { 1.0 };
    (0..8)
        .flat_map(|corner| {
            let signs = Vector3::new(side(corner, 0), side(corner, 1), side(corner, 2));
            mm(&(base_from_box * Point3::from(part.half_extents_m.component_mul(&signs))))
        })
        .collect()
}
