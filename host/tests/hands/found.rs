//! What is found in the three hands, against what one sees in their drawings.

use host::hand::urdf::{Loaded, from_str, load};
use host::hand::{ContactKind, Hand, Part, Posture};
use nalgebra::{Point3, Vector3};

use crate::{FIVE, FOUR, JAWS, THREE, loaded, model, overrides};

fn finger_names(hand: &Hand) -> Vec<&str> {
    hand.fingers.iter().map(|finger| finger.name.as_str()).collect()
}

/// Joint, towards which limit it closes, whether it is held.
fn roles(hand: &Hand) -> Vec<(&str, Option<bool>, bool)> {
    hand.joints.iter().map(|joint| (joint.name.as_str(), joint.flexes, joint.is_held)).collect()
}

/// What holds for the candidates of any hand.
fn check_candidates(hand: &Hand, least: usize) {
    let count = hand.candidates.len();
    assert!((least..=16).contains(&count), "{}: {count} candidates", hand.name);
    let mut names: Vec<&str> = hand.candidates.iter().map(|candidate| candidate.name.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), count, "two candidates of one name");
    for candidate in &hand.candidates {
        let name = &candidate.name;
        assert!(candidate.uses[candidate.opposing] && candidate.finger_count() >= 2, "{name}");
        assert_eq!(candidate.contact == ContactKind::Soft, candidate.finger_count() == 2, "{name}");
        assert!(hand.within_limits(&candidate.open), "{name}");
        let tips = |s: f64| {
            let posture = candidate.posture_at(&hand.joints, s);
            let tip = |f: usize| hand.fingers[f].tip_in_palm(&hand.fingers[f].frames(&posture)).coords;
            let others: Vec<usize> = candidate.fingers().filter(|f| *f != candidate.opposing).collect();
            let mean = others.iter().map(|&f| tip(f)).sum::<Vector3<f64>>() / others.len() as f64;
            (tip(candidate.opposing), mean)
        };
        let opening_m = |s: f64| (tips(s).0 - tips(s).1).norm();
        if !candidate.wraps {
            assert!(opening_m(0.0) > opening_m(1.0) + 0.01, "{name} does not close");
        }
        // Across the opposition.
        let (own, others) = tips(0.0);
        let along = (own - others).normalize().dot(&candidate.lateral_in_palm);
        assert!(along.abs() < 0.9, "{name}: lateral axis along the opposition");
    }
}

/// Pad of a finger in the preshape of a candidate that uses all.
fn pad(hand: &Hand, finger: usize) -> Vector3<f64> {
    let all =
        hand.candidates.iter().find(|candidate| candidate.finger_count() == hand.fingers.len()).unwrap();
    let chain = &hand.fingers[finger];
    chain.pad_in_palm(&chain.frames(&all.posture_at(&hand.joints, 1.0))).into_inner()
}

#[test]
fn the_three_finger_hand_spreads_two_fingers_by_one_held_joint() {
    let Loaded { hand, palm_link, link_from_palm, warnings, .. } = loaded(THREE);
    assert_eq!((palm_link.as_str(), warnings), ("base", Vec::new()));
    assert!(link_from_palm.to_homogeneous().is_identity(1e-12));
    assert_eq!(finger_names(&hand), ["c", "a", "b"]);
    assert_eq!(
        roles(&hand),
        [
            ("spread", None, true),
            ("finger_a_knuckle", Some(true), false),
            ("finger_b_knuckle", Some(true), false),
            ("finger_c_knuckle", Some(true), false),
        ]
    );
    let mirrored = &hand.fingers[2].segments()[0];
    assert_eq!((mirrored.joint, mirrored.multiplier), (0, -1.0));
    // The last joints repeat the knuckle, but only as far as their own limits go: 0.65 + 0.333 x 2.4 is inside 1.5.
    assert_eq!(hand.joints[1].upper_rad, 2.4);
    for finger in &hand.fingers {
        let tip = finger.beads().last().unwrap();
        assert_eq!((tip.part, tip.radius_m), (Part::Tip, 0.009));
        assert!((tip.center_in_segment.coords - Vector3::new(0.048, 0.0, 0.0)).norm() < 1e-12);
        // x along the link, flexion about -y: the pad looks along z.
        assert!((finger.pad_in_last().into_inner() - Vector3::z()).norm() < 1e-9);
    }
    // The round palm as a box, pressing where the open fingers look.
    assert_eq!(hand.palm.len(), 1);
    assert_eq!(hand.palm[0].half_extents_m, Vector3::new(0.048, 0.048, 0.035));
    assert_eq!(hand.pressing_in_palm, Vector3::z_axis());
    assert!((hand.mass_kg - 1.0).abs() < 1e-12);
    check_candidates(&hand, 3);
    // Towards one point, with the two fingers spread, and side by side.
    let spread = |wanted: bool| {
        hand.candidates.iter().any(|c| c.finger_count() == 3 && c.around_rad.is_some() == wanted && !c.wraps)
    };
    assert!(spread(true) && spread(false));
    assert!(hand.candidates.iter().any(|candidate| candidate.wraps));
}

