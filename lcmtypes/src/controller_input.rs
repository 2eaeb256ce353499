//! Access to the messages in a [`ControllerInput`].

use crate::{ControllerInput, Delivered, EncodeError, Message};

impl Delivered {
    /// A message that arrived at `t_arrival_ns`.
    ///
    /// # Errors
    /// The length of an array differs from its length field.
    pub fn new(channel: &str, t_arrival_ns: i64, message: &impl Message) -> Result<Self, EncodeError> {
        let mut delivered = Delivered { channel: channel.to_owned(), t_arrival_ns, ..Self::default() };
        delivered.set(message)?;
        Ok(delivered)
    }

    fn set(&mut self, message: &impl Message) -> Result<(), EncodeError> {
        self.data.clear();
        message.encode(&mut self.data)?;
        self.size = i32::try_from(self.data.len()).unwrap_or(i32::MAX);
        Ok(())
    }
}

impl ControllerInput {
    /// The last message on a channel; `None` if there is none, or if it cannot be decoded.
    pub fn newest<M: Message>(&self, channel: &str) -> Option<M> {
        let message = self.messages.iter().rev().find(|message| message.channel == channel)?;
        M::decode(&message.data).ok()
    }

    /// Adds a message after the others.
    ///
    /// # Errors
    /// The length of an array differs from its length field.
    pub fn deliver(&mut self, channel: &str, t_arrival_ns: i64, message: &impl Message) -> Result<(), EncodeError> {
        self.messages.push(Delivered::new(channel, t_arrival_ns, message)?);
        self.n_messages = i32::try_from(self.messages.len()).unwrap_or(i32::MAX);
        Ok(())
    }

    /// Changes the last message on a channel; false if there is none that can be decoded and encoded.
    pub fn change<M: Message>(&mut self, channel: &str, change: impl FnOnce(&mut M)) -> bool {
        let Some(mut message) = self.newest::<M>(channel) else { return false };
        change(&mut message);
        let found = self.messages.iter_mut().rev().find(|message| message.channel == channel);
        found.is_some_and(|found| found.set(&message).is_ok())
    }
}
