//! The time that every tool shows: seconds since the first tick of the run.

use super::runs::{first_integer, run_id};
use super::sequence_gaps::sequence_number;
use super::{EventRef, Health, LogReader};
use crate::Error;
use lcmtypes::channels::{self, CONTROLLER_INPUT, Class, RUN_INFO};
use std::path::Path;

/// Runs whose RUN_INFO is remembered.
const MAX_RUN_INFOS: usize = 100;

/// What time zero of a log is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Zero {
    /// The first tick of the run (tick 0), whether or not the log contains it.
    FirstTick,
    /// The first CONTROLLER_INPUT of a log that begins later than tick 0 and has no RUN_INFO.
    FirstTickOfLog,
    /// The first event of a log without CONTROLLER_INPUT.
    FirstEvent,
}

impl Zero {
    /// For texts: `times are since ...`.
    pub fn text(self) -> &'static str {
        match self {
            Zero::FirstTick => "the run's first tick",
            Zero::FirstTickOfLog => "the first tick in the log",
            Zero::FirstEvent => "the log's first event",
        }
    }
}

/// Converts the times of one log to times since the first tick of its run.
///
/// A log has two clocks. The controller's messages contain `t_ns`, the controller's monotonic clock. Each event also has the time at
/// which it was received or written, in the clock of the recorder. The offset between the two is taken from the first
/// CONTROLLER_INPUT of the log. In a lockstep log both clocks are the simulation time.
///
/// Time zero is `t_ns` of tick 0. A log that begins later takes it from RUN_INFO, so that a trimmed log shows the times of the whole
/// run. See [`Zero`] for logs that have neither.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RunClock {
    zero: Zero,
    /// Time zero in the controller's clock, ns.
    first_tick_ns: i64,
    /// Time zero in the clock of the log's events, ns.
    origin_ns: i64,
}

impl RunClock {
    /// Reads a log up to its first tick, and up to RUN_INFO if the log begins later than tick 0.
    ///
    /// # Errors
    /// As [`LogReader::open`], or [`Error::Io`] while reading.
    pub fn read(log: &Path) -> Result<Self, Error> {
        let (mut reader, mut found) = (LogReader::open(log)?, RunClockFinder::default());
        let mut health = Health::default();
        while let Some(item) = reader.read()? {
            let Some(event) = health.note(item) else { continue };
            if found.see(&event) {
                break;
            }
        }
        Ok(found.clock())
    }

    /// What time zero is.
    pub fn zero(&self) -> Zero {
        self.zero
    }

    /// Time zero in the controller's clock, ns; `None` for a log without CONTROLLER_INPUT.
    pub fn first_tick_ns(&self) -> Option<i64> {
        (self.zero != Zero::FirstEvent).then_some(self.first_tick_ns)
    }

    /// Time zero in the clock of the log's events, ns.
    pub fn origin_ns(&self) -> i64 {
        self.origin_ns
    }

    /// Time of a controller's message, ns since time zero. `t_ns`: the field of the message.
    pub fn since_ns(&self, t_ns: i64) -> i64 {
        t_ns.saturating_sub(self.first_tick_ns)
    }

    /// Time of an event, ns since time zero: `t_ns` of a controller's message, the event's own time for any other.
    ///
    /// A message of the controller therefore has the same time in every tool, however late the recorder received it.
    pub fn of_event(&self, event: &EventRef<'_>) -> i64 {
        match controller_time(event).filter(|_| self.zero != Zero::FirstEvent) {
            Some(t_ns) => self.since_ns(t_ns),
            None => self.of_log_time(event.t_ns),
        }
    }

    /// An event's own time, ns since time zero.
    pub fn of_log_time(&self, event_t_ns: i64) -> i64 {
        event_t_ns.saturating_sub(self.origin_ns)
    }
}

/// Times of the events of one log, which are given in the order of the log.
///
/// An event that is no message of the controller has the time of the last CONTROLLER_INPUT before it, plus the time in between by the clock of the recorder. So
/// a clock of the recorder that steps moves only the events up to the next input.
#[derive(Debug, Clone)]
pub struct EventTimes {
    clock: RunClock,
    /// The last input: time of its event, and time since the first tick, ns.
    last_input: Option<(i64, i64)>,
}

