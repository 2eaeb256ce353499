//! `hoof log record`: stopped by a signal, killed, with a full disk, with wrong arguments.
#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use common::{Ran, command, events, folder, hoof, messages, ran};
use drivers::live::clock::now_ns;
use lcmtypes::{Event, channels};
use replay::log::LogReader;
use replay::udpm::{Url, split};
use std::io::{BufRead, BufReader};
use std::net::UdpSocket;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// A separate network for each test.
fn url(test: u32) -> Url {
    Url { port: common::network::port(test), ..Url::default() }
}

struct Sender {
    socket: UdpSocket,
    url: Url,
    sent: u32,
}

impl Sender {
    fn new(url: &Url) -> Self {
        let socket = UdpSocket::bind("0.0.0.0:0").unwrap();
        socket.set_multicast_ttl_v4(0).unwrap();
        Sender { socket, url: url.clone(), sent: 0 }
    }

    /// Sends a message with its number.
    fn send(&mut self, channel: &str) {
        let data = [&self.sent.to_be_bytes()[..], &[5; 396]].concat();
        for datagram in split(self.sent, channel, &data) {
            self.socket.send_to(&datagram, (self.url.group, self.url.port)).unwrap();
        }
        self.sent += 1;
    }
}

/// Starts a recorder and waits until it receives.
fn start(mut command: Command) -> Child {
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut output = String::new();
    let mut stderr = BufReader::new(child.stderr.take().unwrap());
    while !output.contains("recording udpm://") {
        let before = output.len();
        stderr.read_line(&mut output).unwrap();
        assert!(output.len() > before, "the recorder ended: {output}");
    }
    child.stderr = Some(stderr.into_inner());
    child
}

fn record(url: &Url, out: &Path, more: &str) -> Command {
    let mut command = command();
    command.args(["log", "record", "--json", "--lcm-url", &url.to_string()]).args(more.split_whitespace()).arg(out);
    command
}

fn end(child: Child, signal: &str) -> Ran {
    let id = child.id().to_string();
    assert!(Command::new("kill").args([signal, &id]).status().unwrap().success());
    ran(child.wait_with_output().unwrap())
}

/// The number in every message of a channel.
fn numbers(log: &Path, channel: &str) -> Vec<u32> {
    let events = LogReader::open(log).unwrap().events().map(Result::unwrap);
    let events = events.filter(|event| *event.channel == *channel);
    events.map(|event| u32::from_be_bytes(*event.data.first_chunk().unwrap())).collect()
}

#[test]
fn a_signal_completes_the_log() {
    let folder = folder("signal");
    for (test, signal, name) in [(0, "-INT", "run.lcmlog"), (1, "-TERM", "run.mcap")] {
        let (url, log) = (url(test), folder.join(name));
        let began_ns = now_ns();
        let recorder = start(record(&url, &log, ""));
        let mut sender = Sender::new(&url);
        (0..500).for_each(|_| sender.send("A"));
        let json = end(recorder, signal).exits(0).json();
        // Its own EVENT messages have the monotonic clock of a run's messages, independent of the log's clock.
        let own: Vec<Event> = messages(&log, channels::EVENT);
        assert!(own.iter().all(|event| (began_ns..now_ns()).contains(&event.t_ns)), "{own:?}");
        assert_eq!(own.len(), 1);
        // Every message sent before the signal is in the log, even if it was still in the kernel's buffer.
        assert_eq!(numbers(&log, "A"), (0..500).collect::<Vec<_>>());
        assert_eq!(json["events"], events(&log).len());
        assert_eq!(
            (&json["heard"], &json["lost"], &json["senders"][0]["received"]),
            (&500.into(), &0.into(), &500.into())
        );
        assert_eq!(json["files"][0], log.display().to_string());
    }
}

/// Time from sending the last recorded message to the kill; `None` if the sender stalled. Fails if an earlier message is missing.
fn killed(url: &Url, log: &Path, messages: u32) -> Option<Duration> {
    let mut recorder = start(record(url, log, ""));
    let mut sender = Sender::new(url);
    let mut sent = Vec::new();
    let mut stall = Duration::ZERO;
    while sender.sent < messages {
        // 2 kHz; a busy wait, since a sleeper wakes up late.
        while sent.last().is_some_and(|last: &Instant| last.elapsed() < Duration::from_micros(500)) {
            std::hint::spin_loop();
        }
        sent.push(Instant::now());
        sender.send("A");
        stall = stall.max(sent[sent.len().saturating_sub(2)].elapsed());
    }
    let killed = Instant::now();
    recorder.kill().unwrap();
    assert!(!recorder.wait().unwrap().success());

    let there = numbers(log, "A");
    assert_eq!(there, (0..there.len() as u32).collect::<Vec<_>>(), "a message is missing");
    let last = sent[there.len().checked_sub(1)?];
    (stall < Duration::from_millis(20)).then(|| killed.duration_since(last))
}

