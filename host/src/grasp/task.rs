//! Epsilon measured by an ellipsoid of expected disturbances instead of the ball.
//!
//! The ball counts a newton of force and a newton of torque / scale alike, in all directions. When it is known which
//! disturbances come, the largest multiple of their ellipsoid that the grasp withstands says more (Ch. Borst, M. Fischer
//! and G. Hirzinger, "Grasp planning: how to choose a suitable task wrench space", ICRA 2004). A linear change of
//! coordinates of wrench space makes the ellipsoid the ball again, and a load that always acts moves the origin; so it is
//! found as epsilon is. It does not depend on the torque scale.

use nalgebra::{Matrix6, Vector6};
use thiserror::Error;

use super::contact::Contact;
use super::expand::{self, Goal, Stop};
use super::quality::{Closure, Limits, Norm, Settings, Workspace, search};
use super::wrench::WrenchReference;

/// Numbers of an ellipsoid or a load that are accepted, N and N m.
const MAX_SIZE: f64 = 1e9;
const MIN_SIZE: f64 = 1e-9;

/// Why numbers are not a task.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum TaskError {
    /// A semi-axis is not between 1e-9 and 1e9.
    #[error("semi-axis {0} is not between {MIN_SIZE:e} and {MAX_SIZE:e} N or N m")]
    SemiAxis(f64),
    /// The matrix is not symmetric and positive definite, or not of ordinary size.
    #[error(
        "the matrix of the task is not symmetric and positive definite with semi-axes between 1e-9 and 1e9"
    )]
    Matrix,
    /// A component of the load is NaN, infinite or beyond 1e9.
    #[error("load component {0} is not within {MAX_SIZE:e} N or N m")]
    Load(f64),
}

/// Disturbances to expect: a load that always acts, and an ellipsoid of wrenches that may come on top.
///
/// Wrenches on the object, force in newtons then torque about the centre of mass in newton metres, object frame. With
/// [`Norm::L1`] they are what one newton of summed normal force is to bear.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Task {
    /// The ellipsoid is this times the unit ball: lower triangular.
    root: Matrix6<f64>,
    load: Vector6<f64>,
}

impl Task {
    /// An ellipsoid with its axes along those of wrench space: three forces in newtons, three torques in newton metres.
    pub fn from_semi_axes(semi_axes: [f64; 6]) -> Result<Self, TaskError> {
        if let Some(wrong) = semi_axes.into_iter().find(|axis| !(MIN_SIZE..=MAX_SIZE).contains(axis)) {
            return Err(TaskError::SemiAxis(wrong));
        }
        Ok(Self { root: Matrix6::from_diagonal(&semi_axes.into()), load: Vector6::zeros() })
    }

    /// The ellipsoid `w' matrix^-1 w <= 1`, as the covariance of the disturbances describes it.
    pub fn from_matrix(matrix: &Matrix6<f64>) -> Result<Self, TaskError> {
        let is_symmetric = (matrix - matrix.transpose()).amax() <= 1e-9 * matrix.amax();
        let root = matrix.cholesky().map(|cholesky| cholesky.l()).ok_or(TaskError::Matrix)?;
        let is_ordinary = root.diagonal().iter().all(|axis| (MIN_SIZE..=MAX_SIZE).contains(axis));
        if is_symmetric && is_ordinary && root.amax() <= MAX_SIZE {
            Ok(Self { root, load: Vector6::zeros() })
        } else {
            Err(TaskError::Matrix)
        }
    }

    /// The same with a load that always acts, such as the weight.
    pub fn with_load(self, load: Vector6<f64>) -> Result<Self, TaskError> {
        match load.iter().find(|x| x.is_nan() || x.abs() > MAX_SIZE) {
            Some(wrong) => Err(TaskError::Load(*wrong)),
            None => Ok(Self { load, ..self }),
        }
    }
}

/// How much of a task a grasp withstands, bracketed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TaskQuality {
    /// The load with the ellipsoid scaled by this is certainly within what the fingers exert. 1 is just the task.
    pub scale_low: f64,
    /// With any larger scale it is not.
    pub scale_high: f64,
    /// Unit wrench, force then torque / scale, along which the fingers have least to spare.
    pub weakest_wrench: Vector6<f64>,
    /// Support queries made.
    pub iterations: usize,
}

