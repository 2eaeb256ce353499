//! The recorder on a real network: stock liblcm sends, a relay drops, duplicates and delays datagrams, and the counts match exactly.
#![allow(clippy::unwrap_used, missing_docs)]

mod common;
#[path = "../../tests/common/network.rs"]
mod network;

use common::path;
use lcmtypes::bus::{Bus, LcmBus};
use lcmtypes::{Event, Message, channels};
use replay::Error;
use replay::log::LogReader;
use replay::record::{Filter, Pattern, RecordOptions, RecordSummary, Recorder, Rotation, SequenceRange};
use replay::udpm::{Listener, Url, split};
use std::collections::BTreeMap;
use std::net::{SocketAddr, UdpSocket};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Long enough on a stalled machine; a test that passes never waits for it.
const TIME_OUT: Duration = Duration::from_secs(20);

/// Network of a test.
fn url(test: u32) -> Url {
    Url { port: network::port(test), ..Url::default() }
}

fn options(url: &Url, out: &Path) -> RecordOptions {
    RecordOptions {
        url: url.clone(),
        out: out.into(),
        filter: Filter::default(),
        vital: None,
        rotation: Rotation::default(),
        reserve: 0,
        buffer: 1 << 24,
    }
}

/// Records while `send` sends, until this number of messages was received.
fn record(options: RecordOptions, messages: u64, send: impl FnOnce()) -> RecordSummary {
    let recorder = Recorder::start(options).unwrap();
    let (sent, received) = (AtomicBool::new(false), AtomicU64::new(0));
    std::thread::scope(|scope| {
        let recorded = scope.spawn(|| {
            let began = Instant::now();
            let all = || sent.load(Ordering::SeqCst) && received.load(Ordering::SeqCst) >= messages;
            let stop = || all() || began.elapsed() > TIME_OUT;
            recorder
                .run(&stop, &mut |progress| received.store(progress.status.counts.received, Ordering::SeqCst))
                .unwrap()
        });
        send();
        sent.store(true, Ordering::SeqCst);
        recorded.join().unwrap()
    })
}

fn data(number: u32) -> Vec<u8> {
    [&number.to_be_bytes()[..], &[7; 396]].concat()
}

/// Channel and first word of every message that is no EVENT; the texts of those that are.
fn content(path: &Path) -> (Vec<(String, u32)>, Vec<String>) {
    let (mut messages, mut texts) = (Vec::new(), Vec::new());
    let mut events = LogReader::open(path).unwrap().events();
    for event in events.by_ref() {
        let event = event.unwrap();
        if *event.channel == *channels::EVENT {
            texts.push(Event::decode(&event.data).unwrap().text);
        } else {
            let word = event.data.first_chunk().map_or(0, |bytes| u32::from_be_bytes(*bytes));
            messages.push((event.channel.to_string(), word));
        }
    }
    assert!(events.health().is_good());
    (messages, texts)
}

/// Where datagrams go.
struct Relay {
    socket: UdpSocket,
    to: SocketAddr,
}

impl Relay {
    fn new(to: &Url) -> Self {
        let socket = UdpSocket::bind("0.0.0.0:0").unwrap();
        socket.set_multicast_ttl_v4(0).unwrap();
        Relay { socket, to: SocketAddr::from((to.group, to.port)) }
    }

    fn send(&self, datagram: &[u8]) {
        assert_eq!(self.socket.send_to(datagram, self.to).unwrap(), datagram.len());
    }

    fn name(&self, recorded: &RecordSummary) -> String {
        let port = self.socket.local_addr().unwrap().port();
        let names = recorded.intake.senders.iter().map(|account| account.sender.clone());
        names.into_iter().find(|name| name.ends_with(&format!(":{port}"))).unwrap()
    }
}

/// What stock liblcm sends for some messages, taken off the network.
fn stock_datagrams(url: &Url, messages: &[(&str, Vec<u8>)]) -> Vec<Vec<u8>> {
    let mut listener = Listener::open(url).unwrap();
    let mut bus = LcmBus::open(&url.to_string()).unwrap();
    let mut datagrams = Vec::new();
    let began = Instant::now();
    for (channel, data) in messages {
        bus.publish(channel, data).unwrap();
        // One message at a time, so that no buffer need hold them all.
        let count = split(0, channel, data).len();
        for _ in 0..count {
            while let (None, true) =
                (listener.receive().unwrap().map(|d| datagrams.push(d.bytes.to_vec())), began.elapsed() < TIME_OUT)
            {
            }
        }
    }
    datagrams
}

