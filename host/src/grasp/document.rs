//! The document that `prehend quality` reads: the contacts of a grasp, and what is known of its object.
//!
//! ```json
//! {"contacts": [{"point": [0.03, 0, 0], "normal": [-1, 0, 0], "friction": 0.4, "torsional_m": 0.005, "max_force_n": 10}],
//!  "center_of_mass": [0, 0, 0], "torque_scale_m": 0.06}
//! ```
//!
//! Metres and newtons, one frame for all. `normal` points into the object and may have any length. A contact needs
//! `point`, `normal` and `friction`; the defaults of the rest:
//!
//! | field | default |
//! |---|---|
//! | `torsional_m` | 0: a hard contact |
//! | `max_force_n` | 1 N; only `--norm linf` uses it |
//! | `center_of_mass` | centroid of the contact points |
//! | `torque_scale_m` | largest distance of a contact point from `center_of_mass`; 1 m when all are there |
//!
//! The last two are what a tool can do that does not see the object. They change with the contacts, so give both to
//! compare grasps of one object.
//!
//! `task` asks for the ellipsoid of disturbances that is withstood: `semi_axes` (three N, three N m) or a 6 x 6 `matrix`
//! (their squares on its diagonal), and a `load` that always acts; wrenches on the object about `center_of_mass`.
//!
//! ```json
//! {"task": {"semi_axes": [1, 1, 2, 0.02, 0.02, 0.01], "load": [0, 0, -2, 0, 0, 0]}}
//! ```
//!
//! The conventions of other programs need more of the object, and name what is missing:
//!
//! ```json
//! {"object": {"vertices": [[0.03, 0, 0]], "bounding_box": {"min": [-0.03, -0.03, 0], "max": [0.03, 0.03, 0.1]},
//!             "surface": [{"point": [0.03, 0, 0], "normal": [-1, 0, 0], "friction": 0.4}]}}
//! ```
//!
//! | field of `object` | meaning, default |
//! |---|---|
//! | `vertices` | vertices of its mesh; none |
//! | `bounding_box` | least and greatest coordinates; those of the vertices |
//! | `surface` | contacts that could be made, spread over it; none |

use nalgebra::{Matrix6, Point3, Vector3};
use serde::Deserialize;
use thiserror::Error;

use super::contact::{Contact, ContactError};
use super::convention::ObjectGeometry;
use super::task::{Task, TaskError};
use super::wrench::{WrenchReference, WrenchReferenceError};

/// Most contacts that a document may have: ten hands full of tactile pads.
pub const MAX_CONTACTS: usize = 1000;

/// Why a text is not a grasp.
#[derive(Debug, Error)]
pub enum DocumentError {
    /// Not JSON, or a field is missing, unknown or of the wrong type. The message names it, with line and column.
    #[error(transparent)]
    Json(#[from] serde_json::Error),
    /// More than [`MAX_CONTACTS`].
    #[error("{0} contacts are more than {MAX_CONTACTS}")]
    TooManyContacts(usize),
    /// A contact is not valid.
    #[error("contact {index}: {source}")]
    Contact {
        /// Its place in the list, from 0.
        index: usize,
        /// What is wrong with it.
        source: ContactError,
    },
    /// A contact in `object.surface` is not valid.
    #[error("object.surface {index}: {source}")]
    Sample {
        /// Its place in the list, from 0.
        index: usize,
        /// What is wrong with it.
        source: ContactError,
    },
    /// The ellipsoid is given twice or not at all.
    #[error("task needs either semi_axes or matrix")]
    Shape,
    /// The task is not valid.
    #[error("task: {0}")]
    Task(#[from] TaskError),
    /// Centre of mass or torque scale is not valid.
    #[error(transparent)]
    Reference(#[from] WrenchReferenceError),
}

/// A grasp as somebody wrote it down, checked.
#[derive(Debug, Clone, PartialEq)]
pub struct GraspDocument {
    /// The contacts, in the order of the document.
    pub contacts: Vec<Contact>,
    /// Centre and scale of torques.
    pub reference: WrenchReference,
    /// What else is known of the object.
    pub object: ObjectGeometry,
    /// Disturbances to measure by.
    pub task: Option<Task>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "an object with `contacts`")]
struct RawGrasp {
    contacts: Vec<RawContact>,
    center_of_mass: Option<[f64; 3]>,
    torque_scale_m: Option<f64>,
    #[serde(default)]
    object: RawObject,
    task: Option<RawTask>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "an object with `semi_axes` or `matrix`")]
struct RawTask {
    semi_axes: Option<[f64; 6]>,
    matrix: Option<[[f64; 6]; 6]>,
    #[serde(default)]
    load: [f64; 6],
}

impl RawTask {
    fn checked(&self) -> Result<Task, DocumentError> {
        let task = match (self.semi_axes, self.matrix) {
            (Some(semi_axes), None) => Task::from_semi_axes(semi_axes)?,
            (None, Some(rows)) => Task::from_matrix(&Matrix6::from_fn(|row, column| rows[row][column]))?,
            _ => return Err(DocumentError::Shape),
        };
        Ok(task.with_load(self.load.into())?)
    }
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields, expecting = "an object with `vertices`, `bounding_box` or `surface`")]
struct RawObject {
    #[serde(default)]
    vertices: Vec<[f64; 3]>,
    bounding_box: Option<RawBox>,
    #[serde(default)]
    surface: Vec<RawContact>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "an object with `min` and `max`")]
