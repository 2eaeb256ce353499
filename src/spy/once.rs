//! `hoof spy --once`: the table, or its JSON, for scripts.

use super::table;
use crate::{Outcome, say, say_json};
use replay::log::Health;
use replay::traffic::{Alarms, Raised, Summary};
use serde::Serialize;

/// What `--once` says.
#[derive(Serialize)]
pub struct Report {
    /// The network's URL or the log's name.
    source: String,
    /// `udpm`, `lcmlog` or `mcap`.
    format: String,
    /// Stretches of a log that could not be read.
    damaged: u64,
    /// The log stops inside a record.
    cut: bool,
    #[serde(flatten)]
    summary: Summary,
    /// Conditions that hold.
    alarms: Vec<Raised>,
    /// Conditions that do not and are about no channel that was heard.
    unmatched: Vec<String>,
}

impl Report {
    /// Judges what was heard or read.
    pub fn new(source: String, format: String, health: &Health, summary: Summary, alarms: &mut Alarms) -> Self {
        let raised = alarms.check(&summary.channels);
        let is_raised = |text: &&str| raised.iter().any(|raised| raised.alarm == *text);
        let unmatched = alarms.unmatched().filter(|text| !is_raised(text)).map(str::to_owned).collect();
        let (damaged, cut) = (health.damaged.len() as u64, health.cut.is_some());
        Report { source, format, damaged, cut, summary, alarms: raised, unmatched }
    }

    /// Whether nothing was heard.
    pub fn is_silent(&self) -> bool {
        self.summary.events == 0
    }

    /// Prints it, and judges it: a raised alarm and silence have failed, and what this program itself missed is data loss.
    pub fn say(&self, as_json: bool) -> anyhow::Result<Outcome> {
        if as_json {
            say_json(self)?
        } else {
            say(self.text())?
        }
        Ok(match self {
            _ if self.is_silent() || !self.alarms.is_empty() => Outcome::Failed,
            _ if self.damaged > 0 || self.cut || self.summary.tally.kernel_dropped > 0 => Outcome::DataLoss,
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
        note(s.untold, "messages of too many channels to be told apart");
        note(s.tally.malformed, "datagrams that no LCM sends");
        note(s.tally.kernel_dropped, "datagrams dropped by the kernel: its receive buffer was full");
        note(*damaged, "stretches of the log are damaged");
        note(u64::from(*cut), "cut: the log stops inside a record");
        text += &format!("\n\n{}", table::text(&s.channels));
        for (place, account) in s.senders.iter().enumerate() {
            text += if place == 0 { "\n\n" } else { "\n" };
            text += &table::sender_text(account);
        }
        for raised in alarms {
            text += &format!("\nALARM {}", table::alarm_text(raised));
        }
        for alarm in unmatched {
            text += &format!("\nwarning: {alarm}: no channel of that name was heard");
        }
        text
    }
}
