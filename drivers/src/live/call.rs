//! Calls from other threads to the real-time thread, and their results on the way back.

use controller::handover::Parameters;
use controller::{Component, RestoreError};
use lcmtypes::{OperatorCommand, ParameterChange};
use rtrb::{Consumer, Producer, RingBuffer};

/// Capacity of each ring, in calls.
const CAPACITY: usize = 256;

/// Identifies a request: `kind`, `sender_id` and `request_id` of a `request_reply_t`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RequestId {
    /// `request_reply_t` KIND_*.
    pub kind: i8,
    /// The sender.
    pub sender_id: i64,
    /// The request, among those of its kind and sender.
    pub request_id: i64,
}

/// A call. The real-time thread carries out all waiting calls at the beginning of its next tick, in order.
pub enum Call {
    /// Follow an operator command, which arrived at `t_ns`.
    Operator {
        /// Arrival, ns.
        t_ns: i64,
        /// The command.
        command: OperatorCommand,
    },
    /// Use the measurements of this driver.
    Driver(i64),
    /// Start or stop a controller.
    Switch(Switch),
    /// Replace the controller by one with other parameters.
    Handover(Box<Handover>),
}

/// Start or stop of a controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Switch {
    /// The request.
    pub id: RequestId,
    /// Index of the controller in the order of the run.
    pub controller: usize,
    /// Start it, else stop it.
    pub start: bool,
}

/// A controller with other parameters. The real-time thread returns it with the controller that it has replaced, so that it frees no memory.
pub struct Handover {
    /// The request.
    pub id: RequestId,
    /// The new controller; on return the replaced one, or the new one if it was refused.
    pub controller: Component,
    /// The change; the real-time thread sets its time and tick.
    pub change: ParameterChange,
    /// All parameters after the change.
    pub parameters: Parameters,
    /// Set on return if the new controller did not accept the state.
    pub refused: Option<HandoverError>,
}

/// Why a controller did not take over.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum HandoverError {
    /// It does not accept the state.
    #[error(transparent)]
    State(#[from] RestoreError),
    /// It panicked, and all controllers were stopped.
    #[error("a controller panicked in the handover")]
    Panicked,
}

/// Result of a call.
pub enum CallResult {
    /// A [`Call::Switch`] has been carried out.
    Switched {
        /// The call.
        switch: Switch,
        /// Time of the tick, ns.
        t_ns: i64,
        /// First tick with it.
        tick: i64,
        /// False if the controller was running, or stopped, already.
        changed: bool,
    },
    /// A [`Call::Handover`] has been carried out or refused.
    Handover(Box<Handover>),
}

/// The calling end.
pub struct CallSender {
    calls: Producer<Call>,
    results: Consumer<CallResult>,
}

/// The end of the real-time thread.
pub struct CallReceiver {
    calls: Consumer<Call>,
    results: Producer<CallResult>,
}

/// Allocates the rings for calls and results and returns both ends.
pub fn call_ring() -> (CallSender, CallReceiver) {
    let (calls_in, calls_out) = RingBuffer::new(CAPACITY);
    // Results of all waiting calls, and of the one in progress.
    let (results_in, results_out) = RingBuffer::new(CAPACITY + 1);
    (CallSender { calls: calls_in, results: results_out }, CallReceiver { calls: calls_out, results: results_in })
}

impl CallSender {
    /// Sends a call; false if the ring is full because the real-time thread does not take calls.
    pub fn send(&mut self, call: Call) -> bool {
        self.calls.push(call).is_ok()
    }

    /// Next result, if there is one.
    pub fn result(&mut self) -> Option<CallResult> {
        self.results.pop().ok()
    }
}

impl CallReceiver {
    pub(super) fn next(&mut self) -> Option<Call> {
        self.calls.pop().ok()
    }

    /// Returns a result; hands it back if the ring is full.
    pub(super) fn put_result(&mut self, result: CallResult) -> Option<CallResult> {
        self.results.push(result).err().map(|rtrb::PushError::Full(result)| result)
    }
}
