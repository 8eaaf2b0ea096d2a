//! The numbers of an arm, and those of the Stäubli RX60.
//!
//! "Manual" below is the manufacturer's: Stäubli, "Arm - RX series 60B family", D28045004E, 02/2008, pages 26 to 31.

use nalgebra::{Isometry3, Point3, Vector3};

use super::{ArmError, JointLimits, Joints, LimitCheck, LinkCapsule, load::LoadRating};

/// Lengths and angle conventions of an ortho-parallel arm with a spherical wrist.
///
/// In the stretched-up pose (all `theta` zero), in the base frame: axis 2 passes through `(a1, *, c1)` along y, axis 3
/// through `(a1, b, c1 + c2)`, the wrist centre is `(a1 + a2, b, c1 + c2 + c3)` and the flange is `c4` above it.
/// The angles of the formulas are `theta_i = sign_i q_i - offset_i`, as in the published parameter sets for other arms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OpwGeometry {
    /// Axis 1 to axis 2, along x.
    pub a1_m: f64,
    /// Axis 3 to axis 4, along x; negative when the forearm lies above the elbow of an arm stretched forward.
    pub a2_m: f64,
    /// Lateral offset of the arm's plane, along y.
    pub b_m: f64,
    /// Base to axis 2, along z.
    pub c1_m: f64,
    /// Axis 2 to axis 3.
    pub c2_m: f64,
    /// Axis 3 to the wrist centre, along axis 4.
    pub c3_m: f64,
    /// Wrist centre to flange.
    pub c4_m: f64,
    /// Subtracted from the signed joint angles, radians.
    pub offset_rad: Joints,
    /// +1 where a joint turns with the formulas, -1 where it turns against them.
    pub sign: [f64; 6],
}

/// Everything that is known about an arm.
#[derive(Debug, Clone, PartialEq)]
pub struct ArmParams {
    /// Shown to people.
    pub name: String,
    /// Lengths and conventions.
    pub geometry: OpwGeometry,
    /// Joint limits.
    pub limits: JointLimits,
    /// Greatest joint speeds with nominal load, rad/s.
    pub speed_rad_per_s: Joints,
    /// Greatest joint accelerations with nominal load, rad/s^2.
    pub acceleration_rad_per_s2: Joints,
    /// Greatest joint jerks with nominal load, rad/s^3.
    pub jerk_rad_per_s3: Joints,
    /// Greatest speed of the load in space, m/s.
    pub cartesian_speed_m_per_s: f64,
    /// What the wrist may carry.
    pub load: LoadRating,
    /// Where the arm waits: the hand high, so that it comes to objects from above, joint angles.
    pub rest_rad: Joints,
    /// Bodies for collision checks.
    pub capsules: Vec<LinkCapsule>,
}

/// Time in which an arm is taken to reach full speed where its maker gives no accelerations, as the RX60's does not. An
/// assumption: with 0.3 s axis 1 of the RX60 speeds up the wrist of the stretched arm (0.6 m) by 10 m/s^2.
pub(super) const RUN_UP_S: f64 = 0.3;

/// Time in which an arm is taken to reach full acceleration where no jerk is published, as for the RX60. An assumption: of
/// the order of what controllers of such arms do, and above a period of their lowest resonance.
pub(super) const JERK_RISE_S: f64 = 0.1;

/// Angles of the formulas at rest: the upper arm leans back a little, the forearm reaches forward, and the hand hangs
/// over the working space, leaning out. On the RX60 the stretched fingers then end 0.4 m above the table.
pub(super) const REST_THETA: Joints = [0.0, -0.12, 1.3, 0.0, 1.6, 0.0];

/// Thickness of the plate between the flange (ISO 9409-1-A31.5) and the hand's wrist plane. An assumption: another
/// laboratory mounts the same hand without any plate.
const ADAPTER_PLATE_M: f64 = 0.020;

/// Pose of the palm frame in the flange frame: axes parallel, the plate's thickness in front of the flange.
pub(super) fn adapter_plate() -> Isometry3<f64> {
    Isometry3::translation(0.0, 0.0, ADAPTER_PLATE_M)
}

impl OpwGeometry {
    /// Stäubli RX60, manual, dimension drawing: 341, 290, 310 and 65 mm along the arm, whose plane is 49 mm beside
    /// axis 1 on the +y side.
    #[must_use]
    pub const fn rx60() -> Self {
        Self {
            a1_m: 0.0,
            a2_m: 0.0,
            b_m: 0.049,
            c1_m: 0.341,
            c2_m: 0.290,
            c3_m: 0.310,
            c4_m: 0.065,
            offset_rad: [0.0; 6],
            sign: [1.0; 6],
        }
    }

