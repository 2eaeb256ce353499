//! Order of a log's times, and its events in the order of time.
//!
//! Most logs are in the order of time. A file in which channels stand one after the other is read in blocks that are sorted; at any time
//! only the blocks that contain the current time are in memory. If the clock of a recording jumped back, events are returned in
//! the order of the file.

use crate::Error;
use crate::log::{Event, Health, LogReader};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;

/// Times that are out of order by less are played in the order of the file.
const TOLERANCE_NS: i64 = 10_000_000;

/// Bytes of a block, before the chunk that completes it.
const BLOCK_BYTES: usize = 1 << 18;

/// Names of channels that are remembered. A damaged file can appear to have an unlimited number.
const MAX_CHANNELS: usize = 1 << 16;

/// How the times of a log are ordered.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum OrderKind {
    /// In the order of time, up to 10 ms.
    Ordered,
    /// Each channel is in the order of time, the file is not.
    ByChannel,
    /// The clock jumped back, or the file consists of several MCAPs whose times overlap.
    JumpsBack,
}

/// Order of the times of a log.
#[derive(Debug, Clone)]
pub struct TimeOrder {
    channels: BTreeSet<Arc<str>>,
    /// Events that are more than 10 ms earlier than a previous event of their channel, where the previous event was not.
    pub jumps_back: u64,
    is_ordered: bool,
    blocks: Vec<Block>,
}

/// Consecutive events.
#[derive(Debug, Clone, Copy)]
struct Block {
    offset: u64,
    events: usize,
    first_ns: i64,
}

impl TimeOrder {
    /// Reads a log from start to end.
    ///
    /// # Errors
    /// As [`LogReader::open`] and [`LogReader::read`].
    pub fn of(log: &Path) -> Result<Self, Error> {
        let mut reader = LogReader::open(log)?;
        let mut order = TimeOrder { channels: BTreeSet::new(), jumps_back: 0, is_ordered: true, blocks: Vec::new() };
        let mut latest: BTreeMap<Arc<str>, (i64, bool)> = BTreeMap::new();
        let (mut latest_of_all, mut bytes, mut last_offset) = (i64::MIN, 0, u64::MAX);
        let mut health = Health::default();
        while let Some(item) = reader.read()? {
            let Some(event) = health.note(item) else { continue };
            let t_ns = event.t_ns;
            // A block begins with a record of the file: in MCAP with a chunk.
            if order.blocks.is_empty() || bytes >= BLOCK_BYTES && event.offset != last_offset {
                order.blocks.push(Block { offset: event.offset, events: 0, first_ns: t_ns });
                bytes = 0;
            }
            bytes += event.data.len() + 64;
            last_offset = event.offset;
            if let Some(block) = order.blocks.last_mut() {
                block.events += 1;
                block.first_ns = block.first_ns.min(t_ns);
            }
            order.is_ordered &= t_ns >= latest_of_all.saturating_sub(TOLERANCE_NS);
            latest_of_all = latest_of_all.max(t_ns);
            if let Some((latest, was_late)) = latest.get_mut(event.channel) {
                let is_late = t_ns < latest.saturating_sub(TOLERANCE_NS);
                order.jumps_back += u64::from(is_late && !*was_late);
                (*latest, *was_late) = ((*latest).max(t_ns), is_late);
            } else if latest.len() < MAX_CHANNELS {
                latest.insert(Arc::clone(event.channel), (t_ns, false));
            }
        }
        order.channels = latest.into_keys().collect();
        if reader.is_joined() && !order.is_ordered {
            // Blocks of joined files cannot be read in another order.
            order.jumps_back = order.jumps_back.max(1);
        }
        Ok(order)
    }

    /// Time of the earliest event, ns, if the file is sorted by time.
    pub(super) fn first_sorted_ns(&self) -> Option<i64> {
        let first = self.blocks.iter().map(|block| block.first_ns).min();
        first.filter(|_| self.kind() == OrderKind::ByChannel)
    }

    /// How the times are ordered.
    pub fn kind(&self) -> OrderKind {
        match (self.is_ordered, self.jumps_back) {
            (true, _) => OrderKind::Ordered,
            (false, 0) => OrderKind::ByChannel,
            (false, _) => OrderKind::JumpsBack,
        }
    }

    /// Message for the user; `None` if the log is in the order of time.
    pub fn notice(&self) -> Option<String> {
        match self.kind() {
            OrderKind::Ordered => None,
            OrderKind::ByChannel => Some("not in the order of time: sorted by log time".to_owned()),
            OrderKind::JumpsBack => {
                let n = self.jumps_back;
                Some(format!("the time jumps back {n} times: played in the order of the file, without the jumps"))
            }
        }
    }

    /// Whether the log has events of a channel.
    pub fn has_channel(&self, name: &str) -> bool {
        self.channels.contains(name) || self.channels.len() >= MAX_CHANNELS
    }
}

/// Events in the order of time: those of a sorted log, else those of the file.
pub(crate) struct OrderedEvents {
    reader: LogReader,
    health: Health,
    /// Blocks that are not yet read, latest first; `None`: the order of the file.
    blocks: Option<Vec<Block>>,
    /// Events of the blocks that were read, by time and place in the file.
    ready: BTreeMap<(i64, u64, usize), Event>,
}

