//! One finger as an articulated body: a driven palm, for the thumb its turning support, and four links.

use hand_model::{DriveParameters, HandModel, LinkMass};
use nalgebra::{Isometry3, Vector3, convert};
use protocol::ids::FingerId;
use rapier3d_f64::math::{Pose, Rotation, Vector};
use rapier3d_f64::prelude::{
    ColliderBuilder, ColliderHandle, GenericJoint, GenericJointBuilder, JointAxesMask, JointAxis,
    MassProperties, Multibody, MultibodyDofCoupling, MultibodyJointHandle, PhysicsWorld, RigidBodyBuilder,
    RigidBodyHandle,
};

use super::convert::{engine_pose, engine_vector, project_pose, project_vector};
use super::plant::{Friction, PlantError};
use super::surface::{Part, surface};

/// The palm follows the arm whatever the fingers do. The engine cannot combine a kinematic root with coupled joints, so
/// the palm is a free body, heavy enough that 10 N do not move it, driven by the force that its next pose asks for.
const PALM_MASS_KG: f64 = 1000.0;
/// Isotropic inertia of the palm, kg m^2; see [`PALM_MASS_KG`].
const PALM_INERTIA_KG_M2: f64 = 10.0;
/// Mass of the thumb's turning support, a tenth of the real palm's. Assumed; it only loads the brake.
const SUPPORT_MASS_KG: f64 = 0.1;
/// Inertia of the support about its own centre, kg m^2: a block of 40 x 40 x 60 mm.
const SUPPORT_INERTIA_KG_M2: f64 = 4e-5;
/// Stiffness of the thumb's brake: 1 mrad at 1 N m.
const BRAKE_STIFFNESS_NM_PER_RAD: f64 = 1000.0;
/// Inertia of the brake's gear seen at the support, kg m^2.
const BRAKE_INERTIA_KG_M2: f64 = 1e-3;
/// The distal link's capsule is this much thinner than the tip's sphere, so that only the tip touches at the end.
const TIP_RECESS_M: f64 = 0.0005;
/// Share of the largest speed over which a drive's torque runs out.
const SPEED_ROLL_OFF: f64 = 0.1;

/// A hinge's only coordinate among the engine's six: the rotation about the joint frame's x axis.
const HINGE: usize = 3;

/// A force and its moment about a given point, base frame, N and N m.
pub(super) type Wrench = (Vector3<f64>, Vector3<f64>);

/// A finger in a world. Its handles never dangle: nothing removes a body.
pub(super) struct FingerBody {
    palm: RigidBodyHandle,
    /// The hinge of the thumb's support.
    support: Option<MultibodyJointHandle>,
    /// What carries the first joint: the palm, or the thumb's support.
    carrier: RigidBodyHandle,
    /// Base part, proximal, middle and distal link.
    pub(super) links: [RigidBodyHandle; 4],
    /// The hinges that carry them: abduction, flexion, middle, distal.
    joints: [MultibodyJointHandle; 4],
    /// Capsules of the proximal, middle and distal link.
    pub(super) capsules: [ColliderHandle; 3],
    pub(super) tip: ColliderHandle,
}

impl FingerBody {
    /// Puts a finger into `world` with its joints (abduction, flexion, middle) at `angles_rad`.
    pub(super) fn insert(
        world: &mut PhysicsWorld,
        model: &HandModel<f64>,
        friction: &Friction,
        id: FingerId,
        base_from_palm: &Isometry3<f64>,
        thumb_rotation_rad: f64,
        angles_rad: [f64; 3],
    ) -> Result<Self, PlantError> {
        let palm_mass = MassProperties::new(Vector::ZERO, PALM_MASS_KG, Vector::splat(PALM_INERTIA_KG_M2));
        let palm = world.insert_body(body(palm_mass).pose(engine_pose(base_from_palm)).gravity_scale(0.0));
        let palm_from_base: Isometry3<f64> = convert(model.palm_from_finger_base(id, 0f64.sin_cos()));
        let (carrier, carrier_from_base, support) = if id == FingerId::Thumb {
            let palm_from_support = Isometry3::from(model.mounts.thumb_axis_in_palm.coords);
            let support_from_base = palm_from_support.inverse() * palm_from_base;
            let center = engine_vector(&support_from_base.translation.vector);
            let inertia = Vector::splat(SUPPORT_INERTIA_KG_M2);
            let support = world.insert_body(body(MassProperties::new(center, SUPPORT_MASS_KG, inertia)));
            let joint = join(world, palm, support, hinge(&palm_from_support, -Vector::Z))?;
            (support, support_from_base, Some(joint))
        } else {
            (palm, palm_from_base, None)
        };

        let geometry = &model.finger;
        let lengths = [0.0, geometry.l1_m, geometry.l2_m, geometry.l3_m];
        let masses = &model.masses;
        let links = [&masses.base, &masses.proximal, &masses.middle, &masses.distal]
            .map(|mass| world.insert_body(body(mass_properties(mass))));
        let limits = &model.hard_limits;
        let limits = [limits.abduction, limits.flexion, limits.middle];
        let mut joints = Vec::with_capacity(4);
        for (k, &link) in links.iter().enumerate() {
            let (parent, parent_from_joint) = match k {
                0 => (carrier, carrier_from_base),
                _ => (links[k - 1], Isometry3::translation(lengths[k - 1], 0.0, 0.0)),
            };
            let mut joint = hinge(&parent_from_joint, hinge_axis(k));
            if let Some(range) = limits.get(k) {
                joint.set_limits(JointAxis::AngX, [range.lower_rad, range.upper_rad]);
            }
            joints.push(join(world, parent, link, joint)?);
        }
        let joints = joints.try_into().map_err(|_| PlantError::Assembly)?;

        let mut radii = model.collision.link_radii_m;
        radii[2] = radii[2].min(geometry.tip_radius_m - TIP_RECESS_M);
        let capsules = [1, 2, 3].map(|k| {
            let end = Vector::X * lengths[k];
            let capsule = ColliderBuilder::capsule_from_endpoints(Vector::ZERO, end, radii[k - 1]);
            world.insert_collider(surface(capsule, Part::Hand, friction.link), Some(links[k]))
        });
        let ball = ColliderBuilder::ball(geometry.tip_radius_m).translation(Vector::X * lengths[3]);
        let tip = world.insert_collider(surface(ball, Part::Hand, friction.tip), Some(links[3]));
        let finger = Self { palm, support, carrier, links, joints, capsules, tip };
        finger.set_up(world, &model.drive, thumb_rotation_rad, angles_rad).ok_or(PlantError::Assembly)?;
        Ok(finger)
    }

