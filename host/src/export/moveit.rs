//! Grasps as a YAML list of `moveit_msgs/Grasp` (ROS 2).
//!
//! <https://docs.ros.org/en/jazzy/p/moveit_msgs/msg/Grasp.html>

use hand_model::{HandAngles, HandModel};
use nalgebra::{Isometry3, Vector3};
use protocol::ids::JointId;

use super::Grasp;
use super::text::{list, quoted, real};
use super::urdf::BASE_LINK;

/// Times at which the fingers touch and at which they press, seconds and nanoseconds after the start of closing.
const TOUCH_AT: (u32, u32) = (1, 0);
const PRESS_AT: (u32, u32) = (1, 500_000_000);

/// The list. `palm_from_parent` is the pose of the link that carries the hand (with an arm its flange) in the palm
/// frame; `object` is the object's name in the planning scene, which the hand may touch.
///
/// `grasp_pose` is the pose of that parent link, not of the palm, as the message wants it. The posture of the grasp is a
/// trajectory of two points: tips touching, then the targets behind the surface that make a position-controlled finger
/// press.
#[must_use]
pub fn yaml(
    model: &HandModel<f64>,
    palm_from_parent: &Isometry3<f64>,
    object: &str,
    grasps: &[Grasp],
) -> String {
    let mut text = format!(
        "# List of moveit_msgs/Grasp (ROS 2) of the HIT/DLR hand. Metres, radians, newtons. Frame {BASE_LINK}: the robot's\n\
         # base, z up. grasp_pose: the link that carries the hand (the end effector's parent link: the arm's flange, or the\n\
         # palm itself when the plan has no arm). grasp_posture: tips touching, then targets behind the surface.\n\
         # grasp_quality: the Ferrari-Canny epsilon. Links and joints are named as in this program's URDF.\n"
    );
    if grasps.is_empty() {
        text += "[]\n";
    }
    for grasp in grasps {
        let parent = grasp.grasp_site * palm_from_parent;
        let (p, q) = (parent.translation, parent.rotation);
        let way =
            |to: &Isometry3<f64>, from: &Isometry3<f64>| to.translation.vector - from.translation.vector;
        let approach = way(&grasp.grasp_site, &grasp.approach_site);
        text += &format!("- id: grasp_{}\n", grasp.number);
        text += &trajectory("pre_grasp_posture", &[((0, 0), &grasp.pregrasp)]);
        text += &trajectory("grasp_posture", &[(TOUCH_AT, &grasp.grasp), (PRESS_AT, &grasp.squeeze)]);
        text += &format!(
            "  grasp_pose:\n    header: {{frame_id: {BASE_LINK}}}\n    pose:\n      position: {{x: {}, y: {}, z: {}}}\n",
            real(p.x),
            real(p.y),
            real(p.z)
        );
        text += &format!(
            "      orientation: {{x: {}, y: {}, z: {}, w: {}}}\n",
            real(q.i),
            real(q.j),
            real(q.k),
            real(q.w)
        );
        text += &format!("  grasp_quality: {}\n", real(grasp.epsilon));
        text += &translation("pre_grasp_approach", &approach);
        text += &translation("post_grasp_retreat", &way(&grasp.lift_site, &grasp.grasp_site));
        text += &translation("post_place_retreat", &-approach);
        text += &format!("  max_contact_force: {}\n", real(model.drive.tip_force_max_n));
        text += &format!("  allowed_touch_objects: [{}]\n", quoted(object));
    }
    text
}

/// A `trajectory_msgs/JointTrajectory`.
fn trajectory(key: &str, points: &[((u32, u32), &HandAngles<f64>)]) -> String {
    let names = JointId::ALL.map(JointId::name).join(", ");
    let mut text = format!("  {key}:\n    joint_names: [{names}]\n    points:\n");
    for ((sec, nanosec), angles) in points {
        text += &format!("    - positions: {}\n", list(&angles.to_array()));
        text += &format!("      time_from_start: {{sec: {sec}, nanosec: {nanosec}}}\n");
    }
    text
}

/// A `moveit_msgs/GripperTranslation` along the whole of `way` (base frame), all of which was planned.
fn translation(key: &str, way: &Vector3<f64>) -> String {
    let length_m = way.norm();
    let direction = way.try_normalize(f64::MIN_POSITIVE).unwrap_or_default();
    format!(
        "  {key}:\n    direction:\n      header: {{frame_id: {BASE_LINK}}}\n      vector: {{x: {}, y: {}, z: {}}}\n    \
         desired_distance: {length}\n    min_distance: {length}\n",
        real(direction.x),
        real(direction.y),
        real(direction.z),
        length = real(length_m)
    )
}
