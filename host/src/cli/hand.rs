//! `prehend hand show`: what was found in a hand's description.

use std::io::Write;
use std::path::PathBuf;

use clap::{Args, Subcommand};
use serde_json::{Value, json};

use super::hand_bus::{self, BusCommand};
use super::hand_file::Read;
use super::{Outcome, hand_file, input, write_json};
use crate::hand::finger::Motion;
use crate::hand::urdf::Loaded;
use crate::hand::{Candidate, Finger, Hand, Joint, Part};
use crate::plan::document::{Pose, posture};

/// Look at a hand's description, or talk to a hand
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Examples:\n  prehend hand show gripper.urdf\n  prehend hand info --link serial:/dev/ttyUSB0\n  prehend hand params --link tcp:127.0.0.1:5000"
)]
pub struct HandCommandArgs {
    #[command(subcommand)]
    command: HandCommand,
}

#[derive(Debug, Clone, Subcommand)]
enum HandCommand {
    /// What is found in a robot description: palm, fingers, closing directions, typical grasps
    Show(ShowArgs),
    #[command(flatten)]
    Bus(BusCommand),
}

/// Arguments of `hand show`.
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Examples:\n  prehend hand show gripper.urdf\n  prehend hand show gripper.urdf --hand-config mine.toml --json"
)]
pub struct ShowArgs {
    /// Robot description
    #[arg(value_name = "FILE.urdf")]
    pub file: PathBuf,
    /// What the description does not say; by default the TOML file of the same name beside it, if there is one
    #[arg(long, value_name = "FILE.toml")]
    pub hand_config: Option<PathBuf>,
    /// Folder in which packages of package:// lie; may be given several times
    #[arg(long, value_name = "DIR")]
    pub package_path: Vec<PathBuf>,
    /// Print one JSON document on standard output
    #[arg(long)]
    pub json: bool,
}

/// Runs the command.
pub fn run(args: &HandCommandArgs, out: &mut dyn Write) -> anyhow::Result<Outcome> {
    let args = match &args.command {
        HandCommand::Show(args) => args,
        HandCommand::Bus(command) => return hand_bus::run(command, out),
    };
    let read = hand_file::load(&args.file, args.hand_config.as_deref(), &args.package_path)?;
    if args.json {
        write_json(out, &document(&read))?;
    } else {
        input::warn(args.file.display(), &read.loaded.warnings);
        describe(&read.loaded, &read.lines(), out)?;
    }
    Ok(Outcome::Done)
}

fn describe(loaded: &Loaded, lines: &[String], out: &mut dyn Write) -> std::io::Result<()> {
    let hand = &loaded.hand;
    for line in lines {
        writeln!(out, "{line}")?;
    }
    let (roll, pitch, yaw) = loaded.link_from_palm.rotation.euler_angles();
    let at_mm = loaded.link_from_palm.translation.vector * 1e3;
    writeln!(
        out,
        "palm: link {}, palm frame at ({:.1}, {:.1}, {:.1}) mm, rpy ({:.3}, {:.3}, {:.3}), {} box(es), presses along ({:.0}, {:.0}, {:.0})",
        loaded.palm_link,
        at_mm.x,
        at_mm.y,
        at_mm.z,
        roll,
        pitch,
        yaw,
        hand.palm.len(),
        hand.pressing_in_palm.x,
        hand.pressing_in_palm.y,
        hand.pressing_in_palm.z,
    )?;
    writeln!(out, "mass {:.3} kg, a fingertip presses up to {:.1} N", hand.mass_kg, hand.tip_force_max_n)?;
    writeln!(out, "joints (rad, or m where they slide):")?;
    for (i, joint) in hand.joints.iter().enumerate() {
        writeln!(
            out,
            "  {:<24} {:>8.3} .. {:<8.3} {}",
            joint.name,
            joint.lower_rad,
            joint.upper_rad,
            role(hand, i, joint)
        )?;
    }
    writeln!(out, "fingers, the one that opposes the others first:")?;
    for finger in &hand.fingers {
        let at = finger.tip_in_last() * 1e3;
        writeln!(
            out,
            "  {:<24} {}; tip on {} at ({:.1}, {:.1}, {:.1}) mm, radius {:.1} mm; {} ball(s)",
            finger.name,
            drives(hand, finger).join(", "),
            finger.segments().last().map_or("", |segment| &segment.link),
            at.x,
            at.y,
            at.z,
            1e3 * finger.tip_radius_m(),
            finger.beads().len()
        )?;
    }
    writeln!(
        out,
        "typical grasps, best first (opening between tips, mm: open, preshape, twice the preshape):"
    )?;
    for candidate in &hand.candidates {
        let [open, preshape, closed] = [0.0, 1.0, 2.0].map(|s| 1e3 * opening_m(hand, candidate, s));
        let fingers: Vec<&str> = candidate.fingers().map(|f| hand.fingers[f].name.as_str()).collect();
        writeln!(
            out,
            "  {:<28} {open:>6.1} {preshape:>6.1} {closed:>6.1}  {}",
            candidate.name,
            fingers.join(", ")
        )?;
    }
    Ok(())
}

