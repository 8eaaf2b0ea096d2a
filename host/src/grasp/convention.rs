//! Conventions: what a number depends on besides the contacts, and those of other programs by name.
//!
//! | name | cone | unit | torque scale | about | what it reports |
//! |---|---|---|---|---|---|
//! | `graspit` | 8 edges | normal force | largest distance of a vertex from the centre | centre of mass | epsilon; -1 without closure |
//! | `frogger` | 4 edges | edge | 1 m | centre of mass | epsilon |
//! | `simox` | 8 edges | edge | half the longest side of the bounding box | centre of mass | epsilon / that of the object |
//! | `dexnet` | 8 edges | normal force | median coordinate of the box's upper corner | centre of mass | epsilon; 0 without closure |
//! | `dexgraspbench` | 8 edges, half the friction | normal force | mean distance of a contact from the centre | centroid of the contacts | 2 - epsilon; 2 without closure |
//!
//! All of them are L1. Read from the sources of `GraspIt!` (`contact.cpp`, `body.cpp`, `gws.cpp`), `FRoGGeR`
//! (`metrics.py`), `Simox` (`GraspQualityMeasureWrenchSpace.cpp`, `BasicGraspQualityMeasure.cpp`), `Dex-Net`
//! (`quality.py`) and `DexGraspBench` (its metric `q1`). What a program does besides, and is not done here, is in
//! [`NamedConvention::not_reproduced`].

use std::fmt;

use nalgebra::{Point3, Vector3};
use thiserror::Error;

use super::contact::{Contact, ContactError, MAX_LENGTH_M};
use super::friction::{ConeModel, EdgeCount};
use super::quality::{Closure, ForceNorm, Norm, Quality, Settings, Workspace, evaluate};
use super::wrench::{WrenchReference, WrenchReferenceError};

/// Everything that a number depends on besides the contacts: without it an epsilon means nothing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Convention {
    /// The program that measures so; `None` when the options were chosen one by one.
    pub name: Option<NamedConvention>,
    /// Shape of the friction cones.
    pub cone: ConeModel,
    /// What bounds the effort.
    pub norm: Norm,
    /// What has unit length in a friction cone.
    pub force_norm: ForceNorm,
    /// Centre and scale of torques.
    pub reference: WrenchReference,
}

impl Convention {
    /// The convention of an evaluation.
    #[must_use]
    pub fn of(settings: &Settings, reference: &WrenchReference) -> Self {
        let Settings { cone, norm, force_norm, .. } = *settings;
        Self { name: None, cone, norm, force_norm, reference: *reference }
    }
}

impl fmt::Display for Convention {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let unit = match self.force_norm {
            ForceNorm::Normal => "unit normal force",
            ForceNorm::Edge => "unit edge force",
        };
        let norm = match self.norm {
            Norm::L1 => "normal forces sum to 1 (L1)",
            Norm::LInf => "normal forces up to each finger's limit (L-infinity), in newtons",
        };
        let c = self.reference.center_of_mass_in_object();
        let scale = self.reference.torque_scale_m();
        if let Some(name) = self.name {
            write!(f, "{name}: ")?;
        }
        write!(f, "{}, {unit}, {norm}, torque / {scale} m about ({}, {}, {})", self.cone, c.x, c.y, c.z)
    }
}

/// Another program's convention.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum NamedConvention {
    /// `GraspIt!` (A. Miller and P. Allen, 2004).
    GraspIt,
    /// `FRoGGeR` (A. Li et al., 2023): its L1 Ferrari-Canny metric.
    Frogger,
    /// `Simox` (N. Vahrenkamp et al., 2012): its wrench space measure.
    Simox,
    /// `Dex-Net` (J. Mahler et al., 2016): `ferrari_canny_L1`.
    DexNet,
    /// `DexGraspBench` (J. Chen et al., 2025): `q1`.
    DexGraspBench,
}

