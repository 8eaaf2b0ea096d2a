//! From a scan to a plan on the virtual cell: what `demo` shows once and `experiment` repeats.

use anyhow::Context;
use nalgebra::Isometry3;

use super::execute::Truth;
use super::input::{SPOT_M, TABLE_HEIGHT_M};
use super::plan::Strategy;
use super::planning::{Planned, Planner};
use crate::object::Object;
use crate::plan::arm::Arm;
use crate::plan::scene::Scene;
use crate::plan::search::SearchSettings;
use crate::plan::seen::SeenSurface;
use crate::surface::{
    Mesh, Plane, PointCloud, ReconstructError, Reconstruction, Settings as ReconstructSettings, Table,
    reconstruct,
};

/// How far from the cell's spot an object may have come and still be scanned and grasped again, metres.
const IN_CELL_M: f64 = 0.12;

/// Whether the object is still where the arm can scan and grasp it.
pub(super) fn is_in_cell(truth: &Truth) -> bool {
    let (low, high) = truth.object.mesh.transformed(&truth.base_from_object).bounding_box();
    let middle = nalgebra::center(&low, &high);
    let away_m = (middle.x - SPOT_M[0]).hypot(middle.y - SPOT_M[1]);
    away_m < IN_CELL_M && (low.z - TABLE_HEIGHT_M).abs() < 0.01
}

/// The closed surface of what stands on the cell's table, base frame.
pub(super) fn surface(cloud: &PointCloud, seed: u64) -> Result<Reconstruction, ReconstructError> {
    let settings = ReconstructSettings {
        table: Table::Plane(Plane::horizontal(TABLE_HEIGHT_M)),
        close: true,
        seed,
        ..Default::default()
    };
    reconstruct(cloud, &settings)
}

/// A search on a reconstructed surface, and what it takes for granted about the object.
pub(super) struct Search {
    pub(super) strategy: Strategy,
    pub(super) friction: f64,
    pub(super) mass_kg: f64,
    pub(super) seed: u64,
}

impl Search {
    /// Searches and keeps at most `top` grasps that the arm can also make.
    ///
    /// `mesh` is in the base frame, as scans are, `seen` what of it was measured; `source` names it in the document.
    pub(super) fn run(
        &self,
        mesh: Mesh,
        seen: Option<SeenSurface>,
        source: &str,
        top: usize,
        progress: &dyn Fn(usize),
    ) -> anyhow::Result<(Scene, Planned)> {
        let mut scene = Scene::new(mesh, Isometry3::identity(), Some(TABLE_HEIGHT_M), Some(Arm::rx60()))
            .context("planning on the reconstructed surface")?;
        scene.friction = self.friction;
        scene.seen = seen;
        let settings = SearchSettings {
            attempts: self.strategy.default_attempts(),
            seed: self.seed,
            ..Default::default()
        };
        let object = Object::new(source, scene.mesh.clone(), self.mass_kg, self.friction);
        let planner = Planner {
            scene: &scene,
            object: &object,
            strategy: self.strategy,
            settings: &settings,
            start_rad: None,
        };
        let planned = planner.plan(top, progress);
        Ok((scene, planned))
    }
}
