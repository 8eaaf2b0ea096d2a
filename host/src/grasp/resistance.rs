//! How much of one given wrench a grasp withstands, and with which contact forces.
//!
//! The wrench set of the grasp, with the origin added (fingers may push less), is left along a ray. Where, is found by the
//! simplex method with columns made on demand (G. Dantzig and P. Wolfe, "Decomposition principle for linear programs",
//! Operations Research 8(1), 1960): the six wrenches of a basis span a plane that the ray pierces at a distance which the
//! grasp attains; the support function across that plane gives an upper bound and the wrench that enters the basis. In
//! the words of collision detection it is a ray cast by portals. Nothing is allocated.
//!
//! The first basis is six wrenches that no finger exerts. The first phase replaces them as far as the ray needs them, or
//! proves that the set does not reach along the ray. They are so small that what is left of them in the second phase
//! counts as rounding: a flat set, as that of two hard fingers, needs no treatment of its own.

use nalgebra::{Matrix6, Vector3, Vector6};
use thiserror::Error;

use super::contact::Contact;
use super::expand;
use super::quality::{Norm, Settings, Workspace};
use super::wrench::{GraspMap, WrenchBasis, WrenchReference};

/// Length of the wrenches of the first basis, as a fraction of the bound of the set.
const SEED: f64 = 1e-7;
/// Distances below this fraction of the bound are none.
const NOTHING: f64 = 1e-6;
/// The part of the ray, a unit long, that the seeds may make in the second phase.
const REACHED: f64 = 1e-11;
/// Wrenches that remain unbalanced, as a fraction of the bound of the set.
const MAX_RESIDUAL: f64 = 1e-9;
/// Relative gap that cannot be closed any further in a flat set.
const DIGITS: f64 = 1e-7;
/// The ray is turned by this much where it would meet an edge of the first basis.
const TURN: f64 = 1e-15;
/// Coefficients of a wrench in a basis that count as none.
const PIVOT: f64 = 1e-11;
/// Pivots after which the inverse is made anew.
const REFRESH: usize = 12;

/// Why numbers are not a disturbance.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
#[error("wrench {0:?} is not six numbers up to 1e9, one of them not 0")]
pub struct DisturbanceError(pub [f64; 6]);

/// A wrench that acts on the object from outside.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Disturbance {
    force_n: Vector3<f64>,
    torque_nm: Vector3<f64>,
}

impl Disturbance {
    /// Force in newtons and torque about the centre of mass in newton metres, object frame.
    pub fn new(force_n: Vector3<f64>, torque_nm: Vector3<f64>) -> Result<Self, DisturbanceError> {
        let (f, t) = (force_n, torque_nm);
        let largest = f.amax().max(t.amax());
        let numbers = f.iter().chain(t.iter());
        if (1e-100..=1e9).contains(&largest) && !numbers.copied().any(f64::is_nan) {
            Ok(Self { force_n, torque_nm })
        } else {
            Err(DisturbanceError([f.x, f.y, f.z, t.x, t.y, t.z]))
        }
    }

    /// Newtons, object frame.
    #[must_use]
    pub fn force_n(&self) -> Vector3<f64> {
        self.force_n
    }

    /// Newton metres about the centre of mass, object frame.
    #[must_use]
    pub fn torque_nm(&self) -> Vector3<f64> {
        self.torque_nm
    }

    /// What the fingers have to exert against it: force, torque / scale.
    fn opposite(&self, reference: &WrenchReference) -> Vector6<f64> {
        let (f, t) = (-self.force_n, -self.torque_nm / reference.torque_scale_m());
        Vector6::new(f.x, f.y, f.z, t.x, t.y, t.z)
    }
}

/// What a finger does at its contact.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ContactForce {
    /// Force of the finger on the object, newtons, object frame.
    pub force_n: Vector3<f64>,
    /// Moment about the inward normal, newton metres; 0 at a hard contact.
    pub torsion_nm: f64,
}

/// How much of a disturbance a grasp balances.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Balance {
    /// At least so many times the disturbance is balanced: [`Norm::L1`] with normal forces that sum to 1 N, so that the
    /// disturbance itself takes `1 / factor_low` newtons; [`Norm::LInf`] with each within its limit.
    pub factor_low: f64,
    /// At most so many times.
    pub factor_high: f64,
    /// The proof of that, a unit wrench `u`, force then torque / scale: no wrench of the fingers reaches farther along
    /// it than `factor_high` times the opposite of the disturbance does.
    pub limiting_wrench: Vector6<f64>,
    /// What the contact forces leave unbalanced of `factor_low` times the disturbance, force and torque / scale, newtons.
    pub residual_n: f64,
    /// Support queries made.
    pub iterations: usize,
    /// Shares of the wrenches that balance, and the directions in which those are the farthest.
    shares: [(f64, Vector6<f64>); 6],
}

