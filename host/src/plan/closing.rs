//! Closing one finger until it touches: conservative advancement along the coupled kinematics.

use hand_model::FingerAngles;
use nalgebra::{Isometry3, Point3, Unit, Vector3};

use super::hand_body::{HandBody, Link};
use super::preshape::FingerPath;
use super::surface_query::SurfaceQuery;

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
    /// Place on the [`FingerPath`].
    pub u: f64,
    /// The finger's angles there.
    pub angles: FingerAngles<f64>,
    /// The link that touches.
    pub link: Link,
    /// The touched point, object frame, metres.
    pub point_in_object: Point3<f64>,
    /// Direction in which the finger pushes: from the bead's centre to the point.
    pub inward_normal_in_object: Unit<Vector3<f64>>,
    /// Cosine of the angle between that direction and the pad's normal: 1 is the middle of the pad, below 0 the back
    /// of the finger.
    pub pad_cosine: f64,
}

/// Room for the bead positions, kept between calls.
#[derive(Debug, Default, Clone)]
pub struct ClosingScratch {
    centers: Vec<Point3<f64>>,
    /// Lower bound of each bead's distance, metres: the last measured one less the way that it can have moved since.
    bounds: Vec<f64>,
}

/// Closes a finger along its path until a bead touches the surface.
pub fn close_finger(
    surface: &SurfaceQuery,
    hand: &HandBody,
    object_from_base: &Isometry3<f64>,
    path: &FingerPath,
    scratch: &mut ClosingScratch,
) -> Closing {
    // No bead moves faster than this per unit of u: abduction and flexion carry it by its distance from the base, the
    // coupled middle and distal joints by at most the length beyond the middle joint, the distal part twice.
    let beyond_middle_m = hand.model.finger.l2_m + 2.0 * hand.model.finger.l3_m;
    let [abduction, flexion, middle] = path.rate_rad.map(f64::abs);
    let speed_m = abduction.hypot(flexion) * hand.reach_m() + middle * beyond_middle_m;
    if speed_m <= 0.0 {
        return Closing::Misses;
    }

    let ClosingScratch { centers, bounds } = scratch;
    hand.bead_centers(&path.at(path.u_begin), centers);
    bounds.clear();
    bounds.extend(
        hand.beads()
            .iter()
            .zip(centers.iter())
            .map(|(bead, center)| surface.distance_bound_m(&(object_from_base * center)) - bead.radius_m),
    );
    let mut u = path.u_begin;
    for step in 0..MAX_STEPS {
        let angles = path.at(u);
        hand.bead_centers(&angles, centers);
        let mut gap = f64::INFINITY;
        for ((bead, center), bound) in hand.beads().iter().zip(centers.iter()).zip(bounds.iter_mut()) {
            // A bead whose bound is beyond the smallest gap so far cannot shorten this step.
            if *bound < gap {
                let center_in_object = object_from_base * center;
                let nearest = surface.nearest(&center_in_object);
                *bound = nearest.signed_distance_m - bead.radius_m;
                if *bound <= TOUCH_M {
                    if step == 0 || nearest.signed_distance_m <= 0.0 {
                        return Closing::StartsInside;
                    }
                    let push = nearest.point_in_object - center_in_object;
                    let pad_in_object = object_from_base
                        * hand_model::pad_normal(&hand_model::FingerTrig::new(&angles, f64::sin_cos));
                    let inward_normal_in_object = Unit::new_normalize(push);
                    return Closing::Touches(Touch {
                        u,
                        angles,
                        link: bead.link,
                        point_in_object: nearest.point_in_object,
                        inward_normal_in_object,
                        pad_cosine: inward_normal_in_object.dot(&pad_in_object),
                    });
                }
            }
            gap = gap.min(*bound);
        }
        if u >= path.u_end {
            return Closing::Misses;
        }
        // Half the touch distance more than is proven free, so that the last step lands inside the touch band.
        let advance = (gap / speed_m).max(0.5 * TOUCH_M / speed_m);
        u = (u + advance).min(path.u_end);
        bounds.iter_mut().for_each(|bound| *bound -= advance * speed_m);
    }
    Closing::Misses
}

#[cfg(test)]
mod tests {
    use hand_model::FingerTrig;
    use protocol::ids::FingerId;

    use super::*;
    use crate::object::BuiltIn;
    use crate::plan::candidates::typical;
    use crate::plan::preshape::Preshape;

    #[test]
    fn a_finger_stops_where_its_tip_meets_a_wall() {
        // A cube whose near face is the plane x = wall in the grasp frame, in the way of the middle finger only.
        let hand = HandBody::hit_dlr();
        let preshape = Preshape::for_width(&hand, &typical()[2], 0.06);
        let path = preshape.paths[FingerId::Middle.index()].unwrap();
        let palm_from_base = hand.palm_from_finger_base(FingerId::Middle, preshape.thumb_rotation_rad);
        let grasp_from_base = preshape.palm_from_grasp.inverse() * palm_from_base;
        let tip = |u: f64| {
            grasp_from_base * hand_model::tip(&hand.model.finger, &FingerTrig::new(&path.at(u), f64::sin_cos))
        };
        let radius_m = hand.model.finger.tip_radius_m;
        let mesh = BuiltIn::Cube.object(1.0).unwrap().mesh;
        let surface = SurfaceQuery::new(&mesh).unwrap();
        for u in [0.3, 0.8, 1.0] {
            let wall_m = tip(u).x + radius_m;
            // The cube stands on z = 0 about the z axis, 50 mm wide.
            let object_from_grasp = Isometry3::translation(-0.025 - wall_m, -tip(u).y, 0.025 - tip(u).z);
            let closing = close_finger(
                &surface,
                &hand,
                &(object_from_grasp * grasp_from_base),
                &path,
                &mut Default::default(),
            );
            let Closing::Touches(touch) = closing else { panic!("{closing:?} at u {u}") };
            assert!((touch.u - u).abs() < 2e-3, "touched at {} instead of {u}", touch.u);
            assert_eq!(touch.link, Link::Tip);
            assert!((touch.inward_normal_in_object.into_inner() - Vector3::x()).norm() < 1e-6);
            assert!(touch.pad_cosine > 0.5);
        }
        let beside = Isometry3::translation(0.0, 1.0, 0.0) * grasp_from_base;
        assert_eq!(close_finger(&surface, &hand, &beside, &path, &mut Default::default()), Closing::Misses);
        let into = Isometry3::translation(-tip(0.0).x, -tip(0.0).y, 0.025 - tip(0.0).z) * grasp_from_base;
        assert_eq!(
            close_finger(&surface, &hand, &into, &path, &mut Default::default()),
            Closing::StartsInside
        );
    }
}
