//! Reflection: values, paths, differences, rejected messages.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use lcm_idl::wire::{MAX_DEPTH, MAX_EMPTY};
use lcm_idl::{DecodeProblem, Deviations, Difference, Segment, TypeSet, Value};

const TEXT: &str = "package p;
struct inner_t { double x[2]; string s; }
struct outer_t { int32_t n; inner_t in[n]; boolean b; float f; }
struct empty_t { }
struct crowd_t { int32_t n; int32_t m; empty_t nothing[n]; double rows[n][m]; }
struct node_t { int8_t n; node_t child[n]; }
struct twin_t { int8_t n; node_t child[n]; }
struct huge_t { empty_t nothing[2000000000]; }";

fn types() -> TypeSet {
    TypeSet::parse([("p.lcm", TEXT)]).unwrap()
}

fn outer(types: &TypeSet) -> (Value, Vec<u8>) {
    let ty = types.by_name("p.outer_t").unwrap();
    let mut value = ty.default_value();
    value.set("n", 2i32).unwrap();
    let inner = types.by_name("p.inner_t").unwrap().default_value();
    *value.get_mut("in").unwrap() = Value::Array(vec![inner.clone(), inner]);
    value.set("in[1].x[0]", 1.5).unwrap();
    value.set("in[1].s", "two").unwrap();
    let bytes = ty.encode(&value).unwrap();
    (value, bytes)
}

#[test]
fn a_message_is_found_by_its_fingerprint_and_shown_as_one_line() {
    let types = types();
    let (value, bytes) = outer(&types);
    let (ty, decoded) = types.decode(&bytes).unwrap();
    assert_eq!((ty.name(), &decoded), ("p.outer_t", &value));
    let line = "{n: 2, in: [{x: [0.0, 0.0], s: \"\"}, {x: [1.5, 0.0], s: \"two\"}], b: false, f: 0.0}";
    assert_eq!(decoded.to_string(), line);

    let error = |bytes: &[u8]| types.decode(bytes).unwrap_err().to_string();
    assert_eq!(error(&[0; 8]), "message, byte 0: no known type has the fingerprint 0000000000000000");
    assert_eq!(error(&[0; 7]), "message, byte 0: 7 bytes remain, expected at least 8");
    let error = types.by_name("p.inner_t").unwrap().decode(&bytes).unwrap_err();
    assert!(matches!(error.problem, DecodeProblem::Fingerprint { .. }), "{error}");
}

#[test]
fn a_type_knows_its_text_and_the_types_of_its_fields() {
    let types = types();
    let outer = types.by_name("p.outer_t").unwrap();
    let names: Vec<Option<&str>> = (0..5).map(|field| outer.element(field).map(|ty| ty.name())).collect();
    assert_eq!((outer.file(), names), ("p.lcm", vec![None, Some("p.inner_t"), None, None, None]));
}

#[test]
fn leaves_come_in_wire_order_with_their_paths() {
    let types = types();
    let (_, bytes) = outer(&types);
    let leaves = types.by_name("p.outer_t").unwrap().leaves(&bytes).unwrap();
    let lines: Vec<String> = leaves.iter().map(|(path, leaf)| format!("{path} = {leaf}")).collect();
    let expected = [
        "n = 2",
        "in[0].x[0] = 0.0",
        "in[0].x[1] = 0.0",
        "in[0].s = \"\"",
        "in[1].x[0] = 1.5",
        "in[1].x[1] = 0.0",
        "in[1].s = \"two\"",
        "b = false",
        "f = 0.0",
    ];
    assert_eq!(lines, expected);
    let mut last = Vec::new();
    types.by_name("p.outer_t").unwrap().walk(&bytes, |path, _| last = path.segments().to_vec()).unwrap();
    assert_eq!(last, [Segment::Field("f")]);
}

#[test]
fn values_are_reached_by_path() {
    let types = types();
    let (mut value, _) = outer(&types);
    assert_eq!(value.get("in[1].x[0]").unwrap().as_f64(), Some(1.5));
    assert_eq!(value.get("in[1].s").unwrap().as_str(), Some("two"));
    assert_eq!(value.get("n").unwrap().as_i64(), Some(2));
    assert_eq!(value.get("in").unwrap().as_array().unwrap().len(), 2);
    assert_eq!(value.get("").unwrap(), &value);
    for wrong in ["in[2]", "in.x", "n[0]", "none", "in[x]", "in[-1]"] {
        assert_eq!(value.get(wrong), None, "{wrong}");
    }
    let error = value.set("n", 2i64).unwrap_err().to_string();
    assert_eq!(error, "value, field n: found int64_t, expected int32_t");
    let error = value.set("m", 2i64).unwrap_err().to_string();
    assert_eq!(error, "value, field m: found no such field or index, expected int64_t");
}

