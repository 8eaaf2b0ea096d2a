//! `prehend calibrate-mount`: from scans of a ball to where the scanner sits on the palm.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, ensure};
use clap::{ArgGroup, Args};
use nalgebra::{Isometry3, Vector3};
use serde::Serialize;

use super::calibrate_mount_virtual::{
    Disturbance, VIRTUAL_CHECK_RADIUS_M, VIRTUAL_RADIUS_M, virtual_captures,
};
use super::{Outcome, input, write_json};
use crate::io::write_atomically;
use crate::scan::Instrument;
use crate::scan::capture::Capture;
use crate::scan::hand_eye::{
    FoundProfiles, HandEye, HandEyeError, Located, MountFile, Profile, Target, Uncertainty, Verification,
    calibrate_mount, sphere_profiles, verify,
};
use crate::scan::recording::read_recording;

/// Hand-eye calibration: find where the scanner sits on the palm, from scans of a ball that stands still
#[derive(Debug, Clone, Args)]
#[command(
    group = ArgGroup::new("source").required(true).args(["scans", "virtual_cell"]),
    after_help = "Each recording shows one matt ball, swept over from many sides (docs/scanning.md, Hand-eye calibration); scan --recording takes the mount with --mount.\n\nExamples:\n  prehend calibrate-mount --virtual -o mount.toml\n  prehend calibrate-mount --virtual --record kept -o mount.toml\n  prehend calibrate-mount kept/ball --radius-mm 20 -o mount.toml\n  prehend calibrate-mount ball-a ball-b --verify ball-c -o mount.toml"
)]
pub struct CalibrateMountArgs {
    /// Recordings (prehend scan --record): folders with scan.toml; in each, a ball stands still somewhere else
    #[arg(value_name = "SCAN")]
    pub scans: Vec<PathBuf>,
    /// Scan a ball in the virtual cell, with a scanner that sits 5 mm and 2 degrees off its place
    #[arg(long = "virtual")]
    pub virtual_cell: bool,
    /// Mount to write, or - for standard output
    #[arg(short, long, value_name = "MOUNT.toml")]
    pub output: PathBuf,
    /// Radius of the ball, millimetres; by default it is found too
    #[arg(long, value_name = "MM", value_parser = input::positive, allow_negative_numbers = true, conflicts_with = "virtual_cell")]
    pub radius_mm: Option<f64>,
    /// Recording of another ball, or of the same elsewhere, that the mount is put to the test on
    #[arg(long, value_name = "SCAN", conflicts_with = "virtual_cell")]
    pub verify: Option<PathBuf>,
    /// Radius of that ball, millimetres
    #[arg(long, value_name = "MM", value_parser = input::positive, allow_negative_numbers = true, requires = "verify")]
    pub verify_radius_mm: Option<f64>,
    /// Sweeps over the virtual ball
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=200), allow_negative_numbers = true, conflicts_with = "scans")]
    pub sweeps: u32,
    /// Noise to add to the virtual scanner's points, along the stripe and away from the laser; not to recordings
    #[arg(long, value_name = "MM", default_value_t = 0.0, value_parser = input::not_negative, allow_negative_numbers = true, conflicts_with = "scans")]
    pub noise_mm: f64,
    /// Error to add to what the virtual arm says: of each sweep, along each axis; not to recordings
    #[arg(long, value_name = "MM", default_value_t = 0.0, value_parser = input::not_negative, allow_negative_numbers = true, conflicts_with = "scans")]
    pub arm_error_mm: f64,
    /// Folder to write with the recordings of the virtual balls, `ball` and `check`
    #[arg(long, value_name = "DIR", conflicts_with = "scans")]
    pub record: Option<PathBuf>,
    /// Seed of the virtual cell: the mount, the sweeps, the noise
    #[arg(long, default_value_t = 1, allow_negative_numbers = true, conflicts_with = "scans")]
    pub seed: u64,
    /// Print one JSON document on standard output
    #[arg(long)]
    pub json: bool,
}

/// What there is to calibrate with.
pub(super) struct Source {
    /// One for each target, and its name.
    pub(super) balls: Vec<(String, Capture)>,
    pub(super) radius_m: Option<f64>,
    pub(super) check: Option<Capture>,
    pub(super) check_radius_m: Option<f64>,
    /// Of the virtual cell.
    pub(super) truth: Option<Isometry3<f64>>,
    /// What is added to measurements of the virtual cell.
    pub(super) disturbance: Disturbance,
}

