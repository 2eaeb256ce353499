//! Rust source for a set of types.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use crate::ast::{ConstantValue, Dim, Enum, Field, FieldType, Primitive, TypeName};
use crate::set::Element;
use crate::{Type, TypeSet};

/// Rust source of every type of a set: one module per package (dots become `_`, no package is `unnamed`) with one struct per type.
///
/// The struct of `robot_state_t` is `RobotState`; it implements [`Message`](crate::Message), its constants are associated constants,
/// its comment is its documentation. An enum is a struct around its `i32`, so values without a name are preserved. The source is a
/// pure function of the set and depends on this crate only.
pub fn generate(set: &TypeSet) -> String {
    let mut modules: BTreeMap<&str, String> = BTreeMap::new();
    for e in set.enums() {
        modules.entry(&e.name.package).or_default().push_str(&enumeration(e));
    }
    for ty in set.types() {
        modules.entry(&ty.def().name.package).or_default().push_str(&structure(set, ty));
    }
    let mut out = String::from("// Generated from .lcm texts by lcm-idl, not to be edited.\n");
    for (package, body) in modules {
        let title = if package.is_empty() { "no package".to_owned() } else { format!("package `{package}`") };
        let _ = write!(
            out,
            "\n/// Types of {title}.\n\
             #[allow(missing_docs, reason = \"the comment of a type says what its fields mean\")]\n\
             #[allow(unused_variables, reason = \"a type may have no field\")]\n\
             #[allow(non_snake_case, non_upper_case_globals, clippy::all, rustdoc::all, reason = \"names and texts are those of the .lcm\")]\n\
             pub mod {} {{\n    use ::lcm_idl::wire as lcm_wire;\n",
            module_name(package)
        );
        for line in body.lines() {
            let _ = if line.is_empty() { writeln!(out) } else { writeln!(out, "    {line}") };
        }
        out.push_str("}\n");
    }
    out
}

/// Name of the Rust struct of a type: `robot_state_t` → `RobotState`.
pub fn camel_case(short_name: &str) -> String {
    let bare = short_name.strip_suffix("_t").filter(|s| !s.is_empty()).unwrap_or(short_name);
    let word = |w: &str| w[..1].to_ascii_uppercase() + &w[1..];
    bare.split('_').filter(|w| !w.is_empty()).map(word).collect()
}

fn module_name(package: &str) -> String {
    if package.is_empty() { "unnamed".to_owned() } else { identifier(&package.replace('.', "_")) }
}

/// A field's name, escaped if it is a Rust keyword.
fn identifier(name: &str) -> String {
    const RAW: &[&str] = &[
        "abstract", "as", "async", "await", "become", "box", "break", "const", "continue", "do", "dyn", "else", "enum",
        "extern", "false", "final", "fn", "for", "gen", "if", "impl", "in", "let", "loop", "macro", "match", "mod",
        "move", "mut", "override", "priv", "pub", "ref", "return", "static", "struct", "trait", "true", "try", "type",
        "typeof", "unsafe", "unsized", "use", "virtual", "where", "while", "yield",
    ];
    match name {
        "self" | "Self" | "super" | "crate" | "_" => format!("{name}_"),
        _ if RAW.contains(&name) => format!("r#{name}"),
        _ => name.to_owned(),
    }
}

fn doc(out: &mut String, indent: &str, comment: Option<&String>) {
    for line in comment.iter().flat_map(|c| c.lines()) {
        // Rustdoc would compile a line with four leading spaces as an example.
        let line = if line.starts_with("    ") { line.trim_start() } else { line };
        let _ = writeln!(out, "{}", format!("{indent}/// {line}").trim_end());
    }
}

fn enumeration(e: &Enum) -> String {
    let name = camel_case(&e.name.short);
    let mut out = String::from("\n");
    doc(&mut out, "", e.comment.as_ref());
    let _ = write!(
        out,
        "#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]\npub struct {name}(pub i32);\n\nimpl {name} {{\n"
    );
    for (value_name, value) in &e.values {
        let _ = writeln!(out, "    pub const {}: Self = Self({value});", identifier(value_name));
    }
    let _ = write!(
        out,
        "}}\n\nimpl lcm_wire::Wire for {name} {{\n    const MIN_SIZE: usize = 4;\n\n{PUT}        self.0.put(out)\n    }}\n\n\
         {TAKE}        lcm_wire::Wire::take(wire).map(Self)\n    }}\n}}\n"
    );
    out
}

