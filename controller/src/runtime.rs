//! Components: from the messages that were delivered to what a controller reads, and back from its state to one snapshot.
//!
//! An executor collects the messages of a tick in a [`Delivery`], logs them as CONTROLLER_INPUT and steps a [`Component`] with them. The component
//! unpacks them ([`Unpacked`]): newer messages replace older ones, and what is not replaced holds. So a log with its CONTROLLER_INPUT messages is
//! enough to compute every tick again.
//!
//! | channel of a delivered message | field of `TickInput` |
//! |---|---|
//! | `ROBOT_STATE` | `state` |
//! | `OPERATOR_COMMAND` | `op`, and its arrival time in `t_op_ns` |
//! | `RUNNING` | `running` |
//! | `ROBOT_COMMAND`: the last command before a controller starts | offered to the controllers that run in this tick |
//! | any other | offered to `Controller::receive` after those above; if the controller does not know it, it is counted in `n_ignored` |
//!
//! A message that cannot be decoded is counted in `n_ignored` and changes nothing. Before the first ROBOT_STATE, `state` has no joints: controllers
//! report FAULT_INPUT_SIZE.

mod component;
mod delivery;
mod unpack;

pub use component::Component;
pub use delivery::{Delivery, MAX_LATE, MAX_MESSAGES};
pub use unpack::{Unpacked, empty_state};
