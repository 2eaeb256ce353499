//! Live runs of several components: on worker threads, in processes of their own, late on purpose, and with a program that is no component.
#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use common::live_process::{LiveProcess, kill};
use common::network::url;
use common::{events, folder, hoof};
use lcmtypes::bus::{Bus, LcmBus};
use lcmtypes::{ControllerInput, ControllerTick, JointReference, Message, RobotCommand};
use std::path::Path;

/// A run file of HyQ without a robot: `hold`, and components in TOML.
fn run_file(folder: &Path, components: &str) -> std::path::PathBuf {
    let file = folder.join("run.toml");
    let first = "robot = \"hyq\"\nlog = \"unused.mcap\"\nhardware = \"dummy\"\n[[component]]\nname = \"legs\"\nkind = \"hold\"\n";
    std::fs::write(&file, format!("{first}{components}")).unwrap();
    file
}

/// Three rates; the worker needs longer than its period, so its results are late and it misses ticks.
const LATE: &str = r#"
[[component]]
name = "knees"
kind = "posture"
joints = ["lf_kfe_joint", "rf_kfe_joint"]
period_ticks = 20
latency_ticks = 20
runs = "worker"
pause_ms = 60
receives = ["planner/JOINT_REFERENCE"]

[[component]]
name = "planner"
kind = "tour"
period_ticks = 100
phase_ticks = 10
latency_ticks = 50
runs = "process"
"#;

#[test]
fn a_run_with_a_late_worker_replays_bit_for_bit() {
    let folder = folder("late");
    let (file, log) = (run_file(&folder, LATE), folder.join("run.mcap"));
    let run = format!("run {} --log {} --ticks 1500 --json --lcm-url {}", file.display(), log.display(), url(0));
    let json = hoof(&run).exits(0).json();
    assert!(json["controller"]["component_ticks_missed"].as_u64() > Some(10), "{json}");
    assert!(json["planner"]["ticks"].as_u64() > Some(5), "{json}");

    let report = hoof(&format!("replay {} --json", log.display())).exits(0).json();
    let of = |k: usize, key: &str| report["components"][k][key].clone();
    assert_eq!([0, 1, 2].map(|k| of(k, "name")), ["legs", "knees", "planner"].map(serde_json::Value::from));
    assert!((0..3).all(|k| of(k, "identical") == true && of(k, "ticks").as_u64() > Some(5)), "{report}");
    assert!(of(0, "late_results").as_u64() > Some(100), "{report}");

    // The input of the first component: nothing of the worker before its latency, and what is late is listed until it arrives.
    let inputs = events(&log).into_iter().filter(|event| *event.channel == *"CONTROLLER_INPUT");
    let inputs: Vec<ControllerInput> = inputs.map(|event| ControllerInput::decode(&event.data).unwrap()).collect();
    let tick_at = |t_ns: i64| inputs.iter().find(|input| input.t_ns == t_ns).map(|input| input.tick);
    let mut delivered = 0;
    for input in &inputs {
        for message in input.messages.iter().filter(|message| message.channel == "knees/ROBOT_COMMAND") {
            let command = RobotCommand::decode(&message.data).unwrap();
            let of_tick = tick_at(command.t_ns).unwrap();
            assert!(input.tick >= of_tick + 20, "tick {} has the result of tick {of_tick}", input.tick);
            delivered += 1;
        }
        for late in &input.late {
            assert!(late.channel == "knees/ROBOT_COMMAND" && late.due_tick <= input.tick, "{late:?}");
        }
    }
    assert!(delivered > 10, "{delivered}");
}

/// A goal of a knee that is not that of the posture, rad.
const GOAL: f64 = -1.0;

