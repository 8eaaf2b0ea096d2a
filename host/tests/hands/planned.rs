//! From a description to grasps with force closure, on a box, a cylinder and a lid; two jaws hold the box only.

use host::hand::urdf::Loaded;
use host::object::BuiltIn;
use host::plan::attempt::Grasp;
use host::plan::best;
use host::plan::scene::Scene;
use host::plan::search::SearchSettings;
use nalgebra::Isometry3;

use crate::{FIVE, FOUR, JAWS, THREE, loaded};

#[test]
fn every_hand_grasps_box_cylinder_and_lid() {
    let settings = SearchSettings { attempts: 3000, threshold: 1.0, ..SearchSettings::default() };
    let mut without = Vec::new();
    let all = &[BuiltIn::Cube, BuiltIn::Cylinder, BuiltIn::TeacupCover][..];
    for (name, objects) in [(THREE, all), (FOUR, all), (FIVE, all), (JAWS, &all[..1])] {
        let Loaded { hand, .. } = loaded(name);
        for object in objects {
            let mesh = object.object(1.0).unwrap().mesh;
            let on_table = Isometry3::translation(0.4, 0.0, 0.0);
            let scene = Scene::new(mesh, on_table, Some(0.0), None).unwrap().with_hand(hand.clone());
            let result = best::search(&scene, &settings, &|_| {});
            if result.grasps.is_empty() {
                without.push(format!("{name} on {}: {:?}", object.name(), result.rejected));
            }
            for grasp in &result.grasps {
                check(&scene, grasp, if name == JAWS { 2.1e-3 } else { 1e-4 });
            }
        }
    }
    assert!(without.is_empty(), "no grasp: {}", without.join("; "));
}

/// What a grasp is: closed by force, its joints inside their limits, each used finger touching where its contact is, which
/// fingers on one drive do to `gap_m`.
fn check(scene: &Scene, grasp: &Grasp, gap_m: f64) {
    let hand = &scene.hand;
    assert!(grasp.quality.epsilon_low > 0.0);
    assert!(hand.within_limits(&grasp.grasp) && hand.within_limits(&grasp.pregrasp));
    let candidate = &hand.candidates[grasp.candidate];
    if !candidate.wraps {
        assert_eq!(grasp.contacts.len(), candidate.finger_count());
    }
    for touch in &grasp.contacts {
        // Contacts lie on the surface: within the band that counts as touching.
        let nearest = scene.surface.nearest(&touch.contact.point_in_object());
        assert!(nearest.signed_distance_m.abs() < 1e-4);
        let Some(finger) = touch.finger else { continue };
        let chain = &hand.fingers[finger];
        let bead = &chain.beads()[touch.bead];
        let in_palm = chain.frames(&grasp.grasp).palm_from_segment(bead.segment) * bead.center_in_segment;
        let off_m =
            scene.surface.nearest(&(grasp.site.object_from_palm * in_palm)).signed_distance_m - bead.radius_m;
        assert!(off_m.abs() < gap_m, "{} is {off_m} m off its contact in {}", chain.name, candidate.name);
    }
}
