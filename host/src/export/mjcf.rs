//! A grasp as a self-contained MuJoCo scene: hand, object and keyframes in one MJCF file.
//!
//! <https://mujoco.readthedocs.io/en/stable/XMLreference.html>

use hand_model::{HandAngles, HandModel};
use nalgebra::{Isometry3, Point3};
use parry3d_f64::{math::Vector, transformation::try_convex_hull};
use protocol::ids::JointId;
use thiserror::Error;

use super::Grasp;
use super::text::{position_and_wxyz, spaced};
use super::tree::{Link, Solid, links};
use crate::surface::Mesh;

/// Stiffness of the position actuators, N m/rad: the firmware's in the fingers' joints. The thumb's Cartesian stiffness
/// amounts to about as much at its tip.
const STIFFNESS_NM_PER_RAD: f64 = 6.0;
/// Damping of the position actuators, N m s/rad: the firmware's.
const DAMPING_NM_S_PER_RAD: f64 = 0.12;
/// Stiffness of the thumb's braked rotation, N m/rad: 1.7 mrad at 1.7 N m, below its step of a degree.
const BRAKE_NM_PER_RAD: f64 = 1000.0;
/// Damping of the brake, N m s/rad: about critical for its inertia.
const BRAKE_DAMPING_NM_S_PER_RAD: f64 = 2.0;
/// Friction of the palm and the inner links, metal and plastic (assumed).
const LINK_FRICTION: f64 = 0.3;

/// Why there is no scene.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum MjcfError {
    /// Nothing of the object has a volume.
    #[error("the object has no convex piece with a volume")]
    NoPieces,
    /// A mass that no body has.
    #[error("an object of {0} kg")]
    Mass(f64),
    /// A coefficient that no contact has.
    #[error("friction {0} is no coefficient")]
    Friction(f64),
}

/// The object of a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneObject {
    /// Vertices of convex pieces whose union is the object, object frame, metres.
    pub pieces: Vec<Vec<Point3<f64>>>,
    /// Where it stands.
    pub base_from_object: Isometry3<f64>,
    /// Mass.
    pub mass_kg: f64,
    /// Coulomb friction of the fingers on it.
    pub friction: f64,
}

/// The scene, in the base frame: the palm fixed at the grasp site, the object free.
///
/// Keyframes: `pregrasp` (open), `grasp` (tips touching) and `squeeze` (tips touching, targets behind the surface: what
/// holds the object: [`Grasp::squeeze`] has to be for joints under position control). There is no table, so that gravity may point anywhere. Mass is spread evenly over the pieces; ones
/// without a volume are left out.
pub fn scene(model: &HandModel<f64>, grasp: &Grasp, object: &SceneObject) -> Result<String, MjcfError> {
    if !(object.mass_kg > 0.0 && object.mass_kg.is_finite()) {
        return Err(MjcfError::Mass(object.mass_kg));
    }
    if !(object.friction >= 0.0 && object.friction.is_finite()) {
        return Err(MjcfError::Friction(object.friction));
    }
    let hulls: Vec<(Vec<Point3<f64>>, f64)> = object.pieces.iter().filter_map(|piece| hull(piece)).collect();
    let volume_m3: f64 = hulls.iter().map(|(_, volume_m3)| volume_m3).sum();
    if hulls.is_empty() {
        return Err(MjcfError::NoPieces);
    }
    let links = links(model);
    let mut text = String::from(HEAD);
    text += "  <asset>\n";
    for (i, (corners, _)) in hulls.iter().enumerate() {
        let corners: Vec<f64> = corners.iter().flat_map(|p| <[f64; 3]>::from(p.coords)).collect();
        text += &format!("    <mesh name=\"piece_{}\" vertex=\"{}\"/>\n", i + 1, spaced(&corners));
    }
    text += "  </asset>\n  <worldbody>\n    <light pos=\"0.4 -0.5 1\" dir=\"0 0.4 -1\"/>\n";
    write_link(&mut text, model, &links, 0, &grasp.grasp_site, &contact(object.friction, grasp.torsional_m));
    let [position, wxyz] = position_and_wxyz(&object.base_from_object);
    text += &format!(
        "    <body name=\"object\" pos=\"{position}\" quat=\"{wxyz}\">\n      <freejoint name=\"object\"/>\n"
    );
    for i in 1..=hulls.len() {
        text += &format!(
            "      <geom type=\"mesh\" mesh=\"piece_{i}\" density=\"{}\" contype=\"2\" conaffinity=\"1\" \
             friction=\"{LINK_FRICTION}\" rgba=\"0.85 0.6 0.3 1\"/>\n",
            object.mass_kg / volume_m3
        );
    }
    text += "    </body>\n  </worldbody>\n";
    text += &coupling_and_actuators(&links);
    text += &keyframes(&links, grasp, &object.base_from_object);
    Ok(text + "</mujoco>\n")
}

