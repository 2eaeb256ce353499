//! Reflection on messages: decode, walk, compare.

use std::fmt;
use std::sync::Arc;

use crate::ast::{Dim, Primitive};
use crate::set::{Element, Linked};
use crate::wire::{self, Deviations, Reader, Wire};
use crate::{DecodeError, DecodeProblem, Leaf, Type, TypeSet, Value};

/// One step from a message to a value in it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Segment<'a> {
    /// To a field of a struct.
    Field(&'a str),
    /// To an element of an array.
    Index(usize),
}

/// Path from a message to a leaf, displayed as `state.q[3]`. The text is created only when it is displayed.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Path<'a>(pub(crate) Vec<Segment<'a>>);

impl<'a> Path<'a> {
    /// The steps, outermost first.
    pub fn segments(&self) -> &[Segment<'a>] {
        &self.0
    }
}

impl fmt::Display for Path<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (place, segment) in self.0.iter().enumerate() {
            match segment {
                Segment::Field(name) if place == 0 => f.write_str(name)?,
                Segment::Field(name) => write!(f, ".{name}")?,
                Segment::Index(index) => write!(f, "[{index}]")?,
            }
        }
        Ok(())
    }
}

/// A leaf in which two messages of a type differ.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Difference {
    /// Path, such as `state.q[3]`.
    pub path: String,
    /// Value in the first message.
    pub left: Value,
    /// Value in the second message.
    pub right: Value,
}

impl Difference {
    /// How many floats lie between the two values, plus one; `None` unless both are floats and neither is a NaN.
    pub fn ulps(&self) -> Option<u64> {
        // Bits of floats of one sign are in the order of their values; the negative ones are mirrored below zero.
        let line64 = |v: f64| {
            if v.is_sign_negative() { -i128::from((-v).to_bits()) } else { i128::from(v.to_bits()) }
        };
        let line32 = |v: f32| {
            if v.is_sign_negative() { -i128::from((-v).to_bits()) } else { i128::from(v.to_bits()) }
        };
        let distance = match (&self.left, &self.right) {
            (Value::Double(a), Value::Double(b)) if !a.is_nan() && !b.is_nan() => line64(*a) - line64(*b),
            (Value::Float(a), Value::Float(b)) if !a.is_nan() && !b.is_nan() => line32(*a) - line32(*b),
            _ => return None,
        };
        u64::try_from(distance.abs()).ok()
    }
}

impl TypeSet {
    /// Decodes a message of any type of the set, found by its fingerprint.
    ///
    /// # Errors
    /// [`DecodeProblem::UnknownFingerprint`], and those of [`Type::decode`].
    pub fn decode(&self, bytes: &[u8]) -> Result<(Type<'_>, Value), DecodeError> {
        let Some(ty) = self.of_message(bytes) else {
            let problem = match bytes.first_chunk() {
                Some(found) => DecodeProblem::UnknownFingerprint { found: u64::from_be_bytes(*found) },
                None => DecodeProblem::Truncated { needed: 8, remaining: bytes.len() },
            };
            return Err(DecodeError { type_name: "message".into(), path: String::new(), offset: 0, problem });
        };
        ty.decode(bytes).map(|value| (ty, value))
    }
}

impl<'a> Type<'a> {
    /// Reads a whole message into a tree of values.
    ///
    /// # Errors
    /// [`DecodeError`] with field and offset. Lengths are checked against the bytes that remain before anything is allocated.
    pub fn decode(&self, bytes: &[u8]) -> Result<Value, DecodeError> {
        self.traverse(bytes, Tree)
    }

    /// As [`Type::decode`], and accepts what LCM's decoders accept: see [`Deviations`].
    ///
    /// # Errors
    /// As [`Type::decode`].
    pub fn decode_lenient(&self, bytes: &[u8]) -> Result<(Value, Deviations), DecodeError> {
        self.traverse_with(Reader::lenient(bytes), Tree, false)
    }

