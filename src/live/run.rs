//! `hoof run`: recorder, driver and controller as processes, started and ended in their order, and one log.

use super::controller::prepare;
use super::process::{Line, Process};
use super::screen::Screen;
use super::{Length, Shared, Stop, refuse_a_second};
use crate::{Outcome, say, say_json};
use anyhow::{Context, bail};
use drivers::Scenario;
use lcmtypes::bus::{Bus, LcmBus};
use lcmtypes::{Event, Message, channels};
use serde_json::{Map, Value, json};
use std::ffi::{OsStr, OsString};
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

/// How long one look at the processes waits for an event.
const LOOK: Duration = Duration::from_millis(50);
/// How long a process may take to end before it is killed: a robot that sits down takes its time.
const PATIENCE: Duration = Duration::from_secs(25);
/// How long the driver and the recorder go on when the controller has died, so that the log shows what came of it.
const AFTERMATH: Duration = Duration::from_secs(1);

/// Start recorder, driver and controller as processes over LCM, and leave one log
///
/// Shows their state and what happens. Ctrl-C ends them in order: the controller, which lets a robot that stands sit down, then driver and recorder;
/// Ctrl-C a second time damps the joints at once.
/// In simulation a run lasts as long as its scenario, if nothing else is said; then, too, a robot that stands sits down. The robot walks on without its recorder; without its driver the
/// controller damps and waits for one (`hoof driver RUN_FILE`).
///
/// The log of an earlier run is kept: it is moved aside, run.mcap to run.1.mcap or the next number that is free.
#[derive(clap::Args)]
#[command(
    after_help = "Example: hoof run runs/hyq_sim.toml --seconds 10\n         hoof replay logs/runs/hyq_sim.mcap\n\n\
    The run file: robot, log, set, hardware, faults; [simulation] scenario, operator; [lcm] url; [[controller]] name, start; \
    [[operator]] channel, priority, timeout_s; [executor] period_us, phase_us; [realtime] priority, core, lock_memory, stay_awake. See runs/hyq_sim.toml."
)]
pub struct RunArgs {
    #[command(flatten)]
    shared: Shared,
    #[command(flatten)]
    length: Length,
    /// Log, instead of the run file's
    #[arg(long, value_name = "FILE")]
    log: Option<PathBuf>,
}

