//! From contacts to the quality of a grasp.
//!
//! [`contact`] says where fingers touch, [`friction`] what they may push there, [`wrench`] what that does to the object,
//! [`quality`] how well it holds, [`resistance`] what it does against one wrench and [`task`] against an ellipsoid of them,
//! [`convention`] what such a number means. [`document`] reads
//! contacts, [`report`] writes what was found.
pub mod contact;
pub mod convention;
pub mod document;
mod expand;
pub mod friction;
pub mod gradient;
mod polar;
mod polytope;
pub mod quality;
pub mod report;
pub mod resistance;
mod seen;
mod support;
pub mod task;
pub mod wrench;

pub use contact::{Contact, ContactError};
pub use convention::{
    Convention, ConventionError, NamedConvention, ObjectGeometry, Reproduction, Score, Yardstick,
};
pub use friction::{ConeModel, EdgeCount, EdgeCountError};
pub use gradient::{ContactGradient, ContactLipschitz, Slope, evaluate_with_gradient, lipschitz};
pub use quality::{
    Closure, ForceNorm, Limits, NoClosure, Norm, Quality, Separation, Settings, Workspace, evaluate,
    evaluate_above, evaluate_within,
};
pub use resistance::{Balance, ContactForce, Disturbance, DisturbanceError, Resistance, Unbalanced, resist};
pub use task::{Task, TaskClosure, TaskError, TaskQuality, evaluate_task};
pub use wrench::{GraspMap, WrenchBasis, WrenchReference, WrenchReferenceError};

#[cfg(test)]
mod tests;
