//! What the arm and the hand on it may not touch: table, object, each other.
//!
//! A move is checked by halving: at its middle, no point of a body is farther from where it passes than half the way that
//! the joints can move it at most, so that a middle with this much clearance proves the whole move. Otherwise both halves
//! are looked at. Every check thus holds between the configurations looked at, down to moves of half a millimetre.

use std::fmt;

use nalgebra::{Isometry3, Point3};

use super::arm::distance::{point_to_segment_m, segment_to_box_m, segment_to_segment_m};
use super::arm::{Arm, Joints};
use super::hand_shape::{Ball, HandShape, in_box, lowest_m};

use super::scene::{TABLE_CLEARANCE_M, TIP_CLEARANCE_M};
use super::surface_query::SurfaceQuery;
use crate::hand::PalmBox;

/// Moves in which no point goes farther are checked at their middle only, metres: half of it may be missed.
const RESOLUTION_M: f64 = 0.0005;

/// What the hand keeps from the table, metres: half of what grasp sites keep, so that the ends of a way are free.
const HAND_TABLE_CLEARANCE_M: f64 = 0.5 * TIP_CLEARANCE_M;

/// Links whose bodies the hand is checked against: the wrist's last one is its neighbour.
const LAST_LINK_NEAR_HAND: usize = 4;

/// Number of the flange's link, which carries the hand.
const FLANGE: usize = 6;

/// Something that can be hit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Body {
    /// A link of the arm: 0 the base, 1 to 6 the one behind that axis.
    Link(usize),
    /// The hand's palm.
    Palm,
    /// One of its fingers.
    Finger,
    /// The table.
    Table,
    /// The object.
    Object,
}

impl fmt::Display for Body {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Link(0) => write!(f, "the arm's base"),
            Self::Link(link) => write!(f, "link {link} of the arm"),
            Self::Palm => write!(f, "the palm"),
            Self::Finger => write!(f, "a finger"),
            Self::Table => write!(f, "the table"),
            Self::Object => write!(f, "the object"),
        }
    }
}

/// Two bodies that touch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Clash {
    /// The one that moves.
    pub mover: Body,
    /// What it touches.
    pub other: Body,
}

impl fmt::Display for Clash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} touches {}", self.mover, self.other)
    }
}

/// Where the object is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ObjectPlace {
    /// It stands, and neither arm nor hand may touch it.
    Standing {
        /// Its pose in the base frame.
        base_from_object: Isometry3<f64>,
    },
    /// It stands, and the hand closes on it: a grasp's own checks have seen to the hand.
    Target {
        /// Its pose in the base frame.
        base_from_object: Isometry3<f64>,
    },
    /// The hand holds it: only the arm's links may not touch it.
    Held {
        /// Its pose in the palm frame.
        palm_from_object: Isometry3<f64>,
    },
}

/// Everything that a way of the arm has to keep clear of.
pub struct Obstacles<'a> {
    arm: &'a Arm,
    hand: &'a HandShape,
    table_height_m: Option<f64>,
    surface: &'a SurfaceQuery,
    place: ObjectPlace,
    /// By link: how far its bodies move per radian of each axis, metres.
    levers_m: [Joints; FLANGE + 1],
    /// What all bodies keep from each other beyond what they have to, metres.
    clearance_m: f64,
}

/// Clearance that is asked for.
#[derive(Clone, Copy)]
struct Room<'a> {
    levers_m: &'a [Joints; FLANGE + 1],
    /// How far each axis may turn.
    turns_rad: Joints,
    /// Asked for in any case, metres.
    clearance_m: f64,
}

impl Room<'_> {
    /// How far `link` may move as seen from `from_link`, and the clearance, metres.
    fn of(&self, from_link: usize, link: usize) -> f64 {
        let moves = (from_link..link).map(|axis| self.turns_rad[axis] * self.levers_m[link][axis]);
        moves.sum::<f64>() + self.clearance_m
    }
}

impl<'a> Obstacles<'a> {
    /// For an arm that carries a hand in a fixed posture. The table and the surface are in base and object frame.
    #[must_use]
    pub fn new(
        arm: &'a Arm,
        hand: &'a HandShape,
        table_height_m: Option<f64>,
        surface: &'a SurfaceQuery,
        place: ObjectPlace,
    ) -> Self {
        let levers_m = std::array::from_fn(|link| {
            let bodies = arm.link_capsules().iter().filter(|capsule| capsule.link == link);
            let extents =
                bodies.map(|c| c.from.coords.norm().max(c.to.coords.norm()) + c.radius_m).fold(0.0, f64::max);
            let of_hand = || {
                let bound = hand.bound();
                (arm.flange_from_palm() * bound.center_in_palm).coords.norm() + bound.radius_m
            };
            arm.levers_m(link, if link == FLANGE { extents.max(of_hand()) } else { extents })
        });
        Self { arm, hand, table_height_m, surface, place, levers_m, clearance_m: 0.0 }
    }

