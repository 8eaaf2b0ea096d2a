use nalgebra::{Translation3, UnitQuaternion, Vector3, Vector6};
use serde_json::Value;

use super::*;
use crate::plan::document::{
    ContactInfo, FORMAT, GraspInfo, HandInfo, ObjectInfo, Pose, SettingsInfo, VERSION, posture,
};

/// A ball of 40 mm between eight contacts at the corners of a cube, standing at (0.4, 0, 0.04), turned.
fn document(hand: &Hand) -> PlanDocument {
    let base_from_object = Isometry3::from_parts(
        Translation3::new(0.4, 0.0, 0.04),
        UnitQuaternion::from_euler_angles(0.3, -0.2, 0.9),
    );
    let site = Isometry3::translation(0.4, 0.0, 0.25);
    let approach = Isometry3::translation(0.4, 0.0, 0.33);
    let open = hand.clamped(Posture::ZERO);
    let mut closed = open;
    hand.joints
        .iter()
        .enumerate()
        .filter(|(_, joint)| joint.flexes.is_some())
        .for_each(|(i, _)| closed[i] = 0.5);
    let contacts = (0..8).map(|corner: i32| {
        let side = |axis: i32| if corner >> axis & 1 == 0 { -1.0 } else { 1.0 };
        let outward = Vector3::new(side(0), side(1), side(2)) / 3f64.sqrt();
        ContactInfo {
            finger: "thumb".to_owned(),
            link: "</script><b>".to_owned(),
            point: (0.04 * outward).into(),
            normal: (-outward).into(),
            friction: 0.5,
            torsional_m: 0.0,
            squeeze_force_n: (-outward).into(),
        }
    });
    let pose = |pose: &Isometry3<f64>| Pose::from(pose);
    let grasp = GraspInfo {
        candidate: "quadpod".to_owned(),
        quality: QualityInfo {
            epsilon: 0.1,
            epsilon_low: 0.1,
            epsilon_high: 0.2,
            expected_epsilon: None,
            closure_chance: None,
            limit_margin: None,
            seen_share: None,
        },
        object_from_palm: pose(&(base_from_object.inverse() * site)),
        approach_site: pose(&approach),
        grasp_site: pose(&site),
        lift_site: pose(&approach),
        pregrasp: posture(hand, &open),
        grasp: posture(hand, &closed),
        squeeze: posture(hand, &closed),
        finger_motion: None,
        contacts: contacts.collect(),
        arm_motion: None,
    };
    PlanDocument {
        format: FORMAT.to_owned(),
        version: VERSION,
        frames: document::frames(),
        hand: HandInfo { name: hand.name.clone(), sha256: hand.sha256.clone() },
        arm: None,
        object: ObjectInfo {
            source: "ball".to_owned(),
            mesh_sha256: "0".repeat(64),
            triangles: 4,
            watertight: true,
            base_from_object: pose(&base_from_object),
            center_of_mass: [0.0; 3],
            torque_scale_m: 0.04,
            mass_kg: 0.1,
            friction: 0.5,
        },
        table_height_m: Some(0.0),
        settings: SettingsInfo { strategy: "paper".to_owned(), attempts: 1, threshold: 0.2, seed: 1 },
        convention: "test".to_owned(),
        attempts: 1,
        force_closure: 1,
        rejected: std::collections::BTreeMap::new(),
        grasps: vec![grasp],
    }
}

fn report<'a>(document: &'a PlanDocument, hand: &'a Hand) -> Report<'a> {
    Report { document, hand, arm: None, mesh: None, cloud: None, run: None, top: 20, notes: Vec::new() }
}

/// The JSON in the page.
fn data(page: &str) -> Value {
    let (_, after) = page.split_once("id=\"data\">").unwrap();
    serde_json::from_str(after.split_once("</script>").unwrap().0).unwrap()
}

#[test]
fn the_page_is_whole_and_takes_nothing_from_outside() {
    let hand = Hand::hit_dlr().unwrap();
    let document = document(&hand);
    let page = report(&document, &hand).html().unwrap();
    assert_eq!(page, report(&document, &hand).html().unwrap(), "the same bytes");
    assert!(page.contains("* plotly.js v") && !page.contains("MathJax.loader"));
    assert_eq!(page.matches("<script").count() - plotly_js().matches("<script").count(), 2);
    // A name that would end the script is data all the same.
    assert_eq!(data(&page)["grasps"][0]["contacts"][0]["link"], "</script><b>");
    let own = page.replace(&plotly_js(), "");
    for outside in ["src=", "href=\"http", "@import", "url(", "fetch("] {
        assert!(!own.contains(outside), "{outside}");
    }
}

