//! One grasp attempt: place the palm, check reach and collisions, close the fingers, take contacts, evaluate.
//!
//! An attempt that is refused before it asks the arm last allocates nothing once its room, the [`AttemptScratch`] of its
//! thread, has grown.

use nalgebra::{Isometry3, Point3, Translation3, Unit, Vector3};

use super::approach::{fingers_collide, free_approach, hand_clear_of_table, palm_clear};
use super::arm::{Inverse, Joints};
use super::best::rank::Errors;
use super::closing::{Closing, Touch, close_finger};
use super::hand_shape::HandShape;
use super::obstacles::{ObjectPlace, Obstacles};
use super::preshape::PATH_M;
use super::scene::Scene;
use super::settle::Site;
use super::wrap::wrap;
use crate::grasp::{Closure, Contact, ContactError, Quality, Workspace, evaluate};
use crate::hand::{Candidate, ContactKind, Hand, MAX_FINGERS, Part, Posture};

/// Least cosine between a finger's push and its pad's normal, for the distal link, whose rubber covers the pad only: 75
/// degrees round the finger.
const PAD_COSINE_MIN: f64 = 0.26;

/// The same for the tip, whose rubber is a cap: its front half and ten degrees more.
const TIP_COSINE_MIN: f64 = -0.17;

/// Between two sites some ten centimetres apart a joint turns by less than this while the arm keeps its configuration, rad.
const SAME_CONFIGURATION_RAD: f64 = 1.2;

/// How far the tips stand off their contacts before they close, metres, widest first: room for errors of scan, arm and
/// calibration, as much as object, table and joint limits leave.
const STAND_OFF_M: [f64; 3] = [0.025, 0.015, 0.008];

/// Of its way back along its path, a tip leaves the surface by at least this share.
const OFF_COSINE_MIN: f64 = 0.3;

/// A grasp that passed every check.
#[derive(Debug, Clone)]
pub struct Grasp {
    /// Index into the hand's candidates.
    pub candidate: usize,
    /// Where the palm is and from where it came, object frame.
    pub site: Site,
    /// Tips standing off their contacts along the normals, as at the approach site.
    pub pregrasp: Posture,
    /// All used fingers touching; joint angles inside the limits.
    pub grasp: Posture,
    /// Where the hand touches: the palm first, then finger by finger.
    pub contacts: Vec<GraspContact>,
    /// Force-closure quality in the scene's convention.
    pub quality: Quality,
    /// What the ranking knows of it beyond its quality, where a search measured it.
    pub robustness: Option<Robustness>,
}

/// How a grasp fares when things are not quite as planned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Robustness {
    /// Share of sampled errors of pose, friction and shape under which the fingers still close by force.
    pub closure_chance: f64,
    /// Mean epsilon over the samples, lost closure counting as 0.
    pub expected_epsilon: f64,
    /// Least distance of a joint of the used fingers from its limits, as a share of its range; held joints do not count.
    pub limit_margin: f64,
    /// Share of the contacts on surface that was measured rather than completed.
    pub seen_share: f64,
    /// What the ranking sorts by.
    pub score: f64,
}

/// A contact and who makes it.
#[derive(Debug, Clone, Copy)]
pub struct GraspContact {
    /// Index of the finger; `None` for the palm.
    pub finger: Option<usize>,
    /// Which of the finger's beads; 0 for the palm.
    pub bead: usize,
    /// Point, inward normal and friction, object frame.
    pub contact: Contact,
}

impl GraspContact {
    /// Name of the finger, or `palm`.
    #[must_use]
    pub fn finger_name<'h>(&self, hand: &'h Hand) -> &'h str {
        self.finger.map_or("palm", |finger| &hand.fingers[finger].name)
    }

    /// Name of the touching link, as in the hand's description; `palm` for the palm.
    #[must_use]
    pub fn link_name<'h>(&self, hand: &'h Hand) -> &'h str {
        self.finger.map_or("palm", |finger| {
            let chain = &hand.fingers[finger];
            chain.link_of(&chain.beads()[self.bead])
        })
    }

    /// Whether a fingertip or the pad before it touches.
    #[must_use]
    pub fn is_pad(&self, hand: &Hand) -> bool {
        self.finger.is_some_and(|finger| hand.fingers[finger].beads()[self.bead].part != Part::Inner)
    }
}

