//! Experiments of the source documents: each simulates, replays its logs bit for bit, measures, and judges what it measured.
//!
//! - [`recipes`]: one file per experiment, and the table [`ALL`] that lists them.
//! - [`bench`]: runs simulations on all cores and keeps their logs. Every recipe uses it.
//! - [`tables`]: the results as judged rows `{name, published, wanted, measured, unit, pass}`; as text, JSON and Markdown.
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
pub mod impedance;
pub mod limit_search;
pub mod recipes;
pub mod scenario_edit;
pub mod states;
pub mod tables;

pub use bench::Bench;
pub use recipes::ALL;
pub use tables::{Row, Tables};

use anyhow::Context;
use std::time::Instant;

/// An experiment: its description and how to run it.
pub struct Experiment {
    /// Identifier, such as `A3`.
    pub id: &'static str,
    /// What is done.
    pub title: &'static str,
    /// What the source reports.
    pub published: &'static str,
    /// Default robot.
    pub robot: &'static str,
    /// Default number of seeds; 1 if the experiment uses no seeds.
    pub seeds: i64,
    /// Duration on two cores, min.
    pub minutes: f64,
    /// Runs it. Every row that it returns is judged, or marked as not judged.
    pub run: fn(&Bench) -> anyhow::Result<Vec<Row>>,
}

impl Experiment {
    /// Runs the experiment and adds the row that counts the logs that replay bit for bit.
    ///
    /// # Errors
    /// A simulation, replay or analysis that fails. A missed target is no error but a row with `pass: false`.
    pub fn measure(&self, bench: &Bench) -> anyhow::Result<Tables> {
        let start = Instant::now();
        let mut rows = (self.run)(bench).with_context(|| format!("experiment {}", self.id))?;
        rows.extend(bench.replays());
        Ok(Tables::new(self, bench, rows, start.elapsed().as_secs_f64()))
    }
}

/// The experiments with these identifiers; `all` selects every one, in the order of [`ALL`]. Case does not matter.
///
/// # Errors
/// An unknown identifier; the message lists the known ones.
pub fn find(ids: &[String]) -> anyhow::Result<Vec<&'static Experiment>> {
    if ids.iter().any(|id| id.eq_ignore_ascii_case("all")) {
        return Ok(ALL.iter().collect());
    }
    let one = |id: &String| {
        ALL.iter().find(|e| e.id.eq_ignore_ascii_case(id)).with_context(|| {
            let known: Vec<_> = ALL.iter().map(|e| e.id).collect();
            format!("unknown experiment \"{id}\"; known: {}, all", known.join(", "))
        })
    };
    ids.iter().map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn identifiers_are_unique_and_found_in_any_case() {
        let ids: std::collections::BTreeSet<&str> = ALL.iter().map(|e| e.id).collect();
        assert_eq!(ids.len(), ALL.len());
        let found = |ids: &[&str]| find(&ids.iter().map(|id| (*id).to_owned()).collect::<Vec<_>>());
        assert_eq!(found(&["a3", "LIMITS"]).unwrap().iter().map(|e| e.id).collect::<Vec<_>>(), ["A3", "limits"]);
        assert_eq!(found(&["All"]).unwrap().len(), ALL.len());
        assert!(found(&["A13"]).is_err());
    }

    #[test]
    fn every_experiment_of_the_paper_is_listed() {
        for number in 1..=12 {
            assert!(ALL.iter().any(|e| e.id == format!("A{number}")), "A{number}");
        }
    }
}
