//! `prehend calibrate`: from marker pairs to what a camera's pixels mean in the laser plane.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, ensure};
use clap::{Args, ValueEnum};
use serde::Serialize;

use super::{Outcome, input, write_json};
use crate::io::{read_text, write_atomically};
use crate::scan::calibrate::{
    Bench, BenchCamera, CalibrateSettings, Calibrated, Candidate, Errors, Fit, MarkerPair, Verification,
    calibrate, parse_markers,
};
use crate::scan::optics::Optics;
use crate::scan::rig::scanner_markers;
use crate::scan::{Camera, Instrument};

/// Calibrate a camera of the scanner: three models compete on held-out markers
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Markers: CSV with the header u_px,v_px,x_mm,y_mm,row; x along the stripe, y away from the laser.\n\nExamples:\n  prehend calibrate -o camera.toml\n  prehend calibrate --rippled -o camera.toml\n  prehend calibrate --camera left -o left.toml\n  prehend calibrate --markers left.csv -o left.toml"
)]
pub struct CalibrateArgs {
    /// Marker pairs of one camera; by default the virtual measuring bench makes them (20 markers x 50 positions)
    #[arg(long, value_name = "FILE.csv")]
    pub markers: Option<PathBuf>,
    /// Calibration to write, or - for standard output
    #[arg(short, long, value_name = "FILE.toml")]
    pub output: PathBuf,
    /// Calibrate this camera of the virtual scanner on a bench that covers its field; scan --calibration takes both
    #[arg(long, value_enum, value_name = "SIDE", conflicts_with_all = ["markers", "rippled"])]
    pub camera: Option<Side>,
    /// Noise of the virtual bench's markers, pixels
    #[arg(long, value_name = "PX", default_value_t = 0.1, value_parser = input::not_negative, allow_negative_numbers = true, conflicts_with = "markers")]
    pub noise: f64,
    /// Optics that no lens model fits, on the virtual bench: 0.25 px of ripple, laser sheet bowed by 0.1 mm
    #[arg(long, conflicts_with = "markers")]
    pub rippled: bool,
    /// Seed of the networks' first weights, and of the virtual bench's noise
    #[arg(long, default_value_t = 1, allow_negative_numbers = true)]
    pub seed: u64,
    /// Print one JSON document on standard output
    #[arg(long)]
    pub json: bool,
}

/// `--camera`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Side {
    /// At negative x of the scanner frame
    Left,
    /// At positive x
    Right,
}

impl Side {
    const fn camera(self) -> Camera {
        match self {
            Self::Left => Camera::Left,
            Self::Right => Camera::Right,
        }
    }
}

#[derive(Serialize)]
struct Summary {
    pairs: usize,
    held_out_pairs: usize,
    chosen: &'static str,
    candidates: Vec<CandidateSummary>,
    /// Of the chosen model, fitted to the inner markers, at markers up to 10 mm outside them.
    outside_inner_markers: Option<Errors>,
    seconds: f64,
}

#[derive(Serialize)]
struct CandidateSummary {
    model: &'static str,
    #[serde(flatten)]
    fit: Fit,
    held_out: Errors,
    /// Against the truth of the virtual bench, off the markers; without pixel noise.
    true_inside: Option<Errors>,
    true_10_mm_outside: Option<Errors>,
}

/// Largest table of markers that is read, bytes.
const MAX_BYTES: u64 = 1 << 26;
const OUTSIDE_M: f64 = 0.010;
const UM: f64 = 1e-6;

/// Runs the command.
pub fn run(args: &CalibrateArgs, out: &mut dyn Write) -> anyhow::Result<Outcome> {
    let to_stdout = args.output.as_os_str() == "-";
    ensure!(!(to_stdout && args.json), "--json and -o - both want standard output");
    let (pairs, truth) = match (&args.markers, args.camera) {
        (Some(path), _) => (read_markers(path)?, Vec::new()),
        (None, Some(side)) => {
            let (instrument, optics) = (Instrument::default(), Optics::default());
            (scanner_markers(&instrument, &optics, side.camera(), args.noise, args.seed), Vec::new())
        }
        (None, None) => {
            let camera = if args.rippled { BenchCamera::rippled() } else { BenchCamera::default() };
            let bench = Bench { noise_px: args.noise, ..Bench::default() };
            (bench.measure(&camera, args.seed), bench.verification(&camera, OUTSIDE_M))
        }
    };
    let clock = Instant::now();
    let settings = CalibrateSettings { seed: args.seed, ..Default::default() };
    let calibrated = calibrate(&pairs, &settings).with_context(|| source(args))?;
    let seconds = clock.elapsed().as_secs_f64();
    let text = calibrated.calibration.to_toml()?;
    if to_stdout {
        out.write_all(text.as_bytes())?;
        return Ok(Outcome::Done);
    }
    write_atomically(&args.output, |writer| writer.write_all(text.as_bytes()))?;
    let summary = summarise(&calibrated, pairs.len(), &truth, seconds);
    if args.json {
        write_json(out, &summary)?;
    } else {
        writeln!(out, "{} marker pairs from {}", pairs.len(), source(args))?;
        describe(&summary, out)?;
        writeln!(out, "wrote {}", args.output.display())?;
    }
    Ok(Outcome::Done)
}

fn source(args: &CalibrateArgs) -> String {
    match &args.markers {
        Some(path) => path.display().to_string(),
        None => format!("the virtual bench, {} px of noise", args.noise),
    }
}

