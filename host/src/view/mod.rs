//! Pictures: a small software renderer and the scene of a grasp; and the page that shows a plan in a browser.
pub mod picture;
pub mod raster;
pub mod report;