impl EventTimes {
    /// The times of the events of the log of a clock.
    pub fn new(clock: RunClock) -> Self {
        EventTimes { clock, last_input: None }
    }

    /// Time of the next event, ns since time zero: its own for a message of the controller, else that of its place in the log.
    pub fn of(&mut self, event: &EventRef<'_>) -> i64 {
        let place = self.of_place(event);
        controller_time(event)
            .filter(|_| self.clock.zero != Zero::FirstEvent)
            .map_or(place, |t_ns| self.clock.since_ns(t_ns))
    }

    /// Time of the place of the next event in the log, ns since time zero.
    pub fn of_place(&mut self, event: &EventRef<'_>) -> i64 {
        if **event.channel == *CONTROLLER_INPUT
            && let Some(t_ns) = controller_time(event)
        {
            self.last_input = Some((event.t_ns, self.clock.since_ns(t_ns)));
        }
        match self.last_input {
            Some((event_t_ns, since_ns)) => since_ns.saturating_add(event.t_ns.saturating_sub(event_t_ns).max(0)),
            None => self.clock.of_log_time(event.t_ns),
        }
    }
}

/// Finds the [`RunClock`] of a log whose events are read for another purpose.
#[derive(Debug, Clone, Default)]
pub struct RunClockFinder {
    first_event_ns: Option<i64>,
    /// `run_id` and time of the first RUN_INFO of each run: a log may begin with that of an earlier one.
    run_infos: Vec<(i64, i64)>,
    first_input: Option<FirstInput>,
}

#[derive(Debug, Clone, Copy)]
struct FirstInput {
    run_id: Option<i64>,
    event_t_ns: i64,
    t_ns: i64,
    tick: i64,
}

impl RunClockFinder {
    /// Takes the next event of the log. True once no later event can change the result.
    pub fn see(&mut self, event: &EventRef<'_>) -> bool {
        self.first_event_ns.get_or_insert(event.t_ns);
        match &**event.channel {
            RUN_INFO if self.run_infos.len() < MAX_RUN_INFOS => {
                if let Some(found) = run_id(RUN_INFO, event.data).zip(first_integer(event.data))
                    && self.run_infos.iter().all(|(known, _)| *known != found.0)
                {
                    self.run_infos.push(found);
                }
            }
            CONTROLLER_INPUT if self.first_input.is_none() => {
                self.first_input = first_integer(event.data).zip(sequence_number(event.data)).map(|(t_ns, tick)| {
                    FirstInput { run_id: run_id(CONTROLLER_INPUT, event.data), event_t_ns: event.t_ns, t_ns, tick }
                });
            }
            _ => {}
        }
        self.first_input.is_some_and(|input| input.tick == 0 || self.run_info_ns(&input).is_some())
    }

    /// Time of the first tick, from the RUN_INFO of the run of an input.
    fn run_info_ns(&self, input: &FirstInput) -> Option<i64> {
        self.run_infos.iter().find(|(run_id, _)| Some(*run_id) == input.run_id).map(|(_, t_ns)| *t_ns)
    }

    /// The clock, from the events seen so far.
    pub fn clock(&self) -> RunClock {
        let first_event_ns = self.first_event_ns.unwrap_or(0);
        let Some(input @ FirstInput { event_t_ns, t_ns, tick, .. }) = self.first_input else {
            return RunClock { zero: Zero::FirstEvent, first_tick_ns: first_event_ns, origin_ns: first_event_ns };
        };
        let (zero, first_tick_ns) = match self.run_info_ns(&input) {
            _ if tick == 0 => (Zero::FirstTick, t_ns),
            Some(run_ns) if run_ns <= t_ns => (Zero::FirstTick, run_ns),
            _ => (Zero::FirstTickOfLog, t_ns),
        };
        let origin_ns = event_t_ns.saturating_sub(t_ns.saturating_sub(first_tick_ns));
        RunClock { zero, first_tick_ns, origin_ns }
    }
}

