//! LCM's UDP multicast format: datagrams of stock LCM, fragments in any order, senders that contradict themselves.
#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use common::Random;
use replay::udpm::{FRAGMENT_BODY, Outcome, Packet, Reassembler, Whole, split};
use serde_json::Value;
use std::net::SocketAddrV4;

fn sender(port: u16) -> SocketAddrV4 {
    SocketAddrV4::new([127, 0, 0, 1].into(), port)
}

fn payload(length: usize) -> Vec<u8> {
    (0..length).map(|i| (i % 251) as u8).collect()
}

/// Hands the reassembler one datagram of a long message.
fn accept(reassembler: &mut Reassembler, from: u16, t_ns: i64, datagram: &[u8]) -> Outcome {
    let Packet::Fragment(fragment) = Packet::parse(datagram).unwrap() else { panic!("a short message") };
    reassembler.accept(sender(from), t_ns, &fragment)
}

fn whole(channel: &str, data: &[u8]) -> Whole {
    Whole { channel: channel.to_owned(), data: data.to_vec() }
}

/// Captured from LCM 1.3.1 and 1.5.3 by `scripts/capture_lcm_datagrams.py`: our datagrams are the same bytes, and theirs are read as what
/// was published.
#[test]
fn datagrams_are_those_of_stock_lcm() {
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
                assert_eq!((short.channel, short.data), (channel, &data[..]));
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
fn fragments_come_in_any_order_several_times_and_mixed() {
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
        // A copy that comes after its message is whole begins the message anew, so there may be more, but none is wrong.
        assert!(
            complete
                .iter()
                .all(|(from, message)| messages.iter().any(|(f, _, data)| f == from && *data == message.data))
        );
    }
}

/// The stock library only counts: the first fragment twice gives it a message with half of it missing.
#[test]
fn a_fragment_that_comes_twice_completes_nothing() {
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
fn a_late_fragment_is_told() {
    let data = payload(100_000);
    let datagrams = split(3, "LONG", &data);
    let mut reassembler = Reassembler::default();
    accept(&mut reassembler, 1, 0, &datagrams[1]);
    let complete = Outcome::Complete { message: whole("LONG", &data), reordered: true };
    assert_eq!(accept(&mut reassembler, 1, 0, &datagrams[0]), complete);
}

#[test]
fn what_waits_too_long_or_takes_too_much_is_given_up_and_told() {
    let told = |reassembler: &mut Reassembler| {
        let told = reassembler.abandoned();
        told.iter().map(|a| (a.sender.port(), a.sequence, a.came, a.count)).collect::<Vec<_>>()
    };
    let datagrams = |sequence| split(sequence, "LONG", &payload(3 * FRAGMENT_BODY));
    let mut reassembler = Reassembler::default();
    accept(&mut reassembler, 1, 0, &datagrams(1)[0]);
    accept(&mut reassembler, 1, 0, &datagrams(1)[2]);
    accept(&mut reassembler, 2, 1_500_000_000, &datagrams(9)[0]);
    reassembler.expire(2_000_000_000);
    assert_eq!(told(&mut reassembler), []);
    reassembler.expire(2_000_000_001);
    assert_eq!(told(&mut reassembler), [(1, 1, 2, 4)]);
    reassembler.clear();
    assert_eq!((told(&mut reassembler), reassembler.bytes()), (vec![(2, 9, 1, 4)], 0));

    // Two messages at most: the third pushes out the one that has waited longest.
    let mut reassembler = Reassembler::with_limit(1 << 30, 2);
    for (t, sequence) in [(10, 1), (20, 2), (30, 1), (40, 3)] {
        let part = usize::from(t == 30);
        accept(&mut reassembler, 1, t, &datagrams(sequence)[part]);
    }
    assert_eq!(told(&mut reassembler), [(1, 2, 1, 4)]);
    // And no more bytes than allowed, whatever sizes the headers claim.
    let mut reassembler = Reassembler::with_limit(200_000, 1000);
    for sequence in 0..50 {
        accept(&mut reassembler, 1, i64::from(sequence), &datagrams(sequence)[0]);
        assert!(reassembler.bytes() <= 200_000);
    }
    assert_eq!(told(&mut reassembler).len(), 47);
}

#[test]
fn another_message_of_the_same_number_takes_the_place_of_the_old() {
    let (old, new) = (split(5, "OLD", &payload(100_000)), split(5, "NEW", &payload(90_000)));
    let mut reassembler = Reassembler::default();
    accept(&mut reassembler, 1, 0, &old[0]);
    accept(&mut reassembler, 1, 0, &new[0]);
    let complete = Outcome::Complete { message: whole("NEW", &payload(90_000)), reordered: false };
    assert_eq!(accept(&mut reassembler, 1, 0, &new[1]), complete);
    assert_eq!(reassembler.abandoned().len(), 1);
}

/// Each byte of a header set to each of some values: whatever is not refused is consistent.
#[test]
fn no_header_is_believed() {
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
    assert_eq!(
        refused.into_iter().collect::<Vec<_>>(),
        [
            "a channel that is not text",
            "a channel without end",
            "a channel without name",
            "a fragment beyond the end of its message",
            "a fragment beyond the last",
            "a message longer than LCM carries",
            "begins with neither LC02 nor LC03",
            "more fragments than a message of this size has",
            "shorter than a header",
        ]
    );
}

/// All numbers there, the pieces not end to end.
#[test]
fn fragments_that_leave_a_hole_make_no_message() {
    let datagrams = split(5, "LONG", &payload(3 * FRAGMENT_BODY));
    let mut moved = datagrams.clone();
    // The offset of the second fragment, one less than it should be.
    moved[1][15] -= 1;
    for order in [[0, 1, 2, 3], [3, 1, 0, 2]] {
        let mut reassembler = Reassembler::default();
        let last = order.iter().map(|&i| accept(&mut reassembler, 1, 0, &moved[i])).last().unwrap();
        assert_eq!((last, reassembler.bytes()), (Outcome::Contradictory, 0));
    }
}
