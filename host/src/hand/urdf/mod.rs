//! Hands from URDF: fingers, tips, closing directions and typical grasps found from the kinematics.
//!
//! The way: text (`description`), one tree of rigid bodies (`tree`), its independent joints (`joints`), chains with balls
//! (`chains`, `balls`, `fit`), how they close (`flexion`) and oppose each other (`opposition`), the palm's boxes (`palm`),
//! typical grasps (`typical`). `docs/hands.md` tells what a person has to know of it.

mod balls;
mod build;
mod chains;
mod description;
mod error;
mod files;
mod fit;
mod flexion;
mod joints;
mod opposition;
mod overrides;
mod palm;
mod tree;
mod typical;

use std::io::Read;
use std::path::{Path, PathBuf};

use nalgebra::Isometry3;

use super::Hand;
use files::Files;

pub use error::{HandError, Problem};
pub use overrides::{FingerOverride, Flexion, MountOverride, Overrides, PalmOverride};

/// Largest description that is read, MiB.
const LIMIT_MIB: u64 = 16;

/// A hand that was read, and what else is to be known of it.
#[derive(Debug, Clone)]
pub struct Loaded {
    /// The hand. Finger 0 is the one that the others close against. Without candidates when no pads face each other: there
    /// is nothing to plan with then ([`Problem::NoCandidate`]).
    pub hand: Hand,
    /// Name of the link that is the palm.
    pub palm_link: String,
    /// Pose of the palm frame in that link.
    pub link_from_palm: Isometry3<f64>,
    /// Where the hand sits on an arm: as the overrides say, else with its lowest box on the flange.
    pub flange_from_palm: Isometry3<f64>,
    /// Whether the overrides said so.
    pub is_mount_given: bool,
    /// What was assumed, left out or approximated, a line each.
    pub warnings: Vec<String>,
}

/// Reads a hand. Meshes of `package://` are looked for in `package_paths` and upwards from the description's folder.
///
/// # Errors
/// [`HandError`], whose message is one line that names the file, and the link, joint or key in it.
pub fn load(
    path: &Path,
    overrides: Option<&Overrides>,
    package_paths: &[PathBuf],
) -> Result<Loaded, HandError> {
    let wrong = |problem| {
        // What a TOML file says wrong is in that file.
        let file = match (&problem, overrides.and_then(|o| o.file.clone())) {
            (Problem::Unknown { .. } | Problem::Value { .. }, Some(file)) => file,
            _ => path.to_owned(),
        };
        HandError { file, problem }
    };
    let text = read(path).map_err(wrong)?;
    let base = path.parent().unwrap_or(Path::new(""));
    from_str(&text, base, overrides, package_paths).map_err(wrong)
}

/// Reads a hand from the text of a description whose relative paths start at `base`.
///
/// # Errors
/// [`Problem`] as [`load`].
pub fn from_str(
    text: &str,
    base: &Path,
    overrides: Option<&Overrides>,
    package_paths: &[PathBuf],
) -> Result<Loaded, Problem> {
    let none = Overrides::default();
    build::hand(text, &Files { base, package_paths }, overrides.unwrap_or(&none))
}

/// The text of a file of reasonable size.
fn read(path: &Path) -> Result<String, Problem> {
    let file = std::fs::File::open(path).map_err(Problem::File)?;
    let mut text = String::new();
    let read = file.take((LIMIT_MIB << 20) + 1).read_to_string(&mut text).map_err(Problem::File)?;
    if read as u64 > LIMIT_MIB << 20 {
        return Err(Problem::TooLarge { limit_mib: LIMIT_MIB });
    }
    Ok(text)
}
