//! From joint angles to the places of links and tip, in the finger's base frame.

use nalgebra::{IsometryMatrix3, Matrix3, Point3, RealField, Rotation3, Translation3, Unit, Vector3};

use crate::joints::FingerAngles;
use crate::model::FingerGeometry;

/// Sines and cosines of a finger's joints and of the sums that its plane chain needs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FingerTrig<T> {
    /// `(sin, cos)` of the abduction `q1`.
    pub abduction: (T, T),
    /// `(sin, cos)` of the flexion `q2`, the proximal link's angle in the plane of the finger.
    pub flexion: (T, T),
    /// `(sin, cos)` of the middle joint `q3`.
    pub middle: (T, T),
    /// `(sin, cos)` of `q2 + q3`, the middle link's angle in the plane of the finger.
    pub middle_link: (T, T),
    /// `(sin, cos)` of `q2 + 2 q3`, the distal link's angle in the plane of the finger.
    pub distal_link: (T, T),
}

/// Sine and cosine of a sum.
fn add<T: RealField + Copy>((sin_a, cos_a): (T, T), (sin_b, cos_b): (T, T)) -> (T, T) {
    (sin_a * cos_b + cos_a * sin_b, cos_a * cos_b - sin_a * sin_b)
}

impl<T: RealField + Copy> FingerTrig<T> {
    /// From angles and the caller's function from radians to `(sin, cos)`, which is called three times.
    #[must_use]
    pub fn new(angles: &FingerAngles<T>, sin_cos: impl Fn(T) -> (T, T)) -> Self {
        Self::from_pairs(
            sin_cos(angles.abduction_rad),
            sin_cos(angles.flexion_rad),
            sin_cos(angles.middle_rad),
        )
    }

    /// From the `(sin, cos)` pairs of abduction, flexion and middle joint.
    #[must_use]
    pub fn from_pairs(abduction: (T, T), flexion: (T, T), middle: (T, T)) -> Self {
        let middle_link = add(flexion, middle);
        Self { abduction, flexion, middle, middle_link, distal_link: add(middle_link, middle) }
    }
}

/// A finger's chain in its plane: how far the tip is along the stretched finger, `along`, and to the pad side, `across`,
/// metres. The plane turns about the abduction axis.
pub(crate) fn tip_in_plane<T: RealField + Copy>(finger: &FingerGeometry<T>, trig: &FingerTrig<T>) -> (T, T) {
    let (sin_1, cos_1) = trig.flexion;
    let (sin_2, cos_2) = trig.middle_link;
    let (sin_3, cos_3) = trig.distal_link;
    (
        finger.l1_m * cos_1 + finger.l2_m * cos_2 + finger.l3_m * cos_3,
        finger.l1_m * sin_1 + finger.l2_m * sin_2 + finger.l3_m * sin_3,
    )
}

/// The tip in the finger's base frame, metres: `(a cos q1, a sin q1, b)` with
/// `a = L1 cos q2 + L2 cos(q2+q3) + L3 cos(q2+2 q3)` and `b` the same of sines.
#[must_use]
pub fn tip<T: RealField + Copy>(finger: &FingerGeometry<T>, trig: &FingerTrig<T>) -> Point3<T> {
    let (along, across) = tip_in_plane(finger, trig);
    let (sin, cos) = trig.abduction;
    Point3::new(along * cos, along * sin, across)
}

/// The outward normal of the pad in the finger's base frame: z of the distal link. It points at what the finger closes on.
#[must_use]
pub fn pad_normal<T: RealField + Copy>(trig: &FingerTrig<T>) -> Unit<Vector3<T>> {
    let (sin, cos) = trig.abduction;
    let (sin_d, cos_d) = trig.distal_link;
    Unit::new_unchecked(Vector3::new(-cos * sin_d, -sin * sin_d, cos_d))
}

/// Poses of a finger's links in its base frame; see the crate's frames.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FingerLinks<T: RealField> {
    /// `base_from_proximal`.
    pub proximal: IsometryMatrix3<T>,
    /// `base_from_middle`.
    pub middle: IsometryMatrix3<T>,
    /// `base_from_distal`.
    pub distal: IsometryMatrix3<T>,
    /// The tip in the base frame, metres.
    pub tip: Point3<T>,
}

