//! Every component of a run replays bit for bit, and every result is delivered after the latency of its component.
#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use common::{Ran, events, folder, hoof, rewrite, rewrite_one};
use lcmtypes::channels::{CONTROLLER_INPUT, CONTROLLER_SNAPSHOT, RUN_INFO};
use lcmtypes::{ComponentState, ControllerInput, Delivered, Message, RobotCommand, SharedState};
use serde_json::{Value, json};
use std::path::Path;

/// 1.5 s: legs with 1500 ticks, arms with 75 (snapshots at 0 and 50), planner with 15 (snapshots at 0 and 10).
fn run(log: &Path) {
    let log = log.display();
    hoof(&format!("sim runs/centauro_components.toml --seconds 1.5 --log {log}")).exits(0);
}

fn replay(log: &Path, more: &str) -> Ran {
    hoof(&format!("replay {} --json {more}", log.display()))
}

/// The text of the run file, for a copy in another folder.
fn run_file() -> String {
    let text = std::fs::read_to_string("runs/centauro_components.toml").unwrap();
    let scenario = Path::new("scenarios/hold.toml").canonicalize().unwrap();
    text.replace("../scenarios/hold.toml", &scenario.display().to_string())
}

fn names(report: &Value) -> Value {
    let of = |one: &Value| json!([one["name"], one["ticks"], one["identical"], one["complete"]]);
    report["components"].as_array().unwrap().iter().map(of).collect()
}

#[test]
fn all_components_replay_bit_for_bit() {
    let folder = folder("identical");
    let log = folder.join("run.mcap");
    run(&log);
    let report = replay(&log, "").exits(0).json();
    let all = json!([["legs", 1500, true, true], ["arms", 75, true, true], ["planner", 15, true, true]]);
    assert_eq!(names(&report), all, "{report:#}");
    let keys = ["identical", "complete", "ticks", "messages_not_recorded", "unverifiable_ticks"];
    assert_eq!(keys.map(|key| report[key].clone()), [json!(true), json!(true), json!(1500), json!(0), json!(0)]);
    assert_eq!(report["release_violations"], json!({"count": 0, "first": null}));
    // The command and the tick of legs, arms and planner (a JOINT_REFERENCE in place of a command), and 2 snapshots of each.
    assert_eq!(report["messages_compared"], 2 * (1500 + 75 + 15) + 6);
    assert_eq!(hoof(&format!("log verify {} --json", log.display())).exits(0).json()["replay"]["complete"], true);
    assert_eq!(hoof(&format!("replay {}", log.display())).exits(0).stdout.matches("component ").count(), 3);

    // A live run may record the input of a tick after its outputs.
    let late = folder.join("late.mcap");
    let mut events_late = events(&log);
    for at in 1..events_late.len() {
        let is_input = &*events_late[at - 1].channel == "planner/CONTROLLER_INPUT";
        if is_input && (events_late[at].channel.starts_with("planner/")) {
            events_late.swap(at - 1, at);
        }
    }
    let mut writer = replay::log::LogWriter::create(&late).unwrap();
    events_late.iter().for_each(|event| writer.write(&event.channel, event.t_ns, &event.data).unwrap());
    writer.finish().unwrap();
    let again = replay(&late, "").exits(0).json();
    assert_eq!((names(&again), &again["messages_compared"]), (all.clone(), &report["messages_compared"]));
    assert_eq!(again["release_violations"]["count"], 0);

    // One component, a part of the log, a what-if replay and a copy of it.
    let arms = replay(&log, "--component arms --from 1.2").exits(0).json();
    assert_eq!((names(&arms), &arms["ticks"]), (json!([["arms", 24, true, true]]), &json!(24)));
    let (copy, other) = (folder.join("copy.mcap"), folder.join("other.mcap"));
    let out = format!("--component arms --out {}", copy.display());
    replay(&log, &out).exits(0);
    let of = |log: &Path, kept: fn(&str) -> bool| {
        let mut events: Vec<_> =
            events(log).into_iter().filter(|e| kept(&e.channel)).map(|e| (e.channel, e.data)).collect();
        events.sort();
        events
    };
    let same: fn(&str) -> bool = |channel| channel != RUN_INFO;
    assert!(of(&log, same) == of(&copy, same), "a copy of arms has the messages of all components");
    assert_eq!(names(&replay(&copy, "").exits(0).json()), all);
    let out = format!("--component arms --set motion.velocity=0.01 --out {}", other.display());
    let what_if = replay(&log, &out).json();
    assert_eq!(what_if["deviations"][0]["what"], "motion.velocity", "{what_if:#}");
    assert_eq!(names(&replay(&other, "--component arms").exits(0).json()), json!([["arms", 75, true, true]]));
    replay(&log, "--component wings").exits(2);
    let moment = hoof(&format!("debug {} --component arms --tick 60 --once --json", log.display())).exits(0).json();
    assert_eq!((&moment["tick"], &moment["agrees"]), (&json!(60), &json!(true)));
}

