//! Any LCM type as a ROS 2 message: its definition, and its messages in CDR.
//!
//! - `hoofprint.robot_state_t` is `hoofprint/msg/RobotState`. ROS 2 wants lower-case fields, so `p_WF` is `p_wf`; names that fall
//!   together get a number.
//! - An array of several dimensions is a flat one, row by row; one whose length varies is a sequence.

use super::cdr::Cdr;
use lcm_idl::ast::{ConstantValue, Dim, Field, FieldType, Primitive};
use lcm_idl::{Type, Value, camel_case};
use std::collections::BTreeSet;
use std::fmt::Write as _;

/// Line between the definitions of the types in a type.
const LINE: &str = "================================================================================\n";

/// Name of a type as messages call it: `hoofprint/msg/RobotState`.
pub(super) fn type_name(ty: Type<'_>) -> String {
    let (package, name) = names(ty);
    format!("{package}/msg/{name}")
}

fn names(ty: Type<'_>) -> (String, String) {
    let name = &ty.def().name;
    let package = if name.package.is_empty() { "lcm_types".to_owned() } else { lower(&name.package) };
    (package, camel_case(&name.short))
}

/// The definition of a type, and of those inside it.
pub(super) fn definition(ty: Type<'_>) -> String {
    let mut text = String::new();
    let mut inner = Vec::new();
    fields(ty, &mut text, &mut inner);
    let mut done = BTreeSet::from([ty.name()]);
    while let Some(next) = inner.pop() {
        if done.insert(next.name()) {
            let (package, name) = names(next);
            let _ = writeln!(text, "{LINE}MSG: {package}/{name}");
            fields(next, &mut text, &mut inner);
        }
    }
    text
}

fn fields<'a>(ty: Type<'a>, text: &mut String, inner: &mut Vec<Type<'a>>) {
    for line in ty.def().comment.iter().flat_map(|comment| comment.lines()) {
        let _ = writeln!(text, "# {line}");
    }
    for constant in &ty.def().constants {
        let is_name = constant.name.starts_with(|c: char| c.is_ascii_uppercase())
            && constant.name.chars().all(|c| c.is_ascii_uppercase() || c.is_ascii_digit() || c == '_');
        let value = match constant.value {
            ConstantValue::Int8(v) => format!("int8 {}={v}", constant.name),
            ConstantValue::Int16(v) => format!("int16 {}={v}", constant.name),
            ConstantValue::Int32(v) => format!("int32 {}={v}", constant.name),
            ConstantValue::Int64(v) => format!("int64 {}={v}", constant.name),
            ConstantValue::Float(v) => format!("float32 {}={v}", constant.name),
            ConstantValue::Double(v) => format!("float64 {}={v}", constant.name),
        };
        if is_name {
            let _ = writeln!(text, "{value}");
        }
    }
    let mut used = BTreeSet::new();
    for (index, field) in ty.def().fields.iter().enumerate() {
        let element = ty.element(index);
        let kind = match (&field.ty, element) {
            (_, Some(element)) => {
                inner.push(element);
                let (package, name) = names(element);
                format!("{package}/{name}")
            }
            (FieldType::Primitive(primitive), _) => primitive_name(*primitive).to_owned(),
            // An enum.
            (FieldType::Named(_), None) => "int32".to_owned(),
        };
        let _ = writeln!(text, "{kind}{} {}", brackets(field), unused(&lower(&field.name), &mut used));
    }
    if ty.def().fields.is_empty() {
        let _ = writeln!(text, "uint8 structure_needs_at_least_one_member");
    }
}

fn primitive_name(primitive: Primitive) -> &'static str {
    match primitive {
        Primitive::Int8 => "int8",
        Primitive::Int16 => "int16",
        Primitive::Int32 => "int32",
        Primitive::Int64 => "int64",
        Primitive::Byte => "uint8",
        Primitive::Float => "float32",
        Primitive::Double => "float64",
        Primitive::String => "string",
        Primitive::Boolean => "bool",
    }
}

