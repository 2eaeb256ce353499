//! Live runs as a person starts them: real processes over LCM UDP multicast, each test on a network of its own.
//!
//! Nothing here depends on how fast the machine is: where a stall makes the robot damp its joints, the log says so, and replays all the same.
#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use common::{Ran, events, folder, hoof, messages};
use lcmtypes::channels::{
    CONTROLLER_INPUT, CONTROLLER_TICK, OPERATOR_COMMAND, ROBOT_COMMAND, ROBOT_STATE, RUN_INFO, TIMING,
};
use lcmtypes::{ControllerInput, ControllerTick, OperatorCommand, RobotCommand, RobotState, RunInfo, Timing};
use std::path::Path;

/// A network of its own for each test and process. liblcm hears every group on its port, so it is the port that tells them apart.
fn url(test: u32) -> String {
    format!("udpm://239.255.78.1:{}?ttl=0&recv_buf_size=2000000", 20_000 + std::process::id() % 4000 * 10 + test)
}

/// A short live run in simulation, to its end.
fn run(test: u32, log: &Path, more: &str) -> Ran {
    let (url, log) = (url(test), log.display());
    hoof(&format!(
        "run runs/hyq_sim.toml --scenario scenarios/short_flat.toml --json --lcm-url {url} --log {log} {more}"
    ))
}

#[test]
fn a_live_run_replays_bit_for_bit() {
    let log = folder("run").join("run.mcap");
    let ran = run(1, &log, "--ticks 1500");
    let json = ran.json();
    // On a machine that stalls the robot may have fallen; everything below holds then too.
    assert!(ran.code < 2, "{}", ran.stderr);
    assert_eq!((&json["controller"]["ticks"], &json["recorder"]["lost"]), (&1500.into(), &0.into()));
    let replay = hoof(&format!("replay --json {}", log.display())).exits(0).json();
    assert_eq!(
        (&replay["identical"], &replay["ticks"], &replay["unverifiable_ticks"]),
        (&true.into(), &1500.into(), &0.into())
    );

    let inputs: Vec<ControllerInput> = messages(&log, CONTROLLER_INPUT);
    assert!(inputs.iter().map(|input| input.tick).eq(0..1500), "a tick is missing");
    let infos: Vec<RunInfo> = messages(&log, RUN_INFO);
    assert_eq!(infos[0].t_ns, inputs[0].t_ns);
    assert!(infos[0].realtime.starts_with("live, every 1000 us, "), "{}", infos[0].realtime);
    let first = events(&log).iter().position(|event| *event.channel == *CONTROLLER_INPUT).unwrap();
    assert!(events(&log)[..first].iter().any(|event| *event.channel == *RUN_INFO), "RUN_INFO comes first");
}

/// What the controller says it consumed is what others sent, and when it came.
#[test]
fn the_input_holds_what_came_and_when() {
    let log = folder("input").join("run.mcap");
    run(2, &log, "--ticks 600");
    let inputs: Vec<ControllerInput> = messages(&log, CONTROLLER_INPUT);
    let states: Vec<RobotState> = messages(&log, ROBOT_STATE);
    let ops: Vec<OperatorCommand> = messages(&log, OPERATOR_COMMAND);
    let with_state = inputs.iter().filter(|input| input.state.nj > 0);
    assert!(with_state.clone().count() > 500);
    for input in with_state {
        assert!(states.contains(&input.state), "tick {}: nobody sent this state", input.tick);
    }
    // The last ticks lead to the safe state: the executor asks for it in the operator's place.
    let (last, followed) = inputs.split_last_chunk::<20>().map(|(followed, last)| (last, followed)).unwrap();
    assert!(last.iter().all(|input| input.op.mode == OperatorCommand::MODE_DAMPING && input.t_op_ns == input.t_ns));
    let mut heard = 0;
    for input in followed.iter().filter(|input| input.op.seq >= 0) {
        assert!(ops.contains(&input.op), "tick {}: nobody sent this command", input.tick);
        // Driver and controller share a clock.
        assert!(input.t_op_ns >= input.op.t_ns, "tick {}: it came before it was sent", input.tick);
        heard = heard.max(input.op.seq);
    }
    assert!(heard >= 10, "only {heard} operator commands were followed");
}

#[test]
fn a_run_ends_with_the_safe_state_and_every_tick_has_its_timing() {
    let log = folder("end").join("run.mcap");
    run(3, &log, "--ticks 400");
    let ticks: Vec<ControllerTick> = messages(&log, CONTROLLER_TICK);
    let commands: Vec<RobotCommand> = messages(&log, ROBOT_COMMAND);
    assert_eq!((ticks.len(), commands.len()), (400, 400));
    assert!(commands[380..].iter().all(|command| command.mode == RobotCommand::MODE_DAMPING));
    assert_eq!(ticks[399].mode, ControllerTick::MODE_DAMPING);
    let timings: Vec<Timing> = messages(&log, TIMING);
    for (timing, tick) in timings.iter().zip(&ticks) {
        let Timing { t_ns, wake_ns, start_ns, end_ns, deadline_ns, stage_ns, .. } = *timing;
        assert_eq!((timing.tick, t_ns), (tick.tick, tick.t_ns));
        assert!(deadline_ns - 1_000_000 <= wake_ns && wake_ns <= start_ns && start_ns < end_ns, "{timing:?}");
        assert!(stage_ns.iter().sum::<i64>() <= end_ns - start_ns, "{timing:?}");
        assert_eq!((deadline_ns - 300_000) % 1_000_000, 0, "ticks keep their phase: {timing:?}");
    }
    assert_eq!(timings.len(), 400);
}
