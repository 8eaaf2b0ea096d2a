//! The exports as other people's readers understand them.

use std::collections::BTreeMap;

use hand_model::{FingerTrig, HandAngles, HandModel, links};
use nalgebra::{Isometry3, IsometryMatrix3, Point3, Rotation3, Translation3, UnitVector3, Vector3};
use protocol::ids::{FingerId, JointId};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;
use urdf_rs::JointType;

use super::mjcf::{MjcfError, SceneObject};
use super::{Grasp, inventor, isaac, mjcf, moveit, urdf};
use crate::io::{Unit, read_mesh_bytes};
use crate::object::BuiltIn;
use crate::plan::arm::Arm;

fn model() -> HandModel<f64> {
    HandModel::hit_dlr()
}

/// Angles evenly within the hard limits.
fn random_angles(random: &mut ChaCha8Rng) -> HandAngles<f64> {
    let limits = model().hard_limits;
    HandAngles::from_array(&JointId::ALL.map(|joint| {
        let range = limits.range(joint);
        random.random_range(range.lower_rad..=range.upper_rad)
    }))
}

fn random_pose(random: &mut ChaCha8Rng) -> Isometry3<f64> {
    let mut vector = |scale: f64| Vector3::from_fn(|_, _| random.random_range(-scale..scale));
    Isometry3::new(vector(0.5), vector(2.0))
}

fn random_grasp(number: usize, random: &mut ChaCha8Rng) -> Grasp {
    Grasp {
        number,
        epsilon: random.random_range(0.0..0.3),
        object_from_palm: random_pose(random),
        approach_site: random_pose(random),
        grasp_site: random_pose(random),
        lift_site: random_pose(random),
        pregrasp: random_angles(random),
        grasp: random_angles(random),
        squeeze: random_angles(random),
        torsional_m: 0.003,
    }
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
}

fn yaml(text: &str) -> Value {
    serde_saphyr::from_str(text).unwrap()
}

#[test]
fn a_yaml_reader_finds_the_palm_in_the_objects_frame() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let grasps: Vec<Grasp> = (1..=20).map(|n| random_grasp(n, &mut random)).collect();
    let source = "mug \"blue\": #1 \\ \u{e9}.stl";
    let text = isaac::yaml(source, &grasps);
    assert!(text.contains("\nformat_version: 1.0\n"));
    let file = yaml(&text);
    assert_eq!((&file["format"], &file["format_version"]), (&"isaac_grasp".into(), &1.0.into()));
    assert_eq!((&file["object_frame"], &file["gripper_frame"]), (&source.into(), &"palm".into()));
    assert_eq!(file["grasps"].as_object().unwrap().len(), grasps.len());
    for grasp in &grasps {
        let read = &file["grasps"][format!("grasp_{}", grasp.number)];
        assert_eq!(read["confidence"].as_f64(), Some(grasp.epsilon));
        let p = numbers(&read["position"]);
        assert_eq!(p, grasp.object_from_palm.translation.vector.as_slice());
        let q = grasp.object_from_palm.rotation;
        assert_eq!(read["orientation"]["w"].as_f64(), Some(q.w));
        assert_eq!(numbers(&read["orientation"]["xyz"]), [q.i, q.j, q.k]);
        for (key, angles) in [("cspace_position", grasp.grasp), ("pregrasp_cspace_position", grasp.pregrasp)]
        {
            assert_eq!(read[key].as_object().unwrap().len(), JointId::ALL.len());
            for (joint, angle_rad) in JointId::ALL.iter().zip(angles.to_array()) {
                assert_eq!(read[key][joint.name()].as_f64(), Some(angle_rad));
            }
        }
    }
    assert_eq!(yaml(&isaac::yaml("mug", &[]))["grasps"], serde_json::json!({}));
}

