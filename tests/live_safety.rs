//! The robot ends in a safe state when a process of a live run dies: real processes and real signals.
#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use common::live_process::{LiveProcess, assert_controller_ended, kill};
use common::network::url;
use common::{events, folder, hoof, messages, ran};
use drivers::live::EndCause;
use drivers::live::clock::now_ns;
use lcmtypes::bus::{Bus, LcmBus};
use lcmtypes::channels::{
    CONTROLLER_INPUT, CONTROLLER_TICK, EVENT, EXPECTED_ROBOT, ROBOT_COMMAND, ROBOT_INFO, ROBOT_STATE,
};
use lcmtypes::{
    ControllerInput, ControllerTick, Event, Message, OperatorCommand, RobotCommand, RobotInfo, RobotState, enum_names,
};
use serde_json::Value;
use std::path::Path;
use std::process::Command;
use std::time::Duration;
use test_support::replace_once;

/// Asserts that the log replays bit for bit. The log of a killed controller ends with commands whose inputs were not published yet.
fn assert_replays(log: &Path) -> Value {
    let replay = hoof(&format!("replay --json {}", log.display())).json();
    assert_eq!((&replay["identical"], &replay["unverifiable_ticks"]), (&true.into(), &0.into()));
    replay
}

/// Whether an event is an error of the driver: its controller died, or the robot fell.
fn is_driver_error(event: &Event) -> bool {
    event.source == "driver" && event.level == Event::LEVEL_ERROR
}

#[test]
fn a_driver_damps_within_20_steps_after_its_controller_died() {
    let log = folder("controller").join("run.mcap");
    let mut run = LiveProcess::run(&url(1), &log, "");
    let controller = run.process("controller");
    run.wait_for(&["controller: ", "STANCE"]);
    kill("-KILL", &controller);
    run.wait_for(&["ERROR driver: "]);
    let ran = run.end();
    assert!(ran.stderr.contains("controller ended, signal: 9"), "{}", ran.stderr);
    assert_eq!(ran.exits(1).json()["controller"]["signal"], 9);
    assert_replays(&log);

    // Counted in steps, which are longer than a millisecond on a machine that stalls.
    let (mut steps, mut damped) = (0, false);
    for event in events(&log) {
        match &*event.channel {
            ROBOT_COMMAND => steps = 0,
            ROBOT_STATE => steps += 1,
            EVENT if is_driver_error(&Event::decode(&event.data).unwrap()) => {
                assert!((10..=20).contains(&steps), "{steps} steps without a command");
                damped = true;
                break;
            }
            _ => {}
        }
    }
    assert!(damped);
}

#[test]
fn the_controller_damps_after_its_driver_died_and_uses_a_second_driver() {
    let log = folder("driver").join("run.mcap");
    let mut run = LiveProcess::run(&url(2), &log, "--ticks 3000");
    let driver = run.process("driver");
    run.wait_for(&["controller: ", "STANCE"]);
    kill("-KILL", &driver);
    run.wait_for(&["ERROR controller: ", "DAMPING", enum_names::fault(ControllerTick::FAULT_STATE_STALE)]);
    let mut second = LiveProcess::start(&format!("driver runs/hyq_sim.toml --lcm-url {}", url(2)));
    second.wait_for(&["driving hyq"]);
    let ran = run.end();
    assert!(ran.stderr.contains("driver ended, signal: 9"), "{}", ran.stderr);
    second.interrupt();
    // The controller damps until an operator requests IDLE: the second robot sinks down upright, which is not a fall.
    second.end().exits(0);
    assert_eq!(ran.exits(1).json()["controller"]["ticks"], 3000);
    assert_eq!(assert_replays(&log)["ticks"], 3000);

    let ticks: Vec<ControllerTick> = messages(&log, CONTROLLER_TICK);
    let stale = ticks.iter().position(|tick| tick.mode == ControllerTick::MODE_DAMPING).unwrap();
    assert_eq!(ticks[stale].fault, ControllerTick::FAULT_STATE_STALE);
    let commands: Vec<RobotCommand> = messages(&log, ROBOT_COMMAND);
    let inputs = controller::Unpacked::all(&messages::<ControllerInput>(&log, CONTROLLER_INPUT));
    // The first tick with a stale state damps.
    assert_eq!(commands[stale].mode, RobotCommand::MODE_DAMPING);
    assert_eq!(commands[stale - 1].mode, RobotCommand::MODE_TORQUE);
    assert!(inputs[stale].t_ns - inputs[stale].state.t_ns > 10_000_000);
    assert!(
        inputs[stale..].iter().any(|input| input.state.sender_id != inputs[stale].state.sender_id),
        "no state of the second driver"
    );
}

