//! Data frames: one per channel, a row a message, a column a field.
//!
//! Columns are named by path, such as `q[3]` or `state.q[3]`, and found by reflection, so a channel that this project has never heard of
//! is a frame too, if the log carries its type (RUN_INFO) or the stack knows it. Integers become `i64`, floats `f64`, booleans and
//! strings themselves; a field that a message does not have (arrays may differ in length) is null. The first column, `log_t_ns`, is
//! the time that the log gives the message.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs::File;
use std::path::{Path, PathBuf};

use lcm_idl::{Leaf, Type, TypeSet};
use lcmtypes::{Message, RunInfo};
use polars::prelude::{
    Column, DataFrame, IdxCa, IntoColumn, NamedFrom, NewChunkedArray, ParquetWriter, PolarsError, Series,
};
use replay::log::LogReader;

use crate::{Error, Progress, Stage};

/// Column of the time that the log gives each message, ns.
pub const LOG_TIME: &str = "log_t_ns";

/// The frames of a log, by channel.
#[derive(Debug)]
pub struct Frames {
    channels: BTreeMap<String, DataFrame>,
    units: BTreeMap<String, BTreeMap<String, String>>,
    unreadable: BTreeMap<String, u64>,
}

impl Frames {
    /// Reads the channels that `wanted` accepts. A channel without a known type, or messages that do not decode, are counted, not an error.
    pub fn read(path: &Path, wanted: impl Fn(&str) -> bool, progress: &mut dyn FnMut(Progress)) -> Result<Self, Error> {
        let log_error = |source| Error::Log { path: path.to_owned(), source };
        let reader = LogReader::open(path).map_err(log_error)?;
        let total = reader.bytes();
        let mut own_types = None;
        let mut tables: BTreeMap<String, Table> = BTreeMap::new();
        let mut units = BTreeMap::new();
        let mut unreadable: BTreeMap<String, u64> = BTreeMap::new();
        for (number, event) in reader.events().enumerate() {
            let event = event.map_err(log_error)?;
            if number.is_multiple_of(4096) {
                progress(Progress { stage: Stage::Read, done: event.offset, total });
            }
            if &*event.channel == "RUN_INFO" && own_types.is_none() {
                own_types = types_of_run(path, &event.data)?;
            }
            if !wanted(&event.channel) {
                continue;
            }
            let own = own_types.as_ref().and_then(|types| types.of_message(&event.data));
            let read = own.or_else(|| lcmtypes::types().of_message(&event.data)).and_then(|ty| {
                units.entry(event.channel.to_string()).or_insert_with(|| units_of(ty));
                tables.entry(event.channel.to_string()).or_default().push(event.t_ns, ty, &event.data)
            });
            if read.is_none() {
                *unreadable.entry(event.channel.to_string()).or_default() += 1;
            }
        }
        progress(Progress { stage: Stage::Read, done: total, total });
        let frame = |(channel, table): (String, Table)| match table.into_frame() {
            Ok(frame) => Ok((channel, frame)),
            Err(source) => Err(Error::Frame { channel, source }),
        };
        Ok(Self { channels: tables.into_iter().map(frame).collect::<Result<_, _>>()?, units, unreadable })
    }

    /// Names of the channels.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.channels.keys().map(String::as_str)
    }

    /// The frame of a channel.
    pub fn get(&self, channel: &str) -> Result<&DataFrame, Error> {
        self.channels.get(channel).ok_or_else(|| Error::NoSuchChannel {
            channel: channel.to_owned(),
            found: self.names().collect::<Vec<_>>().join(", "),
        })
    }

    /// Unit of each field of a channel, from the table of fields in its `.lcm` file; fields without a unit are left out.
    pub fn units(&self, channel: &str) -> BTreeMap<String, String> {
        self.units.get(channel).cloned().unwrap_or_default()
    }

    /// Messages per channel that could not be read.
    pub fn unreadable(&self) -> &BTreeMap<String, u64> {
        &self.unreadable
    }

    /// Several channels side by side, columns named `CHANNEL.path`: one row per message of the first, and the message of each other that is nearest in
    /// `t_ns`, null where none is within half the median step of the first.
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

    /// Writes one `CHANNEL.parquet` per channel into a directory, which is made if need be, and returns the files.
    pub fn write_parquet(&mut self, dir: &Path) -> Result<Vec<PathBuf>, Error> {
        std::fs::create_dir_all(dir).map_err(|source| Error::Write { path: dir.to_owned(), source })?;
        let mut files = Vec::new();
        for (channel, frame) in &mut self.channels {
            let path = dir.join(format!("{}.parquet", channel.replace(['/', '\\'], "_")));
            write_parquet(frame, &path, channel)?;
            files.push(path);
        }
        Ok(files)
    }
}

/// Writes a frame to a Parquet file; `name` is what an error calls it.
pub fn write_parquet(frame: &mut DataFrame, path: &Path, name: &str) -> Result<(), Error> {
    let file = File::create(path).map_err(|source| Error::Write { path: path.to_owned(), source })?;
    let written = ParquetWriter::new(file).finish(frame);
    written.map(drop).map_err(|source| Error::Frame { channel: name.to_owned(), source })
}

/// The types that a log carries in its RUN_INFO; `None` if that does not decode.
pub(crate) fn types_of_run(path: &Path, run_info: &[u8]) -> Result<Option<TypeSet>, Error> {
    let Ok(info) = RunInfo::decode(run_info) else { return Ok(None) };
    let texts = info.lcm_types.iter().map(|file| (file.name.as_str(), file.text.as_str()));
    TypeSet::parse(texts).map(Some).map_err(|source| Error::Types { path: path.to_owned(), source })
}

