//! Exports a log as CSV, Parquet or MATLAB file.
//!
//! CSV and Parquet: a folder with one file per channel, one row per message, one column per field ([`Frames`]). MATLAB: one file with one struct per channel
//! and one matrix per field (`mat`). Parquet files contain the units of their columns as JSON under the metadata key `units`. Long arrays are
//! columns of lists; in CSV, a list is a text with spaces between its values. Tables are built in memory: select channels or a part of a log of an hour first.

mod mat;

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};

use polars::prelude::{Column, CsvWriter, DataFrame, IntoColumn, NamedFrom, PolarsError, SerWriter, Series};
use replay::log::Types;

use crate::frames::{FileNames, write_parquet};
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
    /// Number of messages in the files that LCM decodes although they deviate from the format.
    pub deviating: u64,
    /// Number of integers that the format cannot hold exactly.
    pub rounded: u64,
}

impl Exported {
    /// True if no selected message is missing and all values are exact.
    pub fn is_lossless(&self) -> bool {
        self.unreadable == 0 && self.damaged == 0 && !self.cut && self.rounded == 0
    }
}

/// Writes the channels of a log that `wanted` accepts: into the folder `out`, which is created if missing, or into the file `out` for MATLAB and ticks.
///
/// # Errors
/// [`Error::Log`] if an output is the log itself; as [`Frames::read`]; [`Error::Write`]; [`Error::Frame`]; [`Error::TooLarge`] for a matrix that is too large for a Level 5 file.
pub fn export(
    log: &Path,
    out: &Path,
    format: ExportFormat,
    types: Types,
    wanted: impl Fn(&str) -> bool,
    progress: &mut dyn FnMut(Progress),
) -> Result<Exported, Error> {
    let check = |out: &Path| {
        let same = |source| Error::Log { path: log.to_owned(), source };
        replay::Error::check_distinct_files(log, out).map_err(same)
    };
    check(out)?;
    let mut frames = Frames::read_with(log, types, wanted, progress)?;
    let write_error = |path: &Path, source| Error::Write { path: path.to_owned(), source };
    let mut files = Vec::new();
    let (mut messages, mut rounded) = (0, 0);
    let mut names = FileNames::default();
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
        match format {
            ExportFormat::Csv => {
                let path = out.join(names.of(channel, "csv"));
                check(&path)?;
                let mut frame =
                    lists_as_text(frame).map_err(|source| Error::Frame { channel: channel.to_owned(), source })?;
                let target = File::create(&path).map_err(|source| write_error(&path, source))?;
                let written = CsvWriter::new(std::io::BufWriter::new(target)).finish(&mut frame);
                written.map_err(|source| Error::Frame { channel: channel.to_owned(), source })?;
                files.push(path);
            }
            ExportFormat::Parquet => {
                let path = out.join(names.of(channel, "parquet"));
                check(&path)?;
                write_parquet(frame, &units[channel], &path, channel)?;
                files.push(path);
            }
            ExportFormat::Mat | ExportFormat::Ticks => {}
        }
    }
    if format == ExportFormat::Mat {
        rounded = mat::write(out, &mut frames)?;
        files.push(out.to_owned());
    }
    Ok(Exported {
        files,
        messages,
        unreadable: frames.unreadable().values().sum(),
        damaged: frames.health().damaged.len() as u64,
        cut: frames.health().cut.is_some(),
        deviating: frames.deviating(),
        rounded,
    })
}

/// The frame with each list as a text: its values, separated by spaces.
fn lists_as_text(frame: &DataFrame) -> Result<DataFrame, PolarsError> {
    let as_text = |column: &Column| {
        let Ok(lists) = column.list() else { return Ok(column.clone()) };
        let text = |list: Series| list.iter().map(|value| value.str_value().into_owned()).collect::<Vec<_>>().join(" ");
        let texts: Vec<Option<String>> = (0..lists.len()).map(|row| lists.get_as_series(row).map(text)).collect();
        Ok(Series::new(column.name().clone(), texts).into_column())
    };
    let columns = frame.columns().iter().map(as_text).collect::<Result<Vec<_>, PolarsError>>()?;
    DataFrame::new(frame.height(), columns)
}
