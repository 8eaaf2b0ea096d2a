//! The facets of a growing polytope that are nearest to the origin, and no others.
//!
//! In the polar body `{a : (w - c) . a <= 1}` about an inner point `c` a facet is a vertex `a`, its distance from the
//! origin `d(a) = (1 + a . c) / |a|`, and a new point `w` one more half-space, which cuts vertices off and puts new ones
//! on the edges that it crosses. The set where `d` is at least some positive number is convex. So a new vertex with a
//! lesser `d` can only be on an edge of which one end has a lesser `d` as well, and the double description method
//! (T. S. Motzkin et al., 1953) stays exact when it knows no other vertices than those nearer than the upper bound.
//!
//! Vertices are visited nearest first. Until its turn a vertex is only a distance and a place on an edge of another one;
//! then it gets its matrix and meets the points that came in the meantime, in their order.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use nalgebra::{Matrix6, Vector6};

use super::polytope::{Nearest, Stuck};
use super::seen::{Seen, name, renamed};

/// Vertices that are visited before the search is left to the whole polytope. Hardly a random grasp needs more; where
/// wrenches are as round as a ball, thousands of facets are equally near, and there it is the slower way.
const MAX_VISITS: usize = 500;
/// Visits after which the nearest facet has to be this much of the upper bound: where it was less, the bounds never met in
/// time, and where they did, it was more.
const PROBATION: (usize, f64) = (150, 0.6);
/// Points are named by a byte.
const MAX_POINTS: usize = 256;
/// Gradients of barycentric coordinates in the first simplex, times the bound of the set. Beyond, the simplex is so flat
/// that rounding decides what is a vertex.
const MAX_GRADIENT: f64 = 2e3;
/// The inner point's least barycentric coordinate in the first simplex, before normalization.
const MIN_DEPTH: f64 = 0.02;
/// Rounding in the product of a point with a column, as a fraction of the bound of the set times the column's length:
/// three times what six products make. Within, it is open on which side of the facet the point is.
const NOISE: f64 = 2e-15;
/// Points are drawn in towards the inner point, each by another fraction of its distance up to this one. Contacts and
/// edges of pyramids share planes, and without it a facet with more than six points would be many vertices in one place.
/// It is ten to a hundred times the noise of a common facet, and what it costs is below the gap that ends a search.
const DRAWN_IN: f64 = 2e-12;
/// Coordinates of a point in a basis that count as none. Points that share a plane have such because of their being drawn
/// in, and bases with them would be slivers.
const PIVOT: f64 = 50.0 * DRAWN_IN;
/// How far points of a facet may be off its plane, and a facet from where it was expected, in heights that count as
/// none: beyond, its matrix is spoilt.
const MAX_ERROR: f64 = 2.0;

/// One number for each of the six edges at a vertex, and in lane [`VERTEX`] for the vertex itself. The eighth is there
/// for the sake of the registers.
type Lanes = [f64; 8];
const VERTEX: usize = 6;

/// A vertex that had its turn.
#[derive(Debug, Clone, Copy)]
struct Vertex {
    /// Rows are coordinates. Column `k < 6` has product 1 with point `basis[k]` and 0 with the others of the basis, so its
    /// negative is the edge that leaves their plane; column [`VERTEX`] has product 1 with all.
    columns: [Lanes; 6],
    basis: [u8; 6],
    name: u64,
}

/// A vertex on its turn, with what is known of its edges.
#[derive(Debug, Clone)]
struct Edges {
    at: u16,
    /// Rounding in the product of a point with each column.
    noise: Lanes,
    /// Inverse of the length of each edge, in lengths of its column.
    inverse_lengths: Lanes,
}

/// A vertex that waits: where the edge `lane` of `parent` meets the plane of point `cut`. A corner of the first simplex
/// is its own parent and has no edge.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Waiting {
    distance: f64,
    serial: u32,
    parent: u16,
    lane: u8,
    cut: u8,
}

const NO_EDGE: u8 = u8::MAX;

impl Eq for Waiting {}

impl Ord for Waiting {
    fn cmp(&self, other: &Self) -> Ordering {
        other.distance.total_cmp(&self.distance).then(other.serial.cmp(&self.serial))
    }
}

