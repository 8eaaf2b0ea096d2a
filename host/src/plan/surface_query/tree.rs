//! The triangles in a tree of boxes, eight to a node: what an exact answer needs, for a tenth of a microsecond or two.
//!
//! The triangles stand in the order of a space-filling curve (Morton 1966), eight of them to a leaf, eight leaves to a
//! node and so on: the tree has no pointers, and one node's boxes are tested together. Boxes are single precision in
//! units of the object's size; every test allows for their rounding, so that none drops a triangle that counts.

use std::ops::Range;

use parry3d_f64::math::Vector;
use parry3d_f64::query::PointQueryWithLocation;
use parry3d_f64::shape::{Triangle, TrianglePointLocation};
use rayon::prelude::*;

/// Children of a node.
const WIDTH: usize = 8;

/// Where the boxes of missing children are, in units of the object's size: farther than anything asked about, near
/// enough for its square to be finite.
const NOWHERE: f32 = 1.0e18;

/// Rounding of a box's corner, of the asked point and of their difference, in units of the object's size and of the
/// point's distance from its centre, with room to spare: single precision rounds by 6e-8.
const ROUNDING: f64 = 1.0e-6;

/// Share of a square that the difference of two like it may be wrong by.
const CANCELLATION: f32 = 1.0e-6;

/// Smallest size of an object that boxes are scaled to, metres: below it scaled coordinates would overflow.
const SMALLEST_M: f64 = 1.0e-9;

/// The boxes of a node's children, axis by axis.
struct Node {
    low: [[f32; WIDTH]; 3],
    high: [[f32; WIDTH]; 3],
}

impl Node {
    const EMPTY: Self = Self { low: [[NOWHERE; WIDTH]; 3], high: [[NOWHERE; WIDTH]; 3] };

    fn set(&mut self, child: usize, [low, high]: [[f32; 3]; 2]) {
        for axis in 0..3 {
            (self.low[axis][child], self.high[axis][child]) = (low[axis], high[axis]);
        }
    }

    /// The box about the first `count` children.
    fn around(&self, count: usize) -> [[f32; 3]; 2] {
        let fold = |side: &[[f32; WIDTH]; 3], pick: fn(f32, f32) -> f32| {
            [0, 1, 2].map(|axis| side[axis][1..count].iter().copied().fold(side[axis][0], pick))
        };
        [fold(&self.low, f32::min), fold(&self.high, f32::max)]
    }
}

/// Flat round boxes about a node's children: between two planes, within a radius about the line across them. A patch of
/// surface is flat and lies askew, so that these are much nearer to it than upright boxes.
struct Discs {
    center: [[f32; WIDTH]; 3],
    normal: [[f32; WIDTH]; 3],
    radius: [f32; WIDTH],
    half_height: [f32; WIDTH],
}

impl Discs {
    const EMPTY: Self = Self {
        center: [[NOWHERE; WIDTH]; 3],
        normal: [[0.0; WIDTH]; 3],
        radius: [0.0; WIDTH],
        half_height: [0.0; WIDTH],
    };

    /// Puts one about triangles in the tree's units.
    fn set(&mut self, child: usize, triangles: &[Triangle], scaled: &impl Fn(Vector) -> Vector) {
        let mut sum = Vector::ZERO;
        let (mut low, mut high) = (Vector::INFINITY, Vector::NEG_INFINITY);
        for t in triangles {
            let [a, b, c] = [t.a, t.b, t.c].map(scaled);
            (low, high) = (low.min(a).min(b).min(c), high.max(a).max(b).max(c));
            let normal = (b - a).cross(c - a);
            // The two sides of a thin wall count alike.
            sum += if normal.dot(sum) < 0.0 { -normal } else { normal };
        }
        // As rounded, since distances are measured with it so.
        let normal = sum.try_normalize().unwrap_or(Vector::X).as_vec3().as_dvec3();
        let mut center = 0.5 * (low + high);
        let [mut lowest, mut highest] = [f64::INFINITY, f64::NEG_INFINITY];
        for corner in triangles.iter().flat_map(|t| [t.a, t.b, t.c]) {
            let height = (scaled(corner) - center).dot(normal);
            (lowest, highest) = (lowest.min(height), highest.max(height));
        }
        center = (center + normal * (0.5 * (lowest + highest))).as_vec3().as_dvec3();
        let (mut radius, mut half_height) = (0.0_f64, 0.0_f64);
        for corner in triangles.iter().flat_map(|t| [t.a, t.b, t.c]) {
            let away = scaled(corner) - center;
            let height = away.dot(normal);
            half_height = half_height.max(height.abs());
            radius = radius.max((away - normal * height).length());
        }
        for axis in 0..3 {
            self.center[axis][child] = center[axis] as f32;
            self.normal[axis][child] = normal[axis] as f32;
        }
        // Up, so that what is in stays in.
        (self.radius[child], self.half_height[child]) =
            ((radius as f32).next_up(), (half_height as f32).next_up());
    }

