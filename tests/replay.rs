//! Every run replays bit for bit, and every change of a log is found at its tick, stage and field.
#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use common::{Ran, events, folder, hoof, messages, rewrite_one};
use lcmtypes::channels::{
    CONTROLLER_INPUT, CONTROLLER_TICK, LEG_STATE, ROBOT_COMMAND, ROBOT_STATE, RUN_INFO, TIMING, WBC_SOLUTION,
};
use lcmtypes::{ControllerInput, ControllerTick, LegState, RobotCommand, RobotState, TickInput, WbcSolution};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Two seconds of trot over stones: 2000 ticks, snapshots of the controller at 0 and 1000.
fn run(log: &Path, more: &str) -> Ran {
    hoof(&format!("sim --robot hyq --scenario scenarios/short_rough.toml --json --log {} {more}", log.display()))
}

fn replay(log: &Path, more: &str) -> Ran {
    hoof(&format!("replay {} --json {more}", log.display()))
}

/// The report without wall-clock times.
fn without_time(mut report: Value) -> Value {
    for key in ["wall_seconds", "real_time_factor"] {
        assert!(report.as_object_mut().unwrap().remove(key).is_some(), "{key}");
    }
    report
}

#[track_caller]
fn assert_identical(report: &Value, ticks: u64) {
    assert_eq!(report["identical"], true, "{report:#}");
    assert_eq!(report["first_divergence"], Value::Null, "{report:#}");
    assert_eq!(report["ticks"], ticks, "{report:#}");
    for key in ["messages_different", "messages_not_recorded", "unverifiable_ticks", "missing_input_ticks"] {
        assert_eq!(report[key], 0, "{key}: {report:#}");
    }
}

/// Checks exit code 1 and fields of the first difference.
#[track_caller]
fn divergence(ran: Ran, expected: &Value) -> Value {
    let report = ran.exits(1).json();
    assert_eq!(report["identical"], false);
    let found = &report["first_divergence"];
    for (key, value) in expected.as_object().unwrap() {
        assert_eq!(&found[key], value, "{key}: {found:#}");
    }
    report
}

#[test]
fn a_log_of_either_format_replays_bit_for_bit_in_any_number_of_threads_and_from_the_middle() {
    let folder = folder("either_format");
    for log in [folder.join("run.mcap"), folder.join("run.lcmlog")] {
        assert_eq!(run(&log, "").exits(0).json()["ticks"], 2000);
        let one = without_time(replay(&log, "--jobs 1").exits(0).json());
        assert_identical(&one, 2000);
        // Six messages per tick, and a snapshot per second.
        assert_eq!((&one["messages_compared"], &one["snapshots_compared"]), (&json!(12_002), &json!(2)));
        assert_eq!(without_time(replay(&log, "--jobs 2").exits(0).json()), one);

        // Starts with the snapshot after tick 1000, ends with tick 1500.
        for jobs in ["", "--jobs 2"] {
            let middle = replay(&log, &format!("--from 1.2 --to 1.5 {jobs}")).exits(0).json();
            assert_identical(&middle, 500);
            assert_eq!((&middle["first_t_ns"], &middle["last_t_ns"]), (&json!(1_001_000_000), &json!(1_500_000_000)));
        }
    }
}

#[test]
fn two_runs_of_one_scenario_and_seed_differ_in_timing_only() {
    let folder = folder("two_runs");
    let logs: Vec<PathBuf> = ["a.mcap", "b.mcap", "c.lcmlog", "other_seed.mcap"].map(|name| folder.join(name)).into();
    for (log, more) in logs.iter().zip(["--seed 5", "--seed 5", "--seed 5", "--seed 6"]) {
        run(log, more).exits(0);
    }
    let comparable = |log: &PathBuf| -> Vec<(String, i64, Vec<u8>)> {
        let data = |event: &replay::log::Event| if *event.channel == *TIMING { Vec::new() } else { event.data.clone() };
        events(log).iter().map(|event| (event.channel.to_string(), event.t_ns, data(event))).collect()
    };
    let first = comparable(&logs[0]);
    assert_eq!(first.iter().filter(|(channel, ..)| channel == RUN_INFO).count(), 1);
    assert_eq!(first.iter().filter(|(channel, ..)| channel == TIMING).count(), 2000);
    for log in &logs[1..3] {
        let again = comparable(log);
        let differs = first.iter().zip(&again).position(|(a, b)| a != b);
        assert_eq!(differs.map(|i| (i, &first[i].0, &again[i].0)), None, "{}", log.display());
        assert_eq!(first.len(), again.len(), "{}", log.display());
    }
    let other = comparable(&logs[3]);
    for channel in [RUN_INFO, CONTROLLER_INPUT] {
        let of = |log: &[(String, i64, Vec<u8>)]| log.iter().filter(|e| e.0 == channel).cloned().collect::<Vec<_>>();
        assert!(of(&first) != of(&other), "another seed does not change {channel}");
    }
}

