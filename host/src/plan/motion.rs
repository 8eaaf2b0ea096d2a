//! The arm's way of a grasp: from where it rests to the approach site past everything, a straight line to the grasp site,
//! and straight up.
//!
//! "The sixth joint end of arm must passes by the approach site and moves straightly to grasp site before close hand
//! fingers", and "the motion trajectory should be planned according to the position of the object and the pose of the arm
//! in grasp site" (Wang et al. 2005, section V.A.5).
//!
//! Every configuration of the arm at the approach site is tried, in every whole turn that the limits allow, the nearest
//! to the start first. One that follows both lines with its links clear is taken if the straight move to it is free; if
//! none has such a move, a way past the obstacles is searched. Configurations next to a joint limit or a singularity come
//! after all others.

mod load;
#[cfg(test)]
mod tests;

use std::f64::consts::TAU;
use std::fmt;

use nalgebra::{Isometry3, Point3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::arm::{Arm, Inverse, Joints, LimitCheck, LineBlock, LineOutcome, Margin};
use super::attempt::palm_sites;
use super::free_path::Search;
use super::hand_shape::HandShape;
use super::obstacles::{Clash, ObjectPlace, Obstacles};
use super::scene::Scene;
use super::settle::Site;
use super::timing::{MotionLimits, PointSpeed, Shape, TimingError, time_path};
use super::trajectory::JointTrajectory;
use crate::hand::Posture;
use load::limits;

/// Samples of the straight lines. The spline through them is off the line by a fourth-order term, micrometres.
const STEP_M: f64 = 0.005;
const STEP_RAD: f64 = 0.05;

/// How far the palm may be off its straight line, metres. More is next to a singularity only.
const OFF_LINE_M: f64 = 0.0005;

/// Speed of the palm on the straight last way and on the lift, m/s: what the hand's reflexes can still follow.
const LINE_SPEED_M_PER_S: f64 = 0.10;

/// Corners of a way past obstacles are rounded by this much, rad; by less where that would touch something.
const CORNERS_RAD: [f64; 4] = [0.1, 0.03, 0.01, 0.002];

/// What a searched way keeps from all obstacles, metres, so that its corners can be rounded; nothing where there is no way
/// with it.
const SEARCH_CLEARANCES_M: [f64; 2] = [0.004, 0.0];

/// Seconds between the places of a timed motion that are looked at again.
const LOOK_S: f64 = 0.010;

/// A configuration with less than this is used only when there is no other: rad from a limit, and shares (see
/// [`Margin`]).
const MARGIN: Margin = Margin { limit_rad: 0.05, wrist: 0.1, elbow: 0.1, shoulder: 0.1 };

/// How far beyond start and goals a search may turn each axis, rad.
const SEARCH_PAD_RAD: f64 = 1.6;

/// Random configurations of a search.
const SEARCH_ITERATIONS: usize = 400;

/// Joint trajectories of one grasp, each from rest to rest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "Motion of the arm")]
pub struct ArmMotion {
    /// From the start to the approach site, the hand open.
    #[schemars(title = "Transfer")]
    pub transfer: JointTrajectory,
    /// Approach site to grasp site.
    #[schemars(title = "Approach")]
    pub approach: JointTrajectory,
    /// Grasp site to lifted site.
    #[schemars(title = "Lift")]
    pub lift: JointTrajectory,
}

/// A part of the way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Leg {
    /// From the start to the approach site.
    Transfer,
    /// From the approach site to the grasp site.
    Approach,
    /// From the grasp site up.
    Lift,
}

impl fmt::Display for Leg {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Transfer => "way to the approach site",
            Self::Approach => "straight approach",
            Self::Lift => "lift",
        })
    }
}

/// Why the arm cannot make the way. Where several configurations fail, the reason of the one that came farthest.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum MotionError {
    /// The start is outside the joint limits, or no number.
    #[error("the arm cannot start with axis {axis} at {angle_rad} rad, outside its limits")]
    StartOutsideLimits {
        /// 1 to 6.
        axis: usize,
        /// Its angle.
        angle_rad: f64,
    },
    /// Something touches at the start.
    #[error("where the arm starts {0}")]
    StartCollides(Clash),
    /// No configuration inside the limits reaches the approach site.
    #[error("no configuration of the arm reaches the approach site")]
    Unreachable,
    /// No configuration follows a line within the limits.
    #[error("no configuration of the arm follows the {leg}: {block}")]
    NoLine {
        /// Which line.
        leg: Leg,
        /// What stopped the best of them.
        block: LineBlock,
    },
    /// A line passes so near to a singularity that the timed motion leaves it.
    #[error("on the {leg} the palm would leave its line by {off_m} m, next to a singularity")]
    OffLine {
        /// Which line.
        leg: Leg,
        /// By how much.
        off_m: f64,
    },
    /// Every configuration that follows the lines touches something.
    #[error("on the {leg} {clash}")]
    Collides {
        /// On which part.
        leg: Leg,
        /// What touches what.
        clash: Clash,
    },
    /// No way from the start to a configuration was found.
    #[error("found no way from the start to the approach site: straight on, {0}")]
    NoWay(Clash),
    /// Hand, scanner and object are more than the arm may carry.
    #[error("hand, scanner and object of {object_kg} kg are more than the arm may carry")]
    TooHeavy {
        /// Mass of the object; 0 where hand and scanner alone are too heavy.
        object_kg: f64,
    },
    /// The way could not be timed.
    #[error(transparent)]
    Timing(#[from] TimingError),
}

