//! `hoof replay LOG --resim LOG2`: the plant is simulated again, so that the robot answers the changed controller.

use crate::progress::Progress;
use crate::sim::{Setup, simulate_setup};
use crate::{Outcome, say, say_json};
use analysis::{Metrics, Run};
use anyhow::{Context, ensure};
use drivers::Scenario;
use drivers::operator::OperatorScript;
use lcmtypes::{Message, OperatorCommand, channels};
use replay::engine::{Options, Replay};
use replay::log::LogReader;
use std::path::Path;

pub fn run(log: &Path, options: &Options, out: &Path, json: bool) -> anyhow::Result<Outcome> {
    ensure!(options.from_s.is_none(), "--from: a simulation begins at the beginning");
    ensure!(options.out.is_none(), "--out: --resim writes the log of its own run");
    let replay = Replay::open(log)?;
    let recorded = replay.info();
    ensure!(
        !recorded.scenario.is_empty(),
        "{}: RUN_INFO holds no scenario, so there is nothing to simulate (was it a real robot?)",
        log.display()
    );
    ensure!(
        log.canonicalize().ok() != out.canonicalize().ok() || !out.exists(),
        "--resim {}: this is the log itself, expected another file",
        out.display()
    );
    let mut scenario = Scenario::parse(&recorded.scenario, &format!("scenario of {}", log.display()))?;
    let (commands, duration_s) = operator(log)?;
    scenario.duration_s = options.to_s.map_or(duration_s, |to| to.min(duration_s));
    scenario.seed = recorded.seed;
    scenario.operator = OperatorScript::recorded(commands);
    let params = controller::params::apply_overrides(&recorded.params, &options.set)?;
    let urdf = options.urdf.clone().unwrap_or_else(|| recorded.urdf.clone());
    let setup = Setup {
        robot: recorded.robot.clone(),
        called: recorded.robot.clone(),
        urdf,
        urdf_name: format!("URDF of {}", log.display()),
        params,
        scenario,
        scenario_text: recorded.scenario.clone(),
        prove: false,
    };
    let bar = Progress::new("simulate again");
    let summary = simulate_setup(setup, out, &mut |part| bar.set(part))?;
    drop(bar);
    let same = same_run(log, out)?;
    let (before, after) = (metrics(log)?, metrics(out)?);
    if json {
        say_json(&serde_json::json!({
            "log": log, "resim": out, "same_bits": same.is_none(), "first_difference": same,
            "recorded": before, "simulated": after,
        }))?;
    } else {
        let verdict = match &same {
            None => "the simulation repeats the log, bit for bit".to_owned(),
            Some(place) => format!("the simulation departs from the log: {place}"),
        };
        say(format!("{}\n{verdict}\n\n{}", summary.text(), compared(&before, &after)))?;
    }
    Ok(Outcome::failed_if(summary.fell || summary.safe_state.is_some()))
}

/// The commands that the operator sent, and the length of the run, s.
fn operator(log: &Path) -> anyhow::Result<(Vec<OperatorCommand>, f64)> {
    let mut commands = Vec::new();
    let (mut first, mut times) = (None, (0_i64, 0_i64));
    for event in LogReader::open(log)?.events() {
        let event = event?;
        if *event.channel == *channels::OPERATOR_COMMAND {
            let place = || format!("{}: OPERATOR_COMMAND, byte {}", log.display(), event.offset);
            commands.push(OperatorCommand::decode(&event.data).with_context(place)?);
        } else if *event.channel == *channels::CONTROLLER_INPUT
            && let Some(t_ns) = event.data.get(8..16).and_then(|bytes| Some(i64::from_be_bytes(bytes.try_into().ok()?)))
        {
            times = (times.1, t_ns);
            first.get_or_insert(t_ns);
        }
    }
    let first = first.with_context(|| format!("{}: no CONTROLLER_INPUT", log.display()))?;
    #[expect(clippy::cast_precision_loss, reason = "simulation times are far below 2^53 ns")]
    let duration_s = (times.1 - first + (times.1 - times.0)) as f64 * 1e-9;
    Ok((commands, duration_s))
}

/// The first message in which two runs differ; descriptions and wall-clock times do not count.
fn same_run(log: &Path, again: &Path) -> anyhow::Result<Option<String>> {
    let counts = |channel: &str| ![channels::TIMING, channels::RUN_INFO, channels::EVENT].contains(&channel);
    let events = |path: &Path| -> anyhow::Result<_> {
        let own = path.to_owned();
        let counted = move |event: &Result<replay::log::Event, replay::Error>| {
            event.as_ref().map_or(true, |e| counts(&e.channel))
        };
        Ok(LogReader::open(&own)?.events().filter(counted))
    };
    let (mut ours, mut theirs) = (events(log)?, events(again)?);
    loop {
        match (ours.next().transpose()?, theirs.next().transpose()?) {
            (None, None) => return Ok(None),
            (Some(a), Some(b)) if a.channel == b.channel && a.data == b.data => {}
            #[expect(clippy::cast_precision_loss, reason = "a time for a person to read")]
            (Some(a), _) => return Ok(Some(format!("{} at {:.3} s", a.channel, a.t_ns as f64 * 1e-9))),
            (None, Some(b)) => return Ok(Some(format!("{}, which the log has no more", b.channel))),
        }
    }
}

fn metrics(log: &Path) -> anyhow::Result<Metrics> {
    Ok(Metrics::of(&Run::read(log, &mut |_| {})?))
}

/// The tracking of both runs side by side.
fn compared(before: &Metrics, after: &Metrics) -> String {
    let mut text = format!("{:<16} {:>12} {:>12}", "rms", "recorded", "simulated");
    let number = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.5}"));
    let (rows, again) = (analysis::tables::tracking_rows(before), analysis::tables::tracking_rows(after));
    for (a, b) in rows.iter().zip(&again) {
        let name = format!("{} [{}]", a.name, a.unit);
        text += &format!(
            "\n{name:<16} {:>12} {:>12}",
            number(a.measured.map(|e| e.rms)),
            number(b.measured.map(|e| e.rms))
        );
    }
    let fell = |metrics: &Metrics| if metrics.safety.fell { "yes" } else { "no" };
    text + &format!("\n{:<16} {:>12} {:>12}", "fell", fell(before), fell(after))
}
