//! Merges several logs into one, sorted by time.

use super::copy::{CopyOutput, PROGRESS_EVENTS, profile};
use super::{CopyReport, Event, EventRef, FileChannel, Health, ItemRef, LogReader, McapSource, Types};
use crate::Error;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Merges logs by time: each step writes the earliest of the inputs' next events. The events of one input keep their order, even if its
/// timestamps are out of order. Event numbers are assigned from 0. `progress` receives the fraction read, 0 to 1.
///
/// # Errors
/// As [`super::copy`].
pub fn merge(logs: &[PathBuf], out: &Path, types: Types, progress: &mut dyn FnMut(f64)) -> Result<CopyReport, Error> {
    let mut inputs = Vec::new();
    for log in logs {
        Error::check_distinct_files(log, out)?;
        let reader = LogReader::open(log)?;
        inputs.push(MergeInput { reader, next: None, latest_ns: i64::MIN, health: Health::default() });
    }
    let total: u64 = inputs.iter().map(|input| input.reader.bytes()).sum();
    let profiles = inputs.iter_mut().map(|input| profile(&mut input.reader)).collect::<Result<Vec<_>, _>>()?;
    let mut output = CopyOutput::create(out, types, &profiles)?;
    for input in &mut inputs {
        input.advance()?;
    }
    let mut written = 0_u64;
    while let Some(input) = inputs.iter_mut().filter(|input| input.next.is_some()).min_by_key(|input| input.latest_ns) {
        let Some((event, source)) = input.next.take() else { break };
        let Event { channel, t_ns, number, data, offset } = &event;
        let source = source.as_ref().map(|(channel, publish_t)| McapSource { channel, publish_t: *publish_t });
        // The sequence numbers of another encoding are those of its sender.
        let is_lcm = source.is_none_or(|source| source.channel.is_plain_lcm());
        let number = if is_lcm { output.report.events as i64 } else { *number };
        output.write(&EventRef { channel, t_ns: *t_ns, number, data, offset: *offset, source })?;
        input.advance()?;
        written += 1;
        if written.is_multiple_of(PROGRESS_EVENTS) {
            let read: u64 = inputs.iter().map(MergeInput::offset).sum();
            progress(read as f64 / total.max(1) as f64);
        }
    }
    for input in &mut inputs {
        output.report.add_health(&input.health);
        output.side_records(&mut input.reader)?;
    }
    output.finish()
}

/// Channel in the file and publish time of an event of an MCAP.
type Source = (Arc<FileChannel>, u64);

/// One of the logs that are merged.
struct MergeInput {
    reader: LogReader,
    next: Option<(Event, Option<Source>)>,
    /// Latest time of the events up to `next`, ns: the sort key, so that an event with an earlier time directly follows the event before it.
    latest_ns: i64,
    health: Health,
}

impl MergeInput {
    /// Reads the next event into `next`; `None` at the end of the log.
    fn advance(&mut self) -> Result<(), Error> {
        while let Some(item) = self.reader.read()? {
            if let ItemRef::Event(event) = &item {
                self.latest_ns = self.latest_ns.max(event.t_ns);
                let source = event.source.map(|source| (Arc::clone(source.channel), source.publish_t));
                self.next = Some((event.to_event(), source));
                return Ok(());
            }
            self.health.note(item);
        }
        Ok(())
    }

    fn offset(&self) -> u64 {
        self.next.as_ref().map_or(self.reader.bytes(), |(event, _)| event.offset)
    }
}