/// Why an attempt is no grasp, in the order in which the checks run: a later reason came further.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Rejection {
    /// The palm is in the table or cuts the object where the fingers would close.
    PalmBlocked,
    /// The arm cannot bring the palm to the grasp, the approach or the lifted site.
    Unreachable,
    /// A used finger is in the object before it closes.
    FingerInObject,
    /// A used finger closes in the air.
    FingerMisses,
    /// A finger touches with its side or back, or with a link that a precision grasp does not use.
    NotOnPad,
    /// The contacts do not close by force.
    NoForceClosure,
    /// The metric's iteration cap came before a decision on force closure.
    Undecided,
    /// Palm or fingers go below the table's top.
    HitsTable,
    /// Two fingers collide.
    FingersCollide,
    /// The palm cuts the object on the way there.
    PalmHitsObject,
    /// A finger that stands off, or is not used, touches the object at the grasp site or on the way there.
    FingerHitsObject,
    /// The arm changes its configuration between the sites, or its links touch table or object at one.
    ArmBlocked,
}

impl Rejection {
    /// All reasons, in order.
    pub const ALL: [Self; 12] = [
        Self::PalmBlocked,
        Self::Unreachable,
        Self::FingerInObject,
        Self::FingerMisses,
        Self::NotOnPad,
        Self::NoForceClosure,
        Self::Undecided,
        Self::HitsTable,
        Self::FingersCollide,
        Self::PalmHitsObject,
        Self::FingerHitsObject,
        Self::ArmBlocked,
    ];

    /// Key in the plan document.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::PalmBlocked => "palm-blocked",
            Self::Unreachable => "unreachable",
            Self::FingerInObject => "finger-in-object",
            Self::FingerMisses => "finger-misses",
            Self::NotOnPad => "not-on-pad",
            Self::NoForceClosure => "no-force-closure",
            Self::Undecided => "undecided",
            Self::HitsTable => "hits-table",
            Self::FingersCollide => "fingers-collide",
            Self::PalmHitsObject => "palm-hits-object",
            Self::FingerHitsObject => "finger-hits-object",
            Self::ArmBlocked => "arm-blocked",
        }
    }
}

/// Room that one thread keeps between attempts.
#[derive(Default)]
pub struct AttemptScratch {
    contacts: Vec<Contact>,
    touches: Vec<GraspContact>,
    quality: Workspace,
}

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

