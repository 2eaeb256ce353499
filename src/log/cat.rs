//! `hoof log cat`: prints messages with every field decoded.

use super::{LogTypes, OneRun, Part, loss};
use crate::{Outcome, note};
use anyhow::Context;
use lcm_idl::{Leaf, Value};
use replay::log::{EventRef, EventTimes, Health, LogReader, RunClock, Types, Zero};
use replay::printable::printable_json;
use replay::{printable, printable_path};
use std::fmt::Write as _;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Polling period for a log that is being written.
const POLL: Duration = Duration::from_millis(20);

#[derive(clap::Args)]
#[command(after_help = "Example: hoof log cat run.mcap --channels EVENT\n         \
    hoof log cat run.lcmlog --json --channels ROBOT_STATE --from 10 --to 10.5\n         \
    hoof log cat other.lcmlog --lcm-types ~/other/lcmtypes | head\n         \
    hoof log cat recording.mcap --follow --channels EVENT\n\n\
    A JSON line has the keys t_ns, number, channel, type and fields. A message of unknown type has bytes (hexadecimal) instead of \
        fields. The key deviates names what is wrong in a message that LCM decodes nevertheless. Non-finite numbers are the strings \"NaN\", \"Infinity\" and \"-Infinity\".")]
pub struct Args {
    /// Log to read
    log: PathBuf,
    #[command(flatten)]
    one_run: OneRun,
    #[command(flatten)]
    part: Part,
    /// Wait for further messages, until interrupted or until an MCAP is complete
    #[arg(long, conflicts_with = "run")]
    follow: bool,
    #[command(flatten)]
    types: LogTypes,
    /// Print one JSON object per line and message
    #[arg(long)]
    json: bool,
}

pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let mut types = args.types.read()?;
    let log = args.one_run.of(&args.log);
    let mut reader = if args.follow { follow(&log)? } else { LogReader::open(&log)? };
    let filter = args.part.filter()?;
    if !args.follow {
        args.part.channels.check(&[&log])?;
    }
    let mut filter = filter.for_log(&log)?;
    // JSON lines contain t_ns alone, so they need no time zero.
    let clock = (!args.json).then(|| RunClock::read(&log)).transpose()?;
    // As --from and --to select.
    let mut times = clock.map(EventTimes::new);
    if let Some(zero) = clock.map(|clock| clock.zero()).filter(|zero| *zero != Zero::FirstTick) {
        note(format!("{}: times are s since {}", printable_path(&args.log), zero.text()));
    }
    let mut out = std::io::BufWriter::new(std::io::stdout().lock());
    let (mut health, mut line) = (Health::default(), String::new());
    loop {
        let Some(item) = reader.read()? else {
            if !args.follow || reader.is_complete() {
                break;
            }
            out.flush().context("standard output")?;
            std::thread::sleep(POLL);
            continue;
        };
        let Some(event) = health.note(item) else { continue };
        types.learn(&event);
        let since_ns = times.as_mut().map(|times| times.of(&event));
        if !filter.accepts(&event) {
            continue;
        }
        line.clear();
        match since_ns {
            Some(since_ns) => text_line(&event, since_ns, &types, &mut line),
            None => json_line(&event, &types, &mut line),
        }
        // Text of a foreign log can be anywhere in the line.
        let shown = if args.json { printable_json(&line) } else { printable(&line) };
        writeln!(out, "{shown}").context("standard output")?;
    }
    out.flush().context("standard output")?;
    drop(out);
    for damaged in &health.damaged {
        note(format!(
            "{}: damaged at byte {}, {} bytes: {}",
            printable_path(&args.log),
            damaged.offset,
            damaged.bytes,
            printable(&damaged.why)
        ));
    }
    if let Some(cut) = &health.cut {
        note(format!("{}: cut at byte {}, {} bytes of a record", printable_path(&args.log), cut.offset, cut.bytes));
    }
    Ok(loss(!health.is_good()))
}