#[test]
fn the_run_continues_without_its_recorder() {
    let log = folder("recorder").join("run.mcap");
    let mut run = LiveProcess::run(&url(3), &log, "--ticks 1500");
    let recorder = run.process("recorder");
    run.wait_for(&["controller: ", "WALK"]);
    kill("-KILL", &recorder);
    let ran = run.end();
    assert!(ran.stderr.contains("recorder ended, signal: 9"), "{}", ran.stderr);
    let json = ran.exits(1).json();
    assert_eq!(json["controller"]["ticks"], 1500);
    assert_controller_ended(&json);
    // The log of a killed recorder is complete up to its cut end.
    let replay = hoof(&format!("replay --json {}", log.display()));
    assert_eq!(replay.json()["identical"], true);
}

#[test]
fn the_run_continues_when_the_disk_is_full() {
    let log = folder("disk").join("run.mcap");
    let hoof = env!("CARGO_BIN_EXE_hoof");
    let line = format!(
        "ulimit -f 600; exec {hoof} run runs/hyq_sim.toml --scenario scenarios/short_flat.toml --json --ticks 2500 --lcm-url '{}' --log {}",
        url(4),
        log.display()
    );
    let ran = ran(Command::new("bash").args(["-c", &line]).current_dir(env!("CARGO_MANIFEST_DIR")).output().unwrap());
    let json = ran.json();
    assert_eq!(json["controller"]["ticks"], 2500, "{}", ran.stderr);
    assert_controller_ended(&json);
    assert!(json["recorder"]["failure"].is_string() && json["recorder"]["exit_code"] == 3, "{json}");
    assert!(std::fs::metadata(&log).unwrap().len() <= 600 * 1024);
}

#[test]
fn ctrl_c_lets_the_robot_sit_down_and_completes_the_log() {
    let log = folder("interrupt").join("run.mcap");
    let mut run = LiveProcess::run(&url(5), &log, "--ticks 30000");
    run.process("controller");
    run.wait_for(&["controller: ", "STANCE"]);
    run.interrupt();
    let ran = run.end();
    let json = ran.json();
    assert_controller_ended(&json);
    assert_eq!(json["recorder"]["exit_code"], 0, "{json}");
    assert_replays(&log);
    let ticks: Vec<ControllerTick> = messages(&log, CONTROLLER_TICK);
    let last = ticks.last().unwrap().mode;
    // On a machine that stalls the controller may have damped the robot instead.
    assert!([ControllerTick::MODE_IDLE, ControllerTick::MODE_DAMPING].contains(&last), "{last}");
    let had = |mode: i8| ticks.iter().any(|tick| tick.mode == mode);
    let sat = had(ControllerTick::MODE_SIT) && last == ControllerTick::MODE_IDLE;
    assert!(sat || had(ControllerTick::MODE_DAMPING), "{}", ran.stderr);
    // For the driver the controller has ended, not died: no error after the last command. A stall of the machine may cause one before it.
    let events = events(&log);
    let after_last = events.iter().rev().take_while(|event| *event.channel != *ROBOT_COMMAND);
    let errors =
        after_last.filter(|event| *event.channel == *EVENT && is_driver_error(&Event::decode(&event.data).unwrap()));
    assert!(errors.count() <= usize::from(json["driver"]["fell"] == true), "{}", ran.stderr);
}

