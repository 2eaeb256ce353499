//! Live runs as a person starts them: real processes over LCM UDP multicast, each test on a network of its own.
//!
//! Nothing here depends on how fast the machine is: where a stall makes the robot damp its joints, the log says so, and replays all the same.
#![allow(clippy::unwrap_used, missing_docs)]

mod common;
#[path = "../replay/examples/lossy_relay/relay.rs"]
mod relay;

use common::talker::Talker;
use common::{Ran, events, folder, hoof, messages};
use lcmtypes::bus::{Bus, LcmBus};
use lcmtypes::channels::{
    CONTROLLER_INPUT, CONTROLLER_SNAPSHOT, CONTROLLER_TICK, EVENT, OPERATOR_COMMAND, ROBOT_COMMAND, ROBOT_STATE,
    RUN_INFO, TIMING,
};
use lcmtypes::{ControllerInput, ControllerTick, Event, OperatorCommand, RobotCommand, RobotState, RunInfo, Timing};
use relay::{Account, Relay, Shares};
use replay::udpm::{Listener, Packet, Url};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

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

/// Passes datagrams from one network to another until `over`, those of `passes` only: loses three in a hundred, sends one twice and one late.
fn lose_some(from: &str, to: &str, seed: u64, passes: fn(&str) -> bool, over: &AtomicBool) -> Account {
    let [from, to] = [from, to].map(|url| url.parse::<Url>().unwrap());
    let mut listener = Listener::open(&from).unwrap();
    let mut relay = Relay::new(to, Shares { drop: 0.03, duplicate: 0.01, reorder: 0.01 }, seed);
    while !over.load(Ordering::SeqCst) {
        // Waits for a while only, so that it sees the end.
        let Some(datagram) = listener.receive().unwrap() else { continue };
        if matches!(Packet::parse(datagram.bytes), Ok(Packet::Short(short)) if passes(short.channel)) {
            relay.datagram(datagram.sender, datagram.bytes).unwrap();
        }
    }
    relay.flush().unwrap();
    relay.account()
}

/// Says that it is over, also where a test fails.
struct Until<'a>(&'a AtomicBool);

impl Drop for Until<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::SeqCst);
    }
}

/// The driver on one network, controller and recorder on another; what passes between them loses states one way and commands the other.
#[test]
fn what_a_network_loses_does_not_matter_to_a_replay() {
    let log = folder("lossy").join("run.mcap");
    let (robot_side, control_side) = (url(4), url(5));
    let over = AtomicBool::new(false);
    let (states, commands, recorded) = std::thread::scope(|scope| {
        let states = scope.spawn(|| lose_some(&robot_side, &control_side, 1, |name| name != ROBOT_COMMAND, &over));
        let commands = scope.spawn(|| lose_some(&control_side, &robot_side, 2, |name| name == ROBOT_COMMAND, &over));
        let until = Until(&over);
        let mut recorder = Talker::start(&format!("log record {} --json --lcm-url {control_side}", log.display()));
        recorder.hear(&["recording udpm://"]);
        let run_file = "runs/hyq_sim.toml --scenario scenarios/short_flat.toml --lcm-url";
        let mut driver = Talker::start(&format!("driver {run_file} {robot_side}"));
        driver.hear(&["driving hyq"]);
        Talker::start(&format!("controller {run_file} {control_side} --ticks 1500")).end().exits(0);
        driver.interrupt();
        driver.end();
        recorder.interrupt();
        // Done, with data loss.
        let recorded = recorder.end().exits(3).json();
        drop(until);
        (states.join().unwrap(), commands.join().unwrap(), recorded)
    });
    let lost = states.channels[ROBOT_STATE].lost;
    assert!(lost > 20 && commands.channels[ROBOT_COMMAND].lost > 20, "{lost} states lost");
    assert!(recorded["lost"].as_u64().unwrap() > 20, "{recorded}");
    let inputs: Vec<ControllerInput> = messages(&log, CONTROLLER_INPUT);
    let seqs: Vec<i64> = inputs.iter().filter(|input| input.state.nj > 0).map(|input| input.state.seq).collect();
    let again = seqs.windows(2).filter(|two| two[0] == two[1]).count();
    assert!(again > 20, "only {again} ticks had no new state");
    let replay = hoof(&format!("replay --json {}", log.display())).exits(0).json();
    assert_eq!(
        (&replay["identical"], &replay["ticks"], &replay["unverifiable_ticks"]),
        (&true.into(), &1500.into(), &0.into())
    );
}

/// Long enough on a stalled machine; a test that passes never waits for it.
const PATIENCE: Duration = Duration::from_secs(20);

