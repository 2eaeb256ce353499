//! Uncompressed MATLAB files of Level 5, readable by MATLAB, Octave and scipy without a toolbox.
//!
//! A channel is a struct with the fields of the message, nested structs included, and `log_t_ns`. A field of n messages is a matrix of n rows: `q` of 12
//! joints is n x 12, `f_F_W[4][3]` is n x 4 x 3, and a list of at most m values is n x m; strings are cells. Integers are int64, booleans logical. Missing
//! values (arrays may differ in length) are NaN, and the field is double then; integers that a double cannot hold are counted.
//!
//! This writer is our own: the crates of pure Rust that were found either only read MAT files (matfile 0.5) or write the current time into the file
//! (matrw 0.1), so that equal logs would not give equal bytes.
//!
//! Source: The MathWorks, *MAT-File Format* (R2024a), "Level 5 MAT-Files".

use std::io::Write;
use std::path::Path;

use polars::prelude::{AnyValue, Column, DataType, IntoColumn, Series};

use crate::{Error, Frames};

const MI_INT8: u32 = 1;
const MI_UINT8: u32 = 2;
const MI_INT32: u32 = 5;
const MI_UINT32: u32 = 6;
const MI_DOUBLE: u32 = 9;
const MI_INT64: u32 = 12;
const MI_MATRIX: u32 = 14;
const MI_UTF8: u32 = 16;

const CELL: u32 = 1;
const STRUCT: u32 = 2;
const CHAR: u32 = 4;
const DOUBLE: u32 = 6;
const UINT8: u32 = 9;
const INT64: u32 = 14;
/// Flag of an array of bytes that contains logical values.
const LOGICAL: u32 = 0x200;

/// Length of a name with its terminating NUL.
const NAME: usize = 64;

/// Writes each frame as a variable with the name of its channel. Returns the number of integers that were rounded.
pub(super) fn write(path: &Path, frames: &mut Frames) -> Result<u64, Error> {
    let io = |source| Error::Write { path: path.to_owned(), source };
    let file = std::fs::File::create(path).map_err(io)?;
    let mut out = std::io::BufWriter::new(file);
    let mut header = [b' '; 128];
    let text = b"MATLAB 5.0 MAT-file, hoofprint";
    header[..text.len()].copy_from_slice(text);
    header[116..124].fill(0);
    header[124..128].copy_from_slice(&[0, 1, b'I', b'M']);
    out.write_all(&header).map_err(io)?;
    let (mut names, mut rounded) = (Vec::new(), 0);
    for (channel, frame) in frames.frames_mut() {
        let too_large = || Error::TooLarge { path: path.to_owned(), channel: channel.to_owned() };
        let mut root = Struct::default();
        for column in frame.columns() {
            let (fields, indices) = split(column.name());
            root.field(&fields).parts.push((indices, column.clone()));
        }
        let name = name(channel, &mut names);
        let matrix = root.matrix(&name, frame.height(), &mut rounded).ok_or_else(too_large)?;
        out.write_all(&matrix).map_err(io)?;
    }
    out.flush().map_err(io)?;
    Ok(rounded)
}

/// Splits a path: `state.legs[2].q[3]` has the fields `state`, `legs`, `q` and the indices 2, 3.
fn split(path: &str) -> (Vec<String>, Vec<usize>) {
    let (mut fields, mut indices) = (Vec::new(), Vec::new());
    for step in path.split('.') {
        let mut parts = step.split('[');
        fields.extend(parts.next().map(str::to_owned));
        indices.extend(parts.filter_map(|index| index.trim_end_matches(']').parse::<usize>().ok()));
    }
    (fields, indices)
}

/// A valid MATLAB name that is not in use.
fn name(wanted: &str, used: &mut Vec<String>) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    let mut base: String = wanted.chars().map(plain).take(NAME - 5).collect();
    if !base.starts_with(|c: char| c.is_ascii_alphabetic()) {
        base.insert(0, 'x');
    }
    let numbered = (2..).map(|n| format!("{base}_{n}"));
    let free = std::iter::once(base.clone()).chain(numbered).find(|name| !used.contains(name)).unwrap_or_default();
    used.push(free.clone());
    free
}

