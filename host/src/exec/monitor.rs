//! Feeling for slip: contact point and friction ratio at each fingertip from its six-axis sensor.

use hand_model::FingerGeometry;
use nalgebra::Vector3;
use protocol::ids::{FINGER_COUNT, FingerId};

use crate::link::{Report, TipWrench};

/// What counts as contact and as slip.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MonitorConfig {
    /// Friction that the plan counts on. It should be less than the true one: on the true cone the measured ratio never
    /// exceeds the coefficient, sliding or not.
    pub friction: f64,
    /// Normal force from which there is a contact to judge; one that exists is lost at half of it.
    pub contact_n: f64,
    /// Share of [`Self::friction`] at which a finger is about to slip.
    pub slip_share: f64,
    /// How long the ratio must stay there.
    pub slip_time_s: f64,
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
            slip_share: 0.95,
            slip_time_s: 0.005,
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

/// Filtered forces and timers of the four tips.
#[derive(Debug, Clone, PartialEq)]
pub struct Monitor {
    config: MonitorConfig,
    filtered: [TipWrench; FINGER_COUNT],
    at_edge_s: [f64; FINGER_COUNT],
    touch: [Touch; FINGER_COUNT],
}

impl Monitor {
    /// Starts with free fingertips.
    #[must_use]
    pub fn new(config: MonitorConfig) -> Self {
        let none = TipWrench { force: Vector3::zeros(), moment: Vector3::zeros() };
        Self {
            config,
            filtered: [none; FINGER_COUNT],
            at_edge_s: [0.0; FINGER_COUNT],
            touch: [Touch::Free; FINGER_COUNT],
        }
    }

    /// Takes in the sensors, `dt_s` after the last time, and says what each tip does.
    pub fn update(&mut self, report: &Report, dt_s: f64) -> [Touch; FINGER_COUNT] {
        let config = self.config;
        let share = config.filter_rad_per_s * dt_s / (1.0 + config.filter_rad_per_s * dt_s);
        for finger in FingerId::ALL.map(FingerId::index) {
            let (filtered, raw) = (&mut self.filtered[finger], &report.tip_wrench[finger]);
            filtered.force += (raw.force - filtered.force) * share;
            filtered.moment += (raw.moment - filtered.moment) * share;
            let contact =
                felt_contact(filtered, config.tip_radius_m).filter(|c| c.normal_n > config.contact_n);
            let at_edge =
                contact.is_some_and(|c| c.tangent_n > config.slip_share * config.friction * c.normal_n);
            self.at_edge_s[finger] = if at_edge { self.at_edge_s[finger] + dt_s } else { 0.0 };
            self.touch[finger] = match contact {
                None => Touch::Free,
                Some(_) if self.at_edge_s[finger] >= config.slip_time_s => Touch::Slipping,
                Some(_) => Touch::Firm,
            };
        }
        self.touch
    }

    /// Filtered force on a tip, N.
    #[must_use]
    pub fn force_n(&self, finger: FingerId) -> f64 {
        self.filtered[finger.index()].force.norm()
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
        for _ in 0..50 {
            monitor.update(&report(0.2), 1e-3);
        }
        assert_eq!(monitor.update(&report(0.2), 1e-3)[0], Touch::Firm);
    }
}
