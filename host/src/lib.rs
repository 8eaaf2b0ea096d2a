//! Scanning, surfacing, grasp planning and execution.
//!
//! Data flows one way: scan -> surface -> grasp/plan -> exec -> link. `twin` is the only module that may import the
//! firmware library; see `docs/architecture.md` for the arrows and `docs/conventions.md` for frames and units.

#[cfg(all(feature = "twin", feature = "serve"))]
pub mod cli;
pub mod exec;
pub mod export;
pub mod grasp;
pub mod hand;
pub mod io;
pub mod link;
pub mod object;
pub mod plan;
pub mod record;
pub mod scan;
#[cfg(feature = "serve")]
pub mod serve;
pub mod surface;
#[cfg(feature = "twin")]
pub mod twin;
pub mod view;
