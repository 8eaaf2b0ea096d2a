//! Feeling for slip: contact point and friction ratio at each fingertip from its six-axis sensor.

use hand_model::FingerGeometry;
use nalgebra::Vector3;
use protocol::ids::{FINGER_COUNT, FingerId};

use crate::link::{Report, TipWrench};

/// What counts as contact and as slip.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MonitorConfig {
    /// Friction that the plan counts on. It should be less than the true one: on the true cone the measured ratio never
    /// exceeds the coefficient, sliding or not, so a finger on a slipperier surface slides unnoticed.
    pub friction: f64,
    /// Normal force from which there is a contact to judge.
    pub contact_n: f64,
    /// Force below which a contact counts as lost, once it has stayed there for [`Self::lost_time_s`].
    pub lost_n: f64,
    /// See [`Self::lost_n`].
    pub lost_time_s: f64,
    /// Share of [`Self::friction`] at which a finger is about to slip.
    pub slip_share: f64,
    /// How long the ratio must stay there.
    pub slip_time_s: f64,
    /// Share of [`Self::friction`] below which the finger is firm again.
    pub firm_share: f64,
    /// Cut-off of the force filter.
    pub filter_rad_per_s: f64,
    /// Radius of the tips' spheres.
    pub tip_radius_m: f64,
}

impl MonitorConfig {
    /// Thresholds for the HIT/DLR hand's tip sensors (0.05 N noise: 0.3 N is six deviations).
    #[must_use]
    pub fn new(finger: &FingerGeometry<f64>, friction: f64) -> Self {
        Self {
            friction,
            contact_n: 0.3,
            lost_n: 0.15,
            lost_time_s: 0.02,
            slip_share: 0.95,
            slip_time_s: 0.005,
            firm_share: 0.7,
            filter_rad_per_s: 2.0 * core::f64::consts::PI * 100.0,
            tip_radius_m: finger.tip_radius_m,
        }
    }
}

/// A contact as a fingertip feels it, axes of the distal link.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FeltContact {
    /// From the centre of the sphere to the contact, metres.
    pub point_from_center: Vector3<f64>,
    /// Force into the fingertip along the normal, > 0.
    pub normal_n: f64,
    /// Friction force.
    pub tangent_n: f64,
}

/// Where a single force without a couple presses on a sphere of `radius_m`; `None` if the wrench is no such push.
///
/// The moment fixes the force's line of action, `c = f x m / |f|^2 + s f`; it meets the sphere twice, and a push comes in
/// at the end that it points away from (Bicchi, Salisbury, Brock, 1993).
#[must_use]
pub fn felt_contact(wrench: &TipWrench, radius_m: f64) -> Option<FeltContact> {
    let force = wrench.force;
    let squared = force.norm_squared();
    if squared.is_nan() || squared <= 0.0 {
        return None;
    }
    let off_center = force.cross(&wrench.moment) / squared;
    let chord_2 = radius_m * radius_m - off_center.norm_squared();
    if chord_2.is_nan() || chord_2 < 0.0 {
        return None;
    }
    let point_from_center = off_center - force * (chord_2 / squared).sqrt();
    let normal_n = -force.dot(&point_from_center) / radius_m;
    let tangent_n = (squared - normal_n * normal_n).max(0.0).sqrt();
    Some(FeltContact { point_from_center, normal_n, tangent_n })
}

/// What a fingertip does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Touch {
    /// Nothing is felt.
    Free,
    /// The contact is inside its friction cone.
    Firm,
    /// The contact has been at the edge of its cone for the set time.
    Slipping,
}

/// A fingertip's filtered force and its timers.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Tip {
    filtered: TipWrench,
    at_edge_s: f64,
    unloaded_s: f64,
    touch: Touch,
}

/// Watches the four tips.
#[derive(Debug, Clone, PartialEq)]
pub struct Monitor {
    config: MonitorConfig,
    tips: [Tip; FINGER_COUNT],
}

impl Monitor {
    /// Starts with free fingertips.
    #[must_use]
    pub fn new(config: MonitorConfig) -> Self {
        let filtered = TipWrench { force: Vector3::zeros(), moment: Vector3::zeros() };
        let tip = Tip { filtered, at_edge_s: 0.0, unloaded_s: 0.0, touch: Touch::Free };
        Self { config, tips: [tip; FINGER_COUNT] }
    }

    /// Takes in the sensors, `dt_s` after the last time, and says what each tip does.
    pub fn update(&mut self, report: &Report, dt_s: f64) -> [Touch; FINGER_COUNT] {
        for (tip, wrench) in self.tips.iter_mut().zip(&report.tip_wrench) {
            tip.update(&self.config, wrench, dt_s);
        }
        self.tips.map(|tip| tip.touch)
    }

    /// Filtered force on a tip, N.
    #[must_use]
    pub fn force_n(&self, finger: FingerId) -> f64 {
        self.tips[finger.index()].filtered.force.norm()
    }

