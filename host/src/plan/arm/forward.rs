//! From joint angles to poses.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::{Arm, Joints, params};

impl Arm {
    /// Pose of every link in the base frame: `[i]` moves with axis `i + 1`, and its origin lies on that axis (at the
    /// wrist centre for axes 4 and 5, in the flange for axis 6). All are parallel to the base when the angles of the
    /// formulas are zero.
    #[must_use]
    pub fn link_frames(&self, q_rad: &Joints) -> [Isometry3<f64>; 6] {
        let geometry = &self.params.geometry;
        let theta = geometry.theta_from_joints(q_rad);
        let offsets = params::link_offsets(geometry);
        let axes = [Vector3::z_axis(), Vector3::y_axis(), Vector3::y_axis(), Vector3::z_axis()]
            .into_iter()
            .chain([Vector3::y_axis(), Vector3::z_axis()]);
        let mut frames = [Isometry3::identity(); 6];
        let mut base_from_link = Isometry3::identity();
        for (i, axis) in axes.enumerate() {
            let turn = UnitQuaternion::from_axis_angle(&axis, theta[i]);
            base_from_link *= Isometry3::from_parts(Translation3::from(offsets[i]), turn);
            frames[i] = base_from_link;
        }
        frames
    }

    /// Pose of the flange in the base frame.
    #[must_use]
    pub fn base_from_flange(&self, q_rad: &Joints) -> Isometry3<f64> {
        let [.., base_from_flange] = self.link_frames(q_rad);
        base_from_flange
    }

    /// Pose of the palm in the base frame.
    #[must_use]
    pub fn base_from_palm(&self, q_rad: &Joints) -> Isometry3<f64> {
        self.base_from_flange(q_rad) * self.flange_from_palm
    }
}
