//! LCM's UDP multicast protocol: datagrams as liblcm sends them, fragments in any order, contradictory senders.
#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use common::Random;
use replay::udpm::{FRAGMENT_BODY, Outcome, Packet, Reassembled, Reassembler, split};
use serde_json::Value;
use std::net::SocketAddrV4;

fn sender(port: u16) -> SocketAddrV4 {
    SocketAddrV4::new([127, 0, 0, 1].into(), port)
}

fn payload(length: usize) -> Vec<u8> {
    (0..length).map(|i| (i % 251) as u8).collect()
}

/// Gives the reassembler one datagram of a long message.
fn accept(reassembler: &mut Reassembler, from: u16, t_ns: i64, datagram: &[u8]) -> Outcome {
    let Packet::Fragment(fragment) = Packet::parse(datagram).unwrap() else { panic!("a short message") };
    reassembler.accept(sender(from), t_ns, &fragment)
}

fn whole(channel: &str, data: &[u8]) -> Reassembled {
    Reassembled { channel: channel.to_owned(), data: data.to_vec() }
}

/// Captured from LCM 1.3.1 and 1.5.3 by `scripts/capture_lcm_datagrams.py`: our datagrams have the same bytes, and the captured ones are
/// decoded as published.
#[test]
fn datagrams_equal_those_of_liblcm() {
    let captured: Vec<Value> = serde_json::from_str(include_str!("data/lcm_datagrams.json")).unwrap();
    let number = |value: &Value| usize::try_from(value.as_u64().unwrap()).unwrap();
    let mut seen = Vec::new();
    for message in &captured {
        let (channel, length) = (message["channel"].as_str().unwrap(), number(&message["payload"]));
        let data = payload(length);
        let ours = split(number(&message["sequence"]) as u32, channel, &data);
        let theirs = message["datagrams"].as_array().unwrap();
        assert_eq!(ours.len(), theirs.len(), "{channel} of {length} bytes");
        for (ours, theirs) in ours.iter().zip(theirs) {
            let head: String = ours.iter().take(48).map(|byte| format!("{byte:02x}")).collect();
            assert_eq!(head, theirs["head"].as_str().unwrap());
            assert_eq!(ours.len(), number(&theirs["length"]));
            assert_eq!(u64::from(crc32fast::hash(ours)), theirs["crc32"].as_u64().unwrap());
        }
        match ours.as_slice() {
            [one] => {
                let Packet::Short(short) = Packet::parse(one).unwrap() else { panic!("{channel}: a fragment") };
                assert_eq!((&*short.channel, short.data), (channel, &data[..]));
            }
            fragments => {
                let mut reassembler = Reassembler::default();
                let outcome = fragments.iter().map(|bytes| accept(&mut reassembler, 1, 0, bytes)).last().unwrap();
                assert_eq!(outcome, Outcome::Complete { message: whole(channel, &data), reordered: false });
            }
        }
        seen.push((message["lcm"].as_str().unwrap(), ours.len()));
    }
    for version in ["1.3.1", "1.5.3"] {
        assert!([1, 2, 3].into_iter().all(|count| seen.contains(&(version, count))), "{version}: {seen:?}");
    }
}

#[test]
fn a_message_is_short_up_to_the_longest_datagram() {
    let lengths = |bytes: usize| split(0, "CH", &payload(bytes)).iter().map(Vec::len).collect::<Vec<_>>();
    assert_eq!(lengths(65_496), [65_507]);
    assert_eq!(lengths(65_497), [65_507, 33]);
    assert_eq!(lengths(130_971), [65_507, 65_507]);
    assert_eq!(lengths(130_972), [65_507, 65_507, 21]);
}

#[test]
fn fragments_in_any_order_with_duplicates_from_several_senders() {
    let mut random = Random(7);
    let messages: Vec<(u16, u32, Vec<u8>)> =
        (0..12).map(|i| (i % 3, u32::from(i / 3), payload(70_000 + 40_000 * usize::from(i)))).collect();
    for _ in 0..20 {
        let mut datagrams: Vec<(u16, Vec<u8>)> = Vec::new();
        for (from, sequence, data) in &messages {
            for datagram in split(*sequence, "LONG", data) {
                datagrams.push((*from, datagram.clone()));
                if random.next().is_multiple_of(4) {
                    datagrams.push((*from, datagram));
                }
            }
        }
        for i in (1..datagrams.len()).rev() {
            datagrams.swap(i, (random.next() % (i as u64 + 1)) as usize);
        }
        let mut reassembler = Reassembler::default();
        let mut complete = Vec::new();
        for (from, datagram) in &datagrams {
            if let Outcome::Complete { message, .. } = accept(&mut reassembler, *from, 0, datagram) {
                complete.push((*from, message));
            }
        }
        for (from, _, data) in &messages {
            assert!(complete.contains(&(*from, whole("LONG", data))));
        }
        // A duplicate after its message is complete starts the message again, so there may be more messages, but none is wrong.
        assert!(
            complete
                .iter()
                .all(|(from, message)| messages.iter().any(|(f, _, data)| f == from && *data == message.data))
        );
    }
}