#[test]
fn any_program_can_take_part_and_the_run_replays_without_it() {
    let components = r#"
[[component]]
name = "knees"
kind = "posture"
joints = ["lf_kfe_joint", "rf_kfe_joint"]
period_ticks = 10
latency_ticks = 5
runs = "worker"
receives = ["script/JOINT_REFERENCE"]

[[component]]
name = "script"
kind = "external"
"#;
    let (folder, url) = (folder("external"), url(1));
    let (file, log) = (run_file(&folder, components), folder.join("run.mcap"));
    let mut run = LiveProcess::start(&format!("run {} --log {} --lcm-url {url}", file.display(), log.display()));
    run.wait_for(&["controller: controlling"]);
    let mut bus = LcmBus::open(&url).unwrap();
    bus.subscribe("ROBOT_COMMAND").unwrap();
    let mut reference =
        JointReference { n: 1, joints: vec!["lf_kfe_joint".to_owned()], q: vec![GOAL], ..Default::default() };
    // Until the joint's reference has arrived there; the limit is that of a test that hangs.
    let is_there = |bus: &mut LcmBus| {
        let received = bus.handle(std::time::Duration::from_millis(20)).unwrap();
        received.iter().any(|message| RobotCommand::decode(&message.data).unwrap().q_des[2] == GOAL)
    };
    while !is_there(&mut bus) {
        let mut bytes = Vec::new();
        reference.encode(&mut bytes).unwrap();
        bus.publish("script/JOINT_REFERENCE", &bytes).unwrap();
        reference.seq += 1;
        assert!(reference.seq < 1500, "the reference does not get there");
    }
    run.interrupt();
    run.end();
    let report = hoof(&format!("replay {} --json", log.display())).exits(0).json();
    assert_eq!(report["components"][1]["name"], "knees");
    assert_eq!(
        (&report["components"][0]["identical"], &report["components"][1]["identical"]),
        (&true.into(), &true.into())
    );
}

#[test]
fn the_joints_of_a_process_that_dies_are_damped_and_the_event_names_it() {
    let components = r#"
[[component]]
name = "planner"
kind = "tour"
period_ticks = 100

[[component]]
name = "knees"
kind = "posture"
joints = ["lf_kfe_joint", "rf_kfe_joint"]
period_ticks = 10
latency_ticks = 10
runs = "process"
"#;
    let (folder, url) = (folder("dies"), url(2));
    let (file, log) = (run_file(&folder, components), folder.join("run.mcap"));
    let mut run = LiveProcess::start(&format!("run {} --log {} --lcm-url {url} --json", file.display(), log.display()));
    let knees = run.process("knees");
    run.wait_for(&["knees: controller is in"]);
    kill("-KILL", &knees);
    run.wait_for(&["controller: ", ": knees, ", "ticks ago"]);
    run.interrupt();
    let ran = run.end();
    assert!(ran.stderr.contains("knees ended, signal: 9 (SIGKILL): the controller damps"), "{}", ran.stderr);
    assert_eq!(ran.exits(1).json()["knees"]["signal"], 9);
    let ticks = events(&log).into_iter().filter(|event| *event.channel == *"CONTROLLER_TICK");
    let ticks: Vec<ControllerTick> = ticks.map(|event| ControllerTick::decode(&event.data).unwrap()).collect();
    let late = ticks.iter().find(|tick| tick.fault == ControllerTick::FAULT_COMPONENT).unwrap();
    // Ten periods and the latency.
    assert_eq!((late.fault_index, late.fault_value), (2, 111.0));
}

/// A component that cannot be built is an error before the recorder starts.
#[test]
fn a_run_with_a_component_of_an_unknown_kind_writes_no_log() {
    let folder = folder("unknown");
    let (file, log) =
        (run_file(&folder, "[[component]]\nname = \"knees\"\nkind = \"postrue\"\n"), folder.join("run.mcap"));
    let ran = hoof(&format!("run {} --log {} --lcm-url {}", file.display(), log.display(), url(3))).exits(2);
    assert!(ran.stderr.contains("component knees") && ran.stderr.contains("\"postrue\""), "{}", ran.stderr);
    assert!(!log.exists());
}
