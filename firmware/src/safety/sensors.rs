//! Whether what the sensors say can be true: numbers, in range, not faster than the mechanism, and not standing still
//! where they should move.
//!
//! An angle that jumps is not believed: the last good one stands in for it, and only if the jump stays is it a fault. A
//! reading that stands still is a fault only where something should have moved it: an angle, when its target has
//! moved far and the strain gauge feels nothing in the way; a strain gauge, when its drive's torque has changed.
//! To stand still is to give the same bits; a fingertip that rests on an object does that too, and is left alone.

use hand_model::HandModel;
use protocol::fault::Fault;
use protocol::ids::{FINGER_COUNT, FingerId, JOINT_COUNT, JointId};

use crate::control::Sensors;
use crate::control::limits::all_finite;

/// What is plausible.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Config {
    /// Least and largest angle that a sensor may read: a margin beyond the mechanism's range.
    pub range_rad: [[f32; 2]; JOINT_COUNT],
    /// Fastest a joint can turn.
    pub speed_max_rad_per_s: f32,
    /// How far an angle may jump at once by noise.
    pub jump_max_rad: f32,
    /// Most torque.
    pub torque_max_nm: [f32; JOINT_COUNT],
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
        const MARGIN_RAD: f32 = 0.1;
        let range = |joint| model.hard_limits.range(joint);
        let torque_max_nm = |joint: JointId| match joint.finger_joint() {
            None => model.thumb_rotation.holding_torque_nm,
            Some((_, which)) => model.drive.torque_max_nm[which.index()],
        };
        Self {
            range_rad: JointId::ALL
                .map(|joint| [range(joint).lower_rad - MARGIN_RAD, range(joint).upper_rad + MARGIN_RAD]),
            speed_max_rad_per_s: 4.0 * model.drive.speed_max_rad_per_s,
            jump_max_rad: 0.02,
            torque_max_nm: JointId::ALL.map(|joint| 2.0 * torque_max_nm(joint)),
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
    /// Bits of the last reading; those of no number before the first.
    bits: u32,
    /// How long it has been the same.
    us: u32,
    /// Least and most of the cause since it was the same for the first time.
    low: f32,
    high: f32,
}

impl Default for Still {
    fn default() -> Self {
        Self { bits: f32::NAN.to_bits(), us: 0, low: 0.0, high: 0.0 }
    }
}

impl Still {
    /// One period; whether the reading is that of the period before.
    fn step(&mut self, reading: f32, cause: f32, elapsed_us: u32) -> bool {
        let bits = reading.to_bits();
        if bits != self.bits {
            (self.bits, self.us) = (bits, 0);
            return false;
        }
        if self.us == 0 {
            // Only here, for nearly always the reading is another one.
            (self.low, self.high) = (cause, cause);
        }
        self.us = self.us.saturating_add(elapsed_us);
        // Comparisons, for `min` and `max` are calls on the target.
        if cause < self.low {
            self.low = cause;
        } else if cause > self.high {
            self.high = cause;
        }
        true
    }

    /// Whether the reading has stood still for so long while its cause moved by more than this.
    fn is_stuck(&self, stuck_us: u32, most: f32) -> bool {
        self.us >= stuck_us && self.high - self.low > most
    }
}

/// Memory of one joint.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Joint {
    /// The last angle that was believed, and how long ago that was; nothing before the first.
    good_rad: f32,
    age_us: u32,
    has_good: bool,
    /// Whether there is a good angle and none of the strikes below counts.
    is_trusted: bool,
    jumps: u8,
    out_of_range: u8,
    too_much_torque: u8,
    position: Still,
    torque: Still,
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

/// Whether all numbers are within `+-most`; no number is not.
fn all_within(numbers: &[f32], most: f32) -> bool {
    numbers.iter().all(|number| number.abs() <= most)
}

