//! What is to be done, and how fast.

use hand_model::HandAngles;
use nalgebra::Isometry3;

use crate::link::ThumbLaw;

/// Where the palm goes and what the hand does. Poses are `base_from_palm`.
#[derive(Debug, Clone, PartialEq)]
pub struct ExecutionPlan {
    /// Clear of the object; the execution starts and ends here.
    pub approach_site: Isometry3<f64>,
    /// Where the fingers close; reached from the approach site in a straight line.
    pub grasp_site: Isometry3<f64>,
    /// Open hand on the way in and out.
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

/// How the fingers go from open to touching.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Closing {
    /// All arrive together and softly, on Paul's quartics: the paper's cure for fingers that push the object away.
    Together,
    /// Each joint at once at this speed, rad/s, and no further when it is there: what the cure was needed for.
    EachAtSpeed(f64),
}

/// Times, speeds and thresholds of an execution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExecutionSettings {
    /// Period of commands.
    pub period_s: f64,
    /// Mean speed of the palm from the approach site to the grasp site and back.
    pub advance_speed_m_per_s: f64,
    /// Time in which all fingers close, and later open; the fingertips arrive at rest.
    pub close_s: f64,
    /// How they close.
    pub closing: Closing,
    /// Time in which the grip grows, and later ends.
    pub squeeze_s: f64,
    /// How far to lift.
    pub lift_m: f64,
    /// Time to lift, and to lower.
    pub lift_s: f64,
    /// Time to hold.
    pub hold_s: f64,
    /// Greatest acceleration of the shake along each axis; 0 for none. See [`shake_offset_m`](super::shake_offset_m).
    pub shake_m_per_s2: f64,
    /// Time of the shake in each of its six directions.
    pub shake_s: f64,
    /// Greatest deceleration of the palm when the course is left.
    pub stop_m_per_s2: f64,
    /// Largest multiple of the planned grip that the slip reflex may ask for.
    pub reflex_max: f64,
    /// Share of the planned grip that the slip reflex adds in a second of slipping.
    pub reflex_rate_per_s: f64,
    /// How long fewer than two fingers may be firm, while others slip at the tightest grip, before the object is put down.
    pub slip_max_s: f64,
    /// How long fewer than two fingers may feel the object before it counts as lost.
    pub lost_s: f64,
    /// How far an object may move before the fingers have closed, or within the grip, or stand from where it stood.
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
            closing: Closing::Together,
            squeeze_s: 0.5,
            lift_m: 0.1,
            lift_s: 1.5,
            hold_s: 3.0,
            shake_m_per_s2: 5.0,
            shake_s: 0.4,
            stop_m_per_s2: 10.0,
            reflex_max: 2.0,
            reflex_rate_per_s: 5.0,
            slip_max_s: 0.3,
            lost_s: 0.05,
            displacement_max_m: 0.015,
            trace_period_s: 0.02,
        }
    }
}
