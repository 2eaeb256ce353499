//! `hoof replay LOG --resim LOG2`: simulates the run again in closed loop, so that the robot responds to the changed controller.

use crate::progress::Progress;
use crate::{Outcome, run_info, say, say_json, sim};
use analysis::table::{Column, Table};
use analysis::{Metrics, Run};
use anyhow::{Context, ensure};
use controller::Unpacked;
use controller::params::Params;
use drivers::Scenario;
use drivers::operator_script::OperatorScript;
use drivers::simulation::Setup;
use lcmtypes::{ControllerInput, Message, OperatorCommand, ParameterRequest, TickInput, channels};
use replay::engine::{Options, Replay};
use replay::log::LogReader;
use std::path::Path;

pub fn run(log: &Path, options: &Options, out: &Path, json: bool) -> anyhow::Result<Outcome> {
    ensure!(options.from_s.is_none(), "--from: not possible with --resim, a simulation starts at tick 0");
    ensure!(options.out.is_none(), "--out: not possible with --resim, which writes its own log");
    let replay = Replay::open(log)?;
    let recorded = replay.info();
    ensure!(
        !recorded.scenario.is_empty(),
        "{}: RUN_INFO contains no scenario; --resim needs the log of a simulation",
        log.display()
    );
    anyhow::ensure!(
        recorded.n_components == 1,
        "{}: the run has {} components; --resim needs the log of a run with one: simulate its run file instead",
        log.display(),
        recorded.n_components
    );
    let gaits = Params::from_toml(recorded.params(), &format!("parameters of {}", log.display()))?.gait;
    let mut scenario = Scenario::parse(&recorded.scenario, &format!("scenario of {}", log.display()), &gaits)?;
    // A live run has monotonic clock times, and operators on several channels.
    let live = recorded.realtime.starts_with("live");
    let Requests { commands, parameters, duration_s, running } = Requests::of(log, live)?;
    scenario.duration_s = options.to_s.map_or(duration_s, |to| to.min(duration_s));
    scenario.seed = recorded.seed;
    scenario.operator = OperatorScript::recorded(commands);
    // A parameter that is set on the command line keeps its value.
    let held = |key: &String| options.set.iter().any(|(set, _)| set == key);
    scenario.parameters = parameters.into_iter().filter(|request| !held(&request.key)).collect();
    let params = controller::params::apply_overrides(recorded.params(), &options.set)?;
    let urdf = options.urdf.clone().unwrap_or_else(|| recorded.urdf.clone());
    let setup = Setup {
        robot: recorded.robot.clone(),
        robot_source: recorded.robot.clone(),
        urdf,
        urdf_source: format!("URDF of {}", log.display()),
        params,
        scenario,
        scenario_text: recorded.scenario.clone(),
        scenario_source: format!("scenario of {}", log.display()),
        inputs: vec![log.to_owned()],
        first: (recorded.component().to_owned(), recorded.controller().to_owned()),
        receives: Vec::new(),
        running,
        others: (Vec::new(), Vec::new()),
        prove: None,
    };
    let bar = Progress::new("simulate again");
    let summary = setup.simulate(out, &run_info::build(), &mut |part| bar.set(part))?;
    drop(bar);
    let same = if live { Some("a live run is not repeated bit for bit".to_owned()) } else { same_run(log, out)? };
    let (before, after) = (metrics(log)?, metrics(out)?);
    if json {
        say_json(&serde_json::json!({
            "log": log, "resim": out, "same_bits": same.is_none(), "first_difference": same,
            "recorded": before, "simulated": after,
        }))?;
    } else {
        let verdict = match &same {
            None => "identical: the simulation repeats the log bit for bit".to_owned(),
            Some(place) => format!("different: the simulation differs from the log: {place}"),
        };
        say(format!("{}\n{verdict}\n\n{}", sim::text(&summary), compared(&before, &after)))?;
    }
    Ok(Outcome::failed_if(summary.failed()))
}

/// The operator commands and parameter requests of a run, and its running controllers; times in ns since its first tick.
struct Requests {
    commands: Vec<OperatorCommand>,
    parameters: Vec<ParameterRequest>,
    duration_s: f64,
    /// One bit for each controller of a sequence.
    running: i64,
}

