//! One stripe: what the laser lights, what the cameras see of it, and what they make of it.

use nalgebra::{Isometry3, Point3, Unit, Vector3};
use parry3d_f64::{
    math::Vector,
    query::{Ray, RayCast},
    shape::TriMesh,
};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::instrument::{Camera, Instrument};
use crate::surface::{Mesh, Plane};

/// What there is to see, base frame.
pub(super) struct Scene {
    object: TriMesh,
    table: Option<Plane>,
}

/// Which body a ray met.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Body {
    Object,
    Table,
}

/// Where a ray ends.
pub(super) struct Hit {
    pub(super) distance_m: f64,
    pub(super) normal: Vector3<f64>,
    pub(super) body: Body,
}

/// A measured point, scanner frame, and whose surface it really is on.
pub(super) struct Seen {
    pub(super) point: Point3<f64>,
    pub(super) body: Body,
}

/// Rays that check a line of sight stop short of the surface by this much.
const CLEARANCE_M: f64 = 1e-6;

impl Scene {
    /// `None` when the mesh is not one that rays can be cast at.
    pub(super) fn new(object: &Mesh, table: Option<Plane>) -> Option<Self> {
        let vertices = object.vertices().iter().map(|p| Vector::new(p.x, p.y, p.z)).collect();
        let object = TriMesh::new(vertices, object.faces().to_vec()).ok()?;
        Some(Self { object, table })
    }

    /// First surface along a ray of unit direction.
    pub(super) fn hit(&self, origin: &Point3<f64>, direction: &Vector3<f64>) -> Option<Hit> {
        let ray = Ray::new(
            Vector::new(origin.x, origin.y, origin.z),
            Vector::new(direction.x, direction.y, direction.z),
        );
        let table = self.table.and_then(|table| {
            let distance_m = -table.height(origin) / table.normal.dot(direction);
            (distance_m.is_finite() && distance_m > 0.0).then_some(Hit {
                distance_m,
                normal: table.normal.into_inner(),
                body: Body::Table,
            })
        });
        let reach = table.as_ref().map_or(f64::MAX, |hit| hit.distance_m);
        let object = self.object.cast_local_ray_and_get_normal(&ray, reach, false).map(|hit| Hit {
            distance_m: hit.time_of_impact,
            normal: Vector3::new(hit.normal.x, hit.normal.y, hit.normal.z),
            body: Body::Object,
        });
        object.or(table)
    }

    /// Whether nothing stands between two points.
    pub(super) fn is_clear(&self, from: &Point3<f64>, to: &Point3<f64>) -> bool {
        let way = to - from;
        let distance = way.norm();
        self.hit(from, &(way / distance)).is_none_or(|hit| hit.distance_m > distance - CLEARANCE_M)
    }
}

/// Casts one stripe and measures it. A point needs one camera that sees it; two are averaged.
pub(super) fn stripe(
    scene: &Scene,
    base_from_scanner: &Isometry3<f64>,
    laser_rays: &[Vector3<f64>],
    instrument: &Instrument,
    rng: &mut ChaCha8Rng,
) -> Vec<Seen> {
    let aperture = Point3::from(base_from_scanner.translation.vector);
    let least_cosine = instrument.max_incidence_rad.cos();
    let mut seen = Vec::new();
    for ray in laser_rays {
        let direction = base_from_scanner.rotation * ray;
        let Some(hit) = scene.hit(&aperture, &direction) else {
            continue;
        };
        if -hit.normal.dot(&direction) < least_cosine {
            continue;
        }
        let lit = aperture + direction * hit.distance_m;
        let lit_in_scanner = Point3::from(ray * hit.distance_m);
        let (mut sum, mut cameras) = (Vector3::zeros(), 0);
        for camera in Camera::ALL {
            let Some([u, v]) = instrument.project(camera, &lit_in_scanner) else {
                continue;
            };
            let center = base_from_scanner * instrument.camera_center(camera);
            let to_camera = Unit::new_normalize(center - lit);
            if hit.normal.dot(&to_camera) < least_cosine || !scene.is_clear(&center, &lit) {
                continue;
            }
            let noise: f64 = StandardNormal.sample(rng);
            if let Some(point) = instrument.triangulate(camera, [u, v + noise * instrument.stripe_noise_px]) {
                sum += point.coords;
                cameras += 1;
            }
        }
        if cameras == 0 {
            continue;
        }
        let mut point = Point3::from(sum / f64::from(cameras));
        if instrument.outlier_share > 0.0 && rng.random::<f64>() < instrument.outlier_share {
            let error: f64 = StandardNormal.sample(rng);
            point += ray * (error * instrument.outlier_depth_m);
        }
        seen.push(Seen { point, body: hit.body });
    }
    seen
}
