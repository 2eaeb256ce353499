//! `hoof spy --once` on a real network: it reports exactly the messages that a relay dropped.
#![allow(clippy::unwrap_used, missing_docs)]

mod common;
#[path = "../replay/examples/lossy_relay/relay.rs"]
mod relay;

use common::{Ran, command, folder, hoof, ran, rewrite};
use lcmtypes::bus::{Bus, LcmBus};
use lcmtypes::{Message, RobotState, RunInfo, TextFile, channels};
use relay::{Counts, Relay, SenderAccount, Shares};
use replay::log::LogWriter;
use replay::udpm::{Listener, Url, split};
use serde_json::{Value, json};
use std::io::{BufRead, BufReader};
use std::net::UdpSocket;
use std::process::{Child, Command, Stdio};

/// Network of a test.
fn url(test: u32) -> Url {
    let group = "239.255.76.69".parse().unwrap();
    Url { group, port: common::network::port(test), ..Url::default() }
}

/// Starts a spy that runs until it is stopped, and waits until it listens.
fn start(url: &Url, more: &[&str]) -> Child {
    let mut command = command();
    command.args(["spy", "--once", "--json", "--seconds", "100", "--lcm-url", &url.to_string()]).args(more);
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut stderr = BufReader::new(child.stderr.take().unwrap());
    let mut said = String::new();
    while !said.contains("listening on udpm://") {
        let before = said.len();
        stderr.read_line(&mut said).unwrap();
        assert!(said.len() > before, "it ended: {said}");
    }
    child.stderr = Some(stderr.into_inner());
    child
}

fn end(child: Child) -> Ran {
    let id = child.id().to_string();
    assert!(Command::new("kill").args(["-INT", &id]).status().unwrap().success());
    ran(child.wait_with_output().unwrap())
}

fn state(seq: i64) -> Vec<u8> {
    let mut bytes = Vec::new();
    RobotState { t_ns: seq, seq, ..Default::default() }.encode(&mut bytes).unwrap();
    bytes
}

fn channel<'a>(json: &'a Value, name: &str) -> &'a Value {
    let mut all = json["channels"].as_array().unwrap().iter();
    all.find(|channel| channel["name"] == name).unwrap_or_else(|| panic!("{name} in {json}"))
}

/// Two senders through liblcm, one of them with fragmented messages, one channel from both; 2 % of the datagrams are dropped, 1 % duplicated, 1 % late.
#[test]
fn the_spy_counts_the_messages_that_the_relay_dropped() {
    const MESSAGES: i64 = 3000;
    let (before, behind) = (url(0), url(1));
    let spy = start(&behind, &[]);
    let mut listener = Listener::open(&before).unwrap();
    let shares = Shares { drop: 0.02, duplicate: 0.01, reorder: 0.01 };
    let mut relay = Relay::new(behind, shares, 5);
    let mut senders = [0, 1].map(|_| LcmBus::open(&before.to_string()).unwrap());
    for n in 0..MESSAGES {
        for (place, sender) in senders.iter_mut().enumerate() {
            sender.publish(channels::ROBOT_STATE, &state(n)).unwrap();
            if n % 3 == 0 {
                sender.publish(&format!("PLAIN_{place}"), b"no counter, no type").unwrap();
            }
            if n % 100 == 0 && place == 1 {
                sender.publish("LONG", &[7; 150_000]).unwrap();
            }
        }
        while let Some(datagram) = listener.receive_now().unwrap() {
            relay.datagram(datagram.sender, datagram.bytes).unwrap();
        }
    }
    while let Some(datagram) = listener.receive().unwrap() {
        relay.datagram(datagram.sender, datagram.bytes).unwrap();
    }
    relay.flush().unwrap();
    let json = end(spy).exits(0).json();
    let account = relay.account();

    assert_eq!(account.total.messages, 2 * (3000 + 1000) + 30);
    assert!(account.total.lost > 100 && account.total.duplicated > 50 && account.total.reordered > 50, "{account:?}");
    // Per sender, from the sequence numbers; messages lost after the last received one cannot be counted.
    assert_eq!(account.senders.len(), 2);
    for SenderAccount { port, counts, lost_at_ends, .. } in &account.senders {
        let Counts { messages, lost, duplicated, .. } = *counts;
        let all = json["senders"].as_array().unwrap();
        let sender = all.iter().find(|s| s["sender"].as_str().unwrap().ends_with(&format!(":{port}"))).unwrap();
        assert_eq!(sender["received"], messages - lost, "{sender}");
        assert_eq!(sender["lost"], lost - lost_at_ends, "{sender}");
        assert_eq!(sender["duplicates"], duplicated, "{sender}");
    }
    // Per channel: received messages, and lost ones of ROBOT_STATE, which has a counter.
    for (name, Counts { messages, lost, .. }) in &account.channels {
        let row = channel(&json, name);
        assert_eq!(row["count"], messages - lost, "{row}");
        let at_ends: u64 = account.senders.iter().map(|sender| sender.lost_at_ends).sum();
        assert_eq!(at_ends, 0, "use a seed with which the last messages are received");
        match &**name {
            channels::ROBOT_STATE => assert_eq!(row["lost"], *lost, "{row}"),
            _ => {
                assert_eq!(row["lost"], Value::Null, "{row}");
                assert!(row["lost_at_most"].as_u64().unwrap() >= *lost, "{row}");
            }
        }
    }
    let late: u64 = json["channels"].as_array().unwrap().iter().map(|channel| channel["late"].as_u64().unwrap()).sum();
    let long_late = channel(&json, "LONG")["late"].as_u64().unwrap();
    // A message with several late fragments is counted once.
    assert!((account.total.reordered - account.channels["LONG"].reordered) == late - long_late, "{late}");
    assert_eq!(json["lost"], account.total.lost);
    assert_eq!(channel(&json, channels::ROBOT_STATE)["senders"].as_array().unwrap().len(), 2);
}