    /// Square of the distance from a point to each disc, too small by rounding at most.
    fn distances_squared(&self, point: &[f32; 3]) -> [f32; WIDTH] {
        std::array::from_fn(|child| {
            let x = point[0] - self.center[0][child];
            let y = point[1] - self.center[1][child];
            let z = point[2] - self.center[2][child];
            let height =
                (x * self.normal[0][child] + y * self.normal[1][child] + z * self.normal[2][child]).abs();
            // What rounding leaves of a difference of squares is not known to be more than this.
            let across = (x * x + y * y + z * z) * (1.0 - CANCELLATION) - height * height;
            let across = if across > 0.0 { across } else { 0.0 };
            let out = across.sqrt() - self.radius[child];
            let out = if out > 0.0 { out } else { 0.0 };
            let above = height - self.half_height[child];
            let above = if above > 0.0 { above } else { 0.0 };
            out * out + above * above
        })
    }
}

/// A point of the surface that is nearest to another.
#[derive(Debug, Clone, Copy)]
pub(super) struct Hit {
    /// The triangle, in the tree's order.
    pub(super) triangle: u32,
    /// Which part of it.
    pub(super) location: TrianglePointLocation,
    /// The point.
    pub(super) point: Vector,
    /// Distance to it, not negative.
    pub(super) distance_m: f64,
}

/// A box turned in any way, in the units of a tree.
pub(super) struct TurnedBox {
    center: [f32; 3],
    /// Axes of the box as rows.
    axes: [[f32; 3]; 3],
    half: [f32; 3],
    /// Half extents of the upright box about it.
    upright_half: [f32; 3],
    slack: f32,
}

impl TurnedBox {
    /// Whether single precision can hold it, squared too.
    pub(super) fn is_finite(&self) -> bool {
        self.center.iter().chain(&self.upright_half).all(|x| x.abs() < NOWHERE)
    }

    /// Which boxes of the node it may overlap: six separating axes of the fifteen.
    fn overlaps(&self, node: &Node) -> [bool; WIDTH] {
        let mut apart = [false; WIDTH];
        let mut offset = [[0.0; WIDTH]; 3];
        let mut extent = [[0.0; WIDTH]; 3];
        for axis in 0..3 {
            for child in 0..WIDTH {
                let (low, high) = (node.low[axis][child], node.high[axis][child]);
                offset[axis][child] = 0.5 * (low + high) - self.center[axis];
                extent[axis][child] = 0.5 * (high - low) + self.slack;
                apart[child] |= offset[axis][child].abs() > extent[axis][child] + self.upright_half[axis];
            }
        }
        for (row, half) in self.axes.iter().zip(self.half) {
            for child in 0..WIDTH {
                let (mut along, mut reach) = (0.0, half);
                for axis in 0..3 {
                    along += row[axis] * offset[axis][child];
                    reach += row[axis].abs() * extent[axis][child];
                }
                apart[child] |= along.abs() > reach;
            }
        }
        apart.map(|apart| !apart)
    }
}

/// The tree. Triangles are known by their place in its order.
pub(super) struct Tree {
    triangles: Vec<Triangle>,
    /// Level by level, those that hold triangles first, the root last.
    nodes: Vec<Node>,
    /// Beside the nodes.
    discs: Vec<Discs>,
    /// Where each level begins in `nodes`.
    levels: Vec<usize>,
    center: Vector,
    per_m: f64,
}

