//! Both formats store what was written, with the bytes that other tools expect.
#![allow(clippy::unwrap_used, reason = "test code")]

mod common;

use lcmtypes::bus::{Bus, LcmBus};
use replay::Error;
use replay::log::{Format, Item, LogReader, LogWriter};
use std::time::Duration;

/// Two events as written by LCM 1.5.3.
#[test]
fn an_event_log_has_the_bytes_of_lcm() {
    let path = common::path("golden.lcmlog");
    let mut log = LogWriter::create(&path).unwrap();
    log.write("CH", 123_456_789_000, b"hello").unwrap();
    log.write("CH2", 123_456_999_999, b"").unwrap();
    log.finish().unwrap();
    #[rustfmt::skip]
    let expected = [
        0xed, 0xa1, 0xda, 0x01, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0x07, 0x5b, 0xcd, 0x15, 0, 0, 0, 2, 0, 0, 0, 5,
        0x43, 0x48, 0x68, 0x65, 0x6c, 0x6c, 0x6f,
        0xed, 0xa1, 0xda, 0x01, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0x07, 0x5b, 0xcd, 0xe7, 0, 0, 0, 3, 0, 0, 0, 0,
        0x43, 0x48, 0x32,
    ];
    assert_eq!(std::fs::read(&path).unwrap(), expected);
}

/// Written by `scripts/make_stock_sample.py`.
#[test]
fn a_log_written_by_lcm_is_read() {
    let items = common::items(std::path::Path::new("tests/data/stock.lcmlog"));
    let expected = [
        ("CH".to_owned(), 123_456_789_000, b"hello".to_vec()),
        ("CH2".to_owned(), 123_456_999_000, vec![]),
        ("CH".to_owned(), 123_457_000_000, (0..=255).collect()),
        ("SYNC".to_owned(), 123_456_000_000, [0xed, 0xa1, 0xda, 0x01].repeat(8)),
        ("x".repeat(63), 123_458_000_000, vec![0]),
    ];
    assert_eq!(common::events(&items), expected);
    assert_eq!(items.len(), expected.len());
}

/// liblcm plays our log: every event, channel and byte, in order. It does not return the times of the file.
#[test]
fn liblcm_plays_our_event_log() {
    let path = common::path("stock_plays.lcmlog");
    let messages = common::messages(200);
    common::write(&path, &messages, usize::MAX);
    let mut bus = LcmBus::open(&format!("file://{}?speed=0", path.display())).unwrap();
    bus.subscribe(".*").unwrap();
    let mut played = Vec::new();
    while played.len() < messages.len() {
        let received = bus.handle(Duration::from_secs(5)).unwrap();
        assert!(!received.is_empty(), "the player stopped after {} of {} events", played.len(), messages.len());
        played.extend(received.into_iter().map(|r| (r.channel, r.data)));
    }
    let expected: Vec<_> = messages.into_iter().map(|(channel, _, data)| (channel, data)).collect();
    assert!(played == expected, "{} of {} events", played.len(), expected.len());
}

#[test]
fn both_formats_return_what_was_written() {
    let messages = common::messages(1000);
    for (name, format) in [("round.lcmlog", Format::LcmLog), ("round.mcap", Format::Mcap)] {
        let path = common::path(name);
        common::write(&path, &messages, 300);
        let reader = LogReader::open(&path).unwrap();
        assert_eq!(reader.format(), format);
        let mut events = reader.events();
        let read: Vec<_> = events.by_ref().map(|event| common::message(&event.unwrap())).collect();
        assert!(read == messages, "{name}");
        assert!(events.health().is_good(), "{name}: {:?}", events.health());
    }
}

#[test]
fn nanoseconds_survive_in_mcap_and_are_rounded_down_in_an_event_log() {
    for (name, expected) in [("ns.mcap", 1_999), ("ns.lcmlog", 1_000)] {
        let path = common::path(name);
        common::write(&path, &[("CH".into(), 1_999, vec![7])], 10);
        assert_eq!(common::events(&common::items(&path)), [("CH".to_owned(), expected, vec![7])]);
    }
}