impl Plausibility {
    /// Judges the sensors of a period that began `elapsed_us` after the one before, and replaces angles that jumped by the
    /// last good ones. Returns a fault of each finger's; the thumb's rotation counts as the thumb's.
    ///
    /// What is in order, as nearly always, is seen by a few comparisons, which are written so that no number fails them.
    // A function of its own, as every large step of a period: all of them in one run out of registers.
    #[inline(never)]
    pub fn step(
        &mut self,
        config: &Config,
        sensors: &mut Sensors,
        excitation: &Excitation,
        elapsed_us: u32,
    ) -> [Option<Fault>; FINGER_COUNT] {
        let mut faults = [None; FINGER_COUNT];
        let reach_rad = config.reach_rad(elapsed_us);
        for (finger, fault) in FingerId::ALL.into_iter().zip(&mut faults) {
            let is_active = excitation.active[finger.index()];
            for i in finger.joints() {
                let memory = &mut self.joints[i];
                let (read_rad, torque_nm) = (sensors.position_rad[i], sensors.joint_torque_nm[i]);
                let [lower_rad, upper_rad] = config.range_rad[i];
                let in_order = read_rad >= lower_rad
                    && read_rad <= upper_rad
                    && torque_nm.abs() <= config.torque_max_nm[i]
                    && (read_rad - memory.good_rad).abs() <= reach_rad
                    && memory.is_trusted;
                let mut found = None;
                if in_order {
                    memory.good_rad = read_rad;
                } else {
                    (sensors.position_rad[i], found) =
                        memory.examine(config, i, read_rad, torque_nm, elapsed_us);
                }
                // The thumb's rotation is braked: nothing moves it.
                if i != JointId::THUMB_ROTATION.index() && found != Some(Fault::SensorNotANumber) {
                    let cause = is_active.then(|| (excitation.target_rad[i], excitation.output_nm[i]));
                    found = found.or(memory.stands_still(config, read_rad, torque_nm, cause, elapsed_us));
                }
                if found.is_some() {
                    *fault = fault.or(found);
                }
            }
        }
        for ((fault, count), wrench) in faults.iter_mut().zip(&mut self.wrenches).zip(&sensors.tip_wrench) {
            let (force, moment) = wrench.split_at(3);
            let within = all_within(force, config.force_max_n) && all_within(moment, config.moment_max_nm);
            if within && *count == 0 {
                continue;
            }
            let found = if !all_finite(wrench) {
                Some(Fault::SensorNotANumber)
            } else {
                strike(count, !within, config.strikes).then_some(Fault::WrenchRange)
            };
            *fault = fault.or(found);
        }
        faults
    }
}

impl Config {
    /// How far an angle can have turned, as its sensor sees it.
    fn reach_rad(&self, age_us: u32) -> f32 {
        self.jump_max_rad + self.speed_max_rad_per_s * (age_us as f32 * 1e-6)
    }
}

impl Joint {
    /// The angle to believe, and a fault: a closer look than that of [`Plausibility::step`].
    #[cold]
    fn examine(
        &mut self,
        config: &Config,
        i: usize,
        read_rad: f32,
        torque_nm: f32,
        elapsed_us: u32,
    ) -> (f32, Option<Fault>) {
        if !(read_rad.is_finite() && torque_nm.is_finite()) {
            return (read_rad, Some(Fault::SensorNotANumber));
        }
        let (angle_rad, mut fault) = self.believe(config, read_rad, elapsed_us);
        let [lower_rad, upper_rad] = config.range_rad[i];
        let outside = read_rad < lower_rad || read_rad > upper_rad;
        if strike(&mut self.out_of_range, outside, config.strikes) {
            fault = Some(Fault::PositionRange);
        }
        let too_much = torque_nm.abs() > config.torque_max_nm[i];
        if strike(&mut self.too_much_torque, too_much, config.strikes) {
            fault = fault.or(Some(Fault::TorqueRange));
        }
        self.is_trusted = [self.jumps, self.out_of_range, self.too_much_torque] == [0; 3];
        (angle_rad, fault)
    }

    /// The angle if the joint can have got there since the last good one, else that.
    fn believe(&mut self, config: &Config, read_rad: f32, elapsed_us: u32) -> (f32, Option<Fault>) {
        if self.has_good {
            let age_us = self.age_us.saturating_add(elapsed_us);
            let jumped = (read_rad - self.good_rad).abs() > config.reach_rad(age_us);
            if strike(&mut self.jumps, jumped, config.strikes) {
                // Where the angle is now it may stay, once the fault is reset.
                (self.jumps, self.good_rad, self.age_us) = (0, read_rad, 0);
                return (read_rad, Some(Fault::PositionRate));
            }
            if jumped {
                self.age_us = age_us;
                return (self.good_rad, None);
            }
        }
        (self.good_rad, self.age_us, self.has_good) = (read_rad, 0, true);
        (read_rad, None)
    }

    /// A fault of a reading that stands still where target and torque of the drive, if it has any, should have moved it.
    fn stands_still(
        &mut self,
        config: &Config,
        read_rad: f32,
        torque_nm: f32,
        cause: Option<(f32, f32)>,
        elapsed_us: u32,
    ) -> Option<Fault> {
        let Some((target_rad, output_nm)) = cause else {
            (self.position, self.torque) = (Still::default(), Still::default());
            return None;
        };
        let angle_stands = self.position.step(read_rad, target_rad, elapsed_us);
        let torque_stands = self.torque.step(torque_nm, output_nm, elapsed_us);
        if !angle_stands {
            self.felt_nm = 0.0;
            if !torque_stands {
                return None;
            }
        } else if torque_nm.abs() > self.felt_nm {
            self.felt_nm = torque_nm.abs();
        }
        if self.position.is_stuck(config.stuck_us, config.stuck_target_rad)
            && self.felt_nm < config.contact_torque_nm
        {
            Some(Fault::PositionStuck)
        } else if self.torque.is_stuck(config.stuck_us, config.stuck_output_nm) {
            Some(Fault::TorqueStuck)
        } else {
            None
        }
    }
}

#[cfg(test)]
mod tests;
