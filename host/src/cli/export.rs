//! `prehend export`: a plan in the formats of other programs.

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use clap::{Args, ValueEnum};
use hand_model::HandModel;
use nalgebra::{Isometry3, Point3, Vector3};

use super::execute::{beside, read_plan};
use super::{Outcome, input};
use crate::exec::{LinkPush, joint_squeeze_targets};
use crate::export::mjcf::SceneObject;
use crate::export::{Grasp, inventor, isaac, mjcf, moveit, npz, urdf};
use crate::hand::{Hand, hit_dlr};
use crate::io::{Unit, write_atomically};
use crate::object::Object;
use crate::plan::arm::Arm;
use crate::plan::document::{PlanDocument, mesh_hash};

/// Write grasps, scene or robot of a plan for another program
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Examples:\n  prehend export plan.json --format isaac-grasp --all -o grasps.yaml\n  prehend export plan.json --format mjcf --grasp 2 -o scene.xml\n  prehend export plan.json --format npz --all -o grasps.npz\n  prehend export plan.json --format urdf -o hand.urdf"
)]
pub struct ExportArgs {
    /// Plan to export, as `prehend plan` writes it
    #[arg(value_name = "PLAN.json")]
    pub plan: PathBuf,
    /// What to write
    #[arg(long, value_name = "F")]
    pub format: ExportFormat,
    /// Which grasp of the plan, 1 is the best and the default
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), allow_negative_numbers = true, conflicts_with = "all")]
    pub grasp: Option<u32>,
    /// All grasps of the plan; lists of grasps only
    #[arg(long)]
    pub all: bool,
    /// Unit of the planned mesh's file: m or mm; scenes only
    #[arg(long, default_value = "m", value_parser = input::unit)]
    pub unit: Unit,
    /// File of the arm that was planned with, if it is not the RX60
    #[arg(long, value_name = "FILE.toml")]
    pub arm: Option<PathBuf>,
    /// File to write, or - for standard output
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
}

/// Formats, `--format`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ExportFormat {
    /// List of grasps, isaac_grasp YAML 1.0
    IsaacGrasp,
    /// List of grasps, moveit_msgs/Grasp as YAML
    Moveit,
    /// Grasps as NumPy arrays, with the keys of DexGraspBench
    Npz,
    /// The hand
    Urdf,
    /// The arm with the hand
    UrdfArm,
    /// MuJoCo scene: hand, object, keyframes
    Mjcf,
    /// Open Inventor scene: object and hand
    Inventor,
}

/// Runs the command.
pub fn run(args: &ExportArgs, out: &mut dyn Write) -> anyhow::Result<Outcome> {
    let content = content(args).with_context(|| format!("exporting {}", args.plan.display()))?;
    if args.output == Path::new("-") {
        out.write_all(&content)?;
    } else {
        write_atomically(&args.output, |writer| writer.write_all(&content))?;
        writeln!(out, "wrote {}", args.output.display())?;
    }
    Ok(Outcome::Done)
}

/// What the file holds.
fn content(args: &ExportArgs) -> anyhow::Result<Vec<u8>> {
    let document = read_plan(&args.plan)?;
    if args.format == ExportFormat::Npz {
        let grasps = chosen(args, &document)?;
        let grasps = grasps
            .iter()
            .map(|grasp| pressing_by_joints(grasp, &document))
            .collect::<anyhow::Result<Vec<_>>>()?;
        let base_from_object = document.object.base_from_object.to_isometry("base_from_object")?;
        return Ok(npz::archive(&document.object.source, &base_from_object, &grasps, args.all)?);
    }
    Ok(text(args, &document)?.into_bytes())
}

