//! Data frames: one per channel, with one row per message and one column per field.
//!
//! Columns are named by path, such as `q[3]` or `state.q[3]`. Types come by reflection from the stack or from the log (RUN_INFO), so channels of other
//! projects are frames, too. Integers become `i64`, floats `f64`; booleans and strings stay. A field that a message does not have (arrays may differ in
//! length) is null. CONTROLLER_INPUT is shown as the controller read it: the fields of `tick_input_t`. The first column, `log_t_ns`, is the time of the message in the log.
//!
//! An array with more than 256 values in one message (images, point clouds) is one column of lists, named without indices: `data`, `points.x`.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::path::{Path, PathBuf};

use lcm_idl::Type;
use lcm_idl::ast::FieldType;
use polars::prelude::{Column, DataFrame, IdxCa, KeyValueMetadata, NewChunkedArray, ParquetWriter, PolarsError};
use replay::log::{Health, LogReader, Types};

use crate::consumed::Consumed;
use crate::frame_rows::Rows;
use crate::{Error, Progress, Stage};

/// Name of the column with the time of the message in the log, ns.
pub const LOG_TIME: &str = "log_t_ns";

/// The frames of a log, by channel.
#[derive(Debug)]
pub struct Frames {
    channels: BTreeMap<String, DataFrame>,
    units: BTreeMap<String, BTreeMap<String, String>>,
    unreadable: BTreeMap<String, u64>,
    deviating: u64,
    health: Health,
}

impl Frames {
    /// Reads the channels that `wanted` accepts. Messages of unknown type and messages that cannot be decoded are counted.
    ///
    /// # Errors
    /// [`Error::Log`] if the log cannot be read, [`Error::Frame`] if a frame cannot be built.
    pub fn read(path: &Path, wanted: impl Fn(&str) -> bool, progress: &mut dyn FnMut(Progress)) -> Result<Self, Error> {
        Self::read_with(path, Types::default(), wanted, progress)
    }

    /// As [`Frames::read`], with additional types.
    ///
    /// # Errors
    /// As [`Frames::read`].
    pub fn read_with(
        path: &Path,
        mut types: Types,
        wanted: impl Fn(&str) -> bool,
        progress: &mut dyn FnMut(Progress),
    ) -> Result<Self, Error> {
        let log_error = |source| Error::Log { path: path.to_owned(), source };
        let mut reader = LogReader::open(path).map_err(log_error)?;
        let total = reader.bytes();
        let mut tables: BTreeMap<String, Rows> = BTreeMap::new();
        let mut units = BTreeMap::new();
        let mut unreadable: BTreeMap<String, u64> = BTreeMap::new();
        let (mut health, mut number, mut deviating) = (Health::default(), 0_u64, 0);
        let mut components = Consumed::default();
        while let Some(item) = reader.read().map_err(log_error)? {
            let Some(event) = health.note(item) else { continue };
            if number.is_multiple_of(4096) {
                progress(Progress { stage: Stage::Read, done: event.offset, total });
            }
            number += 1;
            types.learn(&event);
            components.restore(event.channel, event.data);
            if !wanted(event.channel) {
                continue;
            }
            let consumed = components.bytes(event.channel, event.data);
            let found = match &consumed {
                Some(bytes) => lcmtypes::types().of_message(bytes).map(|ty| (ty, &bytes[..])),
                None => types.of_message(event.channel, event.data).map(|ty| (ty, event.data)),
            };
            let read = found.and_then(|(ty, data)| {
                units.entry(event.channel.to_string()).or_insert_with(|| units_of(ty));
                tables.entry(event.channel.to_string()).or_default().push(event.t_ns, ty, data)
            });
            deviating += u64::from(read.is_some_and(|deviations| !deviations.is_none()));
            if read.is_none() {
                *unreadable.entry(event.channel.to_string()).or_default() += 1;
            }
        }
        progress(Progress { stage: Stage::Read, done: total, total });
        let frame = |(channel, table): (String, Rows)| match table.into_frame() {
            Ok(frame) => Ok((channel, frame)),
            Err(source) => Err(Error::Frame { channel, source }),
        };
        Ok(Self {
            channels: tables.into_iter().map(frame).collect::<Result<_, _>>()?,
            units,
            unreadable,
            deviating,
            health,
        })
    }

