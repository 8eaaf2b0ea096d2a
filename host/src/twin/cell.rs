//! The mechanism with its sensors, one control period at a time, whoever controls it.

use nalgebra::{Isometry3, Point3};
use protocol::ids::JOINT_COUNT;

use super::plant::{Drive, Plant, PlantError, STEP_S, Scene};
use super::sensors::{SensorParameters, Sensors};
use crate::link::{LinkError, Report, TrueObject};

/// Physics steps in one control period, unless more are asked for.
pub(super) const STEPS_PER_TICK: u32 = 2;
/// The control period: 1 kHz.
pub const TICK_S: f64 = STEPS_PER_TICK as f64 * STEP_S;

/// Plant and sensors.
pub(super) struct Cell {
    plant: Plant,
    steps_per_tick: u32,
    sensors: Sensors,
    read: Report,
    center_in_object: Option<Point3<f64>>,
}

impl Cell {
    /// Sets up a scene and reads its sensors. `seed` is that of their noise.
    pub(super) fn new(scene: &Scene, parameters: SensorParameters, seed: u64) -> Result<Self, PlantError> {
        Self::with_steps(scene, parameters, seed, STEPS_PER_TICK)
    }

    /// The same with another number of physics steps in one control period, at least 1.
    pub(super) fn with_steps(
        scene: &Scene,
        parameters: SensorParameters,
        seed: u64,
        steps_per_tick: u32,
    ) -> Result<Self, PlantError> {
        let steps_per_tick = steps_per_tick.max(1);
        let plant = Plant::with_step(scene, TICK_S / f64::from(steps_per_tick))?;
        let mut sensors = Sensors::new(parameters, seed);
        let read = sensors.read(&plant.state());
        let center_in_object = scene.object.as_ref().map(|object| object.center_of_mass);
        Ok(Self { plant, steps_per_tick, sensors, read, center_in_object })
    }

    /// The physics.
    pub(super) fn plant(&self) -> &Plant {
        &self.plant
    }

    /// What the sensors said last.
    pub(super) fn read(&self) -> &Report {
        &self.read
    }

    /// One control period under these torques, after which the palm has gone `palm_share` of its way to
    /// `base_from_palm`; then the sensors are read.
    pub(super) fn advance(
        &mut self,
        torque_nm: [f64; JOINT_COUNT],
        thumb_rotation_rad: f64,
        base_from_palm: &Isometry3<f64>,
        palm_share: f64,
    ) {
        let start = self.plant.base_from_palm();
        let end = start.lerp_slerp(base_from_palm, palm_share);
        for step in 1..=self.steps_per_tick {
            self.plant.step(&Drive {
                torque_nm,
                thumb_rotation_rad,
                base_from_palm: start.lerp_slerp(&end, f64::from(step) / f64::from(self.steps_per_tick)),
            });
        }
        self.read = self.sensors.read(&self.plant.state());
    }

    /// Where the object is.
    pub(super) fn object(&self) -> Option<TrueObject> {
        let base_from_object = self.plant.base_from_object()?;
        Some(TrueObject { base_from_object, center_in_base: base_from_object * self.center_in_object? })
    }
}

/// Control periods in `dt_s`.
///
/// # Errors
/// [`LinkError::Step`] when that is no whole number, or none.
pub(super) fn whole_ticks(dt_s: f64) -> Result<u64, LinkError> {
    let ticks = (dt_s / TICK_S).round();
    if ticks >= 1.0 && (ticks * TICK_S - dt_s).abs() < 1e-9 {
        Ok(ticks as u64)
    } else {
        Err(LinkError::Step { dt_s })
    }
}
