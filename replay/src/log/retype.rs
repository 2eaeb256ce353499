//! Rewrites a log with types that have grown since it was written: fields are matched by name.

use super::copy::{CopyOutput, PROGRESS_EVENTS, profile};
use super::{CopyReport, EventFilter, EventRef, Health, LogReader, Types};
use crate::Error;
use lcm_idl::ast::{Dim, Field, FieldType, Primitive};
use lcm_idl::{Leaf, Type, Value};
use lcmtypes::channels;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Result of [`retype`].
#[derive(Debug, Clone, Default, serde::Serialize)]
pub struct RetypeReport {
    /// The copy.
    #[serde(flatten)]
    pub copy: CopyReport,
    /// Events that were rewritten.
    pub converted: u64,
    /// Events of a type that is not among the new ones, or that cannot be decoded: copied as they are.
    pub unchanged: u64,
    /// Each difference between an old and a new type, with the number of messages in which it changed something.
    pub differences: Vec<FieldDifference>,
}

/// A difference between the old and the new version of a type.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct FieldDifference {
    /// Type and field, such as `p.a_t.x`.
    pub field: String,
    /// What happens to it.
    pub change: FieldChange,
    /// Messages that are concerned.
    pub messages: u64,
}

/// What happens to a field.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FieldChange {
    /// New: numbers are 0, booleans false, texts and arrays of variable length empty.
    Added,
    /// Of another type or length that holds the old value.
    Converted,
    /// Gone with its value.
    Removed,
    /// Of another type or length that does not hold the old value: the default, or the elements that fit.
    Truncated,
}

impl FieldChange {
    /// The old value is not in the new message.
    pub fn is_loss(self) -> bool {
        matches!(self, FieldChange::Removed | FieldChange::Truncated)
    }
}

impl RetypeReport {
    /// Every value of the input is in the output.
    pub fn is_lossless(&self) -> bool {
        self.copy.is_lossless() && !self.differences.iter().any(|difference| difference.change.is_loss())
    }
}

/// Copies a log; messages whose type is among the `.lcm` files of `to` in another version are rewritten. RUN_INFO of the copy contains the new
/// texts. `types`: types of the log that it does not contain.
///
/// # Errors
/// As [`super::copy`] and [`Types::from_files`].
pub fn retype(
    log: &Path,
    out: &Path,
    to: &[PathBuf],
    filter: &EventFilter,
    mut types: Types,
    progress: &mut dyn FnMut(f64),
) -> Result<RetypeReport, Error> {
    Error::check_distinct_files(log, out)?;
    let new = Types::from_files(to)?;
    let mut filter = filter.for_log(log)?;
    let mut reader = LogReader::open(log)?;
    let bytes = reader.bytes().max(1);
    let mut output = CopyOutput::create(out, Types::from_files(to)?, &[profile(&mut reader)?])?;
    let (mut report, mut health, mut read) = (RetypeReport::default(), Health::default(), 0_u64);
    let mut changes: BTreeMap<(String, FieldChange), u64> = BTreeMap::new();
    while let Some(item) = reader.read()? {
        let Some(event) = health.note(item) else { continue };
        if read.is_multiple_of(PROGRESS_EVENTS) {
            progress(event.offset as f64 / bytes as f64);
        }
        read += 1;
        types.learn(&event);
        if !filter.accepts(&event) {
            output.report.left_out += 1;
            continue;
        }
        match converted(&event, &types, &new, &mut changes) {
            Some(Some(data)) => {
                report.converted += 1;
                // The schema of another channel in the file would not be that of the new type.
                let source = event.source.filter(|source| source.channel.is_plain_lcm());
                output.write(&EventRef { data: &data, source, ..event })?;
            }
            Some(None) => output.write(&event)?,
            None => {
                report.unchanged += 1;
                output.write(&event)?;
            }
        }
    }
    progress(1.0);
    output.report.add_health(&health);
    output.side_records(&mut reader)?;
    report.copy = output.finish()?;
    let difference = |((field, change), messages)| FieldDifference { field, change, messages };
    report.differences = changes.into_iter().map(difference).collect();
    Ok(report)
}