/// What is to be moved, and from where.
#[derive(Debug, Clone, Copy)]
pub struct MotionRequest<'a> {
    /// Where the palm goes.
    pub site: &'a Site,
    /// The hand on its way to the grasp.
    pub open: &'a Posture,
    /// The hand around the object.
    pub closed: &'a Posture,
    /// Mass of the object.
    pub object_kg: f64,
    /// Where the arm starts, joint angles.
    pub start_rad: Joints,
    /// Seed of the search for a way.
    pub seed: u64,
}

/// Plans transfer, approach and lift of one grasp.
///
/// # Errors
/// [`MotionError`]: with the leg and what is in the way.
pub fn arm_motion(scene: &Scene, arm: &Arm, request: &MotionRequest<'_>) -> Result<ArmMotion, MotionError> {
    if let LimitCheck::Outside { axis, .. } = arm.limits().check(&request.start_rad) {
        return Err(MotionError::StartOutsideLimits { axis, angle_rad: request.start_rad[axis - 1] });
    }
    let free = limits(scene, arm, 0.0)?;
    let loaded = limits(scene, arm, request.object_kg)?;
    let [open, closed] = [request.open, request.closed].map(|posture| HandShape::of(&scene.hand, posture));
    let base_from_object = scene.base_from_object;
    let obstacles = |hand, place| Obstacles::new(arm, hand, scene.table_height_m, &scene.surface, place);
    let palm_from_object = request.site.object_from_palm.inverse();
    let way = Way {
        arm,
        start_rad: request.start_rad,
        sites: palm_sites(scene, request.site),
        transfer: obstacles(&open, ObjectPlace::Standing { base_from_object }),
        approach: obstacles(&open, ObjectPlace::Target { base_from_object }),
        lift: obstacles(&closed, ObjectPlace::Held { palm_from_object }),
        hand_center_in_palm: open.bound().center_in_palm,
        limits: [free, loaded],
        seed: request.seed,
    };
    way.plan()
}

/// Everything that the legs need.
struct Way<'a> {
    arm: &'a Arm,
    start_rad: Joints,
    /// Palm in the base frame: approach, grasp, lifted.
    sites: [Isometry3<f64>; 3],
    transfer: Obstacles<'a>,
    approach: Obstacles<'a>,
    lift: Obstacles<'a>,
    hand_center_in_palm: Point3<f64>,
    /// Without and with the object.
    limits: [MotionLimits; 2],
    seed: u64,
}

/// A configuration that follows both lines with its links clear.
struct Posed {
    approach: Vec<Joints>,
    lift: Vec<Joints>,
}

impl Posed {
    fn at_approach(&self) -> &Joints {
        &self.approach[0]
    }
}