#[derive(Default)]
struct Struct {
    fields: Vec<(String, Node)>,
}

enum Node {
    Inner(Struct),
    Field(Field),
}

/// The columns of one field, each with its indices.
#[derive(Default)]
struct Field {
    parts: Vec<(Vec<usize>, Column)>,
}

impl Struct {
    /// The field at a path, added if missing.
    fn field(&mut self, path: &[String]) -> &mut Field {
        let (first, rest) = path.split_first().map_or((String::new(), path), |(first, rest)| (first.clone(), rest));
        let place = self
            .fields
            .iter()
            .position(|(name, node)| *name == first && matches!(node, Node::Field(_)) == rest.is_empty());
        let place = place.unwrap_or_else(|| {
            let node = if rest.is_empty() { Node::Field(Field::default()) } else { Node::Inner(Struct::default()) };
            self.fields.push((first, node));
            self.fields.len() - 1
        });
        match &mut self.fields[place].1 {
            Node::Field(field) => field,
            Node::Inner(inner) => inner.field(rest),
        }
    }

    /// `None` if an element exceeds the size limit of the format.
    fn matrix(&self, called: &str, rows: usize, rounded: &mut u64) -> Option<Vec<u8>> {
        let mut body = head(STRUCT, &[1, 1], called)?;
        let mut used = Vec::new();
        let names: Vec<String> = self.fields.iter().map(|(field, _)| name(field, &mut used)).collect();
        element(&mut body, MI_INT32, &(NAME as i32).to_le_bytes())?;
        let mut table = Vec::with_capacity(names.len() * NAME);
        for name in &names {
            table.extend_from_slice(name.as_bytes());
            table.resize(table.len().next_multiple_of(NAME), 0);
        }
        element(&mut body, MI_INT8, &table)?;
        for (_, node) in &self.fields {
            body.extend(match node {
                Node::Inner(inner) => inner.matrix("", rows, rounded)?,
                Node::Field(field) => field.matrix(rows, rounded)?,
            });
        }
        wrapped(&body)
    }
}

impl Field {
    fn matrix(&self, rows: usize, rounded: &mut u64) -> Option<Vec<u8>> {
        if let Some((_, column)) = self.parts.first()
            && column.list().is_ok()
        {
            return Field { parts: columns_of(column)? }.matrix(rows, rounded);
        }
        let levels = self.parts.iter().map(|(place, _)| place.len()).max().unwrap_or(0);
        let extent =
            |level: usize| self.parts.iter().filter_map(|(place, _)| place.get(level)).max().map_or(1, |&n| n + 1);
        let mut dims = vec![rows];
        dims.extend((0..levels).map(extent));
        if dims.len() == 1 {
            dims.push(1);
        }
        // Column-major order: index of a column in the matrix.
        let place = |indices: &[usize]| {
            let (mut at, mut stride) = (0, 1);
            for (level, extent) in dims[1..].iter().enumerate() {
                at += indices.get(level).copied().unwrap_or(0) * stride;
                stride *= extent;
            }
            at
        };
        let columns: usize = dims[1..].iter().product();
        let kind = self.parts.first().map(|(_, column)| column.dtype().clone());
        let is_full = columns == self.parts.len() && self.parts.iter().all(|(_, column)| column.null_count() == 0);
        match kind {
            Some(DataType::String) => {
                let mut texts = vec![String::new(); rows * columns];
                for (indices, column) in &self.parts {
                    let at = place(indices) * rows;
                    for (row, text) in column.str().ok()?.iter().enumerate() {
                        texts[at + row] = text.unwrap_or_default().to_owned();
                    }
                }
                cells(&dims, &texts)
            }
            Some(DataType::Int64) if is_full => {
                let mut data = vec![0; rows * columns * 8];
                for (indices, column) in &self.parts {
                    let target = &mut data[place(indices) * rows * 8..];
                    for (slot, value) in target.chunks_exact_mut(8).zip(column.i64().ok()?.iter()) {
                        slot.copy_from_slice(&value.unwrap_or(0).to_le_bytes());
                    }
                }
                numbers(INT64, MI_INT64, &dims, &data)
            }
            Some(DataType::Boolean) if is_full => {
                let mut data = vec![0; rows * columns];
                for (indices, column) in &self.parts {
                    let target = &mut data[place(indices) * rows..];
                    for (slot, value) in target.iter_mut().zip(column.bool().ok()?.iter()) {
                        *slot = u8::from(value.unwrap_or(false));
                    }
                }
                numbers(UINT8 | LOGICAL, MI_UINT8, &dims, &data)
            }
            _ => {
                let mut data = f64::NAN.to_le_bytes().repeat(rows * columns);
                for (indices, column) in &self.parts {
                    if let Ok(integers) = column.i64() {
                        *rounded +=
                            integers.iter().flatten().filter(|&v| v as f64 as i128 != i128::from(v)).count() as u64;
                    }
                    let column = column.cast(&DataType::Float64).ok()?;
                    let target = &mut data[place(indices) * rows * 8..];
                    for (slot, value) in target.chunks_exact_mut(8).zip(column.f64().ok()?.iter()) {
                        slot.copy_from_slice(&value.unwrap_or(f64::NAN).to_le_bytes());
                    }
                }
                numbers(DOUBLE, MI_DOUBLE, &dims, &data)
            }
        }
    }
}

