//! A reader survives anything: cut at every byte, flipped at every byte, garbage, logs one behind the other.
#![allow(clippy::unwrap_used, reason = "a test may")]

mod common;

use common::Message;
use replay::log::{Item, LogReader};
use std::os::unix::fs::FileExt;
use std::path::Path;

const COUNT: usize = 15;
/// Messages in a chunk of the MCAP sample.
const CHUNK: usize = 5;

fn sample(name: &str) -> (Vec<u8>, Vec<Message>) {
    let path = common::path(name);
    let messages = common::messages(COUNT);
    common::write(&path, &messages, CHUNK);
    (std::fs::read(path).unwrap(), messages)
}

fn read(path: &Path, bytes: &[u8]) -> Vec<Item> {
    std::fs::write(path, bytes).unwrap();
    common::items(path)
}

/// Reads the log once with each byte flipped by each mask. The file is changed in place: writing it anew would take minutes.
fn each_flip(path: &Path, bytes: &[u8], masks: &[u8], mut check: impl FnMut(usize, u8, Vec<Item>)) {
    std::fs::write(path, bytes).unwrap();
    let file = std::fs::File::options().write(true).open(path).unwrap();
    for (at, &byte) in bytes.iter().enumerate() {
        for &mask in masks {
            file.write_all_at(&[byte ^ mask], at as u64).unwrap();
            check(at, mask, common::items(path));
        }
        file.write_all_at(&[byte], at as u64).unwrap();
    }
}

/// Reads the log cut to each length, down to the shortest that can be told from no log.
fn each_cut(path: &Path, bytes: &[u8], shortest: usize, mut check: impl FnMut(usize, Vec<Item>)) {
    std::fs::write(path, bytes).unwrap();
    let file = std::fs::File::options().write(true).open(path).unwrap();
    for length in (shortest..=bytes.len()).rev() {
        file.set_len(length as u64).unwrap();
        check(length, common::items(path));
    }
}

/// Ends of the events: every event that ends before the cut is read, and nothing else.
fn ends(bytes: &[u8]) -> Vec<usize> {
    let starts = |b: &[u8]| {
        b.windows(4).enumerate().filter(|(_, w)| w == &[0xed, 0xa1, 0xda, 0x01]).map(|(i, _)| i).collect::<Vec<_>>()
    };
    let mut ends = starts(bytes);
    ends.remove(0);
    ends.push(bytes.len());
    ends
}

#[test]
fn an_event_log_cut_at_any_byte_gives_all_whole_events() {
    let (bytes, messages) = sample("cut.lcmlog");
    let path = common::path("cut_short.lcmlog");
    let ends = ends(&bytes);
    assert_eq!(ends.len(), COUNT);
    each_cut(&path, &bytes, 4, |length, items| {
        let whole = ends.iter().filter(|&&end| end <= length).count();
        assert_eq!(common::events(&items), messages[..whole], "cut at {length}");
        let start = if whole == 0 { 0 } else { ends[whole - 1] };
        match items.last() {
            Some(Item::Event(_)) => assert_eq!(length, start),
            Some(Item::Cut(cut)) => assert_eq!((cut.offset, cut.bytes), (start as u64, (length - start) as u64)),
            other => panic!("cut at {length}: {other:?}"),
        }
        assert!(!items.iter().any(|item| matches!(item, Item::Damaged(_))), "cut at {length}");
    });
}

#[test]
fn an_event_log_flipped_at_any_byte_loses_at_most_the_event_there() {
    let (bytes, messages) = sample("flip.lcmlog");
    let path = common::path("flipped.lcmlog");
    let ends = ends(&bytes);
    each_flip(&path, &bytes, &[0x01, 0x10, 0x80, 0xff], |at, mask, items| {
        let hit = ends.iter().filter(|&&end| end <= at).count();
        let found = common::events(&items);
        // All others stand there, in order; of the one that was hit there may be a changed copy or nothing.
        let behind = COUNT - hit - 1;
        assert!(found.len() >= COUNT - 1, "byte {at} ^ {mask:#x}: {} of {COUNT} events", found.len());
        assert_eq!(found[..hit], messages[..hit], "byte {at}");
        assert_eq!(found[found.len() - behind..], messages[hit + 1..], "byte {at}");
        if found.len() < COUNT {
            let told = items.iter().any(|item| !matches!(item, Item::Event(_)));
            assert!(told, "byte {at} ^ {mask:#x}: an event is missing and nobody says so");
        }
    });
}

#[test]
fn garbage_between_events_costs_no_event() {
    let (bytes, messages) = sample("garbage.lcmlog");
    let path = common::path("garbage_inside.lcmlog");
    let mut random = common::Random(7);
    for at in ends(&bytes) {
        let garbage: Vec<u8> = (0..1 + random.next() % 100).map(|_| (random.next() >> 40) as u8).collect();
        let spoilt = [&bytes[..at], &garbage, &bytes[at..]].concat();
        let items = read(&path, &spoilt);
        assert_eq!(common::events(&items), messages, "garbage at {at}");
        let damaged: Vec<_> = items
            .iter()
            .filter_map(|i| if let Item::Damaged(d) = i { Some((d.offset, d.bytes)) } else { None })
            .collect();
        assert_eq!(damaged, [(at as u64, garbage.len() as u64)]);
    }
}

