//! Power grasps: the palm against the object, and the fingers wrapped around it link by link.
//!
//! The open hand moves on until the palm touches, or whatever of it meets object or table first. Then each finger closes
//! all its joints together; what touches stays where it is, the joints before it stop, and those behind it go on until
//! nothing moves any more, as in the enveloping grasps of `GraspIt!`'s auto-grasp and of underactuated hands. A soft
//! object's patch on the palm is up to four points.

use nalgebra::{Isometry3, Point3, Translation3, Unit, Vector3};

use super::approach::{palm_clear_of_table, palm_cuts_object};
use super::attempt::{GraspContact, Rejection, Seat, contact_at};
use super::closing::{Closing, Way, advance, matrix};
use super::preshape::any_across;
use super::scene::{Scene, TABLE_CLEARANCE_M};
use super::settle::Site;
use crate::hand::{Candidate, Finger, Part, Posture};

/// How far the palm is drawn back before it is seated, and how far beyond its site it may then go, metres: from where its
/// tips would meet, as in a precision grasp, a palm has about a finger's length to go.
const SEAT_BACK_M: f64 = 0.02;
const SEAT_WAY_M: f64 = 0.10;

/// Steps in which it goes, metres: half a fingertip. Nothing that could be held is thinner along the palm's whole width.
const SEAT_STEP_M: f64 = 0.005;

/// Gap that a seated hand leaves to its open fingers, metres: a finger that touches before it closes cannot press.
const FINGER_GAP_M: f64 = 1e-3;

/// Gap at which the palm is seated, metres; larger than what bisection leaves.
const SEAT_GAP_M: f64 = 5e-5;

/// Surface within this of the palm belongs to its patch, metres: what skin over a palm gives way.
const PATCH_M: f64 = 1e-3;

/// Points along each edge of a palm's face at which its distance is measured.
const FACE_POINTS: usize = 9;

/// Most contact points of the palm.
const PALM_CONTACTS: usize = 4;

/// Closing goes on to this many times the preshape; joints stop at their limits long before.
const U_MAX: f64 = 50.0;

/// Seats the palm and wraps the fingers. The contacts, the palm's first, are appended to `contacts`.
///
/// Errors when the hand has no room where it sets out, or the opposing finger or all others touch nothing.
pub(super) fn wrap(
    scene: &Scene,
    candidate: &Candidate,
    site: &Site,
    contacts: &mut Vec<GraspContact>,
) -> Result<Seat, Rejection> {
    let object_from_palm = seat(scene, candidate, site)?;
    palm_contacts(scene, &object_from_palm, site, contacts)?;
    let mut posture = site.preshape.start;
    let (mut opposing, mut others) = (false, false);
    for finger in candidate.fingers() {
        let touched = wrap_finger(scene, candidate, finger, &object_from_palm, &mut posture, contacts)?;
        if finger == candidate.opposing {
            opposing |= touched;
        } else {
            others |= touched;
        }
    }
    if opposing && others { Ok(Seat { object_from_palm, posture }) } else { Err(Rejection::FingerMisses) }
}

/// Whether the hand, drawn back, is free: only from there can it be seated.
pub(super) fn may_be_seated(scene: &Scene, candidate: &Candidate, site: &Site) -> bool {
    is_free(scene, candidate, site, -SEAT_BACK_M)
}

/// Pose of the palm where the open hand meets object or table on its way along the approach direction, or where it was
/// when it meets nothing.
fn seat(scene: &Scene, candidate: &Candidate, site: &Site) -> Result<Isometry3<f64>, Rejection> {
    let mut free_m = -SEAT_BACK_M;
    if !is_free(scene, candidate, site, free_m) {
        return Err(Rejection::PalmBlocked);
    }
    while free_m < SEAT_WAY_M {
        if is_free(scene, candidate, site, free_m + SEAT_STEP_M) {
            free_m += SEAT_STEP_M;
            continue;
        }
        let mut blocked_m = free_m + SEAT_STEP_M;
        while blocked_m - free_m > SEAT_GAP_M {
            let middle_m = 0.5 * (free_m + blocked_m);
            if is_free(scene, candidate, site, middle_m) { free_m = middle_m } else { blocked_m = middle_m }
        }
        return Ok(advanced(site, free_m));
    }
    Ok(site.object_from_palm)
}

/// The palm of a site, so far on along the approach direction.
fn advanced(site: &Site, way_m: f64) -> Isometry3<f64> {
    Translation3::from(site.direction_in_object.into_inner() * way_m) * site.object_from_palm
}

