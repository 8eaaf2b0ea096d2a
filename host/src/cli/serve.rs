//! `prehend serve`: the planner at the end of a line.

use std::future::Future;
use std::io::{self, Write};
use std::net::{SocketAddr, TcpListener};
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::Context;
use clap::{ArgAction, Args, CommandFactory, Parser};

use super::hand_file::HandChoice;
use super::plan::{ArmChoice, Given, Made, PlanArgs, Watch, make};
use super::{Outcome, chain, input, told};
use crate::hand::hit_dlr;
use crate::io::{Loaded, read_geometry_bytes};
use crate::object::BuiltIn;
use crate::plan::scene::Scene;
use crate::serve::{DEFAULT_ADDRESS, Limits, OptionInfo, Page, Product, Reporter, Work};
use crate::view::report::Report;

/// The planner as a service: HTTP, progress as events
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Examples:\n  prehend serve\n  prehend serve --listen 0.0.0.0:7580 --queue 4 --time-limit 60"
)]
pub struct ServeArgs {
    /// Address to listen on. Whoever reaches it may plan: there are no accounts and there is no encryption
    #[arg(long, value_name = "ADDRESS:PORT", default_value = DEFAULT_ADDRESS, value_parser = listening)]
    pub listen: SocketAddr,
    /// Plans that are made at the same time; each uses all cores
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=64), allow_negative_numbers = true)]
    pub jobs: u32,
    /// Plans that may wait besides; the next client is asked to come later
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u32).range(..=10_000), allow_negative_numbers = true)]
    pub queue: u32,
    /// Plans that are kept for their clients
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=100_000), allow_negative_numbers = true)]
    pub keep: u32,
    /// Largest file that is taken, in MB
    #[arg(long, value_name = "MB", default_value_t = 256, value_parser = clap::value_parser!(u32).range(1..=2048), allow_negative_numbers = true)]
    pub max_body: u32,
    /// Longest time of one plan, in seconds
    #[arg(long, value_name = "S", default_value_t = 600.0, value_parser = seconds, allow_negative_numbers = true)]
    pub time_limit: f64,
    /// How long plans in the making may go on when the service is asked to end, in seconds
    #[arg(long, value_name = "S", default_value_t = 30.0, value_parser = seconds, allow_negative_numbers = true)]
    pub grace: f64,
    /// Connections at the same time; those beyond are asked to come later
    #[arg(long, value_name = "N", default_value_t = 512, value_parser = clap::value_parser!(u32).range(1..=10_000), allow_negative_numbers = true)]
    pub connections: u32,
}

fn listening(text: &str) -> Result<SocketAddr, String> {
    text.parse().map_err(|_| format!("give an address with a port, such as {DEFAULT_ADDRESS}"))
}

/// Seconds, of a day at most.
fn seconds(text: &str) -> Result<f64, String> {
    let seconds = input::not_negative(text)?;
    if seconds <= 86_400.0 { Ok(seconds) } else { Err("give 86400 seconds or less".to_owned()) }
}

/// Runs the command: until SIGINT or SIGTERM.
pub fn run(args: &ServeArgs, out: &mut dyn Write) -> anyhow::Result<Outcome> {
    let limits = Limits {
        jobs: args.jobs as usize,
        queue: args.queue as usize,
        kept: args.keep as usize,
        body_bytes: (args.max_body as usize) << 20,
        job_time: Duration::from_secs_f64(args.time_limit),
        grace: Duration::from_secs_f64(args.grace),
        connections: args.connections as usize,
        ..Limits::default()
    };
    let listener = TcpListener::bind(args.listen).with_context(|| format!("listening on {}", args.listen))?;
    let address = listener.local_addr()?;
    // Whoever does not read the log does not end the service.
    let log = |line: &str| drop(writeln!(anstream::stderr(), "{line}"));
    let mut announced = Ok(());
    let ending = async {
        // Before anybody is told that there is something to end.
        let signalled = signal();
        announced = announce(address, out);
        if announced.is_ok() {
            ending(signalled).await;
        }
    };
    crate::serve::run(listener, limits, Planning, log, ending)
        .with_context(|| format!("serving at {address}"))?;
    announced?;
    writeln!(out, "ended")?;
    Ok(Outcome::Done)
}

fn announce(address: SocketAddr, out: &mut dyn Write) -> io::Result<()> {
    writeln!(out, "listening on http://{address}")?;
    if !address.ip().is_loopback() {
        writeln!(out, "whoever reaches this address may plan: see docs/service.md")?;
    }
    out.flush()
}

