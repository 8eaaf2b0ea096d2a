//! One control period of the whole hand.

use hand_model::{FingerGeometry, HandLimits, HandModel};
use protocol::ids::{FINGER_COUNT, FingerId, JOINT_COUNT, JOINTS_PER_FINGER, JointId};

use super::friction::{FrictionModel, compensation_nm};
use super::impedance::{FingerMotion, TipImpedance, tip_torque};
use super::limits::{Limit, all_finite, clamp_torque};
use super::pd::{PdGains, torque_nm};
use super::slip::{Slip, SlipConfig};

/// Everything that stays the same from one period to the next.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Config {
    /// Lengths of every finger.
    pub finger: FingerGeometry<f32>,
    /// The mechanism's range; targets are moved into it.
    pub limits: HandLimits<f32>,
    /// The thumb's spring and damper in [`ThumbMode::Impedance`].
    pub thumb: TipImpedance,
    /// Joint gains: abduction, flexion, middle.
    pub joint: [PdGains; JOINTS_PER_FINGER],
    /// Friction to compensate at every joint.
    pub friction: FrictionModel,
    /// Most torque for abduction, flexion, middle.
    pub torque_max_nm: [f32; JOINTS_PER_FINGER],
    /// Slip and the reflex against it.
    pub slip: SlipConfig,
    /// Gain of the inner loop on the strain gauges, 0 or more: it divides drive friction by one more than itself.
    pub torque_gain: f32,
    /// Cut-off of the strain gauges' filter. The drive's elasticity resonates at 34 Hz, so this stays below.
    pub torque_filter_rad_per_s: f32,
    /// Cut-off of the speed estimate.
    pub velocity_filter_rad_per_s: f32,
}

impl Config {
    /// Gains for the HIT/DLR hand.
    ///
    /// The thumb is the compliant side of a grasp (300 N/m to the pad: 3 N at 10 mm), the other fingers are stiffer. Gains
    /// are assumed, around those identified for the DLR Hand II (3.69 N m/rad, 0.25 N m s/rad; ICRA 2022).
    #[must_use]
    pub fn hit_dlr() -> Self {
        Self::new(&HandModel::hit_dlr())
    }

    /// The same gains with another hand's lengths, ranges and limits.
    #[must_use]
    pub fn new(model: &HandModel<f32>) -> Self {
        Self {
            finger: model.finger,
            limits: model.hard_limits,
            thumb: TipImpedance {
                stiffness_n_per_m: [500.0, 500.0, 300.0],
                damping_n_s_per_m: [10.0, 10.0, 8.0],
                force_max_n: model.drive.tip_force_max_n,
                boost_n: 0.0,
            },
            slip: SlipConfig::new(model.finger.tip_radius_m),
            joint: [PdGains { stiffness_nm_per_rad: 6.0, damping_nm_s_per_rad: 0.12 }; 3],
            friction: FrictionModel {
                coulomb_nm: model.drive.coulomb_friction_nm,
                viscous_nm_s_per_rad: model.drive.viscous_friction_nm_s_per_rad,
                knee_rad_per_s: 0.02,
                share: 0.8,
            },
            torque_max_nm: model.drive.torque_max_nm,
            torque_gain: 0.5,
            torque_filter_rad_per_s: 125.0,
            velocity_filter_rad_per_s: 125.0,
        }
    }
}

/// Which law moves the thumb.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ThumbMode {
    /// Joint by joint, as the other fingers.
    #[default]
    Position,
    /// As a spring and a damper at its tip.
    Impedance,
}

/// What the sensors say. Joints are in the order of `JointId`, fingers in that of `FingerId`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sensors {
    /// Joint angles.
    pub position_rad: [f32; JOINT_COUNT],
    /// Strain gauges: the torque that the drive passes on to its joint.
    pub joint_torque_nm: [f32; JOINT_COUNT],
    /// Force, then torque, on each fingertip, axes of the distal link, N and N m. The control laws do not need it; it is
    /// here because it is sampled with the others and reported with them.
    pub tip_wrench: [[f32; 6]; FINGER_COUNT],
}

/// What is asked of the hand, in the order of `JointId`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Target {
    /// Joint angles. An angle beyond what an object lets through is a push.
    pub position_rad: [f32; JOINT_COUNT],
    /// Their speeds.
    pub velocity_rad_per_s: [f32; JOINT_COUNT],
    /// Torques to add, for example against gravity.
    pub feed_forward_nm: [f32; JOINT_COUNT],
    /// The thumb's law.
    pub thumb_mode: ThumbMode,
}

