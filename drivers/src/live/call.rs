//! What other threads want of the real-time thread.

use controller::handover::Parameters;
use controller::{Controller, RestoreError};
use lcmtypes::{OperatorCommand, ParameterChange};
use rtrb::{Consumer, Producer, RingBuffer};

/// Calls that may wait for the real-time thread.
const CALLS: usize = 256;

/// What is wanted; carried out at the beginning of the next tick, in order.
pub enum Call {
    /// Follow an operator command, which arrived at `t_ns`.
    Operator {
        /// Arrival, ns.
        t_ns: i64,
        /// The command.
        command: OperatorCommand,
    },
    /// Start the k-th controller.
    Start(usize),
    /// Stop the k-th controller.
    Stop(usize),
    /// Have a controller with other parameters take over.
    Change(Box<Handover>),
}

/// A controller with other parameters. It comes back with the one that it has replaced, so that no memory is freed in real time.
pub struct Handover {
    /// Who is to take over; on the way back, who is not needed any more.
    pub controller: Box<dyn Controller>,
    /// The change, whose time and tick the real-time thread fills in.
    pub change: ParameterChange,
    /// The parameters from then on.
    pub parameters: Parameters,
    /// Why it could not take over, on the way back.
    pub refused: Option<RestoreError>,
}

/// The end of who calls.
pub struct Caller {
    calls: Producer<Call>,
    returns: Consumer<Box<Handover>>,
}

/// The end of the real-time thread.
pub struct Called {
    calls: Consumer<Call>,
    returns: Producer<Box<Handover>>,
}

/// Both ends of a line to the real-time thread.
pub fn calls() -> (Caller, Called) {
    let (calls_in, calls_out) = RingBuffer::new(CALLS);
    let (returns_in, returns_out) = RingBuffer::new(CALLS);
    (Caller { calls: calls_in, returns: returns_out }, Called { calls: calls_out, returns: returns_in })
}

impl Caller {
    /// Calls; false if there is no room, since the real-time thread stands still.
    pub fn call(&mut self, call: Call) -> bool {
        self.calls.push(call).is_ok()
    }

    /// A handover that has been carried out or refused.
    pub fn returned(&mut self) -> Option<Box<Handover>> {
        self.returns.pop().ok()
    }
}

impl Called {
    pub(super) fn next(&mut self) -> Option<Call> {
        self.calls.pop().ok()
    }

    pub(super) fn give_back(&mut self, handover: Box<Handover>) {
        // As many may wait here as could have been called.
        drop(self.returns.push(handover));
    }
}