fn read_markers(path: &Path) -> anyhow::Result<Vec<MarkerPair>> {
    let name = || path.display().to_string();
    parse_markers(&read_text(path, MAX_BYTES).with_context(name)?).with_context(name)
}

fn summarise(calibrated: &Calibrated, pairs: usize, truth: &[Verification], seconds: f64) -> Summary {
    let candidate = |candidate: &Candidate| {
        let at = |inside: bool| Errors::at(&candidate.model, truth.iter().filter(|p| p.inside == inside));
        CandidateSummary {
            model: candidate.model.kind().name(),
            fit: candidate.fit.clone(),
            held_out: candidate.held_out,
            true_inside: at(true),
            true_10_mm_outside: at(false),
        }
    };
    Summary {
        pairs,
        held_out_pairs: calibrated.held_out_pairs,
        chosen: calibrated.calibration.model().kind().name(),
        candidates: calibrated.candidates.iter().map(candidate).collect(),
        outside_inner_markers: calibrated.outside,
        seconds,
    }
}

fn describe(summary: &Summary, out: &mut dyn Write) -> std::io::Result<()> {
    let cell = |errors: &Option<Errors>| match errors {
        Some(errors) => format!("{:.1} / {:.1}", errors.rms_m / UM, errors.max_m / UM),
        None => "unknown".to_owned(),
    };
    writeln!(
        out,
        "errors rms / max in um; held out: {} markers, their own noise included",
        summary.held_out_pairs
    )?;
    let head =
        ["model", "parameters", "determined", "held out", "true inside", "10 mm outside", "iterations"];
    let [a, b, c, d, e, f, g] = head;
    writeln!(out, "{a:<9} {b:>10} {c:>10} {d:>15} {e:>15} {f:>15}  {g}")?;
    for candidate in &summary.candidates {
        let iterations: Vec<String> = candidate.fit.iterations.iter().map(ToString::to_string).collect();
        writeln!(
            out,
            "{:<9} {:>10} {:>10.1} {:>15} {:>15} {:>15}  {}{}",
            candidate.model,
            candidate.fit.parameters,
            candidate.fit.effective_parameters,
            cell(&Some(candidate.held_out)),
            cell(&candidate.true_inside),
            cell(&candidate.true_10_mm_outside),
            iterations.join(" "),
            if candidate.fit.converged { "" } else { " (stopped at the limit)" },
        )?;
    }
    writeln!(out, "chosen by the held-out markers: {}", summary.chosen)?;
    if summary.outside_inner_markers.is_some() {
        writeln!(
            out,
            "fitted to the inner markers only, up to 10 mm outside them: {} um; such pixels are refused",
            cell(&summary.outside_inner_markers)
        )?;
    }
    writeln!(out, "all models fitted in {:.2} s", summary.seconds)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scan::calibrate::{Calibration, Evaluation};

    fn args(markers: Option<PathBuf>, output: PathBuf) -> CalibrateArgs {
        CalibrateArgs { markers, output, camera: None, noise: 0.1, rippled: false, seed: 1, json: true }
    }

    #[test]
    fn markers_from_a_file_give_a_calibration_that_can_be_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let (markers, output) = (folder.path().join("left.csv"), folder.path().join("left.toml"));
        let mut table = String::from("u_px,v_px,x_mm,y_mm,row\n");
        let camera = BenchCamera::default();
        for pair in Bench::default().measure(&camera, 4) {
            let ([u, v], [x, y]) = (pair.pixel, pair.target_m.map(|length| length * 1e3));
            table += &format!("{u},{v},{x},{y},{}\n", pair.row);
        }
        std::fs::write(&markers, &table).unwrap();
        let mut out = Vec::new();
        assert_eq!(run(&args(Some(markers), output.clone()), &mut out).unwrap(), Outcome::Done);
        let summary: serde_json::Value = serde_json::from_slice(&out).unwrap();
        assert_eq!(summary["chosen"], "physical");
        assert_eq!(summary["pairs"], 1000);
        assert!(summary["candidates"][0]["true_inside"].is_null());
        let calibration = Calibration::from_toml(&std::fs::read_to_string(output).unwrap()).unwrap();
        let Evaluation::Point([x, y]) = calibration.evaluate(camera.project([0.01, 0.21])) else {
            panic!("a pixel between the markers is refused");
        };
        assert!((x - 0.01).hypot(y - 0.21) < 1e-5);
    }

    #[test]
    fn a_bad_file_is_one_line_that_names_it() {
        let folder = tempfile::tempdir().unwrap();
        let (markers, output) = (folder.path().join("bad.csv"), folder.path().join("bad.toml"));
        let fails = |content: &[u8]| {
            std::fs::write(&markers, content).unwrap();
            let error = run(&args(Some(markers.clone()), output.clone()), &mut Vec::new()).unwrap_err();
            assert!(!output.exists());
            let message = format!("{error:#}");
            let name = markers.display().to_string();
            message.strip_prefix(&format!("{name}: ")).unwrap_or_else(|| panic!("{message}")).to_owned()
        };
        let header = "u_px,v_px,x_mm,y_mm,row\n";
        assert_eq!(fails(format!("{header}1,2,3,4,5\n1,2,x,4,5\n").as_bytes()), "line 3: x_mm is \"x\"");
        assert_eq!(fails(header.as_bytes()), "0 marker pairs: at least 28 are needed");
        assert_eq!(fails(b"u_px,v_px,x_mm,y_mm,row\n\xff\n"), "line 2: not UTF-8 text");
        std::fs::remove_file(&markers).unwrap();
        assert!(run(&args(Some(markers.clone()), output.clone()), &mut Vec::new()).is_err());
    }
}
