//! Requests to change controller parameters during a run: those of a scenario, and the handler for requests of any sender.

use crate::checks::{BadKey, check_range, to_ns};
use crate::robot_files::toml_line;
use controller::Component;
use controller::handover::{ChangeError, Parameters};
use controller::params::{ParamsError, check_key};
use lcmtypes::{Event, ParameterChange, ParameterRequest, RequestReply, RunInfo};
use serde::Deserialize;
use std::fmt::Display;

/// Source of the EVENTs about parameters.
pub const SOURCE: &str = "parameters";

/// Largest length of key and value together, bytes: the real-time thread copies them.
const MAX_LENGTH: usize = 4096;
/// Characters of an oversized key that a refusal quotes.
const QUOTED: usize = 80;

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
        if let Err(ParamsError::UnknownKey { key, hint }) = check_key(&self.key) {
            return Err(BadKey { key: "key", found: key, expected: format!("the key of a parameter{hint}") });
        }
        let seq = i64::try_from(seq).unwrap_or(i64::MAX);
        let value = self.value.as_str().map_or_else(|| self.value.to_string(), toml_line);
        Ok(ParameterRequest { t_ns: to_ns(self.t_s), sender_id: 0, seq, key: self.key, value })
    }
}

/// Checks requests one after the other, each on top of those that were accepted before. It builds controllers, which takes milliseconds and
/// allocates; do not call it from a real-time thread.
#[derive(Debug)]
pub struct ParameterRequestHandler {
    parameters: Parameters,
    run_id: i64,
}

/// A change that is ready to take effect.
pub struct Proposal {
    /// The controller with the new parameters.
    pub controller: Component,
    /// The change; time and tick are set when the controller takes over.
    pub change: ParameterChange,
    /// All parameters after the change, for [`ParameterRequestHandler::accept`].
    pub parameters: Parameters,
}

/// Why a request was not carried out.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// `request_reply_t` CODE_*.
    pub code: i8,
    /// One sentence.
    pub reason: String,
}

impl Refusal {
    /// A refusal with `CODE_REJECTED`.
    pub fn rejected(reason: String) -> Self {
        Refusal { code: RequestReply::CODE_REJECTED, reason }
    }

    /// A refusal to set `key` to `value`.
    pub fn of_parameter(key: &str, value: &str, code: i8, why: &dyn Display) -> Self {
        Refusal { code, reason: format!("{key} = {value} rejected: {why}") }
    }
}

impl ParameterRequestHandler {
    /// A handler for a run with the parameters of `info`.
    pub fn new(info: &RunInfo) -> Self {
        ParameterRequestHandler { parameters: Parameters::new(info), run_id: info.run_id }
    }

    /// Checks a request and builds the controller with the new parameter.
    ///
    /// # Errors
    /// [`Refusal`]: the key is unknown or cannot be changed, or the value has the wrong type, is out of range, or is too long.
    pub fn propose(&self, request: &ParameterRequest) -> Result<Proposal, Refusal> {
        check_length(request)?;
        let ParameterRequest { seq, key, value, .. } = request;
        let proposed = self.parameters.with(key, value).and_then(|parameters| Ok((parameters.build()?, parameters)));
        let (controller, parameters) =
            proposed.map_err(|error| Refusal::of_parameter(key, value, code(&error), &error))?;
        let change = ParameterChange {
            t_ns: 0,
            tick: -1,
            run_id: self.run_id,
            seq: *seq,
            key: key.clone(),
            value: value.clone(),
        };
        Ok(Proposal { controller, change, parameters })
    }

    /// Makes the parameters of a proposal the present ones, after its controller has taken over.
    pub fn accept(&mut self, parameters: Parameters) {
        self.parameters = parameters;
    }
}

/// Checks that key and value of a request are one line of limited length.
///
/// # Errors
/// [`Refusal`] with `CODE_OUT_OF_RANGE`.
pub fn check_length(request: &ParameterRequest) -> Result<(), Refusal> {
    let ParameterRequest { key, value, .. } = request;
    let length = key.len() + value.len();
    if length <= MAX_LENGTH && !value.contains('\n') {
        return Ok(());
    }
    let start: String = key.chars().take(QUOTED).collect();
    let reason = format!("{start} rejected: {length} bytes, expected one line of at most {MAX_LENGTH}");
    Err(Refusal { code: RequestReply::CODE_OUT_OF_RANGE, reason })
}

/// `request_reply_t` CODE_* for an error.
fn code(error: &ChangeError) -> i8 {
    match error {
        ChangeError::Params(ParamsError::UnknownKey { .. }) => RequestReply::CODE_UNKNOWN_NAME,
        ChangeError::Params(_) | ChangeError::Load(_) => RequestReply::CODE_OUT_OF_RANGE,
        _ => RequestReply::CODE_REJECTED,
    }
}

/// Whether a parameter belongs to the safety checks.
fn is_safety(key: &str) -> bool {
    key.starts_with("safety.")
}

/// The EVENT for the outcome of a request, without sender and number. An accepted change of `safety.*` is a warning.
pub fn event(t_ns: i64, tick: i64, outcome: Result<&ParameterChange, &Refusal>) -> Event {
    let (level, text) = match outcome {
        // A changed limit of the safety checks must not go unnoticed.
        Ok(ParameterChange { key, value, .. }) if is_safety(key) => {
            (Event::LEVEL_WARNING, format!("safety limit changed: {key} = {value} from this tick on"))
        }
        Ok(ParameterChange { key, value, .. }) => (Event::LEVEL_INFO, format!("{key} = {value} from this tick on")),
        Err(refusal) => (Event::LEVEL_WARNING, refusal.reason.clone()),
    };
    Event { t_ns, tick, level, source: SOURCE.to_owned(), text, ..Event::default() }
}

/// The REQUEST_REPLY for the outcome of a request.
pub fn reply(request: &ParameterRequest, t_ns: i64, outcome: Result<&ParameterChange, &Refusal>) -> RequestReply {
    let (tick, code, reason) = match outcome {
        Ok(change) => (change.tick, RequestReply::CODE_DONE, String::new()),
        Err(refusal) => (-1, refusal.code, refusal.reason.clone()),
    };
    let kind = RequestReply::KIND_PARAMETER;
    RequestReply { t_ns, tick, sender_id: request.sender_id, request_id: request.seq, kind, code, reason }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_accepted_change_of_a_safety_limit_is_a_warning() {
        for (key, level) in [("safety.max_tilt", Event::LEVEL_WARNING), ("trunk.kp", Event::LEVEL_INFO)] {
            let change = ParameterChange { key: key.to_owned(), value: "0.7".to_owned(), ..ParameterChange::default() };
            assert_eq!(event(0, 0, Ok(&change)).level, level);
        }
    }

    #[test]
    fn oversized_values_are_refused_with_a_short_reason() {
        let handler = ParameterRequestHandler::new(&RunInfo::default());
        for value in ["9".repeat(5000), "[1.0,\n2.0]".to_owned()] {
            let request = ParameterRequest { key: "trunk.kp".to_owned(), value, ..ParameterRequest::default() };
            let Refusal { code, reason } = handler.propose(&request).err().unwrap();
            assert_eq!(code, RequestReply::CODE_OUT_OF_RANGE);
            assert!(reason.contains("trunk.kp") && reason.len() < 200, "{reason}");
        }
    }
}
