//! From what a reader found to a [`Mesh`] or [`PointCloud`]: the checks and repairs that all formats share.

use std::collections::HashMap;

use nalgebra::{Point3, Unit as Normalized, Vector3};

use super::error::{Fault, Place, Problem};
use super::format::Unit;
use super::{Loaded, polygon, repair};
use crate::surface::{Mesh, PointCloud, Provenance};

const PROVENANCE_IGNORED: &str = "the provenance of the faces was ignored";

/// A mesh wider than this is probably in millimetres.
const LARGEST_MESH_M: f64 = 2.0;
/// A cloud may show a whole room.
const LARGEST_CLOUD_M: f64 = 20.0;
/// Anything smaller was probably in metres and has been taken for millimetres.
const SMALLEST_M: f64 = 1e-3;

/// What a reader found, in the unit of the file.
#[derive(Debug)]
pub(super) enum Raw {
    Mesh(RawMesh),
    Cloud(RawCloud),
}

/// Vertices and polygons as they stand in a file.
#[derive(Debug)]
pub(super) struct RawMesh {
    pub(super) vertices: Vec<Point3<f64>>,
    corners: Vec<u32>,
    /// Per polygon the end of its corners, and its line or number in the file.
    polygons: Vec<(u32, u32)>,
    place_of_polygon: fn(usize) -> Place,
    /// A number for the provenance of each polygon, or nothing.
    pub(super) provenance: Vec<f64>,
    pub(super) warnings: Vec<String>,
}

impl RawMesh {
    /// A mesh whose polygons are named in errors by their number.
    pub(super) fn by_face() -> Self {
        Self::new(|face| Place::Element("face", face))
    }

    /// A mesh whose polygons are named in errors by their line.
    pub(super) fn by_line() -> Self {
        Self::new(Place::Line)
    }

    fn new(place_of_polygon: fn(usize) -> Place) -> Self {
        Self {
            vertices: Vec::new(),
            corners: Vec::new(),
            polygons: Vec::new(),
            place_of_polygon,
            provenance: Vec::new(),
            warnings: Vec::new(),
        }
    }

    pub(super) fn has_polygons(&self) -> bool {
        !self.polygons.is_empty()
    }

    /// Adds a polygon that stands at line or number `place`. Whether its corners exist is checked at the end, because
    /// some formats name vertices before they define them.
    pub(super) fn push(
        &mut self,
        corners: impl IntoIterator<Item = Result<i64, Problem>>,
        place: usize,
    ) -> Result<(), Problem> {
        let start = self.corners.len();
        for corner in corners {
            let index = corner?;
            let vertices = self.vertices.len();
            self.corners
                .push(u32::try_from(index).map_err(|_| Problem::IndexOutOfRange { index, vertices })?);
        }
        if self.corners.len() < start + 3 {
            return Err(Problem::TooFewCorners(self.corners.len() - start));
        }
        let end = u32::try_from(self.corners.len()).map_err(|_| Problem::Expands(u32::MAX as usize))?;
        // Lines and faces beyond 2^32 do not fit in a file of the largest size.
        self.polygons.push((end, u32::try_from(place).unwrap_or(u32::MAX)));
        Ok(())
    }

    fn triangles(&self) -> Result<Vec<[u32; 3]>, Fault> {
        let mut triangles = Vec::with_capacity(self.polygons.len());
        let mut start = 0;
        for &(end, place) in &self.polygons {
            let corners = &self.corners[start..end as usize];
            start = end as usize;
            let vertices = self.vertices.len();
            let out_of_range = corners.iter().find(|&&index| index as usize >= vertices);
            match out_of_range {
                Some(&index) => Err(Problem::IndexOutOfRange { index: index.into(), vertices }),
                None => polygon::triangulate(corners, &self.vertices, &mut triangles),
            }
            .map_err(|problem| problem.at((self.place_of_polygon)(place as usize)))?;
        }
        Ok(triangles)
    }

