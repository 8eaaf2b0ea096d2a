//! How far the fingers' wrenches reach, and where least.

use nalgebra::{Isometry3, Point3, Vector3, Vector6};
use serde::Serialize;

use super::ReportError;
use crate::grasp::{
    ConeModel, Contact, ForceNorm, GraspMap, Norm, Settings, Workspace, WrenchReference, evaluate,
};
use crate::plan::document::{GraspInfo, ObjectInfo};

/// Gap between the bounds on epsilon, relative: enough to draw a direction.
const TOLERANCE: f64 = 1e-3;

/// Margins of a grasp, unit normal force in all, torques divided by the torque scale; axes of the base frame.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Margins {
    /// Greatest wrench along +x, -x, +y, -y, +z, -z: force, then torque.
    pub(super) reach: [f64; 12],
    /// The unit wrench, force then torque, that the fingers exert least of.
    pub(super) weakest: [f64; 6],
    /// How much they exert of it, at most.
    pub(super) weakest_reach: f64,
}

/// Margins of a grasp of a plan by the planner's convention; `None` when its contacts do not close by force.
///
/// # Errors
/// [`ReportError`] when a contact, the centre of mass or the torque scale is none.
pub(super) fn margins(
    number: usize,
    object: &ObjectInfo,
    info: &GraspInfo,
    base_from_object: &Isometry3<f64>,
) -> Result<Option<Margins>, ReportError> {
    let contacts: Result<Vec<Contact>, ReportError> = info
        .contacts
        .iter()
        .map(|contact| {
            let normal = Vector3::from(contact.normal);
            Contact::new(Point3::from(contact.point), normal, contact.friction)
                .and_then(|hard| hard.with_torsion(contact.torsional_m))
                .map_err(|error| ReportError::Contact { grasp: number, error })
        })
        .collect();
    let contacts = contacts?;
    let reference = WrenchReference::new(Point3::from(object.center_of_mass), object.torque_scale_m)?;
    let settings = Settings { tolerance: TOLERANCE, ..Settings::default() };
    let closure = evaluate(&contacts, &reference, &settings, &mut Workspace::new());
    let Some(quality) = closure.quality() else { return Ok(None) };
    let map = GraspMap::new(&contacts, &reference, ConeModel::Exact, ForceNorm::Normal);
    let reach = std::array::from_fn(|bar| {
        let (half, axis, sign) = (bar / 6, bar % 6 / 2, if bar % 2 == 0 { 1.0 } else { -1.0 });
        let mut axis_in_base = Vector3::zeros();
        axis_in_base[axis] = sign;
        let in_object = base_from_object.rotation.inverse() * axis_in_base;
        let mut direction = Vector6::zeros();
        direction.fixed_rows_mut::<3>(3 * half).copy_from(&in_object);
        map.reach(&direction, Norm::L1).unwrap_or(0.0)
    });
    let turned = |half: usize| {
        base_from_object.rotation * Vector3::from(quality.weakest_wrench.fixed_rows::<3>(3 * half))
    };
    let (force, torque) = (turned(0), turned(1));
    Ok(Some(Margins {
        reach,
        weakest: [force.x, force.y, force.z, torque.x, torque.y, torque.z],
        weakest_reach: quality.epsilon_high,
    }))
}
