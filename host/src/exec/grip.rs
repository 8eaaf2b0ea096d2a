//! From contacts to a grip: forces that balance each other, and joint targets beyond the contacts that make them.

use hand_model::{
    FingerAngles, FingerInverse, FingerTrig, HandAngles, HandModel, inverse_angles, tip, tip_jacobian,
};
use nalgebra::{DMatrix, DVector, Isometry3, Matrix3, Point3, Unit, Vector3, convert};
use protocol::ids::{FINGER_COUNT, FingerId};
use thiserror::Error;

use crate::hand::{Hand, Posture};

/// Alternating projections: a grasp with room inside its cones needs some tens.
const SWEEPS: usize = 500;
/// Least share of the mean normal force that every fingertip of a precision grasp gets, so that none is idle.
pub const LEAST_TIP_SHARE: f64 = 0.25;
/// Unbalanced rest that is accepted, as a share of the summed normal forces.
const BALANCE_TOLERANCE: f64 = 0.02;

/// Why contacts carry no balanced grip.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum GripError {
    /// Fewer than two contacts.
    #[error("{0} contacts cannot hold an object")]
    TooFew(usize),
    /// The cones hold no forces that balance.
    #[error(
        "within {cone_share} of the friction the contact forces do not balance: {unbalanced_share} of the grip is left over"
    )]
    Unbalanced {
        /// Share of each contact's friction that limited its cone.
        cone_share: f64,
        /// Unbalanced wrench over the summed normal forces.
        unbalanced_share: f64,
    },
    /// A number is not finite, the share or the grip is not positive, or a contact has a negative friction.
    #[error("share {cone_share} and grip {grip_n} N must be positive numbers, and the contacts finite")]
    NotFinite {
        /// Share of each contact's friction.
        cone_share: f64,
        /// Summed normal forces.
        grip_n: f64,
    },
}

/// A place where the hand touches the object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GripContact {
    /// Where it touches, any frame.
    pub point: Point3<f64>,
    /// Into the object, same frame.
    pub inward_normal: Unit<Vector3<f64>>,
    /// Coulomb friction coefficient there.
    pub friction: f64,
}

/// Forces of the contacts on the object, N, in the contacts' frame and order, that balance each other within cones of
/// `cone_share` of each contact's friction, with normal forces that sum to `grip_n`. With a half, the other half is left
/// for weight and disturbance. Every contact gets `least_share` of the mean normal force: [`LEAST_TIP_SHARE`]
/// where each finger touches once, 0 where links touch that nothing presses by itself.
///
/// # Errors
/// [`GripError::Unbalanced`] when the contacts do not oppose each other well enough.
pub fn balanced_forces(
    contacts: &[GripContact],
    cone_share: f64,
    grip_n: f64,
    least_share: f64,
) -> Result<Vec<Vector3<f64>>, GripError> {
    let count = contacts.len();
    if count < 2 {
        return Err(GripError::TooFew(count));
    }
    let positive = |x: f64| x.is_finite() && x > 0.0;
    let finite =
        contacts.iter().all(|c| c.point.coords.iter().chain(c.inward_normal.iter()).all(|x| x.is_finite()));
    let frictions = contacts.iter().all(|c| c.friction.is_finite() && c.friction >= 0.0);
    if !(positive(cone_share) && positive(grip_n) && finite && frictions) {
        return Err(GripError::NotFinite { cone_share, grip_n });
    }
    // 6 x 3n: force, then torque about the middle of the contacts over their mean distance from it.
    let middle = contacts.iter().map(|c| c.point.coords).sum::<Vector3<f64>>() / count as f64;
    let spread = contacts.iter().map(|c| (c.point.coords - middle).norm()).sum::<f64>() / count as f64;
    let scale = if spread > 0.0 { 1.0 / spread } else { 1.0 };
    let mut grasp = DMatrix::zeros(6, 3 * count);
    for (i, contact) in contacts.iter().enumerate() {
        let arm = (contact.point.coords - middle) * scale;
        grasp.fixed_view_mut::<3, 3>(0, 3 * i).copy_from(&Matrix3::identity());
        grasp.fixed_view_mut::<3, 3>(3, 3 * i).copy_from(&arm.cross_matrix());
    }
    let unbalanced = |share| GripError::Unbalanced { cone_share, unbalanced_share: share };
    let inverse = grasp.clone().pseudo_inverse(1e-9).map_err(|_| unbalanced(1.0))?;

    let mean = 1.0 / count as f64;
    let mut forces = DVector::zeros(3 * count);
    for (i, contact) in contacts.iter().enumerate() {
        forces.fixed_rows_mut::<3>(3 * i).copy_from(&(contact.inward_normal.into_inner() * mean));
    }
    for _ in 0..SWEEPS {
        forces -= &inverse * (&grasp * &forces);
        let mut sum = 0.0;
        for (i, contact) in contacts.iter().enumerate() {
            let force = forces.fixed_rows::<3>(3 * i).into_owned();
            let (inside, normal_n) =
                into_cone(&force, &contact.inward_normal, cone_share * contact.friction, least_share * mean);
            forces.fixed_rows_mut::<3>(3 * i).copy_from(&inside);
            sum += normal_n;
        }
        forces /= sum;
    }
    let share = (&grasp * &forces).norm();
    if share > BALANCE_TOLERANCE {
        return Err(unbalanced(share));
    }
    Ok((0..count).map(|i| forces.fixed_rows::<3>(3 * i) * grip_n).collect())
}