#[derive(Serialize)]
struct Summary {
    palm_from_scanner: Pose,
    /// From the noise of the points alone.
    std_by_points: Spread,
    /// From what leaving sweeps out does to the mount.
    std_by_sweeps: Spread,
    condition: f64,
    weakest: Direction,
    frames: usize,
    profiles: usize,
    sweeps: usize,
    points: usize,
    outliers: usize,
    noise_m: f64,
    balls: Vec<Ball>,
    leave_one_out_rms_m: f64,
    leave_one_out: Vec<LeftOutSweep>,
    /// From the mount in the first recording.
    off_recorded: Off,
    #[serde(skip_serializing_if = "Option::is_none")]
    off_truth: Option<Off>,
    #[serde(skip_serializing_if = "Option::is_none")]
    verification: Option<Check>,
    seconds: f64,
}

#[derive(Serialize)]
struct Pose {
    position_m: [f64; 3],
    orientation_wxyz: [f64; 4],
}

/// Standard deviations.
#[derive(Serialize)]
struct Spread {
    position_m: [f64; 3],
    rotation_rad: [f64; 3],
    /// Of a point at the stand-off, in space.
    at_stand_off_m: f64,
}

/// One standard deviation.
#[derive(Serialize)]
struct Direction {
    turn_rad: [f64; 3],
    shift_m: [f64; 3],
}

#[derive(Serialize)]
struct Ball {
    scan: String,
    center_m: [f64; 3],
    radius_m: f64,
    measured_radius_m: f64,
    measured_radius_std_m: f64,
}

#[derive(Serialize)]
struct LeftOutSweep {
    ball: usize,
    sweep: u32,
    rms_m: f64,
    turn_rad: f64,
    shift_m: f64,
}

#[derive(Clone, Copy, Serialize)]
struct Off {
    shift_m: f64,
    turn_rad: f64,
    /// Of a point at the stand-off.
    at_stand_off_m: f64,
}

#[derive(Serialize)]
struct Check {
    sweeps: usize,
    points: usize,
    rms_m: f64,
    center_rms_m: f64,
    center_max_m: f64,
    radius_m: f64,
    radius_std_m: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    radius_error_m: Option<f64>,
}

const MM: f64 = 1e-3;

/// Runs the command.
pub fn run(args: &CalibrateMountArgs, out: &mut dyn Write) -> anyhow::Result<Outcome> {
    let to_stdout = args.output.as_os_str() == "-";
    ensure!(!(to_stdout && args.json), "--json and -o - both want standard output");
    let clock = Instant::now();
    let source = if args.virtual_cell {
        let (ball, check, truth) = virtual_captures(args.sweeps, args.seed, args.record.as_deref())?;
        Source {
            balls: vec![("the virtual cell".to_owned(), ball)],
            radius_m: Some(VIRTUAL_RADIUS_M),
            check: Some(check),
            check_radius_m: Some(VIRTUAL_CHECK_RADIUS_M),
            truth: Some(truth),
            disturbance: Disturbance {
                noise_m: args.noise_mm * MM,
                arm_error_m: args.arm_error_mm * MM,
                seed: args.seed,
            },
        }
    } else {
        recordings(args)?
    };
    let summary = calibrated(&source, clock, |text| {
        if to_stdout {
            out.write_all(text.as_bytes())?;
            return Ok(());
        }
        Ok(write_atomically(&args.output, |writer| writer.write_all(text.as_bytes()))?)
    })?;
    if to_stdout {
        return Ok(Outcome::Done);
    }
    if args.json {
        write_json(out, &summary)?;
    } else {
        describe(&summary, out)?;
        if let Some(folder) = &args.record {
            writeln!(out, "recorded {0}/ball and {0}/check", folder.display())?;
        }
        writeln!(out, "wrote {}", args.output.display())?;
    }
    Ok(Outcome::Done)
}

fn recordings(args: &CalibrateMountArgs) -> anyhow::Result<Source> {
    let read = |folder: &Path| {
        let read = read_recording(folder)?;
        input::warn(folder.display(), &read.warnings);
        Ok::<_, anyhow::Error>(read.capture)
    };
    let ball = |folder: &PathBuf| Ok((folder.display().to_string(), read(folder)?));
    Ok(Source {
        balls: args.scans.iter().map(ball).collect::<anyhow::Result<_>>()?,
        radius_m: args.radius_mm.map(|radius| radius * MM),
        check: args.verify.as_deref().map(read).transpose()?,
        check_radius_m: args.verify_radius_mm.map(|radius| radius * MM),
        truth: None,
        disturbance: Disturbance::default(),
    })
}

