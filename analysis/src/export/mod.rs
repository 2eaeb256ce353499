//! A log as tables of others: CSV, Parquet, MATLAB.
//!
//! CSV and Parquet: one file a channel in a folder, one row a message, one column a field ([`Frames`]). MATLAB: one file, one struct a
//! channel, one matrix a field (`mat`). Parquet files carry the units of their columns as JSON under the metadata key `units`. The tables are made in memory: a log of an hour should be filtered first.

mod mat;

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};

use polars::prelude::{CsvWriter, SerWriter};
use replay::log::Types;

use crate::frames::write_parquet;
use crate::{Error, Frames, Progress};

/// What to write.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Table {
    /// Text, a comma between values, a line of names first.
    Csv,
    /// Apache Parquet.
    Parquet,
    /// Apache Parquet, one file: the channels of the controller side by side, one row a tick.
    Ticks,
    /// MATLAB Level 5.
    Mat,
}

/// What was written.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Exported {
    /// The files.
    pub files: Vec<PathBuf>,
    /// Messages in them.
    pub messages: u64,
    /// Messages of no known type, and malformed ones: not in the files.
    pub unreadable: u64,
    /// Damaged stretches of the log.
    pub damaged: u64,
    /// The log stops inside a record.
    pub cut: bool,
}

impl Exported {
    /// Everything that was wanted is there.
    pub fn is_lossless(&self) -> bool {
        self.unreadable == 0 && self.damaged == 0 && !self.cut
    }
}

/// Writes the channels of a log that `wanted` accepts: into the folder `out`, which is made if need be, or the file `out` for MATLAB
/// and ticks.
///
/// # Errors
/// As [`Frames::read`]; [`Error::Write`]; [`Error::Frame`]; [`Error::TooLarge`] for a matrix that a Level 5 file cannot hold.
pub fn export(
    log: &Path,
    out: &Path,
    table: Table,
    types: Types,
    wanted: impl Fn(&str) -> bool,
    progress: &mut dyn FnMut(Progress),
) -> Result<Exported, Error> {
    let mut frames = Frames::read_with(log, types, wanted, progress)?;
    let write_error = |path: &Path, source| Error::Write { path: path.to_owned(), source };
    let mut files = Vec::new();
    let mut messages = 0;
    if table == Table::Ticks {
        let (mut ticks, units) = frames.ticks()?;
        write_parquet(&mut ticks, &units, out, "all")?;
        files.push(out.to_owned());
    } else if table != Table::Mat {
        std::fs::create_dir_all(out).map_err(|source| write_error(out, source))?;
    }
    let units: BTreeMap<String, _> = frames.names().map(|name| (name.to_owned(), frames.column_units(name))).collect();
    for (channel, frame) in frames.frames_mut() {
        messages += frame.height() as u64;
        let file = |ending: &str| out.join(format!("{}.{ending}", channel.replace(['/', '\\'], "_")));
        match table {
            Table::Csv => {
                let path = file("csv");
                let target = File::create(&path).map_err(|source| write_error(&path, source))?;
                let written = CsvWriter::new(std::io::BufWriter::new(target)).finish(frame);
                written.map_err(|source| Error::Frame { channel: channel.to_owned(), source })?;
                files.push(path);
            }
            Table::Parquet => {
                let path = file("parquet");
                write_parquet(frame, &units[channel], &path, channel)?;
                files.push(path);
            }
            Table::Mat | Table::Ticks => {}
        }
    }
    if table == Table::Mat {
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
