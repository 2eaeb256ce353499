//! The messages that are delivered to a component in a tick.

use lcmtypes::{ControllerInput, Delivered, EncodeError, LateResult, Message};

/// Largest number of messages of a tick. Further messages must wait for the next tick.
pub const MAX_MESSAGES: usize = 64;
/// Largest number of late results that a tick states: as many as it can have messages.
pub const MAX_LATE: usize = MAX_MESSAGES;
/// Bytes that are allocated for each message at the start; a larger message allocates once.
const CAPACITY: usize = 4096;
/// Bytes that are allocated for the name of each channel.
const NAME_CAPACITY: usize = 64;

/// Collects the messages of a tick. Its memory is used again in every tick.
pub struct Delivery {
    input: ControllerInput,
    spare: Vec<Delivered>,
    spare_late: Vec<LateResult>,
}

impl Delivery {
    /// An empty delivery for a run.
    pub fn new(run_id: i64) -> Self {
        let empty = || Delivered {
            channel: String::with_capacity(NAME_CAPACITY),
            data: Vec::with_capacity(CAPACITY),
            ..Delivered::default()
        };
        let mut input = ControllerInput { run_id, ..ControllerInput::default() };
        input.messages.reserve(MAX_MESSAGES);
        input.late.reserve(MAX_LATE);
        let late = || LateResult { channel: String::with_capacity(NAME_CAPACITY), due_tick: 0 };
        let spare_late = (0..MAX_LATE).map(|_| late()).collect();
        Delivery { input, spare: (0..MAX_MESSAGES).map(|_| empty()).collect(), spare_late }
    }

    /// Begins a tick: no message has been delivered.
    pub fn begin(&mut self, t_ns: i64, tick: i64) {
        self.clear();
        self.stamp(t_ns, tick);
    }

    /// Removes all messages.
    pub fn clear(&mut self) {
        (self.input.n_messages, self.input.n_late) = (0, 0);
        self.spare.append(&mut self.input.messages);
        self.spare_late.append(&mut self.input.late);
    }

    /// Sets time and number of the tick that consumes the messages delivered so far.
    pub fn stamp(&mut self, t_ns: i64, tick: i64) {
        (self.input.t_ns, self.input.tick) = (t_ns, tick);
    }

    /// Number of messages that can still be delivered in this tick.
    pub fn room(&self) -> usize {
        self.spare.len()
    }

    /// Delivers a message.
    ///
    /// - `t_arrival_ns`: time of its arrival, clock of the controller.
    ///
    /// Returns false if the tick has [`MAX_MESSAGES`] already.
    ///
    /// # Errors
    /// The length of an array differs from its length field; nothing is delivered.
    pub fn put(&mut self, channel: &str, t_arrival_ns: i64, message: &impl Message) -> Result<bool, EncodeError> {
        let Some(mut delivered) = self.spare.pop() else { return Ok(false) };
        delivered.data.clear();
        if let Err(error) = message.encode(&mut delivered.data) {
            self.spare.push(delivered);
            return Err(error);
        }
        delivered.channel.clear();
        delivered.channel.push_str(channel);
        delivered.t_arrival_ns = t_arrival_ns;
        delivered.size = i32::try_from(delivered.data.len()).unwrap_or(i32::MAX);
        self.input.messages.push(delivered);
        self.input.n_messages += 1;
        Ok(true)
    }

    /// Delivers an encoded message, in place of the last one on the same channel that was delivered in this tick.
    ///
    /// Returns false if the tick has [`MAX_MESSAGES`] already.
    pub fn put_newest(&mut self, channel: &str, t_arrival_ns: i64, data: &[u8]) -> bool {
        let place = self.input.messages.iter().rposition(|message| message.channel == channel);
        let Some(mut delivered) = place.map(|at| self.input.messages.remove(at)).or_else(|| self.spare.pop()) else {
            return false;
        };
        delivered.data.clear();
        delivered.data.extend_from_slice(data);
        delivered.channel.clear();
        delivered.channel.push_str(channel);
        delivered.t_arrival_ns = t_arrival_ns;
        delivered.size = i32::try_from(delivered.data.len()).unwrap_or(i32::MAX);
        self.input.n_messages += i32::from(place.is_none());
        self.input.messages.push(delivered);
        true
    }

    /// States that a result that was due at `due_tick` has not arrived, so that the previous one holds. Beyond [`MAX_LATE`] of a tick, nothing is
    /// stated.
    pub fn late(&mut self, channel: &str, due_tick: i64) {
        let Some(mut late) = self.spare_late.pop() else { return };
        late.channel.clear();
        late.channel.push_str(channel);
        late.due_tick = due_tick;
        self.input.late.push(late);
        self.input.n_late += 1;
    }

    /// The input of the tick.
    pub fn input(&self) -> &ControllerInput {
        &self.input
    }
}