#[test]
fn the_four_finger_hand_has_a_thumb_and_three_joints_that_flex_each_finger() {
    let Loaded { hand, palm_link, warnings, .. } = loaded(FOUR);
    assert_eq!((palm_link.as_str(), warnings), ("hand_base", Vec::new()));
    assert_eq!(finger_names(&hand), ["thumb", "index", "middle", "ring"]);
    assert_eq!(hand.joints.len(), 16);
    for (name, flexes, is_held) in roles(&hand) {
        let turns = name.ends_with("j1") || name == "thumb_j0";
        assert_eq!((flexes, is_held), (if turns { None } else { Some(true) }, false), "{name}");
    }
    // In the preshape the fingers' pads look one way, the thumb's the other.
    let sum = pad(&hand, 1) + pad(&hand, 2) + pad(&hand, 3);
    assert!(sum.dot(&pad(&hand, 0)) < 0.0, "{sum} {}", pad(&hand, 0));
    // Tips are the round ones, on links fixed to the last moving ones.
    let radii: Vec<f64> = hand.fingers.iter().map(|finger| finger.tip_radius_m()).collect();
    assert_eq!(radii, [0.013, 0.012, 0.012, 0.012]);
    assert_eq!(hand.pressing_in_palm, Vector3::x_axis());
    check_candidates(&hand, 6);
}

#[test]
fn the_five_finger_hand_repeats_its_drives_and_finds_its_meshes() {
    let Loaded { hand, palm_link, warnings, .. } = loaded(FIVE);
    assert_eq!(palm_link, "palm");
    assert_eq!(finger_names(&hand), ["thumb", "index", "middle", "ring", "little"]);
    assert_eq!(hand.joints.len(), 6);
    for (name, flexes, _) in roles(&hand) {
        assert_eq!(flexes, if name == "thumb_turn_joint" { None } else { Some(true) }, "{name}");
    }
    let follower = &hand.fingers[1].segments()[1];
    assert_eq!((follower.multiplier, follower.offset_rad), (1.1, 0.06));
    // 1.1 x 1.45 + 0.06 is inside the follower's 1.8, 1.3 x 0.8 + 0.15 inside the thumb's 1.3.
    assert_eq!(hand.joints[0].upper_rad, 1.45);
    // The tip's mesh: a rod of 7.5 mm with a round end of 31 mm, scaled along z to the finger's length. Its balls lie
    // inside, and the tip reaches the end but for a millimetre.
    for (name, end_mm, radius_mm) in [("index", 31.0, 7.5), ("little", 26.04, 7.5), ("thumb", 31.0, 8.25)] {
        let finger = &hand.fingers[hand.finger_index(name).unwrap()];
        let (tip, r) = (finger.tip_in_last(), finger.tip_radius_m());
        let reach_mm = 1e3 * (tip.z + r);
        assert!((end_mm - 1.0..=end_mm + 0.01).contains(&reach_mm), "{name} reaches {reach_mm} mm");
        assert!((0.8 * radius_mm..=radius_mm + 0.01).contains(&(1e3 * r)), "{name}: {r}");
        assert!(tip.x.hypot(tip.y) < 5e-4);
    }
    assert!(
        warnings
            .iter()
            .any(|w| w == "link 'little_distal_link' has no collision shape: its visual ones are used")
    );
    // Slabs about the palm's mesh hold no ball of an open or half closed finger.
    assert!(!hand.palm.is_empty());
    for part in &hand.palm {
        assert!(part.half_extents_m.min() > 0.0 && part.half_extents_m.max() < 0.06, "{part:?}");
    }
    let mut middle = Posture::ZERO;
    hand.joints.iter().enumerate().for_each(|(i, j)| middle[i] = 0.5 * (j.lower_rad + j.upper_rad));
    let open = hand.candidates.iter().map(|candidate| (candidate.name.as_str(), candidate.open));
    for (name, posture) in open.chain([("middle", middle)]) {
        for finger in &hand.fingers {
            let mut centers: Vec<Point3<f64>> = Vec::new();
            finger.bead_centers(&posture, &mut centers);
            for part in &hand.palm {
                let is_in = |center: &Point3<f64>| {
                    let in_box = part.palm_from_box.inverse_transform_point(center).coords.abs();
                    (part.half_extents_m - in_box).min() > 1e-9
                };
                assert!(!centers.iter().any(is_in), "{name}: {} in {part:?}", finger.name);
            }
        }
    }
    check_candidates(&hand, 4);
}

