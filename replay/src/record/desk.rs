//! From datagrams to events: what is whole goes into the log, what is missing is said there.

use super::account::{Account, Accounts, Findings, Run, Seen};
use super::pattern::Filter;
use super::ring::{EventSink, RingWriter};
use super::shed::Keep;
use crate::Error;
use crate::udpm::{Datagram, Fragment, Outcome, Packet, Reassembler, Short};
use lcmtypes::Event;
use std::collections::BTreeMap;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::net::SocketAddrV4;

/// liblcm asks itself this when somebody subscribes; it belongs to nobody's data, though it counts in the sequence.
const SELF_TEST: &str = "LCM_SELF_TEST";

/// How often findings go into the log, ns.
const REPORT_NS: i64 = 1_000_000_000;

/// Stretches of messages that one sentence names.
const NAMED: usize = 40;

/// Sorts what was heard.
pub struct Desk {
    filter: Filter,
    writer: RingWriter,
    accounts: Accounts,
    reassembler: Reassembler,
    tally: Tally,
    kernel_dropped: u32,
    kernel_dropped_said: u32,
    malformed: BTreeMap<&'static str, u64>,
    now_ns: i64,
    reported_ns: i64,
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

/// How a recording goes.
#[derive(Debug, Clone, PartialEq)]
pub struct Status {
    /// What was heard.
    pub tally: Tally,
    /// Messages lost, datagrams that came again, datagrams that came late.
    pub lost_twice_late: [u64; 3],
    /// Senders heard.
    pub senders: usize,
    /// What is recorded now.
    pub keep: Keep,
    /// Part of the ring before the disk that is in use, 0 to 1.
    pub fill: f64,
    /// Messages that were left out.
    pub left_out: u64,
}

/// How a recording went.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Heard {
    /// Events in the log, with those of the recorder itself; `None` if it could not be completed.
    pub events: Option<u64>,
    /// Why it could not: it then ends where the disk took no more.
    pub failure: Option<String>,
    /// What was heard.
    #[serde(flatten)]
    pub tally: Tally,
    /// Messages lost on the way to the recorder.
    pub lost: u64,
    /// Datagrams that came again.
    pub duplicates: u64,
    /// Datagrams that came after a later one.
    pub reordered: u64,
    /// Messages that came and were left out, by channel.
    pub left_out: BTreeMap<String, u64>,
    /// Account of each sender.
    pub senders: Vec<Account>,
}

impl Desk {
    /// Hands what passes the filter to `writer`.
    pub fn new(filter: Filter, writer: RingWriter) -> Self {
        Desk {
            filter,
            writer,
            accounts: Accounts::default(),
            reassembler: Reassembler::default(),
            tally: Tally::default(),
            kernel_dropped: 0,
            kernel_dropped_said: 0,
            malformed: BTreeMap::new(),
            now_ns: 0,
            reported_ns: 0,
        }
    }

    /// Takes a datagram.
    ///
    /// # Errors
    /// [`Error::WriterFailed`] once the log cannot be written any more.
    pub fn datagram(&mut self, datagram: &Datagram) -> Result<(), Error> {
        let Datagram { sender, t_ns, kernel_dropped, bytes } = *datagram;
        self.now_ns = t_ns;
        self.kernel_dropped = self.kernel_dropped.max(kernel_dropped);
        self.tally.kernel_dropped = self.kernel_dropped.into();
        match Packet::parse(bytes) {
            Ok(Packet::Short(short)) => self.short(sender, t_ns, &short),
            Ok(Packet::Fragment(fragment)) => self.fragment(sender, t_ns, &fragment),
            Err(malformed) => {
                self.tally.malformed += 1;
                *self.malformed.entry(malformed.why).or_default() += 1;
                // Its number is used up all the same.
                if let Some(sequence) = malformed.sequence {
                    self.accounts.enter(sender, t_ns, sequence, 0);
                }
                Ok(())
            }
        }
    }

    fn short(&mut self, sender: SocketAddrV4, t_ns: i64, short: &Short) -> Result<(), Error> {
        let mark = mark(&(short.channel, short.data));
        if self.accounts.enter(sender, t_ns, short.sequence, mark) == Seen::Duplicate {
            self.accounts.duplicate(sender, short.sequence);
            return Ok(());
        }
        self.accounts.whole(sender, short.sequence);
        self.message(t_ns, short.channel, short.data)
    }

