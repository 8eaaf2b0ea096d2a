//! Where palm and fingers are to be at each time of a phase.

use core::f64::consts::FRAC_PI_2;

use hand_model::HandModel;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use protocol::ids::{JOINT_COUNT, JointId};

use super::outcome::Trouble;
use super::phase::Phase;
use super::plan::{Closing, ExecutionPlan, ExecutionSettings};
use crate::link::{Command, ThumbLaw};
use crate::plan::profile::rest_to_rest;

/// The directions of the shake, base frame, in their order.
const DIRECTIONS: [[f64; 3]; 6] =
    [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]];

/// Shortest stop, where the palm hardly moves or only turns.
const STOP_LEAST_S: f64 = 0.01;

/// Where the shake has the palm after `time_s`, from where it started: out and back once in each direction, `one_s` each,
/// with accelerations of up to `most_m_per_s2`.
///
/// The way out and back is `64 d u^3 (1 - u)^3` of the time's share u. It starts and ends without speed and acceleration; its
/// acceleration is at most `24 d / T^2`, at the far end and against the direction, and `19.2 d / T^2` along it; its jerk is at
/// most `384 d / T^3`, that is 16 accelerations over T.
#[must_use]
pub fn shake_offset_m(time_s: f64, one_s: f64, most_m_per_s2: f64) -> Vector3<f64> {
    let shares = (time_s / one_s).clamp(0.0, DIRECTIONS.len() as f64);
    let Some(direction) = DIRECTIONS.get(shares as usize) else { return Vector3::zeros() };
    let u = shares.fract();
    let far_m = most_m_per_s2 * one_s * one_s / 24.0;
    // At the far end it is pushed back the hardest: the way goes against the direction, the push along it.
    Vector3::from(*direction) * (-64.0 * far_m * (u * (1.0 - u)).powi(3))
}

/// Where a phase begins.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Start {
    /// The palm's commanded pose.
    pub(super) base_from_palm: Isometry3<f64>,
    /// And the one a period earlier.
    pub(super) before: Isometry3<f64>,
    /// Whether the hand has its grip.
    pub(super) grips: bool,
    /// Multiple of the planned grip.
    pub(super) grip: f64,
}

/// What all phases have in common.
pub(super) struct Course<'a> {
    pub(super) plan: &'a ExecutionPlan,
    pub(super) settings: &'a ExecutionSettings,
    pub(super) model: &'a HandModel<f64>,
}