/// Opens a log that is being written; waits until it has its first byte.
fn follow(log: &Path) -> anyhow::Result<LogReader> {
    loop {
        match LogReader::open_growing(log) {
            Err(replay::Error::EmptyFile { .. }) => std::thread::sleep(POLL),
            opened => return Ok(opened?),
        }
    }
}

/// Why writing a line cannot fail.
const STRING: &str = "writing to a string does not fail";

fn text_line(event: &EventRef<'_>, since_ns: i64, types: &Types, line: &mut String) {
    let (sign, ns) = (if since_ns < 0 { "-" } else { "" }, since_ns.unsigned_abs());
    let (s, ns) = (ns / 1_000_000_000, ns % 1_000_000_000);
    write!(line, "{sign}{s}.{ns:09} {} ", printable(event.channel)).expect(STRING);
    match types.of_message(event.channel, event.data).map(|ty| ty.decode_opened(event.data)) {
        Some(Ok((value, deviations))) => {
            write!(line, "{value}").expect(STRING);
            if !deviations.is_none() {
                write!(line, " [deviates: {deviations}]").expect(STRING);
            }
        }
        Some(Err(error)) => {
            write!(line, "[{} bytes: {}]", event.data.len(), printable(&error.to_string())).expect(STRING)
        }
        None => {
            let named = event.schema().map_or("of unknown type".into(), |schema| printable(&schema.name));
            write!(line, "[{} bytes {named}]", event.data.len()).expect(STRING);
        }
    }
}

fn json_line(event: &EventRef<'_>, types: &Types, line: &mut String) {
    write!(line, "{{\"t_ns\":{},\"number\":{},\"channel\":", event.t_ns, event.number).expect(STRING);
    json_text(event.channel, line);
    let ty = types.of_message(event.channel, event.data);
    let named = types.name_of(event.channel, event.data);
    let name = named.as_deref().or(event.schema().map(|schema| schema.name.as_str()));
    line.push_str(",\"type\":");
    match name {
        Some(name) => json_text(name, line),
        None => line.push_str("null"),
    }
    match ty.map(|ty| ty.decode_opened(event.data)) {
        Some(Ok((value, deviations))) => {
            line.push_str(",\"fields\":");
            json_value(&value, line);
            if !deviations.is_none() {
                line.push_str(",\"deviates\":");
                json_text(&deviations.to_string(), line);
            }
        }
        other => {
            if let Some(Err(error)) = other {
                line.push_str(",\"error\":");
                json_text(&error.to_string(), line);
            }
            line.push_str(",\"bytes\":\"");
            for byte in event.data {
                write!(line, "{byte:02x}").expect(STRING);
            }
            line.push('"');
        }
    }
    line.push('}');
}

/// Appends a value as JSON, fields in wire order.
fn json_value(value: &Value, line: &mut String) {
    let comma = |line: &mut String, place: usize| {
        if place > 0 {
            line.push(',');
        }
    };
    match value {
        Value::Struct(fields) => {
            line.push('{');
            for (place, (name, value)) in fields.iter().enumerate() {
                comma(line, place);
                json_text(name, line);
                line.push(':');
                json_value(value, line);
            }
            line.push('}');
        }
        Value::Array(items) => {
            line.push('[');
            for (place, item) in items.iter().enumerate() {
                comma(line, place);
                json_value(item, line);
            }
            line.push(']');
        }
        leaf => match leaf.as_leaf() {
            Some(Leaf::String(text)) => json_text(text, line),
            Some(Leaf::Double(v)) if !v.is_finite() => json_text(non_finite(v), line),
            Some(Leaf::Float(v)) if !v.is_finite() => json_text(non_finite(v.into()), line),
            Some(other) => write!(line, "{other}").expect(STRING),
            None => {}
        },
    }
}

fn non_finite(v: f64) -> &'static str {
    match v {
        v if v.is_nan() => "NaN",
        v if v > 0.0 => "Infinity",
        _ => "-Infinity",
    }
}

fn json_text(text: &str, line: &mut String) {
    line.push_str(&serde_json::to_string(text).expect("a string serializes as JSON"));
}
