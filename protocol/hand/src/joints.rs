//! Joint angles and their limits.

use nalgebra::RealField;
use protocol::ids::{FINGER_COUNT, FingerId, FingerJoint, JOINT_COUNT, JointId};

/// Angles of one finger's actuated joints, radians.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FingerAngles<T> {
    /// Sideways, about +z of the finger base.
    pub abduction_rad: T,
    /// Bending at the base, about -y of the finger base.
    pub flexion_rad: T,
    /// Bending of the middle joint, and of the distal joint with it.
    pub middle_rad: T,
}

impl<T: Copy> FingerAngles<T> {
    /// Abduction, flexion, middle joint.
    #[must_use]
    pub fn to_array(&self) -> [T; 3] {
        [self.abduction_rad, self.flexion_rad, self.middle_rad]
    }

    /// From abduction, flexion, middle joint.
    #[must_use]
    pub fn from_array(&[abduction_rad, flexion_rad, middle_rad]: &[T; 3]) -> Self {
        Self { abduction_rad, flexion_rad, middle_rad }
    }
}

/// Angles of all actuators, radians.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct HandAngles<T> {
    /// Rotation of the thumb's base about palm -z: 0 to the side, a quarter turn opposed to the fingers.
    pub thumb_rotation_rad: T,
    /// The fingers, by [`FingerId::index`].
    pub fingers: [FingerAngles<T>; FINGER_COUNT],
}

impl<T: Copy> HandAngles<T> {
    /// Angles in the order of [`JointId::ALL`].
    #[must_use]
    pub fn to_array(&self) -> [T; JOINT_COUNT] {
        let mut array = [self.thumb_rotation_rad; JOINT_COUNT];
        for (slots, finger) in array[1..].chunks_exact_mut(3).zip(&self.fingers) {
            slots.copy_from_slice(&finger.to_array());
        }
        array
    }

    /// From angles in the order of [`JointId::ALL`].
    #[must_use]
    pub fn from_array(array: &[T; JOINT_COUNT]) -> Self {
        let angle = |finger, joint| array[JointId::of(finger, joint).index()];
        Self {
            thumb_rotation_rad: array[JointId::THUMB_ROTATION.index()],
            fingers: FingerId::ALL.map(|finger| FingerAngles {
                abduction_rad: angle(finger, FingerJoint::Abduction),
                flexion_rad: angle(finger, FingerJoint::Flexion),
                middle_rad: angle(finger, FingerJoint::Middle),
            }),
        }
    }

    /// The angles of one finger.
    #[must_use]
    pub fn finger(&self, finger: FingerId) -> &FingerAngles<T> {
        &self.fingers[finger.index()]
    }
}

/// What one joint may do, radians; both ends belong to it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointRange<T> {
    /// Smallest angle.
    pub lower_rad: T,
    /// Largest angle.
    pub upper_rad: T,
}

/// An end of a range.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// The smallest angle.
    Lower,
    /// The largest angle.
    Upper,
}

/// Whether angles keep their limits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LimitCheck<T> {
    /// All do.
    Within,
    /// At least one does not; this is the one that is farthest out.
    Beyond {
        /// The joint.
        joint: JointId,
        /// The end that it passed.
        side: Side,
        /// How far, radians; positive.
        excess_rad: T,
    },
    /// An angle is not a number.
    NotANumber {
        /// The first such joint.
        joint: JointId,
    },
}

/// Ranges of all joints. The four fingers are equal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HandLimits<T> {
    /// Rotation of the thumb's base.
    pub thumb_rotation: JointRange<T>,
    /// Abduction of each finger.
    pub abduction: JointRange<T>,
    /// Flexion of each finger.
    pub flexion: JointRange<T>,
    /// Middle joint of each finger.
    pub middle: JointRange<T>,
}

impl<T: RealField + Copy> JointRange<T> {
    /// The nearest angle of the range. NaN stays NaN.
    #[must_use]
    pub fn clamp(&self, angle_rad: T) -> T {
        if angle_rad < self.lower_rad {
            self.lower_rad
        } else if angle_rad > self.upper_rad {
            self.upper_rad
        } else {
            angle_rad
        }
    }

    /// Whether the angle is in the range; NaN is not.
    #[must_use]
    pub fn contains(&self, angle_rad: T) -> bool {
        self.lower_rad <= angle_rad && angle_rad <= self.upper_rad
    }

    /// The end that is passed and by how much.
    fn excess(&self, angle_rad: T) -> (Side, T) {
        let (below, above) = (self.lower_rad - angle_rad, angle_rad - self.upper_rad);
        if below > above { (Side::Lower, below) } else { (Side::Upper, above) }
    }
}

impl<T: RealField + Copy> HandLimits<T> {
    /// The range of one actuator.
    #[must_use]
    pub fn range(&self, joint: JointId) -> JointRange<T> {
        match joint.finger_joint() {
            None => self.thumb_rotation,
            Some((_, FingerJoint::Abduction)) => self.abduction,
            Some((_, FingerJoint::Flexion)) => self.flexion,
            Some((_, FingerJoint::Middle)) => self.middle,
        }
    }

    /// Checks a whole hand.
    ///
    /// ```
    /// use hand_model::{HandAngles, HandModel, LimitCheck, Side};
    /// let limits = HandModel::<f64>::hit_dlr().soft_limits;
    /// let mut angles = limits.clamp(&HandAngles::default());
    /// assert_eq!(limits.check(&angles), LimitCheck::Within);
    /// angles.fingers[3].flexion_rad = 2.0;
    /// let LimitCheck::Beyond { joint, side, excess_rad } = limits.check(&angles) else { unreachable!() };
    /// assert_eq!((joint.name(), side), ("ring_flexion", Side::Upper));
    /// assert!((excess_rad - (2.0 - 75.0_f64.to_radians())).abs() < 1e-12);
    /// ```
    #[must_use]
    pub fn check(&self, angles: &HandAngles<T>) -> LimitCheck<T> {
        let array = angles.to_array();
        self.check_each(JointId::ALL.into_iter().map(|joint| (joint, array[joint.index()])))
    }

