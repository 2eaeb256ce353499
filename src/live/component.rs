//! `hoof component`: one component of a run in a process of its own.

use super::controller::prepare_info;
use super::{Shared, Stop};
use crate::{Outcome, note, say, say_json};
use anyhow::{Context, bail, ensure};
use drivers::components::{EXTERNAL, Runs, build};
use drivers::live::{ProcessReport, RealtimeParams, run_component};
use lcmtypes::bus::LcmBus;
use serde_json::json;
use std::time::Duration;

/// Real-time priority: below workers and the real-time thread, as the publisher.
const PRIORITY: u8 = 1;

/// Run one component of a run file in this process, over LCM
///
/// It takes its inputs (NAME/CONTROLLER_INPUT) from the controller process and publishes its results (NAME/...). `hoof run` starts it for every component
/// with `runs = "process"`; start it by hand before `hoof controller`, also on another computer of the same network. It must receive every input
/// from the first tick on: if one is lost it ends with exit code 3, and the controller damps the joints that it commands.
#[derive(clap::Args)]
#[command(after_help = "Example: hoof component runs/centauro_components.toml planner")]
pub struct ComponentArgs {
    #[command(flatten)]
    shared: Shared,
    /// Name of the component in the run file
    name: String,
}

pub fn run(args: &ComponentArgs) -> anyhow::Result<Outcome> {
    let (file, url) = args.shared.load()?;
    let stop = Stop::new(args.shared.parent)?;
    let name = &args.name;
    let Some(entry) = file.others().iter().find(|entry| entry.name == *name) else {
        let known: Vec<&str> = file.others().iter().map(|entry| &*entry.name).collect();
        bail!("the run file has no component {name:?} beside the first one; it has: {}", known.join(", "));
    };
    ensure!(
        entry.kind != EXTERNAL && entry.runs == Runs::Process,
        "component {name:?} has runs = {:?}, expected \"process\"",
        entry.runs.name()
    );
    let info = prepare_info(&file)?;
    let index = info.find_component(name).with_context(|| name.clone())?;
    let component = build(&info, index)?;
    let priority = file.realtime.priority.min(PRIORITY);
    let granted = RealtimeParams { priority, ..RealtimeParams::none() }.apply();
    for refused in &granted.refused {
        note(format!("warning: {refused}"));
    }
    let mut bus = LcmBus::open(&url.to_string())?;
    note(format!("computing {name} on {url}"));
    let pause = Duration::from_millis(entry.pause_ms);
    let report = run_component(&mut bus, name, component, pause, &|| stop.is_due())?;
    let ProcessReport { ticks, unpublished, foreign, lost_input } = report;
    if args.shared.json {
        say_json(&json!({
            "ticks": ticks, "messages_unpublished": unpublished, "messages_foreign": foreign, "lost_input": lost_input,
        }))?;
    } else {
        say(format!("{name}: {ticks} ticks"))?;
        if let Some(tick) = lost_input {
            say(format!("ended: the input of tick {tick} did not arrive"))?;
        }
    }
    Ok(if lost_input.is_some() || unpublished > 0 { Outcome::DataLoss } else { Outcome::Good })
}
