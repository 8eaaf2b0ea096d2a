//! `prehend quality`: the metric alone, for anyone's contacts.

use std::io::{Read, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use clap::{Args, ValueEnum};
use nalgebra::Vector3;

use super::{Outcome, write_json};
use crate::grasp::document::GraspDocument;
use crate::grasp::report::QualityDocument;
use crate::grasp::{
    Balance, Closure, ConeModel, ContactForce, Convention, Disturbance, ForceNorm, Limits, NamedConvention,
    Norm, Quality, Resistance, Score, Separation, Settings, Task, TaskClosure, Workspace, Yardstick,
    evaluate, evaluate_task, resist,
};

/// Longest document, bytes: some hundred times what the most contacts take.
const MAX_BYTES: u64 = 16 << 20;

const DOCUMENT: &str = r#"Contacts as a JSON document, in metres and newtons; `-` reads standard input:
{"contacts":[{"point":[x,y,z],"normal":[x,y,z],"friction":f,"torsional_m":m,"max_force_n":n}],
 "center_of_mass":[x,y,z],"torque_scale_m":r}
Normals point into the object. Optional: torsional_m (0), max_force_n (1), center_of_mass (centroid of the points),
torque_scale_m (largest distance of a contact from it), and for --convention
"object":{"vertices":[[x,y,z]],"bounding_box":{"min":[x,y,z],"max":[x,y,z]},
          "surface":[{"point":[x,y,z],"normal":[x,y,z],"friction":f}]}
graspit needs center_of_mass and vertices (or torque_scale_m); frogger center_of_mass; simox and dexnet center_of_mass
and bounding_box or vertices; simox also surface, contacts spread over the object; dexgraspbench nothing"#;

/// Measure a grasp: force closure or not, and epsilon, the worst disturbance that it withstands
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Examples:\n  prehend quality contacts.json\n  prehend quality contacts.json --edges 8 --json\n  prehend quality - --norm linf < contacts.json"
)]
pub struct QualityArgs {
    /// Contacts as a JSON document; `-` reads standard input
    #[arg(value_name = "CONTACTS.json", long_help = DOCUMENT, required = true, default_value = "-", hide_default_value = true)]
    pub path: PathBuf,
    /// Measure as another program does; CONTACTS.json may need to know more of the object (see below)
    #[arg(long, value_name = "NAME", value_parser = named, conflicts_with_all = ["edges", "norm", "force_norm"])]
    pub convention: Option<NamedConvention>,
    /// Edges of the friction pyramids, or `exact` for the circular cone
    #[arg(long, value_name = "N|exact", default_value = "exact", value_parser = cone, allow_negative_numbers = true)]
    pub edges: ConeModel,
    /// What bounds the effort of the fingers
    #[arg(long, value_enum, default_value_t)]
    pub norm: NormArg,
    /// What has unit length in a friction cone
    #[arg(long, value_enum, default_value_t)]
    pub force_norm: ForceNormArg,
    /// Relative gap between the bounds on epsilon at which the search is done
    #[arg(long, value_name = "GAP", default_value_t = Settings::default().tolerance, value_parser = tolerance, allow_negative_numbers = true)]
    pub tolerance: f64,
    /// Ask for the resistance to one wrench on the object as well: N and N m about the centre of mass
    #[arg(long, value_name = "FX,FY,FZ,TX,TY,TZ", value_parser = disturbance, allow_hyphen_values = true, conflicts_with = "convention")]
    pub resist: Option<Disturbance>,
    /// Measure by an ellipsoid of disturbances as well, given by its semi-axes in N and N m; without it, by the document's
    /// `task` if there is one
    #[arg(long, value_name = "FX,FY,FZ,TX,TY,TZ", value_parser = semi_axes, allow_hyphen_values = true, conflicts_with = "convention")]
    pub ellipsoid: Option<Box<Task>>,
    /// Print one JSON document
    #[arg(long)]
    pub json: bool,
    // Exclusive arguments need no others, whose defaults are never looked at.
    /// Print the JSON schema of CONTACTS.json and do nothing else
    #[arg(long, exclusive = true)]
    pub schema: bool,
}

/// `--norm`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum NormArg {
    /// Normal forces that sum to 1
    #[default]
    L1,
    /// Each normal force up to its `max_force_n`: epsilon in newtons
    Linf,
}

/// `--force-norm`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum ForceNormArg {
    /// The normal component
    #[default]
    Normal,
    /// The edge of the cone
    Edge,
}

fn cone(text: &str) -> Result<ConeModel, String> {
    if text == "exact" {
        return Ok(ConeModel::Exact);
    }
    let edges: u32 = text.parse().map_err(|_| "give a number of edges or `exact`".to_owned())?;
    ConeModel::edges(edges).map_err(|error| error.to_string())
}

