//! Writes a copy of a log with the replayed outputs.

use super::run_messages::RunMessages;
use super::ticks::{Tick, integer_at};
use crate::Error;
use crate::log::{Event, LogWriter};
use lcmtypes::{Message, ParameterChange, RunInfo, TextFile, channels};
use std::path::Path;

/// The log that is written during a replay.
pub(super) struct Out {
    log: LogWriter,
    info: Vec<u8>,
    messages: RunMessages,
    overridden: Vec<String>,
    bytes: Vec<u8>,
}

impl Out {
    /// Creates the file.
    ///
    /// - `info`: RUN_INFO of the copy.
    /// - `messages`: those of the component that is replayed.
    /// - `overridden`: keys that are set for the whole replay. Changes of them in the log do not apply, so they are not written.
    pub fn create(path: &Path, info: &RunInfo, messages: &RunMessages, overridden: &[String]) -> Result<Self, Error> {
        // The outputs have the types of this build, so RUN_INFO gets their texts.
        let text_file = |(name, text): &(&str, &str)| TextFile { name: (*name).into(), text: (*text).into() };
        let lcm_types: Vec<_> = lcmtypes::SOURCES.iter().map(text_file).collect();
        let info = RunInfo { num_lcm_types: lcm_types.len() as i32, lcm_types, ..info.clone() };
        let mut bytes = Vec::new();
        encode(path, &info, &mut bytes)?;
        let overridden = overridden.to_vec();
        let (log, messages) = (LogWriter::create(path)?, messages.clone());
        Ok(Out { log, info: bytes, messages, overridden, bytes: Vec::new() })
    }

    /// Writes the events before a tick's input, the input, and the replayed outputs.
    pub fn tick(&mut self, tick: &mut Tick, outbox: Option<&controller::Outbox>) -> Result<(), Error> {
        self.rest(std::mem::take(&mut tick.others))?;
        if let Some(input) = &tick.input {
            self.bytes.clear();
            encode(Path::new(channels::CONTROLLER_INPUT), input, &mut self.bytes)?;
            self.log.write(&self.messages.in_log(channels::CONTROLLER_INPUT), tick.t_log_ns, &self.bytes)?;
        }
        // A tick that was not computed keeps the snapshot from which the replay continues.
        if let (None, Some(state)) = (outbox, tick.snapshot()) {
            let t_ns = integer_at(state, 8).unwrap_or(tick.t_log_ns);
            self.log.write(&self.messages.in_log(channels::CONTROLLER_SNAPSHOT), t_ns, state)?;
        }
        for (channel, bytes) in outbox.iter().flat_map(|outbox| outbox.iter()) {
            self.log.write(&self.messages.in_log(channel), tick.t_log_ns, bytes)?;
        }
        Ok(())
    }

    /// Writes events that are not outputs.
    pub fn rest(&mut self, events: Vec<Event>) -> Result<(), Error> {
        for event in events {
            let is_of = |channel: &str, fingerprint| {
                self.messages.plain(&event.channel) == Some(channel) && event.fingerprint() == Some(fingerprint)
            };
            let change = || ParameterChange::decode(&event.data).ok();
            if is_of(channels::PARAMETER_CHANGE, ParameterChange::FINGERPRINT)
                && change().is_some_and(|change| self.overridden.contains(&change.key))
            {
                continue;
            }
            let is_info = is_of(channels::RUN_INFO, RunInfo::FINGERPRINT);
            self.log.write(&event.channel, event.t_ns, if is_info { &self.info } else { &event.data })?;
        }
        Ok(())
    }

    /// Completes the file.
    pub fn finish(self) -> Result<(), Error> {
        self.log.finish().map(drop)
    }
}

fn encode(path: &Path, message: &impl Message, out: &mut Vec<u8>) -> Result<(), Error> {
    message.encode(out).map_err(|source| Error::Encode { path: path.into(), source: source.into() })
}
