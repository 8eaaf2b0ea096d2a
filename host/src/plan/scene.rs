//! Everything that a grasp attempt is tried against: object, table, arm, hand, friction.

use nalgebra::{Isometry3, Point3};

use super::arm::Arm;
use super::hand_body::HandBody;
use super::surface_query::{SurfaceQuery, SurfaceQueryError};
use crate::grasp::quality::Settings as QualitySettings;
use crate::surface::Mesh;

/// Clearance that every part but the fingertips keeps from the table, metres.
pub const TABLE_CLEARANCE_M: f64 = 0.002;

/// What is fixed while grasps are tried. Frames: `object` is the mesh's own frame, `base` the robot's.
pub struct Scene {
    /// The surface to touch, object frame.
    pub surface: SurfaceQuery,
    /// The mesh behind it, object frame.
    pub mesh: Mesh,
    /// Centre of mass, object frame: of the enclosed solid, or of the surface's area when the mesh is open.
    pub center_of_mass: Point3<f64>,
    /// Largest distance of a vertex from the centre of mass, metres: divides torques (GraspIt's convention).
    pub torque_scale_m: f64,
    /// Where the object stands.
    pub base_from_object: Isometry3<f64>,
    /// Height of the table's top in the base frame, metres; `None` without a table.
    pub table_height_m: Option<f64>,
    /// The arm, or `None` to plan for the hand alone.
    pub arm: Option<Arm>,
    /// The hand.
    pub hand: HandBody,
    /// Coulomb friction coefficient between tips and object.
    pub friction: f64,
    /// How quality is measured.
    pub quality: QualitySettings,
    /// How far the approach site lies behind the grasp site along the palm's z axis, metres.
    pub approach_m: f64,
    /// How far the object is to be lifted, metres.
    pub lift_m: f64,
}

impl Scene {
    /// A scene with the hand of the 2005 system, friction 0.4, 80 mm of straight approach and a lift of 100 mm.
    /// Errors when the mesh cannot be indexed.
    pub fn new(
        mesh: Mesh,
        base_from_object: Isometry3<f64>,
        table_height_m: Option<f64>,
        arm: Option<Arm>,
    ) -> Result<Self, SurfaceQueryError> {
        let center_of_mass = mesh.bulk().center_of_mass;
        let torque_scale_m =
            mesh.vertices().iter().map(|p| (p - center_of_mass).norm()).fold(0.0, f64::max);
        Ok(Self {
            surface: SurfaceQuery::new(&mesh)?,
            mesh,
            center_of_mass,
            torque_scale_m,
            base_from_object,
            table_height_m,
            arm,
            hand: HandBody::hit_dlr(),
            friction: 0.4,
            quality: QualitySettings::default(),
            approach_m: 0.08,
            lift_m: 0.10,
        })
    }
}
