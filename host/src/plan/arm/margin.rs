//! How far a configuration is from joint limits and singularities.

use super::{Arm, Joints};

/// Distances of a configuration from what an arm should keep away from; each is 0 or below at it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Margin {
    /// Least distance of a joint from its nearer limit, rad; negative outside.
    pub limit_rad: f64,
    /// |sin| of the wrist's bend: 0 where axes 4 and 6 are in line.
    pub wrist: f64,
    /// |sin| of the elbow's bend: 0 where the arm is stretched or folded.
    pub elbow: f64,
    /// Distance of the wrist centre from the cylinder about axis 1 that the arm's plane touches, as a share of the arm's
    /// length.
    pub shoulder: f64,
}

impl Margin {
    /// The worse of each of two margins.
    #[must_use]
    pub fn min(self, other: Self) -> Self {
        Self {
            limit_rad: self.limit_rad.min(other.limit_rad),
            wrist: self.wrist.min(other.wrist),
            elbow: self.elbow.min(other.elbow),
            shoulder: self.shoulder.min(other.shoulder),
        }
    }
}

impl Arm {
    /// Margins of a configuration.
    #[must_use]
    pub fn margin(&self, q_rad: &Joints) -> Margin {
        let (g, limits) = (&self.params.geometry, &self.params.limits);
        let theta = g.theta_from_joints(q_rad);
        let limit_rad = (0..6)
            .map(|i| (q_rad[i] - limits.lower_rad[i]).min(limits.upper_rad[i] - q_rad[i]))
            .fold(f64::INFINITY, f64::min);
        let (lean, forearm_m) = (g.a2_m.atan2(g.c3_m), g.forearm_m());
        let forward_m = g.a1_m + g.c2_m * theta[1].sin() + forearm_m * (theta[1] + theta[2] + lean).sin();
        Margin {
            limit_rad,
            wrist: theta[4].sin().abs(),
            elbow: (theta[2] + lean).sin().abs(),
            shoulder: forward_m.abs() / (g.c2_m + forearm_m),
        }
    }
}
