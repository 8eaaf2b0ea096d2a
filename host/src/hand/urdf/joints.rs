//! The independent joints of a hand, and how the others repeat them.

use super::description::{Description, Kind};
use super::error::Problem;
use super::overrides::Overrides;
use crate::hand::{Joint, MAX_JOINTS};

/// Speed of a joint whose description has none, rad/s: half a turn a second.
const SPEED_RAD_PER_S: f64 = std::f64::consts::PI;

/// Torque of a joint whose description has none, N m: that of a finger's drive of 10 N at the tip.
const TORQUE_NM: f64 = 1.0;

/// The same of a sliding joint, N and m/s: those of a parallel gripper.
const FORCE_N: f64 = 20.0;
const SPEED_M_PER_S: f64 = 0.1;

/// Lever on which a turning drive is compared with a sliding one, metres.
const LEVER_M: f64 = 0.05;

/// How far a target lies behind a contact that takes the whole torque, rad: gives stiffness from torque. The built-in
/// hand's drives give 1.3 N m at 0.22 rad.
const SQUEEZE_RAD: f64 = 0.2;

/// Stiffness from the torque of a description is kept to this, N m / rad: many write a torque that does not limit.
const STIFFNESS_RANGE_NM_PER_RAD: [f64; 2] = [0.5, 10.0];

/// Independent joints as fingers meet them.
#[derive(Debug, Default)]
pub(super) struct Joints {
    pub(super) joints: Vec<Joint>,
    /// Index in the description, by joint.
    elements: Vec<usize>,
}

/// Which joint moves a segment, and by `multiplier * q + offset`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Drive {
    pub(super) joint: usize,
    pub(super) multiplier: f64,
    pub(super) offset: f64,
}

impl Joints {
    /// The drive of one joint of the description; its independent joint is added when it is new.
    pub(super) fn drive(
        &mut self,
        description: &Description,
        overrides: &Overrides,
        element: usize,
        warnings: &mut Vec<String>,
    ) -> Result<Drive, Problem> {
        let joint = &description.joints[element];
        if let Kind::Other(kind) = &joint.kind {
            return Err(Problem::UnsupportedKind { joint: joint.name.clone(), kind: kind.clone() });
        }
        let Some(mimic) = &joint.mimic else {
            let joint = self.independent(description, overrides, element, warnings)?;
            return Ok(Drive { joint, multiplier: 1.0, offset: 0.0 });
        };
        let no_target = || Problem::MimicTarget { joint: joint.name.clone(), target: mimic.joint.clone() };
        let target = description.joint_index(&mimic.joint).ok_or_else(no_target)?;
        let master = &description.joints[target];
        if let Some(next) = &master.mimic {
            return Err(Problem::MimicChain {
                joint: joint.name.clone(),
                target: mimic.joint.clone(),
                next: next.joint.clone(),
            });
        }
        if matches!(master.kind, Kind::Fixed | Kind::Other(_)) {
            return Err(no_target());
        }
        let index = self.independent(description, overrides, target, warnings)?;
        let drive = Drive { joint: index, multiplier: mimic.multiplier, offset: mimic.offset };
        if joint.kind != Kind::Continuous
            && let Some([lower, upper]) = overrides.limits.get(&joint.name).copied().or(joint.limits)
        {
            if lower > upper {
                return Err(Problem::ReversedLimits { joint: joint.name.clone(), lower, upper });
            }
            narrow(&mut self.joints[index], &drive, [lower, upper], &joint.name, warnings);
        }
        Ok(drive)
    }

    fn independent(
        &mut self,
        description: &Description,
        overrides: &Overrides,
        element: usize,
        warnings: &mut Vec<String>,
    ) -> Result<usize, Problem> {
        if let Some(known) = self.elements.iter().position(|&other| other == element) {
            return Ok(known);
        }
        let joint = &description.joints[element];
        let limits = match overrides.limits.get(&joint.name).copied() {
            Some(limits) => limits,
            None if joint.kind == Kind::Continuous => {
                warnings.push(format!("joint '{}' is continuous: planned from -pi to pi", joint.name));
                [-std::f64::consts::PI, std::f64::consts::PI]
            }
            None => joint.limits.ok_or_else(|| Problem::NoLimits { joint: joint.name.clone() })?,
        };
        let [lower_rad, upper_rad] = limits;
        if lower_rad > upper_rad {
            return Err(Problem::ReversedLimits {
                joint: joint.name.clone(),
                lower: lower_rad,
                upper: upper_rad,
            });
        }
        let mut given = |value: Option<f64>, otherwise: f64, what: &str| match value {
            Some(value) if value > 0.0 => value,
            _ => {
                warnings.push(format!("joint '{}' has no {what}: {otherwise} is assumed", joint.name));
                otherwise
            }
        };
        let slides = joint.kind == Kind::Prismatic;
        let [torque, speed] = if slides { [FORCE_N, SPEED_M_PER_S] } else { [TORQUE_NM, SPEED_RAD_PER_S] };
        let torque_max_nm = given(joint.effort, torque, "effort");
        let speed_max_rad_per_s = given(joint.velocity, speed, "velocity");
        let [least, most] = STIFFNESS_RANGE_NM_PER_RAD;
        // A sliding joint's figures are newtons and metres: the same drive on a lever.
        let torque_nm = if slides { torque_max_nm * LEVER_M } else { torque_max_nm };
        let stiffness =
            overrides.stiffness_nm_per_rad.unwrap_or((torque_nm / SQUEEZE_RAD).clamp(least, most));
        let stiffness_nm_per_rad = if slides { stiffness / (LEVER_M * LEVER_M) } else { stiffness };
        if self.joints.len() == MAX_JOINTS {
            return Err(Problem::TooManyJoints);
        }
        self.elements.push(element);
        self.joints.push(Joint {
            name: joint.name.clone(),
            lower_rad,
            upper_rad,
            speed_max_rad_per_s,
            torque_max_nm,
            stiffness_nm_per_rad,
            flexes: None,
            is_held: false,
        });
        Ok(self.joints.len() - 1)
    }
}

/// Keeps a joint where one that repeats it stays within its own limits.
fn narrow(
    joint: &mut Joint,
    drive: &Drive,
    [lower, upper]: [f64; 2],
    name: &str,
    warnings: &mut Vec<String>,
) {
    if drive.multiplier.abs() < 1e-9 {
        return;
    }
    let at = |limit: f64| (limit - drive.offset) / drive.multiplier;
    let (low, high) = (at(lower).min(at(upper)), at(lower).max(at(upper)));
    let (low, high) = (joint.lower_rad.max(low), joint.upper_rad.min(high));
    let before = joint.upper_rad - joint.lower_rad;
    // Many descriptions give repeating joints limits of no thought: those that leave nothing do not count.
    if high - low < 0.25 * before {
        warnings.push(format!(
            "joint '{name}': its own limits do not fit those of '{}', and are ignored",
            joint.name
        ));
        return;
    }
    if high - low < before - 1e-3 * before.max(1e-3) {
        warnings
            .push(format!("joint '{}' is kept to {low:.4}..{high:.4}, the limits of '{name}'", joint.name));
    }
    if high - low < before - 1e-9 {
        (joint.lower_rad, joint.upper_rad) = (low, high);
    }
}
