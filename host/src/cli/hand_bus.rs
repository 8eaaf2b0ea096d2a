//! `prehend hand info|params|zero|log|monitor`: bring-up of a hand at the end of a line.

use std::io::Write;
use std::path::PathBuf;
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, anyhow, ensure};
use clap::{Args, Subcommand};
use protocol::blackbox::Record;
use protocol::command::Setpoint;
use protocol::fault::Code;
use protocol::ids::JointId;
use protocol::service::{Event, LogRecord, Value};
use protocol::telemetry::{BusTier, DriveState, HandState, JointSet};
use serde_json::json;

use super::{Outcome, input, write_json};
use crate::io::write_atomically;
use crate::link::address::LinkAddress;
use crate::link::client::{HandClient, Parameter};

/// Set-points after which no event is waiting any more: one comes behind every state.
const LOG_CYCLES: usize = 40;

/// What may be asked of a hand that is connected.
#[derive(Debug, Clone, Subcommand)]
pub enum BusCommand {
    /// Who is at the other end: board, versions, schema
    Info(InfoArgs),
    /// Parameters: all, some, or changed
    Params(ParamsArgs),
    /// Take the present readings of the joints' strain gauges as zero
    Zero(ZeroArgs),
    /// Events that nobody has fetched, and the black box
    Log(LogArgs),
    /// State of the hand as it comes, without moving it
    Monitor(MonitorArgs),
}

/// How to get at the hand.
#[derive(Debug, Clone, Args)]
pub struct LinkArgs {
    /// Where the hand is.
    #[arg(
        long,
        value_name = "LINK",
        help = "serial:DEVICE[@BAUD], tcp:HOST:PORT, or qemu[:ELF], which runs the firmware image"
    )]
    pub link: LinkAddress,
    /// Print JSON on standard output
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `hand info`.
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Examples:\n  prehend hand info --link serial:/dev/ttyUSB0\n  prehend hand info --link qemu --json"
)]
pub struct InfoArgs {
    #[command(flatten)]
    link: LinkArgs,
}

/// Arguments of `hand params`.
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Examples:\n  prehend hand params --link qemu\n  prehend hand params bus.hold=12000 torque.gain=0.4 --save --link serial:/dev/ttyUSB0"
)]
pub struct ParamsArgs {
    /// Parameters to show, or to change; all by default
    #[arg(value_name = "NAME[=VALUE]")]
    pub parameters: Vec<String>,
    /// Put all parameters to their defaults first
    #[arg(long)]
    pub defaults: bool,
    /// Then have the hand keep them beyond its power supply
    #[arg(long)]
    pub save: bool,
    #[command(flatten)]
    link: LinkArgs,
}

/// Arguments of `hand zero`.
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Examples:\n  prehend hand zero --link serial:/dev/ttyUSB0\n  prehend hand zero thumb_flexion index_flexion --link tcp:hand.local:5000"
)]
pub struct ZeroArgs {
    /// Joints, as in plans; all by default
    #[arg(value_name = "JOINT")]
    pub joints: Vec<String>,
    #[command(flatten)]
    link: LinkArgs,
}

/// Arguments of `hand log`.
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Examples:\n  prehend hand log --link serial:/dev/ttyUSB0\n  prehend hand log --black-box box.csv --link qemu"
)]
pub struct LogArgs {
    /// Write the black box to this file, as a table
    #[arg(long, value_name = "FILE.csv")]
    pub black_box: Option<PathBuf>,
    #[command(flatten)]
    link: LinkArgs,
}

/// Arguments of `hand monitor`.
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Set-points go to the hand with the control word 0: a hand that had torque lets go.\n\nExamples:\n  prehend hand monitor --link tcp:hand.local:5000 --count 100 --json"
)]
pub struct MonitorArgs {
    /// States to print; for ever by default
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub count: Option<u64>,
    /// States per second
    #[arg(long, value_name = "HZ", default_value_t = 10.0, value_parser = input::positive, allow_negative_numbers = true)]
    pub rate: f64,
    #[command(flatten)]
    link: LinkArgs,
}

