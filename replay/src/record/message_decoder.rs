//! Decodes datagrams into messages and counts lost, incomplete, duplicate and late ones.

use super::sender_counts::{Findings, Seen, SenderCounts, SenderTable, SequenceRange};
use crate::udpm::{Datagram, Fragment, Outcome, Packet, Reassembler, Short};
use lcmtypes::Event;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::net::SocketAddrV4;

/// liblcm sends this message to itself at the first subscription. It has a sequence number but contains no data.
const SELF_TEST: &str = "LCM_SELF_TEST";

/// Largest number of sequence ranges in one EVENT text.
const LISTED: usize = 40;

/// Decodes the datagrams of a network: call [`MessageDecoder::datagram`] for every one, and use the messages that it returns.
#[derive(Default)]
pub struct MessageDecoder {
    senders: SenderTable,
    reassembler: Reassembler,
    counts: ReceiveCounts,
    kernel_dropped_reported: u64,
    malformed: BTreeMap<&'static str, u64>,
}

/// Counts since the start.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
pub struct ReceiveCounts {
    /// Received messages of all channels.
    #[serde(rename = "heard")]
    pub received: u64,
    /// Their bytes.
    pub bytes: u64,
    /// Malformed datagrams.
    pub malformed: u64,
    /// Datagrams that the kernel dropped because the receive buffer was full; their messages count as lost.
    pub kernel_dropped: u64,
}

/// A complete message.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Message<'a> {
    /// Channel.
    pub channel: Cow<'a, str>,
    /// Encoded message.
    pub data: Cow<'a, [u8]>,
    /// At least one of its datagrams was received after a later message of the same sender.
    pub is_late: bool,
}

impl MessageDecoder {
    /// Takes a datagram. Returns the message that it contains or completes, except LCM's self test.
    pub fn datagram<'a>(&mut self, datagram: &Datagram<'a>) -> Option<Message<'a>> {
        let Datagram { sender, t_ns, kernel_dropped, bytes } = *datagram;
        self.counts.kernel_dropped = self.counts.kernel_dropped.max(kernel_dropped.into());
        let message = match Packet::parse(bytes) {
            Ok(Packet::Short(short)) => self.short(sender, t_ns, &short)?,
            Ok(Packet::Fragment(fragment)) => self.fragment(sender, t_ns, &fragment)?,
            Err(malformed) => {
                self.counts.malformed += 1;
                *self.malformed.entry(malformed.why).or_default() += 1;
                // It still uses a sequence number.
                if let Some(sequence) = malformed.sequence {
                    self.senders.enter(sender, t_ns, sequence, 0);
                }
                return None;
            }
        };
        self.counts.received += 1;
        self.counts.bytes += message.data.len() as u64;
        Some(message).filter(|message| message.channel != SELF_TEST)
    }

    fn short<'a>(&mut self, sender: SocketAddrV4, t_ns: i64, short: &Short<'a>) -> Option<Message<'a>> {
        let mark = mark(&(&*short.channel, short.data));
        let seen = self.senders.enter(sender, t_ns, short.sequence, mark);
        if seen == Seen::Duplicate {
            self.senders.duplicate(sender, short.sequence);
            return None;
        }
        self.senders.complete(sender, short.sequence);
        let (channel, data) = (short.channel.clone(), Cow::Borrowed(short.data));
        Some(Message { channel, data, is_late: seen == Seen::Late })
    }

    fn fragment<'a>(&mut self, sender: SocketAddrV4, t_ns: i64, fragment: &Fragment<'a>) -> Option<Message<'a>> {
        let sequence = fragment.sequence;
        let seen = self.senders.enter(sender, t_ns, sequence, mark(&(fragment.size, fragment.count)));
        if seen == Seen::Duplicate {
            self.senders.duplicate(sender, sequence);
            return None;
        }
        match self.reassembler.accept(sender, t_ns, fragment) {
            Outcome::Duplicate => self.senders.duplicate(sender, sequence),
            Outcome::Incomplete { reordered } => {
                if reordered {
                    self.senders.reordered(sender, sequence);
                }
            }
            Outcome::Complete { message, reordered } => {
                if reordered {
                    self.senders.reordered(sender, sequence);
                }
                self.senders.complete(sender, sequence);
                let (channel, data) = (Cow::Owned(message.channel), Cow::Owned(message.data));
                return Some(Message { channel, data, is_late: reordered || seen == Seen::Late });
            }
            Outcome::Contradictory => self.senders.incomplete(sender, sequence, fragment.count, fragment.count),
        }
        None
    }

    /// Counts messages that are overdue at `now_ns` as lost. Call it about once per second.
    pub fn settle(&mut self, now_ns: i64) {
        self.reassembler.expire(now_ns);
        self.senders.settle(now_ns);
        self.take_abandoned();
    }

    /// Gives up everything that has not come.
    pub fn settle_all(&mut self) {
        self.reassembler.clear();
        self.take_abandoned();
        self.senders.settle_all();
    }

    fn take_abandoned(&mut self) {
        for given_up in self.reassembler.abandoned() {
            self.senders.incomplete(given_up.sender, given_up.sequence, given_up.received, given_up.count);
        }
    }

    /// Received messages and datagrams.
    pub fn counts(&self) -> ReceiveCounts {
        self.counts
    }

    /// Lost messages, duplicate datagrams and late datagrams of all senders.
    pub fn totals(&self) -> [u64; 3] {
        self.senders.totals()
    }

    /// Number of senders.
    pub fn senders(&self) -> usize {
        self.senders.len()
    }

    /// Counts of a sender.
    pub fn sender_counts(&self, sender: SocketAddrV4) -> Option<&SenderCounts> {
        self.senders.counts(sender)
    }

    /// Counts of each sender by address; the last entry, if any, sums the senders that are no longer stored.
    pub fn all_counts(&self) -> Vec<SenderCounts> {
        self.senders.all_counts()
    }

    /// Findings since the last call: level and text of an EVENT. Losses are warnings, and nothing else is.
    pub fn take_events(&mut self) -> Vec<(i8, String)> {
        let mut events = Vec::new();
        for (sender, findings) in self.senders.take_findings() {
            events.extend(texts(&findings).into_iter().map(|(level, text)| (level, format!("{sender} {text}"))));
        }
        for (why, count) in std::mem::take(&mut self.malformed) {
            events.push((Event::LEVEL_INFO, format!("{count} malformed datagrams: {why}")));
        }
        let dropped = self.counts.kernel_dropped - self.kernel_dropped_reported;
        if dropped > 0 {
            self.kernel_dropped_reported = self.counts.kernel_dropped;
            let text = format!("the kernel dropped {dropped} datagrams: its receive buffer was full");
            events.push((Event::LEVEL_WARNING, text));
        }
        events
    }
}