#[test]
fn an_mcap_cut_at_any_byte_gives_all_whole_chunks() {
    let (bytes, messages) = sample("cut.mcap");
    let path = common::path("cut_short.mcap");
    let ends = chunk_ends(&bytes);
    assert_eq!(ends.len(), COUNT / CHUNK);
    each_cut(&path, &bytes, 8, |length, items| {
        if length == bytes.len() {
            return;
        }
        let whole = CHUNK * ends.iter().filter(|&&end| end <= length).count();
        assert_eq!(common::events(&items), messages[..whole], "cut at {length}");
        assert!(matches!(items.last(), Some(Item::Cut(_))), "cut at {length}: {:?}", items.last());
        assert_eq!(items.len(), whole + 1, "cut at {length}: {:?}", &items[whole..]);
    });
}

#[test]
fn an_mcap_flipped_at_any_byte_loses_at_most_the_chunk_there() {
    let (bytes, messages) = sample("flip.mcap");
    let path = common::path("flipped.mcap");
    let ends = chunk_ends(&bytes);
    each_flip(&path, &bytes, &[0x01, 0x02, 0x04, 0x10, 0x80, 0xff], |at, mask, items| {
        let found = common::events(&items);
        if found != messages {
            let hit = ends.iter().filter(|&&end| end <= at).count();
            let others = [&messages[..hit * CHUNK], &messages[(hit + 1) * CHUNK..]].concat();
            assert!(found == others, "byte {at} ^ {mask:#x}: {} of {COUNT} events", found.len());
            let told = items.iter().any(|item| !matches!(item, Item::Event(_)));
            assert!(told, "byte {at} ^ {mask:#x}: a chunk is missing and nobody says so");
        }
    });
}

/// Ends of the chunk records, by the index of the mcap crate.
fn chunk_ends(bytes: &[u8]) -> Vec<usize> {
    let summary = mcap::Summary::read(bytes).unwrap().unwrap();
    summary.chunk_indexes.iter().map(|c| (c.chunk_start_offset + c.chunk_length) as usize).collect()
}

#[test]
fn logs_one_behind_the_other_are_read_as_one() {
    for ending in ["lcmlog", "mcap"] {
        let (bytes, messages) = sample(&format!("once.{ending}"));
        let path = common::path(&format!("twice.{ending}"));
        let items = read(&path, &[&bytes[..], &bytes[..]].concat());
        assert_eq!(common::events(&items), [&messages[..], &messages[..]].concat(), "{ending}");
        assert_eq!(items.len(), 2 * COUNT, "{ending}");
    }
}

/// Bytes at random, with the beginnings of records strewn in so that the parsers get far.
#[test]
fn noise_is_read_to_its_end() {
    let mut random = common::Random(11);
    for (ending, heads) in
        [("lcmlog", &[&[0xed, 0xa1, 0xda, 0x01][..]][..]), ("mcap", &[mcap::MAGIC, &[6, 60, 0, 0, 0, 0, 0, 0, 0]])]
    {
        let path = common::path(&format!("noise.{ending}"));
        for _ in 0..300 {
            let mut bytes = heads[0].to_vec();
            for _ in 0..random.next() % 40 {
                bytes.extend_from_slice(heads[(random.next() % heads.len() as u64) as usize]);
                let small = random.next().is_multiple_of(2);
                bytes.extend(
                    (0..random.next() % 80).map(|_| (random.next() >> 40) as u8 & if small { 0x07 } else { 0xff }),
                );
            }
            std::fs::write(&path, &bytes).unwrap();
            let length = bytes.len() as u64;
            for item in LogReader::open(&path).unwrap() {
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

/// A length that claims more than any log holds is not believed, and no memory is taken for it.
#[test]
fn a_huge_length_takes_no_memory() {
    let (mut bytes, messages) = sample("huge.lcmlog");
    bytes[24..28].copy_from_slice(&i32::MAX.to_be_bytes());
    let items = read(&common::path("huge_length.lcmlog"), &bytes);
    assert_eq!(common::events(&items), messages[1..]);
    let (mut bytes, messages) = sample("huge.mcap");
    let first = mcap::Summary::read(&bytes).unwrap().unwrap().chunk_indexes[0].chunk_start_offset as usize;
    // The size after decompression, behind the prefix and two times.
    bytes[first + 25..first + 33].copy_from_slice(&(u64::MAX >> 8).to_le_bytes());
    let items = read(&common::path("huge_length.mcap"), &bytes);
    assert_eq!(common::events(&items), messages[CHUNK..]);
}
