//! Faults, joint checks and command limits, for every controller.
//!
//! A check returns the [`Fault`] that it found; the controller then changes to its safe state in the same tick. Checks that only one kind of
//! robot needs are part of its controller, for example `quadruped/checks.rs`.

mod command;
mod fault;
mod joints;
mod params;

pub use command::{check_command, limit_command};
pub use fault::{Fault, fault};
pub use joints::{check_joint_limits, check_joint_values, is_plausible};
pub use params::SafetyParams;