fn calibrated(
    source: &Source,
    clock: Instant,
    write: impl FnOnce(&str) -> anyhow::Result<()>,
) -> anyhow::Result<Summary> {
    let targets = vec![Target::Sphere { radius_m: source.radius_m }; source.balls.len()];
    // The sphere is looked for without its radius, so that a wrong one is told from a ball that was not seen.
    let found: Vec<FoundProfiles> = (0..)
        .zip(&source.balls)
        .map(|(target, (_, capture))| sphere_profiles(capture, target, None))
        .collect();
    for (found, (name, _)) in found.iter().zip(&source.balls) {
        ensure!(!found.profiles.is_empty(), "{name}: none of {} frames shows a ball", found.frames);
    }
    let mut profiles: Vec<Profile> = found.iter().flat_map(|found| found.profiles.iter().cloned()).collect();
    source.disturbance.apply(&mut profiles, 0);
    let found_mount = calibrate_mount(&targets, &profiles, None).map_err(|error| named(error, source))?;
    let mount = found_mount.palm_from_scanner;
    // Before anything is written.
    let verification = match &source.check {
        Some(check) => {
            let mut profiles = sphere_profiles(check, 0, source.check_radius_m).profiles;
            source.disturbance.apply(&mut profiles, 1);
            let verified = verify(&profiles, source.check_radius_m, &mount);
            Some(verified.context("the ball to verify with")?)
        }
        None => None,
    };
    write(&MountFile::of(&found_mount).to_toml()?)?;
    let recorded = source.balls.first().map_or(mount, |(_, capture)| capture.rig.palm_from_scanner);
    let q = mount.rotation.quaternion();
    let left_out = &found_mount.leave_one_out;
    let weakest_std = found_mount.uncertainty().along(&found_mount.weakest);
    Ok(Summary {
        palm_from_scanner: Pose {
            position_m: mount.translation.vector.into(),
            orientation_wxyz: [q.w, q.i, q.j, q.k],
        },
        std_by_points: spread(&found_mount.by_points, &mount),
        std_by_sweeps: spread(&left_out.uncertainty, &mount),
        condition: found_mount.condition,
        weakest: Direction {
            turn_rad: (found_mount.weakest.turn_rad * weakest_std).into(),
            shift_m: (found_mount.weakest.shift_m * weakest_std).into(),
        },
        frames: found.iter().map(|found| found.frames).sum(),
        profiles: profiles.len(),
        sweeps: left_out.sweeps.len(),
        points: found_mount.points,
        outliers: found_mount.outliers,
        noise_m: found_mount.noise_m,
        balls: balls(&found_mount, source),
        leave_one_out_rms_m: left_out.rms_m,
        leave_one_out: left_out
            .sweeps
            .iter()
            .map(|left| LeftOutSweep {
                ball: left.target,
                sweep: left.sweep,
                rms_m: left.rms_m,
                turn_rad: left.turn_rad.norm(),
                shift_m: left.shift_m.norm(),
            })
            .collect(),
        off_recorded: off(&mount, &recorded),
        off_truth: source.truth.map(|truth| off(&mount, &truth)),
        verification: verification.map(|found| check(&found, source.check_radius_m)),
        seconds: clock.elapsed().as_secs_f64(),
    })
}

/// An error with the name of the recording that it speaks of.
fn named(error: HandEyeError, source: &Source) -> anyhow::Error {
    let target = match error {
        HandEyeError::NoSphere { target }
        | HandEyeError::TooFewPoses { target, .. }
        | HandEyeError::WrongRadius { target, .. } => Some(target),
        _ => None,
    };
    match target.and_then(|target| source.balls.get(target)) {
        Some((name, _)) => anyhow::Error::from(error).context(name.clone()),
        None => error.into(),
    }
}

fn balls(found: &HandEye, source: &Source) -> Vec<Ball> {
    let measured = found.targets.iter().zip(&found.measured_radii_m).zip(&source.balls);
    measured
        .filter_map(|((located, measured), (scan, _))| match (located, measured) {
            (Located::Sphere { center_m, radius_m }, Some([measured_m, std_m])) => Some(Ball {
                scan: scan.clone(),
                center_m: center_m.coords.into(),
                radius_m: *radius_m,
                measured_radius_m: *measured_m,
                measured_radius_std_m: *std_m,
            }),
            _ => None,
        })
        .collect()
}

/// From the scanner to where it looks, in its own frame.
fn gaze() -> Vector3<f64> {
    Vector3::z() * Instrument::default().stand_off_m
}

fn spread(uncertainty: &Uncertainty, mount: &Isometry3<f64>) -> Spread {
    Spread {
        position_m: uncertainty.position_std_m(),
        rotation_rad: uncertainty.rotation_std_rad(),
        at_stand_off_m: uncertainty.point_std_m(&(mount.rotation * gaze())),
    }
}

