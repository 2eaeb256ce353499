//! Outcome of operator commands, as REQUEST_REPLY: whether the controller follows the mode that an operator requests.

use crate::command_mux::Source;
use lcmtypes::{ControllerInput, ControllerTick, OperatorCommand, RequestReply, enum_names};
use std::collections::VecDeque;

/// Forwarded commands that are remembered: more than can wait for the real-time thread.
const FORWARDED: usize = 512;

/// Watches commands and ticks, and makes a reply when the outcome of an operator's mode request is new.
#[derive(Debug)]
pub struct OperatorReplies {
    operators: Vec<Operator>,
    /// Operator, seq and t_ns of commands that went to the real-time thread, oldest first.
    forwarded: VecDeque<(usize, i64, i64)>,
}

#[derive(Debug)]
struct Operator {
    channel: String,
    /// Mode and code of the last reply.
    replied: Option<(i8, i8)>,
}

impl OperatorReplies {
    /// For the operators of a run, in the order of the command multiplexer.
    pub fn new(sources: &[Source]) -> Self {
        let operators = sources.iter().map(|source| Operator { channel: source.channel.clone(), replied: None });
        OperatorReplies { operators: operators.collect(), forwarded: VecDeque::with_capacity(FORWARDED) }
    }

    /// Takes a command that was received while `active` is the operator whose commands are followed.
    pub fn received(
        &mut self,
        operator: usize,
        active: usize,
        t_ns: i64,
        command: &OperatorCommand,
    ) -> Option<RequestReply> {
        if operator == active {
            return None;
        }
        let reason = format!("operator {} is active", self.operators.get(active)?.channel);
        let outcome = Outcome { t_ns, tick: -1, code: RequestReply::CODE_REJECTED, reason };
        self.reply(operator, command, outcome)
    }

    /// Takes a command that went to the real-time thread.
    pub fn forwarded(&mut self, operator: usize, command: &OperatorCommand) {
        let new = (operator, command.seq, command.t_ns);
        if self.forwarded.back() != Some(&new) {
            // A sequence that does not increase is that of a restarted operator, whose requests have no reply yet.
            let last = self.forwarded.iter().rev().find(|(of, ..)| *of == operator);
            if let (Some((_, seq, _)), Some(operator)) = (last, self.operators.get_mut(operator))
                && command.seq <= *seq
            {
                operator.replied = None;
            }
            if self.forwarded.len() == FORWARDED {
                self.forwarded.pop_front();
            }
            self.forwarded.push_back(new);
        }
    }

    /// Takes input and result of a tick.
    pub fn tick(&mut self, input: &ControllerInput, tick: &ControllerTick) -> Option<RequestReply> {
        let op = &input.op;
        let sent = |&&(_, seq, t_ns): &&(usize, i64, i64)| (seq, t_ns) == (op.seq, op.t_ns);
        let (operator, ..) = *self.forwarded.iter().rev().find(sent)?;
        let (code, reason) = outcome(op.mode, tick)?;
        let tick_or_none = if code == RequestReply::CODE_DONE { tick.tick } else { -1 };
        self.reply(operator, op, Outcome { t_ns: tick.t_ns, tick: tick_or_none, code, reason })
    }

    fn reply(&mut self, operator: usize, command: &OperatorCommand, outcome: Outcome) -> Option<RequestReply> {
        let Outcome { t_ns, tick, code, reason } = outcome;
        let OperatorCommand { mode, seq: request_id, sender_id, .. } = *command;
        let operator = self.operators.get_mut(operator)?;
        if operator.replied.replace((mode, code)) == Some((mode, code)) {
            return None;
        }
        let kind = RequestReply::KIND_OPERATOR;
        Some(RequestReply { t_ns, tick, sender_id, request_id, kind, code, reason })
    }
}

struct Outcome {
    t_ns: i64,
    tick: i64,
    code: i8,
    reason: String,
}

