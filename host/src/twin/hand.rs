//! The hand as one articulated body: a driven palm, the thumb's turning support and four fingers of four links.

use hand_model::{DriveParameters, HandModel, LinkMass};
use nalgebra::{Isometry3, Vector3, convert};
use protocol::ids::{FINGER_COUNT, FingerId, JOINT_COUNT};
use rapier3d_f64::math::{Pose, Rotation, Vector};
use rapier3d_f64::prelude::{
    ColliderBuilder, ColliderHandle, GenericJoint, GenericJointBuilder, JointAxesMask, JointAxis,
    MassProperties, Multibody, MultibodyDofCoupling, MultibodyJointHandle, PhysicsWorld, RigidBodyBuilder,
    RigidBodyHandle,
};

use super::convert::{engine_pose, engine_vector, project_pose, project_vector};
use super::plant::{Friction, PlantError, STEP_S};
use super::surface::{Part, surface};

/// The palm follows the arm whatever the fingers do. The engine cannot combine a kinematic root with coupled joints, so
/// the palm is a free body, heavy enough that 10 N do not move it, driven by the force that its next pose asks for.
const PALM_MASS_KG: f64 = 1000.0;
/// Isotropic inertia of the palm, kg m^2; see [`PALM_MASS_KG`].
const PALM_INERTIA_KG_M2: f64 = 10.0;
/// Mass of the thumb's turning support, a tenth of the palm's. Assumed; only its weight on the brake matters.
const SUPPORT_MASS_KG: f64 = 0.1;
/// Inertia of the support about its own centre, kg m^2: a block of 40 x 40 x 60 mm.
const SUPPORT_INERTIA_KG_M2: f64 = 4e-5;
/// Stiffness of the thumb's brake: 1 mrad at 1 N m.
const BRAKE_STIFFNESS_NM_PER_RAD: f64 = 1000.0;
/// Inertia of the brake's gear seen at the support, kg m^2.
const BRAKE_INERTIA_KG_M2: f64 = 1e-3;
/// The distal link's capsule is this much thinner than the tip's sphere, so that only the tip touches at the end.
const TIP_RECESS_M: f64 = 0.0005;

/// A hinge's only coordinate among the engine's six: the rotation about the joint frame's x axis.
const HINGE: usize = 3;

/// One finger: its four links (base part, proximal, middle, distal) and the joints that carry them.
pub(super) struct FingerBody {
    pub(super) links: [RigidBodyHandle; 4],
    pub(super) joints: [MultibodyJointHandle; 4],
    /// Capsules of the proximal, middle and distal link.
    pub(super) capsules: [ColliderHandle; 3],
    pub(super) tip: ColliderHandle,
}

/// The hand in a world.
pub(super) struct HandBody {
    pub(super) palm: RigidBodyHandle,
    support: RigidBodyHandle,
    support_joint: MultibodyJointHandle,
    pub(super) fingers: [FingerBody; FINGER_COUNT],
    drive: DriveParameters<f64>,
    rotation_speed_max_rad_per_s: f64,
    /// Where the thumb's support is braked.
    braked_rad: f64,
}

