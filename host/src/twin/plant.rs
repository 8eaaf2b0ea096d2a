//! The physics: hand, object and table in one engine world, at a fixed step.

use hand_model::{HandAngles, HandModel};
use nalgebra::{Isometry3, Vector3};
use protocol::ids::{FINGER_COUNT, FingerId, JOINT_COUNT};
use rapier3d_f64::math::Vector;
use rapier3d_f64::prelude::{
    ColliderBuilder, ColliderHandle, FrictionModel, PhysicsWorld, RigidBodyHandle, SpringCoefficients,
};
use thiserror::Error;

use super::convert::{engine_vector, project_pose, project_vector};
use super::hand::HandBody;
use super::object::ObjectBody;
use super::surface::{Part, surface};
use crate::link::TipWrench;

/// Length of one physics step unless another is asked for: half a control period.
pub const STEP_S: f64 = 0.0005;

/// Standard gravity, base frame, m/s^2.
pub const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9.80665);

/// Why a scene cannot be simulated.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum PlantError {
    /// The object has no positive mass.
    #[error("an object of {mass_kg} kg cannot be simulated")]
    Mass {
        /// The mass.
        mass_kg: f64,
    },
    /// The object has no shape.
    #[error("an object without convex pieces has no surface to touch")]
    NoPieces,
    /// A convex piece has no volume, or a corner that is not finite.
    #[error("convex piece {piece} of the object has no volume")]
    FlatPiece {
        /// Index of the piece.
        piece: usize,
    },
    /// The engine refused a joint of the hand.
    #[error("the hand could not be assembled")]
    Assembly,
}

/// Coulomb coefficients of pairs of surfaces.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Friction {
    /// Rubber fingertip on the object.
    pub tip: f64,
    /// Bare links and palm on the object.
    pub link: f64,
    /// Object on the table.
    pub table: f64,
}

/// What is simulated, at its start.
#[derive(Debug, Clone)]
pub struct Scene {
    /// The hand.
    pub hand: HandModel<f64>,
    /// Pose of its palm.
    pub base_from_palm: Isometry3<f64>,
    /// Its joints.
    pub angles: HandAngles<f64>,
    /// The object, if there is one.
    pub object: Option<ObjectBody>,
    /// Height of the table's top in the base frame, if there is a table.
    pub table_height_m: Option<f64>,
    /// Coefficients of friction.
    pub friction: Friction,
    /// Gravity in the base frame, m/s^2.
    pub gravity: Vector3<f64>,
}

/// What drives the plant over one step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drive {
    /// Torques of the fingers' drives in the order of `JointId`; the thumb's rotation has none.
    pub torque_nm: [f64; JOINT_COUNT],
    /// Where the thumb's rotation is to be braked.
    pub thumb_rotation_rad: f64,
    /// Pose of the palm at the end of the step.
    pub base_from_palm: Isometry3<f64>,
}

/// A simulated hand with an object and a table. Single-threaded and free of chance: equal inputs give equal bits.
pub struct Plant {
    world: PhysicsWorld,
    hand: HandBody,
    object: Option<RigidBodyHandle>,
    time_steps: u64,
}

/// True mechanical state of the plant's hand.
#[derive(Debug, Clone, PartialEq)]
pub struct PlantState {
    /// Simulated time since the start.
    pub time_s: f64,
    /// Joint angles, order of `JointId`.
    pub angle_rad: [f64; JOINT_COUNT],
    /// Load on each joint from weight and contacts: the torque the drive has to give to hold it.
    pub load_nm: [f64; JOINT_COUNT],
    /// Wrench on each fingertip.
    pub tip_wrench: [TipWrench; FINGER_COUNT],
    /// Pose of each distal link.
    pub base_from_distal: [Isometry3<f64>; FINGER_COUNT],
}

impl Plant {
    /// Sets up a scene, with steps of [`STEP_S`].
    ///
    /// # Errors
    /// [`PlantError`] when the scene cannot be simulated.
    pub fn new(scene: &Scene) -> Result<Self, PlantError> {
        Self::with_step(scene, STEP_S)
    }

    /// Sets up a scene, with steps of `step_s`.
    ///
    /// # Errors
    /// [`PlantError`] when the scene cannot be simulated.
    pub fn with_step(scene: &Scene, step_s: f64) -> Result<Self, PlantError> {
        let mut world = engine_world(&scene.gravity, step_s);
        let angles = scene.angles.to_array();
        let hand =
            HandBody::insert(&mut world, &scene.hand, &scene.friction, &scene.base_from_palm, &angles)?;
        if let Some(height_m) = scene.table_height_m {
            let top = ColliderBuilder::halfspace(nalgebra::Unit::new_unchecked(Vector::Z))
                .translation(Vector::Z * height_m);
            world.insert_collider(surface(top, Part::Table, scene.friction.table), None);
        }
        let object = scene.object.as_ref().map(|object| object.insert(&mut world)).transpose()?;
        Ok(Self { world, hand, object, time_steps: 0 })
    }

