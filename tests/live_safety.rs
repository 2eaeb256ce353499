//! Processes of a live run die, and the robot ends safe: with real processes and real signals.
#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use common::talker::{Talker, kill};
use common::{events, folder, hoof, messages, ran};
use lcmtypes::bus::{Bus, LcmBus};
use lcmtypes::channels::{CONTROLLER_INPUT, CONTROLLER_TICK, EVENT, ROBOT_COMMAND, ROBOT_STATE};
use lcmtypes::{ControllerInput, ControllerTick, Event, Message, OperatorCommand, RobotCommand};
use serde_json::Value;
use std::path::Path;
use std::process::Command;

/// A network of its own for each test and process.
fn url(test: u32) -> String {
    format!("udpm://239.255.78.2:{}?ttl=0&recv_buf_size=2000000", 20_000 + std::process::id() % 4000 * 10 + test)
}

/// The log replays bit for bit. Of a controller that was killed, the last commands came by their own way before their inputs did.
fn is_identical(log: &Path) -> Value {
    let replay = hoof(&format!("replay --json {}", log.display())).json();
    assert_eq!((&replay["identical"], &replay["unverifiable_ticks"]), (&true.into(), &0.into()));
    replay
}

#[test]
fn a_dead_controller_is_noticed_within_20_steps_of_its_driver() {
    let log = folder("controller").join("run.mcap");
    let mut run = Talker::run(&url(1), &log, "");
    let controller = run.process("controller");
    run.hear(&["controller is in STANCE"]);
    kill("-KILL", &controller);
    run.hear(&["ERROR driver: no command for"]);
    let ran = run.end();
    assert!(ran.stderr.contains("controller ended, signal: 9 (SIGKILL): the driver damps the robot"), "{}", ran.stderr);
    assert_eq!(ran.exits(1).json()["controller"]["signal"], 9);
    is_identical(&log);

    // A step is a millisecond, or more on a machine that stalls; then it is not the driver that is late.
    let (mut silent, mut damped) = (0, false);
    for event in events(&log) {
        match &*event.channel {
            ROBOT_COMMAND => silent = 0,
            ROBOT_STATE => silent += 1,
            EVENT if Event::decode(&event.data).unwrap().text.starts_with("no command for") => {
                assert!((10..=20).contains(&silent), "{silent} steps without a command");
                damped = true;
                break;
            }
            _ => {}
        }
    }
    assert!(damped);
}

#[test]
fn a_dead_driver_is_damped_for_and_another_one_is_heard() {
    let log = folder("driver").join("run.mcap");
    let mut run = Talker::run(&url(2), &log, "--ticks 3000");
    let driver = run.process("driver");
    run.hear(&["controller is in STANCE"]);
    kill("-KILL", &driver);
    run.hear(&["ERROR controller: controller is in DAMPING: joint state too old"]);
    let mut second = Talker::start(&format!("driver runs/hyq_sim.toml --lcm-url {}", url(2)));
    second.hear(&["driving hyq"]);
    let ran = run.end();
    assert!(ran.stderr.contains("driver ended, signal: 9 (SIGKILL): the controller damps and waits"), "{}", ran.stderr);
    second.interrupt();
    // The controller goes on damping until the operator wants otherwise, so this robot sinks down, upright.
    second.end().exits(0);
    assert_eq!(ran.exits(1).json()["controller"]["ticks"], 3000);
    assert_eq!(is_identical(&log)["ticks"], 3000);

    let ticks: Vec<ControllerTick> = messages(&log, CONTROLLER_TICK);
    let stale = ticks.iter().position(|tick| tick.mode == ControllerTick::MODE_DAMPING).unwrap();
    assert_eq!(ticks[stale].fault, ControllerTick::FAULT_STATE_STALE);
    let commands: Vec<RobotCommand> = messages(&log, ROBOT_COMMAND);
    let inputs: Vec<ControllerInput> = messages(&log, CONTROLLER_INPUT);
    // The same tick that finds the state too old damps, and no tick before it does.
    assert_eq!(commands[stale].mode, RobotCommand::MODE_DAMPING);
    assert_eq!(commands[stale - 1].mode, RobotCommand::MODE_TORQUE);
    assert!(inputs[stale].t_ns - inputs[stale].state.t_ns > 10_000_000);
    // The second driver counts from 0.
    assert!(inputs[stale..].iter().any(|input| input.state.seq < inputs[stale].state.seq), "nobody heard it");
}

