//! The runs of a log: a recording can contain several, one after the other, and each is replayed and reported on its own.
//!
//! A run is known by its `run_id`, which RUN_INFO, inputs, commands, ticks and parameter changes contain. RUN_INFO or an input begins a run. Every event
//! without `run_id` belongs to the run of the last input before it, or of a first RUN_INFO after that; events before the first run belong to it. An
//! unknown `run_id` of another message begins no run, since any program can send one: the message belongs to the next run, whose first commands can
//! be recorded before its RUN_INFO.

use super::EventRef;
use super::sequence_gaps::sequence_number;
use lcmtypes::channels::{CONTROLLER_INPUT, CONTROLLER_TICK, PARAMETER_CHANGE, ROBOT_COMMAND, RUN_INFO};
use lcmtypes::{ControllerInput, ControllerTick, Message, ParameterChange, RobotCommand, RunInfo};

/// Runs that are kept apart; later ones count as the last of them.
const MAX_RUNS: usize = 1000;

/// One run of a log.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct RunSummary {
    /// Number of the run in the log, from 1: the value of `--run`.
    pub number: usize,
    /// `run_id`, hexadecimal.
    pub run_id: String,
    /// Controller, from RUN_INFO; `None` without one.
    pub controller: Option<String>,
    /// Robot, from RUN_INFO.
    pub robot: Option<String>,
    /// Scenario, from RUN_INFO.
    pub scenario: Option<String>,
    /// Ticks with an input.
    pub ticks: u64,
    /// Tick of the first input.
    pub first_tick: Option<i64>,
    /// Tick of the last input.
    pub last_tick: Option<i64>,
    /// Time of the first input, clock of the controller, ns.
    pub first_t_ns: Option<i64>,
    /// Time of the last input, clock of the controller, ns.
    pub last_t_ns: Option<i64>,
}

/// Finds the runs of a log whose events are read in order.
#[derive(Debug, Clone, Default)]
pub struct Runs {
    ids: Vec<i64>,
    summaries: Vec<RunSummary>,
    current: usize,
}

impl Runs {
    /// Takes the next event; returns the index of its run, from 0.
    pub fn see(&mut self, event: &EventRef<'_>) -> usize {
        let Some(run_id) = run_id(event.channel, event.data) else { return self.current };
        let begins = [RUN_INFO, CONTROLLER_INPUT].contains(&&**event.channel);
        let index = match self.ids.iter().position(|known| *known == run_id) {
            Some(index) => index,
            None if self.ids.len() == MAX_RUNS => MAX_RUNS - 1,
            None if begins => {
                self.current = self.add(run_id);
                self.current
            }
            None => return self.ids.len(),
        };
        if **event.channel == *CONTROLLER_INPUT {
            self.current = index;
        }
        let run = &mut self.summaries[index];
        match &**event.channel {
            CONTROLLER_INPUT => {
                run.ticks += 1;
                let (tick, t_ns) = (sequence_number(event.data), first_integer(event.data));
                (run.first_tick, run.last_tick) = (run.first_tick.or(tick), tick);
                (run.first_t_ns, run.last_t_ns) = (run.first_t_ns.or(t_ns), t_ns);
            }
            RUN_INFO if run.controller.is_none() => {
                if let Ok(info) = RunInfo::decode(event.data) {
                    (run.controller, run.robot) = (Some(info.controller().to_owned()), Some(info.robot));
                    run.scenario = Some(info.scenario_name);
                }
            }
            _ => {}
        }
        index
    }

    fn add(&mut self, run_id: i64) -> usize {
        self.ids.push(run_id);
        self.summaries.push(RunSummary {
            number: self.ids.len(),
            run_id: format!("{run_id:016x}"),
            controller: None,
            robot: None,
            scenario: None,
            ticks: 0,
            first_tick: None,
            last_tick: None,
            first_t_ns: None,
            last_t_ns: None,
        });
        self.ids.len() - 1
    }

    /// The runs so far.
    pub fn summaries(&self) -> &[RunSummary] {
        &self.summaries
    }
}

/// `run_id` of a message; `None` if its type has none, or if it is not of this build's type.
pub(crate) fn run_id(channel: &str, message: &[u8]) -> Option<i64> {
    let channel = channel.rsplit_once('/').map_or(channel, |(_, name)| name);
    // `run_id` is the field after `t_ns`, or after `tick` if the type has one.
    let (fingerprint, offset) = match channel {
        RUN_INFO => (RunInfo::FINGERPRINT, 16),
        CONTROLLER_INPUT => (ControllerInput::FINGERPRINT, 24),
        CONTROLLER_TICK => (ControllerTick::FINGERPRINT, 24),
        ROBOT_COMMAND => (RobotCommand::FINGERPRINT, 24),
        PARAMETER_CHANGE => (ParameterChange::FINGERPRINT, 24),
        _ => return None,
    };
    let is_of_type = super::fingerprint(message) == Some(fingerprint);
    let bytes = message.get(offset..)?.first_chunk().filter(|_| is_of_type)?;
    Some(i64::from_be_bytes(*bytes))
}

/// The first field of a message, which is `int64_t t_ns` in every type of the stack.
pub(super) fn first_integer(message: &[u8]) -> Option<i64> {
    message.get(8..)?.first_chunk().map(|bytes| i64::from_be_bytes(*bytes))
}
