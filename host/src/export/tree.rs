//! The hand as a tree of links, from which every scene and robot description is written.

use hand_model::{HandModel, LinkMass};
use nalgebra::{IsometryMatrix3, Point3, Rotation3, Translation3, Unit, Vector3};
use protocol::ids::{FingerId, FingerJoint, JointId};

/// Share of the palm's mass that turns with the thumb. Assumed: about 100 g.
const SUPPORT_SHARE: f64 = 0.1;
/// Edges of the thumb's support as a block, metres. Assumed; they set its inertia only.
const SUPPORT_EDGES_M: [f64; 3] = [0.04, 0.04, 0.06];

/// How a link turns in its parent.
pub(super) struct Hinge {
    pub(super) name: String,
    /// In the link's frame.
    pub(super) axis: Unit<Vector3<f64>>,
    pub(super) range_rad: [f64; 2],
    pub(super) torque_max_nm: f64,
    pub(super) speed_max_rad_per_s: f64,
    /// Whose angle drives it; an actuator that is not its own makes it a coupled joint.
    pub(super) actuator: JointId,
    pub(super) is_coupled: bool,
}

/// Mass, centre of mass and principal moments along the link's axes.
pub(super) struct Inertia {
    pub(super) mass_kg: f64,
    pub(super) center: Point3<f64>,
    pub(super) principal_kg_m2: [f64; 3],
}

/// The one solid of a link, in its frame, metres.
pub(super) enum Solid {
    /// Along the axes.
    Cuboid { center: Point3<f64>, half: Vector3<f64> },
    /// From the origin along x; a distal link's ends in the tip's sphere.
    Capsule { length_m: f64, radius_m: f64 },
}

/// A link. Its frame is that of `hand_model`.
pub(super) struct Link {
    pub(super) name: String,
    /// Position in the list, before its own; `None` for the palm.
    pub(super) parent: Option<usize>,
    /// At joint angle 0.
    pub(super) parent_from_link: IsometryMatrix3<f64>,
    pub(super) hinge: Option<Hinge>,
    pub(super) inertia: Inertia,
    pub(super) solid: Option<Solid>,
    /// The centre of the fingertip, in distal links.
    pub(super) tip: Option<(String, Point3<f64>)>,
}

/// All links, parents first and each finger in one run: the order of joints in a depth-first walk.
pub(super) fn links(model: &HandModel<f64>) -> Vec<Link> {
    let mut links = vec![palm(model), thumb_support(model)];
    for finger in FingerId::ALL {
        let palm_from_base = model.palm_from_finger_base(finger, 0f64.sin_cos());
        let (parent, parent_from_base) = match finger {
            FingerId::Thumb => {
                (1, Translation3::from(-model.mounts.thumb_axis_in_palm.coords) * palm_from_base)
            }
            _ => (0, palm_from_base),
        };
        add_finger(&mut links, model, finger, parent, parent_from_base);
    }
    links
}

/// Poses of the links in the palm frame.
pub(super) fn palm_from_links(
    links: &[Link],
    angles: &hand_model::HandAngles<f64>,
) -> Vec<IsometryMatrix3<f64>> {
    let angles_rad = angles.to_array();
    let mut poses: Vec<IsometryMatrix3<f64>> = Vec::with_capacity(links.len());
    for link in links {
        let turn = link.hinge.as_ref().map_or(Rotation3::identity(), |hinge| {
            Rotation3::from_axis_angle(&hinge.axis, angles_rad[hinge.actuator.index()])
        });
        let parent = link.parent.map_or(IsometryMatrix3::identity(), |parent| poses[parent]);
        poses.push(parent * link.parent_from_link * turn);
    }
    poses
}

fn block(mass_kg: f64, center: Point3<f64>, edges: &Vector3<f64>) -> Inertia {
    let squares = edges.component_mul(edges);
    let principal_kg_m2 = [0, 1, 2].map(|i| mass_kg / 12.0 * (squares.sum() - squares[i]));
    Inertia { mass_kg, center, principal_kg_m2 }
}

