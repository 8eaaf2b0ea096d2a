//! One grasp attempt: place the palm, check reach and collisions, close the fingers, take contacts, evaluate.

use hand_model::{FingerAngles, FingerInverse, FingerTrig, HandAngles, inverse_angles, tip};
use nalgebra::{Isometry3, Point3, Translation3, Vector3};
use protocol::ids::FingerId;

use super::arm::Inverse;
use super::candidates::{Candidate, ContactKind, SOFT_TIP_TORSION_M, open_finger};
use super::closing::{Closing, ClosingScratch, Touch, close_finger};
use super::hand_body::Link;
use super::scene::{Scene, TABLE_CLEARANCE_M};
use super::settle::Site;
use crate::grasp::{Closure, Contact, ContactError, Quality, Workspace, evaluate};

/// Least cosine between a finger's push and its pad's normal, for the distal link, whose rubber covers the pad only: 75
/// degrees round the finger.
const PAD_COSINE_MIN: f64 = 0.26;

/// The same for the tip, whose rubber is a cap: its front half and ten degrees more.
const TIP_COSINE_MIN: f64 = -0.17;

/// How far the tips stand off their contacts before they close, metres, widest first: room for errors of scan, arm and
/// calibration, as much as object, table and joint limits leave.
const STAND_OFF_M: [f64; 3] = [0.025, 0.015, 0.008];

/// Least step of a bead along the approach, metres: it may so dive by less than this under a grazed surface.
const TRACE_STEP_MIN_M: f64 = 2.0e-4;

/// Overlap of beads of two fingers that is still no collision, metres: the chains are rounder than the links.
const SELF_OVERLAP_M: f64 = 0.002;

/// A grasp that passed every check.
#[derive(Debug, Clone)]
pub struct Grasp {
    /// Index into [`typical`](super::candidates::typical).
    pub candidate: usize,
    /// Where the palm is and from where it came, object frame.
    pub site: Site,
    /// Tips standing off their contacts along the normals, as at the approach site.
    pub pregrasp: HandAngles<f64>,
    /// All used fingers touching; joint angles inside the soft limits.
    pub grasp: HandAngles<f64>,
    /// One contact for each used finger, in the order of [`FingerId`].
    pub contacts: Vec<GraspContact>,
    /// Force-closure quality in the scene's convention.
    pub quality: Quality,
    /// Mean epsilon over sampled errors of the pose, where a search measured it.
    pub expected_epsilon: Option<f64>,
}

/// A contact and who makes it.
#[derive(Debug, Clone)]
pub struct GraspContact {
    /// The finger.
    pub finger: FingerId,
    /// Its link.
    pub link: Link,
    /// Point, inward normal and friction, object frame.
    pub contact: Contact,
}

/// Why an attempt is no grasp, in the order in which the checks run: a later reason came further.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Rejection {
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
    /// The palm cuts the object at the grasp or on the way there.
    PalmHitsObject,
    /// A finger that stands off, or is not used, touches the object at the grasp site or on the way there.
    FingerHitsObject,
}

impl Rejection {
    /// All reasons, in order.
    pub const ALL: [Self; 10] = [
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
    ];

    /// Key in the plan document.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
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
        }
    }
}

/// Room that one thread keeps between attempts.
#[derive(Default)]
pub struct AttemptScratch {
    closing: ClosingScratch,
    centers: Vec<Point3<f64>>,
    other_centers: Vec<Point3<f64>>,
    contacts: Vec<Contact>,
    quality: Workspace,
}

impl AttemptScratch {
    /// Room for the bead centres of one finger.
    pub(super) fn centers_mut(&mut self) -> &mut Vec<Point3<f64>> {
        &mut self.centers
    }
}

/// How the fingers of an attempt ended; the paper's search moves the palm by it until all touch together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Closed {
    /// By [`FingerId::index`]; `None` for fingers that the candidate does not use.
    pub fingers: [Option<Closing>; 4],
}

