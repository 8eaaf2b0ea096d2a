//! Scanning: a laser stripe, two cameras, and an arm that sweeps them over the object.
pub mod calibrate;
pub mod capture;
mod cast;
pub mod clock_offset;
pub mod hand_eye;
pub mod instrument;
pub mod joints;
mod levenberg;
mod mount;
pub mod next_sweep;
pub mod optics;
pub mod profile;
pub mod recording;
pub mod render;
pub mod rig;
pub mod stripe;
pub mod sweep;
pub mod unseen;
pub mod virtual_capture;
pub mod virtual_scan;

pub use instrument::{Camera, Instrument};
pub use mount::palm_from_scanner;
pub use sweep::{StripePose, Sweep, SweepPlan, SweepSettings, plan_sweeps, target_sphere};
pub use virtual_scan::{Scan, ScanError, scan};
