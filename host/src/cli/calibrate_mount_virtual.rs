//! Scans of balls in the virtual cell, by a scanner that does not sit where its drawing says.

use std::path::Path;

use anyhow::{Context, ensure};
use nalgebra::{Isometry3, Point3, Translation3, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::input::{self, SPOT_M, TABLE_HEIGHT_M};
use crate::plan::arm::Arm;
use crate::scan::capture::{Capture, Start};
use crate::scan::hand_eye::{Profile, ball, ball_sweeps, displaced_mount};
use crate::scan::joints::carry;
use crate::scan::optics::Optics;
use crate::scan::recording::{Content, RecordingError, RecordingWriter};
use crate::scan::render::Renderer;
use crate::scan::rig::Rig;
use crate::scan::virtual_capture::{CarriedSweep, CellSettings, virtual_capture};
use crate::scan::{Camera, Instrument, StripePose};
use crate::surface::Plane;

/// Radius of the ball, 40 mm across, and of the one to verify with, an inch across.
pub(super) const VIRTUAL_RADIUS_M: f64 = 0.020;
pub(super) const VIRTUAL_CHECK_RADIUS_M: f64 = 0.0127;
/// Sweeps over the second.
const CHECK_SWEEPS: u32 = 6;
/// The second stands so far from the first.
const CHECK_ASIDE_M: [f64; 2] = [-0.03, 0.06];
/// Both stand on stems of this height, too thin to be seen.
const STEM_M: f64 = 0.010;
/// How far the scanner is from its nominal place.
const SHIFT_M: f64 = 0.005;
const TURN_RAD: f64 = 2.0 * std::f64::consts::PI / 180.0;

/// Captures of the ball to calibrate with and the ball to verify with, and where the scanner really sits. The captures say
/// that it sits at its nominal place. `record` is a folder for both.
pub(super) fn virtual_captures(
    sweeps: u32,
    seed: u64,
    record: Option<&Path>,
) -> anyhow::Result<(Capture, Capture, Isometry3<f64>)> {
    let truth = displaced_mount(SHIFT_M, TURN_RAD, seed);
    let (instrument, optics) = (Instrument::default(), Optics::default());
    let rig = Rig::calibrated(&instrument, &optics, seed).context("calibrating the virtual scanner")?;
    if let Some(folder) = record {
        input::make_folder(folder)?;
    }
    let make = |name: &str, aside_m: [f64; 2], radius_m: f64, sweeps: u32, seed: u64| {
        let folder = record.map(|folder| folder.join(name));
        let writer = |folder| RecordingWriter::create(folder, Content::Stripes, &Arm::rx60());
        let writer = folder.as_deref().map(writer).transpose()?;
        let [x, y] = [0, 1].map(|i| SPOT_M[i] + aside_m[i]);
        let center = Point3::new(x, y, TABLE_HEIGHT_M + STEM_M + radius_m);
        let capture = captured(&center, radius_m, sweeps, seed, &truth, (&instrument, &optics, &rig))?;
        if let Some(writer) = writer {
            writer.finish(&capture)?;
        }
        Ok::<_, anyhow::Error>(capture)
    };
    let ball = make("ball", [0.0; 2], VIRTUAL_RADIUS_M, sweeps, seed)?;
    // Noise and sweeps of its own.
    let check =
        make("check", CHECK_ASIDE_M, VIRTUAL_CHECK_RADIUS_M, CHECK_SWEEPS, seed.wrapping_add(1 << 32))?;
    Ok((ball, check, truth))
}

fn captured(
    center_m: &Point3<f64>,
    radius_m: f64,
    sweeps: u32,
    seed: u64,
    truth: &Isometry3<f64>,
    (instrument, optics, rig): (&Instrument, &Optics, &Rig),
) -> anyhow::Result<Capture> {
    let arm = Arm::rx60();
    let carried = |pass: &[StripePose]| carry(&arm, truth, pass);
    let planned = ball_sweeps(center_m, radius_m, instrument, sweeps, seed, &|pass| carried(pass).is_some());
    let sweeps: Vec<CarriedSweep> = planned
        .into_iter()
        .filter_map(|sweep| Some(CarriedSweep { joints: carried(&sweep.stripes)?, sweep }))
        .collect();
    ensure!(!sweeps.is_empty(), "the arm reaches no sweep over the ball");
    let table = Plane::horizontal(TABLE_HEIGHT_M);
    let renderer = Renderer::new(&ball(center_m, radius_m)?, Some(table), instrument, optics)?;
    let cell = CellSettings { offset_s: 0.0, seed };
    let keep = |_: u32, _: Camera, _: &image::GrayImage| Ok::<(), RecordingError>(());
    Ok(virtual_capture(&renderer, &arm, rig, &sweeps, Start::default(), cell, &keep)?)
}

/// Errors beyond those of the virtual cell's cameras.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Disturbance {
    /// Of each point, along the stripe and away from the laser.
    pub(super) noise_m: f64,
    /// Of where the arm says it is, the same throughout a sweep, along each axis of the base.
    pub(super) arm_error_m: f64,
    pub(super) seed: u64,
}

impl Disturbance {
    /// Adds them; `stream` tells one scan's from another's.
    pub(super) fn apply(&self, profiles: &mut [Profile], stream: u64) {
        if self.noise_m == 0.0 && self.arm_error_m == 0.0 {
            return;
        }
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        rng.set_stream(stream);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        for sweep in profiles.chunk_by_mut(|a, b| (a.target, a.sweep) == (b.target, b.sweep)) {
            let error = Translation3::from(Vector3::from_fn(|_, _| self.arm_error_m * normal()));
            for profile in sweep {
                profile.base_from_palm = error * profile.base_from_palm;
                profile.points_m.iter_mut().flatten().for_each(|x| *x += self.noise_m * normal());
            }
        }
    }
}
