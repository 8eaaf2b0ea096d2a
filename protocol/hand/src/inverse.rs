//! From the place of a tip to joint angles, in closed form.
//!
//! The distance of the tip from the base depends on the middle joint alone, as a quadratic in its cosine. With
//! `e = 1 - cos q3`, `reach = L1 + L2 + L3` and `r` the distance,
//!
//! `4 L1 L3 e^2 - (8 L1 L3 + 2 L2 (L1 + L3)) e + (reach^2 - r^2) = 0`.
//!
//! Its smaller root, in the form that does not cancel, is the finger's; the other one has
//! `cos q3 < -L2 (L1 + L3) / (4 L1 L3)`, which for this hand is bent by more than 112 degrees. The flexion is then the
//! angle between two plane vectors, the tip's and that of the finger bent by `q3` alone, so its sine and cosine are a
//! complex quotient and nothing here needs a trigonometric function.

use nalgebra::{Point3, RealField, convert};
use protocol::ids::FingerId;

use crate::forward::FingerTrig;
use crate::joints::{FingerAngles, HandLimits, LimitCheck};
use crate::model::FingerGeometry;

/// What rounding may put an angle beyond a limit, radians: far below what any joint sensor resolves.
const LIMIT_TOLERANCE_RAD: f64 = 1e-6;

/// Why no pose puts the tip there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NoPose<T> {
    /// Farther from the base than the stretched finger.
    TooFar {
        /// Distance from the base, metres.
        distance_m: T,
        /// Length of the stretched finger, metres.
        reach_m: T,
    },
    /// Nearer to the base than the fully bent finger.
    TooNear {
        /// Distance from the base, metres.
        distance_m: T,
        /// Smallest distance that any angle of the middle joint gives, metres.
        inner_reach_m: T,
    },
    /// On the axis of abduction, where every abduction gives the same tip.
    OnAbductionAxis,
    /// A coordinate is not a finite number.
    NotFinite,
}

/// Poses that put the tip at a point, before limits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TipInverse<T> {
    /// Two poses with one angle of the middle joint: the tip before the axis of abduction, then, with the abduction half
    /// a turn away, behind it. At most one has an abduction within a quarter turn.
    Reached([FingerTrig<T>; 2]),
    /// None.
    Unreachable(NoPose<T>),
}

/// The pose that puts the tip at a point, within limits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FingerInverse<T> {
    /// The one pose within the limits.
    Reached(FingerAngles<T>),
    /// There are poses, but none within the limits.
    BeyondLimits {
        /// The pose that exceeds them least.
        angles: FingerAngles<T>,
        /// By how much, and at which joint.
        check: LimitCheck<T>,
    },
    /// There is no pose.
    Unreachable(NoPose<T>),
}

