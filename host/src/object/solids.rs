//! Generators of watertight solids that stand on z = 0 with the z axis through their centre.

use std::f64::consts::TAU;

use nalgebra::Point3;

use crate::surface::{Mesh, MeshError};

/// A point of a profile that is turned about the z axis: distance from the axis and height, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProfilePoint {
    /// Distance from the axis, metres, never negative. A point with exactly 0 becomes one vertex.
    pub radius_m: f64,
    /// Height, metres.
    pub z_m: f64,
}

impl ProfilePoint {
    /// A profile point from metres.
    #[must_use]
    pub const fn new(radius_m: f64, z_m: f64) -> Self {
        Self { radius_m, z_m }
    }

    /// The point at `angle_rad` about the z axis.
    #[must_use]
    pub fn turned(&self, angle_rad: f64) -> Point3<f64> {
        let (sin, cos) = angle_rad.sin_cos();
        Point3::new(self.radius_m * cos, self.radius_m * sin, self.z_m)
    }
}

/// Turns a closed profile about the z axis in `segments` (at least 3) steps.
///
/// The profile runs counter-clockwise with the radius to the right and z up, so that matter lies on its left; its
/// last point joins the first. An edge on the axis sweeps no area and vanishes. Errors when the profile has no area
/// or a coordinate that is not finite.
pub fn revolve(profile: &[ProfilePoint], segments: usize) -> Result<Mesh, MeshError> {
    let segments = segments.max(3);
    let mut vertices = Vec::with_capacity(profile.len() * segments);
    let mut rings = Vec::with_capacity(profile.len());
    for point in profile {
        let count = if point.radius_m == 0.0 { 1 } else { segments };
        rings.push((vertices.len(), count));
        vertices.extend((0..count).map(|s| point.turned(TAU * s as f64 / segments as f64)));
    }
    let vertex = |(start, count): (usize, usize), segment: usize| (start + segment % count) as u32;
    let mut faces = Vec::with_capacity(2 * profile.len() * segments);
    for (index, &from) in rings.iter().enumerate() {
        let to = rings[(index + 1) % rings.len()];
        for s in 0..segments {
            if from.1 > 1 {
                faces.push([vertex(from, s), vertex(from, s + 1), vertex(to, s + 1)]);
            }
            if to.1 > 1 {
                faces.push([vertex(from, s), vertex(to, s + 1), vertex(to, s)]);
            }
        }
    }
    Mesh::new(vertices, faces)
}

/// The profile of an upright cylinder with the given radius and height, metres.
#[must_use]
pub fn cylinder_profile(radius_m: f64, height_m: f64) -> [ProfilePoint; 4] {
    [(0.0, 0.0), (radius_m, 0.0), (radius_m, height_m), (0.0, height_m)].map(|(r, z)| ProfilePoint::new(r, z))
}

/// An upright box with the given sides along x, y and z, metres. Errors when a side is zero or not finite.
pub fn cuboid(sides_m: [f64; 3]) -> Result<Mesh, MeshError> {
    let [a, b, c] = sides_m;
    let corner = |i: usize| {
        let side = |bit: usize| if i >> bit & 1 == 1 { 0.5 } else { -0.5 };
        Point3::new(a * side(0), b * side(1), c * (side(2) + 0.5))
    };
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let faces = quads.iter().flat_map(|&[p, q, r, s]| [[p, q, r], [p, r, s]]).collect();
    Mesh::new((0..8).map(corner).collect(), faces)
}

/// Upper half of the superellipsoid `(|x/a|^p + |y/b|^p)^(q/p) + |z/h|^q = 1` on its flat base; convex for p, q >= 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HalfSuperellipsoid {
    /// Half length along x, half width along y, height; metres.
    pub semi_axes_m: [f64; 3],
    /// Exponent p of the plan: 2 an ellipse, larger is squarer.
    pub plan_exponent: f64,
    /// Exponent q of the elevation.
    pub elevation_exponent: f64,
}

impl HalfSuperellipsoid {
    /// Samples the surface in `segments` (at least 3) steps about z and `rings` (at least 1) steps from base to top.
    ///
    /// Errors when a semi-axis is zero or a parameter is not finite.
    pub fn mesh(&self, segments: usize, rings: usize) -> Result<Mesh, MeshError> {
        let (segments, rings) = (segments.max(3), rings.max(1));
        let mut vertices = vec![Point3::origin(), Point3::new(0.0, 0.0, self.semi_axes_m[2])];
        for ring in 0..rings {
            let elevation = 0.25 * TAU * ring as f64 / rings as f64;
            for segment in 0..segments {
                vertices.push(self.at(TAU * segment as f64 / segments as f64, elevation));
            }
        }
        let vertex = |ring: usize, segment: usize| (2 + ring * segments + segment % segments) as u32;
        let mut faces = Vec::with_capacity(2 * rings * segments);
        for s in 0..segments {
            faces.push([0, vertex(0, s + 1), vertex(0, s)]);
            for r in 1..rings {
                faces.push([vertex(r - 1, s), vertex(r - 1, s + 1), vertex(r, s + 1)]);
                faces.push([vertex(r - 1, s), vertex(r, s + 1), vertex(r, s)]);
            }
            faces.push([vertex(rings - 1, s), vertex(rings - 1, s + 1), 1]);
        }
        Mesh::new(vertices, faces)
    }

