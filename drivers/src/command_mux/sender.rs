//! State of one sender in the command multiplexer.

use super::Ignored;
use lcmtypes::OperatorCommand;

/// A process that sends commands on the channel of a source.
#[derive(Clone, Debug)]
pub(super) struct Sender {
    pub source: usize,
    pub command: OperatorCommand,
    pub arrival_ns: i64,
    /// Time at which the mode of `command` was requested, ns, on the clock of arrivals.
    pub request_ns: i64,
    /// Begin of its emergency stop, ns; `None` if it has none in force.
    pub stop_ns: Option<i64>,
    /// Mode and reason of the last report that its commands are ignored.
    pub reported: Option<(i8, Ignored)>,
}

impl Sender {
    /// A sender after its first command. `is_starting`: the run has just started, so the sender may have started before it.
    pub fn new(source: usize, t_ns: i64, is_starting: bool, command: &OperatorCommand) -> Self {
        let request_ns = match age_ns(command) {
            Some(age) => t_ns.saturating_sub(age),
            // Not the first message of its sender.
            None if is_starting && command.seq > 0 => i64::MIN,
            None => t_ns,
        };
        let command = command.clone();
        Sender { source, command, arrival_ns: t_ns, request_ns, stop_ns: None, reported: None }
    }

    /// `sender_id` of its commands.
    pub fn id(&self) -> i64 {
        self.command.sender_id
    }

    /// Whether its last command is not older than the time-out.
    pub fn is_alive(&self, t_ns: i64, timeout_ns: i64) -> bool {
        t_ns.saturating_sub(self.arrival_ns) <= timeout_ns
    }

    /// Takes its next command; false if it is older than the last one.
    pub fn take(&mut self, t_ns: i64, timeout_ns: i64, command: &OperatorCommand) -> bool {
        let last = &self.command;
        let is_older = command.seq <= last.seq && command.t_ns < last.t_ns;
        let stops = command.mode == OperatorCommand::MODE_DAMPING;
        if is_older && !stops && self.is_alive(t_ns, timeout_ns) {
            return false;
        }
        if command.mode != last.mode || command.t_mode_ns > last.t_mode_ns {
            self.request_ns = t_ns.saturating_sub(age_ns(command).unwrap_or(0));
        }
        self.command.clone_from(command);
        self.arrival_ns = t_ns;
        true
    }
}

/// Age of the mode request when the command was sent, ns; `None` if unknown.
fn age_ns(command: &OperatorCommand) -> Option<i64> {
    (command.t_mode_ns != 0).then(|| command.t_ns.saturating_sub(command.t_mode_ns).max(0))
}
