//! Exports a log as CSV, Parquet or MATLAB file.
//!
//! CSV and Parquet: a folder with one file per channel, one row per message, one column per field ([`Frames`]). MATLAB: one file with one struct per channel
//! and one matrix per field (`mat`). Parquet files contain the units of their columns as JSON under the metadata key `units`. Tables are built in memory:
//! select channels or a part of a log of an hour first.

mod mat;

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};

use polars::prelude::{CsvWriter, SerWriter};
use replay::log::Types;

use crate::frames::write_parquet;
use crate::{Error, Frames, Progress};

/// Format of an export.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ExportFormat {
    /// Comma-separated values, with a line of column names.
    Csv,
    /// Apache Parquet.
    Parquet,
    /// One Apache Parquet file: the channels of the controller side by side, one row per tick.
    Ticks,
    /// MATLAB Level 5.
    Mat,
}

/// Result of an export.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Exported {
    /// Files written.
    pub files: Vec<PathBuf>,
    /// Number of messages in the files.
    pub messages: u64,
    /// Number of messages of unknown type or malformed messages, which are not in the files.
    pub unreadable: u64,
    /// Number of damaged places in the log.
    pub damaged: u64,
    /// The log ends inside a record.
    pub cut: bool,
}

impl Exported {
    /// True if no selected message is missing.
    pub fn is_lossless(&self) -> bool {
        self.unreadable == 0 && self.damaged == 0 && !self.cut
    }
}

/// Writes the channels of a log that `wanted` accepts: into the folder `out`, which is created if missing, or into the file `out` for MATLAB and ticks.
///
/// # Errors
/// As [`Frames::read`]; [`Error::Write`]; [`Error::Frame`]; [`Error::TooLarge`] for a matrix that is too large for a Level 5 file.
pub fn export(
    log: &Path,
    out: &Path,
    format: ExportFormat,
    types: Types,
    wanted: impl Fn(&str) -> bool,
    progress: &mut dyn FnMut(Progress),
) -> Result<Exported, Error> {
    let mut frames = Frames::read_with(log, types, wanted, progress)?;
    let write_error = |path: &Path, source| Error::Write { path: path.to_owned(), source };
    let mut files = Vec::new();
    let mut messages = 0;
    if format == ExportFormat::Ticks {
        let (mut ticks, units) = frames.ticks()?;
        write_parquet(&mut ticks, &units, out, "all")?;
        files.push(out.to_owned());
    } else if format != ExportFormat::Mat {
        std::fs::create_dir_all(out).map_err(|source| write_error(out, source))?;
    }
    let units: BTreeMap<String, _> = frames.names().map(|name| (name.to_owned(), frames.column_units(name))).collect();
    for (channel, frame) in frames.frames_mut() {
        messages += frame.height() as u64;
        let file = |ending: &str| out.join(format!("{}.{ending}", channel.replace(['/', '\\'], "_")));
        match format {
            ExportFormat::Csv => {
                let path = file("csv");
                let target = File::create(&path).map_err(|source| write_error(&path, source))?;
                let written = CsvWriter::new(std::io::BufWriter::new(target)).finish(frame);
                written.map_err(|source| Error::Frame { channel: channel.to_owned(), source })?;
                files.push(path);
            }
            ExportFormat::Parquet => {
                let path = file("parquet");
                write_parquet(frame, &units[channel], &path, channel)?;
                files.push(path);
            }
            ExportFormat::Mat | ExportFormat::Ticks => {}
        }
    }
    if format == ExportFormat::Mat {
        mat::write(out, &mut frames)?;
        files.push(out.to_owned());
    }
    Ok(Exported {
        files,
        messages,
        unreadable: frames.unreadable().values().sum(),
        damaged: frames.health().damaged.len() as u64,
        cut: frames.health().cut.is_some(),
    })
}
