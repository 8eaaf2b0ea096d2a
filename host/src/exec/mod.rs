//! From a plan to an object lifted, held, shaken and put down: motion of palm and fingers, grip, slip reflex, verdict.
//!
//! Knows the hand only through [`Link`](crate::link::Link), so the same code drives the simulated hand and the real one.
mod grip;
mod judge;
mod monitor;
mod motion;
mod outcome;
mod phase;
mod plan;
mod run;

pub use grip::{
    GripContact, GripError, GripStiffness, LEAST_TIP_SHARE, LinkPush, balanced_forces, joint_squeeze_targets,
    squeeze_targets, torque_share,
};
pub use monitor::{FeltContact, Monitor, MonitorConfig, Touch, felt_contact};
pub use motion::shake_offset_m;
pub use outcome::{Event, EventKind, Execution, TraceSample, Trouble, Verdict};
pub use phase::Phase;
pub use plan::{Closing, ExecutionPlan, ExecutionSettings};
pub use run::{ExecutionError, execute};
