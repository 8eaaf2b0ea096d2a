//! Straight lines of the palm, followed in joint space without changing the branch.

use std::f64::consts::TAU;

use nalgebra::{Isometry3, Translation3};
use thiserror::Error;

use super::{Arm, Inverse, Joints, LimitCheck};

/// A joint may turn this far from one sample to the next. Two branches are farther apart, except next to a
/// singularity, where the motion cannot be followed in any useful time anyway.
const MAX_TURN_RAD: f64 = 0.2;

/// How often a step in which a joint turns farther is halved before the turn counts as a jump.
const MAX_HALVINGS: u32 = 6;

/// More samples than this say nothing new about a line that an arm can reach.
const MAX_STEPS: f64 = 100_000.0;

/// Why a line cannot be followed to its end.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum LineBlock {
    /// A pose, the seed or a step is NaN or infinite, or a step is not greater than zero.
    #[error("a pose or step is not a number that makes sense")]
    NotFinite,
    /// The wrist centre leaves the reach of the links; see [`Inverse::OutOfReach`].
    #[error("it is out of reach, with the wrist {distance_m:.3} m from axis 2")]
    OutOfReach {
        /// Distance from axis 2 to the wrist centre.
        distance_m: f64,
    },
    /// The wrist centre comes too near to axis 1; see [`Inverse::ShoulderSingular`].
    #[error("the wrist comes within {distance_m:.3} m of axis 1")]
    ShoulderSingular {
        /// Distance from axis 1 to the wrist centre.
        distance_m: f64,
    },
    /// A joint would have to leave its limits.
    #[error("axis {axis} would have to go {excess_rad:.3} rad beyond its limit")]
    Limit {
        /// 1 to 6.
        axis: usize,
        /// How far it would be beyond its limit.
        excess_rad: f64,
    },
    /// A joint would have to jump: the line meets a wrist singularity, or the branch ends.
    #[error("axis {axis} would have to jump by {jump_rad:.3} rad, at a singularity")]
    Jump {
        /// 1 to 6.
        axis: usize,
        /// How far it would have to jump.
        jump_rad: f64,
    },
}

/// Whether a straight line of the palm can be followed.
#[derive(Debug, Clone, PartialEq)]
pub enum LineOutcome {
    /// Joint angles along the line, from its start to its end: evenly spaced, with more samples where the joints turn
    /// fast.
    Path(Vec<Joints>),
    /// It ends early.
    Blocked {
        /// The part of the line that can be followed, 0 to 1 (0 also when there is no configuration to start with).
        fraction: f64,
        /// Why.
        reason: LineBlock,
    },
}

/// Poses from `from` (at 0) to `to` (at 1): the origin on a straight line, the rotation about one fixed axis.
struct Line {
    from: Isometry3<f64>,
    to: Isometry3<f64>,
}

impl Line {
    fn at(&self, s: f64) -> Isometry3<f64> {
        let position = self.from.translation.vector.lerp(&self.to.translation.vector, s);
        // Not `slerp`, which panics on half a turn; there the axis is arbitrary, but the same for every `s`.
        let rotation = self.from.rotation * (self.from.rotation.inverse() * self.to.rotation).powf(s);
        Isometry3::from_parts(Translation3::from(position), rotation)
    }
}

impl Arm {
    /// Moves the palm from one pose to another in the base frame along a straight line, turning evenly.
    ///
    /// It starts in the configuration inside the limits that is nearest to `seed_rad`, and samples at least every
    /// `step_m` and `step_rad`. To try another branch, seed with another of [`Arm::palm_solutions_near`].
    #[must_use]
    pub fn straight_line(
        &self,
        base_from_palm_start: &Isometry3<f64>,
        base_from_palm_end: &Isometry3<f64>,
        seed_rad: &Joints,
        step_m: f64,
        step_rad: f64,
    ) -> LineOutcome {
        let line = Line { from: *base_from_palm_start, to: *base_from_palm_end };
        let distance_m = (line.to.translation.vector - line.from.translation.vector).norm();
        let steps =
            (distance_m / step_m).max(line.from.rotation.angle_to(&line.to.rotation) / step_rad).ceil();
        if !(steps.is_finite() && step_m > 0.0 && step_rad > 0.0) {
            return LineOutcome::Blocked { fraction: 0.0, reason: LineBlock::NotFinite };
        }
        let steps = steps.clamp(1.0, MAX_STEPS) as usize;

        let start = match self.palm_solutions_near(&line.from, seed_rad) {
            Inverse::Solutions(near) => near[0].q_rad,
            other => return LineOutcome::Blocked { fraction: 0.0, reason: block(&other) },
        };
        let mut path = vec![(0.0, start)];
        for i in 1..=steps {
            if let Err(reason) = self.advance(&line, i as f64 / steps as f64, MAX_HALVINGS, &mut path) {
                let fraction = path.last().map_or(0.0, |&(s, _)| s);
                return LineOutcome::Blocked { fraction, reason };
            }
        }
        LineOutcome::Path(path.into_iter().map(|(_, q)| q).collect())
    }

