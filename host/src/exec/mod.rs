//! From a plan to a held object: motion of palm and fingers, grip, slip reflex, verdict.
//!
//! Knows the hand only through [`Link`](crate::link::Link), so the same code drives the simulated hand and the real one.
mod grip;
mod monitor;
mod profile;
mod run;

pub use grip::{GripContact, GripError, GripStiffness, balanced_forces, squeeze_targets};
pub use monitor::{FeltContact, Monitor, MonitorConfig, Touch, felt_contact};
pub use profile::{Progress, rest_to_rest};
pub use run::{
    Event, EventKind, Execution, ExecutionError, ExecutionPlan, ExecutionSettings, Phase, TraceSample,
    Verdict, execute,
};
