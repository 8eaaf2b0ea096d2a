//! Where the fingers stand in the palm.

use nalgebra::{ComplexField, IsometryMatrix3, Matrix3, Point3, RealField, Rotation3, Translation3, Vector3};
use protocol::ids::FingerId;

use crate::forward::{FingerTrig, tip};
use crate::joints::HandAngles;
use crate::model::{FingerMounts, HandModel};
use crate::params;

/// `palm_from_base` of a finger that leans by `splay_rad` towards palm +y, its pad to palm +x.
fn splayed(position_m: [f64; 3], splay_rad: f64) -> IsometryMatrix3<f64> {
    let (sin, cos) = ComplexField::sin_cos(splay_rad);
    let x = Vector3::new(0.0, sin, cos);
    let z = Vector3::x();
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, z.cross(&x), z]));
    IsometryMatrix3::from_parts(Translation3::from(position_m), rotation)
}

/// `palm_from_base` of the thumb at rotation 0, its pad leaning by the tilt against palm z.
fn thumb_at_zero() -> IsometryMatrix3<f64> {
    let (sin, cos) = ComplexField::sin_cos(params::THUMB_TILT_RAD);
    let x = Vector3::new(0.0, sin, cos);
    let y = -Vector3::x();
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, y, x.cross(&y)]));
    IsometryMatrix3::from_parts(Translation3::from(params::THUMB_BASE_AT_ZERO_IN_PALM_M), rotation)
}

pub(crate) fn hit_dlr_mounts<T: RealField + Copy>() -> FingerMounts<T> {
    FingerMounts {
        thumb_axis_in_palm: Point3::from(params::THUMB_AXIS_IN_PALM_M).cast(),
        palm_from_thumb_base_at_zero: thumb_at_zero().cast(),
        palm_from_index_base: splayed(params::INDEX_BASE_IN_PALM_M, params::INDEX_SPLAY_RAD).cast(),
        palm_from_middle_base: splayed(params::MIDDLE_BASE_IN_PALM_M, params::MIDDLE_SPLAY_RAD).cast(),
        palm_from_ring_base: splayed(params::RING_BASE_IN_PALM_M, params::RING_SPLAY_RAD).cast(),
    }
}

impl<T: RealField + Copy> HandModel<T> {
    /// The pose of a finger's base in the palm frame.
    ///
    /// `thumb_rotation` is `(sin, cos)` of the thumb's rotation, which is right-handed about palm -z. It moves the thumb
    /// only.
    #[must_use]
    pub fn palm_from_finger_base(&self, finger: FingerId, thumb_rotation: (T, T)) -> IsometryMatrix3<T> {
        let mounts = &self.mounts;
        match finger {
            FingerId::Thumb => {
                let (sin, cos) = thumb_rotation;
                let (zero, one) = (T::zero(), T::one());
                let turn = Rotation3::from_matrix_unchecked(Matrix3::new(
                    cos, sin, zero, -sin, cos, zero, zero, zero, one,
                ));
                let at_zero = &mounts.palm_from_thumb_base_at_zero;
                let axis = mounts.thumb_axis_in_palm.coords;
                let position = axis + turn * (at_zero.translation.vector - axis);
                IsometryMatrix3::from_parts(Translation3::from(position), turn * at_zero.rotation)
            }
            FingerId::Index => mounts.palm_from_index_base,
            FingerId::Middle => mounts.palm_from_middle_base,
            FingerId::Ring => mounts.palm_from_ring_base,
        }
    }

