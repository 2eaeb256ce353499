//! Who says what, how often, how evenly, and what of it does not come: the numbers behind `hoof spy`, of a network or of a log.
//!
//! - [`Traffic`]: takes datagrams, or the events of a log, and keeps an account by channel and by sender in bounded memory.
//! - [`Live`]: hears a network with a socket of its own, and sends nothing.
//! - [`Row`]: one channel of it; [`Summary`]: all of it. Their names in JSON are those of `hoof log info`, and more.
//! - [`Intervals`], [`Window`]: rate and jitter, right at any rate.
//! - [`Alarm`], [`Alarms`]: conditions on rows, such as `ROBOT_STATE rate<900`.
//! - [`Trace`]: a field of a channel's messages over time.
//!
//! What is lost is known exactly for a sender, from LCM's sequence numbers, which count all its messages, whatever their channel. What a
//! channel lost is known where its messages count themselves (`seq`, `tick`); elsewhere it is at most what its senders lost. A row
//! says which of the two it is.
//!
//! What it must never do: send anything, guess a number that nobody knows, or grow with what is heard.

mod alarm;
mod channel;
mod intervals;
mod live;
mod row;
mod trace;

pub use alarm::{Alarm, Alarms, Raised};
pub use intervals::{Intervals, Pace, Spread, Window};
pub use live::Live;
pub use row::{Row, Summary};
pub use trace::Trace;

use crate::log::{EventRef, Types};
use crate::record::{Account, Hearing};
use crate::udpm::Datagram;
use channel::{Arrival, Channel};
use lcmtypes::channels;
use std::collections::{BTreeMap, VecDeque};
use std::hash::{DefaultHasher, Hash, Hasher};

/// Channels that are told apart; beyond, messages are counted together.
const MAX_CHANNELS: usize = 1000;
/// Bytes of last messages kept over all channels.
const MAX_KEPT: usize = 1 << 26;
/// RUN_INFO messages of which types are learnt.
const MAX_RUNS: usize = 16;
/// How often it is judged what is lost, ns.
const SETTLE_NS: i64 = 500_000_000;
/// Findings that are kept to be read.
const NEWS: usize = 100;

/// What is heard.
#[derive(Default)]
pub struct Traffic {
    hearing: Hearing,
    channels: BTreeMap<String, Channel>,
    types: Types,
    /// How often the types have changed.
    knowledge: u64,
    runs: Vec<u64>,
    traces: Vec<Trace>,
    kept: usize,
    /// Messages of channels beyond [`MAX_CHANNELS`].
    untold: u64,
    first_ns: Option<i64>,
    last_ns: i64,
    settled_ns: i64,
    news: VecDeque<(i64, String)>,
}

impl Traffic {
    /// With types that others describe.
    pub fn new(types: Types) -> Self {
        Traffic { types, ..Traffic::default() }
    }

    /// Takes a datagram.
    pub fn datagram(&mut self, datagram: &Datagram) {
        let Datagram { sender, t_ns, .. } = *datagram;
        if let Some(message) = self.hearing.datagram(datagram) {
            let (name, data, is_late) = (&*message.channel, &*message.data, message.is_late);
            self.take(&Arrival { sender: Some(sender), t_ns, name, data, is_late });
        }
    }

    /// Takes an event of a log.
    pub fn event(&mut self, event: &EventRef) {
        if let Some(schema) = event.schema {
            self.knowledge += u64::from(self.types.learn_schema(schema));
        }
        let EventRef { channel, t_ns, data, .. } = *event;
        self.take(&Arrival { sender: None, t_ns, name: channel, data, is_late: false });
    }

    fn take(&mut self, arrival: &Arrival) {
        let Arrival { t_ns, name, data, .. } = *arrival;
        self.first_ns.get_or_insert(t_ns);
        self.last_ns = t_ns;
        if name == channels::RUN_INFO {
            self.learn(data);
        }
        if self.channels.len() >= MAX_CHANNELS && !self.channels.contains_key(name) {
            self.untold += 1;
            return;
        }
        if !self.channels.contains_key(name) {
            self.channels.insert(name.to_owned(), Channel::new(t_ns));
        }
        let Some(channel) = self.channels.get_mut(name) else { return };
        self.kept -= channel.message.len();
        let keep = self.kept + data.len() <= MAX_KEPT;
        channel.take(arrival, &self.types, self.knowledge, keep);
        self.kept += channel.message.len();
        let is_due = |trace: &Trace| trace.channel == name && trace.is_due(t_ns);
        if self.traces.iter().any(is_due)
            && let Some(ty) = self.types.of_message(name, data)
        {
            trace::trace(&mut self.traces, name, ty, data, t_ns);
        }
    }

    /// Takes the types of a RUN_INFO. A run says it again and again; whoever listens reads it once.
    fn learn(&mut self, run_info: &[u8]) {
        let mut hasher = DefaultHasher::new();
        run_info.hash(&mut hasher);
        let hash = hasher.finish();
        if self.runs.contains(&hash) || self.runs.len() == MAX_RUNS {
            return;
        }
        self.runs.push(hash);
        self.types.learn_run_info(channels::RUN_INFO, run_info);
        self.knowledge += 1;
    }

    /// To be called a few times a second, with the time of the network's clock: what is too late is lost.
    pub fn settle(&mut self, now_ns: i64) {
        if (0..SETTLE_NS).contains(&now_ns.saturating_sub(self.settled_ns)) {
            return;
        }
        self.settled_ns = now_ns;
        self.hearing.settle(now_ns);
        self.read_news(now_ns);
    }

