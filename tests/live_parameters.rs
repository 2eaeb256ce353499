//! `hoof set` on a live run: real processes over LCM UDP multicast, each test on a network of its own.
#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use common::{command, folder, hoof, messages};
use lcmtypes::channels::{CONTROLLER_INPUT, CONTROLLER_TICK, EVENT, PARAMETER_CHANGE, PARAMETER_REQUEST};
use lcmtypes::{ControllerInput, ControllerTick, Event, ParameterChange, ParameterRequest};
use std::collections::BTreeSet;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::Stdio;

fn url(test: u32) -> String {
    format!("udpm://239.255.78.2:{}?ttl=0&recv_buf_size=2000000", 20_000 + std::process::id() % 4000 * 10 + test)
}

#[test]
fn parameters_change_while_the_robot_walks_and_the_log_replays() {
    let (url, log) = (url(1), folder("set").join("run.mcap"));
    let run = format!(
        "run runs/hyq_sim.toml --scenario scenarios/short_flat.toml --seconds 60 --lcm-url {url} --log {}",
        log.display()
    );
    let mut run = command().args(run.split(' ')).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let mut said = BufReader::new(run.stderr.take().unwrap()).lines().map(Result::unwrap);
    assert!(said.any(|line| line.contains("controller is in STANCE")), "the run never began");
    let drain = std::thread::spawn(move || said.count());

    let set = |what: &str| hoof(&format!("set --json --lcm-url {url} {what}"));
    let granted = set("trunk.kp=[800,800,800] swing.height=0.07").exits(0).json();
    let refused = set("swing.height=0.06 wbc.friction=-1 trunk.kp=[1,1,1]").exits(1).json();
    let fixed = set("robot.name=other").exits(1).json();
    nix::sys::signal::kill(nix::unistd::Pid::from_raw(run.id().cast_signed()), nix::sys::signal::SIGINT).unwrap();
    assert!(run.wait().unwrap().code().unwrap() < 2);
    drain.join().unwrap();

    let changes: Vec<ParameterChange> = messages(&log, PARAMETER_CHANGE);
    // Each is said several times.
    let mut first_said = Vec::<ParameterChange>::new();
    for change in changes {
        if !first_said.contains(&change) {
            first_said.push(change);
        }
    }
    let told: Vec<_> =
        [&granted, &refused].iter().flat_map(|json| json["changes"].as_array().unwrap().clone()).collect();
    assert_eq!((granted["refused"].clone(), told.len()), (false.into(), 3));
    for (change, told) in first_said.iter().zip(&told) {
        assert_eq!((&*change.key, change.tick), (told["key"].as_str().unwrap(), told["tick"].as_i64().unwrap()));
    }
    let why = refused["why"].as_str().unwrap();
    assert_eq!(why, "wbc.friction = -1 is refused: parameter wbc.friction is -1, expected a positive number");
    assert!(fixed["why"].as_str().unwrap().contains("[robot] is what the run was begun with"), "{fixed}");
    // The third of that call was never asked for.
    let asked: Vec<ParameterRequest> = messages(&log, PARAMETER_REQUEST);
    assert_eq!(asked.iter().map(|wish| wish.seq).collect::<BTreeSet<_>>().len(), 5);
    let events: Vec<Event> = messages(&log, EVENT);
    let told: BTreeSet<_> = events.into_iter().filter(|event| event.source == "parameters").map(|e| e.text).collect();
    assert_eq!(told.len(), 5, "{told:?}");
    let inputs: Vec<ControllerInput> = messages(&log, CONTROLLER_INPUT);
    assert!(first_said.iter().all(|change| inputs.iter().any(|i| (i.tick, i.t_ns) == (change.tick, change.t_ns))));

    let replay = hoof(&format!("replay --json {}", log.display())).exits(0).json();
    assert_eq!((&replay["identical"], &replay["late_messages"]), (&true.into(), &0.into()));
    let ticks = i64::try_from(inputs.len()).unwrap();
    assert_eq!(replay["ticks"], ticks);

    // Simulated again, the robot is asked for the same, at the same times since its first tick.
    let again = log.with_file_name("again.mcap");
    let simulated = hoof(&format!("replay {} --json --resim {}", log.display(), again.display()));
    assert!(simulated.code < 2, "{}", simulated.stderr);
    let wishes = |log: &Path| -> Vec<(String, i64)> {
        let since = messages::<ControllerInput>(log, CONTROLLER_INPUT)[0].t_ns;
        let mut asked: Vec<ParameterRequest> = messages(log, PARAMETER_REQUEST);
        asked.dedup();
        asked.into_iter().map(|wish| (wish.key, wish.t_ns - since)).collect()
    };
    assert_eq!(wishes(&again), wishes(&log));
    let changes: Vec<ParameterChange> = messages(&again, PARAMETER_CHANGE);
    assert!(
        changes.iter().map(|change| (&change.key, &change.value)).eq(first_said.iter().map(|c| (&c.key, &c.value)))
    );
    let walks = |log: &Path| {
        let ticks: Vec<ControllerTick> = messages(log, CONTROLLER_TICK);
        ticks.iter().any(|tick| tick.mode == ControllerTick::MODE_WALK)
    };
    assert_eq!(walks(&again), walks(&log));
}

#[test]
fn a_scenario_asks_for_parameters_in_a_live_run_too() {
    let folder = folder("scenario");
    let (scenario, log) = (folder.join("scenario.toml"), folder.join("run.mcap"));
    let mut text = std::fs::read_to_string("scenarios/short_flat.toml").unwrap();
    text += "[[parameter]]\nt_s = 0.3\nkey = \"swing.height\"\nvalue = 0.07\n";
    std::fs::write(&scenario, text).unwrap();
    let (url, scenario, out) = (url(3), scenario.display(), log.display());
    let run = "run runs/hyq_sim.toml --ticks 2000 --json";
    let ran = hoof(&format!("{run} --scenario {scenario} --lcm-url {url} --log {out}"));
    assert!(ran.code < 2, "{}", ran.stderr);
    let changes: Vec<ParameterChange> = messages(&log, PARAMETER_CHANGE);
    // Each of them, as often as it was said.
    assert!(!changes.is_empty() && changes.iter().all(|change| *change == changes[0]), "{changes:?}");
    assert_eq!((&*changes[0].key, &*changes[0].value), ("swing.height", "0.07"));
    hoof(&format!("replay {out}")).exits(0);
}

#[test]
fn who_asks_nobody_is_told_so() {
    let url = url(2);
    let nobody = hoof(&format!("set trunk.kp=[1,1,1] --lcm-url {url}")).exits(2);
    assert!(nobody.stderr.contains("nobody answers on udpm://239.255.78.2:"), "{}", nobody.stderr);
    let wrong = hoof(&format!("set trunk.kp --lcm-url {url}")).exits(2);
    assert!(wrong.stderr.contains("parameter trunk.kp: expected KEY=VALUE"), "{}", wrong.stderr);
}
