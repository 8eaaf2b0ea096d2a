//! The initial site: move and turn the palm until the fingers touch simultaneously.
//!
//! "Put the palm over the geometry center. Adjust position and pose of the palm until all four fingers can touch the
//! object simultaneously. This position is set as an initial site of grasp" (Wang et al. 2005, section V.A).
//!
//! The hand's own geometry makes this one-dimensional. At every closing fraction s the tips define a *grasp frame*:
//! origin midway between the thumb's tip and the mean of the others, x along the line from those to the thumb. As the
//! fingers flex they also draw back towards the palm, so this frame tilts by some 30 degrees between wide open and
//! closed; a palm that is to touch both sides at one height must lean as far. The search puts the grasp frame of s on
//! the object, closes, and takes the fractions found as the next s.

use hand_model::{FingerTrig, tip};
use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, Unit, UnitQuaternion, Vector3};
use protocol::ids::FingerId;

use super::attempt::{AttemptScratch, close_hand};
use super::candidates::Candidate;
use super::closing::Closing;
use super::scene::{Scene, TABLE_CLEARANCE_M};

/// Corrections before a site is taken as it is. Most need three or four.
const MAX_CORRECTIONS: usize = 8;

/// Longest single correction, metres: about a fingertip's radius, so that none jumps over a finger's width.
const MAX_STEP_M: f64 = 0.015;

/// Corrections below this are no longer worth a closing, metres.
const SETTLED_M: f64 = 0.001;

/// From where a hand comes and how it is turned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Approach {
    /// Direction of the straight last way, object frame.
    pub direction_in_object: Unit<Vector3<f64>>,
    /// Direction from the fingers' contacts to the thumb's, object frame; made perpendicular to the former.
    pub opposition_in_object: Vector3<f64>,
}

impl Approach {
    /// Orientation of the grasp frame: z along the direction, x along the opposition. An opposition parallel to the
    /// direction is replaced by any perpendicular.
    #[must_use]
    pub fn object_from_grasp_rotation(&self) -> UnitQuaternion<f64> {
        let z = self.direction_in_object.into_inner();
        let flat = self.opposition_in_object - z * z.dot(&self.opposition_in_object);
        let x = flat.try_normalize(1e-9).unwrap_or_else(|| {
            let helper = if z.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
            (helper - z * z.dot(&helper)).normalize()
        });
        rotation_from_axes(&x, &z.cross(&x), &z)
    }
}

fn rotation_from_axes(x: &Vector3<f64>, y: &Vector3<f64>, z: &Vector3<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[
        *x, *y, *z,
    ])))
}

/// A placed hand, before anything is known of its contacts.
#[derive(Debug, Clone, PartialEq)]
pub struct Site {
    /// Pose of the palm.
    pub object_from_palm: Isometry3<f64>,
    /// Direction of the straight last way, object frame.
    pub direction_in_object: Unit<Vector3<f64>>,
}

/// The tips at one closing fraction.
struct GraspFrame {
    palm_from_grasp: Isometry3<f64>,
    /// Distance between the thumb's tip-sphere centre and the mean of the others, metres.
    opening_m: f64,
}

fn grasp_frame(scene: &Scene, candidate: &Candidate, s: f64) -> GraspFrame {
    let model = &scene.hand.model;
    let limit = scene.hand.flexion_limit_rad();
    let tip_in_palm = |finger: FingerId| {
        let angles = candidate.finger_at(finger, s, limit);
        let in_base = tip(&model.finger, &FingerTrig::new(&angles, f64::sin_cos));
        (scene.hand.palm_from_finger_base(finger, candidate.thumb_rotation_rad) * in_base).coords
    };
    let others: Vec<Vector3<f64>> = FingerId::ALL
        .into_iter()
        .filter(|&f| f != FingerId::Thumb && candidate.uses[f.index()])
        .map(tip_in_palm)
        .collect();
    let mean = others.iter().sum::<Vector3<f64>>() / others.len().max(1) as f64;
    let thumb = tip_in_palm(FingerId::Thumb);
    // Closed beyond touching each other the tips pass, and the line between them turns round: keep to the palm's x.
    let across = thumb - mean;
    let x = if across.x > 1e-3 { across.normalize() } else { Vector3::x() };
    let y = (Vector3::y() - x * x.y).normalize();
    let rotation = rotation_from_axes(&x, &y, &x.cross(&y));
    GraspFrame {
        palm_from_grasp: Isometry3::from_parts(Translation3::from(0.5 * (mean + thumb)), rotation),
        opening_m: across.x.max(0.0),
    }
}

/// The closing fraction at which the gap between the tip spheres is `width_m`; 0 when even open tips are closer.
fn fraction_for_width(scene: &Scene, candidate: &Candidate, width_m: f64) -> f64 {
    let wanted_m = width_m + 2.0 * scene.hand.model.finger.tip_radius_m;
    let (mut low, mut high) = (0.0, 3.0);
    for _ in 0..30 {
        let middle = 0.5 * (low + high);
        if grasp_frame(scene, candidate, middle).opening_m > wanted_m { low = middle } else { high = middle }
    }
    low
}

