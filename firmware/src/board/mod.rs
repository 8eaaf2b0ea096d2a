//! What differs between boards. One file each; a build has one board, or none when the library runs on the host.

#[cfg(feature = "mps2-an386")]
pub mod mps2_an386;
