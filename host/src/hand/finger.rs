//! A finger: a chain of joints from the palm to the tip, and balls along it.
//!
//! Balls, because the distance from a mesh to a ball is one nearest-point query, and because the direction from a ball's
//! centre to the touched point is a contact normal that averages the facets' noise over the ball's radius.

use nalgebra::{IsometryMatrix3, Matrix3, Point3, Rotation3, SMatrix, Translation3, Unit, Vector3};

use super::posture::Posture;

/// Most joints between the palm and a fingertip, mimicking ones counted.
pub const MAX_SEGMENTS: usize = 8;

/// Most balls of a finger.
pub const MAX_BEADS: usize = 48;

/// How a segment moves in the one before it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Motion {
    /// It turns about its axis.
    Turning,
    /// It slides along its axis.
    Sliding,
}

/// One joint of the chain and the rigid part behind it.
#[derive(Debug, Clone, PartialEq)]
pub struct Segment {
    /// Name of the link behind the joint.
    pub link: String,
    /// Which independent joint moves it.
    pub joint: usize,
    /// Its angle is `multiplier * posture[joint] + offset_rad`: 1 and 0 for the joint itself, others for one that mimics.
    pub multiplier: f64,
    /// See [`Segment::multiplier`]; metres for a sliding joint.
    pub offset_rad: f64,
    motion: Motion,
    axis: Unit<Vector3<f64>>,
    parent_from_segment: IsometryMatrix3<f64>,
    /// `R sin + R K (1 - cos)` of Rodrigues' formula with the fixed rotation multiplied in: `R K` and `R K^2`.
    first_order: Matrix3<f64>,
    second_order: Matrix3<f64>,
}

impl Segment {
    /// A segment whose frame, at angle 0, stands at `parent_from_segment` in the frame of the one before it (of the palm
    /// for the first), and turns about or slides along `axis`, which is in its own frame.
    #[must_use]
    pub fn new(
        link: String,
        parent_from_segment: IsometryMatrix3<f64>,
        axis: Unit<Vector3<f64>>,
        motion: Motion,
        joint: usize,
        [multiplier, offset_rad]: [f64; 2],
    ) -> Self {
        let fixed = parent_from_segment.rotation.into_inner();
        let k = axis.cross_matrix();
        Self {
            link,
            joint,
            multiplier,
            offset_rad,
            motion,
            axis,
            parent_from_segment,
            first_order: fixed * k,
            second_order: fixed * k * k,
        }
    }

    /// Turning or sliding.
    #[must_use]
    pub fn motion(&self) -> Motion {
        self.motion
    }

    /// Axis of the joint in the segment's frame.
    #[must_use]
    pub fn axis(&self) -> Unit<Vector3<f64>> {
        self.axis
    }

    /// Pose at angle 0 in the frame of the segment before.
    #[must_use]
    pub fn parent_from_segment(&self) -> &IsometryMatrix3<f64> {
        &self.parent_from_segment
    }

    fn pose(&self, posture: &Posture) -> IsometryMatrix3<f64> {
        let angle = self.multiplier * posture[self.joint] + self.offset_rad;
        match self.motion {
            Motion::Turning => {
                let (sin, cos) = angle.sin_cos();
                let rotation = self.parent_from_segment.rotation.matrix()
                    + self.first_order * sin
                    + self.second_order * (1.0 - cos);
                IsometryMatrix3::from_parts(
                    self.parent_from_segment.translation,
                    Rotation3::from_matrix_unchecked(rotation),
                )
            }
            Motion::Sliding => self.parent_from_segment * Translation3::from(self.axis.into_inner() * angle),
        }
    }
}

/// What a ball belongs to, as a grasp judges it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Part {
    /// A link before the last one.
    Inner,
    /// The last link, up to the tip: its pad is made for touching.
    Distal,
    /// The fingertip.
    Tip,
}

/// One ball of a finger's chain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bead {
    /// Index of the segment that carries it.
    pub segment: usize,
    /// What it belongs to.
    pub part: Part,
    /// Its centre in the segment's frame.
    pub center_in_segment: Point3<f64>,
    /// Radius, metres.
    pub radius_m: f64,
}

