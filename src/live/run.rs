//! `hoof run`: starts and ends recorder, driver and controller as processes, in order, and writes one log.

use super::controller::prepare;
use super::process::{Line, Process};
use super::run_file::Simulation;
use super::screen::Screen;
use super::stop::END_TIMEOUT;
use super::{Length, Shared, Stop, refuse_a_second};
use crate::{Outcome, say, say_json};
use anyhow::{Context, bail};
use controller::params::Params;
use drivers::Scenario;
use drivers::components::{EXTERNAL, Runs, build};
use lcmtypes::bus::{Bus, LcmBus};
use lcmtypes::{Event, Message, channels};
use replay::udpm::Url;
use serde_json::{Map, Value, json};
use signal_hook::consts::SIGINT;
use std::ffi::{OsStr, OsString};
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

/// Longest wait for an event between two checks of the processes.
const POLL: Duration = Duration::from_millis(50);
/// Time for which driver and recorder continue after the controller has died, so that the log shows the reaction of the robot.
const AFTERMATH: Duration = Duration::from_secs(1);

/// Start recorder, driver and controller as processes over LCM, and leave one log
///
/// Shows the state of the processes and the events of the run. Ctrl-C ends the processes in order: the controller, after a standing robot has sat
/// down, then driver and recorder. A second Ctrl-C damps the joints at once. SIGTERM and SIGHUP (terminal closed) act as Ctrl-C; after the death of
/// `hoof run` the controller lets the robot sit down and the other processes end after it. A simulated run without --ticks or --seconds lasts as long
/// as its scenario; then a standing robot sits down. With `operator = false` in `[simulation]` it lasts until it is stopped.
///
/// If the recorder dies, the robot continues. If the driver dies, the controller damps and waits for another one (`hoof driver RUN_FILE`).
///
/// Exit code 1 if a process failed: the robot fell, the run ended in DAMPING by a fault (`controller.fault` of --json), or another run was active.
///
/// The log of an earlier run is kept under another name: run.mcap becomes run.1.mcap, or the next free number.
#[derive(clap::Args)]
#[command(
    after_help = "Example: hoof run runs/hyq_sim.toml --seconds 10\n         hoof replay logs/runs/hyq_sim.mcap\n\n\
    The run file: robot, log, set, hardware, faults; [simulation] scenario, operator; [lcm] url; [[controller]] name, start; [[component]] name, kind, set, period_ticks, phase_ticks, latency_ticks, runs, joints, receives; \
    [[operator]] channel, priority, timeout_s; [executor] period_us, phase_us; [realtime] priority, core, lock_memory, stay_awake. See runs/hyq_sim.toml."
)]
pub struct RunArgs {
    #[command(flatten)]
    shared: Shared,
    #[command(flatten)]
    length: Length,
    /// Log file [default: that of the run file]
    #[arg(long, value_name = "FILE")]
    log: Option<PathBuf>,
}

