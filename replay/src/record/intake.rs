//! From datagrams to events: writes complete messages to the log, and reports losses there as EVENT messages.

use super::drop_policy::RecordLevel;
use super::message_decoder::{MessageDecoder, ReceiveCounts};
use super::pattern::Filter;
use super::ring::{EventSink, RingWriter};
use super::sender_counts::SenderCounts;
use crate::Error;
use crate::udpm::Datagram;
use lcmtypes::Event;
use std::collections::BTreeMap;

/// Time between two reports in the log, ns.
const REPORT_NS: i64 = 1_000_000_000;

/// Decodes datagrams, filters channels and writes the messages.
pub struct Intake {
    filter: Filter,
    writer: RingWriter,
    decoder: MessageDecoder,
    now_ns: i64,
    reported_ns: i64,
}

/// Status of a running recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Status {
    /// Received messages and datagrams.
    pub counts: ReceiveCounts,
    /// Lost messages, duplicate datagrams, late datagrams.
    pub lost_duplicate_late: [u64; 3],
    /// Number of senders.
    pub senders: usize,
    /// Channels that are recorded now.
    pub level: RecordLevel,
    /// Used part of the write buffer, 0 to 1.
    pub fill: f64,
    /// Received messages that were not recorded.
    pub left_out: u64,
}

/// Summary of a recording.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct IntakeSummary {
    /// Events in the log, including those of the recorder; `None` if the log could not be completed.
    pub events: Option<u64>,
    /// Why the log could not be completed; it ends at the last successful write.
    pub failure: Option<String>,
    /// Received messages and datagrams.
    #[serde(flatten)]
    pub counts: ReceiveCounts,
    /// Messages lost between senders and recorder.
    pub lost: u64,
    /// Duplicate datagrams.
    pub duplicates: u64,
    /// Datagrams received after a later one of their sender.
    pub reordered: u64,
    /// Received messages that were not recorded, by channel.
    pub left_out: BTreeMap<String, u64>,
    /// Counts of each sender.
    pub senders: Vec<SenderCounts>,
}

impl Intake {
    /// Writes the messages of the filter's channels to `writer`.
    pub fn new(filter: Filter, writer: RingWriter) -> Self {
        Intake { filter, writer, decoder: MessageDecoder::default(), now_ns: 0, reported_ns: 0 }
    }

    /// Takes a datagram.
    ///
    /// # Errors
    /// [`Error::WriterFailed`] once a write has failed.
    pub fn datagram(&mut self, datagram: &Datagram) -> Result<(), Error> {
        self.now_ns = datagram.t_ns;
        match self.decoder.datagram(datagram) {
            Some(message) if self.filter.takes(&message.channel) => {
                self.writer.write(&message.channel, datagram.t_ns, &message.data)
            }
            _ => Ok(()),
        }
    }

    /// Call a few times per second, with or without datagrams: counts messages that are overdue as lost, and writes findings to the log.
    ///
    /// # Errors
    /// As [`Intake::datagram`].
    pub fn update(&mut self, now_ns: i64) -> Result<(), Error> {
        self.now_ns = self.now_ns.max(now_ns);
        if now_ns - self.reported_ns < REPORT_NS {
            return Ok(());
        }
        self.reported_ns = now_ns;
        self.decoder.settle(now_ns);
        self.report()
    }

    /// Sets the channels that the free disk space permits.
    pub fn set_disk_level(&mut self, level: RecordLevel) {
        self.writer.set_disk_level(level);
    }

    /// Current status.
    pub fn status(&self) -> Status {
        Status {
            counts: self.decoder.counts(),
            lost_duplicate_late: self.decoder.totals(),
            senders: self.decoder.senders(),
            level: self.writer.level(),
            fill: self.writer.fill(),
            left_out: self.writer.left_out_total(),
        }
    }

    /// Writes the last findings and the totals to the log and completes it.
    pub fn finish(mut self) -> IntakeSummary {
        self.decoder.settle_all();
        let reported = self.report_totals();
        let [lost, duplicates, reordered] = self.decoder.totals();
        let left_out = self.writer.left_out();
        // After a failed write the reports fail too; the error of the writer is the cause.
        let written = self.writer.finish().and_then(|events| reported.map(|()| events));
        let (events, failure) = match written {
            Ok(events) => (Some(events), None),
            Err(error) => (None, Some(error.to_string())),
        };
        let senders = self.decoder.all_counts();
        IntakeSummary { events, failure, counts: self.decoder.counts(), lost, duplicates, reordered, left_out, senders }
    }

    fn report_totals(&mut self) -> Result<(), Error> {
        self.report()?;
        let [lost, duplicate, late] = self.decoder.totals();
        let left_out = self.writer.left_out_total();
        let counts = self.decoder.counts();
        let text = format!(
            "end of the recording: {} messages received from {} senders; lost {lost}, duplicate {duplicate}, late {late}, \
             dropped by the kernel {}, malformed {}, not recorded {left_out}",
            counts.received,
            self.decoder.senders(),
            counts.kernel_dropped,
            counts.malformed
        );
        let level = if lost + left_out > 0 { Event::LEVEL_WARNING } else { Event::LEVEL_INFO };
        self.writer.report(self.now_ns, level, text)
    }

    fn report(&mut self) -> Result<(), Error> {
        self.decoder
            .take_events()
            .into_iter()
            .try_for_each(|(level, text)| self.writer.report(self.now_ns, level, text))
    }
}
