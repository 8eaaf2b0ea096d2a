//! Everything that a grasp attempt is tried against: object, table, arm, hand, friction.

use nalgebra::{Isometry3, Point3};
use thiserror::Error;

use super::arm::Arm;
use super::hand_body::HandBody;
use super::surface_query::{SurfaceQuery, SurfaceQueryError};
use crate::grasp::{Settings as QualitySettings, WrenchReference, WrenchReferenceError};
use crate::surface::Mesh;

/// Clearance that hand and fingers keep from the table, metres: above the arm's error, below what low objects need.
pub const TABLE_CLEARANCE_M: f64 = 0.001;

/// What is fixed while grasps are tried. Frames: `object` is the mesh's own frame, `base` the robot's.
pub struct Scene {
    /// The surface to touch, object frame.
    pub surface: SurfaceQuery,
    /// The mesh behind it, object frame.
    pub mesh: Mesh,
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
    pub hand: HandBody,
    /// Coulomb friction coefficient between tips and object.
    pub friction: f64,
    /// Convention and tolerance of the metric.
    pub quality: QualitySettings,
    /// How far the approach site lies behind the grasp site along the approach's direction, metres.
    pub approach_m: f64,
    /// How far the object is to be lifted, metres.
    pub lift_m: f64,
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
        Ok(Self {
            surface: SurfaceQuery::new(&mesh)?,
            wrench_reference: WrenchReference::of_object(center_of_mass, mesh.vertices())?,
            mesh,
            center_of_mass,
            base_from_object,
            table_height_m,
            arm,
            hand: HandBody::hit_dlr(),
            friction: 0.4,
            // Round grasps take thousands of facets for a millionth; the ranking does not need more than a thousandth.
            quality: QualitySettings { tolerance: 1e-3, ..QualitySettings::default() },
            approach_m: 0.08,
            lift_m: 0.10,
        })
    }
}