/// The axis of joint `k` of a finger (abduction, flexion, middle, distal) in the frame of its link.
fn hinge_axis(k: usize) -> Vector {
    if k == 0 { Vector::Z } else { -Vector::Y }
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
        let body = |mass| RigidBodyBuilder::dynamic().additional_mass_properties(mass).can_sleep(false);
        let palm_mass = MassProperties::new(Vector::ZERO, PALM_MASS_KG, Vector::splat(PALM_INERTIA_KG_M2));
        let palm = world.insert_body(body(palm_mass).pose(engine_pose(base_from_palm)).gravity_scale(0.0));
        let block = &model.collision.palm;
        let half = (block.max_in_palm - block.min_in_palm) / 2.0;
        let cuboid = ColliderBuilder::cuboid(half.x, half.y, half.z)
            .translation(engine_vector(&(block.min_in_palm.coords + half)));
        world.insert_collider(surface(cuboid, Part::Hand, friction.link), Some(palm));

        let thumb_base: Isometry3<f64> =
            convert(model.palm_from_finger_base(FingerId::Thumb, 0f64.sin_cos()));
        let palm_from_support = Isometry3::from(model.mounts.thumb_axis_in_palm.coords);
        let support_from_base = palm_from_support.inverse() * thumb_base;
        let support = world.insert_body(body(MassProperties::new(
            engine_vector(&support_from_base.translation.vector),
            SUPPORT_MASS_KG,
            Vector::splat(SUPPORT_INERTIA_KG_M2),
        )));
        let support_joint = join(world, palm, support, hinge(&palm_from_support, -Vector::Z))?;

        let mut fingers = Vec::with_capacity(FINGER_COUNT);
        for id in FingerId::ALL {
            let (root, root_from_base) = match id {
                FingerId::Thumb => (support, support_from_base),
                _ => (palm, convert(model.palm_from_finger_base(id, 0f64.sin_cos()))),
            };
            fingers.push(FingerBody::insert(world, model, friction, root, &root_from_base)?);
        }
        let fingers = fingers.try_into().map_err(|_| PlantError::Assembly)?;
        let hand = Self {
            palm,
            support,
            support_joint,
            fingers,
            drive: model.drive,
            rotation_speed_max_rad_per_s: model.thumb_rotation.speed_max_rad_per_s,
            braked_rad: angles_rad[0],
        };
        hand.set_up(world, angles_rad).ok_or(PlantError::Assembly)?;
        Ok(hand)
    }

    /// Drives, couplings and the first configuration.
    fn set_up(&self, world: &mut PhysicsWorld, angles_rad: &[f64; JOINT_COUNT]) -> Option<()> {
        let mut links = [[0; 4]; FINGER_COUNT];
        for (links, finger) in links.iter_mut().zip(&self.fingers) {
            for (link, joint) in links.iter_mut().zip(finger.joints) {
                *link = world.multibody_joints.get(joint)?.1;
            }
        }
        let (multibody, support) = world.multibody_joints.get_mut(self.support_joint)?;
        multibody.set_self_contacts_enabled(false);
        // The engine damps every hinge by default.
        multibody.damping_mut().fill(0.0);
        let mut displacement = vec![0.0; multibody.ndofs()];

        let dof = multibody.link(support)?.assembly_id();
        displacement[dof] = angles_rad[0];
        multibody.armature_mut()[dof] = BRAKE_INERTIA_KG_M2;
        multibody.damping_mut()[dof] = 2.0 * (BRAKE_STIFFNESS_NM_PER_RAD * BRAKE_INERTIA_KG_M2).sqrt();
        multibody.link_mut(support)?.joint.set_spring(HINGE, BRAKE_STIFFNESS_NM_PER_RAD, angles_rad[0]);

        for (f, links) in links.iter().enumerate() {
            for (k, &link) in links.iter().enumerate() {
                let dof = multibody.link(link)?.assembly_id();
                displacement[dof] = angles_rad[1 + 3 * f + k.min(2)];
                if k < 3 {
                    multibody.damping_mut()[dof] = self.drive.viscous_friction_nm_s_per_rad;
                    multibody.armature_mut()[dof] = self.drive.rotor_inertia_kg_m2;
                    multibody.frictions_mut()[dof] = self.drive.coulomb_friction_nm;
                }
            }
            multibody.add_dof_coupling(MultibodyDofCoupling {
                link1: links[2],
                dof1: 0,
                axis1: HINGE,
                link2: links[3],
                dof2: 0,
                axis2: HINGE,
                coeff: 1.0,
                offset: 0.0,
            });
        }
        multibody.apply_displacements(&displacement);
        multibody.forward_kinematics(&world.bodies, true);
        multibody.update_rigid_bodies(&mut world.bodies, true);
        Some(())
    }

    /// Adds the drives' torques (order of `JointId`; the entry of the thumb's rotation is not used) as equal and opposite
    /// moments on the two links of each joint. A torque on the middle joint is one on the coupled coordinate, because the
    /// coupling does no work.
    pub(super) fn apply_torques(&self, world: &mut PhysicsWorld, commanded_nm: &[f64; JOINT_COUNT]) {
        for (f, finger) in self.fingers.iter().enumerate() {
            let root = if f == FingerId::Thumb.index() { self.support } else { self.palm };
            for k in 0..3 {
                let limit = self.drive.torque_max_nm[k];
                let mut torque = commanded_nm[1 + 3 * f + k].clamp(-limit, limit);
                let speed = speed_rad_per_s(world, finger.joints[k]);
                // At its largest speed a drive has no voltage left to push further.
                if speed * torque > 0.0 {
                    torque *= (1.0 - speed.abs() / self.drive.speed_max_rad_per_s).clamp(0.0, 0.1) / 0.1;
                }
                let link = &mut world.bodies[finger.links[k]];
                let moment = link.rotation() * hinge_axis(k) * torque;
                link.add_torque(moment, false);
                let parent = if k == 0 { root } else { finger.links[k - 1] };
                world.bodies[parent].add_torque(-moment, false);
            }
        }
    }

    /// Turns the thumb's support towards `target_rad` at its own speed; where it stands it is braked.
    pub(super) fn turn_thumb(&mut self, world: &mut PhysicsWorld, target_rad: f64) {
        let reach = self.rotation_speed_max_rad_per_s * STEP_S;
        self.braked_rad += (target_rad - self.braked_rad).clamp(-reach, reach);
        if let Some((multibody, link)) = world.multibody_joints.get_mut_internal(self.support_joint)
            && let Some(link) = multibody.link_mut(link)
        {
            link.joint.set_spring(HINGE, BRAKE_STIFFNESS_NM_PER_RAD, self.braked_rad);
        }
    }

    /// Adds the force that brings the palm to `base_from_palm` at the end of the next step.
    pub(super) fn drive_palm(&self, world: &mut PhysicsWorld, base_from_palm: &Isometry3<f64>) {
        let Some((multibody, _)) = world.multibody_joints.get(self.support_joint) else { return };
        // The body's own velocity lags by one step; the first six coordinates of the articulated body are the palm's.
        let speeds = multibody.generalized_velocity();
        let (linear, angular) =
            (speeds.fixed_rows::<3>(0).into_owned(), speeds.fixed_rows::<3>(3).into_owned());
        let palm = &mut world.bodies[self.palm];
        let now = project_pose(palm.position());
        let velocity = (base_from_palm.translation.vector - now.translation.vector) / STEP_S;
        let spin = (base_from_palm.rotation * now.rotation.inverse()).scaled_axis() / STEP_S;
        let push = (velocity - linear) * (PALM_MASS_KG / STEP_S);
        let turn = (spin - angular) * (PALM_INERTIA_KG_M2 / STEP_S);
        palm.add_force(engine_vector(&push), false);
        palm.add_torque(engine_vector(&turn), false);
    }

    /// Joint angles in the order of `JointId`.
    pub(super) fn angles_rad(&self, world: &PhysicsWorld) -> [f64; JOINT_COUNT] {
        let mut angles = [angle_rad(world, self.support_joint); JOINT_COUNT];
        for (slots, finger) in angles[1..].chunks_exact_mut(3).zip(&self.fingers) {
            for (slot, &joint) in slots.iter_mut().zip(&finger.joints) {
                *slot = angle_rad(world, joint);
            }
        }
        angles
    }

    /// What the links load their joints with, in the order of `JointId`: the torque that the drive has to give to hold
    /// against weight and contacts. `on_links[f][k]` are the contact force and moment (about the link's centre of mass)
    /// on link `k` of finger `f`, in the base frame. The links' own acceleration is left out.
    pub(super) fn load_nm(
        &self,
        world: &PhysicsWorld,
        on_links: &[[(Vector3<f64>, Vector3<f64>); 4]; FINGER_COUNT],
    ) -> [f64; JOINT_COUNT] {
        let mut load = [0.0; JOINT_COUNT];
        let Some((multibody, support)) = joint_of(world, self.support_joint) else { return load };
        let gravity = project_vector(world.gravity);
        let coordinate = |link: usize| multibody.link(link).map_or(0, |l| l.assembly_id());
        for (f, (finger, on_links)) in self.fingers.iter().zip(on_links).enumerate() {
            let ids = finger.joints.map(|joint| joint_of(world, joint).map_or(0, |(_, id)| id));
            for ((&id, &body), (force, moment)) in ids.iter().zip(&finger.links).zip(on_links) {
                let force = force + gravity * world.bodies[body].mass();
                let jacobian = multibody.body_jacobian(id);
                let along = |link: usize| {
                    let column = jacobian.column(coordinate(link));
                    column.fixed_rows::<3>(0).dot(&force) + column.fixed_rows::<3>(3).dot(moment)
                };
                // The distal joint's load comes to the middle one through the linkage.
                for (joint, &link) in ids.iter().enumerate() {
                    load[1 + 3 * f + joint.min(2)] -= along(link);
                }
                if f == FingerId::Thumb.index() {
                    load[0] -= along(support);
                }
            }
        }
        load
    }

    /// Angle of a finger's distal joint, which the coupling holds to the middle one.
    pub(super) fn distal_rad(&self, world: &PhysicsWorld, finger: FingerId) -> f64 {
        angle_rad(world, self.fingers[finger.index()].joints[3])
    }
}