impl Balance {
    /// The contact forces that balance `factor_low` times the disturbance, in the order of the contacts.
    ///
    /// Takes the grasp that was asked about. The check is one product: `grasp matrix * forces = - factor_low * wrench`.
    #[must_use]
    pub fn contact_forces(
        &self,
        contacts: &[Contact],
        reference: &WrenchReference,
        settings: &Settings,
    ) -> Vec<ContactForce> {
        let map = GraspMap::new(contacts, reference, settings.cone, settings.force_norm);
        let mut forces = vec![ContactForce::default(); contacts.len()];
        for (share, direction) in self.shares.iter().filter(|(share, _)| *share > 0.0) {
            map.parts(direction, settings.norm, |part| {
                let contact = &contacts[part.contact];
                let (force, torsion) = WrenchBasis::push(contact, settings.force_norm, &part.friction);
                forces[part.contact].force_n += force * (share * part.force);
                forces[part.contact].torsion_nm += torsion * (share * part.force);
            });
        }
        forces
    }
}

/// The proof that nothing of a disturbance is balanced.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unbalanced {
    /// Unit wrench, force then torque / scale, along which no finger pushes (to a millionth of the longest wrench), but
    /// the opposite of the disturbance does.
    pub direction: Vector6<f64>,
    /// How far the fingers reach along it, newtons.
    pub reach_n: f64,
    /// Support queries made.
    pub iterations: usize,
}

/// What a grasp does against a disturbance.
#[derive(Debug, Clone, Copy, PartialEq)]
#[must_use]
pub enum Resistance {
    /// It balances this much of it, to the tolerance (or 1e-7, whichever is more).
    Balanced(Balance),
    /// It balances no more of it than rounding.
    None(Unbalanced),
    /// Iterations or digits ran out; the bounds hold.
    Unfinished(Balance),
}

/// A wrench of the basis; `None` for one of the first six.
type Column = Option<Vector6<f64>>;

/// Six wrenches that the ray pierces the plane of.
struct Basis {
    wrenches: Matrix6<f64>,
    inverse: Matrix6<f64>,
    /// The ray in the basis: not negative.
    coefficients: Vector6<f64>,
    ray: Vector6<f64>,
    columns: [Column; 6],
    pivots: usize,
}

impl Basis {
    fn new(ray: &Vector6<f64>, seed: f64) -> Self {
        let least = |k: usize| TURN * (1.0 + k as f64);
        let turned =
            Vector6::from_fn(|k, _| if ray[k].abs() > least(k) { ray[k] } else { least(k).copysign(ray[k]) });
        let signs = turned.map(f64::signum);
        Self {
            wrenches: Matrix6::from_diagonal(&(signs * seed)),
            inverse: Matrix6::from_diagonal(&(signs / seed)),
            coefficients: turned.abs() / seed,
            ray: turned,
            columns: [None; 6],
            pivots: 0,
        }
    }

    /// How far along the ray the plane is.
    fn distance(&self) -> f64 {
        1.0 / self.coefficients.sum()
    }

    /// How much of the ray, a unit long, is still made by the first basis.
    fn of_seeds(&self) -> f64 {
        self.seeds().map(|k| self.coefficients[k].max(0.0) * self.wrenches.column(k).norm()).sum()
    }

    fn seeds(&self) -> impl Iterator<Item = usize> {
        (0..6).filter(|&k| self.columns[k].is_none())
    }

    /// Product 1 with all of the basis: across its plane.
    fn normal(&self) -> Vector6<f64> {
        self.inverse.row_sum().transpose()
    }

    /// Product 1 with what is left of the first basis and 0 with the others.
    fn normal_of_seeds(&self) -> Vector6<f64> {
        self.seeds().fold(Vector6::zeros(), |sum, k| sum + self.inverse.row(k).transpose())
    }

    /// Puts a wrench from beyond the plane into the basis, in place of the one that keeps the ray inside. `None` when
    /// rounding has spoilt the basis.
    fn enter(&mut self, wrench: &Vector6<f64>, direction: &Vector6<f64>) -> Option<()> {
        let along = self.inverse * wrench;
        let floor = PIVOT * along.amax();
        let ratio = |k: usize| self.coefficients[k].max(0.0) / along[k];
        let leaving = (0..6).filter(|&k| along[k] > floor).min_by(|&a, &b| ratio(a).total_cmp(&ratio(b)))?;
        let seed_leaves = self.columns[leaving].is_none();
        self.wrenches.set_column(leaving, wrench);
        self.columns[leaving] = Some(*direction);
        self.pivots += 1;
        if seed_leaves || self.pivots.is_multiple_of(REFRESH) {
            return self.refresh();
        }
        let row = self.inverse.row(leaving) / along[leaving];
        let step = self.coefficients[leaving] / along[leaving];
        for k in (0..6).filter(|&k| k != leaving) {
            let less = row * along[k];
            let mut kept = self.inverse.row_mut(k);
            kept -= less;
            self.coefficients[k] -= along[k] * step;
        }
        self.inverse.set_row(leaving, &row);
        self.coefficients[leaving] = step;
        Some(())
    }

