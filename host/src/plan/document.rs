//! The plan document (`PLAN.json`): what a planner found, for executors, exporters and people.
//!
//! Lengths in metres, angles in radians, forces in newtons, times in seconds, quaternions w first. `docs/planning.md`
//! tells every field.

use std::collections::BTreeMap;

use hand_model::HandAngles;
use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};
use protocol::ids::JointId;
use schemars::generate::SchemaSettings;
use schemars::{JsonSchema, Schema};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use thiserror::Error;

use super::motion::ArmMotion;
use crate::hand::{Hand, hex};
use crate::surface::Mesh;

/// First field of every plan document.
pub const FORMAT: &str = "prehend-plan";
/// Version of the fields below: raised when one changes its meaning.
pub const VERSION: u32 = 2;
/// A SHA-256 in hexadecimal.
const SHA256_PATTERN: &str = "^[0-9a-f]{64}$";

/// Why a document cannot be used.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum DocumentError {
    /// It says it is something else.
    #[error("format is \"{0}\", not \"{FORMAT}\"")]
    Format(String),
    /// Another version.
    #[error("version {0} is not {VERSION}, the one this program reads")]
    Version(u32),
    /// A length, mass or coefficient is no such thing.
    #[error("{field} {value} is {fault}")]
    OutOfRange {
        /// Which one.
        field: &'static str,
        /// Its value.
        value: f64,
        /// What is wrong with it.
        fault: &'static str,
    },
    /// A hash is no SHA-256 in hexadecimal digits.
    #[error("{field} \"{hash}\" is no SHA-256")]
    Hash {
        /// Which one.
        field: &'static str,
        /// Its text.
        hash: String,
    },
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
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "Pose")]
pub struct Pose {
    /// Origin of the one frame in the other, x, y, z, metres.
    #[schemars(title = "Position")]
    pub position: [f64; 3],
    /// Unit quaternion w, x, y, z, no unit.
    #[schemars(title = "Orientation")]
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

/// A plan of `prehend plan`: metres, radians, newtons, seconds, kilograms; quaternions w first.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "Plan of prehend")]
pub struct PlanDocument {
    /// Says that this is a plan.
    #[schemars(title = "Format", extend("const" = FORMAT))]
    pub format: String,
    /// Version of the fields: raised when one changes its meaning.
    #[schemars(title = "Version", extend("const" = VERSION))]
    pub version: u32,
    /// What the poses mean, in words, by the frame's name.
    #[schemars(title = "Frames")]
    pub frames: BTreeMap<String, String>,
    /// The hand that was planned for.
    #[schemars(title = "Hand")]
    pub hand: HandInfo,
    /// Name of the arm; null when the hand was planned alone.
    #[schemars(title = "Arm")]
    pub arm: Option<String>,
    /// The object that was planned on, and where it stands.
    #[schemars(title = "Object")]
    pub object: ObjectInfo,
    /// Height of the table's top in the base frame, metres; null without a table.
    #[schemars(title = "Table")]
    pub table_height_m: Option<f64>,
    /// How the search was set.
    #[schemars(title = "Settings")]
    pub settings: SettingsInfo,
    /// The convention of every epsilon, in words.
    #[schemars(title = "Convention of the metric")]
    pub convention: String,
    /// Number of attempts made.
    #[schemars(title = "Attempts")]
    pub attempts: usize,
    /// Number of attempts that were force closure.
    #[schemars(title = "Force closures")]
    pub force_closure: usize,
    /// Number of attempts by reason of rejection; reasons that did not occur are left out.
    #[schemars(title = "Rejections")]
    pub rejected: BTreeMap<String, usize>,
    /// The grasps, best first; empty when none was found.
    #[schemars(title = "Grasps")]
    pub grasps: Vec<GraspInfo>,
}

/// Identity of the hand.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "Hand")]
pub struct HandInfo {
    /// Name of the hand, as `--hand` takes it.
    #[schemars(title = "Name")]
    pub name: String,
    /// SHA-256 over the parameters that the planner used, hexadecimal.
    #[schemars(title = "Hash", extend("pattern" = SHA256_PATTERN))]
    pub sha256: String,
}

/// Identity and place of the object.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "Object")]
pub struct ObjectInfo {
    /// File name as the user gave it, or the name of a built-in object.
    #[schemars(title = "Source")]
    pub source: String,
    /// SHA-256 over vertices (metres, little-endian doubles) and faces of the mesh that was planned on, hexadecimal.
    #[schemars(title = "Hash of the mesh", extend("pattern" = SHA256_PATTERN))]
    pub mesh_sha256: String,
    /// Number of triangles.
    #[schemars(title = "Triangles")]
    pub triangles: usize,
    /// Whether the mesh encloses a volume.
    #[schemars(title = "Watertight")]
    pub watertight: bool,
    /// Pose of the mesh's frame in the base frame.
    #[schemars(title = "Pose of the object")]
    pub base_from_object: Pose,
    /// Centre of mass, object frame, metres.
    #[schemars(title = "Centre of mass")]
    pub center_of_mass: [f64; 3],
    /// Length that divides torques in the metric, metres.
    #[schemars(title = "Torque scale", extend("exclusiveMinimum" = 0))]
    pub torque_scale_m: f64,
    /// Mass that was planned with, kg: given, or of the built-in object, or assumed.
    #[schemars(title = "Mass", extend("exclusiveMinimum" = 0))]
    pub mass_kg: f64,
    /// Coulomb friction coefficient between tips and object that was planned with, no unit.
    #[schemars(title = "Friction", range(min = 0.0))]
    pub friction: f64,
}

/// Settings of the search.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "Settings of the search")]
pub struct SettingsInfo {
    /// Which search: `paper` or `best`.
    #[schemars(title = "Strategy")]
    pub strategy: String,
    /// Largest number of attempts.
    #[schemars(title = "Attempts")]
    pub attempts: usize,
    /// Epsilon at which `paper` stops, no unit.
    #[schemars(title = "Threshold")]
    pub threshold: f64,
    /// Seed of every random choice of the search.
    #[schemars(title = "Seed")]
    pub seed: u64,
}

/// One grasp: where the palm goes, what the joints do, what touches, how good it is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "Grasp")]
pub struct GraspInfo {
    /// Name of the candidate that it came from.
    #[schemars(title = "Candidate")]
    pub candidate: String,
    /// Ferrari-Canny epsilon, bracketed, and what errors leave of it.
    #[schemars(title = "Quality")]
    pub quality: QualityInfo,
    /// Pose of the palm in the object's frame at the grasp site.
    #[schemars(title = "Palm on the object")]
    pub object_from_palm: Pose,
    /// Pose of the palm in the base frame where the straight last way begins, 80 mm before the grasp site.
    #[schemars(title = "Approach site")]
    pub approach_site: Pose,
    /// Pose of the palm in the base frame where the fingers close.
    #[schemars(title = "Grasp site")]
    pub grasp_site: Pose,
    /// Pose of the palm in the base frame after the lift.
    #[schemars(title = "Lifted site")]
    pub lift_site: Pose,
    /// Joint angles by joint name, rad: fingers open, as at the approach site.
    #[schemars(title = "Pregrasp")]
    pub pregrasp: Posture,
    /// Joint angles by joint name, rad: fingers touching.
    #[schemars(title = "Grasp")]
    pub grasp: Posture,
    /// Joint targets by joint name, rad, behind the surface, that make the fingers press.
    #[schemars(title = "Squeeze")]
    pub squeeze: Posture,
    /// From the pregrasp to the grasp, all fingers arriving together; null for a hand that gives no speeds.
    #[schemars(title = "Motion of the fingers")]
    pub finger_motion: Option<FingerMotionInfo>,
    /// One a finger; in power grasps more, and the palm's.
    #[schemars(title = "Contacts")]
    pub contacts: Vec<ContactInfo>,
    /// Way of the arm from its start to the approach site, to the grasp site and up; null when the hand was planned alone.
    #[schemars(title = "Motion of the arm")]
    pub arm_motion: Option<ArmMotion>,
}

/// A motion of the fingers from rest to rest.
///
/// See [`touch_together`](super::finger_motion::touch_together).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "Motion of the fingers", description = "A motion of the fingers from rest to rest.")]
pub struct FingerMotionInfo {
    /// When all fingers touch: time of the last knot, seconds.
    #[schemars(title = "Time of contact", range(min = 0.0))]
    pub contact_s: f64,
    /// Where and how fast the joints are, cubic between them; the first is at 0 s.
    #[schemars(title = "Knots")]
    pub knots: Vec<FingerKnotInfo>,
}

/// Where the joints of the hand are, and how fast, at one time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "Knot of a finger motion")]
pub struct FingerKnotInfo {
    /// Time since the start of the motion, seconds.
    #[schemars(title = "Time", range(min = 0.0))]
    pub t_s: f64,
    /// Angles by joint name, rad.
    #[schemars(title = "Angles")]
    pub q_rad: Posture,
    /// Speeds by joint name, rad/s.
    #[schemars(title = "Speeds")]
    pub qd_rad_per_s: Posture,
}

/// Quality of a grasp.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "Quality")]
pub struct QualityInfo {
    /// The lower bound, by which grasps compare, no unit.
    #[schemars(title = "Epsilon")]
    pub epsilon: f64,
    /// Lower bound, no unit: a ball of this radius lies inside the wrench space.
    #[schemars(title = "Epsilon, lower bound")]
    pub epsilon_low: f64,
    /// Upper bound, no unit: the wrench space reaches no further in some direction.
    #[schemars(title = "Epsilon, upper bound")]
    pub epsilon_high: f64,
    /// Mean epsilon over sampled errors of pose, friction and shape, lost closure counting 0, no unit; null where it was
    /// not measured.
    #[schemars(title = "Expected epsilon")]
    pub expected_epsilon: Option<f64>,
    /// Share of those samples that close by force, 0 to 1; null where it was not measured.
    #[schemars(title = "Chance of closure")]
    pub closure_chance: Option<f64>,
    /// Least distance of a joint of the used fingers from its limits, as a share of its range: 0 at a limit. Held joints,
    /// as the thumb's rotation, do not count; null where it was not measured.
    #[schemars(title = "Margin of the joints")]
    pub limit_margin: Option<f64>,
    /// Share of the contacts on surface that was measured, not completed, 0 to 1; null where it was not measured.
    #[schemars(title = "Share seen")]
    pub seen_share: Option<f64>,
}

/// One contact of the grasp, in the object's frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "Contact")]
pub struct ContactInfo {
    /// Name of the finger, or palm.
    #[schemars(title = "Finger")]
    pub finger: String,
    /// Name of its link, as the exported URDF names it.
    #[schemars(title = "Link")]
    pub link: String,
    /// Where it touches, object frame, metres.
    #[schemars(title = "Point")]
    pub point: [f64; 3],
    /// Unit vector into the object, object frame, no unit.
    #[schemars(title = "Normal")]
    pub normal: [f64; 3],
    /// Coulomb friction coefficient of the contact, no unit.
    #[schemars(title = "Friction", range(min = 0.0))]
    pub friction: f64,
    /// Lever of the torsional friction, metres: largest moment about the normal over largest friction force; 0 is a hard
    /// contact.
    #[schemars(title = "Torsional lever", range(min = 0.0))]
    pub torsional_m: f64,
    /// Force of the finger on the object in the squeeze, newtons, object frame.
    #[schemars(title = "Squeeze force")]
    pub squeeze_force_n: [f64; 3],
}

impl PlanDocument {
    /// Checks what the types cannot, and the schema can.
    ///
    /// # Errors
    /// [`DocumentError::Format`] or [`DocumentError::Version`] when it is not what this program reads,
    /// [`DocumentError::OutOfRange`] when a mass or length is not above zero, a coefficient or time is below it, or the
    /// times of a motion do not increase, [`DocumentError::Hash`] when a hash is none.
    pub fn check(&self) -> Result<(), DocumentError> {
        if self.format != FORMAT {
            return Err(DocumentError::Format(self.format.clone()));
        }
        if self.version != VERSION {
            return Err(DocumentError::Version(self.version));
        }
        let object = &self.object;
        for (field, value) in
            [("object.mass_kg", object.mass_kg), ("object.torque_scale_m", object.torque_scale_m)]
        {
            if value <= 0.0 {
                return Err(DocumentError::OutOfRange { field, value, fault: "not above 0" });
            }
        }
        let of_contacts = self.grasps.iter().flat_map(|grasp| &grasp.contacts).flat_map(|contact| {
            [("contact friction", contact.friction), ("contact torsional_m", contact.torsional_m)]
        });
        let motions = || self.grasps.iter().filter_map(|grasp| grasp.finger_motion.as_ref());
        let of_motions = motions().flat_map(|motion| {
            let knots = motion.knots.iter().map(|knot| ("finger_motion time", knot.t_s));
            knots.chain([("finger_motion contact_s", motion.contact_s)])
        });
        let of_object = [("object.friction", object.friction)];
        for (field, value) in of_object.into_iter().chain(of_contacts).chain(of_motions) {
            if value < 0.0 {
                return Err(DocumentError::OutOfRange { field, value, fault: "below 0" });
            }
        }
        for motion in motions() {
            if let Some(knots) = motion.knots.windows(2).find(|knots| knots[0].t_s >= knots[1].t_s) {
                let (field, value) = ("finger_motion time", knots[1].t_s);
                return Err(DocumentError::OutOfRange { field, value, fault: "not after the one before" });
            }
        }
        let hashes = [("hand.sha256", &self.hand.sha256), ("object.mesh_sha256", &object.mesh_sha256)];
        match hashes.into_iter().find(|(_, hash)| !is_sha256(hash)) {
            Some((field, hash)) => Err(DocumentError::Hash { field, hash: hash.clone() }),
            None => Ok(()),
        }
    }

    /// The JSON schema (draft 2020-12) of plan documents, as `docs/plan.schema.json` holds it. It says what fields there
    /// are and of what type and range; that joints have the hand's names and motions their order in time it cannot say.
    #[must_use]
    pub fn schema() -> Schema {
        SchemaSettings::draft2020_12().into_generator().into_root_schema_for::<Self>()
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

/// Whether this is 64 lower-case hexadecimal digits, as the schema asks.
fn is_sha256(text: &str) -> bool {
    text.len() == 64 && text.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'))
}

/// A point as the document writes it.
#[must_use]
pub fn array(point: &Point3<f64>) -> [f64; 3] {
    point.coords.into()
}