/// Types of a RUN_INFO are used at once, also for messages received before it.
#[test]
fn types_come_from_the_bus_and_from_folders() {
    let text = "package far; struct away_t { int64_t t_ns; int64_t seq; double x; }";
    let types = lcm_idl::TypeSet::parse([("away_t.lcm", text)]).unwrap();
    let ty = types.by_name("far.away_t").unwrap();
    let message = |seq: i64| {
        let mut value = ty.default_value();
        value.set("seq", seq).unwrap();
        ty.encode(&value).unwrap()
    };
    let folder = folder("types");
    std::fs::write(folder.join("away_t.lcm"), text).unwrap();
    let folder = folder.display().to_string();
    for (test, more, sends_run_info) in
        [(2, &[][..], true), (3, &["--lcm-types", &folder][..], false), (4, &[][..], false)]
    {
        let url = url(test);
        let spy = start(&url, more);
        let mut sender = LcmBus::open(&url.to_string()).unwrap();
        sender.publish("AWAY", &message(1)).unwrap();
        if sends_run_info {
            let file = TextFile { name: "away_t.lcm".to_owned(), text: text.to_owned() };
            let info = RunInfo { num_lcm_types: 1, lcm_types: vec![file], ..Default::default() };
            let mut bytes = Vec::new();
            info.encode(&mut bytes).unwrap();
            sender.publish(channels::RUN_INFO, &bytes).unwrap();
        }
        sender.publish("AWAY", &message(2)).unwrap();
        let json = end(spy).exits(0).json();
        let known = if test == 4 { Value::Null } else { json!("far.away_t") };
        assert_eq!(channel(&json, "AWAY")["type"], known);
        assert_eq!(channel(&json, "AWAY")["fingerprint"], format!("{:016x}", ty.fingerprint()));
    }
}

#[test]
fn an_alarm_or_no_message_is_exit_code_1() {
    let url = url(5);
    let alarms = folder("alarms").join("alarms.toml");
    std::fs::write(&alarms, "alarms = [\"ROBOT_STATE count<5\", \"OPERATOR_.* age>0.5\"]\n").unwrap();
    let file = alarms.display().to_string();
    let json = |messages: i64, more: &[&str], code| {
        let spy = start(&url, more);
        let mut sender = LcmBus::open(&url.to_string()).unwrap();
        (0..messages).for_each(|n| sender.publish(channels::ROBOT_STATE, &state(n)).unwrap());
        end(spy).exits(code).json()
    };
    assert_eq!(json(5, &["--alarm", "ROBOT_STATE count<5"], 0)["alarms"], json!([]));
    let raised = json(4, &["--alarms", &file], 1)["alarms"].take();
    assert_eq!(raised[0], json!({"alarm": "ROBOT_STATE count<5", "channel": "ROBOT_STATE", "value": 4.0, "times": 1}));
    assert_eq!(raised[1]["value"], Value::Null);
    // A misspelled name is not an alarm; it is reported as unmatched.
    let misspelt = json(5, &["--alarm", "ROBOT_STAT rate>10", "--alarm", "ROBOT_STATE rate>1e9"], 0);
    assert_eq!((&misspelt["alarms"], &misspelt["unmatched"]), (&json!([]), &json!(["ROBOT_STAT rate>10"])));
    let silent =
        ran(command().args(["spy", "--once", "--seconds", "0.05", "--lcm-url", &url.to_string()]).output().unwrap())
            .exits(1);
    assert!(silent.stderr.contains(&url.to_string()) && silent.stderr.contains("ip route"), "{}", silent.stderr);
}