/// The force of the cone nearest to `force`, and its normal part, which is at least `least_n` > 0.
fn into_cone(
    force: &Vector3<f64>,
    inward_normal: &Unit<Vector3<f64>>,
    friction: f64,
    least_n: f64,
) -> (Vector3<f64>, f64) {
    let normal_n = force.dot(inward_normal);
    let tangent = force - inward_normal.into_inner() * normal_n;
    let length = tangent.norm();
    let mut nearest_n = normal_n;
    if length > friction * normal_n {
        nearest_n = (normal_n + friction * length) / (1.0 + friction * friction);
    }
    let nearest_n = nearest_n.max(least_n);
    let shrink = if length > friction * nearest_n { friction * nearest_n / length } else { 1.0 };
    (inward_normal.into_inner() * nearest_n + tangent * shrink, nearest_n)
}

/// Stiffness with which the hand's controller turns errors into forces; must be that of the controller.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GripStiffness {
    /// Joints of the fingers under joint control: abduction, flexion, middle.
    pub joint_nm_per_rad: [f64; 3],
    /// The thumb's tip, axes of its base frame.
    pub thumb_n_per_m: [f64; 3],
}

impl Default for GripStiffness {
    fn default() -> Self {
        Self { joint_nm_per_rad: [6.0; 3], thumb_n_per_m: [500.0, 500.0, 300.0] }
    }
}

/// Joint targets that press with the given forces when the hand stands at `grasp`.
///
/// `forces_in_palm` are those of each fingertip on the object, N, palm frame; `None` leaves a finger where it is. A
/// finger under joint control gets `q + J^T f / k`, the thumb a tip target that lies by `f / K` inside the object; where
/// the thumb cannot reach that far it gets the joint motion that the Jacobian gives for it. Targets stay within the
/// mechanism's range, so a finger near its end presses less.
#[must_use]
pub fn squeeze_targets(
    model: &HandModel<f64>,
    grasp: &HandAngles<f64>,
    forces_in_palm: &[Option<Vector3<f64>>; FINGER_COUNT],
    stiffness: &GripStiffness,
) -> HandAngles<f64> {
    let mut squeeze = *grasp;
    for finger in FingerId::ALL {
        let Some(force_in_palm) = forces_in_palm[finger.index()] else { continue };
        let palm_from_base: Isometry3<f64> =
            convert(model.palm_from_finger_base(finger, grasp.thumb_rotation_rad.sin_cos()));
        let force = palm_from_base.rotation.inverse() * force_in_palm;
        let angles = grasp.finger(finger);
        let trig = FingerTrig::new(angles, f64::sin_cos);
        let jacobian = tip_jacobian(&model.finger, &trig);
        let target = if finger == FingerId::Thumb {
            let inside = force.component_div(&Vector3::from(stiffness.thumb_n_per_m));
            let beyond = tip(&model.finger, &trig) + inside;
            match inverse_angles(&model.finger, &model.hard_limits, finger, &beyond, f64::atan2) {
                FingerInverse::Reached(target) => target,
                FingerInverse::BeyondLimits { .. } | FingerInverse::Unreachable(_) => {
                    moved(angles, &damped_solution(&jacobian, &inside))
                }
            }
        } else {
            moved(
                angles,
                &(jacobian.transpose() * force).component_div(&Vector3::from(stiffness.joint_nm_per_rad)),
            )
        };
        squeeze.fingers[finger.index()] = model.hard_limits.clamp_finger(&target);
    }
    squeeze
}