#[test]
fn the_robot_walks_on_without_its_recorder() {
    let log = folder("recorder").join("run.mcap");
    let mut run = Talker::run(&url(3), &log, "--ticks 1500");
    let recorder = run.process("recorder");
    run.hear(&["controller is in WALK"]);
    kill("-KILL", &recorder);
    let ran = run.end();
    assert!(
        ran.stderr.contains("recorder ended, signal: 9 (SIGKILL): the robot goes on without a log"),
        "{}",
        ran.stderr
    );
    let json = ran.exits(1).json();
    assert_eq!((&json["controller"]["ticks"], &json["controller"]["exit_code"]), (&1500.into(), &0.into()));
    // A killed recorder leaves a log without its end, of which nothing else is missing.
    let replay = hoof(&format!("replay --json {}", log.display()));
    assert_eq!(replay.json()["identical"], true);
}

#[test]
fn the_robot_walks_on_when_the_disk_is_full() {
    let log = folder("disk").join("run.mcap");
    let hoof = env!("CARGO_BIN_EXE_hoof");
    let line = format!(
        "ulimit -f 600; exec {hoof} run runs/hyq_sim.toml --scenario scenarios/short_flat.toml --json --ticks 2500 --lcm-url '{}' --log {}",
        url(4),
        log.display()
    );
    let ran = ran(Command::new("bash").args(["-c", &line]).current_dir(env!("CARGO_MANIFEST_DIR")).output().unwrap());
    let json = ran.json();
    assert_eq!(
        (&json["controller"]["ticks"], &json["controller"]["exit_code"]),
        (&2500.into(), &0.into()),
        "{}",
        ran.stderr
    );
    assert!(json["recorder"]["failure"].is_string() && json["recorder"]["exit_code"] == 3, "{json}");
    assert!(std::fs::metadata(&log).unwrap().len() <= 600 * 1024);
}

#[test]
fn ctrl_c_lets_the_robot_sit_down_and_completes_the_log() {
    let log = folder("interrupt").join("run.mcap");
    let mut run = Talker::run(&url(5), &log, "--ticks 30000");
    run.process("controller");
    run.hear(&["controller is in STANCE"]);
    run.interrupt();
    let ran = run.end();
    let json = ran.json();
    for process in ["controller", "recorder"] {
        assert_eq!(json[process]["exit_code"], 0, "{json}");
    }
    is_identical(&log);
    let ticks: Vec<ControllerTick> = messages(&log, CONTROLLER_TICK);
    let last = ticks.last().unwrap().mode;
    // On a machine that stalls it may have been damped instead.
    assert!([ControllerTick::MODE_IDLE, ControllerTick::MODE_DAMPING].contains(&last), "{last}");
    let sat = ticks.iter().any(|tick| tick.mode == ControllerTick::MODE_SIT);
    assert!(sat && last == ControllerTick::MODE_IDLE || ran.stderr.contains("DAMPING: "), "{}", ran.stderr);
    // The driver has seen the end of the commands as an end, not as a death.
    assert!(!ran.stderr.contains("ERROR driver: no command"), "{}", ran.stderr);
}

#[test]
fn ctrl_c_twice_damps_at_once() {
    let log = folder("twice").join("run.mcap");
    let mut run = Talker::run(&url(8), &log, "--ticks 30000");
    run.process("controller");
    run.hear(&["controller is in STANCE"]);
    run.interrupt();
    run.hear(&["controller is in SIT"]);
    run.interrupt();
    let ran = run.end();
    assert_eq!(ran.json()["controller"]["exit_code"], 0);
    is_identical(&log);
    let commands: Vec<RobotCommand> = messages(&log, ROBOT_COMMAND);
    assert!(commands.iter().rev().take(20).all(|command| command.mode == RobotCommand::MODE_DAMPING));
}

