//! The bus, in memory and over liblcm: delivery, order, full queues, invalid names.

#![allow(clippy::unwrap_used, missing_docs, reason = "a test may panic")]

#[path = "../../tests/common/network.rs"]
mod network;

use std::time::Duration;

use lcmtypes::bus::{Bus, BusError, LcmBus, MemoryBus, Received};
use lcmtypes::{Message, RobotState, channels};

/// Longest wait for a message; a passing test gets it within milliseconds.
const TIMEOUT: Duration = Duration::from_secs(20);

fn texts(messages: &[Received]) -> Vec<(&str, &str)> {
    messages.iter().map(|m| (m.channel.as_str(), std::str::from_utf8(&m.data).unwrap())).collect()
}

/// Receives until there are `n` messages.
fn receive(bus: &mut dyn Bus, n: usize) -> Vec<Received> {
    let mut all = Vec::new();
    while all.len() < n {
        let some = bus.handle(TIMEOUT).unwrap();
        assert!(!some.is_empty(), "{} of {n} messages received", all.len());
        all.extend(some);
    }
    all
}

/// Checks one handle of any bus.
fn check_one_handle(bus: &mut dyn Bus) {
    bus.subscribe("A|B.*").unwrap();
    bus.subscribe("B1").unwrap();
    for (channel, text) in [("A", "1"), ("AA", "2"), ("B1", "3"), ("XB1", "4"), ("B", ""), ("A", "6")] {
        bus.publish(channel, text.as_bytes()).unwrap();
    }
    // Complete names only, in order, and B1 once although two subscriptions match.
    assert_eq!(texts(&receive(bus, 4)), [("A", "1"), ("B1", "3"), ("B", ""), ("A", "6")]);
    assert_eq!(bus.handle(Duration::ZERO).unwrap(), []);

    for bad in ["", "with\0nul", &"x".repeat(64)] {
        let error = bus.publish(bad, b"x").unwrap_err();
        assert!(matches!(error, BusError::ChannelName { length, limit: 63, .. } if length == bad.len()), "{error}");
    }
    bus.publish(&"x".repeat(63), b"x").unwrap();
    assert!(matches!(bus.subscribe("A(").unwrap_err(), BusError::Pattern { .. }));
}

#[test]
fn one_handle_in_memory() {
    check_one_handle(&mut MemoryBus::new());
}

#[test]
fn one_handle_of_lcm_memq() {
    check_one_handle(&mut LcmBus::open("memq://").unwrap());
}

#[test]
fn one_handle_of_lcm_udp() {
    check_one_handle(&mut LcmBus::open(&network::url(1)).unwrap());
}

#[test]
fn lcm_carries_messages_between_handles() {
    let url = network::url(2);
    let (mut sender, mut receiver) = (LcmBus::open(&url).unwrap(), LcmBus::open(&url).unwrap());
    receiver.subscribe(channels::ROBOT_STATE).unwrap();
    let state =
        |seq| RobotState { seq, nj: 2, q: vec![0.5; 2], qd: vec![0.0; 2], tau: vec![1.0; 2], ..Default::default() };
    let mut bytes = Vec::new();
    for seq in 0..200 {
        bytes.clear();
        state(seq).encode(&mut bytes).unwrap();
        sender.publish(channels::ROBOT_STATE, &bytes).unwrap();
    }
    // 200 messages are queued at once; with the default capacity of LCM, 30, most would be lost.
    let received = receive(&mut receiver, 200);
    for (seq, message) in (0..).zip(&received) {
        assert_eq!(RobotState::decode(&message.data).unwrap(), state(seq));
        assert!(message.recv_utime.unwrap() > 0);
    }
}

#[test]
fn a_message_of_several_datagrams_arrives_complete() {
    let url = network::url(3);
    let (mut sender, mut receiver) = (LcmBus::open(&url).unwrap(), LcmBus::open(&url).unwrap());
    receiver.subscribe("BIG").unwrap();
    let big: Vec<u8> = (0..200_000u32).map(|i| (i % 251) as u8).collect();
    sender.publish("BIG", &big).unwrap();
    assert_eq!(receive(&mut receiver, 1)[0].data, big);
}