const PUT: &str =
    "    fn put(&self, out: &mut ::std::vec::Vec<u8>) -> ::std::result::Result<(), ::lcm_idl::EncodeError> {\n";
const TAKE: &str =
    "    fn take(wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<Self, ::lcm_idl::DecodeError> {\n";
const RETAKE: &str = "    fn retake(&mut self, wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<(), ::lcm_idl::DecodeError> {\n";

fn structure(set: &TypeSet, ty: Type<'_>) -> String {
    let (def, linked) = (ty.def(), ty.linked());
    let name = camel_case(&def.name.short);
    let fields: Vec<(String, &Field, Element)> =
        def.fields.iter().zip(&linked.elements).map(|(f, e)| (identifier(&f.name), f, *e)).collect();
    let mut out = String::from("\n");

    doc(&mut out, "", def.comment.as_ref());
    let _ = writeln!(out, "#[derive(Clone, Debug, PartialEq)]\npub struct {name} {{");
    for (ident, field, element) in &fields {
        doc(&mut out, "    ", field.comment.as_ref());
        let _ = writeln!(out, "    pub {ident}: {},", rust_type(set, &def.name.package, &field.dims, *element));
    }
    out.push_str("}\n");

    if !def.constants.is_empty() {
        let _ = write!(out, "\nimpl {name} {{\n");
        for c in &def.constants {
            doc(&mut out, "    ", c.comment.as_ref());
            let (ty, value) = constant(c.value);
            let _ = writeln!(out, "    pub const {}: {ty} = {value};", identifier(&c.name));
        }
        out.push_str("}\n");
    }

    let _ = write!(out, "\nimpl ::std::default::Default for {name} {{\n    fn default() -> Self {{\n        Self {{\n");
    for (ident, field, element) in &fields {
        let _ = writeln!(out, "            {ident}: {},", default(&field.dims, *element));
    }
    out.push_str("        }\n    }\n}\n");

    let _ = write!(
        out,
        "\nimpl lcm_wire::Message for {name} {{\n    const TYPE: &'static str = \"{}\";\n    const FINGERPRINT: u64 = {:#018x};\n}}\n",
        ty.name(),
        ty.fingerprint()
    );

    let _ =
        write!(out, "\nimpl lcm_wire::Wire for {name} {{\n    const MIN_SIZE: usize = {};\n\n{PUT}", linked.min_size);
    for (ident, field, _) in &fields {
        put(&mut out, &def.fields, field, &field.dims, &format!("self.{ident}"), 0);
    }
    let _ = write!(out, "        Ok(())\n    }}\n\n{TAKE}");
    for (_, field, element) in &fields {
        let read = take(set, &def.fields, &field.dims, *element, &|name| format!("field_{name}"));
        let _ = writeln!(out, "        let field_{} = wire.field(\"{}\", {read})?;", field.name, field.name);
    }
    let list: Vec<String> = fields.iter().map(|(ident, field, _)| format!("{ident}: field_{}", field.name)).collect();
    let _ = write!(out, "        Ok(Self {{ {} }})\n    }}\n\n{RETAKE}", list.join(", "));
    for (ident, field, element) in &fields {
        retake(&mut out, set, &def.fields, field, ident, *element);
    }
    out.push_str("        Ok(())\n    }\n}\n");
    out
}

fn rust_type(set: &TypeSet, package: &str, dims: &[Dim], element: Element) -> String {
    let named = |name: &TypeName| {
        let module =
            if name.package == package { String::new() } else { format!("super::{}::", module_name(&name.package)) };
        module + &camel_case(&name.short)
    };
    match dims.split_first() {
        Some((Dim::Constant { size, .. }, inner)) => {
            format!("[{}; {size}]", rust_type(set, package, inner, element))
        }
        Some((Dim::Variable { .. }, inner)) => format!("::std::vec::Vec<{}>", rust_type(set, package, inner, element)),
        None => match element {
            Element::Primitive(p) => p.rust_name().to_owned(),
            Element::Struct(index) => named(&set.structs[index].def.name),
            Element::Enum(index) => named(&set.enums()[index].name),
        },
    }
}

