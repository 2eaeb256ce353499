//! Live runs with real processes over LCM UDP multicast, each test on its own network.
//!
//! The tests do not depend on the speed of the machine: if a stall makes the controller damp the joints, the log shows it and replays as well.
#![allow(clippy::unwrap_used, missing_docs)]

mod common;
#[path = "../replay/examples/lossy_relay/relay.rs"]
mod relay;

use common::live_process::LiveProcess;
use common::network::url;
use common::{Ran, events, folder, hoof, messages};
use lcmtypes::bus::{Bus, LcmBus};
use lcmtypes::channels::{
    CONTROLLER_INPUT, CONTROLLER_SNAPSHOT, CONTROLLER_TICK, EXPECTED_ROBOT, OPERATOR_COMMAND, REQUEST_REPLY,
    ROBOT_COMMAND, ROBOT_INFO, ROBOT_STATE, RUN_INFO, TIMING,
};
use lcmtypes::{
    ControllerInput, ControllerTick, OperatorCommand, RequestReply, RobotCommand, RobotInfo, RobotState, RunInfo,
    Timing,
};
use relay::{Account, Relay, Shares};
use replay::udpm::{Listener, Packet, Url};
use std::collections::BTreeSet;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// A complete short live run in simulation.
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
    // On a machine that stalls the robot may have fallen, and the driver has exit code 1.
    let ran = ran.exits_as_reported();
    assert_eq!(json["driver"]["exit_code"], i32::from(json["driver"]["fell"] == true), "{}", ran.stderr);
    assert_eq!((&json["controller"]["ticks"], &json["recorder"]["lost"]), (&1500.into(), &0.into()));
    let replay = hoof(&format!("replay --json {}", log.display())).exits(0).json();
    assert_eq!(
        (&replay["identical"], &replay["ticks"], &replay["unverifiable_ticks"]),
        (&true.into(), &1500.into(), &0.into())
    );

    let inputs = controller::Unpacked::all(&messages::<ControllerInput>(&log, CONTROLLER_INPUT));
    assert!(inputs.iter().map(|input| input.tick).eq(0..1500), "a tick is missing");
    let infos: Vec<RunInfo> = messages(&log, RUN_INFO);
    assert_eq!(infos[0].t_ns, inputs[0].t_ns);
    assert!(infos[0].realtime.starts_with("live, every 1000 us, "), "{}", infos[0].realtime);
    let first = events(&log).iter().position(|event| *event.channel == *CONTROLLER_INPUT).unwrap();
    assert!(events(&log)[..first].iter().any(|event| *event.channel == *RUN_INFO), "RUN_INFO is the first message");
}

/// CONTROLLER_INPUT holds states and commands as they were sent, with their time of arrival.
#[test]
fn the_input_holds_the_messages_as_sent() {
    let log = folder("input").join("run.mcap");
    run(2, &log, "--ticks 600");
    let inputs = controller::Unpacked::all(&messages::<ControllerInput>(&log, CONTROLLER_INPUT));
    let states: Vec<RobotState> = messages(&log, ROBOT_STATE);
    let ops: Vec<OperatorCommand> = messages(&log, OPERATOR_COMMAND);
    let with_state = inputs.iter().filter(|input| input.state.nj > 0);
    assert!(with_state.clone().count() > 500);
    for input in with_state {
        assert!(states.contains(&input.state), "tick {}: this state was not sent", input.tick);
    }
    // In the last ticks the executor's request for damping replaces the operator's command.
    let (last, followed) = inputs.split_last_chunk::<20>().map(|(followed, last)| (last, followed)).unwrap();
    assert!(last.iter().all(|input| input.op.mode == OperatorCommand::MODE_DAMPING && input.t_op_ns == input.t_ns));
    let mut newest = 0;
    for input in followed.iter().filter(|input| input.op.seq >= 0) {
        assert!(ops.contains(&input.op), "tick {}: this command was not sent", input.tick);
        // Driver and controller share a clock.
        assert!(input.t_op_ns >= input.op.t_ns, "tick {}: it arrived before it was sent", input.tick);
        newest = newest.max(input.op.seq);
    }
    assert!(newest >= 10, "only {newest} operator commands were consumed");
}