#[test]
fn each_handle_in_memory_gets_a_copy_in_order() {
    let mut a = MemoryBus::new();
    let (mut b, mut unsubscribed) = (a.connect(), a.connect());
    b.subscribe(".*").unwrap();
    a.subscribe("X").unwrap();
    b.publish("X", b"1").unwrap();
    a.publish("Y", b"2").unwrap();
    assert_eq!(texts(&b.handle(Duration::ZERO).unwrap()), [("X", "1"), ("Y", "2")]);
    assert_eq!(texts(&a.handle(Duration::ZERO).unwrap()), [("X", "1")]);
    assert_eq!(unsubscribed.handle(Duration::ZERO).unwrap(), []);
}

#[test]
fn a_full_queue_in_memory_drops_the_newest_and_counts() {
    let mut sender = MemoryBus::new();
    let mut receiver = sender.connect_with_capacity(2);
    receiver.subscribe("X").unwrap();
    for text in ["1", "2", "3", "4"] {
        sender.publish("X", text.as_bytes()).unwrap();
    }
    assert_eq!(receiver.dropped(), 2);
    assert_eq!(texts(&receiver.handle(Duration::ZERO).unwrap()), [("X", "1"), ("X", "2")]);
    sender.publish("X", b"5").unwrap();
    assert_eq!(texts(&receiver.handle(Duration::ZERO).unwrap()), [("X", "5")]);
}

/// Each thread waits for the other without a time-out: a missing wake-up makes this test hang.
#[test]
fn a_message_wakes_a_handle_in_another_thread() {
    fn answer(bus: &mut dyn Bus, first: bool) {
        let (mine, theirs) = if first { ("PING", "PONG") } else { ("PONG", "PING") };
        for round in 0..500u32 {
            if first {
                bus.publish(mine, &round.to_be_bytes()).unwrap();
            }
            let received = bus.handle(Duration::MAX).unwrap();
            assert_eq!((received.len(), received[0].channel.as_str()), (1, theirs));
            assert_eq!(received[0].data, round.to_be_bytes());
            if !first {
                bus.publish(mine, &round.to_be_bytes()).unwrap();
            }
        }
    }
    let mut a = MemoryBus::new();
    let mut b = a.connect();
    a.subscribe("PONG").unwrap();
    b.subscribe("PING").unwrap();
    let thread = std::thread::spawn(move || answer(&mut b, false));
    answer(&mut a, true);
    thread.join().unwrap();
}

#[test]
fn lcm_writes_an_event_log_and_reads_it_to_its_end() {
    let path = std::env::temp_dir().join(format!("hoofprint-bus-{}.lcmlog", std::process::id()));
    let mut writer = LcmBus::open(&format!("file://{}?mode=w", path.display())).unwrap();
    writer.publish("X", b"1").unwrap();
    writer.publish("Y", b"2").unwrap();
    drop(writer);
    let mut reader = LcmBus::open(&format!("file://{}?mode=r&speed=0", path.display())).unwrap();
    reader.subscribe(".*").unwrap();
    let received = receive(&mut reader, 2);
    let end = reader.handle(TIMEOUT).unwrap_err();
    std::fs::remove_file(&path).unwrap();
    assert_eq!(texts(&received), [("X", "1"), ("Y", "2")]);
    assert!(matches!(end, BusError::Receive { .. }), "{end}");
}

#[test]
fn the_error_of_a_url_that_cannot_be_opened_has_advice() {
    let error = LcmBus::open("nonsense://").unwrap_err().to_string();
    assert!(error.contains("\"nonsense://\"") && error.contains("udpm://"), "{error}");
    // An address outside the multicast range cannot be joined on any machine.
    let error = LcmBus::open("udpm://10.255.255.1:17664?ttl=0").unwrap_err().to_string();
    assert!(error.contains("udpm://10.255.255.1:17664") && error.contains("udpm://239.255.76.67"), "{error}");
}