impl Target {
    /// Stay at these angles.
    #[must_use]
    pub fn hold(position_rad: [f32; JOINT_COUNT], thumb_mode: ThumbMode) -> Self {
        let zero = [0.0; JOINT_COUNT];
        Self { position_rad, velocity_rad_per_s: zero, feed_forward_nm: zero, thumb_mode }
    }

    /// Whether everything in it is a finite number.
    fn is_number(&self) -> bool {
        all_finite(&self.position_rad)
            && all_finite(&self.velocity_rad_per_s)
            && all_finite(&self.feed_forward_nm)
    }
}

/// What one period leaves for the next.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct State {
    /// Measurements of the last period, at rest and none of them good before the first.
    measured: Measured,
    /// The last target that was a target, or what stands in for it.
    target: Target,
    /// Whether there has been a target that was one.
    has_target: bool,
    slip: Slip,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Measured {
    position_rad: [f32; JOINT_COUNT],
    velocity_rad_per_s: [f32; JOINT_COUNT],
    torque_nm: [f32; JOINT_COUNT],
    /// Whether the joint's sensors gave numbers.
    good: [bool; JOINT_COUNT],
}

impl Default for State {
    fn default() -> Self {
        let zero = [0.0; JOINT_COUNT];
        Self {
            measured: Measured {
                position_rad: zero,
                velocity_rad_per_s: zero,
                torque_nm: zero,
                good: [false; JOINT_COUNT],
            },
            target: Target::hold(zero, ThumbMode::Position),
            has_target: false,
            slip: Slip::default(),
        }
    }
}

impl State {
    /// Filtered joint speeds, rad/s; zero before the first period.
    #[must_use]
    pub const fn velocity_rad_per_s(&self) -> &[f32; JOINT_COUNT] {
        &self.measured.velocity_rad_per_s
    }

    /// Ends what the slip reflex adds to the thumb's push: a thumb without torque begins anew.
    pub fn end_boost(&mut self) {
        self.slip.end_boost();
    }

    /// Whether each fingertip slips.
    #[must_use]
    pub fn slipping(&self) -> [bool; FINGER_COUNT] {
        self.slip.slipping()
    }
}

/// What the drives are to give, in the order of `JointId`. Always finite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Torques {
    /// Joint torques. The thumb's rotation is moved between grasps and braked, so its entry is 0.
    pub nm: [f32; JOINT_COUNT],
    /// Why a joint got less than the law asked.
    pub limits: [Limit; JOINT_COUNT],
}

/// One control period of `dt_s`.
#[must_use]
pub fn step(config: &Config, state: &mut State, sensors: &Sensors, target: &Target, dt_s: f32) -> Torques {
    let mut torques = Torques { nm: [0.0; JOINT_COUNT], limits: [Limit::None; JOINT_COUNT] };
    torques.limits[JointId::THUMB_ROTATION.index()] = Limit::Braked;
    if dt_s.is_finite() && dt_s > 0.0 {
        advance(config, state, sensors, target, dt_s, &mut torques);
    } else {
        torques.limits[1..].fill(Limit::BadInput);
    }
    torques
}

// A function of its own, as every large step of a period: all of them in one run out of registers. It writes torques in their
// place: a result of this size would be copied.
#[inline(never)]
fn advance(
    config: &Config,
    state: &mut State,
    sensors: &Sensors,
    target: &Target,
    dt_s: f32,
    torques: &mut Torques,
) {
    state.measured.step(config, sensors, dt_s);
    let reacts = target.thumb_mode == ThumbMode::Impedance;
    state.slip.step(&config.slip, &sensors.tip_wrench, reacts, dt_s);
    if state.give(config, target, torques) || target.is_number() {
        // Array by array: what is longer becomes a call, at four instructions a word.
        state.target.position_rad = target.position_rad;
        state.target.velocity_rad_per_s = target.velocity_rad_per_s;
        state.target.feed_forward_nm = target.feed_forward_nm;
        state.target.thumb_mode = target.thumb_mode;
        state.has_target = true;
    } else {
        state.give_instead(config, target, torques);
    }
}

/// Index of a finger's abduction in arrays of joints.
fn first_joint(finger: FingerId) -> usize {
    1 + finger.index() * JOINTS_PER_FINGER
}

