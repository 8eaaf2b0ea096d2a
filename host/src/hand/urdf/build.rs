//! A hand from its parts.

use nalgebra::{Isometry3, IsometryMatrix3, Point3, Translation3, Unit, Vector3};

use super::description::{Description, pose};
use super::error::Problem;
use super::files::Files;
use super::joints::Joints;
use super::opposition::State;
use super::overrides::Overrides;
use super::tree::Tree;
use super::{Loaded, balls, chains, flexion, opposition, palm, typical};
use crate::hand::{
    Candidate, Finger, Hand, Joint, MAX_FINGERS, PalmBox, SOFT_TIP_TORSION_M, Segment, hash_of,
};

/// Friction coefficient of links and palm, which are taken to be of metal and plastic.
const LINK_FRICTION: f64 = 0.3;

/// Mass of a hand whose description has none, kg.
const MASS_KG: f64 = 1.0;

/// What a fingertip presses, as it follows from the drives' torques, is kept to this, N: many descriptions have torques
/// of no meaning.
const TIP_FORCE_RANGE_N: [f64; 2] = [1.0, 20.0];

/// Open fingers whose directions sum to less than this each do not say where the hand points.
const COMMON_MIN: f64 = 0.4;

/// Reads a hand from the text of its description.
pub(super) fn hand(text: &str, files: &Files, overrides: &Overrides) -> Result<Loaded, Problem> {
    let description = Description::parse(text)?;
    overrides.check_names(&description)?;
    let mut warnings = Vec::new();
    let tree = Tree::new(&description, overrides, &mut warnings)?;
    let Branches { palm_body, leaves } = branches(&description, &tree, overrides)?;
    let palm_link = palm_link(&description, &tree, palm_body, &leaves, overrides);
    let link_from_body = pose_in_body(&tree, palm_body, palm_link).inverse();

    let mut joints = Joints::default();
    let names = finger_names(&description, &tree, &leaves, overrides)?;
    let mut fingers: Vec<Finger> = Vec::new();
    for (&leaf, name) in leaves.iter().zip(names) {
        let parts = (&mut joints, files, overrides);
        fingers.push(chains::finger(
            &description,
            &tree,
            (palm_body, &link_from_body),
            leaf,
            name,
            parts,
            &mut warnings,
        )?);
    }
    let mut joints = joints.joints;
    flexion::find(&mut joints, &mut fingers, overrides, &mut warnings)?;
    let opposing = match &overrides.opposing {
        Some(name) => fingers.iter().position(|finger| finger.name == *name).ok_or_else(|| {
            Problem::Unknown { key: "opposing".to_owned(), what: "finger", name: name.clone() }
        })?,
        None => opposition::opposing(&joints, &fingers),
    };
    let order = opposition::order(&joints, &fingers, opposing);
    let link_from_palm = link_from_palm(&joints, &fingers, opposing, overrides);
    let palm_from_link = link_from_palm.inverse();
    let fingers: Vec<Finger> = order
        .iter()
        .map(|&finger| moved(&fingers[finger], &palm_from_link, &joints))
        .collect::<Result<_, _>>()?;

    let mut candidates = typical::candidates(&joints, &fingers);
    if candidates.is_empty() {
        warnings.push(Problem::NoCandidate.to_string());
    }
    candidates.extend(typical::power(&joints, &fingers, &candidates));
    let palm = palm_boxes(
        &description,
        &tree,
        (palm_body, palm_link),
        &(palm_from_link * link_from_body),
        (&joints, &fingers),
        files,
        &mut warnings,
    )?;
    if palm.is_empty() {
        warnings.push(format!(
            "link '{}' has no shape: the hand is planned without a palm",
            description.links[palm_link].name
        ));
        candidates.retain(|candidate| !candidate.wraps);
    }
    let mut hand = Hand {
        name: overrides.name.clone().unwrap_or_else(|| description.name.clone()),
        sha256: String::new(),
        grasp_center_in_palm: grasp_center(&joints, &fingers, candidates.first()),
        pressing_in_palm: pressing(&joints, &fingers),
        link_friction: LINK_FRICTION,
        soft_tip_torsion_m: overrides.soft_tip_torsion_m.unwrap_or(SOFT_TIP_TORSION_M),
        tip_force_max_n: overrides.tip_force_n.unwrap_or_else(|| tip_force_n(&joints, &fingers)),
        mass_kg: overrides
            .mass_kg
            .unwrap_or_else(|| mass_kg(&description, &tree, palm_body, palm_link, &mut warnings)),
        joints,
        fingers,
        palm,
        candidates,
        model: None,
    };
    hand.sha256 = hash_of(&hand);
    Ok(Loaded {
        flange_from_palm: overrides.mount().unwrap_or_else(|| on_flange(&hand.palm)),
        is_mount_given: overrides.mount().is_some(),
        palm_link: description.links[palm_link].name.clone(),
        link_from_palm: palm::quaternion(&link_from_palm),
        hand,
        warnings,
    })
}

