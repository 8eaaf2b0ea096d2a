//! A plan as one page for a browser: HTML that needs no network.
//!
//! The scene and the plots are drawn by plotly.js, which the crate `plotly` carries. What is drawn is computed here and
//! stands in the page as JSON, lengths in millimetres in the base frame; `page.js` only turns it into traces.

mod motion;
mod quality;
mod run;

use nalgebra::{Isometry3, Point3};
use plotly::Plot;
use serde::Serialize;
use thiserror::Error;

use crate::grasp::{ContactError, WrenchReferenceError};
use crate::hand::{Hand, Posture};
use crate::plan::arm::Arm;
use crate::plan::document::{self, DocumentError, PlanDocument, QualityInfo};
use crate::surface::{Mesh, PointCloud, Provenance};

use motion::{ArmShape, HandParts, Step};
use quality::Margins;
pub use run::{RunEvent, RunRecord, RunSample};

const HEAD: &str = include_str!("head.html");
const STYLE: &str = include_str!("page.css");
const BODY: &str = include_str!("page.html");
const SCRIPT: &str = include_str!("page.js");

/// Points of a cloud that are drawn at most: more only slow the page.
const MAX_POINTS: usize = 20_000;
/// Faces of a mesh that are drawn at most.
const MAX_FACES: usize = 400_000;

/// Why there is no page.
#[derive(Debug, Error)]
pub enum ReportError {
    /// A pose of the plan is none.
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// A posture lacks a joint of the hand, or has no finite angle for it.
    #[error("grasp {grasp}: {posture} has no angle for joint {joint}")]
    Joint {
        /// Number of the grasp, from 1.
        grasp: usize,
        /// Which posture.
        posture: &'static str,
        /// Which joint.
        joint: String,
    },
    /// A contact of the plan is none.
    #[error("grasp {grasp}: {error}")]
    Contact {
        /// Number of the grasp, from 1.
        grasp: usize,
        /// What is wrong.
        error: ContactError,
    },
    /// Centre of mass or torque scale of the plan are out of range.
    #[error(transparent)]
    Reference(#[from] WrenchReferenceError),
    /// The mesh is too large for a page.
    #[error(
        "{0} triangles are more than a page shows ({MAX_FACES}): reconstruct with --triangles, or name another --mesh"
    )]
    TooManyFaces(usize),
    /// A number that JSON has not.
    #[error(transparent)]
    Json(#[from] serde_json::Error),
}

/// What the page shows.
pub struct Report<'a> {
    /// The plan.
    pub document: &'a PlanDocument,
    /// The hand that was planned for.
    pub hand: &'a Hand,
    /// The arm that was planned with, if it is to be drawn.
    pub arm: Option<&'a Arm>,
    /// The object, in the frame of the planned mesh; its provenance colours it.
    pub mesh: Option<&'a Mesh>,
    /// What was scanned of it, in the same frame.
    pub cloud: Option<&'a PointCloud>,
    /// What happened when the plan was executed.
    pub run: Option<&'a RunRecord>,
    /// Grasps to show, best first.
    pub top: usize,
    /// What a reader has to know about what is shown.
    pub notes: Vec<String>,
}

/// What `page.js` reads. Lengths in mm in the base frame, flattened x, y, z.
#[derive(Serialize)]
struct Data<'a> {
    source: &'a str,
    hand: &'a str,
    convention: &'a str,
    mass_kg: f64,
    friction: f64,
    planned: usize,
    notes: Vec<String>,
    table_mm: Option<f64>,
    center_of_mass: [f64; 3],
    mesh: Option<MeshData>,
    cloud: Option<Vec<f64>>,
    parts: HandParts,
    arm: Option<ArmShape>,
    stages: [Stage; 4],
    grasps: Vec<GraspData<'a>>,
    run: Option<&'a RunRecord>,
}

#[derive(Serialize)]
struct MeshData {
    vertices: Vec<f64>,
    faces: Vec<u32>,
    /// Number of the provenance of each face, if it is known.
    provenance: Option<Vec<u8>>,
    names: [&'static str; 4],
}

/// A named place on the slider.
#[derive(Serialize)]
struct Stage {
    name: &'static str,
    step: usize,
}

#[derive(Serialize)]
struct GraspData<'a> {
    number: usize,
    candidate: &'a str,
    quality: &'a QualityInfo,
    contacts: Vec<ContactData<'a>>,
    margins: Option<Margins>,
    steps: Vec<Step>,
}

#[derive(Serialize)]
struct ContactData<'a> {
    finger: &'a str,
    link: &'a str,
    friction: f64,
    at: [f64; 3],
    /// Unit vector into the object.
    inward: [f64; 3],
    force_n: [f64; 3],
}