    /// Continues a path (pairs of place on the line and configuration) to the place `s`.
    fn advance(
        &self,
        line: &Line,
        s: f64,
        halvings: u32,
        path: &mut Vec<(f64, Joints)>,
    ) -> Result<(), LineBlock> {
        let Some(&(before_s, before)) = path.last() else { return Ok(()) };
        match self.continued(&line.at(s), &before) {
            Ok(q_rad) => path.push((s, q_rad)),
            Err(LineBlock::Jump { .. }) if halvings > 0 => {
                self.advance(line, 0.5 * (before_s + s), halvings - 1, path)?;
                self.advance(line, s, halvings - 1, path)?;
            }
            Err(reason) => return Err(reason),
        }
        Ok(())
    }

    /// The configuration for a pose of the palm that continues `before`.
    fn continued(&self, base_from_palm: &Isometry3<f64>, before: &Joints) -> Result<Joints, LineBlock> {
        let outcome = self.inverse(&(base_from_palm * self.flange_from_palm.inverse()), before);
        let Inverse::Solutions(all) = outcome else { return Err(block(&outcome)) };
        let mut nearest = (*before, 0, f64::INFINITY);
        for solution in all.iter() {
            // The solver prefers whole turns inside the limits; a continuous motion has no such choice.
            let q_rad: Joints = std::array::from_fn(|i| {
                let change = solution.q_rad[i] - before[i];
                before[i] + change - TAU * (change / TAU).round()
            });
            let (axis, turn_rad) = largest_turn(&q_rad, before);
            if turn_rad < nearest.2 {
                nearest = (q_rad, axis, turn_rad);
            }
        }
        let (q_rad, axis, jump_rad) = nearest;
        if jump_rad > MAX_TURN_RAD {
            return Err(LineBlock::Jump { axis, jump_rad });
        }
        match self.limits().check(&q_rad) {
            LimitCheck::Inside => Ok(q_rad),
            LimitCheck::Outside { axis, excess_rad } => Err(LineBlock::Limit { axis, excess_rad }),
        }
    }
}

/// The axis (1 to 6) that turns farthest between two configurations, and how far.
fn largest_turn(a: &Joints, b: &Joints) -> (usize, f64) {
    (0..6).map(|i| (i + 1, (a[i] - b[i]).abs())).fold((0, 0.0), |m, turn| if turn.1 > m.1 { turn } else { m })
}

