//! Outcome of operator commands, as REQUEST_REPLY: whether the controller follows the mode that an operator requests.

use lcmtypes::{ControllerTick, OperatorCommand, RequestReply, TickInput, enum_names};
use std::collections::VecDeque;

/// Forwarded commands that are remembered: more than can wait for the real-time thread.
const FORWARDED: usize = 512;
/// Senders whose last reply is remembered.
const SENDERS: usize = 64;

/// Watches commands and ticks, and makes a reply when the outcome of an operator's mode request is new.
#[derive(Debug)]
pub struct OperatorReplies {
    /// Identity of the commands that went to the real-time thread, oldest first.
    forwarded: VecDeque<Forwarded>,
    /// Last reply to each sender, oldest first.
    replied: VecDeque<Replied>,
}

/// A command in transit: its sender, its number, and its arrival, ns.
type Forwarded = (i64, i64, i64);

#[derive(Debug)]
struct Replied {
    sender_id: i64,
    /// seq of the command.
    seq: i64,
    mode: i8,
    code: i8,
}

impl OperatorReplies {
    /// For a run without commands yet.
    pub fn new() -> Self {
        OperatorReplies { forwarded: VecDeque::with_capacity(FORWARDED), replied: VecDeque::new() }
    }

    /// Takes a command that is not followed, and the reason.
    pub fn ignored(&mut self, t_ns: i64, command: &OperatorCommand, reason: String) -> Option<RequestReply> {
        self.reply(command, Outcome { t_ns, tick: -1, code: RequestReply::CODE_REJECTED, reason })
    }

    /// Takes a command that went to the real-time thread; `arrival_ns` as in CONTROLLER_INPUT.
    pub fn forwarded(&mut self, arrival_ns: i64, command: &OperatorCommand) {
        let new = (command.sender_id, command.seq, arrival_ns);
        if self.forwarded.back() != Some(&new) {
            if self.forwarded.len() == FORWARDED {
                self.forwarded.pop_front();
            }
            self.forwarded.push_back(new);
        }
    }

    /// Takes input and result of a tick. A result of another tick than the input is ignored: its request is unknown.
    pub fn tick(&mut self, input: &TickInput, tick: &ControllerTick) -> Option<RequestReply> {
        let op = &input.op;
        let consumed = (op.sender_id, op.seq, input.t_op_ns);
        if input.tick != tick.tick || !self.forwarded.contains(&consumed) {
            return None;
        }
        let (code, reason) = outcome(op.mode, tick)?;
        let tick_or_none = if code == RequestReply::CODE_DONE { tick.tick } else { -1 };
        self.reply(op, Outcome { t_ns: tick.t_ns, tick: tick_or_none, code, reason })
    }

