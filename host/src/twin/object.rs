//! The object: convex pieces for its contacts, the mesh for its mass.

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
use rapier3d_f64::math::{Rotation, Vector};
use rapier3d_f64::parry::transformation::try_convex_hull;
use rapier3d_f64::prelude::{
    ColliderBuilder, MassProperties, PhysicsWorld, RigidBodyBuilder, RigidBodyHandle,
};

use super::convert::{engine_pose, engine_vector};
use super::plant::PlantError;
use super::surface::{Part, surface};
use crate::surface::Mesh;

/// Radius of the balls that stand for points of contact with the table, metres: what the object is too high.
const FOOT_RADIUS_M: f64 = 1.0e-4;
/// Most such points. A rim of 32 corners is round to half a percent.
const FEET: usize = 64;

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
        let mut on_feet = Vec::new();
        for (piece, corners) in self.pieces.iter().enumerate() {
            let hull = hull(corners).ok_or(PlantError::FlatPiece { piece })?;
            let stands_alone = hull
                .shape
                .as_convex_polyhedron()
                .is_some_and(|hull| hull.faces().iter().all(|face| face.num_vertices_or_edges <= 4));
            let part = if stands_alone { Part::Object } else { Part::ObjectOnFeet };
            world.insert_collider(surface(hull, part, 1.0), Some(body));
            if !stands_alone {
                on_feet.extend(corners.iter().map(|p| engine_vector(&p.coords)));
            }
        }
        for foot in feet(&on_feet) {
            let ball = ColliderBuilder::ball(FOOT_RADIUS_M).translation(engine_vector(&foot.coords));
            world.insert_collider(surface(ball, Part::Feet, 1.0), Some(body));
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

/// Points that carry a body on a plane: corners of its convex hull, well spread where there are many.
///
/// A convex body touches a plane with the corners of its hull and nothing else. The engine's own contact of a polyhedron
/// takes four corners of one face, the first four: a disk with a rim of a hundred corners would tip over. The price is
/// a friction cone for each foot, which the engine lets slip at 0.9 of the coefficient.
fn feet(corners: &[Vector]) -> Vec<Point3<f64>> {
    let hull = try_convex_hull(corners).map(|(hull, _)| hull);
    let corners = hull.as_deref().unwrap_or(corners);
    let corners: Vec<Point3<f64>> = corners.iter().map(|p| Point3::new(p.x, p.y, p.z)).collect();
    spread(&corners, FEET)
}

/// At most `count` of the points, each the farthest from those chosen before; the lowest first.
fn spread(points: &[Point3<f64>], count: usize) -> Vec<Point3<f64>> {
    let mut gaps = vec![f64::INFINITY; points.len()];
    let mut next = (0..points.len()).min_by(|&a, &b| points[a].z.total_cmp(&points[b].z));
    let mut chosen = Vec::new();
    while let Some(index) = next {
        let point = points[index];
        chosen.push(point);
        if chosen.len() == count {
            break;
        }
        for (gap, other) in gaps.iter_mut().zip(points) {
            *gap = gap.min((other - point).norm_squared());
        }
        next = (0..points.len()).max_by(|&a, &b| gaps[a].total_cmp(&gaps[b])).filter(|&i| gaps[i] > 0.0);
    }
    chosen
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
