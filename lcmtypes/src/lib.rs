//! Messages of the stack: Rust structs, the table of channels, and the bus that carries them.
//!
//! `*.lcm` in this crate's folder is the truth. `build.rs` generates one struct a type, with the fields' names as in the `.lcm`, its
//! constants as associated constants, and its comment (meaning, frame and unit of each field) as documentation.
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
//! - [`channels`]: which channel carries which type, and which part of a tick it belongs to.
//! - [`bus`]: carries encoded messages, over LCM or within a process.
//! - [`types`]: reflection on every type, for tools that know a channel by name only.
//!
//! A new type is a new `NAME_t.lcm`, with the table of its fields above the struct, and a line in [`channels::CHANNELS`] if it has a
//! channel. A changed meaning is a new name: fingerprints cover names and types of fields, and nothing of what they mean.
//!
//! It must never decide anything about a robot: it is the vocabulary, and the wire.

pub mod bus;
pub mod channels;
mod generated {
    include!(concat!(env!("OUT_DIR"), "/types.rs"));
}

pub mod enum_names;
mod robot_command;

use std::sync::LazyLock;

pub use generated::hoofprint::*;
pub use lcm_idl::{DecodeError, EncodeError, Message};

/// Name and text of every `.lcm` file, by name: what a log stores to explain itself.
pub const SOURCES: &[(&str, &str)] = include!(concat!(env!("OUT_DIR"), "/sources.rs"));

/// Reflection on every type of [`SOURCES`].
pub fn types() -> &'static lcm_idl::TypeSet {
    static TYPES: LazyLock<lcm_idl::TypeSet> =
        LazyLock::new(|| lcm_idl::TypeSet::parse(SOURCES.iter().copied()).expect("the build parsed the same texts"));
    &TYPES
}
