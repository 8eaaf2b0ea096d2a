//! A hand as the planner sees it: fingers as chains of joints and of balls, a palm of boxes, and the typical grasps that
//! it makes.
//!
//! Any number of fingers, joints that mimic others, joints that several fingers share. [`hit_dlr`] is the built-in hand.
//! Joint angles of a whole hand are a [`Posture`]: one number for each independent joint. Nothing here allocates once a
//! hand is made.
pub mod candidate;
pub mod finger;
pub mod hit_dlr;
mod inverse;
mod posture;
pub mod urdf;

use std::fmt::Debug;

use hand_model::HandModel;
use nalgebra::{Isometry3, Point3, Unit, Vector3};
use sha2::{Digest, Sha256};

pub use candidate::{Candidate, ContactKind};
pub use finger::{Bead, Finger, Part, Segment};
pub use posture::{MAX_FINGERS, MAX_JOINTS, Posture};

/// Torsional friction of a soft tip, as the length e in `mu * sqrt(|f_t|^2 + (tau / e)^2)`, metres. 3 mm is the middle
/// of 2..4 mm for rubber tips under a few newtons; contact radius grows with force (Xydas and Kao 1999).
pub const SOFT_TIP_TORSION_M: f64 = 0.003;

/// SHA-256 over all that a value prints in full precision: what plans depend on.
fn hash_of(value: &impl Debug) -> String {
    hex(&Sha256::digest(format!("{value:?}").as_bytes()))
}

/// Bytes as lower-case hexadecimal digits.
pub(crate) fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// An independent joint: one that no other joint drives.
#[derive(Debug, Clone, PartialEq)]
pub struct Joint {
    /// Name, as in plan documents and robot descriptions.
    pub name: String,
    /// Where planned postures begin, rad (metres for a sliding joint).
    pub lower_rad: f64,
    /// Where they end.
    pub upper_rad: f64,
    /// Greatest speed, rad/s.
    pub speed_max_rad_per_s: f64,
    /// Greatest torque of the drive, N m.
    pub torque_max_nm: f64,
    /// Stiffness of the joint's position control while a grasp is squeezed, N m / rad: how far a target has to lie
    /// behind a contact for a given force.
    pub stiffness_nm_per_rad: f64,
    /// Whether the finger closes towards the joint's upper (`true`) or lower limit; `None` for a joint that spreads or
    /// turns a finger.
    pub flexes: Option<bool>,
    /// Set before a grasp and held in it: a joint that several fingers share, or one with a brake.
    pub is_held: bool,
}

/// A box of the palm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PalmBox {
    /// Pose of the box's centre and axes in the palm frame.
    pub palm_from_box: Isometry3<f64>,
    /// Half its edges, metres.
    pub half_extents_m: Vector3<f64>,
}

/// What the planner needs of a hand.
#[derive(Debug, Clone)]
pub struct Hand {
    /// Name, as in the plan document.
    pub name: String,
    /// SHA-256 over everything that a plan depends on.
    pub sha256: String,
    /// The independent joints; a [`Posture`] has their order.
    pub joints: Vec<Joint>,
    /// The fingers, at most [`MAX_FINGERS`].
    pub fingers: Vec<Finger>,
    /// The palm's boxes.
    pub palm: Vec<PalmBox>,
    /// Where grasped things usually are, palm frame: the middle between the tips of a half closed hand.
    pub grasp_center_in_palm: Point3<f64>,
    /// Direction in which the palm presses on what it holds, palm frame: out of its grasping side.
    pub pressing_in_palm: Unit<Vector3<f64>>,
    /// Greatest friction coefficient that links and palm, which have no rubber, are planned with.
    pub link_friction: f64,
    /// Torsional friction of the tips in grasps with soft contacts, metres: see [`SOFT_TIP_TORSION_M`].
    pub soft_tip_torsion_m: f64,
    /// What a fingertip can press continuously, newtons.
    pub tip_force_max_n: f64,
    /// Mass of the whole hand, kg.
    pub mass_kg: f64,
    /// Typical grasps, in the order in which a search tries them.
    pub candidates: Vec<Candidate>,
    /// The parameters that the firmware has of the hand; `None` for hands that it does not drive.
    pub model: Option<HandModel<f64>>,
}

impl Hand {
    /// Index of a finger by name.
    #[must_use]
    pub fn finger_index(&self, name: &str) -> Option<usize> {
        self.fingers.iter().position(|finger| finger.name == name)
    }

    /// Whether a finger has joints enough for its tip to be placed anywhere near: three that are not held.
    #[must_use]
    pub fn is_placeable(&self, finger: usize) -> bool {
        self.fingers[finger].joints().iter().filter(|&&joint| !self.joints[joint].is_held).count() >= 3
    }

    /// The posture with every joint inside its limits.
    #[must_use]
    pub fn clamped(&self, mut posture: Posture) -> Posture {
        for (i, joint) in self.joints.iter().enumerate() {
            posture[i] = posture[i].clamp(joint.lower_rad, joint.upper_rad);
        }
        posture
    }

    /// Whether every joint is inside its limits, to within a nanoradian.
    #[must_use]
    pub fn within_limits(&self, posture: &Posture) -> bool {
        let slack = 1e-9;
        self.joints
            .iter()
            .enumerate()
            .all(|(i, joint)| (joint.lower_rad - slack..=joint.upper_rad + slack).contains(&posture[i]))
    }

    /// Least distance of a joint of some fingers from its nearer limit, as a share of its range: 0 at a limit, 0.5 in the
    /// middle. Joints that are held, which nothing pushes on, and joints without a range do not count; 0.5 when there is
    /// no other.
    #[must_use]
    pub fn limit_margin(&self, posture: &Posture, fingers: impl Iterator<Item = usize>) -> f64 {
        let joints = fingers.flat_map(|finger| self.fingers[finger].joints().iter().copied());
        let margins = joints.filter_map(|i| {
            let joint = &self.joints[i];
            let range = joint.upper_rad - joint.lower_rad;
            let nearer = (posture[i] - joint.lower_rad).min(joint.upper_rad - posture[i]);
            (!joint.is_held && range > 1e-9).then(|| nearer / range)
        });
        margins.fold(0.5, f64::min)
    }
}
