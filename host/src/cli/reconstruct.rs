//! `prehend reconstruct`: cloud -> mesh.

use std::io::Write;
use std::path::PathBuf;

use anyhow::Context;
use clap::Args;
use nalgebra::Point3;
use serde::Serialize;

use super::progress::spinner;
use super::{Outcome, input, write_json};
use crate::io::{MeshFormat, Unit, read_cloud, write_mesh, write_mesh_to};
use crate::surface::{Closing, Plane, Reconstruction, Settings, Table, reconstruct};

/// Reconstruct the surface that a cloud samples, by Hoppe's method
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Examples:\n  prehend reconstruct cloud.ply -o mesh.stl --table 0 --close\n  prehend reconstruct kinect.pcd -o mesh.ply --crop -0.1,-0.1,0.5,0.1,0.1,0.9 --table auto"
)]
pub struct ReconstructArgs {
    /// Cloud to read (.ply .pcd .xyz .txt .csv)
    #[arg(value_name = "CLOUD")]
    pub cloud: PathBuf,
    /// Mesh to write (.stl .ply .obj .off .iv), or - for PLY on standard output
    #[arg(short, long, value_name = "MESH")]
    pub output: PathBuf,
    /// Keep only the points between two corners, file frame, metres: x0,y0,z0,x1,y1,z1
    #[arg(long, value_name = "BOX", value_parser = corners, allow_hyphen_values = true)]
    pub crop: Option<[[f64; 3]; 2]>,
    /// The table to remove: none, auto (search for it), or its height z in metres
    #[arg(long, value_name = "none|auto|Z", default_value = "auto", value_parser = table, allow_hyphen_values = true)]
    pub table: Table,
    /// Complete the unseen sides down to the table, to a closed body
    #[arg(long)]
    pub close: bool,
    /// Cell of the surface lattice in metres; by default from the cloud's density
    #[arg(long, value_name = "M", value_parser = input::positive, allow_negative_numbers = true)]
    pub cell: Option<f64>,
    /// Unit of the cloud file: m or mm
    #[arg(long, default_value = "m", value_parser = input::unit)]
    pub unit: Unit,
    /// Seed of the search for the table
    #[arg(long, default_value_t = 1, allow_negative_numbers = true)]
    pub seed: u64,
    /// Print one JSON document on standard output
    #[arg(long)]
    pub json: bool,
}

fn corners(text: &str) -> Result<[[f64; 3]; 2], String> {
    let wrong = || "give six numbers separated by commas: x0,y0,z0,x1,y1,z1".to_owned();
    let parts: Vec<&str> = text.splitn(4, ',').collect();
    let (first, second) = match parts.as_slice() {
        &[x, y, z, rest] => (input::triple(&format!("{x},{y},{z}")), input::triple(rest)),
        _ => return Err(wrong()),
    };
    let (a, b) = (first.map_err(|_| wrong())?, second.map_err(|_| wrong())?);
    Ok([[0, 1, 2].map(|i| a[i].min(b[i])), [0, 1, 2].map(|i| a[i].max(b[i]))])
}

fn table(text: &str) -> Result<Table, String> {
    match text {
        "none" => Ok(Table::None),
        "auto" => Ok(Table::Auto),
        height => match height.parse::<f64>() {
            Ok(z) if z.is_finite() => Ok(Table::Plane(Plane::horizontal(z))),
            _ => Err("give none, auto, or a height in metres".to_owned()),
        },
    }
}

#[derive(Serialize)]
struct Summary {
    points: usize,
    used: usize,
    triangles: usize,
    seconds: f64,
    watertight: bool,
    components: usize,
    open_edges: usize,
    closing: &'static str,
    table: Option<[f64; 4]>,
}

/// Runs the command.
pub fn run(args: &ReconstructArgs, out: &mut dyn Write) -> anyhow::Result<Outcome> {
    let to_stdout = args.output.as_os_str() == "-";
    anyhow::ensure!(!(to_stdout && args.json), "--json and -o - both want standard output");
    let format = if to_stdout { MeshFormat::Ply } else { MeshFormat::from_path(&args.output)? };
    let loaded = read_cloud(&args.cloud, args.unit)?;
    input::warn(args.cloud.display(), &loaded.warnings);
    let settings = Settings {
        cell_m: args.cell,
        crop: args.crop.map(|[low, high]| (Point3::from(low), Point3::from(high))),
        table: args.table,
        close: args.close,
        seed: args.seed,
        ..Settings::default()
    };
    let bar = spinner("surface");
    let result = reconstruct(&loaded.value, &settings)
        .with_context(|| format!("reconstructing {}", args.cloud.display()))?;
    bar.finish_and_clear();
    if to_stdout {
        write_mesh_to(format, out, &result.mesh)?;
        return Ok(Outcome::Done);
    }
    write_mesh(&args.output, &result.mesh)?;
    if args.json {
        write_json(out, &summary(&result))?;
    } else {
        describe(&result, out)?;
        writeln!(out, "wrote {}", args.output.display())?;
    }
    Ok(Outcome::Done)
}

fn summary(result: &Reconstruction) -> Summary {
    let report = &result.report;
    Summary {
        points: report.points,
        used: report.used,
        triangles: report.triangles,
        seconds: report.seconds.total_s(),
        watertight: report.watertight,
        components: report.components,
        open_edges: report.open_edges,
        closing: closing_name(report.closing),
        table: report.table.map(|t| [t.normal.x, t.normal.y, t.normal.z, t.offset_m]),
    }
}

/// The closing in one word, for the JSON.
fn closing_name(closing: Closing) -> &'static str {
    match closing {
        Closing::NotAsked => "not-asked",
        Closing::AlreadyClosed => "already-closed",
        Closing::OnTable => "on-table",
        Closing::OnAssumedPlane => "on-assumed-plane",
        Closing::Impossible => "impossible",
    }
}

/// What was done, in lines for people.
pub(super) fn describe(result: &Reconstruction, out: &mut dyn Write) -> std::io::Result<()> {
    let report = &result.report;
    writeln!(
        out,
        "reconstructed {} triangles from {} of {} points (spacing {:.2} mm, cells {:.2} mm) in {:.2} s",
        report.triangles,
        report.used,
        report.points,
        report.spacing_m * 1e3,
        report.cell_m * 1e3,
        report.seconds.total_s()
    )?;
    if let Some(table) = report.table {
        let n = table.normal;
        writeln!(out, "table: normal ({:.3}, {:.3}, {:.3}), offset {:.4} m", n.x, n.y, n.z, table.offset_m)?;
    }
    let closing = match report.closing {
        Closing::NotAsked => "left open where nothing was seen",
        Closing::AlreadyClosed => "closed as measured",
        Closing::OnTable => "the unseen completed down to the table",
        Closing::OnAssumedPlane => "the unseen completed to the deepest measured point",
        Closing::Impossible => "could not be closed: left open",
    };
    let state = if report.watertight { "watertight" } else { "open" };
    writeln!(
        out,
        "surface: {state}, {} component(s), {} open edges, {} small part(s) dropped; {closing}",
        report.components, report.open_edges, report.dropped_parts
    )
}