/// Hash that distinguishes two messages with the same sequence number.
fn mark(content: &impl Hash) -> u64 {
    let mut hasher = DefaultHasher::new();
    content.hash(&mut hasher);
    hasher.finish()
}

/// EVENT texts of findings, without the sender's name.
fn texts(findings: &Findings) -> Vec<(i8, String)> {
    let Findings { lost, incomplete, duplicates, reordered, restarted } = findings;
    let mut texts = Vec::new();
    let mut add = |level, what: &str, runs: &[SequenceRange]| {
        if !runs.is_empty() {
            let count: u64 = runs.iter().map(|run| u64::from(run.count)).sum();
            texts.push((level, format!("{what} {count}: sequence {}", listed(runs))));
        }
    };
    add(Event::LEVEL_WARNING, "lost", lost);
    add(Event::LEVEL_INFO, "duplicate", duplicates);
    add(Event::LEVEL_INFO, "late", reordered);
    for (sequence, came, count) in incomplete {
        let text = format!("lost 1: sequence {sequence}, received {came} of {count} fragments");
        texts.push((Event::LEVEL_WARNING, text));
    }
    if *restarted {
        texts.push((Event::LEVEL_INFO, "restarted: sequence numbers start again".to_owned()));
    }
    texts
}

/// `17-19, 23`, and the number of ranges that are not listed.
fn listed(runs: &[SequenceRange]) -> String {
    let one = |run: &SequenceRange| match run.count {
        1 => run.first.to_string(),
        count => format!("{}-{}", run.first, run.first.wrapping_add(count - 1)),
    };
    let named: Vec<_> = runs.iter().take(LISTED).map(one).collect();
    let more = runs.len().saturating_sub(LISTED);
    if more == 0 { named.join(", ") } else { format!("{} and {more} more ranges", named.join(", ")) }
}
