//! `prehend scan`: a laser-stripe scan in the virtual cell.

use std::io::Write;
use std::path::PathBuf;

use anyhow::Context;
use clap::{ArgGroup, Args, ValueEnum};
use nalgebra::{Isometry3, Point3};
use serde::Serialize;

use super::input::{self, TABLE_HEIGHT_M};
use super::scan_images::{self, ImageScan, ImageSummary};
use super::{Outcome, write_json};
use crate::io::{CloudFormat, Unit, write_cloud, write_cloud_to};
use crate::object::Object;
use crate::plan::arm::Arm;
use crate::scan::next_sweep::{Chain, chain};
use crate::scan::{
    Instrument, Scan, StripePose, Sweep, SweepPlan, SweepSettings, palm_from_scanner, plan_sweeps, scan,
    target_sphere,
};
use crate::surface::{Mesh, Plane, PointCloud};

/// Sweep an object with the laser scanner and write the cloud in the robot's base frame
#[derive(Debug, Clone, Args)]
#[command(
    group = ArgGroup::new("source").required(true).args(["object", "recording"]),
    after_help = "Examples:\n  prehend scan --virtual teacup-cover -o cloud.ply\n  prehend scan --virtual mug.stl --unit mm -o mug.pcd\n  prehend scan --virtual mouse --images --sweeps paper -o cloud.ply\n  prehend scan --virtual mouse --sweeps paper --record mouse-scan -o cloud.ply\n  prehend scan --recording mouse-scan -o cloud.ply\n  prehend scan --recording mouse-scan --mount mount.toml -o cloud.ply"
)]
pub struct ScanArgs {
    /// Object in the virtual cell: teacup-cover, cube, cylinder, mouse, disk, or a mesh file (stood upright in its own z)
    #[arg(long = "virtual", value_name = "OBJECT")]
    pub object: Option<String>,
    /// Recording to measure: a folder with scan.toml, frames and joints
    #[arg(
        long,
        value_name = "DIR",
        conflicts_with_all = [
            "images", "record", "record_stripes", "calibration", "clock_offset_ms", "sweeps", "seed", "unit",
        ]
    )]
    pub recording: Option<PathBuf>,
    /// Where the scanner sits on the palm (prehend calibrate-mount), instead of what the recording says
    #[arg(long, value_name = "MOUNT.toml", conflicts_with = "object")]
    pub mount: Option<PathBuf>,
    /// Cloud to write (.ply .pcd .xyz .txt .csv), or - for PLY on standard output
    #[arg(short, long, value_name = "CLOUD")]
    pub output: PathBuf,
    /// Sweeps to make
    #[arg(long, value_enum, default_value_t)]
    pub sweeps: Sweeps,
    /// Render what both cameras see, and measure the images
    #[arg(long)]
    pub images: bool,
    /// Calibrations of the left and the right camera (prehend calibrate --camera); by default the virtual bench's
    #[arg(long, num_args = 2, value_names = ["LEFT.toml", "RIGHT.toml"])]
    pub calibration: Vec<PathBuf>,
    /// Folder to write with the images and the arm's joints, which --recording reads
    #[arg(long, value_name = "DIR")]
    pub record: Option<PathBuf>,
    /// Record the stripes found in the images, not the images
    #[arg(long, requires = "record")]
    pub record_stripes: bool,
    /// How early the virtual cameras' time stamps are, milliseconds: something to find out; by default 0
    #[arg(long, value_name = "MS", value_parser = clock_offset_ms, allow_negative_numbers = true)]
    pub clock_offset_ms: Option<f64>,
    /// Leave the clocks of cameras and arm as they are, whatever the images say
    #[arg(long)]
    pub keep_clock: bool,
    /// Seed of the noise
    #[arg(long, default_value_t = 1, allow_negative_numbers = true)]
    pub seed: u64,
    /// Unit of the mesh file: m or mm
    #[arg(long, default_value = "m", value_parser = input::unit)]
    pub unit: Unit,
    /// Leave the points of the table out
    #[arg(long)]
    pub no_table: bool,
    /// Print one JSON document on standard output
    #[arg(long)]
    pub json: bool,
}

impl ScanArgs {
    /// Whether the virtual cameras' images are asked for, or what only they give.
    fn renders_images(&self) -> bool {
        self.images || self.record.is_some() || !self.calibration.is_empty()
    }
}

/// The most that the clocks of a virtual scan may differ: larger offsets are not looked for. The arm's joints are known
/// for a little longer beyond each sweep.
const MAX_CLOCK_OFFSET_MS: f64 = 60.0;

fn clock_offset_ms(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.abs() <= MAX_CLOCK_OFFSET_MS => Ok(value),
        _ => Err(format!("give a number between -{MAX_CLOCK_OFFSET_MS} and {MAX_CLOCK_OFFSET_MS}")),
    }
}

/// `--sweeps`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum Sweeps {
    /// Straight down, and leaning from four sides
    #[default]
    Around,
    /// One sweep straight down, as in the paper of 2005
    Paper,
    /// Straight down, and then each sweep where most is still unseen
    NextBest,
}

impl Sweeps {
    /// The settings that the word stands for.
    #[must_use]
    pub fn settings(self) -> SweepSettings {
        match self {
            Self::Around => SweepSettings::default(),
            Self::Paper => SweepSettings::paper(),
            Self::NextBest => SweepSettings::next_best(),
        }
    }
}

