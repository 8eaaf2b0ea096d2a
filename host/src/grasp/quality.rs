//! The quality of a grasp: Ferrari and Canny's epsilon, or the proof that there is none.
//!
//! A grasp is force-closed when its fingers can balance any wrench. Epsilon is the radius of the largest ball about the
//! origin of wrench space inside the set of wrenches that the fingers exert with bounded effort (C. Ferrari and J. Canny,
//! "Planning optimal grasps", ICRA 1992): the disturbance that they withstand in the worst direction.

use std::fmt;

use nalgebra::Vector6;

use super::contact::Contact;
use super::expand::{self, Bracket, Goal, Hulls, Stop};
use super::friction::ConeModel;
use super::polar::Polar;
use super::wrench::{GraspMap, WrenchReference};

/// What bounds the effort of the fingers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Norm {
    /// Normal forces that sum to one: epsilon is a fraction of the total normal force.
    #[default]
    L1,
    /// Every normal force at most its contact's `max_force_n`: epsilon is in newtons.
    LInf,
}

/// What has unit length in a friction cone.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum ForceNorm {
    /// The normal component: `GraspIt!` and this project.
    #[default]
    Normal,
    /// The edge of the cone, so that a contact counts `1 / sqrt(1 + friction^2)` of the other convention: `FRoGGeR`. The
    /// exact cone is here the limit of the pyramids, without the cap of unit forces that bulges beyond its rim.
    Edge,
}

impl ForceNorm {
    /// The normal force that a contact with this friction exerts per unit.
    pub(super) fn unit(self, friction: f64) -> f64 {
        match self {
            Self::Normal => 1.0,
            Self::Edge => 1.0 / friction.hypot(1.0),
        }
    }
}

/// How to measure. The default is `GraspIt!`'s convention with the exact cone, to a millionth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Shape of the friction cones.
    pub cone: ConeModel,
    /// What bounds the effort.
    pub norm: Norm,
    /// What has unit length in a cone.
    pub force_norm: ForceNorm,
    /// Gap between the bounds on epsilon, relative to the upper one, at which the search is done. 1 asks only whether
    /// there is closure; 0 (or anything that is no number above it) asks for all the digits that there are.
    pub tolerance: f64,
    /// Support queries after which the search gives up with [`Closure::Unfinished`].
    ///
    /// A common grasp takes 15 to 60. Where the wrenches are as round as a ball, as with contacts spread evenly around a
    /// sphere or a cube, the exact cone takes some hundreds, and each costs a hundred times as much: 1e-3 is found in
    /// 10 ms, 1e-6 in 150 ms. Two soft fingers exactly opposite each other are the worst: as good all around their line,
    /// they take 30 ms for 1e-3 and end at 2e-4 with [`Closure::Unfinished`], out of facets. A planner does well with a
    /// tolerance of 1e-3.
    pub max_iterations: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            cone: ConeModel::Exact,
            norm: Norm::L1,
            force_norm: ForceNorm::Normal,
            tolerance: 1e-6,
            max_iterations: 4000,
        }
    }
}

/// How good a grasp is, bracketed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quality {
    /// Epsilon is at least this: a ball so large lies inside a polytope of wrenches that the fingers exert.
    pub epsilon_low: f64,
    /// Epsilon is at most this: how far the fingers' wrenches reach along `weakest_wrench`.
    pub epsilon_high: f64,
    /// Unit wrench, force then torque / scale, that the fingers exert least of. The disturbance that is hardest to
    /// withstand is its opposite.
    pub weakest_wrench: Vector6<f64>,
    /// Support queries made.
    pub iterations: usize,
}

impl Quality {
    /// The number to report and to rank by: the lower bound, so that no grasp looks better than it is.
    #[must_use]
    pub fn epsilon(&self) -> f64 {
        self.epsilon_low
    }

    fn of(bracket: &Bracket) -> Self {
        Self {
            epsilon_low: bracket.low.max(0.0),
            epsilon_high: bracket.high,
            weakest_wrench: bracket.direction,
            iterations: bracket.queries,
        }
    }
}

/// Why a grasp is not force-closed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum NoClosure {
    /// There is no contact.
    NoContacts,
    /// All wrenches of the fingers lie on one side: some disturbance is not withstood at all.
    Separated,
    /// The wrenches do not span space: nothing is exerted along the direction, either way. So it is with one or two hard
    /// contacts, with hard contacts in a line, and without friction on a body of revolution.
    Flat,
    /// The origin is on the boundary of the wrenches, to within rounding: the fingers balance the disturbance along the
    /// direction at best, and push against it never.
    Boundary,
}

