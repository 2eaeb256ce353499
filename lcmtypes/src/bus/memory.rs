//! A bus within a process: no network, no clock, deterministic order.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use regex_lite::Regex;

use super::{Bus, BusError, QUEUE_CAPACITY, Received, check_channel, check_size, whole_name};

/// A handle to a bus within this process. [`MemoryBus::connect`] creates further handles to the same bus.
#[derive(Debug)]
pub struct MemoryBus {
    hub: Arc<Hub>,
    /// Identifies this handle's inbox.
    id: usize,
}

#[derive(Debug, Default)]
struct Hub {
    inboxes: Mutex<Inboxes>,
    arrived: Condvar,
}

#[derive(Debug, Default)]
struct Inboxes {
    next_id: usize,
    open: Vec<Inbox>,
}

#[derive(Debug)]
struct Inbox {
    id: usize,
    capacity: usize,
    subscriptions: Vec<Regex>,
    queue: VecDeque<Received>,
    dropped: u64,
}

impl Default for MemoryBus {
    fn default() -> Self {
        Self::new()
    }
}

impl MemoryBus {
    /// A new bus with one handle. Its queue holds [`QUEUE_CAPACITY`] messages.
    pub fn new() -> Self {
        Self::attach(Arc::default(), QUEUE_CAPACITY)
    }

    /// Another handle to the same bus.
    pub fn connect(&self) -> Self {
        self.connect_with_capacity(QUEUE_CAPACITY)
    }

    /// Another handle to the same bus. While `capacity` messages are in its queue, further ones are dropped and counted.
    pub fn connect_with_capacity(&self, capacity: usize) -> Self {
        Self::attach(Arc::clone(&self.hub), capacity)
    }

    fn attach(hub: Arc<Hub>, capacity: usize) -> Self {
        let mut inboxes = hub.lock();
        let id = inboxes.next_id;
        inboxes.next_id += 1;
        inboxes.open.push(Inbox { id, capacity, subscriptions: Vec::new(), queue: VecDeque::new(), dropped: 0 });
        drop(inboxes);
        Self { hub, id }
    }
}

impl Hub {
    /// No code panics while it holds the lock, so a poisoned lock has consistent data.
    fn lock(&self) -> MutexGuard<'_, Inboxes> {
        self.inboxes.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Inboxes {
    fn of(&mut self, id: usize) -> &mut Inbox {
        self.open.iter_mut().find(|inbox| inbox.id == id).expect("an inbox exists as long as its handle")
    }
}

impl Bus for MemoryBus {
    fn publish(&mut self, channel: &str, bytes: &[u8]) -> Result<(), BusError> {
        check_channel(channel)?;
        check_size(channel, bytes)?;
        for inbox in &mut self.hub.lock().open {
            if !inbox.subscriptions.iter().any(|s| s.is_match(channel)) {
                continue;
            }
            if inbox.queue.len() < inbox.capacity {
                inbox.queue.push_back(Received { channel: channel.to_owned(), data: bytes.to_vec(), recv_utime: None });
            } else {
                inbox.dropped += 1;
            }
        }
        self.hub.arrived.notify_all();
        Ok(())
    }

    fn subscribe(&mut self, channels: &str) -> Result<(), BusError> {
        let pattern = whole_name(channels)?;
        self.hub.lock().of(self.id).subscriptions.push(pattern);
        Ok(())
    }

    fn handle(&mut self, timeout: Duration) -> Result<Vec<Received>, BusError> {
        let end = Instant::now().checked_add(timeout);
        let mut inboxes = self.hub.lock();
        while inboxes.of(self.id).queue.is_empty() {
            let left = end.map_or(Duration::MAX, |end| end.saturating_duration_since(Instant::now()));
            if left.is_zero() {
                break;
            }
            inboxes = self.hub.arrived.wait_timeout(inboxes, left).unwrap_or_else(PoisonError::into_inner).0;
        }
        Ok(inboxes.of(self.id).queue.drain(..).collect())
    }

    fn dropped(&self) -> u64 {
        self.hub.lock().of(self.id).dropped
    }
}

impl Drop for MemoryBus {
    fn drop(&mut self) {
        self.hub.lock().open.retain(|inbox| inbox.id != self.id);
    }
}