    /// The same, but all bodies keep this much more from each other, metres.
    #[must_use]
    pub fn keeping(&self, clearance_m: f64) -> Self {
        Self { clearance_m, ..*self }
    }

    /// How far the hand's points move per radian of each axis, at most, metres.
    #[must_use]
    pub fn hand_levers_m(&self) -> Joints {
        self.levers_m[FLANGE]
    }

    /// What touches in a configuration.
    #[must_use]
    pub fn clash_at(&self, q: &Joints) -> Option<Clash> {
        self.clash(q, [0.0; 6])
    }

    /// What touches on the straight way in joint space from one configuration to another.
    #[must_use]
    pub fn clash_between(&self, from: &Joints, to: &Joints) -> Option<Clash> {
        let middle: Joints = std::array::from_fn(|i| 0.5 * (from[i] + to[i]));
        let half: Joints = std::array::from_fn(|i| 0.5 * (from[i] - to[i]).abs());
        let room = Room { levers_m: &self.levers_m, turns_rad: half, clearance_m: 0.0 };
        let reach_m = (1..=FLANGE).map(|link| room.of(0, link)).fold(0.0, f64::max);
        // A way that is no number is not free.
        if reach_m.is_nan() || 2.0 * reach_m <= RESOLUTION_M {
            return self.clash(&middle, [0.0; 6]);
        }
        // With this much room at the middle the whole way is free.
        self.clash(&middle, half)?;
        if let Some(clash) = self.clash(&middle, [0.0; 6]) {
            return Some(clash);
        }
        self.clash_between(from, &middle).or_else(|| self.clash_between(&middle, to))
    }

    /// What touches, or could touch when each axis turns by as much as `turns_rad` to either side.
    fn clash(&self, q: &Joints, turns_rad: Joints) -> Option<Clash> {
        let room = Room { levers_m: &self.levers_m, turns_rad, clearance_m: self.clearance_m };
        let frames = self.arm.link_frames(q);
        let base_from_palm = frames[FLANGE - 1] * self.arm.flange_from_palm();
        let capsules = self.arm.link_capsules();
        self.links(&frames, &base_from_palm, &room)
            .or_else(|| {
                self.arm.self_pairs().iter().find_map(|&(i, k)| {
                    let ends = [i, k].map(|c| capsules[c].ends_in_base(&frames));
                    let gap_m = segment_to_segment_m(&ends[0], &ends[1])
                        - capsules[i].radius_m
                        - capsules[k].radius_m;
                    let [first, second] = [i, k].map(|c| capsules[c].link);
                    (gap_m <= room.of(first, second))
                        .then_some(Clash { mover: Body::Link(second), other: Body::Link(first) })
                })
            })
            .or_else(|| self.hand_on_arm(&frames, &base_from_palm, &room))
            .or_else(|| self.hand_on_surroundings(&base_from_palm, room.of(0, FLANGE)))
    }

    /// Links against table and object.
    fn links(
        &self,
        frames: &[Isometry3<f64>; 6],
        base_from_palm: &Isometry3<f64>,
        room: &Room<'_>,
    ) -> Option<Clash> {
        let (base_from_object, is_held) = match self.place {
            ObjectPlace::Standing { base_from_object } | ObjectPlace::Target { base_from_object } => {
                (base_from_object, false)
            }
            ObjectPlace::Held { palm_from_object } => (base_from_palm * palm_from_object, true),
        };
        self.arm.link_capsules().iter().find_map(|capsule| {
            let ends = capsule.ends_in_base(frames);
            let room_m = room.of(0, capsule.link);
            let lowest_m = ends[0].z.min(ends[1].z) - capsule.radius_m;
            // The base stands on the table's level.
            let on_table = capsule.link > 0
                && self.table_height_m.is_some_and(|table| lowest_m < table + TABLE_CLEARANCE_M + room_m);
            if on_table {
                return Some(Clash { mover: Body::Link(capsule.link), other: Body::Table });
            }
            let room_m = if is_held { room.of(capsule.link, FLANGE) } else { room_m };
            let ends_in_object = ends.map(|end| base_from_object.inverse_transform_point(&end));
            self.capsule_hits_object(&ends_in_object, capsule.radius_m + room_m)
                .then_some(Clash { mover: Body::Link(capsule.link), other: Body::Object })
        })
    }

