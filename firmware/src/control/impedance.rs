//! Cartesian impedance of a fingertip: the tip hangs on a spring and a damper, and the joints' torques make it so.
//!
//! `tau = J^T (K dx + D dv)` with the reduced 3 x 3 Jacobian, whose last column holds the middle and the distal joint
//! together. The links' inertia is left as it is: shaping it would need the tip's acceleration.

use hand_model::{FingerAngles, FingerGeometry, FingerTrig, pad_normal, tip, tip_jacobian};
use nalgebra::Vector3;

use crate::trig::sin_cos;

/// A spring and a damper at the fingertip, along the axes of the finger's base frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TipImpedance {
    /// Stiffness along the stretched finger, across it, and to the pad's side.
    pub stiffness_n_per_m: [f32; 3],
    /// Damping along the same axes.
    pub damping_n_s_per_m: [f32; 3],
    /// Most that the spring may push.
    pub force_max_n: f32,
    /// Push along the pad's normal beyond that of the spring, as if the target lay so much deeper.
    pub boost_n: f32,
}

/// Angles and speeds of a finger's three joints.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FingerMotion {
    /// Abduction, flexion, middle joint.
    pub angle_rad: [f32; 3],
    /// Their speeds.
    pub speed_rad_per_s: [f32; 3],
}

/// What the tip's spring asks of the joints.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TipTorque {
    /// Abduction, flexion, middle joint.
    pub torque_nm: [f32; 3],
    /// Whether the spring was cut to the largest force.
    pub force_limited: bool,
}

/// Torques that pull the tip from where it is (`measured`) to where it should be (`desired`).
///
/// The damper acts on the error of the joints' speeds as the tip feels it where it is, so it takes energy out whatever the
/// offset.
///
/// In a stretched finger the Jacobian has no column along the finger, so there the spring cannot act in that direction.
#[must_use]
pub fn tip_torque(
    geometry: &FingerGeometry<f32>,
    impedance: &TipImpedance,
    measured: &FingerMotion,
    desired: &FingerMotion,
) -> TipTorque {
    let here = FingerTrig::new(&FingerAngles::from_array(&measured.angle_rad), sin_cos);
    let there = FingerTrig::new(&FingerAngles::from_array(&desired.angle_rad), sin_cos);
    let jacobian = tip_jacobian(geometry, &here);
    let lag = Vector3::from(desired.speed_rad_per_s) - Vector3::from(measured.speed_rad_per_s);
    let damper = (jacobian * lag).component_mul(&Vector3::from(impedance.damping_n_s_per_m));

    let offset = tip(geometry, &there) - tip(geometry, &here);
    let mut spring = offset.component_mul(&Vector3::from(impedance.stiffness_n_per_m));
    spring += pad_normal(&here).into_inner() * impedance.boost_n;
    let force_max_n = impedance.force_max_n;
    let force_limited = spring.norm_squared() > force_max_n * force_max_n;
    if force_limited {
        spring *= force_max_n / spring.norm();
    }
    TipTorque { torque_nm: (jacobian.transpose() * (spring + damper)).into(), force_limited }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hand_model::HandModel;

    const IMPEDANCE: TipImpedance = TipImpedance {
        stiffness_n_per_m: [400.0, 500.0, 300.0],
        damping_n_s_per_m: [10.0, 10.0, 10.0],
        force_max_n: 10.0,
        boost_n: 0.0,
    };

    fn resting(angle_rad: [f32; 3]) -> FingerMotion {
        FingerMotion { angle_rad, speed_rad_per_s: [0.0; 3] }
    }

    #[test]
    fn torques_do_the_work_of_the_spring() {
        let finger = HandModel::<f32>::hit_dlr().finger;
        let (here, there) = ([0.05, 0.7, 0.5], [0.06, 0.73, 0.52]);
        let place = |q: &[f32; 3]| tip(&finger, &FingerTrig::new(&FingerAngles::from_array(q), sin_cos));
        let torque = tip_torque(&finger, &IMPEDANCE, &resting(here), &resting(there));
        assert!(!torque.force_limited);
        let dx = place(&there) - place(&here);
        let force = dx.component_mul(&Vector3::from(IMPEDANCE.stiffness_n_per_m));
        // Virtual work along each joint, by central differences of the forward kinematics.
        for k in 0..3 {
            let (mut low, mut high) = (here, here);
            low[k] -= 2e-3;
            high[k] += 2e-3;
            let work = force.dot(&((place(&high) - place(&low)) / 4e-3));
            assert!((torque.torque_nm[k] - work).abs() < 1e-4, "{k}: {} {work}", torque.torque_nm[k]);
        }
    }

    #[test]
    fn the_spring_never_exceeds_what_the_tip_bears() {
        let finger = HandModel::<f32>::hit_dlr().finger;
        let here = resting([0.0, 0.3, 0.5]);
        let torque = tip_torque(&finger, &IMPEDANCE, &here, &resting([0.0, 1.2, 1.0]));
        assert!(torque.force_limited);
        let jacobian =
            tip_jacobian(&finger, &FingerTrig::new(&FingerAngles::from_array(&here.angle_rad), sin_cos));
        let force = jacobian.transpose().try_inverse().unwrap() * Vector3::from(torque.torque_nm);
        assert!((force.norm() - 10.0).abs() < 1e-3, "{force}");
    }

    #[test]
    fn a_boost_is_a_push_along_the_pad_that_is_cut_with_the_rest() {
        let finger = HandModel::<f32>::hit_dlr().finger;
        let here = resting([0.1, 0.5, 0.6]);
        let trig = FingerTrig::new(&FingerAngles::from_array(&here.angle_rad), sin_cos);
        let force = |boost_n| {
            let torque = tip_torque(&finger, &TipImpedance { boost_n, ..IMPEDANCE }, &here, &here);
            let inverse = tip_jacobian(&finger, &trig).transpose().try_inverse().expect("bent");
            (inverse * Vector3::from(torque.torque_nm), torque.force_limited)
        };
        let normal = pad_normal(&trig).into_inner();
        let (pushed, limited) = force(3.0);
        assert!((pushed - normal * 3.0).norm() < 1e-4 && !limited, "{pushed}");
        let (pushed, limited) = force(30.0);
        assert!((pushed - normal * 10.0).norm() < 1e-3 && limited, "{pushed}");
    }

    #[test]
    fn the_damper_takes_energy_out() {
        let finger = HandModel::<f32>::hit_dlr().finger;
        for speed in [[1.0, 0.0, 0.0], [0.0, -2.0, 0.5], [0.3, 0.3, -3.0]] {
            let moving = FingerMotion { angle_rad: [0.1, 0.5, 0.6], speed_rad_per_s: speed };
            let torque = tip_torque(&finger, &IMPEDANCE, &moving, &resting(moving.angle_rad));
            let power: f32 = torque.torque_nm.iter().zip(speed).map(|(t, v)| t * v).sum();
            assert!(power < 0.0, "{speed:?}: {power}");
        }
    }
}
