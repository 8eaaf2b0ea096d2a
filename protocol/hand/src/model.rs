//! The hand as one value: geometry, limits, drives, masses. [`HandModel::hit_dlr`] is the built-in one; a caller may
//! change any field of the `f64` model and [`HandModel::cast`] it to the firmware's scalar.

use nalgebra::{IsometryMatrix3, Point3, RealField, convert};
use protocol::ids::FINGER_COUNT;

use crate::frames::hit_dlr_mounts;
use crate::joints::{HandLimits, JointRange};
use crate::params;

/// Lengths of a finger, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FingerGeometry<T> {
    /// Base axes to middle joint.
    pub l1_m: T,
    /// Middle joint to distal joint.
    pub l2_m: T,
    /// Distal joint to the centre of the tip's sphere.
    pub l3_m: T,
    /// Radius of the tip's sphere.
    pub tip_radius_m: T,
}

/// Where the fingers are fixed to the palm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FingerMounts<T: RealField> {
    /// A point of the axis of the thumb's rotation, whose direction is palm -z, metres.
    pub thumb_axis_in_palm: Point3<T>,
    /// The thumb's base at rotation 0.
    pub palm_from_thumb_base_at_zero: IsometryMatrix3<T>,
    /// The index finger's base.
    pub palm_from_index_base: IsometryMatrix3<T>,
    /// The middle finger's base.
    pub palm_from_middle_base: IsometryMatrix3<T>,
    /// The ring finger's base.
    pub palm_from_ring_base: IsometryMatrix3<T>,
}

/// Drives of a finger. Triples are abduction, flexion and middle joint, the last with the distal joint on it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DriveParameters<T> {
    /// Largest torque of each actuator at its joint.
    pub torque_max_nm: [T; 3],
    /// Largest joint speed.
    pub speed_max_rad_per_s: T,
    /// Continuous force that a fingertip may bear.
    pub tip_force_max_n: T,
    /// Motor turns per joint turn.
    pub gear_ratio: T,
    /// Inertia of a rotor seen at its joint.
    pub rotor_inertia_kg_m2: T,
    /// Stiffness between motor and joint.
    pub stiffness_nm_per_rad: T,
    /// Coulomb friction at a joint.
    pub coulomb_friction_nm: T,
    /// Viscous friction at a joint.
    pub viscous_friction_nm_s_per_rad: T,
}

/// The turning base of the thumb: commanded in steps between grasps, then braked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ThumbRotation<T> {
    /// Speed of the turning base.
    pub speed_max_rad_per_s: T,
    /// Torque that the brake holds.
    pub holding_torque_nm: T,
    /// Step of the command.
    pub step_rad: T,
}

/// A rigid link, in its own frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinkMass<T> {
    /// Mass.
    pub mass_kg: T,
    /// Centre of mass on the link's x axis, from its joint.
    pub com_m: T,
    /// Moments of inertia about the centre of mass and the link's x, y and z, which are principal axes.
    pub inertia_kg_m2: [T; 3],
}

/// Masses of a finger.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FingerMasses<T> {
    /// The part between the axes of abduction and flexion; its frame turns with the abduction only.
    pub base: LinkMass<T>,
    /// Proximal link.
    pub proximal: LinkMass<T>,
    /// Middle link.
    pub middle: LinkMass<T>,
    /// Distal link with the tip.
    pub distal: LinkMass<T>,
}

/// A box along the axes of the palm frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PalmBox<T: RealField> {
    /// Corner with the smallest coordinates, metres.
    pub min_in_palm: Point3<T>,
    /// Corner with the largest coordinates, metres.
    pub max_in_palm: Point3<T>,
}

/// Simple solids for collision: a capsule from joint to joint for each link, a box for the palm. The distal capsule ends
/// in the tip's sphere, which is the body that touches objects.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CollisionGeometry<T: RealField> {
    /// Radii of the proximal, middle and distal capsule, metres.
    pub link_radii_m: [T; 3],
    /// The palm, clear of the fingers' roots.
    pub palm: PalmBox<T>,
}