/// A log is read to its end; removed messages count as lost.
#[test]
fn losses_in_a_log_follow_from_the_counters() {
    let folder = folder("log");
    let (log, holes) = (folder.join("run.mcap"), folder.join("holes.lcmlog"));
    let mut writer = LogWriter::create(&log).unwrap();
    // 1 kHz, intervals alternately 0.1 ms longer and shorter; PLAIN in every tenth.
    for n in 0..1000 {
        let t_ns = n * 1_000_000 + n % 2 * 100_000;
        writer.write(channels::ROBOT_STATE, t_ns, &state(n)).unwrap();
        if n % 10 == 0 {
            writer.write("PLAIN", t_ns, b"text").unwrap();
        }
    }
    writer.finish().unwrap();
    let all = hoof(&format!("spy --once --json --log {}", log.display())).exits(0).json();
    let robot = channel(&all, channels::ROBOT_STATE);
    assert_eq!((&robot["count"], &robot["lost"]), (&json!(1000), &json!(0)));
    assert_eq!((robot["jitter_us"].as_f64(), robot["gap_us"].as_f64()), (Some(100.0), Some(1100.0)));
    // 999 intervals in 999.1 ms.
    let rate = robot["rate_hz"].as_f64().unwrap();
    assert!((rate - 999.0 / 0.9991).abs() < 1e-6, "{rate}");
    assert_eq!(channel(&all, "PLAIN")["lost"], Value::Null);
    assert_eq!((&all["format"], &all["events"]), (&json!("mcap"), &json!(1100)));

    rewrite(&log, &holes, |event| {
        // Replace three messages by messages of a channel without counter.
        if [100, 101, 500].iter().any(|seq| event.data == state(*seq)) {
            event.channel = "PLAIN".into();
            event.data = b"text".to_vec();
        }
    });
    let ran = hoof(&format!("spy --once --json --log {} --alarm ROBOT_STATE", holes.display())).exits(2);
    assert!(ran.stderr.contains("\"ROBOT_STATE\""), "{}", ran.stderr);
    let holes = hoof(&format!("spy --once --json --log {}", holes.display())).exits(0).json();
    assert_eq!((&channel(&holes, channels::ROBOT_STATE)["lost"], &holes["lost"]), (&json!(3), &json!(3)));
    let text = hoof(&format!("spy --once --log {}", log.display())).exits(0).stdout;
    let row: Vec<&str> =
        text.lines().find(|line| line.starts_with("ROBOT_STATE")).unwrap().split_whitespace().collect();
    assert_eq!(row[..8], ["ROBOT_STATE", "robot_state_t", "1000", "999.9", "100", "us", "1.10", "ms"], "{text}");
}

/// The spy sends no datagram.
#[test]
fn a_spy_sends_nothing() {
    let url = url(6);
    let mut listener = Listener::open(&url).unwrap();
    let spy = start(&url, &[]);
    let socket = UdpSocket::bind("0.0.0.0:0").unwrap();
    socket.set_multicast_ttl_v4(0).unwrap();
    let port = socket.local_addr().unwrap().port();
    for n in 0..10 {
        socket.send_to(&split(n, "A", &[0; 70_000])[1], (url.group, url.port)).unwrap();
    }
    // Ten incomplete messages, then a complete one.
    socket.send_to(&split(10, "A", b"end")[0], (url.group, url.port)).unwrap();
    let json = end(spy).exits(0).json();
    assert_eq!((&json["lost"], &json["events"]), (&json!(10), &json!(1)));
    let mut seen = 0;
    while let Some(datagram) = listener.receive_now().unwrap() {
        assert_eq!(datagram.sender.port(), port);
        seen += 1;
    }
    assert_eq!(seen, 11);
}