/// Whether palm and used fingers, open, are clear of table and object so far along the approach direction; the fingers with
/// room to begin their closing.
fn is_free(scene: &Scene, candidate: &Candidate, site: &Site, way_m: f64) -> bool {
    let object_from_palm = advanced(site, way_m);
    if !palm_clear_of_table(scene, &(scene.base_from_object * object_from_palm)) {
        return false;
    }
    let turned = matrix(&object_from_palm);
    let up_in_object = scene.base_from_object.inverse_transform_vector(&Vector3::z());
    let lowest_m =
        scene.table_height_m.map(|z_m| z_m + TABLE_CLEARANCE_M - scene.base_from_object.translation.z);
    let fingers_are_free = candidate.fingers().all(|finger| {
        let chain = &scene.hand.fingers[finger];
        let frames = chain.frames(&site.preshape.start);
        chain.beads().iter().all(|bead| {
            let center = turned * (frames.palm_from_segment(bead.segment) * bead.center_in_segment);
            lowest_m.is_none_or(|lowest_m| center.coords.dot(&up_in_object) - bead.radius_m >= lowest_m)
                && scene.surface.clear_of_ball(&center, bead.radius_m + FINGER_GAP_M)
        })
    });
    fingers_are_free && !palm_cuts_object(scene, &object_from_palm)
}

/// Adds the palm's contacts: of the points of its faces that look along the approach and are within the patch, up to four
/// that lie far apart.
fn palm_contacts(
    scene: &Scene,
    object_from_palm: &Isometry3<f64>,
    site: &Site,
    contacts: &mut Vec<GraspContact>,
) -> Result<(), Rejection> {
    let mut patch = [None::<(Point3<f64>, Unit<Vector3<f64>>)>; FACE_POINTS * FACE_POINTS];
    let mut count = 0;
    for part in &scene.hand.palm {
        let object_from_box = object_from_palm * part.palm_from_box;
        let way_in_box = object_from_box.inverse_transform_vector(&site.direction_in_object);
        let axis = way_in_box.iamax();
        let mut normal = Vector3::zeros();
        normal[axis] = way_in_box[axis].signum();
        let inward = Unit::new_normalize(object_from_box * normal);
        let across = any_across(&normal);
        let along = normal.cross(&across);
        let extent = |v: &Vector3<f64>| part.half_extents_m.dot(&v.abs());
        for i in 0..FACE_POINTS {
            for k in 0..FACE_POINTS {
                let share = |i: usize| 2.0 * i as f64 / (FACE_POINTS - 1) as f64 - 1.0;
                let in_box = normal * extent(&normal)
                    + across * (extent(&across) * share(i))
                    + along * (extent(&along) * share(k));
                let at = object_from_box * Point3::from(in_box);
                if scene.surface.distance_bound_m(&at) > PATCH_M {
                    continue;
                }
                let nearest = scene.surface.nearest(&at);
                if nearest.signed_distance_m.abs() <= PATCH_M
                    && let Some(slot) = patch.get_mut(count)
                {
                    *slot = Some((nearest.point_in_object, inward));
                    count += 1;
                }
            }
        }
    }
    // Farthest from those taken so far, the first of all to begin with.
    let mut taken: [Option<usize>; PALM_CONTACTS] = [None; PALM_CONTACTS];
    for slot in 0..PALM_CONTACTS.min(count) {
        let apart_m = |i: usize| {
            let point = patch[i].map_or(Point3::origin(), |(p, _)| p);
            let others = taken.iter().flatten().filter_map(|&k| patch[k]);
            others.map(|(other, _)| (other - point).norm()).fold(f64::INFINITY, f64::min)
        };
        let farthest = (0..count).reduce(|a, b| if apart_m(b) > apart_m(a) { b } else { a });
        let Some(chosen) = farthest.filter(|&i| apart_m(i) > PATCH_M) else { break };
        taken[slot] = Some(chosen);
        if let Some((point, inward)) = patch[chosen] {
            let contact = contact_at(scene, &point, &inward, scene.hand.link_friction, 0.0)?;
            contacts.push(GraspContact { finger: None, bead: 0, contact });
        }
    }
    Ok(())
}