/// Runs the command.
pub fn run(command: &BusCommand, out: &mut dyn Write) -> anyhow::Result<Outcome> {
    match command {
        BusCommand::Info(args) => info(&args.link, out),
        BusCommand::Params(args) => params(args, out),
        BusCommand::Zero(args) => zero(args, out),
        BusCommand::Log(args) => log(args, out),
        BusCommand::Monitor(args) => monitor(args, out),
    }
}

impl LinkArgs {
    fn open(&self) -> anyhow::Result<HandClient> {
        Ok(HandClient::new(self.link.open()?))
    }
}

fn info(link: &LinkArgs, out: &mut dyn Write) -> anyhow::Result<Outcome> {
    let info = link.open()?.info()?;
    if link.json {
        let document = json!({
            "firmware": info.firmware,
            "protocol": info.protocol,
            "board": info.board,
            "schema": format!("{:016x}", info.schema),
            "same_schema": info.is_same_schema(),
            "parameters": info.parameters,
        });
        write_json(out, &document)?;
    } else {
        writeln!(out, "board {}, firmware {}, protocol {}", info.board, info.firmware, info.protocol)?;
        let same = if info.is_same_schema() { "as here" } else { "not as here: one end knows more messages" };
        writeln!(out, "schema {:016x}, {same}; {} parameters", info.schema, info.parameters)?;
    }
    Ok(Outcome::Done)
}

fn params(args: &ParamsArgs, out: &mut dyn Write) -> anyhow::Result<Outcome> {
    let mut hand = args.link.open()?;
    let all = hand.parameters()?;
    let find = |name: &str| {
        all.iter().find(|parameter| parameter.name == name).ok_or_else(|| anyhow!("no parameter {name:?}"))
    };
    // All of them are looked at before any is changed.
    let mut changes: Vec<(&Parameter, Value)> = Vec::new();
    let mut shown = Vec::new();
    for text in &args.parameters {
        let (name, value) = text.split_once('=').map_or((&**text, None), |(name, value)| (name, Some(value)));
        let parameter = find(name)?;
        if let Some(value) = value {
            changes.push((parameter, parse(parameter, value)?));
        }
        shown.push(parameter.index);
    }
    if args.defaults {
        hand.default_parameters()?;
    }
    for (parameter, value) in &changes {
        hand.set_parameter(parameter.index, *value).with_context(|| parameter.name.clone())?;
    }
    if args.save {
        hand.save_parameters()?;
    }
    let is_changed = args.defaults || !changes.is_empty();
    let mut now = if is_changed { hand.parameters()? } else { all };
    if !shown.is_empty() {
        now.retain(|parameter| shown.contains(&parameter.index));
    }
    if args.link.json {
        let list = now.iter().map(|parameter| {
            json!({
                "name": parameter.name,
                "unit": parameter.unit,
                "value": number(parameter.value),
                "default": number(parameter.default),
                "min": number(parameter.range[0]),
                "max": number(parameter.range[1]),
            })
        });
        write_json(out, &json!({ "parameters": list.collect::<Vec<_>>() }))?;
    } else {
        for Parameter { name, unit, value, default, range, .. } in &now {
            let [value, default, min, max] = [*value, *default, range[0], range[1]].map(text);
            writeln!(out, "{name:<24} {value:>10} {unit:<10} (default {default}, {min} to {max})")?;
        }
    }
    Ok(Outcome::Done)
}

/// A value of the parameter's type. Whether it is in range the hand says.
fn parse(parameter: &Parameter, text: &str) -> anyhow::Result<Value> {
    let value = match parameter.default {
        Value::F32(_) => text.parse().ok().map(Value::F32),
        Value::U32(_) => text.parse().ok().map(Value::U32),
        Value::Bool(_) => text.parse().ok().map(Value::Bool),
    };
    value.ok_or_else(|| anyhow!("{}: {text:?} is no {}", parameter.name, type_name(parameter.default)))
}

fn type_name(value: Value) -> &'static str {
    match value {
        Value::F32(_) => "number",
        Value::U32(_) => "count",
        Value::Bool(_) => "true or false",
    }
}

