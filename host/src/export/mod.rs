//! Plans, the hand and the arm in the formats of other programs.
//!
//! Every writer makes a whole file in memory, from values that were checked when they were read: the same input gives the
//! same bytes. Joint and link names are the same in all formats, so that a grasp list and a URDF fit together. Each
//! file's head says in a comment what its frames and units are.

pub mod inventor;
pub mod isaac;
pub mod mjcf;
pub mod moveit;
pub mod npz;
mod text;
mod tree;
pub mod urdf;

use hand_model::HandAngles;
use nalgebra::Isometry3;

use crate::plan::document::{DocumentError, GraspInfo, hand_angles};

/// A grasp of a plan document with its numbers checked.
#[derive(Debug, Clone, PartialEq)]
pub struct Grasp {
    /// From 1, the best; names the grasp in lists.
    pub number: usize,
    /// Lower bound of the grasp's epsilon.
    pub epsilon: f64,
    /// The palm in the object's frame where the fingers close.
    pub object_from_palm: Isometry3<f64>,
    /// The palm in the base frame where the straight way to the grasp begins.
    pub approach_site: Isometry3<f64>,
    /// The palm in the base frame where the fingers close.
    pub grasp_site: Isometry3<f64>,
    /// The palm in the base frame after the lift.
    pub lift_site: Isometry3<f64>,
    /// Fingers open.
    pub pregrasp: HandAngles<f64>,
    /// Fingers touching.
    pub grasp: HandAngles<f64>,
    /// Targets behind the surface.
    pub squeeze: HandAngles<f64>,
    /// Largest torsional friction of its contacts, metres; 0 when all of them are hard.
    pub torsional_m: f64,
}

impl Grasp {
    /// Reads the grasp that is `number`th in its plan, from 1. Errors when a pose or a joint angle is missing or no
    /// finite number.
    pub fn read(number: usize, info: &GraspInfo) -> Result<Self, DocumentError> {
        Ok(Self {
            number,
            epsilon: info.quality.epsilon,
            object_from_palm: info.object_from_palm.to_isometry("object_from_palm")?,
            approach_site: info.approach_site.to_isometry("approach_site")?,
            grasp_site: info.grasp_site.to_isometry("grasp_site")?,
            lift_site: info.lift_site.to_isometry("lift_site")?,
            pregrasp: hand_angles(&info.pregrasp, "pregrasp")?,
            grasp: hand_angles(&info.grasp, "grasp")?,
            squeeze: hand_angles(&info.squeeze, "squeeze")?,
            torsional_m: info.contacts.iter().map(|c| c.torsional_m).fold(0.0, f64::max),
        })
    }
}

#[cfg(test)]
mod tests;
