//! Points spread over the object's surface, and what lies opposite them.

use nalgebra::{Point3, Unit, Vector3};
use rand::{Rng, RngExt};

use super::surface_query::SurfaceQuery;
use crate::surface::Mesh;

/// Samples below this share of a face's area are not worth a face: guards the sum against slivers.
const LEAST_AREA_M2: f64 = 1e-16;

/// A mesh from which points are drawn, evenly by area.
#[derive(Debug)]
pub struct SurfaceSampler {
    /// Sums of the faces' areas up to and with each face, metres squared.
    area_up_to_m2: Vec<f64>,
}

/// A point of the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint {
    /// Where, object frame.
    pub point_in_object: Point3<f64>,
    /// Out of the body, as the face is oriented.
    pub outward_normal: Unit<Vector3<f64>>,
}

/// Where a line through the body comes out again.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crossing {
    /// Length of the way inside, metres.
    pub thickness_m: f64,
    /// Out of the body at the far side.
    pub outward_normal: Unit<Vector3<f64>>,
}

impl SurfaceSampler {
    /// Sums the areas.
    #[must_use]
    pub fn new(mesh: &Mesh) -> Self {
        let mut sum = 0.0;
        let area_up_to_m2 = (0..mesh.faces().len())
            .map(|face| {
                let [a, b, c] = mesh.corners(face);
                sum += 0.5 * (b - a).cross(&(c - a)).norm();
                sum
            })
            .collect();
        Self { area_up_to_m2 }
    }

    /// A random point; `None` when the mesh has no area.
    #[must_use]
    pub fn draw(&self, mesh: &Mesh, rng: &mut impl Rng) -> Option<SurfacePoint> {
        let total = self.area_up_to_m2.last().copied().filter(|area| *area > LEAST_AREA_M2)?;
        let place = rng.random_range(0.0..total);
        let face = self.area_up_to_m2.partition_point(|up_to| *up_to <= place);
        let [a, b, c] = mesh.corners(face.min(self.area_up_to_m2.len() - 1));
        // Square root, so that the density is even (R. Osada et al., "Shape distributions", 2002, section 4.1).
        let (root, share) = (rng.random_range(0.0..1.0_f64).sqrt(), rng.random_range(0.0..1.0));
        let point = a.coords * (1.0 - root) + b.coords * (root * (1.0 - share)) + c.coords * (root * share);
        let outward_normal = Unit::try_new((b - a).cross(&(c - a)), 0.0)?;
        Some(SurfacePoint { point_in_object: Point3::from(point), outward_normal })
    }
}

/// Follows a ray from just under a surface point into the body until it comes out; `None` when it never does, as on open
/// meshes.
#[must_use]
pub fn through(
    surface: &SurfaceQuery,
    from: &Point3<f64>,
    direction: &Unit<Vector3<f64>>,
) -> Option<Crossing> {
    /// Under the surface by this much, metres, so that the ray does not meet its own start.
    const UNDER_M: f64 = 1e-6;
    let start = from + direction.into_inner() * UNDER_M;
    let (way_m, normal) = surface.cast_ray(&start, direction)?;
    // Out of the body means along the ray.
    let outward = if normal.dot(direction) < 0.0 { -normal } else { normal };
    Some(Crossing { thickness_m: way_m + UNDER_M, outward_normal: Unit::try_new(outward, 1e-12)? })
}

/// As [`through`], to the last time that the line comes out: across all hollows, as fingers outside see the body.
#[must_use]
pub fn across(
    surface: &SurfaceQuery,
    from: &Point3<f64>,
    direction: &Unit<Vector3<f64>>,
    longest_m: f64,
) -> Option<Crossing> {
    let beyond = from + direction.into_inner() * longest_m;
    let (way_m, normal) = surface.cast_ray(&beyond, &-*direction)?;
    let outward = if normal.dot(direction) < 0.0 { -normal } else { normal };
    Some(Crossing { thickness_m: longest_m - way_m, outward_normal: Unit::try_new(outward, 1e-12)? })
}

#[cfg(test)]
mod tests {
    use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};

    use super::*;
    use crate::object::solids::cuboid;

    #[test]
    fn points_lie_on_the_faces_in_proportion_to_their_areas() {
        let mesh = cuboid([1.0, 2.0, 3.0]).unwrap();
        let sampler = SurfaceSampler::new(&mesh);
        let surface = SurfaceQuery::new(&mesh).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut on_x = 0;
        for _ in 0..4000 {
            let drawn = sampler.draw(&mesh, &mut rng).unwrap();
            assert!(surface.nearest(&drawn.point_in_object).signed_distance_m.abs() < 1e-12);
            on_x += u32::from(drawn.outward_normal.x.abs() > 0.5);
            let crossing = through(&surface, &drawn.point_in_object, &-drawn.outward_normal).unwrap();
            let whole = across(&surface, &drawn.point_in_object, &-drawn.outward_normal, 10.0).unwrap();
            assert!((whole.thickness_m - crossing.thickness_m).abs() < 1e-9);
            let edges: Vector3<f64> = Vector3::new(1.0, 2.0, 3.0);
            let thickness_m = edges.dot(&drawn.outward_normal.abs());
            assert!((crossing.thickness_m - thickness_m).abs() < 1e-9);
            assert!(crossing.outward_normal.dot(&drawn.outward_normal) < -0.99);
        }
        // Faces across x have 12 of the 22 square metres: 2182 of 4000, one standard deviation 31.
        assert!((on_x as f64 - 2182.0).abs() < 130.0, "{on_x}");
    }
}