impl Tree {
    /// Builds the tree over triangles within a box, and says which of the given ones stands at each place.
    pub(super) fn new(triangles: &[Triangle], [low, high]: [Vector; 2]) -> (Self, Vec<u32>) {
        let center = 0.5 * (low + high);
        let per_m = 1.0 / (0.5 * (high - low).max_element()).max(SMALLEST_M);
        let mut keys: Vec<u64> = triangles
            .par_iter()
            .enumerate()
            .map(|(face, t)| {
                let middle = ((t.a + t.b + t.c) / 3.0 - center) * per_m;
                u64::from(morton(middle)) << 32 | face as u64
            })
            .collect();
        keys.par_sort_unstable();
        let order: Vec<u32> = keys.into_iter().map(|key| key as u32).collect();
        let triangles: Vec<Triangle> = order.par_iter().map(|&face| triangles[face as usize]).collect();

        let scaled = |p: Vector| -> [f32; 3] { ((p - center) * per_m).to_array().map(|x| x as f32) };
        let mut nodes: Vec<Node> = triangles
            .par_chunks(WIDTH)
            .map(|chunk| {
                let mut node = Node::EMPTY;
                for (child, t) in chunk.iter().enumerate() {
                    node.set(child, [scaled(t.a.min(t.b).min(t.c)), scaled(t.a.max(t.b).max(t.c))]);
                }
                node
            })
            .collect();
        let mut levels = vec![0];
        let mut children = triangles.len();
        loop {
            let begin = levels.last().copied().unwrap_or(0);
            let count = nodes.len() - begin;
            if count <= 1 {
                break;
            }
            let end = nodes.len();
            for first in (begin..end).step_by(WIDTH) {
                let mut node = Node::EMPTY;
                for (child, place) in (first..end.min(first + WIDTH)).enumerate() {
                    let full = WIDTH.min(children - (place - begin) * WIDTH);
                    node.set(child, nodes[place].around(full));
                }
                nodes.push(node);
            }
            levels.push(end);
            children = count;
        }
        let unrounded = |p: Vector| (p - center) * per_m;
        let mut discs = Vec::with_capacity(nodes.len());
        let mut span = 1;
        for (level, &begin) in levels.iter().enumerate() {
            let end = levels.get(level + 1).copied().unwrap_or(nodes.len());
            discs.par_extend((0..end - begin).into_par_iter().map(|index| {
                let mut discs = Discs::EMPTY;
                let first = index * WIDTH * span;
                let under = &triangles[first..triangles.len().min(first + WIDTH * span)];
                for (child, part) in under.chunks(span).enumerate() {
                    discs.set(child, part, &unrounded);
                }
                discs
            }));
            span *= WIDTH;
        }
        (Self { triangles, nodes, discs, levels, center, per_m }, order)
    }

    pub(super) fn triangles(&self) -> &[Triangle] {
        &self.triangles
    }

    /// Bytes on the heap.
    pub(super) fn bytes(&self) -> usize {
        self.triangles.capacity() * size_of::<Triangle>()
            + self.nodes.capacity() * size_of::<Node>()
            + self.discs.capacity() * size_of::<Discs>()
    }

    fn scaled(&self, point: Vector) -> [f32; 3] {
        ((point - self.center) * self.per_m).to_array().map(|x| x as f32)
    }

    /// What rounding can add to a distance from this point, in units of the object's size.
    fn rounding(&self, point: Vector) -> f64 {
        ROUNDING * (1.0 + ((point - self.center) * self.per_m).abs().max_element())
    }

    /// The children of a node: places in the level below, or of triangles under level 0.
    fn children(&self, level: usize, index: usize) -> Range<usize> {
        let below = match level {
            0 => self.triangles.len(),
            _ => self.levels[level] - self.levels[level - 1],
        };
        index * WIDTH..below.min((index + 1) * WIDTH)
    }

    /// The nearest point of the surface; `seed` is a triangle that is near already.
    pub(super) fn nearest(&self, point: Vector, seed: u32) -> Hit {
        let mut search = Search {
            tree: self,
            point,
            scaled: self.scaled(point),
            rounding: self.rounding(point),
            limit: 0.0,
            best: self.project(point, seed),
        };
        search.limit = search.limit_of(search.best.distance_m);
        search.descend(self.levels.len() - 1, 0);
        search.best
    }

    fn project(&self, point: Vector, triangle: u32) -> Hit {
        let (found, location) =
            self.triangles[triangle as usize].project_local_point_and_get_location(point, false);
        Hit { triangle, location, point: found.point, distance_m: (point - found.point).length() }
    }

