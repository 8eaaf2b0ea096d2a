//! The built-in hand: the four-finger HIT/DLR hand of the 2005 system, with eight typical grasps.
//!
//! The 2005 system names "four-finger, three-finger, nip, etc."; the set here is this project's reading of that, laid
//! over the precision rows of the GRASP taxonomy (Feix et al. 2016) that a thumb with three fingers can make. Spreads,
//! preshapes and size ranges are engineering choices, the ranges computed from the hand's kinematics.

use hand_model::{HandAngles, HandModel};
use nalgebra::{Isometry3, IsometryMatrix3, Point3, Translation3, Unit, Vector3};
use protocol::ids::{FingerId, FingerJoint, JOINT_COUNT, JointId};

use super::candidate::{Candidate, ContactKind};
use super::finger::{Bead, Finger, FingerError, Motion, Part, Segment};
use super::{Hand, Joint, MAX_FINGERS, PalmBox, Posture, SOFT_TIP_TORSION_M};

/// Name of the hand, as `--hand` takes it.
pub const NAME: &str = "hit-dlr";

/// Middle angle of a stretched finger, rad: 10 degrees, the rest posture of published planners for this hand.
const STRETCHED_MIDDLE_RAD: f64 = 10.0 * std::f64::consts::PI / 180.0;

/// Stiffness of the finger joints' position control, N m / rad: that of the firmware's control laws.
const STIFFNESS_NM_PER_RAD: f64 = 6.0;

/// Friction coefficient of links and palm, which are of metal and plastic: that of the simulated hand.
const LINK_FRICTION: f64 = 0.3;

/// SHA-256 over a hand's parameters, as they print in full precision.
#[must_use]
pub fn hash(model: &HandModel<f64>) -> String {
    super::hash_of(model)
}

/// A posture of this hand as the planner counts it.
#[must_use]
pub fn posture(angles: &HandAngles<f64>) -> Posture {
    let mut posture = Posture::ZERO;
    posture.0[..JOINT_COUNT].copy_from_slice(&angles.to_array());
    posture
}

/// A posture of this hand as the firmware counts it.
#[must_use]
pub fn angles(posture: &Posture) -> HandAngles<f64> {
    HandAngles::from_array(&std::array::from_fn(|i| posture[i]))
}

impl Hand {
    /// The HIT/DLR hand with its published parameters.
    ///
    /// # Errors
    /// [`FingerError`] for a model without links; never for the built-in one.
    pub fn hit_dlr() -> Result<Self, FingerError> {
        Self::from_model(HandModel::hit_dlr())
    }

    /// The hand of a model: beads and box from its collision geometry, its soft limits as limits.
    ///
    /// # Errors
    /// [`FingerError`] when a link is so long and thin that it takes too many balls.
    pub fn from_model(model: HandModel<f64>) -> Result<Self, FingerError> {
        let fingers = FingerId::ALL.into_iter().map(|id| finger(&model, id)).collect::<Result<_, _>>()?;
        let joint = |id: JointId| {
            let range = model.soft_limits.range(id);
            let drive = &model.drive;
            let (speed, torque, flexes) = match id.finger_joint() {
                None => {
                    (model.thumb_rotation.speed_max_rad_per_s, model.thumb_rotation.holding_torque_nm, None)
                }
                Some((_, joint)) => (
                    drive.speed_max_rad_per_s,
                    drive.torque_max_nm[joint.index()],
                    (joint != FingerJoint::Abduction).then_some(true),
                ),
            };
            Joint {
                name: id.name().to_owned(),
                lower_rad: range.lower_rad,
                upper_rad: range.upper_rad,
                speed_max_rad_per_s: speed,
                torque_max_nm: torque,
                stiffness_nm_per_rad: STIFFNESS_NM_PER_RAD,
                flexes,
                // The thumb's rotation is set and then braked.
                is_held: id.finger_joint().is_none(),
            }
        };
        let (low, high) = (model.collision.palm.min_in_palm, model.collision.palm.max_in_palm);
        let masses = &model.masses;
        let finger_kg =
            masses.base.mass_kg + masses.proximal.mass_kg + masses.middle.mass_kg + masses.distal.mass_kg;
        Ok(Self {
            name: NAME.to_owned(),
            sha256: hash(&model),
            joints: JointId::ALL.into_iter().map(joint).collect(),
            fingers,
            palm: vec![PalmBox {
                palm_from_box: Isometry3::from(nalgebra::center(&low, &high).coords),
                half_extents_m: 0.5 * (high - low),
            }],
            grasp_center_in_palm: model.grasp_centre_in_palm,
            pressing_in_palm: Vector3::x_axis(),
            link_friction: LINK_FRICTION,
            soft_tip_torsion_m: SOFT_TIP_TORSION_M,
            tip_force_max_n: model.drive.tip_force_max_n,
            mass_kg: model.palm_mass_kg + FingerId::ALL.len() as f64 * finger_kg,
            candidates: typical(),
            model: Some(model),
        })
    }
}