fn brackets(field: &Field) -> String {
    match fixed_length(field) {
        _ if field.dims.is_empty() => String::new(),
        Some(length) => format!("[{length}]"),
        None => "[]".to_owned(),
    }
}

/// Elements of an array whose length is known from the type, all dimensions together.
fn fixed_length(field: &Field) -> Option<usize> {
    field.dims.iter().try_fold(1_usize, |length, dim| match dim {
        Dim::Constant { size, .. } => length.checked_mul(*size),
        Dim::Variable { .. } => None,
    })
}

/// A name as ROS 2 wants it: lower case, beginning with a letter, no two underscores in a row and none at the end.
fn lower(name: &str) -> String {
    let mut out = String::new();
    for c in name.chars() {
        let c = if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '_' };
        if c != '_' || !(out.is_empty() || out.ends_with('_')) {
            out.push(c);
        }
    }
    let name = out.trim_end_matches('_');
    if name.starts_with(|c: char| c.is_ascii_lowercase()) { name.to_owned() } else { format!("x{name}") }
}

fn unused(name: &str, used: &mut BTreeSet<String>) -> String {
    let numbered = (2..).map(|n| format!("{name}_{n}"));
    let free = std::iter::once(name.to_owned()).chain(numbered).find(|name| !used.contains(name)).unwrap_or_default();
    used.insert(free.clone());
    free
}

/// A message in CDR.
pub(super) fn encode(ty: Type<'_>, value: &Value, out: &mut Cdr) {
    let Value::Struct(values) = value else { return };
    for (index, (field, (_, value))) in ty.def().fields.iter().zip(values).enumerate() {
        if !field.dims.is_empty() && fixed_length(field).is_none() {
            out.length(count(value, field.dims.len()));
        }
        put(ty.element(index), value, out);
    }
    if values.is_empty() {
        out.u8(0);
    }
}

/// Elements of an array of so many dimensions.
fn count(value: &Value, dims: usize) -> usize {
    match value {
        Value::Array(items) if dims > 1 => items.iter().map(|item| count(item, dims - 1)).sum(),
        Value::Array(items) => items.len(),
        _ => 1,
    }
}

fn put(element: Option<Type<'_>>, value: &Value, out: &mut Cdr) {
    match value {
        Value::Int8(v) => out.i8(*v),
        Value::Int16(v) => out.i16(*v),
        Value::Int32(v) => out.i32(*v),
        Value::Int64(v) => out.i64(*v),
        Value::Byte(v) => out.u8(*v),
        Value::Float(v) => out.f32(*v),
        Value::Double(v) => out.f64(*v),
        Value::Boolean(v) => out.u8(u8::from(*v)),
        Value::String(v) => out.string(v),
        Value::Array(items) => items.iter().for_each(|item| put(element, item, out)),
        Value::Struct(_) => {
            if let Some(element) = element {
                encode(element, value, out);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lcm_idl::TypeSet;

    #[test]
    fn a_type_becomes_a_definition() {
        let text = "package demo; struct inner_t { double p_WF[3]; } \
            struct outer_t { const int8_t MODE_A = 1; int32_t n; inner_t legs[n]; boolean f[2][n]; byte p_WF; byte p_wf; }";
        let types = TypeSet::parse([("demo", text)]).unwrap();
        let outer = types.by_name("demo.outer_t").unwrap();
        let expected = format!(
            "int8 MODE_A=1\nint32 n\ndemo/Inner[] legs\nbool[] f\nuint8 p_wf\nuint8 p_wf_2\n{LINE}MSG: demo/Inner\nfloat64[3] p_wf\n"
        );
        assert_eq!((type_name(outer), definition(outer)), ("demo/msg/Outer".to_owned(), expected));
    }

    #[test]
    fn names_are_made_to_fit() {
        let cases = [("p_WF", "p_wf"), ("__a__b_", "a_b"), ("3d", "x3d"), ("_", "x")];
        for (name, expected) in cases {
            assert_eq!(lower(name), expected);
        }
    }
}
