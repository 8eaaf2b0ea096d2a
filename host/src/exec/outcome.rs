//! What came of it.

use nalgebra::Isometry3;
use protocol::ids::{FINGER_COUNT, FingerId, JOINT_COUNT};

use crate::link::HandFault;

/// How an execution ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// Lifted and held where it was grasped.
    Held,
    /// Still in the hand, but it moved in it by more than allowed.
    Slipped,
    /// Lifted, then lost.
    Dropped,
    /// It stayed on the table.
    NotLifted,
    /// It was pushed away before the fingers had closed.
    Disturbed,
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
            Self::NotLifted => "not-lifted",
            Self::Disturbed => "disturbed",
            Self::Faulted => "faulted",
            Self::LinkLost => "link-lost",
        }
    }
}

/// Parts of an execution, in their order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// At the approach site: the hand takes its pregrasp and the thumb its rotation.
    Prepare,
    /// Straight to the grasp site.
    Advance,
    /// All fingers to the surface.
    Close,
    /// The grip grows.
    Squeeze,
    /// Straight up.
    Lift,
    /// Still.
    Hold,
}

impl Phase {
    /// All phases in their order.
    pub const ALL: [Self; 6] =
        [Self::Prepare, Self::Advance, Self::Close, Self::Squeeze, Self::Lift, Self::Hold];
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
    /// The hand does not follow any more; arm and fingers are to stay where they are.
    Fault(HandFault),
    /// The link gave no answer.
    LinkLost,
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
    /// Filtered force on each fingertip.
    pub tip_force_n: [f64; FINGER_COUNT],
    /// True pose of the object, where it is known.
    pub base_from_object: Option<Isometry3<f64>>,
}

/// What came of a plan.
#[derive(Debug, Clone, PartialEq)]
pub struct Execution {
    /// How it ended.
    pub verdict: Verdict,
    /// How far the object's centre rose, where its true place is known.
    pub lift_height_m: Option<f64>,
    /// How far the object moved in the palm frame since the grip stood, where that is known.
    pub slip_m: Option<f64>,
    /// Simulated or real time that it took.
    pub duration_s: f64,
    /// What happened, in order.
    pub events: Vec<Event>,
    /// The course of it.
    pub trace: Vec<TraceSample>,
}
