//! Poses of hand and arm by this project's kinematics, as JSON on standard output, for readers of the exported URDFs to
//! compare with: random joint angles within the limits, and where that puts bodies, as 4 x 4 matrices by rows.

use std::collections::BTreeMap;
use std::io::Write;

use hand_model::{FingerTrig, HandAngles, HandModel, links};
use nalgebra::Matrix4;
use protocol::ids::{FingerId, JointId};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};

use host::plan::arm::Arm;

/// Poses of each robot.
const POSES: usize = 1000;

fn rows(matrix: &Matrix4<f64>) -> Vec<f64> {
    matrix.transpose().iter().copied().collect()
}

/// The fingers' bodies in the palm.
fn hand(random: &mut ChaCha8Rng) -> Value {
    let model = HandModel::<f64>::hit_dlr();
    let angles_rad = JointId::ALL.map(|joint| {
        let range = model.hard_limits.range(joint);
        random.random_range(range.lower_rad..=range.upper_rad)
    });
    let angles = HandAngles::from_array(&angles_rad);
    let mut bodies = BTreeMap::new();
    for finger in FingerId::ALL {
        let palm_from_base = model.palm_from_finger_base(finger, angles.thumb_rotation_rad.sin_cos());
        let in_base = links(&model.finger, &FingerTrig::new(angles.finger(finger), f64::sin_cos));
        for (link, pose) in
            [("proximal", in_base.proximal), ("middle", in_base.middle), ("distal", in_base.distal)]
        {
            let name = format!("{}_{link}_link", finger.name());
            bodies.insert(name, rows(&(palm_from_base * pose).to_homogeneous()));
        }
    }
    let angles: BTreeMap<&str, f64> = JointId::ALL.iter().map(|joint| joint.name()).zip(angles_rad).collect();
    json!({ "angles": angles, "bodies": bodies })
}

/// The palm on the flange of the arm.
fn arm(random: &mut ChaCha8Rng) -> Value {
    let arm = Arm::rx60();
    let limits = arm.limits();
    let q_rad: [f64; 6] =
        std::array::from_fn(|i| random.random_range(limits.lower_rad[i]..=limits.upper_rad[i]));
    let angles: BTreeMap<String, f64> =
        (1..).zip(q_rad).map(|(axis, q)| (format!("joint_{axis}"), q)).collect();
    json!({ "angles": angles, "bodies": { "palm": rows(&arm.base_from_palm(&q_rad).to_homogeneous()) } })
}

fn main() -> std::io::Result<()> {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let hands: Vec<Value> = (0..POSES).map(|_| hand(&mut random)).collect();
    let arms: Vec<Value> = (0..POSES).map(|_| arm(&mut random)).collect();
    writeln!(std::io::stdout(), "{}", json!({ "urdf": hands, "urdf-arm": arms }))
}
