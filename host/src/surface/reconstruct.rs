//! The whole way from a cloud to a mesh.

use std::time::Instant;

use nalgebra::{Isometry3, Point3, Unit, Vector3};
use rayon::prelude::*;
use thiserror::Error;

use super::{
    carve::Sight,
    close::solid_on_table,
    cloud::{CloudError, PointCloud},
    contour::contour,
    distance::{Field, Lattice, Planes, Support, signed_distance},
    finish::{fewer_triangles, provenances, without_flaps},
    fragments::without_fragments,
    grid::{Grid, Neighbour},
    holes::without_small_holes,
    mesh::{Mesh, MeshError},
    orient::{orient_by_propagation, orient_towards},
    outlier::{median, quantile},
    register::Registration,
    scene::Pick,
    sharpen::sharp_contour,
    survey::{Cleaned, Survey},
    symmetry::{Guess, guess},
    table::Plane,
    tangent::{Tangent, Tangents, neighbourhoods, tangents},
};

/// Fewest points that make a surface.
pub const FEWEST_POINTS: usize = 30;

/// Edge of a lattice cell per spacing of the points. Larger cells cut corners: a rim of 3 mm loses a millimetre at 1.5.
const CELL_PER_SPACING: f64 = 1.1;

/// Where the table is.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Table {
    /// There is none in the cloud.
    #[default]
    None,
    /// Search for it; there may be none.
    Auto,
    /// It is known, in the cloud's frame, normal towards the objects.
    Plane(Plane),
}

/// What to do with a cloud. Lengths that are `None` follow from the cloud's own density.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Edge of a cell of the contouring lattice; by default 1.1 times the spacing of the thinned cloud.
    pub cell_m: Option<f64>,
    /// Voxel over which points are averaged first; by default 0.5 mm, or less for objects below 25 mm.
    pub voxel_m: Option<f64>,
    /// Points that a tangent plane is fitted to, at least 5.
    pub neighbours: usize,
    /// Least radius of a tangent plane's neighbourhood; by default 1.5 times the spacing.
    pub radius_m: Option<f64>,
    /// Keep only points between these corners, cloud frame, metres.
    pub crop: Option<(Point3<f64>, Point3<f64>)>,
    /// Where the table is.
    pub table: Table,
    /// Points lower than this over the table belong to the table; by default the greatest of 1 mm, the spacing, and
    /// somewhat more than what a table that was found scatters to below its plane.
    pub table_margin_m: Option<f64>,
    /// Complete the unseen to a closed body.
    pub close: bool,
    /// Let what was seen tell by symmetry about what was not, where the scan does not contradict it.
    pub symmetry: bool,
    /// Which of several objects on the table to take; [`reconstruct`] takes all as one body, see [`Survey`].
    pub pick: Pick,
    /// Move the sweeps of the scan onto each other first, where the cloud knows its sweeps.
    pub register: bool,
    /// Remove stray points first.
    pub outliers: bool,
    /// Connected parts with less than this share of the largest one's area are dropped.
    pub smallest_part: f64,
    /// Most triangles of the mesh, as far as `tolerance_m` allows.
    pub triangles: Option<usize>,
    /// How far the surface may move for the sake of fewer triangles; by default, when `triangles` is given, one cell.
    /// Without either, only slivers go.
    pub tolerance_m: Option<f64>,
    /// Seed of the search for the table.
    pub seed: u64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            cell_m: None,
            voxel_m: None,
            neighbours: 12,
            radius_m: None,
            crop: None,
            table: Table::None,
            table_margin_m: None,
            close: false,
            symmetry: true,
            pick: Pick::Whole,
            register: true,
            outliers: true,
            smallest_part: 0.02,
            triangles: None,
            tolerance_m: None,
            seed: 0,
        }
    }
}

/// How the open sheet became a body, or why not.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Closing {
    /// Only what was measured was asked for.
    NotAsked,
    /// The measured surface was closed by itself.
    AlreadyClosed,
    /// What is unseen was extruded to the table.
    OnTable,
    /// There was no table: extruded, away from the sensor, to the deepest measured point.
    OnAssumedPlane,
    /// The completed volume would need too much memory, or had no surface: the mesh is the open sheet.
    Impossible,
}

/// Wall-clock time of the stages, seconds.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StageSeconds {
    /// Cropping, thinning, outliers and the table.
    pub clean_s: f64,
    /// Neighbourhoods and tangent planes.
    pub tangents_s: f64,
    /// Orientation.
    pub orient_s: f64,
    /// Signed distances.
    pub distance_s: f64,
    /// Contouring, with sharp edges, and the report on the mesh.
    pub contour_s: f64,
    /// Completion of the unseen, its contouring included.
    pub close_s: f64,
}

