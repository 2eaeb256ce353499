//! A Cartesian server in a live run: requests from other processes at any time, every reference continuous, replay bit for bit.
#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use common::live_process::LiveProcess;
use common::network::url;
use common::{events, folder, hoof};
use lcmtypes::{Message, RobotCommand, TaskStatus};

/// Requests of the command, one after the other: each is answered before the next.
const REQUESTS: [(&str, i32, &str); 14] = [
    ("waypoints left_hand --relative --to=0.5_0.02_0_0.05 --to=1_0_0_0", 0, "done"),
    ("mode right_hand velocity", 0, "done"),
    ("velocity right_hand 0 -0.1 0.1 --seconds 0.3", 0, "done"),
    ("pose right_hand 0 0 0", 1, "wrong_state"),
    ("base-link left_hand DWYTorso", 0, "done"),
    ("mode right_hand position", 0, "done"),
    ("pose right_hand --relative 0 0.02 0.02", 0, "done"),
    ("activate left_hand off", 0, "done"),
    ("weight right_hand 0.5", 0, "done"),
    ("gain com 5", 0, "done"),
    ("limits right_hand 0.5 2 1 5", 0, "done"),
    ("activate left_hand on", 0, "done"),
    ("reset right_hand", 0, "done"),
    ("base-link right_hand RSoftHand", 1, "out_of_range"),
];

#[test]
fn requests_of_other_processes_move_tasks_and_the_run_replays() {
    let (folder, url) = (folder("tasks"), url(0));
    let log = folder.join("run.mcap");
    let mut run = LiveProcess::start(&format!("run runs/coman_hands.toml --log {} --lcm-url {url}", log.display()));
    run.wait_for(&["controller: controlling"]);
    let listed = hoof(&format!("task list --json --lcm-url {url}")).exits(0).json();
    let names: Vec<&str> =
        listed["tasks"].as_array().unwrap().iter().map(|task| task["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["com", "left_hand", "left_sole", "posture", "right_hand", "right_sole"]);
    for (request, exit, code) in REQUESTS {
        let arguments: Vec<String> = format!("task {request} --json --lcm-url {url}")
            .split_whitespace()
            .map(|word| if word.starts_with("--to=") { word.replace('_', " ") } else { word.to_owned() })
            .collect();
        let ran = common::ran(common::command().args(&arguments).output().unwrap()).exits(exit);
        assert_eq!(ran.json()["code"], code, "{request}");
    }
    let hand = hoof(&format!("task info left_hand --json --lcm-url {url}")).exits(0).json();
    assert_eq!((&hand["base_link"], &hand["mode"]), (&"DWYTorso".into(), &"position".into()));
    hoof(&format!("task info no_such --lcm-url {url}")).exits(2);
    run.interrupt();
    run.end();

    let report = hoof(&format!("replay {} --json", log.display())).exits(0).json();
    assert_eq!(report["identical"], true, "{report}");
    let (mut last, mut statuses, mut largest) = (None::<RobotCommand>, 0, 0.0_f64);
    for event in events(&log) {
        match &*event.channel {
            "ROBOT_COMMAND" => {
                let command = RobotCommand::decode(&event.data).unwrap();
                if let Some(last) = last.filter(|last| last.mode == command.mode && last.tick > 0) {
                    let dt = 1e-9 * f64::from(i32::try_from(command.t_ns - last.t_ns).unwrap());
                    for (now, before) in command.q_des.iter().zip(&last.q_des) {
                        largest = largest.max((now - before).abs() / dt.max(1e-3));
                    }
                }
                last = Some(command);
            }
            "TASK_STATUS" => {
                TaskStatus::decode(&event.data).unwrap();
                statuses += 1;
            }
            _ => {}
        }
    }
    // The velocity limits of the joints are 4 to 12 rad/s, and the stack allows half of them.
    assert!(statuses > 50 && largest > 0.0 && largest < 6.0, "{statuses} {largest}");
}