/// The poses of a finger's links in its base frame.
///
/// ```
/// use hand_model::{FingerAngles, FingerTrig, HandModel, links, pad_normal, tip};
/// use nalgebra::Point3;
/// let finger = HandModel::<f64>::hit_dlr().finger;
/// let angles = FingerAngles { abduction_rad: 0.1, flexion_rad: 0.6, middle_rad: 0.4 };
/// let trig = FingerTrig::new(&angles, f64::sin_cos);
/// let links = links(&finger, &trig);
/// let tip_in_distal = Point3::new(finger.l3_m, 0.0, 0.0);
/// assert!((links.distal * tip_in_distal - tip(&finger, &trig)).norm() < 1e-15);
/// ```
#[must_use]
pub fn links<T: RealField + Copy>(finger: &FingerGeometry<T>, trig: &FingerTrig<T>) -> FingerLinks<T> {
    let (sin, cos) = trig.abduction;
    let rotation = |(sin_l, cos_l): (T, T)| {
        Rotation3::from_matrix_unchecked(Matrix3::new(
            cos * cos_l,
            -sin,
            -cos * sin_l,
            sin * cos_l,
            cos,
            -sin * sin_l,
            sin_l,
            T::zero(),
            cos_l,
        ))
    };
    let end = |link: &IsometryMatrix3<T>, length: T| {
        Translation3::from(link.translation.vector + link.rotation.matrix().column(0) * length)
    };
    let proximal = IsometryMatrix3::from_parts(Translation3::identity(), rotation(trig.flexion));
    let middle = IsometryMatrix3::from_parts(end(&proximal, finger.l1_m), rotation(trig.middle_link));
    let distal = IsometryMatrix3::from_parts(end(&middle, finger.l2_m), rotation(trig.distal_link));
    FingerLinks { proximal, middle, distal, tip: Point3::from(end(&distal, finger.l3_m).vector) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::HandModel;
    use crate::testing::Poses;
    use nalgebra::Matrix4;

    /// Transform of frame i in frame i-1 after Craig: `rot_x(alpha) trans_x(a) rot_z(theta) trans_z(d)`.
    fn modified_dh(alpha: f64, a: f64, d: f64, theta: f64) -> Matrix4<f64> {
        let rot_x = Matrix4::from_euler_angles(alpha, 0.0, 0.0);
        let rot_z = Matrix4::from_euler_angles(0.0, 0.0, theta);
        rot_x
            * Matrix4::new_translation(&Vector3::new(a, 0.0, 0.0))
            * rot_z
            * Matrix4::new_translation(&Vector3::new(0.0, 0.0, d))
    }

    #[test]
    fn links_and_tip_agree_with_the_modified_dh_table() {
        let finger = HandModel::<f64>::hit_dlr().finger;
        // DH frames have the joint axis as z; ours are turned by +90 degrees about x against frames 2 to 4.
        let dh_from_link = Matrix4::from_euler_angles(core::f64::consts::FRAC_PI_2, 0.0, 0.0);
        for angles in Poses::new(1).take_hard(2000) {
            let links = links(&finger, &FingerTrig::new(&angles, f64::sin_cos));
            let [q1, q2, q3] = angles.to_array();
            let abducted = modified_dh(0.0, 0.0, 0.0, q1);
            let proximal = abducted * modified_dh(-core::f64::consts::FRAC_PI_2, 0.0, 0.0, -q2);
            let middle = proximal * modified_dh(0.0, 0.0678, 0.0, -q3);
            let distal = middle * modified_dh(0.0, 0.0300, 0.0, -q3);
            let tip = distal * modified_dh(0.0, 0.0270, 0.0, 0.0);
            for (dh, ours) in [(proximal, links.proximal), (middle, links.middle), (distal, links.distal)] {
                assert!((dh * dh_from_link - ours.to_homogeneous()).amax() < 1e-14);
            }
            assert!((tip.fixed_view::<3, 1>(0, 3) - links.tip.coords).norm() < 1e-15);
        }
    }

    #[test]
    fn closed_forms_agree_with_the_chain_of_links() {
        let finger = HandModel::<f64>::hit_dlr().finger;
        for angles in Poses::new(2).take_hard(2000) {
            let trig = FingerTrig::new(&angles, f64::sin_cos);
            let links = links(&finger, &trig);
            assert!((links.tip - tip(&finger, &trig)).norm() < 1e-15);
            assert!((links.distal.rotation * Vector3::z() - pad_normal(&trig).into_inner()).norm() < 1e-15);
            assert!((pad_normal(&trig).norm() - 1.0).abs() < 1e-14);
            let [q1, q2, q3] = angles.to_array();
            let along = 0.0678 * q2.cos() + 0.03 * (q2 + q3).cos() + 0.027 * (q2 + 2.0 * q3).cos();
            let across = 0.0678 * q2.sin() + 0.03 * (q2 + q3).sin() + 0.027 * (q2 + 2.0 * q3).sin();
            let expected = Point3::new(along * q1.cos(), along * q1.sin(), across);
            assert!((tip(&finger, &trig) - expected).norm() < 1e-15);
        }
    }

    #[test]
    fn a_stretched_finger_lies_on_x_and_bends_to_its_pad() {
        let finger = HandModel::<f64>::hit_dlr().finger;
        let zero = FingerAngles::default();
        let stretched = tip(&finger, &FingerTrig::new(&zero, f64::sin_cos));
        assert!((stretched - Point3::new(0.1248, 0.0, 0.0)).norm() < 1e-15);
        for (angles, axis) in [
            (FingerAngles { abduction_rad: 0.1, ..zero }, Vector3::y()),
            (FingerAngles { flexion_rad: 0.1, ..zero }, Vector3::z()),
            (FingerAngles { middle_rad: 0.1, ..zero }, Vector3::z()),
        ] {
            let moved = tip(&finger, &FingerTrig::new(&angles, f64::sin_cos)) - stretched;
            assert!(moved.dot(&axis) > 0.005, "{angles:?}");
        }
    }

    #[test]
    fn single_precision_agrees_with_double() {
        let finger = HandModel::<f64>::hit_dlr().finger;
        let finger_32 = HandModel::<f32>::hit_dlr().finger;
        for angles in Poses::new(3).take_hard(2000) {
            let angles_32 = FingerAngles::from_array(&angles.to_array().map(|q| q as f32));
            let double = tip(&finger, &FingerTrig::new(&angles, f64::sin_cos));
            let single = tip(&finger_32, &FingerTrig::new(&angles_32, f32::sin_cos));
            assert!((double - single.cast::<f64>()).norm() < 1e-7);
        }
    }
}