    /// Names of the channels.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.channels.keys().map(String::as_str)
    }

    /// The frame of a channel.
    ///
    /// # Errors
    /// [`Error::NoSuchChannel`].
    pub fn get(&self, channel: &str) -> Result<&DataFrame, Error> {
        self.channels.get(channel).ok_or_else(|| Error::NoSuchChannel {
            channel: channel.to_owned(),
            found: self.names().collect::<Vec<_>>().join(", "),
        })
    }

    /// Units of the fields of a channel, from the table in its `.lcm` file. Fields without a unit are omitted.
    pub fn units(&self, channel: &str) -> BTreeMap<String, String> {
        self.units.get(channel).cloned().unwrap_or_default()
    }

    /// Number of messages per channel that could not be decoded.
    pub fn unreadable(&self) -> &BTreeMap<String, u64> {
        &self.unreadable
    }

    /// Number of messages that LCM decodes although they deviate from the format; they are in the frames.
    pub fn deviating(&self) -> u64 {
        self.deviating
    }

    /// Damage of the log.
    pub fn health(&self) -> &Health {
        &self.health
    }

    /// The frames, by channel.
    pub(crate) fn frames_mut(&mut self) -> impl Iterator<Item = (&str, &mut DataFrame)> {
        self.channels.iter_mut().map(|(channel, frame)| (channel.as_str(), frame))
    }

    /// Units of the columns of a frame. All elements of an array have the unit of its field.
    pub fn column_units(&self, channel: &str) -> BTreeMap<String, String> {
        let (Some(frame), Some(units)) = (self.channels.get(channel), self.units.get(channel)) else {
            return BTreeMap::new();
        };
        let columns = frame.columns().iter().map(|column| column.name().to_string());
        let unit_of = |column: String| {
            let field: String =
                column.split('[').flat_map(|part| part.split_once(']').map_or(Some(part), |p| Some(p.1))).collect();
            units.get(&field).map(|unit| (column, unit.clone()))
        };
        let log_time = [(LOG_TIME.to_owned(), "ns".to_owned())];
        columns.filter_map(unit_of).chain(log_time).collect()
    }

    /// All channels whose messages have a tick number, ROBOT_STATE and GROUND_TRUTH side by side, with the units of the columns. There is one row per message of
    /// CONTROLLER_TICK, or of the first of these channels if the log has none.
    ///
    /// # Errors
    /// [`Error::NoSuchChannel`] if no channel has a tick number.
    pub fn ticks(&self) -> Result<(DataFrame, BTreeMap<String, String>), Error> {
        const GRID: &str = "CONTROLLER_TICK";
        let ticked = |frame: &DataFrame| frame.column("t_ns").is_ok() && frame.column("tick").is_ok();
        let truth = |name: &&str| ["ROBOT_STATE", "GROUND_TRUTH"].contains(name);
        let with_tick = self.channels.iter().filter(|(_, frame)| ticked(frame)).map(|(name, _)| name.as_str());
        let mut channels: Vec<&str> = with_tick.filter(|name| *name != "EVENT").collect();
        if channels.is_empty() {
            self.get(GRID)?;
        }
        channels.extend(self.names().filter(truth));
        channels.sort_by_key(|name| (*name != GRID, truth(name), *name));
        let units = channels.iter().flat_map(|channel| {
            self.column_units(channel).into_iter().map(move |(column, unit)| (format!("{channel}.{column}"), unit))
        });
        Ok((self.joined(&channels)?, units.collect()))
    }

    /// Several channels side by side, with columns named `CHANNEL.path`. There is one row per message of the first channel, with the message of each other
    /// channel that is nearest in `t_ns`; null if none is within half the median step of the first channel.
    ///
    /// # Errors
    /// [`Error::NoSuchChannel`], or [`Error::Frame`].
    pub fn joined(&self, channels: &[&str]) -> Result<DataFrame, Error> {
        let mut out: Option<(Vec<i64>, DataFrame)> = None;
        for &channel in channels {
            let source_error = |source| Error::Frame { channel: channel.to_owned(), source };
            let frame = self.get(channel)?;
            let times = times_of(frame).map_err(source_error)?;
            let (grid, joined) = match out.take() {
                None => (times, prefixed(frame, channel).map_err(source_error)?),
                Some((grid, so_far)) => {
                    let rows = IdxCa::from_iter_options("row".into(), nearest_rows(&grid, &times).into_iter());
                    let beside = frame.take(&rows).map_err(source_error)?;
                    let columns = prefixed(&beside, channel).map_err(source_error)?.into_columns();
                    (grid, so_far.hstack(&columns).map_err(source_error)?)
                }
            };
            out = Some((grid, joined));
        }
        Ok(out.map(|(_, frame)| frame).unwrap_or_default())
    }

    /// Writes one `CHANNEL.parquet` per channel into a folder, which is created if missing, and returns the paths.
    ///
    /// # Errors
    /// [`Error::Write`] or [`Error::Frame`].
    pub fn write_parquet(&mut self, dir: &Path) -> Result<Vec<PathBuf>, Error> {
        std::fs::create_dir_all(dir).map_err(|source| Error::Write { path: dir.to_owned(), source })?;
        let mut files = Vec::new();
        let units: BTreeMap<String, _> = self.names().map(|name| (name.to_owned(), self.column_units(name))).collect();
        let mut names = FileNames::default();
        for (channel, frame) in &mut self.channels {
            let path = dir.join(names.of(channel, "parquet"));
            write_parquet(frame, &units[channel], &path, channel)?;
            files.push(path);
        }
        Ok(files)
    }
}