#[test]
fn a_run_ends_in_the_safe_state_and_every_tick_has_a_timing() {
    let log = folder("end").join("run.mcap");
    run(3, &log, "--ticks 400");
    let ticks: Vec<ControllerTick> = messages(&log, CONTROLLER_TICK);
    let commands: Vec<RobotCommand> = messages(&log, ROBOT_COMMAND);
    assert_eq!((ticks.len(), commands.len()), (400, 400));
    assert!(commands[380..].iter().all(|command| command.mode == RobotCommand::MODE_DAMPING));
    assert_eq!(ticks[399].mode, ControllerTick::MODE_DAMPING);
    let timings: Vec<Timing> = messages(&log, TIMING);
    for (timing, tick) in timings.iter().zip(&ticks) {
        let Timing { t_ns, wake_ns, start_ns, end_ns, deadline_ns, ref stage_ns, .. } = *timing;
        assert_eq!((timing.tick, t_ns), (tick.tick, tick.t_ns));
        assert!(deadline_ns - 1_000_000 <= wake_ns && wake_ns <= start_ns && start_ns < end_ns, "{timing:?}");
        assert!(stage_ns.iter().sum::<i64>() <= end_ns - start_ns, "{timing:?}");
        assert_eq!((deadline_ns - 300_000) % 1_000_000, 0, "ticks keep their phase: {timing:?}");
    }
    assert_eq!(timings.len(), 400);
}

/// Relays the datagrams that `passes` selects from one network to another until `over`: drops 3 %, duplicates 1 % and delays 1 %.
fn lossy_relay(from: &str, to: &str, seed: u64, passes: fn(&str) -> bool, over: &AtomicBool) -> Account {
    let [from, to] = [from, to].map(|url| url.parse::<Url>().unwrap());
    let mut listener = Listener::open(&from).unwrap();
    let mut relay = Relay::new(to, Shares { drop: 0.03, duplicate: 0.01, reorder: 0.01 }, seed);
    while !over.load(Ordering::SeqCst) {
        // The receive call times out, so the loop ends.
        let Some(datagram) = listener.receive().unwrap() else { continue };
        if matches!(Packet::parse(datagram.bytes), Ok(Packet::Short(short)) if passes(&short.channel)) {
            relay.datagram(datagram.sender, datagram.bytes).unwrap();
        }
    }
    relay.flush().unwrap();
    relay.account()
}

/// Whether the controller sends a channel to the driver.
fn of_run(channel: &str) -> bool {
    [ROBOT_COMMAND, EXPECTED_ROBOT].contains(&channel)
}

/// Sets the flag when dropped, also if the test fails.
struct SetOnDrop<'a>(&'a AtomicBool);

impl Drop for SetOnDrop<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::SeqCst);
    }
}

/// The driver is on one network, controller and recorder on another. The relay between them loses states and commands.
#[test]
fn a_run_over_a_lossy_network_replays() {
    let log = folder("lossy").join("run.mcap");
    let (robot_side, control_side) = (url(4), url(5));
    let over = AtomicBool::new(false);
    let (states, commands, recorded) = std::thread::scope(|scope| {
        let states = scope.spawn(|| lossy_relay(&robot_side, &control_side, 1, |name| !of_run(name), &over));
        let commands = scope.spawn(|| lossy_relay(&control_side, &robot_side, 2, of_run, &over));
        let over_on_drop = SetOnDrop(&over);
        let mut recorder = LiveProcess::start(&format!("log record {} --json --lcm-url {control_side}", log.display()));
        recorder.wait_for(&["recording udpm://"]);
        let run_file = "runs/hyq_sim.toml --scenario scenarios/short_flat.toml --lcm-url";
        let mut driver = LiveProcess::start(&format!("driver {run_file} {robot_side}"));
        driver.wait_for(&["driving hyq"]);
        // Exit code 1 if the machine stalled: then the state was too old and the robot was damped.
        LiveProcess::start(&format!("controller {run_file} {control_side} --ticks 1500")).end();
        driver.interrupt();
        driver.end();
        recorder.interrupt();
        // Exit code 3: data loss.
        let recorded = recorder.end().exits(3).json();
        drop(over_on_drop);
        (states.join().unwrap(), commands.join().unwrap(), recorded)
    });
    let lost = states.channels[ROBOT_STATE].lost;
    assert!(lost > 20 && commands.channels[ROBOT_COMMAND].lost > 20, "{lost} states lost");
    assert!(recorded["lost"].as_u64().unwrap() > 20, "{recorded}");
    let inputs = controller::Unpacked::all(&messages::<ControllerInput>(&log, CONTROLLER_INPUT));
    let seqs: Vec<i64> = inputs.iter().filter(|input| input.state.nj > 0).map(|input| input.state.seq).collect();
    let again = seqs.windows(2).filter(|two| two[0] == two[1]).count();
    assert!(again > 20, "only {again} ticks without a new state");
    let replay = hoof(&format!("replay --json {}", log.display())).exits(0).json();
    assert_eq!(
        (&replay["identical"], &replay["ticks"], &replay["unverifiable_ticks"]),
        (&true.into(), &1500.into(), &0.into())
    );
}

