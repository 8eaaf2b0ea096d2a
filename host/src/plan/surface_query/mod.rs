//! The object as the fingers meet it: distance and nearest point on its surface.
//!
//! A grasp attempt asks hundreds of times. Cells around the object say how far the surface is at least (`field`), which
//! settles most questions; a tree of boxes over the triangles answers the others exactly (`tree`), and pseudo-normals
//! give the sign (`sides`). parry decides what a single triangle does; these are the only files of the planner that
//! speak its glam types.

mod field;
mod sides;
#[cfg(test)]
mod tests;
mod tree;

use nalgebra::{Isometry3, Point3, Unit, Vector3};
use parry3d_f64::math::{Pose, Rotation, Vector as ParryVector};
use parry3d_f64::query::{Ray, RayCast, intersection_test};
use parry3d_f64::shape::{Capsule, Cuboid, Shape, Triangle};
use thiserror::Error;

use self::field::{Cell, Field, Reading, Sample};
use self::sides::Sides;
use self::tree::{Tree, TurnedBox};
use crate::surface::Mesh;

/// Largest coordinate of a mesh, metres: the cubes of sizes must stay finite in single precision.
const MAX_COORDINATE_M: f64 = 1.0e12;

/// Triangles of an open mesh that are looked at to prove that a cell is before the surface.
const MAX_PROOF_TRIANGLES: usize = 256;

/// A way is cut into at most two to this power pieces.
const MAX_HALVINGS: f64 = 10.0;

/// Single precision rounds what a cell holds by less than this share.
const SINGLE_ROUNDING: f64 = 2.0e-7;

/// Why a mesh cannot be asked for distances.
#[derive(Debug, Error)]
pub enum SurfaceQueryError {
    /// More triangles than the index can number.
    #[error("{0} triangles are too many for distance queries")]
    TooManyTriangles(usize),
    /// A coordinate beyond any use.
    #[error("a coordinate of {0:e} m is too large for distance queries")]
    TooLarge(f64),
}

/// The nearest point of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Nearest {
    /// The point on the surface, in the object's frame, metres.
    pub point_in_object: Point3<f64>,
    /// Distance to it, metres; negative when the asked point is inside the body. On an open mesh "inside" means
    /// behind the nearest sheet.
    pub signed_distance_m: f64,
}

/// A mesh that answers distance queries from many threads.
pub struct SurfaceQuery {
    tree: Tree,
    sides: Sides,
    field: Field,
    /// A sphere about the whole surface.
    center_in_object: Point3<f64>,
    radius_m: f64,
    /// The upright box about it.
    low: ParryVector,
    high: ParryVector,
}

impl SurfaceQuery {
    /// Indexes a mesh. Errors when its triangles are too many or too large.
    pub fn new(mesh: &Mesh) -> Result<Self, SurfaceQueryError> {
        let faces = mesh.faces();
        if faces.len() >= u32::MAX as usize / 3 {
            return Err(SurfaceQueryError::TooManyTriangles(faces.len()));
        }
        let (low, high) = mesh.bounding_box();
        let largest_m = low.coords.amax().max(high.coords.amax());
        if largest_m > MAX_COORDINATE_M {
            return Err(SurfaceQueryError::TooLarge(largest_m));
        }
        let center_in_object = nalgebra::center(&low, &high);
        let radius_squared = mesh.vertices().iter().map(|p| (p - center_in_object).norm_squared());
        let radius_m = radius_squared.fold(0.0, f64::max).sqrt();
        let [low, high] = [low, high].map(|p| to_parry(&p.coords));
        let vertices: Vec<ParryVector> = mesh.vertices().iter().map(|p| to_parry(&p.coords)).collect();
        let triangles: Vec<Triangle> = faces
            .iter()
            .map(|&[a, b, c]| Triangle::new(vertices[a as usize], vertices[b as usize], vertices[c as usize]))
            .collect();
        let (tree, order) = Tree::new(&triangles, [low, high]);
        let corners = order.iter().map(|&face| faces[face as usize]).collect();
        let sides = Sides::new(tree.triangles(), corners, &vertices);
        Ok(Self { tree, sides, field: Field::new([low, high]), center_in_object, radius_m, low, high })
    }

