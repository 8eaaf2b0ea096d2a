//! The boundary between the project's nalgebra types and the engine's glam types.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use rapier3d_f64::math::{Pose, Rotation, Vector};

/// A vector of the engine.
pub(super) fn engine_vector(v: &Vector3<f64>) -> Vector {
    Vector::new(v.x, v.y, v.z)
}

/// A vector of the project.
pub(super) fn project_vector(v: Vector) -> Vector3<f64> {
    Vector3::new(v.x, v.y, v.z)
}

/// A pose of the engine.
pub(super) fn engine_pose(a_from_b: &Isometry3<f64>) -> Pose {
    let q = a_from_b.rotation;
    Pose::from_parts(engine_vector(&a_from_b.translation.vector), Rotation::from_xyzw(q.i, q.j, q.k, q.w))
}

/// A pose of the project.
pub(super) fn project_pose(a_from_b: &Pose) -> Isometry3<f64> {
    let q = a_from_b.rotation;
    Isometry3::from_parts(
        Translation3::from(project_vector(a_from_b.translation)),
        UnitQuaternion::new_normalize(Quaternion::new(q.w, q.x, q.y, q.z)),
    )
}
