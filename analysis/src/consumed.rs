//! CONTROLLER_INPUT as the controller read it.

use controller::Unpacked;
use lcmtypes::channels::CONTROLLER_INPUT;
use lcmtypes::{ControllerInput, Message};
use std::collections::BTreeMap;

/// Components whose inputs are unpacked; a hostile log may have any number of channels.
const MAX_COMPONENTS: usize = 64;

/// What each component of a log has consumed.
#[derive(Default)]
pub(crate) struct Consumed(BTreeMap<String, Unpacked>);

impl Consumed {
    /// The input of a tick as a `tick_input_t`; `None` for a message that is no CONTROLLER_INPUT of this build.
    pub fn bytes(&mut self, channel: &str, data: &[u8]) -> Option<Vec<u8>> {
        if channel.rsplit('/').next() != Some(CONTROLLER_INPUT) {
            return None;
        }
        let input = ControllerInput::decode(data).ok()?;
        if !self.0.contains_key(channel) && self.0.len() == MAX_COMPONENTS {
            return None;
        }
        let mut bytes = Vec::new();
        self.0.entry(channel.to_owned()).or_default().update(&input).encode(&mut bytes).ok()?;
        Some(bytes)
    }
}