/// A push of one of a finger's links.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinkPush {
    /// Index of the finger.
    pub finger: usize,
    /// Index of the segment of the finger that pushes.
    pub segment: usize,
    /// Where, palm frame.
    pub point_in_palm: Point3<f64>,
    /// Force on the object, N, palm frame.
    pub force_in_palm: Vector3<f64>,
}

/// The greatest share of its torque that the pushes ask of any joint of a hand at `grasp`: above 1 the drives cannot give
/// them. A joint that is held bears its part with the brake. Joints without a torque above 0 do not count: what they can
/// give is not known.
#[must_use]
pub fn torque_share(hand: &Hand, grasp: &Posture, pushes: &[LinkPush]) -> f64 {
    let torques_nm = joint_torques(hand, grasp, pushes);
    let known = hand.joints.iter().enumerate().filter(|(_, joint)| joint.torque_max_nm > 0.0);
    known.map(|(i, joint)| torques_nm[i].abs() / joint.torque_max_nm).fold(0.0, f64::max)
}

/// `J^T f`, N m (N of a sliding joint).
fn joint_torques(hand: &Hand, grasp: &Posture, pushes: &[LinkPush]) -> Posture {
    let mut torques_nm = Posture::ZERO;
    for push in pushes {
        let chain = &hand.fingers[push.finger];
        let jacobian = chain.point_jacobian(&chain.frames(grasp), push.segment, &push.point_in_palm);
        for (column, &joint) in chain.joints().iter().enumerate() {
            torques_nm[joint] += jacobian.column(column).dot(&push.force_in_palm);
        }
    }
    torques_nm
}

/// Joint targets that press with the given forces when a hand whose joints are all under position control stands at
/// `grasp`: `q + J^T f / k` with each joint's stiffness, within the joints' limits. Joints that are held stay.
#[must_use]
pub fn joint_squeeze_targets(hand: &Hand, grasp: &Posture, pushes: &[LinkPush]) -> Posture {
    let torques_nm = joint_torques(hand, grasp, pushes);
    let mut squeeze = *grasp;
    for (i, joint) in hand.joints.iter().enumerate().filter(|(_, joint)| !joint.is_held) {
        squeeze[i] += torques_nm[i] / joint.stiffness_nm_per_rad;
    }
    hand.clamped(squeeze)
}

fn moved(angles: &FingerAngles<f64>, by_rad: &Vector3<f64>) -> FingerAngles<f64> {
    FingerAngles::from_array(&(Vector3::from(angles.to_array()) + by_rad).into())
}

/// `dq` with `J dq` close to `dx`, bounded where the finger is stretched.
fn damped_solution(jacobian: &Matrix3<f64>, dx: &Vector3<f64>) -> Vector3<f64> {
    // A tenth of the lever arms, which are of centimetres: below it a direction counts as lost.
    const DAMPING_M: f64 = 5e-3;
    let square = jacobian * jacobian.transpose() + Matrix3::identity() * (DAMPING_M * DAMPING_M);
    square.cholesky().map_or_else(Vector3::zeros, |c| jacobian.transpose() * c.solve(dx))
}

#[cfg(test)]
mod tests;
