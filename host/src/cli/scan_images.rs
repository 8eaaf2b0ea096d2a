//! `prehend scan` by images: rendered in the virtual cell, or recorded.

use std::io::Write;
use std::path::Path;
use std::time::Instant;

use anyhow::Context;
use serde::Serialize;

use super::input::{self, TABLE_HEIGHT_M};
use super::scan::{ScanArgs, placed};
use crate::io::read_text;
use crate::object::Object;
use crate::plan::arm::Arm;
use crate::scan::calibrate::Calibration;
use crate::scan::capture::{Capture, MeasureReport, MeasureSettings, Measured, Start};
use crate::scan::clock_offset::ClockOffset;
use crate::scan::joints::carry;
use crate::scan::next_sweep::{Chain, chain};
use crate::scan::optics::{Finish, Optics};
use crate::scan::recording::{Content, RecordingWriter, read_recording};
use crate::scan::render::Renderer;
use crate::scan::rig::{MEASURED_WIDTH_M, Rig, StripeCamera};
use crate::scan::virtual_capture::{CarriedSweep, CellSettings, virtual_capture};
use crate::scan::{
    Camera, Instrument, ScanError, StripePose, Sweep, SweepSettings, palm_from_scanner, plan_sweeps,
    target_sphere,
};
use crate::surface::{Plane, PointCloud};

/// A scan by images.
pub(super) struct ImageScan {
    pub(super) measured: Measured,
    pub(super) sweeps: Vec<String>,
    pub(super) unreachable: Vec<String>,
    pub(super) duration_s: f64,
    pub(super) images: ImageSummary,
}

/// What there is to say of the images.
#[derive(Debug, Clone, Serialize)]
pub(super) struct ImageSummary {
    #[serde(flatten)]
    report: MeasureReport,
    #[serde(skip_serializing_if = "Option::is_none")]
    recorded: Option<String>,
    seconds: ImageSeconds,
}

/// Elapsed time of the stages.
#[derive(Debug, Clone, Copy, Serialize)]
struct ImageSeconds {
    /// Rendering and finding the stripes, or reading the recording and finding them.
    images_s: f64,
    /// From stripes to the cloud.
    measure_s: f64,
}

impl ImageSummary {
    pub(super) fn describe(&self, out: &mut dyn Write) -> std::io::Result<()> {
        let report = &self.report;
        let pixels = &report.pixels;
        writeln!(
            out,
            "stripe pixels: {} seen by both cameras alike, {} by one, {} differently, {} doubtful, {} uncalibrated",
            pixels.agreed, pixels.by_one, pixels.disagreed, pixels.doubtful, pixels.outside
        )?;
        let ms = |seconds: f64| seconds * 1e3;
        match report.clock {
            ClockOffset::NotAsked => writeln!(out, "clocks: left alone")?,
            ClockOffset::Undetermined => {
                writeln!(out, "clocks: these sweeps cannot tell whether they agree")?
            }
            ClockOffset::Negligible { offset_s, sigma_s } => {
                writeln!(out, "clocks agree: {:.2} +- {:.2} ms", ms(offset_s), ms(sigma_s))?;
            }
            ClockOffset::Applied { offset_s, sigma_s } => writeln!(
                out,
                "clocks differ: {:.2} +- {:.2} ms added to the frames' times, {} frames lost",
                ms(offset_s),
                ms(sigma_s),
                report.frames_lost_to_clock
            )?,
        }
        let ImageSeconds { images_s, measure_s } = self.seconds;
        writeln!(out, "took {images_s:.2} s for the images, {measure_s:.2} s to measure")?;
        match &self.recorded {
            Some(folder) => writeln!(out, "recorded {folder}"),
            None => Ok(()),
        }
    }
}

/// Measures a recording, with the scanner mounted as a file says if one is given; warnings go to stderr.
pub(super) fn recorded(
    folder: &Path,
    mount: Option<&Path>,
    correct_clock: bool,
) -> anyhow::Result<ImageScan> {
    let clock = Instant::now();
    let mount = mount.map(input::mount).transpose()?;
    let mut read = read_recording(folder)?;
    if let Some(mount) = mount {
        read.capture.rig.palm_from_scanner = mount;
    }
    input::warn(folder.display(), &read.warnings);
    let images_s = clock.elapsed().as_secs_f64();
    let frames = &read.capture.frames;
    let sweeps: Vec<_> = frames.chunk_by(|a, b| a.sweep == b.sweep).collect();
    let duration_s = sweeps.iter().map(|frames| frames[frames.len() - 1].time_s - frames[0].time_s).sum();
    let names = sweeps.iter().map(|frames| format!("sweep {}", frames[0].sweep)).collect();
    let measured = measure(&read.capture, correct_clock, images_s);
    let (measured, images) = measured.with_context(|| folder.display().to_string())?;
    Ok(ImageScan { measured, sweeps: names, unreachable: Vec::new(), duration_s, images })
}

