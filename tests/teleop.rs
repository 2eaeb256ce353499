//! `hoof teleop` on a real bus: commands of a script, of keys, and at the end of the operation.
#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use common::network::url;
use common::{Ran, command, folder, hoof, messages, ran};
use lcmtypes::bus::{Bus, LcmBus};
use lcmtypes::{ControllerInput, ControllerTick, Event, Message, OperatorCommand, RequestReply, TickInput, channels};
use std::io::Write;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

type Op = OperatorCommand;

fn subscribe(url: &str) -> LcmBus {
    let mut bus = LcmBus::open(url).unwrap();
    bus.subscribe("OPERATOR_TELEOP|EVENT").unwrap();
    bus
}

/// Commands and events that have arrived, until no more arrive.
fn received(bus: &mut LcmBus) -> (Vec<OperatorCommand>, Vec<Event>) {
    let (mut commands, mut events) = (Vec::new(), Vec::new());
    loop {
        let messages = bus.handle(Duration::from_millis(200)).unwrap();
        if messages.is_empty() {
            return (commands, events);
        }
        for message in messages {
            match &*message.channel {
                channels::EVENT => events.push(Event::decode(&message.data).unwrap()),
                _ => commands.push(OperatorCommand::decode(&message.data).unwrap()),
            }
        }
    }
}

/// Source and level of events.
fn outline(events: &[Event]) -> Vec<(&str, i8)> {
    events.iter().map(|event| (&*event.source, event.level)).collect()
}

/// Runs `hoof teleop` with lines on standard input.
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
fn a_script_is_sent_line_by_line_and_ends_with_stand() {
    let url = url(1);
    let mut bus = subscribe(&url);
    // No controller is running: exit code 1.
    let ran = script(&url, "walk vx=0.2 gait=crawl\nwait 0.2\n\nyaw=-0.3 # turning\nwait 0.1\n").exits(1);
    assert!(ran.stderr.starts_with("warning: ") && ran.stderr.contains("CONTROLLER_TICK"), "{}", ran.stderr);
    assert!(ran.stdout.contains("STAND"), "{}", ran.stdout);
    let (commands, events) = received(&mut bus);
    let numbers: Vec<i64> = commands.iter().map(|c| c.seq).collect();
    assert_eq!(numbers, (0..commands.len() as i64).collect::<Vec<_>>());
    let mut kinds: Vec<(i8, i8, f64, f64)> = commands.iter().map(|c| (c.mode, c.gait, c.v_H[0], c.yaw_rate)).collect();
    kinds.dedup();
    let (walk, crawl) = (Op::MODE_WALK, Op::GAIT_CRAWL);
    assert_eq!(kinds, [(walk, crawl, 0.2, 0.0), (walk, crawl, 0.2, -0.3), (Op::MODE_STAND, crawl, 0.0, 0.0)]);
    // At least one command per line, and the last command ten times.
    assert!(commands.len() >= 10 + 2, "{} commands", commands.len());
    assert!(commands.windows(2).all(|two| two[0].t_ns < two[1].t_ns));
    assert_eq!(outline(&events), [("teleop", Event::LEVEL_INFO); 2]);
    assert!(events[0].text.contains("OPERATOR_TELEOP") && events[1].text.contains("STAND"), "{events:?}");
}

#[test]
fn after_an_invalid_line_the_robot_stands() {
    let url = url(2);
    let mut bus = subscribe(&url);
    let error = script(&url, "walk\nwait 0.1\nvx=9\nsit\n").exits(2).stderr;
    let named = ["standard input:3", "vx=9", "-0.6 to 0.6"];
    assert!(named.iter().all(|text| error.contains(text)), "{error}");
    let (commands, events) = received(&mut bus);
    assert_eq!(commands.last().unwrap().mode, Op::MODE_STAND);
    let end = events.last().unwrap();
    assert_eq!(end.level, Event::LEVEL_WARNING);
    assert!(named.iter().all(|text| end.text.contains(text)), "{}", end.text);
}

#[test]
fn an_emergency_stop_is_not_cleared_at_the_end() {
    let url = url(3);
    let mut bus = subscribe(&url);
    let result = script(&url, "walk\nestop\n").exits(1).stdout;
    assert!(result.contains("DAMPING"), "{result}");
    let (commands, _) = received(&mut bus);
    let mut modes: Vec<i8> = commands.iter().map(|c| c.mode).collect();
    modes.dedup();
    assert_eq!(modes, [Op::MODE_WALK, Op::MODE_DAMPING]);
}

