//! The arm's joints over time, and how the arm carries the scanner along a sweep.

use nalgebra::{Isometry3, Translation3};
use thiserror::Error;

use super::sweep::StripePose;
use crate::plan::arm::{Arm, Inverse, Joints};

/// What the arm's controller reports.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointSample {
    /// On the arm's clock.
    pub time_s: f64,
    /// Angles of axes 1 to 6.
    pub q_rad: Joints,
}

/// Samples in the order of time.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct JointTrack {
    samples: Vec<JointSample>,
}

/// Why samples are no track.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum JointTrackError {
    /// A time that does not come after the one before.
    #[error("the time {time_s} s does not come after {before_s} s")]
    Order {
        /// Place in the list, from 0.
        index: usize,
        /// Its time.
        time_s: f64,
        /// That of the sample before.
        before_s: f64,
    },
    /// A time or an angle that is no finite number.
    #[error("a time or an angle is not a finite number")]
    NotFinite {
        /// Place in the list, from 0.
        index: usize,
    },
}

/// Samples farther apart than this have a gap between them, in which the arm may have been anywhere.
pub const MAX_GAP_S: f64 = 0.1;

impl JointTrack {
    /// Checks order and numbers.
    ///
    /// # Errors
    /// See [`JointTrackError`].
    pub fn new(samples: Vec<JointSample>) -> Result<Self, JointTrackError> {
        let mut track = Self { samples: Vec::with_capacity(samples.len()) };
        samples.into_iter().try_for_each(|sample| track.push(sample))?;
        Ok(track)
    }

    /// Goes on to another sample.
    ///
    /// # Errors
    /// See [`JointTrackError`]; the track stays as it was.
    pub fn push(&mut self, sample: JointSample) -> Result<(), JointTrackError> {
        let index = self.samples.len();
        let JointSample { time_s, q_rad } = &sample;
        if !q_rad.iter().chain([time_s]).all(|x| x.is_finite()) {
            return Err(JointTrackError::NotFinite { index });
        }
        match self.samples.last() {
            Some(&JointSample { time_s: before_s, .. }) if *time_s <= before_s => {
                Err(JointTrackError::Order { index, time_s: *time_s, before_s })
            }
            _ => {
                self.samples.push(sample);
                Ok(())
            }
        }
    }

    /// This track and then another.
    ///
    /// # Errors
    /// When the other begins before this one ends.
    pub fn followed_by(mut self, other: Self) -> Result<Self, JointTrackError> {
        other.samples.into_iter().try_for_each(|sample| self.push(sample))?;
        Ok(self)
    }

    /// All samples.
    #[must_use]
    pub fn samples(&self) -> &[JointSample] {
        &self.samples
    }

    /// Angles at a time, linear between the samples; `None` before the first, after the last, and in a gap longer than
    /// [`MAX_GAP_S`].
    #[must_use]
    pub fn at(&self, time_s: f64) -> Option<Joints> {
        let after = self.samples.partition_point(|sample| sample.time_s < time_s);
        let b = self.samples.get(after)?;
        if b.time_s <= time_s {
            return Some(b.q_rad);
        }
        let a = self.samples.get(after.checked_sub(1)?)?;
        let span_s = b.time_s - a.time_s;
        // A controller's clock is not exact to the last digit.
        if span_s > MAX_GAP_S * (1.0 + 1e-9) {
            return None;
        }
        let share = (time_s - a.time_s) / span_s;
        Some(std::array::from_fn(|i| a.q_rad[i] + share * (b.q_rad[i] - a.q_rad[i])))
    }
}

/// Time between two samples of a carried sweep: half a millimetre of the way, over which the joints move as good as
/// evenly.
const PERIOD_S: f64 = 0.01;
/// Samples before the first and after the last exposure, so that a clock that runs differently loses nothing.
const RUN_UP: i32 = 8;
/// Furthest that a joint turns in a period.
const MAX_TURN_RAD: f64 = 0.05;

/// The joints that carry the scanner along a sweep's stripes, times as the stripes'; `None` when the arm cannot go that way
/// without leaving its limits or jumping to another configuration.
#[must_use]
pub fn carry(
    arm: &Arm,
    palm_from_scanner: &Isometry3<f64>,
    stripes: &[StripePose],
) -> Option<Vec<JointSample>> {
    let (first, last) = (stripes.first()?, stripes.last()?);
    let scanner_from_palm = palm_from_scanner.inverse();
    let steps = ((last.time_s - first.time_s) / PERIOD_S).ceil().clamp(0.0, 1e6) as i32;
    let at = |i: i32| {
        let time_s = first.time_s + f64::from(i) * PERIOD_S;
        (time_s, pose_at(stripes, time_s) * scanner_from_palm)
    };
    // Most ways that cannot be gone cannot be begun.
    let Inverse::Solutions(starts) = arm.palm_solutions_near(&at(-RUN_UP).1, &[0.0; 6]) else {
        return None;
    };
    let way: Vec<(f64, Isometry3<f64>)> = (-RUN_UP..=steps + RUN_UP).map(at).collect();
    starts.iter().find_map(|start| follow(arm, &way, &start.q_rad))
}

