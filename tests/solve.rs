//! `hoof solve` against solutions of an independent cascade (scripts/hierarchy_fixtures.py), on programs of a log, and on malformed files.
#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use common::{folder, hoof};
use serde_json::{Value, json};
use std::path::Path;

fn written(at: &Path, problem: &Value) -> String {
    std::fs::write(at, problem.to_string()).unwrap();
    at.display().to_string()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

/// Largest difference of residuals: quadprog and our search stop at rounding errors, so only the different treatment of λ remains.
const ALLOWED: f64 = 1e-7;

#[test]
fn hierarchies_have_the_residuals_of_an_independent_cascade() {
    let folder = folder("hierarchies");
    let cases: Vec<Value> = serde_json::from_str(include_str!("data/hierarchies.json")).unwrap();
    for (i, case) in cases.iter().enumerate() {
        let file = written(&folder.join(format!("{i}.json")), &case["problem"]);
        for options in ["", "--with clarabel", "--strategy projectors"] {
            let found = hoof(&format!("solve {file} --json {options}")).exits(0).json();
            assert_eq!((&found["status"], &found["version"]), (&json!("solved"), &json!(1)));
            assert!(found["violation"].as_f64().unwrap() < 1e-8, "{i} {options}: {found}");
            // Clarabel stops at its tolerance; it is not the solver that is tested.
            let allowed = if options.is_empty() { ALLOWED } else { 1e-4 };
            for (found, expected) in numbers(&found["residuals"]).iter().zip(numbers(&case["residuals"])) {
                assert!((found - expected).abs() < allowed, "{i} {} {options}: {found} {expected}", case["kind"]);
            }
        }
        let found = hoof(&format!("solve {file} --json")).exits(0).json();
        for (found, expected) in numbers(&found["x"]).iter().zip(numbers(&case["x"])) {
            assert!((found - expected).abs() < 1e-5, "{i} {}: {found} {expected}", case["kind"]);
        }
    }
}

/// min x² + y² subject to x + y = 2, x ≤ 0.5: (0.5, 1.5), by hand. The Hessian of ½ xᵀHx is 2 E.
#[test]
fn a_program_is_solved_by_both_back_ends() {
    let folder = folder("program");
    let problem = json!({"kind": "qp", "H": [[2.0, 0.0], [0.0, 2.0]], "g": [0.0, 0.0], "A_eq": [[1.0, 1.0]], "b_eq": [2.0],
        "C": [], "lower": [null, null], "upper": [0.5, null]});
    let file = written(&folder.join("qp.json"), &problem);
    for with in ["active_set", "clarabel"] {
        let found = hoof(&format!("solve {file} --json --with {with}")).exits(0).json();
        let x = numbers(&found["x"]);
        assert!((x[0] - 0.5).abs() < 1e-7 && (x[1] - 1.5).abs() < 1e-7, "{with}: {x:?}");
        assert!((found["objective"].as_f64().unwrap() - 2.5).abs() < 1e-6);
    }
    let mut contradicts = problem.clone();
    contradicts["upper"] = json!([0.5, 0.5]);
    let file = written(&folder.join("infeasible.json"), &contradicts);
    assert_eq!(hoof(&format!("solve {file} --json")).exits(1).json()["status"], "infeasible");
    let mut flat = problem;
    flat["H"] = json!([[2.0, 0.0], [0.0, 0.0]]);
    let file = written(&folder.join("flat.json"), &flat);
    hoof(&format!("solve {file}")).exits(2);
    assert_eq!(hoof(&format!("solve {file} --json --with clarabel")).exits(0).json()["status"], "solved");
}

#[test]
fn a_hierarchy_without_solution_says_which_level_and_constraint() {
    let folder = folder("unsolved");
    let problem = json!({"n": 2, "regularization": 1e-8, "lower": [0.0, 0.0], "upper": [1.0, null], "C": [], "c_lower": [], "c_upper": [],
        "levels": [{"A": [[1.0, 0.0]], "b": [0.25], "weight": [1.0]}, {"A": [[0.0, 1.0]], "b": [1.0], "C": [[2.0, 0.0]], "c_lower": [1.0]}]});
    let found = hoof(&format!("solve {} --json", written(&folder.join("p.json"), &problem))).exits(1).json();
    assert_eq!(found["level_status"], json!(["solved", "infeasible"]));
    assert_eq!((&found["status"], &found["contradiction"]), (&json!("infeasible"), &json!("row 0 of C")));
    assert!((numbers(&found["x"])[0] - 0.25).abs() < 1e-6);
    let limited = hoof(&format!(
        "solve {} --json --max-iterations 1",
        written(
            &folder.join("q.json"),
            &json!({"n": 3,
        "lower": [-0.1, -0.1, -0.1], "levels": [{"A": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "b": [-1, -1, -1]}]})
        )
    ));
    assert_eq!(limited.exits(1).json()["status"], "iteration_limit");
}

#[test]
fn malformed_files_name_the_key() {
    let folder = folder("malformed");
    let good = json!({"n": 2, "regularization": 1e-8, "levels": [{"A": [[1.0, 0.0]], "b": [0.25], "weight": [1.0]}]});
    hoof(&format!("solve {}", written(&folder.join("good.json"), &good))).exits(0);
    for (pointer, value, named) in [
        ("/n", json!(3), "levels[0].A[0]"),
        ("/n", json!(0), "n"),
        ("/regularization", json!(-1.0), "regularization"),
        ("/levels/0/b", json!([]), "levels[0].b"),
        ("/levels/0/b", json!([null]), "line 1"),
        ("/levels/0/weight", json!([0.0]), "levels[0].weight"),
        ("/levels/0/A", json!([[1.0, 0.0, 3.0]]), "levels[0].A[0]"),
        ("/levels", json!([]), "levels"),
    ] {
        let mut bad = good.clone();
        *bad.pointer_mut(pointer).unwrap() = value;
        let file = written(&folder.join("bad.json"), &bad);
        let ran = hoof(&format!("solve {file}")).exits(2);
        assert!(ran.stderr.contains(named) && ran.stderr.contains("bad.json"), "{pointer}: {}", ran.stderr);
    }
    for text in [
        "",
        "{",
        "[]",
        "{\"n\": 1e400}",
        "{\"n\": 1, \"levels\": [{\"A\": [[NaN]], \"b\": [0]}]}",
        "{\"n\": 1, \"further\": 2, \"levels\": []}",
    ] {
        let file = folder.join("text.json");
        std::fs::write(&file, text).unwrap();
        hoof(&format!("solve {}", file.display())).exits(2);
    }
}

/// The program of a golden log's tick, as `hoof replay --break --json` prints it, has the recorded solution.
#[test]
fn a_program_of_a_log_is_solved_again() {
    let folder = folder("of_a_log");
    let tick = hoof("replay logs/golden/flat_trot.mcap --break 1500 --json").exits(0).json();
    let program = find(&tick, "H").unwrap();
    let recorded = numbers(&find(&tick, "terms").unwrap()["x"]);
    let file = written(&folder.join("program.json"), program);
    let found = hoof(&format!("solve {file} --json")).exits(0).json();
    assert_eq!(numbers(&found["x"]), recorded);
}

/// The first object with a key.
fn find<'a>(value: &'a Value, key: &str) -> Option<&'a Value> {
    match value {
        Value::Object(map) if map.contains_key(key) => Some(value),
        Value::Object(map) => map.values().find_map(|value| find(value, key)),
        Value::Array(values) => values.iter().find_map(|value| find(value, key)),
        _ => None,
    }
}