impl PartialOrd for Waiting {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// The part of a polytope that faces the origin most.
///
/// It has the same outcomes as the whole [`Polytope`](super::polytope::Polytope), and is [`Stuck`] where that one need
/// not be: with many facets equally near, or in a flat first simplex. Memory is kept, at most some 300 kB.
#[derive(Debug, Clone, Default)]
pub(super) struct Polar {
    /// The inner point that the polar body is about, and the points of the polytope relative to it.
    center: [f64; 6],
    points: Vec<[f64; 6]>,
    vertices: Vec<Vertex>,
    waiting: BinaryHeap<Waiting>,
    seen: Seen,
    serial: u32,
    /// The vertex that was left by the points so far and is nearest.
    nearest: Option<Edges>,
    /// Heights above a facet that count as none, and those that are noise.
    tie: f64,
    noise: f64,
}

impl Polar {
    /// Starts over from a simplex in a set whose points are no longer than `bound`. Heights up to `tie` above a plane
    /// will count as on it.
    pub(super) fn start(&mut self, simplex: &[Vector6<f64>; 7], bound: f64, tie: f64) -> Result<(), Stuck> {
        self.points.clear();
        self.vertices.clear();
        self.waiting.clear();
        self.seen.clear();
        self.serial = 0;
        self.nearest = None;
        self.tie = tie;
        self.noise = NOISE * bound;

        let gradients = gradients(simplex).ok_or(Stuck)?;
        // A NaN must not pass.
        if !gradients.iter().all(|g| g.norm() * bound <= MAX_GRADIENT) {
            return Err(Stuck);
        }
        let of_origin = |k: usize| {
            let corner = simplex[usize::from(k == 0)];
            -gradients[k].dot(&corner)
        };
        let depths: [f64; 7] = std::array::from_fn(|k| of_origin(k).max(MIN_DEPTH));
        let total: f64 = depths.iter().sum();
        let depths = depths.map(|depth| depth / total);
        let center: Vector6<f64> = simplex.iter().zip(depths).map(|(p, depth)| p * depth).sum();
        self.center = center.into();
        self.points.extend(simplex.iter().map(|corner| <[f64; 6]>::from(corner - center)));
        for lacking in 0..7_usize {
            let basis: [u8; 6] = std::array::from_fn(|k| (if k < lacking { k } else { k + 1 }) as u8);
            let of_vertex = gradients[lacking] / -depths[lacking];
            let mut columns = [[0.0; 8]; 6];
            for (k, &point) in basis.iter().enumerate() {
                let point = usize::from(point);
                let column = gradients[point] + of_vertex * depths[point];
                for (row, &x) in columns.iter_mut().zip(&column) {
                    row[k] = x;
                }
            }
            for (row, &x) in columns.iter_mut().zip(&of_vertex) {
                row[VERTEX] = x;
            }
            let distance = (1.0 + of_vertex.dot(&center)) / of_vertex.norm();
            let parent = self.vertices.len() as u16;
            self.vertices.push(Vertex { columns, basis, name: name(&basis) });
            self.push(distance, parent, NO_EDGE, 0);
        }
        Ok(())
    }

    /// The facet nearest to the origin, if one is nearer than `worth`. When `worth` is an upper bound of the distance there
    /// always is one, since the search ends once the bounds meet; or rounding has lost it.
    pub(super) fn pop_nearest(&mut self, worth: f64) -> Result<Option<Nearest>, Stuck> {
        while let Some(next) = self.waiting.pop().filter(|next| next.distance < worth) {
            if self.vertices.len() == PROBATION.0 && next.distance < PROBATION.1 * worth {
                return Err(Stuck);
            }
            let at = self.take(&next)?;
            if let Some(low) = self.visit(at, next.distance, worth)? {
                let vertex = vertex_of(&self.vertices[usize::from(at)].columns);
                let normal = Vector6::from(vertex).normalize();
                return Ok(Some(Nearest { facet: u32::from(at), normal, low }));
            }
        }
        Ok(None)
    }

    /// Points of a facet, by the order of their coming.
    pub(super) fn corners(&self, facet: u32) -> [usize; 6] {
        self.vertices[facet as usize].basis.map(usize::from)
    }