    /// Tangential over normal force at a tip, divided by the friction coefficient: 1 is slip. `None` without contact.
    #[must_use]
    pub fn slip_ratio(&self, finger: FingerId) -> Option<f64> {
        self.tips[finger.index()].slip_ratio(&self.config)
    }
}

impl Tip {
    fn slip_ratio(&self, config: &MonitorConfig) -> Option<f64> {
        let contact = felt_contact(&self.filtered, config.tip_radius_m)?;
        (contact.normal_n > config.contact_n).then(|| contact.tangent_n / contact.normal_n / config.friction)
    }

    fn update(&mut self, config: &MonitorConfig, raw: &TipWrench, dt_s: f64) {
        let share = config.filter_rad_per_s * dt_s / (1.0 + config.filter_rad_per_s * dt_s);
        self.filtered.force += (raw.force - self.filtered.force) * share;
        self.filtered.moment += (raw.moment - self.filtered.moment) * share;
        let timed = |holds: bool, timer_s: f64| if holds { timer_s + dt_s } else { 0.0 };

        let felt = self.slip_ratio(config);
        let ratio = felt.unwrap_or(0.0);
        self.at_edge_s = timed(ratio > config.slip_share, self.at_edge_s);
        self.unloaded_s = timed(self.filtered.force.norm() < config.lost_n, self.unloaded_s);
        self.touch = match self.touch {
            Touch::Free if felt.is_none() => Touch::Free,
            _ if self.unloaded_s >= config.lost_time_s => Touch::Free,
            _ if self.at_edge_s >= config.slip_time_s => Touch::Slipping,
            Touch::Slipping if ratio > config.firm_share => Touch::Slipping,
            _ => Touch::Firm,
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Unit;
    use protocol::ids::JOINT_COUNT;

    const RADIUS_M: f64 = 0.0125;

    fn push(place: Vector3<f64>, force: Vector3<f64>) -> TipWrench {
        let point = Unit::new_normalize(place).into_inner() * RADIUS_M;
        TipWrench { force, moment: point.cross(&force) }
    }

    #[test]
    fn a_push_is_found_where_it_acts() {
        for (place, force) in [
            (Vector3::new(0.3, -0.2, 0.9), Vector3::new(-0.5, 0.1, -3.0)),
            (Vector3::new(1.0, 0.0, 0.0), Vector3::new(-2.0, 0.7, 0.2)),
        ] {
            let felt = felt_contact(&push(place, force), RADIUS_M).unwrap();
            let normal = place.normalize();
            assert!((felt.point_from_center - normal * RADIUS_M).norm() < 1e-12);
            assert!((felt.normal_n + force.dot(&normal)).abs() < 1e-12);
            assert!((felt.tangent_n - (force - normal * force.dot(&normal)).norm()).abs() < 1e-9);
        }
    }

    #[test]
    fn a_line_of_action_beside_the_sphere_is_no_contact() {
        let beside = TipWrench { force: Vector3::x(), moment: Vector3::z() * (1.1 * RADIUS_M) };
        assert_eq!(felt_contact(&beside, RADIUS_M), None);
        let nothing = TipWrench { force: Vector3::zeros(), moment: Vector3::zeros() };
        assert_eq!(felt_contact(&nothing, RADIUS_M), None);
    }

    #[test]
    fn slip_needs_the_edge_of_the_cone_for_some_time() {
        let finger = hand_model::HandModel::<f64>::hit_dlr().finger;
        let mut monitor = Monitor::new(MonitorConfig::new(&finger, 0.4));
        let report = |ratio: f64| Report {
            time_s: 0.0,
            position_rad: [0.0; JOINT_COUNT],
            joint_torque_nm: [0.0; JOINT_COUNT],
            tip_wrench: [push(Vector3::z(), Vector3::new(2.0 * ratio, 0.0, -2.0)); FINGER_COUNT],
        };
        for _ in 0..100 {
            assert_ne!(monitor.update(&report(0.37), 1e-3)[0], Touch::Slipping);
        }
        let ticks = (1..100).find(|_| monitor.update(&report(0.45), 1e-3)[0] == Touch::Slipping);
        assert!((5..12).contains(&ticks.unwrap()), "{ticks:?}");
        let settled =
            |monitor: &mut Monitor, report: &Report| (0..50).map(|_| monitor.update(report, 1e-3)[0]).last();
        assert_eq!(settled(&mut monitor, &report(0.32)), Some(Touch::Slipping), "not firm yet");
        assert_eq!(settled(&mut monitor, &report(0.2)), Some(Touch::Firm));
        let mut free = report(0.0);
        for wrench in &mut free.tip_wrench {
            wrench.force *= 0.0;
        }
        assert_eq!(monitor.update(&free, 1e-3)[0], Touch::Firm, "a contact is not lost at once");
        assert_eq!(settled(&mut monitor, &free), Some(Touch::Free));
    }
}
