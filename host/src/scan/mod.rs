//! Scanning: a laser stripe, two cameras, and an arm that sweeps them over the object.
pub mod calibrate;
mod cast;
pub mod instrument;
mod mount;
pub mod optics;
pub mod render;
pub mod stripe;
pub mod sweep;
pub mod virtual_scan;

pub use instrument::{Camera, Instrument};
pub use mount::palm_from_scanner;
pub use sweep::{StripePose, Sweep, SweepPlan, SweepSettings, plan_sweeps, target_sphere};
pub use virtual_scan::{Scan, ScanError, scan};
