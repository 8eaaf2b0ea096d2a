//! The hand, and the arm with the hand, as URDF.
//!
//! Distal joints are `mimic` joints of the middle ones. Solids are cylinders with a sphere at either end and a box for
//! the palm: nothing refers to another file.

use hand_model::HandModel;
use nalgebra::{IsometryMatrix3, Point3, Rotation3, Translation3, Vector3};

use super::text::spaced;
use super::tree::{Hinge, Inertia, Link, Solid, links};
use crate::plan::arm::Arm;

/// The root of the arm's description: the robot's base frame.
pub const BASE_LINK: &str = "base_link";
/// The arm's last link, whose frame is the flange's: the parent link of the hand.
pub const FLANGE_LINK: &str = "link_6";

/// URDF wants a limit of torque; the arm's manual has none for its axes, so this is one that does not limit.
const ARM_EFFORT_NM: f64 = 1000.0;

/// The hand alone; its root is `palm`.
#[must_use]
pub fn hand(model: &HandModel<f64>) -> String {
    let mut text = head(
        "hit_dlr_hand",
        "The HIT/DLR hand (right). Metres, radians, kilograms. Root link palm: origin at the wrist plane,\n     \
         z along the stretched fingers, x out of the grasping side, y to the index. Finger links: x along the link, z to\n     \
         the pad. Joint angle 0 is the stretched finger; each distal joint repeats the middle joint (mimic).",
    );
    text += &hand_elements(model);
    text + "</robot>\n"
}

/// The arm with the hand on its flange; its root is [`BASE_LINK`].
///
/// The arm's links have no inertia: its maker publishes none.
#[must_use]
pub fn arm_with_hand(arm: &Arm, model: &HandModel<f64>) -> String {
    // A comment must not hold two hyphens.
    let name = arm.params().name.replace('-', " ");
    let mut text = head(
        "arm_hit_dlr",
        &format!(
            "{name} with the HIT/DLR hand. Metres, radians, kilograms. Root base_link: z up along axis 1.\n     \
             link_6: the flange, z away from the arm; the hand's root palm is fixed to it. The arm's links have no inertia\n     \
             and its effort limits are none."
        ),
    );
    text += &link_element(BASE_LINK, None, &arm_solids(arm, 0));
    let frames = arm.link_frames(&[0.0; 6]);
    let (params, sign) = (arm.params(), arm.params().geometry.sign);
    let axes = [Vector3::z(), Vector3::y(), Vector3::y(), Vector3::z(), Vector3::y(), Vector3::z()];
    for i in 0..6 {
        let name = format!("link_{}", i + 1);
        text += &link_element(&name, None, &arm_solids(arm, i + 1));
        let (parent, parent_from_link) = match i {
            0 => (BASE_LINK.to_owned(), frames[0]),
            _ => (format!("link_{i}"), frames[i - 1].inverse() * frames[i]),
        };
        let matrix = IsometryMatrix3::from_parts(
            parent_from_link.translation,
            parent_from_link.rotation.to_rotation_matrix(),
        );
        text += &format!(
            "  <joint name=\"joint_{}\" type=\"revolute\">\n    {}\n    <parent link=\"{parent}\"/>\n    \
             <child link=\"{name}\"/>\n    <axis xyz=\"{}\"/>\n    \
             <limit lower=\"{}\" upper=\"{}\" effort=\"{ARM_EFFORT_NM}\" velocity=\"{}\"/>\n  </joint>\n",
            i + 1,
            origin(&matrix),
            spaced(&<[f64; 3]>::from(axes[i] * sign[i])),
            params.limits.lower_rad[i],
            params.limits.upper_rad[i],
            params.speed_rad_per_s[i],
        );
    }
    let mount = arm.flange_from_palm();
    let mount = IsometryMatrix3::from_parts(mount.translation, mount.rotation.to_rotation_matrix());
    text += &fixed("hand_mount", FLANGE_LINK, "palm", &mount);
    text += &hand_elements(model);
    text + "</robot>\n"
}

fn head(name: &str, comment: &str) -> String {
    format!("<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<robot name=\"{name}\">\n  <!-- {comment} -->\n")
}

fn hand_elements(model: &HandModel<f64>) -> String {
    let links = links(model);
    let mut text = String::new();
    for link in &links {
        text += &link_element(&link.name, Some(&link.inertia), &solids(link));
        if let (Some(hinge), Some(parent)) = (&link.hinge, link.parent) {
            text += &joint_element(model, hinge, &links[parent].name, link);
        }
        if let Some((name, center)) = &link.tip {
            text += &link_element(name, None, &[]);
            let link_from_tip = Translation3::from(center.coords) * IsometryMatrix3::identity();
            text += &fixed(&format!("{name}_fixed"), &link.name, name, &link_from_tip);
        }
    }
    text
}

