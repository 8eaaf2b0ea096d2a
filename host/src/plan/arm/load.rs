//! Whether the wrist may carry a load, and how fast.

use nalgebra::{Matrix3, Point3};

use super::Arm;

/// Standard gravity, m/s^2.
pub const GRAVITY_M_PER_S2: f64 = 9.806_65;

/// What the manufacturer allows at the wrist. In each pair the first value allows full speed and the second one only
/// the reduced speed and acceleration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LoadRating {
    /// Mass behind the flange, kg.
    pub mass_kg: [f64; 2],
    /// Inertia about axis 5, kg m^2.
    pub axis5_inertia_kg_m2: [f64; 2],
    /// Inertia about axis 6, kg m^2.
    pub axis6_inertia_kg_m2: [f64; 2],
    /// Static torque on axis 5 while axis 6 carries none, N m.
    pub axis5_torque_nm: f64,
    /// Static torque on axis 5 while axis 6 carries its own greatest torque, N m. The two axes share their drives.
    pub axis5_torque_with_axis6_nm: f64,
    /// Static torque on axis 6, N m.
    pub axis6_torque_nm: f64,
    /// Share of the nominal speed in reduced mode, 0 to 1.
    pub reduced_speed: f64,
    /// Share of the nominal acceleration in reduced mode, 0 to 1.
    pub reduced_acceleration: f64,
}

/// What hangs on the flange: hand, plate, scanner and object together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Payload {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of mass in the flange frame, metres.
    pub center_in_flange: Point3<f64>,
    /// Inertia about the centre of mass, axes of the flange frame, kg m^2.
    pub inertia_kg_m2: Matrix3<f64>,
}

/// A quantity that a load is judged by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LoadQuantity {
    /// Mass, kg.
    Mass,
    /// Static torque about axis 5, N m.
    Axis5Torque,
    /// Static torque about axis 6, N m.
    Axis6Torque,
    /// Inertia about axis 5, kg m^2.
    Axis5Inertia,
    /// Inertia about axis 6, kg m^2.
    Axis6Inertia,
}

/// How the arm may move a load.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LoadMode {
    /// At full speed and acceleration.
    Nominal,
    /// Only at the reduced ones.
    Reduced {
        /// The quantity farthest above its nominal value, in proportion.
        because: LoadQuantity,
    },
    /// Not at all.
    Exceeded {
        /// The quantity farthest above what is allowed, in proportion.
        because: LoadQuantity,
    },
    /// The payload contains NaN or infinity, or its mass is negative.
    Invalid,
}

/// A load compared with the rating. Torques and inertias are those of the worst wrist posture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LoadCheck {
    /// The verdict.
    pub mode: LoadMode,
    /// Static torque about axis 5, N m.
    pub axis5_torque_nm: f64,
    /// Static torque about axis 6, N m.
    pub axis6_torque_nm: f64,
    /// Inertia about axis 5, kg m^2.
    pub axis5_inertia_kg_m2: f64,
    /// Inertia about axis 6, kg m^2.
    pub axis6_inertia_kg_m2: f64,
}

impl LoadRating {
    /// Stäubli RX60, manual D28045004E, load tables: 2.5 kg nominal, 4.5 kg at 60 % speed and 30 % acceleration.
    #[must_use]
    pub const fn rx60() -> Self {
        Self {
            mass_kg: [2.5, 4.5],
            axis5_inertia_kg_m2: [0.025, 0.125],
            axis6_inertia_kg_m2: [0.0063, 0.032],
            axis5_torque_nm: 7.2,
            axis5_torque_with_axis6_nm: 3.7,
            axis6_torque_nm: 3.5,
            reduced_speed: 0.6,
            reduced_acceleration: 0.3,
        }
    }

    /// Greatest static torque on axis 5 while axis 6 carries `axis6_nm`: the straight line between the manual's two
    /// values. On the RX60 its slope is -1: one drive bears the sum of both torques.
    fn axis5_torque_beside(&self, axis6_nm: f64) -> f64 {
        let share = (axis6_nm / self.axis6_torque_nm).clamp(0.0, 1.0);
        self.axis5_torque_nm + share * (self.axis5_torque_with_axis6_nm - self.axis5_torque_nm)
    }
}

