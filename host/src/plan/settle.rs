//! The initial site: move and turn the palm until the fingers touch simultaneously.
//!
//! "Put the palm over the geometry center. Adjust position and pose of the palm until all four fingers can touch the
//! object simultaneously. This position is set as an initial site of grasp" (Wang et al. 2005, section V.A).

use nalgebra::{Isometry3, Point3, Translation3, Unit, UnitQuaternion, Vector3};

use super::attempt::close_hand;
use super::closing::{Closing, matrix};
use super::preshape::{PATH_M, Preshape, PreshapeTable, any_across, rotation_from_axes};
use super::scene::{Scene, table_clearance_m};

/// Corrections before a site is taken as it is. Most need two or three.
const MAX_CORRECTIONS: usize = 6;

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
        let x = flat.try_normalize(1e-9).unwrap_or_else(|| any_across(&z));
        rotation_from_axes(&x, &z.cross(&x), &z)
    }
}

/// A placed and shaped hand, before anything is known of its contacts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Site {
    /// Pose of the palm frame in the object's frame.
    pub object_from_palm: Isometry3<f64>,
    /// Direction of the straight last way, object frame.
    pub direction_in_object: Unit<Vector3<f64>>,
    /// The hand before it closes, and the ways on which the used fingers close.
    pub preshape: Preshape,
}

/// Places the hand over `target_in_object` and corrects it until the fingers touch together, their contacts in the plane
/// through the target or as near above it as the table lets them. `width_m` is the thickness between the fingers where it
/// is known, metres; else that of the whole object counts. Whether this is a grasp, an attempt there decides.
#[must_use]
pub fn settle(
    scene: &Scene,
    table: &PreshapeTable,
    approach: &Approach,
    target_in_object: &Point3<f64>,
    width_m: Option<f64>,
) -> Site {
    let rotation = approach.object_from_grasp_rotation();
    let opposing = table.candidate().opposing;
    let (mut site, mut center, mut width_m) = begin(scene, table, approach, target_in_object, width_m);

    for _ in 0..MAX_CORRECTIONS {
        let closed = close_hand(scene, table.candidate(), &site);
        let place_on_path = |closing: Closing| match closing {
            Closing::Touches(touch) => Some(touch.u),
            _ => None,
        };
        let inside = |closing: Closing| matches!(closing, Closing::StartsInside);
        let thumb = closed.fingers[opposing];
        let others = || {
            let used = closed.fingers.iter().enumerate();
            used.filter(|(finger, _)| *finger != opposing).filter_map(|(_, closing)| *closing)
        };
        let (mut sum_u, mut touching) = (0.0, 0);
        for u in others().filter_map(place_on_path) {
            sum_u += u;
            touching += 1;
        }
        let others_u = (touching > 0).then(|| sum_u / f64::from(touching));
        // Correction in the grasp frame: +x takes the opposing finger away from the object and brings the others nearer.
        let (mut step, mut wider_m) = (Vector3::zeros(), 0.0);
        match (thumb.is_some_and(inside), others().any(inside)) {
            (true, true) => wider_m = 2.0 * MAX_STEP_M,
            // Open on the side that is inside: half by moving, half by widening.
            (true, false) => (step.x, wider_m) = (0.5 * MAX_STEP_M, MAX_STEP_M),
            (false, true) => (step.x, wider_m) = (-0.5 * MAX_STEP_M, MAX_STEP_M),
            (false, false) => match (thumb.and_then(place_on_path), others_u) {
                (Some(thumb_u), Some(others_u)) => {
                    step.x = 0.5 * (others_u - thumb_u) * PATH_M;
                    wider_m = (2.0 - thumb_u - others_u) * PATH_M;
                }
                // Too far from the one that closes in the air.
                (None, Some(_)) => step.x = -MAX_STEP_M,
                (Some(_), None) => step.x = MAX_STEP_M,
                (None, None) => wider_m = -2.0 * MAX_STEP_M,
            },
        }
        if step.norm().max(wider_m.abs()) < SETTLED_M {
            break;
        }
        let step = step.map(|c: f64| c.clamp(-MAX_STEP_M, MAX_STEP_M));
        center += rotation * step;
        width_m = (width_m + wider_m).max(0.0);
        site = place(scene, table, approach, &rotation, &mut center, width_m);
    }
    site
}

/// The site that [`settle`] begins with.
#[must_use]
pub fn placed(
    scene: &Scene,
    table: &PreshapeTable,
    approach: &Approach,
    target_in_object: &Point3<f64>,
    width_m: Option<f64>,
) -> Site {
    begin(scene, table, approach, target_in_object, width_m).0
}

/// First site, with the middle between its fingers and the width that it is open for.
fn begin(
    scene: &Scene,
    table: &PreshapeTable,
    approach: &Approach,
    target_in_object: &Point3<f64>,
    width_m: Option<f64>,
) -> (Site, Point3<f64>, f64) {
    let rotation = approach.object_from_grasp_rotation();
    let (mut center, width_m) = match width_m {
        Some(width_m) => (*target_in_object, width_m),
        None => {
            let axis = rotation * Vector3::x();
            let ahead_m = scene.extent_m(target_in_object, &axis);
            let behind_m = scene.extent_m(target_in_object, &-axis);
            (target_in_object + axis * (0.5 * (ahead_m - behind_m)), ahead_m + behind_m)
        }
    };
    let site = place(scene, table, approach, &rotation, &mut center, width_m);
    (site, center, width_m)
}

/// Puts the grasp frame of a hand shaped for `width_m` at `center`, and raises `center` until the tips stay above the
/// table.
fn place(
    scene: &Scene,
    table: &PreshapeTable,
    approach: &Approach,
    rotation: &UnitQuaternion<f64>,
    center: &mut Point3<f64>,
    width_m: f64,
) -> Site {
    let preshape = *table.nearest(&scene.hand, width_m);
    let grasp_from_palm = preshape.palm_from_grasp.inverse();
    let pose = |center: &Point3<f64>| {
        Isometry3::from_parts(Translation3::from(center.coords), *rotation) * grasp_from_palm
    };
    let mut site =
        Site { object_from_palm: pose(center), direction_in_object: approach.direction_in_object, preshape };
    let deficit_m = table_deficit_m(scene, table, &site);
    if deficit_m > 0.0 {
        *center += scene.base_from_object.inverse_transform_vector(&Vector3::z()) * deficit_m;
        site.object_from_palm = pose(center);
    }
    site
}

/// How far the used fingers in the preshape reach below the clearance above the table, metres.
fn table_deficit_m(scene: &Scene, table: &PreshapeTable, site: &Site) -> f64 {
    let Some(table_height_m) = scene.table_height_m else { return 0.0 };
    let base_from_palm = matrix(&(scene.base_from_object * site.object_from_palm));
    let posture = site.preshape.with_finger_at(1.0);
    let mut lowest_m = f64::INFINITY;
    for finger in table.candidate().fingers() {
        let chain = &scene.hand.fingers[finger];
        let frames = chain.frames(&posture);
        for bead in chain.beads() {
            let center = base_from_palm * (frames.palm_from_segment(bead.segment) * bead.center_in_segment);
            lowest_m = lowest_m.min(center.z - bead.radius_m - table_clearance_m(bead.part));
        }
    }
    // A tenth of a millimetre more than the clearance, so that rounding does not make the attempt refuse the pose.
    table_height_m + 1.0e-4 - lowest_m
}
