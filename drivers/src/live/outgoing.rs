//! Messages from the publisher thread to the bus.

use super::EventLimit;
use super::clock::now_ns;
use lcmtypes::bus::Bus;
use lcmtypes::{Event, EventNumbers, Message, channels};

/// Encodes and publishes messages, and counts those that the bus did not accept.
pub struct Outgoing {
    bus: Box<dyn Bus>,
    bytes: Vec<u8>,
    unpublished: u64,
    events: EventNumbers,
    limit: EventLimit,
}

impl Outgoing {
    /// Publishes on `bus` the messages of a run.
    pub fn new(bus: Box<dyn Bus>, run_id: i64) -> Self {
        Outgoing {
            bus,
            bytes: Vec::new(),
            unpublished: 0,
            events: EventNumbers::new(run_id),
            limit: EventLimit::default(),
        }
    }

    /// The bus, to receive from.
    pub fn bus(&mut self) -> &mut dyn Bus {
        &mut *self.bus
    }

    /// Messages that the bus did not accept.
    pub fn unpublished(&self) -> u64 {
        self.unpublished
    }

    /// Publishes an encoded message.
    pub fn put_bytes(&mut self, channel: &str, data: &[u8]) {
        self.unpublished += u64::from(self.bus.publish(channel, data).is_err());
    }

    /// Encodes and publishes a message. One that cannot be encoded counts as not published.
    pub fn put(&mut self, channel: &str, message: &impl Message) {
        self.bytes.clear();
        let published = message.encode(&mut self.bytes).is_ok() && self.bus.publish(channel, &self.bytes).is_ok();
        self.unpublished += u64::from(!published);
    }

    /// Publishes an EVENT.
    pub fn event(&mut self, t_ns: i64, tick: i64, level: i8, source: &str, text: String) {
        self.put_event(Event { t_ns, tick, level, source: source.to_owned(), text, ..Event::default() });
    }

    /// Publishes an EVENT; sets its sender and number. EVENTs beyond [`EventLimit`] are counted: a flood of foreign messages must not become a flood
    /// of EVENTs.
    pub fn put_event(&mut self, event: Event) {
        if self.limit.passes(now_ns(), &event) {
            self.put_numbered(event);
        }
    }

    /// Publishes how many EVENTs were not published. Call it several times per second.
    pub fn report_suppressed(&mut self) {
        let now_ns = now_ns();
        for suppressed in self.limit.take_suppressed(now_ns) {
            self.put_numbered(suppressed.event(now_ns));
        }
    }

    /// [`Outgoing::report_suppressed`] at the end of the run.
    pub fn report_rest(&mut self) {
        let now_ns = now_ns();
        for suppressed in self.limit.take_rest() {
            self.put_numbered(suppressed.event(now_ns));
        }
    }

    fn put_numbered(&mut self, mut event: Event) {
        self.events.number(&mut event);
        self.put(channels::EVENT, &event);
    }
}
