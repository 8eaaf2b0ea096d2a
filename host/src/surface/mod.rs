//! From points to a surface: the [`PointCloud`] and [`Mesh`] types and Hoppe's reconstruction between them.
pub mod cloud;
pub mod mesh;

pub use cloud::{CloudError, PointCloud};
pub use mesh::{Mesh, MeshError};