/// The message in its new type: `Some(None)` if it is of that type already, `None` if it cannot be converted.
fn converted(
    event: &EventRef<'_>,
    types: &Types,
    new: &Types,
    changes: &mut BTreeMap<(String, FieldChange), u64>,
) -> Option<Option<Vec<u8>>> {
    let old = types.of_message(event.channel, event.data)?;
    let to = new.given_by_name(old.name())?;
    let is_run_info = **event.channel == *channels::RUN_INFO;
    let is_same = to.fingerprint() == old.fingerprint() && !is_run_info;
    if is_same && !has_bytes(old, 0) {
        return Some(None);
    }
    let (mut value, _) = old.decode_lenient(event.data).ok()?;
    let mut found = Vec::new();
    let has_changed = messages_inside(old, &mut value, &mut |data| converted_inside(data, types, new, 1, &mut found));
    if is_same && !has_changed {
        return Some(None);
    }
    let mut value = structure(old, &value, to, &mut found);
    if is_run_info {
        describe(&mut value, to, new);
    }
    found.sort_unstable();
    found.dedup();
    let data = to.encode(&value).ok()?;
    for change in found {
        *changes.entry(change).or_default() += 1;
    }
    Some(Some(data))
}

/// A message inside a message in its new type, with the messages in it; `None` if nothing changes.
fn converted_inside(
    data: &[u8],
    types: &Types,
    new: &Types,
    depth: usize,
    found: &mut Vec<(String, FieldChange)>,
) -> Option<Vec<u8>> {
    let old = types.of_message("", data)?;
    let to = new.given_by_name(old.name()).unwrap_or(old);
    let is_same = to.fingerprint() == old.fingerprint();
    if is_same && !has_bytes(old, 0) {
        return None;
    }
    let (mut value, _) = old.decode_lenient(data).ok()?;
    let has_changed = depth < MAX_DEPTH
        && messages_inside(old, &mut value, &mut |data| converted_inside(data, types, new, depth + 1, found));
    if is_same && !has_changed {
        return None;
    }
    to.encode(&structure(old, &value, to, found)).ok()
}

/// Nesting of structs in which messages are looked for, and of messages in messages.
const MAX_DEPTH: usize = 4;

/// Whether a type has an array of bytes, which may hold a message.
fn has_bytes(ty: Type<'_>, depth: usize) -> bool {
    let mut fields = ty.def().fields.iter().enumerate();
    fields.any(|(place, field)| {
        is_bytes(field) || depth < MAX_DEPTH && ty.element(place).is_some_and(|inner| has_bytes(inner, depth + 1))
    })
}

fn is_bytes(field: &Field) -> bool {
    matches!((&field.dims[..], &field.ty), ([Dim::Variable { .. }], FieldType::Primitive(Primitive::Byte)))
}

/// Replaces the messages in arrays of bytes. `convert`: a message in its new type, `None` if it does not change. Returns whether one has changed.
fn messages_inside(ty: Type<'_>, value: &mut Value, convert: &mut dyn FnMut(&[u8]) -> Option<Vec<u8>>) -> bool {
    let Value::Struct(fields) = value else { return false };
    let mut has_changed = false;
    for (place, field) in ty.def().fields.iter().enumerate() {
        let value = &mut fields[place].1;
        if is_bytes(field) {
            let bytes = value.as_array().unwrap_or_default().iter().filter_map(Value::as_i64);
            let bytes: Vec<u8> = bytes.filter_map(|byte| u8::try_from(byte).ok()).collect();
            if let Some(data) = convert(&bytes) {
                *value = Value::Array(data.into_iter().map(Value::Byte).collect());
                has_changed = true;
            }
        } else if let Some(inner) = ty.element(place) {
            has_changed |= match value {
                Value::Array(items) => {
                    items.iter_mut().fold(false, |changed, item| messages_inside(inner, item, convert) | changed)
                }
                one => messages_inside(inner, one, convert),
            };
        }
    }
    if has_changed {
        set_lengths(ty, fields);
    }
    has_changed
}

