//! MCAP files of other writers, made record by record: what the specification allows is read, and copies keep what the file says.
#![allow(clippy::unwrap_used, reason = "test code")]

mod common;

use replay::Error;
use replay::log::{CopyOptions, CopyReport, Item, ItemRef, LogReader, LogWriter, Types, copy, merge, verify};
use std::path::{Path, PathBuf};

const MAGIC: &[u8] = b"\x89MCAP0\r\n";

fn text(text: &str) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat()
}

fn map(entries: &[(&str, &str)]) -> Vec<u8> {
    let entries: Vec<u8> = entries.iter().flat_map(|(key, value)| [text(key), text(value)].concat()).collect();
    [&(entries.len() as u32).to_le_bytes()[..], &entries].concat()
}

/// A record; `added`: bytes of fields that this version of the format does not know.
fn record(opcode: u8, body: &[u8], added: &[u8]) -> Vec<u8> {
    [&[opcode][..], &((body.len() + added.len()) as u64).to_le_bytes(), body, added].concat()
}

fn schema(added: &[u8]) -> Vec<u8> {
    let body = [&[1, 0][..], &text("pkg/msg/Pose"), &text("ros2msg"), &text("float64 x")].concat();
    record(3, &body, added)
}

fn channel(id: u8, topic: &str, added: &[u8]) -> Vec<u8> {
    let metadata = map(&[("qos", "old"), ("qos", "reliable")]);
    let body = [&[id, 0, 1, 0][..], &text(topic), &text("cdr"), &metadata].concat();
    record(4, &body, added)
}

fn message(channel: u8, sequence: u32, log_time: u64, data: &[u8]) -> Vec<u8> {
    let times = [log_time, log_time + 7].map(u64::to_le_bytes).concat();
    record(5, &[&[channel, 0][..], &sequence.to_le_bytes(), &times, data].concat(), b"")
}

fn chunk(records: &[u8], added: &[u8]) -> Vec<u8> {
    let sizes = [0, 100, records.len() as u64].map(u64::to_le_bytes).concat();
    let crc = crc32fast::hash(records).to_le_bytes();
    let body = [&sizes, &crc[..], &text(""), &(records.len() as u64).to_le_bytes(), records].concat();
    record(6, &body, added)
}

fn attachment() -> Vec<u8> {
    let times = [3_u64, 4].map(u64::to_le_bytes).concat();
    let body = [&times, &text("map.png")[..], &text("image/png"), &5_u64.to_le_bytes(), b"12345"].concat();
    record(9, &[&body[..], &crc32fast::hash(&body).to_le_bytes()].concat(), b"")
}

fn file(records: &[Vec<u8>], added: &[u8]) -> Vec<u8> {
    let header = record(1, &[text("ros2"), text("another writer")].concat(), added);
    let end = [record(15, &[0; 4], added), record(2, &[0; 20], added)].concat();
    [MAGIC, &header, &records.concat(), &end, MAGIC].concat()
}

/// Channel, sequence and data of the events; fails on damage.
fn read(bytes: Vec<u8>) -> Vec<(String, i64, Vec<u8>)> {
    let event = |item: Result<Item, Error>| match item.unwrap() {
        Item::Event(event) => (event.channel.to_string(), event.number, event.data),
        other => panic!("{other:?}"),
    };
    LogReader::from_bytes("foreign.mcap", bytes).unwrap().map(event).collect()
}

fn numbers(bytes: Vec<u8>) -> Vec<i64> {
    read(bytes).into_iter().map(|(_, number, _)| number).collect()
}

#[test]
fn records_of_later_versions_are_read() {
    for added in [&b""[..], b"\x01\xff\xff", &[0; 40]] {
        let messages = [message(1, 0, 5, b"a"), message(1, 1, 6, b"b")].concat();
        let inside = [schema(b""), channel(1, "/pose", b""), messages.clone()].concat();
        let unknown = record(0x42, b"of a later version", b"");
        let private = record(0x99, b"of one writer", b"");
        let loose = [schema(added), channel(1, "/pose", added), unknown.clone(), messages.clone(), private.clone()];
        assert_eq!(numbers(file(&loose, added)), [0, 1], "{added:?}");
        let chunks = [unknown, chunk(&inside, added), private, chunk(&message(1, 2, 7, b"c"), added)];
        assert_eq!(numbers(file(&chunks, added)), [0, 1, 2], "{added:?}");
    }
}