#[test]
fn one_flipped_bit_of_one_input_is_found_at_its_tick() {
    let folder = folder("flipped_input");
    let (log, flipped) = (folder.join("run.mcap"), folder.join("flipped.mcap"));
    run(&log, "").exits(0);
    for tick in [0, 1, 777, 1000, 1001, 1999] {
        rewrite_one(&log, &flipped, CONTROLLER_INPUT, tick, |input: &mut ControllerInput| {
            assert!(input.change(ROBOT_STATE, |state: &mut RobotState| {
                state.q[4] = f64::from_bits(state.q[4].to_bits() ^ 1);
            }));
        });
        let expected = json!({
            "tick": tick, "t_ns": tick * 1_000_000, "stage": "input", "channel": CONTROLLER_TICK, "field": "digest_input",
        });
        for jobs in ["", "--jobs 2"] {
            divergence(replay(&flipped, jobs), &expected);
        }
    }
}

#[test]
fn one_flipped_bit_of_one_output_is_found_by_channel_field_and_tick() {
    let folder = folder("flipped_output");
    let (log, flipped) = (folder.join("run.lcmlog"), folder.join("flipped.lcmlog"));
    run(&log, "").exits(0);

    let flip = |x: &mut f64| *x = f64::from_bits(x.to_bits() ^ 1);
    rewrite_one(&log, &flipped, ROBOT_COMMAND, 1234, |command: &mut RobotCommand| flip(&mut command.tau[7]));
    let expected =
        json!({ "tick": 1234, "stage": "output", "channel": ROBOT_COMMAND, "field": "tau", "index": 7, "ulp": 1 });
    let report = divergence(replay(&flipped, ""), &expected);
    // The inputs are unchanged, so nothing else differs.
    assert_eq!((&report["ticks"], &report["messages_different"]), (&json!(2000), &json!(1)));

    rewrite_one(&log, &flipped, LEG_STATE, 900, |legs: &mut LegState| flip(&mut legs.p_BF_H_des[2][1]));
    let expected = json!({
        "tick": 900, "stage": "gait", "channel": LEG_STATE, "field": "p_BF_H_des", "index": [2, 1], "ulp": 1,
    });
    divergence(replay(&flipped, ""), &expected);
}

#[test]
fn a_changed_parameter_is_found_at_the_first_tick_that_it_affects() {
    let folder = folder("changed_parameter");
    let log = folder.join("run.mcap");
    run(&log, "").exits(0);
    let legs: Vec<LegState> = messages(&log, LEG_STATE);
    let inputs = controller::Unpacked::all(&messages::<ControllerInput>(&log, CONTROLLER_INPUT));

    // The step height is first used when a foot first lifts off.
    let swings = |legs: &&LegState| legs.state.iter().any(|state| *state != LegState::STATE_STANCE);
    let lift_off = legs.iter().find(swings).unwrap().tick;
    assert!(lift_off > 0);
    let expected = json!({ "tick": lift_off, "stage": "gait" });
    divergence(replay(&log, "--set swing.height=0.11"), &expected);

    // In stance the reference is the posture of the first tick: the stiffness has no effect until a joint moves.
    let moved = inputs.iter().position(|input| input.state.q != inputs[0].state.q).unwrap();
    assert!(moved > 0);
    let expected = json!({ "tick": moved, "stage": "tasks" });
    divergence(replay(&log, "--set posture.stance_kp=[501,501,501]"), &expected);

    // Friction is in the constraints of every tick.
    divergence(replay(&log, "--set wbc.friction=0.7"), &json!({ "tick": 0, "stage": "tasks" }));

    // A limit that is never reached and an unchanged value have no effect.
    for set in ["trunk.max_height_offset=0.11", "wbc.friction=0.6"] {
        assert_identical(&replay(&log, &format!("--set {set}")).exits(0).json(), 2000);
    }
}

