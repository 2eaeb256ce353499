//! Counts lost, duplicate and late messages per sender from the sequence numbers of LCM's datagrams.
//!
//! A sender numbers its messages over all channels, so a receiver of the whole multicast group knows exactly which are lost. A skipped
//! number is first *missing*: its message may still arrive out of order. After half a second it is *lost*.
//!
//! A sender that restarts on the same port starts at 0. The next number distinguishes a restart from a stray datagram, as in RTP
//! (RFC 3550, A.1); the content distinguishes it from a datagram that the network duplicated.

use std::collections::BTreeMap;
use std::net::SocketAddrV4;

/// Time after which a missing message is lost, ns.
const GRACE_NS: i64 = 500_000_000;
/// Number of recent messages per sender whose content hash is stored to detect duplicates.
const WINDOW: usize = 1024;
/// A larger jump of the sequence number means that the sender restarted.
const MAX_JUMP: i32 = 1 << 20;
/// Largest number of ranges of missing messages per sender; if there are more, the oldest is counted as lost.
const MAX_GAPS: usize = 256;
/// Largest number of listed ranges of lost messages per sender; the counts are always exact.
const MAX_LISTED: usize = 10_000;
/// Largest number of stored senders; if there are more, the one with the oldest last message is removed.
const MAX_SENDERS: usize = 1000;

/// A range of sequence numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub struct SequenceRange {
    /// First number.
    pub first: u32,
    /// Count.
    pub count: u32,
}

impl SequenceRange {
    fn holds(&self, sequence: u32) -> bool {
        sequence.wrapping_sub(self.first) < self.count
    }
}

/// Counts of one sender.
#[derive(Debug, Clone, Default, PartialEq, Eq, serde::Serialize)]
pub struct SenderCounts {
    /// Address and port.
    pub sender: String,
    /// Complete messages, without duplicates.
    pub received: u64,
    /// Messages that were not received, or not completely.
    pub lost: u64,
    /// Their sequence numbers, up to 10 000 ranges.
    pub lost_runs: Vec<SequenceRange>,
    /// Duplicate datagrams.
    pub duplicates: u64,
    /// Datagrams received after a later one.
    pub reordered: u64,
    /// Restarts of the sender.
    pub restarts: u64,
}

/// Findings about a sender, for EVENT texts.
#[derive(Debug, Default)]
pub struct Findings {
    /// Messages that were not received.
    pub lost: Vec<SequenceRange>,
    /// Incomplete messages: sequence number, received fragments, all fragments.
    pub incomplete: Vec<(u32, u16, u16)>,
    /// Messages with duplicate datagrams.
    pub duplicates: Vec<SequenceRange>,
    /// Messages with late datagrams.
    pub reordered: Vec<SequenceRange>,
    /// The sender restarted.
    pub restarted: bool,
}

/// Counts of all senders.
#[derive(Default)]
pub struct SenderTable {
    senders: BTreeMap<SocketAddrV4, Sender>,
    /// Sum of the senders that are no longer stored.
    removed: SenderCounts,
}

/// State of the message that a datagram belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Seen {
    /// No datagram of it was received before.
    New,
    /// No datagram of it was received before, but later messages were.
    Late,
    /// Some of its datagrams were received.
    Incomplete,
    /// It was complete already.
    Duplicate,
}

#[derive(Default)]
struct Sender {
    counts: SenderCounts,
    findings: Findings,
    /// Next expected number; `None` before the first message.
    next: Option<u32>,
    gaps: Vec<Gap>,
    window: Vec<Option<Known>>,
    /// Number that would confirm a restart of the sender.
    restart_next: Option<u32>,
    received_ns: i64,
}

struct Gap {
    run: SequenceRange,
    noticed_ns: i64,
}

/// A message in the window.
#[derive(Clone, Copy)]
struct Known {
    sequence: u32,
    /// Hash that distinguishes messages with the same number.
    mark: u64,
    progress: Progress,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Progress {
    Incomplete,
    Complete,
    Lost,
}

impl SenderTable {
    /// Enters a datagram of message `sequence`. `mark` is the same for all datagrams of one message and differs between messages.
    pub fn enter(&mut self, sender: SocketAddrV4, t_ns: i64, sequence: u32, mark: u64) -> Seen {
        if self.senders.len() >= MAX_SENDERS && !self.senders.contains_key(&sender) {
            self.remove_oldest();
        }
        let known = self.senders.entry(sender).or_insert_with(|| Sender::new(sender));
        known.received_ns = t_ns;
        known.enter(t_ns, sequence, mark)
    }