fn palm(model: &HandModel<f64>) -> Link {
    let cuboid = &model.collision.palm;
    let center = nalgebra::center(&cuboid.min_in_palm, &cuboid.max_in_palm);
    let edges = cuboid.max_in_palm - cuboid.min_in_palm;
    Link {
        name: "palm".to_owned(),
        parent: None,
        parent_from_link: IsometryMatrix3::identity(),
        hinge: None,
        inertia: block((1.0 - SUPPORT_SHARE) * model.palm_mass_kg, center, &edges),
        solid: Some(Solid::Cuboid { center, half: edges / 2.0 }),
        tip: None,
    }
}

fn thumb_support(model: &HandModel<f64>) -> Link {
    let axis = model.mounts.thumb_axis_in_palm;
    let range = model.hard_limits.thumb_rotation;
    let root = model.mounts.palm_from_thumb_base_at_zero.translation.vector - axis.coords;
    Link {
        name: "thumb_support".to_owned(),
        parent: Some(0),
        parent_from_link: Translation3::from(axis.coords) * IsometryMatrix3::identity(),
        hinge: Some(Hinge {
            name: JointId::THUMB_ROTATION.name().to_owned(),
            axis: -Vector3::z_axis(),
            range_rad: [range.lower_rad, range.upper_rad],
            torque_max_nm: model.thumb_rotation.holding_torque_nm,
            speed_max_rad_per_s: model.thumb_rotation.speed_max_rad_per_s,
            actuator: JointId::THUMB_ROTATION,
            is_coupled: false,
        }),
        inertia: block(SUPPORT_SHARE * model.palm_mass_kg, Point3::from(root), &SUPPORT_EDGES_M.into()),
        solid: None,
        tip: None,
    }
}

fn add_finger(
    links: &mut Vec<Link>,
    model: &HandModel<f64>,
    finger: FingerId,
    parent: usize,
    parent_from_base: IsometryMatrix3<f64>,
) {
    let (geometry, limits, masses, drive) = (&model.finger, &model.hard_limits, &model.masses, &model.drive);
    let radii = model.collision.link_radii_m;
    let solid = |length_m, radius_m| Some(Solid::Capsule { length_m, radius_m });
    let along = |length_m| Translation3::new(length_m, 0.0, 0.0) * IsometryMatrix3::identity();
    // Link, its joint, where the joint stands in the link before, range, mass, solid. The distal joint repeats the middle.
    let parts = [
        ("base", "abduction", parent_from_base, limits.abduction, &masses.base, None),
        ("proximal", "flexion", along(0.0), limits.flexion, &masses.proximal, solid(geometry.l1_m, radii[0])),
        (
            "middle",
            "middle",
            along(geometry.l1_m),
            limits.middle,
            &masses.middle,
            solid(geometry.l2_m, radii[1]),
        ),
        (
            "distal",
            "distal",
            along(geometry.l2_m),
            limits.middle,
            &masses.distal,
            solid(geometry.l3_m, radii[2]),
        ),
    ];
    for (k, (link, joint, parent_from_link, range, mass, solid)) in parts.into_iter().enumerate() {
        let own = FingerJoint::ALL[k.min(2)];
        let name = finger.name();
        links.push(Link {
            name: format!("{name}_{link}_link"),
            parent: Some(if k == 0 { parent } else { links.len() - 1 }),
            parent_from_link,
            hinge: Some(Hinge {
                name: format!("{name}_{joint}"),
                axis: if k == 0 { Vector3::z_axis() } else { -Vector3::y_axis() },
                range_rad: [range.lower_rad, range.upper_rad],
                torque_max_nm: drive.torque_max_nm[k.min(2)],
                speed_max_rad_per_s: drive.speed_max_rad_per_s,
                actuator: JointId::of(finger, own),
                is_coupled: k == 3,
            }),
            inertia: inertia(mass),
            solid,
            tip: (k == 3).then(|| (format!("{name}_tip"), Point3::new(geometry.l3_m, 0.0, 0.0))),
        });
    }
}

fn inertia(mass: &LinkMass<f64>) -> Inertia {
    Inertia {
        mass_kg: mass.mass_kg,
        center: Point3::new(mass.com_m, 0.0, 0.0),
        principal_kg_m2: mass.inertia_kg_m2,
    }
}
