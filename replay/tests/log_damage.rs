//! Damage in logs: cut at every byte; a flipped byte, a block of zeros and a block of garbage at every byte; inserted and deleted bytes;
//! concatenated logs. Every event in an undamaged record is read, in order, and every loss is reported.
#![allow(clippy::unwrap_used, reason = "test code")]

mod common;

use common::Message;
use replay::log::{Item, ItemRef, LogReader, LogWriter};
use std::collections::BTreeMap;
use std::ops::Range;

const COUNT: usize = 15;
/// Messages in a chunk of the MCAP samples.
const CHUNK: usize = 5;

/// A small log and the positions of its records: an event, or a chunk of events.
struct Sample {
    name: &'static str,
    bytes: Vec<u8>,
    messages: Vec<Message>,
    /// Byte range of each record, and the range of its messages.
    records: Vec<(Range<usize>, Range<usize>)>,
}

fn event_log() -> Sample {
    let path = common::path("sample.lcmlog");
    let messages = common::messages(COUNT);
    common::write(&path, &messages, usize::MAX);
    let mut at = 0;
    let record = |(i, (channel, _, data)): (usize, &Message)| {
        let begin = at;
        at += 28 + channel.len() + data.len();
        (begin..at, i..i + 1)
    };
    let records = messages.iter().enumerate().map(record).collect();
    Sample { name: "event log", bytes: std::fs::read(path).unwrap(), messages, records }
}

/// As written by [`LogWriter`].
fn mcap() -> Sample {
    let path = common::path("sample.mcap");
    let messages = common::messages(COUNT);
    common::write(&path, &messages, CHUNK);
    chunked("mcap", std::fs::read(path).unwrap(), messages)
}

fn chunked(name: &'static str, bytes: Vec<u8>, messages: Vec<Message>) -> Sample {
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let chunks = summary.chunk_indexes.iter().map(|c| {
        let begin = c.chunk_start_offset as usize;
        begin..begin + c.chunk_length as usize
    });
    let records: Vec<_> = chunks.enumerate().map(|(i, chunk)| (chunk, i * CHUNK..(i + 1) * CHUNK)).collect();
    assert_eq!(records.len() * CHUNK, messages.len(), "{name}");
    Sample { name, bytes, messages, records }
}

/// As written by other tools: by the mcap crate with another compression, or without chunks.
fn foreign(name: &'static str, compression: Option<mcap::Compression>, use_chunks: bool) -> Sample {
    let messages = common::messages(COUNT);
    let mut bytes = Vec::new();
    let options = mcap::WriteOptions::new().compression(compression).use_chunks(use_chunks).chunk_size(None);
    let mut out = options.create(std::io::Cursor::new(&mut bytes)).unwrap();
    let mut ids = BTreeMap::new();
    for (i, (channel, t_ns, data)) in messages.iter().enumerate() {
        let id = *ids
            .entry(channel.clone())
            .or_insert_with(|| out.add_channel(0, channel, "lcm", &BTreeMap::new()).unwrap());
        let t = *t_ns as u64;
        let header = mcap::records::MessageHeader { channel_id: id, sequence: i as u32, log_time: t, publish_time: t };
        out.write_to_known_channel(&header, data).unwrap();
        if use_chunks && (i + 1) % CHUNK == 0 {
            out.flush().unwrap();
        }
    }
    out.finish().unwrap();
    drop(out);
    if use_chunks {
        return chunked(name, bytes, messages);
    }
    let mut at = 0;
    let record = |(i, (_, _, data)): (usize, &Message)| {
        let length = (22 + data.len() as u64).to_le_bytes();
        let begin =
            (at..).find(|&at| bytes[at] == 5 && bytes[at + 1..at + 9] == length && bytes[at + 31..].starts_with(data));
        let begin = begin.unwrap();
        at = begin + 31 + data.len();
        (begin..at, i..i + 1)
    };
    let records = messages.iter().enumerate().map(record).collect();
    Sample { name, bytes, messages, records }
}

