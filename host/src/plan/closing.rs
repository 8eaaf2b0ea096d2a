//! Closing one finger until it touches: conservative advancement along the coupled kinematics.

use nalgebra::{Isometry3, IsometryMatrix3, Point3, Unit, Vector3};

use super::preshape::Preshape;
use super::surface_query::SurfaceQuery;
use crate::hand::finger::MAX_BEADS;
use crate::hand::{Finger, Hand, Part, Posture};

/// Distance at which a bead counts as touching, metres: a tenth of the scanner's noise.
const TOUCH_M: f64 = 2.0e-5;

/// Cap on advancement steps. Each step keeps at least the share of the gap that the finger's lever leaves, so a touch
/// is found in a few tens; a finger that creeps along the surface for longer does not close on it.
const MAX_STEPS: usize = 400;

/// Where a closing finger ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Closing {
    /// It touches.
    Touches(Touch),
    /// It reached its limits in the air.
    Misses,
    /// It stood inside the object or on it before it moved.
    StartsInside,
}

/// First touch of a finger.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Touch {
    /// Place on the finger's path of the [`Preshape`].
    pub u: f64,
    /// The bead that touches, index into [`Finger::beads`](crate::hand::Finger::beads).
    pub bead: usize,
    /// What it belongs to.
    pub part: Part,
    /// The touched point, object frame, metres.
    pub point_in_object: Point3<f64>,
    /// Direction in which the finger pushes: from the bead's centre to the point.
    pub inward_normal_in_object: Unit<Vector3<f64>>,
    /// Cosine of the angle between that direction and the pad's normal: 1 is the middle of the pad, below 0 the back
    /// of the finger.
    pub pad_cosine: f64,
}

/// Closes a finger of a hand at `object_from_palm` along its path until a bead touches the surface.
#[must_use]
pub fn close_finger(
    surface: &SurfaceQuery,
    hand: &Hand,
    finger: usize,
    object_from_palm: &Isometry3<f64>,
    preshape: &Preshape,
) -> Closing {
    let way = Way {
        start: preshape.start,
        rate: preshape.rate,
        u_begin: preshape.u_begin[finger],
        u_end: preshape.u_end[finger],
        beads_from: 0,
        may_begin_touching: false,
    };
    advance(surface, &hand.fingers[finger], object_from_palm, &way)
}

/// A straight way of a finger in joint space.
#[derive(Debug, Clone, Copy)]
pub struct Way {
    /// The hand at u = 0.
    pub start: Posture,
    /// Change per unit of u.
    pub rate: Posture,
    /// Where it begins.
    pub u_begin: f64,
    /// Where it ends.
    pub u_end: f64,
    /// Beads before this one are not looked at.
    pub beads_from: usize,
    /// Whether a touch where the way begins is a touch; otherwise it is [`Closing::StartsInside`].
    pub may_begin_touching: bool,
}