pub fn run(args: &RunArgs) -> anyhow::Result<Outcome> {
    let (file, url) = args.shared.load()?;
    let stop = Stop::new(args.shared.parent)?;
    let log = args.log.as_ref().unwrap_or(&file.log);
    // Checked before the recorder starts: a run that cannot start neither writes nor renames a log.
    if file.simulation.is_some() {
        refuse_a_second("driver", channels::ROBOT_STATE, &url)?;
    }
    let (info, _) = prepare(&file, &url)?;
    controller::load(&info).with_context(|| file.robot.clone())?;
    let others = info.components.iter().enumerate().skip(1).filter(|(_, component)| component.kind != EXTERNAL);
    others.map(|(index, _)| build(&info, index)).try_for_each(|component| component.map(drop))?;
    if let Some(folder) = log.parent() {
        std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    }
    let gaits = Params::from_toml(info.params(), &file.robot)?.gait;
    let load = |simulation: &Simulation| Scenario::load(&simulation.scenario, &gaits);
    let scenario = file.simulation.as_ref().map(load).transpose()?;
    let screen = Screen::new(log.clone());
    let mut network = LcmBus::open(&url.to_string())?;
    network.subscribe(channels::EVENT)?;
    if screen.is_visible() {
        network.subscribe(&format!("{}|{}", channels::CONTROLLER_TICK, channels::ROBOT_STATE))?;
    }

    let (lines_in, lines) = channel();
    let mut run = Running { processes: Vec::new(), lines_in, lines, screen, ending: false, network_failed: false };
    let of_run = |url: &Url| -> [OsString; 4] {
        ["--lcm-url".into(), url.to_string().into(), "--parent".into(), std::process::id().to_string().into()]
    };
    // The receive buffer of the run file is for control; the recorder has its own, larger one.
    let of_recorder = of_run(&Url { recv_buf_size: None, ..url.clone() });
    let record = [&["log".into(), "record".into(), log.into()], &of_recorder[..]].concat();
    run.start("recorder", "recording", &record, &stop)?;
    let mut common = [&[args.shared.run_file.clone().into()], &of_run(&url)[..]].concat();
    if let Some(scenario) = &args.shared.scenario {
        common.extend(["--scenario".into(), scenario.into()]);
    }
    if file.simulation.is_some() {
        run.start("driver", "driving", &[&["driver".into()], &common[..]].concat(), &stop)?;
    }
    // Before the controller, so that they receive the input of the first tick.
    for entry in file.others().iter().filter(|entry| entry.runs == Runs::Process && entry.kind != EXTERNAL) {
        let name: &'static str = entry.name.clone().leak();
        let file = [args.shared.run_file.clone().into(), name.into()];
        let arguments = [&["component".into()], &file[..], &of_run(&url)[..]].concat();
        run.start(name, "computing", &arguments, &stop)?;
    }
    // A person's commands have no end: only a run with the scenario's operator ends with the scenario.
    let has_script = file.simulation.as_ref().is_some_and(|simulation| simulation.operator);
    common.extend(args.length.arguments(scenario.as_ref().filter(|_| has_script)));
    run.start("controller", "controlling", &[&["controller".into()], &common[..]].concat(), &stop)?;

    run.watch(&mut network, &stop)?;
    let controller = run.of("controller");
    let died = !controller.is_good() && !controller.lost_data() && !stop.is_due();
    if died {
        let end = Instant::now() + AFTERMATH;
        while Instant::now() < end && !stop.is_due() {
            run.update(&mut network)?;
        }
    }
    run.end(&mut network, &stop)?;
    run.screen.show_rest();
    let Running { processes, screen, .. } = run;
    drop(screen);
    report(args, log, &processes)
}

fn report(args: &RunArgs, log: &std::path::Path, processes: &[Process]) -> anyhow::Result<Outcome> {
    if args.shared.json {
        let mut value = Map::from_iter([("log".to_owned(), json!(log))]);
        value.extend(processes.iter().map(|process| (process.name.to_owned(), process.json())));
        say_json(&Value::Object(value))?;
    } else {
        say(format!("log: {}", log.display()))?;
    }
    let bad = processes.iter().any(|process| !process.is_good() && !process.lost_data());
    let lossy = processes.iter().any(Process::lost_data);
    Ok(match (bad, lossy) {
        (true, _) => Outcome::Failed,
        (false, true) => Outcome::DataLoss,
        _ => Outcome::Good,
    })
}

/// The processes of a run, in the order of their start.
struct Running {
    processes: Vec<Process>,
    lines_in: Sender<Line>,
    lines: Receiver<Line>,
    screen: Screen,
    /// The processes are being ended: their ends are expected.
    ending: bool,
    /// A failure of the network has been shown.
    network_failed: bool,
}

impl Running {
    /// Starts a process and waits until it is ready: a line on standard error that starts with `ready`.
    fn start(&mut self, name: &'static str, ready: &str, arguments: &[OsString], stop: &Stop) -> anyhow::Result<()> {
        let mut arguments: Vec<&OsStr> = arguments.iter().map(AsRef::as_ref).collect();
        arguments.push("--json".as_ref());
        let mut process = Process::start(name, &arguments, self.lines_in.clone())?;
        self.screen.add(&process);
        let mut lines = Vec::new();
        loop {
            if let Ok(line) = self.lines.recv_timeout(POLL) {
                let is_ready = line.process == name && line.text.starts_with(ready);
                self.screen.line(&line);
                if is_ready {
                    break;
                }
                lines.push(line.text);
            } else if process.status()?.is_some() {
                // What it wrote between the last look and its end.
                lines.extend(self.lines.try_iter().filter(|line| line.process == name).map(|line| line.text));
                let error = lines.last().map_or("ended at once", |text| text.trim_start_matches("error: "));
                bail!("{name}: {error}");
            }
            if stop.is_due() {
                bail!("stopped before the {name} was ready");
            }
        }
        self.processes.push(process);
        Ok(())
    }

