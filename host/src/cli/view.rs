//! `prehend view`: a plan as a page for a browser.

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use clap::Args;

use super::execute::{beside, read_document};
use super::hand_file::HandArgs;
use super::{Outcome, input};
use crate::io::{Geometry, Unit, read_cloud, read_geometry, read_mesh, read_text, write_atomically};
use crate::object::BuiltIn;
use crate::plan::arm::Arm;
use crate::plan::document::{PlanDocument, mesh_hash};
use crate::surface::cloud::bounding_box;
use crate::surface::{Mesh, PointCloud};
use crate::view::report::{Report, RunRecord};

/// How far beside a grasp site the palm of a run may be, metres.
const SITE_M: f64 = 1e-4;

/// Largest record of a run that is read, bytes.
const MAX_RUN_BYTES: u64 = 1 << 28;

/// A plan as one page for a browser: the scene in three dimensions, the grasps and their quality, the execution
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Examples:\n  prehend view plan.json -o report.html\n  prehend view plan.json --unit mm --mesh model.ply --run run.json -o report.html"
)]
pub struct ViewArgs {
    /// Plan to show, as `prehend plan` writes it
    #[arg(value_name = "PLAN.json")]
    pub plan: PathBuf,
    /// Page to write
    #[arg(short, long, value_name = "FILE.html")]
    pub output: PathBuf,
    /// Mesh of the object, in the frame of the planned one; by default that one. A PLY file of `prehend reconstruct` is
    /// coloured by where its surface comes from
    #[arg(long, value_name = "FILE")]
    pub mesh: Option<PathBuf>,
    /// Scanned points, in the same frame; by default cloud.ply beside the plan, if it lies there and about the object
    #[arg(long, value_name = "FILE")]
    pub cloud: Option<PathBuf>,
    /// Record of the execution; by default run.json beside the plan, if it is of this plan
    #[arg(long, value_name = "RUN.json")]
    pub run: Option<PathBuf>,
    /// The hand that was planned for
    #[command(flatten)]
    pub hand: HandArgs,
    /// File of the arm that was planned with, if it is not the RX60
    #[arg(long, value_name = "FILE.toml")]
    pub arm: Option<PathBuf>,
    /// Unit of mesh and cloud: m or mm
    #[arg(long, default_value = "m", value_parser = input::unit)]
    pub unit: Unit,
    /// Show at most so many grasps, best first
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..), allow_negative_numbers = true)]
    pub top: u32,
}

/// Runs the command.
pub fn run(args: &ViewArgs, out: &mut dyn Write) -> anyhow::Result<Outcome> {
    let document = read_document(&args.plan).with_context(|| format!("reading {}", args.plan.display()))?;
    let mut hand = args.hand.chosen()?;
    ensure!(
        document.hand.sha256 == hand.hand.sha256,
        "{}: the plan is for another hand, {}: name its file by --hand",
        args.plan.display(),
        document.hand.name
    );
    let mut notes = Vec::new();
    let arm = arm(args, &document, &mut notes)?.map(|arm| hand.mounted(arm));
    let object = object(args, &document, &mut notes)?;
    let mesh = object.as_ref().and_then(|geometry| match geometry {
        Geometry::Mesh(mesh) => Some(mesh),
        Geometry::Cloud(_) => None,
    });
    let beside_cloud = cloud(args, object.as_ref())?;
    let cloud = match (&beside_cloud, &object) {
        (Some(cloud), _) => Some(cloud),
        (None, Some(Geometry::Cloud(planned))) => Some(planned),
        _ => None,
    };
    let record = record(args, &document)?;
    let report = Report {
        document: &document,
        hand: &hand.hand,
        arm: arm.as_ref(),
        mesh,
        cloud,
        run: record.as_ref(),
        top: args.top as usize,
        notes,
    };
    let page = report.html().with_context(|| format!("showing {}", args.plan.display()))?;
    write_atomically(&args.output, |writer| writer.write_all(page.as_bytes()))?;
    let shown = [("mesh", mesh.is_some()), ("cloud", cloud.is_some()), ("run", record.is_some())];
    let with: Vec<&str> = shown.iter().filter(|(_, there)| *there).map(|(name, _)| *name).collect();
    let with = if with.is_empty() { String::new() } else { format!(" with {}", with.join(", ")) };
    writeln!(out, "wrote {}{with}", args.output.display())?;
    Ok(Outcome::Done)
}