#[test]
fn encode_rejects_a_value_of_another_type() {
    let types = types();
    let ty = types.by_name("p.outer_t").unwrap();
    let encode = |change: &dyn Fn(&mut Value)| {
        let (mut value, _) = outer(&types);
        change(&mut value);
        ty.encode(&value).unwrap_err().to_string()
    };
    let put = |path: &'static str, new: Value| move |value: &mut Value| *value.get_mut(path).unwrap() = new.clone();
    assert_eq!(encode(&put("n", Value::Int32(3))), "p.outer_t.in has 2 elements, its length field n is 3");
    assert_eq!(encode(&put("b", Value::Byte(1))), "p.outer_t, field b: found byte, expected boolean");
    assert_eq!(encode(&put("in", Value::Int8(1))), "p.outer_t, field in: found int8_t, expected array");
    assert_eq!(encode(&put("in[1]", Value::Int8(1))), "p.outer_t, field in[1]: found int8_t, expected p.inner_t");
    let three = Value::from(vec![1.0, 2.0, 3.0]);
    assert_eq!(encode(&put("in[0].x", three)), "p.outer_t, field in[0].x: found 3 elements, expected 2 elements");
    let no_fields = Value::Struct(Vec::new());
    assert_eq!(encode(&put("in[0]", no_fields)), "p.outer_t, field in[0]: found 0 fields, expected the 2 of p.inner_t");
    let swapped = |value: &mut Value| {
        let Value::Struct(fields) = value else { panic!() };
        fields.swap(2, 3);
    };
    assert_eq!(encode(&swapped), "p.outer_t: found field f, expected field b");
}

#[test]
fn differences_compare_bits_and_count_ulps() {
    let types = TypeSet::parse([("p.lcm", "struct a_t { double x; float y; int8_t n; byte z[n]; }")]).unwrap();
    let ty = types.by_name("a_t").unwrap();
    let message = |x: f64, y: f32, z: &[u8]| {
        let mut value = ty.default_value();
        value.set("x", x).unwrap();
        value.set("y", y).unwrap();
        value.set("n", i8::try_from(z.len()).unwrap()).unwrap();
        value.set("z", z.to_vec()).unwrap();
        ty.encode(&value).unwrap()
    };
    let difference = |a: &[u8], b: &[u8]| ty.first_difference(a, b).unwrap();
    let same = message(f64::NAN, -0.0, &[1]);
    assert_eq!(difference(&same, &same), None);

    let ulps = |a: f64, b: f64| difference(&message(a, 0.0, &[]), &message(b, 0.0, &[])).unwrap().ulps();
    assert_eq!(ulps(1.0, 1.0 + f64::EPSILON), Some(1));
    assert_eq!(ulps(1.0, 1.0 - f64::EPSILON), Some(2));
    assert_eq!(ulps(0.0, -0.0), Some(0), "different bits, the same number");
    assert_eq!(ulps(5e-324, -5e-324), Some(2));
    assert_eq!(ulps(-f64::MAX, f64::INFINITY), Some(2 * 0x7ff0_0000_0000_0000 - 1));
    assert_eq!(ulps(1.0, f64::NAN), None);
    let found = difference(&message(0.0, 1.0, &[]), &message(0.0, f32::from_bits(1f32.to_bits() + 3), &[])).unwrap();
    assert_eq!((found.path.as_str(), found.ulps()), ("y", Some(3)));

    // A difference in length is found in the length field.
    let found = difference(&message(0.0, 0.0, &[1, 2]), &message(0.0, 0.0, &[9])).unwrap();
    assert_eq!(found, Difference { path: "n".into(), left: Value::Int8(2), right: Value::Int8(1) });
    let found = difference(&message(0.0, 0.0, &[1, 2]), &message(0.0, 0.0, &[1, 3])).unwrap();
    assert_eq!((found.path.as_str(), found.ulps()), ("z[1]", None));
}

/// Fingerprint of a type, then `fields`.
fn raw(types: &TypeSet, name: &str, fields: &[&[u8]]) -> Vec<u8> {
    [&types.by_name(name).unwrap().fingerprint().to_be_bytes()[..], &fields.concat()].concat()
}

