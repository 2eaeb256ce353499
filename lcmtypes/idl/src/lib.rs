//! The LCM type language: parser, fingerprints, run-time reflection and a generator of Rust.
//!
//! LCM messages are described in `.lcm` files. There is no maintained Rust generator for them, so this crate is part of the project.
//! Tests compare it with the stock `lcm-gen` (`tests/conformance`): same fingerprints, same bytes.
//!
//! | module       | content                                                                                |
//! |--------------|----------------------------------------------------------------------------------------|
//! | [`ast`]      | content of a `.lcm` text: structs, fields, dimensions, constants, enums                 |
//! | `parser`     | text → [`ast::File`], errors with file, line, column, found, expected                  |
//! | [`TypeSet`]  | several files linked together, looked up by name or fingerprint                        |
//! | [`Type`]     | reflection: decode to a [`Value`] tree, encode it, walk the leaves, compare messages   |
//! | [`wire`]     | the byte format: [`Message`], [`wire::Wire`], [`wire::Reader`]; used by generated code |
//! | [`generate`] | Rust source for a set of types                                                         |
//!
//! ```
//! let types = lcm_idl::TypeSet::parse([("p.lcm", "package demo; struct point_t { int32_t n; double x[n]; }")])?;
//! let point = types.by_name("demo.point_t").expect("declared above");
//! let mut a = point.default_value();
//! a.set("n", 2i32)?;
//! *a.get_mut("x").expect("a field") = vec![1.0, 2.0].into();
//! let bytes = point.encode(&a)?;
//! assert_eq!(point.leaves(&bytes)?[2].0, "x[1]");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! The crate must never read a file, panic on bad input, or allocate more than a small multiple of its input's size.

pub mod ast;
mod encode;
mod error;
mod generate;
mod hash;
mod lexer;
mod parser;
mod reflect;
mod set;
mod value;
pub mod wire;

pub use error::{DecodeError, DecodeProblem, EncodeError, Error};
pub use generate::{camel_case, generate};
pub use parser::parse;
pub use reflect::{Difference, Path, Segment};
pub use set::{Type, TypeSet};
pub use value::{Leaf, Value};
pub use wire::{Deviations, Message};