impl StageSeconds {
    /// Sum of the stages.
    #[must_use]
    pub fn total_s(&self) -> f64 {
        self.clean_s + self.tangents_s + self.orient_s + self.distance_s + self.contour_s + self.close_s
    }
}

/// What was done.
#[derive(Debug, Clone, PartialEq)]
pub struct Report {
    /// Points given.
    pub points: usize,
    /// Points left after cropping, thinning and cleaning: one tangent plane each.
    pub used: usize,
    /// Median distance of a used point to its fourth neighbour: the pitch of a square grid of that density.
    pub spacing_m: f64,
    /// Edge of the contouring lattice's cells.
    pub cell_m: f64,
    /// The table, given or found, in the cloud's frame.
    pub table: Option<Plane>,
    /// How the sweeps were moved onto each other.
    pub registration: Registration,
    /// How the mesh was closed.
    pub closing: Closing,
    /// Triangles of the mesh.
    pub triangles: usize,
    /// Whether the mesh is closed.
    pub watertight: bool,
    /// Edges that do not join two faces.
    pub open_edges: usize,
    /// Connected parts of the mesh.
    pub components: usize,
    /// Small parts that were dropped.
    pub dropped_parts: usize,
    /// Time taken.
    pub seconds: StageSeconds,
}

/// A surface and how it came about.
#[derive(Debug, Clone, PartialEq)]
pub struct Reconstruction {
    /// The surface in the cloud's frame. Its [`Mesh::provenance`] says which faces measured points support; the others
    /// are completion, and a guess.
    pub mesh: Mesh,
    /// What was done.
    pub report: Report,
}

