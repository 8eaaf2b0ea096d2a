//! The arm's bodies as capsules, how far they move, and which of them could touch each other.

use nalgebra::{Isometry3, Point3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::distance::segment_to_segment_m;
use super::{Arm, Joints, params};

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

/// Configurations that are looked at to find the pairs of capsules that always overlap.
const SAMPLES: usize = 256;

impl LinkCapsule {
    /// The ends of its segment in the base frame, from [`Arm::link_frames`].
    #[must_use]
    pub fn ends_in_base(&self, link_frames: &[Isometry3<f64>; 6]) -> [Point3<f64>; 2] {
        match self.link.checked_sub(1).and_then(|frame| link_frames.get(frame)) {
            Some(frame) => [frame * self.from, frame * self.to],
            None => [self.from, self.to],
        }
    }
}

impl Arm {
    /// Bodies of the arm, ordered by link. Neighbouring links overlap at their joint, and the base stands in the
    /// mounting plane: leave those pairs out of a check. The hand and its adapter plate are not included.
    #[must_use]
    pub fn link_capsules(&self) -> &[LinkCapsule] {
        &self.params.capsules
    }

    /// Pairs of capsules (their numbers, lower link first) that must not overlap.
    ///
    /// Left out are neighbouring links, which share a joint, and pairs that overlap in every one of 256 configurations
    /// drawn over the joint limits: there capsules are fatter than the links, or links meet at a common point such as
    /// the wrist centre, and no motion of the joints could tell a collision from that.
    #[must_use]
    pub fn self_pairs(&self) -> &[(usize, usize)] {
        &self.self_pairs
    }

    /// Bounds of how far a point of a link that is at most `extent_m` from the link's frame moves per radian of each
    /// axis, metres: lengths of the links between, added. Link 6 is the flange and what is fixed to it.
    #[must_use]
    pub fn levers_m(&self, link: usize, extent_m: f64) -> Joints {
        let offsets = params::link_offsets(&self.params.geometry);
        std::array::from_fn(|axis| match axis < link {
            true => offsets[axis + 1..link].iter().map(|offset| offset.norm()).sum::<f64>() + extent_m,
            false => 0.0,
        })
    }
}

/// See [`Arm::self_pairs`].
pub(super) fn self_pairs(arm: &Arm) -> Vec<(usize, usize)> {
    let capsules = arm.link_capsules();
    let mut always: Vec<(usize, usize)> = (0..capsules.len())
        .flat_map(|i| (i + 1..capsules.len()).map(move |k| (i, k)))
        .map(|(i, k)| if capsules[i].link <= capsules[k].link { (i, k) } else { (k, i) })
        .filter(|&(i, k)| capsules[k].link > capsules[i].link + 1)
        .collect();
    let candidates = always.clone();
    let limits = arm.limits();
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    for _ in 0..SAMPLES {
        let q: Joints = std::array::from_fn(|i| rng.random_range(limits.lower_rad[i]..limits.upper_rad[i]));
        let frames = arm.link_frames(&q);
        always.retain(|&(i, k)| {
            let radii_m = capsules[i].radius_m + capsules[k].radius_m;
            let ends = [i, k].map(|c| capsules[c].ends_in_base(&frames));
            segment_to_segment_m(&ends[0], &ends[1]) < radii_m
        });
    }
    candidates.into_iter().filter(|pair| !always.contains(pair)).collect()
}