/// What an evaluation of a task finds; the cases are those of [`Closure`].
#[derive(Debug, Clone, Copy, PartialEq)]
#[must_use]
pub enum TaskClosure {
    /// The load and some of the ellipsoid is withstood, to the tolerance.
    Withstood(TaskQuality),
    /// Not even the load is, or nothing beside it.
    None {
        /// Unit wrench, force then torque / scale, along which the fingers do not reach farther than the load requires.
        direction: Vector6<f64>,
        /// Support queries made.
        iterations: usize,
    },
    /// The scale is below [`Limits::reject_below`].
    Below(TaskQuality),
    /// The scale is at least [`Limits::accept_above`].
    Above(TaskQuality),
    /// Iterations, facets or digits ran out; the bracket holds.
    Unfinished(TaskQuality),
}

impl TaskClosure {
    /// The bracket, where something is certainly withstood.
    #[must_use]
    pub fn quality(&self) -> Option<&TaskQuality> {
        match self {
            Self::Withstood(q) | Self::Below(q) | Self::Above(q) | Self::Unfinished(q) => {
                (q.scale_low > 0.0).then_some(q)
            }
            Self::None { .. } => None,
        }
    }
}

/// Measures a grasp by the disturbances of a task: the largest scale of its ellipsoid that is withstood besides its load.
///
/// With a load the grasp need not be force-closed. `limits` are limits of the scale.
pub fn evaluate_task(
    contacts: &[Contact],
    reference: &WrenchReference,
    settings: &Settings,
    task: &Task,
    limits: &Limits,
    workspace: &mut Workspace,
) -> TaskClosure {
    let scale = reference.torque_scale_m();
    let in_newtons =
        Matrix6::from_diagonal(&Vector6::new(1.0, 1.0, 1.0, 1.0 / scale, 1.0 / scale, 1.0 / scale));
    // The root has a positive diagonal, so there is an inverse; without digits there is no answer.
    let undecided = TaskQuality {
        scale_low: 0.0,
        scale_high: f64::INFINITY,
        weakest_wrench: Vector6::x(),
        iterations: 0,
    };
    let Some(to_ball) = (in_newtons * task.root).try_inverse() else {
        return TaskClosure::Unfinished(undecided);
    };
    let load = to_ball * (in_newtons * task.load);
    let back = to_ball.transpose();
    // A direction of the ball's space, as one of wrench space.
    let direction = |v: &Vector6<f64>| (back * v).normalize();
    workspace.map.assign(contacts, reference, settings.cone, settings.force_norm);
    workspace.map.transform(&to_ball);
    if load == Vector6::zeros() {
        let of = |q: super::quality::Quality| TaskQuality {
            scale_low: q.epsilon_low,
            scale_high: q.epsilon_high,
            weakest_wrench: direction(&q.weakest_wrench),
            iterations: q.iterations,
        };
        return match search(settings, limits, workspace) {
            Closure::Force(q) => TaskClosure::Withstood(of(q)),
            Closure::Below(q) => TaskClosure::Below(of(q)),
            Closure::Above(q) => TaskClosure::Above(of(q)),
            Closure::Unfinished(q) => TaskClosure::Unfinished(of(q)),
            Closure::None(proof) => {
                TaskClosure::None { direction: direction(&proof.direction), iterations: proof.iterations }
            }
        };
    }
    let Workspace { map, hulls } = workspace;
    let bound = map.bound(settings.norm) + load.norm();
    let goal = Goal {
        tolerance: settings.tolerance,
        reject_below: limits.reject_below,
        accept_above: limits.accept_above,
        max_queries: settings.max_iterations,
    };
    // Fingers may push less than all they can, so the origin belongs to the set; the sum of L-infinity has it already.
    let (stop, found) = expand::bracket(hulls, &load, bound, &goal, |u| {
        let farthest = map.farthest(u, settings.norm);
        if settings.norm == Norm::L1 && farthest.dot(u) < 0.0 { load } else { farthest + load }
    });
    let quality = TaskQuality {
        scale_low: found.low.max(0.0),
        scale_high: found.high,
        weakest_wrench: direction(&found.direction),
        iterations: found.queries,
    };
    match stop {
        Stop::Inside => TaskClosure::Withstood(quality),
        Stop::Below => TaskClosure::Below(quality),
        Stop::Above => TaskClosure::Above(quality),
        Stop::Unfinished => TaskClosure::Unfinished(quality),
        Stop::Outside => {
            TaskClosure::None { direction: quality.weakest_wrench, iterations: quality.iterations }
        }
    }
}