// In place, for a copy of measurements or of a target costs more than what is done with it.
impl Measured {
    /// Speeds from a filtered difference, torques through a first-order filter. A joint starts at rest, and anew after its
    /// sensors gave no number: a difference over the gap would be a speed that never was.
    fn step(&mut self, config: &Config, sensors: &Sensors, dt_s: f32) {
        let share = |cut_off: f32| cut_off * dt_s / (1.0 + cut_off * dt_s);
        let (fast, slow) = (share(config.velocity_filter_rad_per_s), share(config.torque_filter_rad_per_s));
        for joint in 0..JOINT_COUNT {
            let (position_rad, torque_nm) = (sensors.position_rad[joint], sensors.joint_torque_nm[joint]);
            let is_good = all_finite(&[position_rad, torque_nm]);
            if is_good && self.good[joint] {
                let speed = (position_rad - self.position_rad[joint]) / dt_s;
                self.velocity_rad_per_s[joint] += fast * (speed - self.velocity_rad_per_s[joint]);
                self.torque_nm[joint] += slow * (torque_nm - self.torque_nm[joint]);
            } else {
                (self.velocity_rad_per_s[joint], self.torque_nm[joint]) = (0.0, torque_nm);
            }
            (self.position_rad[joint], self.good[joint]) = (position_rad, is_good);
        }
    }
}

impl State {
    /// Torques for a target. False if a joint is given none because something is no number; that shows in the result,
    /// so that it is looked for only then.
    fn give(&self, config: &Config, target: &Target, torques: &mut Torques) -> bool {
        let thumb = TipImpedance { boost_n: self.slip.boost_n(), ..config.thumb };
        let mut all_numbers = true;
        for finger in FingerId::ALL {
            let joints = first_joint(finger)..first_joint(finger) + JOINTS_PER_FINGER;
            if self.measured.good[joints.clone()].contains(&false) {
                torques.limits[joints].fill(Limit::BadInput);
                all_numbers = false;
                continue;
            }
            let (nm, limits) = finger_torques(config, &thumb, finger, &self.measured, target);
            all_numbers &= !limits.contains(&Limit::BadInput);
            torques.nm[joints.clone()].copy_from_slice(&nm);
            torques.limits[joints].copy_from_slice(&limits);
        }
        all_numbers
    }

    /// Torques for the last target that was one, else to stay where the joints are.
    #[cold]
    fn give_instead(&mut self, config: &Config, target: &Target, torques: &mut Torques) {
        if self.has_target {
            // A speed that nobody renews must not go on.
            self.target.velocity_rad_per_s = [0.0; JOINT_COUNT];
        } else {
            self.target = Target::hold(self.measured.position_rad, target.thumb_mode);
        }
        self.give(config, &self.target, torques);
        for limit in &mut torques.limits[1..] {
            if *limit == Limit::None {
                *limit = Limit::BadTarget;
            }
        }
    }
}

fn finger_torques(
    config: &Config,
    thumb: &TipImpedance,
    finger: FingerId,
    measured: &Measured,
    target: &Target,
) -> ([f32; JOINTS_PER_FINGER], [Limit; JOINTS_PER_FINGER]) {
    let first = first_joint(finger);
    let pick = |joints: &[f32; JOINT_COUNT]| [joints[first], joints[first + 1], joints[first + 2]];
    let is = FingerMotion {
        angle_rad: pick(&measured.position_rad),
        speed_rad_per_s: pick(&measured.velocity_rad_per_s),
    };
    let mut should = FingerMotion {
        angle_rad: pick(&target.position_rad),
        speed_rad_per_s: pick(&target.velocity_rad_per_s),
    };
    let mut limits = [Limit::None; JOINTS_PER_FINGER];
    let ranges = [&config.limits.abduction, &config.limits.flexion, &config.limits.middle];
    for (k, range) in ranges.into_iter().enumerate() {
        if !range.contains(should.angle_rad[k]) {
            // An infinite target is no target.
            let is_number = should.angle_rad[k].is_finite();
            should.angle_rad[k] = if is_number { range.clamp(should.angle_rad[k]) } else { f32::NAN };
            limits[k] = Limit::Position;
        }
    }
    let asked;
    if finger == FingerId::Thumb && target.thumb_mode == ThumbMode::Impedance {
        let spring = tip_torque(&config.finger, thumb, &is, &should);
        asked = spring.torque_nm;
        if spring.force_limited {
            limits.fill(Limit::TipForce);
        }
    } else {
        asked = core::array::from_fn(|k| {
            let position_error = should.angle_rad[k] - is.angle_rad[k];
            torque_nm(&config.joint[k], position_error, should.speed_rad_per_s[k] - is.speed_rad_per_s[k])
        });
    }
    let mut nm = [0.0; JOINTS_PER_FINGER];
    for k in 0..JOINTS_PER_FINGER {
        let wanted = asked[k] + target.feed_forward_nm[first + k];
        let loss = compensation_nm(&config.friction, should.speed_rad_per_s[k]);
        let given = wanted + config.torque_gain * (wanted - measured.torque_nm[first + k]) + loss;
        let (clamped, limit) = clamp_torque(given, config.torque_max_nm[k]);
        nm[k] = clamped;
        if limit != Limit::None {
            limits[k] = limit;
        }
    }
    (nm, limits)
}

#[cfg(test)]
mod tests;
