//! Completion of the unseen: from the distances near the samples to a solid that stands on the table.
//!
//! Every node of the object's box is decided: measured distances stay as they are; a node on some line of sight is
//! empty; any other node below measured surface belongs to the body. This is free-space carving plus extrusion to the
//! table, here in the field and not on the mesh, so that the result is closed whatever holes the scan left.

use std::sync::atomic::{AtomicBool, Ordering};

use nalgebra::{Point3, Unit, Vector3};
use rayon::prelude::*;

use super::distance::{Field, STRIDE, pack, unpack};

/// Most nodes of the box, 9 bytes each.
const MOST_NODES: usize = 40_000_000;
/// Empty cells about the measured field on each side, so that the body never meets the border.
const PADDING: u64 = 2;
/// Passes of smoothing over what was not measured, which otherwise shows the lattice's steps.
const SMOOTHING: usize = 8;

/// A seen point and the direction to the sensor: all between them is empty.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sight {
    pub(super) point: Point3<f64>,
    pub(super) towards_sensor: Unit<Vector3<f64>>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Knowledge {
    Unseen,
    Empty,
    Measured,
}

/// The field of the closed body, on the nodes about its surface. `measured` is in a frame in which the table is z = 0,
/// on a lattice whose table lies halfway between two layers of nodes. `None` when the box has too many nodes, or when
/// nothing of the field lies above the table.
pub(super) fn solid_on_table(measured: &Field, sights: &[Sight]) -> Option<Field> {
    let mut volume = Volume::new(measured)?;
    volume.carve(sights);
    volume.extrude();
    volume.smooth();
    volume.stand_on_table();
    Some(volume.surface_nodes())
}

struct Volume<'a> {
    measured: &'a Field,
    /// Node of the lattice at the box's lower corner; its layer is the one half a cell below the table.
    low: [u64; 3],
    dims: [usize; 3],
    known: Vec<Knowledge>,
    values: Vec<f64>,
    /// Value of nodes that are only known to be inside (negative) or outside.
    far_m: f64,
}

impl<'a> Volume<'a> {
    fn new(measured: &'a Field) -> Option<Self> {
        let lattice = &measured.lattice;
        let floor = (-0.5 - lattice.low.z / lattice.cell_m).round() as u64;
        let nodes = || measured.keys.iter().map(|&key| unpack(key)).filter(|node| node[2] > floor);
        let first = nodes().next()?;
        let (low, high) = nodes().fold((first, first), |(low, high), node| {
            ([0, 1, 2].map(|a| low[a].min(node[a])), [0, 1, 2].map(|a| high[a].max(node[a])))
        });
        let low = [low[0].saturating_sub(PADDING), low[1].saturating_sub(PADDING), floor];
        let dims = [0, 1, 2].map(|a| (high[a] + PADDING - low[a] + 1) as usize);
        let count = dims.iter().try_fold(1_usize, |product, &d| product.checked_mul(d))?;
        if count > MOST_NODES {
            return None;
        }
        let far_m = 1.5 * lattice.cell_m;
        let known = vec![Knowledge::Unseen; count];
        let mut volume = Self { measured, low, dims, known, values: vec![far_m; count], far_m };
        for (&key, &value) in measured.keys.iter().zip(&measured.values) {
            let node = unpack(key);
            if node[2] > floor {
                let index = volume.index([0, 1, 2].map(|a| (node[a] - low[a]) as usize));
                volume.known[index] = Knowledge::Measured;
                volume.values[index] = value.clamp(-far_m, far_m);
            }
        }
        Some(volume)
    }

    fn index(&self, [i, j, k]: [usize; 3]) -> usize {
        i + self.dims[0] * (j + self.dims[1] * k)
    }

    /// Walks from each seen point towards its sensor, and marks what is passed as empty.
    fn carve(&mut self, sights: &[Sight]) {
        let cell = self.measured.lattice.cell_m;
        let low = self.measured.lattice.position(pack(self.low));
        let top = Vector3::from(self.dims.map(|d| (d - 1) as f64));
        // Marks only ever go from false to true, so that the order of threads does not show.
        let passed: Vec<AtomicBool> = self.known.iter().map(|_| AtomicBool::new(false)).collect();
        sights.par_iter().for_each(|sight| {
            let from = (sight.point - low) / cell;
            let step = sight.towards_sensor.into_inner();
            // Part of the line within the box, in cells; near its point noise would let it cut into the body.
            let (mut start, mut end) = (2.0_f64, f64::INFINITY);
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
            for i in 0..=((end - start) / 0.7) as usize {
                let at = from + step * (start + 0.7 * i as f64);
                let node = [0, 1, 2].map(|a| (at[a].round() as usize).min(self.dims[a] - 1));
                passed[self.index(node)].store(true, Ordering::Relaxed);
            }
        });
        for (known, passed) in self.known.iter_mut().zip(passed) {
            if passed.into_inner() && *known == Knowledge::Unseen {
                *known = Knowledge::Empty;
            }
        }
    }

