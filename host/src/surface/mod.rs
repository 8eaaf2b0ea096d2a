//! From points to a surface: the [`PointCloud`] and [`Mesh`] types and Hoppe's reconstruction between them.
#[cfg(test)]
mod camera;
mod carve;
mod close;
pub mod cloud;
mod contour;
pub mod decimate;
pub mod distance;
mod finish;
mod fragments;
pub mod grid;
mod holes;
pub mod mesh;
pub mod orient;
pub mod outlier;
pub mod provenance;
pub mod reconstruct;
pub mod register;
pub mod scene;
mod sharpen;
mod slivers;
pub mod survey;
mod symmetry;
pub mod table;
pub mod tangent;
pub mod thin;

pub use cloud::{CloudError, PointCloud};
pub use mesh::{Mesh, MeshError};
pub use provenance::Provenance;
pub use reconstruct::{Closing, ReconstructError, Reconstruction, Report, Settings, Table, reconstruct};
pub use register::{Registration, register};
pub use scene::{Pick, SceneObject};
pub use survey::Survey;
pub use table::Plane;
