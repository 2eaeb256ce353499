//! `hoof bridge ros2` against a participant of another DDS implementation, Eclipse Cyclone DDS, which decodes with types of its own (`tests/ros2/peer.py`).
#![allow(clippy::unwrap_used, missing_docs, non_snake_case)]

mod common;

use common::live_process::kill;
use common::network::{port, url};
use common::{Ran, command, hoof, ran};
use drivers::live::clock::now_ns;
use lcmtypes::bus::{Bus, LcmBus};
use lcmtypes::{
    BaseTracking, ComponentInfo, ContactEstimate, ControllerTick, Message, OperatorCommand, RobotState, RunInfo,
    channels,
};
use serde_json::Value;
use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

/// A test that has not ended by then has failed.
const TIMEOUT: Duration = Duration::from_secs(120);
const FEET: [&str; 4] = ["lf_foot", "rf_foot", "lh_foot", "rh_foot"];
/// Estimated force at each foot in W, N.
const FORCES: [[f64; 3]; 4] = [[10.0, -20.0, 300.0], [1.0, 2.0, 200.0], [0.0, 0.0, 100.0], [-5.0, 6.0, 50.0]];
/// Estimated roll, pitch, yaw of the base, rad, and its height, m.
const RPY: [f64; 3] = [0.1, -0.2, 0.3];
const HEIGHT: f64 = 0.55;

/// The messages of a run that the bridge reads.
struct Run {
    bus: LcmBus,
    info: RunInfo,
}

impl Run {
    fn new(url: &str) -> Self {
        let mut bus = LcmBus::open(url).unwrap();
        bus.subscribe("OPERATOR_.*").unwrap();
        let read = |name: &str| std::fs::read_to_string(format!("robots/hyq/{name}")).unwrap();
        let params = controller::params::Params::from_toml(&read("hyq.toml"), "hyq.toml").unwrap();
        let (imus, contacts) = (vec![params.robot.imu_link], params.robot.feet.to_vec());
        let info = RunInfo {
            robot: "hyq".to_owned(),
            urdf: read("hyq.urdf"),
            n_imus: 1,
            imus,
            n_contacts: 4,
            contacts,
            ..RunInfo::default()
        }
        .with_component(ComponentInfo::new("quadruped", &read("hyq.toml")));
        Run { bus, info }
    }

    fn put(&mut self, channel: &str, message: &impl Message) {
        let mut bytes = Vec::new();
        message.encode(&mut bytes).unwrap();
        self.bus.publish(channel, &bytes).unwrap();
    }

    /// Publishes a tick in a mode, and returns the operator commands of the next 10 ms.
    fn tick(&mut self, mode: i8) -> Vec<OperatorCommand> {
        let t_ns = now_ns();
        self.put(channels::RUN_INFO, &self.info.clone());
        let state = RobotState {
            t_ns,
            q: (0..12).map(|k| 0.05 * f64::from(k)).collect(),
            qd: (0..12).map(|k| -0.1 * f64::from(k)).collect(),
            tau: (0..12).map(|k| 3.0 * f64::from(k)).collect(),
            q_WI_wxyz: vec![[0.8, 0.0, 0.6, 0.0]],
            w_WI_I: vec![[0.1, 0.2, 0.3]],
            a_I: vec![[1.0, 2.0, 9.0]],
            ..RobotState::zeros(12, 1, 0)
        };
        self.put(channels::ROBOT_STATE, &state);
        let base = BaseTracking { t_ns, rpy_est: RPY, height_est: HEIGHT, ..BaseTracking::default() };
        self.put(channels::BASE_TRACKING, &base);
        let contact = ContactEstimate {
            t_ns,
            n_contacts: 4,
            f_F_W: FORCES.to_vec(),
            f_normal: vec![0.0; 4],
            contact: vec![0; 4],
            ..ContactEstimate::default()
        };
        self.put(channels::CONTACT_ESTIMATE, &contact);
        self.put(channels::CONTROLLER_TICK, &ControllerTick { t_ns, mode, ..ControllerTick::default() });
        let until = Instant::now() + Duration::from_millis(10);
        let mut commands = Vec::new();
        while let Some(rest) = until.checked_duration_since(Instant::now()) {
            for message in self.bus.handle(rest).unwrap() {
                assert_eq!(message.channel, "OPERATOR_ROS2");
                commands.push(OperatorCommand::decode(&message.data).unwrap());
            }
        }
        commands
    }

