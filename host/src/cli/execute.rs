//! `prehend execute`: run a plan on the twin.

use std::f64::consts::PI;
use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use clap::Args;
use hand_model::{HandAngles, HandModel};
use nalgebra::Isometry3;
use protocol::ids::{FingerId, JointId};
use serde_json::{Value, json};

use super::{Outcome, input, write_json};
use crate::exec::{Event, EventKind, Execution, ExecutionPlan, ExecutionSettings, Verdict, execute};
use crate::hand::{Hand, hit_dlr};
use crate::io::{Geometry, Unit, read_geometry, write_atomically};
use crate::link::ThumbLaw;
use crate::object::{BuiltIn, Object};
use crate::plan::document::{GraspInfo, PlanDocument, Pose, Posture, hand_angles, mesh_hash};
use crate::twin::{Friction, ObjectBody, Scene, SensorParameters, Twin};

/// Largest plan document that is read, bytes.
const MAX_BYTES: u64 = 1 << 30;

/// Farthest from the base that a plan may place hand, object or table, metres: beyond any arm's reach.
const ROOM_M: f64 = 5.0;
/// Longest straight way to the grasp, metres: a long one would take the simulation forever.
const WAY_M: f64 = 1.0;

/// Friction of bare links and of the table on the object: metal and wood on plastic (assumed).
const LINK_FRICTION: f64 = 0.3;
const TABLE_FRICTION: f64 = 0.4;

/// Execute a grasp of a plan: approach, close, squeeze, lift, hold
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Examples:\n  prehend execute plan.json --link twin\n  prehend execute plan.json --object teacup-cover --grasp 2 --friction 0.6"
)]
pub struct ExecuteArgs {
    /// Plan to execute, as `prehend plan` writes it
    #[arg(value_name = "PLAN.json")]
    pub plan: PathBuf,
    /// The hand to run it on: twin, the simulated hand that runs the firmware's control laws
    #[arg(long, default_value = "twin", value_parser = link)]
    pub link: LinkChoice,
    /// Which grasp of the plan, 1 is the best
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..), allow_negative_numbers = true)]
    pub grasp: u32,
    /// What really stands there, by default what was planned on: a built-in object or a mesh file. For a plan on a scan it
    /// stands at the cell's spot (or where its file has it in the base frame); else it takes the planned object's pose
    #[arg(long, value_name = "OBJECT")]
    pub object: Option<String>,
    /// True friction between fingertips and object; by default what the plan counts on
    #[arg(long, value_parser = input::not_negative, allow_negative_numbers = true)]
    pub friction: Option<f64>,
    /// True mass in kg; by default what the plan counts on
    #[arg(long, value_name = "KG", value_parser = input::positive, allow_negative_numbers = true)]
    pub mass: Option<f64>,
    /// Seed of the sensors' noise
    #[arg(long, default_value_t = 1, allow_negative_numbers = true)]
    pub seed: u64,
    /// Unit of the object's mesh file: m or mm
    #[arg(long, default_value = "m", value_parser = input::unit)]
    pub unit: Unit,
    /// Record of the run to write, or - for standard output
    #[arg(short, long, value_name = "RUN.json")]
    pub output: Option<PathBuf>,
    /// Print one JSON document on standard output
    #[arg(long)]
    pub json: bool,
}

/// What to execute on, `--link`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LinkChoice {
    /// The simulated hand.
    Twin,
}

fn link(text: &str) -> Result<LinkChoice, String> {
    match text {
        "twin" => Ok(LinkChoice::Twin),
        _ => Err("give twin".to_owned()),
    }
}

/// What stands in the cell, in truth.
pub(super) struct Truth {
    pub(super) object: Object,
    pub(super) base_from_object: Isometry3<f64>,
    pub(super) table_height_m: Option<f64>,
}

/// Runs the command.
pub fn run(args: &ExecuteArgs, out: &mut dyn Write) -> anyhow::Result<Outcome> {
    let to_stdout = args.output.as_deref() == Some(Path::new("-"));
    ensure!(!(to_stdout && args.json), "--json and -o - both want standard output");
    let document = read_plan(&args.plan).with_context(|| format!("reading {}", args.plan.display()))?;
    let count = document.grasps.len();
    ensure!(count > 0, "{} has no grasp to execute", args.plan.display());
    let Some(grasp) = document.grasps.get(args.grasp as usize - 1) else {
        bail!("--grasp {}: the plan has {count}", args.grasp);
    };
    let truth = truth(args, &document)?;
    let LinkChoice::Twin = args.link;
    let execution = on_twin(&document, grasp, &truth, args.seed)
        .with_context(|| format!("executing {}", args.plan.display()))?;
    match &args.output {
        Some(path) if !to_stdout => write_record(path, &execution)?,
        _ => {}
    }
    if to_stdout {
        write_line(out, &record(&execution))?;
    } else if args.json {
        write_json(out, &summary(&execution))?;
    } else {
        describe(&execution, out)?;
    }
    Ok(if execution.verdict == Verdict::Held { Outcome::Done } else { Outcome::No })
}