impl Requests {
    /// Reads a log: commands as the operator sent them or, for a live run, as the controller consumed them.
    ///
    /// # Errors
    /// A log that cannot be read or does not start at tick 0, or in which a controller starts or stops while another one runs. A simulation does not repeat
    /// this. That all are stopped is no error: a live run stops them after a panic or overruns, which a simulation does not have.
    fn of(log: &Path, live: bool) -> anyhow::Result<Self> {
        let (mut commands, mut parameters) = (Vec::<OperatorCommand>::new(), Vec::new());
        let (mut first, mut last_running, mut times, mut unpacked) = (None, None, (0, 0), Unpacked::default());
        for event in LogReader::open(log)?.events() {
            let event = event?;
            let place = || format!("{}: {}, byte {}", log.display(), event.channel, event.offset);
            match &*event.channel {
                channels::OPERATOR_COMMAND if !live => {
                    commands.push(OperatorCommand::decode(&event.data).with_context(place)?);
                }
                channels::PARAMETER_REQUEST => {
                    let request = ParameterRequest::decode(&event.data).with_context(place)?;
                    // A request may be sent several times.
                    if !parameters.contains(&request) {
                        parameters.push(request);
                    }
                }
                channels::CONTROLLER_SNAPSHOT => unpacked.restore(&event.data),
                channels::CONTROLLER_INPUT => {
                    let input = ControllerInput::decode(&event.data).with_context(place)?;
                    let TickInput { t_ns, tick, t_op_ns, ref op, running, .. } = *unpacked.update(&input);
                    times = (times.1, t_ns);
                    first.get_or_insert((tick, t_ns, running));
                    ensure!(
                        last_running.replace(running).is_none_or(|last| running == last || running == 0),
                        "--resim: {}: controllers were started or stopped in tick {tick} (hoof ctl); a simulation runs the same ones from the first tick on",
                        log.display()
                    );
                    // At the end of a run the executor damps the joints with a command of its own, with the time of the tick.
                    let of_executor = op.mode == OperatorCommand::MODE_DAMPING && t_op_ns == t_ns;
                    if live && op.seq >= 0 && !of_executor && commands.last().is_none_or(|last| last.t_ns < t_op_ns) {
                        commands.push(OperatorCommand { t_ns: t_op_ns, ..op.clone() });
                    }
                }
                _ => {}
            }
        }
        let (first_tick, first, running) = first.with_context(|| format!("{}: no CONTROLLER_INPUT", log.display()))?;
        ensure!(
            first_tick == 0,
            "--resim: {} starts at tick {first_tick}, expected tick 0: a simulation starts from the robot's first posture, not from the state in the middle of a run",
            log.display()
        );
        commands.iter_mut().for_each(|command| command.t_ns -= first);
        parameters.iter_mut().for_each(|request| request.t_ns -= first);
        #[expect(clippy::cast_precision_loss, reason = "simulation times are far below 2^53 ns")]
        let duration_s = (times.1 - first + (times.1 - times.0)) as f64 * 1e-9;
        Ok(Requests { commands, parameters, duration_s, running })
    }
}

/// The first message in which two runs differ, except RUN_INFO, EVENT and TIMING.
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
            (None, Some(b)) => return Ok(Some(format!("{} after the end of the log", b.channel))),
        }
    }
}

fn metrics(log: &Path) -> anyhow::Result<Metrics> {
    Ok(Metrics::of(&Run::read(log, &mut |_| {})?))
}

/// Tracking errors of both runs side by side.
fn compared(before: &Metrics, after: &Metrics) -> String {
    let mut table = Table::new([Column::left("rms"), Column::right("recorded"), Column::right("simulated")]);
    let number = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.5}"));
    let (rows, again) = (analysis::tables::tracking_rows(before), analysis::tables::tracking_rows(after));
    for (a, b) in rows.iter().zip(&again) {
        let name = format!("{} [{}]", a.name, a.unit);
        table.row([name, number(a.measured.map(|e| e.rms)), number(b.measured.map(|e| e.rms))]);
    }
    let fell = |metrics: &Metrics| if metrics.safety.fell { "yes" } else { "no" };
    table.row(["fell", fell(before), fell(after)]);
    table.to_string()
}