    /// A box with the given centre, axes (columns) and half extents in this tree's units.
    pub(super) fn turned_box(&self, center: Vector, axes: [Vector; 3], half_m: Vector) -> TurnedBox {
        let half = half_m * self.per_m;
        let upright = axes[0].abs() * half.x + axes[1].abs() * half.y + axes[2].abs() * half.z;
        let slack = self.rounding(center) + ROUNDING * half.max_element();
        TurnedBox {
            center: self.scaled(center),
            axes: axes.map(|axis| axis.to_array().map(|x| x as f32)),
            half: half.to_array().map(|x| x as f32),
            upright_half: upright.to_array().map(|x| x as f32),
            slack: slack as f32,
        }
    }

    /// Whether `hit` says yes to any triangle that a box may overlap.
    pub(super) fn any_in_box(&self, region: &TurnedBox, hit: &mut impl FnMut(&Triangle) -> bool) -> bool {
        self.any(self.levels.len() - 1, 0, &|node: usize| region.overlaps(&self.nodes[node]), hit)
    }

    /// Whether `hit` says yes to any triangle that may be as near to a point as `reach_m`.
    pub(super) fn any_in_ball(
        &self,
        center: Vector,
        reach_m: f64,
        hit: &mut impl FnMut(&Triangle) -> bool,
    ) -> bool {
        let scaled = self.scaled(center);
        let limit = limit(reach_m * self.per_m, self.rounding(center));
        let overlaps =
            |node: usize| self.discs[node].distances_squared(&scaled).map(|squared| squared <= limit);
        self.any(self.levels.len() - 1, 0, &overlaps, hit)
    }

    fn any<O: Fn(usize) -> [bool; WIDTH], H: FnMut(&Triangle) -> bool>(
        &self,
        level: usize,
        index: usize,
        overlaps: &O,
        hit: &mut H,
    ) -> bool {
        let overlap = overlaps(self.levels[level] + index);
        self.children(level, index).zip(overlap).any(|(child, overlap)| {
            overlap
                && match level {
                    0 => hit(&self.triangles[child]),
                    _ => self.any(level - 1, child, overlaps, hit),
                }
        })
    }
}

/// Square of a distance in single precision, enlarged by what rounding can do to it.
fn limit(distance: f64, rounding: f64) -> f32 {
    ((distance + 2.0 * rounding).powi(2) * (1.0 + 1.0e-5)) as f32
}

/// A nearest-point query on its way.
struct Search<'a> {
    tree: &'a Tree,
    point: Vector,
    scaled: [f32; 3],
    rounding: f64,
    /// Boxes at a greater squared distance hold nothing nearer than `best`.
    limit: f32,
    best: Hit,
}

impl Search<'_> {
    fn limit_of(&self, distance_m: f64) -> f32 {
        limit(distance_m * self.tree.per_m, self.rounding)
    }

    fn descend(&mut self, level: usize, index: usize) {
        let squared = self.tree.discs[self.tree.levels[level] + index].distances_squared(&self.scaled);
        let children = self.tree.children(level, index);
        let count = children.len();
        // The nearest child first; the others seldom stay within the limit that it leaves.
        let mut left = squared;
        for _ in 0..count {
            let (mut child, mut least) = (0, f32::INFINITY);
            for (i, &squared) in left[..count].iter().enumerate() {
                if squared < least {
                    (child, least) = (i, squared);
                }
            }
            // What is not a number is never least, and ends here too.
            if least > self.limit || least == f32::INFINITY {
                return;
            }
            left[child] = f32::INFINITY;
            let place = children.start + child;
            if level > 0 {
                self.descend(level - 1, place);
                continue;
            }
            let hit = self.tree.project(self.point, place as u32);
            if hit.distance_m < self.best.distance_m {
                self.limit = self.limit_of(hit.distance_m);
                self.best = hit;
            }
        }
    }
}

/// Place of a point of the cube from -1 to 1 on the curve: ten bits an axis, interleaved.
fn morton(point: Vector) -> u32 {
    point.to_array().iter().fold(0, |code, &x| {
        // A cast saturates.
        let mut bits = ((x + 1.0) * 512.0).min(1023.0) as u32;
        for (shift, mask) in [(16, 0x0300_00ff), (8, 0x0300_f00f), (4, 0x030c_30c3), (2, 0x0924_9249)] {
            bits = (bits | bits << shift) & mask;
        }
        code << 1 | bits
    })
}