    /// Records that the message is complete.
    pub fn complete(&mut self, sender: SocketAddrV4, sequence: u32) {
        let Some(known) = self.senders.get_mut(&sender) else { return };
        known.counts.received += 1;
        if let Some(message) = known.known(sequence) {
            message.progress = Progress::Complete;
        }
    }

    /// Records a duplicate datagram.
    pub fn duplicate(&mut self, sender: SocketAddrV4, sequence: u32) {
        let Some(known) = self.senders.get_mut(&sender) else { return };
        known.counts.duplicates += 1;
        note(&mut known.findings.duplicates, sequence);
    }

    /// Records a datagram received after a later one.
    pub fn reordered(&mut self, sender: SocketAddrV4, sequence: u32) {
        let Some(known) = self.senders.get_mut(&sender) else { return };
        known.counts.reordered += 1;
        note(&mut known.findings.reordered, sequence);
    }

    /// Records that the message cannot become complete.
    pub fn incomplete(&mut self, sender: SocketAddrV4, sequence: u32, received: u16, count: u16) {
        let Some(known) = self.senders.get_mut(&sender) else { return };
        if let Some(message) = known.known(sequence) {
            if message.progress != Progress::Incomplete {
                return;
            }
            message.progress = Progress::Lost;
        }
        known.counts.lost += 1;
        name(&mut known.counts.lost_runs, SequenceRange { first: sequence, count: 1 });
        known.findings.incomplete.push((sequence, received, count));
    }

    /// Counts messages that are overdue at `now_ns` as lost.
    pub fn settle(&mut self, now_ns: i64) {
        for sender in self.senders.values_mut() {
            sender.settle(|gap| now_ns.saturating_sub(gap.noticed_ns) > GRACE_NS);
        }
    }

    /// Counts all missing messages as lost.
    pub fn settle_all(&mut self) {
        self.senders.values_mut().for_each(|sender| sender.settle(|_| true));
    }

    /// Findings since the last call, for each sender that has some.
    pub fn take_findings(&mut self) -> Vec<(SocketAddrV4, Findings)> {
        let take = |(address, sender): (&SocketAddrV4, &mut Sender)| (*address, std::mem::take(&mut sender.findings));
        self.senders.iter_mut().map(take).filter(|(_, findings)| !findings.is_empty()).collect()
    }

    /// Counts of each sender by address; the last entry, if any, sums the senders that are no longer stored.
    pub fn all_counts(&self) -> Vec<SenderCounts> {
        let removed = Some(&self.removed).filter(|counts| counts.received > 0);
        self.senders.values().map(|sender| &sender.counts).chain(removed).cloned().collect()
    }

    /// Counts of a sender.
    pub fn counts(&self, sender: SocketAddrV4) -> Option<&SenderCounts> {
        self.senders.get(&sender).map(|sender| &sender.counts)
    }

    /// Lost messages, duplicate datagrams and late datagrams of all senders.
    pub fn totals(&self) -> [u64; 3] {
        let accounts = self.senders.values().map(|sender| &sender.counts).chain([&self.removed]);
        accounts.fold([0; 3], |[l, d, r], a| [l + a.lost, d + a.duplicates, r + a.reordered])
    }

    /// Number of senders.
    pub fn len(&self) -> usize {
        self.senders.len()
    }

    fn remove_oldest(&mut self) {
        let oldest = self.senders.iter().min_by_key(|(_, sender)| sender.received_ns).map(|(address, _)| *address);
        if let Some(mut sender) = oldest.and_then(|address| self.senders.remove(&address)) {
            sender.settle(|_| true);
            let (sum, one) = (&mut self.removed, sender.counts);
            sum.sender = "others".to_owned();
            sum.received += one.received;
            sum.lost += one.lost;
            sum.duplicates += one.duplicates;
            sum.reordered += one.reordered;
            sum.restarts += one.restarts;
        }
    }
}

impl Findings {
    fn is_empty(&self) -> bool {
        let Findings { lost, incomplete, duplicates, reordered, restarted } = self;
        lost.is_empty() && incomplete.is_empty() && duplicates.is_empty() && reordered.is_empty() && !restarted
    }
}

impl Sender {
    fn new(address: SocketAddrV4) -> Self {
        let counts = SenderCounts { sender: address.to_string(), ..SenderCounts::default() };
        Sender { counts, window: vec![None; WINDOW], ..Sender::default() }
    }

