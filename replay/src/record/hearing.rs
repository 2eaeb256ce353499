//! From datagrams to messages, and the account of those that never came or not as a whole.

use super::account::{Account, Accounts, Findings, Run, Seen};
use crate::udpm::{Datagram, Fragment, Outcome, Packet, Reassembler, Short};
use lcmtypes::Event;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::net::SocketAddrV4;

/// liblcm asks itself this when somebody subscribes; it belongs to nobody's data, though it counts in the sequence.
const SELF_TEST: &str = "LCM_SELF_TEST";

/// Stretches of messages that one sentence names.
const NAMED: usize = 40;

/// Hears a network: who listens hands over every datagram and is given the messages.
#[derive(Default)]
pub struct Hearing {
    accounts: Accounts,
    reassembler: Reassembler,
    tally: Tally,
    kernel_dropped_said: u64,
    malformed: BTreeMap<&'static str, u64>,
}

/// Counts that only grow.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
pub struct Tally {
    /// Messages heard, whether wanted or not.
    pub heard: u64,
    /// Bytes of them.
    pub bytes: u64,
    /// Datagrams that no LCM sends.
    pub malformed: u64,
    /// Datagrams that the kernel dropped because nobody fetched them in time; what was in them is among the lost.
    pub kernel_dropped: u64,
}

/// A whole message.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Message<'a> {
    /// Channel.
    pub channel: Cow<'a, str>,
    /// The message.
    pub data: Cow<'a, [u8]>,
    /// It, or a part of it, came after a later one of its sender.
    pub is_late: bool,
}

impl Hearing {
    /// Takes a datagram; the message that it is or completes, if it is one for others.
    pub fn datagram<'a>(&mut self, datagram: &Datagram<'a>) -> Option<Message<'a>> {
        let Datagram { sender, t_ns, kernel_dropped, bytes } = *datagram;
        self.tally.kernel_dropped = self.tally.kernel_dropped.max(kernel_dropped.into());
        let message = match Packet::parse(bytes) {
            Ok(Packet::Short(short)) => self.short(sender, t_ns, &short)?,
            Ok(Packet::Fragment(fragment)) => self.fragment(sender, t_ns, &fragment)?,
            Err(malformed) => {
                self.tally.malformed += 1;
                *self.malformed.entry(malformed.why).or_default() += 1;
                // Its number is used up all the same.
                if let Some(sequence) = malformed.sequence {
                    self.accounts.enter(sender, t_ns, sequence, 0);
                }
                return None;
            }
        };
        self.tally.heard += 1;
        self.tally.bytes += message.data.len() as u64;
        Some(message).filter(|message| message.channel != SELF_TEST)
    }

    fn short<'a>(&mut self, sender: SocketAddrV4, t_ns: i64, short: &Short<'a>) -> Option<Message<'a>> {
        let mark = mark(&(short.channel, short.data));
        let seen = self.accounts.enter(sender, t_ns, short.sequence, mark);
        if seen == Seen::Duplicate {
            self.accounts.duplicate(sender, short.sequence);
            return None;
        }
        self.accounts.whole(sender, short.sequence);
        let (channel, data) = (Cow::Borrowed(short.channel), Cow::Borrowed(short.data));
        Some(Message { channel, data, is_late: seen == Seen::Late })
    }

    fn fragment<'a>(&mut self, sender: SocketAddrV4, t_ns: i64, fragment: &Fragment<'a>) -> Option<Message<'a>> {
        let sequence = fragment.sequence;
        let seen = self.accounts.enter(sender, t_ns, sequence, mark(&(fragment.size, fragment.count)));
        if seen == Seen::Duplicate {
            self.accounts.duplicate(sender, sequence);
            return None;
        }
        match self.reassembler.accept(sender, t_ns, fragment) {
            Outcome::Duplicate => self.accounts.duplicate(sender, sequence),
            Outcome::Incomplete { reordered } => {
                if reordered {
                    self.accounts.reordered(sender, sequence);
                }
            }
            Outcome::Complete { message, reordered } => {
                if reordered {
                    self.accounts.reordered(sender, sequence);
                }
                self.accounts.whole(sender, sequence);
                let (channel, data) = (Cow::Owned(message.channel), Cow::Owned(message.data));
                return Some(Message { channel, data, is_late: reordered || seen == Seen::Late });
            }
            Outcome::Contradictory => self.accounts.incomplete(sender, sequence, fragment.count, fragment.count),
        }
        None
    }

    /// Gives up what is too late at `now_ns`: to be called about once a second.
    pub fn settle(&mut self, now_ns: i64) {
        self.reassembler.expire(now_ns);
        self.accounts.settle(now_ns);
        self.take_abandoned();
    }

    /// Gives up everything that has not come.
    pub fn settle_all(&mut self) {
        self.reassembler.clear();
        self.take_abandoned();
        self.accounts.settle_all();
    }

    fn take_abandoned(&mut self) {
        for given_up in self.reassembler.abandoned() {
            self.accounts.incomplete(given_up.sender, given_up.sequence, given_up.received, given_up.count);
        }
    }

    /// What was heard.
    pub fn tally(&self) -> Tally {
        self.tally
    }

    /// Messages lost, datagrams that came again, datagrams that came late: of all senders.
    pub fn totals(&self) -> [u64; 3] {
        self.accounts.totals()
    }

    /// How many senders have been heard.
    pub fn senders(&self) -> usize {
        self.accounts.senders()
    }

    /// The account of a sender that is remembered.
    pub fn account(&self, sender: SocketAddrV4) -> Option<&Account> {
        self.accounts.account(sender)
    }

    /// The accounts, by address; last, if there is one, that of all who were forgotten.
    pub fn accounts(&self) -> Vec<Account> {
        self.accounts.accounts()
    }

    /// What was found since this was last asked: level of the EVENT, and a sentence.
    pub fn news(&mut self) -> Vec<(i8, String)> {
        let mut news = Vec::new();
        for (sender, findings) in self.accounts.findings() {
            news.extend(sentences(&findings).into_iter().map(|(level, text)| (level, format!("{sender} {text}"))));
        }
        for (why, count) in std::mem::take(&mut self.malformed) {
            news.push((Event::LEVEL_WARNING, format!("{count} datagrams that no LCM sends: {why}")));
        }
        let dropped = self.tally.kernel_dropped - self.kernel_dropped_said;
        if dropped > 0 {
            self.kernel_dropped_said = self.tally.kernel_dropped;
            let text = format!("the kernel dropped {dropped} datagrams: its receive buffer was full");
            news.push((Event::LEVEL_WARNING, text));
        }
        news
    }
}