    /// Grows to the hull with `point`, which was found beyond the facet that [`Polar::pop_nearest`] gave last.
    pub(super) fn insert(&mut self, point: &Vector6<f64>, worth: f64) -> Result<(), Stuck> {
        if self.points.len() == MAX_POINTS {
            return Err(Stuck);
        }
        let cut = self.points.len();
        // Multiples of the golden ratio are apart from each other, modulo one, however many they are.
        let scale = 1.0 - DRAWN_IN * (cut as f64 * 0.618_033_988_749_894_9).fract();
        self.points.push(std::array::from_fn(|k| (point[k] - self.center[k]) * scale));
        let edges = self.nearest.take().ok_or(Stuck)?;
        let columns = &self.vertices[usize::from(edges.at)].columns;
        let (products, vertex) = (products(columns, &self.points[cut]), vertex_of(columns));
        let over = products[VERTEX] - 1.0;
        if over <= self.tie * dot(&vertex, &vertex).sqrt() {
            return Err(Stuck);
        }
        self.add_crossed(&edges, cut, &products, over, worth)
    }

    /// Gives the vertex its matrix.
    fn take(&mut self, next: &Waiting) -> Result<u16, Stuck> {
        if next.lane == NO_EDGE {
            return Ok(next.parent);
        }
        if self.vertices.len() == MAX_VISITS {
            return Err(Stuck);
        }
        let parent = &self.vertices[usize::from(next.parent)];
        let lane = usize::from(next.lane);
        let products = products(&parent.columns, &self.points[usize::from(next.cut)]);
        let pivot = 1.0 / products[lane];
        let mut factors = products;
        for factor in &mut factors {
            *factor *= pivot;
        }
        factors[lane] = 1.0 - pivot;
        factors[VERTEX] = (products[VERTEX] - 1.0) * pivot;
        let mut child = *parent;
        for row in &mut child.columns {
            let along = row[lane];
            for k in 0..8 {
                row[k] -= along * factors[k];
            }
        }
        child.name = renamed(child.name, child.basis[lane], next.cut);
        child.basis[lane] = next.cut;
        self.vertices.push(child);
        Ok(self.vertices.len() as u16 - 1)
    }

    /// Finds how long the edges of a vertex are among the points up to the newest of its basis, then lets the later
    /// ones cut.
    ///
    /// Gives the distance of the facet when the vertex is left, rounded down as [`Nearest::low`] is.
    fn visit(&mut self, at: u16, expected: f64, worth: f64) -> Result<Option<f64>, Stuck> {
        let vertex = &self.vertices[usize::from(at)];
        let position = vertex_of(&vertex.columns);
        let length = dot(&position, &position).sqrt();
        let mut in_basis = [0_u64; MAX_POINTS / 64];
        // All corners of the first simplex are there from the start.
        let (mut newest, mut residual) = (6, 0.0_f64);
        for point in vertex.basis.map(usize::from) {
            in_basis[point / 64] |= 1 << (point % 64);
            newest = newest.max(point);
            residual = residual.max((dot(&self.points[point], &position) - 1.0).abs());
        }
        let distance = (1.0 + dot(&position, &self.center)) / length;
        // A vertex that is not where it was expected has been waiting at the wrong place. A NaN must not pass either.
        let is_reliable =
            residual <= MAX_ERROR * self.tie * length && (distance - expected).abs() <= MAX_ERROR * self.tie;
        if !is_reliable {
            return Err(Stuck);
        }
        let mut noise = [0.0; 8];
        for row in &vertex.columns {
            for k in 0..8 {
                noise[k] += row[k] * row[k];
            }
        }
        for (noise, least) in noise.iter_mut().zip([PIVOT, PIVOT, PIVOT, PIVOT, PIVOT, PIVOT, 0.0, 0.0]) {
            *noise = (noise.sqrt() * self.noise).max(least);
        }
        let mut edges = Edges { at, noise, inverse_lengths: [0.0; 8] };
        for point in 0..self.points.len() {
            if in_basis[point / 64] >> (point % 64) & 1 == 1 {
                continue;
            }
            let products = products(&self.vertices[usize::from(at)].columns, &self.points[point]);
            let over = products[VERTEX] - 1.0;
            if point > newest {
                let surely_over = if over.abs() > noise[VERTEX] { over } else { 0.0 };
                self.add_crossed(&edges, point, &products, surely_over, worth)?;
                if surely_over > 0.0 {
                    return Ok(None);
                }
            }
            let inverse_slack = 1.0 / ((-over).max(0.0) + noise[VERTEX]);
            for k in 0..8 {
                let inverse = (-products[k] - noise[k]) * inverse_slack;
                let most = &mut edges.inverse_lengths[k];
                *most = if inverse > *most { inverse } else { *most };
            }
        }
        self.nearest = Some(edges);
        Ok(Some(distance - residual / length))
    }

