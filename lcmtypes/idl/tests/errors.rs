//! Broken texts: where the error is, what stands there and what should.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use lcm_idl::TypeSet;

fn message(text: &str) -> String {
    TypeSet::parse([("a.lcm", text)]).err().map_or("no error".to_owned(), |error| error.to_string())
}

#[test]
fn broken_texts() {
    let table = [
        // The file.
        ("strct a_t { }", "a.lcm:1:1: found `strct`, expected `package`, `struct`, `enum` or the end of the file"),
        (
            "struct a_t { int8_t x; }\n}",
            "a.lcm:2:1: found `}`, expected `package`, `struct`, `enum` or the end of the file",
        ),
        ("struct a_t { };", "a.lcm:1:15: found `;`, expected `package`, `struct`, `enum` or the end of the file"),
        ("package ;", "a.lcm:1:9: found `;`, expected the name of the package"),
        ("package a..b;", "a.lcm:1:9: found `a..b`, expected names with single dots between them"),
        ("package a\nstruct", "a.lcm:2:1: found `struct`, expected `;` after the name of the package"),
        ("/* a\n b", "a.lcm:1:1: found a comment without an end, expected `*/`"),
        (
            "struct a_t { int8_t x; } é",
            "a.lcm:1:26: found `é`, expected a name, a number, a comment or one of `{ } [ ] ; , =`",
        ),
        (
            "struct a_t { int8_t é; }",
            "a.lcm:1:21: found `é`, expected a name, a number, a comment or one of `{ } [ ] ; , =`",
        ),
        // Columns count characters, also behind a comment with some of several bytes.
        ("/* ééé */ struct 5", "a.lcm:1:18: found `5`, expected the name of the struct"),
        // A struct.
        ("struct int8_t { }", "a.lcm:1:8: found `int8_t`, expected the name of the struct that is not a built-in type"),
        ("struct p.a_t { }", "a.lcm:1:8: found `p.a_t`, expected the name of the struct without a dot"),
        ("struct a_t ;", "a.lcm:1:12: found `;`, expected `{` after the name of the struct"),
        ("struct a_t {", "a.lcm:1:13: found the end of the file, expected a field, `const` or `}`"),
        (
            "struct a_t {\n  enum b_t { X }\n}",
            "a.lcm:2:3: found `enum`, expected a field (types cannot be declared inside a struct)",
        ),
        ("struct a_t { 5 x; }", "a.lcm:1:14: found `5`, expected a field, `const` or `}`"),
        // Fields.
        ("struct a_t {\n  int8_t;\n}", "a.lcm:2:9: found `;`, expected the name of the field"),
        ("struct a_t { int8_t 5x; }", "a.lcm:1:21: found `5x`, expected the name of the field"),
        ("struct a_t { int8_t x }", "a.lcm:1:23: found `}`, expected `[`, `,` or `;` after the field"),
        ("struct a_t { int8_t x, }", "a.lcm:1:24: found `}`, expected the name of the field"),
        ("struct a_t { int8_t x; double x; }", "a.lcm:1:31: found `x`, expected a name that a_t does not have yet"),
        (
            "struct a_t { const int8_t x = 1; double x; }",
            "a.lcm:1:41: found `x`, expected a name that a_t does not have yet",
        ),
        (
            "package p; struct a_t { b_t x; }",
            "a.lcm:1:29: found a field of type `p.b_t`, expected a type that one of the texts declares",
        ),
        ("struct a_t { .b_t x; }", "a.lcm:1:14: found `.b_t`, expected a field, `const` or `}`"),
        ("struct a_t { p..b_t x; }", "a.lcm:1:14: found `p..b_t`, expected a type"),
        (
            "struct a_t { int x; }",
            "a.lcm:1:18: found a field of type `int`, expected a type that one of the texts declares",
        ),
        // Dimensions.
        ("struct a_t { int8_t x[]; }", DIM_BRACKET),
        (
            "struct a_t { int8_t x[0]; }",
            "a.lcm:1:23: found `0`, expected a number above 0, an integer constant or an earlier integer field",
        ),
        (
            "struct a_t { int8_t x[-1]; }",
            "a.lcm:1:23: found `-1`, expected a number above 0, an integer constant or an earlier integer field",
        ),
        (
            "struct a_t { int8_t x[09]; }",
            "a.lcm:1:23: found `09`, expected a number above 0, an integer constant or an earlier integer field",
        ),
        (
            "struct a_t { int8_t x[3000000000]; }",
            "a.lcm:1:23: found `3000000000`, expected a number above 0, an integer constant or an earlier integer field",
        ),
        (
            "struct a_t { int8_t x[n]; int8_t n; }",
            "a.lcm:1:23: found `n`, expected a number above 0, an integer constant or an earlier integer field",
        ),
        (
            "struct a_t { double n; int8_t x[n]; }",
            "a.lcm:1:33: found `n`, expected a number above 0, an integer constant or an earlier integer field",
        ),
        (
            "struct a_t { byte n; int8_t x[n]; }",
            "a.lcm:1:31: found `n`, expected a number above 0, an integer constant or an earlier integer field",
        ),
        (
            "struct a_t { int8_t n[2]; int8_t x[n]; }",
            "a.lcm:1:36: found `n`, expected a number above 0, an integer constant or an earlier integer field",
        ),
        (
            "struct a_t { const double N = 2; int8_t x[N]; }",
            "a.lcm:1:43: found `N`, expected a number above 0, an integer constant or an earlier integer field",
        ),
        (
            "struct a_t { const int8_t N = -2; int8_t x[N]; }",
            "a.lcm:1:44: found `N`, expected a number above 0, an integer constant or an earlier integer field",
        ),
        ("struct a_t { int8_t x[2; }", "a.lcm:1:24: found `;`, expected `]` after the array size"),
        // Constants.
        (
            "struct a_t { const byte X = 1; }",
            "a.lcm:1:20: found `byte`, expected int8_t, int16_t, int32_t, int64_t, float or double",
        ),
        ("struct a_t { const int8_t = 1; }", "a.lcm:1:27: found `=`, expected the name of the constant"),
        ("struct a_t { const int8_t X 1; }", "a.lcm:1:29: found `1`, expected `=` after the name of the constant"),
        ("struct a_t { const int8_t X = 128; }", "a.lcm:1:31: found `128`, expected a number that fits int8_t"),
        ("struct a_t { const int16_t X = 0x8000; }", "a.lcm:1:32: found `0x8000`, expected a number that fits int16_t"),
        ("struct a_t { const int32_t X = 1.0; }", "a.lcm:1:32: found `1.0`, expected a number that fits int32_t"),
        (
            "struct a_t { const int64_t X = 0x8000000000000000; }",
            "a.lcm:1:32: found `0x8000000000000000`, expected a number that fits int64_t",
        ),
        ("struct a_t { const int64_t X = --1; }", "a.lcm:1:32: found `-`, expected a number that fits int64_t"),
        ("struct a_t { const float X = 1e39; }", "a.lcm:1:30: found `1e39`, expected a number that fits float"),
        ("struct a_t { const double X = 1.0f; }", "a.lcm:1:31: found `1.0f`, expected a number that fits double"),
        ("struct a_t { const int8_t X = 1 }", "a.lcm:1:33: found `}`, expected `,` or `;` after the constant"),
        // Enums.
        ("enum e_t { 5 }", "a.lcm:1:12: found `5`, expected a name or `}`"),
        ("enum e_t { A = x }", "a.lcm:1:16: found `x`, expected a number that fits int32_t"),
        ("enum e_t { A = 2, B = 2 }", "a.lcm:1:19: found `B` = 2, expected a name and a value other than those of A"),
        ("enum e_t { A, A }", "a.lcm:1:15: found `A` = 2, expected a name and a value other than those of A"),
        (
            "enum e_t { A = 0x7fffffff, B }",
            "a.lcm:1:28: found `B`, expected a value (the next one does not fit int32_t)",
        ),
        ("enum e_t { A", "a.lcm:1:13: found the end of the file, expected a name or `}`"),
        // Types together.
        (
            "struct a_t { }\nenum a_t { X }",
            "a.lcm:1:8: found `a_t`, expected another name: a.lcm:2:6 declares this one",
        ),
        (
            "struct a_t { b_t b; }\nstruct b_t { a_t a[2]; }",
            "a.lcm:2:18: found a field of type `a_t`, which always holds another one, expected an array of variable length between the two",
        ),
    ];
    for (text, expected) in table {
        assert_eq!(message(text), expected, "{text}");
    }
}

