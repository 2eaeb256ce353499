//! Checks the release rule of a run with several components: what a component computes from the inputs of base tick k is delivered at
//! k + `latency_ticks`, never earlier; what is due and has not arrived is listed as late in the input.
//!
//! A replay cannot find this: it computes a component from its recorded inputs, whatever they are. The base tick of an input is the one with the same
//! time. A component that is not the first one runs in its order before the first one. Components of other programs are not checked.

use super::published::{Published, PublishedTick, limit};
use super::release_violation::{ReleaseFault, ReleaseViolation, ReleaseViolations};
use super::run_messages::RunMessages;
use super::ticks::{Beside, Tick, Ticks};
use crate::Error;
use lcmtypes::{ControllerInput, EXTERNAL, RunInfo, channels};
use std::collections::{BTreeMap, VecDeque};
use std::path::Path;

/// Bytes of messages that are kept of all components together until they are delivered.
const MAX_BYTES: usize = 64 << 20;

/// A component as sender and receiver.
struct Part {
    name: String,
    latency_ticks: i64,
    ticks: Ticks,
    /// The next tick with an input.
    next: Option<Tick>,
    /// The last tick with an input.
    last_tick: Option<i64>,
    published: Published,
    /// Published, and not yet due: due base tick, and time.
    waiting: VecDeque<(i64, i64)>,
    /// Base tick in which the newest message that is due became due, by channel.
    due: BTreeMap<String, i64>,
    /// Base tick in which the newest message that it consumed was due, by channel.
    consumed: BTreeMap<String, i64>,
}

/// Checks the log of a run with several components. Reads it once for each of them.
///
/// - `run`: RUN_INFO of the log.
///
/// # Errors
/// Those of reading the log.
pub(super) fn check(path: &Path, run: &RunInfo) -> Result<ReleaseViolations, Error> {
    let mut found = ReleaseViolations::default();
    let mut parts = Vec::new();
    for (index, component) in run.components.iter().enumerate().filter(|(_, one)| one.kind != EXTERNAL) {
        let messages = RunMessages::of_component(run, index);
        let mut part = Part {
            name: component.name.clone(),
            latency_ticks: component.latency_ticks.into(),
            ticks: Ticks::open(path, &messages, Beside::Nothing)?,
            next: None,
            last_tick: None,
            published: Published::default(),
            waiting: VecDeque::new(),
            due: BTreeMap::new(),
            consumed: BTreeMap::new(),
        };
        part.read()?;
        parts.push(part);
    }
    while let Some(base) = parts.first_mut().map(Part::take).transpose()?.flatten() {
        let Some(input) = &base.input else { continue };
        for at in 1..parts.len() {
            while parts[at].next_ns().is_some_and(|t_ns| t_ns < input.t_ns) {
                // Its base tick is not in the log.
                parts[at].take()?;
                (parts[at].published.known_from_ns, parts[at].last_tick) = (i64::MAX, None);
            }
            if parts[at].next_ns() == Some(input.t_ns)
                && let Some(tick) = parts[at].take()?
            {
                tick.input.iter().for_each(|own| consume(&mut parts, at, own, base.tick, &mut found));
                parts[at].publish(tick, input.t_ns, base.tick);
                let mut all: Vec<&mut Published> = parts.iter_mut().map(|part| &mut part.published).collect();
                limit(&mut all, MAX_BYTES);
            }
        }
        consume(&mut parts, 0, input, base.tick, &mut found);
    }
    Ok(found)
}