#[test]
fn schemas_channels_and_messages_can_stand_between_chunks() {
    let first = chunk(&[schema(b""), channel(1, "/a", b""), message(1, 0, 5, b"a")].concat(), b"");
    let between = [message(1, 1, 6, b"b"), channel(2, "/b", b""), message(2, 2, 7, b"c")].concat();
    let last = chunk(&[message(2, 3, 8, b"d"), message(1, 4, 9, b"e")].concat(), b"");
    assert_eq!(numbers(file(&[first, between, last, message(2, 5, 10, b"f")], b"")), [0, 1, 2, 3, 4, 5]);
}

/// The summary repeats the channel, but not its schema.
#[test]
fn a_summary_without_schemas_takes_none_away() {
    let header = record(1, &[text("ros2"), text("another writer")].concat(), b"");
    let data = [schema(b""), channel(1, "/a", b""), message(1, 0, 5, b"a"), record(15, &[0; 4], b"")].concat();
    let summary_at = (MAGIC.len() + header.len() + data.len()) as u64;
    let footer = record(2, &[&summary_at.to_le_bytes()[..], &[0; 12]].concat(), b"");
    let bytes = [MAGIC, &header, &data, &channel(1, "/a", b""), &footer, MAGIC].concat();
    let mut reader = LogReader::from_bytes("summary.mcap", bytes).unwrap();
    let Some(ItemRef::Event(event)) = reader.read().unwrap() else { panic!("no event") };
    assert_eq!(event.schema().unwrap().name, "pkg/msg/Pose");
    assert!(reader.read().unwrap().is_none());
}

/// A message of 18 zero bytes has the layout of an empty chunk.
#[test]
fn zeros_in_a_message_are_no_chunk() {
    let messages: Vec<_> = (0..3).map(|i| message(1, i, 1_000_000, &[0; 18])).collect();
    let bytes = file(&[schema(b""), channel(1, "/a", b""), messages.concat()], b"");
    assert_eq!(numbers(bytes), [0, 1, 2]);
}

/// Bytes missing in one chunk cost that chunk alone, although its stated length then includes the start of the next one.
#[test]
fn missing_bytes_cost_their_chunk_alone() {
    let head = chunk(&[schema(b""), channel(1, "/a", b"")].concat(), b"");
    let chunks: Vec<_> = (0..4).map(|i| chunk(&message(1, i, 5, &[i as u8; 900]), b"")).collect();
    let whole = file(&[head.clone(), chunks.concat()], b"");
    let second = MAGIC.len()
        + record(1, &[text("ros2"), text("another writer")].concat(), b"").len()
        + head.len()
        + chunks[0].len();
    for missing in [1, 100, 700, 840] {
        let mut bytes = whole.clone();
        bytes.drain(second + 100..second + 100 + missing);
        let items: Vec<_> = LogReader::from_bytes("cut.mcap", bytes).unwrap().map(Result::unwrap).collect();
        let found: Vec<_> =
            items.iter().filter_map(|i| if let Item::Event(e) = i { Some(e.number) } else { None }).collect();
        assert_eq!(found, [0, 2, 3], "{missing} bytes");
        assert_eq!(items.len(), 4, "{missing} bytes: {items:?}");
    }
}

