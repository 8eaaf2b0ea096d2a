//! Where the search looks: places where the body is thin enough between surfaces that face apart, and the directions from
//! which arm and palm can come there.
//!
//! Fingers are closed several times for one attempt, and each closing costs some times what it costs to see that the arm
//! does not reach, that the palm would stand in the table, or that the two sides do not face apart. So a proposal is drawn
//! anew until it passes these.

use std::f64::consts::TAU;

use nalgebra::{Isometry3, Point3, Unit, UnitQuaternion, Vector3};
use rand::{Rng, RngExt};
use rand_distr::{Distribution, StandardNormal, UnitSphere};

use super::attempt::{is_open_to, take_finger};
use super::preshape::{Preshape, PreshapeTable, any_across};
use super::samples::{across, through};
use super::scene::Scene;
use super::settle::{Approach, Site, placed, settle};
use super::wrap::palm_over;
use crate::hand::{Candidate, Posture};

/// Share of the proposals that lie between opposite surfaces; the others lie about the middle of the object.
const OPPOSED_SHARE: f64 = 0.7;

/// Least cosine between the line of the fingers and the outward normal at either side: 45 degrees. Beyond, even three
/// fingers find no hold at usual friction.
const FACING_COSINE: f64 = 0.7;

/// How far the line of the fingers leans from the surface's normal, rad (one standard deviation).
const LEAN_RAD: f64 = 0.15;

/// How far the approach leans from straight across the line of the fingers, rad (one standard deviation).
const APPROACH_LEAN_RAD: f64 = 0.25;

/// Share of a power grasp's proposals that come along the direction in which the palm presses; the others come as
/// precision grasps do, thumb and fingers on either side. The built-in hand's thumb leaves little room before the
/// palm's face: nearly all of its power grasps are of the second kind.
const PRESSED_SHARE: f64 = 0.2;

/// How much wider than the object between its fingers a power grasp may open at most, metres.
const ROOM_M: f64 = 0.04;

/// Drawings before a proposal is taken as it is; the attempt then says what is wrong with it.
const DRAWINGS: usize = 24;

/// With a table, approaches rise at most ten degrees above the horizontal.
const RISING_MAX: f64 = 0.17;

/// A site for one candidate's preshapes: settled until the fingers touch together, or where the palm of a power grasp
/// sets out.
pub(super) fn propose(scene: &Scene, table: &PreshapeTable, rng: &mut impl Rng) -> Site {
    let candidate = table.candidate();
    if candidate.wraps && rng.random_range(0.0..1.0) < PRESSED_SHARE {
        return pressed(scene, table, rng);
    }
    let mut last = None;
    for _ in 0..DRAWINGS {
        let Some(mut drawn) = draw(scene, rng) else { continue };
        if candidate.wraps {
            // The fingers have to pass what they will lie against.
            let wider_m = rng.random_range(0.0..ROOM_M);
            drawn.width_m = drawn.width_m.map(|width_m| width_m + wider_m);
        }
        let site = placed(scene, table, &drawn.approach, &drawn.target, drawn.width_m);
        let is_open = is_open_to(scene, candidate, &site);
        last = Some((drawn, site));
        if is_open {
            break;
        }
    }
    let (drawn, mut site) = last.unwrap_or_else(|| {
        let drawn = about_the_middle(scene, rng);
        let site = placed(scene, table, &drawn.approach, &drawn.target, drawn.width_m);
        (drawn, site)
    });
    if candidate.wraps {
        open_wide(scene, candidate, &mut site.preshape);
        return site;
    }
    settle(scene, table, &drawn.approach, &drawn.target, drawn.width_m)
}

/// Every finger at the beginning of its path. What closes from there is the candidate's joints, one after the other, and not
/// the preshape's paths.
fn open_wide(scene: &Scene, candidate: &Candidate, preshape: &mut Preshape) {
    let mut start = preshape.start;
    for finger in candidate.fingers() {
        let opened = preshape.with_finger_at(preshape.u_begin[finger]);
        take_finger(&scene.hand, finger, &opened, &mut start);
    }
    (preshape.start, preshape.rate) = (scene.hand.clamped(start), Posture::ZERO);
}

/// The palm's pressing face over a random point of the surface, the fingers around what is under it.
fn pressed(scene: &Scene, table: &PreshapeTable, rng: &mut impl Rng) -> Site {
    let candidate = table.candidate();
    let mut preshape = *table.nearest(&scene.hand, f64::INFINITY);
    (preshape.start, preshape.rate) = (candidate.open, Posture::ZERO);
    let mut site =
        Site { object_from_palm: Isometry3::identity(), direction_in_object: Vector3::x_axis(), preshape };
    for _ in 0..DRAWINGS {
        let Some(under) = scene.sampler.draw(&scene.mesh, rng) else { break };
        let direction = leaning(&-under.outward_normal, APPROACH_LEAN_RAD, rng);
        if !may_come_along(scene, &direction) {
            continue;
        }
        let turn = UnitQuaternion::from_axis_angle(&direction, rng.random_range(0.0..TAU));
        let lateral = turn * any_across(&direction);
        site.object_from_palm = palm_over(scene, candidate, &direction, &lateral, &under.point_in_object);
        site.direction_in_object = direction;
        if is_open_to(scene, candidate, &site) {
            break;
        }
    }
    site
}

