//! Triangle meshes: the surface that contacts are found on.

use nalgebra::{Isometry3, Point3, Unit, Vector3};
use rayon::prelude::*;
use thiserror::Error;

use super::{cloud::bounding_box, provenance::Provenance};

/// Why arrays of vertices and faces are not a mesh.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum MeshError {
    /// No triangle at all, or only triangles without area.
    #[error("the mesh has no triangle with an area")]
    Empty,
    /// A coordinate is NaN or infinite.
    #[error("vertex {index} has a coordinate that is not a finite number")]
    NotFinite {
        /// Index of the vertex.
        index: usize,
    },
    /// A face names a vertex that does not exist.
    #[error("face {face} names vertex {index}, but there are only {vertices}")]
    IndexOutOfRange {
        /// Index of the face.
        face: usize,
        /// The vertex it names.
        index: u32,
        /// Number of vertices.
        vertices: usize,
    },
    /// More vertices than a 32-bit index can name.
    #[error("{0} vertices are more than a 32-bit index can name")]
    TooManyVertices(usize),
    /// The provenance is not one for each face.
    #[error("{found} provenances for {faces} faces")]
    Provenance {
        /// How many were given.
        found: usize,
        /// Number of faces.
        faces: usize,
    },
}

/// A triangle mesh, metres. Corners run counter-clockwise seen from outside, so [`Mesh::face_normal`] points out of
/// the body. It may be open, and it may have several components.
#[derive(Debug, Clone, PartialEq)]
pub struct Mesh {
    vertices: Vec<Point3<f64>>,
    faces: Vec<[u32; 3]>,
    /// One for each face, where it is known.
    provenance: Option<Vec<Provenance>>,
}

/// Mass properties of the body that a mesh bounds, for unit density.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bulk {
    /// Centre of mass, in the mesh's frame, metres.
    pub center_of_mass: Point3<f64>,
    /// Enclosed volume, m^3; for an open mesh the surface area in m^2 stands in the centre's weight and this is 0.
    pub volume_m3: f64,
}

impl Mesh {
    /// Checks indices and coordinates, and drops triangles without area (repeated corners, or three in a line).
    pub fn new(vertices: Vec<Point3<f64>>, mut faces: Vec<[u32; 3]>) -> Result<Self, MeshError> {
        if u32::try_from(vertices.len()).is_err() {
            return Err(MeshError::TooManyVertices(vertices.len()));
        }
        if let Some(index) = vertices.iter().position(|p| !p.coords.iter().all(|c| c.is_finite())) {
            return Err(MeshError::NotFinite { index });
        }
        for (face, corners) in faces.iter().enumerate() {
            if let Some(&index) = corners.iter().find(|&&i| i as usize >= vertices.len()) {
                return Err(MeshError::IndexOutOfRange { face, index, vertices: vertices.len() });
            }
        }
        faces.retain(|&[a, b, c]| {
            let [a, b, c] = [a, b, c].map(|i| vertices[i as usize]);
            double_area_vector(&[a, b, c]).norm_squared() > 0.0
        });
        if faces.is_empty() {
            return Err(MeshError::Empty);
        }
        Ok(Self { vertices, faces, provenance: None })
    }

    /// The mesh with a provenance for each of its faces.
    pub fn with_provenance(self, provenance: Vec<Provenance>) -> Result<Self, MeshError> {
        if provenance.len() != self.faces.len() {
            return Err(MeshError::Provenance { found: provenance.len(), faces: self.faces.len() });
        }
        Ok(Self { provenance: Some(provenance), ..self })
    }

    /// Where each face comes from; `None` when nobody said, as of a mesh that was no scan.
    #[must_use]
    pub fn provenance(&self) -> Option<&[Provenance]> {
        self.provenance.as_deref()
    }

    /// Whether a face was measured, or nobody said that it was not.
    #[must_use]
    pub fn is_measured(&self, face: usize) -> bool {
        self.provenance.as_ref().is_none_or(|all| all.get(face) == Some(&Provenance::Measured))
    }