fn role(hand: &Hand, index: usize, joint: &Joint) -> String {
    let way = match joint.flexes {
        // Whatever else it could do.
        _ if joint.is_held => "is held",
        Some(true) => "closes upwards",
        Some(false) => "closes downwards",
        None => "spreads or turns",
    };
    let of: Vec<&str> = hand
        .fingers
        .iter()
        .filter(|finger| finger.joints().contains(&index))
        .map(|finger| finger.name.as_str())
        .collect();
    format!("{way}: {}", of.join(", "))
}

/// The finger's joints from the palm on, with what repeats another.
fn drives(hand: &Hand, finger: &Finger) -> Vec<String> {
    finger
        .segments()
        .iter()
        .map(|segment| {
            let name = &hand.joints[segment.joint].name;
            let name = match segment.motion() {
                Motion::Turning => name.clone(),
                Motion::Sliding => format!("{name} (slides)"),
            };
            if (segment.multiplier, segment.offset_rad) == (1.0, 0.0) {
                name
            } else {
                format!("{} x {name} + {}", segment.multiplier, segment.offset_rad)
            }
        })
        .collect()
}

/// Distance between the surfaces of the opposing tip and of the middle of the others.
fn opening_m(hand: &Hand, candidate: &Candidate, s: f64) -> f64 {
    let posture = candidate.posture_at(&hand.joints, s);
    let tip = |finger: usize| {
        let chain = &hand.fingers[finger];
        chain.tip_in_palm(&chain.frames(&posture)).coords
    };
    let others: Vec<usize> = candidate.fingers().filter(|f| *f != candidate.opposing).collect();
    let mean = others.iter().map(|&f| tip(f)).sum::<nalgebra::Vector3<f64>>() / others.len().max(1) as f64;
    (tip(candidate.opposing) - mean).norm() - 2.0 * hand.fingers[candidate.opposing].tip_radius_m()
}

fn document(read: &Read) -> Value {
    let loaded = &read.loaded;
    let hand = &loaded.hand;
    json!({
        "name": hand.name,
        "config": read.config.as_ref().map(|config| config.display().to_string()),
        "sha256": hand.sha256,
        "palm_link": loaded.palm_link,
        "link_from_palm": Pose::from(&loaded.link_from_palm),
        "flange_from_palm": Pose::from(&loaded.flange_from_palm),
        "pressing_in_palm": <[f64; 3]>::from(hand.pressing_in_palm.into_inner()),
        "grasp_center_in_palm": <[f64; 3]>::from(hand.grasp_center_in_palm.coords),
        "palm": hand.palm.iter().map(|part| json!({
            "palm_from_box": Pose::from(&part.palm_from_box),
            "half_extents_m": <[f64; 3]>::from(part.half_extents_m),
        })).collect::<Vec<_>>(),
        "mass_kg": hand.mass_kg,
        "tip_force_max_n": hand.tip_force_max_n,
        "joints": hand.joints.iter().map(|joint| json!({
            "name": joint.name,
            "lower": joint.lower_rad,
            "upper": joint.upper_rad,
            "closes": match joint.flexes { Some(true) => "upper", Some(false) => "lower", None => "none" },
            "held": joint.is_held,
        })).collect::<Vec<_>>(),
        "fingers": hand.fingers.iter().map(|finger| json!({
            "name": finger.name,
            "segments": finger.segments().iter().map(|segment| json!({
                "link": segment.link,
                "joint": hand.joints[segment.joint].name,
                "multiplier": segment.multiplier,
                "offset": segment.offset_rad,
                "slides": segment.motion() == Motion::Sliding,
            })).collect::<Vec<_>>(),
            "tip_in_last": <[f64; 3]>::from(finger.tip_in_last().coords),
            "tip_radius_m": finger.tip_radius_m(),
            "pad_in_last": <[f64; 3]>::from(finger.pad_in_last().into_inner()),
            "balls": finger.beads().iter().map(|bead| json!({
                "link": finger.link_of(bead),
                "part": match bead.part { Part::Inner => "inner", Part::Distal => "distal", Part::Tip => "tip" },
                "center_in_link": <[f64; 3]>::from(bead.center_in_segment.coords),
                "radius_m": bead.radius_m,
            })).collect::<Vec<_>>(),
        })).collect::<Vec<_>>(),
        "candidates": hand.candidates.iter().map(|candidate| json!({
            "name": candidate.name,
            "fingers": candidate.fingers().map(|f| hand.fingers[f].name.clone()).collect::<Vec<_>>(),
            "open": posture(hand, &candidate.open),
            "preshape": posture(hand, &candidate.posture_at(&hand.joints, 1.0)),
            "opening_m": ([0.0, 1.0, 2.0].map(|s| opening_m(hand, candidate, s))),
            "wraps": candidate.wraps,
        })).collect::<Vec<_>>(),
        "warnings": loaded.warnings,
    })
}