#[test]
fn hostile_messages_are_rejected_before_memory_is_allocated() {
    let types = types();
    let problem = |name: &str, fields: &[&[u8]]| {
        let error = types.by_name(name).unwrap().decode(&raw(&types, name, fields)).unwrap_err();
        (error.path.clone(), error.problem)
    };
    let many = i32::MAX.to_be_bytes();
    let none = 0i32.to_be_bytes();
    let (path, found) = problem("p.outer_t", &[&many]);
    assert_eq!((path.as_str(), found), ("in", DecodeProblem::Truncated { needed: 21 * 0x7fff_ffff, remaining: 0 }));
    // Elements without bytes: only the limit bounds them.
    let (path, found) = problem("p.crowd_t", &[&many, &none]);
    let expected =
        DecodeProblem::TooManyEmpty { length_field: "n".into(), found: i64::from(i32::MAX), limit: MAX_EMPTY };
    assert_eq!((path.as_str(), found), ("nothing", expected));
    let n = i32::try_from(MAX_EMPTY / 2 + 1).unwrap();
    assert_eq!(problem("p.crowd_t", &[&n.to_be_bytes(), &none]).0, "rows", "rows of length 0 count too");
    assert_eq!(problem("p.huge_t", &[]).0, "nothing");
    let (path, found) = problem("p.crowd_t", &[&none, &(-1i32).to_be_bytes(), &[0]]);
    assert_eq!(
        (path.as_str(), found),
        ("", DecodeProblem::TrailingBytes { extra: 1 }),
        "no row, so nothing has length -1"
    );

    let string = |length: i32, text: &[u8]| {
        problem("p.outer_t", &[&1i32.to_be_bytes(), &[0; 16], &length.to_be_bytes(), text]).1
    };
    assert_eq!(string(0, &[0; 20]), DecodeProblem::StringLength { found: 0 });
    assert_eq!(string(-5, &[0; 20]), DecodeProblem::StringLength { found: -5 });
    assert_eq!(string(i32::MAX, &[0; 20]), DecodeProblem::Truncated { needed: 0x7fff_ffff, remaining: 20 });
    assert_eq!(string(2, b"ab"), DecodeProblem::StringEnd { found: b'b' });
    assert_eq!(string(2, b"\xff\0"), DecodeProblem::StringUtf8);
    let (path, found) = problem("p.outer_t", &[&none, &[2], &[0; 4]]);
    assert_eq!((path.as_str(), found), ("b", DecodeProblem::Boolean { found: 2 }));
}

#[test]
fn nesting_of_structs_is_limited() {
    let types = types();
    let ty = types.by_name("p.node_t").unwrap();
    let chain = |depth: usize| raw(&types, "p.node_t", &[&vec![1; depth], &[0]]);
    assert!(ty.decode(&chain(MAX_DEPTH)).is_ok());
    let error = ty.decode(&chain(MAX_DEPTH + 1)).unwrap_err();
    assert_eq!(error.problem, DecodeProblem::TooDeep { limit: MAX_DEPTH });
    assert!(ty.decode(&chain(1_000_000)).is_err());
}

/// Bytes that LCM's own decoders accept: the value is clear, and the deviation is counted.
#[test]
fn a_lenient_decoder_accepts_what_lcm_accepts() {
    let types = TypeSet::parse([("a.lcm", "struct a_t { boolean b; string s; int32_t n; }")]).unwrap();
    let ty = types.by_name("a_t").unwrap();
    let message = |b: u8, length: i32, text: &[u8], behind: &[u8]| {
        let bytes = [&ty.fingerprint().to_be_bytes()[..], &[b], &length.to_be_bytes(), text, &[0, 0, 0, 7], behind];
        bytes.concat()
    };
    let counts = |booleans, strings, trailing_bytes| Deviations { booleans, strings, trailing_bytes };
    let cases = [
        (message(1, 4, b"abc\0", b""), "abc", counts(0, 0, 0)),
        (message(2, 4, b"abc\0", b""), "abc", counts(1, 0, 0)),
        (message(1, 5, b"caf\xe9\0", b""), "café", counts(0, 1, 0)),
        (message(1, 3, b"abc", b""), "abc", counts(0, 1, 0)),
        (message(1, 0, b"", b""), "", counts(0, 1, 0)),
        (message(1, 4, b"abc\0", b"12"), "abc", counts(0, 0, 2)),
    ];
    for (bytes, text, expected) in cases {
        let (value, deviations) = ty.decode_lenient(&bytes).unwrap();
        assert_eq!(deviations, expected);
        assert_eq!(value.get("b").unwrap(), &Value::Boolean(true));
        assert_eq!((value.get("s").unwrap().as_str(), value.get("n").unwrap().as_i64()), (Some(text), Some(7)));
        assert_eq!(ty.decode(&bytes).is_ok(), deviations.is_none());
    }
    for bytes in
        [message(1, -1, b"abc\0", b""), message(1, 40, b"abc\0", b""), message(1, 4, b"abc\0", b"")[..20].to_vec()]
    {
        assert!(ty.decode_lenient(&bytes).is_err());
    }
}

