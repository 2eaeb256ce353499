//! Components: several controllers in one run, each with its own period, phase and latency.
//!
//! | part | contents |
//! |---|---|
//! | [`ComponentEntry`] | a `[[component]]` table of a run file |
//! | [`Slot`] | when a component runs, and the messages that wait for its next tick |
//! | [`Others`] | the components beside the first one: computes their ticks or hands their inputs out, and delivers results |
//! | [`Releases`] | results in transit: what a component computes from the inputs of base tick k is delivered at k + latency, never earlier |
//!
//! The first component commands the robot and runs in every base tick. In a base tick the other components run before it, in their order, so with
//! latency 0 it receives what they computed in the same tick. A component receives, once per tick, the newest ROBOT_STATE, all operator commands since
//! its last tick, and the newest message on each channel that it listens to.

mod entry;
mod others;
mod release;
mod slot;

pub use entry::{CommonParams, ComponentEntry, Runs, resolve, slots};
pub use lcmtypes::EXTERNAL;
pub use others::{Others, Runner, build};
pub use release::Releases;
pub use slot::Slot;
