//! What differs between boards. One file each; a build has one board, or none when the library runs on the host.

#[cfg(feature = "mps2-an386")]
pub mod mps2_an386;

#[cfg(feature = "_stm32")]
pub mod stm32;
#[cfg(feature = "stm32g474")]
pub mod stm32g474;
#[cfg(feature = "stm32h563")]
pub mod stm32h563;
