//! Parameter changes of a log.

use crate::Error;
use crate::log::{ChunkIndex, EventRef, Health, LogReader};
use lcmtypes::{Message, ParameterChange, channels};
use std::collections::BTreeSet;
use std::path::Path;

/// All parameter changes of a log, each once, in the order of the log: a live run repeats them, so a change is known even if its first message
/// is lost.
pub(super) fn parameter_changes(path: &Path) -> Result<Vec<ParameterChange>, Error> {
    let (mut found, mut known) = (Vec::new(), BTreeSet::new());
    let mut take = |event: &EventRef<'_>| {
        if **event.channel == *channels::PARAMETER_CHANGE
            && let Ok(change) = ParameterChange::decode(event.data)
            && known.insert(event.data.to_vec())
        {
            found.push(change);
        }
    };
    if let Some(mut index) = ChunkIndex::read(path)? {
        for chunk in index.chunks_with(channels::PARAMETER_CHANGE) {
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
