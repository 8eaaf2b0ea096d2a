//! Surfaces from clouds of a known solid: time, memory, and distance from the truth.
//!
//! `cargo bench -p host --bench surface` prints the table. For the peers, `benches/peers/surface.py` does the rest with
//!
//! - `-- --write DIR`: writes the same clouds as `CLOUD.ply`, metres;
//! - `-- --score DIR`: scores every `CLOUD.METHOD.ply` found there beside ours; `CLOUD.METHOD.json` with `seconds` and
//!   `peak_mb` says what it took;
//! - `-- --large`: also 5 and 10 million points;
//! - `-- NAME`: only clouds with this in their name.
//!
//! Clouds: `one` is a lid seen from above along parallel stripes, with lines of sight; `solid` the lid filled up, seen all
//! round; `thin` the lid with its wall of 4 mm; `thin+rays` the same with lines of sight. Noise is 0.1 mm in all three
//! directions. Of five runs the median time is told, and the growth of the peak of resident memory in the first.

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::Context;
use host::io::{Unit, read_mesh, write_cloud};
use host::surface::{PointCloud, Settings, reconstruct};
use nalgebra::{Point3, Vector3};

mod lid;
mod score;

use lid::{Lid, noisy};
use score::{Score, score};

const SIGMA_MM: f64 = 0.1;
const RUNS: usize = 5;

/// A cloud, what it samples, and what of that it can tell.
struct Case {
    name: String,
    cloud: PointCloud,
    truth: Lid,
    known: Vec<Point3<f64>>,
}

impl Case {
    fn new(kind: &str, n: usize) -> anyhow::Result<Self> {
        let name = format!("{kind}-{n}");
        let known = 200_000;
        if kind == "one" {
            let mut cloud = noisy(&Lid::from_above(n), SIGMA_MM, 1);
            cloud.views = Some(vec![Vector3::z_axis(); cloud.len()]);
            return Ok(Self { name, cloud, truth: Lid::solid(), known: Lid::from_above(known) });
        }
        let truth = if kind == "solid" { Lid::solid() } else { Lid::thin() };
        let samples: Vec<_> = truth.samples(n).collect();
        let points: Vec<Point3<f64>> = samples.iter().map(|sample| sample.0).collect();
        let mut cloud = noisy(&points, SIGMA_MM, 1);
        cloud.views = (kind == "thin+rays").then(|| truth.lines_of_sight(&samples));
        let known = truth.samples(known).map(|(point, _)| point).collect();
        Ok(Self { name, cloud, truth, known })
    }
}

/// What a method took and what came out.
struct Row {
    method: String,
    seconds: f64,
    peak_mb: Option<f64>,
    score: Score,
}

fn main() -> anyhow::Result<()> {
    // Cargo itself adds `--bench`.
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let folder = |option: &str| -> Option<PathBuf> {
        let at = arguments.iter().position(|a| a == option)?;
        arguments.get(at + 1).map(PathBuf::from)
    };
    let mut sizes = vec![5_436, 50_000, 500_000];
    if arguments.iter().any(|a| a == "--large") {
        sizes.extend([5_000_000, 10_000_000]);
    }
    let filter = arguments.iter().find(|a| !a.starts_with("--")).filter(|_| arguments.len() == 1);
    let (write, compare) = (folder("--write"), folder("--score"));
    if write.is_none() {
        println!(
            "{:18} {:22} {:>8} {:>7} {:>9} {:>22} {:>22} {:>6} {:>6} {:>12} {:>5} {:>6}",
            "cloud",
            "method",
            "s",
            "MB",
            "triangles",
            "mesh -> truth, mm",
            "truth -> mesh, mm",
            "false",
            "miss",
            "normal, deg",
            "inv.",
            "open"
        );
    }
    for n in sizes {
        for kind in ["one", "solid", "thin", "thin+rays"] {
            if n > 500_000 && kind != "one" && kind != "solid" {
                continue;
            }
            if filter.as_ref().is_some_and(|part| !format!("{kind}-{n}").contains(part.as_str())) {
                continue;
            }
            let case = Case::new(kind, n)?;
            if let Some(folder) = &write {
                std::fs::create_dir_all(folder)?;
                write_cloud(&folder.join(format!("{}.ply", case.name)), &case.cloud)?;
                continue;
            }
            print(&case.name, &ours(&case)?);
            for row in compare.as_deref().map(|folder| theirs(&case, folder)).transpose()?.unwrap_or_default()
            {
                print("", &row);
            }
        }
    }
    Ok(())
}