    /// Nothing more comes: what is missing is lost.
    pub fn settle_all(&mut self) {
        self.hearing.settle_all();
        self.read_news(self.last_ns);
    }

    fn read_news(&mut self, now_ns: i64) {
        for (_, text) in self.hearing.news() {
            if self.news.len() == NEWS {
                self.news.pop_front();
            }
            self.news.push_back((now_ns, text));
        }
    }

    /// Begins to count anew; types and choice of traces stay.
    pub fn clear(&mut self) {
        let (types, knowledge) = (std::mem::take(&mut self.types), self.knowledge);
        let (runs, mut traces) = (std::mem::take(&mut self.runs), std::mem::take(&mut self.traces));
        traces.iter_mut().for_each(Trace::clear);
        *self = Traffic { types, knowledge, runs, traces, ..Traffic::default() };
    }

    /// Follows a field from now on; whether its path could be read.
    pub fn follow(&mut self, channel: &str, path: &str) -> bool {
        let trace = Trace::new(channel, path);
        let is_some = trace.is_some();
        self.traces.extend(trace);
        is_some
    }

    /// Follows a field no more.
    pub fn unfollow(&mut self, channel: &str, path: &str) {
        self.traces.retain(|trace| trace.channel != channel || trace.path != path);
    }

    /// The fields that are followed.
    pub fn traces(&self) -> &[Trace] {
        &self.traces
    }

    /// What is known of types.
    pub fn types(&self) -> &Types {
        &self.types
    }

    /// The last message of a channel: as many of its bytes as are kept (none of one that is too long), and its length.
    pub fn message(&self, channel: &str) -> Option<(&[u8], usize)> {
        self.channels.get(channel).map(|channel| (&channel.message[..], channel.length))
    }

    /// Every channel as it goes at `now_ns`.
    pub fn rows(&self, now_ns: i64) -> Vec<Row> {
        self.all(|channel| channel.pace(now_ns), now_ns)
    }

    fn all(&self, pace: impl Fn(&Channel) -> Pace, now_ns: i64) -> Vec<Row> {
        let row = |(name, channel): (&String, &Channel)| Row::new(name, channel, pace(channel), now_ns, &self.hearing);
        self.channels.iter().map(row).collect()
    }

    /// Every channel as it went, from its first to its last message.
    pub fn summary(&self, now_ns: i64) -> Summary {
        Summary::new(self, self.all(Channel::whole, now_ns))
    }

    /// Accounts of the senders, by address.
    pub fn senders(&self) -> Vec<Account> {
        self.hearing.accounts()
    }

    /// Messages lost, datagrams that came again, datagrams that came late: of all senders.
    pub fn lost_twice_late(&self) -> [u64; 3] {
        self.hearing.totals()
    }

    /// Datagrams that the kernel dropped because nobody fetched them in time.
    pub fn kernel_dropped(&self) -> u64 {
        self.hearing.tally().kernel_dropped
    }

    /// Whether anything was heard at all, LCM or not.
    pub fn is_silent(&self) -> bool {
        self.first_ns.is_none() && self.hearing.tally() == crate::record::Tally::default()
    }

    /// What was found, with the time when, ns; oldest first.
    pub fn news(&self) -> impl DoubleEndedIterator<Item = &(i64, String)> {
        self.news.iter()
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use std::sync::Arc;

    fn say(traffic: &mut Traffic, channel: &str, t_ns: i64, data: &[u8]) {
        let channel: &Arc<str> = &channel.into();
        traffic.event(&EventRef { channel, t_ns, number: 0, data, offset: 0, schema: None });
    }

    #[test]
    fn memory_does_not_grow_with_channels_or_messages() {
        let mut traffic = Traffic::default();
        for n in 0..1500 {
            say(&mut traffic, &format!("C{n}"), n, &[0; 100_000]);
        }
        let summary = traffic.summary(1500);
        assert_eq!((summary.channels.len(), summary.untold, summary.events), (MAX_CHANNELS, 500, 1500));
        // 671 of them fit into 64 MiB; of the others, the length is known.
        let kept = |name: &str| traffic.message(name).map(|(bytes, length)| (bytes.len(), length));
        assert_eq!((kept("C670"), kept("C671")), (Some((100_000, 100_000)), Some((0, 100_000))));
        assert_eq!(traffic.kept, 671 * 100_000);
        // A channel known already is counted on, and what it gives up others may keep.
        say(&mut traffic, "C0", 1500, b"short");
        say(&mut traffic, "C671", 1500, &[0; 100_000]);
        assert_eq!(traffic.message("C671").unwrap().0.len(), 100_000);
        // Longer than anybody wants to look at.
        say(&mut traffic, "C0", 1501, &vec![0; channel::KEPT + 1]);
        assert_eq!(traffic.message("C0").unwrap().0.len(), 0);
    }

    #[test]
    fn counting_anew_keeps_what_was_chosen() {
        let mut traffic = Traffic::default();
        assert!(traffic.follow("A", "x") && !traffic.follow("A", "x[one]"));
        say(&mut traffic, "A", 5, b"12345678");
        traffic.clear();
        assert_eq!((traffic.rows(10).len(), traffic.traces().len(), traffic.is_silent()), (0, 1, true));
        traffic.unfollow("A", "x");
        assert_eq!(traffic.traces().len(), 0);
    }
}
