//! How epsilon changes with the contacts.
//!
//! Epsilon is the least reach of the wrenches over all directions. By the envelope theorem (J. Danskin, "The theory of
//! max-min", 1966) its derivative is that of the reach along the weakest direction, held fixed. Several contacts reach
//! equally far there: the wrenches at the corners of the facet that ended the search, with weights that combine them to
//! the point of the facet nearest to the origin. The derivative of the facet's distance is the sum of theirs by weight.
//!
//! How far epsilon can change at most is a bound of its own: a contact moved by a length moves no wrench farther than its
//! force allows (F. Pokorny and D. Kragic, "Classical grasp quality evaluation: new algorithms and theory", IROS 2013).

use nalgebra::{Matrix6, Vector3, Vector4, Vector6};

use super::contact::Contact;
use super::expand::Facet;
use super::quality::{Closure, ForceNorm, Limits, Norm, Settings, Workspace, evaluate_within};
use super::wrench::{GraspMap, WrenchReference, first_axis, tangents};

/// Distances that differ by less than this fraction are equal.
const MARGIN: f64 = 1e-9;
/// Weights of a facet's corners beyond this magnified errors. A facet that is cut in pieces may end with a piece that the
/// nearest point is not in, and has some beyond 0 and 1; the derivatives are the same.
const MAX_WEIGHT: f64 = 3.0;

/// Derivatives of epsilon in one contact.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ContactGradient {
    /// In the position, unit of epsilon per metre, object frame. On a smooth surface its tangential part is of use.
    pub point_per_m: Vector3<f64>,
    /// In the normal, unit of epsilon per radian that it tilts this way; across the normal, object frame.
    pub normal_per_rad: Vector3<f64>,
    /// In the friction coefficient.
    pub friction: f64,
}

/// What the derivatives are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Slope {
    /// The gradient: only one direction is the weakest one (to a billionth, or twice the tolerance) and only one combination of contact forces
    /// acts along it. Exact for pyramids; for exact cones the error is of the order of the root of the tolerance.
    Gradient,
    /// One element of the generalized gradient: others may belong to epsilon as well, as with symmetric grasps, so that
    /// it rises less than this says in some directions. So it is too when it could not be told.
    Subgradient,
    /// There is none: no closure, or the search was not finished.
    None,
}

/// Measures a grasp, and how epsilon changes with each contact, in the order of the contacts.
///
/// `gradient` is emptied first, and stays empty with [`Slope::None`]. With a kept workspace and vector, nothing is
/// allocated. The reference, centre and scale of torques, is held fixed.
pub fn evaluate_with_gradient(
    contacts: &[Contact],
    reference: &WrenchReference,
    settings: &Settings,
    workspace: &mut Workspace,
    gradient: &mut Vec<ContactGradient>,
) -> (Closure, Slope) {
    gradient.clear();
    let tolerance = if settings.tolerance > 0.0 { settings.tolerance } else { 0.0 };
    workspace.hulls.witness.is_wanted = true;
    workspace.hulls.witness.margin = MARGIN.max(2.0 * tolerance);
    let closure = evaluate_within(contacts, reference, settings, &Limits::default(), workspace);
    workspace.hulls.witness.is_wanted = false;
    let Workspace { map, hulls } = workspace;
    let (Closure::Force(quality), Some(facet)) = (&closure, hulls.witness.facet()) else {
        return (closure, Slope::None);
    };
    let Some(weights) = weights(map, settings.norm, facet) else { return (closure, Slope::None) };
    gradient.resize(contacts.len(), ContactGradient::default());
    for (weight, direction) in weights.iter().zip(&facet.directions) {
        map.parts(direction, settings.norm, |part| {
            let [x, y, z] = (part.friction * (weight * part.force)).into();
            let push = Vector4::new(weight * part.force, x, y, z);
            let contact = &contacts[part.contact];
            gradient[part.contact].add(contact, reference, settings.force_norm, &facet.normal, &push);
        });
    }
    let slack = 10.0 * (quality.epsilon_high - quality.epsilon_low) + 1e-10 * map.bound(settings.norm);
    let is_reliable = weights.iter().all(|weight| weight.abs() <= MAX_WEIGHT);
    let is_gradient = facet.is_only && is_reliable && map.is_unique(&facet.normal, settings.norm, slack);
    (closure, if is_gradient { Slope::Gradient } else { Slope::Subgradient })
}