/// Places the hand over `target_in_object` and corrects it until thumb and fingers touch together, their contacts
/// around the target or as near above it as the table lets them. Whether this is a grasp, an attempt there decides.
pub fn settle(
    scene: &Scene,
    candidate: &Candidate,
    approach: &Approach,
    target_in_object: &Point3<f64>,
    scratch: &mut AttemptScratch,
) -> Site {
    let rotation = approach.object_from_grasp_rotation();
    let axis = rotation * Vector3::x();
    let extent = |sign: f64| {
        scene.mesh.vertices().iter().map(|p| sign * (p - target_in_object).dot(&axis)).fold(0.0, f64::max)
    };
    let mut s = fraction_for_width(scene, candidate, extent(1.0) + extent(-1.0));
    let mut center = *target_in_object;
    let mut site = place(scene, candidate, approach, &rotation, &mut center, s, scratch);

    for _ in 0..MAX_CORRECTIONS {
        let closed = close_hand(scene, candidate, &site.object_from_palm, scratch);
        let fraction = |closing: &Closing| match closing {
            Closing::Touches(touch) => Some(touch.s),
            _ => None,
        };
        let thumb = closed.fingers[FingerId::Thumb.index()];
        let others: Vec<Closing> = closed.fingers[1..].iter().flatten().copied().collect();
        let touching: Vec<f64> = others.iter().filter_map(fraction).collect();
        let others_s = (!touching.is_empty()).then(|| touching.iter().sum::<f64>() / touching.len() as f64);
        let inside = |closing: &Closing| matches!(closing, Closing::StartsInside);
        // Correction in the grasp frame: +x takes the thumb away from the object and brings the fingers nearer.
        let mut step = Vector3::zeros();
        match (thumb.as_ref().is_some_and(inside), others.iter().any(inside)) {
            (true, true) => step.z = -MAX_STEP_M,
            (true, false) => step.x = MAX_STEP_M,
            (false, true) => step.x = -MAX_STEP_M,
            (false, false) => match (thumb.as_ref().and_then(fraction), others_s) {
                (Some(thumb_s), Some(others_s)) => {
                    let way_m = tip_way_per_fraction_m(scene, candidate);
                    step.x = 0.5 * (others_s - thumb_s) * way_m;
                    s = 0.5 * (thumb_s + others_s);
                }
                // Too far from the one that closes in the air.
                (None, Some(_)) => step.x = -MAX_STEP_M,
                (Some(_), None) => step.x = MAX_STEP_M,
                (None, None) => step.z = MAX_STEP_M,
            },
        }
        center += rotation * step.map(|c| c.clamp(-MAX_STEP_M, MAX_STEP_M));
        let before = site.object_from_palm;
        site = place(scene, candidate, approach, &rotation, &mut center, s, scratch);
        let turned_m = before.rotation.angle_to(&site.object_from_palm.rotation) * scene.hand.reach_m();
        let moved_m = (before.translation.vector - site.object_from_palm.translation.vector).norm();
        if moved_m.max(turned_m) < SETTLED_M {
            break;
        }
    }
    site
}

/// Puts the grasp frame of fraction `s` at `center`, and raises `center` until the tips stay above the table.
fn place(
    scene: &Scene,
    candidate: &Candidate,
    approach: &Approach,
    rotation: &UnitQuaternion<f64>,
    center: &mut Point3<f64>,
    s: f64,
    scratch: &mut AttemptScratch,
) -> Site {
    let grasp_from_palm = grasp_frame(scene, candidate, s).palm_from_grasp.inverse();
    let object_from_palm = |center: &Point3<f64>| {
        Isometry3::from_parts(Translation3::from(center.coords), *rotation) * grasp_from_palm
    };
    let deficit_m = table_deficit_m(scene, candidate, &object_from_palm(center), s, scratch);
    if deficit_m > 0.0 {
        *center += scene.base_from_object.inverse_transform_vector(&Vector3::z()) * deficit_m;
    }
    Site {
        object_from_palm: object_from_palm(center),
        direction_in_object: approach.direction_in_object,
    }
}

/// Way of a fingertip over one closing fraction, metres: the mean over thumb and index of the straight way between
/// open posture and preshape.
fn tip_way_per_fraction_m(scene: &Scene, candidate: &Candidate) -> f64 {
    let limit = scene.hand.flexion_limit_rad();
    let way = |finger: FingerId| {
        let at = |s| {
            let angles = candidate.finger_at(finger, s, limit);
            tip(&scene.hand.model.finger, &FingerTrig::new(&angles, f64::sin_cos))
        };
        (at(1.0) - at(0.0)).norm()
    };
    0.5 * (way(FingerId::Thumb) + way(FingerId::Index))
}

/// How far the used fingers at fraction `s` reach below the clearance above the table, metres.
fn table_deficit_m(
    scene: &Scene,
    candidate: &Candidate,
    object_from_palm: &Isometry3<f64>,
    s: f64,
    scratch: &mut AttemptScratch,
) -> f64 {
    let Some(table_height_m) = scene.table_height_m else { return 0.0 };
    let base_from_palm = scene.base_from_object * object_from_palm;
    let limit = scene.hand.flexion_limit_rad();
    let mut lowest_m = f64::INFINITY;
    for finger in FingerId::ALL {
        if !candidate.uses[finger.index()] {
            continue;
        }
        let base = base_from_palm * scene.hand.palm_from_finger_base(finger, candidate.thumb_rotation_rad);
        scene.hand.bead_centers(&candidate.finger_at(finger, s, limit), scratch.centers_mut());
        for (bead, center) in scene.hand.beads().iter().zip(scratch.centers_mut().iter()) {
            lowest_m = lowest_m.min((base * center).z - bead.radius_m);
        }
    }
    // A tenth of a millimetre more than the clearance, so that rounding does not make the attempt refuse the pose.
    table_height_m + TABLE_CLEARANCE_M + 1.0e-4 - lowest_m
}
