//! Multicast test between two machines: one sends numbered messages, the other counts those received.
//!
//! Each message contains the sender's run, its number and the total. Every hundredth is longer than a datagram. The end is sent
//! several times, so that the listener knows the total.

use super::network::CHANNEL;
use crate::{note, say, say_json};
use anyhow::Context;
use replay::udpm::{Listener, Outcome, Packet, Reassembler, Url, split};
use serde::Serialize;
use std::net::{Ipv4Addr, SocketAddrV4, UdpSocket};
use std::time::{Duration, Instant};

/// Size of a message, bytes, and additional bytes of every [`LONG_EVERY`]th.
const SHORT: usize = 400;
const LONG: usize = 100_000;
const LONG_EVERY: u64 = 100;
/// Number of end messages.
const ENDS: u32 = 20;

/// The two sides.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Side {
    /// Send numbered messages
    Send,
    /// Count them
    Listen,
}

/// Header of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Head {
    /// Identifies the run of the sender.
    run: u64,
    /// Number from 0; `total` marks the end.
    number: u64,
    /// Number of messages in the run.
    total: u64,
}

impl Head {
    fn bytes(self) -> [u8; 24] {
        let mut bytes = [0; 24];
        for (slot, word) in bytes.chunks_exact_mut(8).zip([self.run, self.number, self.total]) {
            slot.copy_from_slice(&word.to_be_bytes());
        }
        bytes
    }

    fn of(data: &[u8]) -> Option<Self> {
        let word = |at: usize| data.get(at..)?.first_chunk().map(|bytes| u64::from_be_bytes(*bytes));
        let (run, number, total) = (word(0)?, word(8)?, word(16)?);
        // Limit the memory that a foreign message can request.
        (total <= 100_000_000 && number <= total).then_some(Head { run, number, total })
    }

    fn is_long(self) -> bool {
        self.number % LONG_EVERY == LONG_EVERY - 1
    }

    fn message(self) -> Vec<u8> {
        let mut data = self.bytes().to_vec();
        data.resize(if self.is_long() { SHORT + LONG } else { SHORT }, 0x5a);
        data
    }
}

pub fn run(side: Side, url: &Url, seconds: f64, rate: f64, json: bool) -> anyhow::Result<crate::Outcome> {
    anyhow::ensure!((0.1..=86_400.0).contains(&seconds), "--seconds {seconds}: expected 0.1 to 86400");
    anyhow::ensure!((1.0..=20_000.0).contains(&rate), "--rate {rate}: expected 1 to 20000");
    if url.ttl == 0 {
        note(format!(
            "warning: {url} stays on this machine; for another one: --lcm-url 'udpm://{}:{}?ttl=1'",
            url.group, url.port
        ));
    }
    match side {
        Side::Send => send(url, seconds, rate),
        Side::Listen => listen(url, Duration::from_secs_f64(seconds), json),
    }
}

fn send(url: &Url, seconds: f64, rate: f64) -> anyhow::Result<crate::Outcome> {
    let to = SocketAddrV4::new(url.group, url.port);
    let socket = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0)).context("socket")?;
    socket.set_multicast_ttl_v4(u32::from(url.ttl)).context("IP_MULTICAST_TTL")?;
    let period = Duration::from_secs_f64(1.0 / rate);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked to be at most 86400 x 20000")]
    let total = (seconds * rate).ceil() as u64;
    let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap_or_default();
    let run = u64::from(std::process::id()) << 32 | u64::from(since.subsec_nanos());
    let (began, mut sequence) = (Instant::now(), 0);
    let mut send_message = |head: Head| -> anyhow::Result<()> {
        for datagram in split(sequence, CHANNEL, &head.message()) {
            socket.send_to(&datagram, to).with_context(|| format!("{to}: run hoof doctor to find the cause"))?;
        }
        sequence = sequence.wrapping_add(1);
        Ok(())
    };
    for number in 0..total {
        let due = period.mul_f64(number as f64);
        std::thread::sleep(due.saturating_sub(began.elapsed()));
        send_message(Head { run, number, total })?;
    }
    for _ in 0..ENDS {
        std::thread::sleep(Duration::from_millis(10));
        send_message(Head { run, number: total, total })?;
    }
    say(format!("sent {total} messages in {:.1} s; the listener prints the result", began.elapsed().as_secs_f64()))?;
    Ok(crate::Outcome::Good)
}

/// Received and lost messages of one run; the JSON of `--json`.
#[derive(Debug, Default, PartialEq, Eq, Serialize)]
struct Count {
    sender: Option<SocketAddrV4>,
    sent: u64,
    lost: u64,
    sent_long: u64,
    lost_long: u64,
    came_again: u64,
    came_late: u64,
}

/// Counts the messages of the first sender that is received.
#[derive(Default)]
struct Counter {
    run: u64,
    came: Vec<bool>,
    highest: Option<u64>,
    count: Count,
}

impl Counter {
    /// Counts a message. Returns whether it is the end.
    fn take(&mut self, sender: SocketAddrV4, head: Head) -> bool {
        if self.count.sender.is_none() {
            (self.count.sender, self.run) = (Some(sender), head.run);
            self.came = vec![false; usize::try_from(head.total).unwrap_or(0)];
        }
        if head.run != self.run {
            return false;
        }
        let Some(slot) = usize::try_from(head.number).ok().and_then(|number| self.came.get_mut(number)) else {
            return head.number == head.total;
        };
        self.count.came_again += u64::from(std::mem::replace(slot, true));
        self.count.came_late += u64::from(self.highest.is_some_and(|highest| head.number < highest));
        self.highest = self.highest.max(Some(head.number));
        false
    }

