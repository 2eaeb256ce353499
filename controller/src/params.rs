//! Reading, checking and changing the parameters of a run.
//!
//! The parameters are one TOML text. It is read once, checked once, and written with all defaults into the log. A robot's file
//! (`robots/NAME/NAME.toml`) contains what differs from the defaults; [`Params::to_toml`] writes every key, so a log does not depend on the
//! defaults of a build.
//!
//! Each table is defined where it is used: [`crate::quadruped::params`], [`crate::hold::params`], [`crate::safety`], [`crate::stack`],
//! [`crate::qp`]. This module contains what is independent of the controller: the list of all tables ([`Params`]), the robot
//! ([`RobotConfig`]), overrides by key, ranges and errors.
//! Each table has the allowed range of its numbers beside it (`BOUNDS`); [`bounds`] lists all of them.

mod digest;
pub(crate) mod error;
pub mod exact;
mod key;
mod overrides;
pub mod range;
mod robot;
mod tables;

pub use digest::parameters_digest;
pub use error::ParamsError;
pub(crate) use key::{quoted, toml_key};
pub use overrides::{add_gaits, apply_changes, apply_overrides, check_key, key_values};
pub use range::Bound;
pub use robot::{RobotConfig, SensorParams};
pub use tables::{Params, bounds};