impl FingerBody {
    fn insert(
        world: &mut PhysicsWorld,
        model: &HandModel<f64>,
        friction: &Friction,
        root: RigidBodyHandle,
        root_from_base: &Isometry3<f64>,
    ) -> Result<Self, PlantError> {
        let geometry = &model.finger;
        let lengths = [0.0, geometry.l1_m, geometry.l2_m, geometry.l3_m];
        let masses = &model.masses;
        let masses = [&masses.base, &masses.proximal, &masses.middle, &masses.distal];
        let limits = &model.hard_limits;
        let limits = [limits.abduction, limits.flexion, limits.middle];
        let links = masses.map(|mass| {
            let mass = mass_properties(mass);
            world.insert_body(RigidBodyBuilder::dynamic().additional_mass_properties(mass).can_sleep(false))
        });
        let mut joints = Vec::with_capacity(4);
        for (k, &link) in links.iter().enumerate() {
            let parent = if k == 0 { root } else { links[k - 1] };
            let parent_from_joint =
                if k == 0 { *root_from_base } else { Isometry3::translation(lengths[k - 1], 0.0, 0.0) };
            let mut joint = hinge(&parent_from_joint, hinge_axis(k));
            if let Some(range) = limits.get(k) {
                joint.set_limits(JointAxis::AngX, [range.lower_rad, range.upper_rad]);
            }
            joints.push(join(world, parent, link, joint)?);
        }
        let capsules = [1, 2, 3].map(|k| {
            let radius = model.collision.link_radii_m[k - 1].min(if k == 3 {
                geometry.tip_radius_m - TIP_RECESS_M
            } else {
                f64::INFINITY
            });
            let capsule =
                ColliderBuilder::capsule_from_endpoints(Vector::ZERO, Vector::X * lengths[k], radius);
            world.insert_collider(surface(capsule, Part::Hand, friction.link), Some(links[k]))
        });
        let ball = ColliderBuilder::ball(geometry.tip_radius_m).translation(Vector::X * lengths[3]);
        let tip = world.insert_collider(surface(ball, Part::Hand, friction.tip), Some(links[3]));
        let joints = joints.try_into().map_err(|_| PlantError::Assembly)?;
        Ok(Self { links, joints, capsules, tip })
    }
}

