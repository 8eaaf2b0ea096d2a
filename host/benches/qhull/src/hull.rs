//! Epsilon from the complete hull of the pyramids' edges, by Qhull.

use host::grasp::{ConeModel, ForceNorm, GraspMap};
use nalgebra::Vector4;
use qhull::Qh;

use crate::grasps::Grasp;

/// What Qhull says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum HullEpsilon {
    /// The origin is inside, at this distance from the nearest facet; 0 when it is outside.
    Distance(f64),
    /// Qhull gave up: a flat hull, or precision problems that it cannot merge away.
    Failed,
}

/// The wrenches of all edges, six coordinates after six, as Qhull takes them.
pub fn edge_wrenches(grasp: &Grasp, edges: u16) -> Vec<f64> {
    let map = GraspMap::new(&grasp.contacts, &grasp.reference, ConeModel::Exact, ForceNorm::Normal);
    let mut wrenches = Vec::new();
    for basis in map.bases() {
        for k in 0..edges {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(k) / f64::from(edges)).sin_cos();
            wrenches.extend((basis.0 * Vector4::new(1.0, cos, sin, 0.0)).iter());
        }
    }
    wrenches
}

/// Builds the hull and looks for its nearest facet. Without arguments Qhull takes its default in six dimensions, `Qx`.
pub fn epsilon(wrenches: &mut [f64], arguments: &[&str]) -> HullEpsilon {
    let Ok(builder) = Qh::builder().capture_stdout(true).capture_stderr(true).qhull_args(arguments) else {
        return HullEpsilon::Failed;
    };
    let Ok(hull) = builder.build(6, wrenches) else { return HullEpsilon::Failed };
    // A facet's offset is minus its signed distance: positive when the origin is outside of it.
    let nearest = hull.facets().map(|facet| -facet.offset()).fold(f64::INFINITY, f64::min);
    HullEpsilon::Distance(nearest.max(0.0))
}