fn constant(value: ConstantValue) -> (&'static str, String) {
    let float = |ty: &str, text: String| match text.as_str() {
        "NaN" => format!("{ty}::NAN"),
        "inf" => format!("{ty}::INFINITY"),
        "-inf" => format!("{ty}::NEG_INFINITY"),
        _ => text,
    };
    match value {
        ConstantValue::Int8(v) => ("i8", v.to_string()),
        ConstantValue::Int16(v) => ("i16", v.to_string()),
        ConstantValue::Int32(v) => ("i32", v.to_string()),
        ConstantValue::Int64(v) => ("i64", v.to_string()),
        ConstantValue::Float(v) => ("f32", float("f32", format!("{v:?}"))),
        ConstantValue::Double(v) => ("f64", float("f64", format!("{v:?}"))),
    }
}

/// Written out, because the standard library implements `Default` only for arrays of up to 32 elements.
fn default(dims: &[Dim], element: Element) -> String {
    match (dims.split_first(), element) {
        (Some((Dim::Variable { .. }, _)), _) => "::std::vec::Vec::new()".to_owned(),
        (Some((Dim::Constant { .. }, inner)), _) => {
            format!("::std::array::from_fn(|_| {})", default(inner, element))
        }
        (None, Element::Primitive(p)) => match p {
            Primitive::Float | Primitive::Double => "0.0".to_owned(),
            Primitive::String => "::std::string::String::new()".to_owned(),
            Primitive::Boolean => "false".to_owned(),
            _ => "0".to_owned(),
        },
        (None, _) => "::std::default::Default::default()".to_owned(),
    }
}

fn is_byte(element: Element) -> bool {
    matches!(element, Element::Primitive(Primitive::Byte))
}

fn is_fixed(dims: &[Dim]) -> bool {
    dims.iter().all(|d| matches!(d, Dim::Constant { .. }))
}

/// The value of a length field as `i64`, read from `prefix` + its name.
fn length(fields: &[Field], index: usize, place: impl Fn(&str) -> String) -> String {
    let field = &fields[index];
    let is_i64 = matches!(field.ty, FieldType::Primitive(Primitive::Int64));
    let place = place(&field.name);
    if is_i64 { place } else { format!("i64::from({place})") }
}

/// Statements that write `place`, checking the length of every variable dimension.
fn put(out: &mut String, fields: &[Field], field: &Field, dims: &[Dim], place: &str, depth: usize) {
    let indent = "    ".repeat(depth + 2);
    let Some((outer, inner)) = dims.split_first().filter(|_| !is_fixed(dims)) else {
        let _ = writeln!(out, "{indent}{place}.put(out)?;");
        return;
    };
    if let Dim::Variable { field: index, name } = outer {
        let length = length(fields, *index, |name| format!("self.{}", identifier(name)));
        let _ = writeln!(
            out,
            "{indent}lcm_wire::check_length(<Self as lcm_wire::Message>::TYPE, \"{}\", {place}.len(), \"{name}\", {length})?;",
            field.name
        );
    }
    if inner.is_empty() && matches!(field.ty, FieldType::Primitive(Primitive::Byte)) {
        let _ = writeln!(out, "{indent}out.extend_from_slice(&{place});");
        return;
    }
    let item = format!("item_{depth}");
    let _ = writeln!(out, "{indent}for {item} in {place}.iter() {{");
    put(out, fields, field, inner, &item, depth + 1);
    let _ = writeln!(out, "{indent}}}");
}

