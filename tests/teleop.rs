//! `hoof teleop` on a real bus: what a script makes it send, and what it says when its person is gone.
#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use common::{Ran, command, folder, hoof, messages, ran};
use lcmtypes::bus::{Bus, LcmBus};
use lcmtypes::{ControllerInput, ControllerTick, Event, Message, OperatorCommand, channels};
use std::io::Write;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

type Op = OperatorCommand;

/// A network of its own for each test and process: a port, since liblcm hears every group that anybody on the machine has joined.
fn url(test: u32) -> String {
    format!("udpm://239.255.76.67:{}?ttl=0", 10_000 + std::process::id() % 1200 * 8 + test)
}

fn hear(url: &str) -> LcmBus {
    let mut bus = LcmBus::open(url).unwrap();
    bus.subscribe("OPERATOR_TELEOP|EVENT").unwrap();
    bus
}

/// What has come since the last time, until nothing more does.
fn heard(bus: &mut LcmBus) -> (Vec<OperatorCommand>, Vec<String>) {
    let (mut commands, mut events) = (Vec::new(), Vec::new());
    loop {
        let messages = bus.handle(Duration::from_millis(200)).unwrap();
        if messages.is_empty() {
            return (commands, events);
        }
        for message in messages {
            match &*message.channel {
                channels::EVENT => events.push(Event::decode(&message.data).unwrap().text),
                _ => commands.push(OperatorCommand::decode(&message.data).unwrap()),
            }
        }
    }
}

/// Runs it with lines on standard input.
fn script(url: &str, lines: &str) -> Ran {
    script_on("OPERATOR_TELEOP", url, lines)
}

fn script_on(channel: &str, url: &str, lines: &str) -> Ran {
    let mut child = command()
        .args(["teleop", "--no-screen", "--lcm-url", url, "--channel", channel])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    child.stdin.take().unwrap().write_all(lines.as_bytes()).unwrap();
    ran(child.wait_with_output().unwrap())
}

#[test]
fn a_script_is_sent_line_by_line_and_stopped_at_its_end() {
    let url = url(1);
    let mut bus = hear(&url);
    // Nobody is there to obey.
    let ran = script(&url, "walk vx=0.2 gait=crawl\nwait 0.2\n\nyaw=-0.3 # turning\nwait 0.1\n").exits(1);
    assert_eq!(ran.stderr, "warning: no controller is heard here: nobody obeys\n");
    let said = ran.stdout;
    assert!(said.starts_with("the script has ended; the last command was STAND, "), "{said}");
    let (commands, events) = heard(&mut bus);
    let numbers: Vec<i64> = commands.iter().map(|c| c.seq).collect();
    assert_eq!(numbers, (0..commands.len() as i64).collect::<Vec<_>>());
    let mut kinds: Vec<(i8, i8, f64, f64)> = commands.iter().map(|c| (c.mode, c.gait, c.v_H[0], c.yaw_rate)).collect();
    kinds.dedup();
    let (walk, crawl) = (Op::MODE_WALK, Op::GAIT_CRAWL);
    assert_eq!(kinds, [(walk, crawl, 0.2, 0.0), (walk, crawl, 0.2, -0.3), (Op::MODE_STAND, crawl, 0.0, 0.0)]);
    // 0.3 s of heartbeats, and the last command ten times.
    assert!(commands.len() >= 10 + 2, "{} commands", commands.len());
    assert!(commands.windows(2).all(|two| two[0].t_ns < two[1].t_ns));
    assert_eq!(events, ["begins on OPERATOR_TELEOP", "ends: the last command was STAND"]);
}

#[test]
fn a_line_that_is_none_is_named_and_the_robot_stands() {
    let url = url(2);
    let mut bus = hear(&url);
    let said = script(&url, "walk\nwait 0.1\nvx=9\nsit\n").exits(2).stderr;
    assert_eq!(said.trim_end(), "error: standard input:3: vx=9: expected -0.6 to 0.6");
    let (commands, events) = heard(&mut bus);
    assert_eq!(commands.last().unwrap().mode, Op::MODE_STAND);
    assert_eq!(
        events.last().unwrap(),
        "ends: standard input:3: vx=9: expected -0.6 to 0.6; the last command was STAND"
    );
}

