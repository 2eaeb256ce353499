//! Parameter changes of a log.

use super::account::RejectedChange;
use super::run_messages::RunMessages;
use crate::Error;
use crate::log::{ChunkIndex, EventRef, Health, LogReader};
use controller::params::apply_changes;
use lcmtypes::{Message, ParameterChange, channels};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// The parameter changes of a run.
#[derive(Default)]
pub(super) struct Changes {
    /// By their first tick; those of a tick in the order of the log.
    pub valid: BTreeMap<i64, Vec<ParameterChange>>,
    /// Number of those that a controller of this build refuses: damaged, or of another program.
    pub rejected: u64,
    /// The first of them.
    pub first_rejected: Option<RejectedChange>,
}

impl Changes {
    /// Reads all parameter changes of a run, each once: a live run repeats them, so a change is known even if its first message is lost.
    pub fn read(path: &Path, messages: &RunMessages) -> Result<Self, Error> {
        let mut by_tick = BTreeMap::<i64, Vec<(u64, ParameterChange)>>::new();
        for (offset, change) in all(path, &messages.in_log(channels::PARAMETER_CHANGE))?
            .into_iter()
            .filter(|(_, change)| messages.is_of_run(change.run_id))
        {
            by_tick.entry(change.tick).or_default().push((offset, change));
        }
        let (mut changes, mut params) = (Changes::default(), messages.params.to_string());
        for (offset, change) in by_tick.into_values().flatten() {
            match apply_changes(&params, &[(change.key.clone(), change.value.clone())]) {
                Ok(changed) => {
                    params = changed;
                    changes.valid.entry(change.tick).or_default().push(change);
                }
                Err(reason) => {
                    changes.rejected += 1;
                    let rejected = || RejectedChange { tick: change.tick, offset, reason: reason.to_string() };
                    changes.first_rejected.get_or_insert_with(rejected);
                }
            }
        }
        Ok(changes)
    }
}

/// All parameter changes on a channel of a log with their offsets, each once, in the order of the log.
fn all(path: &Path, channel: &str) -> Result<Vec<(u64, ParameterChange)>, Error> {
    let (mut found, mut known) = (Vec::new(), BTreeSet::new());
    let mut take = |event: &EventRef<'_>| {
        if **event.channel == *channel
            && let Ok(change) = ParameterChange::decode(event.data)
            && known.insert(event.data.to_vec())
        {
            found.push((event.offset, change));
        }
    };
    if let Some(mut index) = ChunkIndex::read(path)? {
        for chunk in index.chunks_with(channel) {
            index.events(chunk, &mut take)?;
        }
        return Ok(found);
    }
    let (mut reader, mut health) = (LogReader::open(path)?, Health::default());
    while let Some(item) = reader.read()? {
        health.note(item).iter().for_each(&mut take);
    }
    Ok(found)
}
