//! The reader of LCM event logs accepts any bytes: no panic, no item outside the file, items not longer than the file in total.
#![no_main]

use libfuzzer_sys::fuzz_target;
use replay::log::{ItemRef, LogReader};

fuzz_target!(|bytes: &[u8]| {
    let input = [&[0xed, 0xa1, 0xda, 0x01], bytes].concat();
    let length = input.len() as u64;
    let Ok(mut reader) = LogReader::from_bytes("fuzz", input) else { return };
    let mut at = 0;
    while let Ok(Some(item)) = reader.read() {
        let (offset, end) = match item {
            ItemRef::Event(e) => (e.offset, e.offset + 28 + (e.channel.len() + e.data.len()) as u64),
            ItemRef::Damaged(d) => (d.offset, d.offset + d.bytes),
            ItemRef::Cut(c) => (c.offset, c.offset + c.bytes),
        };
        assert!(at <= offset && offset < end && end <= length, "an item at {offset}..{end} behind {at}");
        at = end;
    }
    assert_eq!(at, length, "bytes that no item covers");
});