/// Longest wait for a message; a passing test gets it within milliseconds.
const TIMEOUT: Duration = Duration::from_secs(20);

#[test]
fn a_log_that_begins_during_the_run_replays_from_its_first_snapshot() {
    let log = folder("late").join("run.mcap");
    let url = url(6);
    let mut bus = LcmBus::open(&url).unwrap();
    bus.subscribe(CONTROLLER_TICK).unwrap();
    let run_file = format!("runs/hyq_sim.toml --scenario scenarios/short_flat.toml --lcm-url {url}");
    let mut driver = LiveProcess::start(&format!("driver {run_file}"));
    driver.wait_for(&["driving hyq"]);
    // RUN_INFO is published again after 5 s.
    let controller = LiveProcess::start(&format!("controller {run_file} --ticks 5100"));
    let mut ticks = 0;
    while ticks < 100 {
        let received = bus.handle(TIMEOUT).unwrap();
        assert!(!received.is_empty(), "no tick in {TIMEOUT:?}");
        ticks += received.len();
    }
    // A parameter change before the recorder starts.
    hoof(&format!("set swing.height=0.07 --lcm-url {url}")).exits(0);
    let mut recorder = LiveProcess::start(&format!("log record {} --lcm-url {url}", log.display()));
    recorder.wait_for(&["recording udpm://"]);
    // Exit code 1 if the machine stalled: then the state was too old and the robot was damped.
    controller.end();
    driver.interrupt();
    driver.end();
    recorder.interrupt();
    recorder.end().exits(0);

    let inputs = controller::Unpacked::all(&messages::<ControllerInput>(&log, CONTROLLER_INPUT));
    let (first, last) = (inputs[0].tick, inputs[inputs.len() - 1].tick);
    assert!(first > 100 && inputs.iter().map(|input| input.tick).eq(first..=last));
    // Ticks after the first snapshot are replayed; those before it cannot be.
    let state = events(&log).into_iter().find(|event| *event.channel == *CONTROLLER_SNAPSHOT).unwrap();
    let state = i64::from_be_bytes(*state.data[16..].first_chunk().unwrap());
    let replay = hoof(&format!("replay --json {}", log.display())).exits(0).json();
    assert_eq!(replay["identical"], true);
    assert_eq!((&replay["ticks"], &replay["skipped_ticks"]), (&(last - state).into(), &(state - first + 1).into()));
}

/// A request to a live run.
fn ctl(request: &str, url: &str) -> Ran {
    hoof(&format!("ctl {request} --json --lcm-url {url}"))
}