impl Way<'_> {
    fn plan(&self) -> Result<ArmMotion, MotionError> {
        if let Some(clash) = self.transfer.clash_at(&self.start_rad) {
            return Err(MotionError::StartCollides(clash));
        }
        let mut failures = Failures(None);
        // Those with room first; in each group, the nearest first.
        let mut blocked: [Vec<Posed>; 2] = [vec![], vec![]];
        let mut cramped = Vec::new();
        for start in self.configurations()? {
            let posed = match self.lines(&start) {
                Ok(posed) => posed,
                Err(failure) => {
                    failures.note(failure);
                    continue;
                }
            };
            if self.is_cramped(&posed) {
                cramped.push(posed);
                continue;
            }
            match self.straight_to(posed) {
                Ok(motion) => return Ok(motion),
                Err((posed, failure)) => {
                    failures.note(failure);
                    blocked[0].extend(posed);
                }
            }
        }
        if let Some(motion) = self.past_obstacles(&blocked[0], &mut failures) {
            return Ok(motion);
        }
        for posed in cramped {
            match self.straight_to(posed) {
                Ok(motion) => return Ok(motion),
                Err((posed, failure)) => {
                    failures.note(failure);
                    blocked[1].extend(posed);
                }
            }
        }
        match self.past_obstacles(&blocked[1], &mut failures) {
            Some(motion) => Ok(motion),
            None => Err(failures.0.unwrap_or(MotionError::Unreachable)),
        }
    }

    /// Configurations at the approach site in every whole turn inside the limits, by the time that the slowest joint
    /// takes from the start.
    fn configurations(&self) -> Result<Vec<Joints>, MotionError> {
        let Inverse::Solutions(solutions) = self.arm.palm_solutions_near(&self.sites[0], &self.start_rad)
        else {
            return Err(MotionError::Unreachable);
        };
        let limits = self.arm.limits();
        let mut turned: Vec<Joints> = solutions.iter().map(|solution| solution.q_rad).collect();
        for axis in 0..6 {
            let others: Vec<Joints> = turned
                .iter()
                .flat_map(|q| {
                    [-TAU, TAU]
                        .map(|turn| std::array::from_fn(|i| if i == axis { q[i] + turn } else { q[i] }))
                })
                .filter(|q| limits.check(q).is_inside())
                .collect();
            turned.extend(others);
        }
        let speeds = &self.limits[0].speed_rad_per_s;
        let time_s =
            |q: &Joints| (0..6).map(|i| (q[i] - self.start_rad[i]).abs() / speeds[i]).fold(0.0, f64::max);
        turned.sort_by(|a, b| time_s(a).total_cmp(&time_s(b)));
        Ok(turned)
    }

    /// Follows both lines from a configuration and looks whether they are free.
    fn lines(&self, start: &Joints) -> Result<Posed, MotionError> {
        let line =
            |leg, from, to, seed: &Joints| match self.arm.straight_line(from, to, seed, STEP_M, STEP_RAD) {
                LineOutcome::Path(path) => Ok(path),
                LineOutcome::Blocked { reason, .. } => Err(MotionError::NoLine { leg, block: reason }),
            };
        let [approach_site, grasp_site, lift_site] = &self.sites;
        let approach = line(Leg::Approach, approach_site, grasp_site, start)?;
        let lift = line(Leg::Lift, grasp_site, lift_site, approach.last().unwrap_or(start))?;
        for (leg, path, obstacles) in
            [(Leg::Approach, &approach, &self.approach), (Leg::Lift, &lift, &self.lift)]
        {
            let clash = path.windows(2).find_map(|pair| obstacles.clash_between(&pair[0], &pair[1]));
            if let Some(clash) = clash {
                return Err(MotionError::Collides { leg, clash });
            }
        }
        Ok(Posed { approach, lift })
    }

    fn is_cramped(&self, posed: &Posed) -> bool {
        posed.approach.iter().chain(&posed.lift).any(|q| {
            let margin = self.arm.margin(q);
            margin.min(MARGIN) != MARGIN
        })
    }

    /// The whole motion, if the straight move from the start is free; else the failure, with the configuration where only
    /// that move is in the way.
    fn straight_to(&self, posed: Posed) -> Result<ArmMotion, (Option<Posed>, MotionError)> {
        if let Some(clash) = self.transfer.clash_between(&self.start_rad, posed.at_approach()) {
            return Err((Some(posed), MotionError::NoWay(clash)));
        }
        let path = [self.start_rad, *posed.at_approach()];
        let transfer = self.time_transfer(&path, CORNERS_RAD[0]).map_err(|error| (None, error.into()))?;
        self.with_lines(transfer, &posed).map_err(|failure| (None, failure))
    }

    /// A way past the obstacles to one of the configurations.
    fn past_obstacles(&self, posed: &[Posed], failures: &mut Failures) -> Option<ArmMotion> {
        SEARCH_CLEARANCES_M.into_iter().find_map(|clearance_m| self.search(posed, clearance_m, failures))
    }

    /// A way that keeps a clearance.
    fn search(&self, posed: &[Posed], clearance_m: f64, failures: &mut Failures) -> Option<ArmMotion> {
        let obstacles = self.transfer.keeping(clearance_m);
        let goals: Vec<Joints> =
            posed.iter().map(|p| *p.at_approach()).filter(|q| obstacles.clash_at(q).is_none()).collect();
        if goals.is_empty() {
            return None;
        }
        let is_free = |from: &Joints, to: &Joints| obstacles.clash_between(from, to).is_none();
        let (limits, all) = (self.arm.limits(), || goals.iter().chain([&self.start_rad]));
        let least = |i: usize| all().map(|q| q[i]).fold(f64::INFINITY, f64::min) - SEARCH_PAD_RAD;
        let most = |i: usize| all().map(|q| q[i]).fold(f64::NEG_INFINITY, f64::max) + SEARCH_PAD_RAD;
        let search = Search {
            is_free: &is_free,
            lower_rad: std::array::from_fn(|i| least(i).max(limits.lower_rad[i])),
            upper_rad: std::array::from_fn(|i| most(i).min(limits.upper_rad[i])),
            weights: self.transfer.hand_levers_m(),
            seed: self.seed,
            iterations: SEARCH_ITERATIONS,
        };
        let path = search.path(&self.start_rad, &goals)?;
        let posed = posed.iter().find(|p| path.last() == Some(p.at_approach()))?;
        let outcome = self.time_past(&path).and_then(|transfer| self.with_lines(transfer, posed));
        outcome.map_err(|failure| failures.note(failure)).ok()
    }

    /// Times a path with corners, which are rounded as much as the obstacles let them.
    fn time_past(&self, path: &[Joints]) -> Result<JointTrajectory, MotionError> {
        let mut failure = None;
        for corner_rad in CORNERS_RAD {
            let transfer = self.time_transfer(path, corner_rad)?;
            let steps = (transfer.duration_s() / LOOK_S).ceil();
            let at = |i: f64| transfer.sample(transfer.duration_s() * i / steps).q_rad;
            let clash = (0..steps as usize)
                .find_map(|i| self.transfer.clash_between(&at(i as f64), &at((i + 1) as f64)));
            match clash {
                None => return Ok(transfer),
                Some(clash) => failure = Some(MotionError::Collides { leg: Leg::Transfer, clash }),
            }
        }
        Err(failure.unwrap_or(MotionError::Unreachable))
    }

    fn time_transfer(&self, path: &[Joints], corner_rad: f64) -> Result<JointTrajectory, TimingError> {
        let hand = |q: &Joints| self.arm.base_from_palm(q) * self.hand_center_in_palm;
        let limit_m_per_s = self.arm.params().cartesian_speed_m_per_s;
        let speed = PointSpeed { point: &hand, limit_m_per_s };
        time_path(path, &self.limits[0], Shape::Rounded { corner_rad }, Some(speed))
    }

    /// Adds the timed lines to a transfer.
    fn with_lines(&self, transfer: JointTrajectory, posed: &Posed) -> Result<ArmMotion, MotionError> {
        let palm = |q: &Joints| Point3::from(self.arm.base_from_palm(q).translation.vector);
        let speed = PointSpeed { point: &palm, limit_m_per_s: LINE_SPEED_M_PER_S };
        let timed = |leg, path: &[Joints], limits, from: &Isometry3<f64>, to: &Isometry3<f64>| {
            let trajectory = time_path(path, limits, Shape::Through, Some(speed))?;
            let way = (to.translation.vector - from.translation.vector).normalize();
            let pairs = trajectory.knots().windows(2);
            let off_m = pairs
                .map(|pair| {
                    let middle = trajectory.sample(0.5 * (pair[0].t_s + pair[1].t_s)).q_rad;
                    let off = palm(&middle).coords - from.translation.vector;
                    (off - way * way.dot(&off)).norm()
                })
                .fold(0.0, f64::max);
            if off_m > OFF_LINE_M { Err(MotionError::OffLine { leg, off_m }) } else { Ok(trajectory) }
        };
        let [approach_site, grasp_site, lift_site] = &self.sites;
        let [free, loaded] = &self.limits;
        Ok(ArmMotion {
            transfer,
            approach: timed(Leg::Approach, &posed.approach, free, approach_site, grasp_site)?,
            lift: timed(Leg::Lift, &posed.lift, loaded, grasp_site, lift_site)?,
        })
    }
}

/// The failure of the configuration that came farthest; of several, the first one's.
struct Failures(Option<MotionError>);

impl Failures {
    fn note(&mut self, failure: MotionError) {
        let stage = |failure: &MotionError| match failure {
            MotionError::StartOutsideLimits { .. }
            | MotionError::StartCollides(_)
            | MotionError::Unreachable
            | MotionError::TooHeavy { .. } => 0,
            MotionError::NoLine { .. } => 1,
            MotionError::Collides { leg: Leg::Approach | Leg::Lift, .. } => 2,
            MotionError::NoWay(_) => 3,
            MotionError::Collides { leg: Leg::Transfer, .. } => 4,
            MotionError::OffLine { .. } | MotionError::Timing(_) => 5,
        };
        if self.0.as_ref().is_none_or(|before| stage(&failure) > stage(before)) {
            self.0 = Some(failure);
        }
    }
}