impl OrderedEvents {
    /// # Errors
    /// As [`LogReader::open`].
    pub fn open(log: &Path, order: &TimeOrder) -> Result<Self, Error> {
        let blocks = (order.kind() == OrderKind::ByChannel).then(|| {
            let mut blocks = order.blocks.clone();
            blocks.sort_by_key(|block| std::cmp::Reverse((block.first_ns, block.offset)));
            blocks
        });
        Ok(OrderedEvents { reader: LogReader::open(log)?, health: Health::default(), blocks, ready: BTreeMap::new() })
    }

    /// Damage found so far.
    pub fn health(&self) -> &Health {
        &self.health
    }

    /// The next event.
    ///
    /// # Errors
    /// As [`LogReader::read`].
    pub fn next(&mut self) -> Result<Option<Event>, Error> {
        if self.blocks.is_none() {
            return self.read();
        }
        loop {
            let next_ns = self.ready.keys().next().map(|key| key.0);
            let Some(block) = self
                .blocks
                .as_mut()
                .and_then(|blocks| blocks.pop_if(|block| next_ns.is_none_or(|next| block.first_ns <= next)))
            else {
                return Ok(self.ready.pop_first().map(|(_, event)| event));
            };
            self.reader.seek(block.offset)?;
            for place in 0..block.events {
                let Some(event) = self.read()? else { break };
                self.ready.insert((event.t_ns, block.offset, place), event);
            }
        }
    }

    fn read(&mut self) -> Result<Option<Event>, Error> {
        while let Some(item) = self.reader.read()? {
            if let Some(event) = self.health.note(item) {
                return Ok(Some(event.to_event()));
            }
        }
        Ok(None)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::LogWriter;

    fn log(name: &str, events: impl IntoIterator<Item = (&'static str, i64)>) -> std::path::PathBuf {
        let path = std::env::temp_dir().join(format!("hoof_order_{}_{name}", std::process::id()));
        let mut log = LogWriter::create(&path).unwrap();
        for (channel, t_ms) in events {
            log.write(channel, t_ms * 1_000_000, &[7; 2000]).unwrap();
        }
        log.finish().unwrap();
        path
    }

    fn times(path: &Path) -> (OrderKind, u64, Vec<i64>) {
        let order = TimeOrder::of(path).unwrap();
        let mut events = OrderedEvents::open(path, &order).unwrap();
        let mut times = Vec::new();
        while let Some(event) = events.next().unwrap() {
            times.push(event.t_ns / 1_000_000);
        }
        (order.kind(), order.jumps_back, times)
    }

    /// One channel after the other in the file, over several blocks.
    #[test]
    fn channels_one_after_the_other_are_sorted() {
        for name in ["by_channel.mcap", "by_channel.lcmlog"] {
            let path = log(name, (0..1000).map(|i| ("A", 20 * i)).chain((0..1000).map(|i| ("B", 20 * i + 10))));
            assert_eq!(times(&path), (OrderKind::ByChannel, 0, (0..2000).map(|i| 10 * i).collect()), "{name}");
            std::fs::remove_file(path).unwrap();
        }
    }

    /// A clock that is set back does not mix what happened before and after.
    #[test]
    fn a_clock_that_jumps_back_keeps_the_order_of_the_file() {
        let expected: Vec<i64> = (0..50).map(|i| 1000 + 20 * i).chain((0..50).map(|i| 20 * i)).collect();
        for name in ["jump.mcap", "jump.lcmlog"] {
            let path = log(name, expected.iter().map(|t| ("A", *t)));
            assert_eq!(times(&path), (OrderKind::JumpsBack, 1, expected.clone()), "{name}");
            std::fs::remove_file(path).unwrap();
        }
    }

    /// In each part of a joined file, other channels have the same ids.
    #[test]
    fn every_event_of_joined_files_keeps_its_channel() {
        let parts = [("A", 0), ("B", 10)]
            .map(|(channel, from)| log(&format!("part_{channel}.mcap"), (0..1000).map(|i| (channel, 20 * i + from))));
        let path = std::env::temp_dir().join(format!("hoof_order_{}_joined.mcap", std::process::id()));
        std::fs::write(&path, parts.each_ref().map(|part| std::fs::read(part).unwrap()).concat()).unwrap();
        let order = TimeOrder::of(&path).unwrap();
        assert_eq!((order.kind(), order.jumps_back), (OrderKind::JumpsBack, 1));
        let mut events = OrderedEvents::open(&path, &order).unwrap();
        for n in 0..2000 {
            let event = events.next().unwrap().unwrap();
            let expected = if n < 1000 { ("A", 20 * n) } else { ("B", 20 * (n - 1000) + 10) };
            assert_eq!((&*event.channel, event.t_ns / 1_000_000), expected);
        }
        assert!(events.next().unwrap().is_none() && events.health().is_good());
        parts.iter().chain([&path]).for_each(|path| std::fs::remove_file(path).unwrap());
    }
}