    /// Checks one finger.
    #[must_use]
    pub fn check_finger(&self, finger: FingerId, angles: &FingerAngles<T>) -> LimitCheck<T> {
        let array = angles.to_array();
        self.check_each(FingerJoint::ALL.into_iter().map(|j| (JointId::of(finger, j), array[j.index()])))
    }

    fn check_each(&self, angles: impl Iterator<Item = (JointId, T)>) -> LimitCheck<T> {
        let mut worst = LimitCheck::Within;
        let mut worst_rad = T::zero();
        for (joint, angle_rad) in angles {
            let (side, excess_rad) = self.range(joint).excess(angle_rad);
            if excess_rad > worst_rad {
                worst_rad = excess_rad;
                worst = LimitCheck::Beyond { joint, side, excess_rad };
            } else if angle_rad.partial_cmp(&angle_rad).is_none() {
                return LimitCheck::NotANumber { joint };
            }
        }
        worst
    }

    /// The nearest angles within the limits, joint by joint. NaN stays NaN; [`Self::check`] tells.
    #[must_use]
    pub fn clamp(&self, angles: &HandAngles<T>) -> HandAngles<T> {
        let mut array = angles.to_array();
        for joint in JointId::ALL {
            let angle = &mut array[joint.index()];
            *angle = self.range(joint).clamp(*angle);
        }
        HandAngles::from_array(&array)
    }

    /// The nearest angles of one finger within the limits, joint by joint. NaN stays NaN.
    #[must_use]
    pub fn clamp_finger(&self, angles: &FingerAngles<T>) -> FingerAngles<T> {
        FingerAngles {
            abduction_rad: self.abduction.clamp(angles.abduction_rad),
            flexion_rad: self.flexion.clamp(angles.flexion_rad),
            middle_rad: self.middle.clamp(angles.middle_rad),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::HandModel;

    fn counting() -> HandAngles<f64> {
        HandAngles::from_array(&core::array::from_fn(|i| i as f64))
    }

    #[test]
    fn arrays_follow_the_joint_order() {
        let angles = counting();
        for joint in JointId::ALL {
            let there = match joint.finger_joint() {
                None => angles.thumb_rotation_rad,
                Some((finger, j)) => angles.finger(finger).to_array()[j.index()],
            };
            assert_eq!(there, joint.index() as f64, "{}", joint.name());
        }
        assert_eq!(HandAngles::from_array(&angles.to_array()), angles);
        let thumb = angles.finger(FingerId::Thumb);
        assert_eq!(FingerAngles::from_array(&thumb.to_array()), *thumb);
    }

    #[test]
    fn the_joint_that_is_farthest_out_is_named() {
        let limits = HandModel::<f64>::hit_dlr().hard_limits;
        let mut angles = HandAngles::default();
        assert_eq!(limits.check(&angles), LimitCheck::Within);
        for joint in JointId::ALL {
            let range = limits.range(joint);
            for (side, angle) in
                [(Side::Lower, range.lower_rad - 0.25), (Side::Upper, range.upper_rad + 0.25)]
            {
                let mut array = angles.to_array();
                array[12] += 1.5;
                array[joint.index()] = angle;
                let expected = if joint.index() == 12 { 0.25 } else { 1.5 - 80.0_f64.to_radians() };
                let LimitCheck::Beyond { joint: found, side: found_side, excess_rad } =
                    limits.check(&HandAngles::from_array(&array))
                else {
                    panic!("{} is out", joint.name());
                };
                assert_eq!((found, found_side), (joint, side));
                assert!((excess_rad - expected.max(0.25)).abs() < 1e-12);
            }
        }
        angles.fingers[2].flexion_rad = f64::NAN;
        let joint = JointId::of(FingerId::Middle, FingerJoint::Flexion);
        assert_eq!(limits.check(&angles), LimitCheck::NotANumber { joint });
        assert_eq!(
            limits.check_finger(FingerId::Middle, &angles.fingers[2]),
            LimitCheck::NotANumber { joint }
        );
    }

    #[test]
    fn clamping_moves_only_what_is_out() {
        let hand = HandModel::<f64>::hit_dlr();
        let limits = hand.soft_limits;
        let clamped = limits.clamp(&counting());
        assert_eq!(limits.check(&clamped), LimitCheck::Within);
        assert_eq!(clamped.fingers[0].abduction_rad, limits.abduction.upper_rad);
        assert_eq!(clamped.fingers[0], limits.clamp_finger(&counting().fingers[0]));
        assert_eq!(limits.clamp(&clamped), clamped);
        assert_eq!(clamped.thumb_rotation_rad, 0.0);
    }

    #[test]
    fn soft_limits_lie_within_the_hard_ones() {
        let hand = HandModel::<f64>::hit_dlr();
        for joint in JointId::ALL {
            let (soft, hard) = (hand.soft_limits.range(joint), hand.hard_limits.range(joint));
            assert!(soft.lower_rad < soft.upper_rad);
            assert!(hard.contains(soft.lower_rad) && hard.contains(soft.upper_rad), "{}", joint.name());
            assert!(!hard.contains(f64::NAN));
        }
    }
}
