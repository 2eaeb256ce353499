//! The Cartesian server in lockstep: robots stand and move their hands, stacks are changed while they move, logs replay bit for bit.
#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use common::{command, events, folder, ran};
use lcmtypes::{Message, RobotCommand, TaskReply, TaskStatus};
use std::path::{Path, PathBuf};

/// Simulates a robot with a scenario and a stack; returns the log.
fn simulated(test: &str, robot: &str, scenario: &Path, stack: &str) -> PathBuf {
    let log = folder(test).join("run.mcap");
    let mut sim = command();
    sim.args(["sim", "--robot", robot, "--json", "--set", &format!("cartesian_ik.stack=@{stack}")]);
    let json = ran(sim.arg("--scenario").arg(scenario).arg("--log").arg(&log).output().unwrap()).exits(0).json();
    assert_eq!((&json["fell_at_s"], &json["safe_state"]), (&serde_json::Value::Null, &serde_json::Value::Null));
    let replay = ran(command().args(["replay", "--json"]).arg(&log).output().unwrap()).exits(0).json();
    assert_eq!(replay["identical"], true);
    log
}

/// Code and number of the answers, the statuses, and the largest change of a velocity reference in a tick.
fn read(log: &Path) -> (Vec<i8>, Vec<TaskStatus>, f64) {
    let (mut codes, mut statuses, mut last, mut largest) = (Vec::new(), Vec::new(), None::<RobotCommand>, 0.0_f64);
    for event in events(log) {
        match &*event.channel {
            "TASK_REPLY" => {
                codes.extend(TaskReply::decode(&event.data).unwrap().answers.iter().map(|answer| answer.code));
            }
            "TASK_STATUS" => statuses.push(TaskStatus::decode(&event.data).unwrap()),
            "ROBOT_COMMAND" => {
                let command = RobotCommand::decode(&event.data).unwrap();
                if let Some(last) = last {
                    let changes = command.qd_des.iter().zip(&last.qd_des).map(|(a, b)| (a - b).abs());
                    largest = changes.fold(largest, f64::max);
                }
                last = Some(command);
            }
            _ => {}
        }
    }
    (codes, statuses, largest)
}

/// Error of a task at the end, m and rad.
fn last_error(statuses: &[TaskStatus], task: &str) -> f64 {
    let found = statuses.last().unwrap().tasks.iter().find(|state| state.name == task).unwrap();
    found.error.iter().fold(0.0, |most, x| most.max(x.abs()))
}

/// Both stacks limit the acceleration of the joints to 20 rad/s²: 0.02 rad/s in a tick.
const CHANGE: f64 = 0.02 + 1e-9;

#[test]
fn coman_moves_its_hands_on_two_soles() {
    let log = simulated("coman", "coman", Path::new("scenarios/coman_hands.toml"), "stacks/coman_hands.toml");
    let (codes, statuses, largest) = read(&log);
    assert_eq!(codes, [0, 0, 0, 0, 0, 0, 2]);
    assert!(largest <= CHANGE, "{largest}");
    for task in ["com", "left_hand", "right_hand", "left_sole", "right_sole"] {
        assert!(last_error(&statuses, task) < 1e-3, "{task}: {}", last_error(&statuses, task));
    }
}

#[test]
fn centauro_moves_pelvis_and_hands_on_locked_wheels() {
    let log =
        simulated("centauro", "centauro", Path::new("scenarios/centauro_hands.toml"), "stacks/centauro_hands.toml");
    let (codes, statuses, largest) = read(&log);
    assert_eq!(codes, [0; 4]);
    assert!(largest <= CHANGE, "{largest}");
    for task in ["wheel_1", "wheel_2", "wheel_3", "wheel_4"] {
        assert!(last_error(&statuses, task) < 1e-3, "{task}");
    }
    let hand = statuses.last().unwrap().tasks.iter().find(|state| state.name == "left_hand").unwrap();
    assert!(!hand.active);
}

/// While the hands move, another stack gives the left hand a level of its own, and the right hand no task.
#[test]
fn another_stack_takes_over_while_the_hands_move() {
    let folder = folder("change_files");
    let stack = std::fs::read_to_string("stacks/coman_hands.toml").unwrap();
    let (before, right) = stack.split_once("[task.right_hand]").unwrap();
    let rest = right.split_once("[task.left_sole]").unwrap().1;
    let other = format!("{before}[task.left_sole]{rest}").replace("left_hand + right_hand", "left_hand");
    let scenario = std::fs::read_to_string("scenarios/coman_hands.toml").unwrap();
    let change =
        format!("{scenario}\n[[parameter]]\nt_s = 2.0\nkey = \"cartesian_ik.stack\"\nvalue = '''\n{other}'''\n");
    let file = folder.join("change.toml");
    std::fs::write(&file, change).unwrap();
    let log = simulated("change", "coman", &file, "stacks/coman_hands.toml");
    let (codes, statuses, largest) = read(&log);
    assert_eq!(codes.len(), 7);
    assert_eq!(statuses.last().unwrap().tasks.len(), 5);
    // The velocity of the right hand ends within the limit of the acceleration, too.
    assert!(largest <= CHANGE, "{largest}");
}