#[test]
fn a_yaml_reader_finds_the_flange_and_the_ways_in_the_base_frame() {
    let mut random = ChaCha8Rng::seed_from_u64(2);
    let grasps: Vec<Grasp> = (1..=20).map(|n| random_grasp(n, &mut random)).collect();
    let flange_from_palm = Arm::rx60().flange_from_palm();
    let list = yaml(&moveit::yaml(&model(), &flange_from_palm.inverse(), "mug", &grasps));
    let xyz = |v: &Value| Vector3::from(["x", "y", "z"].map(|k| v[k].as_f64().unwrap()));
    for (grasp, read) in grasps.iter().zip(list.as_array().unwrap()) {
        assert_eq!(read["id"], format!("grasp_{}", grasp.number));
        let pose = &read["grasp_pose"]["pose"];
        let q = &pose["orientation"];
        let [w, x, y, z] = ["w", "x", "y", "z"].map(|k| q[k].as_f64().unwrap());
        let rotation = nalgebra::UnitQuaternion::new_normalize(nalgebra::Quaternion::new(w, x, y, z));
        let base_from_flange = Isometry3::from_parts(Translation3::from(xyz(&pose["position"])), rotation);
        let difference =
            (base_from_flange * flange_from_palm).to_homogeneous() - grasp.grasp_site.to_homogeneous();
        assert!(difference.amax() < 1e-12, "{difference}");
        for (key, way) in [
            (
                "pre_grasp_approach",
                grasp.grasp_site.translation.vector - grasp.approach_site.translation.vector,
            ),
            ("post_grasp_retreat", grasp.lift_site.translation.vector - grasp.grasp_site.translation.vector),
            (
                "post_place_retreat",
                grasp.approach_site.translation.vector - grasp.grasp_site.translation.vector,
            ),
        ] {
            let length_m = read[key]["desired_distance"].as_f64().unwrap();
            let read_way = xyz(&read[key]["direction"]["vector"]) * length_m;
            assert!((read_way - way).amax() < 1e-12, "{key}");
        }
        let points = read["grasp_posture"]["points"].as_array().unwrap();
        assert_eq!(numbers(&points[0]["positions"]), grasp.grasp.to_array());
        assert_eq!(numbers(&points[1]["positions"]), grasp.squeeze.to_array());
        assert_eq!(numbers(&read["pre_grasp_posture"]["points"][0]["positions"]), grasp.pregrasp.to_array());
        assert_eq!(read["max_contact_force"], 10.0);
        assert_eq!(read["allowed_touch_objects"][0], "mug");
    }
    assert_eq!(list.as_array().unwrap().len(), grasps.len());
}

#[test]
fn a_way_of_no_length_has_no_direction() {
    let mut grasp = random_grasp(1, &mut ChaCha8Rng::seed_from_u64(3));
    grasp.lift_site = grasp.grasp_site;
    let list = yaml(&moveit::yaml(&model(), &Isometry3::identity(), "mug", &[grasp]));
    let retreat = &list[0]["post_grasp_retreat"];
    assert_eq!(retreat["desired_distance"], 0.0);
    assert_eq!(retreat["direction"]["vector"], serde_json::json!({"x": 0.0, "y": 0.0, "z": 0.0}));
}

/// Poses of all links in the root, computed from the description and the angles of its driven joints.
fn root_from_links(
    robot: &urdf_rs::Robot,
    root: &str,
    angles: &BTreeMap<String, f64>,
) -> BTreeMap<String, IsometryMatrix3<f64>> {
    let mut poses = BTreeMap::from([(root.to_owned(), IsometryMatrix3::identity())]);
    for joint in &robot.joints {
        let [roll, pitch, yaw] = joint.origin.rpy.0;
        let turn = |axis, angle| Rotation3::from_axis_angle(&axis, angle);
        let rotation =
            turn(Vector3::z_axis(), yaw) * turn(Vector3::y_axis(), pitch) * turn(Vector3::x_axis(), roll);
        let origin = IsometryMatrix3::from_parts(Translation3::from(joint.origin.xyz.0), rotation);
        let angle_rad = match (&joint.mimic, joint.joint_type.clone()) {
            (_, JointType::Fixed) => 0.0,
            (Some(mimic), _) => {
                mimic.multiplier.unwrap_or(1.0) * angles[&mimic.joint] + mimic.offset.unwrap_or(0.0)
            }
            (None, _) => angles[&joint.name],
        };
        let axis = UnitVector3::new_normalize(Vector3::from(joint.axis.xyz.0));
        let pose = poses[&joint.parent.link] * origin * turn(axis, angle_rad);
        assert!(poses.insert(joint.child.link.clone(), pose).is_none(), "{} hangs twice", joint.child.link);
    }
    assert_eq!(poses.len(), robot.links.len());
    poses
}

fn by_name(angles: &HandAngles<f64>) -> BTreeMap<String, f64> {
    JointId::ALL
        .iter()
        .zip(angles.to_array())
        .map(|(joint, angle)| (joint.name().to_owned(), angle))
        .collect()
}