    fn fragment(&mut self, sender: SocketAddrV4, t_ns: i64, fragment: &Fragment) -> Result<(), Error> {
        let sequence = fragment.sequence;
        let seen = self.accounts.enter(sender, t_ns, sequence, mark(&(fragment.size, fragment.count)));
        if seen == Seen::Duplicate {
            self.accounts.duplicate(sender, sequence);
            return Ok(());
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
                self.message(t_ns, &message.channel, &message.data)?;
            }
            Outcome::Contradictory => self.accounts.incomplete(sender, sequence, fragment.count, fragment.count),
        }
        Ok(())
    }

    fn message(&mut self, t_ns: i64, channel: &str, data: &[u8]) -> Result<(), Error> {
        self.tally.heard += 1;
        self.tally.bytes += data.len() as u64;
        if channel == SELF_TEST || !self.filter.takes(channel) {
            return Ok(());
        }
        self.writer.write(channel, t_ns, data)
    }

    /// To be called a few times a second, whether anything came or not: gives up waiting for what is too late, and says in the log what
    /// was found.
    ///
    /// # Errors
    /// As [`Desk::datagram`].
    pub fn look_up(&mut self, now_ns: i64) -> Result<(), Error> {
        self.now_ns = self.now_ns.max(now_ns);
        if now_ns - self.reported_ns < REPORT_NS {
            return Ok(());
        }
        self.reported_ns = now_ns;
        self.reassembler.expire(now_ns);
        self.accounts.settle(now_ns);
        self.report()
    }

    /// What the free space on the disk allows from now on.
    pub fn set_disk(&mut self, keep: Keep) {
        self.writer.set_disk(keep);
    }

    /// How it goes.
    pub fn status(&self) -> Status {
        Status {
            tally: self.tally,
            lost_twice_late: self.accounts.totals(),
            senders: self.accounts.senders(),
            keep: self.writer.keep(),
            fill: self.writer.fill(),
            left_out: self.writer.left_out_total(),
        }
    }

    /// Says the rest and the sum in the log, and completes it.
    pub fn finish(mut self) -> Heard {
        self.reassembler.clear();
        let said = self.settle_and_sum_up();
        let [lost, duplicates, reordered] = self.accounts.totals();
        let left_out = self.writer.left_out();
        // A writer that has failed refuses to say anything more; its own error is the one that tells why.
        let written = self.writer.finish().and_then(|events| said.map(|()| events));
        let (events, failure) = match written {
            Ok(events) => (Some(events), None),
            Err(error) => (None, Some(error.to_string())),
        };
        let senders = self.accounts.accounts();
        Heard { events, failure, tally: self.tally, lost, duplicates, reordered, left_out, senders }
    }

    fn settle_and_sum_up(&mut self) -> Result<(), Error> {
        self.take_abandoned();
        self.accounts.settle_all();
        self.report()?;
        let [lost, twice, late] = self.accounts.totals();
        let left_out = self.writer.left_out_total();
        let text = format!(
            "end of the recording: {} messages heard of {} senders; lost {lost}, came again {twice}, came late {late}, \
             dropped by the kernel {}, malformed {}, left out {left_out}",
            self.tally.heard,
            self.accounts.senders(),
            self.tally.kernel_dropped,
            self.tally.malformed
        );
        let level = if lost + left_out > 0 { Event::LEVEL_WARNING } else { Event::LEVEL_INFO };
        self.writer.say(self.now_ns, level, text)
    }

    fn take_abandoned(&mut self) {
        for given_up in self.reassembler.abandoned() {
            self.accounts.incomplete(given_up.sender, given_up.sequence, given_up.came, given_up.count);
        }
    }

    fn report(&mut self) -> Result<(), Error> {
        self.take_abandoned();
        for (sender, findings) in self.accounts.findings() {
            for (level, text) in sentences(&findings) {
                self.writer.say(self.now_ns, level, format!("{sender} {text}"))?;
            }
        }
        for (why, count) in std::mem::take(&mut self.malformed) {
            let text = format!("{count} datagrams that no LCM sends: {why}");
            self.writer.say(self.now_ns, Event::LEVEL_WARNING, text)?;
        }
        let dropped = self.kernel_dropped - self.kernel_dropped_said;
        if dropped > 0 {
            self.kernel_dropped_said = self.kernel_dropped;
            let text = format!("the kernel dropped {dropped} datagrams: its receive buffer was full");
            self.writer.say(self.now_ns, Event::LEVEL_WARNING, text)?;
        }
        Ok(())
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