    /// Goes down each column: below measured inside is body, until something measured or seen says otherwise.
    fn extrude(&mut self) {
        let layer = self.dims[0] * self.dims[1];
        for column in 0..layer {
            let mut inside = false;
            for k in (1..self.dims[2]).rev() {
                let index = column + k * layer;
                match self.known[index] {
                    Knowledge::Measured => inside = self.values[index] < 0.0,
                    Knowledge::Empty => inside = false,
                    Knowledge::Unseen if inside => self.values[index] = -self.far_m,
                    Knowledge::Unseen => {}
                }
            }
        }
    }

    /// Diffusion (as Davis et al. 2002) of what was not measured near the surface; seen-empty nodes stay outside.
    fn smooth(&mut self) {
        let strides = [1, self.dims[0], self.dims[0] * self.dims[1]];
        let interior = |index: usize| {
            let node = [index % strides[1], index / strides[1] % self.dims[1], index / strides[2]];
            node[2] > 0 && (0..3).all(|a| node[a] + 1 < self.dims[a] && (a == 2 || node[a] > 0))
        };
        let mut near: Vec<bool> = (0..self.values.len())
            .into_par_iter()
            .map(|index| {
                let inside = self.values[index] < 0.0;
                interior(index)
                    && strides.iter().any(|s| {
                        (self.values[index - s] < 0.0) != inside || (self.values[index + s] < 0.0) != inside
                    })
            })
            .collect();
        near = (0..near.len())
            .into_par_iter()
            .map(|i| interior(i) && (near[i] || strides.iter().any(|s| near[i - s] || near[i + s])))
            .collect();
        let moving: Vec<usize> =
            (0..near.len()).filter(|&i| near[i] && self.known[i] != Knowledge::Measured).collect();
        let nearest_outside = 0.1 * self.measured.lattice.cell_m;
        for _ in 0..SMOOTHING {
            let next: Vec<f64> = moving
                .par_iter()
                .map(|&i| {
                    // The layer below the table mirrors the one above it: the body's walls meet the table upright.
                    let below = if i / strides[2] == 1 { i } else { i - strides[2] };
                    let around = [i - 1, i + 1, i - strides[1], i + strides[1], below, i + strides[2]];
                    let mean = around.iter().map(|&n| self.values[n]).sum::<f64>() / 6.0;
                    if self.known[i] == Knowledge::Empty { mean.max(nearest_outside) } else { mean }
                })
                .collect();
            for (&i, value) in moving.iter().zip(next) {
                self.values[i] = value;
            }
        }
    }

    /// Makes the table's plane the body's base: the field crosses zero halfway between the lowest two layers.
    fn stand_on_table(&mut self) {
        let layer = self.dims[0] * self.dims[1];
        for column in 0..layer {
            self.values[column] = self.values[column + layer].abs().max(f64::MIN_POSITIVE);
        }
    }

    /// Corners of all cells that the surface passes.
    fn surface_nodes(&self) -> Field {
        let strides = [1, self.dims[0], self.dims[0] * self.dims[1]];
        let [ni, nj, nk] = self.dims.map(|d| d - 1);
        let mut nodes: Vec<(u64, f64)> = (0..nk)
            .into_par_iter()
            .flat_map_iter(|k| (0..nj).flat_map(move |j| (0..ni).map(move |i| [i, j, k])))
            .flat_map_iter(|node| {
                let base = self.index(node);
                let corner = move |c: usize| base + (0..3).map(|a| (c >> a & 1) * strides[a]).sum::<usize>();
                let inside = (0..8).filter(|&c| self.values[corner(c)] < 0.0).count();
                let key = pack([0, 1, 2].map(|a| self.low[a] + node[a] as u64));
                let emitted = if inside == 0 || inside == 8 { 0 } else { 8 };
                (0..emitted).map(move |c| {
                    let key = key + (0..3).map(|a| (c as u64 >> a & 1) * STRIDE[a]).sum::<u64>();
                    (key, self.values[corner(c)])
                })
            })
            .collect();
        nodes.par_sort_unstable_by_key(|node| node.0);
        nodes.dedup_by_key(|node| node.0);
        let (keys, values) = nodes.into_iter().unzip();
        Field { lattice: self.measured.lattice, keys, values }
    }
}