/// The palm's body and the bodies in which fingers end.
struct Branches {
    palm_body: usize,
    leaves: Vec<usize>,
}

fn branches(description: &Description, tree: &Tree, overrides: &Overrides) -> Result<Branches, Problem> {
    let body_of = |link: &str| description.link_index(link).map(|link| tree.body_of[link]);
    let tips: Vec<usize> = overrides.finger.iter().filter_map(|finger| body_of(&finger.tip)).collect();
    let palm_body = match (overrides.palm.link.as_deref().and_then(body_of), tips.as_slice()) {
        (Some(body), _) => body,
        (None, []) => tree.palm(description)?,
        (None, tips) => tree.common_ancestor(tips),
    };
    let leaves = if tips.is_empty() { tree.leaves(palm_body) } else { tips };
    match leaves.len() {
        count @ 0..=1 => return Err(Problem::NoFingers { count }),
        count if count > MAX_FINGERS => return Err(Problem::TooManyFingers { count }),
        _ => {}
    }
    let refused =
        |i: usize, text: &str| Err(Problem::Value { key: format!("finger[{i}].tip"), text: text.to_owned() });
    for (i, leaf) in leaves.iter().enumerate() {
        if leaves[..i].contains(leaf) {
            return refused(i, "another finger ends in the same moving link");
        }
    }
    for (i, leaf) in leaves.iter().enumerate() {
        if tree.chain(palm_body, *leaf).is_none_or(|chain| chain.is_empty()) {
            return refused(i, "no joint moves this link in the palm");
        }
    }
    Ok(Branches { palm_body, leaves })
}

/// The palm's link: as asked for, else the deepest one of its body that carries all fingers.
fn palm_link(
    description: &Description,
    tree: &Tree,
    palm_body: usize,
    leaves: &[usize],
    overrides: &Overrides,
) -> usize {
    let own = overrides.palm.link.as_deref().and_then(|link| description.link_index(link));
    let first_of_body = tree.bodies[palm_body].links[0].0;
    own.unwrap_or_else(|| {
        let carrying: Vec<usize> = leaves
            .iter()
            .filter_map(|&leaf| tree.chain(palm_body, leaf)?.first().copied())
            .filter_map(|body| tree.bodies[body].joint.as_ref().map(|joint| joint.link))
            .collect();
        tree.common_link(&carrying).unwrap_or(first_of_body)
    })
}

fn pose_in_body(tree: &Tree, body: usize, link: usize) -> IsometryMatrix3<f64> {
    let place = tree.bodies[body].links.iter().find(|(other, _)| *other == link);
    place.map_or_else(IsometryMatrix3::identity, |(_, pose)| *pose)
}

