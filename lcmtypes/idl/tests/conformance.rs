//! Held against the stock LCM tools: same fingerprints, same bytes, by reflection and in generated code.
//!
//! `conformance/expected.json` was made by `scripts/lcm_gen_fixtures.py` from the texts beside it. `conformance/generated.rs` is
//! what [`lcm_idl::generate`] makes of them (see `generator.rs`).

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod common;

use std::collections::BTreeSet;
use std::fs;

use common::conformance_types as types;
use lcm_idl::{Leaf, Message};
use serde_json::Value as Json;

include!("conformance/generated.rs");

fn expected() -> Json {
    serde_json::from_str(&fs::read_to_string(common::folder().join("expected.json")).unwrap()).unwrap()
}

fn unhex(text: &str) -> Vec<u8> {
    (0..text.len()).step_by(2).map(|i| u8::from_str_radix(&text[i..i + 2], 16).unwrap()).collect()
}

/// Type and bytes of every stored message.
fn messages(expected: &Json) -> Vec<(&str, Vec<u8>, &Vec<Json>)> {
    let messages = expected["messages"].as_array().unwrap().iter();
    messages
        .map(|m| (m["type"].as_str().unwrap(), unhex(m["hex"].as_str().unwrap()), m["leaves"].as_array().unwrap()))
        .collect()
}

/// A leaf as the script writes it.
fn written(path: &str, leaf: Leaf<'_>) -> String {
    match leaf {
        Leaf::Int8(v) => format!("{path} int8_t {v}"),
        Leaf::Int16(v) => format!("{path} int16_t {v}"),
        Leaf::Int32(v) => format!("{path} int32_t {v}"),
        Leaf::Int64(v) => format!("{path} int64_t {v}"),
        Leaf::Byte(v) => format!("{path} byte {v}"),
        Leaf::Float(v) => format!("{path} float {:08x}", v.to_bits()),
        Leaf::Double(v) => format!("{path} double {:016x}", v.to_bits()),
        Leaf::Boolean(v) => format!("{path} boolean {v}"),
        Leaf::String(v) => format!("{path} string {v}"),
        Leaf::Latin1(_) => unreachable!("only a lenient decoder returns it"),
    }
}

#[test]
fn fingerprints_are_those_of_lcm_gen() {
    let (types, expected) = (types(), expected());
    let stock: BTreeSet<String> = expected["types"].as_object().unwrap().keys().cloned().collect();
    let ours: BTreeSet<String> = types.types().map(|t| t.name().to_owned()).collect();
    assert_eq!(ours, stock);
    for ty in types.types() {
        let stock = &expected["types"][ty.name()];
        assert_eq!(format!("{:016x}", ty.base_hash()), stock["base"], "base hash of {}", ty.name());
        assert_eq!(format!("{:016x}", ty.fingerprint()), stock["full"], "fingerprint of {}", ty.name());
    }
    for e in types.enums() {
        assert_eq!(format!("{:016x}", e.fingerprint()), expected["enums"][e.name.to_string()], "{}", e.name);
    }
    assert_eq!(types.enums().len(), expected["enums"].as_object().unwrap().len());
}

/// Known from the output of lcm-gen 1.5.3 for LCM's own examples and tests, and partly from its documentation.
#[test]
fn published_fingerprints() {
    let types = types();
    for (name, fingerprint) in [
        ("exlcm.example_t", 0x3755_3c53_61f7_5516),
        ("exlcm.node_t", 0x31fe_946c_75d6_e4e7),
        ("exlcm.example_list_t", 0xd8c3_7c52_f0f6_2dac),
        ("exlcm.exampleconst_t", 0x0000_0000_2468_acf0),
        ("exlcm.muldim_array_t", 0x3c02_48e7_bd69_9f76),
        ("lcmtest.primitives_t", 0x84e6_2b31_229e_6d55),
        ("lcmtest.primitives_list_t", 0x678a_d070_8ed8_03c0),
        ("lcmtest.bools_t", 0x239f_ecd5_036a_5707),
        ("lcmtest.byte_array_t", 0x0e18_e8ef_c4e1_bd7f_u64),
    ] {
        assert_eq!(types.by_name(name).unwrap().fingerprint(), fingerprint, "{name}");
    }
    assert_eq!(types.by_name("exlcm.example_t").unwrap().base_hash(), 0x1baa_9e29_b0fb_aa8b);
    assert_eq!(types.by_name("exlcm.node_t").unwrap().base_hash(), 0x98ff_4a36_3aeb_7273);
}

#[test]
fn reflection_reads_and_writes_the_stock_bytes() {
    let (types, expected) = (types(), expected());
    for (name, bytes, stock) in messages(&expected) {
        let ty = types.by_name(name).unwrap();
        let leaves = ty.leaves(&bytes).unwrap();
        let ours: Vec<String> = leaves.iter().map(|(path, leaf)| written(path, *leaf)).collect();
        assert_eq!(ours, *stock, "{name}");

        let value = ty.decode(&bytes).unwrap();
        assert_eq!(ty.encode(&value).unwrap(), bytes, "{name}");
        for (path, leaf) in &leaves {
            assert_eq!(value.get(path).unwrap().as_leaf(), Some(*leaf), "{name}, {path}");
        }
    }
}

