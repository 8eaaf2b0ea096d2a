//! A typical grasp of a hand: which fingers close, how they stand before and how they move.

use super::Joint;
use super::posture::{MAX_FINGERS, Posture};

/// How the used fingers touch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ContactKind {
    /// Point contact with friction, as the 2005 system assumes.
    Hard,
    /// Soft finger: friction resists torsion about the normal too. Two point contacts can turn about the line through
    /// them, so grasps with two fingers are force closure only with this.
    Soft,
}

/// One typical grasp: which fingers, how they are spread and shaped before they close.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// Name, as in the plan document.
    pub name: String,
    /// Which fingers close, by index.
    pub uses: [bool; MAX_FINGERS],
    /// The finger that the others close against: one of the used ones.
    pub opposing: usize,
    /// The hand open: closing fraction 0.
    pub open: Posture,
    /// Change per unit of closing fraction; 1 is the preshape, and closing goes on beyond it.
    pub closing: Posture,
    /// Direction across the closing fingers, palm frame: the y axis of the grasp frame as far as the fingers let it.
    pub lateral_in_palm: nalgebra::Unit<nalgebra::Vector3<f64>>,
    /// For hands that close towards one point, as on a ball or a rim: where the tips are to stand around it, as angles
    /// from the opposing finger's direction towards `lateral_in_palm`, rad, by finger. The fingers spread as near to
    /// these as their joints let them. `None` for hands that close in parallel, as on a bar.
    pub around_rad: Option<[f64; MAX_FINGERS]>,
    /// Contact model.
    pub contact: ContactKind,
    /// A power grasp: the palm presses and the fingers wrap around, links touching as well as tips.
    pub wraps: bool,
}

impl Candidate {
    /// Indices of the used fingers.
    pub fn fingers(&self) -> impl Iterator<Item = usize> + '_ {
        self.uses.iter().enumerate().filter(|(_, used)| **used).map(|(finger, _)| finger)
    }

    /// Number of fingers that close.
    #[must_use]
    pub fn finger_count(&self) -> usize {
        self.fingers().count()
    }

    /// The hand at closing fraction `s`, every joint stopping at its limits.
    #[must_use]
    pub fn posture_at(&self, joints: &[Joint], s: f64) -> Posture {
        let mut posture = self.open + self.closing * s;
        for (i, joint) in joints.iter().enumerate() {
            posture[i] = posture[i].clamp(joint.lower_rad, joint.upper_rad);
        }
        posture
    }
}
