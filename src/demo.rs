//! `hoof demo`: simulate, log, replay bit for bit, report.

use crate::progress::Progress;
use crate::replay_log::threads;
use crate::robot::find_shipped;
use crate::{Outcome, replay_log, report, run_info, say, say_json, sim};
use analysis::tables;
use drivers::simulation::{Components, Job, Setup};
use replay::engine::Options;
use std::path::PathBuf;

#[derive(clap::Args)]
#[command(after_help = "Example: hoof demo --out out/demo\n\nExit code 1 if the robot falls or the replay differs.")]
pub struct Args {
    /// Folder for log and report; created if missing
    #[arg(long, value_name = "DIR", default_value = "out/demo")]
    out: PathBuf,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

const SCENARIO: &str = "scenarios/rough_trot.toml";

pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let scenario = find_shipped(SCENARIO)?;
    let (log, report_dir) = (args.out.join("hyq_rough_trot.mcap"), args.out.join("report"));
    let job = Job {
        robot: "hyq",
        scenario: &scenario,
        seconds: None,
        seed: None,
        preset: None,
        gaits: &[],
        set: &[],
        components: Components::default(),
    };
    let say_unless_json = |text: String| if args.json { Ok(()) } else { say(text) };

    let bar = Progress::new("HyQ trots over stones");
    let summary = Setup::read(&job)?.simulate(&log, &run_info::build(), &mut |fraction| bar.set(fraction))?;
    drop(bar);
    say_unless_json(format!("{}\n", sim::text(&summary)))?;
    let replayed = replay_log::replay(&log, &Options { jobs: threads(), ..Options::default() })?;
    say_unless_json(format!("{}\n", replay_log::text(&replayed, &[])))?;
    let written = report::write(&log, &report_dir)?;
    say_unless_json(tables::tracking_text(&written.metrics))?;
    say_unless_json(format!("log:    {}\nreport: {}", log.display(), written.html.display()))?;
    if args.json {
        say_json(&serde_json::json!({
            "log": log,
            "report": written.html,
            "identical": replayed.identical,
            "ticks": replayed.ticks,
            "fell": summary.fell,
        }))?;
    }
    Ok(Outcome::failed_if(summary.fell || !replayed.identical))
}
