//! The way of a run to its log: nothing out of order, nothing left out in silence, whatever the disk does.
#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use common::{events, items, message, messages, path, write};
use lcmtypes::{Event, Message, channels};
use replay::Error;
use replay::log::{LogReader, LogWriter, Output};
use replay::record::{
    DiskState, EventSink, Files, Pattern, RecordLevel, RingOptions, RingWriter, Rotation, Target, WhenFull,
};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex};

/// An event log holds whole microseconds, ns.
const US: i64 = 1000;

fn options(capacity: usize, when_full: WhenFull) -> RingOptions {
    RingOptions { capacity, when_full, ..RingOptions::lockstep() }
}

#[test]
fn a_log_through_a_ring_is_the_same_file() {
    let messages = messages(5000);
    for name in ["direct.mcap", "direct.lcmlog"] {
        let (direct, ring) = (path(name), path(&name.replace("direct", "ring")));
        write(&direct, &messages, usize::MAX);
        // A ring of a few events: the writer waits thousands of times.
        for capacity in [300, 1 << 20] {
            let mut log = RingWriter::create(&ring, &options(capacity, WhenFull::Wait)).unwrap();
            for (channel, t_ns, data) in &messages {
                log.write(channel, *t_ns, data).unwrap();
            }
            assert_eq!(log.finish().unwrap(), 5000);
            assert!(std::fs::read(&ring).unwrap() == std::fs::read(&direct).unwrap(), "{name}, ring of {capacity}");
        }
    }
}

#[test]
fn what_was_flushed_is_in_the_file() {
    for name in ["flushed.mcap", "flushed.lcmlog"] {
        let path = path(name);
        let mut log = RingWriter::create(&path, &RingOptions::lockstep()).unwrap();
        for t in 1..=3 {
            log.write("A", t * US, b"12345678").unwrap();
            log.flush().unwrap();
            assert_eq!(kept(&path, "A"), (1..=t).collect::<Vec<_>>());
        }
        assert_eq!(log.finish().unwrap(), 3);
    }
}

/// Payloads that are no LCM messages seem to have a type each, and MCAP has 65,536 channels.
#[test]
fn payloads_of_no_type_are_recorded_without_end() {
    let path = path("payloads.mcap");
    let mut log = RingWriter::create(&path, &RingOptions::lockstep()).unwrap();
    for i in 0..70_000u64 {
        log.write("RAW", 0, &i.to_be_bytes()).unwrap();
    }
    assert_eq!(log.finish().unwrap(), 70_000);
    let events = events(&items(&path));
    assert!((0..).zip(&events).all(|(i, (_, _, data))| *data == u64::to_be_bytes(i)));
    assert_eq!(events.len(), 70_000);
}

#[test]
fn what_no_log_can_hold_is_refused_at_once() {
    let mut log = RingWriter::create(path("refused.mcap"), &options(300, WhenFull::Wait)).unwrap();
    assert!(matches!(log.write("", 0, b""), Err(Error::ChannelName { .. })));
    assert!(matches!(log.write("A", -1, b""), Err(Error::NegativeTime { .. })));
    assert!(matches!(log.write("A", 0, &[0; 300]), Err(Error::RingTooSmall { bytes: 310, limit: 296, .. })));
    log.write("A", 0, &[0; 286]).unwrap();
    assert_eq!(log.finish().unwrap(), 1);
}

#[test]
fn dropping_it_completes_the_log() {
    let path = path("dropped.mcap");
    let mut log = RingWriter::create(&path, &RingOptions::lockstep()).unwrap();
    log.write("A", 1000, b"x").unwrap();
    drop(log);
    assert_eq!(events(&items(&path)), [("A".to_owned(), 1000, b"x".to_vec())]);
}

/// A log that stops at every event until the test lets it go on, and says where it stands.
struct Gate {
    log: LogWriter,
    arrived: Sender<()>,
    go: Receiver<()>,
}

impl EventSink for Gate {
    fn write(&mut self, channel: &str, t_ns: i64, data: &[u8]) -> Result<(), Error> {
        // After the test has let go of its ends, everything passes.
        if self.arrived.send(()).is_ok() {
            let _ = self.go.recv();
        }
        self.log.write(channel, t_ns, data)
    }
}