impl fmt::Display for NamedConvention {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::GraspIt => "GraspIt!",
            Self::Frogger => "FRoGGeR",
            Self::Simox => "Simox",
            Self::DexNet => "Dex-Net",
            Self::DexGraspBench => "DexGraspBench q1",
        })
    }
}

/// What is known of the object beside the contacts; conventions take from it what they need.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ObjectGeometry {
    /// Object frame, metres.
    pub center_of_mass_in_object: Option<Point3<f64>>,
    /// Vertices of its mesh, object frame, metres.
    pub vertices_in_object: Vec<Point3<f64>>,
    /// Largest distance of a vertex from the centre of mass, for who has it and not the vertices, metres.
    pub radius_m: Option<f64>,
    /// Least and greatest coordinates of its points, metres; that of the vertices when it is not given.
    pub bounding_box_in_object: Option<[Point3<f64>; 2]>,
    /// Contacts that fingers could make, spread over its surface: they span the object wrench space.
    pub surface: Vec<Contact>,
}

/// Why a convention has no number for a grasp.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum ConventionError {
    /// Something has to be known of the object.
    #[error("{convention} needs {what}")]
    Missing {
        /// Whose convention.
        convention: NamedConvention,
        /// What is missing, as fields of the contacts' document.
        what: &'static str,
    },
    /// A vertex or a corner of the bounding box has a coordinate that is no length, or the corners are not in order.
    #[error("{0} is not within {MAX_LENGTH_M:e} m, or its corners are not in order")]
    Geometry(&'static str),
    /// These programs have soft fingers of other kinds, or none.
    #[error("contact {index} has torsional friction: {convention} is reproduced for hard contacts only")]
    Soft {
        /// Its place in the list, from 0.
        index: usize,
        /// Whose convention.
        convention: NamedConvention,
    },
    /// Centre or scale of torques is not valid.
    #[error("{convention}: {source}")]
    Reference {
        /// Whose convention.
        convention: NamedConvention,
        /// What is wrong with it.
        source: WrenchReferenceError,
    },
    /// A contact that the convention changes is none any more.
    #[error(transparent)]
    Contact(#[from] ContactError),
    /// The contacts of the surface do not close, so there is nothing to divide by.
    #[error("the samples of the surface have no force closure: {0} divides by their epsilon")]
    OpenSurface(NamedConvention),
}

impl NamedConvention {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::GraspIt, Self::Frogger, Self::Simox, Self::DexNet, Self::DexGraspBench];

    /// As it is written in documents and on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::GraspIt => "graspit",
            Self::Frogger => "frogger",
            Self::Simox => "simox",
            Self::DexNet => "dexnet",
            Self::DexGraspBench => "dexgraspbench",
        }
    }

    /// What the program does and this one does not, so that numbers may differ. Besides, none of them says where around
    /// the normal a pyramid begins; it is at [`tangents`](super::wrench::tangents) here.
    #[must_use]
    pub fn not_reproduced(self) -> &'static str {
        match self {
            Self::GraspIt => {
                "soft contacts, the joggled input of its hull, the fixed 150 mm for virtual contacts"
            }
            Self::Frogger => "soft contacts, the negative number without closure, its min-weight metric",
            Self::Simox => {
                "distances from the mean of the hull's vertices instead of the origin, random samples of the surface, the \
                 force of each contact, pyramids as flat as a friction of 1 gives in some versions"
            }
            Self::DexNet => "soft fingers, closure that its solver takes for granted up to 1e-3",
            Self::DexGraspBench => "one averaged contact of a link, contacts on fingertips only",
        }
    }

    /// How it measures, to the default tolerance.
    #[must_use]
    pub fn settings(self) -> Settings {
        let (edges, force_norm) = match self {
            Self::GraspIt | Self::DexNet | Self::DexGraspBench => (EdgeCount::EIGHT, ForceNorm::Normal),
            Self::Frogger => (EdgeCount::FOUR, ForceNorm::Edge),
            Self::Simox => (EdgeCount::EIGHT, ForceNorm::Edge),
        };
        Settings { cone: ConeModel::Edges(edges), norm: Norm::L1, force_norm, ..Settings::default() }
    }

    /// What it reports for a grasp without closure, where that is one number.
    #[must_use]
    pub fn without_closure(self) -> Option<f64> {
        match self {
            Self::GraspIt => Some(-1.0),
            Self::DexNet => Some(0.0),
            Self::DexGraspBench => Some(2.0),
            Self::Frogger | Self::Simox => None,
        }
    }

    /// The point that it takes torques about and the length that it divides them by.
    pub fn reference(
        self,
        contacts: &[Contact],
        object: &ObjectGeometry,
    ) -> Result<WrenchReference, ConventionError> {
        let missing = |what| ConventionError::Missing { convention: self, what };
        let checked = |center, scale| {
            let failed = |source| ConventionError::Reference { convention: self, source };
            WrenchReference::new(center, scale).map_err(failed)
        };
        if self == Self::DexGraspBench {
            let count = contacts.len().max(1) as f64;
            let sum: Vector3<f64> = contacts.iter().map(|c| c.point_in_object().coords).sum();
            let center = Point3::from(sum / count);
            let distance: f64 = contacts.iter().map(|c| (c.point_in_object() - center).norm()).sum();
            // Without a distance there is no torque either, and any scale will do.
            return checked(center, if distance > 0.0 { distance / count } else { 1.0 });
        }
        let center = object.center_of_mass_in_object.ok_or(missing("center_of_mass"))?;
        if !object.vertices_in_object.iter().all(is_point) {
            return Err(ConventionError::Geometry("a vertex of the object"));
        }
        let scale_m = match self {
            Self::GraspIt if object.vertices_in_object.is_empty() => {
                let what = "object.vertices, or as torque_scale_m their largest distance from center_of_mass";
                object.radius_m.ok_or(missing(what))?
            }
            Self::GraspIt => {
                let distances = object.vertices_in_object.iter().map(|v| (v - center).norm());
                distances.fold(0.0, f64::max)
            }
            Self::Frogger => 1.0,
            Self::Simox => {
                let [least, greatest] = object.bounds()?.ok_or(missing(BOX))?;
                (greatest - least).max() / 2.0
            }
            Self::DexNet => {
                let [_, greatest] = object.bounds()?.ok_or(missing(BOX))?;
                let mut corner: [f64; 3] = (greatest - center).into();
                corner.sort_by(f64::total_cmp);
                corner[1]
            }
            Self::DexGraspBench => 1.0,
        };
        checked(center, scale_m)
    }

    /// The contacts as it takes them.
    fn contacts(self, contacts: &[Contact]) -> Result<Vec<Contact>, ConventionError> {
        let taken = |(index, contact): (usize, &Contact)| {
            if contact.torsional_m() > 0.0 {
                return Err(ConventionError::Soft { index, convention: self });
            }
            if self != Self::DexGraspBench {
                return Ok(*contact);
            }
            let (point, normal) = (contact.point_in_object(), contact.inward_normal_in_object());
            Ok(Contact::new(point, normal.into_inner(), contact.friction() / 2.0)?)
        };
        contacts.iter().enumerate().map(taken).collect()
    }
}

