//! Distance to the surface, sampled in cells: a proven bound for the price of a look-up.
//!
//! Two levels of cells over the object and what a finger reaches around it. A cell knows the distance at its middle, so
//! that anywhere in it the distance is known to the way from there (distances change no faster than places). Cells
//! are measured when they are first asked for: a search asks for few of them, and nothing is built before it starts. What
//! a cell holds depends on the surface alone, so it is the same whichever thread comes first.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};

use parry3d_f64::math::Vector;

/// Room around the object, metres: what a finger opens by, and more.
const MARGIN_M: f64 = 0.06;

/// Most small cells: 8 bytes each, and 32 for the large cell about 64 of them. 34 MB with all of them measured.
const MAX_CELLS: f64 = 4.0e6;

/// Small cells along the side of a large one.
const SPLIT: usize = 4;

/// A large cell answers where its bound is at least this many of its half diagonals: it then lacks a third at most.
const COARSE_ENOUGH: f64 = 4.0;

/// What a cell knows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Sample {
    /// Lower bound of the signed distance at its middle, rounded down to single precision, metres.
    pub(super) value_m: f32,
    /// A triangle that is nearest to its middle.
    pub(super) triangle: u32,
}

impl Sample {
    /// In one word, of which 0 is none.
    fn pack(self) -> u64 {
        (u64::from(self.triangle) + 1) << 32 | u64::from(self.value_m.to_bits())
    }

    fn unpack(word: u64) -> Option<Self> {
        let triangle = (word >> 32).checked_sub(1)?;
        Some(Self { value_m: f32::from_bits(word as u32), triangle: triangle as u32 })
    }
}

/// A cell to be measured.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cell {
    /// Its middle.
    pub(super) center: Vector,
    /// Half its diagonal, metres.
    pub(super) half_diagonal_m: f64,
}

/// A sample and the way from where it was taken to the asked point.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reading {
    pub(super) sample: Sample,
    pub(super) away_m: f64,
}

impl Reading {
    /// Lower bound of the signed distance at the asked point, metres.
    pub(super) fn bound_m(&self) -> f64 {
        f64::from(self.sample.value_m) - self.away_m
    }
}

#[derive(Default)]
struct Block {
    whole: AtomicU64,
    parts: OnceLock<Box<[AtomicU64; SPLIT * SPLIT * SPLIT]>>,
}

/// The cells.
pub(super) struct Field {
    low: Vector,
    cell_m: f64,
    counts: [usize; 3],
    blocks: Vec<Block>,
}

impl Field {
    /// Over a box and the margin around it, nothing measured yet.
    pub(super) fn new([low, high]: [Vector; 2]) -> Self {
        let (low, high) = (low - MARGIN_M, high + MARGIN_M);
        let size = high - low;
        // A tenth less, for the cells that stand out at the far sides.
        let split = SPLIT as f64;
        let mut cell_m = (size.x * size.y * size.z / (0.9 * MAX_CELLS)).cbrt();
        // Far longer than wide, what stands out counts: the largest side alone must not take all.
        cell_m = cell_m.max(size.max_element() / (MAX_CELLS / (split * split)));
        let count = |length_m: f64, cell_m: f64| (length_m / (split * cell_m)).ceil().max(1.0);
        let total = |cell_m: f64| size.to_array().map(|s| count(s, cell_m)).iter().product::<f64>();
        while total(cell_m) * split.powi(3) > MAX_CELLS {
            cell_m *= 1.02;
        }
        let counts = size.to_array().map(|s| count(s, cell_m) as usize);
        let blocks = (0..counts.iter().product()).map(|_| Block::default()).collect();
        Self { low, cell_m, counts, blocks }
    }

    /// Side of a small cell, metres.
    #[cfg(test)]
    pub(super) fn cell_m(&self) -> f64 {
        self.cell_m
    }

    /// Bytes on the heap.
    pub(super) fn bytes(&self) -> usize {
        let measured = self.blocks.iter().filter(|block| block.parts.get().is_some()).count();
        self.blocks.capacity() * size_of::<Block>() + measured * SPLIT.pow(3) * size_of::<AtomicU64>()
    }

    /// Bytes on the heap when all cells are measured.
    #[cfg(test)]
    pub(super) fn bytes_at_most(&self) -> usize {
        self.blocks.capacity() * (size_of::<Block>() + SPLIT.pow(3) * size_of::<AtomicU64>())
    }

    /// What is known at a point; `None` outside the cells. `measure` is told a cell and the triangle nearest to the
    /// large cell's middle, if this is a small one.
    pub(super) fn read(
        &self,
        point: Vector,
        measure: impl Fn(Cell, Option<u32>) -> Sample,
    ) -> Option<Reading> {
        let place = (point - self.low) / self.cell_m;
        let mut block = 0;
        let mut part = 0;
        let mut corner = Vector::ZERO;
        for axis in 0..3 {
            // Written so that NaN is outside.
            if !(place[axis] >= 0.0 && place[axis] < (SPLIT * self.counts[axis]) as f64) {
                return None;
            }
            let index = place[axis] as usize;
            block = block * self.counts[axis] + index / SPLIT;
            part = part * SPLIT + index % SPLIT;
            corner[axis] = index as f64;
        }
        let held = &self.blocks[block];
        let whole_corner = (corner / SPLIT as f64).floor() * SPLIT as f64;
        let whole = self.look(&held.whole, point, whole_corner, SPLIT as f64, |cell| measure(cell, None));
        let half_diagonal_m = 0.5 * 3f64.sqrt() * SPLIT as f64 * self.cell_m;
        if whole.bound_m() >= COARSE_ENOUGH * half_diagonal_m {
            return Some(whole);
        }
        let parts = held.parts.get_or_init(|| Box::new([const { AtomicU64::new(0) }; SPLIT.pow(3)]));
        let seed = Some(whole.sample.triangle);
        Some(self.look(&parts[part], point, corner, 1.0, |cell| measure(cell, seed)))
    }

    fn look(
        &self,
        word: &AtomicU64,
        point: Vector,
        corner: Vector,
        cells: f64,
        measure: impl FnOnce(Cell) -> Sample,
    ) -> Reading {
        let center = self.low + (corner + 0.5 * cells) * self.cell_m;
        // Relaxed: the word is all there is, and whoever writes it writes the same.
        let sample = Sample::unpack(word.load(Ordering::Relaxed)).unwrap_or_else(|| {
            let half_diagonal_m = 0.5 * 3f64.sqrt() * cells * self.cell_m;
            let sample = measure(Cell { center, half_diagonal_m });
            word.store(sample.pack(), Ordering::Relaxed);
            sample
        });
        Reading { sample, away_m: (point - center).length() }
    }
}