#[test]
fn controllers_are_started_and_stopped_while_the_robot_stands() {
    let log = folder("ctl").join("run.mcap");
    let url = url(7);
    let mut run = LiveProcess::run(&url, &log, "");
    run.wait_for(&["controller: ", "STANCE"]);
    let started = ctl("start hold", &url).exits(0).json();
    let again = ctl("start hold", &url).exits(1).json();
    let stopped = ctl("stop hold", &url).exits(0).json();
    let unknown = ctl("stop walker", &url).exits(1).json();
    run.interrupt();
    run.end();
    let network = url.split('?').next().unwrap();
    let no_reply = ctl("start hold", &url).exits(2);
    assert!(no_reply.stderr.contains(network), "{}", no_reply.stderr);

    let outcome =
        |json: &serde_json::Value| (json["refused"].as_bool().unwrap(), json["code"].as_str().unwrap().to_owned());
    assert_eq!(outcome(&started), (false, "done".to_owned()));
    assert_eq!(outcome(&again), (true, "wrong_state".to_owned()));
    assert_eq!(outcome(&stopped), (false, "done".to_owned()));
    assert_eq!(outcome(&unknown), (true, "unknown_name".to_owned()));
    assert_eq!([&again["tick"], &unknown["tick"]], [&serde_json::json!(-1); 2]);
    let named = unknown["answer"].as_str().unwrap();
    assert!(["walker", "hold", "quadruped"].iter().all(|name| named.contains(name)), "{named}");

    // It runs from the tick of the first reply up to that of the other, and the log holds all replies.
    let [from, to] = [&started, &stopped].map(|answer| answer["tick"].as_i64().unwrap());
    assert!(from < to);
    let inputs = controller::Unpacked::all(&messages::<ControllerInput>(&log, CONTROLLER_INPUT));
    let both = inputs.iter().filter(|input| input.running == 0b11).map(|input| input.tick);
    assert!(both.eq(from..to));
    let replies: Vec<RequestReply> = messages(&log, REQUEST_REPLY);
    let senders: BTreeSet<i64> = replies.iter().map(|reply| reply.sender_id).collect();
    let operator = messages::<OperatorCommand>(&log, OPERATOR_COMMAND)[0].sender_id;
    assert_eq!((senders.len(), senders.contains(&operator)), (5, true), "four processes, and the scenario's operator");
    let codes: Vec<(i8, i64)> =
        replies.iter().filter(|reply| reply.sender_id != operator).map(|reply| (reply.code, reply.tick)).collect();
    let (done, wrong, unknown) =
        (RequestReply::CODE_DONE, RequestReply::CODE_WRONG_STATE, RequestReply::CODE_UNKNOWN_NAME);
    assert_eq!(codes, [(done, from), (wrong, -1), (done, to), (unknown, -1)]);
    let replay = hoof(&format!("replay --json {}", log.display())).exits(0).json();
    assert_eq!((&replay["identical"], &replay["ticks"]), (&true.into(), &inputs.len().into()));
}

/// A robot that is no quadruped, with `[[robot.imu]]`: driver and run agree on it, and the log replays.
#[test]
fn a_robot_on_wheels_runs_live() {
    let folder = folder("wheels");
    let (log, run_file) = (folder.join("run.mcap"), folder.join("centauro.toml"));
    let scenario = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios/hold.toml");
    let text = format!(
        "robot = \"centauro\"\nlog = {log:?}\n[simulation]\nscenario = {scenario:?}\n[[controller]]\nname = \"hold\"\n"
    );
    std::fs::write(&run_file, text).unwrap();
    let ran = hoof(&format!("run {} --ticks 600 --json --lcm-url {}", run_file.display(), url(17)));
    let json = ran.exits_as_reported().json();
    assert_eq!((&json["controller"]["ticks"], &json["recorder"]["lost"]), (&600.into(), &0.into()));
    let infos: Vec<RunInfo> = messages(&log, RUN_INFO);
    assert_eq!((&infos[0].imus, infos[0].contacts.len()), (&vec!["imu_link".to_owned()], 6));
    let robots: Vec<RobotInfo> = messages(&log, ROBOT_INFO);
    assert_eq!(robots[0].imus, infos[0].imus);
    // The driver applies commands only of a run for its own robot.
    let states: Vec<RobotState> = messages(&log, ROBOT_STATE);
    assert!(states.iter().all(|state| state.n_imus == 1));
    let commands: Vec<RobotCommand> = messages(&log, ROBOT_COMMAND);
    assert!(commands.iter().any(|command| command.mode == RobotCommand::MODE_TORQUE), "the robot never stood up");
    let replay = hoof(&format!("replay --json {}", log.display())).exits(0).json();
    assert_eq!((&replay["identical"], &replay["ticks"]), (&true.into(), &600.into()));
}