    /// Lower bound of the signed distance to the surface, metres, for the price of a look-up: about a cell (a
    /// two-hundredth of the object with 60 mm around it) below the truth near the surface, a third of the truth at most
    /// far from it.
    ///
    /// It holds for every surface that does not cross itself. Of an open one, a point counts as outside when it is
    /// outside the sphere about the whole; within, the bound is negative where the side is not clear.
    #[must_use]
    pub fn distance_bound_m(&self, point_in_object: &Point3<f64>) -> f64 {
        let from_center_m = (point_in_object - self.center_in_object).norm();
        let from_sphere_m = from_center_m - self.radius_m;
        let point = to_parry(&point_in_object.coords);
        let closed = self.sides.closed();
        let bound_m = match self.read(point) {
            Some(reading) => reading.bound_m(),
            // Outside the cells the upright box is outside the body, if there is one.
            None if closed => self.outside_box_m(point),
            None => -(from_center_m + self.radius_m),
        };
        if closed || from_sphere_m > 0.0 { bound_m.max(from_sphere_m) } else { bound_m }
    }

    /// Distance from the upright box about the surface, metres; 0 within.
    fn outside_box_m(&self, point: ParryVector) -> f64 {
        (self.low - point).max(point - self.high).max(ParryVector::ZERO).length()
    }

    /// The nearest point of the surface to `point_in_object`.
    #[must_use]
    pub fn nearest(&self, point_in_object: &Point3<f64>) -> Nearest {
        let point = to_parry(&point_in_object.coords);
        let seed = self.read(point).map_or(0, |reading| reading.sample.triangle);
        self.nearest_from(point, seed)
    }

    /// The nearest point, unless the signed distance is more than `max_m`: then `None`, mostly at the price of
    /// [`Self::distance_bound_m`]. Points inside always have one.
    #[must_use]
    pub fn nearest_within(&self, point_in_object: &Point3<f64>, max_m: f64) -> Option<Nearest> {
        let point = to_parry(&point_in_object.coords);
        let reading = self.read(point);
        let is_beyond = match &reading {
            Some(reading) => reading.bound_m() > max_m,
            None => self.sides.closed() && self.outside_box_m(point) > max_m,
        };
        if is_beyond {
            return None;
        }
        let nearest = self.nearest_from(point, reading.map_or(0, |reading| reading.sample.triangle));
        (nearest.signed_distance_m <= max_m).then_some(nearest)
    }

    /// Whether a ball neither touches the surface nor lies inside.
    #[must_use]
    pub fn clear_of_ball(&self, center_in_object: &Point3<f64>, radius_m: f64) -> bool {
        self.nearest_within(center_in_object, radius_m).is_none()
    }

    /// Whether a box, centred on its own frame with the given half extents, cuts the surface. A shape whose coordinates
    /// are no numbers, here and below, cuts.
    #[must_use]
    pub fn cuts_box(&self, object_from_box: &Isometry3<f64>, half_extents_m: &Vector3<f64>) -> bool {
        let center = to_parry(&object_from_box.translation.vector);
        let inner_m = half_extents_m.min();
        if let Some(known) = self.ball_cut(center, inner_m, half_extents_m.norm()) {
            return known;
        }
        let region = self.region(object_from_box, half_extents_m);
        self.cut_by(&region, object_from_box, &Cuboid::new(to_parry(half_extents_m)))
    }

    /// Whether a box cuts the surface anywhere on the straight way from where it stands to `way_in_object` beyond,
    /// metres. "No" is proven for every place of the way; "yes" may be wrong by a surface within `step_m` of it.
    #[must_use]
    pub fn cuts_moving_box(
        &self,
        object_from_box: &Isometry3<f64>,
        half_extents_m: &Vector3<f64>,
        way_in_object: &Vector3<f64>,
        step_m: f64,
    ) -> bool {
        let halvings = (way_in_object.norm() / step_m).log2().ceil().clamp(0.0, MAX_HALVINGS) as u32;
        self.cuts_moving(object_from_box, half_extents_m, way_in_object, halvings)
    }

