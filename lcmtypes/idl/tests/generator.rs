//! The generated code itself: `UPDATE_GOLDEN=1 cargo test -p lcm-idl --test generator` writes it again, for review.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod common;

use std::fs;

use lcm_idl::{TypeSet, camel_case, generate};

#[test]
fn generated_code_is_as_committed() {
    let (path, code) = (common::folder().join("generated.rs"), generate(&common::conformance_types()));
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        fs::write(&path, &code).unwrap();
    }
    let committed = fs::read_to_string(&path).unwrap();
    assert!(committed == code, "{} differs from the generator's output", path.display());
}

#[test]
fn names_of_types_become_camel_case() {
    for (name, rust) in [
        ("robot_state_t", "RobotState"),
        ("foot_state2_t", "FootState2"),
        ("Pose", "Pose"),
        ("IMU_data", "IMUData"),
        ("_t", "T"),
        ("t", "T"),
        ("a__b_t", "AB"),
    ] {
        assert_eq!(camel_case(name), rust, "{name}");
    }
}

#[test]
fn a_comment_never_becomes_an_example_that_is_compiled() {
    let text = "// one\n//     let four = spaces;\nstruct a_t { int8_t x; }";
    let code = generate(&TypeSet::parse([("a.lcm", text)]).unwrap());
    assert!(code.contains("    /// one\n    /// let four = spaces;\n"), "{code}");
}

#[test]
fn constants_without_a_literal_in_rust_have_one_in_lcm() {
    let text = "struct a_t { const double N = nan, I = -inf; const float F = inf; }";
    let code = generate(&TypeSet::parse([("a.lcm", text)]).unwrap());
    for line in ["N: f64 = f64::NAN;", "I: f64 = f64::NEG_INFINITY;", "F: f32 = f32::INFINITY;"] {
        assert!(code.contains(line), "{line} in {code}");
    }
}
