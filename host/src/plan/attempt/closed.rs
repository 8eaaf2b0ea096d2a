//! The closed hand and the contacts of its tips.

use nalgebra::{Point3, Unit, Vector3};

use super::super::closing::{Closing, Touch, close_finger};
use super::super::scene::Scene;
use super::super::settle::Site;
use super::grasp::{GraspContact, Rejection};
use super::opening::take_finger;
use crate::grasp::{Contact, ContactError};
use crate::hand::{Candidate, ContactKind, Hand, MAX_FINGERS, Part, Posture};

/// Least cosine between a finger's push and its pad's normal, for the distal link, whose rubber covers the pad only: 75
/// degrees round the finger.
const PAD_COSINE_MIN: f64 = 0.26;

/// The same for the tip, whose rubber is a cap: its front half and ten degrees more.
const TIP_COSINE_MIN: f64 = -0.17;

/// How far a tip may be from where it touched because another finger has the same drive, metres: what settling the palm
/// leaves, which ends when half of what one finger touches sooner than the others is below a millimetre.
const ONE_DRIVE_M: f64 = 2.0e-3;

/// How the fingers of an attempt ended; the searches move the palm by it until all touch together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Closed {
    /// By finger; `None` for fingers that the candidate does not use.
    pub fingers: [Option<Closing>; MAX_FINGERS],
}

impl Closed {
    /// The touches, in finger order.
    pub fn touches(&self) -> impl Iterator<Item = (usize, Touch)> + '_ {
        self.fingers.iter().enumerate().filter_map(|(finger, closing)| match closing {
            Some(Closing::Touches(touch)) => Some((finger, *touch)),
            _ => None,
        })
    }
}

/// Closes the used fingers about the object, the palm held still.
#[must_use]
pub fn close_hand(scene: &Scene, candidate: &Candidate, site: &Site) -> Closed {
    let mut fingers = [None; MAX_FINGERS];
    for finger in candidate.fingers() {
        fingers[finger] =
            Some(close_finger(&scene.surface, &scene.hand, finger, &site.object_from_palm, &site.preshape));
    }
    Closed { fingers }
}

/// Takes the touches of a closed hand, all of which have to be of rubber, and the joint angles of the touching fingers.
pub(super) fn touch_with_tips(
    scene: &Scene,
    candidate: &Candidate,
    site: &Site,
    closed: &Closed,
    grasp: &mut Posture,
    touches: &mut Vec<GraspContact>,
) -> Result<(), Rejection> {
    for finger in candidate.fingers() {
        match closed.fingers[finger] {
            Some(Closing::Touches(touch)) => {
                take_finger(&scene.hand, finger, &site.preshape.with_finger_at(touch.u), grasp);
            }
            Some(Closing::Misses) | None => return Err(Rejection::FingerMisses),
            Some(Closing::StartsInside) => return Err(Rejection::FingerInObject),
        }
    }
    let is_kept = |(finger, touch): (usize, Touch)| {
        keeps_touch(&scene.hand, finger, &site.preshape.with_finger_at(touch.u), grasp)
    };
    if !closed.touches().all(is_kept) {
        return Err(Rejection::FingerMisses);
    }
    if !closed.touches().all(|(_, touch)| on_rubber(&touch)) {
        return Err(Rejection::NotOnPad);
    }
    let torsional_m = torsion(&scene.hand, candidate);
    for (finger, touch) in closed.touches() {
        let (point, normal) = (&touch.point_in_object, &touch.inward_normal_in_object);
        let contact = contact_at(scene, point, normal, f64::INFINITY, torsional_m)?;
        touches.push(GraspContact { finger: Some(finger), bead: touch.bead, contact });
    }
    Ok(())
}

/// Whether a finger that touched in one posture still does, within [`ONE_DRIVE_M`], in the hand's: a drive that closes
/// several fingers stands where one of them touched. Always so of a finger that has its drives to itself.
pub(in super::super) fn keeps_touch(hand: &Hand, finger: usize, touching: &Posture, taken: &Posture) -> bool {
    let chain = &hand.fingers[finger];
    if chain.joints().iter().all(|&joint| touching[joint] == taken[joint]) {
        return true;
    }
    let tip = |posture: &Posture| chain.tip_in_palm(&chain.frames(posture));
    (tip(taken) - tip(touching)).norm() <= ONE_DRIVE_M
}

/// Whether a finger touches with what is made for it.
pub(super) fn on_rubber(touch: &Touch) -> bool {
    match touch.part {
        Part::Tip => touch.pad_cosine >= TIP_COSINE_MIN,
        Part::Distal => touch.pad_cosine >= PAD_COSINE_MIN,
        Part::Inner => false,
    }
}

pub(super) fn torsion(hand: &Hand, candidate: &Candidate) -> f64 {
    match candidate.contact {
        ContactKind::Hard => 0.0,
        ContactKind::Soft => hand.soft_tip_torsion_m,
    }
}

/// A contact of the scene's friction, or of `friction_max` where that is less.
pub(in super::super) fn contact_at(
    scene: &Scene,
    point_in_object: &Point3<f64>,
    inward_normal_in_object: &Unit<Vector3<f64>>,
    friction_max: f64,
    torsional_m: f64,
) -> Result<Contact, Rejection> {
    let contact = || -> Result<Contact, ContactError> {
        Contact::new(
            *point_in_object,
            inward_normal_in_object.into_inner(),
            scene.friction.min(friction_max),
        )?
        .with_torsion(torsional_m)?
        .with_max_force(scene.hand.tip_force_max_n)
    };
    // Only a friction coefficient that is no number gets here: points and normals are finite.
    contact().map_err(|_| Rejection::Undecided)
}