    /// As [`Type::decode_lenient`]. Bytes that are a message of the set, such as the field `data` of a message that contains others, are decoded too: the
    /// value of the array is then that message.
    ///
    /// # Errors
    /// As [`Type::decode`].
    pub fn decode_opened(&self, bytes: &[u8]) -> Result<(Value, Deviations), DecodeError> {
        self.traverse_with(Reader::lenient(bytes), Tree, true)
    }

    /// As [`Type::walk`], and accepts what LCM's decoders accept: see [`Deviations`]. Bytes that are a message of the set are walked too, with paths such
    /// as `data.q[3]`.
    ///
    /// # Errors
    /// As [`Type::walk`].
    pub fn walk_lenient<'b>(
        &self,
        bytes: &'b [u8],
        visit: impl FnMut(&Path<'a>, Leaf<'b>),
    ) -> Result<Deviations, DecodeError> {
        self.traverse_with(Reader::lenient(bytes), Walk(visit), true).map(|((), deviations)| deviations)
    }

    /// Calls `visit` with path and value of every leaf of a message, in wire order.
    ///
    /// # Errors
    /// As [`Type::decode`]; leaves before the damage have been visited.
    pub fn walk<'b>(&self, bytes: &'b [u8], visit: impl FnMut(&Path<'a>, Leaf<'b>)) -> Result<(), DecodeError> {
        self.traverse(bytes, Walk(visit))
    }

    /// Every leaf of a message in wire order, with its path.
    ///
    /// # Errors
    /// As [`Type::decode`].
    pub fn leaves<'b>(&self, bytes: &'b [u8]) -> Result<Vec<(String, Leaf<'b>)>, DecodeError> {
        let mut leaves = Vec::new();
        self.walk(bytes, |path, leaf| leaves.push((path.to_string(), leaf)))?;
        Ok(leaves)
    }

    /// The first leaf in which two messages differ, comparing bits of floats; `None` if none does.
    ///
    /// A difference in length is found in the length field, which always precedes the array. Messages that differ only in [`Deviations`] have
    /// no such leaf.
    ///
    /// # Errors
    /// As [`Type::decode`], of either message.
    pub fn first_difference(&self, left: &[u8], right: &[u8]) -> Result<Option<Difference>, DecodeError> {
        if left == right {
            return self.walk_lenient(left, |_, _| ()).map(|_| None);
        }
        let mut expected = Vec::new();
        self.walk_lenient(left, |_, leaf| expected.push(leaf))?;
        let (mut expected, mut first) = (expected.into_iter(), None);
        self.walk_lenient(right, |path, right| {
            let left = expected.next();
            if let (None, Some(left)) = (&first, left.filter(|&left| left != right)) {
                first = Some(Difference { path: path.to_string(), left: left.to_value(), right: right.to_value() });
            }
        })?;
        Ok(first)
    }

    /// The value with all numbers 0 and all strings and variable arrays empty.
    pub fn default_value(&self) -> Value {
        let fields = self.linked().def.fields.iter().zip(&self.linked().elements);
        Value::Struct(
            fields.map(|(field, element)| (Arc::clone(&field.name), self.default_of(*element, &field.dims))).collect(),
        )
    }

    fn default_of(&self, element: Element, dims: &[Dim]) -> Value {
        match (dims.split_first(), element) {
            (Some((Dim::Constant { size, .. }, inner)), _) => {
                Value::Array(vec![self.default_of(element, inner); *size])
            }
            (Some((Dim::Variable { .. }, _)), _) => Value::Array(Vec::new()),
            (None, Element::Struct(index)) => Type { set: self.set, index }.default_value(),
            (None, Element::Enum(_)) => Value::Int32(0),
            (None, Element::Primitive(p)) => match p {
                Primitive::Int8 => Value::Int8(0),
                Primitive::Int16 => Value::Int16(0),
                Primitive::Int32 => Value::Int32(0),
                Primitive::Int64 => Value::Int64(0),
                Primitive::Byte => Value::Byte(0),
                Primitive::Float => Value::Float(0.0),
                Primitive::Double => Value::Double(0.0),
                Primitive::String => Value::String(String::new()),
                Primitive::Boolean => Value::Boolean(false),
            },
        }
    }

    fn traverse<'b, S: Sink<'a, 'b>>(&self, bytes: &'b [u8], sink: S) -> Result<S::Out, DecodeError> {
        self.traverse_with(Reader::new(bytes), sink, false).map(|(out, _)| out)
    }

    fn traverse_with<'b, S: Sink<'a, 'b>>(
        &self,
        wire: Reader<'b>,
        sink: S,
        opens: bool,
    ) -> Result<(S::Out, Deviations), DecodeError> {
        let depth = 0;
        let mut traversal = Traversal { set: self.set, wire, path: Path::default(), sink, opens, depth };
        let fingerprint = traversal.wire.fingerprint(self.fingerprint());
        let out = fingerprint.and_then(|()| traversal.structure(self.linked()));
        let out = out.and_then(|out| traversal.wire.finish().map(|()| (out, traversal.wire.deviations)));
        out.map_err(|e| DecodeError { path: traversal.path.to_string(), ..e.of_type(self.name()) })
    }
}