/// Code and reason for a requested mode, from the tick that consumed the request; `None` while it is not known.
fn outcome(mode: i8, tick: &ControllerTick) -> Option<(i8, String)> {
    let name = enum_names::operator_mode(mode);
    let state = enum_names::mode(tick.mode);
    let fault = enum_names::fault(tick.fault);
    let wrong_state =
        |why: &str| Some((RequestReply::CODE_WRONG_STATE, format!("{name} is not possible in {state}{why}")));
    let out_of_range = |reason| Some((RequestReply::CODE_OUT_OF_RANGE, reason));
    let is_damped = tick.mode == ControllerTick::MODE_DAMPING;
    match (mode, tick.fault) {
        (OperatorCommand::MODE_DAMPING, _) => is_damped.then(|| (RequestReply::CODE_DONE, String::new())),
        (OperatorCommand::MODE_STAND..=OperatorCommand::MODE_IDLE, ControllerTick::FAULT_OPERATOR_REFUSED) => {
            wrong_state("")
        }
        (_, ControllerTick::FAULT_OPERATOR_REFUSED) => out_of_range(format!("mode {mode}: expected 0 to 4")),
        (_, ControllerTick::FAULT_OPERATOR_RANGE | ControllerTick::FAULT_OPERATOR_NOT_FINITE) => {
            out_of_range(fault.to_owned())
        }
        (_, ControllerTick::FAULT_OPERATOR_STALE) => None,
        (_, ControllerTick::FAULT_CONTROLLER) => wrong_state(": no controller is running"),
        _ if is_damped => wrong_state(&format!(": {fault}")),
        _ => Some((RequestReply::CODE_DONE, String::new())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAD: usize = 0;
    const PLANNER: usize = 1;

    fn replies() -> OperatorReplies {
        let source = |channel: &str| Source { channel: channel.to_owned(), priority: 1, timeout_s: 0.1 };
        OperatorReplies::new(&[source("PAD"), source("PLANNER")])
    }

    fn command(mode: i8, seq: i64) -> OperatorCommand {
        OperatorCommand { mode, seq, sender_id: 9, t_ns: seq * 10, ..OperatorCommand::default() }
    }

    /// Code and request of the reply to a command that a tick consumes.
    fn consumed(replies: &mut OperatorReplies, op: &OperatorCommand, mode: i8, fault: i32) -> Option<(i8, i64)> {
        let input = ControllerInput { op: op.clone(), ..ControllerInput::default() };
        let tick = ControllerTick { mode, fault, tick: 40, ..ControllerTick::default() };
        replies.tick(&input, &tick).map(|reply| (reply.code, reply.request_id))
    }

    #[test]
    fn an_outcome_is_reported_once_and_again_when_it_changes() {
        let mut replies = replies();
        let idle = command(OperatorCommand::MODE_IDLE, 3);
        assert_eq!(consumed(&mut replies, &idle, ControllerTick::MODE_STANCE, 0), None, "not sent through this run");
        replies.forwarded(PAD, &idle);
        let refused = ControllerTick::FAULT_OPERATOR_REFUSED;
        let wrong_state = Some((RequestReply::CODE_WRONG_STATE, 3));
        assert_eq!(consumed(&mut replies, &idle, ControllerTick::MODE_DAMPING, refused), wrong_state);
        assert_eq!(consumed(&mut replies, &idle, ControllerTick::MODE_DAMPING, refused), None);
        let idle = command(OperatorCommand::MODE_IDLE, 4);
        replies.forwarded(PAD, &idle);
        assert_eq!(consumed(&mut replies, &idle, ControllerTick::MODE_DAMPING, refused), None, "the same outcome");
        assert_eq!(consumed(&mut replies, &idle, ControllerTick::MODE_IDLE, 0), Some((RequestReply::CODE_DONE, 4)));
    }

    #[test]
    fn a_restarted_operator_gets_a_reply_to_the_same_request() {
        let mut replies = replies();
        for (seq, reply) in
            [(7, Some((RequestReply::CODE_DONE, 7))), (8, None), (0, Some((RequestReply::CODE_DONE, 0)))]
        {
            let stand = command(OperatorCommand::MODE_STAND, seq);
            replies.forwarded(PAD, &stand);
            assert_eq!(consumed(&mut replies, &stand, ControllerTick::MODE_STANCE, 0), reply, "seq {seq}");
        }
    }

    #[test]
    fn an_emergency_stop_is_done_when_the_controller_damps() {
        let mut replies = replies();
        let stop = command(OperatorCommand::MODE_DAMPING, 1);
        replies.forwarded(PLANNER, &stop);
        assert_eq!(consumed(&mut replies, &stop, ControllerTick::MODE_WALK, 0), None);
        let (damping, fault) = (ControllerTick::MODE_DAMPING, ControllerTick::FAULT_OPERATOR);
        assert_eq!(consumed(&mut replies, &stop, damping, fault), Some((RequestReply::CODE_DONE, 1)));
    }

    #[test]
    fn an_operator_that_is_not_active_is_rejected() {
        let mut replies = replies();
        let walk = command(OperatorCommand::MODE_WALK, 5);
        assert_eq!(replies.received(PAD, PAD, 0, &walk), None);
        let reply = replies.received(PLANNER, PAD, 0, &walk).unwrap();
        assert_eq!((reply.code, reply.sender_id), (RequestReply::CODE_REJECTED, 9));
        assert!(reply.reason.contains("PAD"), "{}", reply.reason);
        assert_eq!(replies.received(PLANNER, PAD, 0, &command(OperatorCommand::MODE_WALK, 6)), None);
    }

    #[test]
    fn values_and_modes_out_of_range_are_named() {
        for (mode, fault) in [(77, ControllerTick::FAULT_OPERATOR_REFUSED), (1, ControllerTick::FAULT_OPERATOR_RANGE)] {
            let (code, reason) = outcome(mode, &ControllerTick { fault, ..ControllerTick::default() }).unwrap();
            assert_eq!(code, RequestReply::CODE_OUT_OF_RANGE);
            assert!(!reason.is_empty());
        }
    }
}