const BOX: &str = "object.bounding_box or object.vertices";

fn is_point(point: &Point3<f64>) -> bool {
    point.iter().all(|x| x.abs() <= MAX_LENGTH_M)
}

impl ObjectGeometry {
    fn bounds(&self) -> Result<Option<[Point3<f64>; 2]>, ConventionError> {
        if let Some([least, greatest]) = self.bounding_box_in_object {
            let ordered = least.iter().zip(greatest.iter()).all(|(a, b)| a <= b);
            let valid = ordered && is_point(&least) && is_point(&greatest);
            return if valid {
                Ok(Some([least, greatest]))
            } else {
                Err(ConventionError::Geometry("object.bounding_box"))
            };
        }
        let vertices = self.vertices_in_object.iter();
        Ok(vertices.map(|v| [*v, *v]).reduce(|[a, b], [v, _]| [a.inf(&v), b.sup(&v)]))
    }
}

/// The number that a program reports.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Score {
    /// For a grasp with closure: it is between these two.
    Between {
        /// Lower bound.
        low: f64,
        /// Upper bound.
        high: f64,
    },
    /// What it reports for every grasp without closure.
    WithoutClosure(f64),
    /// There is no closure, or it is not decided, and the number that the program reports then is not reproduced.
    NotReproduced,
}