/// The columns of a column of lists: one for each place in the longest list.
fn columns_of(column: &Column) -> Option<Vec<(Vec<usize>, Column)>> {
    let lists = column.list().ok()?;
    let lists: Vec<Option<Series>> = (0..lists.len()).map(|row| lists.get_as_series(row)).collect();
    let longest = lists.iter().flatten().map(|list| list.len()).max().unwrap_or(0);
    let place = |index: usize| {
        let values: Vec<AnyValue<'_>> = lists
            .iter()
            .map(|list| list.as_ref().and_then(|list| list.get(index).ok()).unwrap_or(AnyValue::Null))
            .collect();
        let inner = column.dtype().inner_dtype()?;
        let series = Series::from_any_values_and_dtype(column.name().clone(), &values, inner, true).ok()?;
        Some((vec![index], series.into_column()))
    };
    (0..longest).map(place).collect()
}

fn numbers(class: u32, kind: u32, dims: &[usize], data: &[u8]) -> Option<Vec<u8>> {
    let mut body = head(class, dims, "")?;
    element(&mut body, kind, data)?;
    wrapped(&body)
}

fn cells(dims: &[usize], texts: &[String]) -> Option<Vec<u8>> {
    let mut body = head(CELL, dims, "")?;
    for text in texts {
        let length = text.chars().count();
        let mut cell = head(CHAR, &[usize::from(length > 0), length], "")?;
        element(&mut cell, MI_UTF8, text.as_bytes())?;
        body.extend(wrapped(&cell)?);
    }
    wrapped(&body)
}

/// Flags, dimensions and name of a matrix.
fn head(class: u32, dims: &[usize], name: &str) -> Option<Vec<u8>> {
    let mut body = Vec::new();
    element(&mut body, MI_UINT32, &[class.to_le_bytes(), [0; 4]].concat())?;
    let sizes = dims.iter().map(|&size| i32::try_from(size).ok().map(i32::to_le_bytes)).collect::<Option<Vec<_>>>()?;
    element(&mut body, MI_INT32, &sizes.concat())?;
    element(&mut body, MI_INT8, name.as_bytes())?;
    Some(body)
}

fn wrapped(body: &[u8]) -> Option<Vec<u8>> {
    let mut out = Vec::with_capacity(body.len() + 8);
    element(&mut out, MI_MATRIX, body)?;
    Some(out)
}

/// Appends a data element: type, length, bytes, and zeros up to a multiple of eight bytes.
fn element(out: &mut Vec<u8>, kind: u32, data: &[u8]) -> Option<()> {
    out.extend_from_slice(&kind.to_le_bytes());
    out.extend_from_slice(&u32::try_from(data.len()).ok()?.to_le_bytes());
    out.extend_from_slice(data);
    out.resize(out.len().next_multiple_of(8), 0);
    Some(())
}
