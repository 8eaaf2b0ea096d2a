use super::*;

fn contact(point: [f64; 3], normal: [f64; 3]) -> GripContact {
    GripContact {
        point: Point3::from(point),
        inward_normal: Unit::new_normalize(Vector3::from(normal)),
        friction: 0.4,
    }
}

/// Thumb on +x, two fingers on -x of a 50 mm box; the thumb 3 mm off the middle.
fn box_grip() -> Vec<GripContact> {
    vec![
        contact([0.025, 0.003, 0.001], [-1.0, 0.0, 0.0]),
        contact([-0.025, 0.02, 0.0], [1.0, 0.0, 0.0]),
        contact([-0.025, -0.02, 0.0], [1.0, 0.0, 0.0]),
    ]
}

#[test]
fn opposed_contacts_balance_within_their_cones() {
    let contacts = box_grip();
    let forces = balanced_forces(&contacts, 0.5, 12.0, LEAST_TIP_SHARE).unwrap();
    let (mut force, mut torque, mut normal) = (Vector3::zeros(), Vector3::zeros(), 0.0);
    for (contact, f) in contacts.iter().zip(&forces) {
        let n = f.dot(&contact.inward_normal);
        let t = (f - contact.inward_normal.into_inner() * n).norm();
        assert!(n > 1.0 && t <= 0.2 * n * (1.0 + 1e-9), "{n} {t}");
        force += f;
        torque += contact.point.coords.cross(f);
        normal += n;
    }
    assert!((normal - 12.0).abs() < 1e-9);
    assert!(force.norm() < 0.24 && torque.norm() < 0.24 * 0.03, "{force} {torque}");
}

#[test]
fn every_contact_keeps_to_its_own_friction() {
    let mut contacts = box_grip();
    contacts[1].friction = 0.25;
    contacts[2].friction = 0.25;
    for (contact, f) in contacts.iter().zip(balanced_forces(&contacts, 1.0, 12.0, 0.0).unwrap()) {
        let n = f.dot(&contact.inward_normal);
        let t = (f - contact.inward_normal.into_inner() * n).norm();
        assert!(t <= contact.friction * n * (1.0 + 1e-9), "{n} {t}");
    }
    contacts[0].friction = f64::NAN;
    assert!(matches!(balanced_forces(&contacts, 1.0, 12.0, 0.0), Err(GripError::NotFinite { .. })));
}

#[test]
fn contacts_on_one_side_are_refused() {
    let mut contacts = box_grip();
    contacts[0].inward_normal = Unit::new_normalize(Vector3::new(1.0, 0.0, 0.0));
    assert!(matches!(
        balanced_forces(&contacts, 0.5, 12.0, LEAST_TIP_SHARE),
        Err(GripError::Unbalanced { .. })
    ));
    assert_eq!(balanced_forces(&contacts[..1], 0.5, 12.0, LEAST_TIP_SHARE), Err(GripError::TooFew(1)));
    assert!(matches!(
        balanced_forces(&contacts, f64::NAN, 12.0, LEAST_TIP_SHARE),
        Err(GripError::NotFinite { .. })
    ));
}

#[test]
fn nearest_force_of_a_cone_is_on_it() {
    let normal = Vector3::z_axis();
    let (inside, _) = into_cone(&Vector3::new(0.1, 0.0, 1.0), &normal, 0.4, 0.1);
    assert_eq!(inside, Vector3::new(0.1, 0.0, 1.0));
    let outside = Vector3::new(1.0, 0.5, 1.0);
    let (edge, n) = into_cone(&outside, &normal, 0.4, 0.1);
    assert!((edge.xy().norm() - 0.4 * n).abs() < 1e-12);
    // The rest is normal to the cone.
    assert!((outside - edge).dot(&edge).abs() < 1e-12);
}

#[test]
fn squeeze_asks_for_the_forces_it_was_given() {
    let model = HandModel::<f64>::hit_dlr();
    let mut grasp = HandAngles::from_array(&[0.6; 13]);
    grasp.thumb_rotation_rad = 1.5;
    for finger in &mut grasp.fingers {
        finger.abduction_rad = 0.05;
    }
    let mut forces = [None; FINGER_COUNT];
    forces[0] = Some(Vector3::new(-1.5, 0.2, 0.1));
    forces[2] = Some(Vector3::new(1.5, -0.2, 0.4));
    let stiffness = GripStiffness::default();
    let squeeze = squeeze_targets(&model, &grasp, &forces, &stiffness);
    assert_eq!(squeeze.fingers[1], grasp.fingers[1]);
    assert_eq!(squeeze.thumb_rotation_rad, grasp.thumb_rotation_rad);
    let base = |finger| -> Isometry3<f64> { convert(model.palm_from_finger_base(finger, 1.5f64.sin_cos())) };
    let trig = |angles: &FingerAngles<f64>| FingerTrig::new(angles, f64::sin_cos);

    let inside =
        tip(&model.finger, &trig(&squeeze.fingers[0])) - tip(&model.finger, &trig(&grasp.fingers[0]));
    let pressed = base(FingerId::Thumb) * inside.component_mul(&Vector3::from(stiffness.thumb_n_per_m));
    assert!((pressed - forces[0].unwrap()).norm() < 1e-9, "{pressed}");

    let jacobian = tip_jacobian(&model.finger, &trig(&grasp.fingers[2]));
    let turned = Vector3::from(squeeze.fingers[2].to_array()) - Vector3::from(grasp.fingers[2].to_array());
    let torque = turned.component_mul(&Vector3::from(stiffness.joint_nm_per_rad));
    let pressed = base(FingerId::Middle) * (jacobian.transpose().try_inverse().unwrap() * torque);
    assert!((pressed - forces[2].unwrap()).norm() < 1e-9, "{pressed}");
}

#[test]
fn a_push_asks_for_its_lever_times_its_force_of_the_drives() {
    let mut hand = Hand::hit_dlr().unwrap();
    // The middle finger straight up along palm z; it flexes towards palm x.
    let grasp = Posture::ZERO;
    let finger = hand.finger_index("middle").unwrap();
    let chain = hand.fingers[finger].clone();
    let frames = chain.frames(&grasp);
    let bead = chain.beads().last().unwrap();
    let point_in_palm = frames.palm_from_segment(bead.segment) * bead.center_in_segment;
    let push = |force_in_palm| LinkPush { finger, segment: bead.segment, point_in_palm, force_in_palm };
    let share = |hand: &Hand, pushes: &[LinkPush]| torque_share(hand, &grasp, pushes);
    // Lengths of the links, and drives of 1.3, 1.3 and 0.9 N m; middle and distal joint are one drive.
    let (flexion_m, middle_m) = (0.0678 + 0.0300 + 0.0270, 0.0300 + 2.0 * 0.0270);
    let expected = (flexion_m / 1.3_f64).max(middle_m / 0.9);
    let one = push(Vector3::x());
    assert!((share(&hand, &[one]) - expected).abs() < 1e-9, "{}", share(&hand, &[one]));
    assert!((share(&hand, &[one, one, one]) - 3.0 * expected).abs() < 1e-9);
    // Along the finger a force needs no torque.
    assert!(share(&hand, &[push(Vector3::z())]) < 1e-9);
    hand.joints.iter_mut().for_each(|joint| joint.torque_max_nm = 0.0);
    assert_eq!(share(&hand, &[one]), 0.0);
}