#[test]
fn a_recorder_that_comes_late_leaves_a_log_that_replays_from_the_next_state_on() {
    let log = folder("late").join("run.mcap");
    let url = url(6);
    let mut bus = LcmBus::open(&url).unwrap();
    bus.subscribe(CONTROLLER_TICK).unwrap();
    let run_file = format!("runs/hyq_sim.toml --scenario scenarios/short_flat.toml --lcm-url {url}");
    let mut driver = Talker::start(&format!("driver {run_file}"));
    driver.hear(&["driving hyq"]);
    // What the run is, is said again after 5 s.
    let controller = Talker::start(&format!("controller {run_file} --ticks 5100"));
    let mut ticks = 0;
    while ticks < 100 {
        let heard = bus.handle(PATIENCE).unwrap();
        assert!(!heard.is_empty(), "no tick in {PATIENCE:?}");
        ticks += heard.len();
    }
    // It comes behind a change of parameters, too.
    hoof(&format!("set swing.height=0.07 --lcm-url {url}")).exits(0);
    let mut recorder = Talker::start(&format!("log record {} --lcm-url {url}", log.display()));
    recorder.hear(&["recording udpm://"]);
    controller.end().exits(0);
    driver.interrupt();
    driver.end();
    recorder.interrupt();
    recorder.end().exits(0);

    let inputs: Vec<ControllerInput> = messages(&log, CONTROLLER_INPUT);
    let (first, last) = (inputs[0].tick, inputs[inputs.len() - 1].tick);
    assert!(first > 100 && inputs.iter().map(|input| input.tick).eq(first..=last));
    // From behind the first state on, everything is computed again; before it, nothing can be.
    let state = events(&log).into_iter().find(|event| *event.channel == *CONTROLLER_SNAPSHOT).unwrap();
    let state = i64::from_be_bytes(*state.data[16..].first_chunk().unwrap());
    let replay = hoof(&format!("replay --json {}", log.display())).exits(0).json();
    assert_eq!(replay["identical"], true);
    assert_eq!((&replay["ticks"], &replay["skipped_ticks"]), (&(last - state).into(), &(state - first + 1).into()));
    let said = hoof(&format!("replay {}", log.display())).exits(0).stdout;
    assert!(said.contains(&format!("{} ticks were not computed: the state before them is unknown", state - first + 1)));
}

/// A wish to a live run.
fn ctl(wish: &str, url: &str) -> Ran {
    hoof(&format!("ctl {wish} --json --lcm-url {url}"))
}

#[test]
fn controllers_are_started_and_stopped_while_the_robot_stands() {
    let log = folder("ctl").join("run.mcap");
    let url = url(7);
    let mut run = Talker::run(&url, &log, "");
    run.hear(&["controller is in STANCE"]);
    let started = ctl("start hold", &url).exits(0).json();
    let again = ctl("start hold", &url).exits(1).json();
    let stopped = ctl("stop hold", &url).exits(0).json();
    let unknown = ctl("stop nobody", &url).exits(1).json();
    run.interrupt();
    run.end();
    let silence = ctl("start hold", &url).exits(2);
    assert!(silence.stderr.starts_with("error: nobody answers on udpm://239.255.78.1:"), "{}", silence.stderr);

    assert_eq!((&started["refused"], &started["answer"]), (&false.into(), &"controller hold starts".into()));
    assert_eq!((&again["refused"], &again["answer"]), (&true.into(), &"controller hold is running already".into()));
    assert_eq!((&stopped["refused"], &stopped["answer"]), (&false.into(), &"controller hold stops".into()));
    let text = "no controller \"nobody\" to start or stop: there are hold, quadruped";
    assert_eq!((&unknown["refused"], &unknown["answer"]), (&true.into(), &text.into()));

    // It runs from the tick of one answer up to the tick of the other, and the log holds the answers.
    let [from, to] = [&started, &stopped].map(|answer| answer["tick"].as_i64().unwrap());
    assert!(from < to);
    let inputs: Vec<ControllerInput> = messages(&log, CONTROLLER_INPUT);
    let both = inputs.iter().filter(|input| input.running == 0b11).map(|input| input.tick);
    assert!(both.eq(from..to));
    let answers: Vec<Event> = messages(&log, EVENT);
    let answers =
        answers.iter().filter(|event| event.source == "executor" && event.text.starts_with("controller hold "));
    let answers: Vec<(i64, &str)> = answers.map(|event| (event.tick, &*event.text)).collect();
    assert_eq!(
        answers,
        [(from, "controller hold starts"), (-1, "controller hold is running already"), (to, "controller hold stops")]
    );
    let replay = hoof(&format!("replay --json {}", log.display())).exits(0).json();
    assert_eq!((&replay["identical"], &replay["ticks"]), (&true.into(), &inputs.len().into()));
}