/// On a ball each of eight contacts in the corners of a cube reaches along the axes of the cube by what plane
/// trigonometry says: cos(phi) + mu sin(phi) with phi the angle to the diagonal; and moments by mu alone.
#[test]
fn margins_on_a_ball_are_those_of_plane_trigonometry() {
    let hand = Hand::hit_dlr().unwrap();
    let document = document(&hand);
    let grasp = &document.grasps[0];
    let margins = quality::margins(1, &document.object, grasp, &Isometry3::identity()).unwrap().unwrap();
    let (cos, sin) = (1.0 / 3f64.sqrt(), (2.0f64 / 3.0).sqrt());
    for (bar, reach) in margins.reach.iter().enumerate() {
        // A moment about an axis of the cube: the lever is a unit diagonal, the tangential push 0.5 across it.
        let expected = if bar < 6 { cos + 0.5 * sin } else { 0.5 * sin };
        assert!((reach - expected).abs() < 1e-12, "{bar}: {reach} {expected}");
        // The weakest direction is found to a thousandth.
        assert!(1.001 * reach >= margins.weakest_reach);
    }
    assert!((Vector6::from(margins.weakest).norm() - 1.0).abs() < 1e-9);
    // Turned with its frame, the weakest wrench turns too and reaches as far.
    let turn = Isometry3::rotation(Vector3::new(0.4, -1.0, 0.3));
    let turned = quality::margins(1, &document.object, grasp, &turn).unwrap().unwrap();
    let force = |m: &quality::Margins| Vector3::new(m.weakest[0], m.weakest[1], m.weakest[2]);
    assert!((force(&turned) - turn * force(&margins)).norm() < 1e-12);
    assert_eq!(turned.weakest_reach, margins.weakest_reach);
}

#[test]
fn the_steps_lead_from_the_approach_site_to_the_squeeze() {
    let hand = Hand::hit_dlr().unwrap();
    let document = document(&hand);
    let steps = &data(&report(&document, &hand).html().unwrap())["grasps"][0]["steps"];
    assert_eq!(steps.as_array().unwrap().len(), motion::STAGES[3].1 + 1);
    let tip = |step: usize| -> Vec<f64> {
        let chain = steps[step]["fingers"][1].as_array().unwrap();
        chain[chain.len() - 3..].iter().map(|c| c.as_f64().unwrap()).collect()
    };
    // The palms' axes are the base's, the approach site is 80 mm above the grasp site.
    let finger = &hand.fingers[1];
    let (open, closed) = (hand.clamped(Posture::ZERO), {
        let named = &document.grasps[0].grasp;
        read_posture(1, &hand, named, "grasp").unwrap()
    });
    for (step, posture, z_mm) in
        [(0, &open, 330.0), (12, &open, 250.0), (24, &closed, 250.0), (36, &closed, 250.0)]
    {
        let in_palm = finger.tip_in_palm(&finger.frames(posture));
        let expected = [400.0 + 1e3 * in_palm.x, 1e3 * in_palm.y, z_mm + 1e3 * in_palm.z];
        for (c, expected) in tip(step).iter().zip(expected) {
            assert!((c - expected).abs() < 0.006, "{step}: {c} {expected}");
        }
    }
    assert!((tip(6)[2] - 0.5 * (tip(0)[2] + tip(12)[2])).abs() < 0.02);
}

#[test]
fn a_plan_that_does_not_fit_the_hand_is_refused() {
    let hand = Hand::hit_dlr().unwrap();
    let mut document = document(&hand);
    document.grasps[0].squeeze.remove("ring_middle");
    let error = report(&document, &hand).html().unwrap_err();
    assert_eq!(error.to_string(), "grasp 1: squeeze has no angle for joint ring_middle");
}

#[test]
fn contacts_that_do_not_close_have_no_margins() {
    let hand = Hand::hit_dlr().unwrap();
    let mut document = document(&hand);
    document.grasps[0].contacts.truncate(2);
    let page = data(&report(&document, &hand).html().unwrap());
    assert!(page["grasps"][0]["margins"].is_null());
}