/// `impratio` keeps soft contacts from creeping: at 10 a held object slides by a millimetre in a second.
const HEAD: &str = "<mujoco model=\"grasp\">\n  \
    <!-- A grasp of the HIT/DLR hand. Metres, radians, kilograms. World: the robot's base frame, z up. The palm is fixed\n       \
    at the grasp site, the object is free. Position actuators take joint angles; each distal joint repeats the middle\n       \
    joint (equality). Keyframes: pregrasp, grasp, squeeze; start from squeeze to see the object held. No table. -->\n  \
    <compiler angle=\"radian\" autolimits=\"true\"/>\n  \
    <option timestep=\"0.001\" integrator=\"implicitfast\" cone=\"elliptic\" impratio=\"100\"/>\n";

/// The fingertips' friction goes before that of the object.
fn contact(friction: f64, torsional_m: f64) -> String {
    if torsional_m > 0.0 {
        format!("condim=\"4\" priority=\"1\" friction=\"{friction} {torsional_m}\"")
    } else {
        format!("condim=\"3\" priority=\"1\" friction=\"{friction}\"")
    }
}

/// Vertices of the convex hull and its volume; `None` without a volume.
fn hull(piece: &[Point3<f64>]) -> Option<(Vec<Point3<f64>>, f64)> {
    let points: Vec<Vector> = piece.iter().map(|p| Vector::new(p.x, p.y, p.z)).collect();
    let (corners, faces) = try_convex_hull(&points).ok()?;
    let corners: Vec<Point3<f64>> = corners.iter().map(|p| Point3::new(p.x, p.y, p.z)).collect();
    let mesh = Mesh::new(corners.clone(), faces).ok()?;
    let (volume_m3, (low, high)) = (mesh.signed_volume_m3().abs(), mesh.bounding_box());
    // Rounding gives flat sets a volume, too.
    (volume_m3 > 1e-9 * (high - low).amax().powi(3)).then_some((corners, volume_m3))
}

