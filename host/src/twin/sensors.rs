//! What the hand's sensors make of the plant's true state.

use nalgebra::Vector3;
use protocol::ids::JOINT_COUNT;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

use super::plant::PlantState;
use crate::link::{Report, TipWrench};

/// Noise and resolution of the sensors. Standard deviations are those of one sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorParameters {
    /// Noise of a joint angle.
    pub angle_noise_rad: f64,
    /// Resolution of a joint angle; 0 for none.
    pub angle_step_rad: f64,
    /// Noise of a joint torque.
    pub torque_noise_nm: f64,
    /// Range of a joint torque.
    pub torque_range_nm: f64,
    /// Noise of each component of a fingertip's force.
    pub tip_force_noise_n: f64,
    /// Range of each component of a fingertip's force.
    pub tip_force_range_n: f64,
    /// Noise of each component of a fingertip's moment.
    pub tip_moment_noise_nm: f64,
    /// Range of each component of a fingertip's moment.
    pub tip_moment_range_nm: f64,
}

impl SensorParameters {
    /// Sensors of the HIT/DLR hand: angles resolve 0.1 degrees (data sheet of the DLR Hand II), the rest is assumed. Of
    /// the 2 mrad of angle error identified on that hand (ICRA 2022) a quarter is taken as white: its potentiometers
    /// have third-order filters, so most of it is slow.
    #[must_use]
    pub fn hit_dlr() -> Self {
        Self {
            angle_noise_rad: 0.0005,
            angle_step_rad: 0.1f64.to_radians(),
            torque_noise_nm: 0.005,
            torque_range_nm: 1.5,
            tip_force_noise_n: 0.05,
            tip_force_range_n: 20.0,
            tip_moment_noise_nm: 0.0005,
            tip_moment_range_nm: 0.2,
        }
    }

    /// Sensors that tell the truth.
    #[must_use]
    pub fn ideal() -> Self {
        Self {
            angle_noise_rad: 0.0,
            angle_step_rad: 0.0,
            torque_noise_nm: 0.0,
            torque_range_nm: f64::INFINITY,
            tip_force_noise_n: 0.0,
            tip_force_range_n: f64::INFINITY,
            tip_moment_noise_nm: 0.0,
            tip_moment_range_nm: f64::INFINITY,
        }
    }
}

/// Sensors with their own stream of random numbers.
#[derive(Debug, Clone)]
pub(super) struct Sensors {
    parameters: SensorParameters,
    rng: ChaCha8Rng,
}

impl Sensors {
    pub(super) fn new(parameters: SensorParameters, seed: u64) -> Self {
        Self { parameters, rng: ChaCha8Rng::seed_from_u64(seed) }
    }

    /// One sample of all sensors.
    pub(super) fn read(&mut self, state: &PlantState) -> Report {
        let p = self.parameters;
        let mut noise = |sigma: f64| -> f64 {
            let unit: f64 = StandardNormal.sample(&mut self.rng);
            sigma * unit
        };
        let angle = |true_rad: f64| {
            let read = true_rad + noise(p.angle_noise_rad);
            if p.angle_step_rad > 0.0 { (read / p.angle_step_rad).round() * p.angle_step_rad } else { read }
        };
        let position_rad = state.angle_rad.map(angle);
        let mut joint_torque_nm = [0.0; JOINT_COUNT];
        for (read, load) in joint_torque_nm.iter_mut().zip(state.load_nm) {
            *read = (load + noise(p.torque_noise_nm)).clamp(-p.torque_range_nm, p.torque_range_nm);
        }
        let mut vector =
            |v: Vector3<f64>, sigma, range: f64| v.map(|x| (x + noise(sigma)).clamp(-range, range));
        let tip_wrench = state.tip_wrench.map(|wrench| TipWrench {
            force: vector(wrench.force, p.tip_force_noise_n, p.tip_force_range_n),
            moment: vector(wrench.moment, p.tip_moment_noise_nm, p.tip_moment_range_nm),
        });
        Report { time_s: state.time_s, position_rad, joint_torque_nm, tip_wrench }
    }
}