    /// The surface point in the direction that azimuth and elevation have on the unit sphere. Scaling along that
    /// direction spreads vertices evenly, where the usual signed-power parameters crowd them at the flat parts.
    fn at(&self, azimuth_rad: f64, elevation_rad: f64) -> Point3<f64> {
        let (sin_a, cos_a) = azimuth_rad.sin_cos();
        let (sin_e, cos_e) = elevation_rad.sin_cos();
        let (x, y, z) = (cos_e * cos_a, cos_e * sin_a, sin_e);
        let (p, q) = (self.plan_exponent, self.elevation_exponent);
        let plan = x.abs().powf(p) + y.abs().powf(p);
        let scale = (plan.powf(q / p) + z.powf(q)).powf(-1.0 / q);
        let [a, b, h] = self.semi_axes_m;
        Point3::new(a * x * scale, b * y * scale, h * z * scale)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    fn assert_close(found: f64, expected: f64, relative: f64) {
        assert!((found / expected - 1.0).abs() < relative, "found {found}, expected {expected}");
    }

    #[test]
    fn box_has_its_volume_area_and_footprint() {
        let mesh = cuboid([0.02, 0.03, 0.05]).unwrap();
        assert!(mesh.is_watertight());
        assert_close(mesh.signed_volume_m3(), 0.02 * 0.03 * 0.05, 1e-12);
        assert_close(mesh.area_m2(), 2.0 * (0.02 * 0.03 + 0.03 * 0.05 + 0.02 * 0.05), 1e-12);
        let (low, high) = mesh.bounding_box();
        assert!((low - Point3::new(-0.01, -0.015, 0.0)).norm() < 1e-15);
        assert!((high - Point3::new(0.01, 0.015, 0.05)).norm() < 1e-15);
    }

    #[test]
    fn turned_polygon_has_the_volume_of_its_prism() {
        // An n-gon in a circle of radius r has the area n/2 r^2 sin(2 pi / n).
        let (r, h, n) = (0.03, 0.08, 48);
        let mesh = revolve(&cylinder_profile(r, h), n).unwrap();
        assert!(mesh.is_watertight());
        let base = 0.5 * n as f64 * r * r * (TAU / n as f64).sin();
        assert_close(mesh.signed_volume_m3(), base * h, 1e-12);
        assert_close(mesh.area_m2(), 2.0 * base + 2.0 * n as f64 * r * (PI / n as f64).sin() * h, 1e-12);
    }

    #[test]
    fn a_profile_off_the_axis_makes_a_ring() {
        let square =
            [(0.04, 0.0), (0.05, 0.0), (0.05, 0.01), (0.04, 0.01)].map(|(r, z)| ProfilePoint::new(r, z));
        let mesh = revolve(&square, 400).unwrap();
        assert!(mesh.is_watertight());
        // Pappus: area of the section times the path of its centroid.
        assert_close(mesh.signed_volume_m3(), 1e-4 * TAU * 0.045, 1e-4);
    }

    #[test]
    fn exponents_of_two_make_half_an_ellipsoid() {
        let half = HalfSuperellipsoid {
            semi_axes_m: [0.05, 0.03, 0.04],
            plan_exponent: 2.0,
            elevation_exponent: 2.0,
        };
        let mesh = half.mesh(200, 60).unwrap();
        assert!(mesh.is_watertight());
        assert_close(mesh.signed_volume_m3(), 2.0 / 3.0 * PI * 0.05 * 0.03 * 0.04, 1e-3);
        let squarer = HalfSuperellipsoid { plan_exponent: 3.0, ..half }.mesh(200, 60).unwrap();
        assert!(squarer.signed_volume_m3() > mesh.signed_volume_m3());
    }

    #[test]
    fn flat_solids_are_refused() {
        assert!(revolve(&[], 8).is_err());
        assert!(revolve(&cylinder_profile(0.0, 0.1), 8).is_err());
        assert!(cuboid([f64::NAN, 1.0, 1.0]).is_err());
    }
}
