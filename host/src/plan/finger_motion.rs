//! Fingers that arrive together: all joints of a hand from one posture to another in the same time.
//!
//! "The object slightly moves by the first arrived finger. When the method of Paul's quartic equation trajectory
//! interpolation is incorporated into the finger control, the phenomenon occurs rarely" (Wang et al. 2005, section V.B).
//! Every joint follows one law of progress: take-off by Paul's quartic, constant speed, and set-down by the quartic (R. P.
//! Paul, *Robot Manipulators*, 1981), at rest at both ends and without a step of the acceleration. The slowest joint
//! decides the time.

use thiserror::Error;

use super::profile::{BLEND, Progress, rest_to_rest};

/// Knots in each of take-off and set-down. The cubics between them are within 2e-5 of the way from the quartic.
const KNOTS_IN_BLEND: usize = 6;

/// The cubics exceed the greatest speed of the quartic by less than this factor.
const SPEED_SLACK: f64 = 1.001;

/// Where all joints are, and how fast, at one time.
#[derive(Debug, Clone, PartialEq)]
pub struct FingerKnot {
    /// Time since the start of the motion, seconds.
    pub t_s: f64,
    /// Joint angles, rad (metres for a sliding joint).
    pub q_rad: Vec<f64>,
    /// Joint speeds.
    pub qd_rad_per_s: Vec<f64>,
}

/// A motion of all joints from rest to rest, cubic between its knots.
#[derive(Debug, Clone, PartialEq)]
pub struct FingerMotion {
    /// At least one; the last one is the end.
    pub knots: Vec<FingerKnot>,
    /// When all fingers arrive: time of the last knot.
    pub contact_s: f64,
}

/// Why there is no motion.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum FingerMotionError {
    /// The three lists are not equally long.
    #[error("{from} start angles, {to} end angles and {speeds} speeds are not for the same joints")]
    Count {
        /// Start angles.
        from: usize,
        /// End angles.
        to: usize,
        /// Speeds.
        speeds: usize,
    },
    /// An angle is NaN or infinite.
    #[error("joint {joint} (counted from 0) has an angle that is not a finite number")]
    NotFinite {
        /// Its number.
        joint: usize,
    },
    /// A speed limit is not greater than zero.
    #[error("the speed limit of joint {joint} (counted from 0) is {value}, but has to be greater than zero")]
    Speed {
        /// Its number.
        joint: usize,
        /// Its limit.
        value: f64,
    },
}