fn named(text: &str) -> Result<NamedConvention, String> {
    NamedConvention::ALL.into_iter().find(|convention| convention.name() == text).ok_or_else(|| {
        let names: Vec<_> = NamedConvention::ALL.iter().map(|convention| convention.name()).collect();
        format!("known are {}", names.join(", "))
    })
}

fn numbers_of<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|number| number.trim().parse()).collect();
    let numbers = numbers.ok().and_then(|numbers| <[f64; N]>::try_from(numbers).ok());
    numbers.ok_or_else(|| format!("give {N} numbers with commas between them"))
}

fn semi_axes(text: &str) -> Result<Box<Task>, String> {
    Task::from_semi_axes(numbers_of(text)?).map(Box::new).map_err(|error| error.to_string())
}

fn disturbance(text: &str) -> Result<Disturbance, String> {
    let [fx, fy, fz, tx, ty, tz] = numbers_of(text)?;
    Disturbance::new(Vector3::new(fx, fy, fz), Vector3::new(tx, ty, tz)).map_err(|error| error.to_string())
}

fn tolerance(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(gap @ 0.0..=1.0) => Ok(gap),
        _ => Err("give a number from 0 to 1".to_owned()),
    }
}

impl QualityArgs {
    fn settings(&self) -> Settings {
        Settings {
            cone: self.edges,
            norm: match self.norm {
                NormArg::L1 => Norm::L1,
                NormArg::Linf => Norm::LInf,
            },
            force_norm: match self.force_norm {
                ForceNormArg::Normal => ForceNorm::Normal,
                ForceNormArg::Edge => ForceNorm::Edge,
            },
            tolerance: self.tolerance,
            ..Settings::default()
        }
    }
}

/// Reads the contacts, measures, and prints to `out`. [`Outcome::No`] when the grasp is not, or not certainly,
/// force-closed; with `--resist` or a task, when it does not resist the wrench or the ellipsoid at all.
pub fn run(args: &QualityArgs, out: &mut dyn Write) -> anyhow::Result<Outcome> {
    if args.schema {
        write_json(out, &GraspDocument::schema())?;
        return Ok(Outcome::Done);
    }
    let grasp = (|| Ok::<_, anyhow::Error>(GraspDocument::from_json(&read(&args.path)?)?))()
        .with_context(|| format!("reading contacts from {}", args.path.display()))?;
    if let Some(convention) = args.convention {
        ensure!(grasp.task.is_none(), "{}: a task has no --convention", args.path.display());
        return run_named(convention, &grasp, args, out);
    }
    let settings = args.settings();
    let mut workspace = Workspace::new();
    let found = evaluate(&grasp.contacts, &grasp.reference, &settings, &mut workspace);
    let resistance = args.resist.map(|disturbance| {
        let found = resist(&grasp.contacts, &grasp.reference, &settings, &disturbance, &mut workspace);
        let forces = match &found {
            Resistance::Balanced(balance) | Resistance::Unfinished(balance) => {
                balance.contact_forces(&grasp.contacts, &grasp.reference, &settings)
            }
            Resistance::None(_) => Vec::new(),
        };
        (found, forces)
    });
    let task = args.ellipsoid.as_deref().copied().or(grasp.task).map(|task| {
        let limits = Limits::default();
        evaluate_task(&grasp.contacts, &grasp.reference, &settings, &task, &limits, &mut workspace)
    });
    if args.json {
        let mut document = QualityDocument::new(&found, &settings, &grasp.reference);
        if let Some((found, forces)) = &resistance {
            document = document.with_resistance(found, forces);
        }
        if let Some(found) = &task {
            document = document.with_task(found);
        }
        writeln!(out, "{}", serde_json::to_string(&document)?)?;
    } else {
        if let Some(found) = &task {
            print_task(found, settings.norm, out)?;
        }
        if let Some((found, forces)) = &resistance {
            print_resistance(found, forces, settings.norm, out)?;
        }
        print(&found, &Convention::of(&settings, &grasp.reference), out)?;
    }
    let is_resisted = resistance.as_ref().map(|(found, _)| match found {
        Resistance::Balanced(balance) | Resistance::Unfinished(balance) => balance.factor_low > 0.0,
        Resistance::None(_) => false,
    });
    let is_withstood = task.as_ref().map(|found| found.quality().is_some());
    let is_held = match (is_resisted, is_withstood) {
        (None, None) => found.quality().is_some(),
        (resisted, withstood) => resisted.unwrap_or(true) && withstood.unwrap_or(true),
    };
    Ok(if is_held { Outcome::Done } else { Outcome::No })
}

