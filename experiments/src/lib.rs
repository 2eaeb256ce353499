//! Experiments of the source documents: each simulates, replays its logs bit for bit, measures, and judges what it measured.
//!
//! - [`recipes`]: one file per experiment, and the table [`ALL`] that lists them.
//! - [`mod@bench`]: runs simulations on all cores and keeps their logs. Every recipe uses it.
//! - [`row`]: the judged row `{name, published, wanted, measured, unit, pass}`; [`tables`]: all rows as text, JSON and Markdown.
//! - [`limit_search`]: the largest value of a scenario's key that a robot survives.
//! - [`states`]: feeds the logged inputs of a run to controllers with other parameters.
//! - [`impedance`]: closed-form impedance control, the reference of the equivalence proofs in the paper's appendix.
//! - [`scenario_edit`]: changes keys of a scenario file.
//!
//! This crate computes; the command `hoof experiment` parses arguments and prints. It never writes to a terminal: progress goes
//! through [`bench::NewBar`]. Errors are `anyhow` chains, since a recipe combines all crates and its only caller prints the chain.
//!
//! To add an experiment: add a file with an [`Experiment`] constant to `src/recipes/`, and a line to [`ALL`].
#![allow(non_snake_case, reason = "names carry frames, as in p_WF = p_WB + R_WB * p_BF: see ARCHITECTURE.md")]
#![cfg_attr(test, allow(clippy::unwrap_used, reason = "a test may panic"))]

pub mod bench;
pub mod experiment;
pub mod impedance;
pub mod limit_search;
pub mod recipes;
pub mod row;
pub mod scenario_edit;
pub mod states;
pub mod tables;

pub use bench::Bench;
pub use experiment::Experiment;
pub use recipes::{ALL, find};
pub use row::Row;
pub use tables::Tables;
