//! Objects to scan and grasp: the paper's five, generated from their dimensions, or anybody's mesh.
//!
//! The paper names a teacup cover, cubes, cylinders, computer mice and disks, and gives only the range of 10 to 140 mm.
//! Sizes and masses here are those of common specimens; where a figure is a choice, the object's documentation says so.

pub mod solids;
mod teacup_cover;

use std::{fmt, str::FromStr};

use nalgebra::Point3;
use parry3d_f64::{
    math::Vector,
    transformation::{
        try_convex_hull,
        vhacd::{VHACD, VHACDParameters},
    },
};
use thiserror::Error;

use crate::surface::{Mesh, MeshError};
use solids::{HalfSuperellipsoid, cuboid, cylinder_profile, revolve};

/// Friction coefficient of the rubber fingertips on every built-in object: the paper's conservative design value.
pub const DESIGN_FRICTION: f64 = 0.4;

/// A body that fills this share of its hull's volume counts as convex: scans of convex things fill 0.98 and more.
const CONVEX_SHARE: f64 = 0.97;

/// Steps about the axis of round objects: a chord of a 90 mm circle stays within 25 um of the arc.
const SEGMENTS: usize = 96;

/// A rigid object to be grasped.
#[derive(Debug, Clone, PartialEq)]
pub struct Object {
    /// Name for reports.
    pub name: String,
    /// Surface in the object's frame, metres. A built-in object stands on z = 0, z axis through its centre.
    pub mesh: Mesh,
    /// Mass.
    pub mass_kg: f64,
    /// Coulomb friction coefficient of the fingertips on this object.
    pub friction: f64,
    /// Convex parts known from the construction, if any.
    pieces: Option<Vec<Vec<Point3<f64>>>>,
}

impl Object {
    /// An object from a mesh of any origin.
    #[must_use]
    pub fn new(name: impl Into<String>, mesh: Mesh, mass_kg: f64, friction: f64) -> Self {
        Self { name: name.into(), mesh, mass_kg, friction, pieces: None }
    }

    /// The same object, its convex pieces found once and for all.
    #[must_use]
    pub fn decomposed(mut self) -> Self {
        self.pieces = Some(self.convex_pieces());
        self
    }

    /// Vertices of convex parts whose union is the body, object frame, metres: what a physics engine collides with.
    ///
    /// Built-in objects know theirs from the construction. A mesh from elsewhere that is convex is its own hull; any other
    /// is decomposed approximately (VHACD, 64 voxels along its longest side), which takes a moment and needs a closed
    /// mesh to be right.
    #[must_use]
    pub fn convex_pieces(&self) -> Vec<Vec<Point3<f64>>> {
        if let Some(pieces) = &self.pieces {
            return pieces.clone();
        }
        let points: Vec<Vector> = self.mesh.vertices().iter().map(|p| Vector::new(p.x, p.y, p.z)).collect();
        let to_points = |hull: Vec<Vector>| -> Vec<Point3<f64>> {
            hull.into_iter().map(|p| Point3::new(p.x, p.y, p.z)).collect()
        };
        if let Ok((hull, faces)) = try_convex_hull(&points) {
            let hull = to_points(hull);
            let hull_m3 =
                Mesh::new(hull.clone(), faces).map_or(f64::INFINITY, |hull| hull.signed_volume_m3().abs());
            if self.mesh.is_watertight() && self.mesh.signed_volume_m3() > CONVEX_SHARE * hull_m3 {
                return vec![hull];
            }
        }
        let parameters = VHACDParameters { resolution: 64, ..VHACDParameters::default() };
        VHACD::decompose(&parameters, &points, self.mesh.faces(), true)
            .compute_exact_convex_hulls(&points, self.mesh.faces())
            .into_iter()
            .map(|(hull, _)| to_points(hull))
            .collect()
    }
}

