//! Inputs of a stage, and messages as trees of quantities.

use controller::dump::{Dump, Quantity};
use lcm_idl::Value;
use lcmtypes::{ControllerInput, Message};

/// Largest number of elements that an overview lists of a vector or matrix.
const WRITTEN_OUT: usize = 48;

/// Inputs of a stage except the state before the tick: the results of the stages before it, with matrices and long vectors as digest.
pub(super) fn stage_inputs(stage: &str, input: Option<&ControllerInput>, dump: &Dump) -> Quantity {
    let of: &[&str] = match stage {
        "input" | "estimation" => &[],
        "gait" => &["estimation"],
        "tasks" => &["estimation", "gait"],
        "qp" => &["tasks"],
        _ => &["qp", "gait"],
    };
    let from_input = match stage {
        "input" | "estimation" => input.and_then(of_message),
        "gait" => input.and_then(|input| of_message(&input.op)),
        _ => None,
    };
    let mut inputs = Quantity::group();
    if let Some(input) = from_input {
        inputs = inputs.with(if stage == "gait" { "op" } else { "input" }, input);
    }
    for group in of {
        if let Some(quantity) = dump.0.get(group) {
            inputs = inputs.with(group, brief(quantity));
        }
    }
    inputs
}

/// A message as a tree of quantities.
pub(super) fn of_message(message: &impl Message) -> Option<Quantity> {
    let mut bytes = Vec::new();
    message.encode(&mut bytes).ok()?;
    of_bytes(&bytes)
}

/// An encoded message of a known type as a tree of quantities.
pub fn of_bytes(bytes: &[u8]) -> Option<Quantity> {
    lcmtypes::types().decode(bytes).ok().map(|(_, value)| of_value(&value))
}

fn of_value(value: &Value) -> Quantity {
    match value {
        Value::Struct(fields) => {
            fields.iter().fold(Quantity::group(), |group, (name, value)| group.with(name, of_value(value)))
        }
        Value::Array(items) => {
            let numbers: Option<Vec<f64>> = items
                .iter()
                .map(|item| match item {
                    Value::Double(v) => Some(*v),
                    Value::Float(v) => Some(f64::from(*v)),
                    _ => None,
                })
                .collect();
            numbers.map_or_else(|| Quantity::List(items.iter().map(of_value).collect()), Quantity::Numbers)
        }
        Value::Double(v) => Quantity::Number(*v),
        Value::Float(v) => Quantity::Number(f64::from(*v)),
        Value::Boolean(v) => Quantity::Flag(*v),
        Value::String(v) => Quantity::Text(v.clone()),
        other => other.as_i64().map_or_else(Quantity::group, Quantity::Integer),
    }
}

/// The tree with a digest instead of every large array; equal digests mean equal bits.
pub fn brief(quantity: &Quantity) -> Quantity {
    let digest = |size: String, numbers: &mut dyn Iterator<Item = f64>| {
        let mut digest = controller::digest::Digest::default();
        numbers.for_each(|x| digest.f64(x));
        Quantity::Text(format!("{size}, digest {:#018x}", digest.finish()))
    };
    match quantity {
        Quantity::Numbers(v) if v.len() > WRITTEN_OUT => digest(v.len().to_string(), &mut v.iter().copied()),
        Quantity::Matrix(rows) if rows.iter().map(Vec::len).sum::<usize>() > WRITTEN_OUT => {
            let size = format!("{} x {}", rows.len(), rows.first().map_or(0, Vec::len));
            digest(size, &mut rows.iter().flatten().copied())
        }
        Quantity::List(items) => Quantity::List(items.iter().map(brief).collect()),
        Quantity::Group(members) => {
            Quantity::Group(members.iter().map(|(name, member)| (name.clone(), brief(member))).collect())
        }
        other => other.clone(),
    }
}

/// The tree as indented lines: one quantity per line, matrices one row per line.
pub fn lines(quantity: &Quantity) -> Vec<String> {
    let mut out = Vec::new();
    write(&mut out, 0, "", quantity);
    out
}

fn write(out: &mut Vec<String>, depth: usize, name: &str, quantity: &Quantity) {
    let indent = "  ".repeat(depth);
    let mut line = |text: String| out.push(format!("{indent}{name:<width$} {text}", width = 16));
    match quantity {
        Quantity::Flag(v) => line(v.to_string()),
        Quantity::Integer(v) => line(v.to_string()),
        Quantity::Number(v) => line(format!("{v:?}")),
        Quantity::Text(v) => line(v.clone()),
        Quantity::Numbers(v) => line(numbers(v)),
        Quantity::Matrix(rows) => {
            line(format!("{} x {}", rows.len(), rows.first().map_or(0, Vec::len)));
            out.extend(rows.iter().map(|row| format!("{indent}  {}", numbers(row))));
        }
        Quantity::List(items) if items.is_empty() => line("none".to_owned()),
        Quantity::List(items) if items.iter().all(|item| !matches!(item, Quantity::Group(_) | Quantity::List(_))) => {
            let mut texts = Vec::new();
            items.iter().for_each(|item| write(&mut texts, 0, "", item));
            line(texts.iter().map(|text| text.trim()).collect::<Vec<_>>().join(", "));
        }
        Quantity::List(items) => {
            for (i, item) in items.iter().enumerate() {
                write(out, depth, &format!("{name}[{i}]"), item);
            }
        }
        Quantity::Group(members) => {
            if !name.is_empty() {
                out.push(format!("{indent}{name}"));
            }
            let depth = if name.is_empty() { depth } else { depth + 1 };
            members.iter().for_each(|(name, member)| write(out, depth, name, member));
        }
    }
}

fn numbers(v: &[f64]) -> String {
    let texts: Vec<String> = v.iter().map(|x| format!("{x:?}")).collect();
    format!("[{}]", texts.join(", "))
}