/// Ready at the first SIGINT or SIGTERM; the second ends the process on the spot.
async fn ending(signalled: impl Future<Output = io::Result<()>>) {
    if signalled.await.is_err() {
        // Without a handler the signals end the process by themselves.
        std::future::pending::<()>().await;
    }
    let second = signal();
    let _ = writeln!(anstream::stderr(), "ending: plans in the making may finish; once more to end at once");
    tokio::spawn(async {
        if second.await.is_ok() {
            std::process::exit(130);
        }
    });
}

#[cfg(unix)]
fn signal() -> impl Future<Output = io::Result<()>> {
    use tokio::signal::unix::{SignalKind, signal};
    // Handlers are set up at once, not when they are waited for.
    let both = signal(SignalKind::interrupt()).and_then(|one| Ok((one, signal(SignalKind::terminate())?)));
    async {
        let (mut interrupt, mut terminate) = both?;
        tokio::select! {
            _ = interrupt.recv() => {}
            _ = terminate.recv() => {}
        }
        Ok(())
    }
}

#[cfg(not(unix))]
fn signal() -> impl Future<Output = io::Result<()>> {
    tokio::signal::ctrl_c()
}

/// Plans as `prehend plan` does, with its options.
struct Planning;

/// Grasps on a page, best first.
const GRASPS_SHOWN: usize = 20;

/// An uploaded file that nobody has named.
const UNNAMED: &str = "upload";

/// Longest name of a file that is taken, bytes.
const MAX_NAME_BYTES: usize = 4096;

/// Arguments of `plan` that are no options here: they are about files of the machine that calls, and its output.
const LOCAL: [&str; 8] =
    ["help", "input", "output", "json", "schema", "server", "hand_config", "package_path"];

/// The arguments of `plan` alone.
#[derive(Parser)]
#[command(name = "plan", disable_help_flag = true)]
struct PlanOnly {
    #[command(flatten)]
    args: PlanArgs,
}

/// Options that were understood.
struct Asked {
    args: PlanArgs,
    /// Whether the object is built in, and no file comes.
    is_built_in: bool,
}

impl Work for Planning {
    type Request = Asked;
    type Job = (PlanArgs, Given);

    fn options(&self) -> Vec<OptionInfo> {
        let names = BuiltIn::ALL.iter().map(|object| object.name().to_owned()).collect();
        let option = |name: &str, description: &str, default: Option<&str>, words| OptionInfo {
            name: name.to_owned(),
            description: description.to_owned(),
            default: default.map(str::to_owned),
            words,
        };
        let mut options = vec![
            option(
                "name",
                "Name of the file that is sent: it stands in the plan and in errors, and its extension decides where \
                 the content does not",
                Some(UNNAMED),
                Vec::new(),
            ),
            option("object", "A built-in object, instead of a file", None, names),
        ];
        let command = PlanOnly::command();
        for argument in
            command.get_arguments().filter(|argument| !LOCAL.contains(&argument.get_id().as_str()))
        {
            let is_flag = matches!(argument.get_action(), ArgAction::SetTrue);
            let mut words: Vec<String> =
                argument.get_possible_values().iter().map(|value| value.get_name().to_owned()).collect();
            let mut default: Option<String> =
                argument.get_default_values().first().map(|value| value.to_string_lossy().into_owned());
            if argument.get_id() == "hand" {
                words = vec![hit_dlr::NAME.to_owned()];
            }
            if is_flag {
                (words, default) = (vec!["true".to_owned(), "false".to_owned()], Some("false".to_owned()));
            }
            let help = match argument.get_id().as_str() {
                // Files of the machine that calls are not looked for on this one.
                "hand" => "Hand to plan for".to_owned(),
                "arm" => "Arm that carries it: rx60, or none to plan for the hand alone".to_owned(),
                _ => argument.get_help().map(ToString::to_string).unwrap_or_default(),
            };
            options.push(option(argument.get_long().unwrap_or_default(), &help, default.as_deref(), words));
        }
        options
    }

