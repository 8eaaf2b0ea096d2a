//! Hands from URDF, on descriptions written for these tests: what is found, against what one sees; kinematics, against
//! `urdf-rs` and plain matrices; what is refused, and how; grasps planned from end to end.
#![allow(clippy::unwrap_used, clippy::panic, reason = "the helpers of these tests are tests themselves")]

mod built_in;
mod command;
mod found;
mod kinematics;
mod planned;
mod refused;

use std::path::PathBuf;

use host::hand::urdf::{Loaded, Overrides, load};
use host::hand::{Hand, Posture};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Three fingers of which two share a mirrored spread joint; one drive a finger.
const THREE: &str = "three_finger.urdf";
/// Four fingers of four joints each.
const FOUR: &str = "four_finger.urdf";
/// Five fingers with six drives, meshes by relative, `file://` and `package://` paths.
const FIVE: &str = "five_finger/urdf/five_finger.urdf";
/// Two jaws that slide on one drive.
const JAWS: &str = "parallel_gripper.urdf";

fn model(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/hands/models").join(name)
}

fn loaded(name: &str) -> Loaded {
    load(&model(name), None, &[]).unwrap_or_else(|error| panic!("{error}"))
}

fn overrides(toml: &str) -> Overrides {
    Overrides::parse(toml).unwrap_or_else(|error| panic!("{error}"))
}

fn random_posture(hand: &Hand, rng: &mut ChaCha8Rng) -> Posture {
    let mut posture = Posture::ZERO;
    for (i, joint) in hand.joints.iter().enumerate() {
        posture[i] = rng.random_range(joint.lower_rad..=joint.upper_rad);
    }
    posture
}
