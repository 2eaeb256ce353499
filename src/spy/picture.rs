//! What is on the screen, apart from how it is drawn: taken from the traffic in one go, so that the listener waits for no terminal.

use super::curve::Curve;
use super::tree::{self, Decoded};
use replay::record::Account;
use replay::traffic::{Raised, Row, Traffic};
use std::collections::BTreeMap;

/// What of the traffic is wanted.
pub struct Wanted<'a> {
    /// Channels whose last message is decoded: this one, or all.
    pub message: Option<&'a str>,
    /// How far back curves go, s.
    pub span_s: f64,
}

impl Wanted<'_> {
    /// Whatever somebody may want to look at in a picture that stands still.
    pub const ALL: Wanted<'static> = Wanted { message: None, span_s: f64::INFINITY };
}

/// The traffic at a moment.
#[derive(Debug, Clone, Default)]
pub struct Picture {
    /// Every channel.
    pub rows: Vec<Row>,
    /// Conditions that hold.
    pub raised: Vec<Raised>,
    /// Every sender.
    pub senders: Vec<Account>,
    /// Messages lost, datagrams that came again, datagrams that came late.
    pub lost_twice_late: [u64; 3],
    /// Datagrams that the kernel dropped.
    pub kernel_dropped: u64,
    /// What was found: age in s, and a sentence; newest first.
    pub news: Vec<(f64, String)>,
    /// Last messages, of the channels that may be looked at.
    pub messages: BTreeMap<String, Decoded>,
    /// Chosen fields.
    pub curves: Vec<Curve>,
    /// Nothing was heard at all.
    pub is_silent: bool,
}

impl Picture {
    /// Takes it.
    pub fn take(traffic: &Traffic, now_ns: i64, rows: Vec<Row>, raised: Vec<Raised>, wanted: &Wanted) -> Self {
        let seconds = |t_ns: i64| t_ns.saturating_sub(now_ns) as f64 * 1e-9;
        let decoded = |row: &Row| {
            let (bytes, length) =
                traffic.message(&row.name).filter(|_| wanted.message.is_none_or(|name| name == row.name))?;
            Some((row.name.clone(), tree::decode(traffic.types(), &row.name, bytes, length)))
        };
        let curves = traffic.traces().iter().map(|trace| Curve {
            channel: trace.channel.clone(),
            path: trace.path.clone(),
            points: trace
                .points()
                .map(|(t_ns, value)| (seconds(t_ns), value))
                .filter(|(t, _)| *t >= -wanted.span_s)
                .collect(),
        });
        Picture {
            messages: rows.iter().filter_map(decoded).collect(),
            rows,
            raised,
            senders: traffic.senders(),
            lost_twice_late: traffic.lost_twice_late(),
            kernel_dropped: traffic.kernel_dropped(),
            news: traffic.news().rev().map(|(t_ns, text)| ((-seconds(*t_ns)).max(0.0), text.clone())).collect(),
            curves: curves.collect(),
            is_silent: traffic.is_silent(),
        }
    }
}