const DIM_BRACKET: &str =
    "a.lcm:1:23: found `]`, expected a number above 0, an integer constant or an earlier integer field";

#[test]
fn every_prefix_of_a_text_is_parsed_or_rejected() {
    let text = include_str!("conformance/nested.lcm").to_owned() + include_str!("conformance/comments.lcm");
    for (end, _) in text.char_indices() {
        // Any result is fine, as long as it does not panic.
        let _ = TypeSet::parse([("a.lcm", &text[..end])]);
    }
}

#[test]
fn errors_name_the_file() {
    let good = "package p; struct a_t { int8_t x; }";
    let error = TypeSet::parse([("one.lcm", good), ("two.lcm", good)]).unwrap_err().to_string();
    assert_eq!(error, "two.lcm:1:19: found `p.a_t`, expected another name: one.lcm:1:19 declares this one");
}

/// Nested types take no exponential time; types nested too deeply are rejected before the stack overflows.
#[test]
fn hostile_texts_are_parsed_or_rejected_in_bounded_time() {
    use std::fmt::Write as _;
    let mut wide = String::from("struct t0 { int8_t x; }");
    let mut deep = wide.clone();
    let mut knot = String::from("struct t0 { int8_t n; t60 x[n]; }");
    for i in 1..=200 {
        let below = i - 1;
        write!(deep, "struct t{i} {{ t{below} a; }}").unwrap();
        if i <= 60 {
            write!(wide, "struct t{i} {{ t{below} a; t{below} b; }}").unwrap();
            write!(knot, "struct t{i} {{ int8_t n; t{below} a[n]; t{below} b[n]; }}").unwrap();
        }
    }
    assert!(TypeSet::parse([("a.lcm", wide.as_str())]).is_ok());
    let too_many = "which holds too many other types in each other, expected at most 128 in each other, and 1048576 ways through them";
    assert_eq!(message(&deep.replace("struct t128", "\nstruct t128")), format!("a.lcm:2:8: found t128, {too_many}"));
    // The same types, the outermost first.
    let mut reversed: Vec<&str> = deep.split_inclusive('}').collect();
    reversed.reverse();
    assert!(message(&reversed.concat()).contains(too_many));
    assert!(message(&knot).contains(too_many));
}

#[test]
fn constructs_that_lcm_gen_accepts_in_several_forms() {
    // No spaces around braces; numbers as C reads them; both separators in enums.
    let text = "struct a_t{const int32_t X=010,Y=+5,Z=-0x1F;const double D=1e+2,H=0x10;int8_t x[010];}enum e_t{A;B,C}";
    let types = TypeSet::parse([("a.lcm", text)]).unwrap();
    let def = types.by_name("a_t").unwrap().def();
    use lcm_idl::ast::ConstantValue::{Double, Int32};
    let values: Vec<_> = def.constants.iter().map(|c| c.value).collect();
    assert_eq!(values, [Int32(8), Int32(5), Int32(-31), Double(100.0), Double(16.0)]);
    assert_eq!(types.by_name("a_t").unwrap().default_value().to_string(), "{x: [0, 0, 0, 0, 0, 0, 0, 0]}");
    assert_eq!(types.enums()[0].values, [("A".into(), 1), ("B".into(), 2), ("C".into(), 3)]);
}
