//! What the executor needs of a hand on an arm, whichever it is: the simulated one, the firmware in an emulator, or the
//! real one.

pub mod address;
pub mod client;
pub mod emulator;
pub mod host_end;
pub mod port;

use core::fmt;

use nalgebra::{Isometry3, Point3, Vector3};
use protocol::fault::Code;
use protocol::ids::{FINGER_COUNT, FingerId, JOINT_COUNT};
use protocol::telemetry::FingerSet;
use thiserror::Error;

/// Why a link gave no report.
#[derive(Debug, Error)]
pub enum LinkError {
    /// The time step does not suit the far side.
    #[error("a step of {dt_s} s is not a whole number of control periods")]
    Step {
        /// The step asked for.
        dt_s: f64,
    },
    /// A command that cannot be sent.
    #[error("an angle or a torque of the command is not a number")]
    NotANumber,
    /// The other end is gone or does not answer.
    #[error("the link to the hand is lost")]
    Lost(#[source] Box<dyn core::error::Error + Send + Sync>),
}

/// Which law moves the thumb.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ThumbLaw {
    /// Joint by joint, as the other fingers.
    Position,
    /// As a spring and a damper at its tip.
    Impedance,
}

/// What is asked of the hand and the arm. Joints are in the order of `JointId`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Command {
    /// Joint angles.
    pub position_rad: [f64; JOINT_COUNT],
    /// Their speeds.
    pub velocity_rad_per_s: [f64; JOINT_COUNT],
    /// Torques to add.
    pub feed_forward_nm: [f64; JOINT_COUNT],
    /// The thumb's law.
    pub thumb: ThumbLaw,
    /// Where the palm is to be at the end of the step; a link with an arm finds its joints.
    pub base_from_palm: Isometry3<f64>,
}

/// Force and moment on a fingertip, in the axes of the distal link, the moment about the centre of the tip's sphere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TipWrench {
    /// Force, N.
    pub force: Vector3<f64>,
    /// Moment, N m.
    pub moment: Vector3<f64>,
}

impl TipWrench {
    /// Force, then moment.
    #[must_use]
    pub fn to_array(&self) -> [f64; 6] {
        let (f, m) = (self.force, self.moment);
        [f.x, f.y, f.z, m.x, m.y, m.z]
    }
}

/// What keeps a hand from following commands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HandFault {
    /// Why, by its number on the bus.
    pub code: Code,
    /// Fingers that do not follow.
    pub fingers: FingerSet,
}

impl fmt::Display for HandFault {
    /// As in reports: `fault 36 (a sensor gave no number) ring`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "fault {}", self.code.0)?;
        if let Some(words) = self.code.text() {
            write!(f, " ({words})")?;
        }
        let mut fingers = FingerId::ALL.into_iter().filter(|&finger| self.fingers.contains(finger));
        fingers.try_for_each(|finger| write!(f, " {}", finger.name()))
    }
}

/// What the hand's sensors say. Joints are in the order of `JointId`, fingers in that of `FingerId`.
#[derive(Debug, Clone, PartialEq)]
pub struct Report {
    /// Time of the hand's clock.
    pub time_s: f64,
    /// Measured joint angles.
    pub position_rad: [f64; JOINT_COUNT],
    /// Measured joint torques.
    pub joint_torque_nm: [f64; JOINT_COUNT],
    /// Measured wrenches on the fingertips.
    pub tip_wrench: [TipWrench; FINGER_COUNT],
}

/// Where the object really is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrueObject {
    /// Its frame.
    pub base_from_object: Isometry3<f64>,
    /// Its centre of mass in the base frame.
    pub center_in_base: Point3<f64>,
}

/// A hand on an arm.
pub trait Link {
    /// Sends a command, lets `dt_s` pass, and reads the sensors at its end. The palm must be near the commanded pose
    /// already: a command is a sample of a motion, not its goal.
    ///
    /// # Errors
    /// [`LinkError`], after which the hand's state is not known.
    fn step(&mut self, command: &Command, dt_s: f64) -> Result<Report, LinkError>;

    /// What keeps the hand from following the commands it is given, if anything does. A finger whose drive has failed is
    /// without torque; the others hold.
    fn fault(&self) -> Option<HandFault> {
        None
    }

    /// Where the object really is; `None` where nobody knows, as with a real hand.
    fn object(&self) -> Option<TrueObject> {
        None
    }
}
