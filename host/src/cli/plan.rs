//! `prehend plan`: mesh or cloud -> ranked grasps.

use std::cell::RefCell;
use std::io::Write;
use std::path::PathBuf;
use std::time::Instant;

use anyhow::Context;
use clap::{Args, ValueEnum};
use indicatif::ProgressBar;
use nalgebra::{Isometry3, Unit as UnitVector, UnitQuaternion, Vector3};
use serde_json::json;

use super::hand_file::HandArgs;
use super::input::{self, TABLE_HEIGHT_M};
use super::planning::{Planned, Planner};
use super::progress::{bar, spinner};
use super::{Outcome, reconstruct as reconstruct_command, remote, write_json, write_json_file};
use crate::hand::Hand;
use crate::io::{Geometry, Loaded, Unit, read_geometry};
use crate::object::{BuiltIn, Object};
use crate::plan::arm::{Arm, Joints, LimitCheck};
use crate::plan::document::PlanDocument;
use crate::plan::scene::Scene;
use crate::plan::search::{SearchSettings, Stop};
use crate::plan::seen::SeenSurface;
use crate::surface::{Mesh, Pick, Settings as ReconstructSettings, Survey, Table};

/// Plan force-closure grasps on a mesh or a cloud
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Examples:\n  prehend plan mesh.stl -o plan.json\n  prehend plan mug.iv --unit mm -o plan.json --strategy paper\n  prehend plan cloud.pcd -o plan.json --up 0,-1,0 --table none\n  prehend plan cloud.pcd -o plan.json --server http://127.0.0.1:7580"
)]
pub struct PlanArgs {
    /// Mesh (.ply .stl .obj .off .iv .wrl), cloud (.ply .pcd .xyz .txt .csv, reconstructed first), or the name of a
    /// built-in object
    #[arg(value_name = "INPUT", required = true, default_value = "-", hide_default_value = true)]
    pub input: String,
    /// Plan to write, or - for standard output
    #[arg(
        short,
        long,
        value_name = "PLAN.json",
        required = true,
        default_value = "-",
        hide_default_value = true
    )]
    pub output: PathBuf,
    /// Search: the paper's of 2005, or the wider one
    #[arg(long, value_enum, default_value_t)]
    pub strategy: Strategy,
    /// Most attempts; 300 for paper, 10000 for best
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=10_000_000), allow_negative_numbers = true)]
    pub attempts: Option<u32>,
    /// Epsilon at which the paper's search stops
    #[arg(long, default_value_t = 0.2, value_parser = input::not_negative, allow_negative_numbers = true)]
    pub threshold: f64,
    /// Coulomb friction coefficient between fingertips and object
    #[arg(long, default_value_t = 0.4, value_parser = input::not_negative, allow_negative_numbers = true)]
    pub friction: f64,
    /// Mass of the object in kg; by default that of the built-in object, or 0.1 or what it would
    /// weigh in steel if that is less
    #[arg(long, value_name = "KG", value_parser = input::positive, allow_negative_numbers = true)]
    pub mass: Option<f64>,
    /// The hand.
    #[command(flatten)]
    pub hand: HandArgs,
    /// Try only these typical grasps of the hand, names with commas between them; by default all
    #[arg(long, value_name = "NAME,..", value_delimiter = ',')]
    pub candidates: Vec<String>,
    /// Arm that carries it: rx60 (Stäubli), a file that describes another (docs/arms.md), or none to plan for the hand
    /// alone
    #[arg(long, value_name = "rx60|FILE.toml|none", default_value = "rx60", value_parser = arm_choice)]
    pub arm: ArmChoice,
    /// Where the arm starts: angles of its six joints in degrees; by default its rest posture
    #[arg(long, value_name = "Q1,..,Q6", value_parser = input::six, allow_hyphen_values = true)]
    pub start: Option<[f64; 6]>,
    /// Height of the table's top in the base frame in metres, or none
    #[arg(long, value_name = "Z|none", default_value = "0", value_parser = table, allow_hyphen_values = true)]
    pub table: TableChoice,
    /// Where the object is: in the base frame as the file has it, at the cell's spot, or whichever of the two fits
    #[arg(long, value_enum, default_value_t)]
    pub place: Place,
    /// Direction in the file's frame that is up when the object is put at the cell's spot; by default the normal of the
    /// table in a cloud, else the side that an open surface faces, else +z
    #[arg(long, value_name = "X,Y,Z", value_parser = input::triple, allow_hyphen_values = true)]
    pub up: Option<[f64; 3]>,
    /// Which of several objects on the table of a cloud: its number, largest, nearest (to the sensor), the one at X,Y,Z in
    /// the file's frame, or whole for all of them as one body
    #[arg(long, value_name = "N|largest|nearest|whole|X,Y,Z", default_value = "largest", value_parser = input::pick, allow_hyphen_values = true)]
    pub pick: Pick,
    /// How many grasps to write, best first
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..), allow_negative_numbers = true)]
    pub top: u32,
    /// Write all grasps
    #[arg(long)]
    pub all: bool,
    /// Seed of every random choice
    #[arg(long, default_value_t = 1, allow_negative_numbers = true)]
    pub seed: u64,
    /// Unit of the file: m or mm
    #[arg(long, default_value = "m", value_parser = input::unit)]
    pub unit: Unit,
    /// Print one JSON document on standard output
    #[arg(long)]
    pub json: bool,
    /// Have it planned by `prehend serve` at this address; the file is sent there (docs/service.md)
    #[arg(long, value_name = "http://HOST:PORT", value_parser = remote::address)]
    pub server: Option<String>,
    // Exclusive arguments need no others, whose defaults are never looked at.
    /// Print the JSON schema of PLAN.json and do nothing else
    #[arg(long, exclusive = true)]
    pub schema: bool,
}

