//! Why a description makes no hand.

use std::path::PathBuf;

use thiserror::Error;

use super::description::MAX_LINKS;
use crate::hand::finger::FingerError;
use crate::hand::{MAX_FINGERS, MAX_JOINTS};
use crate::io::IoError;
use crate::surface::MeshError;

/// A description that makes no hand: one line that names the file, and in it the link or joint.
#[derive(Debug, Error)]
#[error("{}: {problem}", .file.display())]
pub struct HandError {
    /// The description, or the file of overrides.
    pub file: PathBuf,
    /// What is wrong with it.
    pub problem: Problem,
}

/// What is wrong with a description.
#[derive(Debug, Error)]
pub enum Problem {
    /// The file cannot be read.
    #[error("{0}")]
    File(std::io::Error),
    /// More than a description's text ever is.
    #[error("the file is larger than {limit_mib} MiB, which no robot description is")]
    TooLarge {
        /// Largest size that is read, MiB.
        limit_mib: u64,
    },
    /// Not XML.
    #[error("malformed XML: {0}")]
    Xml(roxmltree::Error),
    /// XML, but of something else.
    #[error("not a robot description: the root element is <{0}>, not <robot>")]
    NotARobot(String),
    /// Macros that are to be expanded first.
    #[error("this is xacro, not URDF: run `xacro FILE > hand.urdf` first")]
    Xacro,
    /// An element lacks an attribute or a child that it needs.
    #[error("line {line}: <{element}> has no {missing}")]
    Missing {
        /// Line of the element.
        line: u32,
        /// Its name.
        element: String,
        /// What it lacks.
        missing: &'static str,
    },
    /// An attribute that is not the finite numbers that it should be.
    #[error("line {line}: {attribute}=\"{text}\" in <{element}> is not {wanted}")]
    Numbers {
        /// Line of the element.
        line: u32,
        /// Its name.
        element: String,
        /// The attribute.
        attribute: &'static str,
        /// What stands there.
        text: String,
        /// What should.
        wanted: &'static str,
    },
    /// A shape that is none of box, sphere, cylinder, capsule, mesh.
    #[error("line {line}: <geometry> holds no box, sphere, cylinder, capsule or mesh")]
    Geometry {
        /// Line of the element.
        line: u32,
    },
    /// Two links or two joints of one name.
    #[error("line {line}: a second {what} is named '{name}'")]
    Twice {
        /// Line of the second.
        line: u32,
        /// "link" or "joint".
        what: &'static str,
        /// The name.
        name: String,
    },
    /// A joint names a link that is not there.
    #[error("joint '{joint}': there is no link '{link}'")]
    NoLink {
        /// The joint.
        joint: String,
        /// The link that it names.
        link: String,
    },
    /// A joint of a type that is none.
    #[error("joint '{joint}': unknown type '{kind}'")]
    UnknownKind {
        /// The joint.
        joint: String,
        /// Its type.
        kind: String,
    },
    /// A joint of a hand that turns or slides about more than one axis.
    #[error("joint '{joint}' is {kind}: a hand's joints are revolute, continuous, prismatic or fixed")]
    UnsupportedKind {
        /// The joint.
        joint: String,
        /// Its type.
        kind: String,
    },
    /// No link.
    #[error("the description has no link")]
    Empty,
    /// More links or joints than a robot has.
    #[error("more than {MAX_LINKS} links or joints, which no robot has")]
    TooManyLinks,
    /// A link under two joints.
    #[error("link '{link}' has two parents, '{first}' and '{second}': loops are not supported")]
    TwoParents {
        /// The link.
        link: String,
        /// One parent.
        first: String,
        /// The other one.
        second: String,
    },
    /// Joints that go round in a circle.
    #[error("link '{link}' is its own ancestor: the joints form a cycle")]
    Cycle {
        /// One link of the circle.
        link: String,
    },
    /// Parts that no joint connects.
    #[error("several roots: {links} have no parent; one link must carry all others")]
    Roots {
        /// Their names.
        links: String,
    },
    /// An axis of no length.
    #[error("joint '{joint}' has a zero axis")]
    ZeroAxis {
        /// The joint.
        joint: String,
    },
    /// A joint of a finger without limits.
    #[error("joint '{joint}' has no limits: <limit lower=.. upper=..> is needed, or limits in the TOML")]
    NoLimits {
        /// The joint.
        joint: String,
    },
    /// Limits the wrong way round.
    #[error("joint '{joint}': its lower limit {lower} lies above its upper limit {upper}")]
    ReversedLimits {
        /// The joint.
        joint: String,
        /// Its lower limit, rad or m.
        lower: f64,
        /// Its upper limit, rad or m.
        upper: f64,
    },
    /// A joint mimics one that is not there or does not move.
    #[error("joint '{joint}' mimics '{target}', which is no moving joint of this description")]
    MimicTarget {
        /// The joint.
        joint: String,
        /// What it mimics.
        target: String,
    },
    /// A joint mimics one that mimics another.
    #[error("joint '{joint}' mimics '{target}', which itself mimics '{next}': name the joint that is driven")]
    MimicChain {
        /// The joint.
        joint: String,
        /// What it mimics.
        target: String,
        /// What that mimics.
        next: String,
    },
    /// Too few fingers.
    #[error("{count} finger(s) found: a hand needs two chains of moving joints that branch from one link")]
    NoFingers {
        /// How many.
        count: usize,
    },
    /// Two or more parts that might be the hand.
    #[error(
        "more than one hand: below '{first}' and '{second}' alike; name one with palm = {{ link = \"...\" }}"
    )]
    AmbiguousPalm {
        /// Link where one begins.
        first: String,
        /// Link where another begins.
        second: String,
    },
    /// Too many fingers.
    #[error("{count} fingers, at most {MAX_FINGERS}: name the ones to use with [[finger]] in the TOML")]
    TooManyFingers {
        /// How many.
        count: usize,
    },
    /// Too many joints.
    #[error("more than {MAX_JOINTS} independent joints: name fewer fingers with [[finger]] in the TOML")]
    TooManyJoints,
    /// A finger ends in a link without a shape.
    #[error(
        "finger {finger}: its last link '{link}' has neither a collision nor a visual shape, so there is no fingertip"
    )]
    NoShape {
        /// The finger.
        finger: String,
        /// Its last link.
        link: String,
    },
    /// Parts that make no finger.
    #[error("{0}")]
    Finger(#[from] FingerError),
    /// A mesh that is not where it should be.
    #[error("link '{link}': no mesh file at '{uri}' (looked in {looked})")]
    NoMesh {
        /// The link.
        link: String,
        /// Path or URI as written.
        uri: String,
        /// Places.
        looked: String,
    },
    /// A mesh of a format that is not read.
    #[error("link '{link}': '{uri}' is {format}, which is not read: convert it to STL, OBJ, PLY or OFF")]
    MeshFormat {
        /// The link.
        link: String,
        /// Path or URI as written.
        uri: String,
        /// Name of the format.
        format: String,
    },
    /// A mesh that cannot be read.
    #[error("link '{link}': {source}")]
    Mesh {
        /// The link.
        link: String,
        /// Why not.
        source: Box<IoError>,
    },
    /// A mesh that its scale takes out of the numbers.
    #[error("link '{link}': '{uri}' in its scale: {source}")]
    Scaled {
        /// The link.
        link: String,
        /// Path or URI as written.
        uri: String,
        /// What became of it.
        source: MeshError,
    },
    /// A solid of no size.
    #[error("link '{link}': a {shape} without extent")]
    FlatShape {
        /// The link.
        link: String,
        /// Kind of shape.
        shape: &'static str,
    },
    /// No posture in which finger pads face each other: a warning of the reader, an error where grasps are wanted.
    #[error(
        "no posture found in which pads face each other over a range of openings; see `prehend hand show`, and say how \
         fingers close with [flexion] in the TOML"
    )]
    NoCandidate,
    /// The overrides are not TOML, or have keys that are not known.
    #[error("{0}")]
    Toml(String),
    /// The overrides name something that the description does not have.
    #[error("{key}: the description has no {what} '{name}'")]
    Unknown {
        /// Key in the TOML.
        key: String,
        /// "link", "joint", "finger".
        what: &'static str,
        /// The name.
        name: String,
    },
    /// A value in the overrides that cannot be.
    #[error("{key}: {text}")]
    Value {
        /// Key in the TOML.
        key: String,
        /// What is wrong.
        text: String,
    },
}
