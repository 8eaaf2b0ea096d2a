//! The arm's way of a grasp: a straight line from the approach site to the grasp site, and straight up.
//!
//! "The sixth joint end of arm must passes by the approach site and moves straightly to grasp site before close hand
//! fingers" (Wang et al. 2005, section V.A.5). All configurations of the arm are tried, the nearest to its rest posture
//! first, and the first whose links clear table and object is taken.

use nalgebra::{Matrix3, Point3};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::arm::{Arm, Inverse, Joints, LineOutcome, LoadMode, Payload};
use super::attempt::palm_sites;
use super::scene::{Scene, TABLE_CLEARANCE_M};
use super::settle::Site;
use super::timing::{MotionLimits, PointSpeed, TimingError, time_path};
use super::trajectory::JointTrajectory;

/// Posture from which configurations are counted as near or far: elbow up, the hand over the cell's working spot, rad.
pub(super) const REST_RAD: Joints = [0.0, 0.3, 1.6, 0.0, 1.2, 0.0];

/// Steps of the straight lines.
const STEP_M: f64 = 0.002;
const STEP_RAD: f64 = 0.02;

/// Corners of the joint path are rounded by at most this, rad: some 0.5 mm at the hand.
const CORNER_RAD: f64 = 0.001;

/// Speed of the palm on the straight last way and on the lift, m/s: what the hand's reflexes can still follow.
const LINE_SPEED_M_PER_S: f64 = 0.10;

/// Links from this one on carry the hand and are always near it.
const FIRST_WRIST_LINK: usize = 4;

/// Mass of the scanner on the palm's support, kg (assumed: two small cameras, a line laser, a bracket).
const SCANNER_KG: f64 = 0.35;

/// Height of the hand's and scanner's common centre of mass over the flange, metres (20 mm plate, palm 1.05 kg around
/// 60 mm, fingers around 200 mm).
const LOAD_CENTER_M: f64 = 0.12;

/// Joint trajectories of one grasp.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ArmMotion {
    /// Approach site to grasp site.
    pub approach: JointTrajectory,
    /// Grasp site to lifted site.
    pub lift: JointTrajectory,
}

/// Why the arm cannot make the way.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum MotionError {
    /// No configuration follows both lines within the limits.
    #[error("no configuration of the arm follows approach and lift")]
    NoLine,
    /// Every configuration that follows them touches table or object with its links.
    #[error("the arm's links touch table or object on the way")]
    LinksCollide,
    /// Hand, scanner and object are more than the arm may carry.
    #[error("hand, scanner and object of {object_kg} kg are more than the arm may carry")]
    TooHeavy {
        /// Mass of the object.
        object_kg: f64,
    },
    /// The way could not be timed.
    #[error(transparent)]
    Timing(#[from] TimingError),
}

/// Plans approach and lift of one site for an object of `object_kg`.
///
/// # Errors
/// [`MotionError`]: no configuration, links in the way, or too heavy a load.
pub fn arm_motion(scene: &Scene, arm: &Arm, site: &Site, object_kg: f64) -> Result<ArmMotion, MotionError> {
    let [approach_site, grasp_site, lift_site] = palm_sites(scene, site);
    let limits = load_limits(scene, arm, object_kg)?;
    let starts = match arm.palm_solutions_near(&approach_site, &REST_RAD) {
        Inverse::Solutions(solutions) => solutions,
        _ => return Err(MotionError::NoLine),
    };
    let mut failure = MotionError::NoLine;
    for start in starts.iter() {
        let line = |from, to, seed: &Joints| arm.straight_line(from, to, seed, STEP_M, STEP_RAD);
        let LineOutcome::Path(approach) = line(&approach_site, &grasp_site, &start.q_rad) else { continue };
        let Some(at_grasp) = approach.last() else { continue };
        let LineOutcome::Path(lift) = line(&grasp_site, &lift_site, at_grasp) else { continue };
        if approach.iter().chain(&lift).any(|q| links_collide(scene, arm, q)) {
            failure = MotionError::LinksCollide;
            continue;
        }
        let palm = |q: &Joints| Point3::from(arm.base_from_palm(q).translation.vector);
        let speed = PointSpeed { point: &palm, limit_m_per_s: LINE_SPEED_M_PER_S };
        return Ok(ArmMotion {
            approach: time_path(&approach, &limits, CORNER_RAD, Some(speed))?,
            lift: time_path(&lift, &limits, CORNER_RAD, Some(speed))?,
        });
    }
    Err(failure)
}

fn load_limits(scene: &Scene, arm: &Arm, object_kg: f64) -> Result<MotionLimits, MotionError> {
    let hand_kg = scene.hand.mass_kg + SCANNER_KG;
    let object_at = Point3::new(0.0, 0.0, scene.hand.grasp_center_in_palm.z);
    let mass_kg = hand_kg + object_kg;
    let center =
        (Point3::new(0.0, 0.0, LOAD_CENTER_M).coords * hand_kg + object_at.coords * object_kg) / mass_kg;
    let payload = Payload {
        mass_kg,
        center_in_flange: Point3::from(center),
        // Point masses about their common centre; the parts' own inertias are a tenth of that.
        inertia_kg_m2: {
            let reduced = hand_kg * object_kg / mass_kg * (object_at.z - LOAD_CENTER_M).powi(2);
            Matrix3::from_diagonal(&nalgebra::Vector3::new(reduced, reduced, 0.0))
        },
    };
    let mode: LoadMode = arm.check_load(&payload).mode;
    MotionLimits::for_load(arm, &mode).ok_or(MotionError::TooHeavy { object_kg })
}

/// Whether a link of the arm touches the table, the object or the hand. The base stands on the table's level, and the
/// wrist carries the hand: those pairs are left out.
pub(super) fn links_collide(scene: &Scene, arm: &Arm, q: &Joints) -> bool {
    let frames = arm.link_frames(q);
    let object_from_base = scene.base_from_object.inverse();
    let base_from_palm = arm.base_from_palm(q);
    arm.link_capsules().iter().any(|capsule| {
        let ends = match capsule.link.checked_sub(1) {
            Some(frame) => [frames[frame] * capsule.from, frames[frame] * capsule.to],
            None => [capsule.from, capsule.to],
        };
        let lowest_m = ends[0].z.min(ends[1].z) - capsule.radius_m;
        let on_table = capsule.link > 0
            && scene.table_height_m.is_some_and(|table| lowest_m < table + TABLE_CLEARANCE_M);
        // The palm as balls about the middles of its boxes: small enough to let no pose that is free be refused.
        let near_palm = capsule.link < FIRST_WRIST_LINK
            && scene.hand.palm.iter().any(|part| {
                let middle = base_from_palm * part.palm_from_box.translation.vector;
                let radius_m = part.half_extents_m.min();
                distance_to_segment_m(&Point3::from(middle), &ends) < capsule.radius_m + radius_m
            });
        on_table
            || near_palm
            || scene.surface.cuts_capsule(&ends.map(|p| object_from_base * p), capsule.radius_m)
    })
}

/// Distance of a point from the segment between two others, metres.
fn distance_to_segment_m(point: &Point3<f64>, [a, b]: &[Point3<f64>; 2]) -> f64 {
    let way = b - a;
    let share = (point - a).dot(&way) / way.norm_squared().max(f64::MIN_POSITIVE);
    (a + way * share.clamp(0.0, 1.0) - point).norm()
}