#[test]
fn an_emergency_stop_is_not_taken_back_by_leaving() {
    let url = url(3);
    let mut bus = hear(&url);
    let said = script(&url, "walk\nestop\n").exits(1).stdout;
    assert!(said.contains("the last command was EMERGENCY STOP"), "{said}");
    let (commands, _) = heard(&mut bus);
    let mut modes: Vec<i8> = commands.iter().map(|c| c.mode).collect();
    modes.dedup();
    assert_eq!(modes, [Op::MODE_WALK, Op::MODE_DAMPING]);
}

/// A controller that walks as somebody commands on a channel nobody knows, and follows OPERATOR_TELEOP once it speaks, until `then` has run.
fn beside_a_controller(url: &str, then: impl FnOnce()) {
    struct Over<'a>(&'a AtomicBool);
    impl Drop for Over<'_> {
        fn drop(&mut self) {
            self.0.store(true, Ordering::SeqCst);
        }
    }
    let over = AtomicBool::new(false);
    let mut tick = ControllerTick { mode: ControllerTick::MODE_WALK, ..ControllerTick::default() };
    let mut input = ControllerInput { op: Op { seq: 7, t_ns: 1, ..Op::default() }, ..ControllerInput::default() };
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let mut bus = LcmBus::open(url).unwrap();
            bus.subscribe("OPERATOR_TELEOP").unwrap();
            let mut bytes = Vec::new();
            while !over.load(Ordering::SeqCst) {
                for message in bus.handle(Duration::from_millis(5)).unwrap() {
                    input.op = Op::decode(&message.data).unwrap();
                    if input.op.mode == Op::MODE_DAMPING {
                        tick.mode = ControllerTick::MODE_DAMPING;
                    }
                }
                tick.encode(&mut bytes).unwrap();
                bus.publish(channels::CONTROLLER_TICK, &bytes).unwrap();
                bytes.clear();
                input.encode(&mut bytes).unwrap();
                bus.publish(channels::CONTROLLER_INPUT, &bytes).unwrap();
                bytes.clear();
            }
        });
        let _over = Over(&over);
        then();
    });
}

#[test]
fn a_script_has_failed_where_nobody_follows_or_the_robot_does_not_obey() {
    let url = url(0);
    beside_a_controller(&url, || {
        let ran = script_on("OPERATOR_PAD", &url, "estop\nwait 0.2\n").exits(1);
        let wanted = "warning: the controller follows another operator, not OPERATOR_PAD: ";
        assert!(ran.stderr.starts_with(wanted), "{}", ran.stderr);
        let ran = script(&url, "estop\nwait 0.2\n").exits(0);
        assert!(ran.stdout.contains("the emergency stop stays") && ran.stderr.is_empty(), "{ran:?}");
        let ran = script(&url, "stand\nwait 0.2\n").exits(1);
        let wanted = "warning: asked for STAND, the robot is in DAMPING: it leaves that by idle, and then stands\n";
        assert_eq!(ran.stderr, wanted);
    });
}

#[test]
fn who_cannot_command_is_not_announced() {
    let url = url(6);
    let mut bus = hear(&url);
    let no_terminal = hoof(&format!("teleop --lcm-url {url}")).exits(2);
    assert!(no_terminal.stderr.contains("there is no terminal for keys and screen"), "{}", no_terminal.stderr);
    for (channel, wanted) in [
        ("A B", "--channel \"A B\": a channel is 1 to 63 letters, digits, _ and -"),
        ("ROBOT_COMMAND", "--channel \"ROBOT_COMMAND\": hoofprint.robot_command_t is sent there"),
    ] {
        let refused = script_on(channel, &url, "");
        assert!(refused.code == 2 && refused.stderr.contains(wanted), "{}", refused.stderr);
    }
    assert_eq!(heard(&mut bus), (vec![], vec![]));
}

