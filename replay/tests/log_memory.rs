//! Memory of a reader is bounded by the size of the file's real content, not by the lengths that it claims.
#![allow(clippy::unwrap_used, reason = "test code")]
#![allow(unsafe_code, reason = "a counting allocator")]

mod common;

use replay::log::LogReader;
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

/// The system allocator with a count of allocated bytes.
struct Counting;

static NOW: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call is passed to the system allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let now = NOW.fetch_add(layout.size(), Ordering::Relaxed) + layout.size();
        PEAK.fetch_max(now, Ordering::Relaxed);
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        NOW.fetch_sub(layout.size(), Ordering::Relaxed);
        unsafe { System.dealloc(block, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Peak memory of reading these bytes, without the bytes themselves, and the number of events.
fn peak(bytes: &[u8]) -> (usize, usize) {
    let bytes = bytes.to_vec();
    let before = NOW.load(Ordering::Relaxed);
    PEAK.store(before, Ordering::Relaxed);
    let mut reader = LogReader::from_bytes("sample", bytes).unwrap();
    let mut events = 0;
    while let Some(item) = reader.read().unwrap() {
        events += usize::from(matches!(item, replay::log::ItemRef::Event(_)));
    }
    (PEAK.load(Ordering::Relaxed) - before, events)
}

/// Limit, bytes: a decompressed chunk, channel names, and the state of zstd.
const LIMIT: usize = 8 << 20;

/// A single test, because all threads share the allocator.
#[test]
fn memory_is_bounded_by_the_content_of_the_file() {
    let messages = common::messages(15);
    let (log, mcap) = (common::path("small.lcmlog"), common::path("small.mcap"));
    common::write(&log, &messages, 5);
    common::write(&mcap, &messages, 5);
    let (log, mcap) = (std::fs::read(log).unwrap(), std::fs::read(mcap).unwrap());

    // A length above the limit is rejected.
    let mut huge = log.clone();
    huge[24..28].copy_from_slice(&i32::MAX.to_be_bytes());
    assert_eq!(peak(&huge).1, 14);
    // Every length of every record set to large values.
    for bytes in [&log, &mcap] {
        for at in 0..bytes.len() - 8 {
            for claim in [u64::MAX >> 8, 0x1fff_ffff, 0x0fff_ffff_0000_0000] {
                let mut damaged = bytes.clone();
                damaged[at..at + 8].copy_from_slice(&claim.to_le_bytes());
                if LogReader::from_bytes("sample", damaged.clone()).is_ok() {
                    let (peak, _) = peak(&damaged);
                    assert!(peak < LIMIT, "{peak} bytes with {claim:#x} at {at}");
                }
            }
        }
    }
    // A long log needs no more memory than a short one.
    let (long, events) = peak(&log.repeat(20_000));
    assert_eq!(events, 300_000);
    assert!(long < LIMIT, "{long} bytes");
    let (long, events) = peak(&mcap.repeat(2_000));
    assert_eq!(events, 30_000);
    assert!(long < LIMIT, "{long} bytes");
    // An unlimited number of channel names does not fill the memory.
    let mut names = Vec::new();
    for i in 0..400_000_u32 {
        names.extend_from_slice(&log[..20]);
        names.extend_from_slice(&8_u32.to_be_bytes());
        names.extend_from_slice(&0_u32.to_be_bytes());
        names.extend_from_slice(format!("{i:08}").as_bytes());
    }
    let (named, events) = peak(&names);
    assert_eq!(events, 400_000);
    assert!(named < LIMIT, "{named} bytes");
}
