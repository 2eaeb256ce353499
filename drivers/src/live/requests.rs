//! Requests of other processes to a live run: checked, passed to the real-time thread, and answered by a REQUEST_REPLY.
//!
//! | channel | request | answered |
//! |---|---|---|
//! | EXECUTOR_COMMAND | start or stop a controller | after the tick that starts or stops it |
//! | PARAMETER_REQUEST | change a parameter | after the tick in which the new controller takes over |
//! | channels of the operators | mode of the robot | after the tick that consumes it ([`OperatorReplies`]) |
//!
//! A request that is received again is not carried out again: [`Replies`] sends the same reply.

use super::call::{Call, CallResult, CallSender, Handover, RequestId, Switch};
use super::change_repeater::ChangeRepeater;
use super::clock::now_ns;
use super::operator_replies::OperatorReplies;
use super::outgoing::Outgoing;
use super::replies::{Known, Replies};
use crate::command_mux::CommandMux;
use crate::parameter_requests::{self, ParameterRequestHandler, Proposal, Refusal};
use lcmtypes::bus::Received;
use lcmtypes::{
    ControllerTick, DecodeError, Event, ExecutorCommand, Message, OperatorCommand, ParameterRequest, RequestReply,
    RunInfo, TickInput, channels,
};
use std::collections::VecDeque;

/// Characters of an unknown name that a reply quotes.
const QUOTED: usize = 80;
/// Parameter requests that may wait.
const MAX_WAITING: usize = 64;

/// Handles the requests of a run.
pub struct Requests {
    calls: CallSender,
    mux: CommandMux,
    operator_replies: OperatorReplies,
    /// Names of the controllers, in the order of their bits.
    controllers: Vec<String>,
    replies: Replies,
    parameters: ParameterRequestHandler,
    /// Parameter requests that wait for the one before them: each is applied to the result of that one.
    waiting: VecDeque<ParameterRequest>,
    /// A handover is with the real-time thread.
    handing_over: bool,
    changes: ChangeRepeater,
    /// Calls for which the ring to the real-time thread had no room.
    not_called: u64,
}

impl Requests {
    /// Requests to the controllers of a run, by name in the order of their bits.
    pub fn new(calls: CallSender, mux: CommandMux, info: &RunInfo, controllers: Vec<String>) -> Self {
        Requests {
            calls,
            operator_replies: OperatorReplies::new(),
            mux,
            controllers,
            replies: Replies::default(),
            parameters: ParameterRequestHandler::new(info),
            waiting: VecDeque::new(),
            handing_over: false,
            changes: ChangeRepeater::default(),
            not_called: 0,
        }
    }

    /// Calls for which the ring to the real-time thread had no room.
    pub fn not_called(&self) -> u64 {
        self.not_called
    }

    /// Publishes the parameter changes of the run again, for logs that begin now.
    pub fn publish_changes(&self, out: &mut Outgoing) {
        self.changes.publish_all(out);
    }

    /// Takes a message from the bus.
    ///
    /// # Errors
    /// If it cannot be decoded.
    pub fn receive(&mut self, message: &Received, out: &mut Outgoing) -> Result<(), DecodeError> {
        if let Some(source) = self.mux.source_of(&message.channel) {
            self.receive_operator(source, &OperatorCommand::decode(&message.data)?, out);
        } else if message.channel == channels::PARAMETER_REQUEST {
            self.receive_parameter(ParameterRequest::decode(&message.data)?, out);
        } else if message.channel == channels::EXECUTOR_COMMAND {
            self.receive_switch(&ExecutorCommand::decode(&message.data)?, out);
        }
        Ok(())
    }

    /// Uses the measurements of this driver, and of no other.
    pub fn use_driver(&mut self, id: i64) {
        self.call(Call::Driver(id));
    }

    /// Damps the joints as an emergency stop of the run itself does; only a request for IDLE ends it.
    pub fn damp(&mut self, t_ns: i64, run_id: i64) {
        let (sender_id, mode) = (run_id, OperatorCommand::MODE_DAMPING);
        self.call(Call::Operator { t_ns, command: OperatorCommand { sender_id, mode, ..OperatorCommand::default() } });
    }

