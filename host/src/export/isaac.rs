//! Grasps as `isaac_grasp` YAML 1.0, which Isaac Sim's grasp editor and Isaac ROS read.
//!
//! <https://nvidia-isaac-ros.github.io/concepts/manipulation/isaac_grasp.html>

use super::Grasp;
use super::text::{list, quoted, real};
use crate::plan::document::named;

/// The file: poses of the palm in the object's frame, `source` being what the object is called.
///
/// Both spellings of the frames' names are written: the specification's and the one that Isaac Sim's editor writes.
#[must_use]
pub fn yaml(source: &str, grasps: &[Grasp]) -> String {
    let mut text = format!(
        "# Grasps of the HIT/DLR hand. Metres and radians. position and orientation: the palm (gripper frame) in the\n\
         # object's frame, that of its mesh file. Palm: origin at the wrist plane, z along the stretched fingers, x out\n\
         # of the grasping side, y to the index. cspace_position: tips touching; pregrasp_cspace_position: open. Each\n\
         # finger's distal joint repeats its middle joint. confidence: the Ferrari-Canny epsilon, no probability.\n\
         format: isaac_grasp\nformat_version: 1.0\n\
         object_frame: {object}\nobject_frame_link: {object}\ngripper_frame: palm\ngripper_frame_link: palm\n\
         grasps:{none}\n",
        object = quoted(source),
        none = if grasps.is_empty() { " {}" } else { "" },
    );
    for grasp in grasps {
        let (p, q) = (grasp.object_from_palm.translation, grasp.object_from_palm.rotation);
        text += &format!("  grasp_{}:\n", grasp.number);
        text += &format!("    confidence: {}\n", real(grasp.epsilon.clamp(0.0, 1.0)));
        text += &format!("    position: {}\n", list(p.vector.as_slice()));
        text += &format!("    orientation: {{w: {}, xyz: {}}}\n", real(q.w), list(&[q.i, q.j, q.k]));
        for (key, angles) in [("cspace_position", grasp.grasp), ("pregrasp_cspace_position", grasp.pregrasp)]
        {
            text += &format!("    {key}:\n");
            for (joint, angle_rad) in named(&angles) {
                text += &format!("      {joint}: {}\n", real(angle_rad));
            }
        }
    }
    text
}