/// A hinge about `axis` (unit, in the frame of the joint), which stands at `parent_from_joint` in the parent.
fn hinge(parent_from_joint: &Isometry3<f64>, axis: Vector) -> GenericJoint {
    let joint_from_engine = Pose::from_rotation(Rotation::from_rotation_arc(Vector::X, axis));
    GenericJointBuilder::new(JointAxesMask::LOCKED_REVOLUTE_AXES)
        .local_frame1(engine_pose(parent_from_joint) * joint_from_engine)
        .local_frame2(joint_from_engine)
        .build()
}

fn join(
    world: &mut PhysicsWorld,
    parent: RigidBodyHandle,
    link: RigidBodyHandle,
    joint: GenericJoint,
) -> Result<MultibodyJointHandle, PlantError> {
    world.insert_multibody_joint(parent, link, joint).ok_or(PlantError::Assembly)
}

fn mass_properties(link: &LinkMass<f64>) -> MassProperties {
    MassProperties::new(Vector::X * link.com_m, link.mass_kg, Vector::from_array(link.inertia_kg_m2))
}

/// The multibody of a joint and the joint's link in it. Handles of this module never dangle: nothing removes a body.
fn joint_of(world: &PhysicsWorld, joint: MultibodyJointHandle) -> Option<(&Multibody, usize)> {
    world.multibody_joints.get(joint)
}

fn angle_rad(world: &PhysicsWorld, joint: MultibodyJointHandle) -> f64 {
    joint_of(world, joint).and_then(|(m, id)| m.link(id)).map_or(0.0, |l| l.joint().coords()[HINGE])
}

fn speed_rad_per_s(world: &PhysicsWorld, joint: MultibodyJointHandle) -> f64 {
    joint_of(world, joint).and_then(|(m, id)| Some(m.joint_velocity(m.link(id)?)[0])).unwrap_or(0.0)
}
