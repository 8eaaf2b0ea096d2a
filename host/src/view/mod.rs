//! Pictures: a small software renderer and the scene of a grasp.
pub mod picture;
pub mod raster;
