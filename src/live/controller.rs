//! `hoof controller`: the controller as a real-time process on LCM.

use super::run_file::{Hardware, RunFile};
use super::{Length, Shared, Stop, refuse_a_second};
use crate::robot::read;
use crate::run_info;
use crate::{Outcome, note, say, say_json};
use anyhow::{Context, bail};
use controller::model::JointKind;
use controller::params::Params;
use controller::quadruped::params::GaitParams;
use drivers::Scenario;
use drivers::command_mux::CommandMux;
use drivers::live::{self, Dummy, EndCause, Executor, Faulty, LcmRobot, Plan, Summary};
use drivers::run_info::{Run, describe};
use lcmtypes::bus::LcmBus;
use lcmtypes::{RunInfo, channels, enum_names};
use replay::udpm::Url;
use serde_json::json;
use std::path::Path;
use std::time::{Duration, Instant};

/// Time between two checks of the main thread for the end of the run.
const POLL: Duration = Duration::from_millis(20);

/// Run the controller in real time against a driver on LCM
///
/// A real-time thread wakes by the absolute clock, takes the newest ROBOT_STATE, steps the controller and sends ROBOT_COMMAND. A second thread
/// publishes all other messages. Real-time settings that the system refuses (scheduler, locked memory, ...) are reported, and the run continues
/// without them. On Ctrl-C or at the end of --seconds a standing robot sits down; a second Ctrl-C, or the end of --ticks, damps the joints at once.
/// Exit code 1 if the run ended in DAMPING by a fault, a controller panicked or was stopped, or another run was active; 3 if messages were lost.
#[derive(clap::Args)]
#[command(after_help = "Example: hoof controller runs/hyq_sim.toml --seconds 60")]
pub struct ControllerArgs {
    #[command(flatten)]
    shared: Shared,
    #[command(flatten)]
    length: Length,
}

pub fn run(args: &ControllerArgs) -> anyhow::Result<Outcome> {
    let (file, url) = args.shared.load()?;
    let stop = Stop::new(args.shared.parent)?;
    let (info, hardware) = prepare(&file, &url)?;
    let schedule = file.executor.schedule();
    let joints = info.joints.clone();
    let executor = Executor::start(Plan {
        component: controller::load(&info).with_context(|| file.robot.clone())?,
        others: file.others().to_vec(),
        receives: file.receives().to_vec(),
        controllers: file.controllers.iter().map(|controller| (controller.name.clone(), controller.start)).collect(),
        hardware,
        bus: Box::new(LcmBus::open(&url.to_string())?),
        operators: CommandMux::new(file.operator.clone())?,
        info,
        schedule,
        ticks: args.length.ticks,
        realtime: file.realtime.clone(),
    })?;
    for refused in &executor.granted().refused {
        note(format!("warning: {refused}"));
    }
    note(format!("controlling {} on {url}: {}", file.robot, executor.granted().held_text()));
    let begin = Instant::now();
    let is_over = || args.length.seconds.is_some_and(|length| begin.elapsed() >= length);
    while !stop.is_due() && !executor.is_finished() && !is_over() {
        std::thread::sleep(POLL);
    }
    // A standing robot sits down; a second signal ends the run at once.
    executor.sit_down(stop.cause().unwrap_or(EndCause::Length));
    stop.take_signal();
    while stop.take_signal().is_none() && !executor.is_finished() {
        std::thread::sleep(POLL);
    }
    report(&executor.finish(), &joints, args.shared.json)
}

/// Description of a run.
pub(super) fn prepare_info(file: &RunFile) -> anyhow::Result<RunInfo> {
    let (files, params_text) = file.robot_files()?;
    let params = Params::from_toml(&params_text, &file.robot)?;
    let (mut scenario, mut scenario_name, mut objects, mut seed) = (String::new(), String::new(), Vec::new(), 0);
    if let Some(simulation) = &file.simulation {
        scenario = read(&simulation.scenario)?;
        let parsed = Scenario::parse(&scenario, &simulation.scenario.display().to_string(), &params.gait)?;
        (scenario_name, objects, seed) = (parsed.name, parsed.objects, parsed.seed);
    }
    let first = file.first();
    let others = file.resolve_others()?;
    Ok(describe(
        &Run {
            first: (&first.0, &first.1),
            others: &others,
            robot: &params.robot.name,
            urdf: &files.urdf,
            params: &params_text,
            scenario: (&scenario_name, &scenario),
            objects: &objects,
            seed,
        },
        &run_info::build(),
    ))
}

