//! The data of the screen, copied from the traffic under one lock, so that drawing does not block the listener.

use super::curve::Curve;
use super::tree::{self, Decoded};
use replay::record::SenderCounts;
use replay::traffic::{Raised, Row, Traffic};
use std::collections::BTreeMap;

/// Which parts of the traffic to copy.
pub struct Scope<'a> {
    /// Channel whose last message is decoded; `None`: all.
    pub message: Option<&'a str>,
    /// Time span of the curves, s.
    pub span_s: f64,
}

impl Scope<'_> {
    /// Everything, for a frozen display.
    pub const ALL: Scope<'static> = Scope { message: None, span_s: f64::INFINITY };
}

/// The traffic at one time.
#[derive(Debug, Clone, Default)]
pub struct ScreenData {
    /// Every channel.
    pub rows: Vec<Row>,
    /// Raised alarms.
    pub raised: Vec<Raised>,
    /// Every sender.
    pub senders: Vec<SenderCounts>,
    /// Lost messages, duplicate datagrams, late datagrams.
    pub lost_duplicate_late: [u64; 3],
    /// Datagrams that the kernel dropped.
    pub kernel_dropped: u64,
    /// Network events: age in s and text; newest first.
    pub news: Vec<(f64, String)>,
    /// Last messages of the selected channels.
    pub messages: BTreeMap<String, Decoded>,
    /// Plotted fields.
    pub curves: Vec<Curve>,
    /// No datagram was received.
    pub is_empty: bool,
}

impl ScreenData {
    /// Copies it.
    pub fn take(traffic: &Traffic, now_ns: i64, rows: Vec<Row>, raised: Vec<Raised>, scope: &Scope) -> Self {
        let seconds = |t_ns: i64| t_ns.saturating_sub(now_ns) as f64 * 1e-9;
        let decoded = |row: &Row| {
            let (bytes, length) =
                traffic.message(&row.name).filter(|_| scope.message.is_none_or(|name| name == row.name))?;
            Some((row.name.clone(), tree::decode(traffic.types(), &row.name, bytes, length)))
        };
        let curves = traffic.traces().iter().map(|trace| Curve {
            channel: trace.channel.clone(),
            path: trace.path.clone(),
            points: trace
                .points()
                .map(|(t_ns, value)| (seconds(t_ns), value))
                .filter(|(t, _)| *t >= -scope.span_s)
                .collect(),
        });
        ScreenData {
            messages: rows.iter().filter_map(decoded).collect(),
            rows,
            raised,
            senders: traffic.senders(),
            lost_duplicate_late: traffic.lost_duplicate_late(),
            kernel_dropped: traffic.kernel_dropped(),
            news: traffic
                .network_events()
                .rev()
                .map(|(t_ns, text)| ((-seconds(*t_ns)).max(0.0), text.clone()))
                .collect(),
            curves: curves.collect(),
            is_empty: traffic.is_empty(),
        }
    }
}