/// Units of the fields of a type: its comment holds a Markdown table with the columns `field` and `unit`.
fn units_of(ty: Type<'_>) -> BTreeMap<String, String> {
    let cells =
        |line: &str| line.trim().trim_matches('|').split('|').map(|cell| cell.trim().to_owned()).collect::<Vec<_>>();
    let comment = ty.def().comment.as_deref().unwrap_or_default();
    let mut rows = comment.lines().filter(|line| line.trim_start().starts_with('|')).map(cells);
    let Some(header) = rows.next() else { return BTreeMap::new() };
    let place = |name: &str| header.iter().position(|cell| cell == name);
    let Some((field, unit)) = place("field").zip(place("unit")) else { return BTreeMap::new() };
    let named = rows.filter_map(|row| Some((row.get(field)?.clone(), row.get(unit)?.clone())));
    named.filter(|(_, unit)| !unit.is_empty() && !unit.starts_with('-')).collect()
}

/// The messages of one channel, column by column.
#[derive(Default)]
struct Table {
    log_times: Vec<i64>,
    names: Vec<String>,
    columns: Vec<Values>,
}

enum Values {
    Integers(Vec<Option<i64>>),
    Floats(Vec<Option<f64>>),
    Flags(Vec<Option<bool>>),
    Texts(Vec<Option<String>>),
}

impl Table {
    /// Appends a message; `None` if it does not decode, and then the table is as it was.
    fn push(&mut self, log_t_ns: i64, ty: Type<'_>, message: &[u8]) -> Option<()> {
        // Decode once without effect: a message that breaks off half-way leaves no half row.
        ty.walk(message, |_, _| ()).ok()?;
        let row = self.log_times.len();
        let mut cursor = 0;
        let mut name = String::new();
        let walked = ty.walk(message, |path, leaf| {
            name.clear();
            let _ = write!(name, "{path}");
            let at = self.column(cursor, &name, leaf);
            self.columns[at].set(row, leaf);
            cursor = at + 1;
        });
        self.log_times.push(log_t_ns);
        walked.ok()
    }

    /// Index of a column, made if it is new. Fields come in the same order in almost every message, so the next is tried first.
    fn column(&mut self, cursor: usize, name: &str, leaf: Leaf<'_>) -> usize {
        if self.names.get(cursor).is_some_and(|next| next == name) {
            return cursor;
        }
        self.names.iter().position(|known| known == name).unwrap_or_else(|| {
            let at = cursor.min(self.names.len());
            self.names.insert(at, name.to_owned());
            self.columns.insert(at, Values::like(leaf));
            at
        })
    }

    fn into_frame(self) -> Result<DataFrame, PolarsError> {
        let rows = self.log_times.len();
        let mut columns = vec![Series::new(LOG_TIME.into(), self.log_times).into_column()];
        for (name, values) in self.names.into_iter().zip(self.columns) {
            columns.push(values.into_column(&name, rows));
        }
        DataFrame::new(rows, columns)
    }
}

impl Values {
    fn like(leaf: Leaf<'_>) -> Self {
        match leaf {
            Leaf::Float(_) | Leaf::Double(_) => Self::Floats(Vec::new()),
            Leaf::Boolean(_) => Self::Flags(Vec::new()),
            Leaf::String(_) => Self::Texts(Vec::new()),
            _ => Self::Integers(Vec::new()),
        }
    }

    /// Sets the value of a row; rows between the last one set and this one are null. A channel has one type, so the kinds agree.
    fn set(&mut self, row: usize, leaf: Leaf<'_>) {
        match self {
            Self::Integers(values) => put(values, row, leaf.as_i64()),
            Self::Floats(values) => put(values, row, leaf.as_f64()),
            Self::Flags(values) => put(values, row, leaf.as_i64().map(|v| v != 0)),
            Self::Texts(values) => put(values, row, leaf.as_str().map(str::to_owned)),
        }
    }

    fn into_column(self, name: &str, rows: usize) -> Column {
        match self {
            Self::Integers(values) => Series::new(name.into(), filled(values, rows)).into_column(),
            Self::Floats(values) => Series::new(name.into(), filled(values, rows)).into_column(),
            Self::Flags(values) => Series::new(name.into(), filled(values, rows)).into_column(),
            Self::Texts(values) => Series::new(name.into(), filled(values, rows)).into_column(),
        }
    }
}

fn put<T>(values: &mut Vec<Option<T>>, row: usize, value: Option<T>) {
    values.resize_with(row, || None);
    values.push(value);
}

fn filled<T>(mut values: Vec<Option<T>>, rows: usize) -> Vec<Option<T>> {
    values.resize_with(rows, || None);
    values
}

/// Times of the rows: the message's own, or the log's if it has none.
fn times_of(frame: &DataFrame) -> Result<Vec<i64>, PolarsError> {
    let column = frame.column("t_ns").or_else(|_| frame.column(LOG_TIME))?;
    Ok(column.i64()?.iter().map(|t| t.unwrap_or(i64::MIN)).collect())
}

fn prefixed(frame: &DataFrame, channel: &str) -> Result<DataFrame, PolarsError> {
    let named = |column: &Column| column.clone().with_name(format!("{channel}.{}", column.name()).into());
    DataFrame::new(frame.height(), frame.columns().iter().map(named).collect())
}

/// Row of the nearest time in `times` for each time of the grid, `None` if it is farther than half the grid's median step.
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
