//! `prehend plan --server`: the same plan, made somewhere else.

use std::io::Write;
use std::time::Instant;

use anyhow::{Context, ensure};
use clap::ValueEnum;
use serde_json::json;

use super::hand_file::HandChoice;
use super::plan::{ArmChoice, PlanArgs, Strategy, TableChoice};
use super::progress::bar;
use super::{Outcome, input, write_json};
use crate::io::{Unit, read_file, write_atomically};
use crate::object::BuiltIn;
use crate::plan::document::PlanDocument;
use crate::serve::client::Client;
use crate::surface::Pick;

/// Reads `--server`.
pub(super) fn address(text: &str) -> Result<String, String> {
    let wanted = || "give http://HOST:PORT".to_owned();
    let (scheme, authority) = text.split_once("://").ok_or_else(wanted)?;
    if scheme == "https" {
        return Err("give http://HOST:PORT; the service has no encryption, a tunnel has".to_owned());
    }
    let authority = authority.trim_end_matches('/');
    let is_authority = !authority.is_empty()
        && authority.bytes().all(|byte| byte.is_ascii_alphanumeric() || b".-_:[]".contains(&byte));
    if scheme == "http" && is_authority { Ok(format!("http://{authority}")) } else { Err(wanted()) }
}

/// Runs the command by way of the service at `url`.
pub(super) fn run(args: &PlanArgs, url: &str, out: &mut dyn Write) -> anyhow::Result<Outcome> {
    let start = Instant::now();
    let options = options(args)?;
    let is_built_in = BuiltIn::ALL.iter().any(|b| b.name() == args.input);
    let file = if is_built_in { None } else { Some(read_file(args.input.as_ref())?) };
    let client = Client::new(url);
    let taken = client.submit(&options, file.as_deref())?;
    drop(file);
    input::warn(&args.input, &taken.warnings);
    let progress = bar(0, "waiting");
    let done = client.follow(&taken.id, &mut |status| {
        progress.set_message(status.stage.clone().unwrap_or_default());
        progress.set_length(status.attempts_asked as u64);
        progress.set_position(status.attempts as u64);
    })?;
    progress.finish_and_clear();
    let plan = client.plan(&taken.id)?;
    // What the service sends is believed as little as a file would be.
    let document: PlanDocument =
        serde_json::from_slice(&plan).with_context(|| format!("{url}: what it sends is no plan"))?;
    document.check().with_context(|| format!("{url}: what it sends is no plan"))?;
    if args.output.as_os_str() == "-" {
        out.write_all(&plan)?;
    } else {
        write_atomically(&args.output, |writer| writer.write_all(&plan))?;
        if args.json {
            let mut summary = done.summary.unwrap_or_default();
            summary["seconds"]["total"] = json!(start.elapsed().as_secs_f64());
            write_json(out, &summary)?;
        } else {
            for line in &done.text {
                writeln!(out, "{line}")?;
            }
            writeln!(
                out,
                "wrote {} in {:.2} s, planned by {url}",
                args.output.display(),
                start.elapsed().as_secs_f64()
            )?;
        }
    }
    Ok(if document.grasps.is_empty() { Outcome::No } else { Outcome::Done })
}

/// The arguments as options of the service. Errors for those that name files of this machine.
pub(super) fn options(args: &PlanArgs) -> anyhow::Result<Vec<(String, String)>> {
    let files = "a service plans for the built-in hand and arm: leave out --server, or the file";
    let is_built_in_hand = args.hand.hand == HandChoice::HitDlr
        && args.hand.hand_config.is_none()
        && args.hand.package_path.is_empty();
    ensure!(is_built_in_hand, "--hand: {files}");
    let arm = match &args.arm {
        ArmChoice::Rx60 => "rx60",
        ArmChoice::None => "none",
        ArmChoice::File(_) => anyhow::bail!("--arm: {files}"),
    };
    let list = |numbers: &[f64]| numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(",");
    let place = args.place.to_possible_value().map(|value| value.get_name().to_owned());
    let pick = match &args.pick {
        Pick::Largest => "largest".to_owned(),
        Pick::Nearest => "nearest".to_owned(),
        Pick::Whole => "whole".to_owned(),
        Pick::Number(index) => (index + 1).to_string(),
        Pick::At(point) => list(point.coords.as_slice()),
    };
    let table = match args.table {
        TableChoice::At(height_m) => height_m.to_string(),
        TableChoice::None => "none".to_owned(),
    };
    let unit = match args.unit {
        Unit::Metre => "m",
        Unit::Millimetre => "mm",
    };
    let is_built_in = BuiltIn::ALL.iter().any(|b| b.name() == args.input);
    let named = if is_built_in { "object" } else { "name" };
    let given = [
        (named, Some(args.input.clone())),
        ("strategy", Some(Strategy::name(args.strategy).to_owned())),
        ("attempts", args.attempts.map(|n| n.to_string())),
        ("threshold", Some(args.threshold.to_string())),
        ("friction", Some(args.friction.to_string())),
        ("mass", args.mass.map(|kg| kg.to_string())),
        ("candidates", (!args.candidates.is_empty()).then(|| args.candidates.join(","))),
        ("arm", Some(arm.to_owned())),
        ("start", args.start.map(|degrees| list(&degrees))),
        ("table", Some(table)),
        ("place", place),
        ("up", args.up.map(|up| list(&up))),
        ("pick", Some(pick)),
        ("top", Some(args.top.to_string())),
        ("all", args.all.then(|| "true".to_owned())),
        ("seed", Some(args.seed.to_string())),
        ("unit", Some(unit.to_owned())),
    ];
    Ok(given.into_iter().filter_map(|(key, value)| Some((key.to_owned(), value?))).collect())
}
