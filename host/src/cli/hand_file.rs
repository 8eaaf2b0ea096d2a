//! Hands for commands: the built-in one, or one from a robot description with its TOML file.

use std::path::{Path, PathBuf};

use clap::Args;

use super::input;
use crate::hand::urdf::{self, HandError, Loaded, Overrides, Problem};
use crate::hand::{Hand, hit_dlr};
use crate::plan::arm::Arm;

/// Which hand to use, `--hand` and what belongs to it.
#[derive(Debug, Clone, Args)]
pub struct HandArgs {
    /// Hand to plan for: hit-dlr (four fingers), or a robot description FILE.urdf (docs/hands.md)
    #[arg(long, value_name = "hit-dlr|FILE.urdf", default_value = hit_dlr::NAME, value_parser = hand_choice)]
    pub hand: HandChoice,
    /// What the description does not say; by default the TOML file of the same name beside it, if there is one
    #[arg(long, value_name = "FILE.toml")]
    pub hand_config: Option<PathBuf>,
    /// Folder in which packages of package:// lie; may be given several times
    #[arg(long, value_name = "DIR")]
    pub package_path: Vec<PathBuf>,
}

/// Which hand, `--hand`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum HandChoice {
    /// The four-finger HIT/DLR hand.
    HitDlr,
    /// The hand that a robot description shows.
    Urdf(PathBuf),
}

fn hand_choice(text: &str) -> Result<HandChoice, String> {
    match text {
        hit_dlr::NAME => Ok(HandChoice::HitDlr),
        file if Path::new(file).extension().is_some_and(|e| e == "urdf" || e == "xml") => {
            Ok(HandChoice::Urdf(file.into()))
        }
        _ => Err("give hit-dlr or a file FILE.urdf".to_owned()),
    }
}

/// A hand for a command, and lines that say what was chosen.
pub(super) struct Chosen {
    pub(super) hand: Hand,
    /// Of a hand from a file.
    loaded: Option<Loaded>,
    pub(super) lines: Vec<String>,
}

impl HandArgs {
    /// The hand; warnings about a description go to stderr.
    pub(super) fn chosen(&self) -> anyhow::Result<Chosen> {
        let HandChoice::Urdf(path) = &self.hand else {
            anyhow::ensure!(self.hand_config.is_none(), "--hand-config: the built-in hand takes none");
            anyhow::ensure!(
                self.package_path.is_empty(),
                "--package-path: the built-in hand has no packages"
            );
            return Ok(Chosen { hand: Hand::hit_dlr()?, loaded: None, lines: Vec::new() });
        };
        let read = load(path, self.hand_config.as_deref(), &self.package_path)?;
        let (lines, loaded) = (read.lines(), read.loaded);
        if loaded.hand.candidates.is_empty() {
            return Err(HandError { file: path.clone(), problem: Problem::NoCandidate }.into());
        }
        input::warn(path.display(), &loaded.warnings);
        Ok(Chosen { hand: loaded.hand.clone(), loaded: Some(loaded), lines })
    }
}

/// A description that was read with its TOML file.
pub(super) struct Read {
    pub(super) loaded: Loaded,
    /// The TOML file: as asked for, or the one that lies beside the description.
    pub(super) config: Option<PathBuf>,
}

impl Read {
    /// What it is, in lines.
    pub(super) fn lines(&self) -> Vec<String> {
        let hand = &self.loaded.hand;
        let names: Vec<&str> = hand.fingers.iter().map(|finger| finger.name.as_str()).collect();
        let mut lines = vec![format!(
            "hand: {}, {} fingers ({}), {} independent joint(s), {} typical grasp(s)",
            hand.name,
            names.len(),
            names.join(", "),
            hand.joints.len(),
            hand.candidates.len()
        )];
        if let Some(config) = &self.config {
            lines.push(format!("hand: with {}", config.display()));
        }
        lines
    }
}

/// Reads a description with its TOML file.
pub(super) fn load(path: &Path, config: Option<&Path>, package_paths: &[PathBuf]) -> anyhow::Result<Read> {
    let beside = path.with_extension("toml");
    let config = config.map(Path::to_owned).or_else(|| beside.is_file().then_some(beside));
    let overrides = config.as_deref().map(Overrides::load).transpose()?;
    let loaded = urdf::load(path, overrides.as_ref(), package_paths)?;
    Ok(Read { loaded, config })
}

impl Chosen {
    /// The arm with this hand on its flange, and a line that says where it sits, if that was not told. An arm that has a
    /// mount of its own keeps it, unless the hand's file names another.
    pub(super) fn mounted(&mut self, arm: Arm) -> Arm {
        let Some(loaded) = &self.loaded else { return arm };
        if arm.has_own_mount() && !loaded.is_mount_given {
            return arm;
        }
        let at = loaded.flange_from_palm;
        if !loaded.is_mount_given {
            self.lines.push(format!(
                "hand: mounted with its palm on the flange, palm frame {:.1} mm in front of it, axes parallel; \
                 [flange_from_palm] in the hand's TOML says otherwise",
                1e3 * at.translation.z
            ));
        }
        arm.with_flange_from_palm(at)
    }
}