/// A part of the log replays on its own, from the snapshots of each component.
#[test]
fn a_part_of_the_log_replays_on_its_own() {
    let folder = folder("part");
    let (log, part) = (folder.join("run.mcap"), folder.join("part.mcap"));
    run(&log);
    let trim = format!("log trim {} {} --around 1.3 --before 0.1 --after 0.1", log.display(), part.display());
    hoof(&trim).exits(0);
    let report = replay(&part, "").exits(0).json();
    let found = report["components"].as_array().unwrap();
    assert!(found.iter().all(|one| one["identical"] == true && one["replayed"] == true), "{report:#}");
    assert_eq!(report["release_violations"]["count"], 0, "{report:#}");
}

/// A component of another program, and one whose first tick is after the end of the log, are listed.
#[test]
fn components_without_a_tick_are_listed_as_not_replayed() {
    let folder = folder("not_replayed");
    let (file, log) = (folder.join("run.toml"), folder.join("run.mcap"));
    let text = run_file() + "\n[[component]]\nname = \"camera\"\nkind = \"external\"\n";
    std::fs::write(&file, text).unwrap();
    let ran = hoof(&format!("sim {} --seconds 0.04 --log {}", file.display(), log.display())).exits(0);
    assert!(ran.stderr.contains("component camera is external"), "{}", ran.stderr);
    let report = replay(&log, "").exits(0).json();
    let found =
        report["components"].as_array().unwrap().iter().map(|one| json!([one["name"], one["ticks"], one["replayed"]]));
    let expected = json!([["legs", 40, true], ["arms", 2, true], ["planner", 0, false], ["camera", 0, false]]);
    assert_eq!(found.collect::<Value>(), expected, "{report:#}");
    assert_eq!((&report["identical"], &report["complete"]), (&json!(true), &json!(true)));
    hoof(&format!("log verify {} --json", log.display())).exits(0);
    replay(&log, "--component camera").exits(2);
}

/// The controllers of a sequence that run are those of the log: here the second one. A run with several components is not simulated again.
#[test]
fn resim_repeats_which_controllers_run_and_refuses_other_components() {
    let folder = folder("resim");
    let (file, log, again) = (folder.join("run.toml"), folder.join("run.mcap"), folder.join("again.mcap"));
    let [scenario] = ["scenarios/hold.toml"].map(|path| Path::new(path).canonicalize().unwrap());
    let controllers = "[[controller]]\nname = \"hold\"\nstart = false\n[[controller]]\nname = \"posture\"\n";
    let text =
        format!("robot = \"centauro\"\nlog = \"unused.mcap\"\n[simulation]\nscenario = {scenario:?}\n{controllers}");
    std::fs::write(&file, text).unwrap();
    hoof(&format!("sim {} --seconds 0.3 --log {}", file.display(), log.display())).exits(0);
    let resim = |log: &Path| hoof(&format!("replay {} --json --resim {}", log.display(), again.display()));
    let report = resim(&log).exits(0).json();
    assert_eq!((&report["same_bits"], &report["first_difference"]), (&json!(true), &Value::Null));
    let none = "[[controller]]\nname = \"hold\"\nstart = false\n";
    let text = std::fs::read_to_string(&file).unwrap().replace(controllers, none);
    std::fs::write(&file, text).unwrap();
    hoof(&format!("sim {} --seconds 0.1 --log {}", file.display(), log.display())).exits(1);
    assert_eq!(resim(&log).exits(1).json()["same_bits"], true);

    // Another controller runs from tick 100 on.
    std::fs::write(&file, format!("{}{controllers}", std::fs::read_to_string(&file).unwrap().replace(none, "")))
        .unwrap();
    hoof(&format!("sim {} --seconds 0.3 --log {}", file.display(), log.display())).exits(0);
    let switched = folder.join("switched.mcap");
    rewrite_one(&log, &switched, CONTROLLER_INPUT, 100, |input: &mut ControllerInput| {
        let mut data = Vec::new();
        lcmtypes::Running { t_ns: input.t_ns, running: 1 }.encode(&mut data).unwrap();
        let size = data.len().try_into().unwrap();
        input.messages.push(Delivered { channel: "RUNNING".to_owned(), t_arrival_ns: input.t_ns, size, data });
        input.n_messages += 1;
    });
    assert!(resim(&switched).exits(2).stderr.contains("tick 100"));

    run(&log);
    assert!(resim(&log).exits(2).stderr.contains("3 components"));
}

