//! From datagrams to events: what is whole goes into the log, what is missing is said there.

use super::account::Account;
use super::drop_policy::Keep;
use super::hearing::{Hearing, Tally};
use super::pattern::Filter;
use super::ring::{EventSink, RingWriter};
use crate::Error;
use crate::udpm::Datagram;
use lcmtypes::Event;
use std::collections::BTreeMap;

/// How often findings go into the log, ns.
const REPORT_NS: i64 = 1_000_000_000;

/// Sorts what was heard.
pub struct Intake {
    filter: Filter,
    writer: RingWriter,
    hearing: Hearing,
    now_ns: i64,
    reported_ns: i64,
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

impl Intake {
    /// Hands what passes the filter to `writer`.
    pub fn new(filter: Filter, writer: RingWriter) -> Self {
        Intake { filter, writer, hearing: Hearing::default(), now_ns: 0, reported_ns: 0 }
    }

    /// Takes a datagram.
    ///
    /// # Errors
    /// [`Error::WriterFailed`] once the log cannot be written any more.
    pub fn datagram(&mut self, datagram: &Datagram) -> Result<(), Error> {
        self.now_ns = datagram.t_ns;
        match self.hearing.datagram(datagram) {
            Some(message) if self.filter.takes(&message.channel) => {
                self.writer.write(&message.channel, datagram.t_ns, &message.data)
            }
            _ => Ok(()),
        }
    }

    /// To be called a few times a second, whether anything came or not: gives up waiting for what is too late, and says in the log what
    /// was found.
    ///
    /// # Errors
    /// As [`Intake::datagram`].
    pub fn look_up(&mut self, now_ns: i64) -> Result<(), Error> {
        self.now_ns = self.now_ns.max(now_ns);
        if now_ns - self.reported_ns < REPORT_NS {
            return Ok(());
        }
        self.reported_ns = now_ns;
        self.hearing.settle(now_ns);
        self.report()
    }

    /// What the free space on the disk allows from now on.
    pub fn set_disk(&mut self, keep: Keep) {
        self.writer.set_disk(keep);
    }

    /// How it goes.
    pub fn status(&self) -> Status {
        Status {
            tally: self.hearing.tally(),
            lost_twice_late: self.hearing.totals(),
            senders: self.hearing.senders(),
            keep: self.writer.keep(),
            fill: self.writer.fill(),
            left_out: self.writer.left_out_total(),
        }
    }

    /// Says the rest and the sum in the log, and completes it.
    pub fn finish(mut self) -> Heard {
        self.hearing.settle_all();
        let said = self.report_and_sum_up();
        let [lost, duplicates, reordered] = self.hearing.totals();
        let left_out = self.writer.left_out();
        // A writer that has failed refuses to say anything more; its own error is the one that tells why.
        let written = self.writer.finish().and_then(|events| said.map(|()| events));
        let (events, failure) = match written {
            Ok(events) => (Some(events), None),
            Err(error) => (None, Some(error.to_string())),
        };
        let senders = self.hearing.accounts();
        Heard { events, failure, tally: self.hearing.tally(), lost, duplicates, reordered, left_out, senders }
    }

    fn report_and_sum_up(&mut self) -> Result<(), Error> {
        self.report()?;
        let [lost, twice, late] = self.hearing.totals();
        let left_out = self.writer.left_out_total();
        let tally = self.hearing.tally();
        let text = format!(
            "end of the recording: {} messages heard of {} senders; lost {lost}, came again {twice}, came late {late}, \
             dropped by the kernel {}, malformed {}, left out {left_out}",
            tally.heard,
            self.hearing.senders(),
            tally.kernel_dropped,
            tally.malformed
        );
        let level = if lost + left_out > 0 { Event::LEVEL_WARNING } else { Event::LEVEL_INFO };
        self.writer.say(self.now_ns, level, text)
    }

    fn report(&mut self) -> Result<(), Error> {
        self.hearing.news().into_iter().try_for_each(|(level, text)| self.writer.say(self.now_ns, level, text))
    }
}