/// Changes one parameter of each stage after the input and computes from the log the first tick that it affects. `scripts/mutants.py` does the
/// same with changes of the code.
#[test]
fn a_change_in_a_stage_of_the_controller_is_attributed_to_it() {
    let folder = folder("stages");
    let log = folder.join("run.mcap");
    run(&log, "").exits(0);
    let inputs = controller::Unpacked::all(&messages::<ControllerInput>(&log, CONTROLLER_INPUT));
    let solutions: Vec<WbcSolution> = messages(&log, WBC_SOLUTION);
    let legs: Vec<LegState> = messages(&log, LEG_STATE);

    // The velocity filter has no effect before the first joint velocity.
    let moves = |input: &TickInput| input.tick > 0 && input.state.qd.iter().any(|qd| *qd != 0.0);
    let moves = inputs.iter().position(moves).unwrap();
    let set = "--set recovery.velocity_time_constant=0.06";
    divergence(replay(&log, set), &json!({ "tick": moves, "stage": "estimation", "field": "digest_estimation" }));

    // Gains of the swing foot and of swing joints have an effect from the first lift-off on.
    let swings = |legs: &LegState| legs.state.iter().any(|state| *state != LegState::STATE_STANCE);
    let lift_off = legs.iter().position(swings).unwrap();
    divergence(replay(&log, "--set swing.clik_gain=10.5"), &json!({ "tick": lift_off, "stage": "gait" }));
    divergence(replay(&log, "--set posture.swing_kd=[31,31,31]"), &json!({ "tick": lift_off, "stage": "tasks" }));

    // A lower iteration limit has an effect in the first tick that needs more iterations.
    let most = solutions.iter().map(|solution| solution.iterations).max().unwrap() - 1;
    let long = solutions.iter().position(|solution| solution.iterations > most).unwrap();
    let expected = json!({ "tick": long, "stage": "qp", "channel": WBC_SOLUTION, "field": "status" });
    divergence(replay(&log, &format!("--set wbc.max_iterations={most}")), &expected);

    // The damping gain is used in MODE_DAMPING only.
    let fault = "[[fault]]\nkind = \"nan_sensor\"\njoint = \"rf_hfe_joint\"\nt_s = 0.9\nduration_s = 0.01";
    let (_, ticks) = run_with(&folder, "nan", fault);
    let damped = ticks.iter().position(|tick| tick.mode == ControllerTick::MODE_DAMPING).unwrap();
    let expected = json!({ "tick": damped, "stage": "output", "channel": ROBOT_COMMAND, "field": "kd", "index": 0 });
    divergence(replay(&folder.join("nan.mcap"), "--set safety.damping=6.5"), &expected);
}

/// Two seconds of trot on flat ground with additional scenario entries. Returns the summary of the run and its ticks.
fn run_with(folder: &Path, name: &str, entries: &str) -> (Ran, Vec<ControllerTick>) {
    let (scenario, log) = (folder.join(format!("{name}.toml")), folder.join(format!("{name}.mcap")));
    let text = std::fs::read_to_string("scenarios/short_flat.toml").unwrap();
    std::fs::write(&scenario, format!("{text}\n{entries}\n")).unwrap();
    let ran = hoof(&format!("sim --robot hyq --scenario {} --json --log {}", scenario.display(), log.display()));
    let ticks: Vec<ControllerTick> = messages(&log, CONTROLLER_TICK);
    for jobs in ["--jobs 1", "--jobs 2"] {
        assert_identical(&replay(&log, jobs).exits(0).json(), ticks.len() as u64);
    }
    (ran, ticks)
}

/// Checks that the robot walks until `tick` and then is in MODE_DAMPING with this fault.
#[track_caller]
fn assert_damps_from((ran, ticks): (Ran, Vec<ControllerTick>), tick: usize, fault: i32, fault_index: i32) -> f64 {
    assert!(ran.exits(1).json()["safe_state"].is_string());
    assert_eq!(ticks[tick - 1].mode, ControllerTick::MODE_WALK);
    for late in &ticks[tick..] {
        assert_eq!(
            (late.mode, late.fault, late.fault_index),
            (ControllerTick::MODE_DAMPING, fault, fault_index),
            "tick {}",
            late.tick
        );
    }
    ticks[tick].fault_value
}

