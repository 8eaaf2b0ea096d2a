//! What both ends of the bus agree on: the body. Kinematics and parameters of the HIT/DLR hand.
//!
//! Four equal fingers, each with three actuated joints and a distal joint that repeats the middle one, and a thumb
//! whose base turns about the palm: 13 actuators. Everything is generic over the scalar, `f32` in the firmware and
//! `f64` on the host, and no function of the finger calls a trigonometric function: the caller gives sines and
//! cosines in a [`FingerTrig`], from its own fast polynomial or from the standard library.
//!
//! # Frames
//!
//! - **palm**: origin at the wrist plane, +z along the stretched fingers, +x out of the grasping side, +y to the index.
//! - **finger base**: origin where the axes of abduction and flexion cross, +x along the stretched finger, +z the axis
//!   of abduction, to the side of the pads. Abduction is positive about +z, flexion and the middle joint about -y.
//! - **proximal, middle, distal**: at the flexion, middle and distal joint, +x along the link, +z to the pad side.
//!   The origin of the proximal link coincides with that of the finger base.
//! - **tip**: the centre of the sphere that is the fingertip, on the x axis of the distal link.
//!
//! ```
//! use hand_model::{FingerAngles, FingerTrig, HandModel, tip};
//! use protocol::ids::FingerId;
//!
//! let hand = HandModel::<f64>::hit_dlr();
//! let angles = FingerAngles { abduction_rad: 0.0, flexion_rad: 0.6, middle_rad: 0.4 };
//! let trig = FingerTrig::new(&angles, f64::sin_cos);
//! let tip_in_base = tip(&hand.finger, &trig);
//! let palm_from_base = hand.palm_from_finger_base(FingerId::Middle, 1.5_f64.sin_cos());
//! let tip_in_palm = palm_from_base * tip_in_base;
//! assert!(tip_in_palm.x > 0.08, "a bent finger reaches out of the palm");
//! ```
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

mod coupling;
mod forward;
mod frames;
mod inverse;
mod jacobian;
mod joints;
mod model;
pub mod params;
#[cfg(test)]
mod testing;

pub use coupling::{
    BaseMotors, base_from_motors, base_torques_from_motors, coupled_torque_nm, distal_rad,
    motor_torques_from_base, motors_from_base,
};
pub use forward::{FingerLinks, FingerTrig, links, pad_normal, tip};
pub use inverse::{FingerInverse, NoPose, TipInverse, inverse_angles, inverse_trig};
pub use jacobian::tip_jacobian;
pub use joints::{FingerAngles, HandAngles, HandLimits, JointRange, LimitCheck, Side};
pub use model::{
    CollisionGeometry, DriveParameters, FingerGeometry, FingerMasses, FingerMounts, HandModel, LinkMass,
    PalmBox, ThumbRotation,
};
