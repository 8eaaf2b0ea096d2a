//! What came of it.

use core::fmt;

use nalgebra::Isometry3;
use protocol::ids::{FINGER_COUNT, FingerId, JOINT_COUNT};

use super::phase::Phase;
use crate::link::{HandFault, TipWrench};

/// How an execution ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// Lifted, held, shaken, and put down where it had stood.
    Held,
    /// Still in the hand, but it moved in it by more than allowed.
    Slipped,
    /// Lifted, then lost.
    Dropped,
    /// Lost while it was shaken.
    DroppedInShake,
    /// It stayed on the table.
    NotLifted,
    /// It was pushed away before the fingers had closed.
    Disturbed,
    /// A fingertip touched something on the way in: the hand stopped and went back.
    Obstructed,
    /// The fingers closed and did not find the object: the hand opened and went back.
    Missed,
    /// The fingertips felt slip that the tightest grip did not stop: the object was put down at once.
    SlipNotStopped,
    /// Held, but it does not stand where it was put down.
    Misplaced,
    /// Put down, but it came away with the open hand.
    NotReleased,
    /// The hand reported a fault: arm and fingers stayed where they were.
    Faulted,
    /// The link was lost; nobody knows what the hand does now.
    LinkLost,
}

impl Verdict {
    /// Lower-case name, as in reports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Held => "held",
            Self::Slipped => "slipped",
            Self::Dropped => "dropped",
            Self::DroppedInShake => "dropped-in-shake",
            Self::NotLifted => "not-lifted",
            Self::Disturbed => "disturbed",
            Self::Obstructed => "obstructed",
            Self::Missed => "missed",
            Self::SlipNotStopped => "slip-not-stopped",
            Self::Misplaced => "misplaced",
            Self::NotReleased => "not-released",
            Self::Faulted => "faulted",
            Self::LinkLost => "link-lost",
        }
    }
}

/// Something worth telling.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum EventKind {
    /// A phase begins.
    Phase(Phase),
    /// A fingertip feels a contact.
    Contact(FingerId),
    /// A fingertip feels a contact while the palm still moves to the grasp site.
    UnexpectedContact(FingerId),
    /// A fingertip is at the edge of its friction cone, and the grip is tightened.
    Slip(FingerId),
    /// A fingertip that was in contact feels nothing any more.
    ContactLost(FingerId),
    /// The course is left.
    Trouble(Trouble),
    /// The hand does not follow any more; arm and fingers are to stay where they are.
    Fault(HandFault),
    /// The link gave no answer.
    LinkLost,
}

impl fmt::Display for EventKind {
    /// As in reports: `lift`, `contact index`, `slip thumb`, `lost`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (what, finger) = match self {
            Self::Phase(phase) => return f.write_str(phase.name()),
            Self::Trouble(trouble) => return f.write_str(trouble.name()),
            Self::Fault(fault) => return write!(f, "{fault}"),
            Self::LinkLost => return f.write_str("link-lost"),
            Self::Contact(finger) => ("contact", finger),
            Self::ContactLost(finger) => ("contact-lost", finger),
            Self::UnexpectedContact(finger) => ("unexpected-contact", finger),
            Self::Slip(finger) => ("slip", finger),
        };
        write!(f, "{what} {}", finger.name())
    }
}

/// Why an execution leaves its course for a safe end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Trouble {
    /// Something is in the way of the open hand: the palm stops and goes back as it came.
    Obstructed,
    /// Fewer than two fingers feel the object that they have closed on: they open, and the palm goes back.
    Missed,
    /// Fewer than two fingers feel the lifted object any more: the palm stops, the hand opens and stays above.
    Lost,
    /// Fewer than two fingers are firm and others slip at the tightest grip: the object is put down at once.
    SlipNotStopped,
}

impl Trouble {
    /// Lower-case name, as in reports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Obstructed => "obstructed",
            Self::Missed => "missed",
            Self::Lost => "lost",
            Self::SlipNotStopped => "slip-not-stopped",
        }
    }

    /// What happened and what the hand did about it, in words.
    #[must_use]
    pub const fn explanation(self) -> &'static str {
        match self {
            Self::Obstructed => {
                "a fingertip touched something on the way in: the palm stopped and went back, hand open"
            }
            Self::Missed => {
                "the fingers closed and fewer than two felt the object: the hand opened and went back"
            }
            Self::Lost => {
                "fewer than two fingers felt the lifted object any more: the palm stopped, the hand opened above"
            }
            Self::SlipNotStopped => {
                "fewer than two fingers were firm at the tightest grip: the object was put down at once"
            }
        }
    }
}

/// An event and its time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Event {
    /// Time since the start of the execution.
    pub time_s: f64,
    /// What happened.
    pub kind: EventKind,
}

/// The state of the execution at one time.
#[derive(Debug, Clone, PartialEq)]
pub struct TraceSample {
    /// Time since the start of the execution.
    pub time_s: f64,
    /// Part of the execution.
    pub phase: Phase,
    /// Commanded pose of the palm.
    pub base_from_palm: Isometry3<f64>,
    /// Commanded joint angles, order of `JointId`.
    pub commanded_rad: [f64; JOINT_COUNT],
    /// Measured joint angles.
    pub measured_rad: [f64; JOINT_COUNT],
    /// Measured joint torques, N m.
    pub joint_torque_nm: [f64; JOINT_COUNT],
    /// Measured wrench on each fingertip, not filtered, axes of the distal link.
    pub tip_wrench: [TipWrench; FINGER_COUNT],
    /// Filtered force on each fingertip.
    pub tip_force_n: [f64; FINGER_COUNT],
    /// Tangential over normal force at each fingertip, divided by the planned friction: 1 is slip. `None` without contact.
    pub slip_ratio: [Option<f64>; FINGER_COUNT],
    /// True pose of the object, where it is known.
    pub base_from_object: Option<Isometry3<f64>>,
}

/// What came of a plan.
#[derive(Debug, Clone, PartialEq)]
pub struct Execution {
    /// How it ended.
    pub verdict: Verdict,
    /// How the hand's own sensors say that it ended: what a robot can act on that nobody watches.
    pub felt: Verdict,
    /// Why the course was left, if it was.
    pub trouble: Option<Trouble>,
    /// How far the object moved while the fingers closed, where its true place is known.
    pub shift_m: Option<f64>,
    /// How far the object's centre had risen by the end of the hold, or at most if it did not get there.
    pub lift_height_m: Option<f64>,
    /// How far the object moved in the palm frame from the squeeze to the end of hold and shake, the larger of both.
    pub slip_m: Option<f64>,
    /// How far from where it stood at first the object was put down.
    pub misplaced_m: Option<f64>,
    /// The greatest multiple of the planned grip that the slip reflex asked for.
    pub grip_max: f64,
    /// Where the object is at the end, where that is known.
    pub base_from_object: Option<Isometry3<f64>>,
    /// Simulated or real time that it took.
    pub duration_s: f64,
    /// What happened, in order.
    pub events: Vec<Event>,
    /// The course of it.
    pub trace: Vec<TraceSample>,
}