    /// Runs in a mode until `done`; returns all commands.
    #[track_caller]
    fn until(&mut self, mode: i8, mut done: impl FnMut(&[OperatorCommand]) -> bool) -> Vec<OperatorCommand> {
        let (start, mut commands) = (Instant::now(), Vec::new());
        while !done(&commands) {
            assert!(start.elapsed() < TIMEOUT, "mode {mode}: {commands:?}");
            commands.extend(self.tick(mode));
        }
        commands
    }
}

/// A child that is killed when dropped.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        // Fails if it has ended already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Ends the bridge as Ctrl-C does.
fn end(mut bridge: Running) -> Ran {
    kill("-INT", &bridge.0.id().to_string());
    let stdout = bridge.0.stdout.take().unwrap();
    let stderr = bridge.0.stderr.take().unwrap();
    let read = |mut from: Box<dyn std::io::Read>| {
        let mut bytes = Vec::new();
        from.read_to_end(&mut bytes).unwrap();
        bytes
    };
    let (stdout, stderr) = (read(Box::new(stdout)), read(Box::new(stderr)));
    ran(std::process::Output { status: bridge.0.wait().unwrap(), stdout, stderr })
}

/// A DDS domain that no other test of this machine is likely to use.
fn domain(number: u32) -> u16 {
    10 + port(number) % 200
}

fn start_bridge(url: &str, domain: u16, more: &[&str]) -> Running {
    let mut command = command();
    command.args(["bridge", "ros2", "--json", "--lcm-url", url, "--domain", &domain.to_string()]).args(more);
    Running(command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap())
}

/// Starts the peer; the receiver gets its lines of JSON.
fn start_peer(domain: u16) -> (Running, Receiver<Value>) {
    let mut command = Command::new("python3");
    command.arg("tests/ros2/peer.py").arg(domain.to_string()).args(FEET).env("PYTHONPATH", "third_party/cyclonedds");
    let mut peer = Running(command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap());
    let lines = BufReader::new(peer.0.stdout.take().unwrap()).lines();
    let (sender, receiver) = channel();
    std::thread::spawn(move || {
        for line in lines.map_while(Result::ok) {
            let _ = sender.send(serde_json::from_str(&line).unwrap());
        }
    });
    (peer, receiver)
}

/// Ends the peer; returns the number of readers of /cmd_vel.
fn end_peer(mut peer: Running, lines: &Receiver<Value>) -> Value {
    drop(peer.0.stdin.take());
    let readers = lines.recv_timeout(TIMEOUT).unwrap();
    assert!(peer.0.wait().unwrap().success());
    readers
}

/// Numbers of a JSON array, or of the members x, y, z and w of an object.
fn numbers(value: &Value) -> Vec<f64> {
    let of_object = || ["x", "y", "z", "w"].into_iter().filter_map(|key| value[key].as_f64()).collect();
    value.as_array().map_or_else(of_object, |array| array.iter().map(|x| x.as_f64().unwrap()).collect())
}