    /// All four fingertips (centres of their spheres) in the palm frame, metres, by [`FingerId::index`], with the
    /// caller's function from radians to `(sin, cos)`.
    #[must_use]
    pub fn tips_in_palm(&self, angles: &HandAngles<T>, sin_cos: impl Fn(T) -> (T, T)) -> [Point3<T>; 4] {
        let thumb_rotation = sin_cos(angles.thumb_rotation_rad);
        FingerId::ALL.map(|finger| {
            let trig = FingerTrig::new(angles.finger(finger), &sin_cos);
            self.palm_from_finger_base(finger, thumb_rotation) * tip(&self.finger, &trig)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::FingerAngles;
    use core::f64::consts::FRAC_PI_2;

    fn base(finger: FingerId, thumb_rotation_rad: f64) -> IsometryMatrix3<f64> {
        HandModel::hit_dlr().palm_from_finger_base(finger, thumb_rotation_rad.sin_cos())
    }

    /// Compares with a position and finger axes in the palm frame as the released model prints them.
    fn assert_base(found: &IsometryMatrix3<f64>, position: [f64; 3], axes: [[f64; 3]; 3], tolerance: f64) {
        assert!((found.translation.vector - Vector3::from(position)).amax() < tolerance, "{found}");
        let expected = Matrix3::from_columns(&axes.map(Vector3::from));
        assert!((found.rotation.matrix() - expected).amax() < tolerance, "{found}");
    }

    #[test]
    fn bases_are_where_the_published_model_has_them() {
        let x_out = [1.0, 0.0, 0.0];
        let index = [[0.0, 0.0355, 0.9994], [0.0, -0.9994, 0.0355], x_out];
        assert_base(&base(FingerId::Index, 0.3), [-0.0043, 0.040165, 0.14543], index, 1e-4);
        let middle = [[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], x_out];
        assert_base(&base(FingerId::Middle, 0.3), [-0.0043, 0.0, 0.15015], middle, 1e-15);
        let ring = [[0.0, -0.0344, 0.9994], [0.0, -0.9994, -0.0344], x_out];
        assert_base(&base(FingerId::Ring, 0.3), [-0.0043, -0.040165, 0.14543], ring, 1e-4);
    }

    #[test]
    fn the_thumb_turns_from_the_side_to_between_index_and_middle() {
        let aside = [[0.0, 0.5736, 0.8192], [-1.0, 0.0, 0.0], [0.0, -0.8192, 0.5736]];
        assert_base(&base(FingerId::Thumb, 0.0), [-0.009, 0.114, 0.097], aside, 1e-4);
        let opposed = [[0.5736, 0.0, 0.8192], [0.0, 1.0, 0.0], [-0.8192, 0.0, 0.5736]];
        assert_base(&base(FingerId::Thumb, FRAC_PI_2), [0.0839, 0.0331, 0.097], opposed, 1e-4);
    }

    #[test]
    fn the_thumb_turns_right_handed_about_minus_z() {
        let axis = Vector3::from(params::THUMB_AXIS_IN_PALM_M);
        for angle in [0.1, 0.7, 1.5] {
            let turn = Rotation3::from_axis_angle(&-Vector3::z_axis(), angle);
            let palm_from_palm = Translation3::from(axis) * turn * Translation3::from(-axis);
            let expected = palm_from_palm * base(FingerId::Thumb, 0.0);
            let found = base(FingerId::Thumb, angle);
            assert!((found.to_homogeneous() - expected.to_homogeneous()).amax() < 1e-15);
        }
    }

    #[test]
    fn rotations_are_proper() {
        for finger in FingerId::ALL {
            let rotation = base(finger, 0.4).rotation.matrix().clone_owned();
            assert!((rotation.transpose() * rotation - Matrix3::identity()).amax() < 1e-15);
            assert!((rotation.determinant() - 1.0).abs() < 1e-14);
        }
    }

    /// Motion of a tip in the palm when one angle of the open hand grows a little.
    fn tip_motion(finger: FingerId, change: impl Fn(&mut FingerAngles<f64>)) -> Vector3<f64> {
        let hand = HandModel::hit_dlr();
        let mut angles = HandAngles { thumb_rotation_rad: FRAC_PI_2, ..HandAngles::default() };
        let before = hand.tips_in_palm(&angles, f64::sin_cos)[finger.index()];
        change(&mut angles.fingers[finger.index()]);
        hand.tips_in_palm(&angles, f64::sin_cos)[finger.index()] - before
    }

    #[test]
    fn abduction_moves_fingers_to_minus_y_and_the_opposed_thumb_to_plus_y() {
        for finger in FingerId::ALL {
            let motion = tip_motion(finger, |angles| angles.abduction_rad = 0.01);
            let expected = if finger == FingerId::Thumb { 0.001248 } else { -0.001248 };
            assert!((motion.y - expected).abs() < 2e-6, "{} {motion}", finger.name());
        }
    }

    #[test]
    fn flexion_moves_fingers_out_of_the_palm_and_the_opposed_thumb_towards_them() {
        for finger in FingerId::ALL {
            for motion in [
                tip_motion(finger, |angles| angles.flexion_rad = 0.01),
                tip_motion(finger, |angles| angles.middle_rad = 0.01),
            ] {
                assert!(if finger == FingerId::Thumb { motion.x < -5e-4 } else { motion.x > 5e-4 });
            }
        }
    }

    #[test]
    fn two_degrees_of_abduction_cancel_the_built_in_splay() {
        let hand = HandModel::<f64>::hit_dlr();
        let mut angles = HandAngles::default();
        angles.fingers[FingerId::Index.index()].abduction_rad = params::INDEX_SPLAY_RAD;
        angles.fingers[FingerId::Ring.index()].abduction_rad = params::RING_SPLAY_RAD;
        let tips = hand.tips_in_palm(&angles, f64::sin_cos);
        assert!((tips[FingerId::Index.index()].y - 0.040165).abs() < 1e-12);
        assert!((tips[FingerId::Ring.index()].y + 0.040165).abs() < 1e-12);
    }

    #[test]
    fn the_thumb_cannot_touch_the_ring_finger() {
        // Measured on the published model with the same tip: the centres stay 27.8 mm apart, more than two radii.
        // The grid is coarse, so it can only overestimate the distance.
        let hand = HandModel::<f64>::hit_dlr();
        let limits = &hand.soft_limits;
        let grid = |range: &crate::JointRange<f64>, n: usize| -> std::vec::Vec<f64> {
            (0..n)
                .map(|i| range.lower_rad + (range.upper_rad - range.lower_rad) * i as f64 / (n - 1) as f64)
                .collect()
        };
        let mut tips: [std::vec::Vec<Point3<f64>>; 4] = Default::default();
        for &abduction_rad in &grid(&limits.abduction, 5) {
            for &flexion_rad in &grid(&limits.flexion, 33) {
                for &middle_rad in &grid(&limits.middle, 33) {
                    let finger = FingerAngles { abduction_rad, flexion_rad, middle_rad };
                    let angles = HandAngles { thumb_rotation_rad: FRAC_PI_2, fingers: [finger; 4] };
                    for (list, tip) in tips.iter_mut().zip(hand.tips_in_palm(&angles, f64::sin_cos)) {
                        list.push(tip);
                    }
                }
            }
        }
        let nearest = |a: FingerId, b: FingerId| {
            let pairs = tips[a.index()]
                .iter()
                .flat_map(|p| tips[b.index()].iter().map(move |q| (p - q).norm_squared()));
            pairs.fold(f64::INFINITY, f64::min).sqrt()
        };
        let gap = nearest(FingerId::Thumb, FingerId::Ring);
        assert!(gap > 2.0 * hand.finger.tip_radius_m && gap < 0.032, "{gap}");
        for finger in [FingerId::Index, FingerId::Middle] {
            assert!(nearest(FingerId::Thumb, finger) < 2.0 * hand.finger.tip_radius_m);
        }
    }
}