#[test]
fn the_counts_match_exactly_what_the_relay_did() {
    for name in ["relay.lcmlog", "relay.mcap"] {
        let (near, far) = (url(0), url(1));
        // Message 20 has three fragments.
        let messages: Vec<(&str, Vec<u8>)> = (0..60)
            .map(|i| if i == 20 { ("LONG", [data(20), vec![9; 150_000]].concat()) } else { ("M", data(i)) })
            .collect();
        let datagrams = stock_datagrams(&near, &messages);
        assert_eq!(datagrams.len(), 62);
        let at = |message: usize| if message > 20 { message + 2 } else { message };

        let path = path(name);
        let relay = Relay::new(&far);
        let received = 60 - 6;
        let recorded = record(options(&far, &path), received, || {
            let dropped = [5, 10, 11, 12, 40, 50].map(at);
            for (i, datagram) in datagrams.iter().enumerate() {
                if dropped.contains(&i) || i == at(30) || i == 21 {
                    continue;
                }
                relay.send(datagram);
                if i == at(25) {
                    relay.send(datagram);
                }
                // 30 goes out after 33; the second fragment of 20 after its third, and twice.
                if i == at(33) {
                    relay.send(&datagrams[at(30)]);
                }
                if i == 22 {
                    relay.send(&datagrams[21]);
                    relay.send(&datagrams[21]);
                }
            }
        });

        let run = |first, count| SequenceRange { first, count };
        let account = &recorded.intake.senders[0];
        assert_eq!(
            (account.received, account.lost, account.duplicates, account.reordered, account.restarts),
            (54, 6, 2, 2, 0)
        );
        assert_eq!(account.lost_runs, [run(5, 1), run(10, 3), run(40, 1), run(50, 1)]);
        assert_eq!((recorded.intake.senders.len(), recorded.intake.counts.received), (1, received));

        let (logged, texts) = content(&path);
        let numbers: Vec<u32> = logged.iter().map(|(_, number)| *number).collect();
        let mut expected: Vec<u32> = (0..60).filter(|i| ![5, 10, 11, 12, 30, 40, 50].contains(i)).collect();
        expected.insert(expected.iter().position(|i| *i == 33).unwrap() + 1, 30);
        assert_eq!(numbers, expected);
        let sender = relay.name(&recorded);
        let (last, found) = texts.split_last().unwrap();
        // The totals: received, senders, lost, duplicate, late, dropped by the kernel, malformed, not recorded.
        let numbers = last.split(|c: char| !c.is_ascii_digit()).filter_map(|number| number.parse::<u64>().ok());
        assert_eq!(numbers.collect::<Vec<_>>(), [54, 1, 6, 2, 2, 0, 0, 0], "{last}");
        // Reported once per second, so in one or several texts.
        assert_eq!(listed(found, &sender, "lost"), ["5", "10-12", "40", "50"]);
        assert_eq!(listed(found, &sender, "duplicate"), ["20", "25"]);
        assert_eq!(listed(found, &sender, "late"), ["20", "30"]);
    }
}

/// The sequence ranges in texts such as `127.0.0.1:4711 lost 4: sequence 5, 10-12`.
fn listed(texts: &[String], sender: &str, what: &str) -> Vec<String> {
    let begin = format!("{sender} {what} ");
    let lists =
        texts.iter().filter_map(|text| text.strip_prefix(&begin)?.split_once(": sequence ")).map(|(_, list)| list);
    lists.flat_map(|list| list.split(", ").map(str::to_owned)).collect()
}

#[test]
fn a_message_with_a_missing_fragment_is_lost_and_reported() {
    let (url, path) = (url(2), path("incomplete.mcap"));
    let relay = Relay::new(&url);
    let recorded = record(options(&url, &path), 2, || {
        relay.send(&split(0, "M", &data(0))[0]);
        let fragments = split(1, "LONG", &[1; 200_000]);
        [0, 1, 3].into_iter().for_each(|i| relay.send(&fragments[i]));
        relay.send(&split(2, "M", &data(2))[0]);
    });
    assert_eq!(
        (recorded.intake.lost, recorded.intake.senders[0].lost_runs[0]),
        (1, SequenceRange { first: 1, count: 1 })
    );
    let begin = format!("{} lost 1: sequence 1,", relay.name(&recorded));
    assert!(content(&path).1.iter().any(|text| text.starts_with(&begin) && text.contains("3 of 4")));
}

