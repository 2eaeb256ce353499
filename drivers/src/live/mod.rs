//! The live run: the same controller as in lockstep, as processes that meet over LCM.
//!
//! ```text
//! real-time thread   sleep -> calls, newest measurement -> step -> command ---- ROBOT_COMMAND --> driver
//!      |  ^                                                        <---------- ROBOT_STATE ----- driver
//! ring |  | calls
//!      v  |
//! carrier            every other message of the tick, TIMING, EVENT, RUN_INFO <--> LCM: recorder, operator, tools
//! ```
//! - [`Executor`]: starts and ends both threads. The real-time thread allocates nothing, takes no lock, and calls the system for the clock
//!   and for the sockets of [`Hardware`] only; whatever may block happens in the carrier.
//! - [`Hardware`]: the robot as the executor sees it; [`LcmRobot`] is any driver process that speaks ROBOT_STATE and ROBOT_COMMAND.
//! - [`Faulty`]: any of them, made to fail by the fault lines of a scenario.
//! - [`plant`]: the simulator as such a driver process, in real time.
//! - [`RealtimeParams`]: scheduler, core and memory of a thread, used where permitted and reported where not.
//! - [`clock`]: the monotonic clock, and sleep until a time on it.
//!
//! A live log replays like any other, since CONTROLLER_INPUT holds what was consumed, whatever the network did before.

mod call;
pub mod clock;
mod executor;
mod faulty;
mod hardware;
mod lateness;
pub mod plant;
mod publisher;
mod realtime;
mod realtime_loop;
mod socket;

pub use call::{Call, Called, Caller, Handover, calls};
pub use executor::{Executor, Plan, Summary};
pub use faulty::Faulty;
pub use hardware::{Dummy, Hardware, LcmRobot};
pub use lateness::Lateness;
pub use publisher::{PublisherReport, RUN_INFO_EVERY_NS};
pub use realtime::{Granted, RealtimeParams};
pub use realtime_loop::{End, Ending, RealtimeLoop, Ticked};
pub use socket::{Ear, Speaker, somebody_speaks};
