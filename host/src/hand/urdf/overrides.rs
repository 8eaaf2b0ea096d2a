//! What a person says of a hand that its description does not, in a short TOML file. Every key is optional.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Vector3};
use serde::Deserialize;

use super::description::{Description, pose};
use super::error::{HandError, Problem};
use super::palm::quaternion;

/// Corrections and additions to a hand that is read from URDF.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Overrides {
    /// The file that was read, for messages.
    #[serde(skip)]
    pub file: Option<PathBuf>,
    /// Name of the hand.
    pub name: Option<String>,
    /// Mass of the hand, kg.
    pub mass_kg: Option<f64>,
    /// What a fingertip can press continuously, N.
    pub tip_force_n: Option<f64>,
    /// Stiffness of every joint's position control, N m / rad.
    pub stiffness_nm_per_rad: Option<f64>,
    /// Torsional friction of soft tips as a length, metres.
    pub soft_tip_torsion_m: Option<f64>,
    /// Name of the finger that the others close against.
    pub opposing: Option<String>,
    /// Joints that are set before a grasp and held in it.
    #[serde(default)]
    pub held: Vec<String>,
    /// Which link is the palm, and where the palm frame stands in it.
    #[serde(default)]
    pub palm: PalmOverride,
    /// Where the hand sits on an arm: pose of the palm frame in the flange frame.
    pub flange_from_palm: Option<MountOverride>,
    /// The fingers, in place of those that are found.
    #[serde(default)]
    pub finger: Vec<FingerOverride>,
    /// Towards which limit a joint closes its finger, by joint.
    #[serde(default)]
    pub flexion: BTreeMap<String, Flexion>,
    /// Narrower or missing limits by joint, rad (metres for a sliding joint).
    #[serde(default)]
    pub limits: BTreeMap<String, [f64; 2]>,
}

/// Which link is the palm, and where the palm frame stands in it.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PalmOverride {
    /// Name of the link that carries the fingers.
    pub link: Option<String>,
    /// Origin of the palm frame in that link, metres.
    pub xyz: Option<[f64; 3]>,
    /// Its roll, pitch and yaw as URDF has them, rad; z is to point along the stretched fingers.
    pub rpy: Option<[f64; 3]>,
}

/// Pose of the palm frame in the arm's flange frame.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MountOverride {
    /// Origin of the palm frame, metres.
    pub xyz: Option<[f64; 3]>,
    /// Its roll, pitch and yaw as URDF has them, rad.
    pub rpy: Option<[f64; 3]>,
}

/// One finger.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FingerOverride {
    /// The last link, or one that is fixed to it.
    pub tip: String,
    /// Name of the finger.
    pub name: Option<String>,
}

/// How a joint closes its finger.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Flexion {
    /// Towards its upper limit.
    Upper,
    /// Towards its lower limit.
    Lower,
    /// Not: it spreads or turns the finger.
    None,
}

impl Overrides {
    /// Reads a file.
    ///
    /// # Errors
    /// [`HandError`] with file, line and key when it is not TOML, has unknown keys, or a number that cannot be.
    pub fn load(path: &Path) -> Result<Self, HandError> {
        let wrong = |problem| HandError { file: path.to_owned(), problem };
        let text = super::read(path).map_err(wrong)?;
        let overrides = Self::parse(&text).map_err(wrong)?;
        Ok(Self { file: Some(path.to_owned()), ..overrides })
    }

    /// Reads a text.
    ///
    /// # Errors
    /// [`Problem`] as [`Overrides::load`].
    pub fn parse(text: &str) -> Result<Self, Problem> {
        let overrides: Self = toml::from_str(text).map_err(|error| {
            // By bytes: a span need not begin at a character.
            let line_of = |at: usize| 1 + text.bytes().take(at).filter(|byte| *byte == b'\n').count();
            let line = error.span().map(|span| line_of(span.start));
            let message = error.message().replace('\n', " ");
            Problem::Toml(line.map_or_else(|| message.clone(), |line| format!("line {line}: {message}")))
        })?;
        overrides.check()?;
        Ok(overrides)
    }

    fn check(&self) -> Result<(), Problem> {
        let wrong = |key: &str, text: &str| Problem::Value { key: key.to_owned(), text: text.to_owned() };
        for (key, value) in [
            ("mass_kg", self.mass_kg),
            ("tip_force_n", self.tip_force_n),
            ("stiffness_nm_per_rad", self.stiffness_nm_per_rad),
        ] {
            if value.is_some_and(|v| !v.is_finite() || v <= 0.0) {
                return Err(wrong(key, "give a number above 0"));
            }
        }
        if self.soft_tip_torsion_m.is_some_and(|v| !v.is_finite() || v < 0.0) {
            return Err(wrong("soft_tip_torsion_m", "give a number of 0 or more"));
        }
        let finite = |numbers: Option<[f64; 3]>| numbers.is_none_or(|n| n.iter().all(|v| v.is_finite()));
        let mount = self.flange_from_palm.clone().unwrap_or_default();
        for (key, xyz, rpy) in
            [("palm", self.palm.xyz, self.palm.rpy), ("flange_from_palm", mount.xyz, mount.rpy)]
        {
            if !finite(xyz) || !finite(rpy) {
                return Err(wrong(key, "xyz and rpy are three finite numbers each"));
            }
        }
        for (joint, [lower, upper]) in &self.limits {
            if !(lower.is_finite() && upper.is_finite() && lower <= upper) {
                return Err(wrong(
                    &format!("limits.{joint}"),
                    "give [lower, upper], finite, and lower not above upper",
                ));
            }
        }
        Ok(())
    }

    /// Refuses names that the description does not have.
    pub(super) fn check_names(&self, description: &Description) -> Result<(), Problem> {
        let unknown = |key: String, what: &'static str, name: &str| {
            Err(Problem::Unknown { key, what, name: name.to_owned() })
        };
        if let Some(link) = &self.palm.link
            && description.link_index(link).is_none()
        {
            return unknown("palm.link".to_owned(), "link", link);
        }
        for (i, finger) in self.finger.iter().enumerate() {
            if description.link_index(&finger.tip).is_none() {
                return unknown(format!("finger[{i}].tip"), "link", &finger.tip);
            }
        }
        let joints = self.limits.keys().map(|joint| ("limits", joint));
        let joints = joints.chain(self.flexion.keys().map(|joint| ("flexion", joint)));
        for (key, joint) in joints.chain(self.held.iter().map(|joint| ("held", joint))) {
            if description.joint_index(joint).is_none() {
                return unknown(key.to_owned(), "joint", joint);
            }
        }
        Ok(())
    }

    /// Pose of the palm frame in the flange frame, where it is given.
    pub(super) fn mount(&self) -> Option<Isometry3<f64>> {
        let mount = self.flange_from_palm.as_ref()?;
        let [xyz, rpy] = [mount.xyz, mount.rpy].map(|v| Vector3::from(v.unwrap_or_default()));
        Some(quaternion(&pose(xyz, rpy)))
    }
}
