//! `hoof driver`: the simulator in place of a robot, in real time.

use super::{Shared, Stop, refuse_a_second, wait_for_controller};
use crate::{Outcome, note, say, say_json};
use anyhow::{Context, bail};
use controller::params::Params;
use drivers::live::plant::{self, Plant, Summary};
use drivers::live::{JointRange, LcmReceiver, LcmSender, RealtimeParams};
use drivers::robot_info::{imu_links, robot_info, with_sensors};
use drivers::{MujocoSim, Scenario, SimParams, Simulator, Terrain};
use lcmtypes::channels;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Time between two checks of the main thread for the end of the run.
const POLL: Duration = Duration::from_millis(20);
/// Time without a command after which the controller has ended.
const QUIET: Duration = Duration::from_millis(500);

/// Simulate a robot in real time, as its driver process on LCM
///
/// Sends ROBOT_STATE and GROUND_TRUTH every millisecond and applies ROBOT_COMMAND. The scenario starts with the first command. If no command arrives
/// for 15 ms, the joints are damped. Runs until Ctrl-C, SIGTERM or SIGHUP.
#[derive(clap::Args)]
#[command(after_help = "Example: hoof driver runs/hyq_sim.toml --scenario scenarios/rough_trot.toml")]
pub struct DriverArgs {
    #[command(flatten)]
    shared: Shared,
}

pub fn run(args: &DriverArgs) -> anyhow::Result<Outcome> {
    let (file, url) = args.shared.load()?;
    let Some(simulation) = &file.simulation else {
        let file = args.shared.run_file.display();
        bail!("{file}: no [simulation]; the robot's own driver is expected on the network");
    };
    let stop = Stop::new(args.shared.parent)?;
    let (files, params_text) = file.robot_files()?;
    let params = Params::from_toml(&params_text, &file.robot)?;
    let scenario = Scenario::load(&simulation.scenario, &params.gait)?;
    let terrain = Terrain::new(&scenario.terrain, scenario.seed);
    let tree = files.tree()?;
    let mut sim = MujocoSim::new(&tree, &params.robot, terrain, SimParams::of(&scenario))?;
    refuse_a_second("driver", channels::ROBOT_STATE, &url)?;
    let (sender, receiver) = (LcmSender::open(&url)?, LcmReceiver::open(&url)?);
    // One below the controller, so that the physics does not delay the command on a single core.
    let realtime = RealtimeParams { priority: file.realtime.priority.saturating_sub(1), ..file.realtime.clone() };
    let listen = url.clone();
    let stopping = Arc::new(AtomicBool::new(false));
    let stopping_thread = stopping.clone();
    let name = scenario.name.clone();
    let robot = params.robot.description(&tree)?;
    let joints = JointRange::of(&robot.model(&tree)?.joints, &robot.joints, &params);
    let damping = params.safety.damping_of(&robot);
    let info = robot_info(&params.robot.name, &files.urdf, sim.joints(), 0);
    let info = with_sensors(info, &imu_links(&robot), &[]);
    let send_operator = simulation.operator;
    let thread = std::thread::Builder::new().name("real-time".to_owned()).spawn(move || {
        let granted = realtime.apply();
        for refused in &granted.refused {
            note(format!("warning: {refused}"));
        }
        note(format!("driving {} in {name} on {url}: {}", file.robot, granted.held_text()));
        plant::run(
            Plant { scenario: &scenario, send_operator, sim: &mut sim, sender, receiver, info, joints, damping },
            &stopping_thread,
        )
    })?;
    while !stop.is_due() && !thread.is_finished() {
        std::thread::sleep(POLL);
    }
    if stop.is_orphaned() {
        wait_for_controller(&listen, QUIET);
    }
    stopping.store(true, Ordering::Relaxed);
    let summary = thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
    report(&summary.with_context(|| simulation.scenario.display().to_string())?, args.shared.json)
}

fn report(summary: &Summary, json: bool) -> anyhow::Result<Outcome> {
    let Summary { sim_seconds, skipped, watchdog, fell_at_s, refused, unsent } = summary;
    if json {
        say_json(&serde_json::json!({
            "sim_seconds": sim_seconds, "skipped_steps": skipped, "watchdog": watchdog, "fell": fell_at_s.is_some(),
            "fell_at_s": fell_at_s, "commands_refused": refused, "messages_unsent": unsent,
        }))?;
    } else {
        let fell = fell_at_s.map_or("no fall".to_owned(), |t| format!("robot fell at {t:.3} s"));
        say(format!(
            "{sim_seconds:.2} s simulated, {fell}; {skipped} steps skipped, watchdog triggered {watchdog} times"
        ))?;
    }
    Ok(Outcome::failed_if(fell_at_s.is_some()))
}