fn measure(
    capture: &Capture,
    correct_clock: bool,
    images_s: f64,
) -> anyhow::Result<(Measured, ImageSummary)> {
    let clock = Instant::now();
    let measured = capture.measure(&MeasureSettings { correct_clock, ..MeasureSettings::default() })?;
    let seconds = ImageSeconds { images_s, measure_s: clock.elapsed().as_secs_f64() };
    let report = measured.report.clone();
    Ok((measured, ImageSummary { report, recorded: None, seconds }))
}

/// Renders and measures an object on the virtual cell's table, and records it when asked to.
pub(super) fn rendered(args: &ScanArgs, object: &Object) -> anyhow::Result<ImageScan> {
    let content = if args.record_stripes { Content::Stripes } else { Content::Frames };
    // First of all: it may be that nothing can be written there.
    let arm = Arm::rx60();
    let writer = |folder| RecordingWriter::create(folder, content, &arm);
    let writer = args.record.as_deref().map(writer).transpose()?;
    let (mesh, _) = placed(object);
    let instrument = Instrument::default();
    // What ceramics and plastics are like.
    let optics = Optics { object: Finish::glazed(), ..Optics::default() };
    let rig = rig(args, &instrument, &optics)?;
    let settings = SweepSettings { field_width_m: Some(MEASURED_WIDTH_M), ..args.sweeps.settings() };
    let (center, radius_m) = target_sphere(&mesh);
    let carried = |pass: &[StripePose]| carry(&arm, &rig.palm_from_scanner, pass);
    let reachable = |pass: &[StripePose]| carried(pass).is_some();
    let first = plan_sweeps(&center, radius_m, &instrument, &settings, &reachable);
    anyhow::ensure!(!first.sweeps.is_empty(), ScanError::NoSweep);

    let clock = Instant::now();
    let table = Plane::horizontal(TABLE_HEIGHT_M);
    let renderer = Renderer::new(&mesh, Some(table), &instrument, &optics)?;
    let keep = |frame: u32, camera: Camera, image: &image::GrayImage| match &writer {
        Some(writer) => writer.image(frame, camera, image),
        None => Ok(()),
    };
    let cell = CellSettings { offset_s: args.clock_offset_ms.unwrap_or(0.0) * 1e-3, seed: args.seed };
    let mut capture: Option<Capture> = None;
    let mut make = |sweeps: &[Sweep]| {
        let sweeps: Vec<CarriedSweep> = sweeps
            .iter()
            .filter_map(|sweep| Some(CarriedSweep { joints: carried(&sweep.stripes)?, sweep: sweep.clone() }))
            .collect();
        let start = capture.as_ref().map_or_else(Start::default, Capture::end);
        let part = virtual_capture(&renderer, &arm, &rig, &sweeps, start, cell, &keep)?;
        // Only to see what is still unseen: the clocks have to wait for all sweeps. A sweep that saw nothing tells nothing.
        let rough = MeasureSettings { correct_clock: false, ..MeasureSettings::default() };
        let cloud = match settings.next_best {
            0 => PointCloud::default(),
            _ => part.measure(&rough).map(|measured| measured.cloud).unwrap_or_default(),
        };
        capture = match capture.take() {
            Some(before) => Some(before.followed_by(part)?),
            None => Some(part),
        };
        Ok::<_, anyhow::Error>(cloud)
    };
    let given = Chain {
        center,
        radius_m,
        table_height_m: TABLE_HEIGHT_M,
        instrument: &instrument,
        settings: &settings,
        reachable: &reachable,
    };
    let plan = chain(first, &given, &mut make)?;
    let capture = capture.ok_or(ScanError::NoSweep)?;
    let (measured, mut images) = measure(&capture, !args.keep_clock, clock.elapsed().as_secs_f64())?;
    if let (Some(writer), Some(folder)) = (writer, &args.record) {
        writer.finish(&capture)?;
        images.recorded = Some(folder.display().to_string());
    }
    Ok(ImageScan {
        measured,
        sweeps: plan.sweeps.iter().map(|sweep| sweep.name.clone()).collect(),
        unreachable: plan.dropped,
        duration_s: plan.sweeps.iter().map(Sweep::duration_s).sum(),
        images,
    })
}

/// Largest calibration that is read.
const MAX_CALIBRATION_BYTES: u64 = 1 << 22;

/// The scanner, calibrated by the files that were named, or by the virtual measuring machine.
fn rig(args: &ScanArgs, instrument: &Instrument, optics: &Optics) -> anyhow::Result<Rig> {
    let [left, right] = args.calibration.as_slice() else {
        return Rig::calibrated(instrument, optics, args.seed).context("calibrating the virtual scanner");
    };
    let camera = |path: &Path| {
        let name = || path.display().to_string();
        let text = read_text(path, MAX_CALIBRATION_BYTES).with_context(name)?;
        let calibration = Calibration::from_toml(&text).with_context(name)?;
        let camera = StripeCamera::new(calibration, instrument.pixels);
        let [columns, rows] = instrument.pixels;
        anyhow::ensure!(
            camera.window.rows_px > 0,
            "{}: the calibration has no row on the sensor of {columns} x {rows} pixels",
            path.display()
        );
        Ok::<_, anyhow::Error>(camera)
    };
    Ok(Rig { cameras: [camera(left)?, camera(right)?], palm_from_scanner: palm_from_scanner() })
}