/// Runs `then` beside a fake controller in WALK: it follows another operator until commands arrive on OPERATOR_TELEOP, and an emergency stop.
fn beside_a_controller(url: &str, then: impl FnOnce()) {
    struct SetOnDrop<'a>(&'a AtomicBool);
    impl Drop for SetOnDrop<'_> {
        fn drop(&mut self) {
            self.0.store(true, Ordering::SeqCst);
        }
    }
    let over = AtomicBool::new(false);
    let mut tick = ControllerTick { mode: ControllerTick::MODE_WALK, ..ControllerTick::default() };
    let mut op = Op { seq: 7, t_ns: 1, ..Op::default() };
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let mut bus = LcmBus::open(url).unwrap();
            bus.subscribe("OPERATOR_TELEOP").unwrap();
            let mut bytes = Vec::new();
            while !over.load(Ordering::SeqCst) {
                for message in bus.handle(Duration::from_millis(5)).unwrap() {
                    op = Op::decode(&message.data).unwrap();
                    if op.mode == Op::MODE_DAMPING {
                        tick.mode = ControllerTick::MODE_DAMPING;
                    }
                }
                tick.encode(&mut bytes).unwrap();
                bus.publish(channels::CONTROLLER_TICK, &bytes).unwrap();
                bytes.clear();
                let mut input = ControllerInput::default();
                input.deliver(channels::OPERATOR_COMMAND, 0, &op).unwrap();
                input.encode(&mut bytes).unwrap();
                bus.publish(channels::CONTROLLER_INPUT, &bytes).unwrap();
                bytes.clear();
            }
        });
        let _over = SetOnDrop(&over);
        then();
    });
}

#[test]
fn a_script_fails_if_its_last_command_is_not_followed() {
    let url = url(0);
    beside_a_controller(&url, || {
        let ran = script_on("OPERATOR_PAD", &url, "estop\nwait 0.2\n").exits(1);
        assert!(ran.stderr.contains("OPERATOR_PAD"), "{}", ran.stderr);
        let ran = script(&url, "estop\nwait 0.2\n").exits(0);
        assert!(ran.stderr.is_empty(), "{}", ran.stderr);
        let ran = script(&url, "stand\nwait 0.2\n").exits(1);
        assert!(["STAND", "DAMPING", "idle"].iter().all(|name| ran.stderr.contains(name)), "{}", ran.stderr);
    });
}

#[test]
fn an_operator_that_cannot_command_is_not_announced() {
    let url = url(6);
    let mut bus = subscribe(&url);
    let no_terminal = hoof(&format!("teleop --lcm-url {url}")).exits(2);
    assert!(no_terminal.stderr.contains("--no-screen"), "{}", no_terminal.stderr);
    for (channel, named) in [("A B", "\"A B\""), ("ROBOT_COMMAND", "hoofprint.robot_command_t")] {
        let refused = script_on(channel, &url, "").exits(2);
        assert!(refused.stderr.contains("--channel") && refused.stderr.contains(named), "{}", refused.stderr);
    }
    assert_eq!(received(&mut bus), (vec![], vec![]));
}

/// Keys on a pseudo-terminal made by `script` of util-linux, which is then closed.
#[test]
fn the_robot_stands_when_the_terminal_is_closed() {
    let url = url(4);
    let mut bus = subscribe(&url);
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
    // A lying robot keeps lying; nothing is sent before the mode of the controller is known.
    let tick = ControllerTick { mode: ControllerTick::MODE_IDLE, ..ControllerTick::default() };
    let mut bytes = Vec::new();
    tick.encode(&mut bytes).unwrap();
    let start = Instant::now();
    let first = loop {
        bus.publish(channels::CONTROLLER_TICK, &bytes).unwrap();
        if let Some(first) =
            bus.handle(Duration::from_millis(20)).unwrap().iter().find(|m| m.channel != channels::EVENT)
        {
            break OperatorCommand::decode(&first.data).unwrap();
        }
        assert!(start.elapsed() < TIMEOUT, "no command");
    };
    assert_eq!((first.mode, first.seq), (Op::MODE_IDLE, 0));
    for (key, mode) in [("\r", Op::MODE_STAND), (" ", Op::MODE_WALK), ("w", Op::MODE_WALK)] {
        keys.write_all(key.as_bytes()).unwrap();
        until(&mut bus, key, |c| c.mode == mode && (key != "w" || c.v_H[0] == 0.3));
    }
    terminal.end();
    let mut events = until(&mut bus, "the end", |c| c.mode == Op::MODE_STAND && c.v_H[0] == 0.0);
    // The warning may come after the commands.
    let start = Instant::now();
    while outline(&events).last() != Some(&("teleop", Event::LEVEL_WARNING)) {
        assert!(start.elapsed() < TIMEOUT, "{events:?}");
        let (commands, later) = received(&mut bus);
        assert!(commands.iter().all(|c| c.mode == Op::MODE_STAND));
        events.extend(later);
    }
}