#[test]
fn ctrl_c_twice_damps_at_once() {
    let log = folder("twice").join("run.mcap");
    let mut run = LiveProcess::run(&url(8), &log, "--ticks 30000");
    run.process("controller");
    run.wait_for(&["controller: ", "STANCE"]);
    run.interrupt();
    run.wait_for(&["controller: ", "SIT"]);
    run.interrupt();
    let ran = run.end();
    assert_controller_ended(&ran.json());
    assert_replays(&log);
    let commands: Vec<RobotCommand> = messages(&log, ROBOT_COMMAND);
    assert!(commands.iter().rev().take(20).all(|command| command.mode == RobotCommand::MODE_DAMPING));
}

/// The executor's request to sit down replaces the operator's command, except for an emergency stop.
#[test]
fn an_emergency_stop_is_followed_while_the_robot_sits_down() {
    let log = folder("stop").join("run.mcap");
    let mut run = LiveProcess::run(&url(0), &log, "--ticks 30000");
    run.process("controller");
    run.wait_for(&["controller: ", "STANCE"]);
    run.interrupt();
    run.wait_for(&["controller: ", "SIT"]);
    let mut operator = LcmBus::open(&url(0)).unwrap();
    let stop = OperatorCommand { mode: OperatorCommand::MODE_DAMPING, ..OperatorCommand::default() };
    let mut bytes = Vec::new();
    stop.encode(&mut bytes).unwrap();
    operator.publish("OPERATOR_TELEOP", &bytes).unwrap();
    run.wait_for(&["controller: ", "DAMPING", enum_names::fault(ControllerTick::FAULT_OPERATOR)]);
    run.end();
    assert_replays(&log);
    let inputs = controller::Unpacked::all(&messages::<ControllerInput>(&log, CONTROLLER_INPUT));
    let ticks: Vec<ControllerTick> = messages(&log, CONTROLLER_TICK);
    let stopped = inputs.iter().position(|input| input.op.mode == OperatorCommand::MODE_DAMPING).unwrap();
    let at = |tick: i64| ticks.iter().find(|found| found.tick == tick).unwrap().mode;
    assert_eq!(at(inputs[stopped].tick - 1), ControllerTick::MODE_SIT);
    assert_eq!(at(inputs[stopped].tick), ControllerTick::MODE_DAMPING, "in the same tick");
}

/// A driver dies and a second one starts; the operator script of the second one makes the robot stand again.
#[test]
fn the_robot_of_a_second_driver_stands_up_on_request() {
    let folder = folder("again");
    let (log, scenario) = (folder.join("run.mcap"), folder.join("again.toml"));
    let text = "name = \"again\"\nduration_s = 60.0\n[terrain]\nkind = \"flat\"\n[start]\nposture = \"lying\"\n\
        [[operator]]\nt_s = 0.0\nmode = \"idle\"\n[[operator]]\nt_s = 1.5\nmode = \"stand\"\n";
    std::fs::write(&scenario, text).unwrap();
    // A stall of the machine shorter than 0.2 s must not damp the robot while it stands up.
    let run_file = folder.join("run.toml");
    let text = std::fs::read_to_string("runs/hyq_sim.toml").unwrap();
    let text = replace_once(&text, "set = []", "set = [\"safety.max_state_age=0.2\"]");
    let scenarios = concat!("scenario = \"", env!("CARGO_MANIFEST_DIR"), "/scenarios/");
    std::fs::write(&run_file, replace_once(&text, "scenario = \"../scenarios/", scenarios)).unwrap();
    let mut run = LiveProcess::start(&format!(
        "run {} --scenario scenarios/short_flat.toml --lcm-url {} --log {} --ticks 30000",
        run_file.display(),
        url(9),
        log.display()
    ));
    let driver = run.process("driver");
    run.wait_for(&["controller: ", "STANCE"]);
    kill("-KILL", &driver);
    run.wait_for(&["ERROR controller: ", "DAMPING", enum_names::fault(ControllerTick::FAULT_STATE_STALE)]);
    let scenario = scenario.display();
    let second = LiveProcess::start(&format!("driver runs/hyq_sim.toml --lcm-url {} --scenario {scenario}", url(9)));
    run.wait_for(&["controller: ", "IDLE"]);
    run.wait_for(&["controller: ", "STAND_UP"]);
    run.wait_for(&["controller: ", "STANCE"]);
    run.interrupt();
    run.end();
    second.interrupt();
    second.end();
    assert_replays(&log);
}

