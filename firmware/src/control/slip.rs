//! Slip at the fingertips, and the reflex against it.
//!
//! A single force without a couple presses on a spherical tip. Force `f` and moment `m` about the sphere's centre then
//! give the parts of the force along and across the normal at the contact: `c = |f x m|^2` is `R^2 f^2` times the square of
//! the friction force, and `d = R^2 f^4 - c` as many times that of the normal force (from the line of action of Bicchi,
//! Salisbury, Brock, 1993). Coulomb's criterion so needs neither a root nor a division.
//!
//! On the true cone the measured ratio never exceeds the coefficient, sliding or not: the coefficient that is set must be less
//! than the true one.

use protocol::ids::FINGER_COUNT;

use super::limits::all_finite;

/// What counts as slip, and what is done about it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlipConfig {
    /// Coulomb coefficient that is counted on.
    pub friction: f32,
    /// Share of it at which a tip is about to slip.
    pub slip_share: f32,
    /// Share below which a tip is firm again.
    pub firm_share: f32,
    /// Normal force from which there is a contact to judge.
    pub contact_n: f32,
    /// How long a tip must stay at the edge of its cone.
    pub edge_s: f32,
    /// Cut-off of the wrenches' filter.
    pub filter_rad_per_s: f32,
    /// How fast the thumb presses harder while a tip slips; 0 for no reflex.
    pub rate_n_per_s: f32,
    /// Most that it presses beyond what was commanded.
    pub boost_max_n: f32,
    /// Radius of the tips' spheres.
    pub tip_radius_m: f32,
}

impl SlipConfig {
    /// For tips of this radius: a normal force is judged from 0.3 N on, six deviations of a sensor of 0.05 N.
    #[must_use]
    pub const fn new(tip_radius_m: f32) -> Self {
        Self {
            friction: 0.4,
            slip_share: 0.95,
            firm_share: 0.7,
            contact_n: 0.3,
            edge_s: 0.005,
            filter_rad_per_s: 628.0,
            rate_n_per_s: 50.0,
            boost_max_n: 6.0,
            tip_radius_m,
        }
    }
}

/// A fingertip's filtered wrench and its timer.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Tip {
    wrench: [f32; 6],
    at_edge_s: f32,
    is_slipping: bool,
}

/// Where a contact lies in its friction cone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Place {
    /// There is no contact to judge, or it is well inside.
    Firm,
    /// Between.
    Inside,
    /// At the edge or beyond.
    Edge,
}

/// What all fingertips feel, and how much harder the thumb presses for it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Slip {
    tips: [Tip; FINGER_COUNT],
    boost_n: f32,
}

impl Slip {
    /// One period. `reacts` says whether the thumb is a spring whose push may grow; when it is not, the push ends.
    pub fn step(
        &mut self,
        config: &SlipConfig,
        wrenches: &[[f32; 6]; FINGER_COUNT],
        reacts: bool,
        dt_s: f32,
    ) {
        let rise = config.filter_rad_per_s * dt_s;
        let share = rise / (1.0 + rise);
        let mut slips = false;
        for (tip, wrench) in self.tips.iter_mut().zip(wrenches) {
            tip.step(config, wrench, share, dt_s);
            slips |= tip.is_slipping;
        }
        if !reacts {
            self.boost_n = 0.0;
        } else if slips {
            let boost_n = self.boost_n + config.rate_n_per_s * dt_s;
            self.boost_n = if boost_n < config.boost_max_n { boost_n } else { config.boost_max_n };
        }
    }

    /// Whether each fingertip slips.
    #[must_use]
    pub fn slipping(&self) -> [bool; FINGER_COUNT] {
        self.tips.map(|tip| tip.is_slipping)
    }

    /// The thumb presses as commanded again.
    pub fn end_boost(&mut self) {
        self.boost_n = 0.0;
    }

    /// How much harder than commanded the thumb presses.
    #[must_use]
    pub const fn boost_n(&self) -> f32 {
        self.boost_n
    }
}

impl Tip {
    fn step(&mut self, config: &SlipConfig, read: &[f32; 6], share: f32, dt_s: f32) {
        let mut wrench = self.wrench;
        for (filtered, read) in wrench.iter_mut().zip(read) {
            *filtered += share * (read - *filtered);
        }
        // What is no number would stay in the filter for ever.
        if !all_finite(&wrench) {
            *self = Self::default();
            return;
        }
        self.wrench = wrench;
        let place = place(config, &wrench);
        self.at_edge_s = if place == Place::Edge { self.at_edge_s + dt_s } else { 0.0 };
        self.is_slipping = match place {
            Place::Firm => false,
            Place::Inside => self.is_slipping,
            Place::Edge => self.is_slipping || self.at_edge_s >= config.edge_s,
        };
    }
}

