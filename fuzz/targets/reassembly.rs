//! Reassembly of fragments in any order and number among arbitrary datagrams.
//!
//! The input is a list of steps. A step of the correct sender passes one fragment of one of its messages; a step of the other sender passes
//! bytes of the input. Every message reassembled from the correct sender's fragments must equal the original.
#![no_main]

use libfuzzer_sys::fuzz_target;
use replay::udpm::{Outcome, Packet, Reassembler, split};
use std::net::SocketAddrV4;
use std::sync::LazyLock;

const BYTES: usize = 300_000;
const MESSAGES: usize = 5;

/// Messages of the correct sender, and their datagrams.
static SENT: LazyLock<Vec<(Vec<u8>, Vec<Vec<u8>>)>> = LazyLock::new(|| {
    let lengths = [65_497, 70_000, 130_972, 140_000, 200_000, 65_500, 100_000, 196_000];
    let message = |(sequence, length): (u32, &usize)| {
        let data: Vec<u8> = (0..*length).map(|i| (i % 251) as u8 ^ sequence as u8).collect();
        let datagrams = split(sequence, "CHANNEL", &data);
        (data, datagrams)
    };
    (0..).zip(&lengths).map(message).collect()
});

fuzz_target!(|input: &[u8]| {
    let sender = |port| SocketAddrV4::new([127, 0, 0, 1].into(), port);
    let mut reassembler = Reassembler::with_limit(BYTES, MESSAGES);
    let (mut t_ns, mut rest) = (0, input);
    while let [step, argument, tail @ ..] = rest {
        rest = tail;
        t_ns += i64::from(*step) * 10_000_000;
        if step % 2 == 0 {
            let (data, datagrams) = &SENT[usize::from(argument >> 4) % SENT.len()];
            let datagram = &datagrams[usize::from(argument & 15) % datagrams.len()];
            let Ok(Packet::Fragment(fragment)) = Packet::parse(datagram) else { panic!("our own datagram is refused") };
            if let Outcome::Complete { message, .. } = reassembler.accept(sender(1), t_ns, &fragment) {
                assert_eq!(message.channel, "CHANNEL");
                assert!(message.data == *data);
            }
        } else {
            let (datagram, tail) = rest.split_at(usize::from(*argument).min(rest.len()));
            rest = tail;
            match Packet::parse(datagram) {
                Ok(Packet::Fragment(fragment)) => {
                    if let Outcome::Complete { message, .. } = reassembler.accept(sender(2), t_ns, &fragment) {
                        assert!(message.data.len() <= fragment.size as usize && !message.channel.is_empty());
                    }
                }
                Ok(Packet::Short(short)) => assert!(short.data.len() <= datagram.len() && !short.channel.is_empty()),
                Err(_) => {}
            }
        }
        if step % 16 == 15 {
            reassembler.expire(t_ns);
        }
        // The newest message is never dropped, so the limit may be exceeded by one fragment.
        assert!(reassembler.bytes() <= BYTES + 65_507 + 64, "{} bytes", reassembler.bytes());
        reassembler.abandoned();
    }
    reassembler.clear();
    assert_eq!(reassembler.bytes(), 0);
});