/// The arm that was planned with, if it is at hand.
fn arm(args: &ViewArgs, document: &PlanDocument, notes: &mut Vec<String>) -> anyhow::Result<Option<Arm>> {
    let arm = args.arm.as_deref().map(input::arm).transpose()?;
    let Some(planned) = &document.arm else { return Ok(None) };
    let (given, arm) = (arm.is_some(), arm.unwrap_or_else(Arm::rx60));
    let name = &arm.params().name;
    ensure!(!given || name == planned, "the plan is for the arm {planned:?}, not {name:?}");
    if name != planned {
        notes.push(format!("The arm {planned} is not shown: --arm names its file."));
        return Ok(None);
    }
    Ok(Some(arm))
}

/// The object's mesh: the one that is asked for, or the one that was planned on, unchanged; or the cloud that was.
fn object(
    args: &ViewArgs,
    document: &PlanDocument,
    notes: &mut Vec<String>,
) -> anyhow::Result<Option<Geometry>> {
    let planned = &document.object;
    if let Some(path) = &args.mesh {
        let loaded = read_mesh(path, args.unit)?;
        input::warn(path.display(), &loaded.warnings);
        if mesh_hash(&loaded.value) != planned.mesh_sha256 {
            notes
                .push(format!("{} is not the mesh that was planned on, or not by its bits.", path.display()));
        }
        return Ok(Some(Geometry::Mesh(loaded.value)));
    }
    let source = beside(&args.plan, &planned.source);
    let built_in = BuiltIn::ALL.into_iter().find(|built_in| built_in.name() == source);
    let geometry = match built_in {
        Some(built_in) => Geometry::Mesh(built_in.object(1.0)?.mesh),
        None => {
            read_geometry(source.as_ref(), args.unit)
                .context("reading the object that was planned on (--mesh names another)")?
                .value
        }
    };
    match &geometry {
        Geometry::Mesh(mesh) => ensure!(
            mesh_hash(mesh) == planned.mesh_sha256,
            "{source} is not the mesh that was planned on (--mesh names another; --unit its unit)"
        ),
        Geometry::Cloud(_) => {
            notes.push(
                "It was planned on a cloud, whose points are shown: --mesh names a surface.".to_owned(),
            );
        }
    }
    Ok(Some(geometry))
}

/// The scanned points: as asked for, or those beside the plan if they are of this object.
fn cloud(args: &ViewArgs, object: Option<&Geometry>) -> anyhow::Result<Option<PointCloud>> {
    if let Some(path) = &args.cloud {
        return Ok(Some(read_cloud(path, args.unit)?.value));
    }
    let path = args.plan.with_file_name("cloud.ply");
    let Some(Geometry::Mesh(mesh)) = object.filter(|_| path.is_file()) else { return Ok(None) };
    let cloud = read_cloud(&path, Unit::Metre)?.value;
    Ok(is_about(&cloud, mesh).then_some(cloud))
}

/// Whether a cloud could be a scan of this: what of it lies in the mesh's bounding box fills at least half of that
/// along every axis. A scan holds the table, too.
fn is_about(cloud: &PointCloud, mesh: &Mesh) -> bool {
    let (low, high) = mesh.bounding_box();
    let pad = 0.05 * (high - low);
    let within =
        |p: &nalgebra::Point3<f64>| (0..3).all(|i| (low[i] - pad[i]..=high[i] + pad[i]).contains(&p[i]));
    let inside: Vec<_> = cloud.points.iter().filter(|p| within(p)).copied().collect();
    let Some((from, to)) = bounding_box(&inside) else { return false };
    (0..3).all(|i| to[i] - from[i] >= 0.5 * (high[i] - low[i]))
}

/// The record of an execution: as asked for, or the one beside the plan if it is of this plan.
fn record(args: &ViewArgs, document: &PlanDocument) -> anyhow::Result<Option<RunRecord>> {
    let beside = args.plan.with_file_name("run.json");
    let path: &Path = match &args.run {
        Some(path) => path,
        None if beside.is_file() => &beside,
        None => return Ok(None),
    };
    let name = || format!("reading {}", path.display());
    let text = read_text(path, MAX_RUN_BYTES).with_context(name)?;
    let record: RunRecord = serde_json::from_str(&text).with_context(name)?;
    Ok((args.run.is_some() || is_of(&record, document)).then_some(record))
}

/// Whether a record can be of this plan: the palm was brought to the site of one of its grasps.
fn is_of(record: &RunRecord, document: &PlanDocument) -> bool {
    let near = |at: &[f64; 3], site: &[f64; 3]| at.iter().zip(site).all(|(a, b)| (a - b).abs() < SITE_M);
    let mut palms = record.trace.iter().filter_map(|sample| sample.palm_position);
    palms.any(|at| document.grasps.iter().any(|grasp| near(&at, &grasp.grasp_site.position)))
}
