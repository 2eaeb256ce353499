//! Time series of any numeric field of any channel, by name such as `ROBOT_STATE.q[3]`.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use crate::consumed::Consumed;
use replay::log::{EventRef, Types};

/// A field of the messages of a channel.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Field {
    /// Channel.
    pub channel: String,
    /// Path of the value in the message, such as `state.q[3]`.
    pub path: String,
}

impl Field {
    /// Parses `CHANNEL.path`; `None` if one of them is empty. The channel ends at the first dot.
    pub fn parse(text: &str) -> Option<Self> {
        let (channel, path) = text.split_once('.')?;
        let both = !channel.is_empty() && !path.is_empty();
        both.then(|| Self { channel: channel.to_owned(), path: path.to_owned() })
    }
}

impl std::fmt::Display for Field {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}.{}", self.channel, self.path)
    }
}

/// Time series of a field.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Samples {
    /// Times, s since the first tick of the run: `t_ns` of the message if it has one, else the time of the log.
    pub t_s: Vec<f64>,
    /// Values; false is 0, true is 1.
    pub values: Vec<f64>,
}

/// Collects time series while a log is read.
pub(crate) struct FieldReader<'a> {
    wanted: BTreeMap<&'a str, Vec<&'a Field>>,
    types: Types,
    consumed: Consumed,
    found: BTreeMap<&'a Field, (Vec<i64>, Vec<f64>)>,
}

impl<'a> FieldReader<'a> {
    pub fn new(fields: &'a [Field]) -> Self {
        let mut wanted: BTreeMap<&str, Vec<&Field>> = BTreeMap::new();
        for field in fields {
            let of_channel = wanted.entry(&field.channel).or_default();
            if !of_channel.contains(&field) {
                of_channel.push(field);
            }
        }
        Self { wanted, types: Types::default(), consumed: Consumed::default(), found: BTreeMap::new() }
    }

    /// Appends the wanted fields of a message. A message that cannot be decoded is ignored.
    pub fn take(&mut self, event: &EventRef) {
        if self.wanted.is_empty() {
            return;
        }
        self.types.learn(event);
        self.consumed.restore(event.channel, event.data);
        let Some(wanted) = self.wanted.get(&**event.channel) else { return };
        let consumed = self.consumed.bytes(event.channel, event.data);
        let found = match &consumed {
            Some(bytes) => lcmtypes::types().of_message(bytes).map(|ty| (ty, &bytes[..])),
            None => self.types.of_message(event.channel, event.data).map(|ty| (ty, event.data)),
        };
        let Some((ty, data)) = found else { return };
        let (mut t_ns, mut name, mut values) = (event.t_ns, String::new(), Vec::with_capacity(wanted.len()));
        let walked = ty.walk_lenient(data, |path, leaf| {
            name.clear();
            let _ = write!(name, "{path}");
            if name == "t_ns" {
                t_ns = leaf.as_i64().unwrap_or(t_ns);
            }
            if let Some(&field) = wanted.iter().find(|field| field.path == name) {
                values.extend(leaf.as_f64().or_else(|| leaf.as_i64().map(|v| v as f64)).map(|value| (field, value)));
            }
        });
        if walked.is_ok() {
            for (field, value) in values {
                let series = self.found.entry(field).or_default();
                series.0.push(t_ns);
                series.1.push(value);
            }
        }
    }

    /// The time series found, by name of the field.
    pub fn finish(self, t0_ns: i64) -> BTreeMap<String, Samples> {
        let seconds = |times: Vec<i64>| times.into_iter().map(|t_ns| t_ns.saturating_sub(t0_ns) as f64 / 1e9).collect();
        let samples = |(times, values)| Samples { t_s: seconds(times), values };
        self.found.into_iter().map(|(field, found)| (field.to_string(), samples(found))).collect()
    }
}
