//! The record of an execution, as `prehend execute` writes it: what of it is plotted.

use serde::{Deserialize, Serialize};

/// An execution. Fields that are not plotted are not read.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunRecord {
    /// How it ended.
    pub verdict: String,
    /// How long it took, seconds.
    pub duration_s: f64,
    /// What happened, in order.
    pub events: Vec<RunEvent>,
    /// The course of it; empty in a summary.
    #[serde(default)]
    pub trace: Vec<RunSample>,
}

/// Something that happened.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunEvent {
    /// When, seconds.
    pub time_s: f64,
    /// What, in words.
    pub event: String,
}

/// The state at one time. What a record does not have stays empty, and the page says so.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunSample {
    /// When, seconds.
    pub time_s: f64,
    /// Force on each fingertip, newtons.
    #[serde(default)]
    pub tip_force_n: Vec<f64>,
    /// Torque of each joint, newton metres.
    #[serde(default)]
    pub joint_torque_nm: Vec<f64>,
    /// Tangential over normal force at each fingertip, divided by the friction coefficient: 1 is slip; null without
    /// contact.
    #[serde(default)]
    pub slip_ratio: Vec<Option<f64>>,
    /// Commanded joint angles, rad.
    #[serde(default)]
    pub commanded_rad: Vec<f64>,
    /// Measured joint angles, rad.
    #[serde(default)]
    pub measured_rad: Vec<f64>,
    /// Palm in the base frame, metres.
    #[serde(default)]
    pub palm_position: Option<[f64; 3]>,
    /// Object in the base frame, metres.
    #[serde(default)]
    pub object_position: Option<[f64; 3]>,
}
