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
use schemars::generate::SchemaSettings;
use schemars::{JsonSchema, Schema};
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

/// The contacts of a grasp as `prehend quality` reads them: metres and newtons, one frame for all.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object with `contacts`")]
#[schemars(title = "Contacts of a grasp")]
struct RawGrasp {
    /// The contacts.
    #[schemars(title = "Contacts", length(max = MAX_CONTACTS))]
    contacts: Vec<RawContact>,
    /// Point about which torques are taken, metres; by default the centroid of the contact points.
    #[schemars(title = "Centre of mass")]
    center_of_mass: Option<[f64; 3]>,
    /// Length that divides torques, metres; by default the largest distance of a contact point from the centre of mass,
    /// or 1 m when all are there.
    #[schemars(title = "Torque scale", extend("exclusiveMinimum" = 0))]
    torque_scale_m: Option<f64>,
    /// What the conventions of other programs need to know of the object.
    #[serde(default)]
    #[schemars(title = "Object")]
    object: RawObject,
    /// Disturbances that the grasp is to be measured by.
    #[schemars(title = "Task")]
    task: Option<RawTask>,
}

/// An ellipsoid of disturbances, wrenches on the object about its centre of mass; either `semi_axes` or `matrix`.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object with `semi_axes` or `matrix`")]
#[schemars(rename = "Task", title = "Task", extend("oneOf" = either_of(["semi_axes", "matrix"])))]
struct RawTask {
    /// Semi-axes of the ellipsoid, three N, three N m.
    #[schemars(title = "Semi-axes")]
    semi_axes: Option<[f64; 6]>,
    /// Matrix of the ellipsoid, squares of N and N m on its diagonal.
    #[schemars(title = "Matrix")]
    matrix: Option<[[f64; 6]; 6]>,
    /// What always acts, three N, three N m; by default nothing.
    #[serde(default)]
    #[schemars(title = "Load")]
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

/// What the conventions of other programs need to know of the object.
#[derive(Deserialize, Default, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object with `vertices`, `bounding_box` or `surface`")]
#[schemars(rename = "Object", title = "Object")]
struct RawObject {
    /// Vertices of its mesh, metres.
    #[serde(default)]
    #[schemars(title = "Vertices")]
    vertices: Vec<[f64; 3]>,
    /// Least and greatest coordinates; by default those of the vertices.
    #[schemars(title = "Bounding box")]
    bounding_box: Option<RawBox>,
    /// Contacts that could be made, spread over the object.
    #[serde(default)]
    #[schemars(title = "Surface", length(max = MAX_CONTACTS))]
    surface: Vec<RawContact>,
}

/// Least and greatest coordinates.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object with `min` and `max`")]
#[schemars(rename = "Box", title = "Bounding box")]
struct RawBox {
    /// Least coordinates, metres.
    #[schemars(title = "Least")]
    min: [f64; 3],
    /// Greatest coordinates, metres.
    #[schemars(title = "Greatest")]
    max: [f64; 3],
}

/// A place where a finger touches.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object with `point`, `normal` and `friction`")]
#[schemars(rename = "Contact", title = "Contact")]
struct RawContact {
    /// Where it touches, metres.
    #[schemars(title = "Point")]
    point: [f64; 3],
    /// Vector into the object, of any length but 0, no unit.
    #[schemars(title = "Normal")]
    normal: [f64; 3],
    /// Coulomb friction coefficient, no unit.
    #[schemars(title = "Friction", range(min = 0.0))]
    friction: f64,
    /// Lever of the torsional friction, metres: largest moment about the normal over largest friction force; 0 is a hard
    /// contact.
    #[serde(default)]
    #[schemars(title = "Torsional lever", range(min = 0.0))]
    torsional_m: f64,
    /// Largest normal force, newtons; only the norm linf uses it.
    #[serde(default = "default_max_force_n")]
    #[schemars(title = "Largest force", extend("exclusiveMinimum" = 0))]
    max_force_n: f64,
}

/// Schemas of which exactly one holds: the one field is there and not null, or the other.
fn either_of(fields: [&str; 2]) -> serde_json::Value {
    let with = |field: &str| serde_json::json!({"required": [field], "properties": {field: {"not": {"type": "null"}}}});
    fields.map(with).to_vec().into()
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
    /// The JSON schema (draft 2020-12) of these documents, as `docs/contacts.schema.json` holds it.
    #[must_use]
    pub fn schema() -> Schema {
        SchemaSettings::draft2020_12().into_generator().into_root_schema_for::<RawGrasp>()
    }

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