fn follow(arm: &Arm, way: &[(f64, Isometry3<f64>)], start_rad: &Joints) -> Option<Vec<JointSample>> {
    let mut before = *start_rad;
    way.iter()
        .map(|(time_s, base_from_palm)| {
            let Inverse::Solutions(near) = arm.palm_solutions_near(base_from_palm, &before) else {
                return None;
            };
            let next = near.iter().next()?.q_rad;
            if next.iter().zip(&before).any(|(a, b)| (a - b).abs() > MAX_TURN_RAD) {
                return None;
            }
            before = next;
            Some(JointSample { time_s: *time_s, q_rad: next })
        })
        .collect()
}

/// The scanner at a time, linear between stripes and beyond them; a sweep turns the scanner nowhere.
fn pose_at(stripes: &[StripePose], time_s: f64) -> Isometry3<f64> {
    let after = stripes.partition_point(|stripe| stripe.time_s < time_s).clamp(1, stripes.len().max(2) - 1);
    let a = &stripes[after - 1];
    let Some(b) = stripes.get(after) else { return a.base_from_scanner };
    let share = (time_s - a.time_s) / (b.time_s - a.time_s);
    let [from, to] = [a, b].map(|stripe| stripe.base_from_scanner.translation.vector);
    Isometry3::from_parts(Translation3::from(from.lerp(&to, share)), a.base_from_scanner.rotation)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scan::palm_from_scanner;
    use nalgebra::{UnitQuaternion, Vector3};

    fn sample(time_s: f64, angle: f64) -> JointSample {
        JointSample { time_s, q_rad: [angle; 6] }
    }

    #[test]
    fn between_samples_the_joints_move_evenly_and_a_gap_is_no_motion() {
        let track = JointTrack::new(vec![sample(1.0, 0.0), sample(1.1, 1.0), sample(2.0, 3.0)]).unwrap();
        assert_eq!(track.at(1.0), Some([0.0; 6]));
        assert!((track.at(1.025).unwrap()[3] - 0.25).abs() < 1e-12);
        assert_eq!(track.at(2.0), Some([3.0; 6]));
        for outside in [0.999, 1.5, 2.001, f64::NAN] {
            assert_eq!(track.at(outside), None, "{outside}");
        }
    }

    #[test]
    fn time_goes_forward() {
        let wrong = JointTrack::new(vec![sample(1.0, 0.0), sample(1.0, 0.1)]);
        assert_eq!(wrong, Err(JointTrackError::Order { index: 1, time_s: 1.0, before_s: 1.0 }));
        assert_eq!(
            JointTrack::new(vec![sample(1.0, f64::NAN)]),
            Err(JointTrackError::NotFinite { index: 0 })
        );
    }

    #[test]
    fn the_arm_carries_the_scanner_where_the_sweep_wants_it() {
        let down = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
        let stripe = |i: u32| StripePose {
            time_s: f64::from(i) * 0.02,
            base_from_scanner: Isometry3::from_parts(
                Translation3::new(0.35 + 0.001 * f64::from(i), 0.0, 0.22),
                down,
            ),
        };
        let stripes: Vec<StripePose> = (0..=100).map(stripe).collect();
        let arm = Arm::rx60();
        let track = JointTrack::new(carry(&arm, &palm_from_scanner(), &stripes).unwrap()).unwrap();
        for stripe in &stripes {
            let found = arm.base_from_palm(&track.at(stripe.time_s).unwrap()) * palm_from_scanner();
            let off = found.inverse() * stripe.base_from_scanner;
            assert!(off.translation.vector.norm() < 1e-6 && off.rotation.angle() < 1e-5);
        }
        let far: Vec<StripePose> = stripes
            .iter()
            .map(|s| StripePose {
                base_from_scanner: Translation3::new(1.0, 0.0, 0.0) * s.base_from_scanner,
                ..*s
            })
            .collect();
        assert_eq!(carry(&arm, &palm_from_scanner(), &far), None);
        assert_eq!(carry(&arm, &palm_from_scanner(), &[]), None);
    }
}