/// The same of the formats that are text.
fn text(args: &ExportArgs, document: &PlanDocument) -> anyhow::Result<String> {
    let hand = HandModel::hit_dlr();
    if matches!(args.format, ExportFormat::Urdf | ExportFormat::UrdfArm) {
        ensure!(
            !args.all && args.grasp.is_none(),
            "a robot description shows no grasp: leave out --grasp and --all"
        );
        return Ok(match args.format {
            ExportFormat::UrdfArm => urdf::arm_with_hand(&arm(args, document)?, &hand),
            _ => urdf::hand(&hand),
        });
    }
    let grasps = chosen(args, document)?;
    match (args.format, grasps.as_slice()) {
        (ExportFormat::Moveit, _) => {
            let palm_from_parent = match &document.arm {
                Some(_) => arm(args, document)?.flange_from_palm().inverse(),
                None => Isometry3::identity(),
            };
            Ok(moveit::yaml(&hand, &palm_from_parent, &document.object.source, &grasps))
        }
        (ExportFormat::Mjcf, [grasp]) if !args.all => {
            let planned = &document.object;
            let object = SceneObject {
                pieces: planned_object(args, document)?.convex_pieces(),
                base_from_object: planned.base_from_object.to_isometry("base_from_object")?,
                mass_kg: planned.mass_kg,
                friction: planned.friction,
            };
            let grasp = pressing_by_joints(grasp, document)?;
            Ok(mjcf::scene(&hand, &grasp, &object)?)
        }
        (ExportFormat::Inventor, [grasp]) if !args.all => {
            Ok(inventor::scene(&hand, grasp, &planned_object(args, document)?.mesh)?)
        }
        (ExportFormat::Mjcf | ExportFormat::Inventor, _) => {
            anyhow::bail!("a scene shows one grasp: choose it by --grasp instead of --all")
        }
        _ => Ok(isaac::yaml(&document.object.source, &grasps)),
    }
}

/// The grasp with squeeze targets for position control of every joint. The plan's are for the firmware, whose thumb
/// presses as a spring at its tip.
fn pressing_by_joints(grasp: &Grasp, document: &PlanDocument) -> anyhow::Result<Grasp> {
    let hand = Hand::hit_dlr()?;
    let palm_from_object = grasp.object_from_palm.inverse();
    let contacts = document.grasps.get(grasp.number - 1).into_iter().flat_map(|info| &info.contacts);
    let pushes: Vec<LinkPush> = contacts
        .filter_map(|contact| {
            let index = hand.finger_index(&contact.finger)?;
            let finger = &hand.fingers[index];
            let bead = finger.beads().iter().find(|bead| finger.link_of(bead) == contact.link)?;
            Some(LinkPush {
                finger: index,
                segment: bead.segment,
                point_in_palm: palm_from_object * Point3::from(contact.point),
                force_in_palm: palm_from_object.rotation * Vector3::from(contact.squeeze_force_n),
            })
        })
        .collect();
    let squeeze = joint_squeeze_targets(&hand, &hit_dlr::posture(&grasp.grasp), &pushes);
    Ok(Grasp { squeeze: hit_dlr::angles(&squeeze), ..grasp.clone() })
}

/// The arm that was planned with; without one in the plan, the one that is asked for.
fn arm(args: &ExportArgs, document: &PlanDocument) -> anyhow::Result<Arm> {
    let arm = match &args.arm {
        Some(path) => input::arm(path)?,
        None => Arm::rx60(),
    };
    if let Some(planned) = &document.arm {
        let name = &arm.params().name;
        ensure!(name == planned, "the plan is for the arm {planned:?}, not {name:?}: give its file by --arm");
    }
    Ok(arm)
}

/// The grasps that were asked for.
fn chosen(args: &ExportArgs, document: &PlanDocument) -> anyhow::Result<Vec<Grasp>> {
    let count = document.grasps.len();
    ensure!(count > 0, "the plan has no grasp");
    let number = args.grasp.unwrap_or(1) as usize;
    ensure!(number <= count, "--grasp {number}: the plan has {count}");
    let numbered = (1..).zip(&document.grasps);
    numbered
        .filter(|(n, _)| args.all || *n == number)
        .map(|(n, info)| Grasp::read(n, info).with_context(|| format!("grasp {n}")))
        .collect()
}

/// The object that was planned on, unchanged.
fn planned_object(args: &ExportArgs, document: &PlanDocument) -> anyhow::Result<Object> {
    let planned = &document.object;
    let source = beside(&args.plan, &planned.source);
    let object = input::object(&source, args.unit, Some(planned.mass_kg), planned.friction)
        .context("reading the object that was planned on")?;
    ensure!(
        mesh_hash(&object.mesh) == planned.mesh_sha256,
        "{source} is not the mesh that was planned on (--unit names its unit)"
    );
    Ok(object)
}