    /// Work that is due: results of the real-time thread, the next parameter request, operators that time out.
    pub fn work(&mut self, out: &mut Outgoing) {
        self.forward_operator(out);
        self.take_results(out);
        self.changes.publish_due(now_ns(), out);
        if !self.handing_over
            && let Some(request) = self.waiting.pop_front()
        {
            self.hand_over(&request, out);
        }
    }

    /// Takes input and result of a tick, which show the outcome of an operator command.
    pub fn tick(&mut self, input: &TickInput, tick: &ControllerTick, out: &mut Outgoing) {
        if let Some(reply) = self.operator_replies.tick(input, tick) {
            out.put(channels::REQUEST_REPLY, &reply);
        }
    }

    /// Answers all pending requests; the real-time thread has ended.
    pub fn close(&mut self, out: &mut Outgoing) {
        self.take_results(out);
        for id in self.replies.pending() {
            self.refuse(id, &Refusal::rejected("the run has ended".to_owned()), out);
        }
    }

    fn receive_operator(&mut self, source: usize, command: &OperatorCommand, out: &mut Outgoing) {
        let t_ns = now_ns();
        self.mux.receive(source, t_ns, command);
        // After each command: the real-time thread consumes an emergency stop in a tick even if the next command clears it.
        self.forward_operator(out);
        if let Some(why) = self.mux.ignored(source, command.sender_id)
            && let Some(reply) = self.operator_replies.ignored(t_ns, command, self.mux.reason(source, why))
        {
            out.put(channels::REQUEST_REPLY, &reply);
        }
    }

    /// Passes the active operator's command to the real-time thread and publishes what has changed about operators.
    fn forward_operator(&mut self, out: &mut Outgoing) {
        let now_ns = now_ns();
        if let Some(selection) = self.mux.new_selection(now_ns) {
            self.operator_replies.forwarded(selection.arrival_ns, selection.command);
            let call = Call::Operator { t_ns: selection.arrival_ns, command: selection.command.clone() };
            self.call(call);
        }
        while let Some(transition) = self.mux.transition() {
            let level = if transition.is_warning() { Event::LEVEL_WARNING } else { Event::LEVEL_INFO };
            out.event(now_ns, -1, level, "operator", self.mux.text(transition));
        }
    }

    fn receive_switch(&mut self, command: &ExecutorCommand, out: &mut Outgoing) {
        // Before each call, so that the ring for results always has room.
        self.take_results(out);
        let ExecutorCommand { sender_id, request_id, .. } = *command;
        let id = RequestId { kind: RequestReply::KIND_EXECUTOR, sender_id, request_id };
        if self.is_known(id, out) {
            return;
        }
        let start = match command.action {
            ExecutorCommand::ACTION_START => Ok(true),
            ExecutorCommand::ACTION_STOP => Ok(false),
            action => {
                let reason = format!("action {action} of EXECUTOR_COMMAND: expected 0 (start) or 1 (stop)");
                Err(Refusal { code: RequestReply::CODE_OUT_OF_RANGE, reason })
            }
        };
        let controller = self.controllers.iter().position(|name| *name == command.controller).ok_or_else(|| {
            let name: String = command.controller.chars().take(QUOTED).collect();
            let known = self.controllers.join(", ");
            let reason = format!("unknown controller {name:?}: the run has {known}");
            Refusal { code: RequestReply::CODE_UNKNOWN_NAME, reason }
        });
        let refusal = match (controller, start) {
            (Ok(controller), Ok(start)) if self.call(Call::Switch(Switch { id, controller, start })) => return,
            (Ok(_), Ok(_)) => Refusal::rejected("the real-time thread takes no calls".to_owned()),
            (Err(refusal), _) | (_, Err(refusal)) => refusal,
        };
        out.event(now_ns(), -1, Event::LEVEL_WARNING, "executor", refusal.reason.clone());
        self.refuse(id, &refusal, out);
    }

    fn receive_parameter(&mut self, request: ParameterRequest, out: &mut Outgoing) {
        let id = id_of(&request);
        if self.is_known(id, out) {
            return;
        }
        // Before it is stored: a foreign message may have any length.
        if let Err(refusal) = parameter_requests::check_length(&request) {
            self.refuse_parameter(id, &refusal, out);
        } else if self.waiting.len() < MAX_WAITING {
            self.waiting.push_back(request);
        } else {
            let why = format!("{MAX_WAITING} requests are waiting already");
            self.refuse_parameter(
                id,
                &Refusal::of_parameter(&request.key, &request.value, RequestReply::CODE_REJECTED, &why),
                out,
            );
        }
    }

