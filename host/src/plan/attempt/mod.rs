//! One grasp attempt: place the palm, check reach and collisions, close the fingers, take contacts, evaluate.
//!
//! An attempt that is refused before it asks the arm last allocates nothing once its room, the [`AttemptScratch`] of its
//! thread, has grown.

mod closed;
mod grasp;
mod opening;
mod reach;

use nalgebra::Isometry3;

use super::approach::palm_clear;
use super::best::rank::Errors;
use super::scene::Scene;
use super::settle::Site;
use super::wrap::{may_be_seated, wrap};
use crate::grasp::{Closure, Contact, Quality, Workspace, evaluate};
use crate::hand::{Candidate, Posture};
pub(super) use closed::contact_at;
use closed::touch_with_tips;
pub use closed::{Closed, close_hand};
pub use grasp::{Grasp, GraspContact, Rejection, Robustness};
pub(super) use opening::take_finger;
use opening::{around, stand_off};
pub use reach::palm_sites;
use reach::{arm_stays_clear, reachable};

/// Room that one thread keeps between attempts.
#[derive(Default)]
pub struct AttemptScratch {
    contacts: Vec<Contact>,
    touches: Vec<GraspContact>,
    quality: Workspace,
}

/// A hand that has closed: where its palm is then, and its joints.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Seat {
    pub(super) object_from_palm: Isometry3<f64>,
    pub(super) posture: Posture,
}

/// Tries one grasp: `candidate` (number `index` of the hand's) with the palm at `site`.
///
/// Errors with the first check that failed, in the order of [`Rejection`].
pub fn attempt(
    scene: &Scene,
    index: usize,
    candidate: &Candidate,
    site: &Site,
    scratch: &mut AttemptScratch,
) -> Result<Grasp, Rejection> {
    // Cheapest first: what already stands in the way needs no arm and no fingers.
    if !candidate.wraps {
        palm_clear(scene, &site.object_from_palm)?;
    }
    if !reachable(scene, site) {
        return Err(Rejection::Unreachable);
    }
    scratch.touches.clear();
    let (site, pregrasp, grasp, quality) = if candidate.wraps {
        let seat = wrap(scene, candidate, site, &mut scratch.touches)?;
        let site = Site { object_from_palm: seat.object_from_palm, ..*site };
        let quality = measure(scene, scratch)?;
        let mut grasp = seat.posture;
        let open = site.preshape.start;
        let pregrasp = around(scene, candidate, &site, &open, &mut grasp, &|_| Some(open))?;
        (site, pregrasp, grasp, quality)
    } else {
        let closed = close_hand(scene, candidate, site);
        let mut grasp = site.preshape.start;
        touch_with_tips(scene, candidate, site, &closed, &mut grasp, &mut scratch.touches)?;
        let quality = measure(scene, scratch)?;
        let fixed = grasp;
        let stand_off = |stand_off_m| stand_off(scene, site, &closed, &fixed, stand_off_m);
        let pregrasp = around(scene, candidate, site, &fixed, &mut grasp, &stand_off)?;
        (*site, pregrasp, grasp, quality)
    };
    // Dearer than all before, and seldom refused.
    if !arm_stays_clear(scene, &site, &pregrasp, &grasp) {
        return Err(Rejection::ArmBlocked);
    }
    let contacts = scratch.touches.clone();
    Ok(Grasp { candidate: index, site, pregrasp, grasp, contacts, quality, robustness: None })
}

/// Whether palm and arm could be at a site at all; what fingers do there is another question.
#[must_use]
pub fn is_open_to(scene: &Scene, candidate: &Candidate, site: &Site) -> bool {
    let is_clear = if candidate.wraps {
        may_be_seated(scene, candidate, site)
    } else {
        palm_clear(scene, &site.object_from_palm).is_ok()
    };
    is_clear && reachable(scene, site)
}

/// Epsilon of the contacts that the hand makes at `site` when friction and surface are not as planned; `None` where a
/// finger does not touch with its rubber or the contacts do not close.
pub(super) fn quality_with_errors(
    scene: &Scene,
    candidate: &Candidate,
    site: &Site,
    errors: &Errors,
    scratch: &mut AttemptScratch,
) -> Option<f64> {
    scratch.contacts.clear();
    scratch.touches.clear();
    let touches = &mut scratch.touches;
    if candidate.wraps {
        wrap(scene, candidate, site, touches).ok()?;
    } else {
        let closed = close_hand(scene, candidate, site);
        let mut grasp = site.preshape.start;
        touch_with_tips(scene, candidate, site, &closed, &mut grasp, touches).ok()?;
    }
    for (index, touch) in touches.iter().enumerate() {
        let planned = &touch.contact;
        let point = planned.point_in_object();
        let is_seen = scene.seen.as_ref().is_none_or(|seen| seen.is_seen(&point));
        // A finger that touches once meets the same error in every grasp.
        let error = if candidate.wraps { index } else { touch.finger.unwrap_or(index) };
        let (point, normal) = errors.moved(error, &point, &planned.inward_normal_in_object(), is_seen);
        let contact = Contact::new(point, normal.into_inner(), planned.friction() * errors.friction)
            .and_then(|contact| contact.with_torsion(planned.torsional_m()));
        scratch.contacts.push(contact.ok()?);
    }
    let closure = evaluate(&scratch.contacts, &scene.wrench_reference, &scene.quality, &mut scratch.quality);
    closure.quality().map(Quality::epsilon)
}

/// Quality of the contacts in `scratch`.
fn measure(scene: &Scene, scratch: &mut AttemptScratch) -> Result<Quality, Rejection> {
    scratch.contacts.clear();
    scratch.contacts.extend(scratch.touches.iter().map(|touch| touch.contact));
    let closure = evaluate(&scratch.contacts, &scene.wrench_reference, &scene.quality, &mut scratch.quality);
    match (closure.quality(), closure) {
        (Some(quality), _) => Ok(*quality),
        (None, Closure::None(_)) => Err(Rejection::NoForceClosure),
        (None, _) => Err(Rejection::Undecided),
    }
}
