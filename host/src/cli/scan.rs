//! `prehend scan`: a laser-stripe scan in the virtual cell.

use std::io::Write;
use std::path::PathBuf;

use anyhow::Context;
use clap::{Args, ValueEnum};
use nalgebra::{Isometry3, Point3};
use serde::Serialize;

use super::input::{self, TABLE_HEIGHT_M};
use super::{Outcome, write_json};
use crate::io::{CloudFormat, Unit, write_cloud, write_cloud_to};
use crate::object::Object;
use crate::plan::arm::{Arm, Inverse};
use crate::scan::{
    Instrument, Scan, SweepPlan, SweepSettings, palm_from_scanner, plan_sweeps, scan, target_sphere,
};
use crate::surface::{Mesh, Plane};

/// Sweep an object with the laser scanner and write the cloud in the robot's base frame
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Examples:\n  prehend scan --virtual teacup-cover -o cloud.ply\n  prehend scan --virtual mug.stl --unit mm -o mug.pcd"
)]
pub struct ScanArgs {
    /// Object in the virtual cell: teacup-cover, cube, cylinder, mouse, disk, or a mesh file (stood upright in its own z)
    #[arg(long = "virtual", value_name = "OBJECT")]
    pub object: String,
    /// Cloud to write (.ply .pcd .xyz .txt .csv), or - for PLY on standard output
    #[arg(short, long, value_name = "CLOUD")]
    pub output: PathBuf,
    /// Sweeps to make
    #[arg(long, value_enum, default_value_t)]
    pub sweeps: Sweeps,
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

/// `--sweeps`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum Sweeps {
    /// Straight down, and leaning from four sides
    #[default]
    Around,
    /// One sweep straight down, as in the paper of 2005
    Paper,
}

impl Sweeps {
    /// The settings that the word stands for.
    #[must_use]
    pub fn settings(self) -> SweepSettings {
        match self {
            Self::Around => SweepSettings::default(),
            Self::Paper => SweepSettings::paper(),
        }
    }
}

#[derive(Serialize)]
struct Summary {
    points: usize,
    object_points: usize,
    stripes: usize,
    sweeps: Vec<String>,
    unreachable: Vec<String>,
    scan_s: f64,
}

/// Runs the command.
pub fn run(args: &ScanArgs, out: &mut dyn Write) -> anyhow::Result<Outcome> {
    let to_stdout = args.output.as_os_str() == "-";
    anyhow::ensure!(!(to_stdout && args.json), "--json and -o - both want standard output");
    let format = if to_stdout { CloudFormat::Ply } else { CloudFormat::from_path(&args.output)? };
    let object = input::object(&args.object, args.unit, None, 0.4)?;
    let (mesh, _) = placed(&object);
    let (sweeps, mut scan) = sweep(&mesh, &args.sweeps.settings(), &Instrument::default(), args.seed)
        .with_context(|| format!("scanning {}", object.name))?;
    if args.no_table {
        scan.cloud = scan.cloud.filtered(|_, p| p.z > TABLE_HEIGHT_M + 0.001);
    }
    if to_stdout {
        write_cloud_to(format, out, &scan.cloud)?;
        return Ok(Outcome::Done);
    }
    write_cloud(&args.output, &scan.cloud)?;
    let summary = Summary {
        points: scan.cloud.len(),
        object_points: scan.object_points,
        stripes: scan.stripes,
        sweeps: sweeps.sweeps.iter().map(|sweep| sweep.name.clone()).collect(),
        unreachable: sweeps.dropped.clone(),
        scan_s: scan.duration_s,
    };
    if args.json {
        write_json(out, &summary)?;
    } else {
        describe(&summary, out)?;
        writeln!(out, "wrote {}", args.output.display())?;
    }
    Ok(Outcome::Done)
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
    let reachable = |base_from_scanner: &Isometry3<f64>| {
        matches!(
            arm.palm_solutions_near(&(base_from_scanner * scanner_from_palm), &[0.0; 6]),
            Inverse::Solutions(_)
        )
    };
    let (center, radius_m): (Point3<f64>, f64) = target_sphere(mesh);
    let plan = plan_sweeps(&center, radius_m, instrument, settings, &reachable);
    let scan = scan(mesh, Some(Plane::horizontal(TABLE_HEIGHT_M)), &plan.sweeps, instrument, seed)?;
    Ok((plan, scan))
}
