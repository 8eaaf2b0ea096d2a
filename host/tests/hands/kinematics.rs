//! Poses of fingers against an evaluation of the same files by another reader and plain 4 x 4 matrices.

use std::collections::BTreeMap;

use nalgebra::{Matrix4, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use crate::{FIVE, FOUR, JAWS, THREE, loaded, model, random_posture};

/// Rotation about a unit axis (Rodrigues), and roll, pitch and yaw, as matrices written out.
fn turned(axis: [f64; 3], angle: f64) -> Matrix4<f64> {
    let [x, y, z] = axis;
    let (s, c) = angle.sin_cos();
    let v = 1.0 - c;
    #[rustfmt::skip]
    let matrix = Matrix4::new(
        c + x * x * v, x * y * v - z * s, x * z * v + y * s, 0.0,
        y * x * v + z * s, c + y * y * v, y * z * v - x * s, 0.0,
        z * x * v - y * s, z * y * v + x * s, c + z * z * v, 0.0,
        0.0, 0.0, 0.0, 1.0,
    );
    matrix
}

fn placed(pose: &urdf_rs::Pose) -> Matrix4<f64> {
    let [roll, pitch, yaw] = *pose.rpy;
    let turn = turned([0.0, 0.0, 1.0], yaw) * turned([0.0, 1.0, 0.0], pitch) * turned([1.0, 0.0, 0.0], roll);
    Matrix4::new_translation(&Vector3::from(*pose.xyz)) * turn
}

/// Pose of a link in the root, by the joints above it.
fn root_from(robot: &urdf_rs::Robot, link: &str, values: &BTreeMap<String, f64>) -> Matrix4<f64> {
    let Some(joint) = robot.joints.iter().find(|joint| joint.child.link == link) else {
        return Matrix4::identity();
    };
    let value = match &joint.mimic {
        Some(mimic) => mimic.multiplier.unwrap_or(1.0) * values[&mimic.joint] + mimic.offset.unwrap_or(0.0),
        None => values.get(&joint.name).copied().unwrap_or(0.0),
    };
    let motion = match joint.joint_type {
        urdf_rs::JointType::Fixed => Matrix4::identity(),
        urdf_rs::JointType::Prismatic => Matrix4::new_translation(&(Vector3::from(*joint.axis.xyz) * value)),
        _ => turned(*joint.axis.xyz, value),
    };
    root_from(robot, &joint.parent.link, values) * placed(&joint.origin) * motion
}

#[test]
fn links_stand_where_another_reader_puts_them() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    for name in [THREE, FOUR, FIVE, JAWS] {
        let robot = urdf_rs::read_file(model(name)).unwrap();
        let loaded = loaded(name);
        let hand = &loaded.hand;
        for _ in 0..200 {
            let posture = random_posture(hand, &mut rng);
            let values: BTreeMap<String, f64> =
                hand.joints.iter().enumerate().map(|(i, joint)| (joint.name.clone(), posture[i])).collect();
            let root_from_palm =
                root_from(&robot, &loaded.palm_link, &values) * loaded.link_from_palm.to_homogeneous();
            for finger in &hand.fingers {
                let frames = finger.frames(&posture);
                for (i, segment) in finger.segments().iter().enumerate() {
                    let expected = root_from(&robot, &segment.link, &values);
                    let found = root_from_palm * frames.palm_from_segment(i).to_homogeneous();
                    assert!((found - expected).abs().max() < 1e-12, "{name} {}", segment.link);
                }
            }
        }
    }
}