/// An outcome of the inverse kinematics without solution, as the reason for the end of a line.
fn block(outcome: &Inverse) -> LineBlock {
    match *outcome {
        Inverse::OutsideLimits { axis, excess_rad } => LineBlock::Limit { axis, excess_rad },
        Inverse::OutOfReach { distance_m, .. } => LineBlock::OutOfReach { distance_m },
        Inverse::ShoulderSingular { distance_m, .. } => LineBlock::ShoulderSingular { distance_m },
        Inverse::NotFinite | Inverse::Solutions(_) => LineBlock::NotFinite,
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    const READY: Joints = [0.1, 0.4, 1.6, 0.2, 1.1, -0.3];

    fn path(outcome: LineOutcome) -> Vec<Joints> {
        match outcome {
            LineOutcome::Path(path) => path,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_line_that_turns_is_followed_to_its_end_without_leaving_it() {
        let arm = Arm::rx60();
        let from = arm.base_from_palm(&READY);
        let turn = Isometry3::rotation(Vector3::new(0.2, -0.3, 0.5));
        let to = Isometry3::translation(0.05, -0.08, -0.06) * from * turn;
        let path = path(arm.straight_line(&from, &to, &READY, 0.002, 0.02));
        assert!(path.len() > 50);
        let direction = (to.translation.vector - from.translation.vector).normalize();
        for (i, q) in path.iter().enumerate() {
            assert!(arm.limits().check(q).is_inside());
            let palm = arm.base_from_palm(q);
            let off = (palm.translation.vector - from.translation.vector).cross(&direction).norm();
            let share = i as f64 / (path.len() - 1) as f64;
            let angle = from.rotation.angle_to(&palm.rotation) - share * from.rotation.angle_to(&to.rotation);
            assert!(off < 1e-9 && angle.abs() < 1e-7, "{i}: {off} m, {angle} rad");
        }
        assert!(largest_turn(&path[0], &READY).1 < 1e-9);
        assert!(path.windows(2).all(|pair| largest_turn(&pair[0], &pair[1]).1 < 0.03));
    }

    #[test]
    fn a_line_out_of_reach_ends_where_the_arm_is_stretched() {
        let arm = Arm::rx60();
        let from = arm.base_from_palm(&READY);
        let to = Isometry3::translation(0.6, 0.0, 0.0) * from;
        let LineOutcome::Blocked { fraction, reason } = arm.straight_line(&from, &to, &READY, 0.001, 0.02)
        else {
            panic!("the arm is not that long");
        };
        assert!(matches!(reason, LineBlock::OutOfReach { .. }), "{reason:?}");
        // The farthest wrist centre on this line, by hand: forward distance sqrt(0.6^2 - (z - 0.341)^2).
        let flange = arm.base_from_flange(&READY);
        let center = flange * nalgebra::Point3::new(0.0, 0.0, -0.065);
        let farthest_xy2 = 0.36 - (center.z - 0.341).powi(2) + 0.049 * 0.049;
        let farthest_x = (farthest_xy2 - center.y * center.y).sqrt();
        assert!((fraction - (farthest_x - center.x) / 0.6).abs() < 0.001 / 0.6);
    }

    #[test]
    fn a_joint_is_not_taken_round_a_whole_turn_to_stay_inside_its_limits() {
        let arm = Arm::rx60();
        let mut q = READY;
        q[5] = 269.0_f64.to_radians();
        let from = arm.base_from_palm(&q);
        let to = from * Isometry3::rotation(Vector3::z() * 0.1);
        match arm.straight_line(&from, &to, &q, 0.001, 0.01) {
            LineOutcome::Blocked { fraction, reason: LineBlock::Limit { axis: 6, .. } } => {
                assert!((fraction - 1.0_f64.to_radians() / 0.1).abs() < 0.1, "{fraction}");
            }
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn past_a_wrist_singularity_the_samples_have_to_be_fine_enough() {
        let arm = Arm::rx60();
        // The hand nods from +0.3 to -0.3 rad; axis 6 passes the line of axis 4 at about `miss_rad`, where axis 4 has
        // to turn by nearly half a turn within a few times that angle.
        let nod = |miss_rad: f64, step_rad| {
            let lean = miss_rad / 0.3;
            let seed = [0.0, 0.4, 1.0, lean, 0.3, -lean];
            let [from, to] = [seed, [0.0, 0.4, 1.0, -lean, -0.3, lean]].map(|q| arm.base_from_palm(&q));
            arm.straight_line(&from, &to, &seed, 1.0, step_rad)
        };
        // Straight through, nothing has to turn: angle 5 changes its sign.
        assert!(path(nod(0.0, 0.1)).iter().all(|q| q[3].abs() < 1e-6));
        let coarse = nod(2e-3, 0.3);
        let LineOutcome::Blocked { reason: LineBlock::Jump { axis: 4 | 6, .. }, fraction } = coarse else {
            panic!("{coarse:?}");
        };
        assert!((fraction - 0.5).abs() < 0.1, "{fraction}");
        let fine = path(nod(2e-3, 0.01));
        assert!(fine.iter().any(|q| q[3] > 0.4 * TAU), "axis 4 turns");
        assert!(fine.windows(2).all(|pair| largest_turn(&pair[0], &pair[1]).1 <= MAX_TURN_RAD));
    }

    #[test]
    fn nonsense_is_refused_and_a_point_is_a_line() {
        let arm = Arm::rx60();
        let pose = arm.base_from_palm(&READY);
        for (step_m, step_rad) in [(0.0, 0.1), (0.1, -1.0), (f64::NAN, 0.1), (0.1, f64::NAN)] {
            let outcome = arm.straight_line(&pose, &pose, &READY, step_m, step_rad);
            assert_eq!(outcome, LineOutcome::Blocked { fraction: 0.0, reason: LineBlock::NotFinite });
        }
        let nowhere = Isometry3::translation(f64::NAN, 0.0, 0.0);
        let outcome = arm.straight_line(&pose, &nowhere, &READY, 0.01, 0.1);
        assert!(matches!(outcome, LineOutcome::Blocked { reason: LineBlock::NotFinite, .. }));
        assert_eq!(path(arm.straight_line(&pose, &pose, &READY, 0.01, 0.1)).len(), 2);
    }
}
