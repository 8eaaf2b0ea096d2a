//! Everything that a grasp attempt is tried against: object, table, arm, hand, friction.

use std::f64::consts::PI;

use nalgebra::{Isometry3, Point3, Vector3};
use rayon::prelude::*;
use thiserror::Error;

use super::approach::{BeadPair, bead_pairs};
use super::arm::Arm;
use super::samples::SurfaceSampler;
use super::seen::SeenSurface;
use super::surface_query::{SurfaceQuery, SurfaceQueryError};
use crate::grasp::{Settings as QualitySettings, WrenchReference, WrenchReferenceError};
use crate::hand::finger::FingerError;
use crate::hand::{Hand, Part};
use crate::surface::Mesh;

/// Clearance that palm, inner links and arm keep from the table, metres: above the arm's error.
pub const TABLE_CLEARANCE_M: f64 = 0.001;

/// Clearance that the ends of fingers keep from the table, metres. They are of rubber and yield with their joints, and the
/// nearer they come the less they lean over what is lower than they are thick: on a cube of 10 mm by 16 degrees for 1
/// mm, by 12 for this.
pub const TIP_CLEARANCE_M: f64 = 0.0002;

/// What a body of the hand keeps from the table, metres.
#[must_use]
pub fn table_clearance_m(part: Part) -> f64 {
    match part {
        Part::Tip | Part::Distal => TIP_CLEARANCE_M,
        Part::Inner => TABLE_CLEARANCE_M,
    }
}

/// What is fixed while grasps are tried. Frames: `object` is the mesh's own frame, `base` the robot's.
pub struct Scene {
    /// The surface to touch, object frame.
    pub surface: SurfaceQuery,
    /// The mesh behind it, object frame.
    pub mesh: Mesh,
    /// Draws points of the mesh.
    pub sampler: SurfaceSampler,
    /// What of the surface was measured; `None` when all of it counts as known.
    pub seen: Option<SeenSurface>,
    /// Centre of mass, object frame: of the enclosed solid, or of the surface's area when the mesh is open.
    pub center_of_mass: Point3<f64>,
    /// Centre and scale of torques: the scale is the largest distance of a vertex from the centre of mass (GraspIt's
    /// convention).
    pub wrench_reference: WrenchReference,
    /// Pose of the object's frame in the base frame.
    pub base_from_object: Isometry3<f64>,
    /// Height of the table's top in the base frame, metres; `None` without a table.
    pub table_height_m: Option<f64>,
    /// The arm, or `None` to plan for the hand alone.
    pub arm: Option<Arm>,
    /// The hand's kinematics and its bodies.
    pub hand: Hand,
    /// Beads of different fingers that must not overlap.
    pub bead_pairs: Vec<BeadPair>,
    /// Coulomb friction coefficient between tips and object.
    pub friction: f64,
    /// Convention and tolerance of the metric.
    pub quality: QualitySettings,
    /// How far the approach site lies behind the grasp site along the approach's direction, metres.
    pub approach_m: f64,
    /// How far the object is to be lifted, metres.
    pub lift_m: f64,
    /// Some hundred vertices that reach farthest, object frame: how far the object extends is read off them.
    extremes_in_object: Vec<Point3<f64>>,
}

/// Why there is no scene.
#[derive(Debug, Error)]
pub enum SceneError {
    /// The mesh cannot be indexed.
    #[error(transparent)]
    Surface(#[from] SurfaceQueryError),
    /// Its vertices coincide or are too large.
    #[error(transparent)]
    Wrench(#[from] WrenchReferenceError),
    /// The built-in hand's parameters make no hand.
    #[error(transparent)]
    Hand(#[from] FingerError),
}

impl Scene {
    /// A scene with the hand of the 2005 system, friction 0.4, 80 mm of straight approach and a lift of 100 mm.
    /// Errors when the mesh cannot be indexed.
    pub fn new(
        mesh: Mesh,
        base_from_object: Isometry3<f64>,
        table_height_m: Option<f64>,
        arm: Option<Arm>,
    ) -> Result<Self, SceneError> {
        let center_of_mass = mesh.bulk().center_of_mass;
        let hand = Hand::hit_dlr()?;
        Ok(Self {
            extremes_in_object: extremes(mesh.vertices()),
            bead_pairs: bead_pairs(&hand),
            surface: SurfaceQuery::new(&mesh)?,
            sampler: SurfaceSampler::new(&mesh),
            seen: None,
            wrench_reference: WrenchReference::of_object(center_of_mass, mesh.vertices())?,
            mesh,
            center_of_mass,
            base_from_object,
            table_height_m,
            arm,
            hand,
            friction: 0.4,
            // Round grasps take thousands of facets for a millionth; the ranking does not need more than a thousandth.
            quality: QualitySettings { tolerance: 1e-3, ..QualitySettings::default() },
            approach_m: 0.08,
            lift_m: 0.10,
        })
    }
    /// The same scene with another hand.
    #[must_use]
    pub fn with_hand(self, hand: Hand) -> Self {
        Self { bead_pairs: bead_pairs(&hand), hand, ..self }
    }

    /// How far the object reaches from `from` along a unit direction, metres, object frame; not below 0. Exact for
    /// bodies with few corners, on round ones too small by a hundredth or two of the radius.
    #[must_use]
    pub fn extent_m(&self, from: &Point3<f64>, direction: &Vector3<f64>) -> f64 {
        self.extremes_in_object.iter().map(|p| (p - from).dot(direction)).fold(0.0, f64::max)
    }
}

/// Directions in which the farthest vertices are kept; the nearest of them is within 10 degrees of any.
const EXTREME_DIRECTIONS: usize = 256;

/// The farthest vertices in directions spread evenly over the sphere (a Fibonacci spiral), each once.
fn extremes(vertices: &[Point3<f64>]) -> Vec<Point3<f64>> {
    let golden_rad = PI * (3.0 - 5f64.sqrt());
    let farthest = |k: usize| {
        let z = 1.0 - (2 * k + 1) as f64 / EXTREME_DIRECTIONS as f64;
        let (sin, cos) = (golden_rad * k as f64).sin_cos();
        let direction = Vector3::new(cos, sin, 0.0) * (1.0 - z * z).sqrt() + Vector3::z() * z;
        let along = |p: &Point3<f64>| p.coords.dot(&direction);
        (0..vertices.len()).reduce(|a, b| if along(&vertices[b]) > along(&vertices[a]) { b } else { a })
    };
    let mut indices: Vec<usize> = (0..EXTREME_DIRECTIONS).into_par_iter().filter_map(farthest).collect();
    indices.sort_unstable();
    indices.dedup();
    indices.into_iter().map(|i| vertices[i]).collect()
}
