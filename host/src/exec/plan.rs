//! What is to be done, and how fast.

use hand_model::HandAngles;
use nalgebra::Isometry3;

use crate::link::ThumbLaw;

/// Where the palm goes and what the hand does. Poses are `base_from_palm`.
#[derive(Debug, Clone, PartialEq)]
pub struct ExecutionPlan {
    /// Clear of the object; the execution starts here.
    pub approach_site: Isometry3<f64>,
    /// Where the fingers close; reached from the approach site in a straight line.
    pub grasp_site: Isometry3<f64>,
    /// Open hand on the way in.
    pub pregrasp: HandAngles<f64>,
    /// Fingertips on the surface.
    pub grasp: HandAngles<f64>,
    /// Targets beyond the surface that make the grip; see [`squeeze_targets`](super::squeeze_targets).
    pub squeeze: HandAngles<f64>,
    /// Friction that the plan counts on.
    pub friction: f64,
    /// The thumb's law from the grasp on.
    pub thumb: ThumbLaw,
}

/// Times, speeds and thresholds of an execution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExecutionSettings {
    /// Period of commands.
    pub period_s: f64,
    /// Mean speed of the palm from the approach site to the grasp site.
    pub advance_speed_m_per_s: f64,
    /// Time in which all fingers close; the fingertips arrive at rest.
    pub close_s: f64,
    /// Time in which the grip grows.
    pub squeeze_s: f64,
    /// How far to lift.
    pub lift_m: f64,
    /// Time to lift.
    pub lift_s: f64,
    /// Time to hold before the verdict.
    pub hold_s: f64,
    /// Largest multiple of the planned grip that the slip reflex may ask for.
    pub reflex_max: f64,
    /// Share of the planned grip that the slip reflex adds in a second of slipping.
    pub reflex_rate_per_s: f64,
    /// How far an object may move before the fingers have closed, or within the grip until the end.
    pub displacement_max_m: f64,
    /// Time between samples of the trace.
    pub trace_period_s: f64,
}

impl Default for ExecutionSettings {
    fn default() -> Self {
        Self {
            period_s: 1e-3,
            advance_speed_m_per_s: 0.08,
            close_s: 1.0,
            squeeze_s: 0.5,
            lift_m: 0.1,
            lift_s: 1.5,
            hold_s: 1.0,
            reflex_max: 2.0,
            reflex_rate_per_s: 5.0,
            displacement_max_m: 0.015,
            trace_period_s: 0.02,
        }
    }
}
