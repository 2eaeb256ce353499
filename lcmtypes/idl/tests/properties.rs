//! Properties of all types and messages, tested on random ones from a fixed seed.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod common;

use std::fmt::Write as _;

use common::Random;
use lcm_idl::ast::{Dim, FieldType};
use lcm_idl::{Difference, Type, TypeSet, Value};

const PRIMITIVES: [&str; 9] =
    ["int8_t", "int16_t", "int32_t", "int64_t", "byte", "float", "double", "string", "boolean"];

/// A text with a few structs, of which each may hold those before it and, in arrays of variable length, any.
fn random_text(random: &mut Random) -> String {
    let mut text = String::from("package random;\nenum choice_t { A, B, C }\n");
    let structs = 1 + random.below(5);
    for s in 0..structs {
        writeln!(text, "struct s{s}_t {{\n    int8_t n;\n    int64_t m;").unwrap();
        for f in 0..random.below(6) {
            let dims: String = (0..random.below(4)).map(|_| ["[2]", "[3]", "[n]", "[m]"][random.below(4)]).collect();
            let ty = match random.below(4) {
                0 if s > 0 => format!("s{}_t", random.below(s)),
                1 if dims.contains(['n', 'm']) => format!("s{}_t", random.below(structs)),
                2 if random.below(3) == 0 => "choice_t".to_owned(),
                _ => PRIMITIVES[random.below(9)].to_owned(),
            };
            writeln!(text, "    {ty} f{f}{dims};").unwrap();
        }
        text.push_str("}\n");
    }
    text
}

/// A value of the type; deeper than `depth`, arrays of variable length are empty.
fn random_value(random: &mut Random, types: &TypeSet, ty: Type<'_>, depth: usize) -> Value {
    let mut lengths = vec![0usize; ty.def().fields.len()];
    let mut value = ty.default_value();
    for (index, field) in ty.def().fields.iter().enumerate() {
        if index < 2 {
            lengths[index] = if depth == 0 { 0 } else { random.below(3) };
            let length = lengths[index];
            let length = if index == 0 {
                Value::Int8(length.try_into().unwrap())
            } else {
                Value::Int64(length.try_into().unwrap())
            };
            value.set(&field.name, length).unwrap();
            continue;
        }
        let sizes: Vec<usize> = field
            .dims
            .iter()
            .map(|dim| match dim {
                Dim::Constant { size, .. } => *size,
                Dim::Variable { field, .. } => lengths[*field],
            })
            .collect();
        *value.get_mut(&field.name).unwrap() = array(&sizes, &mut || match &field.ty {
            FieldType::Named(name) => match types.by_name(&name.to_string()) {
                Some(inner) => random_value(random, types, inner, depth.saturating_sub(1)),
                None => Value::Int32(i32::try_from(random.below(7)).unwrap() - 3),
            },
            FieldType::Primitive(p) => leaf(random, p.name()),
        });
    }
    value
}

fn array(sizes: &[usize], item: &mut dyn FnMut() -> Value) -> Value {
    match sizes.split_first() {
        Some((size, inner)) => Value::Array((0..*size).map(|_| array(inner, item)).collect()),
        None => item(),
    }
}

#[allow(clippy::cast_possible_truncation, reason = "any bits will do")]
fn leaf(random: &mut Random, ty: &str) -> Value {
    let bits = random.next();
    match ty {
        "int8_t" => Value::Int8(bits as i8),
        "int16_t" => Value::Int16(bits as i16),
        "int32_t" => Value::Int32(bits as i32),
        "int64_t" => Value::Int64(bits as i64),
        "byte" => Value::Byte(bits as u8),
        // Any bits: NaNs with payloads, subnormal numbers, both zeros.
        "float" => Value::Float(f32::from_bits(bits as u32)),
        "double" => Value::Double(f64::from_bits(bits)),
        "boolean" => Value::Boolean(bits & 1 == 1),
        _ => Value::String("aé\0漢 ".chars().cycle().skip(random.below(5)).take(random.below(8)).collect()),
    }
}

