//! The object as the fingers meet it: distance and nearest point on its surface.
//!
//! parry's bounding-volume tree answers; this is the only file of the planner that speaks its glam types.

use nalgebra::{Isometry3, Point3, Unit, Vector3};
use parry3d_f64::math::{Pose, Rotation, Vector as ParryVector};
use parry3d_f64::query::{PointQuery, Ray, RayCast, intersection_test};
use parry3d_f64::shape::{Capsule, Cuboid, Shape, TriMesh, TriMeshBuilderError, TriMeshFlags};
use thiserror::Error;

use crate::surface::Mesh;

/// Why a mesh cannot be asked for distances.
#[derive(Debug, Error)]
#[error("the mesh cannot be indexed for distance queries")]
pub struct SurfaceQueryError(#[from] TriMeshBuilderError);

/// The nearest point of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Nearest {
    /// The point on the surface, in the object's frame, metres.
    pub point_in_object: Point3<f64>,
    /// Distance to it, metres; negative when the asked point is inside the body. On an open mesh "inside" means
    /// behind the nearest sheet.
    pub signed_distance_m: f64,
}

/// A mesh with a bounding-volume tree, for many nearest-point queries from many threads.
pub struct SurfaceQuery {
    trimesh: TriMesh,
    /// A sphere about the whole surface.
    center_in_object: Point3<f64>,
    radius_m: f64,
}

impl SurfaceQuery {
    /// Indexes a mesh. Errors when parry refuses it.
    pub fn new(mesh: &Mesh) -> Result<Self, SurfaceQueryError> {
        let vertices = mesh.vertices().iter().map(|p| to_parry(&p.coords)).collect();
        // ORIENTED computes the pseudo-normals that make the inside test right at edges and corners
        // (Baerentzen and Aanaes, DOI 10.1109/TVCG.2005.49); it asks nothing of the topology.
        let flags = TriMeshFlags::ORIENTED | TriMeshFlags::MERGE_DUPLICATE_VERTICES;
        let (low, high) = mesh.bounding_box();
        let center_in_object = nalgebra::center(&low, &high);
        let radius_m = mesh.vertices().iter().map(|p| (p - center_in_object).norm()).fold(0.0, f64::max);
        Ok(Self {
            trimesh: TriMesh::with_flags(vertices, mesh.faces().to_vec(), flags)?,
            center_in_object,
            radius_m,
        })
    }

    /// Lower bound of the distance to the surface, metres, for the price of a subtraction; not positive near it.
    #[must_use]
    pub fn distance_bound_m(&self, point_in_object: &Point3<f64>) -> f64 {
        (point_in_object - self.center_in_object).norm() - self.radius_m
    }

    /// The nearest point of the surface to `point_in_object`.
    #[must_use]
    pub fn nearest(&self, point_in_object: &Point3<f64>) -> Nearest {
        let asked = to_parry(&point_in_object.coords);
        let projection = self.trimesh.project_local_point(asked, false);
        let found = projection.point;
        let distance_m = (asked - found).length();
        Nearest {
            point_in_object: Point3::new(found.x, found.y, found.z),
            signed_distance_m: if projection.is_inside { -distance_m } else { distance_m },
        }
    }

    /// Whether a box, centred on its own frame with the given half extents, cuts the surface.
    #[must_use]
    pub fn cuts_box(&self, object_from_box: &Isometry3<f64>, half_extents_m: &Vector3<f64>) -> bool {
        self.cut_by(object_from_box, &Cuboid::new(to_parry(half_extents_m)))
    }

    /// Whether a capsule about the segment between two points cuts the surface.
    #[must_use]
    pub fn cuts_capsule(&self, ends_in_object: &[Point3<f64>; 2], radius_m: f64) -> bool {
        let [a, b] = ends_in_object.map(|p| to_parry(&p.coords));
        self.cut_by(&Isometry3::identity(), &Capsule::new(a, b, radius_m))
    }

    /// How far a ray goes until it meets the surface, metres, and the unit normal there, turned against the ray or along
    /// it as the face is oriented; `None` when it meets nothing.
    #[must_use]
    pub fn cast_ray(
        &self,
        from_in_object: &Point3<f64>,
        direction: &Unit<Vector3<f64>>,
    ) -> Option<(f64, Vector3<f64>)> {
        let ray = Ray::new(to_parry(&from_in_object.coords), to_parry(direction));
        let hit = self.trimesh.cast_local_ray_and_get_normal(&ray, f64::MAX, false)?;
        Some((hit.time_of_impact, Vector3::new(hit.normal.x, hit.normal.y, hit.normal.z)))
    }

    fn cut_by(&self, object_from_shape: &Isometry3<f64>, shape: &dyn Shape) -> bool {
        let q = object_from_shape.rotation.quaternion();
        let pose = Pose::from_parts(
            to_parry(&object_from_shape.translation.vector),
            Rotation::from_xyzw(q.i, q.j, q.k, q.w),
        );
        // parry supports every pair of a mesh with a convex shape: its "unsupported" error cannot come from here. Were
        // it to come all the same, "cuts" is the safe answer.
        intersection_test(&Pose::IDENTITY, &self.trimesh, &pose, shape)
            .map_or(true, |found| found.intersecting)
    }
}

fn to_parry(v: &Vector3<f64>) -> ParryVector {
    ParryVector::new(v.x, v.y, v.z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::object::solids::cuboid;

    #[test]
    fn distances_to_a_cube_are_the_closed_form_inside_and_out() {
        let mesh = cuboid([1.0; 3]).unwrap().transformed(&Isometry3::translation(0.5, 0.5, 0.0));
        let query = SurfaceQuery::new(&mesh).unwrap();
        for (point, expected) in [
            ([0.5, 0.5, 1.25], 0.25),
            ([0.5, 0.5, 0.9], -0.1),
            ([2.0, 2.0, 0.5], 2f64.sqrt()),
            ([1.5, 1.5, 1.5], 0.75f64.sqrt()),
            ([0.99, 0.98, 0.97], -0.01),
        ] {
            let found = query.nearest(&Point3::from(point)).signed_distance_m;
            assert!((found - expected).abs() < 1e-12, "{point:?}: {found} for {expected}");
        }
    }
}
