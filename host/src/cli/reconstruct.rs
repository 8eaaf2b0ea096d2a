//! `prehend reconstruct`: cloud -> mesh.

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::Args;
use nalgebra::Point3;
use serde::Serialize;

use super::progress::spinner;
use super::{Outcome, input, write_json};
use crate::io::{MeshFormat, Unit, read_cloud, write_mesh, write_mesh_to};
use crate::surface::{
    Closing, Pick, Plane, Provenance, Reconstruction, Registration, SceneObject, Settings, Survey, Table,
};

/// Reconstruct the surface that a cloud samples, by Hoppe's method
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Examples:\n  prehend reconstruct cloud.ply -o mesh.stl --table 0 --close\n  prehend reconstruct kinect.pcd -o mesh.ply --close --pick 2\n  prehend reconstruct kinect.pcd -o mesh.ply --crop -0.1,-0.1,0.5,0.1,0.1,0.9"
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
    /// Which of several objects on the table: its number, largest, nearest (to the sensor), the one at X,Y,Z in the file's
    /// frame, whole for all of them as one body, or all for a file each (MESH-1, MESH-2, ...)
    #[arg(long, value_name = "N|largest|nearest|whole|all|X,Y,Z", default_value = "largest", value_parser = choice, allow_hyphen_values = true)]
    pub pick: Choice,
    /// Do not let symmetry tell about sides that nobody saw
    #[arg(long)]
    pub no_symmetry: bool,
    /// Cell of the surface lattice in metres; by default from the cloud's density
    #[arg(long, value_name = "M", value_parser = input::positive, allow_negative_numbers = true)]
    pub cell: Option<f64>,
    /// Most triangles, as far as --tolerance allows
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(4..), allow_negative_numbers = true)]
    pub triangles: Option<u32>,
    /// How far the surface may move for the sake of fewer triangles, metres; with --triangles alone one cell
    #[arg(long, value_name = "M", value_parser = input::positive, allow_negative_numbers = true)]
    pub tolerance: Option<f64>,
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

/// `--pick` where each object may get a file of its own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Choice {
    /// One of them, or all as one.
    One(Pick),
    /// Each by itself.
    Each,
}

fn choice(text: &str) -> Result<Choice, String> {
    if text == "all" { Ok(Choice::Each) } else { input::pick(text).map(Choice::One) }
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
    /// Share of the surface's area, by provenance.
    provenance: BTreeMap<&'static str, f64>,
    /// Distance between the sweeps before and after they were registered, metres.
    sweeps_apart_m: Option<[f64; 2]>,
    /// Where the mesh went.
    file: String,
}

#[derive(Serialize)]
struct Listed {
    number: usize,
    center: [f64; 3],
    size_m: [f64; 3],
    points: usize,
}

#[derive(Serialize)]
struct Document {
    /// The model, or the first of several.
    #[serde(flatten)]
    first: Summary,
    /// What stands on the table.
    objects: Vec<Listed>,
    /// Number of the object that was taken, if there are several models or objects.
    picked: Option<usize>,
    /// Every model, when each object was asked for.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    models: Vec<Summary>,
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
        symmetry: !args.no_symmetry,
        triangles: args.triangles.map(|n| n as usize),
        tolerance_m: args.tolerance,
        pick: match args.pick {
            Choice::One(pick) => pick,
            Choice::Each => Pick::Largest,
        },
        seed: args.seed,
        ..Settings::default()
    };
    let bar = spinner("surface");
    let context = || format!("reconstructing {}", args.cloud.display());
    let survey = Survey::new(&loaded.value, &settings).with_context(context)?;
    let models: Vec<(PathBuf, Reconstruction)> = match args.pick {
        Choice::One(_) => vec![(args.output.clone(), survey.pick().with_context(context)?)],
        Choice::Each if survey.objects().len() < 2 => {
            vec![(args.output.clone(), survey.pick().with_context(context)?)]
        }
        Choice::Each => each(&survey, args)?,
    };
    bar.finish_and_clear();
    if to_stdout {
        if let [(_, model)] = models.as_slice() {
            write_mesh_to(format, out, &model.mesh)?;
            return Ok(Outcome::Done);
        }
        anyhow::bail!("--pick all gives {} meshes, and standard output holds one", models.len());
    }
    for (path, model) in &models {
        write_mesh(path, &model.mesh)?;
    }
    if args.json {
        write_json(out, &document(&survey, args, &models)?)?;
        return Ok(Outcome::Done);
    }
    if let Choice::One(pick) = &args.pick {
        describe_scene(&survey, pick, out)?;
    }
    for (path, model) in &models {
        describe(model, out)?;
        writeln!(out, "wrote {}", path.display())?;
    }
    Ok(Outcome::Done)
}