fn number(value: Value) -> serde_json::Value {
    match value {
        // By its shortest text, so that 0.4 stays 0.4 in double precision.
        Value::F32(x) => json!(x.to_string().parse::<f64>().unwrap_or(f64::from(x))),
        Value::U32(n) => json!(n),
        Value::Bool(yes) => json!(yes),
    }
}

fn text(value: Value) -> String {
    match value {
        Value::F32(x) => x.to_string(),
        Value::U32(n) => n.to_string(),
        Value::Bool(yes) => yes.to_string(),
    }
}

fn zero(args: &ZeroArgs, out: &mut dyn Write) -> anyhow::Result<Outcome> {
    let mut joints = JointSet::default();
    for name in &args.joints {
        joints = joints.with(JointId::from_name(name).ok_or_else(|| anyhow!("no joint {name:?}"))?);
    }
    if args.joints.is_empty() {
        joints = JointId::ALL.into_iter().fold(joints, JointSet::with);
    }
    args.link.open()?.zero(joints)?;
    let names: Vec<_> =
        JointId::ALL.into_iter().filter(|&joint| joints.contains(joint)).map(JointId::name).collect();
    if args.link.json {
        write_json(out, &json!({ "zeroed": names }))?;
    } else {
        writeln!(out, "zeroed: {}", names.join(", "))?;
    }
    Ok(Outcome::Done)
}

fn log(args: &LogArgs, out: &mut dyn Write) -> anyhow::Result<Outcome> {
    let mut hand = args.link.open()?;
    let mut events = Vec::new();
    for _ in 0..LOG_CYCLES {
        hand.cycle(&Setpoint::default())?;
        events.extend(hand.take_events());
    }
    let black_box = hand.black_box()?;
    let count = black_box.full_rate + black_box.decimated;
    if let Some(path) = &args.black_box {
        ensure!(count > 0, "the black box is empty");
        let records = (0..count).map(|index| hand.record(index)).collect::<Result<Vec<_>, _>>()?;
        write_atomically(path, |file| write_records(file, &records, black_box.full_rate))?;
    }
    if args.link.json {
        let list: Vec<_> =
            events.iter().map(|record| json!({ "t_us": record.t_us, "event": describe(record) })).collect();
        let fault = black_box.first_fault.map(|first| {
            json!({ "number": first.code.0, "text": first.code.text(), "finger": first.finger, "t_us": first.t_us })
        });
        let document = json!({
            "events": list,
            "black_box": { "records": count, "frozen": black_box.frozen, "first_fault": fault },
        });
        write_json(out, &document)?;
    } else {
        for record in &events {
            writeln!(out, "{:>12.6} s  {}", seconds(record.t_us), describe(record))?;
        }
        writeln!(out, "{} event(s); black box: {count} records{}", events.len(), frozen(black_box.frozen))?;
        if let Some(path) = &args.black_box {
            writeln!(out, "wrote {}", path.display())?;
        }
    }
    Ok(Outcome::Done)
}

fn frozen(is_frozen: bool) -> &'static str {
    if is_frozen { ", kept since a fault" } else { "" }
}

fn seconds(t_us: u32) -> f64 {
    f64::from(t_us) * 1e-6
}

fn describe(record: &LogRecord) -> String {
    let code = |code: Code| format!("{} ({})", code.text().unwrap_or("of a newer version"), code.0);
    let drive = |byte: u8| DriveState::from_byte(byte).map_or("?", drive_name);
    match record.event {
        Event::Started => "started".to_owned(),
        Event::Drives { hand, fingers } => {
            format!("drives: hand {}, fingers {}", drive(hand), fingers.map(drive).join(", "))
        }
        Event::Fault(first) => format!("fault: {}", code(first.code)),
        Event::Bus { tier } => format!("bus: {}", BusTier::from_byte(tier).map_or("?", tier_name)),
        Event::Refused(why) => format!("refused a message: {}", code(why)),
        Event::Dropped { events } => format!("{events} event(s) lost"),
        Event::Slip { fingers } => format!("slipping fingers: {fingers:#06b}"),
    }
}

