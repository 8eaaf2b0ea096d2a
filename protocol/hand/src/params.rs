//! Every number of the hand, in SI units, with where it comes from.
//!
//! The HIT/DLR hand was sold as the SCHUNK Anthropomorphic Hand; two laboratories have released models of that hand
//! (for the planners Kautham and Move3D) which agree on the link lengths to 0.1 mm. They show the commercial build; the
//! laboratory prototype may differ by millimetres. No table of the kinematics by its makers is known.
//!
//! Each constant says how it is known: **published** (a paper, a manufacturer, a laboratory's released model),
//! **derived** (arithmetic on published values or measurement on a published model) or **assumed** (an engineering
//! choice, with its reason).

const DEG: f64 = core::f64::consts::PI / 180.0;

/// Proximal link, base axes to middle joint, metres. Published: Kautham's model; Move3D's has 67.816 mm.
pub const L1_M: f64 = 0.0678;
/// Middle link, middle to distal joint, metres. Published: Kautham's model; Move3D's has 29.980 mm.
pub const L2_M: f64 = 0.0300;
/// Distal link, distal joint to the centre of the tip's sphere, metres. Derived: sphere fitted to the fingertip of
/// Kautham's mesh (25 to 27 mm; Move3D's planner uses 29 mm, to its own larger sphere).
pub const L3_M: f64 = 0.0270;
/// Radius of the fingertip, metres. Derived: the same fit (12.1 to 13.7 mm; Move3D's planner uses 13 mm).
pub const TIP_RADIUS_M: f64 = 0.0125;

/// Abduction the mechanism allows, radians. Published: the hand's paper of 2005, +-20 degrees.
pub const ABDUCTION_HARD_RAD: [f64; 2] = [-20.0 * DEG, 20.0 * DEG];
/// Flexion the mechanism allows, radians. Derived: the paper's range of 90 degrees, and 5 degrees of overstretch that
/// contain the -4 degrees of the hand's control software.
pub const FLEXION_HARD_RAD: [f64; 2] = [-5.0 * DEG, 90.0 * DEG];
/// Middle joint, mechanism, radians. Derived: the software's 75 degrees and a margin of 5; 0 is the stretched finger.
pub const MIDDLE_HARD_RAD: [f64; 2] = [0.0, 80.0 * DEG];
/// Abduction to plan within, radians. Published: both released models, +-15 degrees.
pub const ABDUCTION_SOFT_RAD: [f64; 2] = [-15.0 * DEG, 15.0 * DEG];
/// Flexion to plan within, radians. Published: both released models, -4 to 75 degrees.
pub const FLEXION_SOFT_RAD: [f64; 2] = [-4.0 * DEG, 75.0 * DEG];
/// Middle joint to plan within, radians. Published: both released models, 4 to 75 degrees.
pub const MIDDLE_SOFT_RAD: [f64; 2] = [4.0 * DEG, 75.0 * DEG];
/// Rotation of the thumb's base, radians: 0 to the side, a quarter turn opposed. Published: the paper and both models.
pub const THUMB_ROTATION_RAD: [f64; 2] = [0.0, 90.0 * DEG];

/// Base of the index finger in the palm frame, metres. Published: Kautham's model.
pub const INDEX_BASE_IN_PALM_M: [f64; 3] = [-0.0043, 0.040165, 0.14543];
/// Base of the middle finger in the palm frame, metres. Published: Kautham's model.
pub const MIDDLE_BASE_IN_PALM_M: [f64; 3] = [-0.0043, 0.0, 0.15015];
/// Base of the ring finger in the palm frame, metres. Published: Kautham's model.
pub const RING_BASE_IN_PALM_M: [f64; 3] = [-0.0043, -0.040165, 0.14543];
/// Lean of the index finger towards palm +y, radians. Published: Kautham's model, 2.03 degrees.
pub const INDEX_SPLAY_RAD: f64 = 2.03 * DEG;
/// Lean of the middle finger towards palm +y, radians. Published: Kautham's model.
pub const MIDDLE_SPLAY_RAD: f64 = 0.0;
/// Lean of the ring finger towards palm +y, radians. Published: Kautham's model, -1.97 degrees.
pub const RING_SPLAY_RAD: f64 = -1.97 * DEG;

/// A point of the axis of the thumb's rotation, which is parallel to palm z, metres. Published: both models.
pub const THUMB_AXIS_IN_PALM_M: [f64; 3] = [-0.003, 0.0271, 0.0];
/// Base of the thumb at rotation 0 in the palm frame, metres. Published: Kautham's model; Move3D's differs by 5 mm.
pub const THUMB_BASE_AT_ZERO_IN_PALM_M: [f64; 3] = [-0.009, 0.114, 0.097];
/// Angle of the stretched thumb to palm z, radians. Published: Kautham's model 35, Move3D's 35.2 degrees.
pub const THUMB_TILT_RAD: f64 = 35.0 * DEG;
/// Centre of grasps in the palm frame, metres. Published: Move3D's grasp frame, taken over as it is; the origin of its
/// wrist lies about 10 mm from this one's, less than such a centre means.
pub const GRASP_CENTRE_IN_PALM_M: [f64; 3] = [0.08, 0.02, 0.23];