/// `t_ns` of a message that a controller consumed, computed or timed; `None` for any other.
pub(super) fn controller_time(event: &EventRef<'_>) -> Option<i64> {
    let known = channels::find(channels::split(event.channel).1)?;
    let is_of_controller = known.stage.is_some() || known.class == Class::Timing;
    first_integer(event.data).filter(|_| is_of_controller)
}

#[cfg(test)]
mod tests {
    use super::*;
    use lcmtypes::{ControllerInput, Message, RunInfo};
    use std::sync::Arc;

    /// A monotonic clock after some days, and a recorder that uses the Unix epoch.
    const T0_NS: i64 = 300_000_000_000_000;
    const RECORDER_NS: i64 = 1_700_000_000_000_000_000;

    fn message(t_ns: i64, tick: i64) -> Vec<u8> {
        let mut bytes = Vec::new();
        ControllerInput { t_ns, tick, run_id: 5, ..Default::default() }.encode(&mut bytes).unwrap();
        bytes
    }

    fn run_info(run_id: i64, t_ns: i64) -> Vec<u8> {
        let mut bytes = Vec::new();
        RunInfo { t_ns, run_id, ..Default::default() }.encode(&mut bytes).unwrap();
        bytes
    }

    fn clock(events: &[(&str, i64, Vec<u8>)]) -> RunClock {
        let mut found = RunClockFinder::default();
        for (channel, t_ns, data) in events {
            let channel = Arc::from(*channel);
            found.see(&EventRef { channel: &channel, t_ns: *t_ns, number: 0, data, offset: 0, source: None });
        }
        found.clock()
    }

    #[test]
    fn time_zero_is_tick_0_wherever_the_log_begins() {
        let measured = ("ROBOT_STATE", RECORDER_NS, message(T0_NS - 1_000_000_000, 0));
        let earlier = (RUN_INFO, RECORDER_NS, run_info(4, 7));
        let info = (RUN_INFO, RECORDER_NS + 1_001_000_000, run_info(5, T0_NS));
        let input = |tick: i64| {
            let since_ns = tick * 1_000_000;
            (CONTROLLER_INPUT, RECORDER_NS + 1_000_500_000 + since_ns, message(T0_NS + since_ns, tick))
        };
        let (whole, late) = (clock(&[measured.clone(), input(0)]), clock(&[measured, earlier, input(4812), info]));
        assert_eq!((whole.zero(), whole.first_tick_ns()), (Zero::FirstTick, Some(T0_NS)));
        assert_eq!(whole, late);
        assert_eq!(whole.since_ns(T0_NS + 4_812_000_000), 4_812_000_000);
        assert_eq!(whole.of_log_time(RECORDER_NS), -1_000_500_000);
        // A message of the controller has its own time, even if the recorder received it 3 s later.
        let channel = Arc::from(channels::ROBOT_COMMAND);
        let (t_ns, data) = (RECORDER_NS + 5_000_000_000, message(T0_NS + 2_000_000_000, 2000));
        let command = EventRef { channel: &channel, t_ns, number: 0, data: &data, offset: 0, source: None };
        assert_eq!(whole.of_event(&command), 2_000_000_000);
    }

    #[test]
    fn logs_without_a_first_tick_report_their_time_zero() {
        let input = (CONTROLLER_INPUT, 7_000, message(5_000, 3));
        let no_info = clock(&[("A", 6_000, Vec::new()), input]);
        assert_eq!((no_info.zero(), no_info.origin_ns(), no_info.since_ns(5_000)), (Zero::FirstTickOfLog, 7_000, 0));
        let no_run = clock(&[("A", 6_000, Vec::new()), ("B", 9_000, vec![1])]);
        assert_eq!((no_run.zero(), no_run.first_tick_ns()), (Zero::FirstEvent, None));
        assert_eq!(no_run.of_log_time(9_000), 3_000);
    }
}
