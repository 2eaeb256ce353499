//! Who sent what never came: an account per sender, from the sequence numbers of LCM's datagrams.
//!
//! A sender counts its messages over all channels, so whoever hears the whole group knows exactly which did not come. A number that is
//! skipped is *missing* at first: it may still come, out of order. It is *lost* when it is more than half a second old.
//!
//! A sender that starts anew on the same port begins at 0. It is told from a stray by the number that follows it, as RTP does
//! (RFC 3550, A.1), and from a datagram that the network doubled by its content.

use std::collections::BTreeMap;
use std::net::SocketAddrV4;

/// How long a missing message may still come, ns.
const GRACE_NS: i64 = 500_000_000;
/// Messages of a sender whose content is remembered, to know a duplicate.
const WINDOW: usize = 1024;
/// A jump ahead further than this is a sender that began anew.
const MAX_JUMP: i32 = 1 << 20;
/// Stretches of missing messages that are waited for, for each sender; beyond, the oldest is lost.
const MAX_GAPS: usize = 256;
/// Stretches of lost messages that are named in the end, for each sender; the numbers are exact in any case.
const MAX_NAMED: usize = 10_000;
/// Senders that are remembered; beyond, the one silent for longest is forgotten.
const MAX_SENDERS: usize = 1000;

/// Messages in sequence.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub struct Run {
    /// Number of the first.
    pub first: u32,
    /// How many there are.
    pub count: u32,
}

impl Run {
    fn holds(&self, sequence: u32) -> bool {
        sequence.wrapping_sub(self.first) < self.count
    }
}

/// One sender's totals.
#[derive(Debug, Clone, Default, PartialEq, Eq, serde::Serialize)]
pub struct Account {
    /// Address and port.
    pub sender: String,
    /// Messages that came, each once.
    pub received: u64,
    /// Messages that never came, or not as a whole.
    pub lost: u64,
    /// Which ones, as far as they can be listed.
    pub lost_runs: Vec<Run>,
    /// Datagrams that came again.
    pub duplicates: u64,
    /// Datagrams that came after a later one.
    pub reordered: u64,
    /// Times that it began anew.
    pub restarts: u64,
}

/// What a person is told of a sender.
#[derive(Debug, Default)]
pub struct Findings {
    /// Messages that never came.
    pub lost: Vec<Run>,
    /// Messages of which not every fragment came: number, fragments that came, fragments there are.
    pub incomplete: Vec<(u32, u16, u16)>,
    /// Messages of which something came again.
    pub duplicates: Vec<Run>,
    /// Messages of which something came late.
    pub reordered: Vec<Run>,
    /// It began anew.
    pub restarted: bool,
}

/// Accounts of all senders.
#[derive(Default)]
pub struct Accounts {
    senders: BTreeMap<SocketAddrV4, Sender>,
    /// Totals of senders that are no longer remembered.
    forgotten: Account,
}

/// What is known of a datagram's message from the account alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Seen {
    /// Nothing of it had come before.
    New,
    /// Nothing of it had come before, but later ones had.
    Late,
    /// A part of it has come, and it is not whole yet.
    Begun,
    /// It had come already.
    Duplicate,
}

#[derive(Default)]
struct Sender {
    account: Account,
    findings: Findings,
    /// The number expected next; `None` before the first.
    next: Option<u32>,
    gaps: Vec<Gap>,
    window: Vec<Option<Known>>,
    /// The number that would prove that the sender began anew.
    anew: Option<u32>,
    heard_ns: i64,
}

struct Gap {
    run: Run,
    noticed_ns: i64,
}

/// A message in the window.
#[derive(Clone, Copy)]
struct Known {
    sequence: u32,
    /// Tells messages of one number apart.
    mark: u64,
    progress: Progress,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Progress {
    Begun,
    Whole,
    GivenUp,
}

impl Accounts {
    /// Enters a datagram of message `sequence`. `mark` is the same for all datagrams of one message and differs between messages.
    pub fn enter(&mut self, sender: SocketAddrV4, t_ns: i64, sequence: u32, mark: u64) -> Seen {
        if self.senders.len() >= MAX_SENDERS && !self.senders.contains_key(&sender) {
            self.forget_one();
        }
        let known = self.senders.entry(sender).or_insert_with(|| Sender::new(sender));
        known.heard_ns = t_ns;
        known.enter(t_ns, sequence, mark)
    }

