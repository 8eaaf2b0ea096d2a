//! The arm's bodies as capsules, for somebody else's collision checker.

use nalgebra::Point3;

use super::Arm;

/// All points within `radius_m` of a line segment that is fixed in a link.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinkCapsule {
    /// 0: the base, whose frame is `base`; 1 to 6: the link behind that axis, whose frame is
    /// `arm.link_frames(q)[link - 1]`.
    pub link: usize,
    /// One end of the segment, in the link's frame, metres.
    pub from: Point3<f64>,
    /// The other end.
    pub to: Point3<f64>,
    /// Radius.
    pub radius_m: f64,
}

impl Arm {
    /// Bodies of the arm, ordered by link. Neighbouring links overlap at their joint, and the base stands in the
    /// mounting plane: leave those pairs out of a check. The hand and its adapter plate are not included.
    #[must_use]
    pub fn link_capsules(&self) -> &[LinkCapsule] {
        &self.params.capsules
    }
}