    /// Area of the faces of a provenance, m^2; 0 when none is known.
    #[must_use]
    pub fn area_of_m2(&self, provenance: Provenance) -> f64 {
        let of = self.provenance.iter().flatten().enumerate().filter(|(_, found)| **found == provenance);
        of.map(|(f, _)| 0.5 * double_area_vector(&self.corners(f)).norm()).sum()
    }

    /// Vertices, metres.
    #[must_use]
    pub fn vertices(&self) -> &[Point3<f64>] {
        &self.vertices
    }

    /// Corner indices of each triangle, counter-clockwise seen from outside.
    #[must_use]
    pub fn faces(&self) -> &[[u32; 3]] {
        &self.faces
    }

    /// The three corners of a face. Panics when `face` is out of range.
    #[must_use]
    pub fn corners(&self, face: usize) -> [Point3<f64>; 3] {
        self.faces[face].map(|i| self.vertices[i as usize])
    }

    /// Outward unit normal of a face (no face without area survives [`Mesh::new`]).
    #[must_use]
    pub fn face_normal(&self, face: usize) -> Unit<Vector3<f64>> {
        Unit::new_normalize(double_area_vector(&self.corners(face)))
    }

    /// Area of the surface, m^2.
    #[must_use]
    pub fn area_m2(&self) -> f64 {
        (0..self.faces.len()).map(|f| 0.5 * double_area_vector(&self.corners(f)).norm()).sum()
    }

    /// Smallest and largest corner, metres.
    #[must_use]
    pub fn bounding_box(&self) -> (Point3<f64>, Point3<f64>) {
        // A mesh has at least one face, hence vertices.
        bounding_box(&self.vertices).unwrap_or((Point3::origin(), Point3::origin()))
    }

    /// Number of edges that do not belong to exactly two faces running over them in opposite directions.
    #[must_use]
    pub fn open_edges(&self) -> usize {
        let edge = |from: u32, to: u32| ((from.min(to), from.max(to)), from < to);
        let mut uses: Vec<((u32, u32), bool)> =
            self.faces.par_iter().flat_map_iter(|&[a, b, c]| [edge(a, b), edge(b, c), edge(c, a)]).collect();
        uses.par_sort_unstable();
        // Sorted, the use from the higher to the lower vertex comes first.
        let is_joined = |uses: &[((u32, u32), bool)]| matches!(uses, [(_, false), (_, true)]);
        uses.chunk_by(|a, b| a.0 == b.0).filter(|uses| !is_joined(uses)).count()
    }

    /// Whether every edge joins exactly two consistently turned faces.
    #[must_use]
    pub fn is_watertight(&self) -> bool {
        self.open_edges() == 0
    }

    /// Enclosed volume by the divergence theorem, m^3; negative when the mesh is inside out, and without meaning when
    /// it is open.
    #[must_use]
    pub fn signed_volume_m3(&self) -> f64 {
        self.signed_volume_about(&self.bounding_box().0)
    }

    fn signed_volume_about(&self, origin: &Point3<f64>) -> f64 {
        (0..self.faces.len())
            .map(|f| {
                let [a, b, c] = self.corners(f).map(|p| p - origin);
                a.dot(&b.cross(&c)) / 6.0
            })
            .sum()
    }

    /// Centre of mass and volume. A watertight mesh is taken as a solid of constant density; of an open one the centre
    /// of the surface's area is returned, with volume 0.
    #[must_use]
    pub fn bulk(&self) -> Bulk {
        let origin = self.bounding_box().0;
        if self.is_watertight() {
            let (mut volume, mut moment) = (0.0, Vector3::zeros());
            for f in 0..self.faces.len() {
                let [a, b, c] = self.corners(f).map(|p| p - origin);
                let part = a.dot(&b.cross(&c)) / 6.0;
                volume += part;
                moment += (a + b + c) * (part / 4.0);
            }
            if volume.abs() > f64::MIN_POSITIVE {
                return Bulk { center_of_mass: origin + moment / volume, volume_m3: volume.abs() };
            }
        }
        let (mut area, mut moment) = (0.0, Vector3::zeros());
        for f in 0..self.faces.len() {
            let corners = self.corners(f);
            let part = double_area_vector(&corners).norm();
            area += part;
            moment += corners.iter().map(|p| p - origin).sum::<Vector3<f64>>() * (part / 3.0);
        }
        Bulk { center_of_mass: origin + moment / area, volume_m3: 0.0 }
    }