    /// Queues the new vertices where the plane of point `cut` crosses the edges of a vertex: `over` is how far the point
    /// is beyond the vertex, positive when the vertex is cut off. When it is 0, the plane may have crossed either an edge
    /// or its continuation, and both count: a vertex too many does no harm.
    fn add_crossed(
        &mut self,
        edges: &Edges,
        cut: usize,
        products: &Lanes,
        over: f64,
        worth: f64,
    ) -> Result<(), Stuck> {
        let mut most = f64::NEG_INFINITY;
        let mut margins = [0.0; 8];
        for k in 0..6 {
            let product = if over == 0.0 { products[k].abs() } else { products[k] * over.signum() };
            let inside = product - over.abs() * edges.inverse_lengths[k];
            let steep = product - edges.noise[k];
            margins[k] = if inside < steep { inside } else { steep };
            most = if margins[k] > most { margins[k] } else { most };
        }
        if most < 0.0 {
            return Ok(());
        }
        let mut steps = [0.0; 8];
        let (mut squares, mut along) = ([0.0; 8], [1.0; 8]);
        for k in 0..8 {
            steps[k] = over / products[k];
        }
        let Vertex { columns, basis, name } = &self.vertices[usize::from(edges.at)];
        for (row, center) in columns.iter().zip(self.center) {
            for k in 0..8 {
                let x = row[VERTEX] - steps[k] * row[k];
                squares[k] += x * x;
                along[k] += x * center;
            }
        }
        for k in 0..8 {
            along[k] /= squares[k].sqrt();
        }
        let (basis, name) = (*basis, *name);
        for lane in 0..6 {
            if margins[lane] >= 0.0
                && along[lane] < worth
                && self.seen.insert(renamed(name, basis[lane], cut as u8))?
            {
                self.push(along[lane], edges.at, lane as u8, cut as u8);
            }
        }
        Ok(())
    }

    fn push(&mut self, distance: f64, parent: u16, lane: u8, cut: u8) {
        self.waiting.push(Waiting { distance, serial: self.serial, parent, lane, cut });
        self.serial += 1;
    }
}

/// The gradients of the barycentric coordinates; `None` for a flat simplex.
fn gradients(simplex: &[Vector6<f64>; 7]) -> Option<[Vector6<f64>; 7]> {
    let [origin, others @ ..] = simplex;
    let inverse = Matrix6::from_columns(&others.map(|p| p - origin)).try_inverse()?;
    let first = -inverse.row_sum().transpose();
    Some(std::array::from_fn(|k| if k == 0 { first } else { inverse.row(k - 1).transpose() }))
}

/// Products of a point with all columns.
fn products(columns: &[Lanes; 6], point: &[f64; 6]) -> Lanes {
    let mut sums = [0.0; 8];
    for (row, x) in columns.iter().zip(point) {
        for k in 0..8 {
            sums[k] += x * row[k];
        }
    }
    sums
}

fn vertex_of(columns: &[Lanes; 6]) -> [f64; 6] {
    let mut vertex = [0.0; 6];
    for (x, row) in vertex.iter_mut().zip(columns) {
        *x = row[VERTEX];
    }
    vertex
}

fn dot(a: &[f64; 6], b: &[f64; 6]) -> f64 {
    let mut sum = 0.0;
    for (x, y) in a.iter().zip(b) {
        sum += x * y;
    }
    sum
}