    /// The message is whole.
    pub fn whole(&mut self, sender: SocketAddrV4, sequence: u32) {
        let Some(known) = self.senders.get_mut(&sender) else { return };
        known.account.received += 1;
        if let Some(message) = known.known(sequence) {
            message.progress = Progress::Whole;
        }
    }

    /// A datagram came again.
    pub fn duplicate(&mut self, sender: SocketAddrV4, sequence: u32) {
        let Some(known) = self.senders.get_mut(&sender) else { return };
        known.account.duplicates += 1;
        note(&mut known.findings.duplicates, sequence);
    }

    /// A datagram came after a later one.
    pub fn reordered(&mut self, sender: SocketAddrV4, sequence: u32) {
        let Some(known) = self.senders.get_mut(&sender) else { return };
        known.account.reordered += 1;
        note(&mut known.findings.reordered, sequence);
    }

    /// The message will never be whole.
    pub fn incomplete(&mut self, sender: SocketAddrV4, sequence: u32, came: u16, count: u16) {
        let Some(known) = self.senders.get_mut(&sender) else { return };
        if let Some(message) = known.known(sequence) {
            if message.progress != Progress::Begun {
                return;
            }
            message.progress = Progress::GivenUp;
        }
        known.account.lost += 1;
        name(&mut known.account.lost_runs, Run { first: sequence, count: 1 });
        known.findings.incomplete.push((sequence, came, count));
    }

    /// Declares lost what has been missing for too long at `now_ns`.
    pub fn settle(&mut self, now_ns: i64) {
        for sender in self.senders.values_mut() {
            sender.settle(|gap| now_ns.saturating_sub(gap.noticed_ns) > GRACE_NS);
        }
    }

    /// Declares lost all that is missing.
    pub fn settle_all(&mut self) {
        self.senders.values_mut().for_each(|sender| sender.settle(|_| true));
    }

    /// What has been found since this was last asked, for each sender of whom there is something.
    pub fn findings(&mut self) -> Vec<(SocketAddrV4, Findings)> {
        let take = |(address, sender): (&SocketAddrV4, &mut Sender)| (*address, std::mem::take(&mut sender.findings));
        self.senders.iter_mut().map(take).filter(|(_, findings)| !findings.is_empty()).collect()
    }

    /// The accounts, by address; last, if there is one, that of all who were forgotten.
    pub fn accounts(&self) -> Vec<Account> {
        let forgotten = Some(&self.forgotten).filter(|account| account.received > 0);
        self.senders.values().map(|sender| &sender.account).chain(forgotten).cloned().collect()
    }

    /// The account of a sender that is remembered.
    pub fn account(&self, sender: SocketAddrV4) -> Option<&Account> {
        self.senders.get(&sender).map(|sender| &sender.account)
    }

    /// Messages lost, datagrams that came again, datagrams that came late: of all senders.
    pub fn totals(&self) -> [u64; 3] {
        let accounts = self.senders.values().map(|sender| &sender.account).chain([&self.forgotten]);
        accounts.fold([0; 3], |[l, d, r], a| [l + a.lost, d + a.duplicates, r + a.reordered])
    }

    /// How many senders have been heard.
    pub fn senders(&self) -> usize {
        self.senders.len()
    }

