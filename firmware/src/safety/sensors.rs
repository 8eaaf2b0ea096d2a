//! Whether what the sensors say can be true: numbers, in range, not faster than the mechanism, and not standing still
//! where they should move.
//!
//! An angle that jumps is not believed: the last good one stands in for it, and only if the jump stays is it a fault. A
//! reading that stands still is a fault only where something should have moved it: an angle, when its target has
//! moved far and the strain gauge feels nothing in the way; a strain gauge, when its drive's torque has changed.
//! To stand still is to give the same bits; a fingertip that rests on an object does that too, and is left alone.

use hand_model::{HandLimits, HandModel};
use protocol::fault::Fault;
use protocol::ids::{FINGER_COUNT, FingerId, FingerJoint, JOINT_COUNT, JointId};

use crate::control::Sensors;

/// What is plausible.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Config {
    /// The mechanism's range.
    pub limits: HandLimits<f32>,
    /// How far beyond it an angle may read.
    pub margin_rad: f32,
    /// Fastest a joint can turn.
    pub speed_max_rad_per_s: f32,
    /// How far an angle may jump at once by noise.
    pub jump_max_rad: f32,
    /// Most torque on abduction, flexion, middle.
    pub torque_max_nm: [f32; 3],
    /// Most torque on the thumb's rotation.
    pub rotation_torque_max_nm: f32,
    /// Largest component of force on a fingertip.
    pub force_max_n: f32,
    /// Largest component of moment on a fingertip.
    pub moment_max_nm: f32,
    /// Periods in a row for which a reading must be out of range or jump to be a fault.
    pub strikes: u8,
    /// Time for which a reading must stand still to be a fault.
    pub stuck_us: u32,
    /// How far the target must have moved by then.
    pub stuck_target_rad: f32,
    /// What a strain gauge feels of an obstacle.
    pub contact_torque_nm: f32,
    /// How much a drive's torque must have changed by then.
    pub stuck_output_nm: f32,
}

impl Config {
    /// For a hand of this model.
    #[must_use]
    pub fn new(model: &HandModel<f32>) -> Self {
        Self {
            limits: model.hard_limits,
            margin_rad: 0.1,
            speed_max_rad_per_s: 4.0 * model.drive.speed_max_rad_per_s,
            jump_max_rad: 0.02,
            torque_max_nm: model.drive.torque_max_nm.map(|torque_nm| 2.0 * torque_nm),
            rotation_torque_max_nm: 2.0 * model.thumb_rotation.holding_torque_nm,
            force_max_n: 3.0 * model.drive.tip_force_max_n,
            moment_max_nm: 0.5,
            strikes: 3,
            stuck_us: 200_000,
            stuck_target_rad: 0.15,
            contact_torque_nm: 0.05,
            stuck_output_nm: 0.3,
        }
    }
}

/// What the hand did in the period before, by which its sensors are judged.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Excitation {
    /// Angles that the control law was given.
    pub target_rad: [f32; JOINT_COUNT],
    /// Torques that the drives were given.
    pub output_nm: [f32; JOINT_COUNT],
    /// Fingers with torque.
    pub active: [bool; FINGER_COUNT],
}

/// A reading and what should have moved it while it stood still.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Still {
    reading: f32,
    us: u32,
    low: f32,
    high: f32,
}

