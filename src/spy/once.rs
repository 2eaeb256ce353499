//! `hoof spy --once`: prints the table, or JSON, for scripts.

use super::table;
use crate::{Outcome, say, say_json};
use replay::log::Health;
use replay::traffic::{Alarms, Raised, Summary};
use serde::Serialize;

/// The output of `--once`.
#[derive(Serialize)]
pub struct Report {
    /// URL of the network or name of the log.
    source: String,
    /// `udpm`, `lcmlog` or `mcap`.
    format: String,
    /// Damaged parts of a log.
    damaged: u64,
    /// The log ends inside a record.
    cut: bool,
    #[serde(flatten)]
    summary: Summary,
    /// Raised alarms.
    alarms: Vec<Raised>,
    /// Conditions that are not raised and match no channel.
    unmatched: Vec<String>,
}

impl Report {
    /// Checks the alarms against the received messages.
    pub fn new(source: String, format: String, health: &Health, summary: Summary, alarms: &mut Alarms) -> Self {
        let raised = alarms.check(&summary.channels);
        let is_raised = |text: &&str| raised.iter().any(|raised| raised.alarm == *text);
        let unmatched = alarms.unmatched().filter(|text| !is_raised(text)).map(str::to_owned).collect();
        let (damaged, cut) = (health.damaged.len() as u64, health.cut.is_some());
        Report { source, format, damaged, cut, summary, alarms: raised, unmatched }
    }

    /// Whether no message was received.
    pub fn is_empty(&self) -> bool {
        self.summary.events == 0
    }

    /// Prints the report. A raised alarm or no message is a failure; datagrams dropped by the kernel are data loss.
    pub fn say(&self, as_json: bool) -> anyhow::Result<Outcome> {
        if as_json {
            say_json(self)?
        } else {
            say(self.text())?
        }
        Ok(match self {
            _ if self.is_empty() || !self.alarms.is_empty() => Outcome::Failed,
            _ if self.damaged > 0 || self.cut || self.summary.counts.kernel_dropped > 0 => Outcome::DataLoss,
            _ => Outcome::Good,
        })
    }

    fn text(&self) -> String {
        let Report { source, damaged, cut, summary: s, alarms, unmatched, format: _ } = self;
        let mut text = format!(
            "{source}: {} messages, {} channels, {:.3} s, lost {}",
            s.events,
            s.channels.len(),
            s.duration_s,
            s.lost
        );
        let mut note = |n: u64, what: &str| {
            if n > 0 {
                text += &format!("\n{n} {what}");
            }
        };
        note(s.ignored, "messages not counted: too many channels");
        note(s.counts.malformed, "malformed datagrams");
        note(s.counts.kernel_dropped, "datagrams dropped by the kernel: its receive buffer was full");
        note(*damaged, "damaged parts of the log");
        note(u64::from(*cut), "cut: the log ends inside a record");
        text += &format!("\n\n{}", table::text(&s.channels));
        for (place, account) in s.senders.iter().enumerate() {
            text += if place == 0 { "\n\n" } else { "\n" };
            text += &table::sender_text(account);
        }
        for raised in alarms {
            text += &format!("\nALARM {}", table::alarm_text(raised));
        }
        for alarm in unmatched {
            text += &format!("\nwarning: alarm {alarm:?} matches no channel");
        }
        text
    }
}
