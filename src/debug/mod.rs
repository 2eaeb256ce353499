//! `hoof debug`: steps through a log tick by tick in the terminal.

mod events;
mod keys;
mod layout;
#[cfg(test)]
mod tests;
mod view;

use crate::progress::Progress;
use crate::robot::{check_overrides, overrides};
use crate::{Outcome, replay_log, run_info, say, say_json};
use controller::model::{Base, Model, UrdfTree};
use events::Kind;
use ratatui::Terminal;
use ratatui::backend::TestBackend;
use replay::engine::{Cursor, Options};
use std::path::{Path, PathBuf};
use view::Screen;

/// Time after the last tick that is still part of it, s.
const END_S: f64 = 0.01;
/// Width and height of the screen that `--once` prints.
const ONCE: (u16, u16) = (112, 36);

#[derive(clap::Args)]
#[command(after_help = "Example: hoof debug run.mcap\n         hoof debug run.mcap --tick 4812\n         \
    hoof debug run.mcap --once --next qp-failure --json\n\n\
    Keys: → or l next tick, ← or h previous tick, ↓ or j 10 ticks forward, ↑ or k 10 ticks back, PgDn and PgUp 100 ticks,\n\
    Home and End first and last tick, g go to a tick by its number, b and s previous and next recorded state,\n\
    n and N next and previous event of any kind, t next touchdown, f next QP failure, m next missed deadline,\n\
    d next divergence, e next EVENT or change of mode, q or Esc quit")]
pub struct Args {
    /// Log to step through
    log: PathBuf,
    #[command(flatten)]
    one_run: crate::log::OneRun,
    /// Step through this component of a run with several [default: the first one]
    #[arg(long, value_name = "NAME")]
    component: Option<String>,
    /// Show this tick first
    #[arg(long, value_name = "N", conflicts_with = "at")]
    tick: Option<i64>,
    /// Show the tick at this time first, in s since the run's first tick
    #[arg(long, value_name = "S", value_parser = crate::log::seconds)]
    at: Option<f64>,
    /// Search forward from there for an event of this kind
    #[arg(long, value_enum, value_name = "KIND")]
    next: Option<Kind>,
    /// Replay with a changed parameter (repeatable)
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Print the tick and exit
    #[arg(long)]
    once: bool,
    /// With --once, print every quantity of the tick as JSON
    #[arg(long, requires = "once")]
    json: bool,
}

pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let replay = replay_log::open(&args.one_run.of(&args.log), args.component.as_deref())?;
    check_overrides("--set", replay.info().params(), &args.set)?;
    let options = Options { set: overrides(&args.set)?, here: Some(run_info::build()), ..Options::default() };
    let bar = Progress::new("read the log");
    let mut cursor = Cursor::open(&replay, &options, &mut |part| bar.set(part))?;
    drop(bar);
    let first = match (args.tick, args.at) {
        (Some(tick), _) => tick,
        (None, Some(at)) => tick_at(&mut cursor, &args.log, at)?,
        (None, None) => cursor.first_tick(),
    };
    let mut moment = cursor.go_to(first)?;
    if let Some(kind) = args.next {
        let found = events::next(&mut cursor, first, Some(kind), u64::MAX)?;
        let none = || anyhow::anyhow!("{}: no {} after tick {first}", args.log.display(), kind.name());
        moment = found.ok_or_else(none)?;
    }
    let (log, joints) = (args.log.display().to_string(), joint_names(&replay.info().urdf));
    if !args.once {
        keys::interact(&log, replay.info(), &joints, &mut cursor, moment)?;
        return Ok(Outcome::Good);
    }
    let events = events::at(&mut cursor, &moment)?;
    if args.json {
        let tree = replay_log::moment_tree(&moment).with("events", events::to_value(&events));
        say_json(&tree)?;
    } else {
        let last_tick = cursor.last_tick();
        let screen = Screen {
            log: &log,
            info: replay.info(),
            joints: &joints,
            last_tick,
            moment: &moment,
            events: &events,
            message: "",
        };
        say(printed(&screen, ONCE)?)?;
    }
    Ok(Outcome::failed_if(moment.divergence.is_some()))
}

/// The last tick at or before a time. A time outside the log is an error.
fn tick_at(cursor: &mut Cursor, log: &Path, at: f64) -> anyhow::Result<i64> {
    let tick = cursor.tick_at(at)?;
    let (shown, first, last) = (cursor.go_to(tick)?.since_s, cursor.first_tick(), cursor.last_tick());
    // Not before the first tick, and within a period of the last one.
    let is_inside = (tick > first || at >= shown) && (tick < last || at <= shown + END_S);
    if !is_inside {
        let ends = [first, last].map(|tick| cursor.go_to(tick).map(|moment| moment.since_s));
        let [first_s, last_s] = ends;
        anyhow::bail!("{}: --at {at}: the log has ticks from {:.3} s to {:.3} s", log.display(), first_s?, last_s?);
    }
    Ok(tick)
}

/// Names of the joints of a URDF, in its order; empty if it cannot be read.
fn joint_names(urdf: &str) -> Vec<String> {
    let model = UrdfTree::parse(urdf, "URDF of the log").and_then(|tree| Model::new(&tree, Base::Floating));
    model.map_or_else(|_| Vec::new(), |model| model.joints.into_iter().map(|joint| joint.name).collect())
}

/// A screen as text.
fn printed(screen: &Screen, (width, height): (u16, u16)) -> anyhow::Result<String> {
    let mut terminal = Terminal::new(TestBackend::new(width, height))?;
    terminal.draw(|frame| screen.draw(frame))?;
    let buffer = terminal.backend().buffer();
    let row = |y: u16| {
        let cells: String = (0..width).filter_map(|x| buffer.cell((x, y))).map(|cell| cell.symbol()).collect();
        cells.trim_end().to_owned()
    };
    Ok((0..height).map(row).collect::<Vec<_>>().join("\n").trim_end().to_owned())
}