/// Kill times are seeded. Rounds in which the sender itself stalled for 20 ms are not counted.
#[test]
fn kill_9_loses_at_most_the_last_tenth_of_a_second() {
    const WANTED: usize = 3;
    let folder = folder("kill");
    for name in ["run.lcmlog", "run.mcap"] {
        let mut seen = Vec::new();
        for round in 0..20u16 {
            let messages = 300 + u32::from(round) * 7919 % 700;
            seen.extend(killed(&url(2), &folder.join(name), messages));
            if seen.iter().filter(|missing| missing.as_millis() <= 100).count() == WANTED {
                break;
            }
        }
        let good = seen.iter().filter(|missing| missing.as_millis() <= 100).count();
        assert!(good == WANTED, "{name}: missing before the kill: {seen:?}");
    }
}

#[test]
fn a_full_disk_leaves_a_readable_log() {
    let folder = folder("full");
    for (test, name) in [(3, "run.lcmlog"), (4, "run.mcap")] {
        let (url, log) = (url(test), folder.join(name));
        let recorder = record(&url, &log, "");
        // Limits files to 64 kB: a full disk that needs no root.
        let mut limited = Command::new("bash");
        limited.args(["-c", "ulimit -f 64; exec \"$0\" \"$@\""]).arg(recorder.get_program()).args(recorder.get_args());
        let recorder = start(limited);
        let mut sender = Sender::new(&url);
        let mut word = 1u64;
        (0..2000).for_each(|_| {
            // Different channel names, so that the log does not compress below the limit.
            word = word.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            sender.send(&format!("A{:x}", word >> 32));
        });
        let json = end(recorder, "-INT").exits(3).json();
        assert!(json["failure"].as_str().unwrap().contains("File too large"), "{json}");
        assert_eq!((&json["heard"], &json["lost"]), (&2000.into(), &0.into()));
        let mut reader = LogReader::open(&log).unwrap().events();
        let there: Vec<u32> =
            reader.by_ref().map(|event| u32::from_be_bytes(*event.unwrap().data.first_chunk().unwrap())).collect();
        assert!(reader.health().damaged.is_empty(), "{:?}", reader.health());
        assert!(!there.is_empty() && there.len() < 2000);
        assert_eq!(there, (0..there.len() as u32).collect::<Vec<_>>());
    }
}

#[test]
fn rotated_files_are_named_and_complete() {
    let folder = folder("rotate");
    let (url, log) = (url(5), folder.join("run.lcmlog"));
    let recorder = start(record(&url, &log, "--rotate-mb 0.2 --seconds 60"));
    let mut sender = Sender::new(&url);
    // A buffer is written at 256 kB or after 50 ms, whichever is first: this many messages need several files.
    (0..5000).for_each(|_| sender.send("A"));
    let json = end(recorder, "-INT").exits(0).json();
    let files: Vec<_> =
        json["files"].as_array().unwrap().iter().map(|file| file.as_str().unwrap().to_owned()).collect();
    assert!(files.len() > 2 && files[1].ends_with("run_0001.lcmlog"), "{files:?}");
    let all: Vec<u32> = files.iter().flat_map(|file| numbers(Path::new(file), "A")).collect();
    assert_eq!(all, (0..5000).collect::<Vec<_>>());
}

#[test]
fn little_free_space_keeps_only_replay_inputs() {
    let folder = folder("reserve");
    let (url, log) = (url(6), folder.join("run.lcmlog"));
    // More than the free space of any disk.
    let recorder = start(record(&url, &log, "--reserve-mb 10000000 --vital VITAL"));
    let mut sender = Sender::new(&url);
    for channel in [channels::CONTROLLER_INPUT, channels::ROBOT_COMMAND, "VITAL", "OTHER"] {
        (0..10).for_each(|_| sender.send(channel));
    }
    let json = end(recorder, "-INT").exits(3).json();
    let counted =
        [channels::CONTROLLER_INPUT, channels::ROBOT_COMMAND, "VITAL", "OTHER"].map(|name| numbers(&log, name).len());
    assert_eq!(counted, [10, 0, 10, 0]);
    assert_eq!((&json["left_out"]["ROBOT_COMMAND"], &json["left_out"]["OTHER"]), (&10.into(), &10.into()));
}

#[test]
fn invalid_arguments_are_named() {
    let folder = folder("wrong");
    let out = folder.join("run.mcap").display().to_string();
    for (arguments, parts) in [
        (format!("--lcm-url udpm://10.1.2.3 {out}"), ["10.1.2.3", "multicast"]),
        (format!("--include A( {out}"), ["\"A(\"", "channel"]),
        (format!("--rotate-mb=-1 {out}"), ["--rotate-mb -1", "10000000"]),
        (folder.join("run.txt").display().to_string(), ["run.txt", ".lcmlog"]),
    ] {
        let ran = hoof(&format!("log record {arguments}")).exits(2);
        assert!(parts.iter().all(|part| ran.stderr.contains(part)), "{}", ran.stderr);
    }
    assert!(!folder.join("run.mcap").exists());
}
