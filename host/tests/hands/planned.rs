//! From a description to grasps with force closure, on a box, a cylinder and a lid.

use host::hand::urdf::Loaded;
use host::object::BuiltIn;
use host::plan::best;
use host::plan::scene::Scene;
use host::plan::search::SearchSettings;
use nalgebra::Isometry3;

use crate::{FIVE, FOUR, THREE, loaded};

#[test]
fn every_hand_grasps_box_cylinder_and_lid() {
    let settings = SearchSettings { attempts: 3000, threshold: 1.0, seed: 1, ranked: 10 };
    let mut without = Vec::new();
    for name in [THREE, FOUR, FIVE] {
        let Loaded { hand, .. } = loaded(name);
        for object in [BuiltIn::Cube, BuiltIn::Cylinder, BuiltIn::TeacupCover] {
            let mesh = object.object(1.0).unwrap().mesh;
            let on_table = Isometry3::translation(0.4, 0.0, 0.0);
            let scene = Scene::new(mesh, on_table, Some(0.0), None).unwrap().with_hand(hand.clone());
            let result = best::search(&scene, &settings, &|_| {});
            let Some(best) = result.grasps.first() else {
                without.push(format!("{name} on {}: {:?}", object.name(), result.rejected));
                continue;
            };
            // What a grasp is: closed by force, its joints inside their limits, each used finger touching.
            assert!(best.quality.epsilon_low > 0.0);
            assert!(scene.hand.within_limits(&best.grasp) && scene.hand.within_limits(&best.pregrasp));
            let candidate = &scene.hand.candidates[best.candidate];
            if !candidate.wraps {
                assert_eq!(best.contacts.len(), candidate.finger_count());
            }
            for touch in &best.contacts {
                // Contacts lie on the surface: within the band that counts as touching.
                let nearest = scene.surface.nearest(&touch.contact.point_in_object());
                assert!(nearest.signed_distance_m.abs() < 1e-4);
            }
        }
    }
    assert!(without.is_empty(), "no grasp: {}", without.join("; "));
}
