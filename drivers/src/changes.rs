//! Parameters that are asked to be otherwise while the controller runs: the wishes of a scenario, and what answers any wish.

use crate::scenario::to_ns;
use crate::terrain::{BadKey, check_range};
use controller::Controller;
use controller::change::Parameters;
use lcmtypes::{Event, ParameterChange, ParameterRequest, RunInfo};
use serde::Deserialize;

/// Who answers, in events.
pub const SOURCE: &str = "parameters";

/// A `[[parameter]]` entry.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ParameterEntry {
    t_s: f64,
    key: String,
    value: toml::Value,
}

impl ParameterEntry {
    pub(crate) fn resolve(self, seq: usize) -> Result<ParameterRequest, BadKey> {
        check_range("t_s", &[self.t_s], 0.0..=36_000.0)?;
        let seq = i64::try_from(seq).unwrap_or(i64::MAX);
        Ok(ParameterRequest { t_ns: to_ns(self.t_s), seq, key: self.key, value: self.value.to_string() })
    }
}

/// Answers wishes one after the other, each on top of those before it. Builds controllers, so it has no place on a real-time thread.
#[derive(Debug)]
pub struct ParameterDesk {
    parameters: Parameters,
}

impl ParameterDesk {
    /// For a run.
    pub fn new(info: &RunInfo) -> Self {
        ParameterDesk { parameters: Parameters::new(info) }
    }

    /// The controller that is to take over, or the text of the EVENT that says why none is.
    pub fn answer(&mut self, request: &ParameterRequest) -> Result<Box<dyn Controller>, String> {
        let ParameterRequest { key, value, .. } = request;
        self.parameters.change(key, value).map_err(|error| format!("{key} = {value} is refused: {error}"))
    }
}

/// The EVENT of an answer: from a tick on, or why not.
pub fn event(t_ns: i64, tick: i64, answer: Result<&ParameterChange, &String>) -> Event {
    let (level, text) = match answer {
        Ok(ParameterChange { key, value, .. }) => (Event::LEVEL_INFO, format!("{key} = {value} from this tick on")),
        Err(why) => (Event::LEVEL_WARNING, why.clone()),
    };
    Event { t_ns, tick, level, source: SOURCE.to_owned(), text }
}
