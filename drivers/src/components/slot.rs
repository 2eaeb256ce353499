//! When a component runs, and the messages that wait for its next tick.

use controller::Delivery;
use controller::outbox::interned;
use lcmtypes::{ComponentInfo, EncodeError, Message, OperatorCommand, channels};

/// Messages of a tick that are left for measurements and results.
const RESERVED: usize = 32;

/// A component as an executor sees it.
pub struct Slot {
    /// Name of the component.
    pub name: String,
    period_ticks: i64,
    phase_ticks: i64,
    /// Base ticks from its input to the delivery of its results.
    pub latency_ticks: i64,
    receives: Vec<&'static str>,
    /// The messages for its next tick.
    pub inbox: Delivery,
    /// Number of its next tick.
    pub tick: i64,
    /// A measurement has arrived since its last tick.
    pub has_new_state: bool,
    /// Each channel of the table, and its name with the component's in front.
    channels: Vec<(&'static str, &'static str)>,
    /// An encoded command.
    bytes: Vec<u8>,
}

impl Slot {
    /// - `receives`: channels that it listens to.
    pub fn new(info: &ComponentInfo, run_id: i64, receives: Vec<String>) -> Self {
        let ComponentInfo { name, period_ticks, phase_ticks, latency_ticks, .. } = info;
        let with_name = |channel: &'static str| (channel, interned(format!("{name}/{channel}")));
        Slot {
            name: name.clone(),
            period_ticks: i64::from((*period_ticks).max(1)),
            phase_ticks: i64::from(*phase_ticks),
            latency_ticks: i64::from(*latency_ticks),
            receives: receives.into_iter().map(interned).collect(),
            inbox: Delivery::new(run_id),
            tick: 0,
            has_new_state: false,
            channels: channels::CHANNELS.iter().map(|channel| with_name(channel.name)).collect(),
            bytes: Vec::with_capacity(1024),
        }
    }

    /// Whether it has a tick in a base tick.
    pub fn is_due(&self, base_tick: i64) -> bool {
        let since = base_tick - self.phase_ticks;
        since >= 0 && since % self.period_ticks == 0
    }

    /// Whether it listens to a channel.
    pub fn listens_to(&self, channel: &str) -> bool {
        self.received_name(channel).is_some()
    }

    /// The name of a channel that it listens to, with static lifetime; `None` for another channel.
    pub fn received_name(&self, channel: &str) -> Option<&'static str> {
        self.receives.iter().find(|known| **known == channel).copied()
    }

    /// States that a result of a component is late, for each of its channels that this one listens to.
    pub fn state_late(&mut self, component: &str, due_tick: i64) {
        for channel in self.receives.iter().filter(|channel| channels::split(channel).0 == component) {
            self.inbox.late(channel, due_tick);
        }
    }

    /// Its ticks from an input to the delivery of what it computes, this one included.
    pub fn ticks_within_latency(&self) -> usize {
        usize::try_from(self.latency_ticks / self.period_ticks + 1).unwrap_or(1)
    }

    /// Delivers an operator command. A component with so many of them that its tick has no room left keeps the newest.
    ///
    /// # Errors
    /// None for a command with arrays of valid length.
    pub fn put_operator(&mut self, t_ns: i64, op: &OperatorCommand) -> Result<(), EncodeError> {
        if self.inbox.room() > RESERVED {
            return self.inbox.put(channels::OPERATOR_COMMAND, t_ns, op).map(drop);
        }
        self.bytes.clear();
        op.encode(&mut self.bytes)?;
        self.inbox.put_newest(channels::OPERATOR_COMMAND, t_ns, &self.bytes);
        Ok(())
    }

    /// The channels that it listens to.
    pub fn receives(&self) -> &[&'static str] {
        &self.receives
    }

    /// Name on the bus and in the log of one of its channels. Allocates only for a channel that is not in the table, the first time.
    pub fn channel(&self, channel: &str) -> &'static str {
        let known = self.channels.iter().find(|(plain, _)| *plain == channel).map(|(_, with_name)| *with_name);
        known.unwrap_or_else(|| interned(format!("{}/{channel}", self.name)))
    }
}
