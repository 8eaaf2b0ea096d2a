//! A cloud made ready for surfaces, and what of it each surface is made of.

use nalgebra::{Matrix3, Point3, SymmetricEigen, Vector3};

use super::{
    carve::Sight,
    cloud::PointCloud,
    grid::Grid,
    outlier::{inliers, median},
    reconstruct::{
        Clock, ReconstructError, Reconstruction, Samples, Settings, Table, check_settings, enough,
        fourth_neighbour, surface_of,
    },
    register::{Registration, register},
    scene::{Pick, SceneObject, objects},
    table::{Plane, TableTop, find_table},
    tangent::neighbourhoods,
    thin::{Thinned, thin},
};

/// Points belong to the table up to this many times how far its points scatter below its plane.
const SCATTERS: f64 = 1.25;

/// A cloud made ready: cropped, its sweeps registered, thinned, without its table, and divided into objects.
pub struct Survey {
    settings: Settings,
    cleaned: Cleaned,
    objects: Vec<SceneObject>,
    clean_s: f64,
}

impl Survey {
    /// Makes a cloud ready. Errors as [`reconstruct`](super::reconstruct::reconstruct) does before there is a surface.
    pub fn new(cloud: &PointCloud, settings: &Settings) -> Result<Self, ReconstructError> {
        check_settings(settings)?;
        let mut clock = Clock::start();
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
        let counts =
            self.cleaned.counts.iter().zip(&keep).filter(|(_, keep)| **keep).map(|(count, _)| *count);
        let samples = Samples { cloud: &object, counts: counts.collect() };
        // What else stands there tells of empty space, too.
        let keep_all = if members.len() == self.cleaned.above.len() {
            keep
        } else {
            self.cleaned.without_strays(&self.cleaned.above, &self.settings)
        };
        let sights = self.cleaned.sights(&keep_all);
        surface_of(&samples, &sights, &self.cleaned, &self.settings, self.clean_s)
    }
}

/// A cloud without what is no object, and with what all its points tell about empty space.
pub(super) struct Cleaned {
    /// Points given.
    pub(super) given: usize,
    thinned: PointCloud,
    /// How many points each thinned one is the mean of.
    counts: Vec<f64>,
    spacing_m: f64,
    /// The thinned points that stand on the table.
    above: Vec<u32>,
    /// Dense points with their lines of sight, and the thinned point of each.
    scene: PointCloud,
    voxel_of: Vec<u32>,
    pub(super) table: Option<TableTop>,
    margin_m: f64,
    pub(super) registration: Registration,
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
        let spacing_m = median(fourth_neighbour(&neighbourhoods(
            &thinned.points,
            &Grid::for_surface(&thinned.points),
            5,
        )));
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
        let Thinned { cloud: thinned, voxel_of, counts } = thin_scene;
        let margin_m = settings.table_margin_m.unwrap_or_else(|| {
            let scatter_m = table.as_ref().map_or(0.0, |table| table.scatter_m);
            spacing_m.max(0.001).max(SCATTERS * scatter_m)
        });
        let carried = |p: &Point3<f64>| table.as_ref().is_none_or(|table| table.carries(p, margin_m));
        let above: Vec<u32> =
            (0..thinned.len() as u32).filter(|&i| carried(&thinned.points[i as usize])).collect();
        enough(given, above.len(), "removing the table")?;
        Ok(Self { given, thinned, counts, spacing_m, above, scene, voxel_of, table, margin_m, registration })
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