/// Wraps one finger; says whether it touched anything.
fn wrap_finger(
    scene: &Scene,
    candidate: &Candidate,
    finger: usize,
    object_from_palm: &Isometry3<f64>,
    posture: &mut Posture,
    contacts: &mut Vec<GraspContact>,
) -> Result<bool, Rejection> {
    let chain = &scene.hand.fingers[finger];
    let mut rate = Posture::ZERO;
    for &joint in chain.joints() {
        let limits = &scene.hand.joints[joint];
        if !limits.is_held && limits.flexes.is_some() {
            rate[joint] = candidate.closing[joint];
        }
    }
    let mut touched = false;
    // Each round stops a joint.
    for round in 0..=2 * chain.segments().len() {
        let Some((first_moving, u_end)) = next_stop(scene, chain, posture, &mut rate) else { break };
        let beads_from = chain.beads().iter().position(|bead| bead.segment >= first_moving).unwrap_or(0);
        let way =
            Way { start: *posture, rate, u_begin: 0.0, u_end, beads_from, may_begin_touching: round > 0 };
        match advance(&scene.surface, chain, object_from_palm, &way) {
            Closing::StartsInside if !touched => return Err(Rejection::FingerInObject),
            // Pressed in by the curvature before it: it holds what it holds.
            Closing::StartsInside => break,
            Closing::Misses => *posture = *posture + rate * u_end,
            Closing::Touches(touch) => {
                *posture = *posture + rate * touch.u;
                touched = true;
                let bead = &chain.beads()[touch.bead];
                let friction_max =
                    if bead.part == Part::Inner { scene.hand.link_friction } else { f64::INFINITY };
                let (point, inward) = (&touch.point_in_object, &touch.inward_normal_in_object);
                let contact = contact_at(scene, point, inward, friction_max, 0.0)?;
                contacts.push(GraspContact { finger: Some(finger), bead: touch.bead, contact });
                for segment in &chain.segments()[..=bead.segment] {
                    rate[segment.joint] = 0.0;
                }
            }
        }
    }
    Ok(touched)
}

/// The first segment that still moves and the way to the nearest limit; joints that are at theirs are stopped. `None` when
/// nothing moves.
fn next_stop(scene: &Scene, chain: &Finger, posture: &Posture, rate: &mut Posture) -> Option<(usize, f64)> {
    let mut u_end = U_MAX;
    for &joint in chain.joints() {
        if rate[joint] == 0.0 {
            continue;
        }
        let limits = &scene.hand.joints[joint];
        let limit = if rate[joint] > 0.0 { limits.upper_rad } else { limits.lower_rad };
        let u = (limit - posture[joint]) / rate[joint];
        if u <= 1e-6 {
            rate[joint] = 0.0;
        } else {
            u_end = u_end.min(u);
        }
    }
    let first = chain.segments().iter().position(|segment| rate[segment.joint] != 0.0)?;
    Some((first, u_end))
}

/// Pose of a palm, on its way along `direction_in_object`, whose pressing point is at the target, with its lateral axis as
/// near `lateral_in_object` as the direction lets it.
#[must_use]
pub(super) fn palm_over(
    scene: &Scene,
    candidate: &Candidate,
    direction_in_object: &Unit<Vector3<f64>>,
    lateral_in_object: &Vector3<f64>,
    target_in_object: &Point3<f64>,
) -> Isometry3<f64> {
    let frame = |way: &Vector3<f64>, lateral: &Vector3<f64>| {
        let y = (lateral - way * way.dot(lateral)).try_normalize(1e-9).unwrap_or_else(|| any_across(way));
        super::preshape::rotation_from_axes(way, &y, &way.cross(&y))
    };
    let palm_from_frame = frame(&scene.hand.pressing_in_palm, &candidate.lateral_in_palm);
    let rotation = frame(direction_in_object, lateral_in_object) * palm_from_frame.inverse();
    let place = rotation * pressing_point(scene).coords;
    Isometry3::from_parts(Translation3::from(target_in_object.coords - place), rotation)
}

/// The point of the palm that is to press, palm frame: on the face that looks along the pressing direction, towards the
/// place where things are grasped.
fn pressing_point(scene: &Scene) -> Point3<f64> {
    let center = scene.hand.grasp_center_in_palm;
    let nearest = scene.hand.palm.iter().map(|part| {
        let in_box = part.palm_from_box.inverse_transform_point(&center);
        // Well inside the face: a third of its half extent from its edges.
        let half = part.half_extents_m * (2.0 / 3.0);
        let way = part.palm_from_box.inverse_transform_vector(&scene.hand.pressing_in_palm);
        let axis = way.iamax();
        let mut point = in_box.coords.zip_map(&half, |c, half: f64| c.clamp(-half, half));
        point[axis] = part.half_extents_m[axis] * way[axis].signum();
        part.palm_from_box * Point3::from(point)
    });
    nearest.min_by(|a, b| (a - center).norm().total_cmp(&(b - center).norm())).unwrap_or(center)
}