fn finger(model: &HandModel<f64>, id: FingerId) -> Result<Finger, FingerError> {
    let (geometry, radii) = (&model.finger, model.collision.link_radii_m);
    let along = |length_m| Translation3::new(length_m, 0.0, 0.0) * IsometryMatrix3::identity();
    let one = [1.0, 0.0];
    let palm_from_base = model.palm_from_finger_base(id, (0.0, 1.0));
    let mut segments = Vec::new();
    let mut parent_from_base = palm_from_base;
    if id == FingerId::Thumb {
        let axis = Translation3::from(model.mounts.thumb_axis_in_palm.coords);
        let joint = JointId::THUMB_ROTATION.index();
        segments.push(Segment::new(
            "thumb_support".to_owned(),
            axis * IsometryMatrix3::identity(),
            -Vector3::z_axis(),
            Motion::Turning,
            joint,
            one,
        ));
        parent_from_base = axis.inverse() * palm_from_base;
    }
    let base = segments.len();
    // The distal joint repeats the middle one.
    for (link, parent, axis, joint) in [
        ("base", parent_from_base, Vector3::z_axis(), FingerJoint::Abduction),
        ("proximal", along(0.0), -Vector3::y_axis(), FingerJoint::Flexion),
        ("middle", along(geometry.l1_m), -Vector3::y_axis(), FingerJoint::Middle),
        ("distal", along(geometry.l2_m), -Vector3::y_axis(), FingerJoint::Middle),
    ] {
        let name = format!("{}_{link}_link", id.name());
        let joint = JointId::of(id, joint).index();
        segments.push(Segment::new(name, parent, axis, Motion::Turning, joint, one));
    }
    let mut beads = Vec::new();
    let lengths_m = [geometry.l1_m, geometry.l2_m, geometry.l3_m];
    for (link, (length_m, radius_m)) in lengths_m.into_iter().zip(radii).enumerate() {
        let is_distal = link == 2;
        // Centres three quarters of a radius apart at most: the chain's waist is 7 % (1 mm) thinner than the capsule
        // it stands for. The proximal link has none at its joint, which the palm covers, and the distal one none at
        // its end, where the tip is.
        let count = (length_m / (0.75 * radius_m)).ceil().max(1.0);
        beads.extend((1..=count as usize).map(|i| Bead {
            segment: base + 1 + link,
            part: if is_distal { Part::Distal } else { Part::Inner },
            center_in_segment: Point3::new(
                length_m * i as f64 / count - if is_distal { length_m / count } else { 0.0 },
                0.0,
                0.0,
            ),
            radius_m,
        }));
    }
    beads.push(Bead {
        segment: base + 3,
        part: Part::Tip,
        center_in_segment: Point3::new(geometry.l3_m, 0.0, 0.0),
        radius_m: geometry.tip_radius_m,
    });
    Finger::new(id.name().to_owned(), segments, beads, Vector3::z_axis(), |_| [0.0; 2])
}

