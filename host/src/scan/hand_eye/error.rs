//! Why there is no mount.

use thiserror::Error;

use super::WeakDirection;

/// Why a hand-eye calibration gives no mount.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum HandEyeError {
    /// A pose or a point that is no finite number, or a radius that is none above 0.
    #[error("profile {profile}: a pose or a point is not a finite number")]
    NotFinite {
        /// Place in the list, from 0.
        profile: usize,
    },
    /// A radius that no sphere has.
    #[error("a sphere's radius must be above 0, not {radius_m} m")]
    NoRadius {
        /// The radius.
        radius_m: f64,
    },
    /// A profile of a target that is not in the list.
    #[error("profile {profile} is of target {target}, which there is not")]
    UnknownTarget {
        /// Place in the list of profiles, from 0.
        profile: usize,
        /// Its target.
        target: usize,
    },
    /// No circle was found in any profile of a sphere.
    #[error("target {target}: no profile shows an arc of the sphere")]
    NoSphere {
        /// Place in the list of targets, from 0.
        target: usize,
    },
    /// A target that too few sweeps saw.
    #[error("target {target}: seen in {found} sweep(s) or single poses, at least {needed} are needed")]
    TooFewPoses {
        /// Place in the list of targets, from 0.
        target: usize,
        /// Sweeps that see it.
        found: usize,
        /// How many there have to be.
        needed: usize,
    },
    /// The palm was hardly turned, or about one axis only.
    #[error(
        "the palm was turned by only {spread_deg:.1} deg (rms) about axes other than its ({:.2}, {:.2}, {:.2}): the \
         mount's place along that axis cannot be told; add sweeps with the palm turned about other axes",
        .axis[0], .axis[1], .axis[2]
    )]
    NoRotation {
        /// Axis of the palm about which alone it turned; where it did not turn at all, one of all.
        axis: [f64; 3],
        /// Root mean square of the turns about axes at right angles to it.
        spread_deg: f64,
    },
    /// The places of the spheres in the scanner's field lie on a line.
    #[error(
        "the ball's places in the scanner's field lie on a line (within {:.2} mm rms): a mount that is turned about it \
         fits as well; add sweeps with the ball nearer, farther, and to either side",
        .spread_m * 1e3
    )]
    OnALine {
        /// Root mean square distance of the circles' centres from the line, in the laser plane.
        spread_m: f64,
    },
    /// Planes do not tell a mount from scratch.
    #[error("no sphere among the targets: planes alone need a mount to start from")]
    NoStart,
    /// Some motion of the mount changes nothing that was measured.
    #[error("the poses leave the mount undetermined (condition {condition:.0}): {direction}")]
    Undetermined {
        /// Of the mount, worst over best determined direction.
        condition: f64,
        /// The motion, and what would determine it.
        direction: WeakDirection,
    },
    /// Poses and profiles do not belong together.
    #[error(
        "poses and profiles do not fit together: points are typically {:.2} mm off the targets, and {:.0} % far off; is \
         it the right arm, did the target move, do the clocks agree?",
        .noise_m * 1e3, .outlier_share * 1e2
    )]
    Inconsistent {
        /// Robust standard deviation of the points' distances from the targets.
        noise_m: f64,
        /// Share of points that are beyond all noise.
        outlier_share: f64,
    },
    /// The sphere is not as large as was said.
    #[error(
        "target {target}: the radius is {:.3} +- {:.3} mm by the profiles, not {:.3} mm as given",
        .found_m * 1e3, .std_m * 1e3, .given_m * 1e3
    )]
    WrongRadius {
        /// Place in the list of targets, from 0.
        target: usize,
        /// As it was given.
        given_m: f64,
        /// As the profiles say.
        found_m: f64,
        /// Standard deviation of that.
        std_m: f64,
    },
}