#[derive(Serialize)]
struct Summary {
    points: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    object_points: Option<usize>,
    stripes: usize,
    sweeps: Vec<String>,
    unreachable: Vec<String>,
    scan_s: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    images: Option<ImageSummary>,
}

/// Runs the command.
pub fn run(args: &ScanArgs, out: &mut dyn Write) -> anyhow::Result<Outcome> {
    let to_stdout = args.output.as_os_str() == "-";
    anyhow::ensure!(!(to_stdout && args.json), "--json and -o - both want standard output");
    let format = if to_stdout { CloudFormat::Ply } else { CloudFormat::from_path(&args.output)? };
    let by_rays = args.recording.is_none() && !args.renders_images();
    anyhow::ensure!(
        !(by_rays && (args.clock_offset_ms.is_some() || args.keep_clock)),
        "--clock-offset-ms and --keep-clock are for scans by images, and this one is by rays: add --images"
    );
    let (mut cloud, mut summary) = match (&args.recording, &args.object) {
        (Some(folder), _) => {
            of_images(scan_images::recorded(folder, args.mount.as_deref(), !args.keep_clock)?)
        }
        (None, Some(name)) => {
            let object = input::object(name, args.unit, None, 0.4)?;
            let scanning = || format!("scanning {}", object.name);
            if args.renders_images() {
                of_images(scan_images::rendered(args, &object).with_context(scanning)?)
            } else {
                of_rays(&object, args).with_context(scanning)?
            }
        }
        (None, None) => anyhow::bail!("give --virtual or --recording"),
    };
    if args.no_table {
        cloud = cloud.filtered(|_, p| p.z > TABLE_HEIGHT_M + 0.001);
        summary.points = cloud.len();
    }
    if to_stdout {
        write_cloud_to(format, out, &cloud)?;
        return Ok(Outcome::Done);
    }
    write_cloud(&args.output, &cloud)?;
    if args.json {
        write_json(out, &summary)?;
    } else {
        describe(&summary, out)?;
        writeln!(out, "wrote {}", args.output.display())?;
    }
    Ok(Outcome::Done)
}

fn of_rays(object: &Object, args: &ScanArgs) -> anyhow::Result<(PointCloud, Summary)> {
    let (mesh, _) = placed(object);
    let (sweeps, scan) = sweep(&mesh, &args.sweeps.settings(), &Instrument::default(), args.seed)?;
    let summary = Summary {
        points: scan.cloud.len(),
        object_points: Some(scan.object_points),
        stripes: scan.stripes,
        sweeps: sweeps.sweeps.iter().map(|sweep| sweep.name.clone()).collect(),
        unreachable: sweeps.dropped.clone(),
        scan_s: scan.duration_s,
        images: None,
    };
    Ok((scan.cloud, summary))
}

fn of_images(scan: ImageScan) -> (PointCloud, Summary) {
    let ImageScan { measured, sweeps, unreachable, duration_s, images } = scan;
    let summary = Summary {
        points: measured.cloud.len(),
        object_points: None,
        stripes: measured.report.frames,
        sweeps,
        unreachable,
        scan_s: duration_s,
        images: Some(images),
    };
    (measured.cloud, summary)
}

fn describe(summary: &Summary, out: &mut dyn Write) -> std::io::Result<()> {
    writeln!(
        out,
        "scanned {} points in {} stripes, {} sweeps, {:.1} s of the arm's time",
        summary.points,
        summary.stripes,
        summary.sweeps.len(),
        summary.scan_s
    )?;
    for name in &summary.unreachable {
        writeln!(out, "the arm cannot make the sweep {name}")?;
    }
    if let Some(images) = &summary.images {
        images.describe(out)?;
    }
    Ok(())
}

/// An object's mesh standing in the cell, base frame, and the pose that put it there.
pub(super) fn placed(object: &Object) -> (Mesh, Isometry3<f64>) {
    let base_from_object = input::standing_at_spot(&object.mesh, TABLE_HEIGHT_M);
    (object.mesh.transformed(&base_from_object), base_from_object)
}

/// Plans the sweeps that the arm can make over a mesh in the base frame, and makes them.
pub(super) fn sweep(
    mesh: &Mesh,
    settings: &SweepSettings,
    instrument: &Instrument,
    seed: u64,
) -> anyhow::Result<(SweepPlan, Scan)> {
    let arm = Arm::rx60();
    let scanner_from_palm = palm_from_scanner().inverse();
    let holds = |stripe: &StripePose| arm.reaches_palm(&(stripe.base_from_scanner * scanner_from_palm));
    let reachable = |pass: &[StripePose]| pass.iter().all(holds);
    let (center, radius_m): (Point3<f64>, f64) = target_sphere(mesh);
    let first = plan_sweeps(&center, radius_m, instrument, settings, &reachable);
    let table = Plane::horizontal(TABLE_HEIGHT_M);
    if settings.next_best == 0 {
        let scan = scan(mesh, Some(table), &first.sweeps, instrument, seed)?;
        return Ok((first, scan));
    }
    let given = Chain {
        center,
        radius_m,
        table_height_m: TABLE_HEIGHT_M,
        instrument,
        settings,
        reachable: &reachable,
    };
    let mut make =
        |sweeps: &[Sweep]| scan(mesh, Some(table), sweeps, instrument, seed).map(|scan| scan.cloud);
    let plan = chain(first, &given, &mut make)?;
    // All together, so that each stripe has noise of its own.
    let scan = scan(mesh, Some(table), &plan.sweeps, instrument, seed)?;
    Ok((plan, scan))
}