/// Torque that a finger's actuators give, newton metres: abduction, flexion, middle and distal joint together.
/// Derived: what 10 N at the fingertip ask anywhere in the workspace (1.25, 1.24, 0.84), rounded up.
pub const TORQUE_MAX_NM: [f64; 3] = [1.3, 1.3, 0.9];
/// Speed of a finger's joints, radians per second: half a turn. Assumed: models of the later five-finger hand use it; the
/// DLR Hand II, from the same workshop, is published with twice that.
pub const SPEED_MAX_RAD_PER_S: f64 = core::f64::consts::PI;
/// Continuous force of a fingertip, newtons. Published: the paper.
pub const TIP_FORCE_MAX_N: f64 = 10.0;
/// Speed of the thumb's rotation, radians per second. Assumed: a third of a finger's; it moves between grasps only.
pub const THUMB_ROTATION_SPEED_MAX_RAD_PER_S: f64 = 1.0;
/// Torque that the brake of the thumb's rotation holds, newton metres. Derived: 10 N at a lever of 0.167 m, the thumb's
/// largest distance from the axis.
pub const THUMB_BRAKE_HOLDING_NM: f64 = 1.7;
/// Step in which the thumb's rotation is commanded, radians. Published: the control interface of the commercial hand
/// takes whole degrees and has a brake, so this joint is no servo during a grasp.
pub const THUMB_ROTATION_STEP_RAD: f64 = 1.0 * DEG;

/// Motor turns per joint turn. Assumed: harmonic drive 100:1 and belt 1.25:1, from the gears of both later DLR hands.
pub const GEAR_RATIO: f64 = 125.0;
/// Inertia of a rotor seen at the joint, kg m^2. Assumed: 5e-8 kg m^2 of a 16 mm brushless motor times 100^2.
pub const ROTOR_INERTIA_REFLECTED_KG_M2: f64 = 5e-4;
/// Stiffness between motor and joint, newton metres per radian. Assumed: identified for the DLR Hand II (ICRA 2022).
pub const DRIVE_STIFFNESS_NM_PER_RAD: f64 = 25.0;
/// Coulomb friction at a joint, newton metres. Assumed: identified for the DLR Hand II (ICRA 2022).
pub const COULOMB_FRICTION_NM: f64 = 0.02;
/// Viscous friction at a joint, newton metre seconds per radian. Assumed: the middle of the usual 0.01 to 0.02.
pub const VISCOUS_FRICTION_NM_S_PER_RAD: f64 = 0.015;

/// Mass of the hand, kg. Published: the paper.
pub const HAND_MASS_KG: f64 = 1.6;
/// Mass of the part between abduction and flexion axis, kg. Derived: see [`PROXIMAL_MASS_KG`].
pub const BASE_MASS_KG: f64 = 0.030;
/// Mass of the proximal link, kg. Derived: density of the five-finger hand's published model times the volume of this
/// hand's link hulls (2.19, 1.70 and 2.13 times those of the five-finger hand).
pub const PROXIMAL_MASS_KG: f64 = 0.051;
/// Mass of the middle link, kg. Derived: see [`PROXIMAL_MASS_KG`].
pub const MIDDLE_MASS_KG: f64 = 0.027;
/// Mass of the distal link, kg. Derived: see [`PROXIMAL_MASS_KG`].
pub const DISTAL_MASS_KG: f64 = 0.029;
/// Centre of mass of the proximal link along it, from its joint, metres. Assumed: scaled from the five-finger hand;
/// offsets across the link, 3 mm at most, are left out because their side is not known.
pub const PROXIMAL_COM_M: f64 = 0.031;
/// Centre of mass of the middle link along it, from its joint, metres. Assumed: scaled as [`PROXIMAL_COM_M`].
pub const MIDDLE_COM_M: f64 = 0.012;
/// Centre of mass of the distal link along it, from its joint, metres. Assumed: scaled as [`PROXIMAL_COM_M`].
pub const DISTAL_COM_M: f64 = 0.012;

/// Radius of the capsule that stands for the proximal link, metres. Assumed: less than half its envelope of 37 mm, so
/// that neighbours 40 mm apart have room to abduct.
pub const PROXIMAL_RADIUS_M: f64 = 0.015;
/// Radius of the capsule that stands for the middle link, metres. Assumed: half the width of its envelope, 28 mm.
pub const MIDDLE_RADIUS_M: f64 = 0.014;
/// Radius of the capsule that stands for the distal link, metres. Assumed: that of the tip, whose sphere is its end.
pub const DISTAL_RADIUS_M: f64 = TIP_RADIUS_M;
/// Lower corner of the palm's box in the palm frame, metres. Derived: envelope of the palm in Kautham's mesh.
pub const PALM_BOX_MIN_M: [f64; 3] = [-0.045, -0.060, -0.007];
/// Upper corner of the palm's box in the palm frame, metres. Derived: the same envelope, but cut at z = 0.125, 5 mm
/// short of the proximal links; the whole envelope would contain the roots of the fingers.
pub const PALM_BOX_MAX_M: [f64; 3] = [0.037, 0.063, 0.125];
