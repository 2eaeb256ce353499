//! From a log to data frames, metrics, figures and a report.
//!
//! ```no_run
//! let report = analysis::report("run.lcmlog".as_ref(), "report".as_ref(), &mut |_| ())?;
//! println!("{}", analysis::tables::tracking_text(&report.metrics));
//! # Ok::<(), analysis::Error>(())
//! ```
//!
//! - [`run`]: a log as a list of ticks, every message of a tick side by side; what is missing is `None`.
//! - [`metrics`]: figures of merit, the content of `metrics.json`.
//! - [`figures`]: SVG, PDF and PNG, the same bytes for the same logs; [`plots`]: which of them, and how they look.
//! - [`table`]: aligned columns for a terminal; [`numeric_table`]: rows of numbers as text, CSV, LaTeX and JSON.
//! - [`tables`]: the tracking table beside the published one, timing statistics: text, CSV, LaTeX, JSON.
//! - [`timeline`]: what happened and when: gait changes, falls, faults, losses, missed deadlines.
//! - [`check`]: limits that the metrics must keep.
//! - [`report`](report()): all of it in a directory, with one HTML page.
//! - [`replay_comparison`]: logs that replay otherwise than they were recorded, before and after side by side.
//! - [`frames`]: any channel of any log as a polars data frame, and Parquet.
//! - [`export`]: a log as CSV, Parquet or a MATLAB file.
//!
//! It reads logs and nothing else: no robot, no bus, no controller. Nothing depends on it but the command. It must never change a
//! number between two runs over the same log, nor hide that a log is damaged or lacks a channel.

// Names of quantities carry frames, such as p_WF: see ARCHITECTURE.md.
#![allow(non_snake_case)]

pub mod animation;
pub mod check;
pub mod export;
pub mod fields;
pub mod figures;
pub mod frames;
pub mod math;
pub mod metrics;
pub mod numeric_table;
pub mod plots;
pub mod replay_comparison;
pub mod robot;
pub mod run;
pub mod stats;
pub mod table;
pub mod tables;
pub mod timeline;

mod error;
mod html;
mod report;

pub use error::Error;
pub use frames::Frames;
pub use metrics::Metrics;
pub use plots::Plots;
pub use report::{Report, ReportOptions, report, report_with};
pub use run::Run;

/// How far a piece of work has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// What is being done.
    pub stage: Stage,
    /// How much of it is done: bytes while reading, figures while drawing.
    pub done: u64,
    /// How much there is to do, in the same unit.
    pub total: u64,
}

/// A piece of work that takes a while.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Reading the log.
    Read,
    /// Drawing figures.
    Draw,
}
