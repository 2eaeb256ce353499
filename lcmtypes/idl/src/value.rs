//! Values of messages whose type is known at run time only.

use std::borrow::Cow;
use std::fmt;
use std::sync::Arc;

use crate::EncodeError;

/// A message, or a part of one.
///
/// Equality compares the bits of floats, so that a NaN equals itself and 0.0 differs from -0.0.
#[derive(Debug, Clone)]
#[allow(missing_docs, reason = "the variants are the types of the language")]
pub enum Value {
    Int8(i8),
    Int16(i16),
    /// Also the value of an enum.
    Int32(i32),
    Int64(i64),
    Byte(u8),
    Float(f32),
    Double(f64),
    Boolean(bool),
    String(String),
    /// One dimension of an array.
    Array(Vec<Value>),
    /// Fields in wire order.
    Struct(Vec<(Arc<str>, Value)>),
}

/// A value without parts, borrowed from the message.
///
/// Equality compares the bits of floats.
#[derive(Debug, Clone, Copy)]
#[allow(missing_docs, reason = "the variants are the types of the language")]
pub enum Leaf<'a> {
    Int8(i8),
    Int16(i16),
    Int32(i32),
    Int64(i64),
    Byte(u8),
    Float(f32),
    Double(f64),
    Boolean(bool),
    String(&'a str),
    /// A string that is not UTF-8. LCM does not define its encoding; it is shown as Latin-1.
    Latin1(&'a [u8]),
}

impl PartialEq for Leaf<'_> {
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Int8(a), Self::Int8(b)) => a == b,
            (Self::Int16(a), Self::Int16(b)) => a == b,
            (Self::Int32(a), Self::Int32(b)) => a == b,
            (Self::Int64(a), Self::Int64(b)) => a == b,
            (Self::Byte(a), Self::Byte(b)) => a == b,
            (Self::Float(a), Self::Float(b)) => a.to_bits() == b.to_bits(),
            (Self::Double(a), Self::Double(b)) => a.to_bits() == b.to_bits(),
            (Self::Boolean(a), Self::Boolean(b)) => a == b,
            (Self::String(a), Self::String(b)) => a == b,
            (Self::Latin1(a), Self::Latin1(b)) => a == b,
            _ => false,
        }
    }
}

impl Eq for Leaf<'_> {}

/// Text of bytes in Latin-1.
fn latin1(bytes: &[u8]) -> String {
    bytes.iter().map(|&byte| char::from(byte)).collect()
}

impl<'a> Leaf<'a> {
    /// The same value, owned.
    pub fn to_value(self) -> Value {
        match self {
            Self::Int8(v) => Value::Int8(v),
            Self::Int16(v) => Value::Int16(v),
            Self::Int32(v) => Value::Int32(v),
            Self::Int64(v) => Value::Int64(v),
            Self::Byte(v) => Value::Byte(v),
            Self::Float(v) => Value::Float(v),
            Self::Double(v) => Value::Double(v),
            Self::Boolean(v) => Value::Boolean(v),
            Self::String(v) => Value::String(v.to_owned()),
            Self::Latin1(v) => Value::String(latin1(v)),
        }
    }

    /// The number as `f64` (booleans 0 and 1); `None` for a string. An `int64_t` above 2^53 is rounded.
    #[allow(clippy::cast_precision_loss, reason = "said in the documentation")]
    pub fn as_f64(self) -> Option<f64> {
        match self {
            Self::Float(v) => Some(f64::from(v)),
            Self::Double(v) => Some(v),
            other => other.as_i64().map(|v| v as f64),
        }
    }

    /// The integer (booleans 0 and 1); `None` for floats and strings.
    pub fn as_i64(self) -> Option<i64> {
        match self {
            Self::Int8(v) => Some(i64::from(v)),
            Self::Int16(v) => Some(i64::from(v)),
            Self::Int32(v) => Some(i64::from(v)),
            Self::Int64(v) => Some(v),
            Self::Byte(v) => Some(i64::from(v)),
            Self::Boolean(v) => Some(i64::from(v)),
            Self::Float(_) | Self::Double(_) | Self::String(_) | Self::Latin1(_) => None,
        }
    }

    /// The text; `None` for numbers, and for text that is not UTF-8.
    pub fn as_str(self) -> Option<&'a str> {
        if let Self::String(v) = self { Some(v) } else { None }
    }

    /// The text; `None` for numbers.
    pub fn text(self) -> Option<Cow<'a, str>> {
        match self {
            Self::String(v) => Some(Cow::Borrowed(v)),
            Self::Latin1(v) => Some(Cow::Owned(latin1(v))),
            _ => None,
        }
    }
}

/// Floats in the shortest form that reads back to the same bits; strings quoted.
impl fmt::Display for Leaf<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Int8(v) => v.fmt(f),
            Self::Int16(v) => v.fmt(f),
            Self::Int32(v) => v.fmt(f),
            Self::Int64(v) => v.fmt(f),
            Self::Byte(v) => v.fmt(f),
            Self::Float(v) => write!(f, "{v:?}"),
            Self::Double(v) => write!(f, "{v:?}"),
            Self::Boolean(v) => v.fmt(f),
            Self::String(v) => write!(f, "{v:?}"),
            Self::Latin1(v) => write!(f, "{:?}", latin1(v)),
        }
    }
}

impl PartialEq for Value {
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Array(a), Self::Array(b)) => a == b,
            (Self::Struct(a), Self::Struct(b)) => a == b,
            _ => self.as_leaf().is_some() && self.as_leaf() == other.as_leaf(),
        }
    }
}

