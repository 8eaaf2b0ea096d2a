//! The object: convex pieces for its contacts, the mesh for its mass.

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
use rapier3d_f64::math::Rotation;
use rapier3d_f64::prelude::{
    ColliderBuilder, MassProperties, PhysicsWorld, RigidBodyBuilder, RigidBodyHandle,
};

use super::convert::{engine_pose, engine_vector};
use super::plant::PlantError;
use super::surface::{Part, surface};
use crate::surface::Mesh;

/// A rigid object of constant density.
#[derive(Debug, Clone, PartialEq)]
pub struct ObjectBody {
    /// Corners of convex pieces whose union is the object, object frame, metres.
    pub pieces: Vec<Vec<Point3<f64>>>,
    /// Where it stands at the start.
    pub base_from_object: Isometry3<f64>,
    /// Centre of mass in the object frame, metres.
    pub center_of_mass: Point3<f64>,
    /// Mass.
    pub mass_kg: f64,
    /// Inertia about the centre of mass along the object frame's axes, kg m^2.
    pub inertia_kg_m2: Matrix3<f64>,
}

impl ObjectBody {
    /// The solid that `mesh` (object frame) bounds; an open mesh counts as a shell of constant thickness.
    #[must_use]
    pub fn new(
        mesh: &Mesh,
        pieces: Vec<Vec<Point3<f64>>>,
        base_from_object: Isometry3<f64>,
        mass_kg: f64,
    ) -> Self {
        let (center_of_mass, unit_inertia) = mass_distribution(mesh);
        Self { pieces, base_from_object, center_of_mass, mass_kg, inertia_kg_m2: unit_inertia * mass_kg }
    }

    pub(super) fn insert(&self, world: &mut PhysicsWorld) -> Result<RigidBodyHandle, PlantError> {
        if !(self.mass_kg > 0.0 && self.mass_kg.is_finite()) {
            return Err(PlantError::Mass { mass_kg: self.mass_kg });
        }
        if self.pieces.is_empty() {
            return Err(PlantError::NoPieces);
        }
        let eigen = self.inertia_kg_m2.symmetric_eigen();
        // A rotation needs a right-handed triple of axes.
        let mut axes = eigen.eigenvectors;
        if axes.determinant() < 0.0 {
            axes.column_mut(2).neg_mut();
        }
        let turn =
            nalgebra::UnitQuaternion::from_rotation_matrix(&nalgebra::Rotation3::from_matrix_unchecked(axes));
        let mass = MassProperties::with_principal_inertia_frame(
            engine_vector(&self.center_of_mass.coords),
            self.mass_kg,
            engine_vector(&eigen.eigenvalues),
            Rotation::from_xyzw(turn.i, turn.j, turn.k, turn.w),
        );
        let body = world.insert_body(
            RigidBodyBuilder::dynamic()
                .pose(engine_pose(&self.base_from_object))
                .additional_mass_properties(mass)
                .can_sleep(false),
        );
        for (piece, corners) in self.pieces.iter().enumerate() {
            let hull = hull(corners).ok_or(PlantError::FlatPiece { piece })?;
            world.insert_collider(surface(hull, Part::Object, 1.0), Some(body));
        }
        Ok(body)
    }
}

/// The convex hull of `corners`; `None` when they are not finite or span no volume.
fn hull(corners: &[Point3<f64>]) -> Option<ColliderBuilder> {
    if !corners.iter().all(|p| p.coords.iter().all(|x| x.is_finite())) {
        return None;
    }
    let corners: Vec<_> = corners.iter().map(|p| engine_vector(&p.coords)).collect();
    let hull = ColliderBuilder::convex_hull(&corners)?;
    // The engine builds hulls of flat sets too, with rounding for a thickness.
    let longest_m = hull.shape.compute_local_aabb().extents().max_element();
    (hull.shape.mass_properties(1.0).mass() > 1e-9 * longest_m.powi(3)).then_some(hull)
}

/// Centre of mass, and inertia about it for a mass of 1 kg.
fn mass_distribution(mesh: &Mesh) -> (Point3<f64>, Matrix3<f64>) {
    let center = mesh.bulk().center_of_mass;
    let solid = mesh.is_watertight();
    let (mut weight, mut second_moment) = (0.0, Matrix3::zeros());
    for face in 0..mesh.faces().len() {
        let [a, b, c] = mesh.corners(face).map(|p| p - center);
        let sum = a + b + c;
        let outer = |v: Vector3<f64>| v * v.transpose();
        let corners = outer(a) + outer(b) + outer(c) + outer(sum);
        // Integrals of x x^T over a tetrahedron with one corner at the centre, or over a triangle.
        let (part, share) = if solid {
            (a.dot(&b.cross(&c)) / 6.0, 20.0)
        } else {
            ((b - a).cross(&(c - a)).norm() / 2.0, 12.0)
        };
        weight += part;
        second_moment += corners * (part / share);
    }
    let second_moment = second_moment / weight;
    (center, Matrix3::identity() * second_moment.trace() - second_moment)
}