/// Moves every joint from `from` to `to` so that all arrive at the same time, the soonest that `speed_limits_rad_per_s`
/// allow. One number for each joint in each list.
///
/// # Errors
/// [`FingerMotionError`] when the lists do not fit or hold something that is no angle or limit.
pub fn touch_together(
    from: &[f64],
    to: &[f64],
    speed_limits_rad_per_s: &[f64],
) -> Result<FingerMotion, FingerMotionError> {
    let (count, speeds) = (from.len(), speed_limits_rad_per_s.len());
    if to.len() != count || speeds != count {
        return Err(FingerMotionError::Count { from: count, to: to.len(), speeds });
    }
    if let Some(joint) = (0..count).find(|&i| !(from[i].is_finite() && to[i].is_finite())) {
        return Err(FingerMotionError::NotFinite { joint });
    }
    if let Some(joint) =
        (0..count).find(|&i| speed_limits_rad_per_s[i].is_nan() || speed_limits_rad_per_s[i] <= 0.0)
    {
        return Err(FingerMotionError::Speed { joint, value: speed_limits_rad_per_s[joint] });
    }
    let cruise = SPEED_SLACK / (1.0 - BLEND);
    let contact_s =
        (0..count).map(|i| cruise * (to[i] - from[i]).abs() / speed_limits_rad_per_s[i]).fold(0.0, f64::max);
    let knot = |time: f64| {
        let Progress { share, rate_per_s: rate } = rest_to_rest(time, 1.0);
        let rate = if contact_s > 0.0 { rate / contact_s } else { 0.0 };
        FingerKnot {
            t_s: time * contact_s,
            q_rad: from.iter().zip(to).map(|(a, b)| a + (b - a) * share).collect(),
            qd_rad_per_s: from.iter().zip(to).map(|(a, b)| (b - a) * rate).collect(),
        }
    };
    if contact_s == 0.0 {
        return Ok(FingerMotion { knots: vec![knot(0.0)], contact_s });
    }
    let blend = |i: usize| BLEND * i as f64 / KNOTS_IN_BLEND as f64;
    let take_off = (0..=KNOTS_IN_BLEND).map(|i| knot(blend(i)));
    let set_down = (0..=KNOTS_IN_BLEND).rev().map(|i| knot(1.0 - blend(i)));
    let mut knots: Vec<FingerKnot> = take_off.chain(set_down).collect();
    if let Some(last) = knots.last_mut() {
        // Not `a + (b - a)`, which may round.
        last.q_rad = to.to_vec();
    }
    Ok(FingerMotion { knots, contact_s })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Angle and speed of one joint on the cubic between two knots.
    fn between(a: &FingerKnot, b: &FingerKnot, joint: usize, t_s: f64) -> [f64; 2] {
        let h = b.t_s - a.t_s;
        let u = (t_s - a.t_s) / h;
        let (q0, q1) = (a.q_rad[joint], b.q_rad[joint]);
        let (v0, v1) = (a.qd_rad_per_s[joint] * h, b.qd_rad_per_s[joint] * h);
        let (c2, c3) = (3.0 * (q1 - q0) - 2.0 * v0 - v1, v0 + v1 - 2.0 * (q1 - q0));
        [q0 + u * (v0 + u * (c2 + u * c3)), (v0 + u * (2.0 * c2 + 3.0 * u * c3)) / h]
    }

    #[test]
    fn the_slowest_joint_decides_and_all_arrive_together() {
        let motion = touch_together(&[0.0, 1.0, 0.5], &[0.6, 0.4, 0.5], &[2.0, 1.0, 3.0]).unwrap();
        // Joint 1 needs 0.6 rad at 1 rad/s; take-off and set-down cost 0.4 of the time.
        assert!((motion.contact_s - SPEED_SLACK * 0.6 / 0.6).abs() < 1e-12);
        let last = motion.knots.last().unwrap();
        assert_eq!((last.t_s, last.q_rad.as_slice()), (motion.contact_s, [0.6, 0.4, 0.5].as_slice()));
        assert_eq!(motion.knots[0].qd_rad_per_s, [0.0; 3]);
        assert_eq!(last.qd_rad_per_s, [0.0; 3]);
        // Half the way in half the time, all joints alike.
        let [a, b] = [&motion.knots[KNOTS_IN_BLEND], &motion.knots[KNOTS_IN_BLEND + 1]];
        for (joint, half) in [(0, 0.3), (1, 0.7), (2, 0.5)] {
            assert!((between(a, b, joint, 0.5 * motion.contact_s)[0] - half).abs() < 1e-12);
        }
    }

    #[test]
    fn no_way_takes_no_time_and_nonsense_is_named() {
        let still = touch_together(&[0.3], &[0.3], &[1.0]).unwrap();
        assert_eq!((still.contact_s, still.knots.len(), still.knots[0].qd_rad_per_s[0]), (0.0, 1, 0.0));
        assert_eq!(touch_together(&[], &[], &[]).unwrap().contact_s, 0.0);
        let count = FingerMotionError::Count { from: 1, to: 2, speeds: 1 };
        assert_eq!(touch_together(&[0.0], &[0.0, 1.0], &[1.0]), Err(count));
        let nan = touch_together(&[0.0, f64::NAN], &[0.0; 2], &[1.0; 2]);
        assert_eq!(nan, Err(FingerMotionError::NotFinite { joint: 1 }));
        for value in [0.0, -1.0] {
            let stuck = touch_together(&[0.0], &[1.0], &[value]);
            assert_eq!(stuck, Err(FingerMotionError::Speed { joint: 0, value }));
        }
        assert!(matches!(touch_together(&[0.0], &[1.0], &[f64::NAN]), Err(FingerMotionError::Speed { .. })));
    }

    proptest! {
        /// Between the knots too: within the speed limits, never past the end, the speed's derivative without steps.
        #[test]
        fn speeds_hold_and_ways_are_monotone(
            joints in prop::collection::vec((-2.0..2.0f64, -2.0..2.0f64, 0.1..5.0f64), 1..14)
        ) {
            let from: Vec<f64> = joints.iter().map(|j| j.0).collect();
            let to: Vec<f64> = joints.iter().map(|j| j.1).collect();
            let speeds: Vec<f64> = joints.iter().map(|j| j.2).collect();
            let motion = touch_together(&from, &to, &speeds).unwrap();
            let mut fastest: f64 = 0.0;
            for pair in motion.knots.windows(2) {
                for i in 0..=20 {
                    let t_s = pair[0].t_s + (pair[1].t_s - pair[0].t_s) * f64::from(i) / 20.0;
                    let share = rest_to_rest(t_s, motion.contact_s).share;
                    for j in 0..joints.len() {
                        let [q, qd] = between(&pair[0], &pair[1], j, t_s);
                        let way = to[j] - from[j];
                        prop_assert!((q - from[j] - share * way).abs() <= 2e-5 * way.abs() + 1e-12);
                        prop_assert!(qd.abs() <= speeds[j] * (1.0 + 1e-12) && qd * way >= -1e-9);
                        fastest = fastest.max(qd.abs() / speeds[j]);
                    }
                }
            }
            prop_assert!(fastest > 0.99, "no joint is at its limit: {fastest}");
        }
    }
}