/// Poses of a finger's segments in the palm frame.
#[derive(Debug, Clone, Copy)]
pub struct Frames([IsometryMatrix3<f64>; MAX_SEGMENTS]);

impl Default for Frames {
    fn default() -> Self {
        Self([IsometryMatrix3::identity(); MAX_SEGMENTS])
    }
}

impl Frames {
    /// Pose of one segment in the palm frame.
    #[must_use]
    pub fn palm_from_segment(&self, segment: usize) -> &IsometryMatrix3<f64> {
        &self.0[segment]
    }
}

/// A finger from the palm to its tip.
#[derive(Debug, Clone, PartialEq)]
pub struct Finger {
    /// Name, as in the plan document.
    pub name: String,
    segments: Vec<Segment>,
    beads: Vec<Bead>,
    /// For each bead and segment: no point of the bead's way is farther from the segment's joint, metres.
    levers_m: Vec<[f64; MAX_SEGMENTS]>,
    /// Distinct independent joints that move it, from the palm on.
    joints: Vec<usize>,
    /// Centre of the tip's ball, last segment's frame.
    tip_in_last: Point3<f64>,
    tip_radius_m: f64,
    /// Direction out of the pad at the tip, last segment's frame.
    pad_in_last: Unit<Vector3<f64>>,
}

/// Why parts do not make a finger.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FingerError {
    /// No joint moves it, or more than [`MAX_SEGMENTS`].
    #[error("finger {name} has {count} joint(s), not 1 to {MAX_SEGMENTS}")]
    Segments {
        /// Of the finger.
        name: String,
        /// Joints between palm and tip.
        count: usize,
    },
    /// No ball, or more than [`MAX_BEADS`].
    #[error("finger {name} has {count} ball(s), not 1 to {MAX_BEADS}")]
    Beads {
        /// Of the finger.
        name: String,
        /// Balls.
        count: usize,
    },
    /// The last segment has no ball that is its tip.
    #[error("finger {name} has no fingertip on its last link")]
    NoTip {
        /// Of the finger.
        name: String,
    },
}

impl Finger {
    /// Joins segments (palm first) and beads (root first, the tip's last). The tip is the last bead with [`Part::Tip`].
    ///
    /// # Errors
    /// [`FingerError`] when a count is out of range or there is no tip.
    pub fn new(
        name: String,
        segments: Vec<Segment>,
        beads: Vec<Bead>,
        pad_in_last: Unit<Vector3<f64>>,
        joint_limits: impl Fn(usize) -> [f64; 2],
    ) -> Result<Self, FingerError> {
        if segments.is_empty() || segments.len() > MAX_SEGMENTS {
            return Err(FingerError::Segments { name, count: segments.len() });
        }
        if beads.is_empty() || beads.len() > MAX_BEADS || beads.iter().any(|b| b.segment >= segments.len()) {
            return Err(FingerError::Beads { name, count: beads.len() });
        }
        let last = segments.len() - 1;
        let tip = beads.iter().rev().find(|b| b.part == Part::Tip && b.segment == last).copied();
        let Some(tip) = tip else { return Err(FingerError::NoTip { name }) };
        let mut joints = Vec::new();
        for segment in &segments {
            if !joints.contains(&segment.joint) {
                joints.push(segment.joint);
            }
        }
        let slide_m = |segment: &Segment| match segment.motion {
            Motion::Turning => 0.0,
            Motion::Sliding => {
                let [lower, upper] = joint_limits(segment.joint);
                segment.multiplier.abs() * lower.abs().max(upper.abs()) + segment.offset_rad.abs()
            }
        };
        let levers_m = beads
            .iter()
            .map(|bead| {
                let mut levers = [0.0; MAX_SEGMENTS];
                let mut beyond_m = bead.center_in_segment.coords.norm();
                for index in (0..=bead.segment).rev() {
                    levers[index] = match segments[index].motion {
                        Motion::Turning => beyond_m,
                        Motion::Sliding => 1.0,
                    };
                    beyond_m += segments[index].parent_from_segment.translation.vector.norm()
                        + slide_m(&segments[index]);
                }
                levers
            })
            .collect();
        Ok(Self {
            name,
            levers_m,
            joints,
            tip_in_last: tip.center_in_segment,
            tip_radius_m: tip.radius_m,
            pad_in_last,
            segments,
            beads,
        })
    }