const fn drive_name(state: DriveState) -> &'static str {
    match state {
        DriveState::NotReadyToSwitchOn => "not-ready-to-switch-on",
        DriveState::SwitchOnDisabled => "switch-on-disabled",
        DriveState::ReadyToSwitchOn => "ready-to-switch-on",
        DriveState::SwitchedOn => "switched-on",
        DriveState::OperationEnabled => "operation-enabled",
        DriveState::QuickStopActive => "quick-stop-active",
        DriveState::FaultReactionActive => "fault-reaction-active",
        DriveState::Fault => "fault",
    }
}

const fn tier_name(tier: BusTier) -> &'static str {
    match tier {
        BusTier::Fresh => "fresh",
        BusTier::Late => "late",
        BusTier::Hold => "hold",
        BusTier::Stop => "stop",
    }
}

fn write_records(file: &mut dyn Write, records: &[Record], full_rate: u16) -> std::io::Result<()> {
    write!(file, "rate,t_us,drive,bus,fault")?;
    for what in ["position_rad", "target_rad", "torque_nm", "output_nm"] {
        for joint in JointId::ALL {
            write!(file, ",{}_{what}", joint.name())?;
        }
    }
    writeln!(file)?;
    for (i, record) in records.iter().enumerate() {
        let rate = if i < usize::from(full_rate) { "full" } else { "decimated" };
        let (drive, bus) = (drive_name(record.drive), tier_name(record.bus));
        write!(file, "{rate},{},{drive},{bus},{}", record.t_us, record.fault.0)?;
        let angles = record.position.iter().chain(&record.target).map(|angle| angle.to_rad());
        let torques = record.torque.iter().chain(&record.output).map(|torque| torque.to_nm());
        for number in angles.chain(torques) {
            write!(file, ",{number:.5}")?;
        }
        writeln!(file)?;
    }
    Ok(())
}

fn monitor(args: &MonitorArgs, out: &mut dyn Write) -> anyhow::Result<Outcome> {
    let mut hand = args.link.open()?;
    let period = Duration::from_secs_f64(1.0 / args.rate);
    let mut next = Instant::now();
    let mut left = args.count;
    while left != Some(0) {
        let state = hand.cycle(&Setpoint::default())?;
        if args.link.json {
            writeln!(out, "{}", state_document(&state))?;
        } else {
            print_state(&state, out)?;
        }
        // A reader sees every state as it comes.
        out.flush()?;
        left = left.map(|left| left - 1);
        next += period;
        thread::sleep(next.saturating_duration_since(Instant::now()));
    }
    Ok(Outcome::Done)
}

fn state_document(state: &HandState) -> serde_json::Value {
    let status = &state.status;
    json!({
        "t_us": state.t_us,
        "drive": drive_name(status.drive),
        "fingers": status.fingers.map(drive_name),
        "bus": tier_name(status.bus),
        "fault": status.fault.0,
        "command_age_us": state.command_age_us,
        "refused": state.refused,
        "slipping": status.slipping.bits(),
        "limited": status.limited.bits(),
        "position_rad": state.position.map(|q| q.to_rad()),
        "velocity_rad_per_s": state.velocity.map(|q| q.to_rad_per_s()),
        "torque_nm": state.torque.map(|q| q.to_nm()),
        "tip_force_n": state.tip_wrench.map(|wrench| wrench.force.map(|q| q.to_n())),
        "tip_moment_nm": state.tip_wrench.map(|wrench| wrench.torque.map(|q| q.to_nm())),
    })
}

fn print_state(state: &HandState, out: &mut dyn Write) -> std::io::Result<()> {
    let status = &state.status;
    write!(
        out,
        "{:>11.6} s  {:<18} bus {:<5}",
        seconds(state.t_us),
        drive_name(status.drive),
        tier_name(status.bus)
    )?;
    write!(out, " | degrees")?;
    for angle in state.position {
        write!(out, " {:>6.1}", angle.to_rad().to_degrees())?;
    }
    write!(out, " | N")?;
    for wrench in state.tip_wrench {
        let [x, y, z] = wrench.force.map(|q| q.to_n());
        write!(out, " {:>5.2}", (x * x + y * y + z * z).sqrt())?;
    }
    if status.fault != Code::NONE {
        write!(out, " | fault {}: {}", status.fault.0, status.fault.text().unwrap_or("of a newer version"))?;
    }
    writeln!(out)
}
