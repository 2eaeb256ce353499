//! `hoof set` on a live run: real processes over LCM UDP multicast, each test on its own network.
#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use common::network::url;
use common::{command, folder, hoof, messages};
use lcmtypes::channels::{
    CONTROLLER_INPUT, CONTROLLER_TICK, EVENT, PARAMETER_CHANGE, PARAMETER_REQUEST, REQUEST_REPLY,
};
use lcmtypes::{ControllerInput, ControllerTick, Event, ParameterChange, ParameterRequest, RequestReply};
use std::collections::BTreeSet;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::Stdio;

#[test]
fn parameters_change_while_the_robot_walks_and_the_log_replays() {
    let (url, log) = (url(1), folder("set").join("run.mcap"));
    let run = format!(
        "run runs/hyq_sim.toml --scenario scenarios/short_flat.toml --seconds 60 --lcm-url {url} --log {}",
        log.display()
    );
    let mut run = command().args(run.split(' ')).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(run.stderr.take().unwrap()).lines().map(Result::unwrap);
    assert!(lines.any(|line| line.contains("controller: ") && line.contains("STANCE")), "the run did not start");
    let drain = std::thread::spawn(move || lines.count());

    let set = |what: &str| hoof(&format!("set --json --lcm-url {url} {what}"));
    let done = set("trunk.kp=[800,800,800] swing.height=0.07").exits(0).json();
    let refused = set("swing.height=0.06 wbc.friction=-1 trunk.kp=[1,1,1]").exits(1).json();
    let fixed = set("robot.name=other").exits(1).json();
    nix::sys::signal::kill(nix::unistd::Pid::from_raw(run.id().cast_signed()), nix::sys::signal::SIGINT).unwrap();
    run.wait().unwrap();
    drain.join().unwrap();

    let changes: Vec<ParameterChange> = messages(&log, PARAMETER_CHANGE);
    // Each change is published several times.
    let mut published = Vec::<ParameterChange>::new();
    for change in changes {
        if !published.contains(&change) {
            published.push(change);
        }
    }
    let reported: Vec<_> =
        [&done, &refused].iter().flat_map(|json| json["changes"].as_array().unwrap().clone()).collect();
    assert_eq!((&done["refused"], &done["code"], reported.len()), (&false.into(), &"done".into(), 3));
    for (change, reported) in published.iter().zip(&reported) {
        let found = (reported["key"].as_str().unwrap(), reported["tick"].as_i64().unwrap());
        assert_eq!((&*change.key, change.tick), found);
    }
    assert_eq!((&refused["code"], &fixed["code"]), (&"out_of_range".into(), &"rejected".into()));
    assert!(refused["why"].as_str().unwrap().contains("wbc.friction"), "{refused}");
    assert!(fixed["why"].as_str().unwrap().contains("robot.name"), "{fixed}");
    // The third parameter of that call was not requested.
    let requests: Vec<ParameterRequest> = messages(&log, PARAMETER_REQUEST);
    let requests: BTreeSet<(i64, i64)> = requests.iter().map(|request| (request.sender_id, request.seq)).collect();
    assert_eq!(requests.len(), 5);
    let replies: Vec<RequestReply> = messages(&log, REQUEST_REPLY);
    for request in &requests {
        assert!(replies.iter().any(|reply| (reply.sender_id, reply.request_id) == *request), "{request:?}");
    }
    let events: Vec<Event> = messages(&log, EVENT);
    let texts: BTreeSet<_> = events.into_iter().filter(|event| event.source == "parameters").map(|e| e.text).collect();
    assert_eq!(texts.len(), 5, "{texts:?}");
    let inputs = controller::Unpacked::all(&messages::<ControllerInput>(&log, CONTROLLER_INPUT));
    assert!(published.iter().all(|change| inputs.iter().any(|i| (i.tick, i.t_ns) == (change.tick, change.t_ns))));

    let replay = hoof(&format!("replay --json {}", log.display())).exits(0).json();
    assert_eq!((&replay["identical"], &replay["late_messages"]), (&true.into(), &0.into()));
    let ticks = i64::try_from(inputs.len()).unwrap();
    assert_eq!(replay["ticks"], ticks);

    // The simulation of the log has the same requests, at the same times since its first tick.
    let again = log.with_file_name("again.mcap");
    let simulated = hoof(&format!("replay {} --json --resim {}", log.display(), again.display()));
    let fell = simulated.json()["simulated"]["safety"]["fell"].as_bool().unwrap();
    let ticks: Vec<ControllerTick> = messages(&again, CONTROLLER_TICK);
    let damped = ticks.iter().any(|tick| tick.mode == ControllerTick::MODE_DAMPING);
    simulated.exits(i32::from(fell || damped));
    let requests = |log: &Path| -> Vec<(String, i64)> {
        let since = messages::<ControllerInput>(log, CONTROLLER_INPUT)[0].t_ns;
        let mut requests: Vec<ParameterRequest> = messages(log, PARAMETER_REQUEST);
        requests.dedup();
        requests.into_iter().map(|request| (request.key, request.t_ns - since)).collect()
    };
    assert_eq!(requests(&again), requests(&log));
    let changes: Vec<ParameterChange> = messages(&again, PARAMETER_CHANGE);
    assert!(changes.iter().map(|change| (&change.key, &change.value)).eq(published.iter().map(|c| (&c.key, &c.value))));
    let walks = |log: &Path| {
        let ticks: Vec<ControllerTick> = messages(log, CONTROLLER_TICK);
        ticks.iter().any(|tick| tick.mode == ControllerTick::MODE_WALK)
    };
    // The robot of a live run on a machine that stalls may be damped before it walks.
    assert!(walks(&again) || !walks(&log));
}

#[test]
fn the_parameter_requests_of_a_scenario_are_sent_in_a_live_run() {
    let folder = folder("scenario");
    let (scenario, log) = (folder.join("scenario.toml"), folder.join("run.mcap"));
    let mut text = std::fs::read_to_string("scenarios/short_flat.toml").unwrap();
    text += "[[parameter]]\nt_s = 0.3\nkey = \"swing.height\"\nvalue = 0.07\n";
    std::fs::write(&scenario, text).unwrap();
    let (url, scenario, out) = (url(3), scenario.display(), log.display());
    let run = "run runs/hyq_sim.toml --ticks 2000 --json";
    let ran = hoof(&format!("{run} --scenario {scenario} --lcm-url {url} --log {out}"));
    ran.exits_as_reported();
    let changes: Vec<ParameterChange> = messages(&log, PARAMETER_CHANGE);
    // All copies of the one change.
    assert!(!changes.is_empty() && changes.iter().all(|change| *change == changes[0]), "{changes:?}");
    assert_eq!((&*changes[0].key, &*changes[0].value), ("swing.height", "0.07"));
    hoof(&format!("replay {out}")).exits(0);
}

#[test]
fn without_a_run_there_is_an_error() {
    let url = url(2);
    let no_reply = hoof(&format!("set trunk.kp=[1,1,1] --lcm-url {url}")).exits(2);
    assert!(no_reply.stderr.contains(url.split('?').next().unwrap()), "{}", no_reply.stderr);
    let wrong = hoof(&format!("set trunk.kp --lcm-url {url}")).exits(2);
    assert!(wrong.stderr.contains("trunk.kp"), "{}", wrong.stderr);
}