/// The terminal is closed, or `hoof run` dies: the robot sits down (or damps on a machine that stalls), and an EVENT has the cause.
fn ends_in_a_safe_state(log: &Path, cause: EndCause) {
    assert_replays(log);
    let ticks: Vec<ControllerTick> = messages(log, CONTROLLER_TICK);
    let had = |mode: i8| ticks.iter().any(|tick| tick.mode == mode);
    let last = ticks.last().unwrap().mode;
    let sat = had(ControllerTick::MODE_SIT) && last == ControllerTick::MODE_IDLE;
    assert!(sat || had(ControllerTick::MODE_DAMPING), "{last}");
    let reports = messages::<Event>(log, EVENT).iter().filter(|event| event.text.contains(cause.text())).count();
    assert_eq!(reports, 1);
}

#[test]
fn a_closed_terminal_lets_the_robot_sit_down() {
    let log = folder("hang_up").join("run.mcap");
    let mut run = LiveProcess::run(&url(11), &log, "--ticks 30000");
    run.process("controller");
    run.wait_for(&["controller: ", "STANCE"]);
    kill("-HUP", &run.id());
    assert_controller_ended(&run.end().json());
    ends_in_a_safe_state(&log, EndCause::HangUp);
}

#[test]
fn the_robot_sits_down_and_all_processes_end_when_the_run_is_killed() {
    let log = folder("parent").join("run.mcap");
    let mut run = LiveProcess::run(&url(6), &log, "--ticks 30000");
    let processes = ["recorder", "driver", "controller"].map(|name| run.process(name));
    run.wait_for(&["controller: ", "STANCE"]);
    kill("-KILL", &run.id());
    // The pipe is closed when the last of them has ended.
    run.wait();
    for process in processes {
        while Path::new(&format!("/proc/{process}")).exists() {
            std::thread::yield_now();
        }
    }
    ends_in_a_safe_state(&log, EndCause::ParentDied);
}

#[test]
fn a_second_controller_and_a_second_driver_are_refused() {
    let log = folder("second").join("run.mcap");
    let mut run = LiveProcess::run(&url(7), &log, "");
    run.process("controller");
    run.wait_for(&["controller: ", "STANCE"]);
    for (name, channel) in [("controller", "ROBOT_COMMAND"), ("driver", "ROBOT_STATE")] {
        let second = hoof(&format!("{name} runs/hyq_sim.toml --lcm-url {}", url(7))).exits(2);
        assert!([name, channel].iter().all(|text| second.stderr.contains(text)), "{}", second.stderr);
    }
    run.interrupt();
    run.end();
}

fn put(bus: &mut LcmBus, channel: &str, message: &impl Message) {
    let mut bytes = Vec::new();
    message.encode(&mut bytes).unwrap();
    bus.publish(channel, &bytes).unwrap();
}

#[test]
fn foreign_commands_are_refused_and_of_two_runs_the_later_one_ends() {
    let log = folder("two_runs").join("run.mcap");
    let mut run = LiveProcess::run(&url(12), &log, "--seconds 60");
    run.wait_for(&["controller: ", "STANCE"]);
    let mut bus = LcmBus::open(&url(12)).unwrap();
    bus.subscribe(ROBOT_COMMAND).unwrap();
    let mut command = loop {
        let messages = bus.handle(Duration::from_millis(20)).unwrap();
        if let Some(message) = messages.last() {
            break RobotCommand::decode(&message.data).unwrap();
        }
    };
    // With the identity of the run, far ahead, and harmful.
    (command.tick, command.kd) = (command.tick + 100_000, vec![-1e6; command.kd.len()]);
    put(&mut bus, ROBOT_COMMAND, &command);
    run.wait_for(&["driver: ", "ROBOT_COMMAND", "another sender"]);
    put(&mut bus, ROBOT_COMMAND, &RobotCommand { run_id: command.run_id + 1, ..command });
    run.wait_for(&["driver: ", "ROBOT_COMMAND", "another run"]);

    let mut other = RobotInfo { t_ns: now_ns(), sender_id: 1, t_start_ns: i64::MAX, ..RobotInfo::default() };
    put(&mut bus, EXPECTED_ROBOT, &other);
    run.wait_for(&["controller: ", "DAMPING"]);
    (other.t_ns, other.sender_id, other.t_start_ns) = (now_ns(), 2, 0);
    put(&mut bus, EXPECTED_ROBOT, &other);
    let ran = run.end().exits(1).json();
    assert_eq!(ran["controller"]["second_run"], true);
    assert_replays(&log);
}