/// Heads of damaged chunks, each of which states that its records include all later heads. `added`: bytes by which the stated length of the record
/// exceeds that of the chunk; `between`: bytes before each head.
fn nest(added: u64, between: &[u8]) -> Vec<u8> {
    const HEAD: usize = 49;
    let (heads, padding) = (40_000, 16_000_000);
    let total = (HEAD + between.len()) * heads + padding;
    let mut out = Vec::with_capacity(total);
    for _ in 0..heads {
        out.extend(between);
        // Not at the end of the padding: a record follows there.
        let inner = (total - out.len() - HEAD - 100) as u64;
        let sizes = [0, 100, inner].map(u64::to_le_bytes).concat();
        let body = [&sizes, &1_u32.to_le_bytes()[..], &text(""), &inner.to_le_bytes()].concat();
        out.extend([&[6][..], &(body.len() as u64 + inner + added).to_le_bytes(), &body].concat());
    }
    out.resize(total, 0xaa);
    out
}

/// Reading every chunk of a nest to its end would take hours.
#[test]
fn nested_chunks_are_read_in_bounded_time() {
    let good = |sequence| chunk(&[channel(1, "/pose", b""), message(1, sequence, 5, b"a")].concat(), b"");
    for nest in [nest(0, b""), nest(5, &good(2))] {
        let bytes = file(&[good(0), nest, good(1)], b"");
        let mut reader = LogReader::from_bytes("nest.mcap", bytes).unwrap();
        let (mut numbers, mut damaged) = (Vec::new(), 0);
        while let Some(item) = reader.read().unwrap() {
            match item {
                ItemRef::Event(event) => numbers.push(event.number),
                _ => damaged += 1,
            }
        }
        assert_eq!((numbers.first(), numbers.last()), (Some(&0), Some(&1)));
        assert!(damaged > 0);
    }
}

/// The front of a file is gone, more than any fixed limit.
#[test]
fn a_destroyed_front_is_searched_past() {
    let records = [schema(b""), channel(1, "/a", b""), message(1, 7, 5, b"x")].concat();
    let log = common::path("front.lcmlog");
    common::write(&log, &common::messages(3), 10);
    for whole in [[chunk(&records, b""), chunk(&message(1, 8, 6, b"y"), b"")].concat(), std::fs::read(&log).unwrap()] {
        let bytes = [vec![0xaa; 3 << 20], whole].concat();
        let items: Vec<_> = LogReader::from_bytes("front", bytes).unwrap().map(Result::unwrap).collect();
        let events = items.iter().filter(|item| matches!(item, Item::Event(_))).count();
        assert!(events >= 2 && matches!(items[0], Item::Damaged(_)), "{events} events");
    }
}

/// Longer than any channel name that LCM allows on a network.
const LONG_TOPIC: &str = "/pose/of/a/topic/with/a/name/that/is/longer/than/any/that/lcm/allows";

/// A file with everything that a copy has to keep.
fn rich(name: &str) -> PathBuf {
    let metadata = record(12, &[text("calibration"), map(&[("k", "v")])].concat(), b"");
    let records = [schema(b""), channel(1, LONG_TOPIC, b"")];
    let inside = [records.concat(), message(1, 40, 5000, b"cdr bytes"), message(1, 41, 6000, b"more")].concat();
    let path = common::path(name);
    std::fs::write(&path, file(&[chunk(&inside, b""), attachment(), metadata, record(0x99, b"private", b"")], b""))
        .unwrap();
    path
}

fn copied(log: &Path, out: &Path) -> CopyReport {
    copy(log, out, CopyOptions::default(), &mut |_| ()).unwrap()
}