fn ours(case: &Case) -> anyhow::Result<Row> {
    let mut times = Vec::new();
    let mut peak_mb = None;
    let mut mesh = None;
    let runs = if case.cloud.len() > 1_000_000 { 1 } else { RUNS };
    for run in 0..runs {
        let before = reset_peak().then(resident_peak_mb).flatten();
        let clock = Instant::now();
        let found = reconstruct(&case.cloud, &Settings::default()).with_context(|| case.name.clone())?;
        times.push(clock.elapsed().as_secs_f64());
        if run == 0 {
            peak_mb = before.zip(resident_peak_mb()).map(|(before, after)| after - before);
        }
        mesh = Some(found.mesh);
    }
    times.sort_by(f64::total_cmp);
    let mesh = mesh.context("no run")?;
    let score = score(&mesh, &case.truth, &case.known)?;
    Ok(Row { method: "prehend".to_owned(), seconds: times[times.len() / 2], peak_mb, score })
}

/// The meshes of other programs, by name.
fn theirs(case: &Case, folder: &Path) -> anyhow::Result<Vec<Row>> {
    let begins = format!("{}.", case.name);
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder)?
        .filter_map(|entry| entry.ok().map(|entry| entry.path()))
        .filter(|path| path.extension().is_some_and(|e| e == "ply"))
        .collect();
    files.sort();
    let mut rows = Vec::new();
    for path in files {
        let Some(method) = path
            .file_stem()
            .and_then(|stem| stem.to_str())
            .and_then(|stem| stem.strip_prefix(&begins))
            .map(str::to_owned)
        else {
            continue;
        };
        let took: serde_json::Value = serde_json::from_slice(&std::fs::read(path.with_extension("json"))?)?;
        let mesh = read_mesh(&path, Unit::Metre)?.value;
        let number = |key: &str| took[key].as_f64();
        rows.push(Row {
            method,
            seconds: number("seconds").context("seconds")?,
            peak_mb: number("peak_mb"),
            score: score(&mesh, &case.truth, &case.known)?,
        });
    }
    Ok(rows)
}

fn print(cloud: &str, row: &Row) {
    let Score { mesh_to_truth: [a, b, c], truth_to_mesh: [d, e, f], normal_deg: [g, h], .. } = row.score;
    println!(
        "{cloud:18} {:22} {:8.3} {:>7} {:9} {:>22} {:>22} {:6.2} {:6.2} {:>12} {:5.1} {:6}",
        row.method,
        row.seconds,
        row.peak_mb.map_or_else(|| "-".to_owned(), |mb| format!("{mb:.0}")),
        row.score.triangles,
        format!("{a:.3} / {b:.3} / {c:.2}"),
        format!("{d:.3} / {e:.3} / {f:.2}"),
        row.score.invented,
        row.score.missed,
        format!("{g:.1} / {h:.0}"),
        row.score.inverted,
        row.score.open_edges
    );
}

/// Lets Linux forget the peak of this process's memory.
fn reset_peak() -> bool {
    std::fs::write("/proc/self/clear_refs", "5").is_ok()
}

fn resident_peak_mb() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().trim_end_matches(" kB").parse::<f64>().ok().map(|kb| kb / 1024.0)
}