#[test]
fn equal_events_give_equal_bytes() {
    let messages = common::messages(3000);
    for ending in ["lcmlog", "mcap"] {
        let [a, b] = ["a", "b"].map(|name| common::path(&format!("same_{name}.{ending}")));
        common::write(&a, &messages, usize::MAX);
        common::write(&b, &messages, usize::MAX);
        assert!(std::fs::read(a).unwrap() == std::fs::read(b).unwrap(), "{ending}");
    }
}

/// The reader of the mcap crate, which uses the index, finds the same messages as our reader, which walks over the records.
#[test]
fn the_mcap_crate_reads_our_mcap() {
    let messages = common::messages(500);
    let path = common::path("crate.mcap");
    common::write(&path, &messages, 100);
    let bytes = std::fs::read(path).unwrap();
    let read: Vec<_> = mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap).collect();
    assert_eq!(read.len(), messages.len());
    for ((found, (channel, t_ns, data)), number) in read.iter().zip(&messages).zip(0..) {
        assert_eq!((&found.channel.topic, &found.data[..]), (channel, &data[..]));
        assert_eq!((found.log_time, found.publish_time), (*t_ns as u64, *t_ns as u64));
        assert_eq!(found.channel.message_encoding, "lcm");
        assert_eq!(found.sequence, number);
    }
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    assert_eq!(summary.stats.unwrap().message_count, 500);
    assert_eq!(summary.chunk_indexes.len(), 5);
}

#[test]
fn the_format_is_detected_from_the_content() {
    let messages = common::messages(5);
    let (mcap, misnamed) = (common::path("named.mcap"), common::path("misnamed.lcmlog"));
    common::write(&mcap, &messages, 2);
    std::fs::copy(mcap, &misnamed).unwrap();
    let reader = LogReader::open(&misnamed).unwrap();
    assert_eq!(reader.format(), Format::Mcap);
    assert_eq!(reader.count(), 5);
}

#[test]
fn other_files_are_rejected_with_their_name() {
    let open = |name: &str, bytes: &[u8]| {
        let path = common::path(name);
        std::fs::write(&path, bytes).unwrap();
        LogReader::open(path).err().unwrap()
    };
    assert!(matches!(open("empty.lcmlog", b""), Error::EmptyFile { .. }));
    let error = open("three.mcap", b"abc");
    assert!(matches!(error, Error::NotALog { bytes: 3, .. }), "{error}");
    assert!(error.to_string().contains("three.mcap") && error.to_string().contains("61 62 63"), "{error}");
    assert!(matches!(open("text.mcap", "nothing but words ".repeat(100_000).as_bytes()), Error::NotALog { .. }));
    let missing = LogReader::open(common::path("missing.mcap")).err().unwrap();
    assert!(matches!(missing, Error::Io { .. }) && missing.to_string().contains("missing.mcap"), "{missing}");
    assert!(matches!(LogReader::open(common::path("")), Err(Error::NotAFile { .. })));
}

#[test]
fn a_writer_rejects_events_that_no_reader_accepts() {
    assert!(matches!(LogWriter::create(common::path("log.txt")), Err(Error::UnknownExtension { .. })));
    assert!(matches!(LogWriter::create(common::path("none/log.mcap")), Err(Error::Io { .. })));
    for name in ["refuse.lcmlog", "refuse.mcap"] {
        let path = common::path(name);
        let mut log = LogWriter::create(&path).unwrap();
        if name == "refuse.lcmlog" {
            for channel in ["", "a\0b", &"x".repeat(1000)] {
                assert!(matches!(log.write(channel, 0, b"data"), Err(Error::ChannelName { .. })), "{channel:?}");
            }
        } else {
            assert!(matches!(log.write("CH", -1, b"data"), Err(Error::NegativeTime { t_ns: -1, .. })));
        }
        // A rejected event leaves the log unchanged.
        log.write("CH", 5000, b"data").unwrap();
        assert_eq!(log.finish().unwrap(), 1);
        assert_eq!(common::events(&common::items(&path)), [("CH".to_owned(), 5000, b"data".to_vec())]);
    }
}

#[test]
fn a_dropped_writer_has_written_its_events() {
    for name in ["dropped.lcmlog", "dropped.mcap"] {
        let path = common::path(name);
        let mut log = LogWriter::create(&path).unwrap();
        log.write("CH", 5000, b"data").unwrap();
        drop(log);
        assert!(matches!(common::items(&path)[..], [Item::Event(_)]), "{name}");
    }
}