/// Which search to run, `--strategy`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum Strategy {
    /// Eight typical candidates, then small motions about them, until epsilon passes the threshold
    Paper,
    /// Approaches from everywhere, refined, ranked by what survives an error of the pose
    #[default]
    Best,
}

impl Strategy {
    /// The word of the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::Best => "best",
        }
    }

    /// Attempts when none are asked for.
    #[must_use]
    pub fn default_attempts(self) -> usize {
        match self {
            Self::Paper => 300,
            Self::Best => 10_000,
        }
    }
}

/// Which arm carries the hand, `--arm`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ArmChoice {
    /// Stäubli RX60.
    Rx60,
    /// The arm that a file describes.
    File(PathBuf),
    /// The hand alone.
    None,
}

impl ArmChoice {
    /// The arm that the word stands for. Errors when a file describes none.
    pub fn arm(&self) -> anyhow::Result<Option<Arm>> {
        match self {
            Self::Rx60 => Ok(Some(Arm::rx60())),
            Self::File(path) => input::arm(path).map(Some),
            Self::None => Ok(None),
        }
    }
}

fn arm_choice(text: &str) -> Result<ArmChoice, String> {
    match text {
        "rx60" => Ok(ArmChoice::Rx60),
        "none" => Ok(ArmChoice::None),
        file if file.ends_with(".toml") => Ok(ArmChoice::File(file.into())),
        _ => Err("give rx60, none, or a file FILE.toml".to_owned()),
    }
}

/// Where the object is, `--place`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum Place {
    /// In the base frame if it stands there within reach, else at the cell's spot
    #[default]
    Auto,
    /// In the base frame, as the file has it
    Base,
    /// At the cell's spot, up as --up says
    Cell,
}

/// Where the table is, `--table`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TableChoice {
    /// A height in the base frame, metres.
    At(f64),
    /// No table.
    None,
}

impl TableChoice {
    /// Height in the base frame, metres, if there is a table.
    #[must_use]
    pub fn height_m(self) -> Option<f64> {
        match self {
            Self::At(z) => Some(z),
            Self::None => None,
        }
    }
}