/// A body with everything that hangs on it.
fn write_link(
    text: &mut String,
    model: &HandModel<f64>,
    links: &[Link],
    index: usize,
    parent_from_link: &Isometry3<f64>,
    contact: &str,
) {
    let link = &links[index];
    let [position, wxyz] = position_and_wxyz(parent_from_link);
    let inertia = &link.inertia;
    *text += &format!("    <body name=\"{}\" pos=\"{position}\" quat=\"{wxyz}\">\n", link.name);
    *text += &format!(
        "      <inertial pos=\"{}\" mass=\"{}\" diaginertia=\"{}\"/>\n",
        spaced(inertia.center.iter()),
        inertia.mass_kg,
        spaced(&inertia.principal_kg_m2)
    );
    if let Some(hinge) = &link.hinge {
        // The coupled joint has no drive of its own. The drives' Coulomb friction is left out: the firmware compensates
        // it, and without that it would eat a fifth of a fingertip's force.
        let drive = if hinge.is_coupled {
            String::new()
        } else {
            format!(
                " damping=\"{}\" armature=\"{}\"",
                model.drive.viscous_friction_nm_s_per_rad, model.drive.rotor_inertia_kg_m2
            )
        };
        *text += &format!(
            "      <joint name=\"{}\" axis=\"{}\" range=\"{}\"{drive}/>\n",
            hinge.name,
            spaced(hinge.axis.iter()),
            spaced(&hinge.range_rad)
        );
    }
    // Hand and object touch each other, the hand not itself.
    let attributes = "contype=\"1\" conaffinity=\"2\"";
    match &link.solid {
        Some(Solid::Cuboid { center, half }) => {
            *text += &format!(
                "      <geom type=\"box\" pos=\"{}\" size=\"{}\" {attributes} friction=\"{LINK_FRICTION}\"/>\n",
                spaced(center.iter()),
                spaced(half.iter())
            );
        }
        Some(Solid::Capsule { length_m, radius_m }) => {
            let friction = format!("friction=\"{LINK_FRICTION}\"");
            let friction = if link.tip.is_some() { contact } else { &friction };
            *text += &format!(
                "      <geom type=\"capsule\" fromto=\"0 0 0 {length_m} 0 0\" size=\"{radius_m}\" {attributes} {friction}/>\n"
            );
        }
        None => {}
    }
    if let Some((name, center)) = &link.tip {
        *text += &format!("      <site name=\"{name}\" pos=\"{}\"/>\n", spaced(center.iter()));
    }
    for (child, link) in links.iter().enumerate().filter(|(_, link)| link.parent == Some(index)) {
        let pose = &link.parent_from_link;
        let rotation = nalgebra::UnitQuaternion::from_rotation_matrix(&pose.rotation);
        write_link(text, model, links, child, &Isometry3::from_parts(pose.translation, rotation), contact);
    }
    *text += "    </body>\n";
}

fn coupling_and_actuators(links: &[Link]) -> String {
    let hinges = || links.iter().filter_map(|link| link.hinge.as_ref());
    let mut text = String::from("  <equality>\n");
    for hinge in hinges().filter(|hinge| hinge.is_coupled) {
        text += &format!(
            "    <joint joint1=\"{}\" joint2=\"{}\" polycoef=\"0 1 0 0 0\" solref=\"0.002 1\" solimp=\"0.99 0.999 0.001\"/>\n",
            hinge.name,
            hinge.actuator.name()
        );
    }
    text += "  </equality>\n  <actuator>\n";
    for hinge in hinges().filter(|hinge| !hinge.is_coupled) {
        let (stiffness, damping) = if hinge.actuator == JointId::THUMB_ROTATION {
            (BRAKE_NM_PER_RAD, BRAKE_DAMPING_NM_S_PER_RAD)
        } else {
            (STIFFNESS_NM_PER_RAD, DAMPING_NM_S_PER_RAD)
        };
        // Targets may lie behind a surface and so behind a joint's end.
        text += &format!(
            "    <position name=\"{0}\" joint=\"{0}\" kp=\"{stiffness}\" kv=\"{damping}\" forcerange=\"{1} {2}\"/>\n",
            hinge.name, -hinge.torque_max_nm, hinge.torque_max_nm
        );
    }
    text + "  </actuator>\n"
}

fn keyframes(links: &[Link], grasp: &Grasp, base_from_object: &Isometry3<f64>) -> String {
    let coordinates = |angles: &HandAngles<f64>| -> String {
        let angles_rad = angles.to_array();
        let hinges = links.iter().filter_map(|link| link.hinge.as_ref());
        spaced(&hinges.map(|hinge| angles_rad[hinge.actuator.index()]).collect::<Vec<_>>())
    };
    let object = position_and_wxyz(base_from_object).join(" ");
    let mut text = String::from("  <keyframe>\n");
    for (name, posture, target) in [
        ("pregrasp", &grasp.pregrasp, &grasp.pregrasp),
        ("grasp", &grasp.grasp, &grasp.grasp),
        ("squeeze", &grasp.grasp, &grasp.squeeze),
    ] {
        text += &format!(
            "    <key name=\"{name}\" qpos=\"{} {object}\" ctrl=\"{}\"/>\n",
            coordinates(posture),
            spaced(&target.to_array())
        );
    }
    text + "  </keyframe>\n"
}