fn off(a: &Isometry3<f64>, b: &Isometry3<f64>) -> Off {
    Off {
        shift_m: (a.translation.vector - b.translation.vector).norm(),
        turn_rad: a.rotation.angle_to(&b.rotation),
        at_stand_off_m: (a.transform_point(&gaze().into()) - b.transform_point(&gaze().into())).norm(),
    }
}

fn check(found: &Verification, radius_m: Option<f64>) -> Check {
    Check {
        sweeps: found.center_offsets_m.len(),
        points: found.points,
        rms_m: found.rms_m,
        center_rms_m: found.center_rms_m(),
        center_max_m: found.center_offsets_m.iter().copied().fold(0.0, f64::max),
        radius_m: found.radius_m,
        radius_std_m: found.radius_std_m,
        radius_error_m: radius_m.map(|radius| found.radius_m - radius),
    }
}

fn describe(summary: &Summary, out: &mut dyn Write) -> std::io::Result<()> {
    let mm = |lengths: &[f64; 3]| lengths.map(|length| format!("{:.3}", length / MM)).join(" ");
    let deg = |angles: &[f64; 3]| angles.map(|angle| format!("{:.4}", angle.to_degrees())).join(" ");
    writeln!(
        out,
        "{} of {} frames show a ball, in {} sweeps; {} points, {} of them outliers, noise {:.3} mm",
        summary.profiles,
        summary.frames,
        summary.sweeps,
        summary.points,
        summary.outliers,
        summary.noise_m / MM
    )?;
    for ball in &summary.balls {
        writeln!(
            out,
            "ball of {}: centre ({}) mm, radius {:.3} mm, by the profiles {:.3} +- {:.4} mm",
            ball.scan,
            mm(&ball.center_m),
            ball.radius_m / MM,
            ball.measured_radius_m / MM,
            ball.measured_radius_std_m / MM
        )?;
    }
    let Pose { position_m, orientation_wxyz } = &summary.palm_from_scanner;
    let quaternion = orientation_wxyz.map(|x| format!("{x:.6}")).join(" ");
    writeln!(out, "scanner on the palm: ({}) mm, wxyz ({quaternion})", mm(position_m))?;
    for (by, spread) in [("points", &summary.std_by_points), ("sweeps", &summary.std_by_sweeps)] {
        writeln!(
            out,
            "standard deviation by the {by}: x y z {} mm, about them {} deg; {:.3} mm at the stand-off",
            mm(&spread.position_m),
            deg(&spread.rotation_rad),
            spread.at_stand_off_m / MM
        )?;
    }
    writeln!(
        out,
        "least known: a turn by ({}) deg with a shift by ({}) mm, one standard deviation; condition {:.0}",
        deg(&summary.weakest.turn_rad),
        mm(&summary.weakest.shift_m),
        summary.condition
    )?;
    if let Some(worst) = summary.leave_one_out.iter().max_by(|a, b| a.rms_m.total_cmp(&b.rms_m)) {
        writeln!(
            out,
            "each sweep as the others predict it: {:.3} mm rms; worst {:.3} mm, sweep {} of {}",
            summary.leave_one_out_rms_m / MM,
            worst.rms_m / MM,
            worst.sweep,
            summary.balls.get(worst.ball).map_or("", |ball| &ball.scan)
        )?;
    }
    let mut say = |what: &str, off: &Off| {
        writeln!(
            out,
            "{what}: {:.3} mm and {:.4} deg off, {:.3} mm at the stand-off",
            off.shift_m / MM,
            off.turn_rad.to_degrees(),
            off.at_stand_off_m / MM
        )
    };
    say("the mount that was recorded", &summary.off_recorded)?;
    if let Some(truth) = &summary.off_truth {
        say("the true mount", truth)?;
    }
    if let Some(check) = &summary.verification {
        let error = check.radius_error_m.map(|e| format!(", {:+.3} mm off", e / MM)).unwrap_or_default();
        writeln!(
            out,
            "verified on another ball: {} points of {} sweeps, {:.3} mm rms; radius {:.3} +- {:.4} mm{error}; centres \
             by single sweeps scatter by {:.3} mm rms, {:.3} at most",
            check.points,
            check.sweeps,
            check.rms_m / MM,
            check.radius_m / MM,
            check.radius_std_m / MM,
            check.center_rms_m / MM,
            check.center_max_m / MM
        )?;
    }
    writeln!(out, "took {:.1} s", summary.seconds)
}