#[test]
fn another_dds_implementation_reads_every_topic_and_its_velocity_is_followed() {
    let (url, domain) = (url(0), domain(1));
    let mut run = Run::new(&url);
    let bridge = start_bridge(&url, domain, &["--allow-commands"]);
    let (peer, received) = start_peer(domain);
    // A lying robot gets no command, whatever arrives.
    let mut found = None;
    let commands = run.until(ControllerTick::MODE_IDLE, |_| {
        found = received.try_recv().ok();
        found.is_some()
    });
    assert_eq!(commands, []);
    let found = found.unwrap();
    for _ in 0..50 {
        assert_eq!(run.tick(ControllerTick::MODE_IDLE), []);
    }
    // A standing robot walks.
    let commands = run.until(ControllerTick::MODE_STANCE, |commands| commands.len() >= 5);
    for (k, command) in (0..).zip(&commands) {
        let OperatorCommand { mode, v_H, yaw_rate, seq, sender_id, t_mode_ns, .. } = command;
        assert_eq!((*mode, *v_H, *yaw_rate), (OperatorCommand::MODE_WALK, [0.2, -0.05], 0.3));
        assert_eq!((*seq, *sender_id, *t_mode_ns), (k, commands[0].sender_id, commands[0].t_mode_ns));
    }
    assert_ne!(commands[0].sender_id, 0);
    // Without Twists it stands, and then the operator sends nothing.
    assert_eq!(end_peer(peer, &received), 1, "readers of /cmd_vel");
    let stands = |commands: &[OperatorCommand]| commands.last().is_some_and(|c| c.mode == OperatorCommand::MODE_STAND);
    let commands = run.until(ControllerTick::MODE_WALK, stands);
    assert_eq!((commands.last().unwrap().v_H, commands.last().unwrap().yaw_rate), ([0.0; 2], 0.0));
    let start = Instant::now();
    let mut silent_ticks = 0;
    while silent_ticks < 30 {
        assert!(start.elapsed() < TIMEOUT);
        silent_ticks = if run.tick(ControllerTick::MODE_WALK).is_empty() { silent_ticks + 1 } else { 0 };
    }

    let joints = &found["/joint_states"];
    let names: Vec<&str> = joints["name"].as_array().unwrap().iter().map(|n| n.as_str().unwrap()).collect();
    let expected: Vec<String> = ["lf", "rf", "lh", "rh"]
        .iter()
        .flat_map(|leg| ["haa", "hfe", "kfe"].map(|joint| format!("{leg}_{joint}_joint")))
        .collect();
    assert_eq!(names, expected);
    let each = |factor: f64| (0..12).map(|k| factor * f64::from(k)).collect::<Vec<f64>>();
    assert_eq!(numbers(&joints["position"]), each(0.05));
    assert_eq!(numbers(&joints["velocity"]), each(-0.1));
    assert_eq!(numbers(&joints["effort"]), each(3.0));
    // The wall clock: after 2020. The monotonic clock of the run counts from the start of the machine.
    assert!(joints["header"]["stamp"]["sec"].as_i64().unwrap() > 1_577_836_800, "{}", joints["header"]);
    let imu = &found["/imu"];
    assert_eq!(numbers(&imu["orientation"]), [0.0, 0.6, 0.0, 0.8]);
    assert_eq!(numbers(&imu["angular_velocity"]), [0.1, 0.2, 0.3]);
    assert_eq!(numbers(&imu["linear_acceleration"]), [1.0, 2.0, 9.0]);
    let frames = found["/tf"]["transforms"].as_array().unwrap();
    let base = frames.iter().find(|t| t["header"]["frame_id"] == "world").unwrap();
    assert_eq!(numbers(&base["transform"]["translation"]), [0.0, 0.0, HEIGHT]);
    // Product of three half-angle quaternions, x y z w.
    let [(sr, cr), (sp, cp), (sy, cy)] = RPY.map(|angle| (0.5 * angle).sin_cos());
    let expected = [
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    ];
    for (found, expected) in numbers(&base["transform"]["rotation"]).into_iter().zip(expected) {
        assert!((found - expected).abs() < 1e-12, "{found}, expected {expected}");
    }
    for (foot, force) in FEET.iter().zip(FORCES) {
        let wrench = &found[format!("/contact/{foot}")];
        assert_eq!(wrench["header"]["frame_id"], *foot);
        // A rotation into the frame of the foot keeps the length.
        let length = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
        let found = length(&numbers(&wrench["wrench"]["force"]));
        assert!((found - length(&force)).abs() < 1e-9, "{foot}: {found} N");
        assert!(frames.iter().any(|t| t["child_frame_id"] == *foot), "{foot}");
    }
    // 20 kB, in fragments.
    assert_eq!(found["/robot_description"]["data"].as_str(), Some(&*run.info.urdf));

    let summary = end(bridge).exits(0).json();
    assert_eq!((&summary["robot"], &summary["malformed"]), (&"hyq".into(), &0.into()));
    assert_eq!(summary["topics"].as_array().unwrap().len(), 8);
    assert!(summary["twists"].as_u64().unwrap() > 0 && summary["published"].as_u64().unwrap() >= 8, "{summary}");
}

#[test]
fn without_the_flag_nothing_reads_velocities() {
    let (url, domain) = (url(2), domain(3));
    let mut run = Run::new(&url);
    let bridge = start_bridge(&url, domain, &[]);
    let (peer, received) = start_peer(domain);
    let commands = run.until(ControllerTick::MODE_STANCE, |_| received.try_recv().is_ok());
    assert_eq!(commands, []);
    assert_eq!(end_peer(peer, &received), 0, "readers of /cmd_vel");
    let summary = end(bridge).exits(0).json();
    assert_eq!((&summary["twists"], &summary["commands"]), (&0.into(), &0.into()));
}

#[test]
fn invalid_arguments_are_named() {
    for (arguments, named) in [
        ("--domain 233", "233"),
        ("--rate-hz 0", "--rate-hz"),
        ("--rate-hz nan", "--rate-hz"),
        ("--seconds -1", "--seconds"),
        ("--allow-commands --channel ROBOT_STATE", "ROBOT_STATE"),
        ("--channel OPERATOR_ROS2", "--allow-commands"),
    ] {
        let ran = hoof(&format!("bridge ros2 --lcm-url {} {arguments}", url(4))).exits(2);
        assert!(ran.stderr.contains(named), "{arguments}: {}", ran.stderr);
    }
}