fn samples() -> Vec<Sample> {
    vec![
        event_log(),
        mcap(),
        foreign("lz4", Some(mcap::Compression::Lz4), true),
        foreign("uncompressed", None, true),
        foreign("without chunks", None, false),
    ]
}

/// Damage and cuts, for failure messages.
fn reported(items: &[Item]) -> String {
    format!("{:?}", items.iter().filter(|item| !matches!(item, Item::Event(_))).collect::<Vec<_>>())
}

fn read(bytes: Vec<u8>) -> Option<Vec<Item>> {
    LogReader::from_bytes("sample", bytes).ok().map(|reader| reader.map(Result::unwrap).collect())
}

impl Sample {
    /// Reads the log with `range` replaced: all events of records that the change does not touch are returned in order, and besides them at
    /// most those of the touched records.
    fn check_damaged(&self, range: Range<usize>, by: &[u8], what: &str) {
        let bytes = [&self.bytes[..range.start], by, &self.bytes[range.end..]].concat();
        if bytes == self.bytes {
            return;
        }
        let length = bytes.len();
        let what = format!("{}: {what} at {range:?}", self.name);
        // Garbage at the start and no event: not a log.
        let Some(items) = read(bytes) else { return assert!(self.records.len() < 2, "{what}: not opened") };
        let touched = |record: &Range<usize>| {
            if range.is_empty() {
                record.start < range.start && range.start < record.end
            } else {
                record.start < range.end && range.start < record.end
            }
        };
        let may_be_lost: usize = self.records.iter().filter(|r| touched(&r.0)).map(|r| r.1.len()).sum();
        let found = common::events(&items);
        let mut rest = found.iter();
        for (record, messages) in self.records.iter().filter(|r| !touched(&r.0)) {
            for message in &self.messages[messages.clone()] {
                assert!(
                    rest.any(|m| m == message),
                    "{what}: an event of the record at {record:?} is missing, {} of {found:?}",
                    reported(&items)
                );
            }
        }
        // Without a checksum, one other record can be made to look like an event.
        let more = may_be_lost.max(usize::from(self.name == "without chunks")).min(1);
        assert!(found.len() <= self.messages.len() + more, "{what}: {} events", found.len());
        if found.len() < self.messages.len() {
            let is_reported = items.iter().any(|item| !matches!(item, Item::Event(_)));
            assert!(is_reported, "{what}: {} of {COUNT} events, and no loss reported", found.len());
        }
        for item in &items {
            if let Item::Damaged(damaged) = item {
                assert!(damaged.offset + damaged.bytes <= length as u64, "{what}: {damaged:?}");
            }
        }
    }
}

#[test]
fn undamaged_logs_are_read_without_reports() {
    for sample in samples() {
        let items = read(sample.bytes.clone()).unwrap();
        assert_eq!(common::events(&items), sample.messages, "{}", sample.name);
        assert_eq!(items.len(), COUNT, "{}: {:?}", sample.name, items.last());
    }
}

#[test]
fn a_flipped_byte_costs_at_most_its_record() {
    for sample in samples() {
        for at in 0..sample.bytes.len() {
            for mask in [0x01, 0x02, 0x04, 0x10, 0x80, 0xff] {
                sample.check_damaged(at..at + 1, &[sample.bytes[at] ^ mask], &format!("{mask:#x}"));
            }
        }
    }
}

#[test]
fn a_block_of_zeros_or_garbage_costs_at_most_the_touched_records() {
    let mut random = common::Random(3);
    for sample in samples() {
        for at in 0..sample.bytes.len() {
            for length in [4, 20, 90] {
                let range = at..(at + length).min(sample.bytes.len());
                sample.check_damaged(range.clone(), &vec![0; range.len()], "zeros");
                let garbage: Vec<u8> = range.clone().map(|_| (random.next() >> 40) as u8).collect();
                sample.check_damaged(range, &garbage, "garbage");
            }
        }
    }
}