    /// Axis 3 to the wrist centre in a straight line, metres.
    #[must_use]
    pub fn forearm_m(&self) -> f64 {
        self.a2_m.hypot(self.c3_m)
    }

    /// Angles of the formulas from joint angles.
    pub(super) fn theta_from_joints(&self, q_rad: &Joints) -> Joints {
        std::array::from_fn(|i| self.sign[i] * q_rad[i] - self.offset_rad[i])
    }

    /// Joint angles from angles of the formulas.
    pub(super) fn joints_from_theta(&self, theta: &Joints) -> Joints {
        std::array::from_fn(|i| self.sign[i] * (theta[i] + self.offset_rad[i]))
    }
}

impl ArmParams {
    /// Stäubli RX60.
    ///
    /// Limits, speeds, payload and wrist torques are the manual's tables; accelerations and jerks are assumed (see
    /// `RUN_UP_S`, `JERK_RISE_S`). The manual is for the "B" series; for the plain RX60 the lengths are the same and the speeds
    /// may differ.
    #[must_use]
    pub fn rx60() -> Self {
        let speed_rad_per_s = [287.0_f64, 287.0, 319.0, 410.0, 320.0, 700.0].map(f64::to_radians);
        Self {
            name: "Stäubli RX60".to_owned(),
            geometry: OpwGeometry::rx60(),
            limits: JointLimits {
                lower_rad: [-160.0_f64, -127.5, -134.5, -270.0, -109.5, -270.0].map(f64::to_radians),
                upper_rad: [160.0_f64, 127.5, 134.5, 270.0, 120.5, 270.0].map(f64::to_radians),
            },
            speed_rad_per_s,
            acceleration_rad_per_s2: speed_rad_per_s.map(|speed| speed / RUN_UP_S),
            jerk_rad_per_s3: speed_rad_per_s.map(|speed| speed / RUN_UP_S / JERK_RISE_S),
            cartesian_speed_m_per_s: 1.8,
            load: LoadRating::rx60(),
            rest_rad: REST_THETA,
            capsules: rx60_capsules(),
        }
    }

    /// The first parameter that no arm can have.
    pub(super) fn check(&self) -> Result<(), ArmError> {
        let g = &self.geometry;
        let lengths = [
            ("a1_m", g.a1_m),
            ("a2_m", g.a2_m),
            ("b_m", g.b_m),
            ("c1_m", g.c1_m),
            ("c2_m", g.c2_m),
            ("c3_m", g.c3_m),
            ("c4_m", g.c4_m),
            ("cartesian_speed_m_per_s", self.cartesian_speed_m_per_s),
        ];
        let per_axis = [
            ("offset_rad", &g.offset_rad),
            ("lower_rad", &self.limits.lower_rad),
            ("upper_rad", &self.limits.upper_rad),
            ("speed_rad_per_s", &self.speed_rad_per_s),
            ("acceleration_rad_per_s2", &self.acceleration_rad_per_s2),
            ("jerk_rad_per_s3", &self.jerk_rad_per_s3),
            ("rest_rad", &self.rest_rad),
        ];
        let axes = per_axis.iter().flat_map(|(name, values)| values.iter().map(|&v| (*name, v)));
        if let Some((name, value)) = lengths.into_iter().chain(axes).find(|(_, v)| !v.is_finite()) {
            return Err(ArmError::NotFinite { name, value });
        }
        let positive = [("c2_m", g.c2_m), ("forearm", g.forearm_m())]
            .into_iter()
            .chain([("cartesian_speed_m_per_s", self.cartesian_speed_m_per_s)])
            .chain(self.speed_rad_per_s.map(|v| ("speed_rad_per_s", v)))
            .chain(self.acceleration_rad_per_s2.map(|v| ("acceleration_rad_per_s2", v)))
            .chain(self.jerk_rad_per_s3.map(|v| ("jerk_rad_per_s3", v)));
        if let Some((name, value)) = positive.into_iter().find(|(_, v)| *v <= 0.0) {
            return Err(ArmError::NotPositive { name, value });
        }
        for i in 0..6 {
            if g.sign[i].abs() != 1.0 {
                return Err(ArmError::Sign { axis: i + 1, value: g.sign[i] });
            }
            let [lower_rad, upper_rad] = [self.limits.lower_rad[i], self.limits.upper_rad[i]];
            if lower_rad >= upper_rad {
                return Err(ArmError::Limits { axis: i + 1, lower_rad, upper_rad });
            }
        }
        if let LimitCheck::Outside { axis, .. } = self.limits.check(&self.rest_rad) {
            return Err(ArmError::Rest { axis, angle_rad: self.rest_rad[axis - 1] });
        }
        for capsule in &self.capsules {
            if capsule.link > 6 {
                return Err(ArmError::CapsuleLink { link: capsule.link });
            }
            let numbers = capsule.from.iter().chain(&capsule.to.coords).chain([&capsule.radius_m]);
            if let Some(&value) = numbers.into_iter().find(|v| !v.is_finite()) {
                return Err(ArmError::NotFinite { name: "capsule", value });
            }
            if capsule.radius_m <= 0.0 {
                return Err(ArmError::NotPositive { name: "radius of a capsule", value: capsule.radius_m });
            }
        }
        Ok(())
    }
}