    /// Advances by one step.
    pub fn step(&mut self, drive: &Drive) {
        let Drive { torque_nm, thumb_rotation_rad, base_from_palm } = drive;
        self.hand.drive(&mut self.world, torque_nm, *thumb_rotation_rad, base_from_palm);
        self.world.step();
        for (_, body) in self.world.bodies.iter_mut() {
            body.reset_forces(false);
            body.reset_torques(false);
        }
        self.time_steps += 1;
    }

    /// The hand's true state.
    #[must_use]
    pub fn state(&self) -> PlantState {
        let base_from_distal: [_; FINGER_COUNT] = core::array::from_fn(|f| {
            project_pose(self.world.bodies[self.hand.fingers[f].links[3]].position())
        });
        let mut tip_wrench = [TipWrench { force: Vector3::zeros(), moment: Vector3::zeros() }; FINGER_COUNT];
        let mut on_links = [[(Vector3::zeros(), Vector3::zeros()); 4]; FINGER_COUNT];
        for (f, finger) in self.hand.fingers.iter().enumerate() {
            let centre = project_pose(self.world.colliders[finger.tip].position()).translation.vector;
            let (force, moment) = self.contact_wrench(finger.tip, &centre);
            let to_link = base_from_distal[f].rotation.inverse();
            tip_wrench[f] = TipWrench { force: to_link * force, moment: to_link * moment };
            for (k, collider) in
                [(1, finger.capsules[0]), (2, finger.capsules[1]), (3, finger.capsules[2]), (3, finger.tip)]
            {
                let mass_centre = project_vector(self.world.bodies[finger.links[k]].center_of_mass());
                let (force, moment) = self.contact_wrench(collider, &mass_centre);
                on_links[f][k].0 += force;
                on_links[f][k].1 += moment;
            }
        }
        PlantState {
            time_s: self.time_steps as f64 * self.step_s(),
            angle_rad: self.hand.angles_rad(&self.world),
            load_nm: self.hand.load_nm(&self.world, &on_links),
            tip_wrench,
            base_from_distal,
        }
    }

    /// Length of one step.
    #[must_use]
    pub fn step_s(&self) -> f64 {
        self.world.integration_parameters.dt
    }

    /// Pose of the palm.
    #[must_use]
    pub fn base_from_palm(&self) -> Isometry3<f64> {
        self.hand.base_from_palm(&self.world)
    }

    /// Pose of the object, if there is one.
    #[must_use]
    pub fn base_from_object(&self) -> Option<Isometry3<f64>> {
        self.object.map(|object| project_pose(self.world.bodies[object].position()))
    }

    /// Angle of a finger's distal joint, which the linkage holds to the middle one.
    #[must_use]
    pub fn distal_rad(&self, finger: FingerId) -> f64 {
        self.hand.distal_rad(&self.world, finger)
    }

    /// Force on a collider and moment about `center`, base frame, averaged over the last step.
    fn contact_wrench(
        &self,
        collider: ColliderHandle,
        center: &Vector3<f64>,
    ) -> (Vector3<f64>, Vector3<f64>) {
        let mut wrench = (Vector3::zeros(), Vector3::zeros());
        for pair in self.world.contact_pairs_with(collider) {
            let first = pair.collider1 == collider;
            for manifold in pair.manifolds() {
                for point in &manifold.points {
                    // The engine's normal points out of the first collider; both impulses act on the first body.
                    let impulse =
                        point.data.warmstart_tangent_world - manifold.data.normal * point.data.impulse;
                    let force = project_vector(impulse) / if first { self.step_s() } else { -self.step_s() };
                    let local = if first { point.local_p1 } else { point.local_p2 };
                    let place = self.world.colliders[collider].position() * local;
                    wrench.0 += force;
                    wrench.1 += (project_vector(place) - center).cross(&force);
                }
            }
        }
        wrench
    }
}

/// Compliance of contacts: a fingertip yields 0.3 mm under 6 N. The engine's default, soft for the sake of high piles,
/// would let it sink in by 3 mm and bring the links into contact.
const RUBBER: SpringCoefficients<f64> = SpringCoefficients { natural_frequency: 200.0, damping_ratio: 2.0 };

/// An empty world with the plant's settings.
pub(super) fn engine_world(gravity: &Vector3<f64>, step_s: f64) -> PhysicsWorld {
    let mut world = PhysicsWorld::new();
    world.gravity = engine_vector(gravity);
    let parameters = &mut world.integration_parameters;
    parameters.dt = step_s;
    // The engine's tolerances are meant for metres; a hand works in centimetres.
    parameters.length_unit = 0.1;
    // One substep, so that the impulses of the step are the forces that the sensors see.
    parameters.num_solver_iterations = 1;
    parameters.num_internal_pgs_iterations = 8;
    parameters.num_internal_stabilization_iterations = 4;
    parameters.contact_softness = RUBBER;
    parameters.static_contact_softness = RUBBER;
    parameters.max_ccd_substeps = 0;
    parameters.contact_clustering = false;
    parameters.contact_recycling = false;
    // For the object on the table: with one cone for each corner of a face the corners brace against each other sideways
    // and the face slips at 0.9 of its friction. Contacts of the hand always have a cone for each point.
    parameters.friction_model = FrictionModel::Simplified;
    world
}