pub fn run(args: &RunArgs) -> anyhow::Result<Outcome> {
    let (file, url) = args.shared.load()?;
    let stop = Stop::new(&args.shared)?;
    let log = args.log.as_ref().unwrap_or(&file.log);
    // Before the recorder is there: what cannot be run leaves no log and moves none.
    if file.simulation.is_some() {
        refuse_a_second("driver", channels::ROBOT_STATE, &url)?;
    }
    let (info, _) = prepare(&file, &url)?;
    controller::load(&info).with_context(|| file.robot.clone())?;
    if let Some(folder) = log.parent() {
        std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    }
    let scenario = file.simulation.as_ref().map(|simulation| Scenario::load(&simulation.scenario)).transpose()?;
    let screen = Screen::new(log.clone());
    let mut network = LcmBus::open(&url.to_string())?;
    network.subscribe(channels::EVENT)?;
    if screen.is_seen() {
        network.subscribe(&format!("{}|{}", channels::CONTROLLER_TICK, channels::ROBOT_STATE))?;
    }

    let (lines_in, lines) = channel();
    let mut run = Running { processes: Vec::new(), lines_in, lines, screen, ending: false };
    let url = url.to_string();
    let of_run: [OsString; 4] =
        ["--lcm-url".into(), url.into(), "--parent".into(), std::process::id().to_string().into()];
    let record = [OsStr::new("log"), OsStr::new("record"), log.as_os_str()].map(OsString::from);
    run.start("recorder", "recording", &[&record[..], &of_run].concat(), &stop)?;
    let mut common = [&[args.shared.run_file.clone().into()], &of_run[..]].concat();
    if let Some(scenario) = &args.shared.scenario {
        common.extend(["--scenario".into(), scenario.into()]);
    }
    if file.simulation.is_some() {
        run.start("driver", "driving", &[&["driver".into()], &common[..]].concat(), &stop)?;
    }
    common.extend(args.length.arguments(scenario.as_ref()));
    run.start("controller", "controlling", &[&["controller".into()], &common[..]].concat(), &stop)?;

    run.watch(&mut network, &stop)?;
    let controller = run.of("controller");
    let died = !controller.is_good() && !controller.lost_data() && !stop.is_due();
    if died {
        let end = Instant::now() + AFTERMATH;
        while Instant::now() < end && !stop.is_due() {
            run.look(&mut network)?;
        }
    }
    run.end(&mut network, &stop)?;
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

/// The processes of a run, in the order in which they are started.
struct Running {
    processes: Vec<Process>,
    lines_in: Sender<Line>,
    lines: Receiver<Line>,
    screen: Screen,
    /// They are being ended: that one does is no news.
    ending: bool,
}

impl Running {
    /// Starts a process, and waits until it says that it is at work: a line that begins with `ready`.
    fn start(&mut self, name: &'static str, ready: &str, arguments: &[OsString], stop: &Stop) -> anyhow::Result<()> {
        let mut arguments: Vec<&OsStr> = arguments.iter().map(AsRef::as_ref).collect();
        arguments.push("--json".as_ref());
        let mut process = Process::start(name, &arguments, self.lines_in.clone())?;
        self.screen.add(&process);
        let mut said = Vec::new();
        loop {
            if let Ok(line) = self.lines.recv_timeout(LOOK) {
                let is_ready = line.process == name && line.text.starts_with(ready);
                self.screen.line(&line);
                if is_ready {
                    break;
                }
                said.push(line.text);
            } else if process.status()?.is_some() {
                bail!("{name}: {}", said.last().map_or("it ended at once", |text| text.trim_start_matches("error: ")));
            }
            if stop.is_due() {
                bail!("stopped before the {name} was at work");
            }
        }
        self.processes.push(process);
        Ok(())
    }

    fn of(&self, name: &str) -> &Process {
        self.processes.iter().find(|process| process.name == name).expect("all three have been started")
    }

    /// Until the controller has ended, or a stop is asked for.
    fn watch(&mut self, network: &mut dyn Bus, stop: &Stop) -> anyhow::Result<()> {
        loop {
            self.look(network)?;
            let controller = self.processes.last_mut().expect("it was started last");
            if controller.status()?.is_some() || stop.is_due() {
                return Ok(());
            }
        }
    }

    /// Shows what has happened since the last look.
    fn look(&mut self, network: &mut dyn Bus) -> anyhow::Result<()> {
        let mut wait = LOOK;
        if self.screen.is_seen() {
            // Ticks and states come all the time: once a look is enough.
            std::thread::sleep(LOOK);
            wait = Duration::ZERO;
        }
        for message in network.handle(wait).context("the network of the run")? {
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
        while let Ok(line) = self.lines.try_recv() {
            self.screen.line(&line);
        }
        for (process, place) in self.processes.iter_mut().zip(0..) {
            let had_ended = process.has_ended();
            let status = process.status()?;
            if let (Some(status), false, false) = (status, had_ended, self.ending) {
                self.screen.say(&format!("{} ended, {status}{}", process.name, consequence(process)));
            }
            self.screen.show(place, process, status);
        }
        Ok(())
    }

    /// Ends them: who commands first, who listens last. Asking twice hurries.
    fn end(&mut self, network: &mut dyn Bus, stop: &Stop) -> anyhow::Result<()> {
        self.ending = true;
        for place in (0..self.processes.len()).rev() {
            let mut asked = Instant::now();
            stop.forget();
            self.processes[place].ask_to_end()?;
            while self.processes[place].status()?.is_none() {
                self.look(network)?;
                if stop.is_asked() {
                    stop.forget();
                    self.processes[place].ask_to_end()?;
                }
                if asked.elapsed() > PATIENCE {
                    self.screen.say(&format!("{} does not end when asked to: killed", self.processes[place].name));
                    self.processes[place].kill()?;
                    asked = Instant::now();
                }
            }
            self.look(network)?;
        }
        Ok(())
    }
}

/// What it means for the run that a process has ended by itself.
fn consequence(process: &Process) -> &'static str {
    match process.name {
        "recorder" => ": the robot goes on without a log",
        "driver" => ": the controller damps and waits for another one (hoof driver)",
        _ if process.is_good() => "",
        _ if process.lost_data() => ": messages were lost, its report says how many",
        _ => ": the driver damps the robot",
    }
}