#[test]
fn pushes_replay_bit_for_bit() {
    let folder = folder("pushes");
    let pushes = "[[push]]\nt_s = 0.5\nduration_s = 0.2\nforce_W = [0.0, 80.0, 0.0]\n\
                  [[push]]\nt_s = 1.0\nduration_s = 0.1\ntorque_W = [0.0, 0.0, 40.0]\n";
    let (ran, ticks) = run_with(&folder, "pushed", pushes);
    let summary = ran.exits(0).json();
    assert_eq!((&summary["fell"], &summary["safe_state"]), (&json!(false), &Value::Null));
    assert_eq!(ticks.len(), 2000);
    let (_, undisturbed) = run_with(&folder, "undisturbed", "");
    // Inputs have the identity of their run; estimates depend on the measured state only.
    let is_different = |(a, b): (&ControllerTick, &ControllerTick)| a.digest[1] != b.digest[1];
    let first_difference = ticks.iter().zip(&undisturbed).position(is_different);
    // A push acts on the step that follows its tick.
    assert_eq!(first_difference, Some(501));
}

#[test]
fn a_sensor_that_reads_nan_leads_to_damping_in_the_same_tick() {
    let folder = folder("nan_sensor");
    let fault = "[[fault]]\nkind = \"nan_sensor\"\njoint = \"rf_hfe_joint\"\nt_s = 0.9\nduration_s = 0.01";
    let ran = run_with(&folder, "nan", fault);
    let value = assert_damps_from(ran, 900, ControllerTick::FAULT_INPUT_NOT_FINITE, 4);
    assert!(value.is_nan());
    let commands: Vec<RobotCommand> = messages(&folder.join("nan.mcap"), ROBOT_COMMAND);
    assert_eq!(commands[899].mode, RobotCommand::MODE_TORQUE);
    for command in &commands[900..] {
        assert_eq!(command.mode, RobotCommand::MODE_DAMPING);
        assert!(command.tau.iter().chain(&command.kp).all(|x| *x == 0.0));
        assert!(command.kd.iter().all(|x| *x > 0.0));
    }
}

#[test]
fn missing_states_lead_to_damping_after_the_age_limit() {
    let folder = folder("drop_state");
    let drop = |milliseconds: i32| {
        let fault =
            format!("[[fault]]\nkind = \"drop_state\"\nt_s = 0.9\nduration_s = {}", f64::from(milliseconds) * 1e-3);
        run_with(&folder, &format!("{milliseconds}_ms"), &fault)
    };
    // The last state is that of tick 899; one of 10 ms is still good, so tick 910 is the first to find it too old.
    let age = assert_damps_from(drop(100), 910, ControllerTick::FAULT_STATE_STALE, -1);
    assert!((age - 0.011).abs() < 1e-12, "{age}");
    let (ran, ticks) = drop(10);
    assert_eq!(ran.exits(0).json()["safe_state"], Value::Null);
    assert!(ticks[900..].iter().all(|tick| tick.mode == ControllerTick::MODE_WALK));
}

#[test]
fn a_stuck_encoder_is_walked_over_and_replays_bit_for_bit() {
    let folder = folder("stuck_encoder");
    let fault = "[[fault]]\nkind = \"stuck_encoder\"\njoint = \"lf_kfe_joint\"\nt_s = 0.9\nduration_s = 0.05";
    let (ran, ticks) = run_with(&folder, "stuck", fault);
    assert_eq!(ran.exits(0).json()["fell"], false);
    assert!(ticks[900..].iter().all(|tick| tick.mode == ControllerTick::MODE_WALK));
    let inputs = controller::Unpacked::all(&messages::<ControllerInput>(&folder.join("stuck.mcap"), CONTROLLER_INPUT));
    let held = inputs[900].state.q[2];
    assert!(inputs[900..950].iter().all(|input| input.state.q[2] == held && input.state.qd[2] == 0.0));
    assert!(inputs[949].state.q[1] != inputs[900].state.q[1] && inputs[950].state.q[2] != held);
}

#[test]
fn a_knee_without_torque_ends_in_damping_and_replays_bit_for_bit() {
    let folder = folder("torque_loss");
    let fault = |factor: f64| {
        format!(
            "[[fault]]\nkind = \"torque_loss\"\njoint = \"lf_kfe_joint\"\nfactor = {factor:?}\nt_s = 0.9\nduration_s = 9.0"
        )
    };
    let (ran, ticks) = run_with(&folder, "none_left", &fault(0.0));
    assert!(ran.exits(1).json()["safe_state"].is_string());
    let last = ticks.last().unwrap();
    assert_eq!(last.mode, ControllerTick::MODE_DAMPING);
    // The leg collapses; which fault is detected first depends on the motion.
    let known = [ControllerTick::FAULT_QP, ControllerTick::FAULT_TILT, ControllerTick::FAULT_JOINT_VELOCITY];
    assert!(known.contains(&last.fault), "fault {}", last.fault);
    let gave_up = ticks.iter().position(|tick| tick.mode == ControllerTick::MODE_DAMPING).unwrap();
    assert!(gave_up > 900 && ticks[gave_up..].iter().all(|tick| tick.mode == ControllerTick::MODE_DAMPING));

    let (ran, _) = run_with(&folder, "most_left", &fault(0.8));
    assert_eq!(ran.exits(0).json()["fell"], false);
}

