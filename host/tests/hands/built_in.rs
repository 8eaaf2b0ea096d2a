//! The built-in hand as a description: the project's own export, read back.

use hand_model::HandModel;
use host::export::urdf;
use host::hand::Hand;
use host::hand::urdf::from_str;
use nalgebra::Vector3;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use crate::{overrides, random_posture};

/// What the description does not say: the thumb's rotation is braked while grasping.
const BRAKED: &str = "held = [\"thumb_rotation\"]\n";

#[test]
fn the_exported_hand_reads_back_as_the_built_in_one() {
    let built_in = Hand::hit_dlr().unwrap();
    let text = urdf::hand(&HandModel::hit_dlr());
    let read = from_str(&text, "".as_ref(), Some(&overrides(BRAKED)), &[]).unwrap();
    let hand = &read.hand;
    assert_eq!(read.palm_link, "palm");
    assert!(read.link_from_palm.to_homogeneous().is_identity(1e-12), "{}", read.link_from_palm);
    let names = |hand: &Hand| hand.fingers.iter().map(|f| f.name.clone()).collect::<Vec<_>>();
    assert_eq!(names(hand), names(&built_in));
    assert!(hand.candidates.iter().all(|candidate| candidate.opposing == 0));
    assert_eq!(hand.pressing_in_palm, Vector3::x_axis());
    assert!((hand.mass_kg - built_in.mass_kg).abs() < 1e-12);

    // Closing directions, the spreading joints and the braked one.
    let place: Vec<usize> = hand
        .joints
        .iter()
        .map(|joint| built_in.joints.iter().position(|other| other.name == joint.name).unwrap())
        .collect();
    for (joint, &k) in hand.joints.iter().zip(&place) {
        let expected = &built_in.joints[k];
        assert_eq!((joint.flexes, joint.is_held), (expected.flexes, expected.is_held), "{}", joint.name);
        assert_eq!(joint.torque_max_nm, expected.torque_max_nm);
    }

    let mut rng = ChaCha8Rng::seed_from_u64(1);
    for _ in 0..1000 {
        let posture = random_posture(&built_in, &mut rng);
        let mut own = host::hand::Posture::ZERO;
        place.iter().enumerate().for_each(|(i, &k)| own[i] = posture[k]);
        for (a, b) in hand.fingers.iter().zip(&built_in.fingers) {
            let (frames, expected) = (a.frames(&own), b.frames(&posture));
            assert!((a.tip_in_palm(&frames) - b.tip_in_palm(&expected)).norm() < 1e-9, "{}", a.name);
            assert!((a.tip_radius_m() - b.tip_radius_m()).abs() < 1e-12);
            // The pad is where the last joint takes the tip: across the distal link, as in the model.
            assert!(a.pad_in_palm(&frames).dot(&b.pad_in_palm(&expected)) > 0.999, "{}", a.name);
        }
    }

    let [found, expected] = [hand, &built_in].map(|hand| hand.palm[0].half_extents_m);
    assert!((found - expected).norm() < 1e-9 && hand.palm.len() == 1);
    assert!((6..=16).contains(&hand.candidates.len()), "{}", hand.candidates.len());
    assert!(hand.candidates.iter().any(|c| c.wraps) && hand.candidates.iter().any(|c| c.finger_count() == 4));
}