    fn forget_one(&mut self) {
        let oldest = self.senders.iter().min_by_key(|(_, sender)| sender.heard_ns).map(|(address, _)| *address);
        if let Some(mut sender) = oldest.and_then(|address| self.senders.remove(&address)) {
            sender.settle(|_| true);
            let (sum, one) = (&mut self.forgotten, sender.account);
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
        let account = Account { sender: address.to_string(), ..Account::default() };
        Sender { account, window: vec![None; WINDOW], ..Sender::default() }
    }

    fn enter(&mut self, t_ns: i64, sequence: u32, mark: u64) -> Seen {
        let next = *self.next.get_or_insert(sequence);
        #[expect(clippy::cast_possible_wrap, reason = "numbers wrap; the difference says which is ahead")]
        let ahead = sequence.wrapping_sub(next) as i32;
        if (0..MAX_JUMP).contains(&ahead) {
            if ahead > 0 {
                self.miss(Run { first: next, count: ahead as u32 }, t_ns);
            }
            self.begin(sequence, mark);
            self.next = Some(sequence.wrapping_add(1));
            return Seen::New;
        }
        match self.known(sequence).copied() {
            Some(known) if known.mark == mark && known.progress == Progress::Whole => return Seen::Duplicate,
            Some(known) if known.mark == mark => return Seen::Begun,
            _ => {}
        }
        if self.fill_gap(sequence) || self.was_not_lost_after_all(sequence) {
            self.account.reordered += 1;
            note(&mut self.findings.reordered, sequence);
            self.begin(sequence, mark);
            return Seen::Late;
        } else if self.anew == Some(sequence) {
            self.settle(|_| true);
            self.account.restarts += 1;
            self.findings.restarted = true;
            self.next = Some(sequence.wrapping_add(1));
            self.anew = None;
        } else {
            self.anew = Some(sequence.wrapping_add(1));
        }
        self.begin(sequence, mark);
        Seen::New
    }

    fn known(&mut self, sequence: u32) -> Option<&mut Known> {
        self.window[sequence as usize % WINDOW].as_mut().filter(|known| known.sequence == sequence)
    }

    fn begin(&mut self, sequence: u32, mark: u64) {
        self.window[sequence as usize % WINDOW] = Some(Known { sequence, mark, progress: Progress::Begun });
    }

    fn miss(&mut self, run: Run, noticed_ns: i64) {
        self.gaps.push(Gap { run, noticed_ns });
        if self.gaps.len() > MAX_GAPS {
            let oldest = self.gaps.remove(0);
            self.lose(oldest.run);
        }
    }

    /// Takes a number out of what is missing; whether it was there.
    fn fill_gap(&mut self, sequence: u32) -> bool {
        let Some(at) = self.gaps.iter().position(|gap| gap.run.holds(sequence)) else { return false };
        let noticed_ns = self.gaps[at].noticed_ns;
        let rest = without(self.gaps[at].run, sequence).map(|run| Gap { run, noticed_ns });
        self.gaps.splice(at..=at, rest);
        true
    }

    /// It came later than anybody waits for: the account is put right.
    fn was_not_lost_after_all(&mut self, sequence: u32) -> bool {
        let Some(at) = self.account.lost_runs.iter().position(|run| run.holds(sequence)) else { return false };
        let rest = without(self.account.lost_runs[at], sequence);
        self.account.lost_runs.splice(at..=at, rest);
        self.account.lost -= 1;
        true
    }

    fn settle(&mut self, is_lost: impl Fn(&Gap) -> bool) {
        for gap in self.gaps.extract_if(.., |gap| is_lost(gap)).collect::<Vec<_>>() {
            self.lose(gap.run);
        }
    }

    fn lose(&mut self, run: Run) {
        self.account.lost += u64::from(run.count);
        name(&mut self.account.lost_runs, run);
        self.findings.lost.push(run);
    }
}

/// What is left of a run without one of its messages.
fn without(run: Run, sequence: u32) -> impl Iterator<Item = Run> {
    let before = sequence.wrapping_sub(run.first);
    let after = Run { first: sequence.wrapping_add(1), count: run.count - before - 1 };
    [Run { first: run.first, count: before }, after].into_iter().filter(|run| run.count > 0)
}

/// Adds a message to a list of runs; a run in a row grows.
fn note(runs: &mut Vec<Run>, sequence: u32) {
    match runs.last_mut() {
        Some(last) if last.first.wrapping_add(last.count) == sequence => last.count += 1,
        _ => runs.push(Run { first: sequence, count: 1 }),
    }
}

fn name(runs: &mut Vec<Run>, run: Run) {
    if runs.len() < MAX_NAMED {
        runs.push(run);
    }
}