#[test]
fn a_changed_bit_is_found_in_its_component() {
    let folder = folder("changed");
    let (log, other) = (folder.join("run.mcap"), folder.join("other.mcap"));
    run(&log);
    // The last bit of a gain of a joint of arms.
    let bit = |x: &mut f64| *x = f64::from_bits(x.to_bits() ^ 1);
    rewrite_one(&log, &other, "arms/ROBOT_COMMAND", 42, |command: &mut RobotCommand| bit(&mut command.kp[3]));
    let report = replay(&other, "").exits(1).json();
    let first = &report["first_divergence"];
    let place = ["channel", "tick", "field", "index"].map(|key| first[key].clone());
    assert_eq!(place, [json!("arms/ROBOT_COMMAND"), json!(42), json!("kp"), json!(3)], "{report:#}");
    assert_eq!(report["components"][1]["first_divergence"], *first);
    let identical = report["components"].as_array().unwrap().iter().map(|one| one["identical"].clone());
    assert_eq!(identical.collect::<Value>(), json!([true, false, true]));
    // The first component consumed the unchanged bytes.
    assert_eq!(report["release_violations"]["first"]["what"], "other_bytes", "{report:#}");
    assert_eq!(report["identical"], false);

    // The reference of the planner has no tick; it is found by its time.
    rewrite_one(&log, &other, "planner/JOINT_REFERENCE", 7, |reference: &mut lcmtypes::JointReference| {
        bit(&mut reference.q[0])
    });
    let report = replay(&other, "").exits(1).json();
    let first = &report["first_divergence"];
    assert_eq!(
        (&first["channel"], &first["tick"], &first["field"]),
        (&json!("planner/JOINT_REFERENCE"), &json!(7), &json!("q"))
    );

    // The command of arms that the first component holds, in its snapshot.
    rewrite_one(&log, &other, CONTROLLER_SNAPSHOT, 1000, |state: &mut ComponentState| {
        let mut shared = SharedState::decode(&state.controller.data).unwrap();
        bit(&mut shared.commands[0].kp[3]);
        state.controller.data.clear();
        shared.encode(&mut state.controller.data).unwrap();
    });
    let report = replay(&other, "").exits(1).json();
    let first = &report["first_divergence"];
    assert_eq!((&first["channel"], &first["tick"]), (&json!(CONTROLLER_SNAPSHOT), &json!(1000)), "{report:#}");

    // All inputs of arms are missing.
    let mut log_without = replay::log::LogWriter::create(&other).unwrap();
    for event in events(&log).iter().filter(|event| &*event.channel != "arms/CONTROLLER_INPUT") {
        log_without.write(&event.channel, event.t_ns, &event.data).unwrap();
    }
    log_without.finish().unwrap();
    let report = replay(&other, "").exits(3).json();
    assert_eq!(names(&report)[1], json!(["arms", 0, false, false]), "{report:#}");
    hoof(&format!("log verify {} --json", other.display())).exits(1);
}

#[test]
fn a_delivery_at_another_time_is_found() {
    let folder = folder("release");
    let (log, other) = (folder.join("run.mcap"), folder.join("other.mcap"));
    run(&log);
    let is_of_arms = |message: &Delivered| message.channel == "arms/ROBOT_COMMAND";
    // Moves the command of arms in the input of base tick 1000 to another one; its input was that of base tick 980.
    let moved = |to_tick: Option<i64>| {
        let mut taken = None;
        for event in events(&log).iter().filter(|event| *event.channel == *CONTROLLER_INPUT) {
            let input = ControllerInput::decode(&event.data).unwrap();
            if input.tick == 1000 {
                taken = input.messages.into_iter().find(is_of_arms);
            }
        }
        let taken = taken.unwrap();
        rewrite(&log, &other, |event| {
            if *event.channel != *CONTROLLER_INPUT {
                return;
            }
            let mut input = ControllerInput::decode(&event.data).unwrap();
            if input.tick == 1000 {
                input.messages.retain(|message| !is_of_arms(message));
            }
            if Some(input.tick) == to_tick {
                input.messages.push(taken.clone());
            }
            input.n_messages = input.messages.len().try_into().unwrap();
            event.data.clear();
            input.encode(&mut event.data).unwrap();
        });
        replay(&other, "").exits(1).json()["release_violations"].clone()
    };
    let violation = |count: u64, tick: i64, what: &str| {
        json!({"count": count, "first": {
            "component": "legs", "channel": "arms/ROBOT_COMMAND", "tick": tick, "what": what,
            "expected_base_tick": 1000, "found_base_tick": tick,
        }})
    };
    assert_eq!(moved(Some(999)), violation(1, 999, "early"));
    assert_eq!(moved(Some(1003)), violation(1, 1000, "not_delivered"));
    assert_eq!(moved(None), violation(1, 1000, "not_delivered"));
}

