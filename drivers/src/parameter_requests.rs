//! Parameters that are asked to be otherwise while the controller runs: the wishes of a scenario, and what answers any wish.

use crate::scenario::to_ns;
use crate::terrain::{BadKey, check_range};
use controller::Controller;
use controller::handover::Parameters;
use lcmtypes::{Event, ParameterChange, ParameterRequest, RunInfo};
use serde::Deserialize;

/// Who answers, in events.
pub const SOURCE: &str = "parameters";

/// Longest key and value together, bytes: a change goes through the real-time thread.
const MAX_LENGTH: usize = 4096;

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

/// Answers wishes one after the other, each on top of those that were granted before. Builds controllers, so it has no place on a real-time
/// thread.
#[derive(Debug)]
pub struct ParameterRequestHandler {
    parameters: Parameters,
}

/// What a wish comes to.
pub struct Proposal {
    /// The controller that is to take over.
    pub controller: Box<dyn Controller>,
    /// The change, whose time and tick are those of the take-over.
    pub change: ParameterChange,
    /// The parameters then, for [`ParameterRequestHandler::granted`].
    pub parameters: Parameters,
}

impl ParameterRequestHandler {
    /// For a run.
    pub fn new(info: &RunInfo) -> Self {
        ParameterRequestHandler { parameters: Parameters::new(info) }
    }

    /// What is to take over, or the text of the EVENT that says why nothing does.
    pub fn answer(&self, request: &ParameterRequest) -> Result<Proposal, String> {
        let ParameterRequest { seq, key, value, .. } = request;
        let length = key.len() + value.len();
        if length > MAX_LENGTH || value.contains('\n') {
            let start: String = key.chars().take(80).collect();
            return Err(format!(
                "{start} is refused: a value of {length} bytes, expected one line of at most {MAX_LENGTH}"
            ));
        }
        let proposed = self.parameters.with(key, value).and_then(|parameters| Ok((parameters.build()?, parameters)));
        let (controller, parameters) = proposed.map_err(|why| refusal(key, value, &why))?;
        let change =
            ParameterChange { seq: *seq, key: key.clone(), value: value.clone(), ..ParameterChange::default() };
        Ok(Proposal { controller, change, parameters })
    }

    /// A proposal has taken over.
    pub fn granted(&mut self, parameters: Parameters) {
        self.parameters = parameters;
    }
}

/// The text of an EVENT that says why a parameter stays as it is.
pub fn refusal(key: &str, value: &str, why: &dyn std::fmt::Display) -> String {
    format!("{key} = {value} is refused: {why}")
}

/// The EVENT of an answer: from a tick on, or why not.
pub fn event(t_ns: i64, tick: i64, answer: Result<&ParameterChange, &String>) -> Event {
    let (level, text) = match answer {
        Ok(ParameterChange { key, value, .. }) => (Event::LEVEL_INFO, format!("{key} = {value} from this tick on")),
        Err(why) => (Event::LEVEL_WARNING, why.clone()),
    };
    Event { t_ns, tick, level, source: SOURCE.to_owned(), text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_would_not_fit_a_tick_is_refused() {
        let desk = ParameterRequestHandler::new(&RunInfo::default());
        for value in ["9".repeat(5000), "[1.0,\n2.0]".to_owned()] {
            let wish = ParameterRequest { key: "trunk.kp".to_owned(), value, ..ParameterRequest::default() };
            let why = desk.answer(&wish).err().unwrap();
            assert!(why.starts_with("trunk.kp is refused: a value of ") && why.len() < 200, "{why}");
        }
    }
}