/// Keys as a terminal sends them, on a terminal that `script` of util-linux makes; then the terminal is taken away.
#[test]
fn a_terminal_that_is_gone_stands_the_robot() {
    let url = url(4);
    let mut bus = hear(&url);
    let program = format!("'{}' teleop --lcm-url '{url}'", env!("CARGO_BIN_EXE_hoof"));
    let mut terminal = Command::new("script")
        .args(["-qfc", &program, "/dev/null"])
        .env("TERM", "xterm")
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let mut keys = terminal.stdin.take().unwrap();
    let mut terminal = Running(terminal);
    // A robot that lies, as its controller says, stays lying; nothing has been sent before it was heard.
    let tick = ControllerTick { mode: ControllerTick::MODE_IDLE, ..ControllerTick::default() };
    let mut bytes = Vec::new();
    tick.encode(&mut bytes).unwrap();
    let began = Instant::now();
    let first = loop {
        bus.publish(channels::CONTROLLER_TICK, &bytes).unwrap();
        if let Some(first) =
            bus.handle(Duration::from_millis(20)).unwrap().iter().find(|m| m.channel != channels::EVENT)
        {
            break OperatorCommand::decode(&first.data).unwrap();
        }
        assert!(began.elapsed() < Duration::from_secs(60), "it says nothing");
    };
    assert_eq!((first.mode, first.seq), (Op::MODE_IDLE, 0));
    for (key, mode) in [("\r", Op::MODE_STAND), (" ", Op::MODE_WALK), ("w", Op::MODE_WALK)] {
        keys.write_all(key.as_bytes()).unwrap();
        until(&mut bus, key, |c| c.mode == mode && (key != "w" || c.v_H[0] == 0.3));
    }
    terminal.end();
    until(&mut bus, "the end", |c| c.mode == Op::MODE_STAND && c.v_H[0] == 0.0);
    let (commands, events) = heard(&mut bus);
    assert!(commands.iter().all(|c| c.mode == Op::MODE_STAND));
    assert_eq!(events.last().unwrap(), "ends: the terminal is gone; the last command was STAND");
}

/// Waits for a command.
fn until(bus: &mut LcmBus, after: &str, wanted: impl Fn(&OperatorCommand) -> bool) {
    let began = Instant::now();
    loop {
        for message in bus.handle(Duration::from_millis(100)).unwrap() {
            if message.channel != channels::EVENT && wanted(&OperatorCommand::decode(&message.data).unwrap()) {
                return;
            }
        }
        assert!(began.elapsed() < Duration::from_secs(60), "nothing came of {after:?}");
    }
}

/// A live run, in which a person takes over from the scenario, stops the robot, takes the stop back, and goes.
#[test]
fn a_person_takes_over_from_the_scenario_and_stops_the_robot() {
    let url = url(5);
    let log = folder("takes_over").join("run.mcap");
    let mut bus = LcmBus::open(&url).unwrap();
    bus.subscribe(channels::CONTROLLER_TICK).unwrap();
    let run = command()
        .args(["run", "runs/hyq_sim.toml", "--scenario", "scenarios/short_flat.toml", "--ticks", "4000", "--json"])
        .args(["--lcm-url", &url, "--log"])
        .arg(&log)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut run = Running(run);
    let began = Instant::now();
    while bus.handle(Duration::from_millis(100)).unwrap().is_empty() {
        assert!(began.elapsed() < Duration::from_secs(60), "the controller does not begin");
    }
    // Whether it is at rest by then is the robot's matter.
    assert!(script(&url, "stand\nwait 0.4\nestop\nwait 0.2\nidle\nwait 0.2\n").code < 2);
    run.0.wait().unwrap();

    let events: Vec<Event> = messages(&log, channels::EVENT);
    let operator: Vec<&str> = events.iter().filter(|e| e.source == "operator").map(|e| &*e.text).collect();
    let mut said = operator.iter();
    for wanted in [
        "OPERATOR_COMMAND takes over",
        "OPERATOR_TELEOP takes over",
        "emergency stop by OPERATOR_TELEOP",
        "OPERATOR_TELEOP takes its emergency stop back",
        "OPERATOR_COMMAND takes over",
    ] {
        assert!(said.any(|text| *text == wanted), "{wanted}: {operator:?}");
    }
    // The controller consumed what was sent on either channel, and the emergency stop for as long as it was in force.
    let inputs: Vec<ControllerInput> = messages(&log, channels::CONTROLLER_INPUT);
    let teleop: Vec<OperatorCommand> = messages(&log, "OPERATOR_TELEOP");
    let scenario: Vec<OperatorCommand> = messages(&log, channels::OPERATOR_COMMAND);
    let sent = |from: &[OperatorCommand], op: &OperatorCommand| from.contains(op);
    let stopped = inputs.iter().filter(|i| i.op.mode == Op::MODE_DAMPING && sent(&teleop, &i.op)).count();
    assert!(stopped > 0, "the emergency stop was never consumed");
    assert!(inputs.iter().filter(|i| sent(&scenario, &i.op)).count() > 0);
    let json = hoof(&format!("replay --json {}", log.display())).exits(0).json();
    assert_eq!(json["identical"], true);
}

/// A process that ends with the test.
struct Running(Child);

impl Running {
    fn end(&mut self) {
        self.0.kill().unwrap();
        self.0.wait().unwrap();
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.end();
    }
}