/// Moves a finger along a way until one of its beads touches.
#[must_use]
pub fn advance(
    surface: &SurfaceQuery,
    chain: &Finger,
    object_from_palm: &Isometry3<f64>,
    way: &Way,
) -> Closing {
    let beads = chain.beads();
    let object_from_palm = matrix(object_from_palm);
    let (u_begin, u_end) = (way.u_begin, way.u_end);
    let at = |u: f64| chain.frames(&(way.start + way.rate * u));
    let mut speeds_m = [0.0; MAX_BEADS];
    // Lower bound of each bead's distance, metres: the last measured one less the way that it can have moved since.
    let mut bounds_m = [0.0; MAX_BEADS];
    let mut fastest_m = 0.0_f64;
    let first = at(u_begin);
    for (i, bead) in beads.iter().enumerate().skip(way.beads_from) {
        speeds_m[i] = chain.bead_speed_bound_m(i, &way.rate);
        fastest_m = fastest_m.max(speeds_m[i]);
        let center = object_from_palm * (first.palm_from_segment(bead.segment) * bead.center_in_segment);
        bounds_m[i] = surface.distance_bound_m(&center) - bead.radius_m;
    }
    if fastest_m <= 0.0 {
        return Closing::Misses;
    }
    let mut u = u_begin;
    for step in 0..MAX_STEPS {
        let frames = at(u);
        // How far u may go before any bead can touch.
        let mut free = f64::INFINITY;
        // From the tip on, which is the fastest and mostly the nearest: the others need no measuring then.
        for (i, bead) in beads.iter().enumerate().skip(way.beads_from).rev() {
            let speed_m = speeds_m[i].max(1e-6 * fastest_m);
            if bounds_m[i] < free * speed_m {
                let center =
                    object_from_palm * (frames.palm_from_segment(bead.segment) * bead.center_in_segment);
                let bound_m = surface.distance_bound_m(&center) - bead.radius_m;
                bounds_m[i] = bounds_m[i].max(bound_m);
                if bounds_m[i] < free * speed_m && bounds_m[i] < NEAR_M {
                    let nearest = surface.nearest(&center);
                    bounds_m[i] = nearest.signed_distance_m - bead.radius_m;
                    if bounds_m[i] <= TOUCH_M {
                        if step == 0 && !way.may_begin_touching || nearest.signed_distance_m <= 0.0 {
                            return Closing::StartsInside;
                        }
                        let push = Unit::new_normalize(nearest.point_in_object - center);
                        let pad = object_from_palm.rotation * chain.pad_in_palm(&frames).into_inner();
                        return Closing::Touches(Touch {
                            u,
                            bead: i,
                            part: bead.part,
                            point_in_object: nearest.point_in_object,
                            inward_normal_in_object: push,
                            pad_cosine: push.dot(&pad),
                        });
                    }
                }
            }
            free = free.min(bounds_m[i] / speed_m);
        }
        if u >= u_end {
            return Closing::Misses;
        }
        // Half the touch distance more than is proven free, so that the last step lands inside the touch band.
        let advance = free.max(0.5 * TOUCH_M / fastest_m);
        u = (u + advance).min(u_end);
        for (bound, speed) in bounds_m.iter_mut().zip(&speeds_m).take(beads.len()) {
            *bound -= advance * speed.max(1e-6 * fastest_m);
        }
    }
    Closing::Misses
}

/// Bounds below this are measured exactly; above, the bound alone is far enough to go on with, metres.
const NEAR_M: f64 = 0.004;

/// As a matrix, which turns points for less.
#[must_use]
pub fn matrix(pose: &Isometry3<f64>) -> IsometryMatrix3<f64> {
    IsometryMatrix3::from_parts(pose.translation, pose.rotation.to_rotation_matrix())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::object::BuiltIn;

    #[test]
    fn a_finger_stops_where_its_tip_meets_a_wall() {
        // A cube whose near face is the plane x = wall in the grasp frame, in the way of the middle finger only.
        let hand = Hand::hit_dlr().unwrap();
        let preshape = Preshape::for_width(&hand, &hand.candidates[2], 0.06);
        let middle = hand.finger_index("middle").unwrap();
        let chain = &hand.fingers[middle];
        let grasp_from_palm = preshape.palm_from_grasp.inverse();
        let tip = |u: f64| grasp_from_palm * chain.tip_in_palm(&chain.frames(&preshape.with_finger_at(u)));
        let mesh = BuiltIn::Cube.object(1.0).unwrap().mesh;
        let surface = SurfaceQuery::new(&mesh).unwrap();
        let close = |object_from_grasp: Isometry3<f64>| {
            close_finger(&surface, &hand, middle, &(object_from_grasp * grasp_from_palm), &preshape)
        };
        for u in [0.3, 0.8, 1.0] {
            let wall_m = tip(u).x + chain.tip_radius_m();
            // The cube stands on z = 0 about the z axis, 50 mm wide.
            let closing = close(Isometry3::translation(-0.025 - wall_m, -tip(u).y, 0.025 - tip(u).z));
            let Closing::Touches(touch) = closing else { panic!("{closing:?} at u {u}") };
            assert!((touch.u - u).abs() < 2e-3, "touched at {} instead of {u}", touch.u);
            assert_eq!(touch.part, Part::Tip);
            assert!((touch.inward_normal_in_object.into_inner() - Vector3::x()).norm() < 1e-6);
            assert!(touch.pad_cosine > 0.5);
        }
        assert_eq!(close(Isometry3::translation(0.0, 1.0, 0.0)), Closing::Misses);
        let into = Isometry3::translation(-tip(0.0).x, -tip(0.0).y, 0.025 - tip(0.0).z);
        assert_eq!(close(into), Closing::StartsInside);
    }
}
