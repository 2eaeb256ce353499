//! The description of an experiment, and its run.

use crate::bench::Bench;
use crate::row::Row;
use crate::tables::Tables;
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
        let (notes, figures) = bench.remarks();
        Ok(Tables {
            id: self.id,
            title: self.title,
            published: self.published,
            robot: bench.robot().to_owned(),
            pass: rows.iter().all(|row| row.pass != Some(false)),
            rows,
            notes,
            figures,
            logs: bench.dir().to_owned(),
            seconds: start.elapsed().as_secs_f64(),
        })
    }
}