#[test]
fn a_copy_to_mcap_keeps_everything() {
    let (log, out, merged) = (rich("rich.mcap"), common::path("rich_copy.mcap"), common::path("rich_merge.mcap"));
    let report = copied(&log, &out);
    assert_eq!((report.events, report.refused), (2, 0));
    // The older of two equal keys is the only loss.
    assert_eq!(report.not_kept.into_iter().collect::<Vec<_>>(), [("repeated metadata keys", 1)]);
    merge(&[log], &merged, Default::default(), &mut |_| ()).unwrap();
    for out in [out, merged] {
        let bytes = std::fs::read(out).unwrap();
        let messages: Vec<_> = mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap).collect();
        let of = |m: &mcap::Message| (m.sequence, m.log_time, m.publish_time, m.data.to_vec());
        let found: Vec<_> = messages.iter().map(of).collect();
        assert_eq!(found, [(40, 5000, 5007, b"cdr bytes".to_vec()), (41, 6000, 6007, b"more".to_vec())]);
        let channel = &messages[0].channel;
        assert_eq!((&*channel.topic, &*channel.message_encoding), (LONG_TOPIC, "cdr"));
        assert_eq!(channel.metadata["qos"], "reliable");
        let schema = channel.schema.as_ref().unwrap();
        assert_eq!((&*schema.name, &*schema.encoding, &*schema.data), ("pkg/msg/Pose", "ros2msg", &b"float64 x"[..]));
        let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
        let attachment = mcap::read::attachment(&bytes, &summary.attachment_indexes[0]).unwrap();
        assert_eq!((&*attachment.name, attachment.create_time, &*attachment.data), ("map.png", 4, &b"12345"[..]));
        let metadata = mcap::read::metadata(&bytes, &summary.metadata_indexes[0]).unwrap();
        assert_eq!((&*metadata.name, &*metadata.metadata["k"]), ("calibration", "v"));
        let profile = mcap::read::LinearReader::new(&bytes).unwrap().find_map(|record| match record.unwrap() {
            mcap::records::Record::Header(header) => Some(header.profile),
            _ => None,
        });
        assert_eq!(profile.as_deref(), Some("ros2"));
    }
}

/// `hoof spy` and `hoof log info` name the type of a message in another language alike; its first bytes are no fingerprint.
#[test]
fn the_type_of_another_language_is_that_of_its_schema() {
    let path = rich("rich_types.mcap");
    let mut traffic = replay::traffic::Traffic::new(Types::default());
    let mut reader = LogReader::open(&path).unwrap();
    while let Some(item) = reader.read().unwrap() {
        if let ItemRef::Event(event) = item {
            traffic.event(&event);
        }
    }
    let [row] = &traffic.summary(0).channels[..] else { panic!("expected one channel") };
    assert_eq!((row.type_name.as_deref(), row.fingerprint.as_deref(), row.count), (Some("pkg/msg/Pose"), None, 2));
    let [channel] = &replay::log::LogSummary::read(&path).unwrap().channels[..] else { panic!("expected one channel") };
    assert_eq!((channel.type_name.as_deref(), channel.fingerprint.as_deref()), (Some("pkg/msg/Pose"), None));
}

#[test]
fn what_an_event_log_cannot_hold_is_listed() {
    let report = copied(&rich("rich2.mcap"), &common::path("rich.lcmlog"));
    assert_eq!((report.events, report.is_lossless()), (2, false));
    let expected = [
        ("attachments", 1),
        ("message encodings", 1),
        ("metadata of channels", 1),
        ("metadata records", 1),
        ("profiles", 1),
        ("publish times", 2),
        ("records of unknown kinds", 1),
        ("repeated metadata keys", 1),
        ("schemas", 1),
    ];
    assert_eq!(report.not_kept.into_iter().collect::<Vec<_>>(), expected);
}