    /// The mesh in metres, without faces that have no area and without vertices that belong to no face.
    ///
    /// Vertices at exactly the same place are joined where that closes edges. Faces that are there twice are dropped, those
    /// that are turned against their neighbours are turned, and so is a closed surface that is inside out.
    pub(super) fn finish(mut self, unit: Unit) -> Result<Loaded<Mesh>, Fault> {
        for (index, vertex) in self.vertices.iter_mut().enumerate() {
            if let Some(&value) = vertex.coords.iter().find(|c| !c.is_finite()) {
                return Err(Problem::NotFinite(value).at(Place::Element("vertex", index)));
            }
            // Adding zero makes -0 into 0, which is the same place.
            *vertex = vertex.map(|c| unit.to_metres(c) + 0.0);
        }
        if self.polygons.is_empty() {
            return Err(Problem::NoFaces.at(Place::File));
        }
        let mut triangles = self.triangles()?;
        let mut warnings = self.warnings;
        let vertices = used_only(self.vertices, &mut triangles, &mut warnings);
        let found = triangles.len();
        let whole_file = |problem: crate::surface::MeshError| Problem::from(problem).at(Place::File);
        let mut mesh = Mesh::new(vertices, triangles).map_err(whole_file)?;
        let dropped = found - mesh.faces().len();
        if dropped > 0 {
            warnings.push(format!("{dropped} faces without area were dropped"));
        }
        if !self.provenance.is_empty() {
            match provenances(&self.provenance).map(|all| mesh.clone().with_provenance(all)) {
                Some(Ok(marked)) => mesh = marked,
                // Faces were split or dropped, so that the numbers are those of others.
                _ => warnings.push(PROVENANCE_IGNORED.to_owned()),
            }
        }
        mesh = closed_as_far_as_joining_helps(mesh);
        if !mesh.is_watertight() {
            let is_marked = mesh.provenance().is_some();
            mesh = repair::repaired(mesh, &mut warnings);
            if is_marked && mesh.provenance().is_none() {
                warnings.push(PROVENANCE_IGNORED.to_owned());
            }
        }
        if mesh.is_watertight() && mesh.signed_volume_m3() < 0.0 {
            mesh = mesh.flipped();
            warnings.push("the closed surface was inside out: its faces were turned".to_owned());
        }
        let (low, high) = mesh.bounding_box();
        warnings.extend(size_warning((high - low).amax(), LARGEST_MESH_M, unit));
        Ok(Loaded { value: mesh, warnings })
    }
}

/// What the numbers mean; `None` when one of them means nothing.
fn provenances(numbers: &[f64]) -> Option<Vec<Provenance>> {
    let whole = |number: f64| (0..=3_u8).find(|&whole| f64::from(whole) == number);
    numbers.iter().map(|&number| whole(number).and_then(Provenance::from_number)).collect()
}

fn used_only(
    vertices: Vec<Point3<f64>>,
    triangles: &mut [[u32; 3]],
    warnings: &mut Vec<String>,
) -> Vec<Point3<f64>> {
    let mut used = vec![false; vertices.len()];
    triangles.iter().flatten().for_each(|&index| used[index as usize] = true);
    let unused = used.iter().filter(|&&used| !used).count();
    if unused == 0 {
        return vertices;
    }
    warnings.push(format!("{unused} vertices that belong to no face were dropped"));
    let mut next = 0;
    let renumbered: Vec<u32> = used
        .iter()
        .map(|&used| {
            let index = next;
            next += u32::from(used);
            index
        })
        .collect();
    triangles.iter_mut().flatten().for_each(|index| *index = renumbered[*index as usize]);
    vertices.into_iter().zip(used).filter(|(_, used)| *used).map(|(vertex, _)| vertex).collect()
}

