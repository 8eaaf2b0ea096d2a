//! Searches on bodies of known shape.

use nalgebra::{Isometry3, Point3, Vector3};

use super::arm::Arm;
use super::scene::Scene;
use super::search::{SearchResult, SearchSettings};
use super::{best, paper};
use crate::object::BuiltIn;

fn scene(object: BuiltIn) -> Scene {
    let object = object.object(1.0).unwrap();
    Scene::new(object.mesh, Isometry3::translation(0.42, 0.0, 0.0), Some(0.0), Some(Arm::rx60())).unwrap()
}

fn summary(name: &str, result: &SearchResult) -> String {
    let best = result.grasps.first();
    format!(
        "{name}: {} attempts, {} closures, best {:?} expected {:?}, threshold after {:?}, rejected {:?}",
        result.attempts,
        result.grasps.len(),
        best.map(|g| (g.candidate, g.quality.epsilon_low)),
        best.and_then(|g| g.expected_epsilon),
        result.attempts_to_threshold,
        result.rejected
    )
}

#[test]
fn probe() {
    for object in BuiltIn::ALL {
        let scene = scene(object);
        let t = std::time::Instant::now();
        let result = paper::search(&scene, &SearchSettings::default(), &|_| {});
        println!("paper {} {:?}", summary(object.name(), &result), t.elapsed());
        let t = std::time::Instant::now();
        let result = best::search(&scene, &SearchSettings { attempts: 1000, ..Default::default() }, &|_| {});
        println!("best  {} {:?}", summary(object.name(), &result), t.elapsed());
    }
    let _ = (Point3::<f64>::origin(), Vector3::<f64>::x());
}

#[test]
fn query_speed() {
    for object in BuiltIn::ALL {
        let scene = scene(object);
        let t = std::time::Instant::now();
        let mut sum = 0.0;
        for i in 0..20000 {
            let a = f64::from(i) * 0.37;
            let r = 0.05 + 0.03 * (f64::from(i) * 0.11).sin();
            sum += scene
                .surface
                .nearest(&Point3::new(r * a.cos(), r * a.sin(), 0.03 * (f64::from(i) * 0.07).sin() + 0.02))
                .signed_distance_m;
        }
        println!(
            "paper {} {} tris {:?} per query {sum}",
            object.name(),
            scene.mesh.faces().len(),
            t.elapsed() / 20000
        );
    }
}

#[test]
fn lid_detail() {
    use super::attempt::{AttemptScratch, attempt, close_hand};
    use super::settle::{Approach, settle};
    let scene = scene(BuiltIn::TeacupCover);
    let mut scratch = AttemptScratch::default();
    for (i, c) in super::candidates::typical().iter().enumerate() {
        let ap = Approach {
            direction_in_object: nalgebra::Unit::new_normalize(-Vector3::z()),
            opposition_in_object: Vector3::x(),
        };
        let site = settle(&scene, c, &ap, &(scene.center_of_mass - Vector3::z() * 0.02), &mut scratch);
        let closed = close_hand(&scene, &site, &mut scratch);
        for f in protocol::ids::FingerId::ALL {
            if let Some(path) = site.preshape.paths[f.index()] {
                let base = scene.base_from_object
                    * site.object_from_palm
                    * scene.hand.palm_from_finger_base(f, site.preshape.thumb_rotation_rad);
                let mut c = Vec::new();
                scene.hand.bead_centers(&path.at(1.0), &mut c);
                let z: Vec<String> = c
                    .iter()
                    .zip(scene.hand.beads())
                    .map(|(c, b)| format!("{:?} {:.0}", b.link, ((base * c).z - b.radius_m) * 1e3))
                    .collect();
                println!(
                    "paper    beads {} begin {:.2} end {:.2} {:.2?} rate {:.2?} {}",
                    f.name(),
                    path.u_begin,
                    path.u_end,
                    path.at(1.0).to_array(),
                    path.rate_rad,
                    z.join(" ")
                );
            }
        }
        println!(
            "paper {} {:?}",
            c.name,
            attempt(&scene, i, c, &site, &mut scratch).map(|g| g.quality.epsilon_low)
        );
        for (f, t) in closed.touches() {
            println!(
                "paper    {} s {:.3} {:?} p {:.1?} n {:.2?} pad {:.2}",
                f.name(),
                t.u,
                t.link,
                (t.point_in_object.coords * 1e3).as_slice(),
                t.inward_normal_in_object.as_slice(),
                t.pad_cosine
            );
        }
    }
}
