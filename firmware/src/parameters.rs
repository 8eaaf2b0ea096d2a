//! What may be changed over the bus, with type, unit, range and default.

use hand_model::HandModel;
use protocol::fault::Refusal;
use protocol::service::{ParameterInfo, Value};

use crate::{control, safety};

macro_rules! parameters {
    ($($(#[$doc:meta])* $name:ident: $text:literal, $unit:literal, $type:ident($default:expr) in $min:literal..$max:literal;)*) => {
        /// Names the parameters; the number is the index on the wire. New ones are added at the end.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        #[repr(u16)]
        pub enum Parameter {
            $($(#[$doc])* $name,)*
        }

        /// In the order of [`Parameter`].
        const TABLE: &[ParameterInfo<'static>] = &[$(ParameterInfo {
            name: $text,
            unit: $unit,
            default: Value::$type($default),
            min: Value::$type($min),
            max: Value::$type($max),
        },)*];
    };
}

parameters! {
    /// Joint stiffness of abduction.
    StiffnessAbduction: "joint.stiffness_abduction", "N m/rad", F32(6.0) in 0.0..12.0;
    /// Joint stiffness of flexion.
    StiffnessFlexion: "joint.stiffness_flexion", "N m/rad", F32(6.0) in 0.0..12.0;
    /// Joint stiffness of the middle joint.
    StiffnessMiddle: "joint.stiffness_middle", "N m/rad", F32(6.0) in 0.0..12.0;
    /// Joint damping of abduction.
    DampingAbduction: "joint.damping_abduction", "N m s/rad", F32(0.12) in 0.0..0.5;
    /// Joint damping of flexion.
    DampingFlexion: "joint.damping_flexion", "N m s/rad", F32(0.12) in 0.0..0.5;
    /// Joint damping of the middle joint.
    DampingMiddle: "joint.damping_middle", "N m s/rad", F32(0.12) in 0.0..0.5;
    /// Share of the friction that is compensated.
    FrictionShare: "friction.share", "", F32(0.8) in 0.0..1.0;
    /// Gain of the inner torque loop.
    TorqueGain: "torque.gain", "", F32(0.5) in 0.0..2.0;
    /// Cut-off of the strain gauges' filter.
    TorqueFilter: "torque.filter", "rad/s", F32(125.0) in 10.0..2000.0;
    /// Cut-off of the speed estimate.
    VelocityFilter: "velocity.filter", "rad/s", F32(125.0) in 10.0..2000.0;
    /// Most that the spring at the thumb's tip may push.
    ThumbForceMax: "thumb.force_max", "N", F32(10.0) in 0.0..10.0;
    /// Stiffest the thumb's tip may be commanded.
    ThumbStiffnessMax: "thumb.stiffness_max", "N/m", F32(2000.0) in 0.0..8192.0;
    /// Most damping the thumb's tip may be commanded.
    ThumbDampingMax: "thumb.damping_max", "N s/m", F32(50.0) in 0.0..256.0;
    /// How fast the thumb's tip may become stiffer; a spring that is tightened while bent puts energy in.
    ThumbStiffnessRate: "thumb.stiffness_rate", "N/m/s", F32(5000.0) in 0.0..1e6;
    /// Fastest that a target moves.
    TargetSpeedMax: "target.speed_max", "rad/s", F32(core::f32::consts::PI) in 0.01..16.0;
    /// Fastest change of a feed-forward torque.
    TargetTorqueRate: "target.torque_rate", "N m/s", F32(50.0) in 0.1..10000.0;
    /// Joint damping in a stop, as a multiple of that in operation.
    StopDamping: "stop.damping", "", F32(2.0) in 1.0..4.0;
    /// Time after which a stop ends without torque; 0 is never.
    StopRelease: "stop.release", "us", U32(0) in 0..3_600_000_000;
    /// Time between set-points.
    BusCycle: "bus.cycle", "us", U32(1000) in 100..10_000;
    /// Set-points that may be missed before it is said.
    BusLate: "bus.late", "", U32(5) in 1..100;
    /// Time without a new set-point after which the last target is held.
    BusHold: "bus.hold", "us", U32(10_000) in 1000..500_000;
    /// Time without a new set-point after which the hand stops.
    BusStop: "bus.stop", "us", U32(20_000) in 2000..1_000_000;
    /// Friction between fingertips and objects that slip is judged by; it should be less than the true one.
    SlipFriction: "slip.friction", "", F32(0.4) in 0.05..2.0;
    /// How fast the thumb, when it is a spring, presses harder while a fingertip slips; 0 for no reflex.
    SlipRate: "slip.rate", "N/s", F32(50.0) in 0.0..500.0;
    /// Most that it presses beyond what was commanded.
    SlipBoostMax: "slip.boost_max", "N", F32(6.0) in 0.0..10.0;
    /// Half the time of a blend between segments.
    TargetBlend: "target.blend", "us", U32(25_000) in 5000..250_000;
}

/// How many there are.
pub const COUNT: u16 = TABLE.len() as u16;

/// The values of all parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameters([Value; TABLE.len()]);

impl Default for Parameters {
    fn default() -> Self {
        Self(core::array::from_fn(|i| TABLE[i].default))
    }
}

/// What the control laws and the supervision make of the parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// The control laws in operation.
    pub control: control::Config,
    /// The control laws in a stop.
    pub stop: control::Config,
    /// The supervision.
    pub safety: safety::Config,
    /// How targets may move.
    pub target: safety::target::Config,
    /// Stiffest the thumb's tip may be, N/m.
    pub thumb_stiffness_max_n_per_m: f32,
    /// Most damping of the thumb's tip, N s/m.
    pub thumb_damping_max_n_s_per_m: f32,
    /// How fast it may become stiffer, N/m/s.
    pub thumb_stiffness_rate_n_per_m_s: f32,
}

impl Parameters {
    /// What there is to know about a parameter.
    ///
    /// # Errors
    ///
    /// [`Refusal::UnknownParameter`].
    pub fn info(index: u16) -> Result<&'static ParameterInfo<'static>, Refusal> {
        TABLE.get(usize::from(index)).ok_or(Refusal::UnknownParameter)
    }

    /// The value of a parameter.
    ///
    /// # Errors
    ///
    /// [`Refusal::UnknownParameter`].
    pub fn get(&self, index: u16) -> Result<Value, Refusal> {
        self.0.get(usize::from(index)).copied().ok_or(Refusal::UnknownParameter)
    }

    /// Changes a parameter, or nothing.
    ///
    /// # Errors
    ///
    /// No such parameter, another type, a value outside the range or a number that is none, a hold that would come after
    /// the stop.
    // Once in the image, and not at every place that calls it.
    #[inline(never)]
    pub fn set(&mut self, index: u16, value: Value) -> Result<(), Refusal> {
        let info = Self::info(index)?;
        let in_range = match (value, info.min, info.max) {
            (Value::F32(x), Value::F32(min), Value::F32(max)) => (min..=max).contains(&x),
            (Value::U32(x), Value::U32(min), Value::U32(max)) => (min..=max).contains(&x),
            (Value::Bool(_), Value::Bool(_), Value::Bool(_)) => true,
            _ => return Err(Refusal::WrongType),
        };
        let mut changed = *self;
        if let Some(place) = changed.0.get_mut(usize::from(index)) {
            *place = value;
        }
        if !in_range || changed.count(Parameter::BusHold) >= changed.count(Parameter::BusStop) {
            return Err(Refusal::OutOfRange);
        }
        *self = changed;
        Ok(())
    }

    /// A parameter that is a number; the table's tests see to it that it is.
    fn number(&self, parameter: Parameter) -> f32 {
        match self.0[parameter as usize] {
            Value::F32(x) => x,
            Value::U32(_) | Value::Bool(_) => 0.0,
        }
    }

    /// A parameter that is a count.
    fn count(&self, parameter: Parameter) -> u32 {
        match self.0[parameter as usize] {
            Value::U32(n) => n,
            Value::F32(_) | Value::Bool(_) => 0,
        }
    }

    /// What follows from the parameters for a hand with this control period.
    #[must_use]
    pub fn settings(&self, model: &HandModel<f32>, period_us: u32) -> Settings {
        use Parameter as P;
        let mut control = control::Config::new(model);
        let stiffness = [P::StiffnessAbduction, P::StiffnessFlexion, P::StiffnessMiddle];
        let damping = [P::DampingAbduction, P::DampingFlexion, P::DampingMiddle];
        for (k, gains) in control.joint.iter_mut().enumerate() {
            gains.stiffness_nm_per_rad = self.number(stiffness[k]);
            gains.damping_nm_s_per_rad = self.number(damping[k]);
        }
        control.friction.share = self.number(P::FrictionShare);
        control.torque_gain = self.number(P::TorqueGain);
        control.torque_filter_rad_per_s = self.number(P::TorqueFilter);
        control.velocity_filter_rad_per_s = self.number(P::VelocityFilter);
        control.thumb.force_max_n = self.number(P::ThumbForceMax);
        control.slip.friction = self.number(P::SlipFriction);
        control.slip.rate_n_per_s = self.number(P::SlipRate);
        control.slip.boost_max_n = self.number(P::SlipBoostMax);
        let mut stop = control;
        for gains in &mut stop.joint {
            gains.damping_nm_s_per_rad *= self.number(P::StopDamping);
        }
        let release_us = self.count(P::StopRelease);
        Settings {
            control,
            stop,
            safety: safety::Config {
                period_us,
                bus: safety::bus::Config {
                    cycle_us: self.count(P::BusCycle),
                    late_cycles: self.count(P::BusLate),
                    hold_us: self.count(P::BusHold),
                    stop_us: self.count(P::BusStop),
                },
                sensors: safety::sensors::Config::new(model),
                release_us: (release_us > 0).then_some(release_us),
            },
            target: safety::target::Config {
                speed_max_rad_per_s: self.number(P::TargetSpeedMax),
                torque_rate_max_nm_per_s: self.number(P::TargetTorqueRate),
                blend_half_us: self.count(P::TargetBlend),
            },
            thumb_stiffness_max_n_per_m: self.number(P::ThumbStiffnessMax),
            thumb_damping_max_n_s_per_m: self.number(P::ThumbDampingMax),
            thumb_stiffness_rate_n_per_m_s: self.number(P::ThumbStiffnessRate),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_are_those_of_the_control_laws_and_lie_in_their_ranges() {
        let model = HandModel::hit_dlr();
        let settings = Parameters::default().settings(&model, 125);
        assert_eq!(settings.control, control::Config::new(&model));
        assert_eq!(settings.safety.bus, safety::bus::Config::default());
        assert_eq!(settings.target.speed_max_rad_per_s, model.drive.speed_max_rad_per_s);
        for index in 0..COUNT {
            let default = Parameters::info(index).expect("it is there").default;
            assert_eq!(Parameters::default().set(index, default), Ok(()), "{index}");
        }
    }

    #[test]
    fn names_are_unique() {
        for (i, info) in TABLE.iter().enumerate() {
            assert!(TABLE[..i].iter().all(|other| other.name != info.name), "{}", info.name);
        }
    }

    #[test]
    fn wrong_values_are_refused_and_change_nothing() {
        let mut parameters = Parameters::default();
        let index = |parameter: Parameter| parameter as u16;
        for (at, value, refusal) in [
            (COUNT, Value::Bool(true), Refusal::UnknownParameter),
            (index(Parameter::TorqueGain), Value::U32(1), Refusal::WrongType),
            (index(Parameter::TorqueGain), Value::F32(2.1), Refusal::OutOfRange),
            (index(Parameter::TorqueGain), Value::F32(-0.1), Refusal::OutOfRange),
            (index(Parameter::TorqueGain), Value::F32(f32::NAN), Refusal::OutOfRange),
            (index(Parameter::TorqueGain), Value::F32(f32::INFINITY), Refusal::OutOfRange),
            (index(Parameter::BusHold), Value::U32(20_000), Refusal::OutOfRange),
            (index(Parameter::BusStop), Value::U32(9_000), Refusal::OutOfRange),
        ] {
            assert_eq!(parameters.set(at, value), Err(refusal), "{at} {value:?}");
        }
        assert_eq!(parameters, Parameters::default());
        assert_eq!(parameters.set(index(Parameter::TorqueGain), Value::F32(1.5)), Ok(()));
        assert_eq!(parameters.get(index(Parameter::TorqueGain)), Ok(Value::F32(1.5)));
    }
}