impl Course<'_> {
    /// Where the object is lifted to.
    pub(super) fn lift_site(&self) -> Isometry3<f64> {
        Translation3::new(0.0, 0.0, self.settings.lift_m) * self.plan.grasp_site
    }

    /// Where the retreat ends.
    pub(super) fn safe_site(&self, trouble: Option<Trouble>) -> Isometry3<f64> {
        match trouble {
            // Below lies the object.
            Some(Trouble::Lost) => self.lift_site(),
            _ => self.plan.approach_site,
        }
    }

    /// How long a phase takes, at most.
    pub(super) fn duration_s(&self, phase: Phase, start: &Start, trouble: Option<Trouble>) -> f64 {
        let settings = self.settings;
        let way_s = |from: &Isometry3<f64>, to: &Isometry3<f64>| {
            let way = to.translation.vector - from.translation.vector;
            // A radian of turning counts as a decimetre.
            (way.norm() + 0.1 * to.rotation.angle_to(&from.rotation)) / settings.advance_speed_m_per_s
        };
        match phase {
            // At most: the thumb's base has a quarter turn to go at its own speed.
            Phase::Prepare => FRAC_PI_2 / self.model.thumb_rotation.speed_max_rad_per_s + 0.5,
            Phase::Advance => way_s(&self.plan.approach_site, &self.plan.grasp_site),
            Phase::Close | Phase::Open => settings.close_s,
            Phase::Squeeze | Phase::Release => settings.squeeze_s,
            Phase::Lift | Phase::Lower => settings.lift_s,
            Phase::Hold => settings.hold_s,
            Phase::Shake if settings.shake_m_per_s2 > 0.0 => settings.shake_s * DIRECTIONS.len() as f64,
            Phase::Shake => 0.0,
            Phase::Stop => {
                let way = start.base_from_palm.translation.vector - start.before.translation.vector;
                // The quartic's deceleration is at most 1.5 times the mean one.
                (1.5 * way.norm() / settings.period_s / settings.stop_m_per_s2).max(STOP_LEAST_S)
            }
            Phase::Retreat => way_s(&start.base_from_palm, &self.safe_site(trouble)),
        }
    }

    /// The command at `time_s` of a phase that takes `duration_s`; `grip` is the present multiple of the planned grip.
    pub(super) fn command(
        &self,
        phase: Phase,
        start: &Start,
        trouble: Option<Trouble>,
        [time_s, duration_s]: [f64; 2],
        grip: f64,
    ) -> Command {
        let plan = self.plan;
        let way = rest_to_rest(time_s, duration_s);
        let from_start_to = |site: &Isometry3<f64>| start.base_from_palm.lerp_slerp(site, way.share);
        let base_from_palm = match phase {
            Phase::Prepare => plan.approach_site,
            Phase::Advance => plan.approach_site.lerp_slerp(&plan.grasp_site, way.share),
            Phase::Close | Phase::Squeeze => plan.grasp_site,
            Phase::Lift => from_start_to(&self.lift_site()),
            Phase::Hold => self.lift_site(),
            Phase::Shake => {
                let settings = self.settings;
                let offset_m = shake_offset_m(time_s, settings.shake_s, settings.shake_m_per_s2);
                Translation3::from(offset_m) * self.lift_site()
            }
            Phase::Stop => stopping(start, time_s, duration_s, self.settings.period_s),
            Phase::Lower => from_start_to(&plan.grasp_site),
            Phase::Release | Phase::Open => start.base_from_palm,
            Phase::Retreat => from_start_to(&self.safe_site(trouble)),
        };
        let open = plan.pregrasp.to_array();
        let (grasp, squeeze) = (plan.grasp.to_array(), plan.squeeze.to_array());
        let between =
            |from: &[f64; JOINT_COUNT], to: &[f64; JOINT_COUNT], share: f64| -> [f64; JOINT_COUNT] {
                core::array::from_fn(|j| from[j] + (to[j] - from[j]) * share)
            };
        let still = [0.0; JOINT_COUNT];
        let grips = match phase {
            Phase::Stop => start.grips,
            _ => matches!(phase, Phase::Squeeze | Phase::Release | Phase::Lower) || phase.carries(),
        };
        // A grip is a push against something: its targets have no speed of their own.
        let (position_rad, velocity_rad_per_s) = match phase {
            Phase::Close => match self.settings.closing {
                Closing::Together => (
                    between(&open, &grasp, way.share),
                    core::array::from_fn(|j| (grasp[j] - open[j]) * way.rate_per_s),
                ),
                Closing::EachAtSpeed(speed) => each_at_speed(&open, &grasp, speed, time_s),
            },
            Phase::Squeeze => (between(&grasp, &squeeze, way.share), still),
            Phase::Release => (between(&grasp, &squeeze, start.grip * (1.0 - way.share)), still),
            Phase::Open => (
                between(&grasp, &open, way.share),
                core::array::from_fn(|j| (open[j] - grasp[j]) * way.rate_per_s),
            ),
            _ if grips => (between(&grasp, &squeeze, grip), still),
            _ => (open, still),
        };
        Command {
            position_rad,
            velocity_rad_per_s,
            feed_forward_nm: still,
            thumb: if grips { plan.thumb } else { ThumbLaw::Position },
            base_from_palm,
        }
    }
}