/// Names with any bytes, long names and negative times survive where the format holds them.
#[test]
fn names_of_any_bytes_survive() {
    let names: [&[u8]; 5] = [b"caf\xe9", b"a\tb", &[b'x'; 900], "Größe".as_bytes(), "x\u{efe9}".as_bytes()];
    let (log, mcap, back) = (common::path("names.lcmlog"), common::path("names.mcap"), common::path("back.lcmlog"));
    let mut bytes = Vec::new();
    for (number, name) in names.iter().enumerate() {
        bytes.extend_from_slice(&0xeda1_da01_u32.to_be_bytes());
        bytes.extend_from_slice(&[(number as i64).to_be_bytes(), 5_i64.to_be_bytes()].concat());
        bytes.extend_from_slice(&[(name.len() as u32).to_be_bytes(), 2_u32.to_be_bytes()].concat());
        bytes.extend_from_slice(&[name, &b"ab"[..]].concat());
    }
    std::fs::write(&log, &bytes).unwrap();
    for (from, to) in [(&log, &mcap), (&mcap, &back)] {
        assert!(copied(from, to).is_lossless());
    }
    assert!(std::fs::read(&back).unwrap() == bytes);
    // A topic of another writer with the characters that stand for bytes.
    let topic = "x\u{efe9}";
    let (foreign, copy) = (common::path("private.mcap"), common::path("private_copy.mcap"));
    let records = [schema(b""), channel(1, topic, b""), message(1, 0, 5, b"a")];
    std::fs::write(&foreign, file(&records, b"")).unwrap();
    copied(&foreign, &copy);
    let found = mcap::MessageStream::new(&std::fs::read(&copy).unwrap()).unwrap().next().unwrap().unwrap();
    assert_eq!(found.channel.topic, topic);
    copied(&copy, &back);
    assert!(std::fs::read(&back).unwrap()[28..].starts_with(topic.as_bytes()));

    let (negative, again) = (common::path("negative.lcmlog"), common::path("negative_copy.lcmlog"));
    let mut out = LogWriter::create(&negative).unwrap();
    out.write("CH", -5000, b"x").unwrap();
    out.finish().unwrap();
    assert!(copied(&negative, &again).is_lossless());
    assert!(std::fs::read(&negative).unwrap() == std::fs::read(&again).unwrap());
    assert_eq!(copied(&negative, &common::path("negative.mcap")).refused, 1);
}

/// The output is the input under another name.
#[test]
fn no_copy_overwrites_its_input() {
    let log = common::path("input.lcmlog");
    common::write(&log, &common::messages(5), 10);
    let (hard, soft) = (common::path("hard.lcmlog"), common::path("soft.lcmlog"));
    for link in [&hard, &soft] {
        let _ = std::fs::remove_file(link);
    }
    std::fs::hard_link(&log, &hard).unwrap();
    std::os::unix::fs::symlink(&log, &soft).unwrap();
    let before = std::fs::read(&log).unwrap();
    for out in [&log, &hard, &soft] {
        let copy = copy(&log, out, CopyOptions::default(), &mut |_| ());
        let merge = merge(std::slice::from_ref(&log), out, Default::default(), &mut |_| ());
        assert!(matches!((copy, merge), (Err(Error::SameFile { .. }), Err(Error::SameFile { .. }))));
        assert!(std::fs::read(&log).unwrap() == before);
    }
}

/// More channels than MCAP allows: the further ones share one, and keep their names.
#[test]
fn further_channels_share_one() {
    let path = common::path("many.mcap");
    let mut log = LogWriter::create(&path).unwrap();
    for i in 0..66_000 {
        log.write(&format!("CHANNEL_{i}"), i, b"data of no type").unwrap();
    }
    log.finish().unwrap();
    let names: Vec<_> = LogReader::open(&path).unwrap().events().map(|event| event.unwrap()).collect();
    assert_eq!(names.len(), 66_000);
    for (i, event) in names.iter().enumerate() {
        assert_eq!((&*event.channel, event.number), (&*format!("CHANNEL_{i}"), i as i64));
        assert_eq!(event.data, b"data of no type");
    }
}

/// What a copy recovers from a log that is cut at any byte is a good log.
#[test]
fn the_recovery_of_a_cut_log_is_good() {
    for name in ["whole.lcmlog", "whole.mcap"] {
        let (whole, cut, out) =
            (common::path(name), common::path(&format!("cut_{name}")), common::path(&format!("out_{name}")));
        common::write(&whole, &common::messages(12), 4);
        let bytes = std::fs::read(&whole).unwrap();
        for length in 8..bytes.len() {
            std::fs::write(&cut, &bytes[..length]).unwrap();
            let events = copied(&cut, &out).events;
            let report = verify(&out, Types::default(), &mut |_| ()).unwrap();
            assert!(report.good && report.events == events, "{name} cut at {length}: {report:?}");
        }
    }
}
