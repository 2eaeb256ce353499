//! The live run: the same controller as in lockstep, as processes that communicate over LCM.
//!
//! ```text
//! real-time thread   sleep -> calls, newest measurement -> step -> command ---- ROBOT_COMMAND --> driver
//!      |  ^                                                        <---------- ROBOT_STATE ----- driver
//! ring |  | calls
//!      v  |
//! publisher          all other messages of the tick, TIMING, EVENT, RUN_INFO, REQUEST_REPLY <--> LCM: recorder, operators, tools
//! ```
//! - [`Executor`]: starts and ends both threads. The real-time thread allocates nothing, takes no lock, and makes system calls only for the clock
//!   and for the sockets of [`Hardware`]. Everything that may block is done by the publisher.
//! - [`Hardware`]: the robot as the executor uses it. [`LcmRobot`] is any driver process that sends ROBOT_STATE and applies ROBOT_COMMAND.
//! - [`Faulty`]: any hardware with the faults of a scenario.
//! - [`run_component`]: a component in a process of its own; the others of a run: [`crate::components::Others`].
//! - [`plant`]: the simulator as a driver process, in real time.
//! - [`RealtimeParams`]: scheduler, core and memory of a thread. What the system refuses is reported and omitted.
//! - [`clock`]: the monotonic clock, and sleep until a time on it.
//!
//! Every request (start, stop, parameter, mode of an operator) is answered by a REQUEST_REPLY.
//!
//! A live log replays like any other: CONTROLLER_INPUT holds what the controller consumed, whatever the network lost.

mod call;
mod change_repeater;
pub mod clock;
mod command_gate;
mod event_limit;
mod executor;
mod faulty;
mod hardware;
mod joint_range;
mod lateness;
mod message_ring;
mod operator_replies;
mod outgoing;
mod peers;
pub mod plant;
mod process;
mod publisher;
mod realtime;
mod realtime_loop;
mod replies;
mod requests;
mod socket;
mod worker;

pub use call::{Call, CallReceiver, CallResult, CallSender, Handover, HandoverError, RequestId, Switch, call_ring};
pub use event_limit::{EventLimit, Suppressed};
pub use executor::{Executor, Plan, Summary};
pub use faulty::Faulty;
pub use hardware::{Dummy, Hardware, LcmRobot};
pub use joint_range::JointRange;
pub use lateness::Lateness;
pub use message_ring::{MessageReceiver, MessageSender, RingMessage, message_ring};
pub use process::{ProcessReport, run_component};
pub use publisher::{PublisherReport, RUN_INFO_EVERY_NS};
pub use realtime::{Granted, LIMITS_FIX, RealtimeParams, memory_limit};
pub use realtime_loop::{End, EndCause, Ending, RealtimeLoop, RealtimeReport};
pub use socket::{LcmReceiver, LcmSender, has_traffic};
pub use worker::{END_OF_TICK, WorkerEnd, start as start_worker};