#[test]
fn what_is_found_gives_way_to_the_toml() {
    let toml = "name = \"mine\"\nmass_kg = 2.5\ntip_force_n = 7\nopposing = \"pinky\"\nstiffness_nm_per_rad = 3\n\
                [palm]\nlink = \"palm\"\nxyz = [0, 0, 0.05]\nrpy = [0, 0, 0]\n\
                [flange_from_palm]\nxyz = [0, 0, 0.1]\n\
                [limits]\nindex_joint = [0.1, 1.0]\n\
                [[finger]]\ntip = \"index_distal_link\"\n[[finger]]\ntip = \"little_distal_link\"\nname = \"pinky\"\n\
                [[finger]]\ntip = \"thumb_distal_link\"\n[flexion]\nthumb_turn_joint = \"none\"\n";
    let Loaded { hand, link_from_palm, flange_from_palm, is_mount_given, .. } =
        load(&model(FIVE), Some(&overrides(toml)), &[]).unwrap();
    assert_eq!(hand.name, "mine");
    assert_eq!((hand.mass_kg, hand.tip_force_max_n), (2.5, 7.0));
    assert_eq!(hand.fingers[0].name, "pinky");
    assert_eq!(hand.fingers.len(), 3);
    assert!(hand.joints.iter().all(|joint| joint.stiffness_nm_per_rad == 3.0));
    let index = hand.joints.iter().find(|joint| joint.name == "index_joint").unwrap();
    assert_eq!([index.lower_rad, index.upper_rad], [0.1, 1.0]);
    assert_eq!(link_from_palm.translation.vector, Vector3::new(0.0, 0.0, 0.05));
    assert!(is_mount_given && flange_from_palm.translation.z == 0.1);
}

#[test]
fn joints_close_and_are_held_as_the_toml_says() {
    let joint = |name: &str, joint: &str, toml: &str| {
        let hand = load(&model(name), Some(&overrides(toml)), &[]).unwrap().hand;
        let found = hand.joints.iter().find(|other| other.name == joint).unwrap();
        (found.flexes, found.is_held)
    };
    assert_eq!(joint(FIVE, "index_joint", "[flexion]\nindex_joint = \"lower\"\n"), (Some(false), false));
    // One that spreads two fingers is held only as long as it is not said to close them, or when that is said too.
    assert_eq!(joint(THREE, "spread", "[flexion]\nspread = \"upper\"\n"), (Some(true), false));
    assert_eq!(
        joint(THREE, "spread", "held = [\"spread\"]\n[flexion]\nspread = \"upper\"\n"),
        (Some(true), true)
    );
    // And one that closes two fingers, when it is said not to.
    assert_eq!(joint(JAWS, "jaws", "[flexion]\njaws = \"none\"\n"), (None, true));
}

#[test]
fn meshes_in_another_unit_are_doubted_after_their_scale() {
    let text = std::fs::read_to_string(model(FIVE)).unwrap();
    let in_metres = text.replace("palm.obj\" scale=\"0.001 0.001 0.001\"", "palm.obj\"");
    assert_ne!(text, in_metres);
    let path = model(FIVE);
    let doubts = |text: &str| -> Vec<String> {
        let found = from_str(text, path.parent().unwrap(), None, &[]).unwrap();
        found.warnings.into_iter().filter(|line| line.contains(" across")).collect()
    };
    // In millimetres with a scale, they are as large as fingers.
    assert_eq!(doubts(&text), Vec::<String>::new());
    assert_eq!(
        doubts(&in_metres),
        [
            "link 'palm': ../meshes/palm.obj: is 104.0 m across with scale=\"1 1 1\": meshes are in metres, those in \
          millimetres need a scale of 0.001"
        ]
    );
}

#[test]
fn the_same_file_makes_the_same_hand_and_another_one_another_hash() {
    let [a, b] = [loaded(THREE), loaded(THREE)];
    assert_eq!(a.hand.sha256, b.hand.sha256);
    assert_eq!(a.hand.candidates, b.hand.candidates);
    let other = load(&model(THREE), Some(&overrides("tip_force_n = 3\n")), &[]).unwrap();
    assert_ne!(other.hand.sha256, a.hand.sha256);
}

#[test]
fn without_a_mount_the_palm_lies_on_the_flange() {
    // The round palm begins at its link's origin; the meshed one's lowest corner too.
    for name in [THREE, FIVE] {
        let loaded = loaded(name);
        assert!(!loaded.is_mount_given);
        let at = loaded.flange_from_palm;
        assert!(at.translation.vector.norm() < 1e-9 && at.rotation.angle() < 1e-12, "{name}: {at}");
    }
    // The box reaches 97 mm below the origin of the four-finger hand.
    assert!((loaded(FOUR).flange_from_palm.translation.z - 0.097).abs() < 1e-9);
}