#[test]
fn inserted_or_deleted_bytes_cost_at_most_the_touched_record() {
    let mut random = common::Random(5);
    for sample in samples() {
        for at in 0..=sample.bytes.len() {
            let garbage: Vec<u8> = (0..1 + random.next() % 100).map(|_| (random.next() >> 40) as u8).collect();
            sample.check_damaged(at..at, &garbage, "inserted");
            let length = 1 + (random.next() % 40) as usize;
            sample.check_damaged(at..(at + length).min(sample.bytes.len()), &[], "deleted");
        }
    }
}

/// Every complete record is read, and from an incomplete chunk only events that it contains.
#[test]
fn a_log_cut_at_any_byte_returns_all_complete_records() {
    for sample in samples() {
        for length in 1..sample.bytes.len() {
            let Some(items) = read(sample.bytes[..length].to_vec()) else {
                assert!(length < 8, "{}: cut at {length}", sample.name);
                continue;
            };
            let whole: usize = sample.records.iter().filter(|r| r.0.end <= length).map(|r| r.1.len()).sum();
            let found = common::events(&items);
            assert!(found.len() >= whole, "{}: cut at {length}: {} of {whole} events", sample.name, found.len());
            assert_eq!(found, sample.messages[..found.len()], "{}: cut at {length}", sample.name);
            assert!(!items.iter().any(|item| matches!(item, Item::Damaged(_))), "{}: cut at {length}", sample.name);
            let is_boundary = sample.name == "event log" && sample.records.iter().any(|r| r.0.end == length);
            match items.last() {
                Some(Item::Cut(cut)) => assert_eq!(cut.offset + cut.bytes, length as u64, "{}", sample.name),
                other => assert!(is_boundary, "{}: cut at {length}: {other:?}", sample.name),
            }
        }
    }
}

/// In a cut chunk, the events before the cut are read.
#[test]
fn a_cut_chunk_returns_the_events_before_the_cut() {
    // Random bytes do not compress, so the messages are in the compressed chunk in order.
    let path = common::path("large_chunk.mcap");
    let mut random = common::Random(13);
    let messages: Vec<Message> = (0..240)
        .map(|i| ("NOISE".into(), i * 1000, (0..1000).map(|_| (random.next() >> 30) as u8).collect()))
        .collect();
    common::write(&path, &messages, usize::MAX);
    let bytes = std::fs::read(&path).unwrap();
    let chunk = &mcap::Summary::read(&bytes).unwrap().unwrap().chunk_indexes[0];
    let begin = chunk.chunk_start_offset as usize;
    let length = begin + chunk.chunk_length as usize * 3 / 4;
    let items = read(bytes[..length].to_vec()).unwrap();
    let found = common::events(&items);
    assert!((100..=180).contains(&found.len()), "{} events", found.len());
    assert!(found == messages[..found.len()]);
    assert!(matches!(items.last(), Some(Item::Cut(cut)) if cut.offset == begin as u64), "{}", reported(&items));

    // The same bytes damaged at that place: the position of the damage is unknown, so none of the chunk's events is returned.
    let mut damaged = bytes.clone();
    damaged[length - 40_000..length].fill(0xff);
    let items = read(damaged.clone()).unwrap();
    assert!(
        items.iter().all(|item| !matches!(item, Item::Event(e) if e.offset == begin as u64)),
        "{}",
        reported(&items)
    );
    assert!(matches!(&items[0], Item::Damaged(d) if d.offset == begin as u64), "{}", reported(&items));
    let kept = LogReader::from_bytes("sample", damaged).unwrap().keep_unchecked(true).events().count();
    assert!(kept > 50, "{kept} events");
}

