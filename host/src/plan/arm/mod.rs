//! Kinematics of six-axis arms with an ortho-parallel basis and a spherical wrist.
//!
//! "Ortho-parallel": axis 2 is perpendicular to axis 1, axis 3 is parallel to axis 2, and axes 4, 5 and 6 meet in one
//! point, the wrist centre. Almost every industrial six-axis arm is built like this, and seven lengths describe it
//! (Brandstötter, Angerer, Hofbaur, "An Analytical Solution of the Inverse Kinematics Problem of Industrial Serial
//! Manipulators with an Ortho-parallel Basis and a Spherical Wrist", 2014). [`Arm::rx60`] is the built-in one.
//!
//! Frames: `base` has its z axis along axis 1, `flange` is the mounting face of axis 6 with z pointing away from the
//! arm, and `palm` is the hand's own frame. All are parallel to each other when every joint angle is zero.
//!
//! Nothing here knows about time; see [`super::timing`].
mod collision;
pub mod distance;
mod file;
mod forward;
mod inverse;
mod limits;
mod line;
mod load;
mod margin;
mod params;
#[cfg(test)]
mod tests;

use nalgebra::Isometry3;
use thiserror::Error;

pub use collision::LinkCapsule;
pub use file::ArmFileError;
pub use inverse::{Branch, Elbow, Inverse, Shoulder, Solution, Solutions, Wrist};
pub use limits::{JointLimits, LimitCheck};
pub use line::{LineBlock, LineOutcome};
pub use load::{GRAVITY_M_PER_S2, LoadCheck, LoadMode, LoadQuantity, LoadRating, Payload};
pub use margin::Margin;
pub use params::{ArmParams, OpwGeometry};

/// Angles of axes 1 to 6, radians, in the manufacturer's counting.
pub type Joints = [f64; 6];

/// Why numbers do not describe an arm.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ArmError {
    /// A parameter is NaN or infinite.
    #[error("{name} is {value}, not a finite number")]
    NotFinite {
        /// Which parameter.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// A parameter that has to be greater than zero is not.
    #[error("{name} is {value}, but has to be greater than zero")]
    NotPositive {
        /// Which parameter.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// A sense of rotation is neither +1 nor -1.
    #[error("the sign of axis {axis} is {value}, but has to be 1 or -1")]
    Sign {
        /// 1 to 6.
        axis: usize,
        /// Its value.
        value: f64,
    },
    /// The rest posture is outside the joint limits.
    #[error("the rest posture has axis {axis} at {angle_rad} rad, outside its limits")]
    Rest {
        /// 1 to 6.
        axis: usize,
        /// Its angle.
        angle_rad: f64,
    },
    /// A collision capsule belongs to no link.
    #[error("a capsule belongs to link {link}, but links are 0 (the base) to 6")]
    CapsuleLink {
        /// Its link.
        link: usize,
    },
    /// The lower limit of an axis is not below the upper one.
    #[error("axis {axis} has its lower limit {lower_rad} rad at or above its upper limit {upper_rad} rad")]
    Limits {
        /// 1 to 6.
        axis: usize,
        /// Lower limit.
        lower_rad: f64,
        /// Upper limit.
        upper_rad: f64,
    },
}

/// An arm whose parameters have been checked, and where the hand sits on it.
#[derive(Debug, Clone, PartialEq)]
pub struct Arm {
    params: ArmParams,
    flange_from_palm: Isometry3<f64>,
    self_pairs: Vec<(usize, usize)>,
}

impl Arm {
    /// Checks the parameters. The palm frame is where [`Arm::rx60`] has it; see [`Arm::with_flange_from_palm`].
    pub fn new(params: ArmParams) -> Result<Self, ArmError> {
        params.check()?;
        Ok(Self::checked(params))
    }

    /// The Stäubli RX60 that carries the hand on an adapter plate 20 mm thick.
    #[must_use]
    pub fn rx60() -> Self {
        Self::checked(ArmParams::rx60())
    }

    fn checked(params: ArmParams) -> Self {
        let mut arm = Self { params, flange_from_palm: params::adapter_plate(), self_pairs: Vec::new() };
        arm.self_pairs = collision::self_pairs(&arm);
        arm
    }

    /// The same arm with the hand mounted elsewhere.
    #[must_use]
    pub fn with_flange_from_palm(self, flange_from_palm: Isometry3<f64>) -> Self {
        Self { flange_from_palm, ..self }
    }

    /// Whether the hand sits otherwise than on the built-in hand's adapter plate.
    #[must_use]
    pub fn has_own_mount(&self) -> bool {
        self.flange_from_palm != params::adapter_plate()
    }

    /// Lengths, limits, speeds and ratings.
    #[must_use]
    pub fn params(&self) -> &ArmParams {
        &self.params
    }

    /// Joint limits.
    #[must_use]
    pub fn limits(&self) -> &JointLimits {
        &self.params.limits
    }

    /// Pose of the palm frame in the flange frame.
    #[must_use]
    pub fn flange_from_palm(&self) -> Isometry3<f64> {
        self.flange_from_palm
    }
}
