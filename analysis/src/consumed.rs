//! CONTROLLER_INPUT as the controller read it.

use controller::Unpacked;
use lcmtypes::channels::{CONTROLLER_INPUT, CONTROLLER_SNAPSHOT};
use lcmtypes::{ControllerInput, Message};
use std::collections::BTreeMap;

/// Components whose inputs are unpacked; a hostile log may have any number of channels.
const MAX_COMPONENTS: usize = 64;

/// What each component of a log has consumed, by what is in front of the names of its channels.
#[derive(Default)]
pub(crate) struct Consumed(BTreeMap<String, Unpacked>);

impl Consumed {
    /// Takes the input that holds after a tick if the message is a CONTROLLER_SNAPSHOT. A reader of a log calls it for every message.
    pub fn restore(&mut self, channel: &str, data: &[u8]) {
        if let Some(component) = channel.strip_suffix(CONTROLLER_SNAPSHOT).and_then(|prefix| self.component(prefix)) {
            component.restore(data);
        }
    }

    /// The input of a tick as a `tick_input_t`; `None` for a message that is no CONTROLLER_INPUT of this build.
    pub fn bytes(&mut self, channel: &str, data: &[u8]) -> Option<Vec<u8>> {
        let prefix = channel.strip_suffix(CONTROLLER_INPUT)?;
        let input = ControllerInput::decode(data).ok()?;
        let mut bytes = Vec::new();
        self.component(prefix)?.update(&input).encode(&mut bytes).ok()?;
        Some(bytes)
    }

    fn component(&mut self, prefix: &str) -> Option<&mut Unpacked> {
        if !prefix.is_empty() && !prefix.ends_with('/') {
            return None;
        }
        if !self.0.contains_key(prefix) {
            if self.0.len() == MAX_COMPONENTS {
                return None;
            }
            self.0.insert(prefix.to_owned(), Unpacked::default());
        }
        self.0.get_mut(prefix)
    }
}
