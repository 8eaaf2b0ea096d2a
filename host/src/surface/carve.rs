//! Space that lines of sight have passed: nothing is there.

use std::sync::atomic::{AtomicBool, Ordering};

use nalgebra::{Point3, Unit, Vector3};
use rayon::prelude::*;

/// A seen point and the direction to the sensor: all between them is empty.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sight {
    pub(super) point: Point3<f64>,
    pub(super) towards_sensor: Unit<Vector3<f64>>,
}

/// Distance from a seen point, in cells, from which its line of sight counts: nearer, noise would cut into the body.
const CLEARANCE: f64 = 2.0;
/// Distance between the places on a line of sight that are marked, in cells.
const STEP: f64 = 0.7;

/// Steps of a direction's components that are told apart: a degree or two.
const WAYS: f64 = 40.0;

/// Most nodes of a box whose cells may grow, more or less, and most cells along one side of it.
const MOST_NODES: f64 = 6e6;
const LONGEST: f64 = 1e5;

/// Nodes of a box, and which of them some line of sight passes.
pub(super) struct Carved {
    low: Point3<f64>,
    cell_m: f64,
    dims: [usize; 3],
    passed: Vec<bool>,
}

impl Carved {
    /// Walks from each seen point towards its sensor. Node (i, j, k) is at `low + cell_m * (i, j, k)`.
    pub(super) fn new(low: Point3<f64>, cell_m: f64, dims: [usize; 3], sights: &[Sight]) -> Self {
        let top = Vector3::from(dims.map(|d| (d - 1) as f64));
        // Marks only ever go from false to true, so that the order of threads does not show.
        let passed: Vec<AtomicBool> = (0..dims.iter().product()).map(|_| AtomicBool::new(false)).collect();
        thinned(&low, cell_m, sights).into_par_iter().for_each(|sight| {
            let from = (sight.point - low) / cell_m;
            let step = sight.towards_sensor.into_inner();
            // Part of the line within the box, in cells.
            let (mut start, mut end) = (CLEARANCE, f64::INFINITY);
            for axis in 0..3 {
                let (a, b) = (-from[axis] / step[axis], (top[axis] - from[axis]) / step[axis]);
                if a.is_nan() || b.is_nan() {
                    continue;
                }
                start = start.max(a.min(b));
                end = end.min(a.max(b));
            }
            if end.is_infinite() || end < start {
                return;
            }
            for i in 0..=((end - start) / STEP) as usize {
                let at = from + step * (start + STEP * i as f64);
                let node = [0, 1, 2].map(|a| (at[a].round() as usize).min(dims[a] - 1));
                let index = node[0] + dims[0] * (node[1] + dims[1] * node[2]);
                passed[index].store(true, Ordering::Relaxed);
            }
        });
        let passed = passed.into_iter().map(AtomicBool::into_inner).collect();
        Self { low, cell_m, dims, passed }
    }

    /// The same for a box from `low` to `high`, with cells of at least `cell_m`, more for a large box; `None` for a box
    /// that is no box.
    pub(super) fn about(
        low: &Point3<f64>,
        high: &Point3<f64>,
        cell_m: f64,
        sights: &[Sight],
    ) -> Option<Self> {
        let size = high - low;
        let cell_m = cell_m.max((size.product() / MOST_NODES).cbrt()).max(size.amax() / LONGEST);
        if !(cell_m.is_finite() && cell_m > 0.0 && size.min() >= 0.0) {
            return None;
        }
        let dims: [usize; 3] = size.map(|side| (side / cell_m).ceil() as usize + 1).into();
        let nodes = dims.iter().map(|&d| d as f64).product::<f64>();
        (nodes < 4.0 * MOST_NODES).then(|| Self::new(*low, cell_m, dims, sights))
    }

    /// Whether a line of sight passes each node, x running fastest.
    pub(super) fn passed(&self) -> &[bool] {
        &self.passed
    }

    /// Whether the node nearest to a point was passed; nothing is known outside the box.
    pub(super) fn is_empty(&self, point: &Point3<f64>) -> bool {
        let at = ((point - self.low) / self.cell_m).map(f64::round);
        let inside = (0..3).all(|a| at[a] >= 0.0 && at[a] < self.dims[a] as f64);
        inside && {
            let [i, j, k]: [usize; 3] = at.map(|c| c as usize).into();
            self.passed[i + self.dims[0] * (j + self.dims[1] * k)]
        }
    }
}

/// One of all lines of sight that begin in the same half of a cell's edge and go the same way: a dense scan has hundreds
/// that pass the same nodes.
fn thinned<'a>(low: &Point3<f64>, cell_m: f64, sights: &'a [Sight]) -> Vec<&'a Sight> {
    // What lies far outside shares the outermost places: 16 bits for each coordinate, 7 for two of the direction, 1 for the
    // sign of the third.
    let key = |sight: &Sight| -> u64 {
        let place =
            ((sight.point - low) * (2.0 / cell_m)).map(|c| (c + 16_384.0).clamp(0.0, 65_535.0) as u64);
        let way = sight.towards_sensor.map(|c| ((c + 1.0) * WAYS).round() as u64);
        let below = u64::from(sight.towards_sensor.z < 0.0);
        place.x << 48 | place.y << 32 | place.z << 16 | way.x << 8 | way.y << 1 | below
    };
    let mut order: Vec<(u64, u32)> =
        sights.par_iter().zip(0..u32::MAX).map(|(sight, i)| (key(sight), i)).collect();
    order.par_sort_unstable();
    order.dedup_by_key(|(key, _)| *key);
    order.into_iter().map(|(_, i)| &sights[i as usize]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_of_sight_empties_what_it_passes_and_no_more() {
        let sight = Sight { point: Point3::new(0.0, 0.0, 0.0), towards_sensor: Vector3::z_axis() };
        let carved = Carved::new(Point3::new(-2.0, -2.0, -2.0), 1.0, [5, 5, 12], &[sight]);
        for z in 2..=9 {
            assert!(carved.is_empty(&Point3::new(0.2, -0.3, f64::from(z))), "{z}");
        }
        assert!(
            !carved.is_empty(&Point3::new(0.0, 0.0, 1.0)) && !carved.is_empty(&Point3::new(1.0, 0.0, 5.0))
        );
        assert!(!carved.is_empty(&Point3::new(0.0, 0.0, 40.0)));
        assert_eq!(carved.passed().iter().filter(|&&passed| passed).count(), 8);
    }
}
