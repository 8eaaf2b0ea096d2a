//! A polytope in six dimensions that grows point by point: the inner approximation of a convex set.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use nalgebra::{Matrix6, Vector6};

/// Facets that one polytope may have at a time, about 80 MB. A common grasp takes some hundreds; one whose wrenches are
/// as round as those of four fingers around a cube takes 20,000 for three digits and 300,000 for six.
const MAX_FACETS: usize = 1 << 19;

/// Facets that memory is kept for from one use to the next, about 5 MB: more than a common grasp takes.
const KEPT_FACETS: usize = 1 << 15;

/// In place of a neighbour, until the cone of new facets is joined.
const NOT_JOINED: u32 = u32::MAX;

/// The polytope cannot grow: the point is not above the facet that it was found from, or the next facet has no reliable
/// plane, or there are too many. What was known about the set stays true.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Stuck;

/// A 5-simplex on the boundary.
#[derive(Debug, Clone)]
struct Facet {
    /// Unit, outward.
    normal: Vector6<f64>,
    /// Least and greatest of `normal . p` over the corners `p`; they differ by rounding only.
    low: f64,
    high: f64,
    corners: [u32; 6],
    /// `neighbors[k]` shares all corners but `corners[k]`.
    neighbors: [u32; 6],
    /// How far the last point that was compared is above the plane, and which point it was.
    height: f64,
    compared: u32,
    /// Serial number; another facet takes the slot, with another number, once this one is covered.
    born: u32,
}

/// The facets wait for their turn by distance from the origin, nearest first; equal ones by age, so that a run repeats.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Waiting {
    low: f64,
    born: u32,
    facet: u32,
}

impl Eq for Waiting {}

impl Ord for Waiting {
    fn cmp(&self, other: &Self) -> Ordering {
        other.low.total_cmp(&self.low).then(other.born.cmp(&self.born))
    }
}

impl PartialOrd for Waiting {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// A facet as the search sees it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Nearest {
    pub(super) facet: u32,
    /// Unit outward normal.
    pub(super) normal: Vector6<f64>,
    /// Signed distance of the facet from the origin, rounded down: negative when the origin is outside.
    pub(super) low: f64,
}

/// A simplicial polytope with seven points or more.
///
/// New planes are pencils, positive combinations of the planes on both sides of a horizon ridge: no linear system is
/// solved, and errors do not grow by cancellation. What is left of them is measured: `low` is the least distance of any
/// *corner* along the normal, so every point of the facet is at least that far from the origin. The facets close a
/// surface by construction, whatever the rounding; so when all are at a positive distance, a ball with the least of
/// them is inside, even if the surface were not quite convex.
///
/// Slots of covered facets are used again, and memory is kept from one use to the next.
#[derive(Debug, Clone, Default)]
pub(super) struct Polytope {
    points: Vec<Vector6<f64>>,
    facets: Vec<Facet>,
    /// Slots of facets that were covered.
    free: Vec<u32>,
    born: u32,
    waiting: BinaryHeap<Waiting>,
    /// Facets that the new point sees, and the ridges around them: facet and slot of the corner that the ridge lacks.
    visible: Vec<u32>,
    horizon: Vec<(u32, usize)>,
    /// The new facet on every ridge of the horizon.
    cone: Vec<u32>,
    /// Heights up to this one are ties.
    tie: f64,
}

impl Polytope {
    /// Starts over from a simplex. Heights up to `tie` above a plane will count as on it.
    pub(super) fn start(&mut self, simplex: &[Vector6<f64>; 7], tie: f64) -> Result<(), Stuck> {
        self.points.clear();
        self.facets.clear();
        self.free.clear();
        self.born = 0;
        self.waiting.clear();
        self.cone.clear();
        self.tie = tie;
        self.points.extend_from_slice(simplex);

        // Row k of the inverse is the gradient of the barycentric coordinate of corner k + 1.
        let [origin, others @ ..] = simplex;
        let gradients = Matrix6::from_columns(&others.map(|p| p - origin)).try_inverse().ok_or(Stuck)?;
        let first = gradients.row_sum().transpose();
        for opposite in 0..7_u32 {
            let inward =
                if opposite == 0 { -first } else { gradients.row(opposite as usize - 1).transpose() };
            let others = |slot: usize| {
                let slot = slot as u32;
                if slot < opposite { slot } else { slot + 1 }
            };
            // Facet k lacks corner k, so across the ridge that also lacks corner j lies facet j.
            let corners = std::array::from_fn(others);
            let new = self.add_facet(-inward, corners, corners)?;
            self.cone.push(new);
        }
        self.enqueue(f64::INFINITY);
        Ok(())
    }

    /// Takes out the facet nearest to the origin; `None` when none that was worth queueing is left.
    pub(super) fn pop_nearest(&mut self) -> Option<Nearest> {
        loop {
            let Waiting { low, born, facet } = self.waiting.pop()?;
            let f = &self.facets[facet as usize];
            if f.born == born {
                return Some(Nearest { facet, normal: f.normal, low });
            }
        }
    }

    /// Points of a facet, by the order of their coming.
    pub(super) fn corners(&self, facet: u32) -> [usize; 6] {
        self.facets[facet as usize].corners.map(|corner| corner as usize)
    }

    /// Grows to the hull with `point`, which was found beyond `facet`. New facets no nearer than `worth` are not queued.
    pub(super) fn insert(&mut self, facet: u32, point: Vector6<f64>, worth: f64) -> Result<(), Stuck> {
        let apex = self.points.len() as u32;
        self.find_visible(facet, &point, apex)?;
        if self.facets.len() + self.horizon.len() > MAX_FACETS + self.free.len() {
            return Err(Stuck);
        }
        self.points.push(point);
        self.build_cone(apex)?;
        self.join_cone()?;
        for &seen in &self.visible {
            self.facets[seen as usize].born = u32::MAX;
        }
        self.free.extend_from_slice(&self.visible);
        self.enqueue(worth);
        Ok(())
    }

