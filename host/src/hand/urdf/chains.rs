//! Fingers from chains of bodies: segments, balls, and which ball is the tip.

use nalgebra::{IsometryMatrix3, Point3, Vector3};

use super::balls::{self, Ball, Placed};
use super::description::Description;
use super::error::Problem;
use super::files::Files;
use super::joints::Joints;
use super::overrides::Overrides;
use super::tree::Tree;
use crate::hand::finger::{FingerError, MAX_BEADS};
use crate::hand::{Bead, Finger, Part, Segment};

/// Centres of balls in a row are at most this many radii apart: the chain's waist is then 7 % thinner than the link.
const SPACING: f64 = 0.75;

/// Steps in which the spacing grows until a finger has few enough balls.
const WIDER: f64 = 1.2;
const WIDENINGS: usize = 12;

/// Balls that reach as far as the farthest one, to this share of its radius, end the finger with it.
const END_SHARE: f64 = 0.2;

/// Endings of a link's name that do not name its finger.
const ENDINGS: [&str; 14] = [
    "link",
    "tip",
    "distal",
    "fingertip",
    "end",
    "phalanx",
    "phalange",
    "pad",
    "dist",
    "last",
    "3",
    "2",
    "1",
    "0",
];

/// The finger that ends in `leaf`, its pad not known yet; first segment in the frame of the palm's link.
pub(super) fn finger(
    description: &Description,
    tree: &Tree,
    palm: (usize, &IsometryMatrix3<f64>),
    leaf: usize,
    name: String,
    (joints, files, overrides): (&mut Joints, &Files, &Overrides),
    warnings: &mut Vec<String>,
) -> Result<Finger, Problem> {
    let (palm_body, link_from_body) = palm;
    let bodies = tree.chain(palm_body, leaf).unwrap_or_default();
    let link_name = |body: usize| description.links[tree.bodies[body].links[0].0].name.clone();
    let mut segments = Vec::new();
    for (i, &body) in bodies.iter().enumerate() {
        let Some(connection) = &tree.bodies[body].joint else { continue };
        let drive = joints.drive(description, overrides, connection.joint, warnings)?;
        let parent_from_body = match i {
            0 => link_from_body * connection.parent_from_body,
            _ => connection.parent_from_body,
        };
        segments.push(Segment::new(
            link_name(body),
            parent_from_body,
            connection.axis,
            connection.motion,
            drive.joint,
            [drive.multiplier, drive.offset],
        ));
    }
    let shapes: Vec<Vec<Placed>> = bodies
        .iter()
        .map(|&body| balls::shapes(description, &tree.bodies[body].links, files, warnings))
        .collect::<Result<_, _>>()?;
    let mut spacing = SPACING;
    let mut beads = Vec::new();
    for widening in 0..=WIDENINGS {
        let mut said = Vec::new();
        beads = self::beads(description, &shapes, spacing, &mut said);
        if beads.len() <= MAX_BEADS || widening == WIDENINGS {
            warnings.append(&mut said);
            break;
        }
        spacing *= WIDER;
    }
    if spacing > SPACING {
        warnings.push(format!(
            "finger {name}: balls up to {spacing:.2} radii apart, so that {MAX_BEADS} are enough"
        ));
    }
    let limits = |joint: usize| [joints.joints[joint].lower_rad, joints.joints[joint].upper_rad];
    Finger::new(name.clone(), segments, beads, Vector3::z_axis(), limits).map_err(|error| match error {
        FingerError::NoTip { .. } | FingerError::Beads { count: 0, .. } => {
            Problem::NoShape { finger: name, link: link_name(leaf) }
        }
        other => Problem::Finger(other),
    })
}

/// Balls of all segments, root first and the tip's last.
fn beads(
    description: &Description,
    shapes: &[Vec<Placed>],
    spacing: f64,
    warnings: &mut Vec<String>,
) -> Vec<Bead> {
    let last = shapes.len().saturating_sub(1);
    let mut beads = Vec::new();
    for (segment, shapes) in shapes.iter().enumerate() {
        let mut balls = balls::balls(description, shapes, spacing, warnings);
        let bead = |part, ball: &Ball| Bead {
            segment,
            part,
            center_in_segment: ball.center,
            radius_m: ball.radius_m,
        };
        let reach_m = |ball: &Ball| ball.center.coords.norm() + ball.radius_m;
        balls.sort_by(|a, b| reach_m(a).total_cmp(&reach_m(b)));
        if segment != last {
            beads.extend(balls.iter().map(|ball| bead(Part::Inner, ball)));
            continue;
        }
        let (before, end, tip) = end(&balls);
        beads.extend(before.iter().map(|ball| bead(Part::Distal, ball)));
        beads.extend(end.iter().chain(&tip).map(|ball| bead(Part::Tip, ball)));
    }
    beads
}