/// Names with the component in front select fields for figures and files.
#[test]
fn fields_of_a_component_are_plotted_and_exported_by_name() {
    let folder = folder("fields");
    let (log, plots) = (folder.join("run.mcap"), folder.join("plots.toml"));
    run(&log);
    let fields = r#"["arms/ROBOT_COMMAND.tau[3]", "arms/CONTROLLER_INPUT.state.q[0]", "planner/JOINT_REFERENCE.q[1]"]"#;
    std::fs::write(&plots, format!("[[figure]]\nname = \"arms\"\nkind = \"fields\"\nfields = {fields}\n")).unwrap();
    let (report, table) = (folder.join("report"), folder.join("table"));
    hoof(&format!("report {} --out {} --plots {}", log.display(), report.display(), plots.display())).exits(0);
    assert!(report.join("arms.svg").is_file());
    hoof(&format!("log convert {} {} --to csv", log.display(), table.display())).exits(0);
    let commands = std::fs::read_to_string(table.join("arms_ROBOT_COMMAND.csv")).unwrap();
    assert!(commands.lines().next().unwrap().split(',').any(|column| column == "tau[3]"));
    assert_eq!(commands.lines().count(), 1 + 75);
}

/// Where a component runs changes no bit apart from RUN_INFO and the messages about wall-clock time.
#[test]
fn where_a_component_runs_changes_no_bit() {
    let folder = folder("runs");
    let text = run_file();
    let run_of = |places: [&str; 2]| {
        let [arms, planner] = places;
        let text = text
            .replace("runs = \"worker\"", &format!("runs = \"{arms}\""))
            .replace("runs = \"process\"", &format!("runs = \"{planner}\""));
        let (file, log) = (folder.join("run.toml"), folder.join(format!("{arms}_{planner}.mcap")));
        std::fs::write(&file, text).unwrap();
        hoof(&format!("sim {} --seconds 0.5 --log {}", file.display(), log.display())).exits(0);
        let mut found = Vec::new();
        for event in events(&log) {
            let (_, name) = lcmtypes::channels::split(&event.channel);
            if name == RUN_INFO || name == "TIMING" {
                continue;
            }
            found.push((event.channel.to_string(), event.t_ns, event.data));
        }
        found
    };
    let first = run_of(["rt", "rt"]);
    assert!(first.len() > 1000);
    // run_id is a digest of RUN_INFO: compared without it.
    for places in [["worker", "process"], ["process", "worker"]] {
        let other = run_of(places);
        assert_eq!(first.len(), other.len());
        for (a, b) in first.iter().zip(&other) {
            assert_eq!((&a.0, a.1), (&b.0, b.1));
            assert!(without_run_id(&a.2) == without_run_id(&b.2), "{places:?}: {} at {} ns", a.0, a.1);
        }
    }
}

/// A message of the log with 0 in place of `run_id` and `sender_id`, and without digests that contain them.
fn without_run_id(message: &[u8]) -> Vec<(String, String)> {
    let mut leaves = Vec::new();
    leaves_of(message, "", &mut leaves);
    leaves
}

fn leaves_of(message: &[u8], path: &str, leaves: &mut Vec<(String, String)>) {
    if let Ok(input) = ControllerInput::decode(message) {
        for delivered in &input.messages {
            leaves_of(&delivered.data, &format!("{path}{}.", delivered.channel), leaves);
        }
        leaves.push((format!("{path}tick"), input.tick.to_string()));
        return;
    }
    let ty = lcmtypes::types().of_message(message).unwrap();
    ty.walk(message, |field, leaf| {
        let field = field.to_string();
        if !["run_id", "sender_id", "digest"].iter().any(|word| field.contains(word)) {
            leaves.push((format!("{path}{field}"), format!("{leaf:?}")));
        }
    })
    .unwrap();
}