/// From the start's speed to rest on Paul's quartic, whose acceleration ends and begins with 0.
fn stopping(start: &Start, time_s: f64, duration_s: f64, period_s: f64) -> Isometry3<f64> {
    let u = (time_s / duration_s).clamp(0.0, 1.0);
    let periods = duration_s / period_s * (u - u * u * u * (1.0 - 0.5 * u));
    let (now, before) = (&start.base_from_palm, &start.before);
    let way = (now.translation.vector - before.translation.vector) * periods;
    let turn = (now.rotation * before.rotation.inverse()).scaled_axis() * periods;
    Isometry3::from_parts(
        Translation3::from(now.translation.vector + way),
        UnitQuaternion::from_scaled_axis(turn) * now.rotation,
    )
}

/// Each joint on its own, without take-off and set-down.
fn each_at_speed(
    from: &[f64; JOINT_COUNT],
    to: &[f64; JOINT_COUNT],
    speed_rad_per_s: f64,
    time_s: f64,
) -> ([f64; JOINT_COUNT], [f64; JOINT_COUNT]) {
    let (mut position, mut velocity) = (*to, [0.0; JOINT_COUNT]);
    for joint in (0..JOINT_COUNT).filter(|&joint| joint != JointId::THUMB_ROTATION.index()) {
        let way = to[joint] - from[joint];
        let gone = speed_rad_per_s * time_s;
        if gone < way.abs() {
            position[joint] = from[joint] + gone.copysign(way);
            velocity[joint] = speed_rad_per_s.copysign(way);
        }
    }
    (position, velocity)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shake_has_its_acceleration_in_every_direction_and_bounded_jerk() {
        let (one_s, most, step) = (0.4, 5.0, 1e-4);
        let at = |time_s: f64| shake_offset_m(time_s, one_s, most);
        let acceleration = |t: f64| (at(t - step) - 2.0 * at(t) + at(t + step)) / (step * step);
        let (mut low, mut high, mut jerk) = (Vector3::zeros(), Vector3::zeros(), 0.0f64);
        let mut last: Option<Vector3<f64>> = None;
        for i in 0..=(6.0 * one_s / step) as usize {
            let a: Vector3<f64> = acceleration(i as f64 * step);
            (low, high) = (a.inf(&low), a.sup(&high));
            jerk = jerk.max(last.map_or(0.0, |b| (a - b).norm() / step));
            last = Some(a);
        }
        for bound in low.iter().map(|a| -a).chain(high.iter().copied()) {
            assert!((bound - most).abs() < 1e-3 * most, "{low} {high}");
        }
        assert!(jerk < 16.0 * most / one_s * 1.01 && jerk > 0.9 * 16.0 * most / one_s, "{jerk}");
        for i in 0..=6 {
            assert!(at(f64::from(i) * one_s).norm() < 1e-12);
        }
    }

    #[test]
    fn stopping_begins_with_the_speed_and_ends_at_rest() {
        let period_s = 1e-3;
        let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.0, 0.0, 1e-3));
        let before = Isometry3::identity();
        let now = Isometry3::from_parts(Translation3::new(8e-5, 0.0, 0.0), turn);
        let start = Start { base_from_palm: now, before, grips: false, grip: 1.0 };
        let at = |t: f64| stopping(&start, t, 0.1, period_s);
        let speed = |t: f64| (at(t + 1e-6).translation.x - at(t).translation.x) / 1e-6;
        assert!((speed(0.0) - 0.08).abs() < 1e-5);
        assert!(speed(0.1 - 1e-6).abs() < 1e-5);
        assert!((at(0.1).translation.x - (8e-5 + 0.5 * 0.08 * 0.1)).abs() < 1e-12);
        assert!((at(0.1).rotation.angle() - (1e-3 + 0.5 * 0.1)).abs() < 1e-9);
        assert_eq!(at(0.2), at(0.1));
    }
}