/// What a convention makes of a grasp.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reproduction {
    /// In full, with the name.
    pub convention: Convention,
    /// Epsilon in it, before the program makes its score of it.
    pub closure: Closure,
    /// Epsilon of the object wrench space, where the program divides by it.
    pub object: Option<Quality>,
    /// The number that the program would report.
    pub score: Score,
}

/// A convention made ready for an object and many of its grasps.
#[derive(Debug, Clone)]
pub struct Yardstick<'a> {
    name: NamedConvention,
    geometry: &'a ObjectGeometry,
    tolerance: f64,
    object: Option<Quality>,
}

impl<'a> Yardstick<'a> {
    /// Measures of the object what the convention needs; `tolerance` is that of [`Settings`], for object and grasps.
    ///
    /// Simox needs samples of the surface. Their wrench space is round, so a hundred of them take seconds to a
    /// tolerance below 1e-2.
    pub fn new(
        name: NamedConvention,
        geometry: &'a ObjectGeometry,
        tolerance: f64,
        workspace: &mut Workspace,
    ) -> Result<Self, ConventionError> {
        let mut yardstick = Self { name, geometry, tolerance, object: None };
        if name == NamedConvention::Simox {
            if geometry.surface.is_empty() {
                let what = "object.surface, contacts spread over the object";
                return Err(ConventionError::Missing { convention: name, what });
            }
            let surface = name.contacts(&geometry.surface)?;
            let reference = name.reference(&surface, geometry)?;
            let found = evaluate(&surface, &reference, &yardstick.settings(), workspace);
            yardstick.object = Some(*found.quality().ok_or(ConventionError::OpenSurface(name))?);
        }
        Ok(yardstick)
    }

    /// How it measures.
    #[must_use]
    pub fn settings(&self) -> Settings {
        Settings { tolerance: self.tolerance, ..self.name.settings() }
    }

    /// Measures a grasp.
    pub fn measure(
        &self,
        contacts: &[Contact],
        workspace: &mut Workspace,
    ) -> Result<Reproduction, ConventionError> {
        let contacts = self.name.contacts(contacts)?;
        let reference = self.name.reference(&contacts, self.geometry)?;
        let settings = self.settings();
        let closure = evaluate(&contacts, &reference, &settings, workspace);
        let convention = Convention { name: Some(self.name), ..Convention::of(&settings, &reference) };
        let score = match (closure.quality(), &closure) {
            (Some(quality), _) => self.score(quality),
            (None, Closure::None(_)) => {
                self.name.without_closure().map_or(Score::NotReproduced, Score::WithoutClosure)
            }
            (None, _) => Score::NotReproduced,
        };
        Ok(Reproduction { convention, closure, object: self.object, score })
    }

    fn score(&self, quality: &Quality) -> Score {
        let Quality { epsilon_low: low, epsilon_high: high, .. } = *quality;
        match (self.name, self.object) {
            (NamedConvention::DexGraspBench, _) => Score::Between { low: 2.0 - high, high: 2.0 - low },
            (_, Some(object)) => {
                Score::Between { low: low / object.epsilon_high, high: high / object.epsilon_low }
            }
            _ => Score::Between { low, high },
        }
    }
}
