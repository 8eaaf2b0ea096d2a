//! A grasp as an Open Inventor scene: the object and the hand's solids where the tips touch.

use hand_model::HandModel;
use nalgebra::{IsometryMatrix3, Rotation3, Translation3, Vector3};

use super::Grasp;
use super::text::spaced;
use super::tree::{Solid, links, palm_from_links};
use crate::io::{MeshFormat, write_mesh_to};
use crate::surface::Mesh;

/// The scene in the object's frame, metres.
///
/// Errors only if the mesh's own writer does.
pub fn scene(model: &HandModel<f64>, grasp: &Grasp, object: &Mesh) -> std::io::Result<String> {
    let mut mesh = Vec::new();
    write_mesh_to(MeshFormat::Inventor, &mut mesh, object)?;
    let mut text = String::from_utf8_lossy(&mesh).into_owned();
    text += "\n# The HIT/DLR hand at the grasp, in the object's frame, metres\nSeparator {\n";
    text += "  Material { diffuseColor 0.55 0.6 0.7 }\n";
    let object_from_palm = IsometryMatrix3::from_parts(
        grasp.object_from_palm.translation,
        grasp.object_from_palm.rotation.to_rotation_matrix(),
    );
    let links = links(model);
    for (link, palm_from_link) in links.iter().zip(palm_from_links(&links, &grasp.grasp)) {
        let object_from_link = object_from_palm * palm_from_link;
        let at = |x: f64, y: f64, z: f64| object_from_link * Translation3::new(x, y, z);
        match &link.solid {
            None => {}
            Some(Solid::Cuboid { center, half }) => {
                let [width, height, depth] = <[f64; 3]>::from(half * 2.0);
                let shape = format!("Cube {{ width {width} height {height} depth {depth} }}");
                text += &placed(&at(center.x, center.y, center.z), &shape);
            }
            Some(Solid::Capsule { length_m, radius_m }) => {
                let ball = format!("Sphere {{ radius {radius_m} }}");
                text += &placed(&at(0.0, 0.0, 0.0), &ball);
                text += &placed(&at(*length_m, 0.0, 0.0), &ball);
                // A cylinder's axis is y.
                let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), -std::f64::consts::FRAC_PI_2);
                let shape = format!("Cylinder {{ radius {radius_m} height {length_m} }}");
                text += &placed(&(at(length_m / 2.0, 0.0, 0.0) * turn), &shape);
            }
        }
    }
    Ok(text + "}\n")
}

fn placed(pose: &IsometryMatrix3<f64>, shape: &str) -> String {
    let (axis, angle_rad) = pose.rotation.axis_angle().unwrap_or((Vector3::z_axis(), 0.0));
    format!(
        "  Separator {{\n    Transform {{ translation {} rotation {} {angle_rad} }}\n    {shape}\n  }}\n",
        spaced(pose.translation.vector.iter()),
        spaced(axis.iter())
    )
}