/// The robot is asked to sit in the operator's place, but never against an emergency stop.
#[test]
fn an_emergency_stop_is_heard_while_the_robot_sits_down() {
    let log = folder("stop").join("run.mcap");
    let mut run = Talker::run(&url(0), &log, "--ticks 30000");
    run.process("controller");
    run.hear(&["controller is in STANCE"]);
    run.interrupt();
    run.hear(&["controller is in SIT"]);
    let mut operator = LcmBus::open(&url(0)).unwrap();
    let stop = OperatorCommand { mode: OperatorCommand::MODE_DAMPING, ..OperatorCommand::default() };
    let mut bytes = Vec::new();
    stop.encode(&mut bytes).unwrap();
    operator.publish("OPERATOR_TELEOP", &bytes).unwrap();
    run.hear(&["controller is in DAMPING: operator asked for it"]);
    run.end();
    is_identical(&log);
    let inputs: Vec<ControllerInput> = messages(&log, CONTROLLER_INPUT);
    let ticks: Vec<ControllerTick> = messages(&log, CONTROLLER_TICK);
    let stopped = inputs.iter().position(|input| input.op.mode == OperatorCommand::MODE_DAMPING).unwrap();
    let at = |tick: i64| ticks.iter().find(|found| found.tick == tick).unwrap().mode;
    assert_eq!(at(inputs[stopped].tick - 1), ControllerTick::MODE_SIT);
    assert_eq!(at(inputs[stopped].tick), ControllerTick::MODE_DAMPING, "in the tick that follows it");
}

/// A driver dies and another one begins; the operator, who comes with it, brings the robot back to its feet.
#[test]
fn another_driver_is_taken_up_when_the_operator_asks_for_it() {
    let folder = folder("again");
    let (log, scenario) = (folder.join("run.mcap"), folder.join("again.toml"));
    let text = "name = \"again\"\nduration_s = 60.0\n[terrain]\nkind = \"flat\"\n[start]\nposture = \"lying\"\n\
        [[operator]]\nt_s = 0.0\nmode = \"idle\"\n[[operator]]\nt_s = 1.5\nmode = \"stand\"\n";
    std::fs::write(&scenario, text).unwrap();
    let mut run = Talker::run(&url(9), &log, "--ticks 30000");
    let driver = run.process("driver");
    run.hear(&["controller is in STANCE"]);
    kill("-KILL", &driver);
    run.hear(&["ERROR controller: controller is in DAMPING: joint state too old"]);
    let scenario = scenario.display();
    let second = Talker::start(&format!("driver runs/hyq_sim.toml --lcm-url {} --scenario {scenario}", url(9)));
    run.hear(&["controller is in IDLE"]);
    run.hear(&["controller is in STAND_UP"]);
    run.hear(&["controller is in STANCE"]);
    run.interrupt();
    run.end();
    second.interrupt();
    second.end();
    is_identical(&log);
}

#[test]
fn nobody_is_left_behind_when_the_run_is_killed() {
    let log = folder("parent").join("run.mcap");
    let mut run = Talker::run(&url(6), &log, "");
    let processes = ["recorder", "driver", "controller"].map(|name| run.process(name));
    run.hear(&["controller is in STANCE"]);
    kill("-KILL", &run.id());
    // The pipe closes when the last of them is gone.
    run.wait();
    for process in processes {
        while Path::new(&format!("/proc/{process}")).exists() {
            std::thread::yield_now();
        }
    }
    is_identical(&log);
}

#[test]
fn a_second_controller_and_a_second_driver_are_refused() {
    let log = folder("second").join("run.mcap");
    let mut run = Talker::run(&url(7), &log, "");
    run.process("controller");
    run.hear(&["controller is in STANCE"]);
    for (name, channel) in [("controller", "ROBOT_COMMAND"), ("driver", "ROBOT_STATE")] {
        let second = hoof(&format!("{name} runs/hyq_sim.toml --lcm-url {}", url(7))).exits(2);
        let wanted = format!("error: another {name} sends {channel} on udpm://239.255.78.2:");
        assert!(second.stderr.starts_with(&wanted), "{}", second.stderr);
    }
    run.interrupt();
    run.end();
}