impl Still {
    /// How far the cause has moved while the reading stood still, once that is `stuck_us`.
    fn step(
        memory: &mut Option<Self>,
        reading: f32,
        cause: f32,
        elapsed_us: u32,
        stuck_us: u32,
    ) -> Option<f32> {
        match memory {
            Some(still) if still.reading.to_bits() == reading.to_bits() => {
                still.us = still.us.saturating_add(elapsed_us);
                // Comparisons, for `min` and `max` are calls on the target.
                if cause < still.low {
                    still.low = cause;
                } else if cause > still.high {
                    still.high = cause;
                }
                (still.us >= stuck_us).then_some(still.high - still.low)
            }
            _ => {
                *memory = Some(Self { reading, us: 0, low: cause, high: cause });
                None
            }
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Joint {
    /// The last angle that was believed, and how long ago.
    good: Option<(f32, u32)>,
    jumps: u8,
    out_of_range: u8,
    too_much_torque: u8,
    position: Option<Still>,
    torque: Option<Still>,
    /// Most that the strain gauge felt since the angle began to stand still.
    felt_nm: f32,
}

/// Memory of all sensors.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Plausibility {
    joints: [Joint; JOINT_COUNT],
    wrenches: [u8; FINGER_COUNT],
}

/// Counts periods in a row; whether there are `strikes` of them.
fn strike(count: &mut u8, bad: bool, strikes: u8) -> bool {
    *count = if bad { count.saturating_add(1) } else { 0 };
    *count >= strikes
}

impl Plausibility {
    /// Judges the sensors of a period that began `elapsed_us` after the one before, and replaces angles that jumped by the
    /// last good ones. Returns a fault of each finger's; the thumb's rotation counts as the thumb's.
    pub fn step(
        &mut self,
        config: &Config,
        sensors: &mut Sensors,
        excitation: &Excitation,
        elapsed_us: u32,
    ) -> [Option<Fault>; FINGER_COUNT] {
        let mut faults = [None; FINGER_COUNT];
        for (joint, memory) in JointId::ALL.into_iter().zip(&mut self.joints) {
            let (angle_rad, fault) = memory.step(config, joint, sensors, excitation, elapsed_us);
            sensors.position_rad[joint.index()] = angle_rad;
            let first = &mut faults[joint.moves().index()];
            *first = first.or(fault);
        }
        for (finger, count) in FingerId::ALL.into_iter().zip(&mut self.wrenches) {
            let [force @ .., mx, my, mz] = sensors.tip_wrench[finger.index()];
            let beyond = |parts: [f32; 3], most: f32| parts.iter().any(|part| part.abs() > most);
            let bad = beyond(force, config.force_max_n) || beyond([mx, my, mz], config.moment_max_nm);
            let number = force.iter().chain(&[mx, my, mz]).all(|part| part.is_finite());
            let fault = if !number {
                Some(Fault::SensorNotANumber)
            } else {
                strike(count, bad, config.strikes).then_some(Fault::WrenchRange)
            };
            let first = &mut faults[finger.index()];
            *first = first.or(fault);
        }
        faults
    }
}

impl Joint {
    /// The angle to believe, and a fault.
    fn step(
        &mut self,
        config: &Config,
        joint: JointId,
        sensors: &Sensors,
        excitation: &Excitation,
        elapsed_us: u32,
    ) -> (f32, Option<Fault>) {
        let i = joint.index();
        let (read_rad, torque_nm) = (sensors.position_rad[i], sensors.joint_torque_nm[i]);
        if !(read_rad.is_finite() && torque_nm.is_finite()) {
            return (read_rad, Some(Fault::SensorNotANumber));
        }
        let (angle_rad, mut fault) = self.believe(config, read_rad, elapsed_us);

        let range = config.limits.range(joint);
        let outside =
            read_rad < range.lower_rad - config.margin_rad || read_rad > range.upper_rad + config.margin_rad;
        if strike(&mut self.out_of_range, outside, config.strikes) {
            fault = Some(Fault::PositionRange);
        }
        let most_nm = joint.finger_joint().map_or(config.rotation_torque_max_nm, |(_, which)| match which {
            FingerJoint::Abduction => config.torque_max_nm[0],
            FingerJoint::Flexion => config.torque_max_nm[1],
            FingerJoint::Middle => config.torque_max_nm[2],
        });
        if strike(&mut self.too_much_torque, torque_nm.abs() > most_nm, config.strikes) {
            fault = fault.or(Some(Fault::TorqueRange));
        }

        // The thumb's rotation is braked: nothing moves it.
        let Some((finger, _)) = joint.finger_joint() else { return (angle_rad, fault) };
        if !excitation.active[finger.index()] {
            (self.position, self.torque) = (None, None);
            return (angle_rad, fault);
        }
        let (target_rad, output_nm) = (excitation.target_rad[i], excitation.output_nm[i]);
        let target_moved = Still::step(&mut self.position, read_rad, target_rad, elapsed_us, config.stuck_us);
        if self.position.is_none_or(|still| still.us == 0) {
            self.felt_nm = 0.0;
        } else if torque_nm.abs() > self.felt_nm {
            self.felt_nm = torque_nm.abs();
        }
        if target_moved.is_some_and(|moved| moved > config.stuck_target_rad)
            && self.felt_nm < config.contact_torque_nm
        {
            fault = fault.or(Some(Fault::PositionStuck));
        }
        let output_changed = Still::step(&mut self.torque, torque_nm, output_nm, elapsed_us, config.stuck_us);
        if output_changed.is_some_and(|changed| changed > config.stuck_output_nm) {
            fault = fault.or(Some(Fault::TorqueStuck));
        }
        (angle_rad, fault)
    }

    /// The angle if the joint can have got there since the last good one, else that.
    fn believe(&mut self, config: &Config, read_rad: f32, elapsed_us: u32) -> (f32, Option<Fault>) {
        if let Some((good_rad, age_us)) = &mut self.good {
            *age_us = age_us.saturating_add(elapsed_us);
            let reach_rad = config.jump_max_rad + config.speed_max_rad_per_s * (*age_us as f32 * 1e-6);
            let jumped = (read_rad - *good_rad).abs() > reach_rad;
            if strike(&mut self.jumps, jumped, config.strikes) {
                // Where the angle is now it may stay, once the fault is reset.
                self.jumps = 0;
                self.good = Some((read_rad, 0));
                return (read_rad, Some(Fault::PositionRate));
            }
            if jumped {
                return (*good_rad, None);
            }
        }
        self.good = Some((read_rad, 0));
        (read_rad, None)
    }
}

#[cfg(test)]
mod tests;