/// Longest wait for a message; a passing test gets it much earlier.
const TIMEOUT: Duration = Duration::from_secs(60);

/// Waits for a command; returns the events that came with it.
fn until(bus: &mut LcmBus, after: &str, wanted: impl Fn(&OperatorCommand) -> bool) -> Vec<Event> {
    let start = Instant::now();
    loop {
        let (events, commands): (Vec<_>, Vec<_>) = bus
            .handle(Duration::from_millis(100))
            .unwrap()
            .into_iter()
            .partition(|message| message.channel == channels::EVENT);
        if commands.iter().any(|message| wanted(&OperatorCommand::decode(&message.data).unwrap())) {
            return events.iter().map(|message| Event::decode(&message.data).unwrap()).collect();
        }
        assert!(start.elapsed() < TIMEOUT, "no such command after {after:?}");
    }
}

/// Teleoperation during a live run: it becomes active instead of the scenario's operator, stops the robot, clears the stop, and ends.
#[test]
fn teleoperation_overrides_the_scenario_and_stops_the_robot() {
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
    let start = Instant::now();
    while bus.handle(Duration::from_millis(100)).unwrap().is_empty() {
        assert!(start.elapsed() < TIMEOUT, "no tick of the controller");
    }
    // IDLE is rejected until the robot is at rest: then the exit code is 1, with a warning.
    let ran = script(&url, "stand\nwait 0.4\nestop\nwait 0.2\nidle\nwait 0.2\n");
    let code = i32::from(ran.stderr.starts_with("warning: "));
    ran.exits(code);
    run.0.wait().unwrap();

    let events: Vec<Event> = messages(&log, channels::EVENT);
    let operator: Vec<&Event> = events.iter().filter(|event| event.source == "operator").collect();
    let mut reported = operator.iter();
    let (info, warning) = (Event::LEVEL_INFO, Event::LEVEL_WARNING);
    // Scenario active, teleoperation active, its stop, the stop cleared; the scenario's request is older and is ignored from then on.
    for (channel, level) in [
        ("OPERATOR_COMMAND", info),
        ("OPERATOR_TELEOP", info),
        ("OPERATOR_TELEOP", warning),
        ("OPERATOR_TELEOP", info),
        ("OPERATOR_COMMAND", warning),
    ] {
        let found = reported.any(|event| event.text.contains(channel) && event.level == level);
        assert!(found, "{channel}, level {level}: {operator:?}");
    }
    let inputs = controller::Unpacked::all(&messages::<ControllerInput>(&log, channels::CONTROLLER_INPUT));
    let teleop_id = messages::<Op>(&log, "OPERATOR_TELEOP")[0].sender_id;
    let replies: Vec<RequestReply> = messages(&log, channels::REQUEST_REPLY);
    let is_stop = |reply: &RequestReply, input: &TickInput| {
        (input.tick, input.op.seq, input.op.mode) == (reply.tick, reply.request_id, Op::MODE_DAMPING)
    };
    let stop =
        replies.iter().find(|reply| reply.sender_id == teleop_id && inputs.iter().any(|input| is_stop(reply, input)));
    assert_eq!(stop.map(|reply| reply.code), Some(RequestReply::CODE_DONE), "{replies:?}");
    // The controller consumed the commands of both channels, the emergency stop included.
    let teleop: Vec<OperatorCommand> = messages(&log, "OPERATOR_TELEOP");
    let scenario: Vec<OperatorCommand> = messages(&log, channels::OPERATOR_COMMAND);
    let sent = |from: &[OperatorCommand], op: &OperatorCommand| from.contains(op);
    let stopped = inputs.iter().filter(|i| i.op.mode == Op::MODE_DAMPING && sent(&teleop, &i.op)).count();
    assert!(stopped > 0, "the emergency stop was never consumed");
    assert!(inputs.iter().filter(|i| sent(&scenario, &i.op)).count() > 0);
    let json = hoof(&format!("replay --json {}", log.display())).exits(0).json();
    assert_eq!(json["identical"], true);
}

/// A process that is killed when dropped.
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
