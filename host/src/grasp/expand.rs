//! The distance from the origin to the boundary of a convex set that is known by its support function.
//!
//! A polytope inside the set grows towards the point of the boundary nearest to the origin, as the expanding polytope
//! algorithm of collision detection does in three dimensions, and as Zheng did for grasps (Y. Zheng, "An efficient
//! algorithm for a grasp quality measure", IEEE T-RO 29(2), 2013). Its nearest facet bounds the distance from below;
//! how far the set reaches in any direction bounds it from above. Distances are signed, so the polytope need not
//! contain the origin from the start: one direction in which the set does not reach past the origin ends the search.

use nalgebra::Vector6;

use super::polar::Polar;
use super::polytope::{Nearest, Polytope, Stuck};

/// Heights that rounding can make, as a fraction of the bound of the set.
const TIE: f64 = 1e-12;
/// Reaches at or below this fraction of the bound are zero: the origin is not inside. It leaves rounding ten times the
/// room that it was seen to take.
const FLOOR: f64 = 1e-11;
/// Gaps that cannot be closed any further, as a fraction of the bound of the set.
const GAP: f64 = 4e-12;

/// Cosine of the angle within which directions are one, and facets that are looked at to find another.
const CLOSE: f64 = 0.995;
const MAX_OTHERS: usize = 100;

/// Reaches up to this one are zero for a set whose points are not longer than `bound`.
pub(super) fn floor(bound: f64) -> f64 {
    FLOOR * bound
}

/// When to stop.
#[derive(Debug, Clone, Copy)]
pub(super) struct Goal {
    /// Gap between the bounds, relative to the upper one.
    pub(super) tolerance: f64,
    /// Upper bounds below this one are not worth refining.
    pub(super) reject_below: Option<f64>,
    /// Lower bounds from this one on are good enough.
    pub(super) accept_above: Option<f64>,
    /// Support queries.
    pub(super) max_queries: usize,
}

/// Why the search stopped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Stop {
    /// The origin is inside and the bracket as narrow as it was asked for.
    Inside,
    /// The origin is not inside: in the direction of the upper bound the set reaches no farther than rounding.
    Outside,
    /// The distance is less than was asked for.
    Below,
    /// The distance is as much as was asked for, and the bracket wider than the tolerance.
    Above,
    /// Queries, facets or digits ran out.
    Unfinished,
}

/// What is known of the distance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Bracket {
    /// Lower bound; not positive while the origin is not known to be inside.
    pub(super) low: f64,
    /// Upper bound: how far the set reaches along `direction`.
    pub(super) high: f64,
    /// Unit.
    pub(super) direction: Vector6<f64>,
    /// Support queries made.
    pub(super) queries: usize,
}

/// A support function that remembers the direction in which it reached least.
struct Probe<F> {
    farthest: F,
    bracket: Bracket,
    floor: f64,
    reject_below: Option<f64>,
}

impl<F: FnMut(&Vector6<f64>) -> Vector6<f64>> Probe<F> {
    fn ask(&mut self, direction: &Vector6<f64>) -> Vector6<f64> {
        let point = (self.farthest)(direction);
        let reach = point.dot(direction);
        let bracket = &mut self.bracket;
        bracket.queries += 1;
        if reach < bracket.high {
            bracket.high = reach;
            bracket.direction = *direction;
        }
        point
    }

    /// Whether the upper bound alone ends the search.
    fn refusal(&self) -> Option<Stop> {
        let high = self.bracket.high;
        if high <= self.floor {
            Some(Stop::Outside)
        } else if self.reject_below.is_some_and(|least| high < least) {
            Some(Stop::Below)
        } else {
            None
        }
    }
}

/// The facet that a search ended with, for who wants to know what holds it there.
#[derive(Debug, Clone, Default)]
pub(super) struct Witness {
    /// Whether the next search is to leave one. It costs a little, and facets next to the bound are kept.
    pub(super) is_wanted: bool,
    /// Distances that differ by less than this fraction are equal, where it is asked whether one direction is the
    /// weakest.
    pub(super) margin: f64,
    /// The directions in which the points of the polytope are the farthest ones.
    directions: Vec<Vector6<f64>>,
    facet: Option<Facet>,
}

/// A facet by the directions in which its six corners are the farthest points of the set.
#[derive(Debug, Clone, Copy)]
pub(super) struct Facet {
    pub(super) directions: [Vector6<f64>; 6],
    pub(super) normal: Vector6<f64>,
    /// In no direction that is not close to the normal does the set reach as little.
    pub(super) is_only: bool,
}

impl Witness {
    /// What the last search left.
    pub(super) fn facet(&self) -> Option<&Facet> {
        self.facet.as_ref()
    }

    /// Facets nearer than this are kept while the upper bound is `high`.
    fn worth(&self, high: f64) -> f64 {
        if self.is_wanted { high * (1.0 + self.margin) } else { high }
    }

