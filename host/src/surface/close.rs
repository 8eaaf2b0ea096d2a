//! Completion of the unseen: from the distances near the samples to a solid that stands on the table.
//!
//! Every node of the object's box is decided: measured distances stay as they are; a node on some line of sight is
//! empty; any other node below measured surface belongs to the body. What symmetry guesses counts as measured where no line of
//! sight contradicts it. This is free-space carving plus extrusion to the
//! table, here in the field and not on the mesh, so that the result is closed whatever holes the scan left.

use nalgebra::Point3;
use rayon::prelude::*;

use super::{
    carve::{Carved, Sight},
    distance::{Field, STRIDE, pack, unpack},
};

/// Most nodes of the box, 9 bytes each.
const MOST_NODES: usize = 40_000_000;
/// Empty cells about the measured field on each side, so that the body never meets the border.
const PADDING: u64 = 2;
/// Passes of smoothing over what was not measured, which otherwise shows the lattice's steps.
const SMOOTHING: usize = 8;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Knowledge {
    Unseen,
    Empty,
    /// A surface that symmetry tells of.
    Guessed,
    Measured,
}

/// The field of the closed body, on the nodes about its surface. `measured` is in a frame in which the table is z = 0,
/// on a lattice whose table lies halfway between two layers of nodes; `is_guess` says where symmetry stands in for
/// measurement, and `guess` what it tells of empty space. `None` when the box has too many nodes, or when nothing of the
/// field lies above the table.
pub(super) fn solid_on_table(
    measured: &Field,
    sights: &[Sight],
    guess: &[Sight],
    is_guess: &(dyn Fn(&Point3<f64>) -> bool + Sync),
) -> Option<Field> {
    let mut volume = Volume::new(measured, is_guess)?;
    volume.carve(sights, guess);
    volume.extrude();
    volume.fill_pockets();
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
    fn new(measured: &'a Field, is_guess: &(dyn Fn(&Point3<f64>) -> bool + Sync)) -> Option<Self> {
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
        let guessed: Vec<bool> =
            measured.keys.par_iter().map(|&key| is_guess(&lattice.position(key))).collect();
        for ((&key, &value), guessed) in measured.keys.iter().zip(&measured.values).zip(guessed) {
            let node = unpack(key);
            if node[2] > floor {
                let index = volume.index([0, 1, 2].map(|a| (node[a] - low[a]) as usize));
                volume.known[index] = if guessed { Knowledge::Guessed } else { Knowledge::Measured };
                volume.values[index] = value.clamp(-far_m, far_m);
            }
        }
        Some(volume)
    }

    fn index(&self, [i, j, k]: [usize; 3]) -> usize {
        i + self.dims[0] * (j + self.dims[1] * k)
    }

    /// Marks what lines of sight pass as empty. Those of `guess` say nothing against a surface.
    fn carve(&mut self, sights: &[Sight], guess: &[Sight]) {
        let cell_m = self.measured.lattice.cell_m;
        let low = self.measured.lattice.position(pack(self.low));
        let seen = Carved::new(low, cell_m, self.dims, sights);
        for (i, _) in seen.passed().iter().enumerate().filter(|(_, passed)| **passed) {
            // Lines of sight are rounded to nodes: those that pass just over a measured surface mark nodes nearly a cell
            // under it, but none deeper.
            if self.known[i] != Knowledge::Measured || self.values[i] < -cell_m {
                (self.known[i], self.values[i]) = (Knowledge::Empty, self.far_m);
            }
        }
        if guess.is_empty() {
            return;
        }
        let guessed = Carved::new(low, cell_m, self.dims, guess);
        for (i, _) in guessed.passed().iter().enumerate().filter(|(_, passed)| **passed) {
            if self.known[i] == Knowledge::Unseen {
                self.known[i] = Knowledge::Empty;
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
                    Knowledge::Measured | Knowledge::Guessed => inside = self.values[index] < 0.0,
                    Knowledge::Empty => inside = false,
                    Knowledge::Unseen if inside => self.values[index] = -self.far_m,
                    Knowledge::Unseen => {}
                }
            }
        }
    }

    /// What nobody saw, and which is body on all four sides, is body: the floor of a cup in the shadow of its wall.
    fn fill_pockets(&mut self) {
        let (row, layer) = (self.dims[0], self.dims[0] * self.dims[1]);
        let (known, values) = (&self.known, &self.values);
        // Walks along lines of a layer; whether what was met last, other than unseen space, is body.
        let mut ways = vec![0_u8; known.len()];
        let lines = [(1, row, self.dims[1]), (row, 1, self.dims[0])];
        for (bit, (step, between, count)) in lines.into_iter().enumerate() {
            let length = layer / count;
            for (k, line) in (1..self.dims[2]).flat_map(|k| (0..count).map(move |line| (k, line))) {
                let first = k * layer + line * between;
                for backwards in [false, true] {
                    let mut inside = false;
                    for place in 0..length {
                        let place = if backwards { length - 1 - place } else { place };
                        let index = first + place * step;
                        if known[index] != Knowledge::Unseen || values[index] < 0.0 {
                            inside = values[index] < 0.0;
                        } else if inside {
                            ways[index] |= 1 << (2 * bit + usize::from(backwards));
                        }
                    }
                }
            }
        }
        for (value, ways) in self.values.iter_mut().zip(ways) {
            if ways == 0b1111 {
                *value = -self.far_m;
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
        let moving: Vec<usize> = (0..near.len())
            .filter(|&i| near[i] && matches!(self.known[i], Knowledge::Unseen | Knowledge::Empty))
            .collect();
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::distance::Lattice;

    #[test]
    fn unseen_space_is_body_where_body_is_on_all_four_sides() {
        let lattice = Lattice { low: Point3::origin(), cell_m: 1.0 };
        let measured = Field { lattice, keys: vec![], values: vec![] };
        // One layer over the lowest: a ring of body about unseen space, with and without a view into it.
        for is_seen in [false, true] {
            let mut volume = Volume {
                measured: &measured,
                low: [0; 3],
                dims: [7, 7, 2],
                known: vec![Knowledge::Unseen; 98],
                values: vec![1.5; 98],
                far_m: 1.5,
            };
            for (i, j) in (0..49).map(|n| (n % 7, n / 7)) {
                let index = volume.index([i, j, 1]);
                if [i, j].iter().all(|c| (1..6).contains(c)) && [i, j].iter().any(|c| [1, 5].contains(c)) {
                    (volume.known[index], volume.values[index]) = (Knowledge::Measured, -1.0);
                }
            }
            let middle = volume.index([3, 3, 1]);
            if is_seen {
                (volume.known[middle], volume.values[middle]) = (Knowledge::Empty, 1.5);
            }
            volume.fill_pockets();
            let inside = volume.values.iter().filter(|&&value| value < 0.0).count();
            // The ring has 16 nodes. What is seen empty also opens the four rows and columns that end at it.
            assert_eq!(inside, if is_seen { 16 + 4 } else { 16 + 9 });
            assert!(volume.values[volume.index([0, 3, 1])] > 0.0 && (volume.values[middle] > 0.0) == is_seen);
        }
    }
}
