//! What an attempt comes to: a grasp with its contacts, or the reason why not.

use super::super::settle::Site;
use crate::grasp::{Contact, Quality};
use crate::hand::{Hand, Part, Posture};

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
