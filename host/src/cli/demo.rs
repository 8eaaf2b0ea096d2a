//! `prehend demo`: the whole story on the virtual cell.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::Context;
use clap::Args;
use serde_json::json;

use super::execute::{LinkChoice, Truth, on_twin, write_record};
use super::input::{self, TABLE_HEIGHT_M};
use super::pipeline::{self, Search};
use super::plan::Strategy;
use super::planning::Planned;
use super::progress::{bar, spinner};
use super::scan::Sweeps;
use super::{
    Outcome, execute, reconstruct as reconstruct_command, scan as scan_command, write_json, write_json_file,
};
use crate::exec::{Execution, Verdict};
use crate::grasp::Contact;
use crate::io::{Unit, read_mesh, write_atomically, write_cloud, write_mesh};
use crate::object::Object;
use crate::plan::document::PlanDocument;
use crate::plan::scene::Scene;
use crate::plan::seen::SeenSurface;
use crate::scan::Instrument;
use crate::surface::{Mesh, PointCloud};
use crate::view::picture::Picture;
use crate::view::report::{Report, RunRecord};

/// Grasps to keep.
const TOP: usize = 10;

/// Size of the picture, pixels.
const PICTURE_PX: [u32; 2] = [960, 720];

/// Scan, reconstruct, plan and execute on the virtual cell, and leave every result in a folder
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Examples:\n  prehend demo\n  prehend demo --object mouse --out mouse-run\n  prehend demo --object my-part.stl --unit mm --mass 0.2"
)]
pub struct DemoArgs {
    /// Object on the table: teacup-cover, cube, cylinder, mouse, disk, or a mesh file (stood upright in its own z)
    #[arg(long, value_name = "NAME|FILE", default_value = "teacup-cover")]
    pub object: String,
    /// The hand to run it on: twin, the simulated hand that runs the firmware's control laws
    #[arg(long, default_value = "twin", value_parser = twin)]
    pub link: LinkChoice,
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "out")]
    pub out: PathBuf,
    /// Search: the paper's of 2005, or the wider one
    #[arg(long, value_enum, default_value = "paper")]
    pub strategy: Strategy,
    /// Sweeps of the scanner
    #[arg(long, value_enum, default_value_t)]
    pub sweeps: Sweeps,
    /// Friction coefficient that is planned with and simulated
    #[arg(long, default_value_t = 0.4, value_parser = input::not_negative, allow_negative_numbers = true)]
    pub friction: f64,
    /// Mass of the object in kg; by default that of the built-in object, or 0.1
    #[arg(long, value_name = "KG", value_parser = input::positive, allow_negative_numbers = true)]
    pub mass: Option<f64>,
    /// Seed of every random choice
    #[arg(long, default_value_t = 1, allow_negative_numbers = true)]
    pub seed: u64,
    /// Unit of the object's file: m or mm
    #[arg(long, default_value = "m", value_parser = input::unit)]
    pub unit: Unit,
    /// Print one JSON document on standard output
    #[arg(long)]
    pub json: bool,
}

fn twin(text: &str) -> Result<LinkChoice, String> {
    match text {
        "twin" => Ok(LinkChoice::Twin),
        _ => Err("give twin".to_owned()),
    }
}