/// Bodies of the RX60 from the radii of the manual's drawing: base 115 mm, shoulder box 214 mm wide, upper-arm plate
/// 94 mm tapering to 82 mm at 107 to 197.5 mm beside axis 1, forearm 59 mm, wrist 46 mm tapering to 35 mm.
///
/// The plate is flat; the capsule around it stands out by about 0.05 m on either side.
fn rx60_capsules() -> Vec<LinkCapsule> {
    let capsule = |link, from: [f64; 3], to: [f64; 3], radius_m| LinkCapsule {
        link,
        from: Point3::from(from),
        to: Point3::from(to),
        radius_m,
    };
    let plate_y_m = 0.5 * (0.107 + 0.1975);
    vec![
        capsule(0, [0.0, 0.0, 0.115], [0.0, 0.0, 0.226], 0.115),
        capsule(1, [0.0, -0.040, 0.0], [0.0, 0.040, 0.0], 0.115),
        capsule(2, [0.0, plate_y_m, 0.0], [0.0, plate_y_m, 0.290], 0.104),
        capsule(3, [0.0, 0.0, 0.0], [0.0, 0.0, 0.251], 0.059),
        capsule(4, [0.0, 0.0, -0.046], [0.0, 0.0, 0.0], 0.046),
        capsule(5, [0.0, 0.0, 0.0], [0.0, 0.0, 0.030], 0.035),
    ]
}

/// Bodies of an arm of which only the lengths are known: the radii of the RX60, scaled by the length of upper arm and
/// forearm, about the lines from joint to joint.
pub(super) fn default_capsules(g: &OpwGeometry) -> Vec<LinkCapsule> {
    let scale = (g.c2_m + g.forearm_m()) / 0.600;
    let [base, upper, fore, wrist, last] = [0.115, 0.094, 0.059, 0.046, 0.035].map(|radius| radius * scale);
    let capsule = |link, from: [f64; 3], to: [f64; 3], radius_m| LinkCapsule {
        link,
        from: Point3::from(from),
        to: Point3::from(to),
        radius_m,
    };
    // The base stands on its mounting plane, and the wrist's last link ends flush with the flange.
    let base = base.min(0.5 * g.c1_m.abs().max(0.02));
    let last = last.min(0.5 * g.c4_m.abs().max(0.02));
    let short = |length: f64, by: f64| length.signum() * (length.abs() - by).max(0.0);
    vec![
        capsule(0, [0.0, 0.0, base.copysign(g.c1_m)], [0.0, 0.0, short(g.c1_m, base)], base),
        capsule(1, [0.0; 3], [g.a1_m, 0.0, 0.0], base),
        capsule(2, [0.0; 3], [0.0, g.b_m, g.c2_m], upper),
        capsule(3, [0.0; 3], [g.a2_m, 0.0, 0.0], fore),
        capsule(3, [g.a2_m, 0.0, 0.0], [g.a2_m, 0.0, short(g.c3_m, fore)], fore),
        capsule(4, [0.0, 0.0, -wrist], [0.0; 3], wrist.min(fore)),
        capsule(5, [0.0; 3], [0.0, 0.0, short(g.c4_m, last)], last),
    ]
}

/// Origins of the link frames in the stretched-up pose, each in the frame before it, metres.
pub(super) fn link_offsets(g: &OpwGeometry) -> [Vector3<f64>; 6] {
    [
        Vector3::new(0.0, 0.0, g.c1_m),
        Vector3::new(g.a1_m, 0.0, 0.0),
        Vector3::new(0.0, g.b_m, g.c2_m),
        Vector3::new(g.a2_m, 0.0, g.c3_m),
        Vector3::zeros(),
        Vector3::new(0.0, 0.0, g.c4_m),
    ]
}