fn difference(a: &IsometryMatrix3<f64>, b: &IsometryMatrix3<f64>) -> f64 {
    (a.to_homogeneous() - b.to_homogeneous()).amax()
}

#[test]
fn the_urdf_hand_moves_as_the_model() {
    let hand = model();
    let robot = urdf_rs::read_from_string(&urdf::hand(&hand)).unwrap();
    let mut random = ChaCha8Rng::seed_from_u64(4);
    for _ in 0..1000 {
        let angles = random_angles(&mut random);
        let poses = root_from_links(&robot, "palm", &by_name(&angles));
        for finger in FingerId::ALL {
            let palm_from_base = hand.palm_from_finger_base(finger, angles.thumb_rotation_rad.sin_cos());
            let expected = links(&hand.finger, &FingerTrig::new(angles.finger(finger), f64::sin_cos));
            let pose = |link: &str| &poses[&format!("{}_{link}", finger.name())];
            for (link, in_base) in [
                ("proximal_link", expected.proximal),
                ("middle_link", expected.middle),
                ("distal_link", expected.distal),
            ] {
                assert!(difference(pose(link), &(palm_from_base * in_base)) < 1e-9, "{finger:?} {link}");
            }
            let tip = Point3::from(pose("tip").translation.vector);
            assert!((tip - palm_from_base * expected.tip).norm() < 1e-9, "{finger:?}");
        }
    }
}

#[test]
fn the_urdf_hand_has_the_models_mass_limits_and_couplings() {
    let hand = model();
    let robot = urdf_rs::read_from_string(&urdf::hand(&hand)).unwrap();
    let mass_kg: f64 = robot.links.iter().map(|link| link.inertial.mass.value).sum();
    assert!((mass_kg - 1.6).abs() < 1e-12, "{mass_kg}");
    let mimics: Vec<_> =
        robot.joints.iter().filter_map(|j| Some((&j.name, &j.mimic.as_ref()?.joint))).collect();
    assert_eq!(mimics.len(), 4);
    for (distal, middle) in mimics {
        assert_eq!(distal.replace("distal", "middle"), *middle);
    }
    for joint in JointId::ALL {
        let read = robot.joints.iter().find(|j| j.name == joint.name()).unwrap();
        let range = hand.hard_limits.range(joint);
        assert_eq!([read.limit.lower, read.limit.upper], [range.lower_rad, range.upper_rad]);
        assert!(read.limit.effort > 0.0 && read.limit.velocity > 0.0);
    }
    for link in robot.links.iter().filter(|link| link.inertial.mass.value > 0.0) {
        let moments = &link.inertial.inertia;
        let sum = moments.ixx + moments.iyy + moments.izz;
        for moment in [moments.ixx, moments.iyy, moments.izz] {
            assert!(
                moment > 0.0 && 2.0 * moment < sum * (1.0 + 1e-12),
                "{}: no body turns like that",
                link.name
            );
        }
    }
}

#[test]
fn the_urdf_arm_carries_the_hand_as_the_arm_does() {
    let mut params = Arm::rx60().params().clone();
    // Offsets and reversed axes, which the built-in arm has none of.
    params.geometry.offset_rad = [0.1, -0.2, 0.3, 0.0, -0.5, 1.0];
    params.geometry.sign = [1.0, -1.0, 1.0, -1.0, -1.0, 1.0];
    for arm in [Arm::rx60(), Arm::new(params).unwrap()] {
        let robot = urdf_rs::read_from_string(&urdf::arm_with_hand(&arm, &model())).unwrap();
        let mut random = ChaCha8Rng::seed_from_u64(5);
        for _ in 0..1000 {
            let mut angles = by_name(&random_angles(&mut random));
            let limits = arm.limits();
            let q_rad: [f64; 6] =
                std::array::from_fn(|i| random.random_range(limits.lower_rad[i]..=limits.upper_rad[i]));
            angles.extend((1..).zip(q_rad).map(|(axis, q)| (format!("joint_{axis}"), q)));
            let poses = root_from_links(&robot, urdf::BASE_LINK, &angles);
            let matrix = |pose: Isometry3<f64>| {
                IsometryMatrix3::from_parts(pose.translation, pose.rotation.to_rotation_matrix())
            };
            assert!(difference(&poses[urdf::FLANGE_LINK], &matrix(arm.base_from_flange(&q_rad))) < 1e-9);
            assert!(difference(&poses["palm"], &matrix(arm.base_from_palm(&q_rad))) < 1e-9);
        }
    }
}

