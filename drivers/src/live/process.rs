//! A component in a process of its own: it takes its inputs from the bus and publishes its results there.

use crate::DriverError;
use crate::stage_clock::StageClock;
use controller::{Component, Outbox};
use lcmtypes::bus::Bus;
use lcmtypes::{ControllerInput, Message, channels};
use std::time::Duration;

/// Longest wait for one message.
const POLL: Duration = Duration::from_millis(5);

/// What a component in a process of its own has done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ProcessReport {
    /// Computed ticks.
    pub ticks: i64,
    /// Messages that the bus did not accept.
    pub unpublished: u64,
    /// Messages on its input channel that cannot be decoded, or are of another run.
    pub foreign: u64,
    /// Tick of an input that did not arrive, after which it has ended: its state would not be that of a replay.
    pub lost_input: Option<i64>,
}

/// Runs a component in this process until `is_over`, or until one of its inputs is lost.
///
/// - `name`: name of the component, in front of its channels.
/// - `pause`: wait before each tick, to try out late results.
///
/// # Errors
/// If the bus fails.
pub fn run_component(
    bus: &mut dyn Bus,
    name: &str,
    mut component: Component,
    pause: Duration,
    is_over: &dyn Fn() -> bool,
) -> Result<ProcessReport, DriverError> {
    let of_component = |channel: &str| format!("{name}/{channel}");
    let input_channel = of_component(channels::CONTROLLER_INPUT);
    bus.subscribe(&input_channel)?;
    let mut clock = StageClock::new(component.stages().len());
    let (mut outbox, mut input, mut bytes) = (Outbox::new(), ControllerInput::default(), Vec::new());
    let (mut report, mut run_id) = (ProcessReport::default(), None);
    loop {
        // The inputs that have arrived by then are computed too.
        let has_ended = is_over();
        let messages = bus.handle(POLL)?;
        if has_ended && messages.is_empty() {
            return Ok(report);
        }
        for message in messages {
            if message.channel != input_channel {
                continue;
            }
            let decoded = input.decode_into(&message.data).is_ok();
            // The first input of a run binds this process to it.
            if !decoded || *run_id.get_or_insert(input.run_id) != input.run_id || input.tick < report.ticks {
                report.foreign += 1;
                continue;
            }
            if input.tick != report.ticks {
                report.lost_input = Some(report.ticks);
                return Ok(report);
            }
            if !pause.is_zero() {
                std::thread::sleep(pause);
            }
            clock.start();
            component.step_probed(&input, &mut outbox, &mut clock);
            bytes.clear();
            clock.timing(input.t_ns, input.tick).encode(&mut bytes)?;
            // CONTROLLER_TICK last: it says that the results of the tick are complete.
            let is_last = |channel: &str| channel == channels::CONTROLLER_TICK;
            let first = outbox.iter().filter(|(channel, _)| !is_last(channel));
            let last = outbox.iter().filter(|(channel, _)| is_last(channel));
            for (channel, data) in first.chain([(channels::TIMING, &bytes[..])]).chain(last) {
                report.unpublished += u64::from(bus.publish(&of_component(channel), data).is_err());
            }
            report.ticks += 1;
        }
    }
}