/// Names of the files of channels: without separators, never equal.
#[derive(Debug, Default)]
pub(crate) struct FileNames {
    /// Names in use, in lower case.
    used: BTreeSet<String>,
    /// By name in lower case: the number after the last one given, so that many channels with one name do not try all numbers again.
    next: BTreeMap<String, u64>,
}

impl FileNames {
    /// The file name of a channel. A second channel that would get the same name gets a number.
    pub fn of(&mut self, channel: &str, ending: &str) -> String {
        // File systems allow 255 bytes, and some do not distinguish case.
        let plain = |c: char| if c.is_control() || matches!(c, '/' | '\\' | ':') { '_' } else { c };
        let mut base: String = replay::printable(channel).chars().map(plain).collect();
        while base.len() > 200 {
            base.pop();
        }
        let next = self.next.entry(base.to_lowercase()).or_insert(2);
        let mut name = base.clone();
        while !self.used.insert(name.to_lowercase()) {
            name = format!("{base}_{next}");
            *next += 1;
        }
        format!("{name}.{ending}")
    }
}

/// Key of the units in the metadata of a Parquet file.
pub const UNITS_KEY: &str = "units";

/// Writes a frame to a Parquet file. `units`, by column, are stored as a JSON object under the metadata key `units`; `name` is the name of the frame in
/// error messages.
///
/// # Errors
/// [`Error::Write`] or [`Error::Frame`].
pub fn write_parquet(
    frame: &mut DataFrame,
    units: &BTreeMap<String, String>,
    path: &Path,
    name: &str,
) -> Result<(), Error> {
    let file = File::create(path).map_err(|source| Error::Write { path: path.to_owned(), source })?;
    let units = serde_json::to_string(units).expect("a map of texts is always JSON");
    let metadata = KeyValueMetadata::from_static(vec![(UNITS_KEY.to_owned(), units)]);
    let written = ParquetWriter::new(file).with_key_value_metadata(Some(metadata)).finish(frame);
    written.map(drop).map_err(|source| Error::Frame { channel: name.to_owned(), source })
}