/// A four-finger hand of the HIT/DLR kind: equal fingers with coupled distal joints and a thumb that turns.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HandModel<T: RealField> {
    /// Lengths of every finger.
    pub finger: FingerGeometry<T>,
    /// Where the fingers stand in the palm.
    pub mounts: FingerMounts<T>,
    /// What the mechanism allows.
    pub hard_limits: HandLimits<T>,
    /// What plans should keep to: near the hard ends contact is poor.
    pub soft_limits: HandLimits<T>,
    /// Drives of every finger.
    pub drive: DriveParameters<T>,
    /// The thumb's turning base.
    pub thumb_rotation: ThumbRotation<T>,
    /// Masses of every finger.
    pub masses: FingerMasses<T>,
    /// Mass of the palm with the thumb's support.
    pub palm_mass_kg: T,
    /// Solids for collision.
    pub collision: CollisionGeometry<T>,
    /// Where the middle of a grasped object is best, palm frame, metres.
    pub grasp_centre_in_palm: Point3<T>,
}

/// A solid capsule's moments of inertia about its centre, `[axial, transverse, transverse]`, kg m^2.
///
/// A cylinder of `length_m` and two half spheres share the mass by volume; a half sphere's own centre is 3/8 of the
/// radius from its face.
const fn capsule_inertia_kg_m2(mass_kg: f64, length_m: f64, radius_m: f64) -> [f64; 3] {
    let r2 = radius_m * radius_m;
    let cylinder_kg = mass_kg * length_m / (length_m + 4.0 / 3.0 * radius_m);
    let sphere_kg = mass_kg - cylinder_kg;
    let axial = 0.5 * cylinder_kg * r2 + 0.4 * sphere_kg * r2;
    let transverse = cylinder_kg * (length_m * length_m / 12.0 + r2 / 4.0)
        + sphere_kg * (0.4 * r2 + 0.25 * length_m * length_m + 0.375 * length_m * radius_m);
    [axial, transverse, transverse]
}

/// A link as a solid capsule of its collision shape.
const fn capsule_link(mass_kg: f64, com_m: f64, length_m: f64, radius_m: f64) -> LinkMass<f64> {
    LinkMass { mass_kg, com_m, inertia_kg_m2: capsule_inertia_kg_m2(mass_kg, length_m, radius_m) }
}

const MASSES: FingerMasses<f64> = FingerMasses {
    base: capsule_link(params::BASE_MASS_KG, 0.0, 0.0, params::PROXIMAL_RADIUS_M),
    proximal: capsule_link(
        params::PROXIMAL_MASS_KG,
        params::PROXIMAL_COM_M,
        params::L1_M,
        params::PROXIMAL_RADIUS_M,
    ),
    middle: capsule_link(params::MIDDLE_MASS_KG, params::MIDDLE_COM_M, params::L2_M, params::MIDDLE_RADIUS_M),
    distal: capsule_link(params::DISTAL_MASS_KG, params::DISTAL_COM_M, params::L3_M, params::DISTAL_RADIUS_M),
};

const FINGER_MASS_KG: f64 =
    params::BASE_MASS_KG + params::PROXIMAL_MASS_KG + params::MIDDLE_MASS_KG + params::DISTAL_MASS_KG;

const fn range([lower_rad, upper_rad]: [f64; 2]) -> JointRange<f64> {
    JointRange { lower_rad, upper_rad }
}

impl<T: RealField + Copy> HandModel<T> {
    /// The HIT/DLR hand (right), from [`params`].
    #[must_use]
    pub fn hit_dlr() -> Self {
        HandModel::<f64> {
            finger: FingerGeometry {
                l1_m: params::L1_M,
                l2_m: params::L2_M,
                l3_m: params::L3_M,
                tip_radius_m: params::TIP_RADIUS_M,
            },
            mounts: hit_dlr_mounts(),
            hard_limits: HandLimits {
                thumb_rotation: range(params::THUMB_ROTATION_RAD),
                abduction: range(params::ABDUCTION_HARD_RAD),
                flexion: range(params::FLEXION_HARD_RAD),
                middle: range(params::MIDDLE_HARD_RAD),
            },
            soft_limits: HandLimits {
                thumb_rotation: range(params::THUMB_ROTATION_RAD),
                abduction: range(params::ABDUCTION_SOFT_RAD),
                flexion: range(params::FLEXION_SOFT_RAD),
                middle: range(params::MIDDLE_SOFT_RAD),
            },
            drive: DriveParameters {
                torque_max_nm: params::TORQUE_MAX_NM,
                speed_max_rad_per_s: params::SPEED_MAX_RAD_PER_S,
                tip_force_max_n: params::TIP_FORCE_MAX_N,
                gear_ratio: params::GEAR_RATIO,
                rotor_inertia_kg_m2: params::ROTOR_INERTIA_REFLECTED_KG_M2,
                stiffness_nm_per_rad: params::DRIVE_STIFFNESS_NM_PER_RAD,
                coulomb_friction_nm: params::COULOMB_FRICTION_NM,
                viscous_friction_nm_s_per_rad: params::VISCOUS_FRICTION_NM_S_PER_RAD,
            },
            thumb_rotation: ThumbRotation {
                speed_max_rad_per_s: params::THUMB_ROTATION_SPEED_MAX_RAD_PER_S,
                holding_torque_nm: params::THUMB_BRAKE_HOLDING_NM,
                step_rad: params::THUMB_ROTATION_STEP_RAD,
            },
            masses: MASSES,
            palm_mass_kg: params::HAND_MASS_KG - FINGER_COUNT as f64 * FINGER_MASS_KG,
            collision: CollisionGeometry {
                link_radii_m: [params::PROXIMAL_RADIUS_M, params::MIDDLE_RADIUS_M, params::DISTAL_RADIUS_M],
                palm: PalmBox {
                    min_in_palm: Point3::from(params::PALM_BOX_MIN_M),
                    max_in_palm: Point3::from(params::PALM_BOX_MAX_M),
                },
            },
            grasp_centre_in_palm: Point3::from(params::GRASP_CENTRE_IN_PALM_M),
        }
        .cast()
    }
}