/// Puts the new texts into a RUN_INFO.
fn describe(info: &mut Value, ty: Type<'_>, new: &Types) {
    let Some(place) = ty.def().fields.iter().position(|field| *field.name == *"lcm_types") else { return };
    let (Some(file), Value::Struct(fields)) = (ty.element(place), info) else { return };
    let text = |(path, text): (&String, &String)| {
        let mut value = file.default_value();
        let name = Path::new(path).file_name().unwrap_or_default().to_string_lossy().into_owned();
        let set = [value.set("name", name), value.set("text", text.as_str())];
        set.iter().all(Result::is_ok).then_some(value)
    };
    if let Some(texts) = new.given_texts().map(text).collect::<Option<Vec<_>>>() {
        fields[place].1 = Value::Array(texts);
        set_lengths(ty, fields);
    }
}

/// A struct in its new type.
fn structure(old: Type<'_>, value: &Value, new: Type<'_>, found: &mut Vec<(String, FieldChange)>) -> Value {
    let (Value::Struct(before), Value::Struct(mut after)) = (value, new.default_value()) else {
        return new.default_value();
    };
    let is_length = |ty: Type<'_>, name: &str| {
        let dims = ty.def().fields.iter().flat_map(|field| &field.dims);
        dims.filter_map(|dim| if let Dim::Variable { name, .. } = dim { Some(name) } else { None })
            .any(|n| **n == *name)
    };
    for (place, field) in new.def().fields.iter().enumerate() {
        let name = || format!("{}.{}", new.name(), field.name);
        let Some(index) = old.def().fields.iter().position(|known| known.name == field.name) else {
            found.push((name(), FieldChange::Added));
            continue;
        };
        if is_length(new, &field.name) {
            continue;
        }
        let mut change = None;
        let elements = (old.element(index), new.element(place));
        let from = &old.def().fields[index];
        if let Some(value) =
            array(&before[index].1, (from, &from.dims), (field, &field.dims), elements, &mut change, found)
        {
            after[place].1 = value;
        } else {
            change = Some(FieldChange::Truncated);
        }
        found.extend(change.map(|change| (name(), change)));
    }
    for field in &old.def().fields {
        let is_known = new.def().fields.iter().any(|known| known.name == field.name);
        if !is_known && !is_length(old, &field.name) {
            found.push((format!("{}.{}", new.name(), field.name), FieldChange::Removed));
        }
    }
    set_lengths(new, &mut after);
    Value::Struct(after)
}

/// Sets the length fields to the lengths of their arrays.
fn set_lengths(ty: Type<'_>, fields: &mut [(std::sync::Arc<str>, Value)]) {
    for (place, field) in ty.def().fields.iter().enumerate() {
        let mut lengths = Vec::new();
        let mut level = Some(&fields[place].1);
        for dim in &field.dims {
            let items = level.and_then(Value::as_array).unwrap_or_default();
            if let Dim::Variable { field, .. } = dim {
                lengths.push((*field, items.len() as i64));
            }
            level = items.first();
        }
        for (of, length) in lengths {
            if let (FieldType::Primitive(kind), Some(slot)) = (&ty.def().fields[of].ty, fields.get_mut(of))
                && let Some(value) = number(Leaf::Int64(length), *kind)
            {
                slot.1 = value;
            }
        }
    }
}