fn table(text: &str) -> Result<TableChoice, String> {
    match (text, text.parse::<f64>()) {
        ("none", _) => Ok(TableChoice::None),
        (_, Ok(z)) if z.is_finite() => Ok(TableChoice::At(z)),
        _ => Err("give a height in metres, or none".to_owned()),
    }
}

/// Runs the command.
pub fn run(args: &PlanArgs, out: &mut dyn Write) -> anyhow::Result<Outcome> {
    if args.schema {
        write_json(out, &PlanDocument::schema())?;
        return Ok(Outcome::Done);
    }
    let to_stdout = args.output.as_os_str() == "-";
    anyhow::ensure!(!(to_stdout && args.json), "--json and -o - both want standard output");
    if let Some(url) = &args.server {
        return remote::run(args, url, out);
    }
    let start = Instant::now();
    let Loaded { value: given, warnings } = Given::read(args)?;
    input::warn(&args.input, &warnings);
    let made = make(args, given, &Bars::default(), &Stop::default())?;
    let document = &made.planned.document;
    if to_stdout {
        write_json(out, document)?;
    } else {
        write_json_file(&args.output, document)?;
        if args.json {
            write_json(out, &made.summary(args, start.elapsed().as_secs_f64()))?;
        } else {
            out.write_all(&made.text)?;
            writeln!(out, "wrote {} in {:.2} s", args.output.display(), start.elapsed().as_secs_f64())?;
        }
    }
    Ok(if document.grasps.is_empty() { Outcome::No } else { Outcome::Done })
}

/// What there is to plan on, as it was read.
pub(super) enum Given {
    /// A built-in object.
    BuiltIn(Object),
    /// What a file held.
    File(Geometry),
}

impl Given {
    /// Reads what the arguments name.
    fn read(args: &PlanArgs) -> anyhow::Result<Loaded<Self>> {
        if let Some(object) = Self::built_in(args)? {
            return Ok(Loaded { value: object, warnings: Vec::new() });
        }
        let Loaded { value, warnings } = read_geometry(args.input.as_ref(), args.unit)?;
        Ok(Loaded { value: Self::File(value), warnings })
    }

    /// The built-in object, if that is what the arguments name.
    pub(super) fn built_in(args: &PlanArgs) -> anyhow::Result<Option<Self>> {
        if BuiltIn::ALL.iter().all(|b| b.name() != args.input) {
            return Ok(None);
        }
        Ok(Some(Self::BuiltIn(input::object(&args.input, args.unit, args.mass, args.friction)?)))
    }
}

/// Who is told how far it is.
pub(super) trait Watch {
    /// What is being done now.
    fn stage(&self, name: &'static str);
    /// Attempts of the search, so far and at most.
    fn attempts(&self, so_far: usize, at_most: usize);
}

/// Tells whoever sits at the terminal.
#[derive(Default)]
struct Bars(RefCell<Option<ProgressBar>>);

impl Bars {
    fn replace(&self, bar: Option<ProgressBar>) {
        if let Some(old) = self.0.replace(bar) {
            old.finish_and_clear();
        }
    }
}

impl Watch for Bars {
    fn stage(&self, name: &'static str) {
        self.replace((name == SURFACE).then(|| spinner(name)));
    }

