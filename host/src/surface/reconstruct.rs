//! The whole way from a cloud to a mesh.

use std::time::Instant;

use nalgebra::{Isometry3, Matrix3, Point3, SymmetricEigen, Unit, Vector3};
use rayon::prelude::*;
use thiserror::Error;

use super::{
    carve::{Carved, Sight},
    close::solid_on_table,
    cloud::{CloudError, PointCloud},
    contour::contour,
    decimate::{Limits, decimate},
    distance::{Field, Lattice, Planes, Support, signed_distance},
    fragments::without_fragments,
    grid::{Grid, Neighbour},
    mesh::{Mesh, MeshError},
    orient::{orient_by_propagation, orient_towards},
    outlier::{inliers, median, quantile},
    provenance::Provenance,
    register::{Registration, register},
    scene::{Pick, SceneObject, objects},
    sharpen::sharp_contour,
    symmetry::{Guess, guess},
    table::{Plane, TableTop, find_table},
    tangent::{Tangent, Tangents, tangents},
    thin::{Thinned, thin},
};

/// Fewest points that make a surface.
pub const FEWEST_POINTS: usize = 30;

/// Edge of a lattice cell per spacing of the points. Larger cells cut corners: a rim of 3 mm loses a millimetre at 1.5.
const CELL_PER_SPACING: f64 = 1.1;

/// Points belong to the table up to this many times how far its points scatter below its plane.
const SCATTERS: f64 = 1.25;

/// Least cosine between a face and the line of sight to the sensor that saw it. A little below none, for noise.
const LEAST_FACING: f64 = -0.1;
/// Edges shorter than this share of a cell are slivers' and collapse, where the surface moves less than the other share.
const SLIVER_EDGE: f64 = 0.15;
const SLIVER_TOLERANCE: f64 = 0.05;

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
    /// Neighbours of a tangent plane.
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

/// A cloud made ready: cropped, its sweeps registered, thinned, without its table, and divided into objects.
pub struct Survey {
    settings: Settings,
    cleaned: Cleaned,
    objects: Vec<SceneObject>,
    clean_s: f64,
}

impl Survey {
    /// Makes a cloud ready. Errors as [`reconstruct`] does before there is a surface.
    pub fn new(cloud: &PointCloud, settings: &Settings) -> Result<Self, ReconstructError> {
        check_settings(settings)?;
        let mut clock = Clock(Instant::now());
        let cleaned = Cleaned::new(cloud, settings)?;
        let objects = if settings.pick == Pick::Whole { Vec::new() } else { cleaned.objects() };
        Ok(Self { settings: settings.clone(), cleaned, objects, clean_s: clock.lap() })
    }

    /// The objects on the table, the largest first. None without a table, or when [`Pick::Whole`] was asked for.
    #[must_use]
    pub fn objects(&self) -> &[SceneObject] {
        &self.objects
    }

    /// The table, given or found.
    #[must_use]
    pub fn table(&self) -> Option<Plane> {
        self.cleaned.table.as_ref().map(|table| table.plane)
    }

    /// Number of the object that a pick means; `None` for the whole, or when there are no objects.
    pub fn picked(&self, pick: &Pick) -> Result<Option<usize>, ReconstructError> {
        let nearest_to = |point: Point3<f64>| {
            let distances = self.objects.iter().map(|object| (object.center - point).norm());
            distances.enumerate().min_by(|a, b| a.1.total_cmp(&b.1)).map(|(number, _)| number)
        };
        Ok(match *pick {
            Pick::Whole => None,
            // A lone object needs no table to be told from others.
            Pick::Number(0) | Pick::Largest if self.objects.is_empty() => None,
            Pick::Number(number) if number < self.objects.len() => Some(number),
            Pick::Number(number) => {
                return Err(ReconstructError::NoSuchObject { number, objects: self.objects.len() });
            }
            Pick::Largest => Some(0),
            Pick::Nearest => nearest_to(self.cleaned.sensor()),
            Pick::At(point) => nearest_to(point),
        })
    }

    /// Reconstructs what the settings pick.
    pub fn pick(&self) -> Result<Reconstruction, ReconstructError> {
        match self.picked(&self.settings.pick)? {
            Some(number) => self.object(number),
            None => self.whole(),
        }
    }

    /// Reconstructs all that stands on the table, or the whole cloud without a table, as one body.
    pub fn whole(&self) -> Result<Reconstruction, ReconstructError> {
        self.surface(&self.cleaned.above)
    }

    /// Reconstructs one of the objects.
    pub fn object(&self, number: usize) -> Result<Reconstruction, ReconstructError> {
        let objects = self.objects.len();
        let object = self.objects.get(number).ok_or(ReconstructError::NoSuchObject { number, objects })?;
        self.surface(&object.members)
    }