    fn cuts_moving(
        &self,
        object_from_box: &Isometry3<f64>,
        half_extents_m: &Vector3<f64>,
        way_in_object: &Vector3<f64>,
        halvings: u32,
    ) -> bool {
        // The box, in its own frame, about all that it passes over: empty, or to be looked at in halves.
        let half_way = 0.5 * way_in_object;
        let mut middle = *object_from_box;
        middle.translation.vector += half_way;
        let along = middle.inverse_transform_vector(&half_way).abs();
        if !self.cuts_box(&middle, &(half_extents_m + along)) {
            return false;
        }
        halvings == 0
            || self.cuts_box(&middle, half_extents_m)
            || self.cuts_moving(object_from_box, half_extents_m, &half_way, halvings - 1)
            || self.cuts_moving(&middle, half_extents_m, &half_way, halvings - 1)
    }

    /// Whether a capsule about the segment between two points cuts the surface.
    #[must_use]
    pub fn cuts_capsule(&self, ends_in_object: &[Point3<f64>; 2], radius_m: f64) -> bool {
        let [from, to] = ends_in_object;
        let half_length_m = 0.5 * (to - from).norm();
        let middle = nalgebra::center(from, to);
        if let Some(known) = self.ball_cut(to_parry(&middle.coords), radius_m, half_length_m + radius_m) {
            return known;
        }
        let turn = nalgebra::UnitQuaternion::rotation_between(&Vector3::x(), &(to - from));
        let object_from_middle =
            Isometry3::from_parts(middle.into(), turn.unwrap_or(nalgebra::UnitQuaternion::identity()));
        // Opposite to the x axis no rotation is found, and none is needed: a box looks the same from both ends.
        let half = Vector3::new(half_length_m + radius_m, radius_m, radius_m);
        let region = self.region(&object_from_middle, &half);
        let [a, b] = ends_in_object.map(|p| to_parry(&p.coords));
        self.cut_by(&region, &Isometry3::identity(), &Capsule::new(a, b, radius_m))
    }

    /// How far a ray goes until it meets the surface, metres, and the unit normal there, turned against the ray or along
    /// it as parry has it; `None` when it meets nothing.
    #[must_use]
    pub fn cast_ray(
        &self,
        from_in_object: &Point3<f64>,
        direction: &Unit<Vector3<f64>>,
    ) -> Option<(f64, Vector3<f64>)> {
        // No surface is farther than the far side of the sphere about it.
        let longest_m = (from_in_object - self.center_in_object).norm() + self.radius_m;
        let turn = nalgebra::UnitQuaternion::rotation_between(&Vector3::x(), direction);
        let middle = from_in_object + direction.into_inner() * (0.5 * longest_m);
        // Opposite to the x axis no rotation is found, and none is needed: a box looks the same from both ends.
        let object_from_middle =
            Isometry3::from_parts(middle.into(), turn.unwrap_or(nalgebra::UnitQuaternion::identity()));
        let region = self.region(&object_from_middle, &Vector3::new(0.5 * longest_m, 0.0, 0.0));
        if !region.is_finite() {
            return None;
        }
        let ray = Ray::new(to_parry(&from_in_object.coords), to_parry(direction));
        let mut nearest: Option<(f64, Vector3<f64>)> = None;
        self.tree.any_in_box(&region, &mut |triangle| {
            if let Some(hit) = triangle.cast_local_ray_and_get_normal(&ray, longest_m, false)
                && nearest.is_none_or(|(way_m, _)| hit.time_of_impact < way_m)
            {
                nearest = Some((hit.time_of_impact, Vector3::new(hit.normal.x, hit.normal.y, hit.normal.z)));
            }
            false
        });
        nearest
    }

