//! The hand: four fingers that share the pose of their palm.
//!
//! Each finger is an articulated body of its own, on a palm of its own: fingers feel each other only through the palm,
//! which yields to none of them, and four small mass matrices cost less than one large one.

use hand_model::{DriveParameters, HandModel, ThumbRotation};
use nalgebra::Isometry3;
use protocol::ids::{FINGER_COUNT, FingerId, JOINT_COUNT, JOINTS_PER_FINGER, JointId};
use rapier3d_f64::prelude::{ColliderBuilder, PhysicsWorld};

use super::convert::{engine_vector, project_pose};
use super::finger::{FingerBody, Wrench};
use super::plant::{Friction, PlantError};
use super::surface::{Part, surface};

/// The hand in a world.
pub(super) struct HandBody {
    pub(super) fingers: [FingerBody; FINGER_COUNT],
    drive: DriveParameters<f64>,
    rotation: ThumbRotation<f64>,
    /// Where the thumb's support is braked.
    braked_rad: f64,
}

impl HandBody {
    /// Puts the hand into `world`, with its joints at `angles_rad` (order of `JointId`).
    pub(super) fn insert(
        world: &mut PhysicsWorld,
        model: &HandModel<f64>,
        friction: &Friction,
        base_from_palm: &Isometry3<f64>,
        angles_rad: &[f64; JOINT_COUNT],
    ) -> Result<Self, PlantError> {
        let rotation_rad = angles_rad[JointId::THUMB_ROTATION.index()];
        let mut fingers = Vec::with_capacity(FINGER_COUNT);
        for (id, angles) in FingerId::ALL.into_iter().zip(by_finger(angles_rad)) {
            fingers.push(FingerBody::insert(
                world,
                model,
                friction,
                id,
                base_from_palm,
                rotation_rad,
                angles,
            )?);
        }
        let fingers: [_; FINGER_COUNT] = fingers.try_into().map_err(|_| PlantError::Assembly)?;
        let block = &model.collision.palm;
        let half = (block.max_in_palm - block.min_in_palm) / 2.0;
        let cuboid = ColliderBuilder::cuboid(half.x, half.y, half.z)
            .translation(engine_vector(&(block.min_in_palm.coords + half)));
        world.insert_collider(surface(cuboid, Part::Hand, friction.link), Some(fingers[0].palm()));
        Ok(Self { fingers, drive: model.drive, rotation: model.thumb_rotation, braked_rad: rotation_rad })
    }

    /// Prepares the next step: torques of the drives (order of `JointId`; the entry of the thumb's rotation is not used),
    /// the angle to which the thumb's support is to turn, at its own speed, and the palm's pose at the end of the step.
    pub(super) fn drive(
        &mut self,
        world: &mut PhysicsWorld,
        commanded_nm: &[f64; JOINT_COUNT],
        thumb_rotation_rad: f64,
        base_from_palm: &Isometry3<f64>,
    ) {
        let reach = self.rotation.speed_max_rad_per_s * world.integration_parameters.dt;
        if thumb_rotation_rad.is_finite() {
            self.braked_rad += (thumb_rotation_rad - self.braked_rad).clamp(-reach, reach);
        }
        for (finger, torques) in self.fingers.iter().zip(by_finger(commanded_nm)) {
            finger.brake_support(world, self.braked_rad);
            finger.apply_torques(world, &self.drive, torques);
            finger.drive_palm(world, base_from_palm);
        }
    }

    /// Pose of the palm.
    pub(super) fn base_from_palm(&self, world: &PhysicsWorld) -> Isometry3<f64> {
        project_pose(world.bodies[self.fingers[0].palm()].position())
    }

    /// Joint angles in the order of `JointId`.
    pub(super) fn angles_rad(&self, world: &PhysicsWorld) -> [f64; JOINT_COUNT] {
        let mut angles = [self.fingers[0].support_rad(world).unwrap_or(self.braked_rad); JOINT_COUNT];
        for (slots, finger) in angles[1..].chunks_exact_mut(JOINTS_PER_FINGER).zip(&self.fingers) {
            slots.copy_from_slice(&finger.angles_rad(world)[..JOINTS_PER_FINGER]);
        }
        angles
    }

    /// Load on each joint in the order of `JointId`; see [`FingerBody::load_nm`].
    pub(super) fn load_nm(
        &self,
        world: &PhysicsWorld,
        on_links: &[[Wrench; 4]; FINGER_COUNT],
    ) -> [f64; JOINT_COUNT] {
        let mut load = [0.0; JOINT_COUNT];
        for (f, (finger, on_links)) in self.fingers.iter().zip(on_links).enumerate() {
            let (of_finger, of_support) = finger.load_nm(world, on_links);
            let first = 1 + JOINTS_PER_FINGER * f;
            load[first..first + JOINTS_PER_FINGER].copy_from_slice(&of_finger);
            load[JointId::THUMB_ROTATION.index()] += of_support;
        }
        load
    }

    /// Angle of a finger's distal joint, which the coupling holds to the middle one.
    pub(super) fn distal_rad(&self, world: &PhysicsWorld, finger: FingerId) -> f64 {
        self.fingers[finger.index()].angles_rad(world)[3]
    }
}

/// The entries of each finger in an array of joints: abduction, flexion, middle.
fn by_finger(joints: &[f64; JOINT_COUNT]) -> [[f64; JOINTS_PER_FINGER]; FINGER_COUNT] {
    core::array::from_fn(|f| core::array::from_fn(|k| joints[1 + JOINTS_PER_FINGER * f + k]))
}
