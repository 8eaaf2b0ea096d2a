//! Names and order of fingers and joints. The order is part of the wire: a number is never reused.

use core::ops::Range;

/// Fingers of the hand.
pub const FINGER_COUNT: usize = 4;

/// Actuated joints of one finger; the distal joint follows the middle one.
pub const JOINTS_PER_FINGER: usize = 3;

/// Actuators of the hand: the rotation of the thumb's base, then three joints for each finger.
pub const JOINT_COUNT: usize = 1 + FINGER_COUNT * JOINTS_PER_FINGER;

/// A finger of the right hand.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum FingerId {
    /// The opposing finger, on a base that turns about the palm.
    Thumb = 0,
    /// First finger, on the thumb's side.
    Index = 1,
    /// Second finger, in the middle of the palm.
    Middle = 2,
    /// Third finger.
    Ring = 3,
}

impl FingerId {
    /// All fingers in the order of their numbers.
    pub const ALL: [Self; FINGER_COUNT] = [Self::Thumb, Self::Index, Self::Middle, Self::Ring];

    /// Position in [`Self::ALL`].
    #[must_use]
    pub const fn index(self) -> usize {
        self as usize
    }

    /// The finger at `index` of [`Self::ALL`]; `None` from [`FINGER_COUNT`] on.
    #[must_use]
    pub const fn from_index(index: usize) -> Option<Self> {
        if index < FINGER_COUNT { Some(Self::ALL[index]) } else { None }
    }

    /// Indices of the joints that [move](JointId::moves) the finger.
    #[must_use]
    pub const fn joints(self) -> Range<usize> {
        let end = 1 + (self.index() + 1) * JOINTS_PER_FINGER;
        match self {
            Self::Thumb => 0..end,
            Self::Index | Self::Middle | Self::Ring => end - JOINTS_PER_FINGER..end,
        }
    }

    /// Lower-case name, as in plans and logs.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Thumb => "thumb",
            Self::Index => "index",
            Self::Middle => "middle",
            Self::Ring => "ring",
        }
    }
}

/// An actuated joint within a finger, from the palm outwards.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum FingerJoint {
    /// Sideways motion at the base.
    Abduction = 0,
    /// Bending at the base.
    Flexion = 1,
    /// Bending of the middle joint, which the distal joint repeats.
    Middle = 2,
}

impl FingerJoint {
    /// All joints of a finger in the order of their numbers.
    pub const ALL: [Self; JOINTS_PER_FINGER] = [Self::Abduction, Self::Flexion, Self::Middle];

    /// Position in [`Self::ALL`].
    #[must_use]
    pub const fn index(self) -> usize {
        self as usize
    }
}

/// An actuator of the hand. Every array of [`JOINT_COUNT`] entries is in this order: `thumb_rotation`, then thumb,
/// index, middle and ring, each with abduction, flexion and middle joint.
///
/// ```
/// use protocol::ids::{FingerId, FingerJoint, JointId};
/// let joint = JointId::of(FingerId::Index, FingerJoint::Abduction);
/// assert_eq!((joint.index(), joint.name()), (4, "index_abduction"));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum JointId {
    /// The turning base of the thumb.
    ThumbRotation = 0,
    /// Sideways motion of the thumb.
    ThumbAbduction = 1,
    /// Bending of the thumb at its base.
    ThumbFlexion = 2,
    /// Bending of the thumb at its middle joint.
    ThumbMiddle = 3,
    /// Sideways motion of the index finger.
    IndexAbduction = 4,
    /// Bending of the index finger at its base.
    IndexFlexion = 5,
    /// Bending of the index finger at its middle joint.
    IndexMiddle = 6,
    /// Sideways motion of the middle finger.
    MiddleAbduction = 7,
    /// Bending of the middle finger at its base.
    MiddleFlexion = 8,
    /// Bending of the middle finger at its middle joint.
    MiddleMiddle = 9,
    /// Sideways motion of the ring finger.
    RingAbduction = 10,
    /// Bending of the ring finger at its base.
    RingFlexion = 11,
    /// Bending of the ring finger at its middle joint.
    RingMiddle = 12,
}

impl JointId {
    /// The turning base of the thumb.
    pub const THUMB_ROTATION: Self = Self::ThumbRotation;