    /// Builds the controller for a parameter request and sends it to the real-time thread.
    fn hand_over(&mut self, request: &ParameterRequest, out: &mut Outgoing) {
        let id = id_of(request);
        let refusal = match self.parameters.propose(request) {
            Ok(Proposal { controller, change, parameters }) => {
                let handover = Handover { id, controller, change, parameters, refused: None };
                self.handing_over = self.call(Call::Handover(Box::new(handover)));
                if self.handing_over {
                    return;
                }
                let why = "the real-time thread takes no calls";
                Refusal::of_parameter(&request.key, &request.value, RequestReply::CODE_REJECTED, &why)
            }
            Err(refusal) => refusal,
        };
        self.refuse_parameter(id, &refusal, out);
    }

    /// Takes the results of the real-time thread and answers their requests.
    fn take_results(&mut self, out: &mut Outgoing) {
        while let Some(result) = self.calls.result() {
            match result {
                CallResult::Switched { switch, t_ns, tick, changed } => {
                    if changed {
                        self.done(switch.id, t_ns, tick, out);
                    } else {
                        let name = self.controllers.get(switch.controller).map_or("?", |name| &**name);
                        let state = if switch.start { "running" } else { "stopped" };
                        let reason = format!("controller {name} is already {state}");
                        out.event(t_ns, -1, Event::LEVEL_WARNING, "executor", reason.clone());
                        self.refuse(switch.id, &Refusal { code: RequestReply::CODE_WRONG_STATE, reason }, out);
                    }
                }
                CallResult::Handover(handover) => {
                    let Handover { id, change, parameters, refused, .. } = *handover;
                    self.handing_over = false;
                    if let Some(why) = refused {
                        let code = RequestReply::CODE_WRONG_STATE;
                        self.refuse_parameter(id, &Refusal::of_parameter(&change.key, &change.value, code, &why), out);
                    } else {
                        self.parameters.accept(parameters);
                        out.put_event(parameter_requests::event(change.t_ns, change.tick, Ok(&change)));
                        self.changes.changed(&change, now_ns(), out);
                        self.done(id, change.t_ns, change.tick, out);
                    }
                }
            }
        }
    }

    /// Whether a request has been received before; sends its reply again.
    fn is_known(&mut self, id: RequestId, out: &mut Outgoing) -> bool {
        let known = self.replies.open(id);
        if let Some(Known::Answered(reply)) = &known {
            out.put(channels::REQUEST_REPLY, reply);
        }
        known.is_some()
    }

    fn done(&mut self, id: RequestId, t_ns: i64, tick: i64, out: &mut Outgoing) {
        let reply = RequestReply { t_ns, tick, code: RequestReply::CODE_DONE, ..reply_to(id) };
        self.reply(&reply, out);
    }

    fn refuse_parameter(&mut self, id: RequestId, refusal: &Refusal, out: &mut Outgoing) {
        out.put_event(parameter_requests::event(now_ns(), -1, Err(refusal)));
        self.refuse(id, refusal, out);
    }

    fn refuse(&mut self, id: RequestId, refusal: &Refusal, out: &mut Outgoing) {
        let Refusal { code, reason } = refusal.clone();
        let reply = RequestReply { t_ns: now_ns(), tick: -1, code, reason, ..reply_to(id) };
        self.reply(&reply, out);
    }

    fn reply(&mut self, reply: &RequestReply, out: &mut Outgoing) {
        self.replies.answer(reply);
        out.put(channels::REQUEST_REPLY, reply);
    }

    fn call(&mut self, call: Call) -> bool {
        let called = self.calls.send(call);
        self.not_called += u64::from(!called);
        called
    }
}

fn id_of(request: &ParameterRequest) -> RequestId {
    RequestId { kind: RequestReply::KIND_PARAMETER, sender_id: request.sender_id, request_id: request.seq }
}

fn reply_to(id: RequestId) -> RequestReply {
    let RequestId { kind, sender_id, request_id } = id;
    RequestReply { kind, sender_id, request_id, ..RequestReply::default() }
}