    fn enter(&mut self, t_ns: i64, sequence: u32, mark: u64) -> Seen {
        let next = *self.next.get_or_insert(sequence);
        #[expect(
            clippy::cast_possible_wrap,
            reason = "numbers wrap around; the sign of the difference shows which is ahead"
        )]
        let ahead = sequence.wrapping_sub(next) as i32;
        if (0..MAX_JUMP).contains(&ahead) {
            if ahead > 0 {
                self.miss(SequenceRange { first: next, count: ahead as u32 }, t_ns);
            }
            self.begin(sequence, mark);
            self.next = Some(sequence.wrapping_add(1));
            return Seen::New;
        }
        match self.known(sequence).copied() {
            Some(known) if known.mark == mark && known.progress == Progress::Complete => return Seen::Duplicate,
            Some(known) if known.mark == mark => return Seen::Incomplete,
            _ => {}
        }
        if self.fill_gap(sequence) || self.recover_lost(sequence) {
            self.counts.reordered += 1;
            note(&mut self.findings.reordered, sequence);
            self.begin(sequence, mark);
            return Seen::Late;
        } else if self.restart_next == Some(sequence) {
            self.settle(|_| true);
            self.counts.restarts += 1;
            self.findings.restarted = true;
            self.next = Some(sequence.wrapping_add(1));
            self.restart_next = None;
        } else {
            self.restart_next = Some(sequence.wrapping_add(1));
        }
        self.begin(sequence, mark);
        Seen::New
    }

    fn known(&mut self, sequence: u32) -> Option<&mut Known> {
        self.window[sequence as usize % WINDOW].as_mut().filter(|known| known.sequence == sequence)
    }

    fn begin(&mut self, sequence: u32, mark: u64) {
        self.window[sequence as usize % WINDOW] = Some(Known { sequence, mark, progress: Progress::Incomplete });
    }

    fn miss(&mut self, run: SequenceRange, noticed_ns: i64) {
        self.gaps.push(Gap { run, noticed_ns });
        if self.gaps.len() > MAX_GAPS {
            let oldest = self.gaps.remove(0);
            self.lose(oldest.run);
        }
    }

    /// Removes a number from the gaps. Returns whether it was missing.
    fn fill_gap(&mut self, sequence: u32) -> bool {
        let Some(at) = self.gaps.iter().position(|gap| gap.run.holds(sequence)) else { return false };
        let noticed_ns = self.gaps[at].noticed_ns;
        let rest = without(self.gaps[at].run, sequence).map(|run| Gap { run, noticed_ns });
        self.gaps.splice(at..=at, rest);
        true
    }

    /// Removes a number from the lost ones if it was counted as lost too early.
    fn recover_lost(&mut self, sequence: u32) -> bool {
        let Some(at) = self.counts.lost_runs.iter().position(|run| run.holds(sequence)) else { return false };
        let rest = without(self.counts.lost_runs[at], sequence);
        self.counts.lost_runs.splice(at..=at, rest);
        self.counts.lost -= 1;
        true
    }

    fn settle(&mut self, is_lost: impl Fn(&Gap) -> bool) {
        for gap in self.gaps.extract_if(.., |gap| is_lost(gap)).collect::<Vec<_>>() {
            self.lose(gap.run);
        }
    }

    fn lose(&mut self, run: SequenceRange) {
        self.counts.lost += u64::from(run.count);
        name(&mut self.counts.lost_runs, run);
        self.findings.lost.push(run);
    }
}

/// A range without one of its numbers.
fn without(run: SequenceRange, sequence: u32) -> impl Iterator<Item = SequenceRange> {
    let before = sequence.wrapping_sub(run.first);
    let after = SequenceRange { first: sequence.wrapping_add(1), count: run.count - before - 1 };
    [SequenceRange { first: run.first, count: before }, after].into_iter().filter(|run| run.count > 0)
}

/// Adds a number to a list of ranges; extends the last range if it is adjacent.
fn note(runs: &mut Vec<SequenceRange>, sequence: u32) {
    match runs.last_mut() {
        Some(last) if last.first.wrapping_add(last.count) == sequence => last.count += 1,
        _ => runs.push(SequenceRange { first: sequence, count: 1 }),
    }
}

fn name(runs: &mut Vec<SequenceRange>, run: SequenceRange) {
    if runs.len() < MAX_LISTED {
        runs.push(run);
    }
}