    /// The same finger with another direction out of the pad, last segment's frame.
    #[must_use]
    pub fn with_pad(self, pad_in_last: Unit<Vector3<f64>>) -> Self {
        Self { pad_in_last, ..self }
    }

    /// Joints and rigid parts, palm first.
    #[must_use]
    pub fn segments(&self) -> &[Segment] {
        &self.segments
    }

    /// Balls, root first.
    #[must_use]
    pub fn beads(&self) -> &[Bead] {
        &self.beads
    }

    /// Independent joints that move this finger, from the palm on.
    #[must_use]
    pub fn joints(&self) -> &[usize] {
        &self.joints
    }

    /// Radius of the tip's ball, metres.
    #[must_use]
    pub fn tip_radius_m(&self) -> f64 {
        self.tip_radius_m
    }

    /// Centre of the tip's ball in the last segment's frame.
    #[must_use]
    pub fn tip_in_last(&self) -> Point3<f64> {
        self.tip_in_last
    }

    /// Direction out of the pad at the tip, in the last segment's frame.
    #[must_use]
    pub fn pad_in_last(&self) -> Unit<Vector3<f64>> {
        self.pad_in_last
    }

    /// Name of the link that carries a bead.
    #[must_use]
    pub fn link_of(&self, bead: &Bead) -> &str {
        &self.segments[bead.segment].link
    }

    /// Poses of all segments in the palm frame.
    #[must_use]
    pub fn frames(&self, posture: &Posture) -> Frames {
        let mut frames = Frames::default();
        let mut palm_from_parent = IsometryMatrix3::identity();
        for (frame, segment) in frames.0.iter_mut().zip(&self.segments) {
            palm_from_parent *= segment.pose(posture);
            *frame = palm_from_parent;
        }
        frames
    }

    /// Centre of the tip's ball in the palm frame.
    #[must_use]
    pub fn tip_in_palm(&self, frames: &Frames) -> Point3<f64> {
        frames.0[self.segments.len() - 1] * self.tip_in_last
    }

    /// Direction out of the pad in the palm frame.
    #[must_use]
    pub fn pad_in_palm(&self, frames: &Frames) -> Unit<Vector3<f64>> {
        frames.0[self.segments.len() - 1] * self.pad_in_last
    }

    /// Centres of the beads in the palm frame, in their order, into `centers`.
    pub fn bead_centers(&self, posture: &Posture, centers: &mut Vec<Point3<f64>>) {
        let frames = self.frames(posture);
        centers.clear();
        centers.extend(self.beads.iter().map(|bead| frames.0[bead.segment] * bead.center_in_segment));
    }

    /// A speed that no point of the bead exceeds while the joints move at `rate` per unit of time, metres per unit.
    #[must_use]
    pub fn bead_speed_bound_m(&self, bead: usize, rate: &Posture) -> f64 {
        self.segments
            .iter()
            .zip(&self.levers_m[bead])
            .map(|(segment, lever)| (segment.multiplier * rate[segment.joint]).abs() * lever)
            .sum()
    }

    /// How a point that is fixed to `segment` and stands at `point_in_palm` moves with the finger's joints: 3 x n,
    /// columns in the order of [`Finger::joints`], m/rad, palm frame.
    #[must_use]
    pub fn point_jacobian(
        &self,
        frames: &Frames,
        segment: usize,
        point_in_palm: &Point3<f64>,
    ) -> SMatrix<f64, 3, MAX_SEGMENTS> {
        let mut jacobian = SMatrix::<f64, 3, MAX_SEGMENTS>::zeros();
        for (frame, moving) in frames.0.iter().zip(&self.segments).take(segment + 1) {
            let axis_in_palm = frame.rotation * moving.axis;
            let motion = match moving.motion {
                Motion::Turning => axis_in_palm.cross(&(point_in_palm.coords - frame.translation.vector)),
                Motion::Sliding => axis_in_palm.into_inner(),
            };
            if let Some(column) = self.joints.iter().position(|&joint| joint == moving.joint) {
                let mut slot = jacobian.column_mut(column);
                slot += motion * moving.multiplier;
            }
        }
        jacobian
    }
}
