//! From contacts to wrenches: what the fingers can exert on the object, as a support function.
//!
//! A wrench is `[force; torque / torque_scale_m]`, force first, in the object frame and about the centre of mass. The
//! division makes its six numbers one unit, so that a length in wrench space means something.

use nalgebra::{Matrix6, Matrix6x4, Point3, Unit, Vector3, Vector4, Vector6};
use thiserror::Error;

use super::contact::{Contact, MAX_LENGTH_M};
use super::friction::{ConeModel, FrictionSet};
use super::quality::{ForceNorm, Norm};
use super::support::{Part, Support};

/// Smallest torque scale, metres: keeps the quotient of two lengths finite, squared too.
const MIN_TORQUE_SCALE_M: f64 = 1e-9;

/// Why numbers are not a reference for wrenches.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum WrenchReferenceError {
    /// A coordinate of the centre of mass is NaN, infinite or beyond [`MAX_LENGTH_M`].
    #[error("center_of_mass ({x}, {y}, {z}) has a coordinate that is not a length up to {MAX_LENGTH_M:e} m")]
    CenterOfMass {
        /// First coordinate, metres.
        x: f64,
        /// Second coordinate, metres.
        y: f64,
        /// Third coordinate, metres.
        z: f64,
    },
    /// The torque scale is not a length between 1e-9 m and [`MAX_LENGTH_M`].
    #[error("torque_scale_m {0} is not a length between {MIN_TORQUE_SCALE_M:e} and {MAX_LENGTH_M:e} m")]
    TorqueScale(f64),
}

/// The point that torques are taken about and the length that they are divided by.
///
/// Two epsilons are comparable only when both are equal, which is why every printed number carries them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WrenchReference {
    center_of_mass_in_object: Point3<f64>,
    torque_scale_m: f64,
}

impl WrenchReference {
    /// Checks both.
    pub fn new(
        center_of_mass_in_object: Point3<f64>,
        torque_scale_m: f64,
    ) -> Result<Self, WrenchReferenceError> {
        let Point3 { coords: c } = center_of_mass_in_object;
        if !c.iter().all(|x| x.abs() <= MAX_LENGTH_M) {
            return Err(WrenchReferenceError::CenterOfMass { x: c.x, y: c.y, z: c.z });
        }
        if !(MIN_TORQUE_SCALE_M..=MAX_LENGTH_M).contains(&torque_scale_m) {
            return Err(WrenchReferenceError::TorqueScale(torque_scale_m));
        }
        Ok(Self { center_of_mass_in_object, torque_scale_m })
    }

    /// `GraspIt!`'s choice: the largest distance of a vertex of the object from its centre of mass.
    ///
    /// Errors when all vertices coincide with the centre, or none is given.
    pub fn of_object(
        center_of_mass_in_object: Point3<f64>,
        vertices_in_object: &[Point3<f64>],
    ) -> Result<Self, WrenchReferenceError> {
        let distances = vertices_in_object.iter().map(|v| (v - center_of_mass_in_object).norm());
        Self::new(center_of_mass_in_object, distances.fold(0.0, f64::max))
    }

    /// Where torques are taken about, object frame, metres.
    #[must_use]
    pub fn center_of_mass_in_object(&self) -> Point3<f64> {
        self.center_of_mass_in_object
    }

    /// What torques are divided by, metres.
    #[must_use]
    pub fn torque_scale_m(&self) -> f64 {
        self.torque_scale_m
    }
}

/// The wrenches of one contact: 6 x 4, rows force then torque / scale, columns the unit normal force and the largest
/// friction along the first tangent, along the second, and in torsion.
///
/// The contact exerts `B (1, x, y, z)` per unit of normal force, with `(x, y, z)` in the unit ball.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WrenchBasis(pub Matrix6x4<f64>);

impl WrenchBasis {
    /// Wrenches of a contact about `reference`.
    #[must_use]
    pub fn new(contact: &Contact, reference: &WrenchReference, force_norm: ForceNorm) -> Self {
        let normal = contact.inward_normal_in_object();
        let [first, second] = tangents(&normal);
        let lever =
            (contact.point_in_object() - reference.center_of_mass_in_object) / reference.torque_scale_m;
        let friction = contact.friction();
        let unit = force_norm.unit(friction);
        let pushing = |force: Vector3<f64>| wrench(force, lever.cross(&force));
        let twisting = |torque: Vector3<f64>| wrench(Vector3::zeros(), torque);
        Self(Matrix6x4::from_columns(&[
            pushing(normal.into_inner()) * unit,
            pushing(first) * (unit * friction),
            pushing(second) * (unit * friction),
            twisting(*normal) * (unit * friction * (contact.torsional_m() / reference.torque_scale_m)),
        ]))
    }