impl Target for Gate {
    fn flush(&mut self) -> Result<(), Error> {
        self.log.flush()
    }

    fn finish(self: Box<Self>) -> Result<u64, Error> {
        self.log.finish()
    }
}

struct Held {
    log: RingWriter,
    arrived: Receiver<()>,
    go: Sender<()>,
}

/// A writer whose thread has read the event FIRST from the ring of 64 kB and is blocked.
fn held(path: &Path, vital: Option<&str>) -> Held {
    let ((arrived, has_arrived), (go, may_go)) = (channel(), channel());
    let gate = Gate { log: LogWriter::create(path).unwrap(), arrived, go: may_go };
    let vital = vital.map(|vital| Pattern::new(vital).unwrap());
    let mut log = RingWriter::start(path, Box::new(gate), &options(64_000, WhenFull::Drop { vital })).unwrap();
    log.write("FIRST", 0, b"").unwrap();
    has_arrived.recv().unwrap();
    Held { log, arrived: has_arrived, go }
}

fn kept(path: &Path, name: &str) -> Vec<i64> {
    LogReader::open(path)
        .unwrap()
        .events()
        .map(Result::unwrap)
        .filter(|event| *event.channel == *name)
        .map(|event| event.t_ns / US)
        .collect()
}

/// EVENT messages of the recorder: time in us, level, text.
fn reports(path: &Path) -> Vec<(i64, i8, String)> {
    let events = LogReader::open(path).unwrap().events().map(Result::unwrap);
    let reports =
        events.filter(|event| *event.channel == *channels::EVENT).map(|event| Event::decode(&event.data).unwrap());
    reports.map(|event| (event.t_ns / US, event.level, event.text)).collect()
}

#[test]
fn a_slow_disk_drops_debug_channels_first_and_no_replay_input() {
    for vital in [None, Some("OTHER.*")] {
        let path = path("slow.lcmlog");
        let Held { mut log, arrived, go } = held(&path, vital);
        // 1 kB each: half of the ring is full after 32, three quarters after 48; inputs alone fill the rest.
        let others = [channels::ROBOT_STATE, channels::ROBOT_COMMAND, "OTHER_PROJECT"];
        for t in 1..=20 {
            for name in others {
                log.write(name, t * US, &[0; 970]).unwrap();
            }
            if t % 2 == 0 {
                log.write(channels::CONTROLLER_INPUT, t * US, &[0; 970]).unwrap();
            }
        }
        assert_eq!(log.level(), if vital.is_none() { RecordLevel::Replay } else { RecordLevel::Inputs });
        let left_out = log.left_out();
        drop((arrived, go));
        log.finish().unwrap();

        let inputs: Vec<i64> = (1..=10).map(|i| 2 * i).collect();
        assert_eq!(kept(&path, channels::CONTROLLER_INPUT), inputs);
        // The debug channel is dropped first, then unknown channels unless they are vital.
        let states = kept(&path, channels::ROBOT_STATE);
        assert_eq!(states, (1..=10).collect::<Vec<_>>());
        for name in others {
            let there = kept(&path, name).len() as u64;
            assert_eq!(there + left_out.get(name).copied().unwrap_or(0), 20, "{name}");
        }
        assert_eq!(kept(&path, "OTHER_PROJECT").len(), if vital.is_some() { 20 } else { 9 });
        // The log reports exactly the dropped messages.
        let reports = reports(&path);
        assert_eq!((reports[0].0, reports[0].1), (10, Event::LEVEL_WARNING));
        let reported: u64 = reports.iter().map(|(_, _, text)| dropped(text).map(|(_, count)| count).sum::<u64>()).sum();
        assert_eq!(reported, left_out.values().sum::<u64>());
    }
}

/// The channels and counts at the end of a report: `...: A 1, B 2`.
fn dropped(text: &str) -> impl Iterator<Item = (&str, u64)> {
    let list = text.rsplit_once(": ").map_or("", |(_, list)| list);
    list.split(", ").filter_map(|one| one.rsplit_once(' ')).map(|(name, count)| (name, count.parse().unwrap()))
}