fn place(config: &SlipConfig, &[fx, fy, fz, mx, my, mz]: &[f32; 6]) -> Place {
    let squared = fx * fx + fy * fy + fz * fz;
    let contact = config.contact_n * config.contact_n;
    if squared <= contact {
        return Place::Firm;
    }
    let (cx, cy, cz) = (fy * mz - fz * my, fz * mx - fx * mz, fx * my - fy * mx);
    let radius = config.tip_radius_m * config.tip_radius_m;
    let across = cx * cx + cy * cy + cz * cz;
    let along = radius * squared * squared - across;
    // Not so beside the sphere, where it is too light, and beyond all numbers.
    let is_contact = along > contact * radius * squared;
    if !is_contact {
        return Place::Firm;
    }
    let within = |share: f32| {
        let ratio = share * config.friction;
        across <= ratio * ratio * along
    };
    match (within(config.firm_share), within(config.slip_share)) {
        (true, _) => Place::Firm,
        (false, true) => Place::Inside,
        (false, false) => Place::Edge,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    const RADIUS_M: f32 = 0.0125;
    const DT_S: f32 = 125e-6;

    fn config() -> SlipConfig {
        SlipConfig::new(RADIUS_M)
    }

    /// What a force at a place of the sphere does to the sensor.
    fn push(place: Vector3<f32>, force: Vector3<f32>) -> [f32; 6] {
        let moment = (place.normalize() * RADIUS_M).cross(&force);
        [force.x, force.y, force.z, moment.x, moment.y, moment.z]
    }

    /// A normal force of 2 N on the pad, with this share of it across.
    fn at_ratio(ratio: f32) -> [[f32; 6]; FINGER_COUNT] {
        let firm = push(Vector3::z(), Vector3::z() * -2.0);
        [firm, push(Vector3::z(), Vector3::new(2.0 * ratio, 0.0, -2.0)), firm, firm]
    }

    /// Periods until the index finger slips.
    fn slips_after(slip: &mut Slip, wrenches: &[[f32; 6]; FINGER_COUNT], periods: usize) -> Option<usize> {
        (0..periods).find(|_| {
            slip.step(&config(), wrenches, true, DT_S);
            slip.slipping()[1]
        })
    }

    #[test]
    fn the_criterion_is_coulombs_wherever_the_contact_is() {
        // The parts of the force by vectors, as the module does not compute them.
        for place_ in [Vector3::new(0.3, -0.2, 0.9), Vector3::x(), Vector3::new(0.5, 0.5, 0.1)] {
            let normal = place_.normalize();
            let across = normal.cross(&Vector3::new(0.2, 0.9, -0.4)).normalize();
            for ratio in [0.0_f32, 0.2, 0.27, 0.29, 0.33, 0.37, 0.39, 0.5, 2.0] {
                let force = (across * ratio - normal) * 1.7;
                let expected = match ratio / config().friction {
                    share if share < config().firm_share => Place::Firm,
                    share if share < config().slip_share => Place::Inside,
                    _ => Place::Edge,
                };
                assert_eq!(place(&config(), &push(place_, force)), expected, "{ratio}");
            }
        }
    }

    #[test]
    fn what_is_light_or_beside_the_sphere_is_not_judged() {
        assert_eq!(place(&config(), &push(Vector3::z(), Vector3::new(0.2, 0.0, -0.2))), Place::Firm);
        assert_eq!(place(&config(), &[1.0, 0.0, 0.0, 0.0, 0.0, 1.1 * RADIUS_M]), Place::Firm);
        assert_eq!(place(&config(), &[0.0; 6]), Place::Firm);
    }

    #[test]
    fn slip_needs_the_edge_for_some_time_and_ends_well_inside() {
        let mut slip = Slip::default();
        assert_eq!(slips_after(&mut slip, &at_ratio(0.37), 800), None);
        let periods = slips_after(&mut slip, &at_ratio(0.45), 800).expect("it slips");
        // 5 ms and the filter's delay of some 1.6 ms.
        assert!((40..80).contains(&periods), "{periods}");
        assert_eq!(slip.slipping(), [false, true, false, false]);
        for (ratio, slipping) in [(0.32, true), (0.2, false)] {
            for _ in 0..400 {
                slip.step(&config(), &at_ratio(ratio), true, DT_S);
            }
            assert_eq!(slip.slipping()[1], slipping, "{ratio}");
        }
    }

    #[test]
    fn the_thumb_presses_harder_while_a_tip_slips_and_no_more_than_allowed() {
        let mut slip = Slip::default();
        for _ in 0..400 {
            slip.step(&config(), &at_ratio(0.5), true, DT_S);
        }
        // 50 ms less some 6 ms at 50 N/s.
        assert!((2.0..2.4).contains(&slip.boost_n()), "{}", slip.boost_n());
        for _ in 0..400 {
            slip.step(&config(), &at_ratio(0.1), true, DT_S);
        }
        let held_n = slip.boost_n();
        assert!(held_n > 2.0, "the grip stays");
        for _ in 0..8000 {
            slip.step(&config(), &at_ratio(0.5), true, DT_S);
        }
        assert_eq!(slip.boost_n(), config().boost_max_n);
        slip.step(&config(), &at_ratio(0.5), false, DT_S);
        assert_eq!(slip.boost_n(), 0.0);
    }

    #[test]
    fn no_number_leaves_no_trace() {
        let mut slip = Slip::default();
        assert_eq!(slips_after(&mut slip, &[[f32::MAX; 6]; FINGER_COUNT], 100), None);
        for bad in [f32::NAN, f32::INFINITY] {
            slip.step(&config(), &[[bad; 6]; FINGER_COUNT], true, DT_S);
        }
        assert_eq!(slips_after(&mut slip, &at_ratio(0.1), 100), None);
        assert!(slips_after(&mut slip, &at_ratio(0.5), 800).is_some());
    }
}