    /// Force, and moment about the normal, of a contact per unit of its normal force, with friction from the unit ball;
    /// newtons and newton metres, object frame.
    pub(super) fn push(
        contact: &Contact,
        force_norm: ForceNorm,
        friction: &Vector3<f64>,
    ) -> (Vector3<f64>, f64) {
        let normal = contact.inward_normal_in_object();
        let [first, second] = tangents(&normal);
        let (unit, mu) = (force_norm.unit(contact.friction()), contact.friction());
        let force = normal.into_inner() + (first * friction.x + second * friction.y) * mu;
        (force * unit, unit * mu * contact.torsional_m() * friction.z)
    }

    /// What the contact's normal force and friction do along `direction`: the transpose of the basis times it.
    fn components(&self, direction: &Vector6<f64>) -> (f64, Vector3<f64>) {
        let c: Vector4<f64> = self.0.tr_mul(direction);
        (c[0], Vector3::new(c[1], c[2], c[3]))
    }

    /// No wrench of a unit normal force is longer.
    fn bound(&self) -> f64 {
        self.0.column(0).norm() + self.0.fixed_columns::<3>(1).norm()
    }
}

fn wrench(force: Vector3<f64>, torque: Vector3<f64>) -> Vector6<f64> {
    Vector6::new(force.x, force.y, force.z, torque.x, torque.y, torque.z)
}

/// Two unit tangents that make a right-handed frame with the normal as third axis. The first is `n x X`, or `n x Y` when
/// the normal is near X: pyramids start there, so it is part of their definition.
#[must_use]
pub fn tangents(normal: &Unit<Vector3<f64>>) -> [Vector3<f64>; 2] {
    let first = normal.cross(&first_axis(normal)).normalize();
    [first, normal.cross(&first)]
}

/// The axis that the first tangent is across.
pub(super) fn first_axis(normal: &Unit<Vector3<f64>>) -> Vector3<f64> {
    if normal.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() }
}

/// The wrenches that a grasp can exert, as the support function of a convex set: how far it reaches in a direction, and
/// which wrench reaches there.
///
/// With `h_i(u)` the farthest that a unit normal force at contact `i` reaches along `u`, which has a closed form, the
/// set with normal forces that sum to one ([`Norm::L1`]) reaches `max_i h_i(u)`, and the set with normal forces up to
/// each finger's limit `F_i` ([`Norm::LInf`]) reaches `sum_i F_i max(0, h_i(u))`. A query costs O(contacts), whatever
/// the number of edges.
#[derive(Debug, Clone)]
pub struct GraspMap {
    bases: Vec<WrenchBasis>,
    limits_n: Vec<f64>,
    friction: FrictionSet,
    support: Support,
}

impl GraspMap {
    pub(super) fn empty() -> Self {
        Self {
            bases: Vec::new(),
            limits_n: Vec::new(),
            friction: FrictionSet::new(ConeModel::Exact),
            support: Support::default(),
        }
    }

    /// The map of a set of contacts.
    #[must_use]
    pub fn new(
        contacts: &[Contact],
        reference: &WrenchReference,
        cone: ConeModel,
        force_norm: ForceNorm,
    ) -> Self {
        let mut map = Self::empty();
        map.assign(contacts, reference, cone, force_norm);
        map
    }

    /// Becomes the map of other contacts, in the memory that it has.
    pub(super) fn assign(
        &mut self,
        contacts: &[Contact],
        reference: &WrenchReference,
        cone: ConeModel,
        force_norm: ForceNorm,
    ) {
        self.friction.set_model(cone);
        self.bases.clear();
        self.bases.extend(contacts.iter().map(|c| WrenchBasis::new(c, reference, force_norm)));
        self.limits_n.clear();
        self.limits_n.extend(contacts.iter().map(Contact::max_force_n));
        self.support.assign(&self.bases, &self.limits_n);
    }

    /// Takes every wrench through a linear map.
    pub(super) fn transform(&mut self, map: &Matrix6<f64>) {
        for basis in &mut self.bases {
            basis.0 = map * basis.0;
        }
        self.support.assign(&self.bases, &self.limits_n);
    }