/// The balls of the last link in three: those before its end, those at its end, and the tip, which is the one at the end
/// or, of several, one in their middle.
fn end(balls: &[Ball]) -> (Vec<Ball>, Vec<Ball>, Option<Ball>) {
    let Some(farthest) = balls.last() else { return Default::default() };
    // Along the link's middle: the farthest ball of a wide link may be one at a corner.
    let sum: Vector3<f64> = balls.iter().map(|ball| ball.center.coords).sum();
    let along = sum.try_normalize(1e-6).unwrap_or_else(Vector3::z);
    let reach_m = |ball: &Ball| ball.center.coords.dot(&along) + ball.radius_m;
    let most_m = balls.iter().map(reach_m).fold(f64::NEG_INFINITY, f64::max);
    let is_end = |ball: &&Ball| reach_m(ball) > most_m - END_SHARE * farthest.radius_m;
    let (end, before): (Vec<Ball>, Vec<Ball>) = balls.iter().partition(|ball| is_end(ball));
    match end.as_slice() {
        [one] => (before, Vec::new(), Some(*one)),
        _ => {
            let sum: Vector3<f64> = end.iter().map(|ball| ball.center.coords).sum();
            let middle = Ball {
                center: Point3::from(sum / end.len() as f64),
                radius_m: end.iter().map(|ball| ball.radius_m).fold(f64::INFINITY, f64::min),
            };
            (before, end, Some(middle))
        }
    }
}

/// Names of fingers from the names of their last links: without endings such as `_distal_link` and without the beginning
/// that all share. Where that does not tell them apart, the whole names.
pub(super) fn names(links: &[String]) -> Vec<String> {
    let words = |link: &String| -> Vec<String> {
        link.split(['_', '-', '.', ' ']).filter(|word| !word.is_empty()).map(str::to_owned).collect()
    };
    let mut all: Vec<Vec<String>> = links.iter().map(words).collect();
    for words in &mut all {
        while words.len() > 1
            && words.last().is_some_and(|w| ENDINGS.contains(&w.to_ascii_lowercase().as_str()))
        {
            words.pop();
        }
    }
    while all.len() > 1 && all.iter().all(|words| words.len() > 1 && words[0] == all[0][0]) {
        all.iter_mut().for_each(|words| drop(words.remove(0)));
    }
    let short: Vec<String> = all.iter().map(|words| words.join("_").to_ascii_lowercase()).collect();
    let are_distinct =
        short.iter().enumerate().all(|(i, name)| !name.is_empty() && !short[..i].contains(name));
    if are_distinct { short } else { links.to_vec() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_what_tells_fingers_apart() {
        let names_of = |links: &[&str]| names(&links.iter().map(|&link| link.to_owned()).collect::<Vec<_>>());
        assert_eq!(names_of(&["thumb_distal_link", "ring_distal_link"]), ["thumb", "ring"]);
        assert_eq!(names_of(&["rh_ffdistal", "rh_thdistal"]), ["ffdistal", "thdistal"]);
        assert_eq!(names_of(&["finger_a_tip", "finger_b_tip"]), ["a", "b"]);
        // Numbers alone are endings: the whole names stay.
        assert_eq!(names_of(&["link_1", "link_2"]), ["link_1", "link_2"]);
    }

    #[test]
    fn several_balls_at_the_end_have_a_tip_in_their_middle() {
        let ball = |x, y, radius_m| Ball { center: Point3::new(x, y, 0.0), radius_m };
        let (before, end, tip) =
            end(&[ball(0.01, 0.0, 0.008), ball(0.04, -0.005, 0.006), ball(0.04, 0.005, 0.006)]);
        assert_eq!((before.len(), end.len()), (1, 2));
        let tip = tip.unwrap();
        assert!((tip.center.coords - Vector3::new(0.04, 0.0, 0.0)).norm() < 1e-12 && tip.radius_m == 0.006);
        let (before, end, tip) = super::end(&[ball(0.01, 0.0, 0.008), ball(0.04, 0.0, 0.006)]);
        assert_eq!((before.len(), end.len(), tip), (1, 0, Some(ball(0.04, 0.0, 0.006))));
    }
}
