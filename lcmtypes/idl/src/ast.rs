//! Syntax tree of a `.lcm` text. Names are not yet linked to other types.

use std::sync::Arc;

/// The built-in types of the language.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[allow(missing_docs, reason = "the variants are the names of the language")]
pub enum Primitive {
    Int8,
    Int16,
    Int32,
    Int64,
    Byte,
    Float,
    Double,
    String,
    Boolean,
}

impl Primitive {
    /// Every primitive type, in the order of the language's reference.
    pub const ALL: [Self; 9] = [
        Self::Int8,
        Self::Int16,
        Self::Int32,
        Self::Int64,
        Self::Byte,
        Self::Float,
        Self::Double,
        Self::String,
        Self::Boolean,
    ];

    /// The type of that name, such as `int32_t`.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|p| p.name() == name)
    }

    /// The name in a `.lcm` text.
    pub fn name(self) -> &'static str {
        match self {
            Self::Int8 => "int8_t",
            Self::Int16 => "int16_t",
            Self::Int32 => "int32_t",
            Self::Int64 => "int64_t",
            Self::Byte => "byte",
            Self::Float => "float",
            Self::Double => "double",
            Self::String => "string",
            Self::Boolean => "boolean",
        }
    }

    /// The Rust type that generated code uses for it.
    pub fn rust_name(self) -> &'static str {
        match self {
            Self::Int8 => "i8",
            Self::Int16 => "i16",
            Self::Int32 => "i32",
            Self::Int64 => "i64",
            Self::Byte => "u8",
            Self::Float => "f32",
            Self::Double => "f64",
            Self::String => "::std::string::String",
            Self::Boolean => "bool",
        }
    }

    /// `int8_t` to `int64_t`: the types that a length field may have.
    pub fn is_signed_integer(self) -> bool {
        matches!(self, Self::Int8 | Self::Int16 | Self::Int32 | Self::Int64)
    }

    /// Smallest number of bytes of a value on the wire; exact for all types but strings.
    pub fn min_size(self) -> usize {
        match self {
            Self::Int8 | Self::Byte | Self::Boolean => 1,
            Self::Int16 => 2,
            Self::Int32 | Self::Float => 4,
            Self::Int64 | Self::Double => 8,
            Self::String => 5,
        }
    }
}

/// Place in a text; lines and columns count from 1, columns in characters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Position {
    /// Line, from 1.
    pub line: usize,
    /// Column, from 1.
    pub column: usize,
}

/// One parsed `.lcm` text.
#[derive(Debug, Clone, PartialEq)]
pub struct File {
    /// Name in error messages.
    pub path: Arc<str>,
    /// Its structs, in the order of the text.
    pub structs: Vec<Struct>,
    /// Its enums, in the order of the text.
    pub enums: Vec<Enum>,
}

/// Name of a declared type.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct TypeName {
    /// Package, empty if the text names none; may contain dots.
    pub package: String,
    /// Name without the package, such as `robot_state_t`.
    pub short: String,
}

impl std::fmt::Display for TypeName {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if !self.package.is_empty() {
            write!(f, "{}.", self.package)?;
        }
        f.write_str(&self.short)
    }
}

/// A message type.
#[derive(Debug, Clone, PartialEq)]
pub struct Struct {
    /// Its name.
    pub name: TypeName,
    /// Place of the name.
    pub position: Position,
    /// Comment directly above the declaration, without comment signs; lines joined by `\n`.
    pub comment: Option<String>,
    /// Its constants, in the order of the text.
    pub constants: Vec<Constant>,
    /// Its fields, in wire order.
    pub fields: Vec<Field>,
}

/// A named constant of a struct. Constants are not on the wire and not in the fingerprint.
#[derive(Debug, Clone, PartialEq)]
pub struct Constant {
    /// Its name.
    pub name: String,
    /// Value, with its type.
    pub value: ConstantValue,
    /// The value as written.
    pub text: String,
    /// Comment above its line.
    pub comment: Option<String>,
}

/// Value of a constant, by its declared type.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(missing_docs, reason = "the variants are the types of the language")]
pub enum ConstantValue {
    Int8(i8),
    Int16(i16),
    Int32(i32),
    Int64(i64),
    Float(f32),
    Double(f64),
}

/// A field of a struct.
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    /// Its name.
    pub name: Arc<str>,
    /// Place of the name.
    pub position: Position,
    /// Type of one element.
    pub ty: FieldType,
    /// Dimensions, outermost first; none for a scalar.
    pub dims: Vec<Dim>,
    /// Comment above its line.
    pub comment: Option<String>,
}

/// Type of a field's elements.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum FieldType {
    /// A built-in type.
    Primitive(Primitive),
    /// A struct or an enum, with the package filled in.
    Named(TypeName),
}

/// One dimension of an array.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Dim {
    /// Fixed size.
    Constant {
        /// Number of elements, above 0.
        size: usize,
        /// The number as written (for a named constant: as written at the constant); part of the fingerprint.
        text: String,
    },
    /// Variable size, in an earlier integer field of the same struct.
    Variable {
        /// Index of that field in [`Struct::fields`].
        field: usize,
        /// Name of that field.
        name: Arc<str>,
    },
}

/// A list of named numbers; on the wire an `int32_t`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Enum {
    /// Its name.
    pub name: TypeName,
    /// Place of the name.
    pub position: Position,
    /// Comment directly above the declaration.
    pub comment: Option<String>,
    /// Names and values, in the order of the text.
    pub values: Vec<(String, i32)>,
}

impl Enum {
    /// Its part of the fingerprint of a struct with a field of this type.
    pub fn fingerprint(&self) -> u64 {
        crate::hash::enum_base(self)
    }
}