    fn note(&mut self, direction: &Vector6<f64>) {
        if self.is_wanted {
            self.directions.push(*direction);
        }
    }

    fn start(&mut self, directions: &[Vector6<f64>; 7]) {
        self.directions.clear();
        self.facet = None;
        directions.iter().for_each(|direction| self.note(direction));
    }
}

/// A polytope inside the set that grows where it is nearest to the origin.
trait Inner {
    /// Whether the bounds have met when no facet is nearer than the upper one; else one has been lost.
    const MEETS: bool;
    /// Corners of a facet that was taken out last, by the order of their coming.
    fn corners(&self, facet: u32) -> [usize; 6];
    /// Takes out the facet nearest to the origin; `None` when none is nearer than `worth`.
    fn pop_nearest(&mut self, worth: f64) -> Result<Option<Nearest>, Stuck>;
    /// Grows to the hull with `point`, which was found beyond the facet that was taken out last.
    fn insert(&mut self, facet: u32, point: Vector6<f64>, worth: f64) -> Result<(), Stuck>;
}

impl Inner for Polar {
    const MEETS: bool = false;

    fn corners(&self, facet: u32) -> [usize; 6] {
        self.corners(facet)
    }

    fn pop_nearest(&mut self, worth: f64) -> Result<Option<Nearest>, Stuck> {
        self.pop_nearest(worth)
    }

    fn insert(&mut self, _facet: u32, point: Vector6<f64>, worth: f64) -> Result<(), Stuck> {
        self.insert(&point, worth)
    }
}

impl Inner for Polytope {
    const MEETS: bool = true;

    fn corners(&self, facet: u32) -> [usize; 6] {
        self.corners(facet)
    }

    /// Facets farther than `worth` have not been queued.
    fn pop_nearest(&mut self, _worth: f64) -> Result<Option<Nearest>, Stuck> {
        Ok(self.pop_nearest())
    }

    fn insert(&mut self, facet: u32, point: Vector6<f64>, worth: f64) -> Result<(), Stuck> {
        self.insert(facet, point, worth)
    }
}

/// Memory of a search.
#[derive(Debug, Clone, Default)]
pub(super) struct Hulls {
    /// Only the facets that matter; left out when `None`.
    pub(super) polar: Option<Polar>,
    /// All facets: slower, but it takes any body.
    pub(super) polytope: Polytope,
    pub(super) witness: Witness,
}

/// Brackets the distance from the origin to the boundary of the set whose support function is `farthest` and whose
/// points are not longer than `bound`. `inside` is any guess at a point of the set.
pub(super) fn bracket(
    hulls: &mut Hulls,
    inside: &Vector6<f64>,
    bound: f64,
    goal: &Goal,
    farthest: impl FnMut(&Vector6<f64>) -> Vector6<f64>,
) -> (Stop, Bracket) {
    let nothing =
        Bracket { low: f64::NEG_INFINITY, high: f64::INFINITY, direction: Vector6::x(), queries: 0 };
    let mut probe =
        Probe { farthest, bracket: nothing, floor: floor(bound), reject_below: goal.reject_below };
    let Hulls { polar, polytope, witness } = hulls;
    witness.facet = None;
    let Start { simplex, directions } = match grow_simplex(&mut probe, inside) {
        Ok(found) => found,
        Err(stop) => return (stop, probe.bracket),
    };
    witness.start(&directions);
    let near = polar.as_mut().and_then(|polar| {
        polar
            .start(&simplex, bound, TIE * bound)
            .and_then(|()| expand(polar, &mut probe, bound, goal, witness))
            .ok()
    });
    let stop = near.unwrap_or_else(|| {
        witness.start(&directions);
        let whole = polytope.start(&simplex, TIE * bound);
        let stop = whole.and_then(|()| expand(polytope, &mut probe, bound, goal, witness));
        polytope.release_excess();
        stop.unwrap_or(Stop::Unfinished)
    });
    (stop, probe.bracket)
}

/// Seven points of the set that span space, and the directions in which they are the farthest.
struct Start {
    simplex: [Vector6<f64>; 7],
    directions: [Vector6<f64>; 7],
}