fn print_task(found: &TaskClosure, norm: Norm, out: &mut dyn Write) -> std::io::Result<()> {
    let effort = match norm {
        Norm::L1 => "for each newton of summed normal force",
        Norm::LInf => "within each finger's limit",
    };
    match (found, found.quality()) {
        (_, Some(q)) => {
            writeln!(
                out,
                "withstands {} times the ellipsoid (at most {}) {effort}",
                q.scale_low, q.scale_high
            )
        }
        (TaskClosure::None { direction, .. }, _) => {
            let direction = numbers(direction.as_slice());
            writeln!(out, "withstands nothing of the ellipsoid: nothing is to spare along {direction}")
        }
        _ => writeln!(out, "undecided how much of the ellipsoid is withstood; the search gave up"),
    }
}

fn print_resistance(
    found: &Resistance,
    forces: &[ContactForce],
    norm: Norm,
    out: &mut dyn Write,
) -> std::io::Result<()> {
    let effort = match norm {
        Norm::L1 => "with normal forces that sum to 1 N",
        Norm::LInf => "within each finger's limit",
    };
    match found {
        Resistance::None(unbalanced) => {
            let direction = numbers(unbalanced.direction.as_slice());
            return writeln!(out, "the wrench is not resisted: nothing is exerted along {direction}");
        }
        Resistance::Unfinished(Balance { factor_low, factor_high, .. }) if *factor_low == 0.0 => {
            return writeln!(
                out,
                "undecided: the wrench is resisted at most {factor_high} times; the search gave up"
            );
        }
        Resistance::Balanced(Balance { factor_low, factor_high, .. })
        | Resistance::Unfinished(Balance { factor_low, factor_high, .. }) => {
            writeln!(out, "resists the wrench {factor_low} times (at most {factor_high}) {effort}, by")?;
        }
    }
    for (index, ContactForce { force_n, torsion_nm }) in forces.iter().enumerate() {
        let force = numbers(force_n.as_slice());
        writeln!(out, "  contact {index}: force {force} N, moment about the normal {torsion_nm:.6} N m")?;
    }
    Ok(())
}

/// Measures as another program does.
fn run_named(
    convention: NamedConvention,
    grasp: &GraspDocument,
    args: &QualityArgs,
    out: &mut dyn Write,
) -> anyhow::Result<Outcome> {
    let mut workspace = Workspace::new();
    let yardstick = Yardstick::new(convention, &grasp.object, args.tolerance, &mut workspace)
        .with_context(|| format!("measuring {}", args.path.display()))?;
    let found = yardstick
        .measure(&grasp.contacts, &mut workspace)
        .with_context(|| format!("measuring {}", args.path.display()))?;
    if args.json {
        let document = QualityDocument::of_reproduction(&found, &yardstick.settings());
        writeln!(out, "{}", serde_json::to_string(&document)?)?;
    } else {
        match found.score {
            Score::Between { low, high } => {
                writeln!(out, "{convention} says {low} (between {low} and {high})")?
            }
            Score::WithoutClosure(score) => writeln!(out, "{convention} says {score}")?,
            Score::NotReproduced => writeln!(out, "what {convention} says is not reproduced")?,
        }
        print(&found.closure, &found.convention, out)?;
        writeln!(out, "not reproduced: {}", convention.not_reproduced())?;
    }
    Ok(if found.closure.quality().is_some() { Outcome::Done } else { Outcome::No })
}

fn read(path: &Path) -> anyhow::Result<String> {
    let source: Box<dyn Read> = if path == Path::new("-") {
        Box::new(std::io::stdin())
    } else {
        Box::new(std::fs::File::open(path)?)
    };
    let mut text = String::new();
    source.take(MAX_BYTES + 1).read_to_string(&mut text)?;
    ensure!(text.len() as u64 <= MAX_BYTES, "more than {MAX_BYTES} bytes");
    Ok(text)
}

fn print(found: &Closure, convention: &Convention, out: &mut dyn Write) -> std::io::Result<()> {
    let unit = match convention.norm {
        Norm::L1 => "",
        Norm::LInf => " N",
    };
    let bracket = |q: &Quality| {
        format!("epsilon {}{unit} (between {} and {})", q.epsilon(), q.epsilon_low, q.epsilon_high)
    };
    match found {
        Closure::Force(quality) => {
            writeln!(out, "force closure, {}", bracket(quality))?;
            writeln!(out, "weakest wrench: {}", numbers(quality.weakest_wrench.as_slice()))?;
        }
        Closure::None(Separation { direction, margin, reason, .. }) => {
            writeln!(out, "no force closure: {reason}")?;
            writeln!(out, "nothing is exerted along {} (margin {margin})", numbers(direction.as_slice()))?;
        }
        Closure::Below(quality) | Closure::Above(quality) | Closure::Unfinished(quality)
            if quality.epsilon_low > 0.0 =>
        {
            writeln!(out, "force closure, {}; the search gave up before the tolerance", bracket(quality))?;
        }
        Closure::Below(quality) | Closure::Above(quality) | Closure::Unfinished(quality) => {
            let high = quality.epsilon_high;
            writeln!(out, "undecided: epsilon is at most {high}{unit}; the search gave up")?;
        }
    }
    writeln!(out, "convention: {convention}")
}

