//! Reflection on messages: encode.

use crate::ast::{Dim, Primitive};
use crate::reflect::{Path, Segment};
use crate::set::Element;
use crate::wire::{self, Wire};
use crate::{EncodeError, Type, Value};

impl Type<'_> {
    /// Writes a message.
    ///
    /// # Errors
    /// [`EncodeError::Shape`] if the tree does not have the fields and kinds of the type, [`EncodeError::Length`] if an array does
    /// not have the length given by its length field.
    pub fn encode(&self, value: &Value) -> Result<Vec<u8>, EncodeError> {
        let mut writer = Writer { top: *self, path: Path::default(), out: self.fingerprint().to_be_bytes().to_vec() };
        writer.structure(*self, value)?;
        Ok(writer.out)
    }
}

struct Writer<'a> {
    top: Type<'a>,
    path: Path<'a>,
    out: Vec<u8>,
}

impl<'a> Writer<'a> {
    fn shape(&self, found: &str, expected: &str) -> EncodeError {
        let (type_name, path) = (self.top.name().to_owned(), self.path.to_string());
        EncodeError::Shape { type_name, path, found: found.to_owned(), expected: expected.to_owned() }
    }

    fn structure(&mut self, ty: Type<'a>, value: &Value) -> Result<(), EncodeError> {
        let linked = ty.linked();
        let Value::Struct(fields) = value else {
            return Err(self.shape(value.kind(), ty.name()));
        };
        if fields.len() != linked.def.fields.len() {
            let (found, expected) = (fields.len(), linked.def.fields.len());
            return Err(self.shape(&format!("{found} fields"), &format!("the {expected} of {}", ty.name())));
        }
        let integers: Vec<i64> = fields.iter().map(|(_, value)| value.as_i64().unwrap_or(0)).collect();
        for (index, (name, value)) in fields.iter().enumerate() {
            let field = &linked.def.fields[index];
            if *name != field.name {
                return Err(self.shape(&format!("field {name}"), &format!("field {}", field.name)));
            }
            self.path.0.push(Segment::Field(&field.name));
            self.array(ty, linked.elements[index], &field.dims, &integers, value)?;
            self.path.0.pop();
        }
        Ok(())
    }

    fn array(
        &mut self,
        ty: Type<'a>,
        element: Element,
        dims: &'a [Dim],
        integers: &[i64],
        value: &Value,
    ) -> Result<(), EncodeError> {
        let Some((outer, inner)) = dims.split_first() else {
            return self.element(element, value);
        };
        let Value::Array(items) = value else {
            return Err(self.shape(value.kind(), "array"));
        };
        match outer {
            Dim::Constant { size, .. } if *size == items.len() => {}
            Dim::Constant { size, .. } => {
                return Err(self.shape(&format!("{} elements", items.len()), &format!("{size} elements")));
            }
            Dim::Variable { field, name } => {
                wire::check_length(ty.name(), &self.path.to_string(), items.len(), name, integers[*field])?;
            }
        }
        for (index, item) in items.iter().enumerate() {
            self.path.0.push(Segment::Index(index));
            self.array(ty, element, inner, integers, item)?;
            self.path.0.pop();
        }
        Ok(())
    }

    fn element(&mut self, element: Element, value: &Value) -> Result<(), EncodeError> {
        let out = &mut self.out;
        let expected = match element {
            Element::Struct(index) => {
                return self.structure(Type { set: self.top.set, index }, value);
            }
            Element::Enum(_) => Primitive::Int32,
            Element::Primitive(p) => p,
        };
        match (expected, value) {
            (Primitive::Int8, Value::Int8(v)) => v.put(out),
            (Primitive::Int16, Value::Int16(v)) => v.put(out),
            (Primitive::Int32, Value::Int32(v)) => v.put(out),
            (Primitive::Int64, Value::Int64(v)) => v.put(out),
            (Primitive::Byte, Value::Byte(v)) => v.put(out),
            (Primitive::Float, Value::Float(v)) => v.put(out),
            (Primitive::Double, Value::Double(v)) => v.put(out),
            (Primitive::Boolean, Value::Boolean(v)) => v.put(out),
            (Primitive::String, Value::String(v)) => wire::put_str(v, out),
            _ => Err(self.shape(value.kind(), expected.name())),
        }
    }
}