/// A chunk with a wrong CRC is omitted unless the caller asks for it.
#[test]
fn unchecked_chunks_can_be_kept() {
    let Sample { mut bytes, messages, records, .. } = foreign("uncompressed", None, true);
    let at = records[1].0.end - 3;
    bytes[at] ^= 1;
    let counts = [false, true].map(|keep| {
        let mut reader = LogReader::from_bytes("sample", bytes.clone()).unwrap().keep_unchecked(keep);
        let (mut events, mut damaged) = (0, 0);
        while let Some(item) = reader.read().unwrap() {
            match item {
                ItemRef::Event(_) => events += 1,
                _ => damaged += 1,
            }
        }
        (events, damaged)
    });
    assert_eq!(counts, [(messages.len() - CHUNK, 1), (messages.len(), 1)]);
}

/// Outside of chunks only the CRC of all the data detects an altered message.
#[test]
fn the_crc_of_all_the_data_detects_an_altered_message() {
    let Sample { mut bytes, messages, records, .. } = foreign("without chunks", None, false);
    bytes[records[3].0.end - 1] ^= 1;
    let items = read(bytes).unwrap();
    assert_eq!(common::events(&items).len(), messages.len());
    let Some(Item::Damaged(damaged)) = items.last() else { panic!("{:?}", items.last()) };
    assert_eq!((damaged.offset, damaged.bytes), (0, 0), "{damaged:?}");
}

/// A wrong length that ends exactly at the start of a later event of the same size: only the event numbers show it.
#[test]
fn a_wrong_length_that_ends_at_a_later_event_loses_no_other_event() {
    let path = common::path("even.lcmlog");
    let messages: Vec<Message> = (0..8).map(|i| ("CH".into(), i * 1000, vec![7; 34])).collect();
    common::write(&path, &messages, usize::MAX);
    let mut bytes = std::fs::read(&path).unwrap();
    // Events of 64 bytes; the data length of the third one becomes that of three events minus a header.
    bytes[2 * 64 + 27] = 34 + 128;
    let items = read(bytes).unwrap();
    let expected = [&messages[..2], &messages[3..]].concat();
    assert_eq!(common::events(&items), expected);
    let Item::Damaged(damaged) = &items[2] else { panic!("{:?}", items[2]) };
    assert_eq!((damaged.offset, damaged.bytes), (128, 64));
}

/// An event that contains a complete log is not damaged.
#[test]
fn an_event_can_contain_a_log() {
    let Sample { bytes, .. } = event_log();
    let path = common::path("nested.lcmlog");
    let messages: Vec<Message> = (0..3).map(|i| ("LOG".into(), i, bytes.clone())).collect();
    let mut log = LogWriter::create(&path).unwrap();
    for (i, (channel, t_ns, data)) in messages.iter().enumerate() {
        // Numbers with gaps, as after a filter.
        log.write_numbered(channel, *t_ns * 1000, 20 * i as i64, data).unwrap();
    }
    log.finish().unwrap();
    let items = common::items(&path);
    assert_eq!((items.len(), common::events(&items).len()), (3, 3));
}

/// Inside a message, 20,000 events lead to one sequence of 200,000. Following the sequence from each of them would take many minutes.
#[test]
fn sequences_inside_a_message_are_followed_once() {
    let event = |number: i64, length: usize| {
        let lengths = [1, length as u32].map(u32::to_be_bytes).concat();
        [&0xEDA1_DA01_u32.to_be_bytes()[..], &number.to_be_bytes(), &[0; 8], &lengths, b"A"].concat()
    };
    let (starts, sequence) = (20_000, 200_000);
    let one = event(0, 0).len();
    let inner: Vec<u8> = (1..=starts)
        .flat_map(|n| event(6, one * (starts - n)))
        .chain((0..sequence).flat_map(|n| event(7 + n, 0)))
        .chain([0; 100])
        .collect();
    let bytes = [event(5, inner.len()), inner, event(100, 0)].concat();
    let items = read(bytes).unwrap();
    let numbers: Vec<i64> =
        items.iter().filter_map(|i| if let Item::Event(e) = i { Some(e.number) } else { None }).collect();
    assert_eq!((numbers, items.len()), (vec![5, 100], 2));
}