fn finger_names(
    description: &Description,
    tree: &Tree,
    leaves: &[usize],
    overrides: &Overrides,
) -> Result<Vec<String>, Problem> {
    let last_links: Vec<String> =
        leaves.iter().map(|&leaf| description.links[tree.bodies[leaf].links[0].0].name.clone()).collect();
    let found = chains::names(&last_links);
    let given = |i: usize| overrides.finger.get(i).and_then(|finger| finger.name.clone());
    let names: Vec<String> =
        found.into_iter().enumerate().map(|(i, name)| given(i).unwrap_or(name)).collect();
    for (i, name) in names.iter().enumerate() {
        let refused = |text: String| Err(Problem::Value { key: format!("finger[{i}].name"), text });
        // Contacts of the palm are named so in plans.
        if name.trim().is_empty() || name == "palm" {
            return refused(format!("'{name}' is no name for a finger"));
        }
        if names[..i].contains(name) {
            return refused(format!("a second finger is named '{name}'"));
        }
    }
    Ok(names)
}

/// Pose of the palm frame in the palm's link: as the overrides say, else turned by quarter turns about its origin.
fn link_from_palm(
    joints: &[Joint],
    fingers: &[Finger],
    opposing: usize,
    overrides: &Overrides,
) -> IsometryMatrix3<f64> {
    let xyz = Vector3::from(overrides.palm.xyz.unwrap_or_default());
    match overrides.palm.rpy {
        Some(rpy) => pose(xyz, Vector3::from(rpy)),
        None => IsometryMatrix3::from_parts(
            Translation3::from(xyz),
            opposition::link_from_palm(joints, fingers, opposing),
        ),
    }
}

/// The finger in another frame of the palm.
fn moved(
    finger: &Finger,
    palm_from_link: &IsometryMatrix3<f64>,
    joints: &[Joint],
) -> Result<Finger, Problem> {
    let mut segments = finger.segments().to_vec();
    if let Some(first) = segments.first_mut() {
        *first = Segment::new(
            first.link.clone(),
            palm_from_link * first.parent_from_segment(),
            first.axis(),
            first.motion(),
            first.joint,
            [first.multiplier, first.offset_rad],
        );
    }
    let limits = |joint: usize| [joints[joint].lower_rad, joints[joint].upper_rad];
    let (name, beads) = (finger.name.clone(), finger.beads().to_vec());
    Ok(Finger::new(name, segments, beads, finger.pad_in_last(), limits)?)
}

/// Boxes of the palm's body, without what lies before the palm's link on an arm.
fn palm_boxes(
    description: &Description,
    tree: &Tree,
    (palm_body, palm_link): (usize, usize),
    palm_from_body: &IsometryMatrix3<f64>,
    (joints, fingers): (&[Joint], &[Finger]),
    files: &Files,
    warnings: &mut Vec<String>,
) -> Result<Vec<PalmBox>, Problem> {
    let links: Vec<(usize, IsometryMatrix3<f64>)> = tree.bodies[palm_body]
        .links
        .iter()
        .filter(|(link, _)| is_of_hand(tree, palm_body, palm_link, *link))
        .map(|(link, body_from_link)| (*link, palm_from_body * body_from_link))
        .collect();
    let shapes = balls::shapes(description, &links, files, warnings)?;
    let middle = flexion::middle(joints);
    let mut centers: Vec<Point3<f64>> = Vec::new();
    for finger in fingers {
        for posture in [middle, flexion::open(joints, finger, &middle)] {
            let mut of_finger = Vec::new();
            finger.bead_centers(&posture, &mut of_finger);
            centers.append(&mut of_finger);
        }
    }
    Ok(palm::boxes(description, &shapes, &centers, warnings))
}

/// Whether a link of the palm's body belongs to the hand: all do when no arm carries it.
fn is_of_hand(tree: &Tree, palm_body: usize, palm_link: usize, link: usize) -> bool {
    tree.bodies[palm_body].joint.is_none() || tree.is_below(link, palm_link)
}