/// Name, fingers (thumb, index, middle, ring), thumb rotation, spread (index, middle, ring), preshape of the fingers
/// (flexion, middle), of the thumb, places around a centre (index, middle, ring), contact; angles in degrees.
type Row = (&'static str, [bool; 4], f64, [f64; 3], [f64; 2], [f64; 2], Option<[f64; 3]>, ContactKind);

/// The eight candidates, the four-finger ones first, and the power grasps behind them. Angles in degrees in the table, radians in the result.
fn typical() -> Vec<Candidate> {
    use ContactKind::{Hard, Soft};
    let (timr, tim, tir) = ([true; 4], [true, true, true, false], [true, true, false, true]);
    let (ti, tm) = ([true, true, false, false], [true, false, true, false]);
    #[rustfmt::skip]
    let rows: [Row; 10] = [
        ("quadpod", timr, 90.0, [-10.0, 0.0, 10.0], [25.0, 30.0], [15.0, 20.0], Some([110.0, 180.0, -110.0]), Hard),
        ("disk-rim", timr, 90.0, [-15.0, 0.0, 15.0], [20.0, 15.0], [10.0, 15.0], Some([120.0, 180.0, -120.0]), Hard),
        ("prismatic-4", timr, 90.0, [2.0, 0.0, -2.0], [30.0, 30.0], [15.0, 20.0], None, Hard),
        ("tripod", tim, 90.0, [-5.0, 5.0, 0.0], [35.0, 30.0], [20.0, 25.0], Some([120.0, -120.0, 0.0]), Hard),
        ("prismatic-3", tim, 90.0, [2.0, 0.0, 0.0], [35.0, 30.0], [20.0, 25.0], None, Hard),
        ("wide-triangle", tir, 90.0, [-12.0, 0.0, 12.0], [25.0, 30.0], [15.0, 20.0], Some([120.0, 0.0, -120.0]), Hard),
        ("palmar-pinch", ti, 75.0, [0.0, 0.0, 0.0], [40.0, 35.0], [25.0, 30.0], None, Soft),
        ("nip", tm, 90.0, [0.0, 0.0, 0.0], [50.0, 40.0], [35.0, 40.0], None, Soft),
        ("power", timr, 90.0, [2.0, 0.0, -2.0], [45.0, 40.0], [45.0, 40.0], None, Hard),
        ("power-turned", timr, 60.0, [2.0, 0.0, -2.0], [45.0, 40.0], [45.0, 40.0], None, Hard),
    ];
    rows.into_iter().map(candidate).collect::<Vec<_>>()
}

fn candidate((name, uses_of, rotation, spread, fingers, thumb, around, contact): Row) -> Candidate {
    let (mut open, mut closing) = (Posture::ZERO, Posture::ZERO);
    open[JointId::THUMB_ROTATION.index()] = rotation.to_radians();
    let abduction = [0.0, spread[0], spread[1], spread[2]];
    for id in FingerId::ALL {
        let joint = |joint| JointId::of(id, joint).index();
        let [flexion, middle] = if id == FingerId::Thumb { thumb } else { fingers };
        open[joint(FingerJoint::Abduction)] = abduction[id.index()].to_radians();
        open[joint(FingerJoint::Middle)] = STRETCHED_MIDDLE_RAD;
        closing[joint(FingerJoint::Flexion)] = flexion.to_radians();
        closing[joint(FingerJoint::Middle)] = middle.to_radians() - STRETCHED_MIDDLE_RAD;
    }
    let mut uses = [false; MAX_FINGERS];
    uses[..uses_of.len()].copy_from_slice(&uses_of);
    let around_rad = around.map(|degrees| {
        let mut angles = [0.0; MAX_FINGERS];
        angles[1..=3].copy_from_slice(&degrees.map(f64::to_radians));
        angles
    });
    Candidate {
        name: name.to_owned(),
        uses,
        opposing: FingerId::Thumb.index(),
        open,
        closing,
        lateral_in_palm: Unit::new_unchecked(Vector3::y()),
        around_rad,
        contact,
        wraps: name.starts_with("power"),
    }
}

#[cfg(test)]
mod tests {
    use rand::RngExt;
    use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};

    use super::*;

    fn random_posture(hand: &Hand, rng: &mut ChaCha8Rng) -> Posture {
        let mut posture = Posture::ZERO;
        for (i, joint) in hand.joints.iter().enumerate() {
            posture[i] = rng.random_range(joint.lower_rad..=joint.upper_rad);
        }
        posture
    }

    #[test]
    fn the_chain_has_the_tips_and_pads_of_the_closed_form() {
        let hand = Hand::hit_dlr().unwrap();
        let model = HandModel::<f64>::hit_dlr();
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for _ in 0..500 {
            let posture = random_posture(&hand, &mut rng);
            let of_model = angles(&posture);
            let tips = model.tips_in_palm(&of_model, f64::sin_cos);
            for (i, id) in FingerId::ALL.into_iter().enumerate() {
                let chain = &hand.fingers[i];
                let frames = chain.frames(&posture);
                assert!((chain.tip_in_palm(&frames) - tips[i]).norm() < 1e-14);
                let base = model.palm_from_finger_base(id, of_model.thumb_rotation_rad.sin_cos());
                let trig = hand_model::FingerTrig::new(of_model.finger(id), f64::sin_cos);
                let pad = base.rotation * hand_model::pad_normal(&trig);
                assert!((chain.pad_in_palm(&frames).into_inner() - pad.into_inner()).norm() < 1e-14);
            }
        }
    }

    #[test]
    fn the_iterated_inverse_finds_what_the_closed_form_finds() {
        let hand = Hand::hit_dlr().unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let mut middle = Posture::ZERO;
        for (i, joint) in hand.joints.iter().enumerate() {
            middle[i] = 0.5 * (joint.lower_rad + joint.upper_rad);
        }
        let mut missed = 0;
        for _ in 0..1000 {
            let posture = random_posture(&hand, &mut rng);
            for (i, finger) in hand.fingers.iter().enumerate() {
                let tip = finger.tip_in_palm(&finger.frames(&posture));
                let mut seed = middle;
                seed[0] = posture[0];
                match hand.finger_inverse(i, &tip, &seed) {
                    Some(found) => {
                        assert!(hand.within_limits(&found) && found[0] == posture[0]);
                        let found_tip = finger.tip_in_palm(&finger.frames(&found));
                        assert!((found_tip - tip).norm() < 1e-6, "{}", finger.name);
                    }
                    None => missed += 1,
                }
            }
        }
        // The closed form finds all 4000; the iteration may lose a few at the corners of the limits.
        assert!(missed <= 40, "{missed} of 4000");
    }

    #[test]
    fn no_bead_is_faster_than_its_bound() {
        let hand = Hand::hit_dlr().unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let (mut before, mut after) = (Vec::new(), Vec::new());
        for _ in 0..200 {
            let from = random_posture(&hand, &mut rng);
            let rate = random_posture(&hand, &mut rng) - from;
            for finger in &hand.fingers {
                finger.bead_centers(&from, &mut before);
                finger.bead_centers(&(from + rate * 1e-6), &mut after);
                for (i, (a, b)) in before.iter().zip(&after).enumerate() {
                    assert!((b - a).norm() / 1e-6 <= finger.bead_speed_bound_m(i, &rate) + 1e-6);
                }
            }
        }
    }

    #[test]
    fn candidates_pass_through_the_preshape_and_stop_at_the_limits() {
        let hand = Hand::hit_dlr().unwrap();
        assert_eq!(hand.candidates.iter().filter(|c| !c.wraps).count(), 8);
        assert!(hand.candidates.iter().any(|c| c.wraps));
        for candidate in &hand.candidates {
            assert!(candidate.uses[candidate.opposing], "{}: nothing opposes", candidate.name);
            assert_eq!(candidate.contact == ContactKind::Soft, candidate.finger_count() == 2);
            assert!(hand.within_limits(&candidate.posture_at(&hand.joints, 100.0)));
            let preshape = candidate.posture_at(&hand.joints, 1.0);
            assert_eq!(preshape, candidate.open + candidate.closing, "{}", candidate.name);
        }
    }
}