fn cube_scene() -> SceneObject {
    let cube = BuiltIn::Cube.object(1.0).unwrap();
    SceneObject {
        pieces: cube.convex_pieces(),
        base_from_object: Isometry3::translation(0.4, 0.0, 0.0),
        mass_kg: 0.1,
        friction: 0.4,
    }
}

#[test]
fn an_mjcf_scene_has_keyframes_for_all_its_joints() {
    let grasp = random_grasp(1, &mut ChaCha8Rng::seed_from_u64(6));
    let text = mjcf::scene(&model(), &grasp, &cube_scene()).unwrap();
    let attribute = |line: &str, name: &str| -> Vec<f64> {
        let (_, rest) = line.split_once(&format!("{name}=\"")).unwrap();
        rest.split('"').next().unwrap().split(' ').map(|n| n.parse().unwrap()).collect()
    };
    let keys: Vec<&str> = text.lines().filter(|line| line.contains("<key ")).collect();
    assert_eq!(keys.len(), 3);
    for (key, posture, target) in [
        (keys[0], grasp.pregrasp, grasp.pregrasp),
        (keys[1], grasp.grasp, grasp.grasp),
        (keys[2], grasp.grasp, grasp.squeeze),
    ] {
        // Thumb rotation, four joints a finger with the distal one repeating, position and orientation of the object.
        let mut qpos = vec![posture.thumb_rotation_rad];
        for finger in &posture.fingers {
            qpos.extend([finger.abduction_rad, finger.flexion_rad, finger.middle_rad, finger.middle_rad]);
        }
        qpos.extend([0.4, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
        assert_eq!(attribute(key, "qpos"), qpos);
        assert_eq!(attribute(key, "ctrl"), target.to_array());
    }
    let mesh = text.lines().find(|line| line.contains("<mesh ")).unwrap();
    assert_eq!(attribute(mesh, "vertex").len(), 3 * 8);
    // What the firmware compensates.
    assert!(!text.contains("frictionloss"));
    let density = text.lines().find(|line| line.contains("density")).unwrap();
    assert!((attribute(density, "density")[0] - 0.1 / 0.05f64.powi(3)).abs() < 1e-9);
}

#[test]
fn an_object_without_volume_mass_or_friction_makes_no_scene() {
    let grasp = random_grasp(1, &mut ChaCha8Rng::seed_from_u64(7));
    let refused = |object: SceneObject| mjcf::scene(&model(), &grasp, &object).unwrap_err();
    let flat = vec![[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]].map(Point3::from).to_vec()];
    for pieces in [vec![], vec![vec![]], flat] {
        assert_eq!(refused(SceneObject { pieces, ..cube_scene() }), MjcfError::NoPieces);
    }
    assert_eq!(refused(SceneObject { mass_kg: 0.0, ..cube_scene() }), MjcfError::Mass(0.0));
    assert_eq!(refused(SceneObject { friction: -0.1, ..cube_scene() }), MjcfError::Friction(-0.1));
}

#[test]
fn an_inventor_scene_shows_the_tips_where_the_model_has_them() {
    let hand = model();
    let cube = BuiltIn::Cube.object(1.0).unwrap().mesh;
    let mut random = ChaCha8Rng::seed_from_u64(8);
    for _ in 0..5 {
        let grasp = random_grasp(1, &mut random);
        let text = inventor::scene(&hand, &grasp, &cube).unwrap();
        let read = read_mesh_bytes(text.as_bytes(), "scene.iv".as_ref(), Unit::Metre).unwrap().value;
        for corner in cube.vertices() {
            assert!(read.vertices().iter().any(|v| (v - corner).norm() < 1e-9));
        }
        for tip in hand.tips_in_palm(&grasp.grasp, f64::sin_cos) {
            let tip = grasp.object_from_palm * tip;
            let radius_m = hand.finger.tip_radius_m;
            let on_sphere = read.vertices().iter().filter(|v| ((*v - tip).norm() - radius_m).abs() < 1e-6);
            assert!(on_sphere.count() > 1000, "no ball at {tip}");
        }
    }
}
