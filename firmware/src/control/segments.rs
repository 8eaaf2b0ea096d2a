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

use protocol::ids::{FINGER_COUNT, FingerId, JOINT_COUNT};
use thiserror::Error;

use super::quintic::Quintic;
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
    ways: [Quintic; JOINT_COUNT],
    /// Time of this piece, and how much of it has passed.
    time_us: u32,
    passed_us: u32,
    /// One over its time.
    per_us: f32,
    per_s: f32,
    /// Where the segment under way ends, with which speed and how long it goes straight.
    goal_rad: [f32; JOINT_COUNT],
    speed_rad_per_s: [f32; JOINT_COUNT],
    straight_us: u32,
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
            ways: [Quintic::default(); JOINT_COUNT],
            time_us: 1,
            passed_us: 0,
            per_us: 1.0,
            per_s: 1.0,
            goal_rad: [0.0; JOINT_COUNT],
            speed_rad_per_s: [0.0; JOINT_COUNT],
            straight_us: 0,
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
        self.piece = Piece::Rest;
        self.begin(1);
        for (way, &goal_rad) in self.ways.iter_mut().zip(&self.goal_rad) {
            *way = Quintic::straight(goal_rad, 0.0, 0.0);
        }
    }

    /// A segment behind those that wait, or instead of them and of the one under way.
    ///
    /// # Errors
    ///
    /// [`SegmentError`]; then all is as before.
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
                let now = self.motion(i);
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
            self.blend(Some(segment), pace);
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

    /// Motion of a joint now.
    fn motion(&self, joint: usize) -> Motion {
        self.ways[joint].motion(self.passed_us as f32 * self.per_us, self.time_us as f32 * 1e-6)
    }

    /// From the motion that there is to that of the next segment, or to rest at the end of this one.
    // Apart from the period that it ends, which has no registers left.
    #[inline(never)]
    fn blend(&mut self, next: Option<&Segment>, pace: &Pace) {
        let half_s = pace.half_us as f32 * 1e-6;
        let time_s = 2.0 * half_s;
        let per_segment_s = next.map_or(0.0, |segment| 1e6 / segment.time_us as f32);
        for i in 0..JOINT_COUNT {
            let now = self.motion(i);
            let mut to = Motion {
                position_rad: self.goal_rad[i],
                velocity_rad_per_s: 0.0,
                acceleration_rad_per_s2: 0.0,
            };
            if let Some(segment) = next {
                // The two straight lines meet here; when a straight piece has ended, that is its segment's goal.
                let corner_rad = now.position_rad + now.velocity_rad_per_s * half_s;
                to.velocity_rad_per_s = (segment.goal_rad[i] - corner_rad) * per_segment_s;
                to.position_rad = corner_rad + to.velocity_rad_per_s * half_s;
                self.goal_rad[i] = segment.goal_rad[i];
            }
            self.speed_rad_per_s[i] = to.velocity_rad_per_s;
            self.ways[i] = Quintic::between(&now, &to, time_s);
        }
        self.piece = if next.is_some() { Piece::Blend } else { Piece::Stop };
        self.straight_us = next.map_or(0, |segment| segment.time_us.saturating_sub(2 * pace.half_us));
        self.begin(2 * pace.half_us);
    }

    fn begin(&mut self, time_us: u32) {
        (self.time_us, self.passed_us) = (time_us.max(1), 0);
        self.per_us = 1.0 / self.time_us as f32;
        self.per_s = 1e6 * self.per_us;
    }

    /// The piece behind the one that has ended.
    #[inline(never)]
    fn turn(&mut self, pace: &Pace) {
        self.passed_us = self.time_us;
        match self.piece {
            Piece::Rest => self.begin(1),
            Piece::Stop => self.settle(),
            Piece::Blend if self.straight_us > 0 => {
                let time_s = self.straight_us as f32 * 1e-6;
                for (way, speed_rad_per_s) in self.ways.iter_mut().zip(self.speed_rad_per_s) {
                    *way = Quintic::straight(way.at(1.0).0, speed_rad_per_s, time_s);
                }
                self.piece = Piece::Straight;
                self.begin(self.straight_us);
            }
            Piece::Blend | Piece::Straight => {
                let next = (self.waiting > 0).then(|| self.queue[self.first % QUEUE_LEN]);
                if next.is_some() {
                    self.first = (self.first + 1) % QUEUE_LEN;
                    self.waiting -= 1;
                }
                self.blend(next.as_ref(), pace);
            }
        }
    }

    /// Goes on by one period and writes positions and speeds of the fingers that are `active`; others stay.
    #[inline(never)]
    pub fn step(&mut self, elapsed_us: u32, active: [bool; FINGER_COUNT], pace: &Pace, target: &mut Target) {
        let passed_us = self.passed_us.saturating_add(elapsed_us);
        if passed_us >= self.time_us {
            // A period that was missed ends one piece, not two.
            let beyond_us = passed_us - self.time_us;
            self.turn(pace);
            self.passed_us = beyond_us.min(self.time_us);
        } else {
            self.passed_us = passed_us;
        }
        let share = self.passed_us as f32 * self.per_us;
        for finger in FingerId::ALL {
            if !active[finger.index()] {
                target.velocity_rad_per_s[finger.joints()].fill(0.0);
                continue;
            }
            for i in finger.joints() {
                let (position_rad, per_piece) = self.ways[i].at(share);
                target.position_rad[i] = position_rad;
                target.velocity_rad_per_s[i] = per_piece * self.per_s;
            }
        }
    }

    /// Whether all joints stand still and nothing waits.
    #[must_use]
    pub fn is_at_rest(&self) -> bool {
        self.piece == Piece::Rest
    }
}

#[cfg(test)]
mod tests;