    fn attempts(&self, so_far: usize, at_most: usize) {
        if self.0.borrow().is_none() {
            self.replace(Some(bar(at_most, "attempts")));
        }
        if let Some(bar) = &*self.0.borrow() {
            bar.set_position(so_far as u64);
        }
    }
}

impl Drop for Bars {
    fn drop(&mut self) {
        self.replace(None);
    }
}

/// Names of stages.
const SURFACE: &str = "surface";
const SEARCH: &str = "search";

/// A plan, and what people are told of it.
pub(super) struct Made {
    pub(super) planned: Planned,
    /// The scene that was planned in.
    pub(super) scene: Scene,
    /// Lines about the surface, the hand, the place and the search.
    pub(super) text: Vec<u8>,
}

/// Plans on what was given. Once `stop` is asked, what comes out is no plan.
pub(super) fn make(args: &PlanArgs, given: Given, watch: &dyn Watch, stop: &Stop) -> anyhow::Result<Made> {
    let mut text: Vec<u8> = Vec::new();
    let mut chosen = args.hand.chosen()?;
    let arm = args.arm.arm()?.map(|arm| chosen.mounted(arm));
    watch.stage(SURFACE);
    let Input { object, table_normal, seen } = object_of(args, given, &mut text)?;
    watch.stage(SEARCH);
    let (base_from_object, placing) = place(args, &object.mesh, table_normal)?;
    let table_height_m = args.table.height_m();
    let start_rad = checked_start(args.start, arm.as_ref())?;
    let mut scene = Scene::new(object.mesh.clone(), base_from_object, table_height_m, arm)
        .with_context(|| format!("planning on {}", args.input))?
        .with_hand(chosen.hand);
    restrict(&mut scene.hand, &args.candidates)?;
    scene.friction = args.friction;
    scene.seen = seen;
    let top = if args.all { usize::MAX } else { args.top as usize };
    let settings = SearchSettings {
        attempts: args.attempts.map_or(args.strategy.default_attempts(), |n| n as usize),
        threshold: args.threshold,
        seed: args.seed,
        ranked: top,
        stop: stop.clone(),
    };
    watch.attempts(0, settings.attempts);
    let planner =
        Planner { scene: &scene, object: &object, strategy: args.strategy, settings: &settings, start_rad };
    let planned = planner.plan(top, &|done| watch.attempts(done, settings.attempts));
    for line in &chosen.lines {
        writeln!(text, "{line}")?;
    }
    writeln!(text, "{placing}")?;
    planned.describe(&mut text)?;
    Ok(Made { planned, scene, text })
}

impl Made {
    /// The document of `--json`; `total_s` is what all of it took.
    pub(super) fn summary(&self, args: &PlanArgs, total_s: f64) -> serde_json::Value {
        let document = &self.planned.document;
        json!({
            "attempts": document.attempts,
            "force_closure": document.force_closure,
            "grasps": document.grasps.len(),
            "seconds": { "total": total_s, "search": self.planned.search_s },
            "best": document.grasps.first().map(|grasp| json!({
                "epsilon": grasp.quality.epsilon,
                "strategy": args.strategy.name(),
                "candidate": grasp.candidate,
            })),
            "rejected": document.rejected,
            "convention": document.convention,
        })
    }
}

/// Leaves the hand those of its candidates that are named; none named leaves all.
fn restrict(hand: &mut Hand, names: &[String]) -> anyhow::Result<()> {
    if let Some(unknown) = names.iter().find(|name| hand.candidates.iter().all(|c| c.name != **name)) {
        let known: Vec<&str> = hand.candidates.iter().map(|candidate| candidate.name.as_str()).collect();
        anyhow::bail!("--candidates: there is no '{unknown}'; the hand has {}", known.join(", "));
    }
    if !names.is_empty() {
        hand.candidates.retain(|candidate| names.contains(&candidate.name));
    }
    Ok(())
}

/// The joint angles that were given in degrees, inside the arm's limits.
fn checked_start(given_deg: Option<[f64; 6]>, arm: Option<&Arm>) -> anyhow::Result<Option<Joints>> {
    let Some(degrees) = given_deg else { return Ok(None) };
    let arm = arm.context("--start: there is no arm to start")?;
    let start_rad = degrees.map(f64::to_radians);
    if let LimitCheck::Outside { axis, .. } = arm.limits().check(&start_rad) {
        let [lower, upper] =
            [arm.limits().lower_rad, arm.limits().upper_rad].map(|limits| limits[axis - 1].to_degrees());
        anyhow::bail!("--start: axis {axis} is at {} degrees, outside {lower} to {upper}", degrees[axis - 1]);
    }
    Ok(Some(start_rad))
}

/// What there is to plan on.
struct Input {
    object: Object,
    /// Normal of the table that was found in a cloud, in the file's frame.
    table_normal: Option<Vector3<f64>>,
    /// What of the surface was measured, where that is known.
    seen: Option<SeenSurface>,
}

/// The object of what was given; a cloud is reconstructed and completed first, which is described in `text`.
fn object_of(args: &PlanArgs, given: Given, text: &mut Vec<u8>) -> anyhow::Result<Input> {
    let geometry = match given {
        Given::BuiltIn(object) => return Ok(Input { object, table_normal: None, seen: None }),
        Given::File(geometry) => geometry,
    };
    let mut table_normal = None;
    let mesh = match geometry {
        Geometry::Mesh(mesh) => mesh,
        Geometry::Cloud(cloud) => {
            let settings = ReconstructSettings {
                table: Table::Auto,
                close: true,
                pick: args.pick,
                seed: args.seed,
                ..Default::default()
            };
            let context = || format!("reconstructing {}", args.input);
            let survey = Survey::new(&cloud, &settings).with_context(context)?;
            let result = survey.pick().with_context(context)?;
            reconstruct_command::describe_scene(&survey, &args.pick, text)?;
            reconstruct_command::describe(&result, text)?;
            table_normal = result.report.table.map(|table| table.normal.into_inner());
            result.mesh
        }
    };
    let seen = SeenSurface::of_mesh(&mesh);
    let mass_kg = args.mass.unwrap_or_else(|| input::assumed_mass_kg(&mesh));
    Ok(Input { object: Object::new(&args.input, mesh, mass_kg, args.friction), table_normal, seen })
}

/// Pose of the mesh's frame in the base frame, and a line that says how it was chosen.
fn place(
    args: &PlanArgs,
    mesh: &Mesh,
    table_normal: Option<Vector3<f64>>,
) -> anyhow::Result<(Isometry3<f64>, String)> {
    let table_m = args.table.height_m().unwrap_or(TABLE_HEIGHT_M);
    let in_base = match args.place {
        Place::Base => true,
        Place::Cell => false,
        Place::Auto => args.up.is_none() && input::stands_in_cell(mesh, table_m),
    };
    if in_base {
        return Ok((Isometry3::identity(), "object: in the base frame, where the file has it".to_owned()));
    }
    let (up, why) = match (args.up, table_normal, seen_side(mesh)) {
        (Some(up), _, _) => {
            let up = Vector3::from(up);
            // Scaled, so that no length overflows.
            (up / up.amax(), "as given")
        }
        (None, Some(normal), _) => (normal, "the normal of the table in the cloud"),
        (None, None, Some(side)) => (side, "the side that the open surface faces"),
        (None, None, None) => (Vector3::z(), "its own z"),
    };
    let up = UnitVector::try_new(up, 1e-9).context("--up: (0, 0, 0) is no direction")?;
    let upright = UnitQuaternion::rotation_between_axis(&up, &Vector3::z_axis())
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
    let turned = Isometry3::from_parts(nalgebra::Translation3::identity(), upright);
    let base_from_object = input::standing_at_spot(&mesh.transformed(&turned), table_m) * turned;
    let [x, y] = input::SPOT_M;
    let line = format!(
        "object: standing at ({x:.2}, {y:.2}, {table_m:.2}) m, up is {why} ({:.2}, {:.2}, {:.2})",
        up.x, up.y, up.z
    );
    Ok((base_from_object, line))
}

/// The direction that an open surface faces on the whole; `None` for a closed one, whose normals cancel.
fn seen_side(mesh: &Mesh) -> Option<Vector3<f64>> {
    let mut sum = Vector3::zeros();
    for face in 0..mesh.faces().len() {
        let [a, b, c] = mesh.corners(face);
        sum += 0.5 * (b - a).cross(&(c - a));
    }
    // A hole or two leave a small rest; a sheet seen from one side faces there with a good part of its area.
    (sum.norm() > 0.2 * mesh.area_m2()).then_some(sum)
}