/// What tells two messages of one number apart.
fn mark(content: &impl Hash) -> u64 {
    let mut hasher = DefaultHasher::new();
    content.hash(&mut hasher);
    hasher.finish()
}

/// Findings as sentences that follow the sender's name.
fn sentences(findings: &Findings) -> Vec<(i8, String)> {
    let Findings { lost, incomplete, duplicates, reordered, restarted } = findings;
    let mut sentences = Vec::new();
    let mut say = |level, what: &str, runs: &[Run]| {
        if !runs.is_empty() {
            let count: u64 = runs.iter().map(|run| u64::from(run.count)).sum();
            sentences.push((level, format!("{what} {count}: sequence {}", listed(runs))));
        }
    };
    say(Event::LEVEL_WARNING, "lost", lost);
    say(Event::LEVEL_INFO, "came again", duplicates);
    say(Event::LEVEL_INFO, "came late", reordered);
    for (sequence, came, count) in incomplete {
        let text = format!("lost 1: sequence {sequence}, of which {came} of {count} fragments came");
        sentences.push((Event::LEVEL_WARNING, text));
    }
    if *restarted {
        sentences.push((Event::LEVEL_WARNING, "began anew".to_owned()));
    }
    sentences
}

/// `17-19, 23`, and how many more stretches there are.
fn listed(runs: &[Run]) -> String {
    let one = |run: &Run| match run.count {
        1 => run.first.to_string(),
        count => format!("{}-{}", run.first, run.first.wrapping_add(count - 1)),
    };
    let named: Vec<_> = runs.iter().take(NAMED).map(one).collect();
    let more = runs.len().saturating_sub(NAMED);
    if more == 0 { named.join(", ") } else { format!("{} and {more} stretches more", named.join(", ")) }
}