/// Sines and cosines of the joints for a tip in the finger's base frame, metres. Square roots and divisions only.
///
/// Accuracy: near the stretched finger the middle joint's angle goes with the square root of the distance that is left,
/// so there the relative rounding of the point shows as its square root (about 1e-8 rad in `f64`, 1e-3 rad in `f32`).
#[must_use]
pub fn inverse_trig<T: RealField + Copy>(
    finger: &FingerGeometry<T>,
    tip_in_base: &Point3<T>,
) -> TipInverse<T> {
    let &FingerGeometry { l1_m: l1, l2_m: l2, l3_m: l3, .. } = finger;
    let (one, two) = (T::one(), T::one() + T::one());
    let distance_2 = tip_in_base.coords.norm_squared();
    if !distance_2.is_finite() {
        return TipInverse::Unreachable(NoPose::NotFinite);
    }
    let reach_m = l1 + l2 + l3;
    let square = two * two * l1 * l3;
    let linear = two * square + two * l2 * (l1 + l3);
    let rounding = convert::<f64, T>(16.0) * T::default_epsilon();
    let short_of_reach = reach_m * reach_m - distance_2;
    if short_of_reach < -rounding * reach_m * reach_m {
        return TipInverse::Unreachable(NoPose::TooFar { distance_m: distance_2.sqrt(), reach_m });
    }
    let short_of_reach = short_of_reach.max(T::zero());
    let discriminant = linear * linear - two * two * square * short_of_reach;
    let versine = two * short_of_reach / (linear + discriminant.max(T::zero()).sqrt());
    if discriminant < T::zero() || versine > two {
        let innermost = (linear / (two * square)).min(two);
        let inner_reach_2 = reach_m * reach_m - (linear - square * innermost) * innermost;
        return TipInverse::Unreachable(NoPose::TooNear {
            distance_m: distance_2.sqrt(),
            inner_reach_m: inner_reach_2.max(T::zero()).sqrt(),
        });
    }
    let from_axis = tip_in_base.coords.xy().norm();
    if from_axis <= rounding * reach_m {
        return TipInverse::Unreachable(NoPose::OnAbductionAxis);
    }

    let middle @ (sin_3, cos_3) = ((versine * (two - versine)).sqrt(), one - versine);
    let (sin_33, cos_33) = (two * sin_3 * cos_3, one - two * sin_3 * sin_3);
    // The tip of the finger bent by q3 alone, in the plane of the finger.
    let (along, across) = (l1 + l2 * cos_3 + l3 * cos_33, l2 * sin_3 + l3 * sin_33);
    let squared = along * along + across * across;
    let pose = |from_axis: T| {
        let abduction = (tip_in_base.y / from_axis, tip_in_base.x / from_axis);
        let flexion = (
            (tip_in_base.z * along - from_axis * across) / squared,
            (from_axis * along + tip_in_base.z * across) / squared,
        );
        FingerTrig::from_pairs(abduction, flexion, middle)
    };
    TipInverse::Reached([pose(from_axis), pose(-from_axis)])
}

/// Joint angles for a tip in the finger's base frame, metres, with the caller's `atan2(y, x)`.
///
/// `finger_id` only names the joint in the answer.
///
/// ```
/// use hand_model::{FingerAngles, FingerInverse, FingerTrig, HandModel, inverse_angles, tip};
/// use protocol::ids::FingerId;
/// let hand = HandModel::<f64>::hit_dlr();
/// let angles = FingerAngles { abduction_rad: -0.1, flexion_rad: 0.7, middle_rad: 0.5 };
/// let tip = tip(&hand.finger, &FingerTrig::new(&angles, f64::sin_cos));
/// let inverse = inverse_angles(&hand.finger, &hand.soft_limits, FingerId::Ring, &tip, f64::atan2);
/// let FingerInverse::Reached(found) = inverse else { unreachable!("{inverse:?}") };
/// assert!((found.flexion_rad - 0.7).abs() < 1e-12);
/// ```
#[must_use]
pub fn inverse_angles<T: RealField + Copy>(
    finger: &FingerGeometry<T>,
    limits: &HandLimits<T>,
    finger_id: FingerId,
    tip_in_base: &Point3<T>,
    atan2: impl Fn(T, T) -> T,
) -> FingerInverse<T> {
    let poses = match inverse_trig(finger, tip_in_base) {
        TipInverse::Reached(poses) => poses,
        TipInverse::Unreachable(why) => return FingerInverse::Unreachable(why),
    };
    let [before, behind] = poses.map(|trig| {
        let angle = |(sin, cos): (T, T)| atan2(sin, cos);
        let angles = FingerAngles {
            abduction_rad: angle(trig.abduction),
            flexion_rad: angle(trig.flexion),
            middle_rad: angle(trig.middle),
        };
        (angles, limits.check_finger(finger_id, &angles))
    });
    let (angles, check) = if excess_rad(&behind.1) < excess_rad(&before.1) { behind } else { before };
    match check {
        LimitCheck::Beyond { excess_rad, .. } if excess_rad > convert(LIMIT_TOLERANCE_RAD) => {
            FingerInverse::BeyondLimits { angles, check }
        }
        LimitCheck::NotANumber { .. } => FingerInverse::Unreachable(NoPose::NotFinite),
        LimitCheck::Within | LimitCheck::Beyond { .. } => {
            FingerInverse::Reached(limits.clamp_finger(&angles))
        }
    }
}