/// Random types with a random message each.
fn each_message(seeds: std::ops::Range<u64>, mut check: impl FnMut(&TypeSet, Type<'_>, &Value, &[u8])) {
    for seed in seeds {
        let mut random = Random(seed);
        let text = random_text(&mut random);
        let types =
            TypeSet::parse([("random.lcm", text.as_str())]).unwrap_or_else(|e| panic!("seed {seed}: {e}\n{text}"));
        for ty in types.types() {
            let value = random_value(&mut random, &types, ty, 3);
            let bytes = ty.encode(&value).unwrap_or_else(|e| panic!("seed {seed}: {e}\n{text}"));
            if bytes.len() < 20_000 {
                check(&types, ty, &value, &bytes);
            }
        }
    }
}

#[test]
fn decode_inverts_encode() {
    let mut messages = 0;
    each_message(0..400, |types, ty, value, bytes| {
        messages += 1;
        let again = ty.decode(bytes).unwrap();
        assert_eq!(again, *value);
        assert_eq!(ty.encode(&again).unwrap(), bytes);
        let (found, _) = types.decode(bytes).unwrap();
        assert_eq!(found.fingerprint(), ty.fingerprint());
        for (path, leaf) in ty.leaves(bytes).unwrap() {
            assert_eq!(value.get(&path).unwrap().as_leaf(), Some(leaf), "{path}");
        }
    });
    assert!(messages > 800, "{messages}");
}

#[test]
fn a_truncated_message_is_rejected() {
    each_message(1000..1060, |_, ty, _, bytes| {
        let step = 1 + bytes.len() / 500;
        for end in (0..bytes.len()).step_by(step) {
            assert!(ty.decode(&bytes[..end]).is_err(), "{} cut at byte {end} of {}", ty.name(), bytes.len());
        }
        let longer = [bytes, &[0]].concat();
        assert!(ty.decode(&longer).unwrap_err().to_string().ends_with("1 bytes follow the last field, expected none"));
    });
}

#[test]
fn damaged_bytes_are_rejected_or_decoded_to_a_value_that_encodes_to_them() {
    let mut random = Random(7);
    let mut read = 0;
    each_message(2000..2200, |_, ty, _, bytes| {
        for _ in 0..20 {
            let mut damaged = bytes.to_vec();
            let place = random.below(bytes.len());
            damaged[place] ^= 1 << random.below(8);
            if let Ok(value) = ty.decode(&damaged) {
                read += 1;
                assert_eq!(ty.encode(&value).unwrap(), damaged);
            }
        }
    });
    assert!(read > 1000, "{read}");
}

#[test]
fn the_first_difference_is_the_leaf_that_was_changed() {
    let mut random = Random(11);
    let mut compared = 0;
    each_message(3000..3300, |_, ty, value, bytes| {
        assert_eq!(ty.first_difference(bytes, bytes).unwrap(), None);
        let leaves = ty.leaves(bytes).unwrap();
        let (path, _) = &leaves[random.below(leaves.len())];
        let mut changed = value.clone();
        let place = changed.get_mut(path).unwrap();
        let left = place.clone();
        let right = match &left {
            Value::Double(v) => Value::Double(f64::from_bits(v.to_bits() ^ 1)),
            Value::Float(v) => Value::Float(f32::from_bits(v.to_bits() ^ 1)),
            Value::Boolean(v) => Value::Boolean(!v),
            Value::String(v) => Value::String(format!("{v}!")),
            Value::Byte(v) => Value::Byte(v ^ 1),
            _ => return, // an integer may be a length
        };
        *place = right.clone();
        compared += 1;
        let found = ty.first_difference(bytes, &ty.encode(&changed).unwrap()).unwrap();
        assert_eq!(found, Some(Difference { path: path.clone(), left, right }));
    });
    assert!(compared > 100, "{compared}");
}