struct RawBox {
    min: [f64; 3],
    max: [f64; 3],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "an object with `point`, `normal` and `friction`")]
struct RawContact {
    point: [f64; 3],
    normal: [f64; 3],
    friction: f64,
    #[serde(default)]
    torsional_m: f64,
    #[serde(default = "default_max_force_n")]
    max_force_n: f64,
}

fn default_max_force_n() -> f64 {
    Contact::DEFAULT_MAX_FORCE_N
}

impl RawContact {
    fn checked(&self) -> Result<Contact, ContactError> {
        Contact::new(Point3::from(self.point), Vector3::from(self.normal), self.friction)?
            .with_torsion(self.torsional_m)?
            .with_max_force(self.max_force_n)
    }
}

impl GraspDocument {
    /// Reads a document.
    pub fn from_json(text: &str) -> Result<Self, DocumentError> {
        let raw: RawGrasp = serde_json::from_str(text)?;
        let most = raw.contacts.len().max(raw.object.surface.len());
        if most > MAX_CONTACTS {
            return Err(DocumentError::TooManyContacts(most));
        }
        let checked = |(index, contact): (usize, &RawContact)| {
            contact.checked().map_err(|source| DocumentError::Contact { index, source })
        };
        let contacts = raw.contacts.iter().enumerate().map(checked).collect::<Result<Vec<_>, _>>()?;
        let sample = |(index, contact): (usize, &RawContact)| {
            contact.checked().map_err(|source| DocumentError::Sample { index, source })
        };
        let object = ObjectGeometry {
            center_of_mass_in_object: raw.center_of_mass.map(Point3::from),
            vertices_in_object: raw.object.vertices.iter().copied().map(Point3::from).collect(),
            radius_m: raw.torque_scale_m,
            bounding_box_in_object: raw.object.bounding_box.map(|b| [b.min.into(), b.max.into()]),
            surface: raw.object.surface.iter().enumerate().map(sample).collect::<Result<Vec<_>, _>>()?,
        };
        let task = raw.task.map(|task| task.checked()).transpose()?;
        let center = raw.center_of_mass.map_or_else(|| centroid(&contacts), Point3::from);
        let scale = raw.torque_scale_m.unwrap_or_else(|| farthest(&contacts, &center).unwrap_or(1.0));
        Ok(Self { reference: WrenchReference::new(center, scale)?, contacts, object, task })
    }
}

/// The origin when there is no contact: no torque will be taken about it.
fn centroid(contacts: &[Contact]) -> Point3<f64> {
    let sum: Vector3<f64> = contacts.iter().map(|c| c.point_in_object().coords).sum();
    Point3::from(sum / contacts.len().max(1) as f64)
}