/// A model of every object that has one; the others are told on standard error.
fn each(survey: &Survey, args: &ReconstructArgs) -> anyhow::Result<Vec<(PathBuf, Reconstruction)>> {
    let mut models = Vec::new();
    for number in 0..survey.objects().len() {
        match survey.object(number) {
            Ok(model) => models.push((numbered(&args.output, number + 1), model)),
            Err(error) => {
                input::warn(args.cloud.display(), &[format!("object {} left out: {error}", number + 1)]);
            }
        }
    }
    anyhow::ensure!(!models.is_empty(), "{}: none of the objects has a surface", args.cloud.display());
    Ok(models)
}

/// `mesh.ply` becomes `mesh-2.ply`.
fn numbered(path: &Path, number: usize) -> PathBuf {
    let part = |part: Option<&OsStr>| part.unwrap_or_default().to_string_lossy().into_owned();
    path.with_file_name(format!("{}-{number}.{}", part(path.file_stem()), part(path.extension())))
}

fn document(
    survey: &Survey,
    args: &ReconstructArgs,
    models: &[(PathBuf, Reconstruction)],
) -> anyhow::Result<Document> {
    let mut summaries = models.iter().map(|(path, model)| summary(model, path));
    let first = summaries.next().context("there is no model")?;
    let picked = match &args.pick {
        Choice::One(pick) => survey.picked(pick)?.map(|number| number + 1),
        Choice::Each => None,
    };
    let listed = |(i, object): (usize, &SceneObject)| Listed {
        number: i + 1,
        center: object.center.coords.into(),
        size_m: object.size_m,
        points: object.members.len(),
    };
    let models = if models.len() > 1 { models.iter().map(|(p, m)| summary(m, p)).collect() } else { vec![] };
    Ok(Document { first, objects: survey.objects().iter().enumerate().map(listed).collect(), picked, models })
}

/// What stands on the table and which of it was taken, in lines for people; nothing of a lone object.
pub(super) fn describe_scene(survey: &Survey, pick: &Pick, out: &mut dyn Write) -> anyhow::Result<()> {
    let objects = survey.objects();
    if objects.len() < 2 {
        return Ok(());
    }
    let picked = survey.picked(pick)?;
    writeln!(out, "{} objects on the table; another with --pick:", objects.len())?;
    for (i, object) in objects.iter().enumerate() {
        let ([x, y, z], c) = (object.size_m.map(|side| side * 1e3), object.center);
        let mark = if Some(i) == picked { "  <- this one" } else { "" };
        writeln!(
            out,
            "  {:2}  {x:.0} x {y:.0} x {z:.0} mm at ({:.3}, {:.3}, {:.3}), {} points{mark}",
            i + 1,
            c.x,
            c.y,
            c.z,
            object.members.len()
        )?;
    }
    Ok(())
}

fn summary(result: &Reconstruction, file: &Path) -> Summary {
    let report = &result.report;
    let area_m2 = result.mesh.area_m2();
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
        provenance: Provenance::ALL
            .into_iter()
            // The sum of nothing is -0.
            .map(|each| (each.name(), result.mesh.area_of_m2(each) / area_m2 + 0.0))
            .collect(),
        sweeps_apart_m: match &report.registration {
            Registration::Moved(moved) => Some([moved.before_m, moved.after_m]),
            Registration::OneSweep | Registration::Unmoved => None,
        },
        file: file.display().to_string(),
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
    if let Registration::Moved(moved) = &report.registration {
        let [before, after] = [moved.before_m, moved.after_m].map(|m| m * 1e3);
        let sweeps = moved.corrections.len();
        writeln!(
            out,
            "sweeps: {sweeps} registered to each other, {before:.2} mm apart before, {after:.2} after"
        )?;
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
    )?;
    let share = |each| 100.0 * result.mesh.area_of_m2(each) / result.mesh.area_m2();
    let shares: Vec<String> = Provenance::ALL
        .into_iter()
        .filter(|&each| share(each) >= 0.05)
        .map(|each| format!("{each} {:.1} %", share(each)))
        .collect();
    writeln!(out, "area: {}", shares.join(", "))
}
