//! The reader of MCAP accepts any bytes: no panic, it terminates, no item outside the file, the same items in two passes.
#![no_main]

use libfuzzer_sys::fuzz_target;
use replay::log::{ItemRef, LogReader};

fn read(bytes: &[u8], unchecked: bool) -> Vec<(u64, u64)> {
    let input = [b"\x89MCAP0\r\n", bytes].concat();
    let length = input.len() as u64;
    let Ok(reader) = LogReader::from_bytes("fuzz", input) else { return Vec::new() };
    let mut reader = reader.keep_unchecked(unchecked);
    let mut items = Vec::new();
    while let Ok(Some(item)) = reader.read() {
        let (offset, bytes) = match item {
            ItemRef::Event(e) => (e.offset, 0),
            ItemRef::Damaged(d) => (d.offset, d.bytes),
            ItemRef::Cut(c) => (c.offset, c.bytes),
        };
        assert!(offset + bytes <= length, "an item at {offset}, {bytes} bytes");
        items.push((offset, bytes));
    }
    items
}

fuzz_target!(|bytes: &[u8]| {
    assert_eq!(read(bytes, false), read(bytes, false));
    read(bytes, true);
});
