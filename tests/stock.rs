//! The stock LCM tools read logs of this project: Debian's lcm-gen, liblcm and lcm-logplayer, which scripts/setup.sh installs.
#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use common::{events, folder, hoof};
use lcm_idl::Value;
use lcmtypes::bus::{Bus, LcmBus, Received};
use lcmtypes::{Message, channels::*, *};
use replay::log::Event as LogEvent;
use std::collections::BTreeSet;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

/// A run as an event log, and its events.
fn run(folder: &Path, seconds: f64) -> (PathBuf, Vec<LogEvent>) {
    let log = folder.join("run.lcmlog");
    let scenario = folder.join("scenario.toml");
    let mut text = std::fs::read_to_string("scenarios/short_rough.toml").unwrap();
    text += "[[parameter]]\nt_s = 0.5\nkey = \"trunk.kp\"\nvalue = [700.0, 700.0, 700.0]\n";
    std::fs::write(&scenario, text).unwrap();
    let (scenario, out) = (scenario.display(), log.display());
    hoof(&format!("sim --robot hyq --scenario {scenario} --seconds {seconds} --log {out}")).exits(0);
    let events = events(&log);
    (log, events)
}

/// Runs a tool; returns its standard output.
fn tool(command: &mut Command) -> String {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}; scripts/setup.sh installs it"));
    assert!(output.status.success(), "{command:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// Compiles the reader in C with stock liblcm and the code that stock lcm-gen generates from every `.lcm` file.
fn stock_reader(folder: &Path) -> PathBuf {
    let types = Path::new(env!("CARGO_MANIFEST_DIR")).join("lcmtypes");
    let mut sources = vec![Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/stock/read_log.c")];
    let (mut headers, mut list) = (String::new(), "#define TYPES(X)".to_owned());
    for name in SOURCES.iter().map(|(file, _)| file.trim_end_matches("_t.lcm")) {
        headers += &format!("#include \"hoofprint_{name}_t.h\"\n");
        list += &format!(" X({name})");
    }
    std::fs::write(folder.join("types.h"), headers + &list + "\n").unwrap();
    for (name, _) in SOURCES {
        tool(
            Command::new("lcm-gen")
                .arg("--c")
                .arg("--c-cpath")
                .arg(folder)
                .arg("--c-hpath")
                .arg(folder)
                .arg(types.join(name)),
        );
        sources.push(folder.join(format!("hoofprint_{}", name.replace(".lcm", ".c"))));
    }
    let reader = folder.join("read_log");
    tool(Command::new("cc").arg("-o").arg(&reader).arg("-I").arg(folder).args(sources).arg("-llcm"));
    reader
}

/// The line that the reader must print for an event, computed with this project's decoders.
fn line(number: usize, event: &LogEvent) -> String {
    let mut line = format!("{number} {} {} same", event.t_ns / 1000, event.channel);
    macro_rules! show {
        ($type:ty, |$m:ident| $($field:expr),*) => {{
            let $m = <$type>::decode(&event.data).unwrap();
            $(line.push(' '); line += &Shown::shown(&$field);)*
        }};
    }
    match &*event.channel {
        RUN_INFO => show!(RunInfo, |m| m.urdf.len(), m.seed, m.num_lcm_types, m.lcm_types.last().unwrap().name),
        ROBOT_INFO | EXPECTED_ROBOT => {
            show!(RobotInfo, |m| m.sender_id, m.robot, m.joint_names.last().unwrap().clone(), m.urdf_sha256)
        }
        ROBOT_STATE => show!(RobotState, |m| m.seq, m.q, m.tau[11], m.a_I[0][2]),
        OPERATOR_COMMAND => show!(OperatorCommand, |m| m.seq, m.mode, m.v_H[0], m.height_offset),
        PARAMETER_REQUEST => show!(ParameterRequest, |m| m.seq, m.key, m.value),
        REQUEST_REPLY => show!(RequestReply, |m| m.tick, m.request_id, m.code, m.reason),
        PARAMETER_CHANGE => show!(ParameterChange, |m| m.tick, m.seq, m.key, m.value),
        CONTROLLER_INPUT => {
            show!(ControllerInput, |m| m.tick, m.messages[0].channel, m.messages[0].size, m.messages[0].t_arrival_ns)
        }
        CONTROLLER_TICK => show!(ControllerTick, |m| m.tick, m.mode, m.fault_value, m.digest[5]),
        CONTACT_ESTIMATE => show!(ContactEstimate, |m| m.tick, m.f_F_W[2][1], m.contact[3], m.n_W[2]),
        BASE_TRACKING => show!(BaseTracking, |m| m.tick, m.rpy_est[2], m.height_est, m.v_H_des[1]),
        LEG_STATE => show!(LegState, |m| m.gait, m.state[1], m.p_BF_H_des[3][2], m.v_BF_H_des[3][2]),
        WBC_SOLUTION => show!(WbcSolution, |m| m.n_active, m.base_residual, m.vd[17], m.f_F_W[1][2]),
        ROBOT_COMMAND => show!(RobotCommand, |m| m.mode, m.tau[7], m.kd[11]),
        CONTROLLER_SNAPSHOT => {
            show!(ComponentState, |m| m.tick, m.input.state.q[5], m.input.op.v_H[0], m.controller.size)
        }
        GROUND_TRUTH => {
            show!(GroundTruth, |m| m.n_contacts, m.p_WF[3][2], m.f_F_W[1][0], m.contact[2], m.tau_push_W[2])
        }
        TIMING => show!(Timing, |m| m.wall_ns, m.stage_ns[5]),
        EVENT => show!(Event, |m| m.level, m.source, m.text),
        other => panic!("unknown channel {other}"),
    }
    line
}

/// Fields as the reader prints them.
trait Shown {
    fn shown(&self) -> String;
}

macro_rules! shown_as_is {
    ($($type:ty),*) => { $(impl Shown for $type { fn shown(&self) -> String { self.to_string() } })* };
}
shown_as_is!(i8, i32, i64, usize, String);

impl Shown for bool {
    fn shown(&self) -> String {
        u8::from(*self).to_string()
    }
}

impl Shown for f64 {
    fn shown(&self) -> String {
        format!("{:016x}", self.to_bits())
    }
}

impl Shown for Vec<f64> {
    fn shown(&self) -> String {
        self.iter().map(Shown::shown).collect::<Vec<_>>().join(" ")
    }
}

#[test]
fn stock_lcm_gen_and_liblcm_decode_every_message_equally() {
    let folder = folder("reads");
    let (log, events) = run(&folder, 2.0);
    let reader = stock_reader(&folder);
    let text = tool(Command::new(reader).arg(&log));
    let (fingerprints, lines) = text.split_once("events\n").unwrap();

    let ours: BTreeSet<String> =
        lcmtypes::types().types().map(|ty| format!("{} {:016x}", ty.name(), ty.fingerprint())).collect();
    assert_eq!(fingerprints.lines().map(str::to_owned).collect::<BTreeSet<_>>(), ours);
    assert_eq!(ours.len(), SOURCES.len());
    for channel in CHANNELS {
        assert!(ours.contains(&format!("{} {:016x}", channel.type_name, channel.fingerprint)), "{}", channel.name);
    }

    let mut found = lines.lines();
    for (number, event) in events.iter().enumerate() {
        assert_eq!(found.next(), Some(&*line(number, event)));
    }
    assert_eq!(found.next(), None);
    let seen: BTreeSet<&str> = events.iter().map(|event| &*event.channel).collect();
    // Channels of live runs only, RUNNING, which occurs inside CONTROLLER_INPUT only, and those of planners and Cartesian servers.
    let absent = [EXECUTOR_COMMAND, EXPECTED_ROBOT, RUNNING, JOINT_REFERENCE, TASK_REQUEST, TASK_REPLY, TASK_STATUS];
    let in_lockstep = CHANNELS.iter().map(|channel| channel.name).filter(|name| !absent.contains(name));
    assert_eq!(seen, in_lockstep.collect(), "channels without an event");
}

/// Lua code of stock lcm-gen keeps every number as a double: the integers of the message, reduced to what a double holds.
fn without_large_integers(value: Value) -> Value {
    match value {
        Value::Int64(v) => Value::Int64(v % (1 << 53)),
        Value::Array(items) => Value::Array(items.into_iter().map(without_large_integers).collect()),
        Value::Struct(fields) => {
            Value::Struct(fields.into_iter().map(|(name, value)| (name, without_large_integers(value))).collect())
        }
        other => other,
    }
}

/// One message of each type of a run, and of types of live runs one with default values: stock code decodes and encodes it to the same bytes.
#[test]
fn stock_code_in_every_language_encodes_the_same_bytes() {
    let folder = folder("languages");
    let (_, events) = run(&folder, 2.0);
    let (mut input, mut small) = (String::new(), String::new());
    for ty in lcmtypes::types().types() {
        let fingerprint = ty.fingerprint();
        let recorded = events.iter().rev().find(|event| event.fingerprint() == Some(fingerprint));
        let data = recorded.map_or_else(|| ty.encode(&ty.default_value()).unwrap(), |event| event.data.clone());
        let line = |data: &[u8]| {
            let hex: String = data.iter().map(|byte| format!("{byte:02x}")).collect();
            format!("{} {hex}\n", ty.name().trim_start_matches("hoofprint."))
        };
        input += &line(&data);
        small += &line(&ty.encode(&without_large_integers(ty.decode(&data).unwrap())).unwrap());
    }
    let stock = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/stock");
    let types = SOURCES.iter().map(|(name, _)| Path::new(env!("CARGO_MANIFEST_DIR")).join("lcmtypes").join(name));
    let mut generate = Command::new("lcm-gen");
    for option in ["-x", "--cpp-hpath", "-p", "--ppath", "-j", "--jpath", "-l", "--lpath"] {
        generate.arg(option);
        if option.starts_with("--") {
            generate.arg(&folder);
        }
    }
    tool(generate.args(types));
    let names: Vec<_> = SOURCES.iter().map(|(name, _)| name.trim_end_matches(".lcm")).collect();
    let includes: String = names.iter().map(|name| format!("#include \"hoofprint/{name}.hpp\"\n")).collect();
    let list: String = names.iter().map(|name| format!(" X({name})")).collect();
    std::fs::write(folder.join("types.hpp"), format!("{includes}#define TYPES(X){list}\n")).unwrap();
    let program = folder.join("round_trip");
    tool(Command::new("g++").arg("-o").arg(&program).arg("-I").arg(&folder).arg(stock.join("round_trip.cpp")));

    let mut python = Command::new("python3");
    python.arg(stock.join("round_trip.py")).env("PYTHONPATH", &folder);
    let mut lua = Command::new("lua5.2");
    let module = folder.join("?.lua");
    lua.arg(stock.join("round_trip.lua"))
        .env("LUA_PATH", format!("{};{}", module.display(), folder.join("?/init.lua").display()));
    let mut languages = vec![("C++", Command::new(program)), ("Python", python), ("Lua", lua)];
    // A JDK is large, so scripts/setup.sh does not install one.
    let jar = "/usr/share/java/lcm.jar";
    if Command::new("javac").arg("-version").output().is_ok() && Path::new(jar).exists() {
        let java_files = names.iter().map(|name| folder.join(format!("hoofprint/{name}.java")));
        tool(
            Command::new("javac")
                .arg("-d")
                .arg(&folder)
                .args(["-cp", jar])
                .arg(stock.join("RoundTrip.java"))
                .args(java_files),
        );
        let mut java = Command::new("java");
        java.arg("-cp").arg(format!("{}:{jar}", folder.display())).arg("RoundTrip");
        languages.push(("Java", java));
    } else {
        eprintln!("Java is not tested: javac or {jar} is missing");
    }
    for (language, mut command) in languages {
        let child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn();
        let mut child = child.unwrap_or_else(|error| panic!("{language}: {error}; scripts/setup.sh installs it"));
        let mut stdin = child.stdin.take().unwrap();
        let input = if language == "Lua" { &small } else { &input };
        let text = input.clone();
        let writer = std::thread::spawn(move || stdin.write_all(text.as_bytes()));
        let output = child.wait_with_output().unwrap();
        writer.join().unwrap().unwrap();
        let found = String::from_utf8(output.stdout).unwrap();
        for (found, expected) in found.lines().zip(input.lines()) {
            assert!(found == expected, "{language}: {}", expected.split(' ').next().unwrap());
        }
        assert_eq!(found.lines().count(), input.lines().count(), "{language}");
    }
}

/// UDP may lose a message on a busy machine: in one of a few attempts all messages must arrive; in every attempt each arriving message is in the
/// log, in the log's order.
#[test]
fn stock_lcm_logplayer_plays_a_log() {
    const ATTEMPTS: u32 = 5;
    let folder = folder("plays");
    let (log, events) = run(&folder, 0.25);
    let mut lost = Vec::new();
    for attempt in 0..ATTEMPTS {
        let received = play(&log, attempt);
        let mut recorded = events.iter();
        for message in &received {
            let is_it = |event: &&LogEvent| *event.channel == *message.channel && event.data == message.data;
            assert!(recorded.any(|event| is_it(&event)), "not in the log, or out of order: {}", message.channel);
        }
        lost.push(events.len() - received.len());
        if lost.ends_with(&[0]) {
            return;
        }
    }
    panic!("lost of {} messages in {ATTEMPTS} attempts: {lost:?}", events.len());
}

/// The stock logger queues at most 30 messages while it writes: in one of a few attempts it must record all of them.
#[test]
fn stock_lcm_logger_records_a_played_log() {
    const ATTEMPTS: u32 = 5;
    let folder = folder("records");
    let (log, sent) = run(&folder, 0.25);
    let mut lost = Vec::new();
    for attempt in 0..ATTEMPTS {
        let copy = folder.join(format!("copy{attempt}.lcmlog"));
        record(&log, &copy, attempt);
        let (mut played, recorded) = (sent.iter(), events(&copy));
        for event in &recorded {
            let is_it = |other: &&LogEvent| *other.channel == *event.channel && other.data == event.data;
            assert!(played.any(|other| is_it(&other)), "not in the log, or out of order: {}", event.channel);
        }
        lost.push(sent.len() - recorded.len());
        if lost.ends_with(&[0]) {
            return;
        }
    }
    panic!("lost of {} messages by the stock logger in {ATTEMPTS} attempts: {lost:?}", sent.len());
}

/// Records with the stock logger while `hoof log play` sends.
fn record(log: &Path, recorded: &Path, attempt: u32) {
    let port = common::network::port(attempt);
    // liblcm sends LCM_SELF_TEST when it starts; it is not part of the log.
    let url = format!("udpm://239.255.76.67:{port}?ttl=0");
    let mut logger = Command::new("lcm-logger");
    logger.arg(format!("--lcm-url={url}")).arg("--channel=(?!LCM_).*").arg(recorded);
    let logger = logger.stdout(Stdio::null()).stderr(Stdio::null()).spawn();
    let mut logger = logger.unwrap_or_else(|error| panic!("lcm-logger: {error}; scripts/setup.sh installs it"));
    // The logger receives as soon as its socket is bound to the port on any address.
    let bound = format!("00000000:{port:04X} ");
    while !std::fs::read_to_string("/proc/net/udp").unwrap().contains(&bound) {
        assert!(logger.try_wait().unwrap().is_none(), "lcm-logger ended");
        std::thread::yield_now();
    }
    hoof(&format!("log play {} --speed 0.25 --lcm-url {url}", log.display())).exits(0);
    let id = logger.id().to_string();
    assert!(Command::new("kill").args(["-INT", &id]).status().unwrap().success());
    assert!(logger.wait().unwrap().success());
}

/// Messages received while the stock player plays a log at a quarter of its speed: 3000 messages per second.
fn play(log: &Path, attempt: u32) -> Vec<Received> {
    // A separate port for each attempt, so that no other messages arrive.
    let port = common::network::port(100 + attempt);
    let url = format!("udpm://239.255.76.67:{port}?ttl=0");
    let mut bus = LcmBus::open(&format!("{url}&recv_buf_size=2000000")).unwrap();
    bus.subscribe("[A-Z_]*").unwrap();
    let mut player = Command::new("lcm-logplayer");
    player.arg("--speed=0.25").arg(format!("--lcm-url={url}")).arg(log).stdout(Stdio::null());
    let mut player =
        player.spawn().unwrap_or_else(|error| panic!("lcm-logplayer: {error}; scripts/setup.sh installs it"));
    let mut received = Vec::new();
    loop {
        let ended = player.try_wait().unwrap();
        let some = bus.handle(Duration::from_millis(200)).unwrap();
        match ended {
            Some(status) if some.is_empty() => {
                assert!(status.success(), "lcm-logplayer: {status}");
                break;
            }
            _ => received.extend(some),
        }
    }
    received.retain(|message| message.channel != "LCM_SELF_TEST");
    received
}
