//! From a plan to a held object: motion of palm and fingers, grip, slip reflex, verdict.
//!
//! Knows the hand only through [`Link`](crate::link::Link), so the same code drives the simulated hand and the real one.
mod grip;
mod monitor;
mod outcome;
mod plan;
mod run;

pub use grip::{
    GripContact, GripError, GripStiffness, LEAST_TIP_SHARE, LinkPush, balanced_forces, joint_squeeze_targets,
    squeeze_targets, torque_share,
};
pub use monitor::{FeltContact, Monitor, MonitorConfig, Touch, felt_contact};
pub use outcome::{Event, EventKind, Execution, Phase, TraceSample, Verdict};
pub use plan::{ExecutionPlan, ExecutionSettings};
pub use run::{ExecutionError, execute};