/// Checks the input of a component in a base tick.
fn consume(parts: &mut [Part], at: usize, input: &ControllerInput, base_tick: i64, found: &mut ReleaseViolations) {
    parts.iter_mut().for_each(|part| part.advance(base_tick));
    if parts[at].last_tick.is_none_or(|last| last.checked_add(1) != Some(input.tick)) {
        // What it consumed before is not in the log.
        parts[at].consumed.clear();
    }
    parts[at].last_tick = Some(input.tick);
    let name = parts[at].name.clone();
    let mut violation = |channel: &str, what, expected_base_tick| {
        found.count += 1;
        found.first.get_or_insert_with(|| ReleaseViolation {
            component: name.clone(),
            channel: channel.to_owned(),
            tick: input.tick,
            what,
            expected_base_tick,
            found_base_tick: base_tick,
        });
    };
    for message in &input.messages {
        let Some(sender) = sender(parts, &message.channel) else { continue };
        let t_ns = super::ticks::integer_at(&message.data, 8).unwrap_or(i64::MIN);
        let Some(PublishedTick { due_tick, messages }) = parts[sender].published.at(t_ns) else {
            if t_ns >= parts[sender].published.known_from_ns {
                violation(&message.channel, ReleaseFault::OtherBytes, None);
            }
            continue;
        };
        let due_tick = *due_tick;
        let is_published = messages.iter().any(|(channel, data)| *channel == message.channel && *data == message.data);
        if base_tick < due_tick {
            violation(&message.channel, ReleaseFault::Early, Some(due_tick));
        } else if !is_published {
            violation(&message.channel, ReleaseFault::OtherBytes, Some(due_tick));
        }
        parts[at].consumed.insert(message.channel.clone(), due_tick);
    }
    let missing = |channel: &String, consumed: i64| {
        let due = *parts[sender(parts, channel)?].due.get(channel)?;
        (due > consumed && !input.late.iter().any(|late| late.channel == *channel)).then_some(due)
    };
    let missed: Vec<(String, i64)> = parts[at]
        .consumed
        .iter()
        .filter_map(|(channel, consumed)| Some((channel.clone(), missing(channel, *consumed)?)))
        .collect();
    for (channel, due) in missed {
        violation(&channel, ReleaseFault::NotDelivered, Some(due));
        parts[at].consumed.insert(channel, due);
    }
}

/// Index of the component of a channel; `None` for one of the first component, of another program or of no component.
fn sender(parts: &[Part], channel: &str) -> Option<usize> {
    let (name, _) = channels::split(channel);
    (1..parts.len()).find(|at| parts[*at].name == name)
}

impl Part {
    /// Time of the next tick, ns.
    fn next_ns(&self) -> Option<i64> {
        Some(self.next.as_ref()?.input.as_ref()?.t_ns)
    }

    /// Reads the next tick with an input.
    fn read(&mut self) -> Result<(), Error> {
        self.next = self.ticks.next()?;
        while self.next.as_ref().is_some_and(|tick| tick.input.is_none()) {
            self.next = self.ticks.next()?;
        }
        Ok(())
    }

    /// Returns the next tick.
    fn take(&mut self) -> Result<Option<Tick>, Error> {
        let tick = self.next.take();
        self.read()?;
        Ok(tick)
    }

    /// Takes what it published in a tick.
    fn publish(&mut self, tick: Tick, t_ns: i64, base_tick: i64) {
        let due_tick = base_tick.saturating_add(self.latency_ticks);
        let is_message = |(channel, _): &(std::sync::Arc<str>, Vec<u8>)| **channel != *channels::CONTROLLER_SNAPSHOT;
        let all = tick.recorded.into_iter().chain(tick.candidates).filter(is_message);
        let messages: Vec<_> = all.map(|(channel, data)| (format!("{}/{channel}", self.name), data)).collect();
        self.waiting.push_back((due_tick, t_ns));
        self.published.put(t_ns, PublishedTick { due_tick, messages });
    }

    /// Notes what is due in a base tick.
    fn advance(&mut self, base_tick: i64) {
        while let Some((due_tick, t_ns)) = self.waiting.pop_front_if(|(due_tick, _)| *due_tick <= base_tick) {
            for (channel, _) in self.published.at(t_ns).iter().flat_map(|published| &published.messages) {
                match self.due.get_mut(channel) {
                    Some(due) => *due = due_tick,
                    None => drop(self.due.insert(channel.clone(), due_tick)),
                }
            }
        }
    }
}