impl Closed {
    /// The touches, in finger order.
    pub fn touches(&self) -> impl Iterator<Item = (FingerId, Touch)> + '_ {
        FingerId::ALL.into_iter().filter_map(|finger| match self.fingers[finger.index()] {
            Some(Closing::Touches(touch)) => Some((finger, touch)),
            _ => None,
        })
    }
}

/// Closes the used fingers about the object, the palm held still.
#[must_use]
pub fn close_hand(scene: &Scene, site: &Site, scratch: &mut AttemptScratch) -> Closed {
    let fingers = FingerId::ALL.map(|finger| {
        let path = site.preshape.paths[finger.index()].as_ref()?;
        let palm_from_base = scene.hand.palm_from_finger_base(finger, site.preshape.thumb_rotation_rad);
        let object_from_base = site.object_from_palm * palm_from_base;
        Some(close_finger(&scene.surface, &scene.hand, &object_from_base, path, &mut scratch.closing))
    });
    Closed { fingers }
}

/// Tries one grasp: `candidate` (number `index`) with the palm at `site`.
///
/// Errors with the first check that failed, in the order of [`Rejection`].
pub fn attempt(
    scene: &Scene,
    index: usize,
    candidate: &Candidate,
    site: &Site,
    scratch: &mut AttemptScratch,
) -> Result<Grasp, Rejection> {
    if !reachable(scene, site) {
        return Err(Rejection::Unreachable);
    }
    let closed = close_hand(scene, site, scratch);
    let mut grasp = HandAngles {
        thumb_rotation_rad: candidate.thumb_rotation_rad,
        fingers: candidate.abduction_rad.map(open_finger),
    };
    for finger in FingerId::ALL {
        match closed.fingers[finger.index()] {
            None => {}
            Some(Closing::Touches(touch)) => grasp.fingers[finger.index()] = touch.angles,
            Some(Closing::Misses) => return Err(Rejection::FingerMisses),
            Some(Closing::StartsInside) => return Err(Rejection::FingerInObject),
        }
    }
    let on_rubber = |touch: &Touch| match touch.link {
        Link::Tip => touch.pad_cosine >= TIP_COSINE_MIN,
        Link::Distal => touch.pad_cosine >= PAD_COSINE_MIN,
        Link::Proximal | Link::Middle => false,
    };
    if !closed.touches().all(|(_, touch)| on_rubber(&touch)) {
        return Err(Rejection::NotOnPad);
    }
    let torsional_m = match candidate.contact {
        ContactKind::Hard => 0.0,
        ContactKind::Soft => SOFT_TIP_TORSION_M,
    };
    let contacts = closed
        .touches()
        .map(|(finger, touch)| {
            // Only a friction coefficient that is no number gets here: points and normals are finite.
            let contact = contact(scene, &touch, torsional_m).map_err(|_| Rejection::Undecided)?;
            Ok(GraspContact { finger, link: touch.link, contact })
        })
        .collect::<Result<Vec<_>, Rejection>>()?;
    scratch.contacts.clear();
    scratch.contacts.extend(contacts.iter().map(|c| c.contact));
    let closure = evaluate(&scratch.contacts, &scene.wrench_reference, &scene.quality, &mut scratch.quality);
    let quality = match (closure.quality(), closure) {
        (Some(quality), _) => *quality,
        (None, Closure::None(_)) => return Err(Rejection::NoForceClosure),
        (None, _) => return Err(Rejection::Undecided),
    };
    let pregrasp = open_up(scene, candidate, site, &closed, &mut grasp, scratch)?;
    Ok(Grasp {
        candidate: index,
        site: site.clone(),
        pregrasp,
        grasp,
        contacts,
        quality,
        expected_epsilon: None,
    })
}