#[test]
fn replay_inputs_that_do_not_fit_are_reported() {
    let path = path("stuck.lcmlog");
    let Held { mut log, arrived, go } = held(&path, None);
    for t in 1..=100 {
        log.write(channels::CONTROLLER_INPUT, t * US, &[0; 970]).unwrap();
    }
    let lost = log.left_out()[channels::CONTROLLER_INPUT];
    drop((arrived, go));
    log.finish().unwrap();
    let there = kept(&path, channels::CONTROLLER_INPUT);
    assert_eq!(there, (1..=there.len() as i64).collect::<Vec<_>>());
    assert_eq!(there.len() as u64 + lost, 100);
    assert!(lost > 30, "{lost}");
    let reports = reports(&path);
    assert_eq!(reports.iter().flat_map(|(_, _, text)| dropped(text)).map(|(_, count)| count).sum::<u64>(), lost);
}

#[test]
fn low_disk_space_drops_the_same_channels() {
    let path = path("reserve.lcmlog");
    let mut log = RingWriter::create(&path, &options(1 << 20, WhenFull::Drop { vital: None })).unwrap();
    for (t, level) in [(1, RecordLevel::All), (2, RecordLevel::Replay), (3, RecordLevel::Inputs), (4, RecordLevel::All)]
    {
        log.set_disk_level(level);
        for name in [channels::CONTROLLER_INPUT, channels::ROBOT_COMMAND, channels::ROBOT_STATE] {
            log.write(name, t * US, b"x").unwrap();
        }
    }
    log.finish().unwrap();
    assert_eq!(kept(&path, channels::CONTROLLER_INPUT), [1, 2, 3, 4]);
    assert_eq!(kept(&path, channels::ROBOT_COMMAND), [1, 2, 4]);
    assert_eq!(kept(&path, channels::ROBOT_STATE), [1, 4]);
    let reports = reports(&path);
    let (state, command) = ((channels::ROBOT_STATE, 1), (channels::ROBOT_COMMAND, 1));
    let found: Vec<_> = reports.iter().map(|(_, level, text)| (*level, dropped(text).collect::<Vec<_>>())).collect();
    let warning = Event::LEVEL_WARNING;
    assert_eq!(found, [(warning, vec![]), (warning, vec![state]), (warning, vec![command, state])]);
}

/// A disk of `room` bytes, in memory.
#[derive(Clone, Default)]
struct SmallDisk(Arc<Mutex<(Vec<u8>, usize)>>);

impl SmallDisk {
    fn with_room(room: usize) -> Self {
        SmallDisk(Arc::new(Mutex::new((Vec::new(), room))))
    }

    fn set_room(&self, room: usize) {
        self.0.lock().unwrap().1 = room;
    }

    /// The file as it is now, as one that can be opened.
    fn save(&self, name: &str) -> PathBuf {
        let path = path(name);
        std::fs::write(&path, &self.0.lock().unwrap().0).unwrap();
        path
    }
}