impl Arm {
    /// Compares a payload with the wrist's rating.
    #[must_use]
    pub fn check_load(&self, payload: &Payload) -> LoadCheck {
        let rating = &self.params.load;
        let from_wrist = payload.center_in_flange.coords + nalgebra::Vector3::z() * self.params.geometry.c4_m;
        let weight_n = payload.mass_kg * GRAVITY_M_PER_S2;
        // Axis 5 lies somewhere in the x-y plane of the flange, depending on q6: it can be perpendicular to the lever.
        let axis5_torque_nm = weight_n * from_wrist.norm();
        let axis6_torque_nm = weight_n * from_wrist.xy().norm();
        let steiner = Matrix3::identity() * from_wrist.norm_squared() - from_wrist * from_wrist.transpose();
        let inertia = payload.inertia_kg_m2 + steiner * payload.mass_kg;
        // Greatest principal value of the x-y block, in closed form.
        let [xx, yy, xy] = [inertia[(0, 0)], inertia[(1, 1)], 0.5 * (inertia[(0, 1)] + inertia[(1, 0)])];
        let axis5_inertia_kg_m2 = 0.5 * (xx + yy) + (0.5 * (xx - yy)).hypot(xy);
        let axis6_inertia_kg_m2 = inertia[(2, 2)];

        // Each quantity as a share of what full speed allows, and of what is allowed at all.
        let torque5 = axis5_torque_nm / rating.axis5_torque_beside(axis6_torque_nm);
        let torque6 = axis6_torque_nm / rating.axis6_torque_nm;
        let shares = [
            (LoadQuantity::Mass, rating.mass_kg.map(|allowed| payload.mass_kg / allowed)),
            (LoadQuantity::Axis5Torque, [torque5; 2]),
            (LoadQuantity::Axis6Torque, [torque6; 2]),
            (
                LoadQuantity::Axis5Inertia,
                rating.axis5_inertia_kg_m2.map(|allowed| axis5_inertia_kg_m2 / allowed),
            ),
            (
                LoadQuantity::Axis6Inertia,
                rating.axis6_inertia_kg_m2.map(|allowed| axis6_inertia_kg_m2 / allowed),
            ),
        ];
        let worst = |column: usize| {
            shares.iter().max_by(|a, b| a.1[column].total_cmp(&b.1[column])).filter(|s| s.1[column] > 1.0)
        };
        let finite = shares.iter().all(|(_, share)| share.iter().all(|s| s.is_finite()));
        let mode = if !finite || payload.mass_kg < 0.0 {
            LoadMode::Invalid
        } else if let Some(&(because, _)) = worst(1) {
            LoadMode::Exceeded { because }
        } else if let Some(&(because, _)) = worst(0) {
            LoadMode::Reduced { because }
        } else {
            LoadMode::Nominal
        };
        LoadCheck { mode, axis5_torque_nm, axis6_torque_nm, axis5_inertia_kg_m2, axis6_inertia_kg_m2 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A mass without extent on axis 6, `height_m` in front of the flange.
    fn point_mass(mass_kg: f64, height_m: f64) -> Payload {
        Payload {
            mass_kg,
            center_in_flange: Point3::new(0.0, 0.0, height_m),
            inertia_kg_m2: Matrix3::zeros(),
        }
    }

    #[test]
    fn the_bare_hand_needs_reduced_mode_because_of_its_inertia() {
        let check = Arm::rx60().check_load(&point_mass(1.6, 0.120));
        assert_eq!(check.mode, LoadMode::Reduced { because: LoadQuantity::Axis5Inertia });
        assert!((check.axis5_torque_nm - 1.6 * 9.80665 * 0.185).abs() < 1e-12);
        assert!((check.axis5_inertia_kg_m2 - 1.6 * 0.185 * 0.185).abs() < 1e-12);
    }

    #[test]
    fn each_rating_can_be_the_one_that_decides() {
        let rx60 = Arm::rx60();
        let off_axis = |mass_kg, x_m| Payload {
            center_in_flange: Point3::new(x_m, 0.0, -0.065),
            ..point_mass(mass_kg, 0.0)
        };
        let disk = |izz| Payload {
            inertia_kg_m2: Matrix3::from_diagonal(&nalgebra::Vector3::new(0.0, 0.0, izz)),
            ..point_mass(1.0, 0.0)
        };
        let beside = Payload { center_in_flange: Point3::new(0.08, 0.0, 0.085), ..point_mass(3.0, 0.0) };
        let cases = [
            (point_mass(1.0, 0.02), LoadMode::Nominal),
            (point_mass(4.0, 0.0), LoadMode::Reduced { because: LoadQuantity::Mass }),
            (point_mass(4.6, 0.0), LoadMode::Exceeded { because: LoadQuantity::Mass }),
            (point_mass(1.5, 0.40), LoadMode::Exceeded { because: LoadQuantity::Axis5Inertia }),
            (disk(0.0064), LoadMode::Reduced { because: LoadQuantity::Axis6Inertia }),
            (disk(0.0321), LoadMode::Exceeded { because: LoadQuantity::Axis6Inertia }),
            (off_axis(4.4, 0.0835), LoadMode::Exceeded { because: LoadQuantity::Axis6Torque }),
            (point_mass(4.4, 0.103), LoadMode::Exceeded { because: LoadQuantity::Axis5Torque }),
            // 5.0 N m, which axis 5 would bear alone, but not beside 2.35 N m on axis 6.
            (beside, LoadMode::Exceeded { because: LoadQuantity::Axis5Torque }),
            (off_axis(f64::NAN, 0.1), LoadMode::Invalid),
            (point_mass(-1.0, 0.1), LoadMode::Invalid),
        ];
        for (payload, mode) in cases {
            assert_eq!(rx60.check_load(&payload).mode, mode, "{payload:?}");
        }
    }

    #[test]
    fn axis_five_bears_less_beside_a_loaded_axis_six() {
        let rating = LoadRating::rx60();
        assert_eq!(rating.axis5_torque_beside(0.0), 7.2);
        assert!((rating.axis5_torque_beside(1.0) - 6.2).abs() < 1e-12);
        assert!((rating.axis5_torque_beside(9.0) - 3.7).abs() < 1e-12);
    }
}
