//! From a pose to joint angles, in closed form.
//!
//! The wrist centre fixes axes 1 to 3: two shoulders, two elbows each. The remaining rotation fixes axes 4 to 6, with
//! two wrists: eight solutions. Where solutions merge or become a one-parameter family, the outcome says so.
//!
//! Angles come from `atan2` of well-scaled pairs (the elbow from the half-angle form of the cosine law), never from
//! `acos`, whose error grows to 1e-8 rad near a stretched arm or wrist.

use std::f64::consts::PI;
use std::ops::ControlFlow;

use nalgebra::{Isometry3, Matrix3, Rotation3, Vector3};

use super::{Arm, JointLimits, Joints, LimitCheck};

/// A wrist centre this far beyond reach still counts as reached, and one this near to the shoulder's cylinder counts
/// as singular: below it, rounding decides.
const LENGTH_TOLERANCE_M: f64 = 1e-9;

/// A solution with |sin q5| below this leaves axes 4 and 6 in line; the pose error from treating it so is as large.
const WRIST_TOLERANCE: f64 = 1e-10;

/// Which side the arm stands on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Shoulder {
    /// The wrist centre is in front of axis 1.
    Front,
    /// The arm reaches over its own back.
    Back,
}

/// Which way the elbow bends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Elbow {
    /// Forearm turned by a positive angle out of line with the upper arm.
    Positive,
    /// By a negative angle.
    Negative,
    /// In line, stretched or folded: both bends are one, and no motion along the arm is possible at first order.
    Straight,
}

/// Which way the wrist bends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Wrist {
    /// Angle 5 of the formulas is positive.
    Positive,
    /// It is negative.
    Negative,
    /// Axes 4 and 6 are in line: a one-parameter family of which q4 is taken from the seed.
    Free,
}

/// Name of a solution that stays the same along a motion that meets no singularity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Branch {
    /// Shoulder.
    pub shoulder: Shoulder,
    /// Elbow.
    pub elbow: Elbow,
    /// Wrist.
    pub wrist: Wrist,
}

/// One configuration that reaches the pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Solution {
    /// Joint angles. Each is given in that whole turn which is inside the limits and nearest to the seed.
    pub q_rad: Joints,
    /// Which of the solutions it is.
    pub branch: Branch,
    /// Whether it is inside the limits.
    pub limits: LimitCheck,
}

/// Up to eight solutions, without allocation; derefs to a slice.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Solutions {
    items: [Solution; 8],
    len: usize,
}

/// What the inverse kinematics found.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(
    clippy::large_enum_variant,
    reason = "boxing the eight solutions would allocate in the planner's inner loop"
)]
pub enum Inverse {
    /// At least one configuration: eight in regular poses, fewer where branches merge. A wrist or elbow singularity
    /// is named in the solution's [`Branch`].
    Solutions(Solutions),
    /// There are configurations, but all outside the joint limits. Only from [`Arm::solutions_near`].
    OutsideLimits {
        /// The worst joint of the configuration that is least outside, 1 to 6.
        axis: usize,
        /// How far that one is beyond its limit.
        excess_rad: f64,
    },
    /// The wrist centre is too far from axis 2, or (with unequal links) too near.
    OutOfReach {
        /// Distance from axis 2 to the wrist centre, in the plane of the arm.
        distance_m: f64,
        /// Least distance that the lengths allow.
        least_m: f64,
        /// Greatest distance that the lengths allow.
        greatest_m: f64,
    },
    /// The wrist centre is nearer to axis 1 than the arm's plane can come (or, without lateral offset, on it, where
    /// axis 1 is free).
    ShoulderSingular {
        /// Distance from axis 1 to the wrist centre.
        distance_m: f64,
        /// Lateral offset of the arm's plane.
        least_m: f64,
    },
    /// The pose or the seed contains NaN or infinity.
    NotFinite,
}

impl Solutions {
    const fn new() -> Self {
        let branch = Branch { shoulder: Shoulder::Front, elbow: Elbow::Positive, wrist: Wrist::Positive };
        let blank = Solution { q_rad: [0.0; 6], branch, limits: LimitCheck::Inside };
        Self { items: [blank; 8], len: 0 }
    }

    /// Two shoulders, two elbows and two wrists never exceed the eight places.
    fn push(&mut self, solution: Solution) {
        if let Some(place) = self.items.get_mut(self.len) {
            *place = solution;
            self.len += 1;
        }
    }
}

impl std::ops::Deref for Solutions {
    type Target = [Solution];

    fn deref(&self) -> &[Solution] {
        &self.items[..self.len]
    }
}

impl Solution {
    /// Euclidean distance in joint space, radians.
    #[must_use]
    pub fn distance_rad(&self, q_rad: &Joints) -> f64 {
        self.q_rad.iter().zip(q_rad).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
    }
}