    fn refresh(&mut self) -> Option<()> {
        self.inverse = self.wrenches.try_inverse()?;
        self.coefficients = self.inverse * self.ray;
        Some(())
    }
}

/// Finds how many times a disturbance a grasp can balance.
///
/// With normal forces that sum to at most one newton ([`Norm::L1`]) or are within each contact's limit ([`Norm::LInf`]).
/// The grasp need not be force-closed. `settings` are those of epsilon; the tolerance is the relative gap of the bounds.
pub fn resist(
    contacts: &[Contact],
    reference: &WrenchReference,
    settings: &Settings,
    disturbance: &Disturbance,
    workspace: &mut Workspace,
) -> Resistance {
    let opposite = disturbance.opposite(reference);
    let length = opposite.norm();
    let ray = opposite / length;
    let map = &mut workspace.map;
    map.assign(contacts, reference, settings.cone, settings.force_norm);
    let bound = map.bound(settings.norm);
    if bound == 0.0 {
        return Resistance::None(Unbalanced { direction: ray, reach_n: 0.0, iterations: 0 });
    }
    let mut basis = Basis::new(&ray, SEED * bound);
    let (mut high, mut limiting, mut reach_n) = (f64::INFINITY, ray, f64::INFINITY);
    let (mut iterations, mut is_reached) = (0, false);
    let is_finished = loop {
        if iterations >= settings.max_iterations {
            break false;
        }
        is_reached = is_reached || basis.of_seeds() <= REACHED;
        let normal = if is_reached { basis.normal() } else { basis.normal_of_seeds() };
        let direction = normal.normalize();
        let farthest = map.farthest(&direction, settings.norm);
        iterations += 1;
        let reach = farthest.dot(&direction).max(0.0);
        let along = direction.dot(&ray);
        // What rounding makes of the reach counts as reach.
        let most = (reach + f64::EPSILON * bound) / along;
        if along > 0.0 && most < high {
            (high, limiting, reach_n) = (most, direction, reach);
        }
        let low = if is_reached { basis.distance() } else { 0.0 };
        let gap = high - low;
        if gap <= settings.tolerance.max(DIGITS / 10.0) * high || high <= NOTHING * bound {
            break true;
        }
        let is_beyond = if is_reached { reach * normal.norm() > 1.0 } else { reach > 0.0 };
        if !is_beyond || basis.enter(&farthest, &direction).is_none() {
            break gap <= DIGITS * high;
        }
    };
    if high <= NOTHING * bound {
        return Resistance::None(Unbalanced { direction: limiting, reach_n, iterations });
    }
    let found = balance(&basis, map, settings.norm, &ray);
    let mut factor_low = found.distance / length;
    if found.residual > MAX_RESIDUAL * bound {
        factor_low = 0.0;
    }
    let found = Balance {
        factor_low,
        factor_high: (high / length).max(factor_low),
        limiting_wrench: limiting,
        residual_n: if factor_low > 0.0 { found.residual } else { 0.0 },
        iterations,
        shares: if factor_low > 0.0 { found.shares } else { [(0.0, Vector6::zeros()); 6] },
    };
    if is_finished && factor_low > 0.0 { Resistance::Balanced(found) } else { Resistance::Unfinished(found) }
}

struct Found {
    distance: f64,
    residual: f64,
    shares: [(f64, Vector6<f64>); 6],
}

/// The share of each wrench of the basis in the point where the ray leaves, without the seeds, and what is then missing.
fn balance(basis: &Basis, map: &GraspMap, norm: Norm, ray: &Vector6<f64>) -> Found {
    let distance = basis.distance();
    let mut shares = [(0.0, Vector6::zeros()); 6];
    let mut sum = Vector6::zeros();
    for ((share, column), coefficient) in shares.iter_mut().zip(&basis.columns).zip(&basis.coefficients) {
        if let Some(direction) = column {
            *share = ((coefficient * distance).max(0.0), *direction);
            sum += map.farthest(direction, norm) * share.0;
        }
    }
    Found { distance, residual: (sum - ray * distance).norm(), shares }
}

impl Unbalanced {
    /// Checks the proof without trust in the search: along the direction the fingers reach no more than a millionth of
    /// their longest wrench, and the opposite of the disturbance is on that side.
    #[must_use]
    pub fn verify(
        &self,
        contacts: &[Contact],
        reference: &WrenchReference,
        settings: &Settings,
        disturbance: &Disturbance,
    ) -> bool {
        let map = GraspMap::new(contacts, reference, settings.cone, settings.force_norm);
        let bound = map.bound(settings.norm);
        let along = self.direction.dot(&disturbance.opposite(reference).normalize());
        let reach = map.reach(&self.direction, settings.norm).unwrap_or(0.0);
        (self.direction.norm() - 1.0).abs() < 1e-9
            && along > 0.0
            && reach <= NOTHING * bound * along + expand::floor(bound)
    }
}