    /// Gives back the memory of an unusually large polytope.
    pub(super) fn release_excess(&mut self) {
        if self.facets.capacity() > KEPT_FACETS {
            *self = Self::default();
        }
    }

    fn height(&mut self, facet: u32, point: &Vector6<f64>, apex: u32) -> f64 {
        let f = &mut self.facets[facet as usize];
        if f.compared != apex {
            f.compared = apex;
            f.height = f.normal.dot(point) - f.high;
        }
        f.height
    }

    /// Walks over the facets that the point is above, from one to its neighbours, and notes the horizon around them.
    fn find_visible(&mut self, from: u32, point: &Vector6<f64>, apex: u32) -> Result<(), Stuck> {
        self.visible.clear();
        self.horizon.clear();
        if self.height(from, point, apex) <= self.tie {
            return Err(Stuck);
        }
        self.visible.push(from);
        let mut next = 0;
        while let Some(&seen) = self.visible.get(next) {
            next += 1;
            for slot in 0..6 {
                let neighbor = self.facets[seen as usize].neighbors[slot];
                let known = self.facets[neighbor as usize].compared == apex;
                if self.height(neighbor, point, apex) <= self.tie {
                    self.horizon.push((seen, slot));
                } else if !known {
                    self.visible.push(neighbor);
                }
            }
        }
        // The first facet was compared before the walk, so no neighbour has pushed it again.
        Ok(())
    }

    /// One new facet from every horizon ridge to the apex, joined across the ridge.
    fn build_cone(&mut self, apex: u32) -> Result<(), Stuck> {
        self.cone.clear();
        for at in 0..self.horizon.len() {
            let (seen, slot) = self.horizon[at];
            let below = &self.facets[seen as usize];
            let hidden = below.neighbors[slot];
            let beyond = &self.facets[hidden as usize];
            let normal = beyond.normal * below.height - below.normal * beyond.height;
            let mut corners = below.corners;
            corners[slot] = apex;
            let mut neighbors = [NOT_JOINED; 6];
            neighbors[slot] = hidden;
            let new = self.add_facet(normal, corners, neighbors)?;
            let back = slot_of(&self.facets[hidden as usize].neighbors, seen)?;
            self.facets[hidden as usize].neighbors[back] = new;
            // The retired facet points into the cone, for `join_cone` to find.
            self.facets[seen as usize].neighbors[slot] = new;
            self.cone.push(new);
        }
        Ok(())
    }

    /// Joins the facets of the cone with each other, by turning around each of a ridge's own ridges through the visible
    /// facets until the horizon is met again. What is joined there is joined on both sides.
    fn join_cone(&mut self) -> Result<(), Stuck> {
        for at in 0..self.horizon.len() {
            let (seen, slot) = self.horizon[at];
            let new = self.cone[at];
            for other in (0..6).filter(|&other| other != slot) {
                if self.facets[new as usize].neighbors[other] == NOT_JOINED {
                    let (met, back) = self.turn(seen, slot, other)?;
                    self.facets[new as usize].neighbors[other] = met;
                    self.facets[met as usize].neighbors[back] = new;
                }
            }
        }
        Ok(())
    }

    /// Turns around the four corners that `facet` has besides those in `keep` and `leave`, away from the ridge that
    /// lacks `keep`, to the facet of the cone on the other side, and to its slot for the way back.
    fn turn(&self, mut facet: u32, keep: usize, mut leave: usize) -> Result<(u32, usize), Stuck> {
        let Facet { corners, compared, .. } = self.facets[facet as usize];
        let mut kept = corners[keep];
        for _ in 0..=self.visible.len() {
            let across = self.facets[facet as usize].neighbors[leave];
            let f = &self.facets[across as usize];
            if f.compared != compared {
                return Ok((across, slot_of(&f.corners, kept)?));
            }
            let entered = slot_of(&f.neighbors, facet)?;
            leave = slot_of(&f.corners, kept)?;
            kept = f.corners[entered];
            facet = across;
        }
        Err(Stuck)
    }

    fn add_facet(
        &mut self,
        normal: Vector6<f64>,
        corners: [u32; 6],
        neighbors: [u32; 6],
    ) -> Result<u32, Stuck> {
        let length = normal.norm();
        // A pencil of two opposite planes, or an overflown inverse.
        if !(length > 0.0 && length.is_finite()) {
            return Err(Stuck);
        }
        let normal = normal / length;
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for corner in corners {
            let along = normal.dot(&self.points[corner as usize]);
            low = low.min(along);
            high = high.max(along);
        }
        // Point 0 is never compared with a facet: it is a corner of the first simplex.
        let facet =
            Facet { normal, low, high, corners, neighbors, height: 0.0, compared: 0, born: self.born };
        self.born += 1;
        if let Some(slot) = self.free.pop() {
            self.facets[slot as usize] = facet;
            Ok(slot)
        } else {
            self.facets.push(facet);
            Ok(self.facets.len() as u32 - 1)
        }
    }

    /// Queues the facets of the cone.
    fn enqueue(&mut self, worth: f64) {
        for &facet in &self.cone {
            let Facet { low, born, .. } = self.facets[facet as usize];
            if low < worth {
                self.waiting.push(Waiting { low, born, facet });
            }
        }
    }
}

fn slot_of(slots: &[u32; 6], value: u32) -> Result<usize, Stuck> {
    slots.iter().position(|&slot| slot == value).ok_or(Stuck)
}