    /// One basis per contact, in their order.
    #[must_use]
    pub fn bases(&self) -> &[WrenchBasis] {
        &self.bases
    }

    /// How far the set reaches along `direction`. `None` without contacts: the set is then empty.
    #[must_use]
    pub fn reach(&self, direction: &Vector6<f64>, norm: Norm) -> Option<f64> {
        let each = self.bases.iter().map(|basis| self.reach_of(basis, direction));
        match norm {
            Norm::L1 => each.reduce(f64::max),
            Norm::LInf => (!self.bases.is_empty())
                .then(|| each.zip(&self.limits_n).map(|(reach, limit)| limit * reach.max(0.0)).sum()),
        }
    }

    /// The wrench of the set that reaches farthest along `direction`; zero without contacts.
    #[must_use]
    pub fn farthest(&self, direction: &Vector6<f64>, norm: Norm) -> Vector6<f64> {
        self.support.farthest(direction, norm, &self.friction)
    }

    /// Tells which contacts make up the wrench that [`GraspMap::farthest`] finds, and with what.
    pub(super) fn parts(&self, direction: &Vector6<f64>, norm: Norm, tell: impl FnMut(Part)) {
        self.support.parts(direction, norm, &self.friction, tell);
    }

    /// A length that no wrench of the set exceeds: the measure of what rounding can do.
    #[must_use]
    pub fn bound(&self, norm: Norm) -> f64 {
        let each = self.bases.iter().map(WrenchBasis::bound);
        match norm {
            Norm::L1 => each.fold(0.0, f64::max),
            Norm::LInf => each.zip(&self.limits_n).map(|(bound, limit)| bound * limit).sum(),
        }
    }

    /// Whether only one combination of contact forces makes the wrenches that reach farthest along `direction`, to within
    /// `slack`: whether what the contacts give to them is independent.
    pub(super) fn is_unique(&self, direction: &Vector6<f64>, norm: Norm, slack: f64) -> bool {
        let most = self.bases.iter().map(|basis| self.reach_of(basis, direction)).fold(f64::MIN, f64::max);
        let (mut all, mut apart) = (Span::default(), 0);
        for basis in &self.bases {
            let reach = self.reach_of(basis, direction);
            // What may be added to or taken from what this contact does.
            let (is_free, is_pushing) = match norm {
                Norm::L1 => (reach >= most - slack, false),
                Norm::LInf => (reach.abs() <= slack, reach > slack),
            };
            if !(is_free || is_pushing) {
                continue;
            }
            let (_, friction) = basis.components(direction);
            let at = self.friction.farthest(&friction);
            let mut own = Span::default();
            if is_free {
                let farthest = basis.0 * Vector4::new(1.0, at.x, at.y, at.z);
                own.add(&farthest);
                all.add(&farthest);
            }
            self.friction.for_each_tie(&friction, slack, |other| {
                let step = basis.0.fixed_columns::<3>(1) * (other - at);
                own.add(&step);
                all.add(&step);
            });
            apart += own.dimension;
        }
        apart == all.dimension
    }

    /// Mean of the wrenches of the unit normal forces; zero without contacts.
    pub(super) fn mean_normal_wrench(&self) -> Vector6<f64> {
        let sum: Vector6<f64> = self.bases.iter().map(|basis| basis.0.column(0).into_owned()).sum();
        sum / self.bases.len().max(1) as f64
    }

    fn reach_of(&self, basis: &WrenchBasis, direction: &Vector6<f64>) -> f64 {
        let (normal, friction) = basis.components(direction);
        normal + self.friction.reach(&friction)
    }
}

/// The span of some wrenches, by orthonormal ones.
#[derive(Debug, Default)]
struct Span {
    axes: [Vector6<f64>; 6],
    dimension: usize,
}

impl Span {
    /// Part of a wrench across the span, relative to it, that counts as none.
    const DEPENDENT: f64 = 1e-7;

    fn add(&mut self, wrench: &Vector6<f64>) {
        let Some(mut rest) = wrench.try_normalize(1e-100) else { return };
        for _ in 0..2 {
            for axis in &self.axes[..self.dimension] {
                rest -= axis * axis.dot(&rest);
            }
        }
        if self.dimension < 6 && rest.norm() > Self::DEPENDENT {
            self.axes[self.dimension] = rest.normalize();
            self.dimension += 1;
        }
    }
}