/// Receiver of the values of a message as it is read; one traversal serves all uses.
trait Sink<'a, 'b> {
    type Out;
    fn leaf(&mut self, path: &Path<'a>, leaf: Leaf<'b>) -> Self::Out;
    fn array(&mut self, items: Vec<Self::Out>) -> Self::Out;
    fn structure(&mut self, linked: &'a Linked, fields: Vec<Self::Out>) -> Self::Out;
}

struct Tree;

impl<'a, 'b> Sink<'a, 'b> for Tree {
    type Out = Value;
    fn leaf(&mut self, _: &Path<'a>, leaf: Leaf<'b>) -> Value {
        leaf.to_value()
    }
    fn array(&mut self, items: Vec<Value>) -> Value {
        Value::Array(items)
    }
    fn structure(&mut self, linked: &'a Linked, fields: Vec<Value>) -> Value {
        Value::Struct(linked.def.fields.iter().map(|f| Arc::clone(&f.name)).zip(fields).collect())
    }
}

/// Lists of `()` take no memory, so a walk builds nothing.
struct Walk<F>(F);

impl<'a, 'b, F: FnMut(&Path<'a>, Leaf<'b>)> Sink<'a, 'b> for Walk<F> {
    type Out = ();
    fn leaf(&mut self, path: &Path<'a>, leaf: Leaf<'b>) {
        (self.0)(path, leaf);
    }
    fn array(&mut self, _: Vec<()>) {}
    fn structure(&mut self, _: &'a Linked, _: Vec<()>) {}
}

/// A walk that visits nothing.
struct Nothing;

impl<'a, 'b> Sink<'a, 'b> for Nothing {
    type Out = ();
    fn leaf(&mut self, _: &Path<'a>, _: Leaf<'b>) {}
    fn array(&mut self, _: Vec<()>) {}
    fn structure(&mut self, _: &'a Linked, _: Vec<()>) {}
}

/// On failure `path` keeps the place of the error.
struct Traversal<'a, 'b, S> {
    set: &'a TypeSet,
    wire: Reader<'b>,
    path: Path<'a>,
    sink: S,
    /// Messages in arrays of bytes are read too; the number of messages around the present one.
    opens: bool,
    depth: usize,
}

/// Messages inside messages that are read.
const MAX_MESSAGES: usize = 8;

impl<'a, 'b, S: Sink<'a, 'b>> Traversal<'a, 'b, S> {
    fn structure(&mut self, linked: &'a Linked) -> Result<S::Out, DecodeError> {
        let mut fields = Vec::with_capacity(linked.def.fields.len());
        let mut integers = vec![0; linked.def.fields.len()];
        for (index, field) in linked.def.fields.iter().enumerate() {
            self.path.0.push(Segment::Field(&field.name));
            let element = linked.elements[index];
            let out = if field.dims.is_empty() {
                self.element(element, &mut integers[index])?
            } else {
                self.array(element, &field.dims, &integers)?
            };
            fields.push(out);
            self.path.0.pop();
        }
        Ok(self.sink.structure(linked, fields))
    }