/// The weights of a facet's corners in its point nearest to the origin: they sum to one.
fn weights(map: &GraspMap, norm: Norm, facet: &Facet) -> Option<[f64; 6]> {
    let corners = Matrix6::from_columns(&facet.directions.map(|direction| map.farthest(&direction, norm)));
    let weights = corners.try_inverse()? * facet.normal;
    let sum = weights.sum();
    (sum > 0.0).then(|| (weights / sum).into())
}

impl ContactGradient {
    /// Adds the derivatives of the reach along `direction` of what a contact exerts: `push` is normal force and friction,
    /// as the columns of [`WrenchBasis`](super::wrench::WrenchBasis) take them.
    fn add(
        &mut self,
        contact: &Contact,
        reference: &WrenchReference,
        force_norm: ForceNorm,
        direction: &Vector6<f64>,
        push: &Vector4<f64>,
    ) {
        let scale = reference.torque_scale_m();
        let (along_force, along_torque): (Vector3<f64>, Vector3<f64>) =
            (direction.fixed_rows::<3>(0).into(), direction.fixed_rows::<3>(3).into());
        let lever = (contact.point_in_object() - reference.center_of_mass_in_object()) / scale;
        // A force f reaches f . g along the direction.
        let g = along_force + along_torque.cross(&lever);
        let normal = contact.inward_normal_in_object();
        let [first, second] = tangents(&normal);
        let mu = contact.friction();
        let unit = force_norm.unit(mu);
        let torsion = contact.torsional_m() / scale;
        let [normal_force, x, y, z] = (push * unit).into();

        let force = normal.into_inner() * normal_force + (first * x + second * y) * mu;
        self.point_per_m += force.cross(&along_torque) / scale;

        // The first tangent is n x axis, made a unit, and the second n x first: both turn with the normal.
        let axis = first_axis(&normal);
        let inverse = 1.0 / normal.cross(&axis).norm();
        let of_first = |v: &Vector3<f64>| axis.cross(&(v - first * first.dot(v))) * inverse;
        let of_second = first.cross(&g) + of_first(&g.cross(&normal));
        let turned =
            g * normal_force + (of_first(&g) * x + of_second * y + along_torque * (z * torsion)) * mu;
        self.normal_per_rad += turned - normal.into_inner() * normal.dot(&turned);

        let of_friction = first.dot(&g) * x + second.dot(&g) * y + normal.dot(&along_torque) * (z * torsion);
        let reach = normal.dot(&g) * normal_force + of_friction * mu;
        // Of the unit 1 / sqrt(1 + mu^2), the logarithmic derivative.
        let of_unit = match force_norm {
            ForceNorm::Normal => 0.0,
            ForceNorm::Edge => -mu * unit * unit,
        };
        self.friction += of_friction + of_unit * reach;
    }
}

/// How much epsilon can change at most when one contact does, whatever the others are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactLipschitz {
    /// Unit of epsilon per metre that the point moves.
    pub point_per_m: f64,
    /// Unit of epsilon per radian that the normal tilts, for exact cones. A pyramid also turns about its normal as that
    /// tilts, in places by jumps.
    pub normal_per_rad: f64,
    /// Per unit of the friction coefficient, up from this one.
    pub friction: f64,
}

/// Lipschitz bounds of epsilon in a contact: no wrench that the contact exerts moves any farther.
#[must_use]
pub fn lipschitz(contact: &Contact, reference: &WrenchReference, settings: &Settings) -> ContactLipschitz {
    let mu = contact.friction();
    let limit = match settings.norm {
        Norm::L1 => 1.0,
        Norm::LInf => contact.max_force_n(),
    };
    let unit = settings.force_norm.unit(mu) * limit;
    let scale = reference.torque_scale_m();
    let lever = (contact.point_in_object() - reference.center_of_mass_in_object()).norm() / scale;
    let torsion = contact.torsional_m() / scale;
    let (force, with_torque) = (unit * mu.hypot(1.0), lever.hypot(1.0));
    ContactLipschitz {
        point_per_m: force / scale,
        normal_per_rad: force * with_torque + unit * mu * torsion,
        friction: limit * (with_torque + torsion),
    }
}