impl fmt::Display for NoClosure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NoContacts => "there is no contact",
            Self::Separated => "all contact wrenches are on one side",
            Self::Flat => "the contact wrenches do not span all directions",
            Self::Boundary => "the contact wrenches reach the origin but not around it",
        })
    }
}

/// The proof that a grasp is not force-closed: a direction along which no contact can exert anything.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Separation {
    /// Unit wrench, force then torque / scale, that the fingers cannot exert.
    pub direction: Vector6<f64>,
    /// How far, at least, the wrench of every unit normal force is behind the plane across `direction`; 0 when the plane
    /// touches (and at least minus the rounding error then).
    pub margin: f64,
    /// What kind of failure it is.
    pub reason: NoClosure,
    /// Support queries made.
    pub iterations: usize,
}

impl Separation {
    /// Checks the proof without trust in the search: no contact reaches along the direction. Rounding is allowed 1e-11
    /// of the longest wrench.
    #[must_use]
    pub fn verify(&self, contacts: &[Contact], reference: &WrenchReference, settings: &Settings) -> bool {
        let map = GraspMap::new(contacts, reference, settings.cone, settings.force_norm);
        (self.direction.norm() - 1.0).abs() < 1e-9
            && map
                .reach(&self.direction, Norm::L1)
                .is_none_or(|reach| reach <= expand::floor(map.bound(Norm::L1)))
    }
}

/// What an evaluation finds.
#[derive(Debug, Clone, Copy, PartialEq)]
#[must_use]
pub enum Closure {
    /// Force closure, with epsilon to the tolerance.
    Force(Quality),
    /// No force closure, with the proof. An epsilon below 1e-11 of the longest wrench counts as none: the digits of the
    /// wrenches cannot tell.
    None(Separation),
    /// Epsilon is below [`Limits::reject_below`], if there is closure at all; it was not looked at further.
    Below(Quality),
    /// Force closure, with an epsilon of at least [`Limits::accept_above`]; it was not looked at further.
    Above(Quality),
    /// Iterations, facets or digits ran out. The bracket holds; closure is certain exactly when its lower bound is
    /// positive.
    Unfinished(Quality),
}

impl Closure {
    /// The bracket of a grasp that is certainly force-closed, finished or not.
    #[must_use]
    pub fn quality(&self) -> Option<&Quality> {
        match self {
            Self::Force(quality)
            | Self::Below(quality)
            | Self::Above(quality)
            | Self::Unfinished(quality) => (quality.epsilon_low > 0.0).then_some(quality),
            Self::None(_) => None,
        }
    }
}

/// What is enough to know about an epsilon, in its unit. The default asks for the number itself.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Limits {
    /// Epsilons below this one are not measured any further: [`Closure::Below`].
    pub reject_below: Option<f64>,
    /// Epsilons that are certainly at least this one are not measured any further: [`Closure::Above`].
    pub accept_above: Option<f64>,
}

impl Limits {
    /// Whether epsilon is at least `threshold`, and no more than that: the cheapest answer. It is
    /// [`Closure::Above`] or [`Closure::Below`], [`Closure::None`] without closure, and [`Closure::Force`] only when the
    /// tolerance was met first, with the threshold between the bounds or next to them.
    #[must_use]
    pub fn at(threshold: f64) -> Self {
        Self { reject_below: Some(threshold), accept_above: Some(threshold) }
    }
}

/// Memory of an evaluation, at most some megabytes between evaluations. One that is kept, one per thread, makes later
/// evaluations free of allocation, but for those whose wrenches are as round as a ball.
#[derive(Debug, Clone)]
pub struct Workspace {
    pub(super) map: GraspMap,
    pub(super) hulls: Hulls,
}

impl Workspace {
    /// An empty one.
    #[must_use]
    pub fn new() -> Self {
        let hulls = Hulls { polar: Some(Polar::default()), ..Hulls::default() };
        Self { map: GraspMap::empty(), hulls }
    }

    /// One that has all evaluations done by the whole expanding polytope, as otherwise only the few that need it: for
    /// comparison. It finds the same and takes longer.
    #[must_use]
    pub fn whole_polytope() -> Self {
        Self { map: GraspMap::empty(), hulls: Hulls::default() }
    }
}