    /// Number of parts that share no vertex index.
    #[must_use]
    pub fn components(&self) -> usize {
        let mut parent: Vec<u32> = (0..self.vertices.len() as u32).collect();
        fn root(parent: &mut [u32], mut i: u32) -> u32 {
            while parent[i as usize] != i {
                parent[i as usize] = parent[parent[i as usize] as usize];
                i = parent[i as usize];
            }
            i
        }
        for &[a, b, c] in &self.faces {
            let a = root(&mut parent, a);
            for other in [b, c] {
                let other = root(&mut parent, other);
                parent[other as usize] = a;
            }
        }
        let mut roots: Vec<u32> = self.faces.iter().map(|f| root(&mut parent, f[0])).collect();
        roots.sort_unstable();
        roots.dedup();
        roots.len()
    }

    /// The same mesh in frame `a`, where `self` is in frame `b`.
    #[must_use]
    pub fn transformed(&self, a_from_b: &Isometry3<f64>) -> Self {
        Self { vertices: self.vertices.iter().map(|p| a_from_b * p).collect(), ..self.clone() }
    }

    /// The mesh with every coordinate multiplied by `factor` (> 0), as for a change of unit.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        Self { vertices: self.vertices.iter().map(|p| p * factor).collect(), ..self.clone() }
    }

    /// The mesh turned inside out.
    #[must_use]
    pub fn flipped(&self) -> Self {
        Self { faces: self.faces.iter().map(|&[a, b, c]| [a, c, b]).collect(), ..self.clone() }
    }
}

/// Twice the area of a triangle times its normal (right-hand rule over the corners).
fn double_area_vector([a, b, c]: &[Point3<f64>; 3]) -> Vector3<f64> {
    (b - a).cross(&(c - a))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tetrahedron() -> Mesh {
        let v = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let f = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
        Mesh::new(v.map(Point3::from).to_vec(), f).unwrap()
    }

    #[test]
    fn corner_tetrahedron_has_its_closed_form_bulk() {
        let mesh = tetrahedron();
        assert!(mesh.is_watertight());
        assert!((mesh.signed_volume_m3() - 1.0 / 6.0).abs() < 1e-15);
        let bulk = mesh.bulk();
        assert!((bulk.center_of_mass - Point3::new(0.25, 0.25, 0.25)).norm() < 1e-15);
        assert!((mesh.area_m2() - (1.5 + 3f64.sqrt() / 2.0)).abs() < 1e-15);
        assert!(mesh.flipped().signed_volume_m3() < 0.0);
        assert_eq!(mesh.components(), 1);
    }

    #[test]
    fn missing_or_turned_faces_open_the_mesh() {
        let whole = tetrahedron();
        let open = Mesh::new(whole.vertices().to_vec(), whole.faces()[1..].to_vec()).unwrap();
        assert_eq!(open.open_edges(), 3);
        let mut faces = whole.faces().to_vec();
        faces[0].swap(0, 1);
        assert_eq!(Mesh::new(whole.vertices().to_vec(), faces).unwrap().open_edges(), 3);
    }

    #[test]
    fn bad_arrays_are_named() {
        let points = vec![Point3::origin(), Point3::new(1.0, 0.0, 0.0), Point3::new(0.0, 1.0, 0.0)];
        let error = Mesh::new(points.clone(), vec![[0, 1, 7]]).unwrap_err();
        assert_eq!(error, MeshError::IndexOutOfRange { face: 0, index: 7, vertices: 3 });
        assert_eq!(Mesh::new(points.clone(), vec![[0, 1, 1]]).unwrap_err(), MeshError::Empty);
        let mut bad = points;
        bad[1].x = f64::NAN;
        assert_eq!(Mesh::new(bad, vec![[0, 1, 2]]).unwrap_err(), MeshError::NotFinite { index: 1 });
    }
}