    fn request(&self, options: &[(String, String)]) -> Result<Asked, String> {
        let known = self.options();
        let mut call: Vec<String> = ["plan", "-o", "-"].map(str::to_owned).to_vec();
        let (mut name, mut object) = (None, None);
        for (key, value) in options {
            let Some(option) = known.iter().find(|option| option.name == *key) else {
                let names: Vec<&str> = known.iter().map(|option| option.name.as_str()).collect();
                return Err(format!("there is no option '{key}': there are {}", names.join(", ")));
            };
            let slot = match key.as_str() {
                "name" => &mut name,
                "object" => &mut object,
                _ => {
                    match (option.words.iter().any(|word| word == "true"), value.as_str()) {
                        (false, _) => call.push(format!("--{key}={value}")),
                        (true, "true" | "") => call.push(format!("--{key}")),
                        (true, "false") => {}
                        (true, _) => return Err(format!("{key}: give true or false")),
                    }
                    continue;
                }
            };
            if slot.replace(value.clone()).is_some() {
                return Err(format!("{key}: give it once"));
            }
        }
        let is_built_in = object.is_some();
        let input = match (name, object) {
            (Some(_), Some(_)) => return Err("give name for a file, or object for a built-in one".to_owned()),
            (_, Some(object)) if BuiltIn::ALL.iter().all(|built_in| built_in.name() != object) => {
                return Err(crate::object::ObjectError::UnknownName(object).to_string());
            }
            (_, Some(object)) => object,
            (Some(name), None) => checked_name(name)?,
            (None, None) => UNNAMED.to_owned(),
        };
        call.extend(["--".to_owned(), input]);
        let PlanOnly { args } = PlanOnly::try_parse_from(call).map_err(|error| told(&error))?;
        if args.hand.hand != HandChoice::HitDlr {
            return Err(format!(
                "hand: only {} here; plan for files of hands without a service",
                hit_dlr::NAME
            ));
        }
        if matches!(args.arm, ArmChoice::File(_)) {
            return Err("arm: only rx60 or none here; plan for files of arms without a service".to_owned());
        }
        Ok(Asked { args, is_built_in })
    }

    fn needs_body(&self, asked: &Asked) -> bool {
        !asked.is_built_in
    }

    fn read(&self, asked: Asked, body: Vec<u8>) -> Result<(Self::Job, Vec<String>), String> {
        let args = asked.args;
        let loaded = if asked.is_built_in {
            Given::built_in(&args)
                .map_err(|error| chain(&error))?
                .map(|value| Loaded { value, warnings: Vec::new() })
        } else {
            None
        };
        let Loaded { value, warnings } = match loaded {
            Some(built_in) => built_in,
            None => {
                let Loaded { value, warnings } =
                    read_geometry_bytes(&body, Path::new(&args.input), args.unit)
                        .map_err(|error| chain(&error.into()))?;
                Loaded { value: Given::File(value), warnings }
            }
        };
        Ok(((args, value), warnings))
    }

    fn plan(&self, (args, given): Self::Job, reporter: &Reporter) -> Result<Product, String> {
        let start = Instant::now();
        let made = make(&args, given, &Told(reporter), reporter.stop()).map_err(|error| chain(&error))?;
        let document = &made.planned.document;
        let summary = made.summary(&args, start.elapsed().as_secs_f64());
        // What a file of `prehend plan` holds.
        let mut plan = serde_json::to_vec_pretty(document).map_err(|error| error.to_string())?;
        plan.push(b'\n');
        Ok(Product {
            grasps: document.grasps.len(),
            text: String::from_utf8_lossy(&made.text).lines().map(str::to_owned).collect(),
            summary,
            page: Some(page(made)),
            plan,
        })
    }
}

/// Draws the plan when somebody wants to see it. Kept until then: what is drawn, without the scene's tables.
fn page(made: Made) -> (Page, usize) {
    let (document, Scene { hand, arm, mesh, .. }) = (made.planned.document, made.scene);
    let bytes = std::mem::size_of_val(mesh.vertices()) + std::mem::size_of_val(mesh.faces());
    let draw = move || {
        let report = Report {
            document: &document,
            hand: &hand,
            arm: arm.as_ref(),
            mesh: Some(&mesh),
            cloud: None,
            run: None,
            top: GRASPS_SHOWN,
            notes: Vec::new(),
        };
        report.html().map_err(|error| error.to_string())
    };
    (Arc::new(draw), bytes)
}

/// A name that can stand in a line and in a document.
fn checked_name(name: String) -> Result<String, String> {
    if name.is_empty() || name.len() > MAX_NAME_BYTES || name.chars().any(char::is_control) {
        return Err(format!("name: give a name of 1 to {MAX_NAME_BYTES} bytes without control characters"));
    }
    Ok(name)
}

/// Tells the service how far a plan is.
struct Told<'a>(&'a Reporter);

impl Watch for Told<'_> {
    fn stage(&self, name: &'static str) {
        self.0.stage(name);
    }

    fn attempts(&self, so_far: usize, at_most: usize) {
        self.0.attempts(so_far, at_most);
    }
}