/// Finds the posture for the way to the object: tips standing off their contacts as far as there is room, fingers that
/// are not used stretched or, where that is in the way, curled (in `grasp` too). Errors with the last obstacle.
fn open_up(
    scene: &Scene,
    candidate: &Candidate,
    site: &Site,
    closed: &Closed,
    grasp: &mut HandAngles<f64>,
    scratch: &mut AttemptScratch,
) -> Result<HandAngles<f64>, Rejection> {
    let mut obstacle = Rejection::FingerHitsObject;
    for idle in [open_finger(0.0), curled_finger(scene)] {
        for finger in FingerId::ALL.into_iter().filter(|f| !candidate.uses[f.index()]) {
            grasp.fingers[finger.index()] = idle;
        }
        if !clear_of_table(scene, &site.object_from_palm, grasp, &mut scratch.centers) {
            obstacle = Rejection::HitsTable;
            continue;
        }
        if fingers_collide(scene, grasp, scratch) {
            obstacle = Rejection::FingersCollide;
            continue;
        }
        for stand_off_m in STAND_OFF_M {
            let Some(pregrasp) = stand_off(scene, site, closed, grasp, stand_off_m) else { continue };
            match free_approach(scene, site, &pregrasp, scratch) {
                Ok(()) => return Ok(pregrasp),
                Err(reason) => obstacle = reason,
            }
        }
    }
    Err(obstacle)
}

/// The grasp with every touching tip drawn back from its contact along the normal; `None` when a finger's limits do not
/// let it.
fn stand_off(
    scene: &Scene,
    site: &Site,
    closed: &Closed,
    grasp: &HandAngles<f64>,
    stand_off_m: f64,
) -> Option<HandAngles<f64>> {
    let model = &scene.hand.model;
    let mut opened = *grasp;
    for (finger, touch) in closed.touches() {
        let object_from_base =
            site.object_from_palm * scene.hand.palm_from_finger_base(finger, grasp.thumb_rotation_rad);
        let back = object_from_base
            .inverse_transform_vector(&(-stand_off_m * touch.inward_normal_in_object.into_inner()));
        let tip_in_base = tip(&model.finger, &FingerTrig::new(&touch.angles, f64::sin_cos)) + back;
        match inverse_angles(&model.finger, &model.soft_limits, finger, &tip_in_base, f64::atan2) {
            FingerInverse::Reached(angles) => opened.fingers[finger.index()] = angles,
            _ => return None,
        }
    }
    Some(opened)
}

fn contact(scene: &Scene, touch: &Touch, torsional_m: f64) -> Result<Contact, ContactError> {
    Contact::new(touch.point_in_object, touch.inward_normal_in_object.into_inner(), scene.friction)?
        .with_torsion(torsional_m)?
        .with_max_force(scene.hand.model.drive.tip_force_max_n)
}

/// A finger folded against the palm.
fn curled_finger(scene: &Scene) -> FingerAngles<f64> {
    let [flexion_rad, middle_rad] = scene.hand.flexion_limit_rad();
    FingerAngles { abduction_rad: 0.0, flexion_rad, middle_rad }
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
        matches!(arm.palm_solutions_near(base_from_palm, &[0.0; 6]), Inverse::Solutions(_))
    })
}

