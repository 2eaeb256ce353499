//! Messages of the stack: Rust structs, the table of channels, and the bus.
//!
//! The types are defined by the `*.lcm` files in this crate's folder. `build.rs` generates one struct per type: fields have the names of the `.lcm`
//! file, constants are associated constants, and the comment (meaning, frame and unit of each field) is the documentation.
//!
//! ```
//! use lcmtypes::{Message, RobotState};
//!
//! let state = RobotState { t_ns: 1_000_000, nj: 2, q: vec![0.1, 0.2], qd: vec![0.0; 2], tau: vec![0.0; 2], ..Default::default() };
//! let mut bytes = Vec::new();
//! state.encode(&mut bytes)?;
//! assert_eq!(RobotState::decode(&bytes)?, state);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! - [`channels`]: the type of each channel, and the stage of a tick that it belongs to.
//! - [`bus`]: transport of encoded messages, over LCM or within a process.
//! - [`enum_names`]: names of the constants.
//! - [`types`]: reflection on every type, for tools that know only the name of a channel.
//!
//! To add a type, add `NAME_t.lcm` with the table of its fields above the struct, and a row in [`channels::CHANNELS`] if it has a channel. If the
//! meaning of a field changes, give the field a new name: a fingerprint covers names and types of fields, not their meaning.
//!
//! This crate makes no decisions about a robot: it defines messages and transports them.

pub mod bus;
pub mod channels;
mod generated {
    include!(concat!(env!("OUT_DIR"), "/types.rs"));
}

mod controller_input;
pub mod enum_names;
mod robot_command;
mod robot_state;
mod run_info;
mod sender;

use std::sync::LazyLock;

pub use generated::hoofprint::*;
pub use lcm_idl::{DecodeError, EncodeError, Message};
pub use run_info::EXTERNAL;
pub use sender::{EventNumbers, new_sender_id};

/// Name and text of every `.lcm` file, sorted by name. A log stores them, so that its messages can be decoded.
pub const SOURCES: &[(&str, &str)] = include!(concat!(env!("OUT_DIR"), "/sources.rs"));

/// Reflection on every type of [`SOURCES`].
pub fn types() -> &'static lcm_idl::TypeSet {
    static TYPES: LazyLock<lcm_idl::TypeSet> =
        LazyLock::new(|| lcm_idl::TypeSet::parse(SOURCES.iter().copied()).expect("the build parsed the same texts"));
    &TYPES
}
