//! A hand that finds its way by itself: straight segments of all joints, each with its own time, and transitions between
//! them, of one time for all joints, so that all fingers arrive together.
//!
//! ```text
//!             corner                      goal
//!   ---straight---\                        |
//!              blend \---straight---.      |
//!           2 half_us                 blend `-- rest
//! ```
//!
//! A blend begins half its time before a corner: there it is Paul's quartic. A segment that comes while the hand is coming to
//! rest, or that replaces those before it, begins at once with the quintic from the motion that there is. Position, velocity
//! and acceleration have no step in either case. Speeds keep to those of the straight pieces, but that a blend out of an
//! acceleration may go beyond them by a fifth of their change.

use protocol::ids::JOINT_COUNT;
use thiserror::Error;

use super::quintic::{Corner, Weights};
use super::tick::Target;
use super::transition::Motion;

/// Segments that may wait.
pub const QUEUE_LEN: usize = 8;
/// Longest segment: more would show in the last digits of the time within it.
const TIME_MAX_US: u32 = 60_000_000;

/// A straight way of all joints.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Segment {
    /// Where it ends.
    pub goal_rad: [f32; JOINT_COUNT],
    /// From the corner before it to its end; at least a blend.
    pub time_us: u32,
}

/// Why a segment is not taken. Nothing has changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum SegmentError {
    /// No room.
    #[error("{QUEUE_LEN} segments wait already")]
    Full,
    /// Shorter than a blend, longer than a minute, or faster than a joint may move.
    #[error("a segment is too short, too long or too fast")]
    Time,
}

/// How segments are followed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pace {
    /// Half the time of a blend; more than 0.
    pub half_us: u32,
    /// Largest speed of a straight piece.
    pub speed_max_rad_per_s: f32,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Piece {
    /// Still.
    Rest,
    /// To the speed of the segment under way, whose straight piece follows.
    Blend,
    /// To its end.
    Straight,
    /// Into rest.
    Stop,
}

/// The segments that wait, and the way that is under way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Segments {
    piece: Piece,
    /// The last corner of every joint; at rest where it stands.
    corners: [Corner; JOINT_COUNT],
    /// Where the segment under way ends, and how long it goes straight.
    goal_rad: [f32; JOINT_COUNT],
    straight_us: u32,
    /// Time of this piece, and how much of it has passed.
    time_us: u32,
    passed_us: u32,
    /// From the corner to the beginning of a straight piece.
    half_us: u32,
    queue: [Segment; QUEUE_LEN],
    first: usize,
    waiting: usize,
}

impl Segments {
    /// At rest.
    #[must_use]
    pub fn at_rest(position_rad: &[f32; JOINT_COUNT]) -> Self {
        let mut segments = Self {
            piece: Piece::Rest,
            corners: [Corner::default(); JOINT_COUNT],
            goal_rad: [0.0; JOINT_COUNT],
            straight_us: 0,
            time_us: 0,
            passed_us: 0,
            half_us: 0,
            queue: [Segment { goal_rad: [0.0; JOINT_COUNT], time_us: 0 }; QUEUE_LEN],
            first: 0,
            waiting: 0,
        };
        segments.rest(position_rad);
        segments
    }

    /// Forgets all segments, here.
    pub fn rest(&mut self, position_rad: &[f32; JOINT_COUNT]) {
        self.waiting = 0;
        self.goal_rad = *position_rad;
        self.settle();
    }

    /// Stands at the goal.
    fn settle(&mut self) {
        self.begin(Piece::Rest, u32::MAX);
        for (corner, &position_rad) in self.corners.iter_mut().zip(&self.goal_rad) {
            *corner = Corner { position_rad, ..Corner::default() };
        }
    }

    /// A segment behind those that wait, or instead of them and of the one under way.
    ///
    /// # Errors
    ///
    /// [`SegmentError`]; then all is as before.
    #[inline(never)]
    pub fn add(&mut self, segment: &Segment, replaces: bool, pace: &Pace) -> Result<(), SegmentError> {
        let begins = replaces || (self.waiting == 0 && matches!(self.piece, Piece::Rest | Piece::Stop));
        if !begins && self.waiting >= QUEUE_LEN {
            return Err(SegmentError::Full);
        }
        if segment.time_us < 2 * pace.half_us || segment.time_us > TIME_MAX_US {
            return Err(SegmentError::Time);
        }
        let time_s = segment.time_us as f32 * 1e-6;
        let half_s = pace.half_us as f32 * 1e-6;
        for (i, goal_rad) in segment.goal_rad.iter().enumerate() {
            let from_rad = if begins {
                let now = self.motion(&self.corners[i]);
                now.position_rad + now.velocity_rad_per_s * half_s
            } else {
                self.last_goal_rad()[i]
            };
            // In a form that no number fails.
            let is_legal = (goal_rad - from_rad).abs() <= pace.speed_max_rad_per_s * time_s;
            if !is_legal {
                return Err(SegmentError::Time);
            }
        }
        if begins {
            self.waiting = 0;
            self.retarget(segment, pace);
        } else {
            self.queue[(self.first + self.waiting) % QUEUE_LEN] = *segment;
            self.waiting += 1;
        }
        Ok(())
    }

    /// Where the last segment ends.
    fn last_goal_rad(&self) -> &[f32; JOINT_COUNT] {
        match self.waiting {
            0 => &self.goal_rad,
            waiting => &self.queue[(self.first + waiting - 1) % QUEUE_LEN].goal_rad,
        }
    }

