//! The simulated hand that a plan is executed on: which board, if any, it is run by.

use std::path::PathBuf;

use anyhow::{Context, bail};
use protocol::ids::FingerId;

use super::execute::RunSettings;
use super::progress::spinner;
use crate::link::Link;
use crate::link::emulator::find_image;
use crate::link::emulator::lockstep::Lockstep;
use crate::twin::{Board, Failure, InProcess, OnBus, Scene, SensorParameters, Twin};

/// What to execute on, `--link`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum LinkChoice {
    /// The firmware's control laws, called directly.
    Twin,
    /// The whole controller on its bus, in this process.
    Controller,
    /// The same as the firmware's image in QEMU; the project's own is built when none is named.
    Qemu(Option<PathBuf>),
}

/// Reads a `--link`.
pub(super) fn link(text: &str) -> Result<LinkChoice, String> {
    match (text, text.strip_prefix("qemu:")) {
        ("twin", _) => Ok(LinkChoice::Twin),
        ("controller", _) => Ok(LinkChoice::Controller),
        ("qemu", _) => Ok(LinkChoice::Qemu(None)),
        (_, Some(elf)) if !elf.is_empty() => Ok(LinkChoice::Qemu(Some(elf.into()))),
        _ => Err("give twin, controller or qemu[:ELF]".to_owned()),
    }
}

impl LinkChoice {
    /// Lower-case name, as in reports.
    pub(super) const fn name(&self) -> &'static str {
        match self {
            Self::Twin => "twin",
            Self::Controller => "controller",
            Self::Qemu(_) => "qemu",
        }
    }

    /// Finds the image, or builds it.
    pub(super) fn make_ready(&self) -> anyhow::Result<SimulatedHand> {
        Ok(match self {
            Self::Twin => SimulatedHand::Twin,
            Self::Controller => SimulatedHand::Controller,
            Self::Qemu(elf) => {
                let waiting = spinner("image");
                let elf = find_image(elf.as_deref())?;
                waiting.finish_and_clear();
                SimulatedHand::Image(elf)
            }
        })
    }
}

/// A [`LinkChoice`] that is ready to be executed on.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum SimulatedHand {
    Twin,
    Controller,
    /// The ELF.
    Image(PathBuf),
}

impl SimulatedHand {
    /// The hand in `scene`; `seed` is that of its sensors' noise. A board knows nothing of `settings.twin`.
    pub(super) fn in_scene(
        &self,
        scene: &Scene,
        seed: u64,
        settings: &RunSettings,
    ) -> anyhow::Result<Box<dyn Link>> {
        let failure = settings.failure;
        match self {
            Self::Twin if failure.is_some() => {
                bail!(
                    "--fail: the twin is control laws alone, which know no faults (--link controller or qemu)"
                )
            }
            Self::Twin => {
                Ok(Box::new(Twin::with_settings(scene, SensorParameters::hit_dlr(), seed, &settings.twin)?))
            }
            Self::Controller => on_bus(scene, seed, InProcess::default(), failure),
            Self::Image(elf) => {
                let board = Lockstep::start(elf).context("starting the image in QEMU")?;
                on_bus(scene, seed, board, failure)
            }
        }
    }
}

fn on_bus<B: Board + 'static>(
    scene: &Scene,
    seed: u64,
    board: B,
    failure: Option<(f64, Failure)>,
) -> anyhow::Result<Box<dyn Link>> {
    let hand = OnBus::start(scene, SensorParameters::hit_dlr(), seed, board)
        .context("making the hand ready over its bus")?;
    Ok(Box::new(match failure {
        Some((time_s, failure)) => hand.failing_at(time_s, failure),
        None => hand,
    }))
}

/// Reads a `--fail`: `power@SECONDS` or `FINGER@SECONDS`.
pub(super) fn failure(text: &str) -> Result<(f64, Failure), String> {
    let wrong = || "give power@SECONDS, or a finger (thumb, index, middle, ring) @SECONDS".to_owned();
    let (what, time_s) = text.split_once('@').ok_or_else(wrong)?;
    let time_s: f64 = time_s.parse().map_err(|_| wrong())?;
    let finger = FingerId::ALL.into_iter().find(|finger| finger.name() == what);
    let failure = match (what, finger) {
        ("power", _) => Failure::Power,
        (_, Some(finger)) => Failure::StrainGauge(finger),
        _ => return Err(wrong()),
    };
    if time_s.is_finite() && time_s >= 0.0 { Ok((time_s, failure)) } else { Err(wrong()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_and_failures_are_read_and_nonsense_is_refused() {
        assert_eq!(link("twin"), Ok(LinkChoice::Twin));
        assert_eq!(link("controller"), Ok(LinkChoice::Controller));
        assert_eq!(link("qemu"), Ok(LinkChoice::Qemu(None)));
        assert_eq!(link("qemu:a:b.elf"), Ok(LinkChoice::Qemu(Some("a:b.elf".into()))));
        for text in ["", "qemu:", "Twin", "tcp:h:1"] {
            assert!(link(text).is_err(), "{text}");
        }
        assert_eq!(failure("power@3"), Ok((3.0, Failure::Power)));
        assert_eq!(failure("ring@0.5"), Ok((0.5, Failure::StrainGauge(FingerId::Ring))));
        for text in ["", "power", "power@", "power@-1", "power@nan", "palm@1", "@1"] {
            assert!(failure(text).is_err(), "{text}");
        }
    }
}