/// An expression that reads a field: a function of the reader. `place` is the variable with the value of a length field.
fn take(set: &TypeSet, fields: &[Field], dims: &[Dim], element: Element, place: &dyn Fn(&str) -> String) -> String {
    let is_struct = matches!(element, Element::Struct(_));
    let Some((outer, inner)) = dims.split_first().filter(|_| is_struct || !is_fixed(dims)) else {
        let take = "lcm_wire::Wire::take";
        return if is_struct { format!("|wire| wire.nested({take})") } else { take.to_owned() };
    };
    match outer {
        Dim::Constant { .. } => format!("|wire| wire.array({})", take(set, fields, inner, element, place)),
        Dim::Variable { field, name } if inner.is_empty() && is_byte(element) => {
            format!("|wire| wire.byte_list(\"{name}\", {}).map(<[u8]>::to_vec)", length(fields, *field, place))
        }
        Dim::Variable { .. } => format!("|wire| wire.list({})", list(set, fields, dims, element, place)),
    }
}

/// A statement that reads a field of `self` in place.
fn retake(out: &mut String, set: &TypeSet, fields: &[Field], field: &Field, ident: &str, element: Element) {
    let place = |name: &str| format!("self.{}", identifier(name));
    let name = &field.name;
    let _ = match (&field.dims[..], element) {
        ([Dim::Variable { field: index, name: of }], Element::Struct(ty)) => {
            let (length, smallest) = (length(fields, *index, place), set.structs[ty].min_size);
            let list = format!("wire.retake_list(&mut self.{ident}, \"{of}\", {length}, {smallest})");
            writeln!(out, "        wire.field(\"{name}\", |wire| {list})?;")
        }
        ([Dim::Variable { field: index, name: of }], Element::Primitive(Primitive::String)) => {
            let (length, smallest) = (length(fields, *index, place), Primitive::String.min_size());
            let list = format!("wire.retake_list(&mut self.{ident}, \"{of}\", {length}, {smallest})");
            writeln!(out, "        wire.field(\"{name}\", |wire| {list})?;")
        }
        ([Dim::Variable { field: index, name: of }], element) if is_byte(element) => {
            let bytes = format!("wire.byte_list(\"{of}\", {})", length(fields, *index, place));
            writeln!(out, "        let bytes = wire.field(\"{name}\", |wire| {bytes})?;")
                .and_then(|()| writeln!(out, "        self.{ident}.clear();"))
                .and_then(|()| writeln!(out, "        self.{ident}.extend_from_slice(bytes);"))
        }
        ([], Element::Primitive(Primitive::String)) => {
            let retake = format!("lcm_wire::Wire::retake(&mut self.{ident}, wire)");
            writeln!(out, "        wire.field(\"{name}\", |wire| {retake})?;")
        }
        ([Dim::Variable { .. }, ..], _) => {
            let list = list(set, fields, &field.dims, element, &place);
            writeln!(out, "        wire.field(\"{name}\", |wire| wire.refill(&mut self.{ident}, {list}))?;")
        }
        ([], Element::Struct(_)) => {
            let nested = format!("wire.nested(|wire| lcm_wire::Wire::retake(&mut self.{ident}, wire))");
            writeln!(out, "        wire.field(\"{name}\", |wire| {nested})?;")
        }
        _ => {
            let read = take(set, fields, &field.dims, element, &place);
            writeln!(out, "        self.{ident} = wire.field(\"{name}\", {read})?;")
        }
    };
}

/// Arguments for reading a list of variable length: name and value of its length field, smallest size of an item in bytes, expression of an item.
fn list(set: &TypeSet, fields: &[Field], dims: &[Dim], element: Element, place: &dyn Fn(&str) -> String) -> String {
    let Some((Dim::Variable { field, name }, inner)) = dims.split_first() else {
        unreachable!("both callers check the dimension")
    };
    let smallest = match element {
        Element::Primitive(p) => p.min_size(),
        Element::Enum(_) => Primitive::Int32.min_size(),
        Element::Struct(index) => set.structs[index].min_size,
    };
    let row: Vec<String> = inner
        .iter()
        .map(|dim| match dim {
            Dim::Constant { size, .. } => size.to_string(),
            Dim::Variable { field, .. } => length(fields, *field, place),
        })
        .collect();
    let row_size = if row.is_empty() {
        smallest.to_string()
    } else {
        format!("lcm_wire::row_size(&[{}], {smallest})", row.join(", "))
    };
    let item = take(set, fields, inner, element, place);
    format!("\"{name}\", {}, {row_size}, {item}", length(fields, *field, place))
}