impl Arm {
    /// Every configuration that brings the flange to a pose in the base frame, inside the limits or not.
    ///
    /// The seed chooses among whole turns, and q4 where the wrist is singular; the order of the solutions does not
    /// depend on it.
    #[must_use]
    pub fn inverse(&self, base_from_flange: &Isometry3<f64>, seed_rad: &Joints) -> Inverse {
        let mut solutions = Solutions::new();
        let visited = self.visit(base_from_flange, seed_rad, &mut |solution| {
            solutions.push(solution);
            ControlFlow::Continue(())
        });
        visited.unwrap_or(Inverse::Solutions(solutions))
    }

    /// Whether some configuration inside the limits brings the palm to a pose in the base frame. Ends at the first one:
    /// for those who try many poses.
    #[must_use]
    pub fn reaches_palm(&self, base_from_palm: &Isometry3<f64>) -> bool {
        let mut reaches = false;
        let base_from_flange = base_from_palm * self.flange_from_palm.inverse();
        self.visit(&base_from_flange, &[0.0; 6], &mut |solution| {
            reaches = solution.limits.is_inside();
            if reaches { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        reaches
    }

    /// Shows the configurations one by one until told to break; the outcome instead when there is none.
    fn visit(
        &self,
        base_from_flange: &Isometry3<f64>,
        seed_rad: &Joints,
        visitor: &mut dyn FnMut(Solution) -> ControlFlow<()>,
    ) -> Option<Inverse> {
        let rotation = base_from_flange.rotation.to_rotation_matrix();
        let position = base_from_flange.translation.vector;
        if !position.iter().chain(rotation.matrix()).chain(seed_rad).all(|v| v.is_finite()) {
            return Some(Inverse::NotFinite);
        }
        let g = &self.params.geometry;
        let center = position - rotation * Vector3::new(0.0, 0.0, g.c4_m);

        let lateral_m = g.b_m.abs();
        let distance_m = center.x.hypot(center.y);
        if distance_m <= lateral_m + LENGTH_TOLERANCE_M {
            return Some(Inverse::ShoulderSingular { distance_m, least_m: lateral_m });
        }
        let forward_m = ((distance_m - lateral_m) * (distance_m + lateral_m)).sqrt();

        let mut nearest_miss: Option<Miss> = None;
        let mut found = false;
        for (shoulder, along_m) in [(Shoulder::Front, forward_m), (Shoulder::Back, -forward_m)] {
            // In the frame turned by theta1 the wrist centre is at (along, b), and there at (x, z) from axis 2.
            let theta1 = center.y.atan2(center.x) - g.b_m.atan2(along_m);
            let (x, z) = (along_m - g.a1_m, center.z - g.c1_m);
            let elbows = match self.elbows(x, z) {
                Ok(elbows) => elbows,
                Err(miss) => {
                    if nearest_miss.is_none_or(|other| miss.gap_m() < other.gap_m()) {
                        nearest_miss = Some(miss);
                    }
                    continue;
                }
            };
            for Bend { elbow, theta2, theta3 } in elbows.into_iter().flatten() {
                let wrist = Rotation3::from_axis_angle(&Vector3::y_axis(), -(theta2 + theta3))
                    * Rotation3::from_axis_angle(&Vector3::z_axis(), -theta1)
                    * rotation;
                let seed_theta4 = g.theta_from_joints(seed_rad)[3];
                for (wrist, [theta4, theta5, theta6]) in
                    wrists(wrist.matrix(), seed_theta4).into_iter().flatten()
                {
                    let q = g.joints_from_theta(&[theta1, theta2, theta3, theta4, theta5, theta6]);
                    let q_rad = nearest_turns(&self.params.limits, &q, seed_rad);
                    let branch = Branch { shoulder, elbow, wrist };
                    let limits = self.params.limits.check(&q_rad);
                    found = true;
                    if visitor(Solution { q_rad, branch, limits }).is_break() {
                        return None;
                    }
                }
            }
        }
        match nearest_miss {
            Some(Miss { distance_m, least_m, greatest_m }) if !found => {
                Some(Inverse::OutOfReach { distance_m, least_m, greatest_m })
            }
            _ => None,
        }
    }

    /// The configurations inside the limits, nearest to the seed first.
    #[must_use]
    pub fn solutions_near(&self, base_from_flange: &Isometry3<f64>, seed_rad: &Joints) -> Inverse {
        let all = match self.inverse(base_from_flange, seed_rad) {
            Inverse::Solutions(all) => all,
            other => return other,
        };
        let mut inside = Solutions::new();
        let mut least = (0, f64::INFINITY);
        for solution in all.iter() {
            match solution.limits {
                LimitCheck::Inside => inside.push(*solution),
                LimitCheck::Outside { axis, excess_rad } if excess_rad < least.1 => {
                    least = (axis, excess_rad)
                }
                LimitCheck::Outside { .. } => {}
            }
        }
        if inside.is_empty() {
            return Inverse::OutsideLimits { axis: least.0, excess_rad: least.1 };
        }
        // A stable sort: equal distances keep the order of the branches.
        inside.items[..inside.len]
            .sort_by(|a, b| a.distance_rad(seed_rad).total_cmp(&b.distance_rad(seed_rad)));
        Inverse::Solutions(inside)
    }

    /// [`Arm::solutions_near`] for a pose of the palm.
    #[must_use]
    pub fn palm_solutions_near(&self, base_from_palm: &Isometry3<f64>, seed_rad: &Joints) -> Inverse {
        self.solutions_near(&(base_from_palm * self.flange_from_palm.inverse()), seed_rad)
    }

    /// Angles 2 and 3 of the formulas for a wrist centre at `(x, z)` from axis 2 in the plane of the arm.
    fn elbows(&self, x: f64, z: f64) -> Result<[Option<Bend>; 2], Miss> {
        let g = &self.params.geometry;
        let (upper_m, fore_m) = (g.c2_m, g.forearm_m());
        let distance_m = x.hypot(z);
        let (greatest_m, least_m) = (upper_m + fore_m, (upper_m - fore_m).abs());
        // Cosine law for the angle between the links, as tan^2(angle / 2) = from_stretched / from_folded.
        let from_stretched = (greatest_m - distance_m) * (greatest_m + distance_m);
        let from_folded = (distance_m - least_m) * (distance_m + least_m);
        let miss = Miss { distance_m, least_m, greatest_m };
        if miss.gap_m() > LENGTH_TOLERANCE_M {
            return Err(miss);
        }
        let bend = 2.0 * from_stretched.max(0.0).sqrt().atan2(from_folded.max(0.0).sqrt());
        // Angle of the forearm's line out of its own link frame.
        let forearm_lean = g.a2_m.atan2(g.c3_m);
        let solve = |elbow, bend: f64| {
            let theta2 = x.atan2(z) - (fore_m * bend.sin()).atan2(upper_m + fore_m * bend.cos());
            Some(Bend { elbow, theta2, theta3: bend - forearm_lean })
        };
        if from_stretched <= LENGTH_TOLERANCE_M * greatest_m || from_folded <= LENGTH_TOLERANCE_M * greatest_m
        {
            return Ok([solve(Elbow::Straight, bend), None]);
        }
        Ok([solve(Elbow::Positive, bend), solve(Elbow::Negative, -bend)])
    }
}

/// Angles 2 and 3 of the formulas for one elbow, radians.
#[derive(Debug, Clone, Copy)]
struct Bend {
    elbow: Elbow,
    theta2: f64,
    theta3: f64,
}

/// A wrist centre that the links do not reach.
#[derive(Debug, Clone, Copy)]
struct Miss {
    distance_m: f64,
    least_m: f64,
    greatest_m: f64,
}

impl Miss {
    /// How far the wrist centre is beyond reach; not positive when it is within.
    fn gap_m(&self) -> f64 {
        (self.distance_m - self.greatest_m).max(self.least_m - self.distance_m)
    }
}

/// Angles 4, 5 and 6 with `m = Rz(theta4) Ry(theta5) Rz(theta6)`.
fn wrists(m: &Matrix3<f64>, seed_theta4: f64) -> [Option<(Wrist, [f64; 3])>; 2] {
    let solve = |wrist, theta4: f64| {
        // What remains after undoing axis 4 is Ry(theta5) Rz(theta6): an error in theta4 is made good here, so that
        // the pose stays exact however near to singular the wrist is.
        let rest = Rotation3::from_axis_angle(&Vector3::z_axis(), -theta4) * m;
        let theta5 = rest[(0, 2)].atan2(rest[(2, 2)]);
        let theta6 = rest[(1, 0)].atan2(rest[(1, 1)]);
        Some((wrist, [theta4, theta5, theta6]))
    };
    if m[(0, 2)].hypot(m[(1, 2)]) < WRIST_TOLERANCE {
        return [solve(Wrist::Free, seed_theta4), None];
    }
    let theta4 = m[(1, 2)].atan2(m[(0, 2)]);
    [solve(Wrist::Positive, theta4), solve(Wrist::Negative, theta4 + PI)]
}

/// Every joint in the whole turn that suits limits and seed.
fn nearest_turns(limits: &JointLimits, q_rad: &Joints, seed_rad: &Joints) -> Joints {
    std::array::from_fn(|i| limits.nearest_turn(i, q_rad[i], seed_rad[i]))
}