    fn reply(&mut self, command: &OperatorCommand, outcome: Outcome) -> Option<RequestReply> {
        let Outcome { t_ns, tick, code, reason } = outcome;
        let OperatorCommand { mode, seq, sender_id, .. } = *command;
        let known = self.replied.iter().position(|replied| replied.sender_id == sender_id);
        let last = known.and_then(|place| self.replied.remove(place));
        if known.is_none() && self.replied.len() == SENDERS {
            self.replied.pop_front();
        }
        self.replied.push_back(Replied { sender_id, seq, mode, code });
        // A number that does not increase is that of a restarted operator, whose requests have no reply yet.
        if last.is_some_and(|last| (last.mode, last.code) == (mode, code) && seq >= last.seq) {
            return None;
        }
        let kind = RequestReply::KIND_OPERATOR;
        Some(RequestReply { t_ns, tick, sender_id, request_id: seq, kind, code, reason })
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
        // The mode is taken; a velocity or pose beyond what gait and legs allow is followed in part, and steps wait for a foot without ground.
        (_, ControllerTick::FAULT_OPERATOR_LIMITED | ControllerTick::FAULT_NO_GROUND) if !is_damped => {
            Some((RequestReply::CODE_DONE, String::new()))
        }
        (_, ControllerTick::FAULT_CONTROLLER) => wrong_state(": no controller is running"),
        // Also before the first valid input: the controller stays in IDLE and reports the fault.
        _ if is_damped || tick.fault != ControllerTick::FAULT_NONE => wrong_state(&format!(": {fault}")),
        _ => Some((RequestReply::CODE_DONE, String::new())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAD: i64 = 8;
    const PLANNER: i64 = 9;

    fn command(sender_id: i64, mode: i8, seq: i64) -> OperatorCommand {
        OperatorCommand { mode, seq, sender_id, t_ns: seq * 10, ..OperatorCommand::default() }
    }

    /// Code and request of the reply to a command that arrived at 5 ns and is consumed by tick 40.
    fn consumed(replies: &mut OperatorReplies, op: &OperatorCommand, mode: i8, fault: i32) -> Option<(i8, i64)> {
        let input = TickInput { op: op.clone(), tick: 40, t_op_ns: 5, ..TickInput::default() };
        let tick = ControllerTick { mode, fault, tick: 40, ..ControllerTick::default() };
        replies.tick(&input, &tick).map(|reply| (reply.code, reply.request_id))
    }

    #[test]
    fn an_outcome_is_reported_once_and_again_when_it_changes() {
        let mut replies = OperatorReplies::new();
        let idle = command(PAD, OperatorCommand::MODE_IDLE, 3);
        assert_eq!(consumed(&mut replies, &idle, ControllerTick::MODE_STANCE, 0), None, "not sent through this run");
        replies.forwarded(5, &idle);
        let refused = ControllerTick::FAULT_OPERATOR_REFUSED;
        let wrong_state = Some((RequestReply::CODE_WRONG_STATE, 3));
        assert_eq!(consumed(&mut replies, &idle, ControllerTick::MODE_DAMPING, refused), wrong_state);
        assert_eq!(consumed(&mut replies, &idle, ControllerTick::MODE_DAMPING, refused), None);
        let idle = command(PAD, OperatorCommand::MODE_IDLE, 4);
        replies.forwarded(5, &idle);
        assert_eq!(consumed(&mut replies, &idle, ControllerTick::MODE_DAMPING, refused), None, "the same outcome");
        assert_eq!(consumed(&mut replies, &idle, ControllerTick::MODE_IDLE, 0), Some((RequestReply::CODE_DONE, 4)));
    }

    #[test]
    fn a_reply_needs_the_same_sender_arrival_and_tick() {
        let mut replies = OperatorReplies::new();
        let stand = command(PAD, OperatorCommand::MODE_STAND, 3);
        replies.forwarded(5, &stand);
        let of = |sender_id, t_op_ns, tick| {
            let op = OperatorCommand { sender_id, ..stand.clone() };
            TickInput { op, t_op_ns, tick, ..TickInput::default() }
        };
        let tick = ControllerTick { mode: ControllerTick::MODE_STANCE, tick: 40, ..ControllerTick::default() };
        for other in [of(PLANNER, 5, 40), of(PAD, 6, 40), of(PAD, 5, 39)] {
            assert_eq!(replies.tick(&other, &tick), None);
        }
        let reply = replies.tick(&of(PAD, 5, 40), &tick).unwrap();
        assert_eq!((reply.sender_id, reply.request_id, reply.kind), (PAD, 3, RequestReply::KIND_OPERATOR));
    }

    #[test]
    fn a_restarted_operator_gets_a_reply_to_the_same_request() {
        let mut replies = OperatorReplies::new();
        for (seq, reply) in
            [(7, Some((RequestReply::CODE_DONE, 7))), (8, None), (0, Some((RequestReply::CODE_DONE, 0)))]
        {
            let stand = command(PAD, OperatorCommand::MODE_STAND, seq);
            replies.forwarded(5, &stand);
            assert_eq!(consumed(&mut replies, &stand, ControllerTick::MODE_STANCE, 0), reply, "seq {seq}");
        }
    }

    #[test]
    fn an_emergency_stop_is_done_when_the_controller_damps() {
        let mut replies = OperatorReplies::new();
        let stop = command(PLANNER, OperatorCommand::MODE_DAMPING, 1);
        replies.forwarded(5, &stop);
        assert_eq!(consumed(&mut replies, &stop, ControllerTick::MODE_WALK, 0), None);
        let (damping, fault) = (ControllerTick::MODE_DAMPING, ControllerTick::FAULT_OPERATOR);
        assert_eq!(consumed(&mut replies, &stop, damping, fault), Some((RequestReply::CODE_DONE, 1)));
    }

    #[test]
    fn a_request_before_the_first_valid_input_is_not_done() {
        let mut replies = OperatorReplies::new();
        let stand = command(PAD, OperatorCommand::MODE_STAND, 1);
        replies.forwarded(5, &stand);
        let (idle, fault) = (ControllerTick::MODE_IDLE, ControllerTick::FAULT_INPUT_SIZE);
        assert_eq!(consumed(&mut replies, &stand, idle, fault), Some((RequestReply::CODE_WRONG_STATE, 1)));
        assert_eq!(
            consumed(&mut replies, &stand, ControllerTick::MODE_STAND_UP, 0),
            Some((RequestReply::CODE_DONE, 1))
        );
    }

    #[test]
    fn an_ignored_command_is_rejected_once() {
        let mut replies = OperatorReplies::new();
        let walk = command(PLANNER, OperatorCommand::MODE_WALK, 5);
        let reply = replies.ignored(7, &walk, "operator PAD is active".to_owned()).unwrap();
        assert_eq!((reply.code, reply.sender_id, reply.tick), (RequestReply::CODE_REJECTED, PLANNER, -1));
        assert_eq!(replies.ignored(8, &command(PLANNER, OperatorCommand::MODE_WALK, 6), String::new()), None);
    }

    #[test]
    fn values_and_modes_out_of_range_are_named() {
        for (mode, fault) in [(77, ControllerTick::FAULT_OPERATOR_REFUSED), (1, ControllerTick::FAULT_OPERATOR_RANGE)] {
            let (code, reason) = outcome(mode, &ControllerTick { fault, ..ControllerTick::default() }).unwrap();
            assert_eq!(code, RequestReply::CODE_OUT_OF_RANGE);
            assert!(!reason.is_empty());
        }
    }

    #[test]
    fn a_command_followed_in_part_is_done() {
        for fault in [ControllerTick::FAULT_OPERATOR_LIMITED, ControllerTick::FAULT_NO_GROUND] {
            let mut replies = OperatorReplies::new();
            let walk = command(PAD, OperatorCommand::MODE_WALK, 1);
            replies.forwarded(5, &walk);
            let reply = consumed(&mut replies, &walk, ControllerTick::MODE_WALK, fault);
            assert_eq!(reply, Some((RequestReply::CODE_DONE, 1)));
        }
    }
}
