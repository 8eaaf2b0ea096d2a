//! The picture of a grasp: object, hand, friction cones, table.

use image::RgbImage;
use nalgebra::{Isometry3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};

use super::raster::{Camera, Color, Triangle, render};
use crate::grasp::contact::Contact;
use crate::hand::{Hand, Posture};
use crate::surface::Mesh;

const OBJECT: Color = [222, 196, 150];
const PALM: Color = [96, 110, 130];
const FINGERS: Color = [140, 156, 180];
const TIPS: Color = [70, 84, 104];
const CONES: Color = [214, 72, 60];
const TABLE: Color = [226, 228, 226];
const BACKGROUND: Color = [250, 250, 248];

/// Length of a drawn friction cone, metres.
const CONE_M: f64 = 0.030;

/// What to draw.
pub struct Picture<'a> {
    /// The object, in its own frame.
    pub object: &'a Mesh,
    /// The hand's shape.
    pub hand: &'a Hand,
    /// Pose of the palm in the base frame.
    pub base_from_palm: Isometry3<f64>,
    /// Joint angles.
    pub posture: &'a Posture,
    /// Contacts, object frame, each drawn as its friction cone on the outside of the object.
    pub contacts: &'a [Contact],
    /// Pose of the frame in which object and contacts are given.
    pub base_from_object: Isometry3<f64>,
    /// Height of the table's top, if there is one.
    pub table_height_m: Option<f64>,
}

impl Picture<'_> {
    /// Renders the scene from the side, a little above, so that thumb and fingers are both seen.
    #[must_use]
    pub fn render(&self, width: u32, height: u32) -> RgbImage {
        let mut triangles = Vec::new();
        let object = self.object.transformed(&self.base_from_object);
        push_mesh(&mut triangles, &object, OBJECT);
        self.push_hand(&mut triangles);
        for contact in self.contacts {
            self.push_cone(&mut triangles, contact);
        }
        let (low, high) = object.bounding_box();
        let middle = low + 0.5 * (high - low);
        if let Some(z) = self.table_height_m {
            let half = 0.16;
            let corner = |x: f64, y: f64| Point3::new(middle.x + x * half, middle.y + y * half, z);
            let corners = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
            push_quad(&mut triangles, corners, TABLE);
        }
        let target = Point3::from(0.5 * (middle.coords + self.base_from_palm.translation.vector));
        // Across the opposition, so that the gap between thumb and fingers lies open to the eye.
        let palm_y = self.base_from_palm * Vector3::y();
        let side = Vector3::new(palm_y.x, palm_y.y, 0.0).try_normalize(1e-6).unwrap_or_else(Vector3::y);
        let palm_x = self.base_from_palm * Vector3::x();
        let eye = target + side * 0.60 + palm_x * 0.18 + Vector3::z() * 0.22;
        render(&triangles, &Camera { eye, target, field_of_view_rad: 0.55 }, width, height, BACKGROUND)
    }

    fn push_hand(&self, triangles: &mut Vec<Triangle>) {
        for part in &self.hand.palm {
            push_box(triangles, &(self.base_from_palm * part.palm_from_box), &part.half_extents_m, PALM);
        }
        let mut centers = Vec::new();
        for finger in &self.hand.fingers {
            let frames = finger.frames(self.posture);
            finger.bead_centers(self.posture, &mut centers);
            let (Some(first), Some(center)) = (finger.beads().first(), centers.first()) else { continue };
            let root = Point3::from(frames.palm_from_segment(first.segment).translation.vector);
            // The carrier of the finger, from the palm's nearest point; the models give no shape for it.
            let carrier = self.hand.palm.iter().map(|part| {
                let in_box = part.palm_from_box.inverse() * root;
                let half = &part.half_extents_m;
                let nearest = in_box.coords.zip_map(half, |c, half: f64| c.clamp(-half, half));
                part.palm_from_box * Point3::from(nearest)
            });
            let nearest =
                carrier.min_by(|a, b| (a - root).norm().total_cmp(&(b - root).norm())).unwrap_or(*center);
            let base = self.base_from_palm;
            push_tube(triangles, &(base * nearest), &(base * root), first.radius_m, PALM);
            let joints: Vec<(Point3<f64>, f64)> = std::iter::once((base * root, first.radius_m))
                .chain(finger.beads().iter().zip(&centers).map(|(bead, c)| (base * c, bead.radius_m)))
                .collect();
            for pair in joints.windows(2) {
                push_tube(triangles, &pair[0].0, &pair[1].0, pair[0].1 * 0.96, FINGERS);
            }
            if let Some((tip, radius_m)) = joints.last() {
                push_sphere(triangles, tip, *radius_m, TIPS);
            }
        }
    }

    /// A cone with its apex at the contact, opening against the inward normal with half angle atan(mu).
    fn push_cone(&self, triangles: &mut Vec<Triangle>, contact: &Contact) {
        const SIDES: usize = 24;
        let apex = self.base_from_object * contact.point_in_object();
        let outward = -(self.base_from_object * contact.inward_normal_in_object().into_inner());
        let across =
            outward.cross(&if outward.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() }).normalize();
        let ring = |k: usize| {
            let turn =
                Rotation3::from_scaled_axis(outward * (std::f64::consts::TAU * k as f64 / SIDES as f64));
            apex + CONE_M * (outward + turn * across * contact.friction())
        };
        triangles.extend((0..SIDES).map(|k| Triangle {
            corners: [apex, ring(k), ring(k + 1)],
            color: CONES,
            mark: true,
        }));
    }
}