#[test]
fn senders_are_counted_separately_and_a_restart_is_detected() {
    let (url, path) = (url(3), path("senders.mcap"));
    let (a, b) = (Relay::new(&url), Relay::new(&url));
    let recorded = record(options(&url, &path), 8 + 3 + 4, || {
        // Numbers 0 to 3 again from the same port with other content are a restart; b has its own sequence.
        for i in [100, 101, 102, 103, 105, 106, 107, 108] {
            a.send(&split(i, "A", &data(i))[0]);
        }
        for i in [7, 8, 9] {
            b.send(&split(i, "B", &data(i))[0]);
        }
        for i in [0, 1, 2, 3] {
            a.send(&split(i, "A", &data(1000 + i))[0]);
        }
    });
    let by_name: BTreeMap<_, _> = recorded.intake.senders.iter().map(|s| (s.sender.clone(), s)).collect();
    let (a_account, b_account) = (by_name[&a.name(&recorded)], by_name[&b.name(&recorded)]);
    assert_eq!((a_account.received, a_account.lost, a_account.restarts), (12, 1, 1));
    assert_eq!((b_account.received, b_account.lost, b_account.restarts), (3, 0, 0));
    assert_eq!(content(&path).0.len(), 15);
}

#[test]
fn numbers_wrap() {
    let (url, path) = (url(4), path("wrap.mcap"));
    let relay = Relay::new(&url);
    let recorded = record(options(&url, &path), 5, || {
        for i in [u32::MAX - 1, u32::MAX, 1, 0, 3] {
            relay.send(&split(i, "M", &data(i))[0]);
        }
    });
    let account = &recorded.intake.senders[0];
    assert_eq!((account.received, account.lost, account.reordered, account.restarts), (5, 1, 1, 0));
    assert_eq!(account.lost_runs, [SequenceRange { first: 2, count: 1 }]);
}

#[test]
fn noise_is_counted_and_survived() {
    let (url, path) = (url(5), path("noise.mcap"));
    let relay = Relay::new(&url);
    let recorded = record(options(&url, &path), 2, || {
        relay.send(&split(0, "M", &data(0))[0]);
        for noise in [&b""[..], b"x", b"LC02", b"LC02\0\0\0\x01", b"LC03\0\0\0\x02short", &[0xff; 1000]] {
            relay.send(noise);
        }
        relay.send(&split(3, "M", &data(3))[0]);
    });
    // Messages 1 and 2 were received damaged, so they are not lost.
    assert_eq!((recorded.intake.counts.malformed, recorded.intake.lost), (6, 0));
    assert!(content(&path).1.iter().any(|text| text.starts_with("1 malformed datagrams: ")));
}

#[test]
fn only_selected_channels_are_recorded_and_all_are_counted() {
    let (url, path) = (url(6), path("filtered.mcap"));
    let mut options = options(&url, &path);
    options.filter = Filter { include: Pattern::new("A|B|LCM.*").ok(), exclude: Pattern::new("B").ok() };
    // A handle that subscribes sends LCM_SELF_TEST to itself, out of the same sequence.
    let recorded = record(options, 61, || {
        let mut bus = LcmBus::open(&url.to_string()).unwrap();
        bus.subscribe("A").unwrap();
        for i in 0..20 {
            for channel in ["A", "B", "C"] {
                bus.publish(channel, &data(i)).unwrap();
            }
        }
    });
    assert_eq!((recorded.intake.lost, recorded.intake.duplicates), (0, 0));
    assert_eq!(content(&path).0, (0..20).map(|i| ("A".to_owned(), i)).collect::<Vec<_>>());
}

/// The other direction: liblcm accepts our datagrams.
#[test]
fn stock_lcm_receives_our_fragments() {
    let url = url(7);
    let mut bus = LcmBus::open(&format!("{url}&recv_buf_size=4000000")).unwrap();
    bus.subscribe("CH").unwrap();
    let relay = Relay::new(&url);
    let lengths = [5, 65_496, 65_497, 130_972, 1_000_000];
    for (sequence, length) in (0..).zip(lengths) {
        let data: Vec<u8> = (0..length).map(|i| (i % 251) as u8).collect();
        let mut received = Vec::new();
        // A datagram may be lost where a machine is busy; the message goes out again then.
        for _ in 0..10 {
            split(sequence, "CH", &data).iter().for_each(|datagram| relay.send(datagram));
            received = bus.handle(Duration::from_secs(2)).unwrap();
            if !received.is_empty() {
                break;
            }
        }
        assert!(received[0].data == data, "{length} bytes");
    }
}

#[test]
fn a_recording_that_cannot_start_is_an_error() {
    let url = url(8);
    let start = |out: PathBuf| Recorder::start(options(&url, &out)).err().unwrap();
    assert!(matches!(start(path("log.txt")), Error::UnknownExtension { path } if path.ends_with("log.txt")));
    assert!(matches!(start(path("none/log.mcap")), Error::Io { path, .. } if path.ends_with("none/log.mcap")));
}