/// An object that needs no file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BuiltIn {
    /// Porcelain lid, D 90 mm, 48 mm high with its knob, 70 g. The shape is a choice within what lids of tea bowls
    /// measure (80 to 95 mm across); it stands on its flange, its rim 10 mm above the table.
    TeacupCover,
    /// Plastic or wooden cube, side 50 mm, 100 g.
    Cube,
    /// Tube or cup, D 50 x 90 mm, upright, 120 g.
    Cylinder,
    /// Computer mouse, 115 x 60 x 38 mm with its length along x, 100 g; half a superellipsoid, exponents 2.5.
    Mouse,
    /// Disk, D 100 x 20 mm, flat on the table, 130 g.
    Disk,
}

/// A name or a size that makes no object.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ObjectError {
    /// No built-in object has that name.
    #[error("no built-in object is called '{0}'; there are teacup-cover, cube, cylinder, mouse and disk")]
    UnknownName(String),
    /// The scale is zero, negative or not finite.
    #[error("scale {0} is not a positive number")]
    Scale(f64),
    /// The dimensions make no solid.
    #[error(transparent)]
    Mesh(#[from] MeshError),
}

impl BuiltIn {
    /// All of them, in the paper's order.
    pub const ALL: [Self; 5] = [Self::TeacupCover, Self::Cube, Self::Cylinder, Self::Mouse, Self::Disk];

    /// The name on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::TeacupCover => "teacup-cover",
            Self::Cube => "cube",
            Self::Cylinder => "cylinder",
            Self::Mouse => "mouse",
            Self::Disk => "disk",
        }
    }

    /// Mass at scale 1.
    const fn mass_kg(self) -> f64 {
        match self {
            Self::TeacupCover => 0.070,
            Self::Cube | Self::Mouse => 0.100,
            Self::Cylinder => 0.120,
            Self::Disk => 0.130,
        }
    }

    /// The object with every length multiplied by `scale`, and its mass by the cube of it.
    ///
    /// Errors when `scale` is not a positive number.
    pub fn object(self, scale: f64) -> Result<Object, ObjectError> {
        if !(scale.is_finite() && scale > 0.0) {
            return Err(ObjectError::Scale(scale));
        }
        let mesh = self.mesh()?.scaled(scale);
        let mut pieces = match self {
            Self::TeacupCover => teacup_cover::convex_pieces(),
            _ => return Ok(self.finish(mesh.clone(), vec![mesh.vertices().to_vec()], scale)),
        };
        pieces.iter_mut().flatten().for_each(|point| *point *= scale);
        Ok(self.finish(mesh, pieces, scale))
    }

    fn finish(self, mesh: Mesh, pieces: Vec<Vec<Point3<f64>>>, scale: f64) -> Object {
        let mass_kg = self.mass_kg() * scale.powi(3);
        let pieces = Some(pieces);
        Object { name: self.name().to_owned(), mesh, mass_kg, friction: DESIGN_FRICTION, pieces }
    }

    fn mesh(self) -> Result<Mesh, MeshError> {
        match self {
            Self::TeacupCover => revolve(&teacup_cover::profile(), SEGMENTS),
            Self::Cube => cuboid([0.05; 3]),
            Self::Cylinder => revolve(&cylinder_profile(0.025, 0.090), SEGMENTS),
            Self::Mouse => HalfSuperellipsoid {
                semi_axes_m: [0.0575, 0.030, 0.038],
                plan_exponent: 2.5,
                elevation_exponent: 2.5,
            }
            .mesh(64, 16),
            Self::Disk => revolve(&cylinder_profile(0.050, 0.020), SEGMENTS),
        }
    }
}

impl fmt::Display for BuiltIn {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for BuiltIn {
    type Err = ObjectError;

    fn from_str(name: &str) -> Result<Self, ObjectError> {
        let found = Self::ALL.into_iter().find(|object| object.name() == name);
        found.ok_or_else(|| ObjectError::UnknownName(name.to_owned()))
    }
}

#[cfg(test)]
mod tests;