fn push_mesh(triangles: &mut Vec<Triangle>, mesh: &Mesh, color: Color) {
    triangles.extend((0..mesh.faces().len()).map(|face| Triangle {
        corners: mesh.corners(face),
        color,
        mark: false,
    }));
}

fn push_quad(triangles: &mut Vec<Triangle>, [a, b, c, d]: [Point3<f64>; 4], color: Color) {
    triangles.push(Triangle { corners: [a, b, c], color, mark: false });
    triangles.push(Triangle { corners: [a, c, d], color, mark: false });
}

fn push_box(triangles: &mut Vec<Triangle>, frame: &Isometry3<f64>, half_m: &Vector3<f64>, color: Color) {
    let corner = |x: f64, y: f64, z: f64| frame * Point3::new(x * half_m.x, y * half_m.y, z * half_m.z);
    for sign in [-1.0, 1.0] {
        let rounds = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        push_quad(triangles, rounds.map(|(u, v)| corner(sign, u, v)), color);
        push_quad(triangles, rounds.map(|(u, v)| corner(u, sign, v)), color);
        push_quad(triangles, rounds.map(|(u, v)| corner(u, v, sign)), color);
    }
}

/// The side of a cylinder between two points, with a ball at its end.
fn push_tube(
    triangles: &mut Vec<Triangle>,
    from: &Point3<f64>,
    to: &Point3<f64>,
    radius_m: f64,
    color: Color,
) {
    const SIDES: usize = 20;
    push_sphere(triangles, to, radius_m, color);
    let way = to - from;
    let Some(axis) = way.try_normalize(1e-9) else { return };
    let turn = UnitQuaternion::rotation_between(&Vector3::z(), &axis).unwrap_or_else(|| {
        // Antiparallel: any half turn about a horizontal axis.
        UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI)
    });
    let frame = Isometry3::from_parts(Translation3::from(from.coords), turn);
    let rim = |k: usize, z: f64| {
        let (sin, cos) = (std::f64::consts::TAU * k as f64 / SIDES as f64).sin_cos();
        frame * Point3::new(radius_m * cos, radius_m * sin, z)
    };
    for k in 0..SIDES {
        push_quad(
            triangles,
            [rim(k, 0.0), rim(k + 1, 0.0), rim(k + 1, way.norm()), rim(k, way.norm())],
            color,
        );
    }
}

fn push_sphere(triangles: &mut Vec<Triangle>, center: &Point3<f64>, radius_m: f64, color: Color) {
    const RINGS: usize = 12;
    const SIDES: usize = 20;
    let point = |ring: usize, side: usize| {
        let (sin_polar, cos_polar) = (std::f64::consts::PI * ring as f64 / RINGS as f64).sin_cos();
        let (sin, cos) = (std::f64::consts::TAU * side as f64 / SIDES as f64).sin_cos();
        center + radius_m * Vector3::new(sin_polar * cos, sin_polar * sin, cos_polar)
    };
    for ring in 0..RINGS {
        for side in 0..SIDES {
            let corners =
                [point(ring, side), point(ring, side + 1), point(ring + 1, side + 1), point(ring + 1, side)];
            push_quad(triangles, corners, color);
        }
    }
}