    /// Compares the received messages with the total.
    fn finish(mut self) -> Count {
        for (number, came) in (0..).zip(&self.came) {
            let is_long = Head { run: 0, number, total: 0 }.is_long();
            let (sent, lost) = if is_long {
                (&mut self.count.sent_long, &mut self.count.lost_long)
            } else {
                (&mut self.count.sent, &mut self.count.lost)
            };
            *sent += 1;
            *lost += u64::from(!came);
        }
        self.count
    }
}

fn listen(url: &Url, timeout: Duration, json: bool) -> anyhow::Result<crate::Outcome> {
    let mut listener = Listener::open(url)?;
    if let Some(warning) = listener.warning() {
        note(format!("warning: {warning}"));
    }
    note(format!("listening to {url}; run on the other machine: hoof doctor --between send --lcm-url '{url}'"));
    let (mut counter, mut reassembler) = (Counter::default(), Reassembler::default());
    let mut last = Instant::now();
    // After the first message a short timeout suffices: the sender has finished, or the network has failed.
    while last.elapsed() < if counter.count.sender.is_some() { Duration::from_secs(3) } else { timeout } {
        let Some(datagram) = listener.receive().context("socket")? else { continue };
        let head = match Packet::parse(datagram.bytes) {
            Ok(Packet::Short(message)) if message.channel == CHANNEL => Head::of(message.data),
            Ok(Packet::Fragment(fragment)) => match reassembler.accept(datagram.sender, datagram.t_ns, &fragment) {
                Outcome::Complete { message, .. } if message.channel == CHANNEL => Head::of(&message.data),
                _ => None,
            },
            _ => None,
        };
        let Some(head) = head else { continue };
        last = Instant::now();
        if counter.take(datagram.sender, head) {
            break;
        }
    }
    let count = counter.finish();
    if json {
        say_json(&count)?;
    } else {
        say(text(&count, url))?;
    }
    Ok(crate::Outcome::failed_if(count.sender.is_none() || count.lost + count.lost_long > 0))
}

fn text(count: &Count, url: &Url) -> String {
    let Count { sender: Some(sender), sent, lost, sent_long, lost_long, came_again, came_late } = count else {
        return format!(
            "FAIL  no message received. On the sender: hoof doctor --lcm-url '{url}' (route, ttl). Here: check the firewall with hoof doctor, and run\n      \
             tcpdump -ni INTERFACE 'host {} or igmp'\n      \
             If tcpdump shows datagrams, a filter drops them. If not, a switch with IGMP snooping and without a querier drops\n      \
             them: disable snooping or enable a querier, see docs/multicast.md",
            url.group
        );
    };
    let word = if lost + lost_long == 0 { "OK   " } else { "FAIL " };
    format!(
        "{word} from {sender}: lost {lost} of {sent} short and {lost_long} of {sent_long} long messages; {came_again} duplicate, {came_late} late"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sender() -> SocketAddrV4 {
        SocketAddrV4::new(Ipv4Addr::new(10, 0, 0, 7), 4000)
    }

    #[test]
    fn headers_are_parsed_and_garbage_is_rejected() {
        let head = Head { run: 9, number: 99, total: 200 };
        assert_eq!(Head::of(&head.message()), Some(head));
        assert_eq!(head.message().len(), SHORT + LONG);
        assert_eq!(Head { number: 100, ..head }.message().len(), SHORT);
        assert_eq!(Head::of(b"garbage"), None);
        assert_eq!(Head::of(&Head { run: 1, number: 5, total: 4 }.bytes()), None);
        assert_eq!(Head::of(&Head { run: 1, number: 5, total: u64::MAX }.bytes()), None);
    }

    #[test]
    fn lost_late_and_duplicate_messages_are_counted() {
        let (total, mut counter) = (250, Counter::default());
        let order = (0..total).filter(|n| ![3, 99, 249].contains(n)).chain([100, 99]);
        for number in order {
            assert!(!counter.take(sender(), Head { run: 1, number, total }));
            counter.take(sender(), Head { run: 2, number: 3, total });
        }
        assert!(counter.take(sender(), Head { run: 1, number: total, total }));
        let count = counter.finish();
        let wanted = Count {
            sender: Some(sender()),
            sent: 248,
            lost: 2,
            sent_long: 2,
            lost_long: 0,
            came_again: 1,
            came_late: 2,
        };
        assert_eq!(count, wanted);
        let text = text(&count, &Url::default());
        let numbers: Vec<u64> = text.split(' ').filter_map(|word| word.parse().ok()).collect();
        assert!(
            text.starts_with("FAIL") && text.contains("10.0.0.7:4000") && numbers == [2, 248, 0, 2, 1, 2],
            "{text}"
        );
    }

    #[test]
    fn no_message_is_a_failure_with_advice() {
        let text = text(&Counter::default().finish(), &Url::default());
        assert!(text.starts_with("FAIL") && text.contains("IGMP snooping") && text.contains("tcpdump"), "{text}");
    }
}
