//! Memory of a reader: bounded by what the file really holds, whatever its lengths claim.
#![allow(clippy::unwrap_used, reason = "a test may")]
#![allow(unsafe_code, reason = "an allocator that counts")]

mod common;

use replay::log::LogReader;
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

/// The system's allocator, counting.
struct Counting;

static NOW: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call goes to the system's allocator unchanged.
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

/// Most memory, bytes, that reading these bytes took beside them, and how many events there were.
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

/// A decompressed chunk, tables of names, and what zstd works in.
const ENOUGH: usize = 8 << 20;

/// One test, since all threads share the allocator.
#[test]
fn memory_is_bounded_by_what_the_file_holds() {
    let messages = common::messages(15);
    let (log, mcap) = (common::path("small.lcmlog"), common::path("small.mcap"));
    common::write(&log, &messages, 5);
    common::write(&mcap, &messages, 5);
    let (log, mcap) = (std::fs::read(log).unwrap(), std::fs::read(mcap).unwrap());

    // A length that claims more than any log holds is not believed.
    let mut huge = log.clone();
    huge[24..28].copy_from_slice(&i32::MAX.to_be_bytes());
    assert_eq!(peak(&huge).1, 14);
    // Every length of every record set to large values.
    for bytes in [&log, &mcap] {
        for at in 0..bytes.len() - 8 {
            for claim in [u64::MAX >> 8, 0x1fff_ffff, 0x0fff_ffff_0000_0000] {
                let mut spoilt = bytes.clone();
                spoilt[at..at + 8].copy_from_slice(&claim.to_le_bytes());
                if LogReader::from_bytes("sample", spoilt.clone()).is_ok() {
                    let (peak, _) = peak(&spoilt);
                    assert!(peak < ENOUGH, "{peak} bytes with {claim:#x} at {at}");
                }
            }
        }
    }
    // A long log takes no more than a short one.
    let (long, events) = peak(&log.repeat(20_000));
    assert_eq!(events, 300_000);
    assert!(long < ENOUGH, "{long} bytes");
    let (long, events) = peak(&mcap.repeat(2_000));
    assert_eq!(events, 30_000);
    assert!(long < ENOUGH, "{long} bytes");
    // Channels without end: the names are not kept.
    let mut names = Vec::new();
    for i in 0..400_000_u32 {
        names.extend_from_slice(&log[..20]);
        names.extend_from_slice(&8_u32.to_be_bytes());
        names.extend_from_slice(&0_u32.to_be_bytes());
        names.extend_from_slice(format!("{i:08}").as_bytes());
    }
    let (named, events) = peak(&names);
    assert_eq!(events, 400_000);
    assert!(named < ENOUGH, "{named} bytes");
}