#[test]
fn a_driver_with_another_robot_is_not_commanded() {
    let folder = folder("wrong_robot");
    let run_file = folder.join("run.toml");
    let text = std::fs::read_to_string("runs/hyq_sim.toml").unwrap();
    let scenarios = concat!("scenario = \"", env!("CARGO_MANIFEST_DIR"), "/scenarios/");
    let text = replace_once(&text, "scenario = \"../scenarios/", scenarios);
    std::fs::write(&run_file, replace_once(&text, "robot = \"hyq\"", "robot = \"anymal_b\"")).unwrap();
    let mut driver = LiveProcess::start(&format!("driver runs/hyq_sim.toml --lcm-url {} --json", url(13)));
    driver.wait_for(&["driving hyq"]);
    let wrong = hoof(&format!("controller {} --lcm-url {} --ticks 1000", run_file.display(), url(13))).exits(2);
    assert!(["hyq", "anymal_b"].iter().all(|name| wrong.stderr.contains(name)), "{}", wrong.stderr);
    driver.interrupt();
    let driver = driver.end().json();
    assert_eq!(driver["sim_seconds"], 0.0, "the scenario starts with the first command");
}

#[test]
fn of_two_drivers_the_later_one_ends_and_the_first_one_damps_its_joints() {
    let log = folder("two_drivers").join("run.mcap");
    let mut run = LiveProcess::run(&url(16), &log, "--seconds 60");
    run.wait_for(&["controller: ", "STANCE"]);
    let mut bus = LcmBus::open(&url(16)).unwrap();
    bus.subscribe(ROBOT_INFO).unwrap();
    let mut other = loop {
        let messages = bus.handle(Duration::from_millis(20)).unwrap();
        if let Some(message) = messages.last() {
            break RobotInfo::decode(&message.data).unwrap();
        }
    };
    (other.t_ns, other.sender_id, other.t_start_ns) = (now_ns(), 1, i64::MAX);
    put(&mut bus, ROBOT_INFO, &other);
    run.wait_for(&["driver: ", "a second driver"]);
    run.wait_for(&["controller: ", "DAMPING"]);
    (other.t_ns, other.sender_id, other.t_start_ns) = (now_ns(), 2, 0);
    put(&mut bus, ROBOT_INFO, &other);
    run.wait_for(&["driver ended"]);
    run.interrupt();
    let ran = run.end().exits(1).json();
    assert_eq!(ran["driver"]["exit_code"], 2);
    assert_replays(&log);

    // The first step after the EVENT is damped, before the controller can have commanded that.
    let (mut before, mut damped, mut is_found) = (RobotState::default(), None, false);
    for event in events(&log) {
        match &*event.channel {
            ROBOT_STATE if is_found => {
                damped = Some(RobotState::decode(&event.data).unwrap());
                break;
            }
            ROBOT_STATE => before = RobotState::decode(&event.data).unwrap(),
            EVENT => is_found = is_driver_error(&Event::decode(&event.data).unwrap()),
            _ => {}
        }
    }
    for (tau, qd) in damped.unwrap().tau.iter().zip(&before.qd) {
        // `safety.damping` of HyQ; both are measured with the resolution of their sensors.
        assert!((tau + 20.0 * qd).abs() < 0.05, "{tau} N m at {qd} rad/s");
    }
}