fn farthest(contacts: &[Contact], center: &Point3<f64>) -> Option<f64> {
    let distances = contacts.iter().map(|c| (c.point_in_object() - center).norm());
    distances.reduce(f64::max).filter(|&distance| distance > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(text: &str) -> String {
        GraspDocument::from_json(text).unwrap_err().to_string()
    }

    #[test]
    fn defaults_are_the_documented_ones() {
        let text = r#"{"contacts":[{"point":[0.0,1.0,0.0],"normal":[0,-2,0],"friction":0.4},
            {"point":[0,-3,0],"normal":[0,1,0],"friction":0.5,"torsional_m":0.01,"max_force_n":10}]}"#;
        let GraspDocument { contacts, reference, .. } = GraspDocument::from_json(text).unwrap();
        assert_eq!(reference.center_of_mass_in_object(), Point3::new(0.0, -1.0, 0.0));
        assert_eq!(reference.torque_scale_m(), 2.0);
        assert_eq!((contacts[0].torsional_m(), contacts[0].max_force_n()), (0.0, 1.0));
        assert_eq!((contacts[1].torsional_m(), contacts[1].max_force_n()), (0.01, 10.0));
        assert_eq!(contacts[0].inward_normal_in_object().into_inner(), -Vector3::y());

        let one_point = r#"{"contacts":[{"point":[1,1,1],"normal":[0,1,0],"friction":0}]}"#;
        assert_eq!(GraspDocument::from_json(one_point).unwrap().reference.torque_scale_m(), 1.0);
        assert!(GraspDocument::from_json(r#"{"contacts":[]}"#).unwrap().contacts.is_empty());
    }

    #[test]
    fn what_is_wrong_is_named() {
        for (text, named) in [
            ("", "EOF"),
            ("[]", "contacts"),
            (r#"{}"#, "contacts"),
            (r#"{"contacts":[],"com":[0,0,0]}"#, "com"),
            (r#"{"contacts":[{"point":[0,0,0],"normal":[0,0,1],"mu":0.4}]}"#, "mu"),
            (r#"{"contacts":[{"point":[0,0,0],"normal":[0,0,1]}]}"#, "friction"),
            (r#"{"contacts":[{"point":[0,0],"normal":[0,0,1],"friction":1}]}"#, "length 2"),
            (
                r#"{"contacts":[{"point":[0,0,0],"normal":[0,0,0],"friction":1}]}"#,
                "contact 0: normal (0, 0, 0)",
            ),
            (r#"{"contacts":[{"point":[0,0,1e999],"normal":[0,0,1],"friction":1}]}"#, "number out of range"),
            (r#"{"contacts":[{"point":[0,0,1e30],"normal":[0,0,1],"friction":1}]}"#, "contact 0: point"),
            (r#"{"contacts":[{"point":[0,0,0],"normal":[0,0,1],"friction":-1}]}"#, "friction -1"),
            (r#"{"contacts":[],"object":{"mesh":"cup.stl"}}"#, "unknown field `mesh`"),
            (r#"{"contacts":[],"object":{"bounding_box":{"min":[0,0,0]}}}"#, "missing field `max`"),
            (
                r#"{"contacts":[],"object":{"surface":[{"point":[0,0,0],"normal":[0,0,0],"friction":1}]}}"#,
                "object.surface 0: normal",
            ),
            (r#"{"contacts":[],"task":{"load":[0,0,0,0,0,0]}}"#, "either semi_axes or matrix"),
            (r#"{"contacts":[],"task":{"semi_axes":[1,1,1,1,1,0]}}"#, "task: semi-axis 0 is"),
            (r#"{"contacts":[],"task":{"semi_axes":[1,1,1]}}"#, "invalid length 3"),
            (r#"{"contacts":[],"torque_scale_m":0}"#, "torque_scale_m 0"),
            (r#"{"contacts":[],"torque_scale_m":NaN}"#, "line 1"),
        ] {
            let message = error(text);
            assert!(message.contains(named), "{text}: {message}");
        }
        let contact = r#"{"point":[0,0,0],"normal":[0,0,1],"friction":1}"#;
        let many = vec![contact; MAX_CONTACTS + 1].join(",");
        assert!(error(&format!(r#"{{"contacts":[{many}]}}"#)).starts_with("1001 contacts"));
    }
}