    fn array(&mut self, element: Element, dims: &[Dim], integers: &[i64]) -> Result<S::Out, DecodeError> {
        let Some((outer, inner)) = dims.split_first() else {
            return self.element(element, &mut 0);
        };
        // Sizes known from the type are checked too: the type may come from a log, so it is not trusted.
        let inner_lengths: Vec<i64> = inner.iter().map(|dim| dim_length(dim, integers)).collect();
        let row_size = wire::row_size(&inner_lengths, self.min_size(element));
        let name = if let Dim::Variable { name, .. } = outer { name } else { "the array size" };
        let length = self.wire.claim(name, dim_length(outer, integers), row_size)?;
        let is_bytes = inner.is_empty() && matches!(element, Element::Primitive(Primitive::Byte));
        if is_bytes && self.opens && self.depth < MAX_MESSAGES {
            let before = self.wire.clone();
            let bytes = self.wire.slice(length)?;
            if let Some(out) = self.message(bytes)? {
                return Ok(out);
            }
            self.wire = before;
        }
        let mut items = Vec::with_capacity(length);
        for index in 0..length {
            self.path.0.push(Segment::Index(index));
            items.push(self.array(element, inner, integers)?);
            self.path.0.pop();
        }
        Ok(self.sink.array(items))
    }

    /// Reads bytes as a message; `None` if they are no message of the set.
    fn message(&mut self, bytes: &'b [u8]) -> Result<Option<S::Out>, DecodeError> {
        let Some(ty) = self.set.of_message(bytes) else { return Ok(None) };
        // Once without effect, because bytes that merely begin like a message are shown as bytes.
        if ty.traverse(bytes, Nothing).is_err() {
            return Ok(None);
        }
        let around = std::mem::replace(&mut self.wire, Reader::lenient(bytes));
        self.depth += 1;
        let out = self.wire.fingerprint(ty.fingerprint()).and_then(|()| self.structure(ty.linked()));
        self.depth -= 1;
        self.wire = around;
        out.map(Some)
    }

    fn min_size(&self, element: Element) -> usize {
        match element {
            Element::Primitive(p) => p.min_size(),
            Element::Enum(_) => i32::MIN_SIZE,
            Element::Struct(index) => self.set.structs[index].min_size,
        }
    }

    /// Reads one element; `integer` takes its value if it may be the length of an array.
    fn element(&mut self, element: Element, integer: &mut i64) -> Result<S::Out, DecodeError> {
        let wire = &mut self.wire;
        let leaf = match element {
            Element::Struct(index) => {
                wire.enter()?;
                let out = self.structure(&self.set.structs[index])?;
                self.wire.leave();
                return Ok(out);
            }
            Element::Enum(_) => Leaf::Int32(i32::take(wire)?),
            Element::Primitive(p) => match p {
                Primitive::Int8 => Leaf::Int8(i8::take(wire)?),
                Primitive::Int16 => Leaf::Int16(i16::take(wire)?),
                Primitive::Int32 => Leaf::Int32(i32::take(wire)?),
                Primitive::Int64 => Leaf::Int64(i64::take(wire)?),
                Primitive::Byte => Leaf::Byte(u8::take(wire)?),
                Primitive::Float => Leaf::Float(f32::take(wire)?),
                Primitive::Double => Leaf::Double(f64::take(wire)?),
                Primitive::Boolean => Leaf::Boolean(bool::take(wire)?),
                Primitive::String => match wire.text_or_bytes()? {
                    Ok(text) => Leaf::String(text),
                    Err(bytes) => Leaf::Latin1(bytes),
                },
            },
        };
        if let Some(value) = leaf.as_i64() {
            *integer = value;
        }
        Ok(self.sink.leaf(&self.path, leaf))
    }
}

fn dim_length(dim: &Dim, integers: &[i64]) -> i64 {
    match dim {
        Dim::Constant { size, .. } => i64::try_from(*size).unwrap_or(i64::MAX),
        Dim::Variable { field, .. } => integers[*field],
    }
}