/// The middle between the opposing tip and the mean of the others in the first candidate's preshape; without one, of all
/// tips of the half closed hand.
fn grasp_center(joints: &[Joint], fingers: &[Finger], candidate: Option<&Candidate>) -> Point3<f64> {
    let Some(candidate) = candidate else {
        let middle = flexion::middle(joints);
        let sum: Vector3<f64> = fingers.iter().map(|finger| State::new(finger, &middle).tip.coords).sum();
        return Point3::from(sum / fingers.len().max(1) as f64);
    };
    let posture = candidate.posture_at(joints, 1.0);
    let tip = |finger: usize| State::new(&fingers[finger], &posture).tip.coords;
    let others: Vec<usize> = candidate.fingers().filter(|f| *f != candidate.opposing).collect();
    let mean = others.iter().map(|&f| tip(f)).sum::<Vector3<f64>>() / others.len().max(1) as f64;
    Point3::from(0.5 * (tip(candidate.opposing) + mean))
}

/// Where the palm presses: where open pads look on the whole, as in hands like ours; between fingers whose pads look at
/// each other, away from the wrist.
fn pressing(joints: &[Joint], fingers: &[Finger]) -> Unit<Vector3<f64>> {
    let middle = flexion::middle(joints);
    let pads = fingers.iter().map(|f| State::new(f, &flexion::open(joints, f, &middle)).pad);
    let sum: Vector3<f64> = pads.sum();
    let along = if sum.norm() > COMMON_MIN * fingers.len() as f64 { sum } else { Vector3::z() };
    Unit::new_unchecked(opposition::nearest_axis(&along, None))
}

/// What the weakest closing joint bears at the tip of its stretched finger, N.
fn tip_force_n(joints: &[Joint], fingers: &[Finger]) -> f64 {
    let middle = flexion::middle(joints);
    let mut least_n = f64::INFINITY;
    for finger in fingers {
        let posture = flexion::open(joints, finger, &middle);
        let frames = finger.frames(&posture);
        let tip = finger.tip_in_palm(&frames);
        let jacobian = finger.point_jacobian(&frames, finger.segments().len() - 1, &tip);
        for (column, &joint) in finger.joints().iter().enumerate() {
            let lever_m = jacobian.column(column).norm();
            if joints[joint].flexes.is_some() && lever_m > 1e-3 {
                least_n = least_n.min(joints[joint].torque_max_nm / lever_m);
            }
        }
    }
    let [least, most] = TIP_FORCE_RANGE_N;
    if least_n.is_finite() { least_n.clamp(least, most) } else { most }
}

fn mass_kg(
    description: &Description,
    tree: &Tree,
    palm_body: usize,
    palm_link: usize,
    warnings: &mut Vec<String>,
) -> f64 {
    let of_hand = |link: &usize| {
        let body = tree.body_of[*link];
        if body == palm_body {
            is_of_hand(tree, palm_body, palm_link, *link)
        } else {
            tree.chain(palm_body, body).is_some()
        }
    };
    let sum: f64 =
        (0..description.links.len()).filter(of_hand).map(|link| description.links[link].mass_kg).sum();
    if sum > 0.0 && sum.is_finite() {
        return sum;
    }
    warnings.push(format!("the links have no mass: {MASS_KG} kg is assumed for the hand"));
    MASS_KG
}

/// Parallel to the flange, with the palm's lowest box on it.
fn on_flange(palm: &[PalmBox]) -> Isometry3<f64> {
    let lowest_m = |part: &PalmBox| {
        let z_in_box = part.palm_from_box.inverse_transform_vector(&Vector3::z());
        part.palm_from_box.translation.z - part.half_extents_m.dot(&z_in_box.abs())
    };
    let lowest_m = palm.iter().map(lowest_m).reduce(f64::min).unwrap_or(0.0);
    Isometry3::translation(0.0, 0.0, -lowest_m)
}