/// liblcm only counts fragments: there, the first fragment twice completes a message that lacks its second half.
#[test]
fn a_duplicate_fragment_completes_nothing() {
    let data = payload(100_000);
    let datagrams = split(3, "LONG", &data);
    let mut reassembler = Reassembler::default();
    assert_eq!(accept(&mut reassembler, 1, 0, &datagrams[0]), Outcome::Incomplete { reordered: false });
    assert_eq!(accept(&mut reassembler, 1, 0, &datagrams[0]), Outcome::Duplicate);
    let complete = Outcome::Complete { message: whole("LONG", &data), reordered: false };
    assert_eq!(accept(&mut reassembler, 1, 0, &datagrams[1]), complete);
    assert_eq!(reassembler.bytes(), 0);
}

#[test]
fn a_late_fragment_is_reported_as_reordered() {
    let data = payload(100_000);
    let datagrams = split(3, "LONG", &data);
    let mut reassembler = Reassembler::default();
    accept(&mut reassembler, 1, 0, &datagrams[1]);
    let complete = Outcome::Complete { message: whole("LONG", &data), reordered: true };
    assert_eq!(accept(&mut reassembler, 1, 0, &datagrams[0]), complete);
}

#[test]
fn messages_beyond_the_timeout_or_the_limits_are_abandoned_and_reported() {
    let abandoned = |reassembler: &mut Reassembler| {
        let messages = reassembler.abandoned();
        messages.iter().map(|a| (a.sender.port(), a.sequence, a.received, a.count)).collect::<Vec<_>>()
    };
    let datagrams = |sequence| split(sequence, "LONG", &payload(3 * FRAGMENT_BODY));
    let mut reassembler = Reassembler::default();
    accept(&mut reassembler, 1, 0, &datagrams(1)[0]);
    accept(&mut reassembler, 1, 0, &datagrams(1)[2]);
    accept(&mut reassembler, 2, 1_500_000_000, &datagrams(9)[0]);
    reassembler.expire(2_000_000_000);
    assert_eq!(abandoned(&mut reassembler), []);
    reassembler.expire(2_000_000_001);
    assert_eq!(abandoned(&mut reassembler), [(1, 1, 2, 4)]);
    reassembler.clear();
    assert_eq!((abandoned(&mut reassembler), reassembler.bytes()), (vec![(2, 9, 1, 4)], 0));

    // Limit of two messages: the third replaces the one with the oldest last fragment.
    let mut reassembler = Reassembler::with_limit(1 << 30, 2);
    for (t, sequence) in [(10, 1), (20, 2), (30, 1), (40, 3)] {
        let part = usize::from(t == 30);
        accept(&mut reassembler, 1, t, &datagrams(sequence)[part]);
    }
    assert_eq!(abandoned(&mut reassembler), [(1, 2, 1, 4)]);
    // The limit of bytes holds, independent of the sizes in the headers.
    let mut reassembler = Reassembler::with_limit(200_000, 1000);
    for sequence in 0..50 {
        accept(&mut reassembler, 1, i64::from(sequence), &datagrams(sequence)[0]);
        assert!(reassembler.bytes() <= 200_000);
    }
    assert_eq!(abandoned(&mut reassembler).len(), 47);
}

#[test]
fn a_new_message_with_the_same_sequence_number_replaces_the_old() {
    let (old, new) = (split(5, "OLD", &payload(100_000)), split(5, "NEW", &payload(90_000)));
    let mut reassembler = Reassembler::default();
    accept(&mut reassembler, 1, 0, &old[0]);
    accept(&mut reassembler, 1, 0, &new[0]);
    let complete = Outcome::Complete { message: whole("NEW", &payload(90_000)), reordered: false };
    assert_eq!(accept(&mut reassembler, 1, 0, &new[1]), complete);
    assert_eq!(reassembler.abandoned().len(), 1);
}

/// Each header byte set to several values: every accepted datagram is consistent.
#[test]
fn inconsistent_headers_are_rejected() {
    let mut refused = std::collections::BTreeSet::new();
    for datagram in [split(1, "CH", b"hello"), split(1, "CH", &payload(100_000))].concat() {
        for length in 0..64.min(datagram.len()) {
            refused.extend(Packet::parse(&datagram[..length]).err().map(|m| m.why));
        }
        for at in 0..24.min(datagram.len()) {
            for value in [0, 1, 2, 0x7f, 0x80, 0xff] {
                let mut damaged = datagram.clone();
                damaged[at] = value;
                match Packet::parse(&damaged) {
                    Ok(Packet::Fragment(f)) => {
                        assert!(f.number < f.count && f.offset as usize + f.data.len() <= f.size as usize);
                        let mut reassembler = Reassembler::default();
                        reassembler.accept(sender(1), 0, &f);
                        assert!(reassembler.bytes() <= damaged.len() + 64);
                    }
                    Ok(Packet::Short(_)) => {}
                    Err(malformed) => drop(refused.insert(malformed.why)),
                }
            }
        }
    }
    // Every reason for a rejection occurs.
    assert_eq!(refused.len(), 8, "{refused:?}");
}

/// All fragments are received, but they are not contiguous.
#[test]
fn fragments_with_a_hole_between_them_are_dropped() {
    let datagrams = split(5, "LONG", &payload(3 * FRAGMENT_BODY));
    let mut moved = datagrams.clone();
    // Offset of the second fragment, one too small.
    moved[1][15] -= 1;
    for order in [[0, 1, 2, 3], [3, 1, 0, 2]] {
        let mut reassembler = Reassembler::default();
        let last = order.iter().map(|&i| accept(&mut reassembler, 1, 0, &moved[i])).last().unwrap();
        assert_eq!((last, reassembler.bytes()), (Outcome::Contradictory, 0));
    }
}
