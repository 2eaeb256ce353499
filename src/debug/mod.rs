//! `hoof debug`: a log tick by tick in the terminal.

mod events;
mod keys;
mod view;

use crate::progress::Progress;
use crate::robot::overrides;
use crate::{Outcome, replay_log, run_info, say, say_json};
use events::Kind;
use ratatui::Terminal;
use ratatui::backend::TestBackend;
use replay::engine::{Cursor, Moment, Options, Replay};
use std::path::PathBuf;

/// Size of the screen that `--once` prints.
const ONCE: (u16, u16) = (112, 36);

#[derive(clap::Args)]
#[command(after_help = "Example: hoof debug run.mcap\n         hoof debug run.mcap --tick 4812\n         \
    hoof debug run.mcap --once --next qp-failure --json\n\n\
    Keys: → l forward, ← h back, ↑ k and ↓ j by 10 ticks, PgUp PgDn by 100, b back to the recorded state before, s on to the next one,\n\
    n N next and previous event of any kind, t touchdown, f QP failure, m missed deadline, d divergence, e EVENT, g tick number, Home End, q quit")]
pub struct Args {
    /// Log, as for `hoof replay`
    log: PathBuf,
    /// Tick to begin with
    #[arg(long, value_name = "N", conflicts_with = "at")]
    tick: Option<i64>,
    /// Time to begin with, s since the run's first tick
    #[arg(long, value_name = "S")]
    at: Option<f64>,
    /// Go on to the next event of this kind
    #[arg(long, value_enum, value_name = "KIND")]
    next: Option<Kind>,
    /// Change a parameter, as for `hoof replay`
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Print the tick and end
    #[arg(long)]
    once: bool,
    /// Print JSON; needs --once
    #[arg(long, requires = "once")]
    json: bool,
}

pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let replay = Replay::open(&args.log)?;
    let options = Options { set: overrides(&args.set)?, here: Some(run_info::build()), ..Options::default() };
    let bar = Progress::new("read the log");
    let mut cursor = Cursor::open(&replay, &options, &mut |part| bar.set(part))?;
    drop(bar);
    let first = match (args.tick, args.at) {
        (Some(tick), _) => tick,
        (None, Some(at)) => cursor.tick_at(at)?,
        (None, None) => cursor.first_tick(),
    };
    let mut moment = cursor.go_to(first)?;
    if let Some(kind) = args.next {
        let found = events::next(&mut cursor, first, Some(kind), u64::MAX)?;
        let none = || anyhow::anyhow!("{}: no {} behind tick {first}", args.log.display(), kind.name());
        moment = found.ok_or_else(none)?;
    }
    if !args.once {
        keys::interact(&args.log.display().to_string(), replay.info(), &mut cursor, moment)?;
        return Ok(Outcome::Good);
    }
    let events = events::at(&mut cursor, &moment)?;
    if args.json {
        let tree = replay_log::moment_tree(&moment).with("events", events::quantity(&events));
        say_json(&tree)?;
    } else {
        say(once(&args.log.display().to_string(), replay.info(), &cursor, &moment, &events)?)?;
    }
    Ok(Outcome::failed_if(moment.divergence.is_some()))
}

/// The screen as text.
fn once(
    log: &str,
    info: &lcmtypes::RunInfo,
    cursor: &Cursor,
    moment: &Moment,
    events: &[events::Event],
) -> anyhow::Result<String> {
    let mut terminal = Terminal::new(TestBackend::new(ONCE.0, ONCE.1))?;
    let screen = view::Screen { log, info, last_tick: cursor.last_tick(), moment, events, message: "" };
    terminal.draw(|frame| screen.draw(frame))?;
    let buffer = terminal.backend().buffer();
    let row = |y: u16| {
        let cells: String = (0..ONCE.0).filter_map(|x| buffer.cell((x, y))).map(|cell| cell.symbol()).collect();
        cells.trim_end().to_owned()
    };
    Ok((0..ONCE.1).map(row).collect::<Vec<_>>().join("\n").trim_end().to_owned())
}