/// Joins vertices at the same place when that leaves fewer open edges: STL has nothing but loose triangles, and other
/// exporters split vertices where colour or normals jump.
fn closed_as_far_as_joining_helps(mesh: Mesh) -> Mesh {
    let open = mesh.open_edges();
    if open == 0 {
        return mesh;
    }
    let (vertices, joined) = welded(&mesh);
    let unfolded = without_folds(&joined);
    [joined, unfolded]
        .into_iter()
        .filter_map(|faces| Mesh::new(vertices.clone(), faces).ok())
        .map(|candidate| (candidate.open_edges(), candidate))
        .filter(|(left, _)| *left < open)
        .min_by_key(|(left, _)| *left)
        .map_or(mesh, |(_, candidate)| candidate)
}

/// Vertices of equal bits joined, in order of first use, and the faces over them.
fn welded(mesh: &Mesh) -> (Vec<Point3<f64>>, Vec<[u32; 3]>) {
    let mut index_of_place: HashMap<[u64; 3], u32> = HashMap::with_capacity(mesh.vertices().len());
    let mut vertices = Vec::new();
    let joined: Vec<u32> = mesh
        .vertices()
        .iter()
        .map(|vertex| {
            let place = [vertex.x, vertex.y, vertex.z].map(f64::to_bits);
            *index_of_place.entry(place).or_insert_with(|| {
                vertices.push(*vertex);
                vertices.len() as u32 - 1
            })
        })
        .collect();
    (vertices, mesh.faces().iter().map(|face| face.map(|index| joined[index as usize])).collect())
}

/// The faces without pairs on the same corners that are turned against each other. Decimation leaves such folds: they
/// enclose nothing, and their edges have four faces where a surface has two.
fn without_folds(faces: &[[u32; 3]]) -> Vec<[u32; 3]> {
    let mut kept = vec![true; faces.len()];
    let mut waiting: HashMap<[u32; 3], Vec<usize>> = HashMap::with_capacity(faces.len());
    for (index, &face) in faces.iter().enumerate() {
        let [a, b, c] = repair::from_least(face);
        match waiting.get_mut(&[a, c, b]).and_then(Vec::pop) {
            Some(opposite) => (kept[index], kept[opposite]) = (false, false),
            None => waiting.entry([a, b, c]).or_default().push(index),
        }
    }
    faces.iter().zip(kept).filter(|(_, kept)| *kept).map(|(face, _)| *face).collect()
}

/// Points as they stand in a file; positions may be NaN.
#[derive(Debug, Default)]
pub(super) struct RawCloud {
    pub(super) points: Vec<Point3<f64>>,
    pub(super) normals: Option<Vec<Vector3<f64>>>,
    pub(super) views: Option<Vec<Vector3<f64>>>,
    /// Numbers of the sweeps.
    pub(super) sweeps: Option<Vec<f64>>,
    /// Where all points were seen from, in the unit of the file. `views` goes before it.
    pub(super) viewpoint: Option<Point3<f64>>,
}

impl RawCloud {
    /// An empty cloud that has these attributes.
    pub(super) fn with(normals: bool, views: bool, sweeps: bool) -> Self {
        Self {
            normals: normals.then(Vec::new),
            views: views.then(Vec::new),
            sweeps: sweeps.then(Vec::new),
            ..Self::default()
        }
    }

    /// Adds a point; `values` are x y z, normal, view, sweep, of which only those that the cloud has are looked at.
    pub(super) fn push(&mut self, values: &[f64; 10]) {
        self.points.push(Point3::new(values[0], values[1], values[2]));
        if let Some(normals) = &mut self.normals {
            normals.push(Vector3::new(values[3], values[4], values[5]));
        }
        if let Some(views) = &mut self.views {
            views.push(Vector3::new(values[6], values[7], values[8]));
        }
        if let Some(sweeps) = &mut self.sweeps {
            sweeps.push(values[9]);
        }
    }

