//! The production control laws in this process, on the plant's sensors: the link that needs no hardware.

use firmware::control::{self, Config, State, Target, ThumbMode};
use nalgebra::Point3;
use protocol::ids::JOINT_COUNT;

use super::plant::{Drive, Plant, PlantError, STEP_S, Scene};
use super::sensors::{SensorParameters, Sensors};
use crate::link::{Command, Link, LinkError, Report, ThumbLaw, TrueObject};

/// Physics steps in one control period, unless more are asked for.
const STEPS_PER_TICK: u32 = 2;
/// The control period: 1 kHz.
pub const TICK_S: f64 = STEPS_PER_TICK as f64 * STEP_S;

/// What a simulated hand may have otherwise than usual.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TwinSettings {
    /// Physics steps in one control period, at least 1: more of them show whether the usual ones are enough.
    pub steps_per_tick: u32,
    /// Stiffness of the thumb's tip across its pad, N/m, in the controller alone; a grip that is planned for another one is
    /// not what was planned. `None` is the firmware's own.
    pub thumb_stiffness_n_per_m: Option<f64>,
}

impl Default for TwinSettings {
    fn default() -> Self {
        Self { steps_per_tick: STEPS_PER_TICK, thumb_stiffness_n_per_m: None }
    }
}

/// A simulated hand that runs the firmware's control laws.
pub struct Twin {
    plant: Plant,
    steps_per_tick: u32,
    sensors: Sensors,
    config: Config,
    state: State,
    report: Report,
    center_in_object: Option<Point3<f64>>,
}

impl Twin {
    /// Sets up a scene. `seed` is that of the sensors' noise.
    ///
    /// # Errors
    /// [`PlantError`] when the scene cannot be simulated.
    pub fn new(scene: &Scene, parameters: SensorParameters, seed: u64) -> Result<Self, PlantError> {
        Self::with_settings(scene, parameters, seed, &TwinSettings::default())
    }

    /// Sets up a scene with a hand that is not quite the usual one.
    ///
    /// # Errors
    /// [`PlantError`] when the scene cannot be simulated.
    pub fn with_settings(
        scene: &Scene,
        parameters: SensorParameters,
        seed: u64,
        settings: &TwinSettings,
    ) -> Result<Self, PlantError> {
        let steps_per_tick = settings.steps_per_tick.max(1);
        let plant = Plant::with_step(scene, TICK_S / f64::from(steps_per_tick))?;
        let mut sensors = Sensors::new(parameters, seed);
        let report = sensors.read(&plant.state());
        let mut config = Config::new(&scene.hand.cast());
        // `exec` has its reflex, which knows the plan's forces; two at once would add up.
        config.slip.rate_n_per_s = 0.0;
        if let Some(n_per_m) = settings.thumb_stiffness_n_per_m {
            let [.., normal] = config.thumb.stiffness_n_per_m;
            let softer = n_per_m as f32 / normal;
            config.thumb.stiffness_n_per_m[2] = n_per_m as f32;
            // As damped as before.
            config.thumb.damping_n_s_per_m[2] *= softer.sqrt();
        }
        Ok(Self {
            plant,
            steps_per_tick,
            sensors,
            config,
            state: State::default(),
            report,
            center_in_object: scene.object.as_ref().map(|object| object.center_of_mass),
        })
    }

    /// The simulated hand, object and table.
    #[must_use]
    pub fn plant(&self) -> &Plant {
        &self.plant
    }

    fn tick(&mut self, command: &Command, palm_share: f64) {
        let single = |values: &[f64; JOINT_COUNT]| values.map(|x| x as f32);
        let target = Target {
            position_rad: single(&command.position_rad),
            velocity_rad_per_s: single(&command.velocity_rad_per_s),
            feed_forward_nm: single(&command.feed_forward_nm),
            thumb_mode: match command.thumb {
                ThumbLaw::Position => ThumbMode::Position,
                ThumbLaw::Impedance => ThumbMode::Impedance,
            },
        };
        let sensors = control::Sensors {
            position_rad: single(&self.report.position_rad),
            joint_torque_nm: single(&self.report.joint_torque_nm),
            tip_wrench: self.report.tip_wrench.map(|wrench| {
                let (f, m) = (wrench.force, wrench.moment);
                [f.x, f.y, f.z, m.x, m.y, m.z].map(|x| x as f32)
            }),
        };
        let torques = control::step(&self.config, &mut self.state, &sensors, &target, TICK_S as f32);
        let start = self.plant.base_from_palm();
        let end = start.lerp_slerp(&command.base_from_palm, palm_share);
        for step in 1..=self.steps_per_tick {
            self.plant.step(&Drive {
                torque_nm: torques.nm.map(f64::from),
                thumb_rotation_rad: command.position_rad[0],
                base_from_palm: start.lerp_slerp(&end, f64::from(step) / f64::from(self.steps_per_tick)),
            });
        }
        self.report = self.sensors.read(&self.plant.state());
    }
}

impl Link for Twin {
    /// `dt_s` must be a whole number of [`TICK_S`]; the palm moves evenly over it.
    fn step(&mut self, command: &Command, dt_s: f64) -> Result<Report, LinkError> {
        let ticks = (dt_s / TICK_S).round();
        if !(ticks >= 1.0 && (ticks * TICK_S - dt_s).abs() < 1e-9) {
            return Err(LinkError::Step { dt_s });
        }
        let ticks = ticks as u64;
        for left in (1..=ticks).rev() {
            self.tick(command, 1.0 / left as f64);
        }
        Ok(self.report.clone())
    }

    fn object(&self) -> Option<TrueObject> {
        let base_from_object = self.plant.base_from_object()?;
        Some(TrueObject { base_from_object, center_in_base: base_from_object * self.center_in_object? })
    }
}
