//! What stands between a command and a torque: the state machine of the drives, the tiers of bus loss, the plausibility
//! of sensors, limits of the target, overruns and check-ins, the first fault and the black box.
//!
//! Every part is a configuration, a state and a `step`, without I/O and without a clock. [`Supervisor`] puts them together.

pub mod bus;
pub mod drive;
pub mod recorder;
pub mod sensors;
mod supervisor;
pub mod target;
pub mod watch;

pub use supervisor::{Config, Cycle, Found, Mode, Supervisor};