/// Writes the events of a golden log after a change of their list.
fn edited(out: &Path, change: impl FnOnce(&mut Vec<replay::log::Event>)) {
    let mut list = events(Path::new("logs/golden/flat_trot.mcap"));
    change(&mut list);
    let mut log = replay::log::LogWriter::create(out).unwrap();
    list.iter().for_each(|event| log.write(&event.channel, event.t_ns, &event.data).unwrap());
    log.finish().unwrap();
}

/// Whatever a replay cannot use makes `verify` fail too, and a log that `verify` finds good replays with exit code 0.
#[test]
fn verify_and_replay_agree() {
    type Edit = fn(&mut Vec<replay::log::Event>);
    let edits: [(&str, i32, Edit); 8] = [
        ("nothing", 0, |_| {}),
        ("foreign", 0, |list| {
            let mut foreign = list[500].clone();
            (foreign.channel, foreign.data) = ("CONTROLLER_INPUT".into(), vec![0xa5; 100]);
            list.insert(500, foreign);
        }),
        ("dropped_input", 3, |list| drop(list.remove(place(list, CONTROLLER_INPUT, 700)))),
        ("dropped_tick", 3, |list| drop(list.remove(place(list, CONTROLLER_TICK, 700)))),
        ("doubled", 3, |list| {
            let at = place(list, CONTROLLER_INPUT, 700);
            let mut other = list[at].clone();
            let last = other.data.len() - 1;
            other.data[last] ^= 1;
            list.insert(at + 1, other);
        }),
        ("late_input", 3, |list| {
            let late = list.remove(place(list, CONTROLLER_INPUT, 700));
            let to = place(list, CONTROLLER_INPUT, 1400);
            list.insert(to, replay::log::Event { t_ns: list[to].t_ns, ..late });
        }),
        ("negative_tick", 3, |list| {
            let at = place(list, ROBOT_COMMAND, 700);
            list[at].data[16] |= 0x80;
        }),
        ("undecodable", 3, |list| {
            let at = place(list, CONTROLLER_INPUT, 700);
            list[at].data.truncate(90);
        }),
    ];
    let folder = folder("agree");
    for (name, code, edit) in edits {
        let log = folder.join(format!("{name}.mcap"));
        edited(&log, edit);
        let report = replay(&log, "").exits(code).json();
        assert_eq!(
            (&report["identical"], &report["complete"]),
            (&json!(true), &json!(code == 0)),
            "{name}: {report:#}"
        );
        let verified = hoof(&format!("log verify {} --json", log.display())).exits(i32::from(code != 0)).json();
        assert_eq!(verified["replay"]["complete"], code == 0, "{name}: {verified:#}");
        assert_eq!(verified["replay"]["unused"], report["unused"], "{name}");
    }
}

fn place(list: &[replay::log::Event], channel: &str, tick: i64) -> usize {
    list.iter().position(|event| *event.channel == *channel && event.data[16..24] == tick.to_be_bytes()).unwrap()
}

/// A simulation starts from the first posture of the robot, so that of an excerpt cannot be repeated.
#[test]
fn an_excerpt_from_the_middle_is_not_simulated_again() {
    let folder = folder("resim_excerpt");
    let (part, again) = (folder.join("part.mcap"), folder.join("again.mcap"));
    let golden = "logs/golden/flat_trot.mcap";
    hoof(&format!("log trim {golden} {} --around 1.6 --before 0.2 --after 0.2", part.display())).exits(0);
    replay(&part, "").exits(0);
    // The log of a run that is selected by its number is not overwritten either.
    let same = replay(&part, &format!("--run 1 --resim {}", part.display())).exits(2);
    assert!(same.stderr.contains("same file"), "{}", same.stderr);
    let refused = replay(&part, &format!("--resim {}", again.display())).exits(2);
    assert!(refused.stderr.contains("tick 1001") && !again.exists(), "{}", refused.stderr);
}
