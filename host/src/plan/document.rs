//! The plan document (`PLAN.json`): what a planner found, for executors, exporters and people.
//!
//! Lengths in metres, angles in radians, forces in newtons, times in seconds, quaternions w first. `docs/planning.md`
//! tells every field.

use std::collections::BTreeMap;

use hand_model::HandAngles;
use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};
use protocol::ids::JointId;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use thiserror::Error;

use super::motion::ArmMotion;
use crate::hand::Hand;
use crate::surface::Mesh;

/// First field of every plan document.
pub const FORMAT: &str = "prehend-plan";
/// Version of the fields below: raised when one changes its meaning.
pub const VERSION: u32 = 2;

/// Why a document cannot be used.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum DocumentError {
    /// It says it is something else.
    #[error("format is \"{0}\", not \"{FORMAT}\"")]
    Format(String),
    /// Another version.
    #[error("version {0} is not {VERSION}, the one this program reads")]
    Version(u32),
    /// A joint name is missing from a posture.
    #[error("{posture} has no angle for joint {joint}")]
    MissingJoint {
        /// Which posture.
        posture: &'static str,
        /// Which joint.
        joint: &'static str,
    },
    /// A number is not finite, or a quaternion has no length.
    #[error("{0} is not a finite pose or angle")]
    NotFinite(&'static str),
}

/// A pose: position and orientation of one frame in another.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pose {
    /// Metres.
    pub position: [f64; 3],
    /// Unit quaternion, w first.
    pub orientation_wxyz: [f64; 4],
}

impl From<&Isometry3<f64>> for Pose {
    fn from(pose: &Isometry3<f64>) -> Self {
        let q = pose.rotation.quaternion();
        Self { position: pose.translation.vector.into(), orientation_wxyz: [q.w, q.i, q.j, q.k] }
    }
}

impl Pose {
    /// As an isometry; `name` is for the error when a number is not finite or the quaternion has no length.
    pub fn to_isometry(self, name: &'static str) -> Result<Isometry3<f64>, DocumentError> {
        let [w, x, y, z] = self.orientation_wxyz;
        let quaternion = Quaternion::new(w, x, y, z);
        let finite = self.position.iter().chain(&self.orientation_wxyz).all(|c| c.is_finite());
        // A norm that overflows is no length either.
        if !finite || !(1e-6..1e6).contains(&quaternion.norm()) {
            return Err(DocumentError::NotFinite(name));
        }
        let rotation = UnitQuaternion::from_quaternion(quaternion);
        Ok(Isometry3::from_parts(Translation3::from(Vector3::from(self.position)), rotation))
    }
}

/// Joint angles by joint name, rad.
pub type Posture = BTreeMap<String, f64>;

/// A posture of a hand by joint name.
#[must_use]
pub fn posture(hand: &Hand, posture: &crate::hand::Posture) -> Posture {
    hand.joints.iter().enumerate().map(|(i, joint)| (joint.name.clone(), posture[i])).collect()
}

/// A posture of the built-in hand by joint name.
#[must_use]
pub fn named(angles: &HandAngles<f64>) -> Posture {
    JointId::ALL.iter().zip(angles.to_array()).map(|(j, angle)| (j.name().to_owned(), angle)).collect()
}

/// Reads a posture back; `name` is for the error.
pub fn hand_angles(posture: &Posture, name: &'static str) -> Result<HandAngles<f64>, DocumentError> {
    let mut array = HandAngles::default().to_array();
    for (slot, joint) in array.iter_mut().zip(JointId::ALL) {
        let angle = posture
            .get(joint.name())
            .ok_or(DocumentError::MissingJoint { posture: name, joint: joint.name() })?;
        if !angle.is_finite() {
            return Err(DocumentError::NotFinite(joint.name()));
        }
        *slot = *angle;
    }
    Ok(HandAngles::from_array(&array))
}

/// The whole document.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlanDocument {
    /// [`FORMAT`].
    pub format: String,
    /// [`VERSION`].
    pub version: u32,
    /// What the poses mean, in words.
    pub frames: BTreeMap<String, String>,
    /// The hand that was planned for.
    pub hand: HandInfo,
    /// Name of the arm; `null` when the hand was planned alone.
    pub arm: Option<String>,
    /// The object that was planned on.
    pub object: ObjectInfo,
    /// Height of the table's top in the base frame, metres.
    pub table_height_m: Option<f64>,
    /// How the search was set.
    pub settings: SettingsInfo,
    /// The metric's convention, in words.
    pub convention: String,
    /// Attempts made.
    pub attempts: usize,
    /// Attempts that were force closure.
    pub force_closure: usize,
    /// Attempts by reason of rejection.
    pub rejected: BTreeMap<String, usize>,
    /// Best first.
    pub grasps: Vec<GraspInfo>,
}

/// Identity of the hand.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HandInfo {
    /// Name of the hand, as `--hand` takes it.
    pub name: String,
    /// SHA-256 over the parameters that the planner used.
    pub sha256: String,
}

/// Identity and place of the object.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObjectInfo {
    /// File name as the user gave it, or the name of a built-in object.
    pub source: String,
    /// SHA-256 over vertices and faces of the mesh that was planned on: see [`mesh_hash`].
    pub mesh_sha256: String,
    /// Number of triangles.
    pub triangles: usize,
    /// Whether the mesh encloses a volume.
    pub watertight: bool,
    /// Pose of the mesh's frame in the base frame.
    pub base_from_object: Pose,
    /// Object frame, metres.
    pub center_of_mass: [f64; 3],
    /// Length that divides torques, metres.
    pub torque_scale_m: f64,
    /// Mass, kg: given, or of the built-in object, or assumed.
    pub mass_kg: f64,
    /// Friction coefficient between tips and object.
    pub friction: f64,
}