/// Units of the fields of a type, by path, from the Markdown table with the columns `field` and `unit` in its comment.
fn units_of(ty: Type<'_>) -> BTreeMap<String, String> {
    let cells =
        |line: &str| line.trim().trim_matches('|').split('|').map(|cell| cell.trim().to_owned()).collect::<Vec<_>>();
    let comment = ty.def().comment.as_deref().unwrap_or_default();
    let mut rows = comment.lines().filter(|line| line.trim_start().starts_with('|')).map(cells);
    let header = rows.next().unwrap_or_default();
    let place = |name: &str| header.iter().position(|cell| cell == name);
    let mut units = BTreeMap::new();
    if let Some((field, unit)) = place("field").zip(place("unit")) {
        for (names, unit) in rows.filter_map(|row| Some((row.get(field)?.clone(), row.get(unit)?.clone()))) {
            // A row may have several fields. Dashes are the line below the header.
            if !unit.is_empty() && !unit.starts_with('-') {
                units.extend(names.split(", ").map(|name| (name.to_owned(), unit.clone())));
            }
        }
    }
    for member in &ty.def().fields {
        if let FieldType::Named(name) = &member.ty
            && let Some(inner) = lcmtypes::types().by_name(&name.to_string())
        {
            units.extend(units_of(inner).into_iter().map(|(field, unit)| (format!("{}.{field}", member.name), unit)));
        }
    }
    units
}

/// Times of the rows, ns: `t_ns` of the message, or the time of the log if it has none.
fn times_of(frame: &DataFrame) -> Result<Vec<i64>, PolarsError> {
    let column = frame.column("t_ns").or_else(|_| frame.column(LOG_TIME))?;
    Ok(column.i64()?.iter().map(|t| t.unwrap_or(i64::MIN)).collect())
}

fn prefixed(frame: &DataFrame, channel: &str) -> Result<DataFrame, PolarsError> {
    let named = |column: &Column| column.clone().with_name(format!("{channel}.{}", column.name()).into());
    DataFrame::new(frame.height(), frame.columns().iter().map(named).collect())
}

/// For each time of the grid, the row with the nearest time; `None` if it differs by more than half the median step of the grid.
fn nearest_rows(grid: &[i64], times: &[i64]) -> Vec<Option<u32>> {
    let mut steps: Vec<i64> = grid.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_unstable();
    let tolerance = steps.get(steps.len() / 2).map_or(0, |step| step.unsigned_abs() / 2);
    let mut order: Vec<u32> = (0..times.len() as u32).collect();
    order.sort_by_key(|&row| times[row as usize]);
    let distance = |row: &u32, t: i64| times[*row as usize].abs_diff(t);
    let nearest = |&t: &i64| {
        let after = order.partition_point(|&row| times[row as usize] < t);
        let candidates = order.get(after.saturating_sub(1)..).unwrap_or_default().iter().take(2).copied();
        candidates.min_by_key(|row| distance(row, t)).filter(|row| distance(row, t) <= tolerance)
    };
    grid.iter().map(nearest).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn file_names_differ_on_every_file_system() {
        let mut names = FileNames::default();
        let found = ["A/b", "a:B", "a_b_2", "A\\B", "../x"].map(|channel| names.of(channel, "csv"));
        assert_eq!(found, ["A_b.csv", "a_B_2.csv", "a_b_2_2.csv", "A_B_3.csv", ".._x.csv"]);
    }

    /// As many channels as a log can have, all with one name.
    #[test]
    fn many_channels_with_one_name_get_different_files() {
        let mut names = FileNames::default();
        let found: BTreeSet<String> = (0..65_000).map(|n| names.of(&format!("{:300}{n}", ""), "csv")).collect();
        assert_eq!(found.len(), 65_000);
    }
}
