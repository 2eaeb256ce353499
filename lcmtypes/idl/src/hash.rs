//! Fingerprints, as `lcm-gen` computes them: from the names and types of a struct's fields, not from its own name.

use crate::ast::{Dim, Enum, FieldType, Struct};

/// Hash of a struct's own fields, without the types they name.
pub(crate) fn struct_base(s: &Struct) -> u64 {
    let mut hash = Hash(0x1234_5678);
    for field in &s.fields {
        hash.text(&field.name);
        if let FieldType::Primitive(p) = field.ty {
            hash.text(p.name());
        }
        hash.length(field.dims.len());
        for dim in &field.dims {
            let (kind, size) = match dim {
                Dim::Constant { text, .. } => (0, text.as_str()),
                Dim::Variable { name, .. } => (1, &**name),
            };
            hash.byte(kind);
            hash.text(size);
        }
    }
    hash.0.cast_unsigned()
}

/// Hash of an enum, from its name only, so that values can be added later.
pub(crate) fn enum_base(e: &Enum) -> u64 {
    let mut hash = Hash(0x8765_4321);
    hash.text(&e.name.short);
    hash.0.cast_unsigned()
}

/// Hash of a struct from its own hash and the sum of those of the structs and enums that its fields name.
pub(crate) fn full(base: u64, sum_of_fields: u64) -> u64 {
    base.wrapping_add(sum_of_fields).rotate_left(1)
}

/// The running value is signed: its right shift copies the sign.
struct Hash(i64);

impl Hash {
    fn byte(&mut self, c: i8) {
        self.0 = ((self.0 << 8) ^ (self.0 >> 55)).wrapping_add(i64::from(c));
    }

    /// The original passes lengths as `char`, so only the low byte is used.
    #[allow(clippy::cast_possible_truncation, reason = "part of the definition")]
    fn length(&mut self, length: usize) {
        self.byte((length as u8).cast_signed());
    }

    fn text(&mut self, text: &str) {
        self.length(text.len());
        text.bytes().for_each(|b| self.byte(b.cast_signed()));
    }
}