/// Checks palm and open fingers at the grasp site and along the straight line from the approach site.
fn free_approach(
    scene: &Scene,
    site: &Site,
    open: &HandAngles<f64>,
    scratch: &mut AttemptScratch,
) -> Result<(), Rejection> {
    let back = -site.direction_in_object.into_inner();
    // The table is below the grasp site or below nothing: both ends of the way stand for all of it.
    for back_m in [0.0, scene.approach_m] {
        let object_from_palm = Translation3::from(back * back_m) * site.object_from_palm;
        if !clear_of_table(scene, &object_from_palm, open, &mut scratch.centers) {
            return Err(Rejection::HitsTable);
        }
    }
    // The palm is thick: stations a third of a fingertip's diameter apart miss nothing that it could hit.
    let spacing_m = scene.hand.model.finger.tip_radius_m * 2.0 / 3.0;
    let stations = (scene.approach_m / spacing_m).ceil() as usize;
    for station in 0..=stations {
        let back_m = scene.approach_m * station as f64 / stations as f64;
        let object_from_box =
            Translation3::from(back * back_m) * site.object_from_palm * scene.hand.palm_from_box;
        let inside = || {
            let middle = Point3::from(object_from_box.translation.vector);
            scene.surface.nearest(&middle).signed_distance_m < 0.0
        };
        if scene.surface.cuts_box(&object_from_box, &scene.hand.palm_half_extents_m) || inside() {
            return Err(Rejection::PalmHitsObject);
        }
    }
    for finger in FingerId::ALL {
        let base = site.object_from_palm * scene.hand.palm_from_finger_base(finger, open.thumb_rotation_rad);
        scene.hand.bead_centers(&open.fingers[finger.index()], &mut scratch.centers);
        for (bead, center) in scene.hand.beads().iter().zip(&scratch.centers) {
            // Sphere tracing: the bead may move back by its own clearance before it needs another look.
            let start = base * center;
            let mut back_m = 0.0;
            while back_m <= scene.approach_m {
                let clearance_m =
                    scene.surface.nearest(&(start + back * back_m)).signed_distance_m - bead.radius_m;
                if clearance_m <= 0.0 {
                    return Err(Rejection::FingerHitsObject);
                }
                back_m += clearance_m.max(TRACE_STEP_MIN_M);
            }
        }
    }
    Ok(())
}

/// Whether palm and fingers stay above the table; true without a table.
fn clear_of_table(
    scene: &Scene,
    object_from_palm: &Isometry3<f64>,
    angles: &HandAngles<f64>,
    centers: &mut Vec<Point3<f64>>,
) -> bool {
    let Some(table_height_m) = scene.table_height_m else { return true };
    let base_from_palm = scene.base_from_object * object_from_palm;
    let base_from_box = base_from_palm * scene.hand.palm_from_box;
    let half = scene.hand.palm_half_extents_m;
    let up_in_box = base_from_box.inverse_transform_vector(&Vector3::z());
    let lowest_m = base_from_box.translation.z - half.dot(&up_in_box.abs());
    if lowest_m < table_height_m + TABLE_CLEARANCE_M {
        return false;
    }
    FingerId::ALL.into_iter().all(|finger| {
        let base = base_from_palm * scene.hand.palm_from_finger_base(finger, angles.thumb_rotation_rad);
        scene.hand.bead_centers(&angles.fingers[finger.index()], centers);
        scene
            .hand
            .beads()
            .iter()
            .zip(centers.iter())
            .all(|(bead, center)| (base * center).z - bead.radius_m >= table_height_m + TABLE_CLEARANCE_M)
    })
}

/// Whether beads of two different fingers overlap by more than the tolerance.
fn fingers_collide(scene: &Scene, angles: &HandAngles<f64>, scratch: &mut AttemptScratch) -> bool {
    let beads = scene.hand.beads();
    for (i, first) in FingerId::ALL.into_iter().enumerate() {
        let first_base = scene.hand.palm_from_finger_base(first, angles.thumb_rotation_rad);
        scene.hand.bead_centers(&angles.fingers[first.index()], &mut scratch.centers);
        scratch.centers.iter_mut().for_each(|c| *c = first_base * *c);
        for second in FingerId::ALL.into_iter().skip(i + 1) {
            let second_base = scene.hand.palm_from_finger_base(second, angles.thumb_rotation_rad);
            scene.hand.bead_centers(&angles.fingers[second.index()], &mut scratch.other_centers);
            for (bead, center) in beads.iter().zip(&scratch.centers) {
                for (other_bead, other) in beads.iter().zip(&scratch.other_centers) {
                    let least_m = bead.radius_m + other_bead.radius_m - SELF_OVERLAP_M;
                    if (center - second_base * other).norm_squared() < least_m * least_m {
                        return true;
                    }
                }
            }
        }
    }
    false
}
