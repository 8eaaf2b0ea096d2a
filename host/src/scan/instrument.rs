//! The laser-stripe scanner on the palm: two cameras with the laser between them, as the paper describes it.
//!
//! No data sheet of the paper's cameras or their arrangement is known. The values of [`Instrument::default`] are a
//! design: chosen so that the 95 x 50 mm that the paper calibrates lie well within the field of ordinary 1/3 inch
//! cameras.
//!
//! Scanner frame: origin at the laser's aperture, z along the middle of the fan towards the object, y along the
//! stripe, x across the laser plane (x = 0). The cameras sit at x = +-`camera_offset_m`, their image rows along y, and
//! their axes meet the z axis at the stand-off.

use nalgebra::{Point3, Vector3};

/// Geometry, optics and noise of the scanner.
#[derive(Debug, Clone, PartialEq)]
pub struct Instrument {
    /// Full angle of the laser fan.
    pub fan_rad: f64,
    /// Distance from the aperture at which the camera axes meet the laser plane.
    pub stand_off_m: f64,
    /// Distance of each camera from the laser plane.
    pub camera_offset_m: f64,
    /// Focal length.
    pub focal_m: f64,
    /// Pixel pitch.
    pub pixel_m: f64,
    /// Pixels along the stripe and across it (depth).
    pub pixels: [u32; 2],
    /// Columns between two points of a stripe, pixels.
    pub column_step_px: f64,
    /// Standard deviation of the stripe's centre. 0.1 on diffuse plastic, 0.3 on glossy or dark surfaces.
    pub stripe_noise_px: f64,
    /// Largest angle between the surface's normal and the laser's or the camera's ray that still gives a stripe.
    pub max_incidence_rad: f64,
    /// Share of points that go wrong: half a spot beyond an edge, or reflected twice on glaze. 0.01 to 0.02 is usual
    /// on porcelain; off by default.
    pub outlier_share: f64,
    /// Standard deviation of an outlier's depth.
    pub outlier_depth_m: f64,
    /// Standard deviation, along each axis, of the offset by which a whole sweep is misplaced: arm and hand-eye
    /// calibration together 0.3 mm and more; off by default.
    pub registration_m: f64,
}

impl Default for Instrument {
    fn default() -> Self {
        Self {
            fan_rad: 60_f64.to_radians(),
            stand_off_m: 0.200,
            camera_offset_m: 0.060,
            focal_m: 0.0075,
            pixel_m: 6.4e-6,
            pixels: [768, 576],
            column_step_px: 6.0,
            stripe_noise_px: 0.15,
            max_incidence_rad: 70_f64.to_radians(),
            outlier_share: 0.0,
            outlier_depth_m: 0.003,
            registration_m: 0.0,
        }
    }
}

/// One of the two cameras.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Camera {
    /// At negative x.
    Left,
    /// At positive x.
    Right,
}

impl Camera {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Left, Self::Right];

    /// As files name it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Left => "left",
            Self::Right => "right",
        }
    }

    const fn sign(self) -> f64 {
        match self {
            Self::Left => -1.0,
            Self::Right => 1.0,
        }
    }
}

impl Instrument {
    /// Position of a camera's centre of projection, scanner frame.
    #[must_use]
    pub fn camera_center(&self, camera: Camera) -> Point3<f64> {
        Point3::new(camera.sign() * self.camera_offset_m, 0.0, 0.0)
    }

    /// Axes of the image: along the stripe, across it, and the optical axis; scanner frame.
    fn camera_axes(&self, camera: Camera) -> [Vector3<f64>; 3] {
        let optical = Vector3::new(-camera.sign() * self.camera_offset_m, 0.0, self.stand_off_m).normalize();
        [Vector3::y(), Vector3::y().cross(&optical), optical]
    }

    /// Image of a point in the scanner frame, pixels from the principal point (along the stripe, across it); `None`
    /// when it falls outside the sensor or lies behind the camera.
    #[must_use]
    pub fn project(&self, camera: Camera, point: &Point3<f64>) -> Option<[f64; 2]> {
        let [along, across, optical] = self.camera_axes(camera);
        let ray = point - self.camera_center(camera);
        let depth = ray.dot(&optical);
        if depth <= 0.0 {
            return None;
        }
        let scale = self.focal_m / (self.pixel_m * depth);
        let image = [ray.dot(&along) * scale, ray.dot(&across) * scale];
        let on_sensor = (0..2).all(|axis| image[axis].abs() <= 0.5 * f64::from(self.pixels[axis]));
        on_sensor.then_some(image)
    }

    /// The point of the laser plane that a pixel sees, scanner frame; `None` when its ray runs along the plane or away
    /// from it.
    #[must_use]
    pub fn triangulate(&self, camera: Camera, [u, v]: [f64; 2]) -> Option<Point3<f64>> {
        let [along, across, optical] = self.camera_axes(camera);
        let ray = (along * u + across * v) * (self.pixel_m / self.focal_m) + optical;
        let center = self.camera_center(camera);
        let reach = -center.x / ray.x;
        (reach.is_finite() && reach > 0.0).then(|| {
            let point = center + ray * reach;
            Point3::new(0.0, point.y, point.z)
        })
    }

    /// Width of the cameras' field along the stripe at the stand-off.
    #[must_use]
    pub fn field_width_m(&self) -> f64 {
        f64::from(self.pixels[0]) * self.column_pitch_m()
    }

    /// Distance between two points of a stripe at the stand-off.
    #[must_use]
    pub fn point_pitch_m(&self) -> f64 {
        self.column_step_px * self.column_pitch_m()
    }

    fn column_pitch_m(&self) -> f64 {
        self.stand_off_m.hypot(self.camera_offset_m) * self.pixel_m / self.focal_m
    }

    /// Directions of the laser's rays that the cameras sample, scanner frame, unit length: one for each used column.
    #[must_use]
    pub fn laser_rays(&self) -> Vec<Vector3<f64>> {
        let pitch = self.point_pitch_m();
        let half_width = (0.5 * self.field_width_m()).min(self.stand_off_m * (0.5 * self.fan_rad).tan());
        let half = if pitch > 0.0 { (half_width / pitch).floor() as i32 } else { 0 };
        (-half..=half)
            .map(|column| Vector3::new(0.0, f64::from(column) * pitch, self.stand_off_m).normalize())
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn field_and_resolution_are_the_designs() {
        let instrument = Instrument::default();
        assert!((instrument.field_width_m() - 0.137).abs() < 0.001);
        // One pixel across the stripe is 0.57 mm of depth at the stand-off.
        let [at, next] = [0.0, 1.0].map(|v| instrument.triangulate(Camera::Right, [0.0, v]).unwrap());
        assert!((at - Point3::new(0.0, 0.0, 0.2)).norm() < 1e-12);
        assert!(((next.z - at.z).abs() - 0.00062).abs() < 0.00006, "{}", next.z - at.z);
    }

    #[test]
    fn triangulation_inverts_projection_for_both_cameras() {
        let instrument = Instrument::default();
        for camera in Camera::ALL {
            for point in [[0.0, 0.03, 0.17], [0.0, -0.05, 0.22], [0.0, 0.0, 0.2]].map(Point3::from) {
                let image = instrument.project(camera, &point).unwrap();
                assert!((instrument.triangulate(camera, image).unwrap() - point).norm() < 1e-12);
            }
            assert_eq!(instrument.project(camera, &Point3::new(0.0, 0.2, 0.2)), None);
            assert_eq!(instrument.project(camera, &Point3::new(0.0, 0.0, -0.2)), None);
        }
    }
}