    /// Bytes that the index takes now; the cells come on the heap as they are asked for.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.tree.bytes() + self.sides.bytes() + self.field.bytes()
    }

    /// Whether what lies between two balls about the same centre cuts the surface, where the cells know.
    fn ball_cut(&self, center: ParryVector, inner_m: f64, outer_m: f64) -> Option<bool> {
        let reading = self.read(center)?;
        let sample_m = f64::from(reading.sample.value_m).abs();
        if sample_m * (1.0 - SINGLE_ROUNDING) - reading.away_m > outer_m {
            return Some(false);
        }
        (sample_m * (1.0 + SINGLE_ROUNDING) + reading.away_m < inner_m).then_some(true)
    }

    fn region(&self, object_from_box: &Isometry3<f64>, half_extents_m: &Vector3<f64>) -> TurnedBox {
        let turn = object_from_box.rotation.to_rotation_matrix();
        let axes = [0, 1, 2].map(|i| to_parry(&turn.matrix().column(i).into_owned()));
        self.tree.turned_box(to_parry(&object_from_box.translation.vector), axes, to_parry(half_extents_m))
    }

    fn cut_by(&self, region: &TurnedBox, object_from_shape: &Isometry3<f64>, shape: &dyn Shape) -> bool {
        // Of what is farther than that, or no number, the boxes can tell nothing, and parry ends in an assertion.
        if !region.is_finite() {
            return true;
        }
        let q = object_from_shape.rotation.quaternion();
        let pose = Pose::from_parts(
            to_parry(&object_from_shape.translation.vector),
            Rotation::from_xyzw(q.i, q.j, q.k, q.w),
        );
        // parry supports every pair of a triangle with a convex shape: its "unsupported" error cannot come from here. Were
        // it to come all the same, "cuts" is the safe answer.
        self.tree.any_in_box(region, &mut |triangle| {
            intersection_test(&Pose::IDENTITY, triangle, &pose, shape)
                .map_or(true, |found| found.intersecting)
        })
    }

    fn read(&self, point: ParryVector) -> Option<Reading> {
        self.field.read(point, |cell, seed| self.measure(cell, seed.unwrap_or(0)))
    }

    fn measure(&self, cell: Cell, seed: u32) -> Sample {
        let hit = self.tree.nearest(cell.center, seed);
        let outside = !self.sides.inside(self.tree.triangles(), cell.center, &hit)
            && (self.sides.closed() || self.before_the_surface(cell, hit.distance_m));
        let value_m = if outside { hit.distance_m } else { -hit.distance_m };
        let single = value_m as f32;
        let value_m = if f64::from(single) > value_m { single.next_down() } else { single };
        Sample { value_m, triangle: hit.triangle }
    }

    /// Whether a whole cell of an open mesh is before every triangle that can be nearest to one of its points, so that
    /// the signed distance is positive throughout.
    fn before_the_surface(&self, cell: Cell, distance_m: f64) -> bool {
        let reach_m = distance_m + 2.0 * cell.half_diagonal_m;
        let mut seen = 0;
        !self.tree.any_in_ball(cell.center, reach_m, &mut |triangle| {
            seen += 1;
            let normal = triangle.scaled_normal();
            let before_m = (cell.center - triangle.a).dot(normal) / normal.length();
            // A triangle without a normal stands in the way.
            before_m.is_nan() || before_m <= cell.half_diagonal_m || seen > MAX_PROOF_TRIANGLES
        })
    }

    fn nearest_from(&self, point: ParryVector, seed: u32) -> Nearest {
        let hit = self.tree.nearest(point, seed);
        let inside = self.sides.inside(self.tree.triangles(), point, &hit);
        Nearest {
            point_in_object: Point3::new(hit.point.x, hit.point.y, hit.point.z),
            signed_distance_m: if inside { -hit.distance_m } else { hit.distance_m },
        }
    }
}

fn to_parry(v: &Vector3<f64>) -> ParryVector {
    ParryVector::new(v.x, v.y, v.z)
}
