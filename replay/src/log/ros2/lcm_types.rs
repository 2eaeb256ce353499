//! Converts any LCM type to a ROS 2 message type: its name, its definition, and its messages.
//!
//! - `hoofprint.robot_state_t` becomes `hoofprint/msg/RobotState`. ROS 2 requires lower-case field names, so `p_WF` becomes `p_wf`; of
//!   two fields that get the same name, the second gets the suffix `_2`.
//! - An array of several dimensions is flattened row by row; an array of variable length becomes a sequence.

use lcm_idl::ast::{ConstantValue, Dim, Field, FieldType, Primitive};
use lcm_idl::{Type, Value, camel_case};
use serde::ser::{Serialize, SerializeTuple, Serializer};
use std::collections::BTreeSet;
use std::fmt::Write as _;

/// Separator between the definitions of a type and of its nested types.
const LINE: &str = "================================================================================\n";

/// Name of a type in ROS 2: `hoofprint/msg/RobotState`.
pub(super) fn type_name(ty: Type<'_>) -> String {
    let (package, name) = names(ty);
    format!("{package}/msg/{name}")
}

fn names(ty: Type<'_>) -> (String, String) {
    let name = &ty.def().name;
    let package = if name.package.is_empty() { "lcm_types".to_owned() } else { lower(&name.package) };
    (package, camel_case(&name.short))
}

/// The definition of a type, followed by those of its nested types.
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

/// Number of elements over all dimensions, if the type fixes it.
fn fixed_length(field: &Field) -> Option<usize> {
    field.dims.iter().try_fold(1_usize, |length, dim| match dim {
        Dim::Constant { size, .. } => length.checked_mul(*size),
        Dim::Variable { .. } => None,
    })
}

/// A valid ROS 2 field name: lower case, starts with a letter, no two underscores in a row, no underscore at the end.
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

/// The name, with a number if it is already used.
fn unused(name: &str, used: &mut BTreeSet<String>) -> String {
    let numbered = (2..).map(|n| format!("{name}_{n}"));
    let free = std::iter::once(name.to_owned()).chain(numbered).find(|name| !used.contains(name)).unwrap_or_default();
    used.insert(free.clone());
    free
}

/// A decoded LCM message that serializes as the ROS 2 message of its type.
pub(super) struct Ros2Value<'a> {
    ty: Option<Type<'a>>,
    value: &'a Value,
}

impl<'a> Ros2Value<'a> {
    pub fn new(ty: Type<'a>, value: &'a Value) -> Self {
        Ros2Value { ty: Some(ty), value }
    }
}

impl Serialize for Ros2Value<'_> {
    fn serialize<S: Serializer>(&self, out: S) -> Result<S::Ok, S::Error> {
        match (self.value, self.ty) {
            (Value::Int8(v), _) => out.serialize_i8(*v),
            (Value::Int16(v), _) => out.serialize_i16(*v),
            (Value::Int32(v), _) => out.serialize_i32(*v),
            (Value::Int64(v), _) => out.serialize_i64(*v),
            (Value::Byte(v), _) => out.serialize_u8(*v),
            (Value::Float(v), _) => out.serialize_f32(*v),
            (Value::Double(v), _) => out.serialize_f64(*v),
            (Value::Boolean(v), _) => out.serialize_bool(*v),
            (Value::String(v), _) => out.serialize_str(v),
            // ROS 2 has no empty messages: see `fields`.
            (Value::Struct(fields), _) if fields.is_empty() => out.serialize_u8(0),
            (Value::Struct(fields), Some(ty)) => {
                let mut out = out.serialize_tuple(fields.len())?;
                for (index, (field, (_, value))) in ty.def().fields.iter().zip(fields).enumerate() {
                    let ty = ty.element(index);
                    if field.dims.is_empty() {
                        out.serialize_element(&Ros2Value { ty, value })?;
                    } else {
                        out.serialize_element(&Ros2Array { ty, value, is_fixed: fixed_length(field).is_some() })?;
                    }
                }
                out.end()
            }
            // Cannot occur: arrays are fields, and a struct has a type.
            (Value::Array(_) | Value::Struct(_), _) => out.serialize_unit(),
        }
    }
}

/// An array of any number of dimensions, flattened row by row. A fixed one is written without its length.
struct Ros2Array<'a> {
    ty: Option<Type<'a>>,
    value: &'a Value,
    is_fixed: bool,
}

impl Serialize for Ros2Array<'_> {
    fn serialize<S: Serializer>(&self, out: S) -> Result<S::Ok, S::Error> {
        let mut elements = Vec::new();
        flatten(self.value, &mut elements);
        let elements = elements.into_iter().map(|value| Ros2Value { ty: self.ty, value });
        if self.is_fixed {
            let mut out = out.serialize_tuple(elements.len())?;
            for element in elements {
                out.serialize_element(&element)?;
            }
            return out.end();
        }
        out.collect_seq(elements)
    }
}

fn flatten<'a>(value: &'a Value, elements: &mut Vec<&'a Value>) {
    match value {
        Value::Array(items) => items.iter().for_each(|item| flatten(item, elements)),
        element => elements.push(element),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lcm_idl::TypeSet;

    #[test]
    fn definition_of_a_type_with_nested_type_and_duplicate_names() {
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
    fn field_names_become_valid_in_ros2() {
        let cases = [("p_WF", "p_wf"), ("__a__b_", "a_b"), ("3d", "x3d"), ("_", "x")];
        for (name, expected) in cases {
            assert_eq!(lower(name), expected);
        }
    }
}