#[test]
fn concatenated_logs_are_read_as_one() {
    for sample in samples() {
        let items = read(sample.bytes.repeat(2)).unwrap();
        assert_eq!(common::events(&items), [&sample.messages[..], &sample.messages[..]].concat(), "{}", sample.name);
        assert_eq!(items.len(), 2 * COUNT, "{}", sample.name);
        let numbers: Vec<_> = items.iter().map(|i| if let Item::Event(e) = i { e.number } else { -1 }).collect();
        assert_eq!(numbers, (0..COUNT as i64).chain(0..COUNT as i64).collect::<Vec<_>>(), "{}", sample.name);
    }
}

/// Timestamps out of order are kept.
#[test]
fn timestamps_can_be_out_of_order() {
    for ending in ["lcmlog", "mcap"] {
        let path = common::path(&format!("backwards.{ending}"));
        let messages: Vec<Message> = (0..50).map(|i| ("CH".into(), (i * 37 % 50) * 1000, vec![i as u8; 9])).collect();
        common::write(&path, &messages, 7);
        assert_eq!(common::events(&common::items(&path)), messages, "{ending}");
    }
}

/// A file that is appended to byte by byte returns each event as soon as it is complete, and never a cut.
#[test]
fn a_growing_log_is_read_as_it_grows() {
    for sample in [event_log(), mcap()] {
        let path = common::path("growing");
        std::fs::write(&path, &sample.bytes[..60]).unwrap();
        let mut file = std::fs::File::options().append(true).open(&path).unwrap();
        let mut reader = LogReader::open_growing(&path).unwrap();
        let mut found = Vec::new();
        for at in 60..=sample.bytes.len() {
            while let Some(item) = reader.read().unwrap() {
                let ItemRef::Event(event) = item else { panic!("{}: {item:?} at {at}", sample.name) };
                found.push(common::message(&event.to_event()));
            }
            let whole: usize = sample.records.iter().filter(|r| r.0.end <= at).map(|r| r.1.len()).sum();
            assert_eq!(found.len(), whole, "{}: {at} bytes are written", sample.name);
            if at < sample.bytes.len() {
                std::io::Write::write_all(&mut file, &sample.bytes[at..=at]).unwrap();
            }
        }
        assert_eq!(found, sample.messages, "{}", sample.name);
    }
}

/// Random bytes mixed with starts of records, so that the parsers proceed.
#[test]
fn random_bytes_are_read_to_their_end() {
    let mut random = common::Random(11);
    for heads in [
        &[&[0xed, 0xa1, 0xda, 0x01][..]][..],
        &[mcap::MAGIC, &[6, 60, 0, 0, 0, 0, 0, 0, 0], &[5, 30, 0, 0, 0, 0, 0, 0, 0]],
    ] {
        for _ in 0..300 {
            let mut bytes = heads[0].to_vec();
            for _ in 0..random.next() % 40 {
                bytes.extend_from_slice(heads[(random.next() % heads.len() as u64) as usize]);
                let small = random.next().is_multiple_of(2);
                bytes.extend(
                    (0..random.next() % 80).map(|_| (random.next() >> 40) as u8 & if small { 0x07 } else { 0xff }),
                );
            }
            let length = bytes.len() as u64;
            for item in LogReader::from_bytes("noise", bytes).unwrap() {
                let end = match item.unwrap() {
                    Item::Event(event) => event.offset + event.data.len() as u64,
                    Item::Damaged(damaged) => damaged.offset + damaged.bytes,
                    Item::Cut(cut) => cut.offset + cut.bytes,
                };
                assert!(end <= length);
            }
        }
    }
}
