//! Runs the command, and reads or alters the logs that it writes.
#![allow(dead_code, reason = "each test file uses a part of it")]

pub mod live_process;
pub mod network;

use lcmtypes::Message;
use replay::log::{Event, LogReader, LogWriter};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

/// The command, in the root of the source tree.
pub fn command() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_hoof"));
    command.current_dir(env!("CARGO_MANIFEST_DIR")).stdin(Stdio::null());
    command
}

/// Exit code and output of the command.
#[derive(Debug)]
pub struct Ran {
    /// Exit code.
    pub code: i32,
    /// Standard output.
    pub stdout: String,
    /// Standard error.
    pub stderr: String,
}

/// Runs `hoof` with arguments separated by spaces.
pub fn hoof(arguments: &str) -> Ran {
    ran(command().args(arguments.split_whitespace()).output().unwrap())
}

/// Output of a finished process; a panic or a signal fails the test.
pub fn ran(output: Output) -> Ran {
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    let (stdout, stderr) = (text(output.stdout), text(output.stderr));
    assert!(!stderr.contains("panicked"), "{stderr}");
    let code = output.status.code().unwrap_or_else(|| panic!("{}: {stderr}", output.status));
    Ran { code, stdout, stderr }
}

impl Ran {
    /// Fails the test if the exit code is not `code`.
    #[track_caller]
    pub fn exits(self, code: i32) -> Self {
        assert_eq!(self.code, code, "exit code\n{}{}", self.stdout, self.stderr);
        self
    }

    /// Fails the test unless the exit code of a live run is the one that its JSON implies: 0, 1 if a process failed (a fall in simulation
    /// included), 3 if data was lost.
    #[track_caller]
    pub fn exits_as_reported(self) -> Self {
        let json = self.json();
        let codes = ["recorder", "driver", "controller"].map(|name| json[name]["exit_code"].as_i64());
        let code = match codes {
            _ if codes.iter().any(|code| !matches!(code, Some(0 | 3))) => 1,
            _ if codes.contains(&Some(3)) => 3,
            _ => 0,
        };
        self.exits(code)
    }

    /// Standard output as JSON.
    #[track_caller]
    pub fn json(&self) -> Value {
        serde_json::from_str(&self.stdout).unwrap_or_else(|error| panic!("{error}\n{}{}", self.stdout, self.stderr))
    }
}

/// An empty folder for one test.
pub fn folder(test: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("hoof").join(env!("CARGO_CRATE_NAME")).join(test);
    if folder.exists() {
        std::fs::remove_dir_all(&folder).unwrap();
    }
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// All events of an undamaged log.
pub fn events(log: &Path) -> Vec<Event> {
    let mut events = LogReader::open(log).unwrap().events();
    let found = events.by_ref().map(|event| event.unwrap()).collect();
    assert!(events.health().is_good(), "{}: {:?}", log.display(), events.health());
    found
}

/// All messages of one channel, decoded.
pub fn messages<M: Message>(log: &Path, channel: &str) -> Vec<M> {
    events(log).iter().filter(|event| *event.channel == *channel).map(|event| M::decode(&event.data).unwrap()).collect()
}

/// Copies a log; `change` alters each event.
pub fn rewrite(from: &Path, to: &Path, mut change: impl FnMut(&mut Event)) {
    let mut log = LogWriter::create(to).unwrap();
    for mut event in events(from) {
        change(&mut event);
        log.write(&event.channel, event.t_ns, &event.data).unwrap();
    }
    log.finish().unwrap();
}

/// Copies a log and alters one message: the one of `channel` with this tick (the second field of most types).
pub fn rewrite_one<M: Message>(from: &Path, to: &Path, channel: &str, tick: i64, change: impl Fn(&mut M)) {
    let mut altered = 0;
    rewrite(from, to, |event| {
        if *event.channel == *channel && event.data[16..24] == tick.to_be_bytes() {
            let mut message = M::decode(&event.data).unwrap();
            change(&mut message);
            event.data.clear();
            message.encode(&mut event.data).unwrap();
            altered += 1;
        }
    });
    assert_eq!(altered, 1, "messages of {channel} with tick {tick}");
}