impl Eq for Value {}

impl Value {
    /// The value, if it has no parts.
    pub fn as_leaf(&self) -> Option<Leaf<'_>> {
        Some(match self {
            Self::Int8(v) => Leaf::Int8(*v),
            Self::Int16(v) => Leaf::Int16(*v),
            Self::Int32(v) => Leaf::Int32(*v),
            Self::Int64(v) => Leaf::Int64(*v),
            Self::Byte(v) => Leaf::Byte(*v),
            Self::Float(v) => Leaf::Float(*v),
            Self::Double(v) => Leaf::Double(*v),
            Self::Boolean(v) => Leaf::Boolean(*v),
            Self::String(v) => Leaf::String(v),
            Self::Array(_) | Self::Struct(_) => return None,
        })
    }

    /// [`Leaf::as_f64`]
    pub fn as_f64(&self) -> Option<f64> {
        self.as_leaf()?.as_f64()
    }

    /// [`Leaf::as_i64`]
    pub fn as_i64(&self) -> Option<i64> {
        self.as_leaf()?.as_i64()
    }

    /// [`Leaf::as_str`]
    pub fn as_str(&self) -> Option<&str> {
        self.as_leaf()?.as_str()
    }

    /// The elements of an array.
    pub fn as_array(&self) -> Option<&[Value]> {
        if let Self::Array(items) = self { Some(items) } else { None }
    }

    /// The part at a path such as `state.q[3]`; the empty path is the value itself.
    pub fn get(&self, path: &str) -> Option<&Value> {
        steps(path).try_fold(self, |value, step| match (value, step?) {
            (Self::Struct(fields), Step::Field(name)) => fields.iter().find(|f| *f.0 == *name).map(|f| &f.1),
            (Self::Array(items), Step::Index(index)) => items.get(index),
            _ => None,
        })
    }

    /// As [`Value::get`], to be changed.
    pub fn get_mut(&mut self, path: &str) -> Option<&mut Value> {
        steps(path).try_fold(self, |value, step| match (value, step?) {
            (Self::Struct(fields), Step::Field(name)) => fields.iter_mut().find(|f| *f.0 == *name).map(|f| &mut f.1),
            (Self::Array(items), Step::Index(index)) => items.get_mut(index),
            _ => None,
        })
    }

    /// Puts a value of the same kind in the place of another.
    ///
    /// # Errors
    /// [`EncodeError::Shape`] if nothing stands at the path, or something of another kind.
    pub fn set(&mut self, path: &str, value: impl Into<Value>) -> Result<(), EncodeError> {
        let value = value.into();
        let shape = |found: &str, expected: &str| EncodeError::Shape {
            type_name: "value".into(),
            path: path.into(),
            found: found.into(),
            expected: expected.into(),
        };
        match self.get_mut(path) {
            Some(place) if place.kind() == value.kind() => *place = value,
            Some(place) => return Err(shape(value.kind(), place.kind())),
            None => return Err(shape("no such field or index", value.kind())),
        }
        Ok(())
    }

    /// Name of the kind, as in a `.lcm` text.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Int8(_) => "int8_t",
            Self::Int16(_) => "int16_t",
            Self::Int32(_) => "int32_t",
            Self::Int64(_) => "int64_t",
            Self::Byte(_) => "byte",
            Self::Float(_) => "float",
            Self::Double(_) => "double",
            Self::Boolean(_) => "boolean",
            Self::String(_) => "string",
            Self::Array(_) => "array",
            Self::Struct(_) => "struct",
        }
    }
}

/// One line: `{t_ns: 5, q: [0.1, 0.2]}`.
impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let comma = |f: &mut fmt::Formatter<'_>, index| if index > 0 { f.write_str(", ") } else { Ok(()) };
        match self {
            Self::Array(items) => {
                f.write_str("[")?;
                for (index, item) in items.iter().enumerate() {
                    comma(f, index)?;
                    item.fmt(f)?;
                }
                f.write_str("]")
            }
            Self::Struct(fields) => {
                f.write_str("{")?;
                for (index, (name, value)) in fields.iter().enumerate() {
                    comma(f, index)?;
                    write!(f, "{name}: {value}")?;
                }
                f.write_str("}")
            }
            leaf => leaf.as_leaf().map_or(Ok(()), |leaf| leaf.fmt(f)),
        }
    }
}

macro_rules! from {
    ($($t:ty => $variant:ident),*) => {$(
        impl From<$t> for Value {
            fn from(v: $t) -> Self {
                Self::$variant(v)
            }
        }
    )*};
}
from!(i8 => Int8, i16 => Int16, i32 => Int32, i64 => Int64, u8 => Byte, f32 => Float, f64 => Double, bool => Boolean, String => String);

impl From<&str> for Value {
    fn from(v: &str) -> Self {
        Self::String(v.to_owned())
    }
}

impl<T: Into<Value>> From<Vec<T>> for Value {
    fn from(v: Vec<T>) -> Self {
        Self::Array(v.into_iter().map(Into::into).collect())
    }
}

enum Step<'p> {
    Field(&'p str),
    Index(usize),
}

/// The steps of a path; `None` for an invalid step.
fn steps(path: &str) -> impl Iterator<Item = Option<Step<'_>>> {
    path.split(['.', '[']).filter(|s| !s.is_empty()).map(|step| match step.strip_suffix(']') {
        Some(index) => index.parse().ok().map(Step::Index),
        None => Some(Step::Field(step)),
    })
}