    /// Drives, coupling and the first configuration.
    fn set_up(
        &self,
        world: &mut PhysicsWorld,
        drive: &DriveParameters<f64>,
        thumb_rotation_rad: f64,
        angles_rad: [f64; 3],
    ) -> Option<()> {
        let mut links = [0; 4];
        for (link, joint) in links.iter_mut().zip(self.joints) {
            *link = world.multibody_joints.get(joint)?.1;
        }
        let support = self.support.and_then(|joint| Some(world.multibody_joints.get(joint)?.1));
        let (multibody, _) = world.multibody_joints.get_mut(self.joints[0])?;
        multibody.set_self_contacts_enabled(false);
        // The engine damps every hinge by default.
        multibody.damping_mut().fill(0.0);
        let mut displacement = vec![0.0; multibody.ndofs()];
        if let Some(support) = support {
            let dof = multibody.link(support)?.assembly_id();
            displacement[dof] = thumb_rotation_rad;
            multibody.armature_mut()[dof] = BRAKE_INERTIA_KG_M2;
            multibody.damping_mut()[dof] = 2.0 * (BRAKE_STIFFNESS_NM_PER_RAD * BRAKE_INERTIA_KG_M2).sqrt();
            brake(multibody, support, thumb_rotation_rad);
        }
        for (k, &link) in links.iter().enumerate() {
            let dof = multibody.link(link)?.assembly_id();
            displacement[dof] = angles_rad[k.min(2)];
            if k < 3 {
                multibody.damping_mut()[dof] = drive.viscous_friction_nm_s_per_rad;
                multibody.armature_mut()[dof] = drive.rotor_inertia_kg_m2;
                multibody.frictions_mut()[dof] = drive.coulomb_friction_nm;
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
        multibody.apply_displacements(&displacement);
        multibody.forward_kinematics(&world.bodies, true);
        multibody.update_rigid_bodies(&mut world.bodies, true);
        Some(())
    }

    /// Adds the drives' torques (abduction, flexion, middle) as equal and opposite moments on the two links of each joint.
    /// A torque on the middle joint is one on the coupled coordinate, because the coupling does no work.
    pub(super) fn apply_torques(
        &self,
        world: &mut PhysicsWorld,
        drive: &DriveParameters<f64>,
        commanded_nm: [f64; 3],
    ) {
        for (k, commanded) in commanded_nm.into_iter().enumerate() {
            let limit = drive.torque_max_nm[k];
            // A drive makes nothing of what is no number.
            let mut torque = if commanded.is_finite() { commanded.clamp(-limit, limit) } else { 0.0 };
            let speed = speed_rad_per_s(world, self.joints[k]);
            // At its largest speed a drive has no voltage left to push further.
            if speed * torque > 0.0 {
                let left = 1.0 - speed.abs() / drive.speed_max_rad_per_s;
                torque *= (left / SPEED_ROLL_OFF).clamp(0.0, 1.0);
            }
            let link = &mut world.bodies[self.links[k]];
            let moment = link.rotation() * hinge_axis(k) * torque;
            link.add_torque(moment, false);
            let parent = if k == 0 { self.carrier } else { self.links[k - 1] };
            world.bodies[parent].add_torque(-moment, false);
        }
    }

    /// Brakes the support, if there is one, at `angle_rad`.
    pub(super) fn brake_support(&self, world: &mut PhysicsWorld, angle_rad: f64) {
        if let Some(joint) = self.support
            && let Some((multibody, link)) = world.multibody_joints.get_mut_internal(joint)
        {
            brake(multibody, link, angle_rad);
        }
    }

    /// Adds the force that brings the palm to `base_from_palm` at the end of the next step.
    pub(super) fn drive_palm(&self, world: &mut PhysicsWorld, base_from_palm: &Isometry3<f64>) {
        let Some((multibody, _)) = world.multibody_joints.get(self.joints[0]) else { return };
        let step_s = world.integration_parameters.dt;
        // The body's own velocity lags by one step; the first six coordinates of the articulated body are the palm's.
        let speeds = multibody.generalized_velocity();
        let (linear, angular) =
            (speeds.fixed_rows::<3>(0).into_owned(), speeds.fixed_rows::<3>(3).into_owned());
        let palm = &mut world.bodies[self.palm];
        let now = project_pose(palm.position());
        let velocity = (base_from_palm.translation.vector - now.translation.vector) / step_s;
        let spin = (base_from_palm.rotation * now.rotation.inverse()).scaled_axis() / step_s;
        let push = (velocity - linear) * (PALM_MASS_KG / step_s);
        let turn = (spin - angular) * (PALM_INERTIA_KG_M2 / step_s);
        palm.add_force(engine_vector(&push), false);
        palm.add_torque(engine_vector(&turn), false);
    }

    /// The palm's body, which carries whatever else is fixed to it.
    pub(super) fn palm(&self) -> RigidBodyHandle {
        self.palm
    }

    /// Angles of abduction, flexion, middle and distal joint.
    pub(super) fn angles_rad(&self, world: &PhysicsWorld) -> [f64; 4] {
        self.joints.map(|joint| angle_rad(world, joint))
    }

    /// Angle of the support, if there is one.
    pub(super) fn support_rad(&self, world: &PhysicsWorld) -> Option<f64> {
        self.support.map(|joint| angle_rad(world, joint))
    }

    /// Torques that the drives (abduction, flexion, middle) and the brake of the support have to give to hold the links
    /// against weight and contacts. `on_links[k]` is the contact wrench on link `k` about its centre of mass. The links'
    /// own acceleration is left out.
    pub(super) fn load_nm(&self, world: &PhysicsWorld, on_links: &[Wrench; 4]) -> ([f64; 3], f64) {
        let (mut load, mut on_support) = ([0.0; 3], 0.0);
        let Some((multibody, _)) = world.multibody_joints.get(self.joints[0]) else {
            return (load, on_support);
        };
        let link_of = |joint| world.multibody_joints.get(joint).map(|(_, link)| link);
        let coordinate = |joint| multibody.link(link_of(joint)?).map(|link| link.assembly_id());
        let gravity = project_vector(world.gravity);
        for ((&joint, &body), (force, moment)) in self.joints.iter().zip(&self.links).zip(on_links) {
            let Some(link) = link_of(joint) else { continue };
            let force = force + gravity * world.bodies[body].mass();
            let jacobian = multibody.body_jacobian(link);
            let along = |coordinate: usize| {
                let column = jacobian.column(coordinate);
                column.fixed_rows::<3>(0).dot(&force) + column.fixed_rows::<3>(3).dot(moment)
            };
            // The distal joint's load comes to the middle one through the linkage.
            for (k, &joint) in self.joints.iter().enumerate() {
                load[k.min(2)] -= coordinate(joint).map_or(0.0, along);
            }
            on_support -= self.support.and_then(coordinate).map_or(0.0, along);
        }
        (load, on_support)
    }
}

/// The axis of joint `k` of a finger (abduction, flexion, middle, distal) in the frame of its link.
fn hinge_axis(k: usize) -> Vector {
    if k == 0 { Vector::Z } else { -Vector::Y }
}

fn body(mass: MassProperties) -> RigidBodyBuilder {
    RigidBodyBuilder::dynamic().additional_mass_properties(mass).can_sleep(false)
}

fn mass_properties(link: &LinkMass<f64>) -> MassProperties {
    MassProperties::new(Vector::X * link.com_m, link.mass_kg, Vector::from_array(link.inertia_kg_m2))
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

/// A stiff spring, which the engine integrates implicitly, stands for the brake.
fn brake(multibody: &mut Multibody, support: usize, angle_rad: f64) {
    if let Some(link) = multibody.link_mut(support) {
        link.joint.set_spring(HINGE, BRAKE_STIFFNESS_NM_PER_RAD, angle_rad);
    }
}

fn angle_rad(world: &PhysicsWorld, joint: MultibodyJointHandle) -> f64 {
    let found = world.multibody_joints.get(joint).and_then(|(multibody, link)| multibody.link(link));
    found.map_or(0.0, |link| link.joint().coords()[HINGE])
}

fn speed_rad_per_s(world: &PhysicsWorld, joint: MultibodyJointHandle) -> f64 {
    let found =
        world.multibody_joints.get(joint).and_then(|(m, link)| Some(m.joint_velocity(m.link(link)?)[0]));
    found.unwrap_or(0.0)
}