fn round_trip<M: Message>(name: &str, bytes: &[u8]) -> bool {
    if name != M::TYPE {
        return false;
    }
    let mut again = Vec::new();
    M::decode(bytes).unwrap().encode(&mut again).unwrap();
    assert_eq!(again, bytes, "{name}");
    for end in 0..bytes.len() {
        assert!(M::decode(&bytes[..end]).is_err(), "{name} cut at byte {end}");
    }
    // Reflection and generated code agree on what is a message.
    let types = types();
    let ty = types.by_name(name).unwrap();
    let mut random = common::Random(1);
    // Read over whatever was there before, part of a damaged message included.
    let mut used = M::default();
    for _ in 0..2000 {
        let mut damaged = bytes.to_vec();
        let place = random.below(bytes.len());
        damaged[place] = random.next().to_le_bytes()[0];
        let (generated, reflected) = (M::decode(&damaged), ty.decode(&damaged));
        assert_eq!(generated.is_ok(), reflected.is_ok(), "{name}: {generated:?}, {reflected:?}");
        if let Ok(message) = generated {
            again.clear();
            message.encode(&mut again).unwrap();
            assert_eq!(again, damaged, "{name}");
        }
        assert_eq!(used.decode_into(&damaged).is_ok(), reflected.is_ok(), "{name}: {reflected:?}");
        if reflected.is_ok() {
            again.clear();
            used.encode(&mut again).unwrap();
            assert_eq!(again, damaged, "{name} read over another");
        }
    }
    true
}

#[test]
fn generated_code_reads_and_writes_the_stock_bytes() {
    let expected = expected();
    for (name, bytes, _) in messages(&expected) {
        let known = round_trip::<conformance::Primitives>(name, &bytes)
            || round_trip::<conformance::Empty>(name, &bytes)
            || round_trip::<conformance::Arrays>(name, &bytes)
            || round_trip::<conformance::OneLine>(name, &bytes)
            || round_trip::<conformance::Long>(name, &bytes)
            || round_trip::<conformance::Nested>(name, &bytes)
            || round_trip::<conformance::Enums>(name, &bytes)
            || round_trip::<conformance::Node>(name, &bytes)
            || round_trip::<conformance::Ping>(name, &bytes)
            || round_trip::<conformance::Commented>(name, &bytes)
            || round_trip::<conformance::NamedConstants>(name, &bytes)
            || round_trip::<unnamed::Bare>(name, &bytes)
            || round_trip::<exlcm::Example>(name, &bytes)
            || round_trip::<exlcm::MuldimArray>(name, &bytes)
            || round_trip::<lcmtest::Bools>(name, &bytes);
        assert!(known, "no generated type for {name}");
    }
}

#[test]
fn generated_fields_hold_the_values() {
    let expected = expected();
    let bytes = |ty: &str| messages(&expected).into_iter().find(|m| m.0 == ty).unwrap().1;

    let arrays = conformance::Arrays::decode(&bytes("conformance.arrays_t")).unwrap();
    assert_eq!(arrays.columns, [vec![0.5, 0.25], vec![-0.5, -0.25]]);
    assert_eq!(arrays.cube, [[[1, 2, 3], [4, 5, 6]], [[7, 8, 9], [-1, -2, -3]]].map(|rows| rows.map(Vec::from)));
    assert_eq!(arrays.square, [[70000], [-70000]]);
    assert_eq!(arrays.raw, *b"\xde\xad\xbe\xef");
    let primitives = conformance::Primitives::decode(&bytes("conformance.primitives_t")).unwrap();
    assert_eq!((primitives.s.as_str(), primitives.f, primitives.yes), ("größe\n", 0.1, true));
    let enums = conformance::Enums::decode(&bytes("conformance.enums_t")).unwrap();
    assert_eq!(enums.palette, [conformance::Colour::RED, conformance::Colour(99)]);
    let commented = conformance::Commented::decode(&bytes("conformance.commented_t")).unwrap();
    assert_eq!((commented.r#type, commented.r#match, commented.self_, commented.r#box), (1, 2, 3, 4));
}

#[test]
fn generated_constants_have_their_type_and_value() {
    use conformance::Primitives as P;
    let integers: (i8, i8, i8, i16, i32, i64) = (P::SMALLEST, P::LARGEST, P::HEXADECIMAL, P::PORT, P::SIGN, P::BIG);
    assert_eq!(integers, (-128, 127, 127, 7667, i32::MIN, i64::MAX));
    let floats: (f32, f32, f64, f64, f64, f64) = (P::THIRD, P::AVOGADRO, P::PI, P::TINY, P::HALF, P::INTEGER);
    assert_eq!(floats, (1.0 / 3.0, 6.022_140_8e23, std::f64::consts::PI, -1e-300, 0.5, 3.0));
    use conformance::{Colour, Other};
    assert_eq!(
        [Colour::RED, Colour::GREEN, Colour::BLUE, Colour::INFRARED, Colour::VIOLET].map(|c| c.0),
        [1, 5, 6, -3, 7]
    );
    assert_eq!([Other::A.0, Other::B.0], [16, 17]);
}

#[test]
fn the_comment_above_a_struct_is_kept() {
    let types = types();
    let comment = |name: &str| types.by_name(name).unwrap().def().comment.clone();
    let expected = "First line,\n  second line, indented.\n\nFourth line with \"quotes\", `ticks`, \\backslashes\\ and [brackets].";
    assert_eq!(comment("conformance.commented_t").as_deref(), Some(expected));
    assert_eq!(comment("conformance.no_comment_t"), None);
    assert_eq!(
        comment("conformance.primitives_t").as_deref(),
        Some("Every primitive type,\nand every type of constant.")
    );
    assert_eq!(comment("bare_t").as_deref(), Some("Before any `package` line."));

    let commented = types.by_name("conformance.commented_t").unwrap();
    let fields: Vec<Option<&str>> = commented.def().fields.iter().map(|f| f.comment.as_deref()).collect();
    let rust = Some("keywords of Rust");
    assert_eq!(fields, [Some("A block above a field."), Some("above a field"), rust, rust, rust, rust]);
}