impl io::Write for SmallDisk {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let (file, room) = &mut *self.0.lock().unwrap();
        let count = bytes.len().min(room.saturating_sub(file.len()));
        if count == 0 && !bytes.is_empty() {
            return Err(io::ErrorKind::StorageFull.into());
        }
        file.extend_from_slice(&bytes[..count]);
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

fn on_disk(name: &str, disk: &SmallDisk) -> (RingWriter, Arc<DiskState>) {
    let state = Arc::<DiskState>::default();
    let disk = disk.clone();
    let create = move |_: &Path| Ok(Box::new(disk.clone()) as Output);
    let files = Files::create_on(Path::new(name), Rotation::default(), Arc::clone(&state), Box::new(create)).unwrap();
    let options = RingOptions { capacity: 1 << 22, ..RingOptions::live() };
    (RingWriter::start(Path::new(name), Box::new(files), &options).unwrap(), state)
}

#[test]
fn a_full_disk_is_waited_for_and_leaves_no_hole() {
    for name in ["full.lcmlog", "full.mcap"] {
        let messages = messages(20_000);
        let disk = SmallDisk::with_room(100_000);
        let (mut log, state) = on_disk(name, &disk);
        for (channel, t_ns, data) in &messages {
            log.write(channel, *t_ns, data).unwrap();
        }
        while state.trouble().is_none() {
            std::thread::yield_now();
        }
        disk.set_room(usize::MAX);
        assert_eq!(log.finish().unwrap(), 20_000);
        assert_eq!(state.trouble(), None);
        assert!(events(&items(&disk.save(name))) == messages, "{name}");
    }
}

#[test]
fn a_disk_that_stays_full_leaves_a_log_that_can_be_read() {
    for name in ["stays_full.lcmlog", "stays_full.mcap"] {
        let messages = messages(20_000);
        let disk = SmallDisk::with_room(100_001);
        let (mut log, state) = on_disk(name, &disk);
        for (channel, t_ns, data) in &messages {
            log.write(channel, *t_ns, data).unwrap();
        }
        while state.trouble().is_none() {
            std::thread::yield_now();
        }
        state.give_up();
        log.finish().unwrap_err();
        let saved = disk.save(name);
        assert!(std::fs::metadata(&saved).unwrap().len() <= 100_001);
        let mut reader = LogReader::open(&saved).unwrap().events();
        let there: Vec<_> = reader.by_ref().map(|event| message(&event.unwrap())).collect();
        assert!(reader.health().damaged.is_empty(), "{:?}", reader.health());
        assert!(there.len() < messages.len() && there == messages[..there.len()], "{name}");
        // Nothing that the disk took is given away but the event or chunk that it took in part.
        let cut = reader.health().cut.as_ref().map_or(0, |cut| cut.bytes);
        assert!(cut < if name.ends_with(".lcmlog") { 200 } else { 100_001 }, "{cut}");
    }
}

#[test]
fn files_follow_each_other_by_size_and_time_and_each_explains_itself() {
    for (rotation, count) in [
        (Rotation { bytes: Some(20_000), ..Rotation::default() }, None),
        (Rotation { time_ns: Some(1_000_000_000), ..Rotation::default() }, Some(5)),
        (Rotation { time_ns: Some(1_000_000_000), keep: Some(2), ..Rotation::default() }, Some(2)),
    ] {
        let out = path("rotated.lcmlog");
        let state = Arc::<DiskState>::default();
        let mut files = Box::new(Files::create(&out, rotation, state).unwrap());
        let names = files.names();
        let info = lcmtypes::RunInfo { robot: "hyq".to_owned(), ..Default::default() };
        let mut info_bytes = Vec::new();
        info.encode(&mut info_bytes).unwrap();
        files.write(channels::RUN_INFO, 0, &info_bytes).unwrap();
        let messages: Vec<_> =
            (0..450).map(|i| ("A".to_owned(), i64::from(i) * 10_000_000, vec![i as u8; 200])).collect();
        for (channel, t_ns, data) in &messages {
            files.write(channel, *t_ns, data).unwrap();
            files.flush().unwrap();
        }
        files.finish().unwrap();

        let names: Vec<PathBuf> = names.lock().unwrap().iter().cloned().collect();
        if let Some(count) = count {
            assert_eq!(names.len(), count);
        }
        let mut all = Vec::new();
        for (name, bytes) in names.iter().map(|name| (name, std::fs::metadata(name).unwrap().len())) {
            let mut events = events(&items(name));
            let (channel, _, data) = events.remove(0);
            assert_eq!((&*channel, data), (channels::RUN_INFO, info_bytes.clone()));
            assert!(rotation.bytes.is_none_or(|limit| bytes < limit + 1000), "{bytes}");
            all.extend(events);
        }
        assert!(all == messages[messages.len() - all.len()..]);
        assert!(rotation.keep.is_some() || all.len() == messages.len());
        assert!(names.len() > 1 && names[0].file_name().unwrap().to_str().unwrap().starts_with("rotated_000"));
        names.iter().for_each(|name| std::fs::remove_file(name).unwrap());
    }
}