    /// The cloud in metres, without points that are no numbers (the holes of an organised cloud).
    pub(super) fn finish(mut self, unit: Unit) -> Result<Loaded<PointCloud>, Fault> {
        let mut warnings = Vec::new();
        let finite: Vec<bool> =
            self.points.iter().map(|point| point.coords.iter().all(|c| c.is_finite())).collect();
        self.keep(&finite, &mut warnings, "points that are not finite numbers were dropped");
        if let (None, Some(viewpoint)) = (&self.views, self.viewpoint) {
            let elsewhere: Vec<bool> = self.points.iter().map(|point| *point != viewpoint).collect();
            self.keep(&elsewhere, &mut warnings, "points at the viewpoint itself were dropped");
            self.views = Some(self.points.iter().map(|point| viewpoint - point).collect());
        }
        if self.points.is_empty() {
            return Err(Problem::NoPoints.at(Place::File));
        }
        let cloud = PointCloud {
            points: self.points.into_iter().map(|point| point.map(|c| unit.to_metres(c) + 0.0)).collect(),
            normals: directions(self.normals, "normals", &mut warnings),
            views: directions(self.views, "lines of sight", &mut warnings),
            sweeps: sweep_numbers(self.sweeps, &mut warnings),
        };
        let cloud = cloud.checked().map_err(|problem| Problem::from(problem).at(Place::File))?;
        if let Some((low, high)) = cloud.bounding_box() {
            warnings.extend(size_warning((high - low).amax(), LARGEST_CLOUD_M, unit));
        }
        Ok(Loaded { value: cloud, warnings })
    }

    fn keep(&mut self, kept: &[bool], warnings: &mut Vec<String>, message: &str) {
        let dropped = kept.iter().filter(|&&kept| !kept).count();
        if dropped == 0 {
            return;
        }
        warnings.push(format!("{dropped} of {} {message}", kept.len()));
        retain(&mut self.points, kept);
        self.normals.iter_mut().for_each(|normals| retain(normals, kept));
        self.views.iter_mut().for_each(|views| retain(views, kept));
        self.sweeps.iter_mut().for_each(|sweeps| retain(sweeps, kept));
    }
}

fn retain<T>(items: &mut Vec<T>, kept: &[bool]) {
    let mut kept = kept.iter();
    items.retain(|_| kept.next().is_some_and(|&kept| kept));
}

/// Unit vectors; none at all when one of them has no direction, because an attribute is there for all points or none.
fn directions(
    vectors: Option<Vec<Vector3<f64>>>,
    what: &str,
    warnings: &mut Vec<String>,
) -> Option<Vec<Normalized<Vector3<f64>>>> {
    let vectors = vectors?;
    let total = vectors.len();
    let units: Vec<_> = vectors
        .into_iter()
        .filter_map(|vector| Normalized::try_new(vector, f64::MIN_POSITIVE))
        .filter(|unit| unit.iter().all(|c| c.is_finite()))
        .collect();
    if units.len() < total {
        warnings.push(format!("{what} ignored: {} of {total} have no direction", total - units.len()));
        return None;
    }
    Some(units)
}

/// Numbers of sweeps; none at all when one of them is no small whole number.
fn sweep_numbers(numbers: Option<Vec<f64>>, warnings: &mut Vec<String>) -> Option<Vec<u16>> {
    let numbers = numbers?;
    let whole = |&number: &f64| number.fract() == 0.0 && (0.0..=f64::from(u16::MAX)).contains(&number);
    if !numbers.iter().all(whole) {
        warnings.push(format!("sweeps ignored: not all are whole numbers from 0 to {}", u16::MAX));
        return None;
    }
    Some(numbers.into_iter().map(|number| number as u16).collect())
}

fn size_warning(size_m: f64, largest_m: f64, unit: Unit) -> Option<String> {
    let question = match unit {
        Unit::Metre if size_m > largest_m => "is it in millimetres? try --unit mm",
        Unit::Millimetre if size_m < SMALLEST_M => "is it in metres? try --unit m",
        _ if size_m > largest_m => "that is too large for a hand",
        _ if size_m < SMALLEST_M => "that is too small for a hand",
        _ => return None,
    };
    let shown =
        if size_m < SMALLEST_M { format!("{:.3} mm", size_m * 1e3) } else { format!("{size_m:.1} m") };
    Some(format!("is {shown} across: {question}"))
}