    fn capsule_hits_object(&self, ends: &[Point3<f64>; 2], radius_m: f64) -> bool {
        let middle = nalgebra::center(&ends[0], &ends[1]);
        let reach_m = 0.5 * (ends[1] - ends[0]).norm() + radius_m;
        // A capsule farther away than its ends needs no look.
        self.surface.distance_bound_m(&middle) <= reach_m
            && (self.surface.cuts_capsule(ends, radius_m)
                || self.surface.nearest(&middle).signed_distance_m < 0.0)
    }

    /// Palm and fingers against the links that do not neighbour them.
    fn hand_on_arm(
        &self,
        frames: &[Isometry3<f64>; 6],
        base_from_palm: &Isometry3<f64>,
        room: &Room<'_>,
    ) -> Option<Clash> {
        let bound = self.hand.bound();
        let bound_at = base_from_palm * bound.center_in_palm;
        let near = self.arm.link_capsules().iter().filter(|capsule| capsule.link <= LAST_LINK_NEAR_HAND);
        near.into_iter().find_map(|capsule| {
            let ends = capsule.ends_in_base(frames);
            let keep_m = capsule.radius_m + room.of(capsule.link, FLANGE);
            if point_to_segment_m(&bound_at, &ends) > bound.radius_m + keep_m {
                return None;
            }
            let other = Body::Link(capsule.link);
            let palm_touches = self.hand.boxes().iter().any(|part| {
                let ends = in_box(&(base_from_palm * part.palm_from_box), &ends);
                segment_to_box_m(&ends, &part.half_extents_m) <= keep_m
            });
            if palm_touches {
                return Some(Clash { mover: Body::Palm, other });
            }
            let ends_in_palm = ends.map(|end| base_from_palm.inverse_transform_point(&end));
            let touches = self.hand.balls().iter().any(|ball| {
                point_to_segment_m(&ball.center_in_palm, &ends_in_palm) <= ball.radius_m + keep_m
            });
            touches.then_some(Clash { mover: Body::Finger, other })
        })
    }

    /// Palm and fingers against table and object.
    fn hand_on_surroundings(&self, base_from_palm: &Isometry3<f64>, room_m: f64) -> Option<Clash> {
        let ObjectPlace::Standing { base_from_object } = self.place else { return None };
        let bound = self.hand.bound();
        let bound_at = base_from_palm * bound.center_in_palm;
        if let Some(table) = self.table_height_m {
            let least_m = table + HAND_TABLE_CLEARANCE_M + room_m;
            if bound_at.z - bound.radius_m < least_m {
                let low = |part: &PalmBox| {
                    lowest_m(&(base_from_palm * part.palm_from_box), &part.half_extents_m) < least_m
                };
                if self.hand.boxes().iter().any(low) {
                    return Some(Clash { mover: Body::Palm, other: Body::Table });
                }
                let low = |ball: &Ball| (base_from_palm * ball.center_in_palm).z - ball.radius_m < least_m;
                if self.hand.balls().iter().any(low) {
                    return Some(Clash { mover: Body::Finger, other: Body::Table });
                }
            }
        }
        let object_from_palm = base_from_object.inverse() * base_from_palm;
        if self.surface.distance_bound_m(&(object_from_palm * bound.center_in_palm)) > bound.radius_m + room_m
        {
            return None;
        }
        let palm_touches = self.hand.boxes().iter().any(|part| {
            let object_from_box = object_from_palm * part.palm_from_box;
            let half = part.half_extents_m.add_scalar(room_m);
            let middle = Point3::from(object_from_box.translation.vector);
            self.surface.distance_bound_m(&middle) <= half.norm()
                && (self.surface.cuts_box(&object_from_box, &half)
                    || self.surface.nearest(&middle).signed_distance_m < 0.0)
        });
        if palm_touches {
            return Some(Clash { mover: Body::Palm, other: Body::Object });
        }
        let touches = self.hand.balls().iter().any(|ball| {
            let center = object_from_palm * ball.center_in_palm;
            let keep_m = ball.radius_m + room_m;
            self.surface.distance_bound_m(&center) <= keep_m
                && self.surface.nearest(&center).signed_distance_m <= keep_m
        });
        touches.then_some(Clash { mover: Body::Finger, other: Body::Object })
    }
}