/// Runs the command.
pub fn run(args: &DemoArgs, out: &mut dyn Write) -> anyhow::Result<Outcome> {
    let mut report: Box<dyn Write + '_> =
        if args.json { Box::new(std::io::sink()) } else { Box::new(&mut *out) };
    let object = input::object(&args.object, args.unit, args.mass, args.friction)?;
    input::make_folder(&args.out)?;
    let file = |name: &str| args.out.join(name);
    let (true_mesh, base_from_object) = scan_command::placed(&object);
    writeln!(report, "object: {}, {:.0} g, friction {}", object.name, object.mass_kg * 1e3, object.friction)?;

    let clock = Instant::now();
    let waiting = spinner("scan");
    let (sweeps, scan) =
        scan_command::sweep(&true_mesh, &args.sweeps.settings(), &Instrument::default(), args.seed)
            .with_context(|| format!("scanning {}", object.name))?;
    waiting.finish_and_clear();
    write_cloud(&file("cloud.ply"), &scan.cloud)?;
    let scan_s = clock.elapsed().as_secs_f64();
    writeln!(
        report,
        "1 scan         {} points in {} stripes of {} sweeps ({:.1} s of the arm's time), computed in {scan_s:.2} s",
        scan.cloud.len(),
        scan.stripes,
        sweeps.sweeps.len(),
        scan.duration_s
    )?;

    let clock = Instant::now();
    let waiting = spinner("surface");
    let surface = pipeline::surface(&scan.cloud, args.seed)
        .with_context(|| format!("reconstructing the scan of {}", object.name))?;
    waiting.finish_and_clear();
    write_mesh(&file("mesh.stl"), &surface.mesh)?;
    write_mesh(&file("mesh.iv"), &surface.mesh)?;
    // Planned on is what the file holds, in single precision, so that `prehend plan mesh.stl` finds the same grasps.
    let mesh = read_mesh(&file("mesh.stl"), Unit::Metre)?.value;
    let reconstruct_s = clock.elapsed().as_secs_f64();
    write!(report, "2 reconstruct  ")?;
    reconstruct_command::describe(&surface, &mut report)?;

    let clock = Instant::now();
    let seen = SeenSurface::of_mesh(&surface.mesh);
    let (scene, planned) = plan(args, &object, mesh, seen)?;
    let document = &planned.document;
    write_json_file(&file("plan.json"), document)?;
    let plan_s = clock.elapsed().as_secs_f64();
    write!(report, "3 plan         ")?;
    planned.describe(&mut report)?;

    let clock = Instant::now();
    let truth = Truth { object, base_from_object, table_height_m: Some(TABLE_HEIGHT_M) };
    let execution = match document.grasps.first() {
        Some(best) => {
            draw(&scene, &planned, &file("grasp.png"))?;
            let waiting = spinner("execute");
            let execution = on_twin(document, best, &truth, args.seed)?;
            waiting.finish_and_clear();
            write_record(&file("run.json"), &execution)?;
            write!(report, "4 execute      ")?;
            execute::describe(&execution, &mut report)?;
            Some(execution)
        }
        None => {
            writeln!(report, "4 execute      no grasp to execute")?;
            None
        }
    };
    let execute_s = clock.elapsed().as_secs_f64();
    let clock = Instant::now();
    let run = execution.as_ref().map(|run| serde_json::from_value(execute::record(run))).transpose()?;
    let page = page(&scene, document, &surface.mesh, &scan.cloud, run.as_ref())?;
    write_atomically(&file("report.html"), |writer| writer.write_all(page.as_bytes()))?;
    let view_s = clock.elapsed().as_secs_f64();
    writeln!(report, "5 view         report.html, for a browser")?;
    writeln!(
        report,
        "took {:.2} s: scan {scan_s:.2}, reconstruct {reconstruct_s:.2}, plan {plan_s:.2}, execute {execute_s:.2}, \
         view {view_s:.2}; \
         results in {}",
        scan_s + reconstruct_s + plan_s + execute_s + view_s,
        args.out.display()
    )?;
    drop(report);
    if args.json {
        let best = document.grasps.first();
        write_json(
            out,
            &json!({
                "stages": {
                    "scan_s": scan_s, "reconstruct_s": reconstruct_s, "plan_s": plan_s, "execute_s": execute_s,
                    "view_s": view_s,
                },
                "points": scan.cloud.len(),
                "triangles": surface.report.triangles,
                "attempts": document.attempts,
                "force_closure": document.force_closure,
                "epsilon": best.map(|grasp| grasp.quality.epsilon),
                "convention": document.convention,
                "lift_height_m": execution.as_ref().and_then(|e| e.lift_height_m),
                "verdict": verdict(execution.as_ref()),
            }),
        )?;
    }
    let held = execution.is_some_and(|execution| execution.verdict == Verdict::Held);
    Ok(if held { Outcome::Done } else { Outcome::No })
}

fn verdict(execution: Option<&Execution>) -> &'static str {
    execution.map_or("no-force-closure", |execution| execution.verdict.name())
}

fn plan(
    args: &DemoArgs,
    object: &Object,
    mesh: Mesh,
    seen: Option<SeenSurface>,
) -> anyhow::Result<(Scene, Planned)> {
    let search =
        Search { strategy: args.strategy, friction: args.friction, mass_kg: object.mass_kg, seed: args.seed };
    let progress = bar(args.strategy.default_attempts(), "attempts");
    // The document names what it was planned on: the mesh beside it.
    let found = search.run(mesh, seen, "mesh.stl", TOP, &|done| progress.set_position(done as u64))?;
    progress.finish_and_clear();
    Ok(found)
}

/// All of it as a page for a browser.
fn page(
    scene: &Scene,
    document: &PlanDocument,
    mesh: &Mesh,
    cloud: &PointCloud,
    run: Option<&RunRecord>,
) -> anyhow::Result<String> {
    let report = Report {
        document,
        hand: &scene.hand,
        arm: scene.arm.as_ref(),
        mesh: Some(mesh),
        cloud: Some(cloud),
        run,
        top: TOP,
        notes: Vec::new(),
    };
    Ok(report.html()?)
}

/// Draws the best grasp.
fn draw(scene: &Scene, planned: &Planned, path: &Path) -> anyhow::Result<()> {
    let Some(grasp) = planned.grasps.first() else { return Ok(()) };
    let contacts: Vec<Contact> = grasp.contacts.iter().map(|touch| touch.contact).collect();
    let picture = Picture {
        object: &scene.mesh,
        hand: &scene.hand,
        base_from_palm: scene.base_from_object * grasp.site.object_from_palm,
        posture: &grasp.grasp,
        contacts: &contacts,
        base_from_object: scene.base_from_object,
        table_height_m: scene.table_height_m,
    };
    let [width, height] = PICTURE_PX;
    let image = picture.render(width, height);
    write_atomically(path, |writer| {
        let encoder = image::codecs::png::PngEncoder::new(writer);
        image.write_with_encoder(encoder).map_err(std::io::Error::other)
    })?;
    Ok(())
}