/// Description and hardware of a run.
pub(super) fn prepare(file: &RunFile, url: &Url) -> anyhow::Result<(RunInfo, Box<dyn live::Hardware>)> {
    let info = prepare_info(file)?;
    let (files, params_text) = file.robot_files()?;
    let params = Params::from_toml(&params_text, &file.robot)?;
    let tree = files.tree()?;
    let joints = tree.joints.iter().filter(|joint| joint.kind != JointKind::Fixed);
    let joints: Vec<String> = joints.map(|joint| joint.name.clone()).collect();
    let hardware: Box<dyn live::Hardware> = match file.hardware {
        Hardware::Lcm => {
            refuse_a_second("controller", channels::ROBOT_COMMAND, url)?;
            Box::new(LcmRobot::open(url)?)
        }
        Hardware::Dummy => {
            let posture = |name: &String| params.robot.posture.get(name).copied().unwrap_or_default();
            Box::new(Dummy::new(joints.iter().map(posture).collect()))
        }
    };
    let hardware = match &file.faults {
        Some(path) => faulty(hardware, path, &joints, &params.gait).with_context(|| path.display().to_string())?,
        None => hardware,
    };
    Ok((info, hardware))
}

/// The hardware with the faults of a scenario.
fn faulty(
    hardware: Box<dyn live::Hardware>,
    path: &Path,
    joints: &[String],
    gaits: &GaitParams,
) -> anyhow::Result<Box<dyn live::Hardware>> {
    let faults = Scenario::load(path, gaits)?.faults;
    if let Some(fault) = faults.iter().find(|fault| !Faulty::supports(&fault.kind)) {
        bail!("fault {} is injected by the simulator: move it to the scenario of [simulation]", fault.kind);
    }
    Ok(Box::new(Faulty::new(hardware, &faults, joints)?))
}

fn report(summary: &Summary, joints: &[String], json: bool) -> anyhow::Result<Outcome> {
    let Summary { realtime, publisher } = summary;
    let fault = publisher.fault.map(|fault| {
        let joint = usize::try_from(fault.index).ok().and_then(|index| joints.get(index));
        (enum_names::fault(fault.code), joint, fault.value)
    });
    if json {
        let fault = fault.map(|(name, joint, value)| json!({ "fault": name, "joint": joint, "value": value }));
        say_json(&json!({
            "ticks": realtime.ticks, "late_ticks": realtime.late, "skipped_ticks": realtime.skipped,
            "not_carried": realtime.not_carried, "commands_unsent": realtime.unsent, "panics": realtime.panics,
            "messages_unpublished": publisher.unpublished, "messages_unreadable": publisher.unreadable,
            "wishes_not_taken": publisher.not_called, "component_ticks_missed": realtime.missed,
            "results_unknown": realtime.unknown_results, "results_not_passed": publisher.not_passed, "overrun_stops": realtime.overrun_stops,
            "second_run": publisher.second_run, "fault": fault,
        }))?;
    } else {
        say(format!("{} ticks, {} late, {} skipped", realtime.ticks, realtime.late, realtime.skipped))?;
        if let Some((name, joint, value)) = fault {
            let joint = joint.map_or(String::new(), |joint| format!(" {joint}"));
            say(format!("ended in DAMPING: {name}:{joint} {value:.3}"))?;
        }
        if realtime.missed > 0 {
            say(format!("{} ticks of components were missed because they were behind", realtime.missed))?;
        }
        if publisher.second_run {
            say("another run was active on this network")?;
        }
        if publisher.unreadable > 0 {
            say(format!("{} received messages could not be decoded", publisher.unreadable))?;
        }
        if summary.is_lossy() {
            say(format!(
                "lost: {} messages (ring full), {} messages (not accepted by LCM), {} commands (not sent)",
                realtime.not_carried, publisher.unpublished, realtime.unsent
            ))?;
        }
    }
    let is_stopped = realtime.panics + realtime.overrun_stops > 0;
    Ok(if is_stopped || publisher.second_run || fault.is_some() {
        Outcome::Failed
    } else if summary.is_lossy() {
        Outcome::DataLoss
    } else {
        Outcome::Good
    })
}
