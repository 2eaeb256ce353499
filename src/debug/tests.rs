//! The screen at any size: no number is shown in part, and panels never run into each other.

use super::events::{Event, Kind};
use super::printed;
use super::view::Screen;
use controller::dump::{
    ContactSummary, Dump, GaitSummary, LevelSummary, Overview, Phase, PhaseKind, Quantity, TermSummary, Value,
};
use controller::qp::{NamedViolation, QpStatus};
use lcmtypes::{ControllerTick, Message, RobotCommand, RunInfo, TickInput, channels};
use replay::engine::Moment;
use std::collections::BTreeSet;

const LEGS: [&str; 4] = ["LF", "RF", "LH", "RH"];

/// A tick with numbers that are all different and as long as they get.
fn overview() -> Overview {
    let named = |name: &str, unit, value| Quantity { name: name.to_owned(), unit, value };
    let contact = |k: usize| {
        let x = k as f64;
        ContactSummary {
            name: LEGS[k].to_owned(),
            phase: Some(Phase { name: "SwingDown", kind: PhaseKind::Swing }),
            t_phase: Some(12.345 + x),
            in_contact: Some(k == 0),
            f_z_est: Some(-123.4 - x),
            f_z_qp: Some(567.8 + x),
            f_z_bounds: Some([20.0 + x, 1000.0 + x]),
            p_des: Some([0.371 + x, -0.207 - x, -0.581 - x]),
        }
    };
    let term = |task: &str, weight, residual| TermSummary { task: task.to_owned(), weight, residual };
    Overview {
        gait: Some(GaitSummary { name: "crawl".to_owned(), clock: 0.417 }),
        contacts: (0..4).map(contact).collect(),
        base: vec![
            named("rpy", "rad", Value::Numbers(vec![-0.0101, 0.0202, -3.1303])),
            named("e_o_W", "rad", Value::Numbers(vec![0.0404, -0.0505, 0.0606])),
            named("height", "m", Value::Number(0.5707)),
            named("v_H_des", "m/s", Value::Numbers(vec![0.8008, -0.9009])),
        ],
        levels: vec![LevelSummary {
            status: Some(QpStatus::Solved),
            iterations: 17,
            n_active: 23,
            terms: vec![term("contact", 1e6, 6.25e-3), term("trunk", 1e3, 7.36e-2), term("posture", 1.0, 8.47e1)],
            active: vec!["normal force of LF".to_owned(), "upper bound of acceleration of rh_kfe_joint".to_owned()],
        }],
        conflict: None,
    }
}

fn moment(overview: Overview) -> Moment {
    let encoded = |message: &dyn Fn(&mut Vec<u8>)| {
        let mut bytes = Vec::new();
        message(&mut bytes);
        bytes
    };
    let tick = ControllerTick {
        mode: ControllerTick::MODE_DAMPING,
        fault: ControllerTick::FAULT_JOINT_POSITION,
        fault_index: 4,
        fault_value: -2.625,
        ..ControllerTick::default()
    };
    let command = RobotCommand {
        nj: 12,
        tau: (0..12).map(|j| -101.1 - f64::from(j)).collect(),
        q_des: vec![0.0; 12],
        qd_des: vec![0.0; 12],
        kp: vec![0.0; 12],
        kd: vec![0.0; 12],
        ..RobotCommand::default()
    };
    Moment {
        tick: 123_456,
        t_ns: 0,
        since_s: 123.456,
        input: TickInput::default(),
        recorded: Vec::new(),
        replayed: vec![
            (channels::CONTROLLER_TICK, encoded(&|bytes| tick.encode(bytes).unwrap())),
            (channels::ROBOT_COMMAND, encoded(&|bytes| command.encode(bytes).unwrap())),
        ],
        beside: Vec::new(),
        divergence: None,
        dump: Dump { overview, ..Dump::default() },
        is_snapshot: true,
    }
}

fn screen(moment: &Moment, size: (u16, u16)) -> String {
    let event = |kind, text: &str| Event { kind, text: text.to_owned() };
    let events = [
        event(Kind::Touchdown, "LF touches down"),
        event(Kind::MissedDeadline, "command 250 µs after its deadline"),
        event(Kind::Event, "executor: 98765 of 43210"),
    ];
    let info = RunInfo { robot: "hyq".to_owned(), scenario_name: "short_flat_31415".to_owned(), ..RunInfo::default() };
    let joints: Vec<String> = (0..12).map(|j| format!("joint_{j}")).collect();
    let message = "search stopped at tick 112233: no EVENT found";
    let screen = Screen {
        log: "logs/run_27182.mcap",
        info: &info,
        joints: &joints,
        last_tick: 654_321,
        moment,
        events: &events,
        message,
    };
    printed(&screen, size).unwrap()
}

/// Words with a digit, except counts of missing lines and words marked as incomplete.
fn numbers(screen: &str) -> BTreeSet<String> {
    let line = |line: &str| -> Vec<String> {
        let mut words: Vec<&str> = line.split_whitespace().collect();
        // "… 3 more" in either half.
        while let Some(k) = words.iter().position(|word| *word == "more") {
            words.drain(k.saturating_sub(2)..=k);
        }
        let digit = |word: &&&str| word.contains(|c: char| c.is_ascii_digit()) && !word.contains('…');
        words.iter().filter(digit).map(|word| word.trim_end_matches([',', ':']).to_owned()).collect()
    };
    screen.lines().flat_map(line).collect()
}

#[test]
fn no_size_of_the_screen_shows_part_of_a_number() {
    let conflict = vec![NamedViolation { name: "base dynamics, force z of 4711".to_owned(), by: 12.346 }];
    for overview in [overview(), Overview { conflict: Some(conflict), ..overview() }, Overview::default()] {
        let moment = moment(overview);
        let whole = numbers(&screen(&moment, (400, 100)));
        for width in 1..=160 {
            for height in [1, 10, 24, 30, 50] {
                let shown = screen(&moment, (width, height));
                let partial: Vec<_> = numbers(&shown).difference(&whole).cloned().collect();
                assert!(partial.is_empty(), "{width}x{height}: {partial:?} are not numbers of the tick\n{shown}");
            }
        }
    }
}

#[test]
fn a_terminal_of_80_by_24_shows_all_legs_and_levels() {
    let shown = screen(&moment(overview()), (80, 24));
    for leg in LEGS {
        let row =
            shown.lines().find(|line| line.starts_with(leg)).unwrap_or_else(|| panic!("no row of {leg}\n{shown}"));
        assert!(row.contains("SwingDown"), "{shown}");
    }
    let contacts = overview().contacts;
    for contact in &contacts {
        let [Some(est), Some(qp)] = [contact.f_z_est, contact.f_z_qp] else { unreachable!("set above") };
        assert!(shown.contains(&format!("{est:.1}")) && shown.contains(&format!("{qp:.1}")), "{shown}");
    }
    for (task, residual) in [("contact", "6.25e-3"), ("trunk", "7.36e-2"), ("posture", "8.47e1")] {
        let row = shown.lines().find(|line| line.trim_start().starts_with(task)).expect(task);
        assert!(row.contains(residual), "{shown}");
    }
    assert!(shown.contains("DAMPING") && shown.contains("-2.625") && shown.contains("joint_4"), "{shown}");
}