/// Finds the points to start with, unless a direction was met in which it reaches too little.
///
/// Each query goes from the span so far towards the origin, as GJK does; when the origin is in the span, it goes along any
/// direction that is not. A flat set needs no test of its own: it cannot reach past the origin on both sides.
fn grow_simplex<F>(probe: &mut Probe<F>, inside: &Vector6<f64>) -> Result<Start, Stop>
where
    F: FnMut(&Vector6<f64>) -> Vector6<f64>,
{
    let towards = (-inside).try_normalize(0.0).unwrap_or_else(Vector6::x);
    let first = probe.ask(&towards);
    if let Some(stop) = probe.refusal() {
        return Err(stop);
    }
    let (mut simplex, mut directions) = ([first; 7], [towards; 7]);
    let mut span: [Vector6<f64>; 6] = [Vector6::zeros(); 6];
    for known in 0..6 {
        let axes = &span[..known];
        let off_span = without(&first, axes);
        let mut direction = if off_span.norm() > 2.0 * probe.floor {
            without(&-off_span.normalize(), axes).normalize()
        } else {
            any_across(axes)
        };
        let mut point = probe.ask(&direction);
        let reach = |point: &Vector6<f64>| (point - first).dot(&direction);
        if probe.refusal().is_none() && reach(&point) <= probe.floor {
            direction = -direction;
            point = probe.ask(&direction);
        }
        if let Some(stop) = probe.refusal() {
            return Err(stop);
        }
        (simplex[known + 1], directions[known + 1]) = (point, direction);
        span[known] = without(&without(&(point - first), axes), axes).normalize();
    }
    Ok(Start { simplex, directions })
}

/// The part of a vector across the span of orthonormal axes.
fn without(vector: &Vector6<f64>, axes: &[Vector6<f64>]) -> Vector6<f64> {
    axes.iter().fold(*vector, |rest, axis| rest - axis * axis.dot(&rest))
}

/// A unit vector across the span of fewer than six orthonormal axes: from the coordinate axis farthest out of the span.
fn any_across(axes: &[Vector6<f64>]) -> Vector6<f64> {
    let across = |k: usize| without(&Vector6::ith(k, 1.0), axes);
    let best = (1..6).map(across).fold(across(0), |a, b| if b.norm() > a.norm() { b } else { a });
    without(&best.normalize(), axes).normalize()
}

fn expand<I: Inner, F>(
    inner: &mut I,
    probe: &mut Probe<F>,
    bound: f64,
    goal: &Goal,
    witness: &mut Witness,
) -> Result<Stop, Stuck>
where
    F: FnMut(&Vector6<f64>) -> Vector6<f64>,
{
    loop {
        let nearest = inner.pop_nearest(witness.worth(probe.bracket.high))?;
        if nearest.is_none() && !I::MEETS {
            return Err(Stuck);
        }
        // Facets as far out as the upper bound do not count: when no other is left, the bounds have met.
        let low = nearest.map_or(probe.bracket.high, |facet| facet.low);
        probe.bracket.low = low.max(probe.bracket.low).min(probe.bracket.high);
        let mut stop = verdict(probe, bound, goal);
        let Some(nearest) = nearest else { return Ok(stop.unwrap_or(Stop::Unfinished)) };
        if stop.is_none() {
            if probe.bracket.queries >= goal.max_queries {
                return Ok(Stop::Unfinished);
            }
            let point = probe.ask(&nearest.normal);
            stop = verdict(probe, bound, goal);
            if stop.is_none() {
                inner.insert(nearest.facet, point, witness.worth(probe.bracket.high))?;
                witness.note(&nearest.normal);
            }
        }
        if let Some(stop) = stop {
            if witness.is_wanted && stop == Stop::Inside {
                let corners = inner.corners(nearest.facet);
                let directions = corners.map(|corner| witness.directions[corner]);
                let is_only = is_only(inner, probe, &nearest.normal, witness);
                witness.facet = Some(Facet { directions, normal: nearest.normal, is_only });
            }
            return Ok(stop);
        }
    }
}

/// Looks for another direction in which the set reaches as little as along `normal`. When it cannot be told, there may
/// be one.
fn is_only<F>(inner: &mut impl Inner, probe: &mut Probe<F>, normal: &Vector6<f64>, witness: &Witness) -> bool
where
    F: FnMut(&Vector6<f64>) -> Vector6<f64>,
{
    let worth = witness.worth(probe.bracket.high);
    let mut others = 0;
    while others < MAX_OTHERS {
        let other = match inner.pop_nearest(worth) {
            Ok(Some(facet)) if facet.low < worth => facet,
            Ok(_) => return true,
            Err(Stuck) => return false,
        };
        if other.normal.dot(normal) > CLOSE {
            continue;
        }
        others += 1;
        let point = (probe.farthest)(&other.normal);
        if point.dot(&other.normal) < worth || inner.insert(other.facet, point, worth).is_err() {
            return false;
        }
    }
    false
}

fn verdict<F>(probe: &Probe<F>, bound: f64, goal: &Goal) -> Option<Stop>
where
    F: FnMut(&Vector6<f64>) -> Vector6<f64>,
{
    let Bracket { low, high, .. } = probe.bracket;
    let narrow = low > 0.0 && high - low <= (goal.tolerance * high).max(GAP * bound);
    let enough = low > 0.0 && goal.accept_above.is_some_and(|enough| low >= enough);
    let accepted = || if narrow { Some(Stop::Inside) } else { enough.then_some(Stop::Above) };
    probe.refusal().or_else(accepted)
}