fn joint_element(model: &HandModel<f64>, hinge: &Hinge, parent: &str, link: &Link) -> String {
    let mimic = if hinge.is_coupled {
        format!("    <mimic joint=\"{}\" multiplier=\"1\" offset=\"0\"/>\n", hinge.actuator.name())
    } else {
        String::new()
    };
    format!(
        "  <joint name=\"{}\" type=\"revolute\">\n    {}\n    <parent link=\"{parent}\"/>\n    <child link=\"{}\"/>\n    \
         <axis xyz=\"{}\"/>\n    <limit lower=\"{}\" upper=\"{}\" effort=\"{}\" velocity=\"{}\"/>\n    \
         <dynamics damping=\"{}\" friction=\"{}\"/>\n{mimic}  </joint>\n",
        hinge.name,
        origin(&link.parent_from_link),
        link.name,
        spaced(hinge.axis.iter()),
        hinge.range_rad[0],
        hinge.range_rad[1],
        hinge.torque_max_nm,
        hinge.speed_max_rad_per_s,
        model.drive.viscous_friction_nm_s_per_rad,
        model.drive.coulomb_friction_nm,
    )
}

fn fixed(name: &str, parent: &str, child: &str, parent_from_child: &IsometryMatrix3<f64>) -> String {
    format!(
        "  <joint name=\"{name}\" type=\"fixed\">\n    {}\n    <parent link=\"{parent}\"/>\n    \
         <child link=\"{child}\"/>\n  </joint>\n",
        origin(parent_from_child)
    )
}

/// Roll, pitch and yaw come from the matrix: by way of a quaternion, a pitch near a quarter turn, as the fingers have it,
/// would lose half of its digits.
fn origin(pose: &IsometryMatrix3<f64>) -> String {
    let (roll, pitch, yaw) = pose.rotation.euler_angles();
    format!(
        "<origin xyz=\"{}\" rpy=\"{}\"/>",
        spaced(pose.translation.vector.iter()),
        spaced(&[roll, pitch, yaw])
    )
}

fn link_element(name: &str, inertia: Option<&Inertia>, solids: &[String]) -> String {
    if inertia.is_none() && solids.is_empty() {
        return format!("  <link name=\"{name}\"/>\n");
    }
    let mut text = format!("  <link name=\"{name}\">\n");
    if let Some(Inertia { mass_kg, center, principal_kg_m2: [xx, yy, zz] }) = inertia {
        text += &format!(
            "    <inertial>\n      <origin xyz=\"{}\" rpy=\"0 0 0\"/>\n      <mass value=\"{mass_kg}\"/>\n      \
             <inertia ixx=\"{xx}\" ixy=\"0\" ixz=\"0\" iyy=\"{yy}\" iyz=\"0\" izz=\"{zz}\"/>\n    </inertial>\n",
            spaced(center.iter())
        );
    }
    for element in ["visual", "collision"] {
        for solid in solids {
            text += &format!("    <{element}>\n{solid}    </{element}>\n");
        }
    }
    text + "  </link>\n"
}

fn solids(link: &Link) -> Vec<String> {
    match &link.solid {
        None => Vec::new(),
        Some(Solid::Cuboid { center, half }) => {
            let at = Translation3::from(center.coords) * IsometryMatrix3::identity();
            vec![solid(&at, &format!("<box size=\"{}\"/>", spaced((half * 2.0).iter())))]
        }
        Some(Solid::Capsule { length_m, radius_m }) => {
            capsule(&Point3::origin(), &Point3::new(*length_m, 0.0, 0.0), *radius_m)
        }
    }
}

fn arm_solids(arm: &Arm, link: usize) -> Vec<String> {
    let of_link = arm.link_capsules().iter().filter(|capsule| capsule.link == link);
    of_link.flat_map(|c| capsule(&c.from, &c.to, c.radius_m)).collect()
}

/// URDF knows no capsule.
fn capsule(from: &Point3<f64>, to: &Point3<f64>, radius_m: f64) -> Vec<String> {
    let along = to - from;
    // A cylinder's axis is z; half a turn about x is as good as any for the opposite direction.
    let turn = Rotation3::rotation_between(&Vector3::z(), &along)
        .unwrap_or_else(|| Rotation3::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
    let middle = Translation3::from(nalgebra::center(from, to).coords);
    let cylinder = format!("<cylinder radius=\"{radius_m}\" length=\"{}\"/>", along.norm());
    let ball = format!("<sphere radius=\"{radius_m}\"/>");
    let at = |end: &Point3<f64>| Translation3::from(end.coords) * IsometryMatrix3::identity();
    vec![
        solid(&IsometryMatrix3::from_parts(middle, turn), &cylinder),
        solid(&at(from), &ball),
        solid(&at(to), &ball),
    ]
}

fn solid(at: &IsometryMatrix3<f64>, geometry: &str) -> String {
    format!("      {}\n      <geometry>{geometry}</geometry>\n", origin(at))
}