/// A type that is missing, declared twice or invalid costs itself and the types that need it.
#[test]
fn complete_types_are_used_and_others_are_named() {
    let texts = [
        ("a.lcm", "package p; struct a_t { int32_t x; }"),
        ("again.lcm", "package p; struct a_t { int32_t x; }"),
        ("other.lcm", "package p; struct a_t { int64_t x; }"),
        ("lost.lcm", "package p; struct lost_t { gone_t x; } struct needs_t { lost_t x; } struct whole_t { a_t x; }"),
        ("notes.lcm", "Lens correction model"),
        ("loop.lcm", "struct loop_t { loop_t x; }"),
    ];
    let (types, errors) = TypeSet::parse_valid(texts);
    let names: Vec<_> = types.types().map(|ty| ty.name()).collect();
    assert_eq!(names, ["p.a_t", "p.a_t", "p.whole_t"]);
    assert_eq!(types.by_name("p.a_t").unwrap().file(), "a.lcm");
    assert!(types.types().all(|ty| types.by_fingerprint(ty.fingerprint()).is_some()));
    let texts: Vec<_> = errors.iter().map(ToString::to_string).collect();
    let files: Vec<_> = texts.iter().map(|text| text.split(':').next().unwrap()).collect();
    assert_eq!(files, ["notes.lcm", "again.lcm", "other.lcm", "lost.lcm", "lost.lcm", "loop.lcm"]);
}

/// Bytes that are a message of the set are opened by lenient walks and by `decode_opened`, and stay bytes in `decode`.
#[test]
fn messages_inside_bytes_are_opened_for_people() {
    let text = "struct inner_t { int32_t n; double v[n]; } struct box_t { int32_t size; byte data[size]; byte last; }";
    let types = TypeSet::parse([("t", text)]).unwrap();
    let inner = |v: f64| {
        let ty = types.by_name("inner_t").unwrap();
        let value =
            Value::Struct(vec![("n".into(), Value::Int32(1)), ("v".into(), Value::Array(vec![Value::Double(v)]))]);
        ty.encode(&value).unwrap()
    };
    let ty = types.by_name("box_t").unwrap();
    let boxed = |data: &[u8]| {
        let bytes = data.iter().map(|byte| Value::Byte(*byte)).collect();
        let size = Value::Int32(i32::try_from(data.len()).unwrap());
        let fields = vec![("size".into(), size), ("data".into(), Value::Array(bytes)), ("last".into(), Value::Byte(7))];
        ty.encode(&Value::Struct(fields)).unwrap()
    };
    let message = boxed(&inner(2.5));
    let (opened, deviations) = ty.decode_opened(&message).unwrap();
    assert_eq!(opened.get("data.v[0]").and_then(Value::as_f64), Some(2.5));
    assert_eq!(opened.get("last").and_then(Value::as_i64), Some(7), "what follows is read from its place");
    assert!(deviations.is_none());
    let plain = ty.decode(&message).unwrap();
    assert_eq!(plain.get("data").and_then(Value::as_array).map(<[Value]>::len), Some(20));
    assert_eq!(ty.encode(&plain).unwrap(), message);
    let found = ty.first_difference(&message, &boxed(&inner(3.0))).unwrap().unwrap();
    assert_eq!((&*found.path, found.left, found.right), ("data.v[0]", Value::Double(2.5), Value::Double(3.0)));

    // Cut, with a byte too many, or a message inside itself deeper than anybody sends: bytes.
    let mut deep = inner(1.0);
    for _ in 0..20 {
        deep = boxed(&deep);
    }
    for data in [&inner(2.5)[..19], &[&inner(2.5)[..], &[0]].concat(), b"short"] {
        let (opened, _) = ty.decode_opened(&boxed(data)).unwrap();
        assert_eq!(opened.get("data").and_then(Value::as_array).map(<[Value]>::len), Some(data.len()));
    }
    assert!(ty.decode_opened(&deep).is_ok());
}
