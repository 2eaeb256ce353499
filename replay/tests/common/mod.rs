//! Small logs for the tests of this crate.
#![allow(dead_code, reason = "no test file needs all of it")]

pub mod toy;

use replay::log::{Event, Item, LogReader, LogWriter};
use std::path::{Path, PathBuf};

/// A file in cargo's directory for test data; each test file has its own subdirectory.
pub fn path(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("replay").join(env!("CARGO_CRATE_NAME"));
    std::fs::create_dir_all(&folder).unwrap();
    folder.join(name)
}

/// A deterministic random number generator (xorshift64*).
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_F491_4F6C_DD1D)
    }
}

pub type Message = (String, i64, Vec<u8>);

/// Events on three channels, 0 to 59 bytes each, times in whole microseconds.
pub fn messages(count: usize) -> Vec<Message> {
    let mut random = Random(1);
    (0..count)
        .map(|i| {
            let channel = ["ALPHA", "BETA", "A_CHANNEL_WITH_A_LONGER_NAME"][i % 3];
            let data = (0..random.next() % 60).map(|_| (random.next() >> 33) as u8).collect();
            (channel.to_owned(), 1_000_000_000 + i as i64 * 250_000, data)
        })
        .collect()
}

/// Writes a log, each `chunk` messages flushed.
pub fn write(path: &Path, messages: &[Message], chunk: usize) {
    let mut log = LogWriter::create(path).unwrap();
    for (i, (channel, t_ns, data)) in messages.iter().enumerate() {
        log.write(channel, *t_ns, data).unwrap();
        if (i + 1) % chunk == 0 {
            log.flush().unwrap();
        }
    }
    assert_eq!(log.finish().unwrap(), messages.len() as u64);
}

pub fn items(path: &Path) -> Vec<Item> {
    LogReader::open(path).unwrap().map(|item| item.unwrap()).collect()
}

pub fn message(event: &Event) -> Message {
    (event.channel.to_string(), event.t_ns, event.data.clone())
}

/// The messages among the items.
pub fn events(items: &[Item]) -> Vec<Message> {
    items.iter().filter_map(|item| if let Item::Event(event) = item { Some(message(event)) } else { None }).collect()
}
