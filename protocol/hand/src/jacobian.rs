//! How the tip moves with the joints.

use nalgebra::{Matrix3, RealField};

use crate::forward::{FingerTrig, tip_in_plane};
use crate::model::FingerGeometry;

/// The Jacobian of the tip in the finger's base frame, 3 x 3, m/rad: column j is the tip's velocity for a unit speed of
/// abduction, flexion and middle joint (the distal joint moving with it).
///
/// Its transpose maps a force on the tip, N, to the torques that the actuators feel, N m; the third is on the coupled
/// coordinate, middle and distal joint together.
///
/// ```
/// use hand_model::{FingerAngles, FingerTrig, HandModel, tip_jacobian};
/// use nalgebra::Vector3;
/// let finger = HandModel::<f64>::hit_dlr().finger;
/// let stretched = FingerTrig::new(&FingerAngles::default(), f64::sin_cos);
/// let torques_nm = tip_jacobian(&finger, &stretched).transpose() * Vector3::new(0.0, 0.0, 10.0);
/// assert!((torques_nm[1] - 1.248).abs() < 1e-12, "10 N at the end of a stretched finger");
/// ```
#[must_use]
pub fn tip_jacobian<T: RealField + Copy>(finger: &FingerGeometry<T>, trig: &FingerTrig<T>) -> Matrix3<T> {
    let (along, across) = tip_in_plane(finger, trig);
    let (sin, cos) = trig.abduction;
    // Derivatives of (along, across) by the middle joint: the middle link turns once, the distal link twice.
    let twice_l3_m = finger.l3_m + finger.l3_m;
    let along_3 = -(finger.l2_m * trig.middle_link.0 + twice_l3_m * trig.distal_link.0);
    let across_3 = finger.l2_m * trig.middle_link.1 + twice_l3_m * trig.distal_link.1;
    Matrix3::new(
        -along * sin,
        -across * cos,
        along_3 * cos,
        along * cos,
        -across * sin,
        along_3 * sin,
        T::zero(),
        along,
        across_3,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Poses;
    use crate::{FingerAngles, HandModel, links, tip};
    use nalgebra::Vector3;

    #[test]
    fn columns_are_central_differences_of_the_tip() {
        let finger = HandModel::<f64>::hit_dlr().finger;
        let step = 1e-5;
        for angles in Poses::new(4).take_hard(2000) {
            let jacobian = tip_jacobian(&finger, &FingerTrig::new(&angles, f64::sin_cos));
            for j in 0..3 {
                let moved = |by: f64| {
                    let mut array = angles.to_array();
                    array[j] += by;
                    tip(&finger, &FingerTrig::new(&FingerAngles::from_array(&array), f64::sin_cos))
                };
                let difference = (moved(step) - moved(-step)) / (2.0 * step);
                assert!((jacobian.column(j) - difference).norm() < 1e-10, "column {j} at {angles:?}");
            }
        }
    }

    #[test]
    fn columns_are_axes_crossed_with_levers() {
        let finger = HandModel::<f64>::hit_dlr().finger;
        for angles in Poses::new(5).take_hard(500) {
            let trig = FingerTrig::new(&angles, f64::sin_cos);
            let links = links(&finger, &trig);
            let jacobian = tip_jacobian(&finger, &trig);
            let bend = -(links.proximal.rotation * Vector3::y());
            let lever = |link: &nalgebra::IsometryMatrix3<f64>| links.tip.coords - link.translation.vector;
            let abduction = Vector3::z().cross(&links.tip.coords);
            let flexion = bend.cross(&lever(&links.proximal));
            let middle = bend.cross(&lever(&links.middle)) + bend.cross(&lever(&links.distal));
            assert!(
                (jacobian - nalgebra::Matrix3::from_columns(&[abduction, flexion, middle])).amax() < 1e-15
            );
        }
    }

    #[test]
    fn torque_limits_allow_the_fingertip_force_everywhere() {
        let hand = HandModel::<f64>::hit_dlr();
        for angles in Poses::new(6).take_soft(20_000) {
            let jacobian = tip_jacobian(&hand.finger, &FingerTrig::new(&angles, f64::sin_cos));
            for (column, limit_nm) in jacobian.column_iter().zip(hand.drive.torque_max_nm) {
                assert!(column.norm() * hand.drive.tip_force_max_n <= limit_nm, "{angles:?}");
            }
        }
    }
}