impl Report<'_> {
    /// The page. The same input gives the same bytes.
    ///
    /// # Errors
    /// [`ReportError`] when the plan does not fit the hand or has contacts or poses that are none, or the mesh is too
    /// large.
    pub fn html(&self) -> Result<String, ReportError> {
        // In a script no text may look like its end.
        let data = serde_json::to_string(&self.data()?)?.replace('<', "\\u003c");
        Ok(format!(
            "{HEAD}<style>\n{STYLE}</style>\n</head>\n<body>\n{BODY}\
             <script type=\"application/json\" id=\"data\">{data}</script>\n{}\
             <script>\n{SCRIPT}</script>\n</body>\n</html>\n",
            plotly_js()
        ))
    }

    fn data(&self) -> Result<Data<'_>, ReportError> {
        let document = self.document;
        let object = &document.object;
        let base_from_object = object.base_from_object.to_isometry("base_from_object")?;
        let mut notes = self.notes.clone();
        if document.grasps.len() > self.top {
            notes.push(format!("The best {} of {} grasps are shown.", self.top, document.grasps.len()));
        }
        let count = self.cloud.map_or(0, PointCloud::len);
        if count > MAX_POINTS {
            notes.push(format!("Of {count} scanned points every {}th is shown.", count.div_ceil(MAX_POINTS)));
        }
        let mut arm = self.arm;
        if let Some(shown) = arm
            && !motion::reaches(shown, document)?
        {
            notes.push("The arm is not shown: with its angles of the plan it does not bring the palm to the grasp site.".to_owned());
            arm = None;
        }
        let numbered = (1..).zip(&document.grasps).take(self.top);
        let grasps: Result<_, ReportError> = numbered
            .map(|(number, info)| {
                let rotation = base_from_object.rotation;
                Ok(GraspData {
                    number,
                    candidate: &info.candidate,
                    quality: &info.quality,
                    contacts: info
                        .contacts
                        .iter()
                        .map(|contact| ContactData {
                            finger: &contact.finger,
                            link: &contact.link,
                            friction: contact.friction,
                            at: mm(&(base_from_object * Point3::from(contact.point))),
                            inward: (rotation * nalgebra::Vector3::from(contact.normal)).into(),
                            force_n: (rotation * nalgebra::Vector3::from(contact.squeeze_force_n)).into(),
                        })
                        .collect(),
                    margins: quality::margins(number, object, info, &base_from_object)?,
                    steps: motion::steps(number, self.hand, arm, info)?,
                })
            })
            .collect();
        Ok(Data {
            source: &object.source,
            hand: &document.hand.name,
            convention: &document.convention,
            mass_kg: object.mass_kg,
            friction: object.friction,
            planned: document.grasps.len(),
            notes,
            table_mm: document.table_height_m.map(|height_m| 1e3 * height_m),
            center_of_mass: mm(&(base_from_object * Point3::from(object.center_of_mass))),
            mesh: self.mesh.map(|mesh| mesh_data(mesh, &base_from_object)).transpose()?,
            cloud: self.cloud.map(|cloud| cloud_data(cloud, &base_from_object)),
            parts: HandParts::of(self.hand),
            arm: arm.map(ArmShape::of),
            stages: motion::STAGES.map(|(name, step)| Stage { name, step }),
            grasps: grasps?,
            run: self.run,
        })
    }
}

/// The script of plotly.js. The crate gives it together with `MathJax`, which no label here needs.
fn plotly_js() -> String {
    let scripts = Plot::offline_js_sources();
    let plotly = scripts.split_inclusive("</script>").find(|script| script.contains("plotly.js v"));
    plotly.map_or_else(|| scripts.clone(), |script| script.trim().to_owned() + "\n")
}

fn mesh_data(mesh: &Mesh, base_from_object: &Isometry3<f64>) -> Result<MeshData, ReportError> {
    if mesh.faces().len() > MAX_FACES {
        return Err(ReportError::TooManyFaces(mesh.faces().len()));
    }
    Ok(MeshData {
        vertices: mesh.vertices().iter().flat_map(|p| mm(&(base_from_object * p))).collect(),
        faces: mesh.faces().iter().flatten().copied().collect(),
        provenance: mesh.provenance().map(|all| all.iter().map(|p| p.number()).collect()),
        names: Provenance::ALL.map(Provenance::name),
    })
}

/// Every so manieth point, so that not too many are left.
fn cloud_data(cloud: &PointCloud, base_from_object: &Isometry3<f64>) -> Vec<f64> {
    let every = cloud.len().div_ceil(MAX_POINTS).max(1);
    cloud.points.iter().step_by(every).flat_map(|p| mm(&(base_from_object * p))).collect()
}

/// A point in mm, to hundredths: the page gets much smaller.
fn mm(point: &Point3<f64>) -> [f64; 3] {
    // Adding 0 makes a plain 0 of -0.
    point.coords.map(|c| (c * 1e5).round() / 100.0 + 0.0).into()
}

/// A posture of a plan in the order of the hand's joints.
fn read_posture(
    grasp: usize,
    hand: &Hand,
    named: &document::Posture,
    posture: &'static str,
) -> Result<Posture, ReportError> {
    let mut read = Posture::ZERO;
    for (i, joint) in hand.joints.iter().enumerate() {
        match named.get(&joint.name) {
            Some(angle) if angle.is_finite() => read[i] = *angle,
            _ => return Err(ReportError::Joint { grasp, posture, joint: joint.name.clone() }),
        }
    }
    Ok(read)
}

#[cfg(test)]
mod tests;
