//! The production control laws in this process, on the plant's sensors: the link that needs no hardware.

use firmware::control::{self, Config, State, Target, ThumbMode};
use protocol::ids::JOINT_COUNT;

use super::cell::{Cell, STEPS_PER_TICK, TICK_S, whole_ticks};
use super::plant::{Plant, PlantError, Scene};
use super::sensors::SensorParameters;
use crate::link::{Command, Link, LinkError, Report, ThumbLaw, TrueObject};

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
    cell: Cell,
    config: Config,
    state: State,
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
        let cell = Cell::with_steps(scene, parameters, seed, settings.steps_per_tick)?;
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
        Ok(Self { cell, config, state: State::default() })
    }

    /// The simulated hand, object and table.
    #[must_use]
    pub fn plant(&self) -> &Plant {
        self.cell.plant()
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
        let read = self.cell.read();
        let sensors = control::Sensors {
            position_rad: single(&read.position_rad),
            joint_torque_nm: single(&read.joint_torque_nm),
            tip_wrench: read.tip_wrench.map(|wrench| wrench.to_array().map(|x| x as f32)),
        };
        let torques = control::step(&self.config, &mut self.state, &sensors, &target, TICK_S as f32);
        let torque_nm = torques.nm.map(f64::from);
        self.cell.advance(torque_nm, command.position_rad[0], &command.base_from_palm, palm_share);
    }
}

impl Link for Twin {
    /// `dt_s` must be a whole number of [`TICK_S`]; the palm moves evenly over it.
    fn step(&mut self, command: &Command, dt_s: f64) -> Result<Report, LinkError> {
        for left in (1..=whole_ticks(dt_s)?).rev() {
            self.tick(command, 1.0 / left as f64);
        }
        Ok(self.cell.read().clone())
    }

    fn object(&self) -> Option<TrueObject> {
        self.cell.object()
    }
}