/// Settings of the search.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SettingsInfo {
    /// `paper` or `best`.
    pub strategy: String,
    /// Most attempts.
    pub attempts: usize,
    /// Epsilon at which `paper` stops.
    pub threshold: f64,
    /// Seed of every random choice of the search.
    pub seed: u64,
}

/// One grasp: where the palm goes, what the joints do, what touches, how good it is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GraspInfo {
    /// Name of the candidate that it came from.
    pub candidate: String,
    /// Ferrari-Canny epsilon, bracketed.
    pub quality: QualityInfo,
    /// Pose of the palm in the object's frame at the grasp site.
    pub object_from_palm: Pose,
    /// Pose of the palm in the base frame where the straight last way begins, 80 mm before the grasp site.
    pub approach_site: Pose,
    /// Pose of the palm in the base frame where the fingers close.
    pub grasp_site: Pose,
    /// Pose of the palm in the base frame after the lift.
    pub lift_site: Pose,
    /// Fingers open, as at the approach site.
    pub pregrasp: Posture,
    /// Fingers touching.
    pub grasp: Posture,
    /// Joint targets behind the surface that make the fingers press.
    pub squeeze: Posture,
    /// From the pregrasp to the grasp, all fingers arriving together; `null` for a hand that gives no speeds.
    pub finger_motion: Option<FingerMotionInfo>,
    /// One a finger; in power grasps more, and the palm's.
    pub contacts: Vec<ContactInfo>,
    /// Way of the arm from its start to the approach site, to the grasp site and up; `null` when the hand was planned alone.
    pub arm_motion: Option<ArmMotion>,
}

/// A motion of the fingers from rest to rest: see [`touch_together`](super::finger_motion::touch_together).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FingerMotionInfo {
    /// When all fingers touch: time of the last knot, seconds.
    pub contact_s: f64,
    /// Cubic between them; the first is at 0 s.
    pub knots: Vec<FingerKnotInfo>,
}

/// Where the joints of the hand are, and how fast, at one time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FingerKnotInfo {
    /// Time since the start of the motion, seconds.
    pub t_s: f64,
    /// Angles by joint name.
    pub q_rad: Posture,
    /// Speeds by joint name, rad/s.
    pub qd_rad_per_s: Posture,
}

/// Quality of a grasp.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct QualityInfo {
    /// The lower bound, by which grasps compare.
    pub epsilon: f64,
    /// Lower bound: a ball of this radius lies inside the wrench space.
    pub epsilon_low: f64,
    /// Upper bound: the wrench space reaches no further in some direction.
    pub epsilon_high: f64,
    /// Mean over sampled errors of pose, friction and shape, lost closure counting 0, where it was measured.
    pub expected_epsilon: Option<f64>,
    /// Share of those samples that close by force.
    pub closure_chance: Option<f64>,
    /// Least distance of a joint of the used fingers from its limits, as a share of its range: 0 at a limit. Held joints,
    /// as the thumb's rotation, do not count.
    pub limit_margin: Option<f64>,
    /// Share of the contacts on surface that was measured, not completed.
    pub seen_share: Option<f64>,
}

/// One contact of the grasp, in the object's frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ContactInfo {
    /// Name of the finger.
    pub finger: String,
    /// Name of its link.
    pub link: String,
    /// Object frame, metres.
    pub point: [f64; 3],
    /// Unit, into the object, object frame.
    pub normal: [f64; 3],
    /// Friction coefficient.
    pub friction: f64,
    /// Lever of the torsional friction, metres: largest moment about the normal over largest friction force; 0 is a hard
    /// contact.
    pub torsional_m: f64,
    /// Force of the finger on the object in the squeeze, newtons, object frame.
    pub squeeze_force_n: [f64; 3],
}

impl PlanDocument {
    /// Checks what the types cannot.
    ///
    /// # Errors
    /// [`DocumentError::Format`] or [`DocumentError::Version`] when it is not what this program reads.
    pub fn check(&self) -> Result<(), DocumentError> {
        if self.format != FORMAT {
            return Err(DocumentError::Format(self.format.clone()));
        }
        if self.version != VERSION {
            return Err(DocumentError::Version(self.version));
        }
        Ok(())
    }
}

/// The frames of a plan document in words.
#[must_use]
pub fn frames() -> BTreeMap<String, String> {
    [
        ("base", "the robot's base: z up along axis 1, origin where it is bolted down"),
        ("object", "the frame of the mesh file"),
        ("palm", "origin at the wrist plane, z along the stretched fingers, x out of the grasping side, y to the index"),
        ("a_from_b", "maps coordinates in b to coordinates in a: the pose of b in a"),
    ]
    .into_iter()
    .map(|(name, meaning)| (name.to_owned(), meaning.to_owned()))
    .collect()
}

/// SHA-256 over a mesh: number of vertices, their coordinates as little-endian doubles, then the faces' indices.
#[must_use]
pub fn mesh_hash(mesh: &Mesh) -> String {
    let mut hash = Sha256::new();
    hash.update((mesh.vertices().len() as u64).to_le_bytes());
    for vertex in mesh.vertices() {
        vertex.coords.iter().for_each(|c| hash.update(c.to_le_bytes()));
    }
    for face in mesh.faces() {
        face.iter().for_each(|i| hash.update(i.to_le_bytes()));
    }
    hex(&hash.finalize())
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// A point as the document writes it.
#[must_use]
pub fn array(point: &Point3<f64>) -> [f64; 3] {
    point.coords.into()
}
