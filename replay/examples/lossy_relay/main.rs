//! Relays the datagrams of one LCM network to another; drops, duplicates and reorders some of them, and reports which:
//!
//! ```text
//! lossy_relay udpm://239.255.76.67:7667 udpm://239.255.76.67:7668 --drop 0.01 --seed 1 [--duplicate 0.001] [--reorder 0.001] [--count N]
//! ```
//! With `--channels` only short messages of these channels pass: two relays, one per direction, simulate a lossy network between a robot and
//! its controller. The relay ends on Ctrl-C or after N datagrams and prints its actions per channel and per sender as JSON. The two networks
//! need different ports: on Linux, liblcm receives every multicast group of its port. Long messages keep their fragments.
#![allow(clippy::unwrap_used)]

mod relay;

use relay::{Relay, Shares};
use replay::record::Pattern;
use replay::udpm::{Listener, Packet, Url};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

const USAGE: &str = "lossy_relay FROM_URL TO_URL [--drop SHARE] [--duplicate SHARE] [--reorder SHARE] [--seed N] [--count DATAGRAMS] [--channels REGEX]";

/// Prints an error and the usage, and ends with exit code 2.
fn usage(error: &str) -> ! {
    eprintln!("error: {}\nusage: {USAGE}", replay::printable(error));
    std::process::exit(2)
}

fn parsed<T: std::str::FromStr>(text: &str) -> T {
    text.parse().unwrap_or_else(|_| usage(&format!("{text:?}: expected a number")))
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let (mut urls, mut shares, mut seed, mut count) = (Vec::new(), Shares::default(), 1u64, u64::MAX);
    let mut channels: Option<Pattern> = None;
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().unwrap_or_else(|| usage("a value is missing"));
        match argument.as_str() {
            "--drop" => shares.drop = parsed(&value()),
            "--duplicate" => shares.duplicate = parsed(&value()),
            "--reorder" => shares.reorder = parsed(&value()),
            "--seed" => seed = parsed(&value()),
            "--count" => count = parsed(&value()),
            "--channels" => channels = Some(Pattern::new(&value()).unwrap_or_else(|error| usage(&error.to_string()))),
            url => urls.push(url.parse::<Url>().unwrap_or_else(|error| usage(&error.to_string()))),
        }
    }
    let [from, to] = &urls[..] else { usage("expected two networks") };
    if from.port == to.port {
        usage(&format!("{from} and {to}: the two networks need different ports"));
    }

    let passes = |bytes: &[u8]| {
        let named =
            |channels: &Pattern| matches!(Packet::parse(bytes), Ok(Packet::Short(m)) if channels.matches(&m.channel));
        channels.as_ref().is_none_or(named)
    };
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        signal_hook::flag::register(signal, Arc::clone(&stop)).unwrap();
    }
    let mut listener = Listener::open(from).unwrap();
    let mut relay = Relay::new(to.clone(), shares, seed);
    // Signals to the parent process that the relay receives.
    eprintln!("relaying {from} to {to}");
    let (mut taken, mut kernel_dropped) = (0, 0);
    while taken < count && !stop.load(Ordering::Relaxed) {
        match listener.receive().unwrap() {
            Some(datagram) if !passes(datagram.bytes) => kernel_dropped = datagram.kernel_dropped,
            Some(datagram) => {
                taken += 1;
                kernel_dropped = datagram.kernel_dropped;
                relay.datagram(datagram.sender, datagram.bytes).unwrap();
            }
            None => relay.flush().unwrap(),
        }
    }
    relay.flush().unwrap();
    // Datagrams that the kernel dropped are in no count of the relay.
    assert!(kernel_dropped == 0, "the relay was too slow: the kernel dropped {kernel_dropped} datagrams");
    println!("{}", serde_json::to_string(&relay.account()).unwrap());
}