    fn of(&self, name: &str) -> &Process {
        self.processes.iter().find(|process| process.name == name).expect("all processes have been started")
    }

    /// Waits until the controller has ended or a stop is requested.
    fn watch(&mut self, network: &mut dyn Bus, stop: &Stop) -> anyhow::Result<()> {
        loop {
            self.update(network)?;
            let controller = self.processes.last_mut().expect("it was started last");
            if controller.status()?.is_some() || stop.is_due() {
                return Ok(());
            }
        }
    }

    /// Shows what has happened since the last call.
    fn update(&mut self, network: &mut dyn Bus) -> anyhow::Result<()> {
        let mut wait = POLL;
        if self.screen.is_visible() {
            // Ticks and states arrive all the time: one poll per interval is enough.
            std::thread::sleep(POLL);
            wait = Duration::ZERO;
        }
        // A screen without events is no reason to end the robot's run.
        let messages = network.handle(wait).unwrap_or_else(|error| {
            if !std::mem::replace(&mut self.network_failed, true) {
                self.screen.say(&format!("no events are shown from now on: the network of the run: {error}"));
            }
            std::thread::sleep(wait);
            Vec::new()
        });
        for message in messages {
            match &*message.channel {
                channels::CONTROLLER_TICK => self.screen.tick(&message.data),
                channels::ROBOT_STATE => self.screen.state(),
                _ => {
                    if let Ok(event) = Event::decode(&message.data) {
                        self.screen.event(&event);
                    }
                }
            }
        }
        self.screen.show_suppressed();
        while let Ok(line) = self.lines.try_recv() {
            self.screen.line(&line);
        }
        let had_ended: Vec<bool> = self.processes.iter().map(Process::has_ended).collect();
        let (mut running, mut ended) = (Vec::new(), Vec::new());
        for process in &mut self.processes {
            let is_running = process.status()?.is_none();
            if is_running { &mut running } else { &mut ended }.push(process.name);
        }
        for ((process, place), had_ended) in self.processes.iter_mut().zip(0..).zip(had_ended) {
            let status = process.status()?;
            if let (Some(status), false, false) = (status, had_ended, self.ending) {
                let consequence = consequence(process, &running, &ended);
                self.screen.say(&format!("{} ended, {status}{consequence}", process.name));
            }
            self.screen.show(place, process, status);
        }
        Ok(())
    }

    /// Ends the processes in reverse order: the controller first, the recorder last. A second request ends each at once.
    fn end(&mut self, network: &mut dyn Bus, stop: &Stop) -> anyhow::Result<()> {
        self.ending = true;
        for place in (0..self.processes.len()).rev() {
            let mut requested = Instant::now();
            self.processes[place].request_end(stop.take_signal().unwrap_or(SIGINT))?;
            while self.processes[place].status()?.is_none() {
                self.update(network)?;
                if let Some(signal) = stop.take_signal() {
                    self.processes[place].request_end(signal)?;
                }
                if requested.elapsed() > END_TIMEOUT {
                    self.screen.say(&format!(
                        "{} did not end within {} s: killed",
                        self.processes[place].name,
                        END_TIMEOUT.as_secs()
                    ));
                    self.processes[place].kill()?;
                    requested = Instant::now();
                }
            }
            self.update(network)?;
        }
        Ok(())
    }
}

/// Consequence for the run of a process that has ended by itself, with the names of the processes that are running and that have ended.
fn consequence(process: &Process, running: &[&str], ended: &[&str]) -> &'static str {
    match process.name {
        "recorder" if running.contains(&"controller") => ": the run continues without a log",
        "driver" if running.contains(&"controller") => {
            ": the controller damps and waits for another driver (hoof driver RUN_FILE)"
        }
        "recorder" | "driver" => "",
        _ if process.is_good() => "",
        name if name != "controller" && running.contains(&"controller") => {
            ": the controller damps the joints that this component commands"
        }
        _ if process.lost_data() => ": messages were lost, see its result",
        // A robot's own driver is not a process of the run.
        _ if ended.contains(&"driver") => ": no driver is running that could damp the joints",
        _ => ": the driver damps the joints when commands time out",
    }
}
