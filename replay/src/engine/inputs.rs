//! Inputs of a stage of a tick, and messages as trees of named quantities.

use controller::dump::{Dump, Group, Quantity, Value};
use lcm_idl::Value as Field;
use lcmtypes::channels::Stage;
use lcmtypes::{Message, TickInput};

/// Largest number of entries of a vector or matrix that [`brief`] writes out.
const WRITTEN_OUT: usize = 48;

/// Inputs of a stage besides the state before the tick: results of earlier stages. Matrices and long vectors are replaced by their digest.
///
/// - `stage`: name of the stage, see [`Stage::name`].
pub(super) fn stage_inputs(stage: &str, input: &TickInput, dump: &Dump) -> Group {
    let stage = Stage::ALL.into_iter().find(|s| s.name() == stage).unwrap_or(Stage::Output);
    let (from_input, earlier): (_, &[Stage]) = match stage {
        Stage::Input | Stage::Estimation => (of_message(input).map(|input| ("input", input)), &[]),
        Stage::Gait => (of_message(&input.op).map(|op| ("op", op)), &[Stage::Estimation]),
        Stage::Tasks => (None, &[Stage::Estimation, Stage::Gait]),
        Stage::Qp => (None, &[Stage::Tasks]),
        Stage::Output => (None, &[Stage::Qp, Stage::Gait]),
    };
    let mut inputs = Group::new();
    if let Some((name, value)) = from_input {
        inputs = inputs.with(name, value);
    }
    for stage in earlier {
        if let Some(quantities) = dump.stage(*stage) {
            inputs = inputs.with(stage.name(), brief_group(quantities));
        }
    }
    inputs
}

/// A message as a tree of quantities.
pub(super) fn of_message(message: &impl Message) -> Option<Value> {
    let mut bytes = Vec::new();
    message.encode(&mut bytes).ok()?;
    of_bytes(&bytes)
}

/// An encoded message as a tree of quantities; `None` if its type is unknown.
pub fn of_bytes(bytes: &[u8]) -> Option<Value> {
    lcmtypes::types().decode(bytes).ok().map(|(_, value)| of_field(&value))
}

fn of_field(field: &Field) -> Value {
    match field {
        Field::Struct(fields) => {
            fields.iter().fold(Group::new(), |group, (name, field)| group.with(name, of_field(field))).into()
        }
        Field::Array(items) => {
            let numbers: Option<Vec<f64>> = items
                .iter()
                .map(|item| match item {
                    Field::Double(v) => Some(*v),
                    Field::Float(v) => Some(f64::from(*v)),
                    _ => None,
                })
                .collect();
            numbers.map_or_else(|| Value::List(items.iter().map(of_field).collect()), Value::Numbers)
        }
        Field::Double(v) => Value::Number(*v),
        Field::Float(v) => Value::Number(f64::from(*v)),
        Field::Boolean(v) => Value::Flag(*v),
        Field::String(v) => Value::Text(v.clone()),
        other => other.as_i64().map_or_else(|| Group::new().into(), Value::Integer),
    }
}

/// The same value with a digest in place of every large array: equal digests mean equal bits.
pub fn brief(value: &Value) -> Value {
    let digest = |size: String, numbers: &mut dyn Iterator<Item = f64>| {
        let mut digest = controller::digest::Digest::default();
        numbers.for_each(|x| digest.f64(x));
        Value::Text(format!("{size}, digest {:#018x}", digest.finish()))
    };
    match value {
        Value::Numbers(v) if v.len() > WRITTEN_OUT => digest(v.len().to_string(), &mut v.iter().copied()),
        Value::Matrix(rows) if rows.iter().map(Vec::len).sum::<usize>() > WRITTEN_OUT => {
            let size = format!("{} x {}", rows.len(), rows.first().map_or(0, Vec::len));
            digest(size, &mut rows.iter().flatten().copied())
        }
        Value::List(items) => Value::List(items.iter().map(brief).collect()),
        Value::Group(group) => brief_group(group).into(),
        other => other.clone(),
    }
}

fn brief_group(group: &Group) -> Group {
    let brief = |Quantity { name, unit, value }: &Quantity| Quantity { name: name.clone(), unit, value: brief(value) };
    group.iter().map(brief).collect()
}

/// The group as indented lines, one quantity per line with its unit; matrices one row per line.
pub fn lines(group: &Group) -> Vec<String> {
    let mut out = Vec::new();
    group.iter().for_each(|Quantity { name, unit, value }| write(&mut out, 0, name, unit, value));
    out
}

fn write(out: &mut Vec<String>, depth: usize, name: &str, unit: &str, value: &Value) {
    let indent = "  ".repeat(depth);
    let mut line = |text: String| {
        let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
        out.push(format!("{indent}{name:<16} {text}{unit}"));
    };
    match value {
        Value::Flag(v) => line(v.to_string()),
        Value::Integer(v) => line(v.to_string()),
        Value::Number(v) => line(format!("{v:?}")),
        Value::Text(v) => line(v.clone()),
        Value::Numbers(v) => line(numbers(v)),
        Value::Matrix(rows) => {
            line(format!("{} x {}", rows.len(), rows.first().map_or(0, Vec::len)));
            out.extend(rows.iter().map(|row| format!("{indent}  {}", numbers(row))));
        }
        Value::List(items) if items.is_empty() => line("none".to_owned()),
        Value::List(items) if items.iter().all(|item| !matches!(item, Value::Group(_) | Value::List(_))) => {
            let mut texts = Vec::new();
            items.iter().for_each(|item| write(&mut texts, 0, "", "", item));
            line(texts.iter().map(|text| text.trim()).collect::<Vec<_>>().join(", "));
        }
        Value::List(items) => {
            for (i, item) in items.iter().enumerate() {
                write(out, depth, &format!("{name}[{i}]"), unit, item);
            }
        }
        Value::Group(group) => {
            out.push(format!("{indent}{name}"));
            group.iter().for_each(|Quantity { name, unit, value }| write(out, depth + 1, name, unit, value));
        }
    }
}

fn numbers(v: &[f64]) -> String {
    let texts: Vec<String> = v.iter().map(|x| format!("{x:?}")).collect();
    format!("[{}]", texts.join(", "))
}