fn numbers(values: &[f64]) -> String {
    let texts: Vec<String> = values.iter().map(|value| format!("{value:.6}")).collect();
    format!("[{}]", texts.join(", "))
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Cli {
        #[command(flatten)]
        quality: QualityArgs,
    }

    const SIX_AXES: &str = r#"{"contacts":[
        {"point":[1,0,0],"normal":[-1,0,0],"friction":0.4}, {"point":[-1,0,0],"normal":[1,0,0],"friction":0.4},
        {"point":[0,1,0],"normal":[0,-1,0],"friction":0.4}, {"point":[0,-1,0],"normal":[0,1,0],"friction":0.4},
        {"point":[0,0,1],"normal":[0,0,-1],"friction":0.4}, {"point":[0,0,-1],"normal":[0,0,1],"friction":0.4}],
        "center_of_mass":[0,0,0],"torque_scale_m":1}"#;

    const PINCH: &str = r#"{"contacts":[{"point":[1,0,0],"normal":[-1,0,0],"friction":0.4},
        {"point":[-1,0,0],"normal":[1,0,0],"friction":0.4}]}"#;

    fn run_on(text: &str, options: &[&str]) -> anyhow::Result<(Outcome, String)> {
        let file = tempfile::NamedTempFile::new()?;
        std::fs::write(file.path(), text)?;
        let path = file.path().to_string_lossy().into_owned();
        let words = ["quality", path.as_str()].into_iter().chain(options.iter().copied());
        let mut out = Vec::new();
        let outcome = run(&Cli::try_parse_from(words)?.quality, &mut out)?;
        Ok((outcome, String::from_utf8(out)?))
    }

    #[test]
    fn json_carries_the_number_and_its_convention() {
        let (outcome, text) = run_on(SIX_AXES, &["--json", "--edges", "8"]).unwrap();
        let json: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!((outcome, &json["closure"]), (Outcome::Done, &true.into()));
        for key in ["epsilon", "epsilon_low", "epsilon_high"] {
            assert!((json[key].as_f64().unwrap() - 0.326598632).abs() < 1e-6, "{text}");
        }
        assert_eq!(json["convention"]["edges"], 8);
        assert_eq!(json["convention"]["norm"], "l1");
        assert_eq!(json["convention"]["force_norm"], "normal");
        assert_eq!(json["convention"]["torque_scale_m"], 1.0);
        assert_eq!(json["weakest_wrench"].as_array().unwrap().len(), 6);
        assert!(json.get("separating_direction").is_none());
    }

    #[test]
    fn no_closure_is_an_honest_no() {
        let (outcome, text) = run_on(PINCH, &["--json"]).unwrap();
        let json: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!((outcome, &json["closure"]), (Outcome::No, &false.into()));
        assert_eq!(json["reason"], "flat");
        assert_eq!(json["separating_direction"].as_array().unwrap().len(), 6);
        assert!(json.get("epsilon").is_none());
        let (outcome, text) = run_on(PINCH, &["--norm", "linf"]).unwrap();
        assert_eq!(outcome, Outcome::No);
        assert!(text.starts_with("no force closure") && text.contains("exact cone"), "{text}");
    }

    #[test]
    fn text_names_the_unit() {
        let (_, text) =
            run_on(SIX_AXES, &["--norm", "linf", "--force-norm", "edge", "--tolerance", "0.01"]).unwrap();
        assert!(text.contains(" N (between") && text.contains("unit edge force"), "{text}");
    }

    #[test]
    fn mistakes_are_named() {
        let failed = |text: &str, options: &[&str]| format!("{:#}", run_on(text, options).unwrap_err());
        assert!(failed(r#"{"contacts":[],"mass":1}"#, &[]).contains("unknown field `mass`"));
        assert!(failed(PINCH, &["--edges", "2"]).contains("2 edges"));
        assert!(failed(PINCH, &["--edges", "many"]).contains("many"));
        assert!(failed(PINCH, &["--tolerance", "-1"]).contains("-1"));
        assert!(failed(PINCH, &["--tolerance", "NaN"]).contains("from 0 to 1"));
        let missing = Cli::try_parse_from(["quality", "/nowhere/at/all.json"]).unwrap();
        let error = run(&missing.quality, &mut Vec::new()).unwrap_err();
        assert!(format!("{error:#}").contains("/nowhere/at/all.json"));
    }
}
