//! Data frames, metrics, figures and reports from a log.
//!
//! ```no_run
//! let report = analysis::report("run.lcmlog".as_ref(), "report".as_ref(), &mut |_| ())?;
//! println!("{}", analysis::tables::tracking_text(&report.metrics));
//! # Ok::<(), analysis::Error>(())
//! ```
//!
//! - [`run`]: a log as a list of ticks with the messages of each tick; missing messages are `None`.
//! - [`robot`]: the robot of a log, from its URDF.
//! - [`metrics`]: the content of `metrics.json`.
//! - [`figures`]: figures as SVG, PDF and PNG, with equal bytes for equal logs; [`plots`]: the TOML file that selects them.
//! - [`table`]: aligned columns for a terminal; [`numeric_table`]: rows of numbers as text, CSV, LaTeX and JSON.
//! - [`tables`]: tracking errors with published values, timing statistics, comparison of logs.
//! - [`timeline`]: changes of mode and gait, falls, faults, losses, missed deadlines, events.
//! - [`check`]: limits for metrics.
//! - [`report`](report()): all of these in a folder, with an HTML page.
//! - [`replay_comparison`]: HTML page of golden logs whose replay differs from the record.
//! - [`frames`]: any channel of any log as a polars data frame; Parquet files.
//! - [`export`]: a log as CSV, Parquet or MATLAB file.
//!
//! It reads logs only; it does not use the bus or run a controller. Only the command and the experiments depend on it. Two runs over the same log give
//! equal output. Damage and missing channels of a log are always reported.

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

mod consumed;
mod error;
mod frame_rows;
mod html;
mod report;

pub use error::Error;
pub use frames::Frames;
pub use metrics::Metrics;
pub use plots::Plots;
pub use report::{Report, ReportOptions, report, report_with};
pub use run::Run;

/// Progress of a long operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Current operation.
    pub stage: Stage,
    /// Amount done: bytes while reading, figures while drawing.
    pub done: u64,
    /// Total amount, in the same unit.
    pub total: u64,
}

/// A long operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Reading the log.
    Read,
    /// Drawing figures.
    Draw,
}
