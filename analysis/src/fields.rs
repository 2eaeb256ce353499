//! Any numeric field of any channel over time, by name: `ROBOT_STATE.q[3]`.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use lcm_idl::TypeSet;
use replay::log::Event;

use crate::Error;
use crate::frames::types_of_run;

/// A field of the messages of a channel.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Field {
    /// Channel.
    pub channel: String,
    /// Way to the value inside the message, such as `state.q[3]`.
    pub path: String,
}

impl Field {
    /// Reads `CHANNEL.path`; `None` without both. A channel's name may not hold a dot then.
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

/// Values of a field over time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Samples {
    /// Times: the message's `t_ns` where it has one, else the log's; s since the first tick of the run.
    pub t_s: Vec<f64>,
    /// Values; booleans are 0 and 1.
    pub values: Vec<f64>,
}

/// Collects fields while a log is read.
pub(crate) struct FieldReader<'a> {
    wanted: BTreeMap<&'a str, Vec<&'a Field>>,
    own_types: Option<TypeSet>,
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
        Self { wanted, own_types: None, found: BTreeMap::new() }
    }

    /// Takes the wanted fields out of a message; one that does not decode gives none.
    pub fn take(&mut self, path: &Path, event: &Event) -> Result<(), Error> {
        if self.wanted.is_empty() {
            return Ok(());
        }
        if &*event.channel == "RUN_INFO" && self.own_types.is_none() {
            self.own_types = types_of_run(path, &event.data)?;
        }
        let Some(wanted) = self.wanted.get(&*event.channel) else { return Ok(()) };
        let own = self.own_types.as_ref().and_then(|types| types.of_message(&event.data));
        let Some(ty) = own.or_else(|| lcmtypes::types().of_message(&event.data)) else { return Ok(()) };
        let (mut t_ns, mut name, mut values) = (event.t_ns, String::new(), Vec::with_capacity(wanted.len()));
        let walked = ty.walk(&event.data, |path, leaf| {
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
        Ok(())
    }

    /// The fields that were found, by name.
    pub fn finish(self, t0_ns: i64) -> BTreeMap<String, Samples> {
        let seconds = |times: Vec<i64>| times.into_iter().map(|t_ns| (t_ns - t0_ns) as f64 / 1e9).collect();
        let samples = |(times, values)| Samples { t_s: seconds(times), values };
        self.found.into_iter().map(|(field, found)| (field.to_string(), samples(found))).collect()
    }
}