    fn surface(&self, members: &[u32]) -> Result<Reconstruction, ReconstructError> {
        let keep = self.cleaned.without_strays(members, &self.settings);
        let object = self.cleaned.thinned.filtered(|i, _| keep[i]);
        enough(self.cleaned.given, object.len(), "removing outliers")?;
        not_on_a_line(&object.points)?;
        // What else stands there tells of empty space, too.
        let keep_all = if members.len() == self.cleaned.above.len() {
            keep
        } else {
            self.cleaned.without_strays(&self.cleaned.above, &self.settings)
        };
        let sights = self.cleaned.sights(&keep_all);
        surface_of(&object, &sights, &self.cleaned, &self.settings, self.clean_s)
    }
}

fn surface_of(
    object: &PointCloud,
    sights: &[Sight],
    cleaned: &Cleaned,
    settings: &Settings,
    clean_s: f64,
) -> Result<Reconstruction, ReconstructError> {
    let mut seconds = StageSeconds { clean_s, ..StageSeconds::default() };
    let mut clock = Clock(Instant::now());
    let table = cleaned.table.as_ref().map(|table| table.plane);

    let grid = Grid::for_surface(&object.points);
    let fourth = fourth_neighbour(&object.points, &grid);
    let spacing = median(fourth.clone());
    let cell_m = settings.cell_m.unwrap_or(CELL_PER_SPACING * spacing);
    let radius = settings.radius_m.unwrap_or(1.5 * spacing);
    let Tangents { planes, shows_edges } = tangents(&object.points, &grid, settings.neighbours, radius);
    let fitted = object.filtered(|i, _| planes[i].is_some());
    let mut planes: Vec<Tangent> = planes.into_iter().flatten().collect();
    enough(cleaned.given, planes.len(), "fitting tangent planes")?;
    seconds.tangents_s = clock.lap();

    let up = table.map_or_else(Vector3::z, |table| table.normal.into_inner());
    match fitted.views.as_ref().or(fitted.normals.as_ref()) {
        Some(outside) => orient_towards(&mut planes, outside),
        None => orient_by_propagation(&mut planes, settings.neighbours, &up),
    }
    seconds.orient_s = clock.lap();

    let support_plane = table.unwrap_or_else(|| assumed_plane(&planes, &fitted.points));
    let plane_from_cloud = support_plane.plane_from_cloud();
    planes.par_iter_mut().for_each(|plane| *plane = plane.transformed(&plane_from_cloud));
    let origins: Vec<Point3<f64>> = planes.iter().map(|plane| plane.origin).collect();
    let lattice = lattice_above_table(&origins, cell_m)?;
    let grid = Grid::new(&origins, 1.5 * spacing.max(0.5 * cell_m));
    let support =
        Support { radius_m: 1.25 * quantile(fourth, 0.9).max(0.7 * cell_m), blend_m: 0.7 * spacing };
    let planes = Planes { tangents: &planes, grid: &grid, support, shows_edges };
    let field = signed_distance(&planes, lattice);
    seconds.distance_s = clock.lap();

    let part = |triangles, solid| -> Result<(Mesh, usize), MeshError> {
        let kept = without_fragments(triangles, settings.smallest_part, solid);
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

struct Clock(Instant);

impl Clock {
    fn lap(&mut self) -> f64 {
        let now = Instant::now();
        let lap = now - std::mem::replace(&mut self.0, now);
        lap.as_secs_f64()
    }
}

fn check_settings(settings: &Settings) -> Result<(), ReconstructError> {
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

fn enough(given: usize, left: usize, stage: &'static str) -> Result<(), ReconstructError> {
    if left < FEWEST_POINTS {
        return Err(ReconstructError::TooFew { given, left, stage });
    }
    Ok(())
}

/// A cloud without what is no object, and with what all its points tell about empty space.
struct Cleaned {
    /// Points given.
    given: usize,
    thinned: PointCloud,
    spacing_m: f64,
    /// The thinned points that stand on the table.
    above: Vec<u32>,
    /// Dense points with their lines of sight, and the thinned point of each.
    scene: PointCloud,
    voxel_of: Vec<u32>,
    table: Option<TableTop>,
    margin_m: f64,
    registration: Registration,
}

impl Cleaned {
    fn new(cloud: &PointCloud, settings: &Settings) -> Result<Self, ReconstructError> {
        let given = cloud.len();
        let mut scene = cloud.clone().checked()?;
        enough(given, scene.len(), "reading")?;
        if let Some((low, high)) = settings.crop {
            scene = scene.filtered(|_, p| (0..3).all(|a| p[a] >= low[a] && p[a] <= high[a]));
            enough(given, scene.len(), "cropping")?;
        }
        not_on_a_line(&scene.points)?;
        let extent = scene.bounding_box().map_or(0.0, |(low, high)| (high - low).max());
        let voxel_m = settings.voxel_m.unwrap_or_else(|| (0.02 * extent).min(0.0005));
        let mut thin_scene = thin(&scene, voxel_m);
        let thinned = &thin_scene.cloud;
        let spacing_m = median(fourth_neighbour(&thinned.points, &Grid::for_surface(&thinned.points)));
        let table = match settings.table {
            Table::None => None,
            Table::Auto => find_table(thinned, spacing_m.max(0.002 * extent), settings.seed),
            Table::Plane(plane) => Some(TableTop::endless(plane)),
        };
        let registration = if settings.register {
            register(&scene, table.as_ref().map(|table| &table.plane))
        } else {
            Registration::OneSweep
        };
        if matches!(registration, Registration::Moved(_)) {
            scene = registration.applied(&scene);
            thin_scene = thin(&scene, voxel_m);
        }
        let Thinned { cloud: thinned, voxel_of } = thin_scene;
        let margin_m = settings.table_margin_m.unwrap_or_else(|| {
            let scatter_m = table.as_ref().map_or(0.0, |table| table.scatter_m);
            spacing_m.max(0.001).max(SCATTERS * scatter_m)
        });
        let carried = |p: &Point3<f64>| table.as_ref().is_none_or(|table| table.carries(p, margin_m));
        let above: Vec<u32> =
            (0..thinned.len() as u32).filter(|&i| carried(&thinned.points[i as usize])).collect();
        enough(given, above.len(), "removing the table")?;
        Ok(Self { given, thinned, spacing_m, above, scene, voxel_of, table, margin_m, registration })
    }

    /// What stands on the table; nothing when there is none.
    fn objects(&self) -> Vec<SceneObject> {
        self.table.as_ref().map_or_else(Vec::new, |table| {
            objects(&self.thinned.points, &self.above, table, self.spacing_m, self.margin_m)
        })
    }

    /// Which of the thinned points belong to no stray.
    fn without_strays(&self, members: &[u32], settings: &Settings) -> Vec<bool> {
        let mut keep = vec![false; self.thinned.len()];
        let points: Vec<Point3<f64>> = members.iter().map(|&i| self.thinned.points[i as usize]).collect();
        let belongs = if settings.outliers { inliers(&points, 6.0) } else { vec![true; points.len()] };
        members.iter().zip(belongs).for_each(|(&i, belongs)| keep[i as usize] = belongs);
        keep
    }

    /// Lines of sight of those points that are no strays, and of the table's.
    ///
    /// The mean of several lines of sight is none, so they come from the dense cloud; a stray point's is no evidence.
    fn sights(&self, keep: &[bool]) -> Vec<Sight> {
        let on_table =
            |p: &Point3<f64>| self.table.as_ref().is_some_and(|t| t.plane.height(p).abs() <= self.margin_m);
        let seen = self.scene.views.iter().flatten().zip(&self.scene.points).zip(&self.voxel_of);
        seen.filter(|((_, point), voxel)| keep[**voxel as usize] || on_table(point))
            .map(|((&towards_sensor, &point), _)| Sight { point, towards_sensor })
            .collect()
    }

    /// The point that the nearest object is near to: the mean of where lines of sight go, or the origin.
    fn sensor(&self) -> Point3<f64> {
        let Some(views) = &self.scene.views else { return Point3::origin() };
        // The point nearest to all lines of sight.
        let (mut form, mut pull) = (Matrix3::zeros(), Vector3::zeros());
        for (point, view) in self.scene.points.iter().zip(views) {
            let across = Matrix3::identity() - view.into_inner() * view.transpose();
            form += across;
            pull += across * point.coords;
        }
        let far = || {
            self.thinned.points.first().copied().unwrap_or_else(Point3::origin) + views[0].into_inner() * 1e3
        };
        form.try_inverse().map_or_else(far, |inverse| Point3::from(inverse * pull))
    }
}

/// Errors when the points vary along one direction at most.
fn not_on_a_line(points: &[Point3<f64>]) -> Result<(), ReconstructError> {
    let count = points.len() as f64;
    let mean = points.iter().map(|p| p.coords / count).sum::<Vector3<f64>>();
    let reach = points.iter().map(|p| (p.coords - mean).amax()).fold(0.0, f64::max);
    // Scaled first: squares of tiny or huge coordinates leave the range of a float.
    let offset = |p: &Point3<f64>| (p.coords - mean) / reach;
    let covariance: Matrix3<f64> =
        points.iter().map(offset).filter(|o| o.amax().is_finite()).map(|o| o * o.transpose() / count).sum();
    let mut variances = SymmetricEigen::new(covariance).eigenvalues;
    variances.as_mut_slice().sort_by(f64::total_cmp);
    if reach <= 0.0 || !reach.is_finite() || variances[1] <= 1e-10 * variances[2] {
        return Err(ReconstructError::Degenerate);
    }
    Ok(())
}

/// Distance from each point to its fourth neighbour: on a square grid of samples, its pitch.
fn fourth_neighbour(points: &[Point3<f64>], grid: &Grid) -> Vec<f64> {
    let distance = |found: &mut Vec<(f64, u32)>, point| {
        grid.nearest(point, 5, found);
        found.last().map_or(0.0, |n| n.0.sqrt())
    };
    points.par_iter().map_init(Vec::new, distance).collect()
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

/// A sheet without the faces that no sensor can have seen: those that look away from the one that saw the nearest sample,
/// and those that lines of sight pass through. Both hang over where the surface folds back under itself. `None` when
/// nothing is left, or nothing tells.
fn without_flaps(
    mesh: &Mesh,
    grid: &Grid,
    views: Option<&[Unit<Vector3<f64>>]>,
    plane_from_cloud: &Isometry3<f64>,
    sights: &[Sight],
    spacing_m: f64,
) -> Option<Mesh> {
    let views = views?;
    let (low, high) = mesh.bounding_box();
    let reach = Vector3::repeat(4.0 * spacing_m);
    let carved = Carved::about(&(low - reach), &(high + reach), spacing_m, sights)?;
    let is_sound = |found: &mut Vec<Neighbour>, face: usize| {
        let [a, b, c] = mesh.corners(face).map(|p| p.coords);
        let (middle, normal) = (Point3::from((a + b + c) / 3.0), mesh.face_normal(face).into_inner());
        grid.nearest(&middle, 1, found);
        let view = found.first().map(|n| plane_from_cloud.rotation * views[n.1 as usize]);
        let beside = |cells: f64| middle + normal * (cells * spacing_m);
        let is_passed = carved.is_empty(&beside(1.5)) && carved.is_empty(&beside(-1.5));
        view.is_none_or(|view| view.dot(&normal) > LEAST_FACING) && !is_passed
    };
    let sound: Vec<bool> = (0..mesh.faces().len()).into_par_iter().map_init(Vec::new, is_sound).collect();
    let faces = mesh.faces().iter().zip(&sound).filter(|(_, sound)| **sound).map(|(face, _)| *face);
    // Vertices that nothing uses any more go with the fragments.
    let kept = without_fragments((mesh.vertices().to_vec(), faces.collect()), 0.0, false);
    Mesh::new(kept.triangles.0, kept.triangles.1).ok()
}

/// Without slivers, and with no more triangles than asked for, as far as the bound on the error allows.
fn fewer_triangles(mesh: Mesh, settings: &Settings, cell_m: f64) -> Mesh {
    let slivers =
        Limits { triangles: 0, tolerance_m: SLIVER_TOLERANCE * cell_m, edges_below_m: SLIVER_EDGE * cell_m };
    let mesh = decimate(&mesh, &slivers);
    if settings.triangles.is_none() && settings.tolerance_m.is_none() {
        return mesh;
    }
    decimate(
        &mesh,
        &Limits {
            triangles: settings.triangles.unwrap_or(0),
            tolerance_m: settings.tolerance_m.unwrap_or(cell_m),
            edges_below_m: f64::INFINITY,
        },
    )
}

/// Where each face comes from. Of the points of `grid` the first `seen` were measured; with a base, faces below that
/// height that look down are the table's.
fn provenances(mesh: &Mesh, grid: &Grid, seen: usize, radius_m: f64, base_m: Option<f64>) -> Vec<Provenance> {
    (0..mesh.faces().len())
        .into_par_iter()
        .map_init(Vec::new, |found, face| {
            let [a, b, c] = mesh.corners(face).map(|p| p.coords);
            let middle = Point3::from((a + b + c) / 3.0);
            if base_m.is_some_and(|base_m| middle.z < base_m) && mesh.face_normal(face).z < -0.7 {
                return Provenance::Table;
            }
            grid.nearest(&middle, 1, found);
            match found.first().filter(|n| n.0 < radius_m * radius_m) {
                Some(n) if (n.1 as usize) < seen => Provenance::Measured,
                Some(_) => Provenance::Mirrored,
                None => Provenance::Extruded,
            }
        })
        .collect()
}

#[cfg(test)]
mod tests;