/// A plan for any hand.
pub(super) fn read_document(path: &Path) -> anyhow::Result<PlanDocument> {
    let metadata = std::fs::metadata(path)?;
    ensure!(metadata.is_file(), "not a file");
    ensure!(metadata.len() <= MAX_BYTES, "{} bytes are more than a plan has", metadata.len());
    let document: PlanDocument = serde_json::from_str(&std::fs::read_to_string(path)?)?;
    document.check()?;
    Ok(document)
}

/// A plan for the built-in hand.
pub(super) fn read_plan(path: &Path) -> anyhow::Result<PlanDocument> {
    let document = read_document(path)?;
    ensure!(
        document.hand.sha256 == hit_dlr::hash(&HandModel::hit_dlr()),
        "the plan is for another hand, {}: only {} with the parameters of this program is simulated and exported",
        document.hand.name,
        hit_dlr::NAME
    );
    Ok(document)
}

/// The object that really stands there: as asked for, or the one that was planned on, which must be unchanged.
fn truth(args: &ExecuteArgs, document: &PlanDocument) -> anyhow::Result<Truth> {
    let planned = &document.object;
    let friction = args.friction.unwrap_or(planned.friction);
    let mut object = match &args.object {
        Some(name) => input::object(name, args.unit, args.mass, friction)?,
        None => {
            let source = beside(&args.plan, &planned.source);
            let object = planned_object(&source, args.unit, friction)?;
            ensure!(
                mesh_hash(&object.mesh) == planned.mesh_sha256,
                "{source} is not the mesh that was planned on (--object names another; --unit its unit)"
            );
            object
        }
    };
    object.mass_kg =
        args.mass.unwrap_or(if args.object.is_some() { object.mass_kg } else { planned.mass_kg });
    let planned_pose = pose(planned.base_from_object, "base_from_object")
        .with_context(|| format!("reading {}", args.plan.display()))?;
    let table_m = document.table_height_m.unwrap_or(input::TABLE_HEIGHT_M);
    // A scan is in the base frame; the object itself is not, unless its file says so.
    let planned_on_scan = planned_pose == Isometry3::identity();
    let base_from_object = if args.object.is_none() || !planned_on_scan {
        planned_pose
    } else if input::stands_in_cell(&object.mesh, table_m) {
        Isometry3::identity()
    } else {
        input::standing_at_spot(&object.mesh, table_m)
    };
    Ok(Truth { object, base_from_object, table_height_m: document.table_height_m })
}

/// Where the object that was planned on is: as the plan names it, or beside the plan.
pub(super) fn beside(plan: &Path, source: &str) -> String {
    match plan.parent().map(|folder| folder.join(source)) {
        // The plan may have been moved together with its mesh.
        Some(beside) if !Path::new(source).exists() && beside.exists() => {
            beside.to_string_lossy().into_owned()
        }
        _ => source.to_owned(),
    }
}

/// The object that was planned on, by the name in the plan.
fn planned_object(source: &str, unit: Unit, friction: f64) -> anyhow::Result<Object> {
    if BuiltIn::ALL.iter().all(|b| b.name() != source)
        && let Ok(loaded) = read_geometry(source.as_ref(), unit)
        && matches!(loaded.value, Geometry::Cloud(_))
    {
        bail!(
            "{source} is a cloud: reconstruct it to a mesh and plan on that, or name the object with --object"
        );
    }
    input::object(source, unit, None, friction)
        .context("reading the object that was planned on (--object names another)")
}

/// A pose of a plan, in a room and with an orientation.
fn pose(pose: Pose, name: &'static str) -> anyhow::Result<Isometry3<f64>> {
    let isometry = pose.to_isometry(name)?;
    let far_m = isometry.translation.vector.amax();
    ensure!(far_m <= ROOM_M, "{name} is {far_m:e} m from the base: out of reach");
    Ok(isometry)
}

/// A posture of a plan, within half a turn of the stretched hand.
fn angles(posture: &Posture, name: &'static str) -> anyhow::Result<HandAngles<f64>> {
    let angles = hand_angles(posture, name)?;
    for (joint, angle_rad) in JointId::ALL.iter().zip(angles.to_array()) {
        ensure!(angle_rad.abs() <= PI, "{name}: {} cannot turn to {angle_rad:e} rad", joint.name());
    }
    Ok(angles)
}

/// The thumb's law in the squeeze. With its tip it presses as a spring; in a power grasp the targets are those of joints
/// (see [`joint_squeeze_targets`](crate::exec::joint_squeeze_targets)).
fn thumb_law(grasp: &GraspInfo) -> anyhow::Result<ThumbLaw> {
    let hand = Hand::hit_dlr()?;
    let candidate = hand.candidates.iter().find(|candidate| candidate.name == grasp.candidate);
    let candidate =
        candidate.with_context(|| format!("no typical grasp of the hand is {:?}", grasp.candidate))?;
    Ok(if candidate.wraps { ThumbLaw::Position } else { ThumbLaw::Impedance })
}