fn excess_rad<T: RealField + Copy>(check: &LimitCheck<T>) -> T {
    match check {
        LimitCheck::Beyond { excess_rad, .. } => *excess_rad,
        LimitCheck::Within | LimitCheck::NotANumber { .. } => T::zero(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Poses;
    use crate::{HandModel, Side, tip};
    use protocol::ids::{FingerJoint, JointId};

    fn tip_of(hand: &HandModel<f64>, angles: &FingerAngles<f64>) -> Point3<f64> {
        tip(&hand.finger, &FingerTrig::new(angles, f64::sin_cos))
    }

    fn inverse(hand: &HandModel<f64>, tip: &Point3<f64>) -> FingerInverse<f64> {
        inverse_angles(&hand.finger, &hand.soft_limits, FingerId::Index, tip, f64::atan2)
    }

    #[test]
    fn every_pose_within_the_limits_is_found_and_is_the_only_one() {
        let hand = HandModel::<f64>::hit_dlr();
        let mut worst_rad = 0.0_f64;
        let mut behind = 0;
        for angles in Poses::new(9).take_soft(20_000) {
            let tip = tip_of(&hand, &angles);
            let FingerInverse::Reached(found) = inverse(&hand, &tip) else { panic!("{angles:?}") };
            for (a, b) in found.to_array().into_iter().zip(angles.to_array()) {
                worst_rad = worst_rad.max((a - b).abs());
            }
            let TipInverse::Reached(poses) = inverse_trig(&hand.finger, &tip) else { panic!("{angles:?}") };
            let within = poses.map(|trig| {
                let angles = [trig.abduction, trig.flexion, trig.middle].map(|(sin, cos)| sin.atan2(cos));
                hand.soft_limits.check_finger(FingerId::Index, &FingerAngles::from_array(&angles))
                    == LimitCheck::Within
            });
            assert_eq!(within.iter().filter(|&&w| w).count(), 1, "{angles:?}");
            behind += usize::from(within[1]);
        }
        assert!(worst_rad < 1e-9, "{worst_rad}");
        assert!(behind > 100, "the bent finger's tip passes behind the axis of abduction: {behind}");
    }

    #[test]
    fn both_poses_reach_the_point() {
        let hand = HandModel::<f64>::hit_dlr();
        let mut poses = Poses::new(10);
        let mut reached = 0;
        for _ in 0..5000 {
            let point = Point3::from(core::array::from_fn::<f64, 3, _>(|_| poses.uniform(-0.13, 0.13)));
            if let TipInverse::Reached(found) = inverse_trig(&hand.finger, &point) {
                reached += 1;
                for trig in found {
                    assert!((tip(&hand.finger, &trig) - point).norm() < 1e-14, "{point}");
                    for (sin, cos) in [trig.abduction, trig.flexion, trig.middle] {
                        assert!((sin.hypot(cos) - 1.0).abs() < 1e-12);
                    }
                }
            }
        }
        assert!(reached > 1000);
    }

    #[test]
    fn no_pose_reaches_what_is_called_unreachable() {
        let hand = HandModel::<f64>::hit_dlr();
        let distance = |q3: f64| {
            let finger = &hand.finger;
            let along = finger.l1_m + finger.l2_m * q3.cos() + finger.l3_m * (2.0 * q3).cos();
            along.hypot(finger.l2_m * q3.sin() + finger.l3_m * (2.0 * q3).sin())
        };
        let all = || (0..=100_000).map(|i| distance(core::f64::consts::PI * f64::from(i) / 1e5));
        let (near, far) = (all().fold(f64::INFINITY, f64::min), all().fold(0.0, f64::max));

        let direction = nalgebra::Vector3::new(0.6, 0.0, 0.8);
        let at = |distance_m: f64| inverse_trig(&hand.finger, &Point3::from(direction * distance_m));
        let TipInverse::Unreachable(NoPose::TooFar { reach_m, .. }) = at(far + 1e-6) else { panic!() };
        assert!((reach_m - far).abs() < 1e-12);
        let TipInverse::Unreachable(NoPose::TooNear { inner_reach_m, .. }) = at(near - 1e-6) else {
            panic!()
        };
        assert!((inner_reach_m - near).abs() < 1e-9);
        assert!(matches!(at(far), TipInverse::Reached(_)));
        assert!(matches!(at(near + 1e-6), TipInverse::Reached(_)));
    }

    #[test]
    fn the_joint_that_stops_a_finger_is_named() {
        let hand = HandModel::<f64>::hit_dlr();
        for (joint, angles) in [
            (FingerJoint::Abduction, [0.5, 0.6, 0.6]),
            (FingerJoint::Flexion, [0.1, 1.5, 0.6]),
            (FingerJoint::Middle, [0.1, 0.6, 1.5]),
        ] {
            let angles = FingerAngles::from_array(&angles);
            let FingerInverse::BeyondLimits { angles: found, check } =
                inverse(&hand, &tip_of(&hand, &angles))
            else {
                panic!("{joint:?}");
            };
            let upper_rad = hand.soft_limits.range(JointId::of(FingerId::Index, joint)).upper_rad;
            let LimitCheck::Beyond { joint: named, side: Side::Upper, excess_rad } = check else {
                panic!("{check:?}")
            };
            assert_eq!(named, JointId::of(FingerId::Index, joint));
            assert!((excess_rad - (angles.to_array()[joint.index()] - upper_rad)).abs() < 1e-12);
            assert!((found.middle_rad - angles.middle_rad).abs() < 1e-12);
        }
    }

    #[test]
    fn ends_of_the_hard_limits_are_within_them() {
        let hand = HandModel::<f64>::hit_dlr();
        let limits = hand.hard_limits;
        for pick in 0..8 {
            let end = |range: crate::JointRange<f64>, bit: u32| {
                if pick >> bit & 1 == 0 { range.lower_rad } else { range.upper_rad }
            };
            let angles = [end(limits.abduction, 0), end(limits.flexion, 1), end(limits.middle, 2)];
            let tip = tip_of(&hand, &FingerAngles::from_array(&angles));
            let found = inverse_angles(&hand.finger, &limits, FingerId::Thumb, &tip, f64::atan2);
            // Stretched and bent by a right angle at the base, a finger points along its axis of abduction.
            if pick >> 1 == 0b01 {
                assert_eq!(found, FingerInverse::Unreachable(NoPose::OnAbductionAxis));
            } else {
                assert!(matches!(found, FingerInverse::Reached(_)), "{angles:?} {found:?}");
            }
        }
    }

    #[test]
    fn odd_points_have_odd_answers() {
        let hand = HandModel::<f64>::hit_dlr();
        let at = |x, y, z| inverse(&hand, &Point3::new(x, y, z));
        for bad in [f64::NAN, f64::INFINITY, f64::MAX] {
            assert_eq!(at(bad, 0.0, 0.0), FingerInverse::Unreachable(NoPose::NotFinite));
            assert_eq!(at(0.1, 0.0, bad), FingerInverse::Unreachable(NoPose::NotFinite));
        }
        assert_eq!(at(0.0, 0.0, 0.1), FingerInverse::Unreachable(NoPose::OnAbductionAxis));
        assert!(matches!(at(0.0, 0.0, 0.0), FingerInverse::Unreachable(NoPose::TooNear { .. })));
    }

    #[test]
    fn single_precision_is_good_to_a_tenth_of_a_milliradian() {
        let hand = HandModel::<f32>::hit_dlr();
        for angles in Poses::new(12).take_soft(20_000) {
            let angles = FingerAngles::from_array(&angles.to_array().map(|q| q as f32));
            let tip = tip(&hand.finger, &FingerTrig::new(&angles, f32::sin_cos));
            let found = inverse_angles(&hand.finger, &hand.soft_limits, FingerId::Index, &tip, f32::atan2);
            match found {
                FingerInverse::Reached(found) => {
                    for (a, b) in found.to_array().into_iter().zip(angles.to_array()) {
                        assert!((a - b).abs() < 1e-4, "{angles:?} {found:?}");
                    }
                }
                // A pose at a limit may come out a rounding beyond it.
                FingerInverse::BeyondLimits { check: LimitCheck::Beyond { excess_rad, .. }, .. } => {
                    assert!(excess_rad < 1e-4, "{angles:?}");
                }
                other => panic!("{angles:?} {other:?}"),
            }
        }
    }
}