    fn passed_s(&self) -> f32 {
        self.passed_us as f32 * 1e-6
    }

    /// Of a blend.
    fn share(&self) -> f32 {
        self.passed_us as f32 / self.time_us as f32
    }

    /// Motion now of the joint that has this corner.
    // Thirteen times it would be a tenth of the image.
    #[inline(never)]
    fn motion(&self, corner: &Corner) -> Motion {
        match self.piece {
            Piece::Rest => corner.straight(0.0),
            Piece::Straight => corner.straight(self.passed_s() + self.half_us as f32 * 1e-6),
            Piece::Blend | Piece::Stop => corner.blend(self.share(), self.time_us as f32 * 1e-6),
        }
    }

    /// From the motion that there is to that of a segment, at any time. Not in a control period: it would be long for that.
    fn retarget(&mut self, segment: &Segment, pace: &Pace) {
        let half_s = pace.half_us as f32 * 1e-6;
        let per_segment_s = 1e6 / segment.time_us as f32;
        for i in 0..JOINT_COUNT {
            let now = self.motion(&self.corners[i]);
            let position_rad = now.position_rad + now.velocity_rad_per_s * half_s;
            self.corners[i] = Corner {
                position_rad,
                before_rad_per_s: now.velocity_rad_per_s,
                after_rad_per_s: (segment.goal_rad[i] - position_rad) * per_segment_s,
                acceleration_rad_per_s2: now.acceleration_rad_per_s2,
            };
            self.goal_rad[i] = segment.goal_rad[i];
        }
        self.blend(Piece::Blend, segment.time_us, pace);
    }

    /// From the end of a straight piece, half a blend before its goal, to the next segment.
    fn turn(&mut self, pace: &Pace) {
        let segment = &self.queue[self.first % QUEUE_LEN];
        let per_segment_s = 1e6 / segment.time_us as f32;
        for i in 0..JOINT_COUNT {
            let (corner, position_rad) = (&mut self.corners[i], self.goal_rad[i]);
            corner.position_rad = position_rad;
            corner.before_rad_per_s = corner.after_rad_per_s;
            corner.after_rad_per_s = (segment.goal_rad[i] - position_rad) * per_segment_s;
            corner.acceleration_rad_per_s2 = 0.0;
            self.goal_rad[i] = segment.goal_rad[i];
        }
        let time_us = segment.time_us;
        self.first = (self.first + 1) % QUEUE_LEN;
        self.waiting -= 1;
        self.blend(Piece::Blend, time_us, pace);
    }

    /// From the end of a straight piece, half a blend before its goal, to rest there.
    fn stop(&mut self, pace: &Pace) {
        for (corner, &goal_rad) in self.corners.iter_mut().zip(&self.goal_rad) {
            corner.position_rad = goal_rad;
            (corner.before_rad_per_s, corner.after_rad_per_s) = (corner.after_rad_per_s, 0.0);
            corner.acceleration_rad_per_s2 = 0.0;
        }
        self.blend(Piece::Stop, 0, pace);
    }

    fn blend(&mut self, piece: Piece, segment_us: u32, pace: &Pace) {
        self.half_us = pace.half_us;
        self.straight_us = segment_us.saturating_sub(2 * pace.half_us);
        self.begin(piece, 2 * pace.half_us);
    }

    fn begin(&mut self, piece: Piece, time_us: u32) {
        (self.piece, self.time_us, self.passed_us) = (piece, time_us, 0);
    }

    /// The piece behind the one that has ended.
    // A function of its own, as every large step of a period: all of them in one run out of registers.
    #[inline(never)]
    fn end(&mut self, pace: &Pace) {
        match self.piece {
            Piece::Rest => self.passed_us = 0,
            Piece::Stop => self.settle(),
            Piece::Blend if self.straight_us > 0 => self.begin(Piece::Straight, self.straight_us),
            Piece::Blend | Piece::Straight if self.waiting > 0 => self.turn(pace),
            Piece::Blend | Piece::Straight => self.stop(pace),
        }
    }

    /// Goes on by one period, and what then holds for all joints.
    pub fn advance(&mut self, elapsed_us: u32, pace: &Pace) -> Weights {
        let passed_us = self.passed_us.saturating_add(elapsed_us);
        if passed_us >= self.time_us {
            // A period that was missed ends one piece, not two.
            let beyond_us = passed_us - self.time_us;
            self.end(pace);
            self.passed_us = beyond_us.min(self.time_us);
        } else {
            self.passed_us = passed_us;
        }
        match self.piece {
            Piece::Rest => Weights::straight(0.0),
            Piece::Straight => Weights::straight(self.passed_s() + self.half_us as f32 * 1e-6),
            Piece::Blend | Piece::Stop => Weights::blend(self.share(), self.time_us as f32 * 1e-6),
        }
    }

    /// Position and velocity of a joint.
    pub fn write(&self, joint: usize, weights: &Weights, target: &mut Target) {
        (target.position_rad[joint], target.velocity_rad_per_s[joint]) = self.corners[joint].at(weights);
    }

    /// Whether all joints stand still and nothing waits.
    #[must_use]
    pub fn is_at_rest(&self) -> bool {
        self.piece == Piece::Rest
    }
}

#[cfg(test)]
mod tests;