struct Drawn {
    approach: Approach,
    target: Point3<f64>,
    width_m: Option<f64>,
}

fn draw(scene: &Scene, rng: &mut impl Rng) -> Option<Drawn> {
    if rng.random_range(0.0..1.0) < OPPOSED_SHARE {
        between_opposed(scene, rng)
    } else {
        Some(about_the_middle(scene, rng))
    }
}

/// Between a random point of the surface and the one opposite it; `None` when they do not face apart.
fn between_opposed(scene: &Scene, rng: &mut impl Rng) -> Option<Drawn> {
    let near = scene.sampler.draw(&scene.mesh, rng)?;
    let axis = leaning(&near.outward_normal, LEAN_RAD, rng);
    // A rim is held by its wall, a cup around all of it.
    let crossing = if rng.random_range(0.0..1.0) < 0.5 {
        through(&scene.surface, &near.point_in_object, &-axis)?
    } else {
        let longest_m = 2.1 * scene.wrench_reference.torque_scale_m();
        across(&scene.surface, &near.point_in_object, &-axis, longest_m)?
    };
    if crossing.outward_normal.dot(&axis) > -FACING_COSINE {
        return None;
    }
    let target = near.point_in_object - axis.into_inner() * (0.5 * crossing.thickness_m);
    let across = any_across(&axis);
    let turn = UnitQuaternion::from_axis_angle(&axis, rng.random_range(0.0..TAU));
    let straight = Unit::new_normalize(turn * across);
    let direction = leaning(&straight, APPROACH_LEAN_RAD, rng);
    if !may_come_along(scene, &direction) {
        return None;
    }
    let approach = Approach { direction_in_object: direction, opposition_in_object: axis.into_inner() };
    Some(Drawn { approach, target, width_m: Some(crossing.thickness_m) })
}

/// About a point between the centre of mass and a random vertex, from anywhere: handles, necks and corners are graspable
/// where the middle is too thick.
fn about_the_middle(scene: &Scene, rng: &mut impl Rng) -> Drawn {
    let direction = loop {
        let direction = Unit::new_normalize(Vector3::from(UnitSphere.sample(rng)));
        if may_come_along(scene, &direction) {
            break direction;
        }
    };
    let turn = UnitQuaternion::from_axis_angle(&direction, rng.random_range(0.0..TAU));
    let vertices = scene.mesh.vertices();
    let somewhere = vertices[rng.random_range(0..vertices.len())];
    let target = scene.center_of_mass + (somewhere - scene.center_of_mass) * rng.random_range(0.0..1.0);
    let opposition_in_object = turn * any_across(&direction);
    Drawn {
        approach: Approach { direction_in_object: direction, opposition_in_object },
        target,
        width_m: None,
    }
}

/// Seldom from below: with a table a direction may rise a little only.
fn may_come_along(scene: &Scene, direction_in_object: &Vector3<f64>) -> bool {
    scene.table_height_m.is_none() || (scene.base_from_object * direction_in_object).z < RISING_MAX
}

fn leaning(direction: &Unit<Vector3<f64>>, lean_rad: f64, rng: &mut impl Rng) -> Unit<Vector3<f64>> {
    let mut normal = || rng.sample::<f64, _>(StandardNormal) * lean_rad;
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(normal(), normal(), normal()));
    Unit::new_normalize(turn * direction.into_inner())
}

/// The hand's candidates and variants of them: joints that spread or turn a finger moved by up to a fifth of their range,
/// and the ratio in which joints close changed by up to a third.
pub(super) fn variants(scene: &Scene, each: usize, rng: &mut impl Rng) -> Vec<PreshapeTable> {
    let hand = &scene.hand;
    hand.candidates
        .iter()
        .enumerate()
        .flat_map(|(typical, candidate)| (0..each).map(move |_| (typical, candidate)))
        .map(|(typical, candidate)| {
            let mut variant = candidate.clone();
            for (i, joint) in hand.joints.iter().enumerate() {
                let range = joint.upper_rad - joint.lower_rad;
                if joint.flexes.is_none() {
                    let moved = variant.open[i] + rng.random_range(-0.2..0.2) * range;
                    variant.open[i] = moved.clamp(joint.lower_rad, joint.upper_rad);
                } else {
                    variant.closing[i] *= 1.0 + rng.random_range(-0.33..0.33);
                }
            }
            PreshapeTable::new(typical, variant)
        })
        .collect()
}