impl HandModel<f64> {
    /// The same hand in another scalar, each number rounded once.
    ///
    /// ```
    /// use hand_model::HandModel;
    /// let mut hand = HandModel::<f64>::hit_dlr();
    /// hand.finger.tip_radius_m = 0.013;
    /// assert_eq!(hand.cast::<f32>().finger.tip_radius_m, 0.013);
    /// ```
    #[must_use]
    pub fn cast<U: RealField + Copy>(&self) -> HandModel<U> {
        let range = |r: &JointRange<f64>| JointRange {
            lower_rad: convert(r.lower_rad),
            upper_rad: convert(r.upper_rad),
        };
        let limits = |l: &HandLimits<f64>| HandLimits {
            thumb_rotation: range(&l.thumb_rotation),
            abduction: range(&l.abduction),
            flexion: range(&l.flexion),
            middle: range(&l.middle),
        };
        let link = |l: &LinkMass<f64>| LinkMass {
            mass_kg: convert(l.mass_kg),
            com_m: convert(l.com_m),
            inertia_kg_m2: l.inertia_kg_m2.map(convert),
        };
        let (finger, mounts, drive, masses) = (&self.finger, &self.mounts, &self.drive, &self.masses);
        let palm = &self.collision.palm;
        HandModel {
            finger: FingerGeometry {
                l1_m: convert(finger.l1_m),
                l2_m: convert(finger.l2_m),
                l3_m: convert(finger.l3_m),
                tip_radius_m: convert(finger.tip_radius_m),
            },
            mounts: FingerMounts {
                thumb_axis_in_palm: mounts.thumb_axis_in_palm.cast(),
                palm_from_thumb_base_at_zero: mounts.palm_from_thumb_base_at_zero.cast(),
                palm_from_index_base: mounts.palm_from_index_base.cast(),
                palm_from_middle_base: mounts.palm_from_middle_base.cast(),
                palm_from_ring_base: mounts.palm_from_ring_base.cast(),
            },
            hard_limits: limits(&self.hard_limits),
            soft_limits: limits(&self.soft_limits),
            drive: DriveParameters {
                torque_max_nm: drive.torque_max_nm.map(convert),
                speed_max_rad_per_s: convert(drive.speed_max_rad_per_s),
                tip_force_max_n: convert(drive.tip_force_max_n),
                gear_ratio: convert(drive.gear_ratio),
                rotor_inertia_kg_m2: convert(drive.rotor_inertia_kg_m2),
                stiffness_nm_per_rad: convert(drive.stiffness_nm_per_rad),
                coulomb_friction_nm: convert(drive.coulomb_friction_nm),
                viscous_friction_nm_s_per_rad: convert(drive.viscous_friction_nm_s_per_rad),
            },
            thumb_rotation: ThumbRotation {
                speed_max_rad_per_s: convert(self.thumb_rotation.speed_max_rad_per_s),
                holding_torque_nm: convert(self.thumb_rotation.holding_torque_nm),
                step_rad: convert(self.thumb_rotation.step_rad),
            },
            masses: FingerMasses {
                base: link(&masses.base),
                proximal: link(&masses.proximal),
                middle: link(&masses.middle),
                distal: link(&masses.distal),
            },
            palm_mass_kg: convert(self.palm_mass_kg),
            collision: CollisionGeometry {
                link_radii_m: self.collision.link_radii_m.map(convert),
                palm: PalmBox { min_in_palm: palm.min_in_palm.cast(), max_in_palm: palm.max_in_palm.cast() },
            },
            grasp_centre_in_palm: self.grasp_centre_in_palm.cast(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Poses;
    use crate::{FingerTrig, links};
    use protocol::ids::FingerId;

    #[test]
    fn masses_add_up_to_the_published_hand() {
        let hand = HandModel::<f64>::hit_dlr();
        let m = &hand.masses;
        let finger_kg = m.base.mass_kg + m.proximal.mass_kg + m.middle.mass_kg + m.distal.mass_kg;
        assert!((4.0 * finger_kg + hand.palm_mass_kg - 1.6).abs() < 1e-12);
        assert!((finger_kg - 0.137).abs() < 1e-12);
    }

    #[test]
    fn a_capsule_is_a_rod_or_a_ball_in_the_limits() {
        let [axial, transverse, _] = capsule_inertia_kg_m2(3.0, 0.0, 0.1);
        assert!((axial - 0.4 * 3.0 * 0.01).abs() < 1e-15 && (transverse - axial).abs() < 1e-15);
        let [axial, transverse, _] = capsule_inertia_kg_m2(3.0, 2.0, 1e-9);
        assert!(axial < 1e-15 && (transverse - 1.0).abs() < 1e-8);
    }

    #[test]
    fn link_inertias_are_those_of_bodies_of_their_size() {
        // The five-finger hand's published links: 7.9e-6, 2.65e-6 and 1.58e-6 kg m^2. These are 1.7 to 2.2 times as
        // heavy and at most 1.3 times as long, so they cannot be ten times as inert.
        let m = HandModel::<f64>::hit_dlr().masses;
        for (link, smaller) in [(m.proximal, 7.9e-6), (m.middle, 2.65e-6), (m.distal, 1.58e-6)] {
            let [axial, transverse, _] = link.inertia_kg_m2;
            assert!(
                axial < transverse && transverse > smaller && transverse < 10.0 * smaller,
                "{transverse}"
            );
        }
    }

    #[test]
    fn the_palm_box_is_clear_of_fingers_within_the_soft_limits_and_of_the_root_of_the_thumb() {
        let hand = HandModel::<f64>::hit_dlr();
        let palm = hand.collision.palm;
        let outside = |point: Point3<f64>| {
            let beyond = (palm.min_in_palm - point).sup(&(point - palm.max_in_palm));
            beyond.map(|c| c.max(0.0)).norm()
        };
        let mut poses = Poses::new(7);
        for angles in poses.take_soft(5000) {
            let thumb_rotation = poses.uniform(0.0, core::f64::consts::FRAC_PI_2).sin_cos();
            let links = links(&hand.finger, &FingerTrig::new(&angles, f64::sin_cos));
            let ends =
                [links.proximal, links.middle, links.distal].map(|l| Point3::from(l.translation.vector));
            let ends = [ends[0], ends[1], ends[2], links.tip];
            for finger in FingerId::ALL {
                // Beyond the root, a bent thumb can touch the palm, as a real one does.
                let points = if finger == FingerId::Thumb { 1 } else { 12 };
                let palm_from_base = hand.palm_from_finger_base(finger, thumb_rotation);
                for i in 0..=points {
                    let (link, part) = ((i / 4).min(2), f64::from(i as u8) / 4.0);
                    let along = ends[link + 1] - ends[link];
                    let point_in_base = ends[link] + along * (part - link as f64);
                    let gap = outside(palm_from_base * point_in_base) - hand.collision.link_radii_m[link];
                    assert!(gap > 0.0, "{} {angles:?}: {gap}", finger.name());
                }
            }
        }
    }

    #[test]
    fn the_thumb_brake_holds_the_fingertip_force_at_the_longest_lever() {
        let hand = HandModel::<f64>::hit_dlr();
        let mut longest_m = 0.0_f64;
        for angles in Poses::new(8).take_hard(20_000) {
            let tip = hand.palm_from_finger_base(FingerId::Thumb, (0.0, 1.0))
                * crate::tip(&hand.finger, &FingerTrig::new(&angles, f64::sin_cos));
            longest_m = longest_m.max((tip - hand.mounts.thumb_axis_in_palm).xy().norm());
        }
        let needed_nm = longest_m * hand.drive.tip_force_max_n;
        assert!(needed_nm <= hand.thumb_rotation.holding_torque_nm, "{needed_nm}");
        assert!(needed_nm > 0.9 * hand.thumb_rotation.holding_torque_nm, "{needed_nm}");
    }
}