/// Takes the touches of a closed hand, all of which have to be of rubber, and the joint angles of the touching fingers.
fn touch_with_tips(
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

/// Whether palm and arm could be at a site at all; what fingers do there is another question.
#[must_use]
pub fn is_open_to(scene: &Scene, candidate: &Candidate, site: &Site) -> bool {
    // A palm that is to touch is seated later.
    (candidate.wraps || palm_clear(scene, &site.object_from_palm).is_ok()) && reachable(scene, site)
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
    if candidate.wraps {
        scratch.touches.clear();
        wrap(scene, candidate, site, &mut scratch.touches).ok()?;
        for (index, touch) in scratch.touches.iter().enumerate() {
            let planned = &touch.contact;
            let point = planned.point_in_object();
            let is_seen = scene.seen.as_ref().is_none_or(|seen| seen.is_seen(&point));
            let (point, normal) = errors.moved(index, &point, &planned.inward_normal_in_object(), is_seen);
            let contact = Contact::new(point, normal.into_inner(), planned.friction() * errors.friction);
            scratch.contacts.push(contact.ok()?);
        }
        let closure =
            evaluate(&scratch.contacts, &scene.wrench_reference, &scene.quality, &mut scratch.quality);
        return closure.quality().map(Quality::epsilon);
    }
    let closed = close_hand(scene, candidate, site);
    let torsional_m = torsion(&scene.hand, candidate);
    for finger in candidate.fingers() {
        let Some(Closing::Touches(touch)) = closed.fingers[finger] else { return None };
        if !on_rubber(&touch) {
            return None;
        }
        let is_seen = scene.seen.as_ref().is_none_or(|seen| seen.is_seen(&touch.point_in_object));
        let (point, normal) =
            errors.moved(finger, &touch.point_in_object, &touch.inward_normal_in_object, is_seen);
        let contact = Contact::new(point, normal.into_inner(), scene.friction * errors.friction)
            .and_then(|contact| contact.with_torsion(torsional_m));
        scratch.contacts.push(contact.ok()?);
    }
    let closure = evaluate(&scratch.contacts, &scene.wrench_reference, &scene.quality, &mut scratch.quality);
    closure.quality().map(Quality::epsilon)
}

/// Whether a finger touches with what is made for it.
fn on_rubber(touch: &Touch) -> bool {
    match touch.part {
        Part::Tip => touch.pad_cosine >= TIP_COSINE_MIN,
        Part::Distal => touch.pad_cosine >= PAD_COSINE_MIN,
        Part::Inner => false,
    }
}

fn torsion(hand: &Hand, candidate: &Candidate) -> f64 {
    match candidate.contact {
        ContactKind::Hard => 0.0,
        ContactKind::Soft => hand.soft_tip_torsion_m,
    }
}

/// Takes over the joints of one finger, held ones left out.
fn take_finger(hand: &Hand, finger: usize, from: &Posture, onto: &mut Posture) {
    for &joint in hand.fingers[finger].joints() {
        if !hand.joints[joint].is_held {
            onto[joint] = from[joint];
        }
    }
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

/// Finds the posture for the way to the object: used fingers opened by `opened` as far as there is room (it is given one
/// of [`STAND_OFF_M`] and the joints of the fingers that are not used are put onto what it returns), fingers that are not
/// used stretched or, where that is in the way, folded (in `grasp` too). Errors with the last obstacle.
fn around(
    scene: &Scene,
    candidate: &Candidate,
    site: &Site,
    closed: &Posture,
    grasp: &mut Posture,
    opened: &dyn Fn(f64) -> Option<Posture>,
) -> Result<Posture, Rejection> {
    let mut obstacle = Rejection::FingerHitsObject;
    let idle = || (0..scene.hand.fingers.len()).filter(|&f| !candidate.uses[f]);
    for is_folded in [false, true] {
        for finger in idle() {
            take_finger(&scene.hand, finger, &candidate.open, grasp);
            if is_folded {
                fold(&scene.hand, finger, grasp);
            }
        }
        if !hand_clear_of_table(scene, &site.object_from_palm, grasp) {
            obstacle = Rejection::HitsTable;
        } else if fingers_collide(scene, grasp) {
            obstacle = Rejection::FingersCollide;
        } else {
            for stand_off_m in STAND_OFF_M {
                let Some(mut pregrasp) = opened(stand_off_m) else { continue };
                for finger in idle() {
                    take_finger(&scene.hand, finger, grasp, &mut pregrasp);
                }
                match free_approach(scene, site, &pregrasp) {
                    Ok(()) => return Ok(pregrasp),
                    Err(reason) => obstacle = reason,
                }
                if pregrasp == *closed {
                    break;
                }
            }
        }
        if idle().next().is_none() {
            break;
        }
    }
    Err(obstacle)
}

/// Folds a finger out of the way: its closing joints to where they end.
fn fold(hand: &Hand, finger: usize, onto: &mut Posture) {
    for &joint in hand.fingers[finger].joints() {
        let limits = &hand.joints[joint];
        match limits.flexes {
            Some(true) if !limits.is_held => onto[joint] = limits.upper_rad,
            Some(false) if !limits.is_held => onto[joint] = limits.lower_rad,
            _ => {}
        }
    }
}

/// The grasp with every touching tip drawn back from its contact along the normal, or along its path where it has too few
/// joints for that; `None` when a finger's limits do not let it.
fn stand_off(
    scene: &Scene,
    site: &Site,
    closed: &Closed,
    grasp: &Posture,
    stand_off_m: f64,
) -> Option<Posture> {
    let mut opened = *grasp;
    for (finger, touch) in closed.touches() {
        let chain = &scene.hand.fingers[finger];
        let back = site
            .object_from_palm
            .inverse_transform_vector(&(-stand_off_m * touch.inward_normal_in_object.into_inner()));
        let from = chain.tip_in_palm(&chain.frames(grasp));
        let found = if scene.hand.is_placeable(finger) {
            scene.hand.finger_inverse(finger, &(from + back), grasp)?
        } else {
            let opened = scene.hand.clamped(site.preshape.with_finger_at(touch.u - stand_off_m / PATH_M));
            // Somewhere off the contact, if not straight off it.
            let off = chain.tip_in_palm(&chain.frames(&opened)) - from;
            if off.dot(&back) < OFF_COSINE_MIN * back.norm() * back.norm() {
                return None;
            }
            opened
        };
        take_finger(&scene.hand, finger, &found, &mut opened);
    }
    Some(opened)
}

/// A contact of the scene's friction, or of `friction_max` where that is less.
pub(super) fn contact_at(
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

/// Poses of the palm in the base frame at the approach site (behind the grasp site along the straight last way), the
/// grasp site, and after the lift straight up.
#[must_use]
pub fn palm_sites(scene: &Scene, site: &Site) -> [Isometry3<f64>; 3] {
    let grasp = scene.base_from_object * site.object_from_palm;
    let way = scene.base_from_object * site.direction_in_object.into_inner();
    [
        Translation3::from(-way * scene.approach_m) * grasp,
        grasp,
        Translation3::new(0.0, 0.0, scene.lift_m) * grasp,
    ]
}

/// Whether the arm has a posture for approach, grasp and lifted site; true without an arm.
fn reachable(scene: &Scene, site: &Site) -> bool {
    let Some(arm) = &scene.arm else { return true };
    palm_sites(scene, site).iter().all(|base_from_palm| {
        matches!(arm.palm_solutions_near(base_from_palm, &arm.params().rest_rad), Inverse::Solutions(_))
    })
}

/// Whether the arm can hold the palm at approach, grasp and lifted site in one configuration whose links clear table and
/// object there; true without an arm. The ways between are looked at when a grasp is written.
fn arm_stays_clear(scene: &Scene, site: &Site, open: &Posture, closed: &Posture) -> bool {
    let Some(arm) = &scene.arm else { return true };
    let [approach, grasp, lift] = palm_sites(scene, site);
    let rest_rad = &arm.params().rest_rad;
    let Inverse::Solutions(starts) = arm.palm_solutions_near(&approach, rest_rad) else { return false };
    let base_from_object = scene.base_from_object;
    let [open, closed] = [open, closed].map(|posture| HandShape::of(&scene.hand, posture));
    let obstacles = |hand, place| Obstacles::new(arm, hand, scene.table_height_m, &scene.surface, place);
    let coming = obstacles(&open, ObjectPlace::Target { base_from_object });
    let palm_from_object = site.object_from_palm.inverse();
    let going = obstacles(&closed, ObjectPlace::Held { palm_from_object });
    starts.iter().any(|start| {
        let next = |pose: &Isometry3<f64>, from: &Joints| match arm.palm_solutions_near(pose, from) {
            Inverse::Solutions(found) => found.first().map(|solution| solution.q_rad),
            _ => None,
        };
        let is_near =
            |a: &Joints, b: &Joints| a.iter().zip(b).all(|(a, b)| (a - b).abs() < SAME_CONFIGURATION_RAD);
        let Some(at_grasp) = next(&grasp, &start.q_rad).filter(|q| is_near(q, &start.q_rad)) else {
            return false;
        };
        let Some(at_lift) = next(&lift, &at_grasp).filter(|q| is_near(q, &at_grasp)) else { return false };
        let is_clear = |obstacles: &Obstacles<'_>, q: &Joints| obstacles.clash_at(q).is_none();
        is_clear(&coming, &start.q_rad) && is_clear(&coming, &at_grasp) && is_clear(&going, &at_lift)
    })
}