impl Default for Workspace {
    fn default() -> Self {
        Self::new()
    }
}

/// Measures a grasp.
///
/// Never fails: contacts and reference are valid by construction, and a degenerate grasp is an outcome like any other.
pub fn evaluate(
    contacts: &[Contact],
    reference: &WrenchReference,
    settings: &Settings,
    workspace: &mut Workspace,
) -> Closure {
    evaluate_within(contacts, reference, settings, &Limits::default(), workspace)
}

/// Measures a grasp as long as it may be as good as `floor` (in the unit of epsilon), and stops with
/// [`Closure::Below`] as soon as it cannot.
///
/// With the best epsilon so far as floor, this finds the best of many grasps for little more than the cost of their
/// closure tests.
pub fn evaluate_above(
    contacts: &[Contact],
    reference: &WrenchReference,
    settings: &Settings,
    floor: f64,
    workspace: &mut Workspace,
) -> Closure {
    let limits = Limits { reject_below: Some(floor), accept_above: None };
    evaluate_within(contacts, reference, settings, &limits, workspace)
}

/// Measures a grasp as far as `limits` need it, and stops with [`Closure::Below`] or [`Closure::Above`] as soon as the
/// bracket is beyond one of them.
pub fn evaluate_within(
    contacts: &[Contact],
    reference: &WrenchReference,
    settings: &Settings,
    limits: &Limits,
    workspace: &mut Workspace,
) -> Closure {
    workspace.map.assign(contacts, reference, settings.cone, settings.force_norm);
    search(settings, limits, workspace)
}

/// Measures the grasp whose map the workspace has.
pub(super) fn search(settings: &Settings, limits: &Limits, workspace: &mut Workspace) -> Closure {
    let Workspace { map, hulls } = workspace;
    if map.bases().is_empty() {
        let direction = Vector6::x();
        return Closure::None(Separation {
            direction,
            margin: 0.0,
            reason: NoClosure::NoContacts,
            iterations: 0,
        });
    }
    let inside = map.mean_normal_wrench();
    let mut bracket = |norm: Norm, goal: &Goal| {
        expand::bracket(hulls, &inside, map.bound(norm), goal, |u| map.farthest(u, norm))
    };
    let mut spent = 0;
    if settings.norm == Norm::LInf {
        // The set of L-infinity contains the origin always, on its boundary when there is no closure, and the way to
        // the boundary is long. The set of L1 is apart from the origin then, and a few queries show it.
        let closure = Goal {
            tolerance: 1.0,
            reject_below: None,
            accept_above: None,
            max_queries: settings.max_iterations,
        };
        let (stop, found) = bracket(Norm::L1, &closure);
        spent = found.queries;
        match stop {
            Stop::Inside => {}
            Stop::Outside => return Closure::None(separation(map, &found)),
            Stop::Below | Stop::Above | Stop::Unfinished => {
                let high = map.reach(&found.direction, Norm::LInf).unwrap_or(0.0);
                return Closure::Unfinished(Quality::of(&Bracket { low: 0.0, high, ..found }));
            }
        }
    }
    let goal = Goal {
        tolerance: settings.tolerance,
        reject_below: limits.reject_below,
        accept_above: limits.accept_above,
        max_queries: settings.max_iterations.saturating_sub(spent),
    };
    let (stop, mut found) = bracket(settings.norm, &goal);
    found.queries += spent;
    match stop {
        Stop::Inside => Closure::Force(Quality::of(&found)),
        Stop::Outside if settings.norm == Norm::L1 => Closure::None(separation(map, &found)),
        Stop::Below => Closure::Below(Quality::of(&found)),
        Stop::Above => Closure::Above(Quality::of(&found)),
        // With force limits so far apart that the smaller ones drown in rounding, there is closure but no number.
        Stop::Outside | Stop::Unfinished => Closure::Unfinished(Quality::of(&found)),
    }
}

fn separation(map: &GraspMap, found: &Bracket) -> Separation {
    let direction = found.direction;
    let reach = |direction: &Vector6<f64>| map.reach(direction, Norm::L1).unwrap_or(0.0);
    let floor = expand::floor(map.bound(Norm::L1));
    let margin = -reach(&direction);
    let reason = if margin > floor {
        NoClosure::Separated
    } else if reach(&-direction) <= floor {
        NoClosure::Flat
    } else {
        NoClosure::Boundary
    };
    Separation { direction, margin, reason, iterations: found.queries }
}