/// Why there is no surface.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ReconstructError {
    /// The cloud itself is wrong.
    #[error(transparent)]
    Cloud(#[from] CloudError),
    /// Too few points.
    #[error("{left} of {given} points are left after {stage}; a surface needs at least {FEWEST_POINTS}")]
    TooFew {
        /// Points given.
        given: usize,
        /// Points left.
        left: usize,
        /// After which stage.
        stage: &'static str,
    },
    /// The points lie on a line or on one spot.
    #[error("all points lie on a line")]
    Degenerate,
    /// A setting has no meaning.
    #[error("setting {name} must be a positive number, not {value}")]
    Setting {
        /// Which.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// The cells are too small for the cloud.
    #[error("cells of {cell_m:e} m are too small for a cloud of {extent_m:e} m")]
    CellTooSmall {
        /// Edge of a cell.
        cell_m: f64,
        /// Longest side of the cloud.
        extent_m: f64,
    },
    /// The cells are too large to show the cloud's shape.
    #[error("cells of {cell_m:e} m are too large for a cloud of {extent_m:e} m")]
    CellTooLarge {
        /// Edge of a cell.
        cell_m: f64,
        /// Longest side of the cloud.
        extent_m: f64,
    },
    /// There is no object of that number.
    #[error("there is no object {} among the {objects} on the table", number + 1)]
    NoSuchObject {
        /// Its number, from 0.
        number: usize,
        /// How many there are.
        objects: usize,
    },
    /// Nothing could be contoured.
    #[error("the points support no surface: {0}")]
    NoSurface(#[from] MeshError),
}

/// Reconstructs the surface that a cloud samples, by the method of Hoppe et al. 1992 on a cleaned and thinned cloud.
///
/// Orientation comes from the cloud's lines of sight, else from its normals, else from propagation. The result does
/// not depend on the number of threads.
pub fn reconstruct(cloud: &PointCloud, settings: &Settings) -> Result<Reconstruction, ReconstructError> {
    let survey = Survey::new(cloud, settings)?;
    survey.whole()
}

/// A thinned cloud.
pub(super) struct Samples<'a> {
    pub(super) cloud: &'a PointCloud,
    /// How many points each one is the mean of.
    pub(super) counts: Vec<f64>,
}

/// The surface of one object of a cloud that was made ready in `clean_s` seconds.
pub(super) fn surface_of(
    samples: &Samples<'_>,
    sights: &[Sight],
    cleaned: &Cleaned,
    settings: &Settings,
    clean_s: f64,
) -> Result<Reconstruction, ReconstructError> {
    let object = samples.cloud;
    let mut seconds = StageSeconds { clean_s, ..StageSeconds::default() };
    let mut clock = Clock::start();
    let table = cleaned.table.as_ref().map(|table| table.plane);

    let grid = Grid::for_surface(&object.points);
    // At least what the spacing is measured by.
    let near = neighbourhoods(&object.points, &grid, settings.neighbours.max(5));
    let fourth = fourth_neighbour(&near);
    let spacing = median(fourth.clone());
    let cell_m = settings.cell_m.unwrap_or(CELL_PER_SPACING * spacing);
    let radius = settings.radius_m.unwrap_or(1.5 * spacing);
    let Tangents { planes, shows_edges } = tangents(&object.points, &samples.counts, &grid, &near, radius);
    let fitted = object.filtered(|i, _| planes[i].is_some());
    let mut planes: Vec<Tangent> = planes.into_iter().flatten().collect();
    enough(cleaned.given, planes.len(), "fitting tangent planes")?;
    seconds.tangents_s = clock.lap();

    let up = table.map_or_else(Vector3::z, |table| table.normal.into_inner());
    match fitted.views.as_ref().or(fitted.normals.as_ref()) {
        Some(outside) => orient_towards(&mut planes, outside),
        None if planes.len() == near.len() => orient_by_propagation(&mut planes, &near, &up),
        None => {
            let near =
                neighbourhoods(&fitted.points, &Grid::for_surface(&fitted.points), settings.neighbours);
            orient_by_propagation(&mut planes, &near, &up);
        }
    }
    seconds.orient_s = clock.lap();

    let support_plane = table.unwrap_or_else(|| assumed_plane(&planes, &fitted.points));
    let plane_from_cloud = support_plane.plane_from_cloud();
    planes.par_iter_mut().for_each(|plane| *plane = plane.transformed(&plane_from_cloud));
    let origins: Vec<Point3<f64>> = planes.iter().map(|plane| plane.origin).collect();
    let lattice = lattice_above_table(&origins, cell_m)?;
    let grid = Grid::new(&origins, 1.5 * spacing.max(0.5 * cell_m));
    let support =
        Support { radius_m: 1.25 * quantile(fourth, 0.9).max(0.7 * cell_m), blend_m: 0.9 * spacing };
    let planes = Planes { tangents: &planes, grid: &grid, support, shows_edges };
    let field = signed_distance(&planes, lattice);
    seconds.distance_s = clock.lap();

    let part = |triangles, solid| -> Result<(Mesh, usize), MeshError> {
        let whole = without_small_holes(triangles, 2.0 * support.radius_m);
        let kept = without_fragments(whole, settings.smallest_part, solid);
        Ok((Mesh::new(kept.triangles.0, kept.triangles.1)?, kept.dropped))
    };
    // Sharpening takes as long as the distances: once, on the field that the mesh comes from in the end.
    let plain = if settings.close || !shows_edges { Some(part(contour(&field), false)?) } else { None };
    let is_open = settings.close && plain.as_ref().is_some_and(|(mesh, _)| !mesh.is_watertight());
    seconds.contour_s = clock.lap();

    let seen_planes = planes.tangents.len();
    let all: Vec<Tangent>;
    let mut all_grid = None;
    let mut closed = None;
    if is_open {
        let sights = in_plane(sights, &plane_from_cloud);
        let found =
            if settings.symmetry { guess(planes.tangents, &sights, spacing) } else { Guess::default() };
        all = [planes.tangents, &found.planes].concat();
        let origins: Vec<Point3<f64>> = all.iter().map(|plane| plane.origin).collect();
        let grid = all_grid.insert(Grid::new(&origins, 1.5 * spacing.max(0.5 * cell_m)));
        let planes = Planes { tangents: &all, grid, ..planes };
        let is_guess = |node: &Point3<f64>| {
            let mut near = Vec::new();
            planes.grid.nearest(node, 1, &mut near);
            near.first().is_some_and(|n| n.1 as usize >= seen_planes)
        };
        let drawn = |field: &Field| if shows_edges { sharp_contour(field, &planes) } else { contour(field) };
        let solid = if found.planes.is_empty() {
            solid_on_table(&field, &sights, &found.sights, &|_| false)
        } else {
            let lattice = lattice_above_table(&origins, cell_m)?;
            solid_on_table(&signed_distance(&planes, lattice), &sights, &found.sights, &is_guess)
        };
        closed = solid.and_then(|solid| part(drawn(&solid), true).ok());
    }
    let closing = match (settings.close, is_open, &closed) {
        (false, ..) => Closing::NotAsked,
        (true, false, _) => Closing::AlreadyClosed,
        (true, true, Some(_)) if table.is_some() => Closing::OnTable,
        (true, true, Some(_)) => Closing::OnAssumedPlane,
        (true, true, None) => Closing::Impossible,
    };
    seconds.close_s = clock.lap();
    let (mesh, dropped_parts) = match (closed, plain) {
        (Some(body), _) => body,
        (None, Some(plain)) if !shows_edges => plain,
        (None, _) => part(sharp_contour(&field, &planes), false)?,
    };
    let mesh = if mesh.is_watertight() {
        mesh
    } else {
        let sights = in_plane(sights, &plane_from_cloud);
        without_flaps(&mesh, &grid, fitted.views.as_deref(), &plane_from_cloud, &sights, spacing)
            .unwrap_or(mesh)
    };
    let origins_grid = all_grid.as_ref().unwrap_or(&grid);
    let base = (closing == Closing::OnTable || closing == Closing::OnAssumedPlane).then_some(0.6 * cell_m);
    let provenance = provenances(&mesh, origins_grid, seen_planes, support.radius_m, base);
    let mesh = fewer_triangles(mesh.with_provenance(provenance)?, settings, cell_m);
    let mesh = mesh.transformed(&plane_from_cloud.inverse());
    let open_edges = mesh.open_edges();
    let components = mesh.components();
    seconds.contour_s += clock.lap();
    let report = Report {
        points: cleaned.given,
        used: origins.len(),
        spacing_m: spacing,
        cell_m,
        table,
        registration: cleaned.registration.clone(),
        closing,
        triangles: mesh.faces().len(),
        watertight: open_edges == 0,
        open_edges,
        components,
        dropped_parts,
        seconds,
    };
    Ok(Reconstruction { mesh, report })
}

pub(super) struct Clock(Instant);

impl Clock {
    pub(super) fn start() -> Self {
        Self(Instant::now())
    }

    pub(super) fn lap(&mut self) -> f64 {
        let now = Instant::now();
        let lap = now - std::mem::replace(&mut self.0, now);
        lap.as_secs_f64()
    }
}

pub(super) fn check_settings(settings: &Settings) -> Result<(), ReconstructError> {
    let positive = [
        ("cell_m", settings.cell_m),
        ("voxel_m", settings.voxel_m),
        ("radius_m", settings.radius_m),
        ("table_margin_m", settings.table_margin_m),
        ("tolerance_m", settings.tolerance_m),
        ("neighbours", Some(settings.neighbours.saturating_sub(2) as f64)),
    ];
    for (name, value) in positive {
        if let Some(value) = value
            && !(value.is_finite() && value > 0.0)
        {
            return Err(ReconstructError::Setting { name, value });
        }
    }
    Ok(())
}

pub(super) fn enough(given: usize, left: usize, stage: &'static str) -> Result<(), ReconstructError> {
    if left < FEWEST_POINTS {
        return Err(ReconstructError::TooFew { given, left, stage });
    }
    Ok(())
}

/// Distance from each point to its fourth neighbour: on a square grid of samples, its pitch.
pub(super) fn fourth_neighbour(near: &[Vec<Neighbour>]) -> Vec<f64> {
    near.iter().map(|near| near.get(4).or(near.last()).map_or(0.0, |n| n.0.sqrt())).collect()
}

/// Without a table: a plane across the mean outward direction, through the point that lies deepest behind it.
fn assumed_plane(planes: &[Tangent], points: &[Point3<f64>]) -> Plane {
    let sum: Vector3<f64> = planes.iter().map(|plane| plane.normal.into_inner()).sum();
    // The normals of a closed surface cancel; then any plane below serves.
    let normal = Unit::try_new(sum, 0.05 * planes.len() as f64).unwrap_or_else(Vector3::z_axis);
    let depths = points.iter().map(|point| normal.dot(&point.coords));
    Plane { normal, offset_m: depths.fold(f64::INFINITY, f64::min) }
}

/// A lattice about the points whose layers lie half a cell off the plane z = 0.
fn lattice_above_table(points: &[Point3<f64>], cell_m: f64) -> Result<Lattice, ReconstructError> {
    const MARGIN: f64 = 8.0;
    let (low, high) = super::cloud::bounding_box(points).unwrap_or((Point3::origin(), Point3::origin()));
    let bottom = low.z.min(0.0);
    let extent_m = (high.x - low.x).max(high.y - low.y).max(high.z - bottom);
    if extent_m / cell_m + 2.0 * MARGIN > Lattice::LONGEST {
        return Err(ReconstructError::CellTooSmall { cell_m, extent_m });
    }
    // A shape takes some cells across; a sheet may be thinner than one, so the longest side counts.
    if cell_m > extent_m / 3.0 {
        return Err(ReconstructError::CellTooLarge { cell_m, extent_m });
    }
    let layers = (-bottom / cell_m).ceil() + MARGIN;
    let low = Point3::new(low.x - MARGIN * cell_m, low.y - MARGIN * cell_m, -(layers + 0.5) * cell_m);
    Ok(Lattice { low, cell_m })
}

fn in_plane(sights: &[Sight], plane_from_cloud: &Isometry3<f64>) -> Vec<Sight> {
    let placed = |sight: &Sight| Sight {
        point: plane_from_cloud * sight.point,
        towards_sensor: plane_from_cloud.rotation * sight.towards_sensor,
    };
    sights.iter().map(placed).collect()
}

#[cfg(test)]
mod tests;