/// A field with its remaining dimensions; `None` if nothing of the old value fits.
fn array(
    value: &Value,
    (from, old_dims): (&Field, &[Dim]),
    (to, new_dims): (&Field, &[Dim]),
    elements: (Option<Type<'_>>, Option<Type<'_>>),
    change: &mut Option<FieldChange>,
    found: &mut Vec<(String, FieldChange)>,
) -> Option<Value> {
    let (Some((_, old_inner)), Some((dim, new_inner))) = (old_dims.split_first(), new_dims.split_first()) else {
        return if old_dims.is_empty() && new_dims.is_empty() {
            element(value, from, to, elements, change, found)
        } else {
            None
        };
    };
    let items = value.as_array()?;
    let mut out = items
        .iter()
        .map(|item| array(item, (from, old_inner), (to, new_inner), elements, change, found))
        .collect::<Option<Vec<_>>>()?;
    if let Dim::Constant { size, .. } = dim
        && *size != out.len()
    {
        let fits = out.len() <= *size;
        *change = (*change).max(Some(if fits { FieldChange::Converted } else { FieldChange::Truncated }));
        out.resize(*size, empty(to, new_inner, elements.1));
    }
    Some(Value::Array(out))
}

/// The default of an element with its remaining dimensions.
fn empty(field: &Field, dims: &[Dim], element: Option<Type<'_>>) -> Value {
    match (dims.split_first(), element, &field.ty) {
        (Some((Dim::Constant { size, .. }, inner)), ..) => Value::Array(vec![empty(field, inner, element); *size]),
        (Some(_), ..) => Value::Array(Vec::new()),
        (None, Some(ty), _) => ty.default_value(),
        (None, None, FieldType::Primitive(Primitive::String)) => Value::String(String::new()),
        (None, None, FieldType::Primitive(kind)) => number(Leaf::Int64(0), *kind).unwrap_or(Value::Int32(0)),
        (None, None, FieldType::Named(_)) => Value::Int32(0),
    }
}

fn element(
    value: &Value,
    from: &Field,
    to: &Field,
    elements: (Option<Type<'_>>, Option<Type<'_>>),
    change: &mut Option<FieldChange>,
    found: &mut Vec<(String, FieldChange)>,
) -> Option<Value> {
    match elements {
        (Some(old), Some(new)) => return Some(structure(old, value, new, found)),
        (None, None) => {}
        _ => return None,
    }
    let kind = match &to.ty {
        FieldType::Primitive(kind) => *kind,
        // An enum.
        FieldType::Named(_) => Primitive::Int32,
    };
    let leaf = value.as_leaf()?;
    let is_same = matches!((&from.ty, &to.ty), (FieldType::Primitive(a), FieldType::Primitive(b)) if a == b);
    if !is_same {
        *change = (*change).max(Some(FieldChange::Converted));
    }
    if let (Primitive::String, Some(text)) = (kind, leaf.as_str()) {
        return Some(Value::String(text.to_owned()));
    }
    number(leaf, kind)
}

/// A number in another type; `None` if that type does not hold it.
fn number(leaf: Leaf<'_>, kind: Primitive) -> Option<Value> {
    let exact = |v: f64| {
        let integer = v as i64;
        (integer as f64 == v && v.abs() < 9e18).then_some(integer)
    };
    let integer = || leaf.as_i64().or_else(|| exact(leaf.as_f64()?));
    Some(match kind {
        Primitive::Int8 => Value::Int8(integer()?.try_into().ok()?),
        Primitive::Int16 => Value::Int16(integer()?.try_into().ok()?),
        Primitive::Int32 => Value::Int32(integer()?.try_into().ok()?),
        Primitive::Int64 => Value::Int64(integer()?),
        Primitive::Byte => Value::Byte(integer()?.try_into().ok()?),
        Primitive::Boolean => match integer()? {
            0 => Value::Boolean(false),
            1 => Value::Boolean(true),
            _ => return None,
        },
        Primitive::Float => match leaf {
            Leaf::Float(v) => Value::Float(v),
            _ => {
                let v = leaf.as_f64()?;
                let narrow = v as f32;
                (v.is_nan() || f64::from(narrow).to_bits() == v.to_bits()).then_some(Value::Float(narrow))?
            }
        },
        Primitive::Double => match leaf.as_i64() {
            Some(v) if v as f64 as i128 != i128::from(v) => return None,
            _ => Value::Double(leaf.as_f64()?),
        },
        Primitive::String => return None,
    })
}