/// Executes one grasp on the simulated hand.
pub(super) fn on_twin(
    document: &PlanDocument,
    grasp: &GraspInfo,
    truth: &Truth,
    seed: u64,
) -> anyhow::Result<Execution> {
    let plan = ExecutionPlan {
        approach_site: pose(grasp.approach_site, "approach_site")?,
        grasp_site: pose(grasp.grasp_site, "grasp_site")?,
        pregrasp: angles(&grasp.pregrasp, "pregrasp")?,
        grasp: angles(&grasp.grasp, "grasp")?,
        squeeze: angles(&grasp.squeeze, "squeeze")?,
        friction: document.object.friction,
        thumb: thumb_law(grasp)?,
    };
    let way_m = (plan.grasp_site.translation.vector - plan.approach_site.translation.vector).norm();
    ensure!(way_m <= WAY_M, "approach_site is {way_m} m from grasp_site");
    let table_m = truth.table_height_m.unwrap_or(0.0);
    ensure!(table_m.abs() <= ROOM_M, "table_height_m {table_m:e} is out of reach");
    let hand: HandModel<f64> = HandModel::hit_dlr();
    let open: HandAngles<f64> = plan.pregrasp;
    let object = &truth.object;
    let scene = Scene {
        hand,
        base_from_palm: plan.approach_site,
        angles: open,
        object: Some(ObjectBody::new(
            &object.mesh,
            object.convex_pieces(),
            truth.base_from_object,
            object.mass_kg,
        )),
        table_height_m: truth.table_height_m,
        friction: Friction { tip: object.friction, link: LINK_FRICTION, table: TABLE_FRICTION },
        gravity: crate::twin::plant::GRAVITY,
    };
    let mut twin = Twin::new(&scene, SensorParameters::hit_dlr(), seed)
        .with_context(|| format!("simulating {}", object.name))?;
    Ok(execute(&hand, &plan, &ExecutionSettings::default(), &mut twin)?)
}

/// Writes what happened and the trace to a file.
pub(super) fn write_record(path: &Path, execution: &Execution) -> anyhow::Result<()> {
    let record = record(execution);
    write_atomically(path, |writer| write_line(writer, &record))?;
    Ok(())
}

fn write_line(writer: &mut dyn Write, record: &Value) -> std::io::Result<()> {
    serde_json::to_writer(&mut *writer, record)?;
    writeln!(writer)
}

/// What happened and the trace.
pub(super) fn record(execution: &Execution) -> Value {
    let mut record = summary(execution);
    if let Value::Object(fields) = &mut record {
        let trace: Vec<Value> = execution
            .trace
            .iter()
            .map(|sample| {
                json!({
                    "time_s": sample.time_s,
                    "phase": format!("{:?}", sample.phase).to_lowercase(),
                    "palm_position": <[f64; 3]>::from(sample.base_from_palm.translation.vector),
                    "commanded_rad": sample.commanded_rad,
                    "measured_rad": sample.measured_rad,
                    "tip_force_n": sample.tip_force_n,
                    "object_position": sample.base_from_object.map(|pose| <[f64; 3]>::from(pose.translation.vector)),
                })
            })
            .collect();
        fields.insert("trace".to_owned(), Value::Array(trace));
    }
    record
}

fn summary(execution: &Execution) -> Value {
    json!({
        "verdict": execution.verdict.name(),
        "lift_height_m": execution.lift_height_m,
        "slip_m": execution.slip_m,
        "duration_s": execution.duration_s,
        "events": execution.events.iter().map(|event| json!({
            "time_s": event.time_s,
            "event": event_name(event),
        })).collect::<Vec<_>>(),
    })
}

/// The event in words: `lift`, `contact index`, `slip thumb`.
fn event_name(event: &Event) -> String {
    let of = |what: &str, finger: FingerId| format!("{what} {}", finger.name());
    match event.kind {
        EventKind::Phase(phase) => format!("{phase:?}").to_lowercase(),
        EventKind::Contact(finger) => of("contact", finger),
        EventKind::ContactLost(finger) => of("contact-lost", finger),
        EventKind::UnexpectedContact(finger) => of("unexpected-contact", finger),
        EventKind::Slip(finger) => of("slip", finger),
    }
}

/// How it went, in lines for people.
pub(super) fn describe(execution: &Execution, out: &mut dyn Write) -> std::io::Result<()> {
    let events: Vec<String> =
        execution.events.iter().map(|e| format!("{:.2} s {}", e.time_s, event_name(e))).collect();
    writeln!(out, "executed {:.1} s: {}", execution.duration_s, events.join(", "))?;
    if let Some(lift_m) = execution.lift_height_m {
        write!(out, "the object rose {:.1} mm", lift_m * 1e3)?;
        match execution.slip_m {
            Some(slip_m) => writeln!(out, " and moved {:.1} mm in the hand", slip_m * 1e3)?,
            None => writeln!(out)?,
        }
    }
    writeln!(out, "verdict: {}", execution.verdict.name())
}