    /// All actuators in wire order.
    pub const ALL: [Self; JOINT_COUNT] = [
        Self::ThumbRotation,
        Self::ThumbAbduction,
        Self::ThumbFlexion,
        Self::ThumbMiddle,
        Self::IndexAbduction,
        Self::IndexFlexion,
        Self::IndexMiddle,
        Self::MiddleAbduction,
        Self::MiddleFlexion,
        Self::MiddleMiddle,
        Self::RingAbduction,
        Self::RingFlexion,
        Self::RingMiddle,
    ];

    /// The actuator of one joint of a finger.
    #[must_use]
    pub const fn of(finger: FingerId, joint: FingerJoint) -> Self {
        Self::ALL[1 + finger.index() * JOINTS_PER_FINGER + joint.index()]
    }

    /// The actuator at `index` of [`Self::ALL`]; `None` from [`JOINT_COUNT`] on.
    #[must_use]
    pub const fn from_index(index: usize) -> Option<Self> {
        if index < JOINT_COUNT { Some(Self::ALL[index]) } else { None }
    }

    /// The actuator with this [`Self::name`].
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|joint| joint.name() == name)
    }

    /// Position in [`Self::ALL`].
    #[must_use]
    pub const fn index(self) -> usize {
        self as usize
    }

    /// Finger and joint; `None` for the thumb's rotation, which belongs to the palm.
    #[must_use]
    pub const fn finger_joint(self) -> Option<(FingerId, FingerJoint)> {
        // A table: firmware asks a hundred times a control period.
        const TABLE: [Option<(FingerId, FingerJoint)>; JOINT_COUNT] = {
            let mut table = [None; JOINT_COUNT];
            let mut i = 1;
            while i < JOINT_COUNT {
                let finger = FingerId::ALL[(i - 1) / JOINTS_PER_FINGER];
                table[i] = Some((finger, FingerJoint::ALL[(i - 1) % JOINTS_PER_FINGER]));
                i += 1;
            }
            table
        };
        TABLE[self.index()]
    }

    /// The finger that the joint moves. The thumb's rotation moves the thumb.
    #[must_use]
    pub const fn moves(self) -> FingerId {
        match self.finger_joint() {
            Some((finger, _)) => finger,
            None => FingerId::Thumb,
        }
    }

    /// Lower-case name, as in plans and logs.
    #[must_use]
    pub const fn name(self) -> &'static str {
        const NAMES: [&str; JOINT_COUNT] = [
            "thumb_rotation",
            "thumb_abduction",
            "thumb_flexion",
            "thumb_middle",
            "index_abduction",
            "index_flexion",
            "index_middle",
            "middle_abduction",
            "middle_flexion",
            "middle_middle",
            "ring_abduction",
            "ring_flexion",
            "ring_middle",
        ];
        NAMES[self.index()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::format;

    #[test]
    fn finger_numbers_are_their_places() {
        for (i, finger) in FingerId::ALL.into_iter().enumerate() {
            assert_eq!(finger.index(), i);
            assert_eq!(FingerId::from_index(i), Some(finger));
        }
        assert_eq!(FingerId::from_index(FINGER_COUNT), None);
    }

    #[test]
    fn every_joint_is_found_by_index_name_and_finger() {
        for (i, id) in JointId::ALL.into_iter().enumerate() {
            assert_eq!(id.index(), i);
            assert_eq!(JointId::from_index(i), Some(id));
            assert_eq!(JointId::from_name(id.name()), Some(id));
            match id.finger_joint() {
                Some((finger, joint)) => {
                    assert_eq!(JointId::of(finger, joint), id);
                    assert_eq!(id.name(), format!("{}_{joint:?}", finger.name()).to_lowercase());
                }
                None => assert_eq!(id, JointId::THUMB_ROTATION),
            }
        }
        assert_eq!(JointId::from_index(JOINT_COUNT), None);
        assert_eq!(JointId::from_name("little_flexion"), None);
    }

    #[test]
    fn the_wire_order_is_finger_major_after_the_thumb_rotation() {
        assert_eq!(JOINT_COUNT, 13);
        assert_eq!(JointId::of(FingerId::Thumb, FingerJoint::Abduction).index(), 1);
        assert_eq!(JointId::of(FingerId::Ring, FingerJoint::Middle).index(), 12);
    }
}
